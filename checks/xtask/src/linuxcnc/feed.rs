//! The feed that joints allow: the component's pins again on the host, and a way at a feed that is too much for a screw.

use pkm_core::five_axis::{JointMotion, ToolMotion};
use pkm_core::nalgebra::{Vector2, Vector5};
use pkm_core::{Configuration, FiveAxis, Tool};
use serde_json::Value;

use super::in_file_units;
use super::replay::{DEG, Host, PERIOD_NS, Row, held, joints_of, worst};
use crate::Outcome;

const PERIOD_S: f64 = PERIOD_NS / 1e9;
/// Of the way on which a screw is too fast, mm/s.
pub const FEED_MM_PER_S: f64 = 30.0;
/// Of the configuration: mm/s and mm/s² of a screw, °/s and °/s² of the wrist, and the greatest override.
const SCREW: [f64; 2] = [120.0, 1000.0];
const WRIST: [f64; 2] = [40.0, 400.0];
const OVERRIDE: f64 = 1.2;
/// The component's: a tip that is slower than the first stays; below the second no curve is known. mm/s, the latter °/s too.
const STAYS: f64 = 1e-6;
const SLOW: f64 = 0.1;

/// Half the velocity that the fastest screw has on the straight ways from place to place, at the feed. mm/s.
pub fn slow_screw_mm_per_s(five: &FiveAxis<'_, f64>, from: &[f64], places: &[Vec<f64>]) -> Result<f64, String> {
    const STEPS: usize = 200;
    let mut fastest = 0.0_f64;
    let mut from = from;
    for to in places {
        let way_mm = (0..3).map(|i| (to[i] - from[i]).powi(2)).sum::<f64>().sqrt();
        let at = |step: usize| {
            let share = step as f64 / STEPS as f64;
            let axes: Vec<f64> = from.iter().zip(to).map(|(a, b)| a + share * (b - a)).collect();
            held(five, &axes).map(|solution| in_file_units(&solution.joints))
        };
        for step in 0..STEPS {
            let moved = worst(&at(step + 1)?[..3], &at(step)?[..3]);
            fastest = fastest.max(moved * STEPS as f64 / way_mm * FEED_MM_PER_S);
        }
        from = to;
    }
    Ok(fastest / 2.0)
}

/// The component with its state beside the component's.
#[derive(Default)]
pub struct Feed {
    places: Vec<(Configuration<f64>, Tool<f64>)>,
    commands: Vec<Vec<f64>>,
    /// Joints by the way, first and second derivative, SI by mm or °.
    by_way: Option<JointMotion<f64>>,
    /// Greatest differences from the pins: velocities, accelerations, share.
    worst: [f64; 3],
    /// Of velocities and accelerations from plain differences of the joints' commands, as a share of these and 1 in the pins' units.
    from_commands: [f64; 2],
    /// Periods in which a joint was faster than 1 mm/s or °/s.
    moving: usize,
}

/// Two moments a period apart and the one between: first and second time derivative.
fn derivatives<V>(three: [V; 3]) -> (V, V)
where
    V: Copy + std::ops::Sub<Output = V> + std::ops::Add<Output = V> + std::ops::Div<f64, Output = V>,
{
    let [a, b, c] = three;
    ((c - a) / (2.0 * PERIOD_S), (c - b - b + a) / (PERIOD_S * PERIOD_S))
}

impl Feed {
    /// How the joints moved in the middle one of the last three periods, and how the tool.
    fn motion(&mut self, five: &FiveAxis<'_, f64>, row: &Row<'_>) -> Option<(ToolMotion<f64>, JointMotion<f64>)> {
        let Ok(place) = five.forward(&joints_of(row.joints)) else {
            self.places.clear();
            self.commands.clear();
            return None;
        };
        if self.places.len() == 3 {
            self.places.remove(0);
            self.commands.remove(0);
        }
        self.places.push(place);
        self.commands.push(row.joints.to_vec());
        let &[(_, a), (stands, b), (_, c)] = self.places.as_slice() else { return None };
        let (tip_m_per_s, tip_m_per_s2) = derivatives([a.tip_m, b.tip_m, c.tip_m]);
        let (axis_per_s, axis_per_s2) = derivatives([a.axis, b.axis, c.axis]);
        let tool = ToolMotion { tip_m_per_s, axis_per_s, tip_m_per_s2, axis_per_s2 };
        five.joint_motion(&stands, &tool).ok().map(|joints| (tool, joints))
    }

    /// A period.
    pub fn take(&mut self, host: &Host, row: &Row<'_>, screw_mm_per_s: Option<f64>) -> Outcome {
        let found = self.motion(&host.five()?, row);
        if found.is_some() != row.feed_ok() {
            return Err(format!("joint motion or none: the component has {}", row.feed_ok()));
        }
        if let Some((tool, joints)) = found {
            let [velocity, acceleration] = [joints.velocity, joints.acceleration].map(|v| in_units(&v));
            keep(&mut self.worst[0], worst(row.velocity, &velocity));
            keep(&mut self.worst[1], worst(row.acceleration, &acceleration));
            let commands: Vec<Vector5<f64>> = self.commands.iter().map(|c| Vector5::from_column_slice(c)).collect();
            let (v, a) = derivatives([commands[0], commands[1], commands[2]]);
            for (i, (pins, plain)) in [(row.velocity, v), (row.acceleration, a)].into_iter().enumerate() {
                keep(&mut self.from_commands[i], worst(pins, plain.as_slice()) / (1.0 + plain.amax()));
            }
            self.take_way(&tool, &joints);
            self.moving += usize::from(velocity.iter().any(|v| v.abs() > 1.0));
        }
        let feed = row.requested * if screw_mm_per_s.is_some() { 1.0 } else { OVERRIDE };
        let all = |screw: f64, turn: f64| Vector5::new(screw / 1e3, screw / 1e3, screw / 1e3, turn / DEG, turn / DEG);
        let share = self.by_way.map_or(1.0, |by_way| {
            let at_feed =
                JointMotion { velocity: by_way.velocity * feed, acceleration: by_way.acceleration * feed * feed };
            at_feed.feed_share(&all(screw_mm_per_s.unwrap_or(SCREW[0]), WRIST[0]), &all(SCREW[1], WRIST[1]))
        });
        keep(&mut self.worst[2], (share - row.feed_share).abs());
        Ok(())
    }

    pub fn print(&self) {
        let ([v, a, share], [from_v, from_a]) = (self.worst, self.from_commands);
        println!(
            "  joints moved in {} periods; velocities {v:.1e} mm/s or degrees/s from the host's, accelerations {a:.1e}, the share of the \
             feed {share:.1e}; from plain differences of the commands {from_v:.1e} and {from_a:.1e} of these",
            self.moving
        );
    }

    /// Whether the component's numbers are the host's, and those of the joints' commands by themselves.
    pub fn holds(&self) -> bool {
        let [v, a, share] = self.worst;
        let same = v <= 1e-8 && a <= 1e-4 && share <= 1e-8;
        same && self.from_commands.iter().all(|d| *d <= 3e-3) && self.moving >= 5000
    }

    /// q' = q̇/ṡ and q'' = (q̈ − q' s̈)/ṡ², with s the way of the tip, or the turn of the wrist where the tip stays.
    fn take_way(&mut self, tool: &ToolMotion<f64>, joints: &JointMotion<f64>) {
        let turns = |v: &Vector5<f64>| Vector2::new(v[3], v[4]);
        let (turn, turn_gain) = (turns(&joints.velocity), turns(&joints.acceleration));
        let tip = tool.tip_m_per_s;
        let (speed, gain) = if tip.norm() * 1e3 > STAYS {
            (tip.norm() * 1e3, tip.dot(&tool.tip_m_per_s2) / tip.norm_squared())
        } else {
            (turn.norm() * DEG, turn.dot(&turn_gain) / turn.norm_squared())
        };
        if speed >= SLOW {
            let velocity = joints.velocity / speed;
            let acceleration = (joints.acceleration - joints.velocity * gain) / (speed * speed);
            self.by_way = Some(JointMotion { velocity, acceleration });
        } else if let Some(by_way) = &mut self.by_way {
            by_way.acceleration = Vector5::zeros();
        }
    }
}

fn keep(worst: &mut f64, d: f64) {
    *worst = if d > *worst || d.is_nan() { d } else { *worst };
}

fn in_units(v: &Vector5<f64>) -> [f64; 5] {
    std::array::from_fn(|i| if i < 3 { v[i] * 1e3 } else { v[i] * DEG })
}

/// One run over the ways: the fastest that a screw's command was, and at each place, as the tip's way in mm, the share.
struct Run {
    fastest: f64,
    seconds: f64,
    ways: Vec<Vec<[f64; 2]>>,
}

/// Rows of the script's step, and the limit of the screws that holds there.
pub fn during(verdict: &Value) -> Result<(Vec<usize>, f64), String> {
    let steps = verdict["steps"].as_array().ok_or("no steps")?;
    let step = steps.iter().find(|step| step["step"] == "feed").ok_or("no step feed")?;
    let rows = step["rows"].as_array().map(|rows| rows.iter().filter_map(Value::as_u64).map(|n| n as usize).collect());
    Ok((rows.ok_or("feed: no rows")?, step["slow_screw_mm_per_s"].as_f64().ok_or("feed: no limit")?))
}

/// Twice the same ways: without the share a screw exceeds its limit, with it none does, and both times the share is the same at the
/// same place, whether it acts or not.
pub fn judge(host: &Host, verdict: &Value, rows: &[Vec<f64>]) -> Outcome {
    let (noted, limit) = during(verdict)?;
    let five = host.five()?;
    let run = |noted: &[usize]| -> Result<Run, String> {
        let mut run = Run { fastest: 0.0, seconds: 0.0, ways: Vec::new() };
        for leg in noted.windows(2) {
            let rows: Vec<Row<'_>> =
                rows.get(leg[0]..leg[1]).ok_or("feed: rows are missing")?.iter().map(|r| Row::of(r)).collect();
            let tips: Result<Vec<_>, String> = rows
                .iter()
                .map(|r| {
                    five.forward(&joints_of(r.joints)).map(|(_, tool)| tool.tip_m * 1e3).map_err(|e| e.to_string())
                })
                .collect();
            let tips = tips?;
            let mut way = Vec::new();
            for n in 2..rows.len() {
                run.fastest = run.fastest.max(worst(&rows[n].joints[..3], &rows[n - 1].joints[..3]) / PERIOD_S);
                let speed = (tips[n] - tips[n - 2]).norm() / (2.0 * PERIOD_S);
                run.seconds += if speed > SLOW { PERIOD_S } else { 0.0 };
                // pins are those of the period before
                if speed > 1.0 && rows[n].requested > 0.0 {
                    way.push([(tips[n - 1] - tips[0]).norm(), rows[n].feed_share]);
                }
            }
            run.ways.push(way);
        }
        Ok(run)
    };
    let middle = noted.len() / 2;
    let (without, with) = (run(&noted[..=middle])?, run(&noted[middle..])?);
    let (mut apart, mut compared) = (0.0_f64, 0);
    for (free, held) in without.ways.iter().zip(&with.ways) {
        for [at, share] in held {
            let Some(pair) = free.windows(2).find(|pair| pair[0][0] <= *at && *at <= pair[1][0]) else { continue };
            let [[from, a], [to, b]] = [pair[0], pair[1]];
            let there = if to > from { a + (b - a) * (at - from) / (to - from) } else { a };
            apart = apart.max((there - share).abs());
            compared += 1;
        }
    }
    let least = with.ways.iter().flatten().map(|[_, share]| *share).fold(1.0, f64::min);
    println!(
        "  a way at {FEED_MM_PER_S} mm/s, limit of a screw {limit:.2} mm/s: {:.2} mm/s in {:.1} s without the share, {:.2} mm/s in {:.1} s \
         with it; least share {least:.3}; at the same place the two shares are {apart:.1e} apart ({compared} places)",
        without.fastest, without.seconds, with.fastest, with.seconds
    );
    for (holds, what) in [
        (without.fastest >= 1.5 * limit, "no screw would be too fast: nothing was tested"),
        (with.fastest <= 1.01 * limit, "a screw is too fast for all its share"),
        (with.fastest >= 0.98 * limit, "the share holds the feed back more than the screws ask"),
        (compared >= 500 && apart <= 1e-3, "the share depends on whether it acts"),
    ] {
        if !holds {
            return Err(format!("feed: {what}"));
        }
    }
    Ok(())
}

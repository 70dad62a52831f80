//! What would hurt a machine, done to a simulated one, and the reaction that is expected.

use pkm_core::compensator::{Compensator, CompensatorSettings, Reading};
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::{Configuration, FiveAxis, Model, Pose};
use serde_json::Value;

use super::in_file_units;
use super::replay::{Host, Row, SMALL_SCREW_MM, joints_of, settings, worst, wrench_of};
use crate::Outcome;

/// A place nearer to the singularity locus than the margin, from which a straight way leads home.
pub struct Parked {
    /// mm and degrees.
    pub joints: [f64; 5],
    /// X Y Z A B of a place nearer to the locus still.
    pub inward: [f64; 5],
}

/// Home's platform with the wrist turned into the margin, as an operator can jog it joint by joint.
pub fn parked_inside_the_margin(
    five: &FiveAxis<'_, f64>,
    home: Configuration<f64>,
    home_axes: [f64; 5],
    margin: f64,
) -> Option<Parked> {
    let place = |beta_rad: Vector2<f64>| {
        let configuration = Configuration { beta_rad, ..home };
        let [x, y, z] = (five.tool(&configuration).ok()?.tip_m * 1e3).into();
        Some((
            [x, y, z, beta_rad[0].to_degrees(), beta_rad[1].to_degrees()],
            five.normalised_determinant(&configuration).ok()?,
        ))
    };
    let share = |axes: [f64; 5]| {
        let [x, y, z, a, b] = axes;
        let solution = five.inverse_at_any_margin(Vector3::new(x, y, z) / 1e3, Vector2::new(a, b).map(f64::to_radians));
        solution.ok().map(|solution| solution.normalised_determinant)
    };
    let leads_out = |from: [f64; 5]| {
        let mut last = share(from)?;
        for step in 1..=1000 {
            let way = f64::from(step) / 1000.0;
            let next = share(std::array::from_fn(|i| from[i] + way * (home_axes[i] - from[i])))?;
            if next < last && next < 1.2 * margin {
                return None;
            }
            last = next;
        }
        Some(())
    };
    let turns = || (-160..=160).map(|i| 0.5 * f64::from(i));
    let mut all = turns().flat_map(|b| (-8..=8).map(move |a| [10.0 * f64::from(a), b]));
    all.find_map(|turned| {
        let beta_rad = Vector2::from(turned).map(f64::to_radians);
        let (axes, here) = place(beta_rad)?;
        let inside = here > 0.4 * margin && here < 0.8 * margin;
        if !inside {
            return None;
        }
        leads_out(axes)?;
        let joints = in_file_units(&five.joints(&Configuration { beta_rad, ..home }).ok()?);
        // a degree nearer
        let inward = [-1.0, 1.0].into_iter().find_map(|d| {
            let (axes, share) = place(Vector2::new(turned[0], turned[1] + d).map(f64::to_radians))?;
            (share > 0.0 && share < here).then_some(axes)
        })?;
        Some(Parked { joints, inward })
    })
}

/// X Y Z A B with home's platform 5 mm beyond the table's box: mm and degrees.
pub fn outside_the_box(host: &Host) -> Option<[f64; 5]> {
    let five = host.five().ok()?;
    let ([theta_rad, sigma_rad, z0_m], [.., half_m]) = (host.table.centre, host.table.half_width);
    let beyond_m = half_m + 5e-3;
    [z0_m + beyond_m, z0_m - beyond_m].into_iter().find_map(|z0_m| {
        let pose = Pose { theta_rad, sigma_rad, z0_m };
        let tool = five.tool(&Configuration { pose, beta_rad: Vector2::zeros() }).ok()?;
        let [x, y, z] = (tool.tip_m * 1e3).into();
        Some([x, y, z, 0.0, 0.0])
    })
}

/// Where the offset is at the end of a fault.
enum End {
    Zero,
    Same,
    /// Another way, by half of what it was and more: one component of six is reversed.
    Other,
}

/// What the script did, by the rows of the recorder that it noted.
struct Steps<'a> {
    verdict: &'a Value,
    rows: &'a [Vec<f64>],
}

impl<'a> Steps<'a> {
    /// The rows between the notes `from` and `from` + 1 of a step.
    fn rows(&self, name: &str, from: usize) -> Result<Vec<Row<'a>>, String> {
        let steps = self.verdict["steps"].as_array().ok_or("no steps")?;
        let noted = steps.iter().find(|step| step["step"] == name).ok_or_else(|| format!("no step {name}"))?;
        let at = |i: usize| noted["rows"][i].as_u64().map(|n| n as usize);
        let span = at(from).zip(at(from + 1)).and_then(|(from, to)| self.rows.get(from..to));
        let span = span.filter(|span| span.len() > 100).ok_or_else(|| format!("{name}: the rows are missing"))?;
        Ok(span.iter().map(|row| Row::of(row)).collect())
    }
}

/// Smaller offsets are none, mm and degrees.
const NOTHING: f64 = 1e-4;

fn size(values: &[f64]) -> f64 {
    worst(values, &[0.0; 5])
}

/// Holds the recorded periods against the reactions that are expected.
pub fn judge_faults(host: &Host, verdict: &Value, rows: &[Vec<f64>]) -> Outcome {
    let steps = Steps { verdict, rows };
    always(rows)?;
    let reactions = [
        ("nan", 80.0, End::Zero),
        ("spike", 81.0, End::Zero),
        ("reversed", 0.0, End::Other),
        ("skipped", 0.0, End::Other),
        ("temperature", 83.0, End::Same),
        ("jump", 83.0, End::Same),
        ("outside", 84.0, End::Zero),
    ];
    for (name, code, expected) in reactions {
        let (during, after) = (steps.rows(name, 0)?, steps.rows(name, 1)?);
        let [first, last, end] = [&during[0], &during[during.len() - 1], &after[after.len() - 1]];
        let seen = during.iter().any(|row| row.fault() == code);
        let apart = worst(last.offsets, first.offsets);
        let ends = match expected {
            End::Zero => size(last.offsets) == 0.0,
            End::Same => apart <= NOTHING,
            End::Other => last.fault() == 0.0 && apart > 0.5 * size(first.offsets),
        };
        let back = worst(end.offsets, first.offsets);
        if !(seen && ends && size(first.offsets) > NOTHING && back <= NOTHING && end.fault() == 0.0) {
            let found = format!("{apart:e} from the offset before, {back:e} apart afterwards");
            return Err(format!("{name}: expected fault {code}, its reaction, and the offset again: {found}"));
        }
    }
    let during = steps.rows("stuck", 0)?;
    let most = during.iter().map(|row| size(row.offsets)).fold(0.0, f64::max);
    let last = &during[during.len() - 1];
    if !(most > NOTHING && last.fault() == 82.0 && size(last.offsets) == 0.0) {
        return Err(format!("stuck: expected fault 82 and no offset, found {} and {:?}", last.fault(), last.offsets));
    }
    one_joint_at_its_limit(host, &steps.rows("small", 0)?)?;
    forgotten(&steps.rows("abort", 0)?)?;
    homed_again_under_load(&steps.rows("rehome", 0)?)?;
    let during = steps.rows("sag", 0)?;
    let first = &during[0];
    let moved = during.iter().map(|row| worst(row.command, first.command)).fold(0.0, f64::max);
    let sagged = during.iter().map(|row| (row.stands[2] - first.stands[2]).abs()).fold(0.0, f64::max);
    if !(moved == 0.0 && sagged > 0.009 && sagged < 0.011) {
        return Err(format!("sag: the command moved by {moved:e} mm when a drive sagged by {sagged:e} mm"));
    }
    println!("  faults: each with its reaction; a drive that sagged by {sagged:.3} mm moved no command");
    Ok(())
}

/// In every period: no step above the rate limit, no offset above the largest, and none that grows while the machine is not homed
/// and on.
fn always(rows: &[Vec<f64>]) -> Outcome {
    let CompensatorSettings { period_s, max_screw_m, max_wrist_rad, screw_rate_m_per_s, wrist_rate_rad_per_s, .. } =
        settings(0);
    let rounding = 1e-9;
    for (n, pair) in rows.windows(2).enumerate() {
        let [before, row] = [&pair[0], &pair[1]].map(|row| Row::of(row));
        for i in 0..5 {
            let (largest, rate) = if i < 3 {
                (max_screw_m * 1e3, screw_rate_m_per_s * 1e3)
            } else {
                (max_wrist_rad.to_degrees(), wrist_rate_rad_per_s.to_degrees())
            };
            let (from, to) = (before.offsets[i], row.offsets[i]);
            let grows = !row.enabled() && to.abs() > from.abs();
            let within = to.abs() <= largest + rounding && (to - from).abs() <= rate * period_s + rounding;
            if grows || !within {
                return Err(format!("period {n}: offset {i} went from {from:e} to {to:e}, enabled {}", row.enabled()));
            }
        }
    }
    Ok(())
}

/// The tip stays on the line from its unloaded to its compensated place while a screw has its largest offset.
fn one_joint_at_its_limit(host: &Host, during: &[Row<'_>]) -> Outcome {
    let (five, table) = (host.five()?, host.table()?);
    let row = during.last().ok_or("no rows")?;
    // on the straight way of the tip it is a little short of it
    if row.limit() != 1.0 || row.offsets[..3].iter().all(|offset| offset.abs() < 0.99 * SMALL_SCREW_MM) {
        return Err(format!("small: expected a screw at its largest offset: {:?}", row.offsets));
    }
    let tip = |offsets: &[f64]| {
        let joints: Vec<f64> = row.stands.iter().zip(offsets).map(|(at, offset)| at + offset).collect();
        five.forward(&joints_of(&joints)).map(|(_, tool)| tool.tip_m).map_err(|e| e.to_string())
    };
    // without limits: what the same load asks for when it has acted for long
    let free = CompensatorSettings { max_screw_m: 0.01, ..settings(0) };
    let mut compensator = Compensator::<f64, 5>::new(&free).map_err(|e| e.to_string())?;
    let (stands, _) = five.forward(&joints_of(row.stands)).map_err(|e| e.to_string())?;
    let wrench = wrench_of(row.wrench)?;
    let (model, reading) = (Model::new(five.machine, &table), Reading { enabled: true, wrench, rise: 0.0.into() });
    for _ in 0..2000 {
        compensator.update(&model, five.wrist, &stands, &reading);
    }
    let [a, b, c, d, e] = compensator.joints().into();
    let asked = [a * 1e3, b * 1e3, c * 1e3, d.to_degrees(), e.to_degrees()];
    let from = tip(&[0.0; 5])?;
    let way = tip(&asked)? - from;
    let off_line_um = |offsets: &[f64]| {
        let moved = tip(offsets)? - from;
        let off = moved - way * (moved.dot(&way) / way.norm_squared());
        Ok::<_, String>(1e6 * off.norm())
    };
    let clamped: Vec<f64> =
        (0..5).map(|i| if i < 3 { asked[i].clamp(-SMALL_SCREW_MM, SMALL_SCREW_MM) } else { asked[i] }).collect();
    let (whole, each) = (off_line_um(row.offsets)?, off_line_um(&clamped)?);
    println!(
        "  a screw at its largest offset of {:.0} um: tip {whole:.4} um off its line; joints limited alone: {each:.2} um",
        1e3 * SMALL_SCREW_MM
    );
    if whole <= 1.0 && each > 1.0 { Ok(()) } else { Err("small: the tip left its line, or nothing was tested".into()) }
}

/// A load that a program had set when it was aborted is gone, and its offset.
fn forgotten(during: &[Row<'_>]) -> Outcome {
    let (first, last) = (&during[0], &during[during.len() - 1]);
    let acted = size(first.wrench) > 0.0 && size(first.offsets) > NOTHING;
    println!(
        "  a program aborted under a load of {:.0} N: {:.0} N half a second later",
        size(first.wrench),
        size(last.wrench)
    );
    // where the platform is tilted no load leaves the rounding of the inverse kinematics
    if acted && size(last.wrench) == 0.0 && size(last.offsets) <= 1e-9 {
        return Ok(());
    }
    let [from, to] = [first, last].map(|row| size(row.offsets));
    Err(format!(
        "abort: expected a load that is forgotten, and no offset: it went from {from:e} to {to:e} mm or degrees"
    ))
}

/// A load that is left on: its offset goes while the machine is homed again, and is not taken into home.
fn homed_again_under_load(during: &[Row<'_>]) -> Outcome {
    let (first, last) = (&during[0], &during[during.len() - 1]);
    let load_stays = during.iter().all(|row| row.wrench == first.wrench) && size(first.wrench) > 0.0;
    let had_offset = size(first.offsets) > NOTHING;
    let homing = during.iter().filter(|row| !row.homed()).count();
    let least = during.iter().map(|row| size(row.offsets)).fold(f64::INFINITY, f64::min);
    let latched = worst(first.motor_offset, last.motor_offset);
    println!(
        "  homed again under a load of {:.0} N: {homing} periods not homed, the offset went from {:.2} to {:.2} um, {latched:.1e} mm \
         taken into home",
        size(first.wrench),
        1e3 * size(first.offsets),
        1e3 * least
    );
    if load_stays && had_offset && homing > 0 && least < size(first.offsets) && latched <= 1e-9 {
        Ok(())
    } else {
        Err("rehome: expected an offset that goes, and a home without it".into())
    }
}

//! Every period of a simulation again on the host: kinematics, stiffness, deflection, and the compensator with its state.

use std::hint::black_box;
use std::ops::Range;
use std::time::Instant;

use pkm_core::compensator::{Compensator, CompensatorSettings, Limit, Offset, Reading};
use pkm_core::nalgebra::{SVector, Vector2, Vector3};
use pkm_core::{
    CompensatedTool, Configuration, Corrected, CorrectionTable, Domain, FiveAxis, JointValues, Model, Pose,
    ScrewLengths, TemperatureRise, Tool, ToolSolution, Wrench,
};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::table_numbers::TableNumbers;

use super::feed::Feed;
use super::in_file_units;
use crate::Outcome;
use crate::c::compensator::number;

/// A row of the recorder: times of the thread on the wall's and on the processor's clock and of the compensation, real pins,
/// flags, whole numbers.
const REALS: usize = 3;
const FLAGS: usize = REALS + 99;
const WHOLE: usize = FLAGS + 5;
pub const ROW: usize = WHOLE + 6;

/// Real pins of a row.
pub struct Row<'a> {
    all: &'a [f64],
    pub asked: &'a [f64],
    pub given: &'a [f64],
    pub felt: &'a [f64],
    pub placed: &'a [f64],
    /// Where the joints stand without the offsets, mm and degrees.
    pub stands: &'a [f64],
    pub wrench: &'a [f64],
    pub offsets: &'a [f64],
    pub moved: &'a [f64],
    pub margins: &'a [f64],
    pub target_share: f64,
    /// What motmod commands the motors.
    pub command: &'a [f64],
    pub drive: &'a [f64],
    pub motor_offset: &'a [f64],
    rise: TemperatureRise<f64>,
    /// What motmod commands the joints, how fast they move by the component, and the share of the programmed feed that it allows.
    pub joints: &'a [f64],
    pub velocity: &'a [f64],
    pub acceleration: &'a [f64],
    pub feed_share: f64,
    pub requested: f64,
    pub k: &'a [f64],
}

impl<'a> Row<'a> {
    pub fn of(all: &'a [f64]) -> Self {
        let mut next = REALS;
        let mut take = |n: usize| {
            next += n;
            &all[next - n..next]
        };
        let (asked, given, felt, placed) = (take(5), take(5), take(5), take(5));
        let (stands, wrench, offsets, moved) = (take(5), take(6), take(5), take(6));
        let (margins, target_share, command) = (take(3), take(1)[0], take(5));
        let (drive, motor_offset) = (take(5), take(3));
        let mut rise = TemperatureRise::from(take(1)[0]);
        rise.limbs_k[1] = take(1)[0];
        let (joints, velocity, acceleration) = (take(5), take(5), take(5));
        let (feed_share, requested, k) = (take(1)[0], take(1)[0], take(21));
        Self {
            all,
            asked,
            given,
            felt,
            placed,
            stands,
            wrench,
            offsets,
            moved,
            margins,
            target_share,
            command,
            drive,
            motor_offset,
            rise,
            joints,
            velocity,
            acceleration,
            feed_share,
            requested,
            k,
        }
    }

    fn flag(&self, i: usize) -> bool {
        self.all[FLAGS + i] == 1.0
    }

    /// What the inverse was asked for, once it was.
    fn target(&self) -> Option<&[f64]> {
        (self.asked != [0.0; 5]).then_some(self.asked)
    }

    /// The machine is homed and on.
    pub fn enabled(&self) -> bool {
        self.flag(2)
    }

    pub fn homed(&self) -> bool {
        self.flag(3)
    }

    /// Joint velocities and accelerations are of the period before.
    pub fn feed_ok(&self) -> bool {
        self.flag(4)
    }

    pub fn fault(&self) -> f64 {
        self.all[WHOLE + 3]
    }

    pub fn limit(&self) -> f64 {
        self.all[WHOLE + 4]
    }

    /// Which settings the script has chosen.
    fn phase(&self) -> usize {
        self.all[WHOLE + 5] as usize
    }
}

pub fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, |worst, d| if d > worst || d.is_nan() { d } else { worst })
}

/// The host's side: from the machine file and `coefficients.json`, not from generated source.
pub struct Host {
    pub machine: MachineFile,
    pub table: TableNumbers,
}

impl Host {
    pub fn five(&self) -> Result<FiveAxis<'_, f64>, String> {
        self.machine.five_axis().map_err(|e| e.to_string())
    }

    pub fn table(&self) -> Result<CorrectionTable<'_, f64>, String> {
        self.table.table().map_err(|e| e.to_string())
    }
}

/// X Y Z A B in mm and degrees, held.
pub fn held(five: &FiveAxis<'_, f64>, axes: &[f64]) -> Result<ToolSolution<f64>, String> {
    let [x, y, z, a, b] = axes.try_into().map_err(|_| "expected five axes")?;
    let (tip_m, beta_rad) = (Vector3::new(x, y, z) / 1e3, Vector2::new(a, b).map(f64::to_radians));
    five.inverse_at(tip_m, beta_rad).map_err(|e| e.to_string())
}

pub fn joints_of(values: &[f64]) -> JointValues<f64> {
    let at = |i: usize| values.get(i).copied().unwrap_or(f64::NAN);
    JointValues {
        lengths: ScrewLengths { q_m: Vector3::new(at(0), at(1), at(2)) / 1e3 },
        beta_rad: Vector2::new(at(3), at(4)).map(f64::to_radians),
    }
}

pub fn wrench_of(components: &[f64]) -> Result<Wrench<f64>, String> {
    let components = <[f64; 6]>::try_from(components).map_err(|_| "a wrench is six numbers")?;
    Ok(Wrench::from_vector(components.into()))
}

/// Median, 99.9 % and greatest.
pub fn spread(values: impl Iterator<Item = f64>) -> [f64; 3] {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    let at = |share: f64| values.get(((values.len().max(1) - 1) as f64 * share) as usize).copied().unwrap_or(f64::NAN);
    [at(0.5), at(0.999), at(1.0)]
}

/// Settings of a phase of the script, as `pkm.hal` and the script have them.
pub fn settings(phase: usize) -> CompensatorSettings {
    let default = CompensatorSettings::DEFAULT;
    // the component has them in mm and degrees
    let max_wrist_rad = default.max_wrist_rad * DEG / DEG;
    let wrist_rate_rad_per_s = default.wrist_rate_rad_per_s * DEG / DEG;
    let plain = CompensatorSettings { gain: 1.0, stuck_s: 0.0, max_wrist_rad, wrist_rate_rad_per_s, ..default };
    match phase {
        1 => CompensatorSettings { stuck_s: STUCK_S, ..plain },
        2 => CompensatorSettings { max_screw_m: SMALL_SCREW_MM / 1e3, ..plain },
        _ => plain,
    }
}

pub const DEG: f64 = 180.0 / std::f64::consts::PI;
/// Of phase 1.
pub const STUCK_S: f64 = 0.5;
/// Largest offset of a screw in phase 2.
pub const SMALL_SCREW_MM: f64 = 0.004;

/// The compensator beside the component's.
struct Compensation {
    compensator: Compensator<f64, 5>,
    phase: usize,
    was_on: bool,
}

impl Compensation {
    fn new() -> Result<Self, String> {
        let compensator = Compensator::new(&settings(0)).map_err(|e| e.to_string())?;
        Ok(Self { compensator, phase: 0, was_on: false })
    }

    /// A period. Returns the offsets, mm and degrees, and an error when limit or fault are not the component's.
    fn update(
        &mut self,
        five: &FiveAxis<'_, f64>,
        table: &CorrectionTable<'_, f64>,
        row: &Row<'_>,
        stands: Result<Configuration<f64>, String>,
        wrench: Wrench<f64>,
    ) -> Result<[f64; 5], String> {
        let at_rest = !self.was_on && self.compensator.joints() == SVector::<f64, 5>::zeros();
        if at_rest && row.phase() != self.phase {
            self.phase = row.phase();
            self.compensator = Compensator::new(&settings(self.phase)).map_err(|e| e.to_string())?;
        }
        self.was_on = row.enabled();
        let pose = Pose { theta_rad: f64::NAN, sigma_rad: 0.0, z0_m: 0.0 };
        let nowhere = Configuration { pose, beta_rad: Vector2::zeros() };
        let reading = Reading { enabled: self.was_on, wrench, rise: row.rise };
        let known = stands.is_ok();
        let model = Model::new(five.machine, table);
        let Offset { joints, limit, fault, .. } =
            self.compensator.update(&model, five.wrist, &stands.unwrap_or(nowhere), &reading);
        let limit = [Limit::None, Limit::Size, Limit::Rate].iter().position(|l| *l == limit).map(|l| l as f64);
        // the number of what the kinematics refuse is their own
        let same_fault = match number(fault) {
            _ if row.enabled() && !known => row.fault() != 0.0,
            Ok(number) => row.fault() == f64::from(number),
            Err(_) => row.fault() != 0.0,
        };
        if limit != Some(row.limit()) || !same_fault {
            return Err(format!(
                "the host's compensator has limit {limit:?} and fault {fault:?}, the component {} and {}",
                row.limit(),
                row.fault()
            ));
        }
        let [a, b, c, d, e] = joints.into();
        Ok([a * 1e3, b * 1e3, c * 1e3, d.to_degrees(), e.to_degrees()])
    }
}

struct Computed {
    tool: Tool<f64>,
    stiffness: Corrected<f64>,
    wanted: CompensatedTool<f64>,
}

/// What the component computes in a period without a state.
fn component(
    five: &FiveAxis<'_, f64>,
    table: &CorrectionTable<'_, f64>,
    stands: &[f64],
    force: &Wrench<f64>,
) -> Result<Computed, String> {
    let (stood, tool) = five.forward(&joints_of(stands)).map_err(|e| e.to_string())?;
    let stiffness = table.factor_form(five.machine, &stood.pose).map_err(|e| e.to_string())?;
    let wanted = five.compensated(Some(table), &tool, force, &stood).map_err(|e| e.to_string())?;
    Ok(Computed { tool, stiffness, wanted })
}

/// Of the configuration.
pub const PERIOD_NS: f64 = 1e6;

fn keep(worst: &mut f64, d: f64) {
    *worst = if d > *worst || d.is_nan() { d } else { *worst };
}

/// What periods showed.
#[derive(Default)]
struct Seen {
    /// Greatest differences from the host: joints and axes, mm and degrees.
    inverse: f64,
    forward: f64,
    offsets: f64,
    /// um, urad, and shares of the distances from singularities.
    deflection: f64,
    /// Relative to the diagonal.
    stiffness: f64,
    /// Furthest that a joint's command moved in a period.
    jump: f64,
    valid: usize,
    loaded: usize,
    stepped: usize,
    inside: usize,
    late: usize,
    late_by_us: usize,
    /// Of the inverse for a tool vector, from period to period.
    iterations: Vec<u8>,
    last: Option<Configuration<f64>>,
    last_command: Option<Vec<f64>>,
    compensation: Option<Compensation>,
    feed: Feed,
}

impl Seen {
    /// Compares what comes of the place where the machine stands: stiffness, deflection, distances from singularities.
    fn take_place(&mut self, host: &Host, row: &Row<'_>, computed: &Computed, pose: &Pose<f64>) -> Outcome {
        let Computed { stiffness, wanted, .. } = computed;
        let [moved, turned] = [wanted.deflection.translation_m, wanted.deflection.rotation_rad].map(|v| v * 1e6);
        keep(&mut self.deflection, worst(row.moved, &[moved.as_slice(), turned.as_slice()].concat()));
        let distance = host.five()?.machine.singularity_distance(pose).map_err(|e| e.to_string())?;
        keep(
            &mut self.deflection,
            worst(row.margins, &[wanted.solution.normalised_determinant, distance.limbs_1_2, distance.limb_3]),
        );
        let matrix = stiffness.factor.stiffness().matrix();
        let upper = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
        for ((i, j), found) in upper.zip(row.k) {
            keep(&mut self.stiffness, (found - matrix[(i, j)]).abs() / (matrix[(i, i)] * matrix[(j, j)]).sqrt());
        }
        let inside = stiffness.domain == Domain::Inside && wanted.deflection.domain == Some(Domain::Inside);
        if inside != row.flag(1) {
            return Err(format!("inside the box or not: {:?}", row.all));
        }
        self.inside += usize::from(inside);
        Ok(())
    }

    fn take(&mut self, host: &Host, row: &Row<'_>, load: &[f64; 6]) -> Outcome {
        let (five, table) = (host.five()?, host.table()?);
        // until a first forward gave an answer, there is nothing
        if let Some(target) = row.target() {
            let solution = held(&five, target)?;
            keep(&mut self.inverse, worst(row.given, &in_file_units(&solution.joints)));
            keep(&mut self.inverse, (solution.normalised_determinant - row.target_share).abs());
        }
        if row.felt != [0.0; 5] {
            let (_, tool) = five.forward(&joints_of(row.felt)).map_err(|e| e.to_string())?;
            let [x, y, z] = (tool.tip_m * 1e3).into();
            keep(&mut self.forward, worst(row.placed, &[x, y, z, row.felt[3], row.felt[4]]));
        }
        let force = wrench_of(row.wrench)?;
        let stood = five.forward(&joints_of(row.stands)).map_err(|e| e.to_string());
        let compensation = match &mut self.compensation {
            Some(compensation) => compensation,
            none => none.insert(Compensation::new()?),
        };
        let to = compensation.update(&five, &table, row, stood.clone().map(|(stood, _)| stood), force)?;
        keep(&mut self.offsets, worst(row.offsets, &to));
        let added: Vec<f64> = row.command.iter().zip(row.offsets).map(|(command, offset)| command + offset).collect();
        keep(&mut self.offsets, worst(row.drive, &added));
        if let Some(before) = self.last_command.take_if(|_| stood.is_ok()) {
            keep(&mut self.jump, worst(row.command, &before));
        }
        self.last_command = stood.is_ok().then(|| row.command.to_vec());
        let computed = component(&five, &table, row.stands, &force);
        if computed.is_ok() != row.flag(0) {
            return Err(format!("results and no pose, or the other way round: {:?}", row.all));
        }
        // as long as the machine is not homed its joints mean nothing
        let (Ok((stood, _)), Ok(computed)) = (stood, computed) else {
            self.last = None;
            return Ok(());
        };
        self.valid += 1;
        self.take_place(host, row, &computed, &stood.pose)?;
        let moves_joints = row.offsets.iter().any(|d| d.abs() > 1e-4);
        self.loaded += usize::from(row.wrench != [0.0; 6] && moves_joints);
        self.stepped += usize::from(row.wrench == load && moves_joints);
        if row.all[0] > PERIOD_NS {
            self.take_late(&five, &table, row, &force);
        }
        if let Some(near) = &self.last {
            self.iterations.push(five.inverse(&computed.tool, near).map_err(|e| e.to_string())?.iterations);
        }
        self.last = Some(stood);
        Ok(())
    }

    /// The same again: what was taken away from the thread does not come again.
    fn take_late(
        &mut self,
        five: &FiveAxis<'_, f64>,
        table: &CorrectionTable<'_, f64>,
        row: &Row<'_>,
        force: &Wrench<f64>,
    ) {
        let again = (0..20).map(|_| {
            let begun = Instant::now();
            black_box((
                component(five, table, row.stands, force).ok(),
                row.target().map(|target| held(five, target).ok()),
            ));
            begun.elapsed().as_nanos() as f64
        });
        let again = again.fold(f64::INFINITY, f64::min);
        println!("  a late period, {:.0} ns: its work done again takes {again:.0} ns", row.all[0]);
        self.late += 1;
        self.late_by_us += usize::from(again > 0.5 * PERIOD_NS);
    }

    fn print(&self, rows: &[Vec<f64>]) {
        println!(
            "  {} periods, {} with results, {} of them under load, {} inside the table's box, {} late, {} of them by us",
            rows.len(),
            self.valid,
            self.loaded,
            self.inside,
            self.late,
            self.late_by_us
        );
        println!(
            "  greatest differences from the host: inverse {:.1e}, forward {:.1e}, offsets {:.1e} mm or degrees; \
             deflection {:.1e} um or urad; K_m {:.1e} of its diagonal",
            self.inverse, self.forward, self.offsets, self.deflection, self.stiffness
        );
        self.feed.print();
        let [half, _, most] = spread(self.iterations.iter().map(|n| f64::from(*n)));
        println!(
            "  iterations: none; were tool vectors asked for, {half} Newton iterations from period to period, {most} at the most\n  \
             furthest that a joint's command moved in a period: {:.4} mm or degrees",
            self.jump
        );
        let column = |i: usize| spread(rows.iter().map(|r| r[i]));
        let times = [
            ("inverse", column(WHOLE)),
            ("forward", column(WHOLE + 1)),
            ("compensator, stiffness", column(WHOLE + 2)),
            ("  by the processor's clock", column(2)),
            ("whole servo thread", column(0)),
            ("  by the processor's clock", column(1)),
        ];
        for (what, [half, most, all]) in times {
            println!("  {what:26} {half:6.0} ns at the median, {most:6.0} at 99.9 %, {all:8.0} at the most");
        }
        // motion-controller calls each of the kinematics about once a period
        let ours: f64 = times[..3].iter().map(|(_, [half, ..])| half).sum();
        let [thread, ..] = times[4].1;
        println!(
            "  ours at the median: {:.0} % of the thread's time, {:.1} % of the period",
            100.0 * ours / thread,
            100.0 * ours / PERIOD_NS
        );
    }
}

/// What the recorder saw, period by period.
///
/// # Arguments
/// * `slow`: rows in which a screw has another limit of its velocity, and that limit, mm/s.
pub fn judge_rows(
    host: &Host,
    rows: &[Vec<f64>],
    load: &[f64; 6],
    periods: usize,
    slow: &(Range<usize>, f64),
) -> Outcome {
    let mut seen = Seen::default();
    rows.iter().enumerate().try_for_each(|(n, row)| {
        let (row, limit) = (Row::of(row), slow.0.contains(&n).then_some(slow.1));
        let done = seen.take(host, &row, load).and_then(|()| seen.feed.take(host, &row, limit));
        done.map_err(|e| format!("period {n}: {e}"))
    })?;
    seen.print(rows);
    let enough = rows.len() >= periods && seen.loaded >= 1000 && seen.stepped >= 100 && seen.inside > 0;
    let exact = [seen.inverse, seen.forward, seen.offsets].into_iter().all(|d| d <= 1e-11)
        && seen.deflection <= 1e-10
        && seen.stiffness == 0.0;
    // the fastest joint does 120 mm/s
    let steady = seen.jump <= 0.121;
    for (holds, what) in [
        (enough, "too little was seen"),
        (exact, "not what the host computes"),
        (steady, "a joint jumped"),
        (seen.feed.holds(), "not the joints' velocities, accelerations or share of the feed"),
        (seen.late_by_us == 0, "our functions overran the period"),
    ] {
        if !holds {
            return Err(what.to_owned());
        }
    }
    Ok(())
}

//! A machine's life as one whole: a nut wears, a bolt comes loose, seasons pass, the probe is replaced and fails; what `replay` learns
//! of it, against a frozen table and against fits of the last readings. The truth is the frame, which knows no amplitude.

mod report;

use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use nalgebra::{DMatrix, DVector, Matrix6, Vector3, Vector6};

pub use self::report::{Outcome, Worst, report};
use crate::Random;
use crate::machine::{Machine, Part, Pose};
use crate::truth::World;

/// Poses of a life; loads at each that judge it, in N.
const POSES: usize = 30;
const JUDGED_LOADS: usize = 2;
const FORCE_N: f64 = 800.0;
/// The tool's tip over A, m.
const TIP_M: f64 = 0.25;
/// How far each declared stiffness is off (1 sd), and the model's own error as the estimator is told, as a share of the deflection.
const DECLARED_SD: f64 = 0.005;
const MODEL_SHARE: f64 = 0.005;
/// What is learned: drives of three limbs, the tool along u, v, w, and the probe's gain.
const AMPLITUDES: usize = 7;
const GAIN: usize = 6;
/// Deviation, drift in a day and alarm of a drive, as shares of its compliance; of the tool, m/N: one hundredth of what the tip gives by.
const DRIVE: [f64; 3] = [0.2, 0.002, 0.1];
const TOOL: [f64; 3] = [5e-9, 2e-11, 2e-9];
/// The same of the gain, as shares.
const PROBE: [f64; 3] = [5e-3, 2e-4, 2e-2];
/// What the tool's holder gives by when it is loose, m/N.
const LOOSE_M_PER_N: f64 = 6e-9;
/// Readings of the acceptance, from which on changes count: so many that they tell the gain from the tool.
const ACCEPTANCE: usize = 120;
/// Readings of the fit beside the estimator.
const LAST: usize = 200;
/// Days of a stretch of life that is judged for itself.
const STRETCH: usize = 20;

/// What comes loose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loose {
    /// The tool's holder along u, v or w, which is learned.
    Tool(usize),
    /// A joint of a limb, in a direction that is not learned.
    Joint(usize, Part),
}

/// A life.
#[derive(Clone, Copy, Debug)]
pub struct Plan {
    /// Days.
    pub days: usize,
    /// Readings in a day.
    pub readings: usize,
    /// Whether a part comes loose that is not learned.
    pub foreign: bool,
}

/// What one pose is like: compliances at A, true and declared, and what each amplitude adds by the declared machine and in truth.
struct Place {
    pose: Pose,
    truth: Matrix6<f64>,
    declared: Matrix6<f64>,
    /// Of a unit of compliance of each drive, in truth and as declared.
    drives: [[Matrix6<f64>; 3]; 2],
    /// What the loose part adds when it is not a tool's.
    loose: Matrix6<f64>,
}

/// A machine with what happens to it.
struct Life {
    places: Vec<Place>,
    worn: usize,
    loose: Loose,
    loose_from: usize,
    replaced_at: usize,
    fails_from: usize,
    /// Gain of the probe before and after it was replaced.
    gains: [f64; 2],
    /// Axial compliance of the worn drive, m/N.
    drive: f64,
}

/// Days in which the probe fails.
const FAILS_DAYS: usize = 10;
/// Stiffness of the worn drive at the end, as a share of the first.
const WORN: f64 = 0.7;
/// Part of all stiffness that goes for each degree, and the hall's swing over a year, K.
const SOFTER_PER_K: f64 = 4e-4;
const SEASON_K: f64 = 8.0;

fn compliance(machine: &Machine, pose: &Pose) -> Matrix6<f64> {
    World::new(machine.clone(), machine.clone(), Vec::new()).reduced(pose, 20.0).c
}

impl Life {
    fn new(rng: &mut Random, plan: &Plan) -> (Self, Machine) {
        let declared = Machine::reference();
        let mut truth = declared.clone();
        for which in declared.stiffnesses() {
            truth.scale(which, (DECLARED_SD * rng.normal()).exp());
        }
        let worn = rng.index(3);
        let loose = if plan.foreign {
            let joints = truth.stiffnesses();
            let lateral =
                |(_, part): &&(usize, Part)| matches!(part, Part::Base(0 | 1 | 3..=5) | Part::Platform(0 | 1));
            let (limb, part) = rng.pick(&joints.iter().filter(lateral).copied().collect::<Vec<_>>());
            Loose::Joint(limb, part)
        } else {
            Loose::Tool(rng.index(3))
        };
        let mut places = Vec::new();
        while places.len() < POSES {
            let round = |v: f64, digits: f64| (v * digits).round() / digits;
            let angle = |rng: &mut Random| round(rng.between(-14.0, 14.0), 1e4).to_radians();
            let pose = Pose([angle(rng), angle(rng), round(rng.between(0.503, 0.557), 1e6)]);
            if !declared.reaches(&pose) {
                continue;
            }
            let softer = |of: &Machine, limb: usize| {
                let mut soft = of.clone();
                soft.scale((limb, Part::Platform(2)), 0.8);
                let more = 1.0 / soft.limbs[limb].platform[2] - 1.0 / of.limbs[limb].platform[2];
                (compliance(&soft, &pose) - compliance(of, &pose)) / more
            };
            let own = compliance(&truth, &pose);
            let loose = match loose {
                Loose::Tool(_) => Matrix6::zeros(),
                Loose::Joint(limb, part) => {
                    let mut slack = truth.clone();
                    slack.scale((limb, part), 0.5);
                    compliance(&slack, &pose) - own
                }
            };
            places.push(Place {
                declared: compliance(&declared, &pose),
                truth: own,
                drives: [&truth, &declared].map(|of| [0, 1, 2].map(|limb| softer(of, limb))),
                loose,
                pose,
            });
        }
        let of = |rng: &mut Random, from: f64, to: f64| (rng.between(from, to) * plan.days as f64) as usize;
        let life = Self {
            worn,
            loose,
            loose_from: of(rng, 0.2, 0.4),
            replaced_at: of(rng, 0.5, 0.6),
            fails_from: of(rng, 0.7, 0.9),
            gains: [1.0 + 0.003 * rng.normal(), 1.0 + 0.003 * rng.normal()],
            drive: 1.0 / declared.limbs[worn].platform[2],
            places,
        };
        (life, declared)
    }

    /// What each amplitude is in truth on a day.
    fn amplitudes(&self, plan: &Plan, day: usize) -> [f64; AMPLITUDES] {
        let mut amplitudes = [0.0; AMPLITUDES];
        let left = 1.0 - (1.0 - WORN) * day as f64 / plan.days as f64;
        amplitudes[self.worn] = self.drive * (1.0 / left - 1.0);
        if let (Loose::Tool(axis), true) = (self.loose, day >= self.loose_from) {
            amplitudes[3 + axis] = LOOSE_M_PER_N;
        }
        amplitudes
    }

    /// True compliance at A on a day.
    fn truth(&self, plan: &Plan, place: &Place, day: usize) -> Matrix6<f64> {
        let amplitudes = self.amplitudes(plan, day);
        let mut c = place.truth;
        for (n, amplitude) in amplitudes.iter().enumerate() {
            c += added(&place.drives[0], n) * *amplitude;
        }
        if day >= self.loose_from {
            c += place.loose;
        }
        let warmer = SEASON_K * (std::f64::consts::TAU * day as f64 / 365.0).sin();
        c * (1.0 + SOFTER_PER_K * warmer)
    }
}

/// What a unit of an amplitude adds to the compliance at A.
fn added(drives: &[Matrix6<f64>; 3], amplitude: usize) -> Matrix6<f64> {
    match amplitude {
        0..3 => drives[amplitude],
        GAIN => Matrix6::zeros(),
        _ => Matrix6::from_diagonal(&Vector6::ith(amplitude - 3, 1.0)),
    }
}

/// Motion of the tip under a force there.
fn tip_motion(c: &Matrix6<f64>, f: &Vector3<f64>) -> Vector3<f64> {
    let d = c * Vector6::new(f.x, f.y, f.z, -TIP_M * f.y, TIP_M * f.x, 0.0);
    Vector3::new(d[0] + TIP_M * d[4], d[1] - TIP_M * d[3], d[2])
}

/// A reading as it is written.
struct Press {
    place: usize,
    force_n: Vector3<f64>,
    read_m: Vector3<f64>,
    deviation_m: f64,
    day: usize,
    /// Whether the probe fails.
    failed: bool,
}

/// A press with a probe that works.
fn press(life: &Life, plan: &Plan, rng: &mut Random, day: usize) -> Press {
    let place = rng.index(POSES);
    let force_n = Vector3::from_fn(|_, _| rng.between(-FORCE_N, FORCE_N).round());
    let is_new = day >= life.replaced_at;
    let deviation_m = if is_new { 0.5e-6 } else { 0.3e-6 };
    let mut read_m =
        tip_motion(&life.truth(plan, &life.places[place], day), &force_n) * life.gains[usize::from(is_new)];
    read_m.iter_mut().for_each(|read| *read += deviation_m * rng.normal());
    Press { place, force_n, read_m, deviation_m, day, failed: false }
}

fn presses(life: &Life, plan: &Plan, rng: &mut Random) -> Vec<Press> {
    let fault = rng.index(3);
    let lived = |n: usize| {
        let mut press = press(life, plan, rng, n / plan.readings);
        press.failed = (life.fails_from..life.fails_from + FAILS_DAYS).contains(&press.day);
        if press.failed {
            press.read_m = match fault {
                // wired the wrong way round, loose, or stuck
                0 => -press.read_m,
                1 => Vector3::from_fn(|_, _| rng.between(-1e-3, 1e-3)),
                _ => Vector3::new(41e-6, -7e-6, 12e-6),
            };
        }
        press
    };
    (0..plan.days * plan.readings).map(lived).collect()
}

fn log_csv(life: &Life, plan: &Plan, presses: &[Press]) -> String {
    let mut csv =
        "time_s,pose,theta_deg,sigma_deg,z0_mm,point_u_mm,point_v_mm,point_w_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,\
                   dx_um,dy_um,dz_um,sigma_linear_um\n"
            .to_owned();
    for (n, press) in presses.iter().enumerate() {
        let [theta, sigma, z0] = life.places[press.place].pose.0;
        let [u, v, w] = (press.read_m * 1e6).into();
        let [x, y, z] = press.force_n.into();
        _ = writeln!(
            csv,
            "{},P{:02},{:.4},{:.4},{:.3},0,0,{},{x},{y},{z},0,0,0,{u:.4},{v:.4},{w:.4},{}",
            1_700_000_000 + 86_400 / plan.readings * n,
            press.place,
            theta.to_degrees(),
            sigma.to_degrees(),
            z0 * 1e3,
            TIP_M * 1e3,
            press.deviation_m * 1e6
        );
    }
    csv
}

/// Deviation, drift in a day and alarm of an amplitude.
fn settings(drive: f64, amplitude: usize) -> [f64; 3] {
    match amplitude {
        0..3 => DRIVE.map(|share| share * drive),
        GAIN => PROBE,
        _ => TOOL,
    }
}

fn learn_toml(drive: f64, accepted: &[f64; AMPLITUDES]) -> String {
    let mut text = format!("format = 1\nmodel_share = {MODEL_SHARE}\n");
    for (n, accepted) in accepted.iter().enumerate() {
        let place = match n {
            0..3 => format!("place = \"limb.{}.body\"\nmotion = \"axial\"", n + 1),
            GAIN => "place = \"probe\"".to_owned(),
            _ => format!("place = \"tool\"\nmotion = \"{}\"", ["u", "v", "w"][n - 3]),
        };
        let [deviation, drift, alarm] = settings(drive, n);
        _ = writeln!(
            text,
            "[[learn]]\n{place}\naccepted = {accepted:e}\ndeviation = {deviation:e}\n\
             drift_per_day = {drift:e}\nleast = {:e}\nmost = {:e}\nrate_per_s = {drive:e}\nalarm = {alarm:e}",
            accepted - 5.0 * deviation,
            accepted + 50.0 * deviation
        );
    }
    text
}

/// What `replay` made of a reading.
struct Step {
    is_taken: bool,
    alarms: Vec<usize>,
    values: [f64; AMPLITUDES],
    /// What of their changes is compensated.
    compensated: [f64; AMPLITUDES],
}

fn steps(text: &str) -> Result<Vec<Step>, String> {
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or("").split(',').collect();
    let column = |name: &str| head.iter().position(|h| *h == name).ok_or_else(|| format!("no column {name}"));
    let (status, alarms) = (column("status")?, column("alarms")?);
    let columns = |name: &str| (1..=AMPLITUDES).map(|n| column(&format!("{name}_{n}"))).collect::<Result<Vec<_>, _>>();
    let numbers = [columns("value")?, columns("compensated")?];
    let step = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |n: usize| cells.get(n).copied().ok_or_else(|| format!("a short line: {line}"));
        let none = [0.0; AMPLITUDES];
        let mut step = Step { is_taken: cell(status)? == "taken", alarms: Vec::new(), values: none, compensated: none };
        for number in cell(alarms)?.split_whitespace() {
            let number = number.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
            step.alarms.push(number.ok_or_else(|| format!("no alarm: {line}"))?);
        }
        for (all, columns) in [&mut step.values, &mut step.compensated].into_iter().zip(&numbers) {
            for (number, column) in all.iter_mut().zip(columns) {
                *number = cell(*column)?.parse().map_err(|e| format!("{line}: {e}"))?;
            }
        }
        Ok(step)
    };
    lines.map(step).collect()
}

/// Judges estimates by loads that were not pressed.
struct Judge<'a> {
    life: &'a Life,
    plan: &'a Plan,
    loads: Vec<(usize, Vector3<f64>)>,
}

impl Judge<'_> {
    /// Sum of the squared errors of the tip on a day by some values of the amplitudes, m².
    fn error(&self, day: usize, values: &[f64; AMPLITUDES]) -> f64 {
        let off = |(place, force_n): &(usize, Vector3<f64>)| {
            let place = &self.life.places[*place];
            let mut c = place.declared - self.life.truth(self.plan, place, day);
            for (n, value) in values.iter().enumerate() {
                c += added(&place.drives[1], n) * *value;
            }
            tip_motion(&c, force_n).norm_squared()
        };
        self.loads.iter().map(off).sum()
    }
}

/// Rows of a reading, and what was read beyond what was accepted, in deviations.
fn rows(life: &Life, press: &Press, accepted: &[f64; AMPLITUDES]) -> [(DVector<f64>, f64); 3] {
    let place = &life.places[press.place];
    let seen = tip_motion(&place.declared, &press.force_n);
    let shown = |n| if n == GAIN { seen } else { tip_motion(&added(&place.drives[1], n), &press.force_n) };
    let moved: [Vector3<f64>; AMPLITUDES] = std::array::from_fn(shown);
    let expected = moved.iter().zip(accepted).fold(seen, |sum, (moved, accepted)| sum + moved * *accepted);
    [0, 1, 2].map(|axis| {
        let noise = press.deviation_m.hypot(MODEL_SHARE * seen[axis]);
        let row = DVector::from_fn(AMPLITUDES, |n, _| settings(life.drive, n)[0] * moved[n][axis] / noise);
        (row, (press.read_m[axis] - expected[axis]) / noise)
    })
}

/// Lives a life and asks the program.
///
/// # Errors
/// What the program refuses.
pub fn live(program: &Path, seed: u64, plan: &Plan, folder: &Path) -> Result<Outcome, String> {
    let mut rng = Random::new(seed ^ (0x11FE << 40));
    let (life, declared) = Life::new(&mut rng, plan);
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display())).map(|()| path)
    };
    let machine = write("machine.toml", declared.toml("life"))?;
    let replay = |presses: &[Press], accepted: &[f64; AMPLITUDES]| {
        let log = write("log.csv", log_csv(&life, plan, presses))?;
        let (learn, out) = (write("learn.toml", learn_toml(life.drive, accepted))?, folder.join("out"));
        let mut command = Command::new(program);
        command.arg("replay").stdin(Stdio::null());
        for (option, path) in [("--machine", &machine), ("--log", &log), ("--learn", &learn), ("--out", &out)] {
            command.arg(option).arg(path);
        }
        let done = command.output().map_err(|e| format!("{}: {e}", program.display()))?;
        if !done.status.success() {
            return Err(String::from_utf8_lossy(&done.stderr).trim().to_owned());
        }
        let path = out.join("steps.csv");
        steps(&std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?)
    };
    // what the table is off by is no change: a machine is accepted with what the first readings say
    let first: Vec<Press> = (0..ACCEPTANCE).map(|_| press(&life, plan, &mut rng, 0)).collect();
    let accepted = replay(&first, &[0.0; AMPLITUDES])?.last().ok_or("no steps")?.values;
    let presses = presses(&life, plan, &mut rng);
    let steps = replay(&presses, &accepted)?;
    let load = |rng: &mut Random, n: usize| (n % POSES, rng.direction() * 500.0);
    let loads = (0..POSES * JUDGED_LOADS).map(|n| load(&mut rng, n)).collect();
    let judge = Judge { life: &life, plan, loads };
    let mut outcome = alarms(&life, plan, &presses, &steps);
    outcome.seed = seed;
    errors(&judge, &presses, &steps, &accepted, &mut outcome);
    Ok(outcome)
}

/// Errors of the tip over the life.
fn errors(judge: &Judge<'_>, presses: &[Press], steps: &[Step], accepted: &[f64; AMPLITUDES], outcome: &mut Outcome) {
    let mut taken: Vec<[(DVector<f64>, f64); 3]> = Vec::new();
    let (mut whole, mut stretch, mut batch) = ([0.0; 2], [0.0; 2], [0.0; 2]);
    let every = judge.plan.readings;
    for (n, (press, step)) in presses.iter().zip(steps).enumerate() {
        if step.is_taken {
            taken.push(rows(judge.life, press, accepted));
        }
        if (n + 1) % every > 0 {
            continue;
        }
        let errors = [judge.error(press.day, &step.compensated), judge.error(press.day, &[0.0; AMPLITUDES])];
        for (n, error) in errors.iter().enumerate() {
            whole[n] += error;
            stretch[n] += error;
        }
        if (press.day + 1) % STRETCH == 0 {
            let of_frozen = (stretch[0] / stretch[1]).sqrt();
            if press.day < STRETCH {
                outcome.first = of_frozen;
            } else if of_frozen > outcome.worst.of_frozen {
                outcome.worst = Worst {
                    of_frozen,
                    frozen_m: (stretch[1] / (STRETCH * judge.loads.len()) as f64).sqrt(),
                    until: press.day + 1,
                    is_before_loose: press.day < judge.life.loose_from,
                };
            }
            stretch = [0.0; 2];
        }
        if press.day % 5 == 0 && taken.len() >= LAST {
            let (mut information, mut right) = (DMatrix::identity(AMPLITUDES, AMPLITUDES), DVector::zeros(AMPLITUDES));
            for (row, beyond) in taken[taken.len() - LAST..].iter().flatten() {
                information += row * row.transpose();
                right += row * *beyond;
            }
            if let Some(factor) = information.cholesky() {
                let fitted = factor.solve(&right);
                let value = |n: usize| accepted[n] + settings(judge.life.drive, n)[0] * fitted[n];
                batch[0] += errors[0];
                batch[1] += judge.error(press.day, &std::array::from_fn(value));
            }
        }
    }
    let ratio = |[own, other]: [f64; 2]| (own / other).sqrt();
    outcome.of_frozen = ratio(whole);
    outcome.of_batch = ratio(batch);
}

/// Alarms and refusals over the life.
fn alarms(life: &Life, plan: &Plan, presses: &[Press], steps: &[Step]) -> Outcome {
    let limit = |amplitude: usize| settings(life.drive, amplitude)[2];
    let first = |amplitude: usize, from: usize| {
        let at = steps.iter().skip(from).position(|step| step.alarms.contains(&amplitude));
        at.map(|after| after as i64 + 1)
    };
    let worth = |press: &Press| life.amplitudes(plan, press.day)[life.worn] >= limit(life.worn);
    let worn_from = presses.iter().position(worth).unwrap_or(presses.len());
    let loose_from = life.loose_from * plan.readings;
    let is_false = |(press, step): &(&Press, &Step)| {
        step.alarms.iter().any(|n| life.amplitudes(plan, press.day)[*n] < 0.5 * limit(*n))
    };
    let failed = || presses.iter().zip(steps).filter(|(press, _)| press.failed);
    Outcome {
        seed: 0,
        loose: life.loose,
        of_frozen: 0.0,
        first: 0.0,
        worst: Worst::default(),
        of_batch: 0.0,
        worn_after: first(life.worn, worn_from),
        loose_after: match life.loose {
            Loose::Tool(axis) => first(3 + axis, loose_from),
            Loose::Joint(..) => None,
        },
        false_alarms: [false, true].map(|new| {
            let own = presses.iter().zip(steps).filter(|(press, _)| (press.day >= life.replaced_at) == new);
            own.filter(is_false).count()
        }),
        failed_taken: [failed().filter(|(_, step)| step.is_taken).count(), failed().count()],
        refused: presses.iter().zip(steps).filter(|(press, step)| !press.failed && !step.is_taken).count(),
    }
}

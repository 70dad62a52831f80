//! How often the expanded uncertainty of a table's deflections covers their error: stiffnesses of a true machine at the poses of
//! an L49 and what `fit` makes of them, or readings and what `diagnose` makes of them; and what `predict` says of other poses under
//! other loads.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use nalgebra::Vector6;

use crate::Random;
use crate::effects::{Effect, LISTED, OUTSIDE};
use crate::forms::FORMS;
use crate::machine::{Machine, Pose};
use crate::set::{Kind, Set, SetOptions};
use crate::truth::World;

/// Where a held-out pose lies: of a box that is this much as wide as the measured one, at least and at most.
const ZONES: [(&str, f64, f64); 3] = [("inside", 0.0, 0.9), ("edge", 0.9, 1.0), ("beyond", 1.0, 1.4)];
/// Poses of each zone.
const POSES: usize = 30;
/// Loads at each pose.
const LOADS: usize = 3;
/// The tool's tip over A, m.
const TIP_M: f64 = 0.25;

/// How many components were covered in a zone.
#[derive(Clone, Debug)]
struct Zone {
    name: &'static str,
    covered: usize,
    of: usize,
    /// Squares of errors, uncertainties and deflections, µm².
    sums: [f64; 3],
}

/// What came of one set.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Its seed, and what the truth had.
    about: String,
    zones: Vec<Zone>,
}

/// A machine whose stiffness does not depend on the load.
fn world(rng: &mut Random) -> World {
    let declared = if rng.chance(0.4) { Machine::reference() } else { Machine::random(rng) };
    let mut machine = declared.clone();
    for which in declared.stiffnesses() {
        machine.scale(which, (0.1 * rng.normal()).exp());
    }
    let known = |id: &str| {
        let others = [
            "form-load",
            "form-warm",
            "form-sens",
            "thermal",
            "sensor",
            "load-",
            "clearance",
            "contact",
            "friction",
            "cubic",
            "preload",
        ];
        !others.iter().any(|other| id.starts_with(other))
    };
    let mut specs = Vec::new();
    for list in [&FORMS[..], &OUTSIDE[..], &LISTED[..]] {
        let linear: Vec<_> = list.iter().filter(|s| known(s.id)).collect();
        specs.push(*rng.pick(&linear));
    }
    let mut effects: Vec<Effect> = Vec::new();
    for spec in specs {
        let mut effect = Effect::random(&spec, rng);
        effect.amplitude *= rng.log_between(0.5, 3.0);
        effects.push(effect);
    }
    World::new(declared, machine, effects)
}

/// Where scaled variables are in the box.
fn pose(angle: f64, [theta, sigma, z0]: [f64; 3]) -> Pose {
    let round = |v: f64, digits: f64| (v * digits).round() / digits;
    let degrees = |t: f64| round((t * angle).to_degrees(), 1e4).to_radians();
    Pose([degrees(theta), degrees(sigma), round(0.530 + 0.030 * z0, 1e6)])
}

/// Runs the program.
fn run(program: &Path, arguments: &[&OsStr]) -> Result<(), String> {
    let done = Command::new(program).args(arguments).stdin(Stdio::null()).output();
    let done = done.map_err(|e| format!("{}: {e}", program.display()))?;
    let said = || format!("{arguments:?}: {}: {}", done.status, String::from_utf8_lossy(&done.stderr).trim());
    if done.status.success() { Ok(()) } else { Err(said()) }
}

fn stiffness_csv(world: &World, angle: f64) -> Result<String, String> {
    let upper = || (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
    let names: Vec<String> = upper().map(|(i, j)| format!("k{}{}", i + 1, j + 1)).collect();
    let mut csv = format!("pose,theta_deg,sigma_deg,z0_mm,{}\n", names.join(","));
    for n in 0..49_usize {
        let (i, j) = (n / 7, n % 7);
        // an orthogonal array: each pair of levels once
        let p = pose(angle, [i, j, (i + 2 * j) % 7].map(|level| level as f64 / 3.0 - 1.0));
        let k = world.reduced(&p, 20.0).c.try_inverse().ok_or("a compliance that has no inverse")?;
        let cells: Vec<String> = upper().map(|(i, j)| format!("{:.12e}", 0.5 * (k[(i, j)] + k[(j, i)]))).collect();
        let [theta, sigma, z0] = p.0;
        _ = writeln!(
            csv,
            "S{n:02},{:.4},{:.4},{:.3},{}",
            theta.to_degrees(),
            sigma.to_degrees(),
            z0 * 1e3,
            cells.join(",")
        );
    }
    Ok(csv)
}

/// Motion of the tip under a load there, from a compliance at A.
fn tip_motion(c: &nalgebra::Matrix6<f64>, w: &Vector6<f64>) -> [f64; 3] {
    // a force at the tip turns the platform about A
    let at_a = Vector6::new(w[0], w[1], w[2], w[3] - TIP_M * w[1], w[4] + TIP_M * w[0], w[5]);
    let d = c * at_a;
    [d[0] + TIP_M * d[4], d[1] - TIP_M * d[3], d[2]]
}

/// Readings that are asked for, as CSV, and with each its zone and the tip's true motion in m.
struct Asked {
    csv: String,
    truth: Vec<(&'static str, [f64; 3])>,
}

impl Asked {
    /// Poses of each zone, each under some loads at the tip.
    fn random(world: &World, angle: f64, rng: &mut Random) -> Self {
        let head = "pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm,load_u_mm,load_v_mm,load_w_mm,\
                    point_u_mm,point_v_mm,point_w_mm,dx_um,dy_um,dz_um\n";
        let mut asked = Self { csv: head.to_owned(), truth: Vec::new() };
        for (zone, least, most) in &ZONES {
            let mut poses = 0;
            while poses < POSES {
                let scaled: [f64; 3] = std::array::from_fn(|_| rng.between(-most, *most));
                let farthest = scaled.iter().fold(0.0_f64, |far, t| far.max(t.abs()));
                let p = pose(angle, scaled);
                if farthest < *least || !world.nominal.reaches(&p) {
                    continue;
                }
                poses += 1;
                asked.add(zone, &p, &world.reduced(&p, 20.0).c, rng);
            }
        }
        asked
    }

    /// Loads at a pose where A has this compliance.
    fn add(&mut self, zone: &'static str, p: &Pose, c: &nalgebra::Matrix6<f64>, rng: &mut Random) {
        let [theta, sigma, z0] = p.0;
        for _ in 0..LOADS {
            let (force, moment) = (rng.direction() * 500.0, rng.direction() * rng.between(0.0, 50.0));
            let w = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
                .map(|v| (v * 10.0).round() / 10.0);
            let loads: Vec<String> = w.iter().map(|v| format!("{:.1}", v + 0.0)).collect();
            let tip = TIP_M * 1e3;
            _ = writeln!(
                self.csv,
                "H{:04},{:.4},{:.4},{:.3},{},0,0,{tip},0,0,{tip},0,0,0",
                self.truth.len(),
                theta.to_degrees(),
                sigma.to_degrees(),
                z0 * 1e3,
                loads.join(",")
            );
            self.truth.push((zone, tip_motion(c, &w)));
        }
    }
}

fn s(text: &str) -> &OsStr {
    text.as_ref()
}

/// What the program predicts for the readings in `asked`, with a table of a machine.
fn predicted(program: &Path, [machine, table, asked]: [&Path; 3], folder: &Path) -> Result<String, String> {
    let said = folder.join("said.csv");
    let files = [s("--machine"), machine.as_os_str(), s("--table"), table.as_os_str()];
    let asked = [s("--data"), asked.as_os_str(), s("--out"), said.as_os_str()];
    run(program, &[&[s("predict")], &files[..], &asked].concat())?;
    std::fs::read_to_string(&said).map_err(|e| format!("{}: {e}", said.display()))
}

fn write(folder: &Path, name: &str, text: &str) -> Result<PathBuf, String> {
    let path = folder.join(name);
    std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display())).map(|()| path)
}

impl Outcome {
    /// Makes stiffnesses of a machine and asks the program.
    ///
    /// # Errors
    /// What the program refuses.
    pub fn of_fit(program: &Path, seed: u64, terms: &str, folder: &Path) -> Result<Self, String> {
        let mut rng = Random::new(seed ^ (0x20 << 48));
        let world = world(&mut rng);
        let angle = rng.pick(&[12.0_f64, 15.0]).to_radians();
        let machine = write(folder, "machine.toml", &world.nominal.toml("trial"))?;
        let data = write(folder, "stiffness.csv", &stiffness_csv(&world, angle)?)?;
        let Asked { csv, truth } = Asked::random(&world, angle, &mut rng);
        let asked = write(folder, "asked.csv", &csv)?;
        let out = folder.join("fit");
        let files = [s("--machine"), machine.as_os_str(), s("--data"), data.as_os_str(), s("--out"), out.as_os_str()];
        run(program, &[&[s("fit"), s("--terms"), s(terms)], &files[..]].concat())?;
        let text = predicted(program, [&machine, &out.join("coefficients.json"), &asked], folder)?;
        let effects: Vec<&str> = world.effects.iter().map(|e| e.id).collect();
        Self::counted(format!("{seed} {}", effects.join("+")), &text, &truth)
    }

    /// Makes readings of a machine and asks the program.
    ///
    /// # Errors
    /// What the program refuses.
    pub fn of_diagnosis(program: &Path, kind: Kind, seed: u64, folder: &Path) -> Result<Self, String> {
        let set = Set::new(kind, seed, &SetOptions::default())?;
        set.write(folder, false)?;
        let (csv, truth) = set.asked(TIP_M);
        let asked = write(folder, "asked.csv", &csv)?;
        let [machine, data, out] = ["machine.toml", "measured.csv", "diagnosis"].map(|name| folder.join(name));
        let files = [s("--machine"), machine.as_os_str(), s("--data"), data.as_os_str(), s("--out"), out.as_os_str()];
        run(program, &[&[s("diagnose")], &files[..]].concat())?;
        let (machine, table) = (out.join("machine.toml"), out.join("coefficients.json"));
        let text = predicted(program, [&machine, &table, &asked], folder)?;
        Self::counted(format!("{} {seed}", kind.name()), &text, &truth)
    }

    /// Counts which components of the predictions cover the truth.
    fn counted(about: String, said: &str, truth: &[(&'static str, [f64; 3])]) -> Result<Self, String> {
        let mut zones: Vec<Zone> = Vec::new();
        let mut lines = said.lines();
        let head: Vec<&str> = lines.next().unwrap_or("").split(',').collect();
        let column = |name: &str| head.iter().position(|h| *h == name).ok_or_else(|| format!("no column {name}"));
        let columns = ["dx_um", "dy_um", "dz_um", "u95_dx_um", "u95_dy_um", "u95_dz_um"].map(column);
        for (line, (name, truth)) in lines.zip(truth) {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |n: usize| -> Result<f64, String> {
                let cell = cells.get(columns[n].clone()?).ok_or("a short line")?;
                cell.parse().map_err(|e| format!("{cell}: {e}"))
            };
            let place = zones.iter().position(|zone| zone.name == *name).unwrap_or(zones.len());
            if place == zones.len() {
                zones.push(Zone { name, covered: 0, of: 0, sums: [0.0; 3] });
            }
            for axis in 0..3 {
                let (error, u95) = (number(axis)? - truth[axis] * 1e6, number(3 + axis)?);
                zones[place].covered += usize::from(error.abs() <= u95);
                zones[place].of += 1;
                for (sum, value) in zones[place].sums.iter_mut().zip([error, u95, truth[axis] * 1e6]) {
                    *sum += value * value;
                }
            }
        }
        Ok(Self { about, zones })
    }

    /// A line for people.
    pub fn line(&self) -> String {
        let zone = |Zone { name, covered, of, sums }: &Zone| {
            let [error, u95, moved] = sums.map(|sum| (sum / *of as f64).sqrt());
            let share = 100.0 * *covered as f64 / *of as f64;
            format!("{name} {share:.1} % (error {error:.3}, U95 {u95:.3} of {moved:.1} µm)")
        };
        format!("{}: {}", self.about, self.zones.iter().map(zone).collect::<Vec<_>>().join("; "))
    }
}

/// Coverage over all sets.
pub fn report(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    let names = outcomes.first().map_or(Vec::new(), |o| o.zones.iter().map(|zone| zone.name).collect());
    for name in names {
        let all = || outcomes.iter().flat_map(|o| &o.zones).filter(|zone| zone.name == name);
        let (covered, of) = all().fold((0, 0), |sum, zone| (sum.0 + zone.covered, sum.1 + zone.of));
        let mut shares: Vec<f64> = all().map(|zone| 100.0 * zone.covered as f64 / zone.of as f64).collect();
        shares.sort_by(f64::total_cmp);
        let at =
            |share: f64| shares.get((share * (shares.len() - 1) as f64).round() as usize).copied().unwrap_or(f64::NAN);
        _ = writeln!(
            text,
            "{name:<7} {:.1} % of {of} components covered; by set: least {:.1} %, tenth {:.1} %, median {:.1} %, greatest {:.1} %",
            100.0 * covered as f64 / of as f64,
            at(0.0),
            at(0.1),
            at(0.5),
            at(1.0)
        );
    }
    text
}

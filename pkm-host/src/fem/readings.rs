//! Measured data made of the solids' stiffness: deflections under loads, with noise and zero errors, in the measured format.
//! With an effect in the solids that the machine file does not declare they are what `diagnose` is for.

use pkm_core::Wrench;

use super::{Case, Solved};
use crate::error::{Failure, Result, printable};
use crate::files::dataset::{self, DEFLECTION_COLUMNS, READ_COLUMNS, Sheet, WRENCH_COLUMNS};
use crate::files::import::Renames;
use crate::files::machine::MachineFile;
use crate::files::readings::{GAUGE, KINDS, Readings};
use crate::files::source::Source;
use crate::pose::NamedPose;

/// How readings are simulated.
pub struct Simulation {
    /// Greatest force of the usual loads.
    pub force_n: f64,
    /// Greatest moment.
    pub moment_nm: f64,
    /// How often each is taken.
    pub repeats: u32,
    /// 1 sd of a reading, of translations in µm and of rotations in µrad.
    pub noise: [f64; 2],
    /// 1 sd of what the readings of a series share.
    pub zero: [f64; 2],
    /// All errors follow from it.
    pub seed: u64,
}

/// Loads at poses.
pub struct Loads {
    sheet: Sheet,
    readings: Readings,
}

/// Along and about every axis, both ways: half the load, the whole, and half of it again on the way back.
fn usual(simulation: &Simulation, poses: &[NamedPose]) -> String {
    let mut header: Vec<String> = dataset::POSE_COLUMNS.map(str::to_owned).to_vec();
    header.extend(WRENCH_COLUMNS.map(str::to_owned));
    header.extend(["series", "repeat", "direction"].map(str::to_owned));
    let mut rows = Vec::new();
    for pose in poses {
        for repeat in 1..=simulation.repeats {
            for (axis, name) in WRENCH_COLUMNS.iter().enumerate() {
                let most = if axis < 3 { simulation.force_n } else { simulation.moment_nm };
                for (sign, mark) in [(1.0, "+"), (-1.0, "-")] {
                    for (share, direction) in [(0.5, "load"), (1.0, "load"), (0.5, "unload")] {
                        let mut row = vec![pose.id.clone()];
                        row.extend(dataset::pose_cells(&pose.pose));
                        row.extend(
                            (0..6).map(|i| if i == axis { (sign * share * most).to_string() } else { "0".into() }),
                        );
                        let (axis, _) = name.split_once('_').unwrap_or((name, ""));
                        row.extend([format!("{}{mark}{axis}.{repeat}", pose.id), repeat.to_string(), direction.into()]);
                        rows.push(row);
                    }
                }
            }
        }
    }
    dataset::to_csv(b',', &header, rows)
}

impl Loads {
    /// Poses and wrenches of a measured file, or the usual loads at every pose.
    ///
    /// # Errors
    /// Those of a measured file.
    pub fn new(
        simulation: &Simulation,
        loads: Option<Source>,
        poses: &[NamedPose],
        file: &MachineFile,
    ) -> Result<Self> {
        let source = loads.unwrap_or_else(|| Source::from_text("the usual loads", usual(simulation, poses)));
        let (sheet, readings) = Readings::read_conditions(source, file, &Renames::default())?;
        Ok(Self { sheet, readings })
    }

    /// Poses of the file, each once.
    pub fn poses(&self) -> &[NamedPose] {
        &self.readings.poses
    }

    /// What is wrong with the file and yet not refused.
    pub fn warnings(&self) -> &[String] {
        &self.sheet.warnings
    }

    /// The readings as CSV, and how many they are.
    ///
    /// # Errors
    /// A stiffness that is not positive definite.
    pub fn csv(
        &self,
        simulation: &Simulation,
        file: &MachineFile,
        set: &[String],
        solved: &[(&Case, Solved)],
    ) -> Result<(String, usize)> {
        let given = |c: &&str| self.sheet.has(c);
        let mut wanted: Vec<&str> = READ_COLUMNS.into_iter().filter(given).collect();
        if wanted.is_empty() {
            wanted = DEFLECTION_COLUMNS.to_vec();
        }
        const SIGMA: [&str; 2] = ["sigma_linear_um", "sigma_angular_urad"];
        let mut header = self.sheet.header.clone();
        header.extend(wanted.iter().chain(&SIGMA).filter(|c| !given(c)).map(|c| (*c).to_owned()));
        let column = |name: &str| header.iter().position(|h| h == name);

        let factors = solved.iter().map(|(case, s)| {
            s.stiffness().factor().map_err(|e| Failure::other(format!("pose `{}`: {e}", case.pose.id)))
        });
        let factors = factors.collect::<Result<Vec<_>>>()?;
        // two ids of one pose are one pose of the readings
        let of_pose = self.readings.poses.iter().map(|p| {
            let solved = solved.iter().position(|(case, _)| case.pose.id == p.id);
            solved.map(|n| &factors[n]).ok_or_else(|| Failure::other(format!("pose `{}` was not computed", p.id)))
        });
        let of_pose = of_pose.collect::<Result<Vec<_>>>()?;
        let mut random = fastrand::Rng::with_seed(simulation.seed);
        let mut normal = move || pkm_diagnosis::screening::normal(&mut random);
        let series = self.readings.readings.iter().map(|r| r.series + 1).max().unwrap_or(0);
        let zeros: Vec<[f64; 6]> =
            (0..series).map(|_| std::array::from_fn(|i| simulation.zero[i / 3] * normal())).collect();
        let mut rows = Vec::new();
        for (row, reading) in self.sheet.rows.iter().zip(&self.readings.readings) {
            let c = &self.readings.conditions[reading.condition];
            let at_a: Wrench<f64> = c.wrench.moved_to_a(c.point_m.into());
            let deflection = of_pose[c.pose].deflection(&at_a).map_err(|e| {
                Failure::input(format!("no deflection: {e}")).in_file(&self.sheet.source.name).at_line(row.line)
            })?;
            let seen = deflection.seen_at(c.point_m.into());
            let micro = c.read(seen.to_vector().into()).map(|v| v * 1e6);
            let mut cells = row.to_cells();
            cells.resize(header.len(), String::new());
            for i in c.channels() {
                let (zero, noise) = (zeros[reading.series][i % GAUGE], simulation.noise[KINDS[i]] * normal());
                let value = micro[i] + zero + noise;
                let name = READ_COLUMNS[i];
                if let Some(at) = column(name).filter(|_| wanted.contains(&name)) {
                    cells[at] = self.sheet.written(format!("{value:.4}"));
                }
            }
            for (i, name) in SIGMA.iter().enumerate() {
                let sigma = simulation.noise[i].hypot(simulation.zero[i]);
                if let Some(at) = column(name) {
                    // without noise there is nothing to declare
                    cells[at] = if sigma > 0.0 { self.sheet.written(format!("{sigma:.4}")) } else { String::new() };
                }
            }
            rows.push(cells);
        }
        let count = rows.len();
        let [linear, angular] = simulation.noise;
        let text = format!(
            "# readings of machine `{}` in solids, simulated by finite elements; --set {}; noise {linear} um, {angular} urad, \
             zero {} um, {} urad, seed {}\n{}",
            file.name,
            if set.is_empty() { "nothing".to_owned() } else { printable(&set.join(", ")) },
            simulation.zero[0],
            simulation.zero[1],
            simulation.seed,
            dataset::to_csv(self.sheet.delimiter(), &header, rows)
        );
        Ok((text, count))
    }
}

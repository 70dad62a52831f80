//! Measured deflections as the diagnosis needs them: load history, repeats, channels that are missing.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

use pkm_core::Wrench;
use pkm_diagnosis::Covariance;

use crate::csv::decimals;
use crate::dataset::{LOAD_RANDOM_COLUMN, READ_COLUMNS, Row, Sheet};
use crate::error::{Failure, Result};
use crate::import::Renames;
use crate::machine::MachineFile;
use crate::measured::{LoadCase, Measured};
use crate::pose::{NamedPose, ROTATION_ARM_M};
use crate::source::Source;
use crate::steps::steps;
use crate::warmth::{Warmth, Zeros};

/// Channels: three translations, three rotations, and the displacement along a gauge.
pub const CHANNELS: usize = 7;

/// The channel of gauges.
pub const GAUGE: usize = 6;

/// Of each channel: 0 for lengths, 1 for angles.
pub const KINDS: [usize; CHANNELS] = [0, 0, 0, 1, 1, 1, 0];

/// What determines a prediction; readings that share it are repeats of one another.
#[derive(Clone, Copy, Debug)]
pub struct Condition {
    /// Index of the commanded pose.
    pub pose: usize,
    /// Load at `point_m`, in A-uvw.
    pub wrench: Wrench<f64>,
    /// Where load and deflection are given, in A-uvw.
    pub point_m: [f64; 3],
    /// Load at which the loading last turned; zero when it has only grown.
    pub turned_at: Wrench<f64>,
    /// Of the machine.
    pub temperature_c: f64,
    /// Temperature above that of the zero reading.
    pub rise_k: f64,
    /// Unit direction, in A-uvw, in which a gauge reads; `None` where components are read.
    pub gauge: Option<[f64; 3]>,
}

impl Condition {
    /// What is read of a deflection at `point_m`, m and rad, by channel.
    pub fn read(&self, deflection: [f64; 6]) -> [f64; CHANNELS] {
        let [x, y, z, rx, ry, rz] = deflection;
        let along = self.gauge.map_or(0.0, |[u, v, w]| u * x + v * y + w * z);
        [x, y, z, rx, ry, rz, along]
    }

    /// Channels in which it is read.
    pub fn channels(&self) -> Range<usize> {
        if self.gauge.is_some() { GAUGE..CHANNELS } else { 0..GAUGE }
    }

    /// What is the same of readings at one pose and point, along one gauge.
    fn key_of_place(&self) -> Vec<u64> {
        let mut key = bits(&self.point_m);
        key.push(self.pose as u64);
        key.extend(self.gauge.map_or_else(Vec::new, |direction| bits(&direction)));
        key
    }

    /// What is the same of readings under one condition.
    fn key(&self) -> Vec<u64> {
        let mut key = self.key_of_place();
        key.extend(bits(self.wrench.to_vector().as_slice()));
        key.extend(bits(self.turned_at.to_vector().as_slice()));
        key.extend(bits(&[self.temperature_c, self.rise_k]));
        key
    }
}

/// One line of the file.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Line of the file, from 1.
    pub line: u64,
    /// Index of its condition.
    pub condition: usize,
    /// The same without the temperature: what makes repeats.
    pub repeat_of: usize,
    /// Readings that share a zero-reading error.
    pub series: usize,
    /// Deflection in m and rad; `None` where the cell is blank.
    pub observed: [Option<f64>; CHANNELS],
    /// Declared standard deviation of translations in m and rotations in rad.
    pub sigma: [Option<f64>; 2],
    /// Declared instead, where errors of the channels go together.
    pub covariance: Option<Arc<Covariance>>,
    /// Relative scatter of its load, where the file has it; else that of the machine file counts.
    pub load_random: Option<f64>,
}

/// A measured file.
#[derive(Clone)]
pub struct Readings {
    /// File, as the user named it.
    pub source: Source,
    /// Different poses, in the order in which they appear.
    pub poses: Vec<NamedPose>,
    /// Different conditions.
    pub conditions: Vec<Condition>,
    /// Rows.
    pub readings: Vec<Reading>,
    /// Names of the series; empty for a row on its own.
    pub series_names: Vec<String>,
    /// Step in which each channel's numbers are read, m and rad: that of the last digit written, or of a coarser dial.
    pub resolution: [f64; CHANNELS],
    /// Whether the file has temperatures.
    pub has_temperature: bool,
    /// Whether some readings were taken while the load went down.
    pub has_unloading: bool,
    /// Whether the file has poses by the lengths of the screws, and not by θ, σ and Z0.
    pub has_lengths: bool,
    /// What is wrong with the file and yet not refused.
    pub warnings: Vec<String>,
}

fn bits(values: &[f64]) -> Vec<u64> {
    // −0 and 0 are one load
    values.iter().map(|v| (v + 0.0).to_bits()).collect()
}

/// The load history of one series.
struct History {
    last: Wrench<f64>,
    turned_at: Wrench<f64>,
}

fn inner(a: &Wrench<f64>, b: &Wrench<f64>) -> f64 {
    a.to_vector().iter().zip(&b.to_vector()).map(|(a, b)| a * b).sum()
}

/// Share of the largest force within which recorded wrenches are of one nominal load.
const REPEAT_TOLERANCE: f64 = 0.02;
/// The same in standard deviations of the difference of two, where the load cell's noise is declared and greater.
const REPEAT_TOLERANCE_SD: f64 = 3.0;
/// Share of the largest force within which the loads where the history turned are one, under loads of one name.
const PEAK_TOLERANCE: f64 = 0.1;

/// Whether two wrenches are of one nominal load, within a share of the largest force: a load cell records each repeat a little
/// differently.
fn are_repeats(a: &Wrench<f64>, b: &Wrench<f64>, share: f64) -> bool {
    let forces = |w: &Wrench<f64>| {
        let [x, y, z, mx, my, mz] = w.to_vector().into();
        [x, y, z, mx / ROTATION_ARM_M, my / ROTATION_ARM_M, mz / ROTATION_ARM_M]
    };
    let (a, b) = (forces(a), forces(b));
    let largest = a.iter().chain(&b).fold(0.0, |m: f64, v| m.max(v.abs()));
    a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= share * largest)
}

impl History {
    /// Takes the next load, with its direction as the file marks it.
    fn step(&mut self, load: &Wrench<f64>, direction: &str) {
        let (along, before) = (inner(load, &self.last), inner(&self.last, &self.last));
        // past the half way back, or marked as such, the load is going down from the last one
        let shrinking = along < before && before > 0.0;
        let growing = along > before && before > 0.0;
        let came_down = inner(&self.turned_at, &self.turned_at) > 0.0;
        match direction {
            "unload" if !came_down && before > 0.0 => self.turned_at = self.last,
            "unload" if !came_down => {
                // nothing known of the peak: some way above
                self.turned_at = Wrench::from_vector(load.to_vector() * 2.0);
            }
            "load" => self.turned_at = Wrench::ZERO,
            "" if shrinking && !came_down => self.turned_at = self.last,
            "" if growing => self.turned_at = Wrench::ZERO,
            _ => {}
        }
        self.last = *load;
    }
}

/// Loads under which readings were repeated at one pose and point: name, wrench and turning point, number of the repeat.
type Loads = Vec<(String, [Wrench<f64>; 2], usize)>;

/// Which readings are repeats of one another.
struct Repeats {
    seen: HashMap<Vec<u64>, Loads>,
    count: usize,
}

impl Repeats {
    /// The number of a reading's repeats: those at one place whose loads are of one name or nominally the same.
    fn number(
        &mut self,
        place: Vec<u64>,
        name: &str,
        [wrench, turned_at]: [&Wrench<f64>; 2],
        load_random: f64,
    ) -> usize {
        let same_load = REPEAT_TOLERANCE.max(REPEAT_TOLERANCE_SD * 2.0_f64.sqrt() * load_random);
        let loads = self.seen.entry(place).or_default();
        let is_same = |(other, [own, own_turned], _): &&(String, [Wrench<f64>; 2], usize)| {
            let are_repeats = |a, b| are_repeats(a, b, same_load);
            // of one name whatever was recorded, on the way back from about the same load
            if !name.is_empty() && name == *other {
                return self::are_repeats(own_turned, turned_at, PEAK_TOLERANCE.max(same_load));
            }
            are_repeats(own, wrench) && are_repeats(own_turned, turned_at)
        };
        if let Some((.., number)) = loads.iter().find(is_same) {
            return *number;
        }
        loads.push((name.to_owned(), [*wrench, *turned_at], self.count));
        self.count += 1;
        self.count - 1
    }
}

/// The deflection of a row in m and rad; `most` keeps the most digits behind the point of each channel.
fn deflection(sheet: &Sheet, row: &Row, most: &mut [usize; CHANNELS]) -> Result<[Option<f64>; CHANNELS]> {
    let mut observed = [None; CHANNELS];
    for (c, column) in READ_COLUMNS.iter().enumerate() {
        observed[c] = sheet.optional(row, column)?.map(|v| v * 1e-6);
        if observed[c].is_some() {
            most[c] = most[c].max(decimals(sheet.cell(row, column)?));
        }
    }
    Ok(observed)
}

impl Readings {
    /// Reads a measured file, also as laboratories export it.
    ///
    /// # Errors
    /// See [`Measured::read`]; anything that is wrong with a row; no reading at all.
    pub fn read(source: Source, machine: &MachineFile) -> Result<Self> {
        Self::read_renamed(source, machine, &Renames::default())
    }

    /// Reads a measured file some of whose columns are called otherwise.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_renamed(source: Source, machine: &MachineFile, renames: &Renames) -> Result<Self> {
        let (sheet, this) = Self::read_conditions(source, machine, renames)?;
        this.require_deflections(&sheet)?;
        Ok(this)
    }

    /// Reads a measured file of which the deflections don't matter, and its cells as they stand.
    ///
    /// # Errors
    /// See [`Measured::read`]; anything that is wrong with a row.
    pub fn read_conditions(source: Source, machine: &MachineFile, renames: &Renames) -> Result<(Sheet, Self)> {
        let (sheet, cases) = Measured::read(source, machine, renames)?.complete()?;
        let this = Self::new(&sheet, &cases, machine.uncertainty.load_random)?;
        Ok((sheet, this))
    }

    /// Refuses a file in which nothing was measured.
    ///
    /// # Errors
    /// No column of deflections, or nothing in them.
    pub fn require_deflections(&self, sheet: &Sheet) -> Result<()> {
        if !READ_COLUMNS.iter().any(|c| sheet.has(c)) {
            let why = ": a measured file needs at least one deflection column";
            return Err(sheet.missing(READ_COLUMNS[0], why));
        }
        if self.readings.iter().all(|r| r.observed.iter().all(Option::is_none)) {
            let message = "expected readings, found blank deflection columns only";
            return Err(Failure::input(message).in_file(&sheet.source.name));
        }
        Ok(())
    }

    /// Readings of rows, a load case each; `load_random` is the relative noise of the load cell in rows that have none of their own.
    ///
    /// # Errors
    /// A cell that is no number.
    pub fn new(sheet: &Sheet, cases: &[LoadCase], load_random: f64) -> Result<Self> {
        let mut poses: Vec<NamedPose> = Vec::new();
        let mut repeats = Repeats { seen: HashMap::new(), count: 0 };
        let (mut pose_index, mut conditions_seen) = (HashMap::new(), HashMap::new());
        let mut series_index: HashMap<String, usize> = HashMap::new();
        let mut series_names = Vec::new();
        let mut histories: HashMap<usize, History> = HashMap::new();
        let mut zeros = Zeros::default();
        let (mut conditions, mut readings) = (Vec::new(), Vec::new());
        let mut digits = [0; CHANNELS];
        let has_temperature = sheet.has("temperature_c");
        let mut has_unloading = false;
        for (n, (row, case)) in sheet.rows.iter().zip(cases).enumerate() {
            let observed = deflection(sheet, row, &mut digits)?;
            let sigma = [sheet.optional(row, "sigma_linear_um")?, sheet.optional(row, "sigma_angular_urad")?]
                .map(|s| s.map(|v| v * 1e-6));
            let p = &case.pose.pose;
            let pose = *pose_index.entry(bits(&[p.theta_rad, p.sigma_rad, p.z0_m])).or_insert_with(|| {
                poses.push(case.pose.clone());
                poses.len() - 1
            });
            let series_name = if sheet.has("series") { sheet.cell(row, "series")?.to_owned() } else { String::new() };
            // without a name a row is on its own
            let key = if series_name.is_empty() { format!("\0{n}") } else { series_name.clone() };
            let series = *series_index.entry(key).or_insert_with(|| {
                series_names.push(series_name);
                series_names.len() - 1
            });
            let direction = if sheet.has("direction") { sheet.cell(row, "direction")? } else { "" };
            let Warmth { temperature_c, rise_k } = zeros.step(sheet, row, &case.wrench)?;
            let history =
                histories.entry(series).or_insert_with(|| History { last: Wrench::ZERO, turned_at: Wrench::ZERO });
            history.step(&case.wrench, direction);
            has_unloading |= inner(&history.turned_at, &history.turned_at) > 0.0;
            let condition = Condition {
                pose,
                wrench: case.wrench,
                point_m: case.point_m,
                turned_at: history.turned_at,
                temperature_c,
                rise_k,
                gauge: case.gauge,
            };
            let name = if sheet.has("load") { sheet.cell(row, "load")? } else { "" };
            let own_random = sheet.optional(row, LOAD_RANDOM_COLUMN)?;
            let scatter = own_random.unwrap_or(load_random);
            let loads = [&case.wrench, &history.turned_at];
            let repeat_of = repeats.number(condition.key_of_place(), name, loads, scatter);
            let condition = *conditions_seen.entry(condition.key()).or_insert_with(|| {
                conditions.push(condition);
                conditions.len() - 1
            });
            let covariance = case.covariance.clone().map(Arc::new);
            readings.push(Reading {
                line: row.line,
                condition,
                repeat_of,
                series,
                observed,
                sigma,
                covariance,
                load_random: own_random,
            });
        }
        let written = digits.map(|d| 1e-6 * 10_f64.powi(-(d.min(12) as i32)));
        let resolution = steps(&readings, written);
        Ok(Self {
            source: sheet.source.clone(),
            poses,
            conditions,
            readings,
            series_names,
            resolution,
            has_temperature,
            has_unloading,
            has_lengths: sheet.has("q1_mm") && !sheet.has("theta_deg"),
            warnings: sheet.warnings.clone(),
        })
    }

    /// The same poses and conditions without some of the readings.
    pub fn without(&self, left_out: impl Fn(&Reading) -> bool) -> Self {
        let mut rest = self.clone();
        rest.readings.retain(|r| !left_out(r));
        rest
    }

    /// Those of one pose, with its conditions alone.
    pub fn at_pose(&self, pose: usize) -> Self {
        let own: Vec<usize> = (0..self.conditions.len()).filter(|c| self.conditions[*c].pose == pose).collect();
        let mut number = vec![None; self.conditions.len()];
        own.iter().enumerate().for_each(|(n, c)| number[*c] = Some(n));
        let of_pose = |r: &Reading| Some(Reading { condition: number[r.condition]?, ..r.clone() });
        Self {
            poses: vec![self.poses[pose].clone()],
            conditions: own.iter().map(|c| Condition { pose: 0, ..self.conditions[*c] }).collect(),
            readings: self.readings.iter().filter_map(of_pose).collect(),
            // field by field: a clone of all readings for each pose would take its time
            source: self.source.clone(),
            series_names: self.series_names.clone(),
            resolution: self.resolution,
            has_temperature: self.has_temperature,
            has_unloading: self.has_unloading,
            has_lengths: self.has_lengths,
            warnings: self.warnings.clone(),
        }
    }

    /// The same, in the same order, with each repeat of a pose as a pose of its own: the first readings of its conditions, the second
    /// ones, and so on. `None` without repeats.
    pub fn by_repeat(&self) -> Option<Self> {
        let mut count = BTreeMap::new();
        let mut poses: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        let mut split = Self { poses: Vec::new(), conditions: Vec::new(), ..self.clone() };
        for r in &mut split.readings {
            let repeat = count.entry(r.repeat_of).or_insert(0);
            let condition = &self.conditions[r.condition];
            let own = condition.pose;
            let pose = *poses.entry((own, *repeat)).or_insert_with(|| {
                split.poses.push(NamedPose { line: r.line, ..self.poses[own].clone() });
                split.poses.len() - 1
            });
            r.condition = split.conditions.len();
            split.conditions.push(Condition { pose, ..*condition });
            *repeat += 1;
        }
        (poses.len() > self.poses.len()).then_some(split)
    }

    /// The same without single numbers: pairs of reading and channel.
    pub fn without_numbers(&self, left_out: &[(usize, usize)]) -> Self {
        let mut rest = self.clone();
        for (reading, channel) in left_out {
            rest.readings[*reading].observed[*channel] = None;
        }
        rest
    }

    /// How many poses have any reading.
    pub fn read_poses(&self) -> usize {
        let read = self.readings.iter().filter(|r| r.observed.iter().any(Option::is_some));
        read.map(|r| self.conditions[r.condition].pose).collect::<BTreeSet<usize>>().len()
    }

    /// Which channels have any reading.
    pub fn channels(&self) -> [bool; CHANNELS] {
        std::array::from_fn(|c| self.readings.iter().any(|r| r.observed[c].is_some()))
    }
}

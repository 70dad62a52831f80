//! The files that a diagnosis leaves: for the controller the machine with its effects and a residual correction table, for people
//! the residual of every reading.

use std::collections::HashSet;

use pkm_core::effects::EFFECTS;
use pkm_core::{Deflection, Machine, Pose, Stiffness, StiffnessError, StiffnessFactor};
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value, value};

use super::Diagnosis;
use super::compare::{Rival, extent};
use crate::error::{Failure, Result};
use crate::files::dataset::{READ_COLUMNS, StiffnessData, Target};
use crate::files::elements;
use crate::files::machine::MachineFile;
use crate::files::readings::{GAUGE, Readings};
use crate::files::results::ShownReading;
use crate::files::source::Source;
use crate::files::table::TableFile;
use crate::fit::export::{Provenance, rust_source};
use crate::fit::{self, Fit, TermChoice};
use crate::pose::{NamedPose, pose_of, tidy, written_units};

/// Levels of each variable at which the residual correction table is fitted.
pub(super) const LEVELS: usize = 5;

/// Share of the noise of a reading by which the table that is written may differ from the one that was judged without a warning.
const MAX_DEPARTURE: f64 = 0.2;

/// Changes a number of the file, unless it holds this value already.
pub(crate) fn set(item: &mut Item, number: f64) {
    match item.as_value_mut() {
        Some(there) => set_value(there, number),
        None => *item = value(number),
    }
}

fn set_value(there: &mut Value, number: f64) {
    if there.as_float().or_else(|| there.as_integer().map(|i| i as f64)) != Some(number) {
        let decor = there.decor().clone();
        *there = number.into();
        *there.decor_mut() = decor;
    }
}

/// The machine file with re-identified stiffnesses and effects; all else as it stood.
///
/// # Errors
/// None for a file that was read before.
pub fn machine_toml(file: &MachineFile, diagnosis: &Diagnosis) -> Result<String> {
    let mut document: DocumentMut =
        file.source.text()?.parse().map_err(|e: toml_edit::TomlError| Failure::other(e.to_string()))?;
    let Diagnosis { machine, .. } = diagnosis;
    for (i, limb) in machine.limbs.iter().enumerate() {
        for (joint, numbers) in [("base_joint", &limb.base_joint), ("platform_joint", &limb.platform_joint)] {
            for axis in 0..3 {
                let item = &mut document["limb"][i][joint];
                set_entry(&mut item["linear_n_per_m"], axis, numbers.linear_n_per_m[axis]);
                set_entry(&mut item["angular_nm_per_rad"], axis, numbers.angular_nm_per_rad[axis]);
            }
        }
        for (name, tube) in [("rod", &limb.body.rod), ("screw", &limb.body.screw)] {
            let item = &mut document["limb"][i]["body"][name];
            set(&mut item["young_gpa"], tube.young_pa / 1e9);
            set(&mut item["shear_gpa"], tube.shear_pa / 1e9);
        }
    }
    document.remove("effect");
    let mut effects = ArrayOfTables::new();
    for (info, values) in EFFECTS.iter().zip(machine.effects.parameters) {
        if values.iter().all(|v| *v == 0.0) {
            continue;
        }
        let mut table = Table::new();
        table["id"] = value(info.id);
        for (name, v) in info.names().zip(values).filter(|(_, v)| *v != 0.0) {
            table[name] = value(v);
        }
        effects.push(table);
    }
    if !effects.is_empty() {
        document["effect"] = Item::ArrayOfTables(effects);
    }
    document.remove("element");
    if let Some(tables) = elements::tables(&machine.effects.elements) {
        document["element"] = Item::ArrayOfTables(tables);
    }
    Ok(document.to_string())
}

fn set_entry(array: &mut Item, i: usize, number: f64) {
    if let Some(entry) = array.as_array_mut().and_then(|a| a.get_mut(i)) {
        set_value(entry, number);
    }
}

/// What the final model leaves of every reading and channel, in the units of the columns.
pub fn residuals_csv(readings: &Readings, diagnosis: &Diagnosis) -> String {
    let mut csv = "line,column,read,said,residual,standard_deviation,standardised,excluded\n".to_owned();
    let said = diagnosis.own.of(Rival::After);
    let left_out: HashSet<&(usize, usize)> = diagnosis.left_out.iter().collect();
    for (n, r) in readings.readings.iter().enumerate() {
        for (c, column) in READ_COLUMNS.iter().enumerate() {
            let Some(read) = r.observed[c] else { continue };
            let sd = diagnosis.standard_deviations[n][c];
            let said = said[r.condition][c];
            let excluded = left_out.contains(&(n, c));
            let residual = read - said;
            let standardised = if excluded { residual / sd } else { diagnosis.standardised[n][c] };
            let numbers = [read * 1e6, said * 1e6, residual * 1e6, sd * 1e6, standardised].map(|v| format!("{v:.6}"));
            csv += &format!("{},{column},{},{}\n", r.line, numbers.join(","), u8::from(excluded));
        }
    }
    csv
}

/// Every reading with what the model says of it as declared and as identified, to the nanometre and the nanoradian.
pub fn shown_readings(readings: &Readings, diagnosis: &Diagnosis) -> Vec<ShownReading> {
    let micro = |v: f64| (v * 1e9).round() / 1e3;
    let left_out: HashSet<usize> = diagnosis.left_out.iter().map(|(n, _)| *n).collect();
    let rows = readings.readings.iter().enumerate().map(|(n, r)| {
        let c = &readings.conditions[r.condition];
        let [theta_deg, sigma_deg, z0_mm] = written_units(&readings.poses[c.pose].pose);
        let channels = c.channels();
        let said = |rival: Rival| {
            let mut shown = [0.0; GAUGE];
            for (to, from) in shown.iter_mut().zip(&diagnosis.own.of(rival)[r.condition][channels.clone()]) {
                *to = micro(*from);
            }
            shown
        };
        let mut read = [None; GAUGE];
        for (to, from) in read.iter_mut().zip(&r.observed[channels.clone()]) {
            *to = from.map(micro);
        }
        ShownReading {
            line: r.line,
            theta_deg,
            sigma_deg,
            z0_mm,
            point_mm: c.point_m.map(|m| tidy(m * 1e3)),
            wrench: <[f64; 6]>::from(c.wrench.to_vector()).map(tidy),
            gauge: c.gauge,
            read,
            before: said(Rival::Declared),
            after: said(Rival::After),
            excluded: left_out.contains(&n),
        }
    });
    rows.collect()
}

/// What the controller gets.
pub struct Shipped {
    /// `coefficients.rs`.
    pub rust: String,
    /// `coefficients.json`.
    pub table: TableFile,
    /// By how much its translations differ from those of the model that was judged, on the readings: rms, µm; none
    /// where one of them has no stiffness at some pose.
    pub departure_um_rms: Option<f64>,
    /// Where no correction is applied, or not the one that was judged.
    pub warnings: Vec<String>,
}

/// Rms difference of the translations that two stiffnesses give under the loads of the readings, µm.
fn departure(
    readings: &Readings,
    judged: &dyn Fn(&Pose<f64>) -> Result<StiffnessFactor<f64>>,
    shipped: &dyn Fn(&Pose<f64>) -> Result<StiffnessFactor<f64>>,
) -> Result<f64> {
    let failed = |e: StiffnessError| Failure::other(e.to_string());
    let factors = readings.poses.iter().map(|p| Ok([judged(&p.pose)?, shipped(&p.pose)?]));
    let factors: Vec<[StiffnessFactor<f64>; 2]> = factors.collect::<Result<_>>()?;
    let mut sum = 0.0;
    for c in &readings.conditions {
        let at_a = c.wrench.moved_to_a(c.point_m.into());
        let [a, b] = &factors[c.pose];
        let seen = |d: Deflection<f64>| d.seen_at(c.point_m.into()).translation_m;
        let difference = seen(a.deflection(&at_a).map_err(failed)?) - seen(b.deflection(&at_a).map_err(failed)?);
        sum += difference.norm_squared();
    }
    Ok(1e6 * (sum / readings.conditions.len() as f64).sqrt())
}

/// The table of the stiffnesses with the correction or, where there can be none of these, of the machine's own, and why.
fn with_correction(
    machine: &Machine<f64>,
    source: &Source,
    poses: &[NamedPose],
    corrected: Result<Vec<Stiffness<f64>>>,
) -> Result<(Fit, Option<String>)> {
    let fitted = |stiffnesses: Vec<Stiffness<f64>>| {
        let targets = stiffnesses.iter().map(|k| Target { principal: k.principal().into(), full: Some(*k) }).collect();
        let data = StiffnessData { source: source.clone(), poses: poses.to_vec(), targets, warnings: Vec::new() };
        fit::fit(fit::samples(machine, data)?, None, TermChoice::Full)
    };
    match corrected.and_then(fitted) {
        Ok(fit) => Ok((fit, None)),
        Err(e) => {
            let why = e.message;
            let warning =
                format!("no residual correction table: {why}; coefficients.rs holds the identified machine alone");
            let own: std::result::Result<Vec<_>, _> = poses.iter().map(|p| machine.stiffness(&p.pose)).collect();
            Ok((fitted(own.map_err(|e| Failure::other(e.to_string()))?)?, Some(warning)))
        }
    }
}

/// `coefficients.rs` and its table: the improved machine, and the correction that the readings ask for beyond it, compared on the
/// readings with the model that was judged.
///
/// # Errors
/// A machine without stiffness somewhere in that box.
pub fn table(
    declared: &MachineFile,
    improved: &MachineFile,
    readings: &Readings,
    diagnosis: &Diagnosis,
) -> Result<Shipped> {
    let bounds = extent(readings);
    let machine = improved.below_tool()?;
    let mut poses = Vec::new();
    for n in 0..LEVELS.pow(3) {
        let [i, j, k] = [n % LEVELS, n / LEVELS % LEVELS, n / LEVELS.pow(2)];
        let [theta, sigma, z0] = bounds.level([LEVELS; 3], [i, j, k]);
        let pose = pose_of(theta, sigma, z0);
        if machine.inverse(&pose).is_ok() {
            poses.push(NamedPose { id: format!("G{:03}", n + 1), line: 1, pose });
        }
    }
    let corrected: Result<Vec<_>> =
        poses.iter().map(|p| diagnosis.fitted.residual_table().stiffness(&p.pose)).collect();
    let (mut fit, left_out) = with_correction(&machine, &readings.source, &poses, corrected)?;
    let is_corrected = left_out.is_none();
    let mut warnings: Vec<String> = left_out.into_iter().collect();
    // of the correction as well, where there is one
    fit.uncertainty = diagnosis.table_uncertainty.clone().filter(|_| is_corrected);
    if is_corrected && fit.uncertainty.is_none() {
        let why = "the machine has no stiffness at a pose of a reading, or a deviation away from what was estimated";
        warnings.push(format!("coefficients.rs does not say how far its table may be off: {why}"));
    }
    let trained = fit::evaluate(&fit.training, &machine, improved.wrist_parameters.tip_at_zero_m(), &fit.numbers)?;
    let file = fit.table_file(improved, &readings.source);
    let command = format!(
        "pkm-host diagnose --machine {} --data {} (table: what the readings ask for beyond the effects, on a grid)",
        declared.source.file_name(),
        readings.source.file_name()
    );
    let (training, poses) = (&trained, readings.poses.len());
    let provenance = Provenance { command: &command, file: &file, poses, verification: None, training, verified: None };
    let failed = |e: &dyn std::fmt::Display| Failure::other(e.to_string());
    let numbers = fit.numbers.table()?;
    let judged = |pose: &Pose<f64>| {
        if is_corrected {
            diagnosis.fitted.residual_table().stiffness(pose)?.factor().map_err(|e| failed(&e))
        } else {
            machine.stiffness(pose).and_then(|k| k.factor()).map_err(|e| failed(&e))
        }
    };
    let shipped = |pose: &Pose<f64>| Ok(numbers.factor_form(&machine, pose).map_err(|e| failed(&e))?.factor);
    let departure_um_rms = departure(readings, &judged, &shipped).ok();
    let variances = [0, 1, 2, GAUGE].map(|c| diagnosis.noise.variance(c));
    let limit_um = MAX_DEPARTURE * 1e6 * variances.into_iter().fold(0.0, f64::max).sqrt();
    if let Some(departure_um_rms) = departure_um_rms.filter(|d| *d > limit_um) {
        warnings.push(format!(
            "the table of coefficients.rs differs from the one that was judged by {departure_um_rms:.3} µm rms on the readings, more \
             than {limit_um:.3} µm, a part of their noise: hold it against readings of its own"
        ));
    }
    let rust = rust_source(&provenance, &fit, improved)?;
    Ok(Shipped { rust, table: file, departure_um_rms, warnings })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_correction_that_would_be_negative_is_left_out_and_said() {
        let source = Source::embedded(pkm_fixtures::MACHINE);
        let machine = MachineFile::parse(source.clone()).unwrap().below_tool().unwrap();
        let axis = [-1.0, -0.5, 0.0, 0.5, 1.0];
        let mut poses = Vec::new();
        for (i, j, k) in (0..125).map(|n| (n % 5, n / 5 % 5, n / 25)) {
            let pose = pose_of(10.0 * axis[i], 10.0 * axis[j], 530.0 + 30.0 * axis[k]);
            poses.push(NamedPose { id: format!("{i}{j}{k}"), line: 1, pose });
        }
        let own: Vec<Stiffness<f64>> = poses.iter().map(|p| machine.stiffness(&p.pose).unwrap()).collect();
        let (whole, said) = with_correction(&machine, &source, &poses, Ok(own.clone())).unwrap();
        assert_eq!(said, None);
        let negative = own.iter().map(|k| Stiffness::from_lower(&-k.matrix())).collect();
        let (alone, said) = with_correction(&machine, &source, &poses, Ok(negative)).unwrap();
        assert!(said.unwrap().contains("holds the identified machine alone"));
        assert_eq!(format!("{:?}", alone.numbers), format!("{:?}", whole.numbers));
    }
}

//! What a sensor reads on a machine with given parameters: the core's deflection, and errors of the measurement.

use std::collections::HashMap;

use nalgebra::{Matrix6, Vector3, Vector6};
use pkm_core::effects::MAX_PARAMETERS;
use pkm_core::{Deflection, LoadResponse, Machine, MachineParameters, Pose, Wrench};

use super::model::MEASUREMENT;
use crate::files::readings::{CHANNELS, Condition};

/// Parameters of a machine and of a measurement, at which predictions are made.
#[derive(Clone, Debug)]
pub struct State {
    /// Of the machine.
    pub machine: MachineParameters,
    /// By effect and parameter, as in [`MEASUREMENT`].
    pub measurement: [[f64; MAX_PARAMETERS]; MEASUREMENT.len()],
}

/// What determines the deflections of a machine at a pose: its compliance, as poses have more loads than a wrench has
/// components, and what depends on the load.
type Answer<'a> = (Matrix6<f64>, LoadResponse<'a, f64>);

fn answer<'a>(machine: &'a Machine<f64>, pose: &Pose<f64>) -> Option<Answer<'a>> {
    Some((compliance(machine, pose)?, machine.load_response(pose).ok()?))
}

/// Compliance of a machine at A, by the deflections under unit wrenches.
pub fn compliance(machine: &Machine<f64>, pose: &Pose<f64>) -> Option<Matrix6<f64>> {
    let factor = machine.stiffness(pose).ok()?.factor().ok()?;
    let mut compliance = Matrix6::zeros();
    for (i, mut column) in compliance.column_iter_mut().enumerate() {
        let unit = Wrench::from_vector(Vector6::ith(i, 1.0));
        column.copy_from(&factor.deflection(&unit).ok()?.to_vector());
    }
    Some(compliance)
}

impl State {
    /// A machine that is measured without errors.
    pub fn of(machine: MachineParameters) -> Self {
        Self { machine, measurement: [[0.0; MAX_PARAMETERS]; MEASUREMENT.len()] }
    }

    /// What the sensor reads in each condition, m and rad.
    pub fn predict(&self, poses: &[Pose<f64>], conditions: &[Condition]) -> Option<Vec<[f64; CHANNELS]>> {
        let machine = Machine::<f64>::new(&self.machine).ok()?;
        let [rotation, scale, gain, point] = self.measurement;
        let loaded = |w: &Wrench<f64>, at: [f64; 3]| {
            let w = Wrench { force_n: w.force_n * (1.0 + gain[0]), moment_nm: w.moment_nm * (1.0 + gain[1]) };
            w.moved_to_a(Vector3::new(at[0] + point[0], at[1] + point[1], at[2] + point[2]))
        };
        let effects = &self.machine.effects;
        let (warms, grows) = (effects.soften_with_temperature(), effects.grow_with_temperature());
        let warmth = |c: &Condition| if warms { c.temperature_c.to_bits() } else { 0 };
        let machines: HashMap<u64, Machine<f64>> = if warms {
            let warm = |c: &Condition| Some((warmth(c), machine.at_temperature(c.temperature_c).ok()?));
            conditions.iter().map(warm).collect::<Option<_>>()?
        } else {
            HashMap::from([(0, machine)])
        };
        // one stiffness a pose and, if it changes with that, temperature
        let mut at: Vec<Vec<(u64, &Machine<f64>, Answer<'_>)>> = vec![Vec::new(); poses.len()];
        let mut found = Vec::with_capacity(conditions.len());
        for c in conditions {
            let (pose, there) = (&poses[c.pose], &mut at[c.pose]);
            let known = there.iter().position(|a| a.0 == warmth(c));
            let n = known.unwrap_or(there.len());
            if known.is_none() {
                let machine = machines.get(&warmth(c))?;
                there.push((warmth(c), machine, answer(machine, pose)?));
            }
            let (_, machine, (compliance, response)) = &there[n];
            let wrench = loaded(&c.wrench, c.point_m);
            let turned_at = loaded(&c.turned_at, c.point_m);
            let linear = Deflection::from_vector(compliance * wrench.to_vector());
            let mut d = linear.plus(&response.deflection(&wrench, &turned_at).ok()?);
            if grows {
                d = d.plus(&machine.thermal_deflection(pose, c.rise_k).ok()?);
            }
            let d = d.seen_at(c.point_m.into());
            let turned = |v: Vector3<f64>, scale: f64| -> [f64; 3] {
                let [x, y, z, ..] = rotation;
                [
                    (v[0] + y * v[2] - z * v[1]) * (1.0 + scale),
                    (v[1] + z * v[0] - x * v[2]) * (1.0 + scale),
                    (v[2] + x * v[1] - y * v[0]) * (1.0 + scale),
                ]
            };
            let ([x, y, z], [rx, ry, rz]) = (turned(d.translation_m, scale[0]), turned(d.rotation_rad, scale[1]));
            found.push(c.read([x, y, z, rx, ry, rz]));
        }
        Some(found)
    }
}

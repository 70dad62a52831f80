//! What a weight does in the component, against the host's compensator.

use std::fmt::Write as _;
use std::path::Path;

use pkm_core::compensator::{CarriedWeight, Compensator, CompensatorSettings, Reading, Weight};
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::{Configuration, FiveAxis, Model, Pose, Wrench};

use super::in_file_units;
use super::learning::{Session, expect};
use super::replay::Host;
use crate::Outcome;

/// `PKM_ERROR_WEIGHT_NO_REFERENCE`.
const NO_REFERENCE: f64 = 88.0;
/// Force along x, y, z of the base in N, centre of mass in mm.
const PLATFORM: [[f64; 3]; 2] = [[600.0, -150.0, -480.0], [20.0, -10.0, 100.0]];
const TOOL: [[f64; 3]; 2] = [[150.0, -37.5, -120.0], [120.0, 10.0, -200.0]];

fn weight([force_n, centre_mm]: [[f64; 3]; 2]) -> Weight<f64> {
    Weight { force_n: force_n.into(), centre_m: Vector3::from(centre_mm) / 1e3 }
}

fn joints(five: &FiveAxis<'_, f64>, name: &str, at: &Configuration<f64>) -> Result<String, String> {
    let joints = in_file_units(&five.joints(at).map_err(|e| e.to_string())?);
    Ok(joints.iter().enumerate().map(|(n, joint)| format!("setp pkmcompensator.{name}-{n} {joint}\n")).collect())
}

/// Nothing is compensated without a place of the zero; with it, what the host's compensator says, and nothing at the zero.
pub fn weigh(out: &Path, host: &Host) -> Outcome {
    let (five, table) = (host.five()?, host.table()?);
    let place = |share: f64| {
        let part = |axis: usize, way: f64| host.table.centre[axis] + share * way * host.table.half_width[axis];
        Configuration {
            pose: Pose { theta_rad: part(0, 0.7), sigma_rad: part(1, -0.6), z0_m: part(2, 0.5) },
            beta_rad: Vector2::new(0.3, -0.2) * share,
        }
    };
    let (zero, at) = (place(0.0), place(1.0));
    let settings = CompensatorSettings { gain: 1.0, stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let mut compensator = Compensator::<f64, 5>::new(&settings).map_err(|e| e.to_string())?;
    let model = Model::new(five.machine, &table);
    let carried = CarriedWeight::<f64, 5>::new(&model, five.wrist, &weight(PLATFORM), &weight(TOOL), &zero);
    compensator.set_weight(Some(carried.map_err(|e| e.to_string())?));
    let reading = Reading { enabled: true, wrench: Wrench::ZERO, rise: 0.0.into() };
    for _ in 0..2000 {
        compensator.update(&model, five.wrist, &at, &reading);
    }
    let [a, b, c, d, e] = compensator.joints().into();
    let expected = [0.0, a * 1e3, b * 1e3, c * 1e3, d.to_degrees(), e.to_degrees()];
    if expected.iter().all(|offset| offset.abs() < 1e-3) {
        return Err(format!("the weight asks for next to nothing: {expected:?}"));
    }

    let mut lines = joints(&five, "joint", &at)?;
    for (whose, centre_axes, [force_n, centre_mm]) in [("platform", "uvw", PLATFORM), ("tool", "xyz", TOOL)] {
        for ((axis, centre_axis), (force, centre)) in
            "xyz".chars().zip(centre_axes.chars()).zip(force_n.into_iter().zip(centre_mm))
        {
            writeln!(lines, "setp pkmcompensator.{whose}-weight-{axis}-n {force}").ok();
            writeln!(lines, "setp pkmcompensator.{whose}-centre-{centre_axis}-mm {centre}").ok();
        }
    }
    let on = "loadusr -w sleep 1\nsetp pkmcompensator.enable 1\nloadusr -w sleep 2\n";
    let pins: Vec<String> =
        ["fault-code".to_owned()].into_iter().chain((0..5).map(|n| format!("offset-{n}"))).collect();
    let session = Session { out, host };
    let without = [NO_REFERENCE, 0.0, 0.0, 0.0, 0.0, 0.0];
    expect("a weight without a zero", &session.run(&format!("{lines}{on}"), &pins)?, &without, 0.0)?;
    let zeroed = lines + &joints(&five, "zeroed-at", &zero)?;
    // as many digits as HAL prints
    expect("a weight", &session.run(&format!("{zeroed}{on}"), &pins)?, &expected, 1e-6)?;
    // of a compensation that is on it waits
    let pins = [&["settings-pending".to_owned()], &pins[1..]].concat();
    let late = format!("setp pkmcompensator.enable 1\nloadusr -w sleep 0.3\n{zeroed}loadusr -w sleep 0.3\n");
    expect("a weight while it is on", &session.run(&late, &pins)?, &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], 1e-9)?;
    let taken = late + "setp pkmcompensator.enable 0\n" + on;
    expect("a weight after it was on", &session.run(&taken, &pins)?, &expected, 1e-6)?;
    let there = zeroed + &joints(&five, "joint", &zero)?;
    expect("a weight at the zero", &session.run(&format!("{there}{on}"), &pins)?, &[0.0; 6], 1e-9)?;
    println!(
        "  a weight: the host's offsets, none where the machine was zeroed, fault 88 without such a place; one that is set while it compensates waits"
    );
    Ok(())
}

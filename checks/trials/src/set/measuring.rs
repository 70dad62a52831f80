//! Which poses and loads are measured, which are held out, and what noise and loads that miss do to readings.

use std::collections::BTreeMap;

use nalgebra::{Vector3, Vector6};

use crate::Random;
use crate::effects::Needs;
use crate::machine::{Machine, Pose};
use crate::truth::{Row, Wrench};

/// Standard deviations of a reading (µm, µrad) and of a series' zero.
pub(super) const NOISE: [[f64; 2]; 2] = [[1.5, 0.7], [5.0, 2.5]];
/// Loads of a series, in order.
pub(super) struct Levels {
    pub force: &'static [f64],
    pub moment: &'static [f64],
    pub unload: bool,
}

pub(super) const LAYOUTS: [Levels; 6] = [
    Levels { force: &[200.0, 500.0, 1000.0], moment: &[30.0, 100.0], unload: true },
    Levels { force: &[500.0, 1000.0], moment: &[20.0, 50.0, 100.0], unload: false },
    Levels { force: &[200.0, 500.0, 1000.0], moment: &[], unload: true },
    Levels { force: &[100.0, 200.0, 400.0, 700.0, 1000.0], moment: &[50.0, 100.0], unload: false },
    Levels { force: &[100.0, 250.0, 500.0, 1000.0], moment: &[30.0, 100.0], unload: true },
    Levels { force: &[500.0, 1000.0], moment: &[], unload: false },
];

pub(super) fn layouts_for(needs: &[Needs]) -> Vec<usize> {
    let fits = |levels: &Levels| {
        needs.iter().all(|n| match n {
            Needs::Nothing | Needs::Temperature => true,
            Needs::Moments => !levels.moment.is_empty(),
            Needs::Levels => levels.force.len() >= 4,
            Needs::Unloading => levels.unload,
        })
    };
    (0..LAYOUTS.len()).filter(|i| fits(&LAYOUTS[*i])).collect()
}

/// A pose of the box, `wide` times as large.
pub(super) fn pose_in(rng: &mut Random, machine: &Machine, angle: f64, wide: f64) -> Pose {
    loop {
        let mut part = |limit: f64| rng.between(-limit, limit);
        let (theta, sigma, z) = (part(angle * wide), part(angle * wide), part(0.030 * wide));
        let round = |v: f64, digits: f64| (v * digits).round() / digits;
        let pose = Pose([
            round(theta.to_degrees(), 1e4).to_radians(),
            round(sigma.to_degrees(), 1e4).to_radians(),
            round(0.530 + z, 1e6),
        ]);
        let beyond = theta.abs() > angle || sigma.abs() > angle || z.abs() > 0.030;
        if machine.reaches(&pose) && (wide <= 1.0 || beyond) {
            return pose;
        }
    }
}

pub(super) fn plan(rng: &mut Random, poses: usize, levels: &Levels, soft_y: bool, temperature: bool) -> Vec<Row> {
    let mut rows = Vec::new();
    let (mut series, mut t) = (0, rng.between(19.0, 23.0));
    for pose in 0..poses {
        if temperature {
            // between poses time goes by
            t = (t + 2.0 * rng.normal()).clamp(17.0, 27.0);
        }
        for axis in 0..6 {
            let list = if axis < 3 { levels.force } else { levels.moment };
            if list.is_empty() {
                continue;
            }
            let share = if soft_y && axis == 1 { 0.5 } else { 1.0 };
            for sign in [1.0, -1.0] {
                for repeat in 1..=2 {
                    series += 1;
                    let up = list.iter().map(|l| (*l, false));
                    let falls = if levels.unload && axis < 3 { list.len() - 1 } else { 0 };
                    let down = list[..falls].iter().rev().map(|l| (*l, true));
                    for (level, unload) in up.chain(down) {
                        if temperature {
                            t = (t + 0.1 * rng.normal()).clamp(16.0, 28.0);
                        }
                        let wrench = Wrench::ith(axis, sign * level * share);
                        let temperature = if temperature { (t * 100.0).round() / 100.0 } else { 20.0 };
                        rows.push(Row { pose, wrench, applied: wrench, series, repeat, unload, temperature });
                    }
                }
            }
        }
    }
    rows
}

/// Poses and loads that were not measured.
#[derive(Clone, Debug)]
pub(super) struct HeldOut {
    pub poses: Vec<Pose>,
    pub rows: Vec<Row>,
    pub zones: Vec<&'static str>,
    pub values: Vec<Vector6<f64>>,
}

/// Draws `count` times 22 poses that were not measured.
pub(super) fn held_out(
    rng: &mut Random,
    machine: &Machine,
    angle: f64,
    moments: bool,
    temperature: bool,
    count: usize,
) -> HeldOut {
    let (mut poses, mut rows, mut zones) = (Vec::new(), Vec::new(), Vec::new());
    for n in 0..22 * count {
        let zone = ["inside", "beyond", "loads"][usize::from(n % 22 >= 8) + usize::from(n % 22 >= 16)];
        poses.push(pose_in(rng, machine, angle, if zone == "beyond" { 1.4 } else { 1.0 }));
        let t = if temperature { (rng.between(17.0, 26.0) * 100.0).round() / 100.0 } else { 20.0 };
        for k in 0..if zone == "loads" { 4 } else { 5 } {
            let mut wrench = Wrench::zeros();
            if zone == "loads" {
                let part = |v: Vector3<f64>, size: f64| v.map(|x| (x * size * 10.0).round() / 10.0);
                wrench.fixed_rows_mut::<3>(0).copy_from(&part(rng.direction(), 1500.0));
                let moment = part(rng.direction(), rng.between(20.0, 120.0));
                wrench.fixed_rows_mut::<3>(3).copy_from(&moment);
            } else {
                let sign = rng.pick(&[1.0, -1.0]);
                match k {
                    4 if moments => wrench[3 + rng.index(3)] = sign * 100.0,
                    3 | 4 => wrench[rng.index(3)] = sign * rng.pick(&[300.0, 700.0, 1000.0]),
                    axis => wrench[axis] = sign * rng.pick(&[300.0, 700.0, 1000.0]),
                }
            }
            let series = rows.len() + 1;
            rows.push(Row { pose: n, wrench, applied: wrench, series, repeat: 1, unload: false, temperature: t });
            zones.push(zone);
        }
    }
    HeldOut { poses, rows, zones, values: Vec::new() }
}

/// Per pose and direction of load: a small turn of the force and an error of its size.
pub(super) fn misaim(rows: &mut [Row], rng: &mut Random) {
    let (angle, gain) = (rng.between(2e-3, 5e-3), rng.between(5e-3, 1e-2));
    let mut found = BTreeMap::new();
    for row in rows {
        let sign: [i8; 6] =
            std::array::from_fn(|i| if row.wrench[i] == 0.0 { 0 } else { row.wrench[i].signum() as i8 });
        let (turn, size) = *found
            .entry((row.pose, sign))
            .or_insert_with(|| (rng.direction() * (angle * rng.normal().abs()), 1.0 + gain * rng.normal()));
        let rotation = nalgebra::Rotation3::new(turn);
        for part in [0, 3] {
            let v: Vector3<f64> = row.wrench.fixed_rows::<3>(part).into();
            row.applied.fixed_rows_mut::<3>(part).copy_from(&(rotation * v * size));
        }
    }
}

pub(super) fn noise(rows: &[Row], readings: &mut [Vector6<f64>], rng: &mut Random) {
    let mut zero = [0.0; 6];
    let mut series = usize::MAX;
    for (row, reading) in rows.iter().zip(readings) {
        if row.series != series {
            series = row.series;
            zero = std::array::from_fn(|i| NOISE[i / 3][1] * rng.normal());
        }
        for (i, v) in reading.iter_mut().enumerate() {
            *v += 1e-6 * (zero[i] + NOISE[i / 3][0] * rng.normal());
        }
    }
}

/// Readings in steps, as a dial has them; of rotations, µrad, five times as coarse ones.
pub(super) fn round(readings: &mut [Vector6<f64>], step_um: f64) {
    for reading in readings {
        for (i, v) in reading.iter_mut().enumerate() {
            let step = 1e-6 * step_um * if i < 3 { 1.0 } else { 5.0 };
            *v = (*v / step).round() * step;
        }
    }
}

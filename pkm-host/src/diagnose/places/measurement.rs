//! Blocks of the measurement: sensor, load, time.

use std::f64::consts::PI;
use std::sync::Arc;

use pkm_core::Pose;

use super::Blocks;
use super::elastic::{M8, Solved};
use super::terms::{Lag, Seen, Term};
use crate::files::readings::{CHANNELS, Condition, GAUGE};
use crate::pose::ROTATION_ARM_M;

/// ln prior of what needs an oddity of one campaign: drift, one pose, a matrix of cross-talk.
pub const LN_PRIOR_OF_ODDITIES: f64 = -4.0;
/// Unit of relative errors of sensors and loads.
pub const RELATIVE: f64 = 0.03;
/// Units of how far a machine stands beside its pose.
const BESIDE_RAD: f64 = 0.01;
const BESIDE_M: f64 = 0.005;

fn size(component: usize) -> f64 {
    if component < 3 { 1.0 } else { 1.0 / ROTATION_ARM_M }
}

/// Adds all of them. `solved` is the declared machine.
pub fn add(blocks: &mut Blocks<'_>, solved: &[Solved]) {
    let pairs = || (0..6).flat_map(|i| (0..6).map(move |j| (i, j)));
    let sensor = vec!["sensor".to_owned()];
    let load = vec!["load".to_owned()];
    blocks.add_with(&sensor, "general", "constant", pairs().map(cross_talk).collect(), 0, LN_PRIOR_OF_ODDITIES);
    blocks.add(&sensor, "general", "constant", (0..6).map(|i| cross_talk((i, i))).collect());
    blocks.add_with(
        &load,
        "general",
        "constant",
        pairs().map(|p| wrong_load(p, false)).collect(),
        0,
        LN_PRIOR_OF_ODDITIES,
    );
    blocks.add_with(&load, "general", "load", pairs().map(|p| wrong_load(p, true)).collect(), 0, LN_PRIOR_OF_ODDITIES);
    gain_by_load(blocks);
    not_linear(blocks);
    lagging(blocks);
    by_time(blocks, solved);
    let beside = beside_the_pose(blocks);
    blocks.add_with(&["geometry".into()], "general", "constant", beside, 0, LN_PRIOR_OF_ODDITIES);
    if blocks.looks_at_single_poses() {
        by_pose(blocks);
    }
}

/// A channel reads part of another.
pub fn cross_talk((i, j): (usize, usize)) -> Term {
    let unit = RELATIVE * size(i) / size(j);
    Term::Direct(Arc::new(move |s: &Seen<'_>| {
        let mut d = [0.0; 6];
        d[i] = unit * s.displacement[j];
        d
    }))
}

/// A component of the load acts in another, with its sign or without.
pub fn wrong_load((i, j): (usize, usize), even: bool) -> Term {
    let unit = RELATIVE * size(j) / size(i);
    Term::Direct(Arc::new(move |s: &Seen<'_>| {
        let w = if even { s.wrench[j].abs() } else { s.wrench[j] };
        std::array::from_fn(|r| s.compliance[(r, i)] * unit * w)
    }))
}

/// A load cell whose gain goes with the force. It is right at the usual force: else the machine's own stiffness as a whole would go with it.
fn gain_by_load(blocks: &mut Blocks<'_>) {
    let force = |c: &Condition| c.wrench.force_n.norm();
    let conditions = &blocks.readings.conditions;
    let squares: f64 = conditions.iter().map(|c| force(c).powi(2)).sum();
    let loaded = conditions.iter().filter(|c| force(c) > 0.0).count();
    if loaded > 0 {
        let usual = (squares / loaded as f64).sqrt();
        let laws: [fn(f64) -> f64; 2] = [|u| u - 1.0, |u| u * u - 1.0];
        let of = |law: fn(f64) -> f64| {
            Term::Direct(Arc::new(move |s: &Seen<'_>| {
                let [x, y, z, ..] = s.wrench;
                let force = (x * x + y * y + z * z).sqrt();
                // a moment alone is read by another part of the cell
                let gain = if force > 0.0 { RELATIVE * law(force / usual) } else { 0.0 };
                s.displacement.map(|d| gain * d)
            }))
        };
        blocks.add_with(&["load".into()], "general", "load", laws.map(of).into(), 0, LN_PRIOR_OF_ODDITIES);
    }
}

/// Channels with readings, and the rms of each, m and rad.
fn used(blocks: &Blocks<'_>) -> Vec<(usize, f64)> {
    let rms = |c: usize| {
        let squares: Vec<f64> = blocks.readings.readings.iter().filter_map(|r| r.observed[c]).map(|v| v * v).collect();
        (!squares.is_empty()).then(|| (c, (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()))
    };
    (0..CHANNELS).filter_map(rms).filter(|c| c.1 > 0.0).collect()
}

/// Sensors that are not linear. A gauge has no term of its own here: it reads what the terms of components leave along it.
fn not_linear(blocks: &mut Blocks<'_>) {
    let laws: [fn(f64) -> f64; 4] = [|u| u * u, |u| u * u.abs(), f64::abs, |u| u * u * u];
    let of = |(c, rms): (usize, f64)| {
        laws.map(|law| {
            Term::Direct(Arc::new(move |s: &Seen<'_>| {
                let mut d = [0.0; 6];
                d[c] = RELATIVE * rms * law(s.displacement[c] / rms);
                d
            }))
        })
    };
    let terms = used(blocks).into_iter().filter(|(c, _)| *c != GAUGE).flat_map(of).collect();
    blocks.add(&["sensor".into()], "general", "load", terms);
}

/// Sensors that lag behind: a gauge with friction in its stem, which stays where it is until the machine is away by so much, or one that
/// reads less while the load goes down, by a share of what it reads or by as much wherever it stands.
fn lagging(blocks: &mut Blocks<'_>) {
    let (whitener, unloading) = (&blocks.problem.whitener, blocks.readings.has_unloading);
    let of = |(c, rms): (usize, f64)| {
        let deviations =
            || (0..whitener.entries.len()).filter(|n| whitener.entries[*n].channel == c).map(|n| whitener.deviation(n));
        // a stem that holds less than the noise is not seen
        let noise = deviations().sum::<f64>() / deviations().count() as f64;
        let held = |by: f64| -> Lag {
            Arc::new(move |now, turned| {
                let stem = turned - turned.max(-by).min(by);
                RELATIVE * rms / by * (now - stem.max(now - by).min(now + by))
            })
        };
        let less = |law: fn(f64) -> f64| -> Lag {
            Arc::new(move |now, turned| if turned == 0.0 { 0.0 } else { RELATIVE * rms * law(now / rms) })
        };
        let mut lags: Vec<Lag> = [1.0, 3.0, 9.0, 27.0].map(|scale| held(scale * noise)).into();
        if unloading {
            lags.extend([less(|u| u), less(|u| (5.0 * u).tanh())]);
        }
        lags.into_iter().map(move |lag| Term::Lag(c, lag))
    };
    let terms = used(blocks).into_iter().flat_map(of).collect();
    blocks.add(&["sensor".into()], "general", "direction", terms);
}

/// Drift of the sensor, and limbs that yield more and more, over the order of the readings.
fn by_time(blocks: &mut Blocks<'_>, solved: &[Solved]) {
    let entries = &blocks.problem.whitener.entries;
    let rows = blocks.readings.readings.len() as f64;
    let mean = |r: &[usize]| r.iter().map(|r| 2.0 * *r as f64 / rows - 1.0).sum::<f64>() / r.len() as f64;
    let time: Vec<f64> = entries.iter().map(|e| mean(&e.readings)).collect();
    let mut drift = Vec::new();
    for (c, rms) in used(blocks) {
        let mut shape = |of: &dyn Fn(f64) -> f64| {
            let value = |(e, t): (&pkm_diagnosis::Entry, &f64)| {
                if e.channel == c { RELATIVE * rms * of(*t) } else { 0.0 }
            };
            drift.push(Term::Entry(Arc::new(entries.iter().zip(&time).map(value).collect())));
        };
        shape(&|t| t);
        shape(&|t| t * t - 1.0 / 3.0);
        for k in 1..4 {
            shape(&|t| (PI * f64::from(k) * t).sin());
            shape(&|t| (PI * f64::from(k) * t).cos());
        }
    }
    let usual = blocks.usual.0;
    let softer = |limb: usize| -> Vec<Term> {
        let mut e = M8::zeros();
        e[(3 * limb, 3 * limb)] = usual[(3 * limb, 3 * limb)];
        let e = Arc::new(vec![e; solved.len()]);
        let laws: [fn(f64) -> f64; 3] = [|t| t, |t| t * t, |t| (3.0 * t).tanh()];
        laws.map(|law| Term::Times(e.clone(), Arc::new(time.iter().map(|t| law(*t)).collect()))).into()
    };
    let softer: Vec<Vec<Term>> = (0..3).map(softer).collect();
    blocks.add_with(&["time".into(), "sensor".into()], "general", "time", drift, 0, LN_PRIOR_OF_ODDITIES);
    for (limb, terms) in softer.into_iter().enumerate() {
        let places = [super::limbs::part(limb, "body"), "time".into()];
        blocks.add_with(&places, "axial", "time", terms, 0, LN_PRIOR_OF_ODDITIES);
    }
}

/// A machine that stands beside the pose that the file has, everywhere by the same θ, σ or Z0: drives that were homed elsewhere, or an
/// angle and a height that were read from another zero.
pub fn beside_the_pose(blocks: &Blocks<'_>) -> Vec<Term> {
    let poses = || blocks.readings.poses.iter().map(|p| p.pose);
    let conditions = &blocks.readings.conditions;
    let moves: [fn(&mut Pose<f64>, f64); 3] = [
        |pose, unit| pose.theta_rad += unit * BESIDE_RAD,
        |pose, unit| pose.sigma_rad += unit * BESIDE_RAD,
        |pose, unit| pose.z0_m += unit * BESIDE_M,
    ];
    let of = |moved: fn(&mut Pose<f64>, f64)| {
        let at = |unit: f64| {
            let mut poses: Vec<Pose<f64>> = poses().collect();
            poses.iter_mut().for_each(|pose| moved(pose, unit));
            blocks.model.predict(&poses, conditions, &[], &[])
        };
        let (more, less) = (at(0.5)?, at(-0.5)?);
        let of = |e: &pkm_diagnosis::Entry| more[e.condition][e.channel] - less[e.condition][e.channel];
        Some(Term::Entry(Arc::new(blocks.problem.whitener.entries.iter().map(of).collect())))
    };
    moves.into_iter().filter_map(of).collect()
}

/// An offset of each channel at each pose.
fn by_pose(blocks: &mut Blocks<'_>) {
    let entries = &blocks.problem.whitener.entries;
    let pose_of = |e: &pkm_diagnosis::Entry| blocks.readings.conditions[e.condition].pose;
    let mut terms = Vec::new();
    for pose in 0..blocks.frames.len() {
        for (c, rms) in used(blocks) {
            let value =
                |e: &pkm_diagnosis::Entry| if e.channel == c && pose_of(e) == pose { RELATIVE * rms } else { 0.0 };
            terms.push(Term::Entry(Arc::new(entries.iter().map(value).collect())));
        }
    }
    blocks.add_with(&["sensor".into(), "load".into()], "general", "pose", terms, 0, LN_PRIOR_OF_ODDITIES);
}

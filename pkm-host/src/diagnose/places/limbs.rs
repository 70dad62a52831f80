//! Blocks of the limbs: joints, bodies, laws of the load, of temperature and of time.

use std::f64::consts::TAU;
use std::sync::Arc;

use pkm_core::effects::Place;
use pkm_core::thermal::DECLARED_TEMPERATURE_C;

use super::coupled::Written;
use super::elastic::{Frame, M6, M8, V8};
use super::terms::{Term, alike, rows, symmetric};
use super::{Blocks, local};
use crate::diagnose::declared::Declared;

/// Index of the axial force of each limb among the transmitted wrenches.
pub const AXIAL: [usize; 3] = [0, 3, 6];
/// Transmitted wrenches of each limb.
const OWN: [std::ops::Range<usize>; 3] = [0..3, 3..6, 6..8];
/// Limbs that may be alike, by themselves and together.
const GROUPS: [&[usize]; 5] = [&[0], &[1], &[2], &[0, 1], &[0, 1, 2]];
/// Pitches of periodic compliances, mm: usual leads of screws, and twice and thrice these.
const PITCHES_MM: [f64; 12] = [5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 16.0, 20.0, 25.0, 32.0, 40.0, 60.0];

/// Name of a limb's part.
pub fn part(limb: usize, name: &str) -> String {
    format!("limb.{}.{name}", limb + 1)
}

fn bodies(limbs: &[usize]) -> Vec<String> {
    limbs.iter().map(|i| part(*i, "body")).collect()
}

/// Adds all blocks of the limbs.
pub fn add(blocks: &mut Blocks<'_>) {
    joints(blocks);
    for (motion, first, last) in [("axial", 0, 1), ("lateral", 1, 3), ("general", 0, 3)] {
        for degree in 0..3 {
            body(blocks, motion, first..last, degree);
        }
    }
    twist(blocks);
    periodic(blocks);
    local::add(blocks);
    load(blocks);
    if blocks.readings.has_unloading {
        direction(blocks);
    }
    if blocks.readings.has_temperature {
        temperature(blocks);
    }
}

/// What a joint may yield, in units of its own declared compliances.
fn joints(blocks: &mut Blocks<'_>) {
    for (joint, name) in ["base_joint", "platform_joint"].into_iter().enumerate() {
        for coupled in [false, true] {
            let of_limb = |limb: usize| -> (Vec<Term>, Written) {
                let l = &blocks.model.declared.limbs[limb];
                let j = if joint == 0 { &l.base_joint } else { &l.platform_joint };
                let linear = (0..3).map(|a| (a, 1.0 / j.linear_n_per_m[a]));
                let stiff = (0..3).filter(|a| j.angular_nm_per_rad[*a] > 0.0);
                let angular = stiff.map(|a| (3 + a, 1.0 / j.angular_nm_per_rad[a]));
                let (which, units): (Vec<usize>, Vec<f64>) = linear.chain(angular).unzip();
                let forces = |f: &Frame| rows(&f.joints[limb][joint], &which);
                let written = Written::of(&[place(limb, joint)], &units, &|n| which[n]);
                let written = if coupled { written } else { written.by(1) };
                (symmetric(blocks.frames, &forces, &units, &[&|_| 1.0], written.together), written)
            };
            let all: Vec<(Vec<Term>, Written)> = (0..3).map(of_limb).collect();
            let both = alike(&[all[0].0.clone(), all[1].0.clone()]);
            let of_both = all[0].1.clone().at(&[place(0, joint), place(1, joint)]);
            for (limb, (terms, written)) in all.into_iter().enumerate() {
                blocks.add_written(&[part(limb, name)], terms, written);
            }
            blocks.add_written(&[part(0, name), part(1, name)], both, of_both);
        }
    }
}

/// The base joint (0) or platform joint (1) of a limb.
fn place(limb: usize, joint: usize) -> Place {
    let limb = limb as u8 + 1;
    if joint == 0 { Place::BaseJoint { limb } } else { Place::PlatformJoint { limb } }
}

/// A compliance of some of the limb's own wrenches, polynomial in its length.
fn body(blocks: &mut Blocks<'_>, motion: &'static str, wrenches: std::ops::Range<usize>, degree: usize) {
    let usual = blocks.usual.0;
    let of_limb = |limb: usize| -> Vec<Term> {
        let own: Vec<usize> = OWN[limb].clone().collect();
        let used = &own[wrenches.start..wrenches.end.min(own.len())];
        let units: Vec<f64> = used.iter().map(|k| usual[(*k, *k)]).collect();
        let (mean, spread) = (blocks.mean(|f| f.q[limb]), blocks.spread(|f| f.q[limb]));
        let x = move |f: &Frame| (f.q[limb] - mean) / spread;
        let shapes: [&dyn Fn(&Frame) -> f64; 3] = [&|_| 1.0, &x, &|f| x(f).powi(2)];
        let forces = |_: &Frame| used.iter().map(|k| V8::from_fn(|r, _| f64::from(r == *k))).collect();
        symmetric(blocks.frames, &forces, &units, &shapes[..=degree], units.len())
    };
    let all: Vec<Vec<Term>> = (0..3).map(of_limb).collect();
    let law = if degree == 0 { "constant" } else { "extension" };
    for group in GROUPS {
        let own: Vec<Vec<Term>> = group.iter().map(|i| all[*i].clone()).collect();
        if (motion, degree) == ("general", 0) {
            let own_wrenches = OWN[group[0]].clone();
            let places: Vec<Place> = group.iter().map(|i| Place::Body { limb: *i as u8 + 1 }).collect();
            let units: Vec<f64> = own_wrenches.map(|k| usual[(k, k)]).collect();
            // what limb 3 has in common with the others is less than theirs
            if group.iter().all(|i| OWN[*i].len() == units.len()) {
                let written = Written::of(&places, &units, &|n| n);
                blocks.add_written(&bodies(group), alike(&own), written);
            }
        } else {
            blocks.add(&bodies(group), motion, law, alike(&own));
        }
    }
    blocks.add(&bodies(&[0, 1, 2]), motion, law, all.concat());
}

/// Axial force and torque along the limbs that pass couples: a screw that twists as it stretches. They are the same all along a
/// body, so that elements at its platform joint, whose z is the limb's own line, say it.
fn twist(blocks: &mut Blocks<'_>) {
    /// Force along z and moment about it, of a joint.
    const ALONG: [usize; 2] = [2, 5];
    let usual = blocks.usual.0;
    for degree in 0..2 {
        let of_limb = |limb: usize| -> (Vec<Term>, Written) {
            let units: Vec<f64> = [OWN[limb].start, OWN[limb].end - 1].iter().map(|k| usual[(*k, *k)]).collect();
            let (mean, spread) = (blocks.mean(|f| f.q[limb]), blocks.spread(|f| f.q[limb]));
            let shapes: [&dyn Fn(&Frame) -> f64; 2] = [&|_| 1.0, &|f| (f.q[limb] - mean) / spread];
            let forces = |f: &Frame| rows(&f.joints[limb][1], &ALONG);
            let terms = symmetric(blocks.frames, &forces, &units, &shapes[..=degree], units.len());
            (terms, Written::of(&[place(limb, 1)], &units, &|n| ALONG[n]))
        };
        let all = [0, 1].map(of_limb);
        for group in [&[0][..], &[1], &[0, 1]] {
            let terms = alike(&group.iter().map(|i| all[*i].0.clone()).collect::<Vec<_>>());
            if degree == 0 {
                let places: Vec<Place> = group.iter().map(|i| place(*i, 1)).collect();
                blocks.add_written(&bodies(group), terms, all[group[0]].1.clone().at(&places));
            } else {
                blocks.add(&bodies(group), "general", "extension", terms);
            }
        }
    }
}

/// An axial compliance that is periodic in the limb's length.
fn periodic(blocks: &mut Blocks<'_>) {
    for group in GROUPS {
        for pitch_mm in PITCHES_MM {
            let wave = |turn: f64| {
                let of = |f: &Frame| {
                    let mut e = M8::zeros();
                    for i in group {
                        let k = AXIAL[*i];
                        e[(k, k)] = blocks.usual.0[(k, k)] * (TAU * f.q[*i] / (1e-3 * pitch_mm) + turn).sin();
                    }
                    e
                };
                Term::Elastic(Arc::new(blocks.frames.iter().map(of).collect()))
            };
            let terms = vec![wave(0.0), wave(0.25 * TAU)];
            let ln_prior = -(PITCHES_MM.len() as f64).ln();
            blocks.add_with(&bodies(group), "axial", "periodic", terms, 0, ln_prior);
        }
    }
}

/// Rms axial force of each limb over the readings.
fn usual_forces(blocks: &Blocks<'_>) -> [f64; 3] {
    AXIAL.map(|k| blocks.usual_load(|_| V8::from_fn(|r, _| f64::from(r == k))))
}

/// An elongation of some limbs by a law of their tension, in units of the usual ones; the second argument is the tension where
/// the load turned.
fn elongation(blocks: &Blocks<'_>, limbs: &[usize], law: fn(f64, f64) -> f64, unloading_only: bool) -> Term {
    let (usual, limbs) = (usual_forces(blocks), limbs.to_vec());
    let units = AXIAL.map(|k| blocks.usual.0[(k, k)]);
    Term::Law(Arc::new(move |_, now: &V8, turned: &V8| {
        let mut e = V8::zeros();
        if !unloading_only || turned.amax() > 0.0 {
            for i in &limbs {
                let k = AXIAL[*i];
                e[k] = units[*i] * usual[*i] * law(now[k] / usual[*i], turned[k] / usual[*i]);
            }
        }
        e
    }))
}

/// Adds a family of laws for each group of limbs, and for all limbs with laws of their own.
fn by_groups(blocks: &mut Blocks<'_>, name: &'static str, laws: &[fn(f64, f64) -> f64], unloading_only: bool) {
    let of = |blocks: &Blocks<'_>, group: &[usize]| -> Vec<Term> {
        laws.iter().map(|law| elongation(blocks, group, *law, unloading_only)).collect()
    };
    for group in GROUPS {
        let terms = of(blocks, group);
        blocks.add(&bodies(group), "axial", name, terms);
    }
    let each = (0..3).flat_map(|i| of(blocks, &[i])).collect();
    blocks.add(&bodies(&[0, 1, 2]), "axial", name, each);
}

/// Elongations that are not linear in the tension: even, odd, saturating, with a dead zone.
fn load(blocks: &mut Blocks<'_>) {
    by_groups(
        blocks,
        "load",
        &[
            |u, _| u.abs(),
            |u, _| u * u,
            |u, _| u * u.abs(),
            |u, _| u * u * u,
            |u, _| 0.05 * (u / 0.05).tanh(),
            |u, _| 0.2 * (u / 0.2).tanh(),
            |u, _| 0.6 * (u / 0.6).tanh(),
            |u, _| u - u.clamp(-0.1, 0.1),
            |u, _| u - u.clamp(-0.3, 0.3),
            |u, _| u - u.clamp(-0.8, 0.8),
            |u, _| u - u.clamp(-1.6, 1.6),
        ],
        false,
    );
}

/// Elongations that lag while the load goes down.
fn direction(blocks: &mut Blocks<'_>) {
    by_groups(blocks, "direction", &[|_, t| (5.0 * t).tanh(), |_, t| t, |u, t| t - u, |u, _| (5.0 * u).tanh()], true);
}

/// Softening of bodies and of joints, along the limb alone too, and growth, with temperature.
fn temperature(blocks: &mut Blocks<'_>) {
    let conditions = &blocks.readings.conditions;
    let entries = &blocks.problem.whitener.entries;
    let warmer = entries.iter().map(|e| (conditions[e.condition].temperature_c - DECLARED_TEMPERATURE_C) / 10.0);
    let warmer: Arc<Vec<f64>> = Arc::new(warmer.collect());
    // thermal growth, ppm scale of metals, by entry
    let grown = |limbs: &[usize]| {
        let (problem, readings) = (blocks.problem, blocks.readings);
        let of = |c: usize| -> [f64; 6] {
            let condition = &readings.conditions[c];
            let f = &blocks.frames[condition.pose];
            let Some(solved) = super::elastic::solve(&f.wrenches, &f.compliance(), &M6::zeros()) else {
                return [0.0; 6];
            };
            let mut e = V8::zeros();
            for i in limbs {
                e[AXIAL[*i]] = f.q[*i] * 1e-5 * condition.rise_k;
            }
            let d = pkm_core::Deflection::from_vector(solved.response * e);
            d.seen_at(condition.point_m.into()).to_vector().into()
        };
        let all: Vec<[f64; 6]> = (0..readings.conditions.len()).map(of).collect();
        let values = problem.whitener.entries.iter().map(|e| all[e.condition][e.channel]);
        Term::Entry(Arc::new(values.collect()))
    };
    let declared = Declared::all(&blocks.model.declared);
    let softer = |limbs: &[usize], bodies: bool| {
        let kept = |d: &Declared| d.is_of_body() == bodies && limbs.contains(&d.limb);
        let of = |f: &Frame| {
            let kept = f.parts.iter().zip(&declared).filter(|(_, d)| kept(d));
            kept.fold(M8::zeros(), |sum, (part, _)| sum + part)
        };
        Term::Times(Arc::new(blocks.frames.iter().map(of).collect()), warmer.clone())
    };
    // a drive, a nut or a bearing
    let softer_along = |limbs: &[usize]| {
        let usual = blocks.usual.0;
        let along = limbs.iter().fold(M8::zeros(), |mut sum, i| {
            sum[(AXIAL[*i], AXIAL[*i])] = usual[(AXIAL[*i], AXIAL[*i])];
            sum
        });
        Term::Times(Arc::new(vec![along; blocks.frames.len()]), warmer.clone())
    };
    let mut new = Vec::new();
    for group in GROUPS {
        new.push((bodies(group), "general", vec![softer(group, true), softer(group, false)]));
        new.push((bodies(group), "axial", vec![softer_along(group)]));
        new.push((bodies(group), "axial", vec![grown(group)]));
    }
    new.push((bodies(&[0, 1, 2]), "axial", (0..3).map(|i| grown(&[i])).collect()));
    for (places, motion, terms) in new {
        blocks.add(&places, motion, "temperature", terms);
    }
}

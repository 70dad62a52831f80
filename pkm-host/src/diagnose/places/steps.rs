//! Blocks of what changed once, from one pose on: a sensor or load cell that was set up anew, a machine that came loose or was moved.
//!
//! Where that was is looked for first, by how much better the declared stiffnesses fit the readings before and after apart. The
//! blocks are of that pose alone.

use std::ops::Range;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use pkm_core::effects::Place;

use super::Blocks;
use super::elastic::{Frame, M8, M68, V8};
use super::limbs::part;
use super::measurement::{LN_PRIOR_OF_ODDITIES, RELATIVE, beside_the_pose, cross_talk, wrong_load};
use super::terms::{Seen, Term, rows, symmetric};

/// Poses before and after a change, at the least.
const MIN_POSES: usize = 2;
/// ln evidence that stiffnesses of their own before and after a pose gain, from which on a change there is looked at.
const MIN_GAIN: f64 = 20.0;
const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];
const SHIFTS: [usize; 3] = [0, 1, 2];
/// Rotations of a sensor's axes: what each component reads of another, and the other of it with the opposite sign.
const TURNS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// What readings say of the declared stiffnesses, in units of their priors.
#[derive(Clone)]
struct Sums {
    information: DMatrix<f64>,
    along: DVector<f64>,
    squares: f64,
}

impl Sums {
    fn none(unknowns: usize) -> Self {
        Self { information: DMatrix::zeros(unknowns, unknowns), along: DVector::zeros(unknowns), squares: 0.0 }
    }

    fn plus(&self, other: &Self, sign: f64) -> Self {
        Self {
            information: &self.information + &other.information * sign,
            along: &self.along + &other.along * sign,
            squares: self.squares + other.squares * sign,
        }
    }

    /// ln evidence but for a constant of each reading.
    fn ln_evidence(&self) -> Option<f64> {
        let n = self.along.len();
        let known = (&self.information + DMatrix::identity(n, n)).cholesky()?;
        let rest = self.squares - self.along.dot(&known.solve(&self.along));
        let ln_determinant: f64 = 2.0 * known.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
        Some(-0.5 * (rest + ln_determinant))
    }
}

/// The pose from which on the readings fit other stiffnesses best, of the poses in the file's order, if they do clearly.
fn change(blocks: &Blocks<'_>) -> Option<usize> {
    let problem = blocks.problem;
    let declared = problem.model.declared();
    let poses = blocks.frames.len();
    let fit = problem.linear(&declared, vec![0.0; declared.len()].into())?;
    let mut of_pose = vec![Sums::none(declared.len()); poses];
    for (n, entry) in problem.whitener.entries.iter().enumerate() {
        let own = &mut of_pose[blocks.readings.conditions[entry.condition].pose];
        let row = fit.jacobian.row(n).transpose();
        own.information.syger(1.0, &row, &row, 1.0);
        own.along.axpy(fit.residuals[n], &row, 1.0);
        own.squares += fit.residuals[n].powi(2);
    }
    for own in &mut of_pose {
        own.information.fill_upper_triangle_with_lower_triangle();
    }
    let all = of_pose.iter().fold(Sums::none(declared.len()), |sum, own| sum.plus(own, 1.0));
    let together = all.ln_evidence()?;
    let mut before = Sums::none(declared.len());
    let mut best: Option<(usize, f64)> = None;
    // those that were left out have no readings
    let read: Vec<(usize, &Sums)> = of_pose.iter().enumerate().filter(|(_, own)| own.squares > 0.0).collect();
    for (n, (pose, own)) in read.iter().copied().enumerate() {
        if n >= MIN_POSES && n + MIN_POSES <= read.len() {
            let gain = before.ln_evidence()? + all.plus(&before, -1.0).ln_evidence()? - together;
            if best.is_none_or(|best| gain > best.1) {
                best = Some((pose, gain));
            }
        }
        before = before.plus(own, 1.0);
    }
    best.filter(|best| best.1 > MIN_GAIN).map(|best| best.0)
}

/// A column of the poses from one on alone; none of a term that acts otherwise than by pose.
fn from_on(term: Term, from: usize, blocks: &Blocks<'_>) -> Option<Term> {
    Some(match term {
        Term::Elastic(e) => {
            let after = e.iter().enumerate().map(|(pose, e)| if pose < from { M8::zeros() } else { *e });
            Term::Elastic(Arc::new(after.collect()))
        }
        Term::Direct(direct) => {
            Term::Direct(Arc::new(move |s: &Seen<'_>| if s.pose < from { [0.0; 6] } else { direct(s) }))
        }
        Term::Entry(values) => {
            let pose_of = |e: &pkm_diagnosis::Entry| blocks.readings.conditions[e.condition].pose;
            let entries = blocks.problem.whitener.entries.iter().zip(values.iter());
            Term::Entry(Arc::new(entries.map(|(e, v)| if pose_of(e) < from { 0.0 } else { *v }).collect()))
        }
        _ => return None,
    })
}

/// A change that is looked at: the pose from which on, and its blocks.
pub struct Step {
    pub from: usize,
    pub blocks: Range<usize>,
}

/// Adds all of them, if there is such a pose.
pub fn add(blocks: &mut Blocks<'_>) -> Option<Step> {
    let (from, first) = (change(blocks)?, blocks.list.len());
    let ln_prior = LN_PRIOR_OF_ODDITIES - (blocks.frames.len() as f64).ln();
    for (places, motion, terms) in [of_measurement(blocks), of_machine(blocks)].concat() {
        let terms = terms.into_iter().filter_map(|term| from_on(term, from, blocks)).collect();
        blocks.add_with(&places, motion, "time", terms, 0, ln_prior);
    }
    Some(Step { from, blocks: first..blocks.list.len() })
}

/// Places, motion and columns of a block.
type Change = (Vec<String>, &'static str, Vec<Term>);

fn of_measurement(blocks: &Blocks<'_>) -> Vec<Change> {
    let named = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
    let diagonal = |of: &dyn Fn((usize, usize)) -> Term| -> Vec<Term> { ALL.iter().map(|i| of((*i, *i))).collect() };
    let gain = Term::Direct(Arc::new(|s: &Seen<'_>| s.displacement.map(|d| RELATIVE * d)));
    let turn = |[i, j]: [usize; 2]| {
        Term::Direct(Arc::new(move |s: &Seen<'_>| {
            let mut d = [0.0; 6];
            for kind in [0, 3] {
                (d[kind + i], d[kind + j]) =
                    (RELATIVE * s.displacement[kind + j], -RELATIVE * s.displacement[kind + i]);
            }
            d
        }))
    };
    let turns: Vec<Term> = TURNS.map(turn).into();
    // a force that acts elsewhere is a moment beside it
    let levers = TURNS.into_iter().flat_map(|[i, j]| [[i, j], [j, i]]);
    let levers = levers.map(|[force, about]| wrong_load((3 + about, force), false));
    vec![
        (named(&["sensor", "load", "time"]), "general", vec![gain]),
        (named(&["sensor", "time"]), "general", diagonal(&cross_talk)),
        (named(&["sensor", "time"]), "general", [diagonal(&cross_talk), turns].concat()),
        (named(&["load", "time"]), "general", diagonal(&|pair| wrong_load(pair, false))),
        (named(&["load", "time"]), "general", levers.collect()),
        (named(&["geometry"]), "general", beside_the_pose(blocks)),
    ]
}

/// A place, and what passes there.
type Mount = (Place, fn(&Frame) -> &M68);

fn of_machine(blocks: &Blocks<'_>) -> Vec<Change> {
    let usual: Vec<f64> = ALL.map(|i| blocks.usual.1[(i, i)]).into();
    let mounts: [Mount; 2] = [(Place::Tool, |f| &f.wrenches), (Place::Base, |f| &f.ground)];
    let mut all: Vec<Change> = Vec::new();
    let names = |place: Place| vec![place.name().unwrap_or_default().to_owned()];
    for (place, passing) in mounts {
        for together in [1, 6] {
            let terms = symmetric(blocks.frames, &|f| rows(passing(f), &ALL), &usual, &[&|_| 1.0], together);
            all.push((names(place), "general", terms));
        }
    }
    for limb in 0..3 {
        let (mut axial, along) = (M8::zeros(), (3 * limb, 3 * limb));
        axial[along] = blocks.usual.0[along];
        let axial = Term::Elastic(Arc::new(vec![axial; blocks.frames.len()]));
        all.push((vec![part(limb, "body")], "axial", vec![axial]));
        let forces = |f: &Frame| -> Vec<V8> { rows(&f.bores[limb], &SHIFTS) };
        let bore = symmetric(blocks.frames, &forces, &usual[..3], &[&|_| 1.0], 3);
        all.push((vec![part(limb, "platform_joint"), "moving_platform".to_owned()], "general", bore));
    }
    all
}

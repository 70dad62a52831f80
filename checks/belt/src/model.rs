//! The machine as the statistics see it: conditions of closure, declared anchors, and what the model may lack.

use nalgebra::{DMatrix, DVector, Matrix4x2, Vector2, Vector4};
use pkm_diagnosis::places::{AtState, Block, PlaceModel, State};
use pkm_diagnosis::{
    Candidate, Channel, CommonErrors, ForwardModel, Kind, Observations, Parameter, Prior, Problem, Reading, Role,
    Unknown,
};

use crate::files::Run;
use crate::machine::{Anchors, COORDINATES, Effect, Group, Load, Machine};

/// Standard deviation of a declared anchor coordinate, m: wide, so that the readings decide. The maker's tool, which knows
/// no stretch, scatters by 18 mm between runs.
pub const ANCHOR_SD_M: f64 = 0.05;
/// Conditions of a reading: four lengths less two coordinates of the sled.
pub const CONDITIONS: usize = 2;
/// Degrees of freedom of the Student error of a visit, the usual choice where gross errors are expected but not many (Lange,
/// Little and Taylor 1989).
pub(crate) const VISIT_DOF: f64 = 4.0;
/// Step of the numbers in the files, m.
const RESOLUTION_M: f64 = 1e-5;

/// Something that the model may lack: where, what, and the largest plausible amplitude.
struct Possible {
    /// Places, the most affected first.
    places: &'static [&'static str],
    motion: &'static str,
    law: &'static str,
    effect: Effect,
    /// Amplitude that would be large.
    scale: f64,
}

/// A share of a length that would be large: steel wire and timing belts stretch by 1 % at most in service, and a worn or
/// miscounted drum is hardly farther off.
const MAX_SHARE: f64 = 0.01;
/// A length by which an anchor or a zero could plausibly be off, m.
const MAX_LENGTH_ERROR_M: f64 = 0.03;
/// Squared weight per metre over the pull: a belt of 10 g/m under 10 N, 1/m².
const MAX_SAG: f64 = 1e-4;

const PULL: &str = "measuring pull";
const WEIGHT: &str = "weight of the sled";
const CONSTANT: &str = "constant";
const LENGTH: &str = "proportional to the length";

/// Everything that the model may lack. Two effects with the same signature stand once, with both places.
const POSSIBLE: [Possible; 20] = {
    const fn of(
        places: &'static [&'static str],
        motion: &'static str,
        law: &'static str,
        effect: Effect,
        scale: f64,
    ) -> Possible {
        Possible { places, motion, law, effect, scale }
    }
    use Effect::{Sag, Scale, Stretch, Yielding, Zero};
    use Group::{All, Lower, One, Upper};
    [
        // belts of one make: a pull that stretches the lower ones stretches the upper ones that carry it
        of(&["lower belts", "upper belts"], "stretch", PULL, Stretch(All, Load::Pull), MAX_SHARE),
        of(&["lower belts"], "stretch", PULL, Stretch(Lower, Load::Pull), MAX_SHARE),
        of(&["upper belts"], "stretch", PULL, Stretch(Upper, Load::Pull), MAX_SHARE),
        of(&["upper belts"], "stretch", WEIGHT, Stretch(Upper, Load::Weight), MAX_SHARE),
        of(&["lower anchors", "upper anchors"], "yielding", PULL, Yielding(All, Load::Pull), MAX_LENGTH_ERROR_M),
        // under the constant pull a zero of both lower belts is the same
        of(&["lower anchors"], "yielding", PULL, Yielding(Lower, Load::Pull), MAX_LENGTH_ERROR_M),
        of(&["upper anchors"], "yielding", PULL, Yielding(Upper, Load::Pull), MAX_LENGTH_ERROR_M),
        of(&["upper anchors"], "yielding", WEIGHT, Yielding(Upper, Load::Weight), MAX_LENGTH_ERROR_M),
        of(&["lower belts", "upper belts"], "sag", "own weight", Sag(All), MAX_SAG),
        of(&["zero of all belts"], "zero error", CONSTANT, Zero(All), MAX_LENGTH_ERROR_M),
        of(&["zero of belt bl"], "zero error", CONSTANT, Zero(One(0)), MAX_LENGTH_ERROR_M),
        of(&["zero of belt br"], "zero error", CONSTANT, Zero(One(1)), MAX_LENGTH_ERROR_M),
        of(&["zero of belt tr"], "zero error", CONSTANT, Zero(One(2)), MAX_LENGTH_ERROR_M),
        of(&["zero of belt tl"], "zero error", CONSTANT, Zero(One(3)), MAX_LENGTH_ERROR_M),
        of(&["encoder of belt bl"], "scale error", LENGTH, Scale(One(0)), MAX_SHARE),
        of(&["encoder of belt br"], "scale error", LENGTH, Scale(One(1)), MAX_SHARE),
        of(&["encoder of belt tr"], "scale error", LENGTH, Scale(One(2)), MAX_SHARE),
        of(&["encoder of belt tl"], "scale error", LENGTH, Scale(One(3)), MAX_SHARE),
        of(&["encoders of the upper belts"], "scale error", LENGTH, Scale(Upper), MAX_SHARE),
        of(&["encoders of all belts"], "scale error", LENGTH, Scale(All), MAX_SHARE),
    ]
};

/// Number of the candidate that a common factor on all lengths is.
pub const COMMON_SCALE: usize = POSSIBLE.len() - 1;

/// The effect of a candidate.
pub fn effect(candidate: usize) -> Effect {
    POSSIBLE[candidate].effect
}

/// One point of one run.
struct Visit {
    /// Mean lengths, m.
    mean_m: Vector4<f64>,
    /// Where the declared model puts the sled, m.
    place_m: Vector2<f64>,
    /// Lengths of the declared model there, m.
    lengths_m: Vector4<f64>,
    /// Weighted lengths to conditions, by orthonormal columns.
    closure: Matrix4x2<f64>,
}

/// Points whose lengths no place of the sled fits, even nearly.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoPlace {
    /// Line of the file.
    pub line: usize,
}

/// The machine over the points of one run.
pub struct Model {
    declared: Anchors,
    weights: Vector4<f64>,
    visits: Vec<Visit>,
    /// By visit, see [`Model::spread`].
    spread: Vec<f64>,
    parameters: Vec<Parameter>,
    candidates: Vec<Candidate>,
    blocks: Vec<Block>,
}

impl Model {
    /// Of a run, with anchors as declared. `upper_weight`: weight of the upper belts' lengths over that of the lower ones'.
    ///
    /// # Errors
    /// Lengths that do not belong to one place of the sled.
    pub fn new(run: &Run, declared: Anchors, upper_weight: f64) -> Result<Self, NoPlace> {
        let weights = Vector4::new(1.0, 1.0, upper_weight, upper_weight);
        let machine = Machine { anchors: declared, effects: Vec::new() };
        let visit = |point: &[crate::files::Lengths; 4]| {
            let mean_m = point.iter().map(|r| r.at_m).sum::<Vector4<f64>>() / point.len() as f64;
            let start = declared.below_upper_belts(&mean_m);
            let place_m =
                start.and_then(|s| machine.place_m(&mean_m, &weights, s)).ok_or(NoPlace { line: point[0].line })?;
            let sled = declared.sled(place_m);
            Ok(Visit { mean_m, place_m, lengths_m: sled.length_m, closure: closure(&sled.jacobian(), &weights) })
        };
        let visits = run.points.iter().map(visit).collect::<Result<Vec<_>, _>>()?;
        let parameter = |scale, role| Parameter { prior: Prior::Normal { scale }, role, ambiguous: false };
        let mut parameters = vec![parameter(ANCHOR_SD_M, Role::Declared); COORDINATES];
        parameters.extend(POSSIBLE.iter().map(|p| parameter(p.scale, Role::Amplitude { one_sided: false })));
        let candidate = |(n, p): (usize, &Possible)| Candidate {
            names: vec![format!("{} of {}, {}", p.motion, p.places.join(" and "), p.law)],
            kind: if matches!(p.effect, Effect::Zero(_) | Effect::Scale(_)) { Kind::Measurement } else { Kind::Effect },
            place: p.places[0].to_owned(),
            unknowns: vec![amplitude(n)],
            start: Vec::new(),
            is_free: false,
        };
        let block = |p: &Possible| Block {
            places: p.places.iter().map(|p| (*p).to_owned()).collect(),
            motion: p.motion,
            law: p.law,
            columns: 1,
            forces: 0,
            ln_prior: 0.0,
        };
        Ok(Self {
            declared,
            weights,
            spread: vec![1.0; visits.len()],
            visits,
            parameters,
            candidates: POSSIBLE.iter().enumerate().map(candidate).collect(),
            blocks: POSSIBLE.iter().map(block).collect(),
        })
    }

    /// The declared anchors.
    pub fn anchors(&self) -> Anchors {
        self.declared
    }

    /// Where the declared model puts the sled, by point, m.
    pub fn places_m(&self) -> impl Iterator<Item = Vector2<f64>> {
        self.visits.iter().map(|v| v.place_m)
    }

    /// Takes over how far the error of each visit spreads, from the squared whitened residuals of its conditions: the error of
    /// a visit is Student, not normal, as a belt now and then settles millimetres off. A Student error is a normal one
    /// with a variance of its own; this is the most likely variance.
    pub fn spread(&mut self, squares: &[f64]) {
        for (spread, square) in self.spread.iter_mut().zip(squares) {
            *spread = ((VISIT_DOF + square * *spread * *spread) / (VISIT_DOF + CONDITIONS as f64)).sqrt();
        }
    }

    /// The machine at values of the unknowns.
    pub fn machine(&self, unknowns: &[Unknown], x: &[f64]) -> Machine {
        let mut machine = Machine { anchors: self.declared, effects: Vec::new() };
        for (unknown, x) in unknowns.iter().zip(x) {
            let value = self.parameters[unknown.0].prior.value(*x);
            match unknown.0.checked_sub(COORDINATES) {
                None => machine.anchors.coordinates_m[unknown.0] += value,
                Some(candidate) => machine.effects.push((effect(candidate), value)),
            }
        }
        machine
    }

    /// Conditions as read, each about the declared model: no prediction changes with where the sled was.
    pub fn observations(&self, run: &Run) -> Observations {
        let readings = run.points.iter().enumerate().flat_map(|(point, readings)| {
            let visit = &self.visits[point];
            readings.iter().map(move |r| {
                let conditions = self.conditions(visit, &r.at_m);
                Reading {
                    condition: point,
                    repeat_of: point,
                    series: point,
                    observed: conditions.iter().copied().map(Some).collect(),
                    sigma: vec![None],
                    covariance: None,
                    drawn: Vec::new(),
                }
            })
        });
        Observations {
            channels: vec![Channel { kind: 0, resolution: RESOLUTION_M }; CONDITIONS],
            pose_of: (0..run.points.len()).collect(),
            readings: readings.collect(),
        }
    }

    fn conditions(&self, visit: &Visit, lengths_m: &Vector4<f64>) -> Vector2<f64> {
        visit.closure.transpose() * (lengths_m - visit.lengths_m).component_mul(&self.weights)
    }
}

/// The unknown of a candidate.
pub fn amplitude(candidate: usize) -> Unknown {
    Unknown(COORDINATES + candidate)
}

/// Orthonormal combinations of weighted lengths that do not change with the place of the sled: the first is mostly of the
/// belt bl, the second mostly of br.
fn closure(jacobian: &Matrix4x2<f64>, weights: &Vector4<f64>) -> Matrix4x2<f64> {
    let mut basis: Vec<Vector4<f64>> = Vec::new();
    let motions = jacobian.column_iter().map(|c| c.component_mul(weights));
    for vector in motions.chain([Vector4::x(), Vector4::y()]) {
        let rest = basis.iter().fold(vector, |rest, b| rest - b * b.dot(&vector));
        basis.push(rest.normalize());
    }
    Matrix4x2::from_columns(&[basis[2], basis[3]])
}

/// What a machine leaves of the two conditions of a reading, every belt weighted alike, m. `None` where the lengths fit no
/// place of the sled.
pub fn closure_errors_m(machine: &Machine, lengths_m: &Vector4<f64>) -> Option<Vector2<f64>> {
    let weights = Vector4::repeat(1.0);
    let start = machine.anchors.below_upper_belts(lengths_m)?;
    let sled = machine.anchors.sled(machine.place_m(lengths_m, &weights, start)?);
    Some(closure(&sled.jacobian(), &weights).transpose() * (machine.read_m(&sled) - lengths_m))
}

impl ForwardModel for Model {
    fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn predict(&self, unknowns: &[Unknown], x: &[f64]) -> Option<Vec<f64>> {
        let machine = self.machine(unknowns, x);
        let mut conditions = Vec::with_capacity(CONDITIONS * self.visits.len());
        for visit in &self.visits {
            let place = machine.place_m(&visit.mean_m, &self.weights, visit.place_m)?;
            let lengths = machine.read_m(&machine.anchors.sled(place));
            conditions.extend(self.conditions(visit, &lengths).iter());
        }
        Some(conditions)
    }

    /// Errors of one visit to a point, which its readings share: a later run reads otherwise there. Nobody declares them, so
    /// that their size is among the levels that the evidence compares.
    fn common_errors(&self) -> Option<CommonErrors> {
        let at = |n: usize, own: usize| if n % CONDITIONS == own { self.spread[n / CONDITIONS] } else { 0.0 };
        let column = |own: usize| (0..CONDITIONS * self.visits.len()).map(|n| at(n, own)).collect();
        Some(CommonErrors {
            columns: (0..CONDITIONS).map(column).collect(),
            sd: vec![0.0; CONDITIONS],
            undeclared: vec![1.0; CONDITIONS],
            group_of: (0..self.visits.len()).collect(),
        })
    }
}

/// The candidates as blocks of one column each.
pub struct Blocks<'a> {
    /// Readings and model.
    pub problem: &'a Problem<'a>,
    /// The model.
    pub model: &'a Model,
}

impl PlaceModel for Blocks<'_> {
    fn declared(&self) -> usize {
        COORDINATES
    }

    fn blocks(&self) -> &[Block] {
        &self.model.blocks
    }

    fn at<'a>(&'a self, state: &State) -> Option<Box<dyn AtState + 'a>> {
        let unknowns: Vec<Unknown> =
            (0..COORDINATES).map(Unknown).chain(state.blocks.iter().map(|(b, _)| amplitude(*b))).collect();
        let x: Vec<f64> =
            state.declared.iter().copied().chain(state.blocks.iter().map(|(_, amplitudes)| amplitudes[0])).collect();
        let predicted = self.problem.predict(&unknowns, &x)?;
        let declared = self.problem.jacobian(&unknowns, &x, 0..COORDINATES)?;
        Some(Box::new(AtUnknowns { problem: self.problem, unknowns, x, predicted, declared }))
    }
}

/// The model where its unknowns have some values.
struct AtUnknowns<'a> {
    problem: &'a Problem<'a>,
    unknowns: Vec<Unknown>,
    x: Vec<f64>,
    predicted: DVector<f64>,
    declared: DMatrix<f64>,
}

impl AtState for AtUnknowns<'_> {
    fn predicted(&self) -> &DVector<f64> {
        &self.predicted
    }

    fn declared(&self) -> DMatrix<f64> {
        self.declared.clone()
    }

    fn block(&self, block: usize) -> Option<DMatrix<f64>> {
        let own = amplitude(block);
        if let Some(at) = self.unknowns.iter().position(|u| *u == own) {
            return self.problem.jacobian(&self.unknowns, &self.x, at..at + 1);
        }
        let unknowns = [self.unknowns.as_slice(), &[own]].concat();
        self.problem.jacobian(&unknowns, &[self.x.as_slice(), &[0.0]].concat(), self.x.len()..unknowns.len())
    }
}

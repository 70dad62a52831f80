//! The blocks of a machine under the conditions of some readings, as a forward model.

use nalgebra::{DMatrix, DVector, Vector6};
use pkm_core::effects::Element;
use pkm_core::{Deflection, Wrench};
use pkm_diagnosis::places::{AtState, Block, Finding, PlaceModel, State};
use pkm_diagnosis::{Entry, Prior, Problem, Role};
use rayon::prelude::*;

use super::coupled::Written;
use super::elastic::{self, Frame, M6, M8, Solved, V8};
use super::steps::{self, Step};
use super::terms::{Seen, Term};
use super::{Blocks, Says, limbs, measurement, named, platforms, ties, turned};
use crate::diagnose::declared::Declared;
use crate::diagnose::elements::{ElementParameter, Family};
use crate::diagnose::model::Model;
use crate::files::readings::{CHANNELS, Condition, Readings};

/// Wrench, or displacement.
type Six = [f64; 6];

/// Blocks and all that their columns are made from.
pub struct World {
    frames: Vec<Frame>,
    uncertainty: Vec<f64>,
    /// At A, and where the load turned, by condition.
    wrenches: Vec<(Six, Six)>,
    /// What the declared machine gives beyond its elastic part, by condition.
    offset: Vec<Six>,
    blocks: Vec<Block>,
    terms: Vec<Vec<Term>>,
    written: Vec<Option<Says>>,
    step: Option<Step>,
}

/// A world under the conditions of readings.
pub struct Under<'a> {
    world: &'a World,
    problem: &'a Problem<'a>,
    readings: &'a Readings,
}

/// A parameter for each main direction of a compliance or a tie, and where a fit of it begins.
fn directions(written: &Written, amplitudes: &[f64], yielding: bool) -> (Vec<ElementParameter>, Vec<f64>) {
    let of = |(elements, compliance): (Vec<Element>, f64)| {
        let prior = Prior::Normal { scale: compliance.abs() };
        let role = Role::Amplitude { one_sided: yielding || written.is_one_sided() };
        (ElementParameter { elements, index: 0, prior, role }, compliance.signum())
    };
    written.elements(amplitudes, yielding).into_iter().map(of).unzip()
}

/// What is seen at a point of the platform of a displacement of A.
fn seen_at(displacement: Vector6<f64>, at_m: [f64; 3]) -> Six {
    Deflection::from_vector(displacement).seen_at(at_m.into()).to_vector().into()
}

impl World {
    /// All blocks of a machine; the scales of sensors and of time follow from the readings.
    pub fn new(problem: &Problem<'_>, model: &Model, readings: &Readings) -> Option<Self> {
        let stiffnesses = Declared::all(&model.declared);
        let poses: Vec<_> = readings.poses.iter().map(|p| p.pose).collect();
        let frames = Frame::all(&model.declared, &stiffnesses, &poses)?;
        let at_a = |wrench: &Wrench<f64>, c: &Condition| wrench.moved_to_a(c.point_m.into()).to_vector().into();
        let wrenches: Vec<(Six, Six)> =
            (readings.conditions.iter()).map(|c| (at_a(&c.wrench, c), at_a(&c.turned_at, c))).collect();
        let uncertainty = stiffnesses.iter().map(|d| d.uncertainty(&model.uncertainty)).collect();
        let offset = vec![[0.0; 6]; wrenches.len()];
        let (blocks, terms, written, step) = (Vec::new(), Vec::new(), Vec::new(), None);
        let mut this = Self { frames, uncertainty, wrenches, offset, blocks, terms, written, step };
        let declared = State { declared: vec![0.0; stiffnesses.len()], blocks: Vec::new() };
        let solved = this.solve(&declared)?;
        let elastic = this.displacements(readings, &solved);
        let said = model.predict(&poses, &readings.conditions, &[], &[])?;
        let difference = |(s, e): (&[f64; CHANNELS], &Six)| -> Six { std::array::from_fn(|c| s[c] - e[c]) };
        this.offset = said.iter().zip(&elastic).map(difference).collect();

        let n = this.frames.len() as f64;
        let usual_d = this.frames.iter().map(Frame::compliance).fold(M8::zeros(), |a, b| a + b) / n;
        let usual_c = solved.iter().fold(M6::zeros(), |a, s| a + s.compliance) / n;
        let passing = (0..this.wrenches.len()).map(|c| this.passing(readings, &solved, c)).collect();
        let usual = (usual_d, usual_c);
        let frames = &this.frames;
        let mut blocks =
            Blocks { problem, model, readings, frames, usual, passing, list: Vec::new(), written: Vec::new() };
        limbs::add(&mut blocks);
        platforms::add(&mut blocks);
        turned::add(&mut blocks);
        ties::add(&mut blocks);
        measurement::add(&mut blocks, &solved);
        let step = steps::add(&mut blocks);
        named::add(&mut blocks);
        (this.written, this.step) = (blocks.written, step);
        (this.blocks, this.terms) = blocks.list.into_iter().unzip();
        Some(this)
    }

    /// As the engine takes it.
    pub fn on<'a>(&'a self, problem: &'a Problem<'a>, readings: &'a Readings) -> Under<'a> {
        Under { world: self, problem, readings }
    }

    /// A block.
    pub fn block(&self, index: usize) -> &Block {
        &self.blocks[index]
    }

    /// The pose from which on a block acts, if that is not the first.
    pub fn since(&self, block: usize) -> Option<usize> {
        self.step.as_ref().filter(|step| step.blocks.contains(&block)).map(|step| step.from)
    }

    /// What a finding found as elements, a compliance of a place whatever its form, by its main directions and by those alone in which
    /// something yields: far less than declared is nonsense where readings do not say it. Nothing if it is something else.
    pub fn elements(&self, found: &Finding) -> Vec<Family> {
        let block = &self.blocks[found.block];
        let mut all: Vec<(Vec<ElementParameter>, Vec<f64>)> = match &self.written[found.block] {
            Some(Says::Directions(written)) => {
                [false, true].map(|yielding| directions(written, &found.amplitudes, yielding)).into()
            }
            Some(Says::Stretch(stretch)) => stretch.parameters(&found.amplitudes).into_iter().collect(),
            None => Vec::new(),
        };
        // where nothing is left out both are the same, and where nothing yields there is none
        all.dedup_by(|b, a| a.1 == b.1);
        all.retain(|(parameters, _)| !parameters.is_empty());
        let family = |(parameters, start)| Family {
            places: block.places.clone(),
            motion: block.motion,
            law: block.law,
            parameters,
            start,
        };
        all.into_iter().map(family).collect()
    }

    fn solve(&self, state: &State) -> Option<Vec<Solved>> {
        let of = |(pose, f): (usize, &Frame)| {
            let (mut d, mut beside) = (f.rest, M6::zeros());
            for ((part, x), sd) in f.parts.iter().zip(&state.declared).zip(&self.uncertainty) {
                d += part * (-sd * x).exp();
            }
            for (b, amplitudes) in &state.blocks {
                for (term, a) in self.terms[*b].iter().zip(amplitudes) {
                    match term {
                        Term::Elastic(e) => d += e[pose] * *a,
                        Term::AtPose(at, e) if *at == pose => d += **e * *a,
                        Term::Beside(k) => beside += k[pose] * *a,
                        _ => {}
                    }
                }
            }
            elastic::solve(&f.wrenches, &d, &beside)
        };
        self.frames.iter().enumerate().map(of).collect()
    }

    fn passing(&self, readings: &Readings, solved: &[Solved], condition: usize) -> (V8, V8) {
        let p = &solved[readings.conditions[condition].pose].response;
        let (now, turned) = self.wrenches[condition];
        (p.tr_mul(&Vector6::from(now)), p.tr_mul(&Vector6::from(turned)))
    }

    fn displacements(&self, readings: &Readings, solved: &[Solved]) -> Vec<Six> {
        let all = readings.conditions.iter().zip(&self.wrenches).zip(&self.offset);
        all.map(|((c, (w, _)), offset)| {
            let d = seen_at(solved[c.pose].compliance * Vector6::from(*w), c.point_m);
            std::array::from_fn(|i| d[i] + offset[i])
        })
        .collect()
    }
}

impl Under<'_> {
    fn by_condition(&self, of: impl Fn(usize) -> Six) -> Vec<f64> {
        let values: Vec<Six> = (0..self.readings.conditions.len()).map(of).collect();
        self.problem.whitened(self.read(&values).as_flattened())
    }

    /// What is read of displacements, by condition.
    fn read(&self, displacements: &[Six]) -> Vec<[f64; CHANNELS]> {
        self.readings.conditions.iter().zip(displacements).map(|(c, d)| c.read(*d)).collect()
    }

    fn column(&self, term: &Term, solved: &[Solved], said: &[Six]) -> DVector<f64> {
        let conditions = &self.readings.conditions;
        // a pose has one change of its compliance, and many loads
        let softer = |s: &Solved, e: &M8| s.response * e * s.response.transpose();
        let all = |e: &[M8]| solved.iter().zip(e).map(|(s, e)| softer(s, e)).collect::<Vec<M6>>();
        let yields = |compliance: &M6, wrench: Six, c: usize| -> Six {
            seen_at(compliance * Vector6::from(wrench), conditions[c].point_m)
        };
        let moved = |change: &M6, c: usize| yields(change, self.world.wrenches[c].0, c);
        let by_pose = |change: &[M6]| self.by_condition(|c| moved(&change[conditions[c].pose], c));
        let whitened = |mut values: Vec<f64>| {
            self.problem.whitener.whiten(&mut values);
            values
        };
        let values = match term {
            Term::Fixed(column) => return (**column).clone(),
            Term::Entry(values) => whitened((**values).clone()),
            Term::Elastic(e) => by_pose(&all(e)),
            Term::AtPose(pose, e) => {
                let change = softer(&solved[*pose], e);
                self.by_condition(|c| if conditions[c].pose == *pose { moved(&change, c) } else { [0.0; 6] })
            }
            Term::Beside(k) => {
                let stiffer = |(s, k): (&Solved, &M6)| -(s.compliance * k * s.compliance);
                by_pose(&solved.iter().zip(k.iter()).map(stiffer).collect::<Vec<M6>>())
            }
            Term::Times(e, factors) => {
                let change = all(e);
                let moved = (0..conditions.len()).map(|c| moved(&change[conditions[c].pose], c));
                let read = self.read(&moved.collect::<Vec<Six>>());
                let entries = self.problem.whitener.entries.iter().zip(factors.iter());
                whitened(entries.map(|(e, f)| f * read[e.condition][e.channel]).collect())
            }
            Term::Lag(channel, lag) => {
                let lags = |e: &Entry| {
                    let c = e.condition;
                    if e.channel != *channel {
                        return 0.0;
                    }
                    let turned = yields(&solved[conditions[c].pose].compliance, self.world.wrenches[c].1, c);
                    let [now, turned] = [said[c], turned].map(|d| conditions[c].read(d)[*channel]);
                    lag(now, turned)
                };
                whitened(self.problem.whitener.entries.iter().map(lags).collect())
            }
            Term::Law(law) => self.by_condition(|c| {
                let pose = conditions[c].pose;
                let (now, turned) = self.world.passing(self.readings, solved, c);
                let d = solved[pose].response * law(pose, &now, &turned);
                seen_at(d, conditions[c].point_m)
            }),
            Term::Direct(direct) => self.by_condition(|c| {
                let pose = conditions[c].pose;
                let wrench = self.world.wrenches[c].0;
                direct(&Seen { compliance: &solved[pose].compliance, pose, wrench, displacement: said[c] })
            }),
        };
        values.into()
    }

    fn declared_terms(&self, state: &State) -> Vec<Term> {
        let of = |j: usize| {
            let sd = self.world.uncertainty[j];
            let slope = -sd * (-sd * state.declared[j]).exp();
            Term::Elastic(self.world.frames.iter().map(|f| f.parts[j] * slope).collect::<Vec<_>>().into())
        };
        (0..state.declared.len()).map(of).collect()
    }
}

impl PlaceModel for Under<'_> {
    fn declared(&self) -> usize {
        self.world.uncertainty.len()
    }

    fn blocks(&self) -> &[Block] {
        &self.world.blocks
    }

    fn at<'a>(&'a self, state: &State) -> Option<Box<dyn AtState + 'a>> {
        let solved = self.world.solve(state)?;
        let said = self.world.displacements(self.readings, &solved);
        let mut predicted: DVector<f64> = self.problem.whitened(self.read(&said).as_flattened()).into();
        for (b, amplitudes) in &state.blocks {
            for (term, a) in self.world.terms[*b].iter().zip(amplitudes) {
                let is_in_compliance = matches!(term, Term::Elastic(_) | Term::AtPose(..) | Term::Beside(_));
                if !is_in_compliance && *a != 0.0 {
                    predicted.axpy(*a, &self.column(term, &solved, &said), 1.0);
                }
            }
        }
        Some(Box::new(Solution { under: self, declared: self.declared_terms(state), solved, said, predicted }))
    }
}

/// A state, solved.
struct Solution<'a> {
    under: &'a Under<'a>,
    declared: Vec<Term>,
    /// By pose.
    solved: Vec<Solved>,
    /// By condition.
    said: Vec<Six>,
    predicted: DVector<f64>,
}

impl Solution<'_> {
    fn columns(&self, terms: &[Term]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> =
            terms.par_iter().map(|t| self.under.column(t, &self.solved, &self.said)).collect();
        DMatrix::from_columns(&columns)
    }
}

impl AtState for Solution<'_> {
    fn predicted(&self) -> &DVector<f64> {
        &self.predicted
    }

    fn declared(&self) -> DMatrix<f64> {
        self.columns(&self.declared)
    }

    fn block(&self, block: usize) -> Option<DMatrix<f64>> {
        Some(self.columns(&self.under.world.terms[block]))
    }
}

#[cfg(test)]
mod tests {
    use pkm_core::machine::Machine;
    use pkm_diagnosis::{Candidate, Rules, Whitener};

    use super::*;
    use crate::diagnose::Method;
    use crate::diagnose::experiment::{Experiment, observations};
    use crate::diagnose::model::Recorded;
    use crate::diagnose::places::terms::entries;
    use crate::diagnose::tests::{condition, even, machine, reading, readings};

    /// Judges the world of the reference machine under loads along and about each axis, at seven poses.
    fn on_unit_loads(judge: impl FnOnce(&World, &Readings, &Model)) {
        under(&Rules::DEFAULT, |world, _, readings, model| judge(world, readings, model));
    }

    fn under(rules: &Rules, judge: impl FnOnce(&World, &Problem<'_>, &Readings, &Model)) {
        let unit = |i: usize| std::array::from_fn(|k| if k == i { 100.0 } else { 0.0 });
        let conditions: Vec<_> = (0..7).flat_map(|pose| (0..6).map(move |i| condition(pose, unit(i)))).collect();
        let seen = std::array::from_fn(|channel| (channel < 6).then_some(1e-6));
        let all = (0..conditions.len()).map(|c| reading(c, c, seen)).collect();
        let readings = readings(conditions, all);
        let model = Model::new(&machine(), Recorded::default(), Method::Places).unwrap();
        let read = observations(&readings, &model);
        let whitener = Whitener::new(&read, &even(1e-6));
        let experiment = Experiment::new(&model, &readings);
        let problem = Problem::new(&read, &whitener, &experiment, rules);
        judge(&World::new(&problem, &model, &readings).unwrap(), &problem, &readings, &model);
    }

    /// What yields at one pose alone is read there and nowhere else, as much as its column says.
    #[test]
    fn what_one_pose_has_of_its_own_is_read_there() {
        under(&Rules::DEFAULT, |world, problem, readings, _| {
            let (seen, entries) = (world.on(problem, readings), &problem.whitener.entries);
            let amount = 1e-4;
            let predicted = |blocks| seen.at(&State { declared: vec![0.0; seen.declared()], blocks });
            let as_declared = predicted(Vec::new()).unwrap();
            let places = ["tool", "sensor"];
            let of_poses = world.blocks.iter().enumerate().filter(|(_, b)| b.law == "pose" && b.places == places);
            let blocks: Vec<usize> = of_poses.map(|(block, _)| block).collect();
            assert_eq!(blocks.len(), 7);
            for (pose, block) in blocks.into_iter().enumerate() {
                let column = as_declared.block(block).unwrap().column(0).clone_owned();
                let mut amplitudes = vec![0.0; 6];
                amplitudes[0] = amount;
                let more = predicted(vec![(block, amplitudes)]).unwrap();
                let slope = (more.predicted() - as_declared.predicted()) / amount;
                assert!(column.amax() > 1.0);
                assert!((slope - &column).amax() < 1e-3 * column.amax());
                let elsewhere =
                    entries.iter().zip(&column).filter(|(e, _)| readings.conditions[e.condition].pose != pose);
                assert!(elsewhere.map(|(_, v)| v.abs()).fold(0.0, f64::max) == 0.0);
            }
        });
    }

    #[test]
    fn of_many_poses_none_is_looked_at_alone() {
        let rules = Rules { max_single_poses: 6, ..Rules::DEFAULT };
        under(&rules, |world, _, _, _| {
            let of_sensor = |b: &Block| b.places.iter().any(|place| place == "sensor");
            assert!(world.blocks.iter().all(|b| b.law != "pose" || !of_sensor(b)));
        });
    }

    /// With a block's amplitudes and without, by pose.
    fn solved(world: &World, block: usize, amplitudes: &[f64]) -> [Vec<Solved>; 2] {
        let declared = State { declared: vec![0.0; world.uncertainty.len()], blocks: Vec::new() };
        let state = State { blocks: vec![(block, amplitudes.to_vec())], ..declared.clone() };
        [world.solve(&state).unwrap(), world.solve(&declared).unwrap()]
    }

    /// Greatest difference between compliances, each entry in units of those on the diagonal.
    fn difference(by_core: &M6, found: &M6, usual: &M6) -> f64 {
        let size = |i: usize, j: usize| (usual[(i, i)] * usual[(j, j)]).sqrt();
        M6::from_fn(|i, j| (by_core[(i, j)] - found[(i, j)]).abs() / size(i, j)).max()
    }

    /// The block of a formula is the core's effect far from the declared machine, where a derivative there would not be.
    #[test]
    fn a_formula_that_is_a_compliance_holds_however_much_yields() {
        on_unit_loads(|world, readings, model| {
            let block = world.blocks.iter().position(|b| b.places == ["moving_platform"] && b.columns == 5).unwrap();
            let named = |c: &Candidate| c.names == ["moving-platform-compliance"];
            let unknowns = &model.candidates.iter().find(|c| named(c)).unwrap().unknowns;
            for amplitudes in [[1.0, 2.0, 0.5, 0.0, 0.0], [0.0, 0.0, 0.0, 2.0, 1.0]] {
                let softer = Machine::<f64>::new(&model.state(unknowns, &amplitudes, false).machine).unwrap();
                let [after, before] = solved(world, block, &amplitudes);
                for (pose, (before, after)) in readings.poses.iter().zip(before.iter().zip(&after)) {
                    let by_core = softer.stiffness(&pose.pose).unwrap().matrix().try_inverse().unwrap();
                    let usual = &before.compliance;
                    assert!(difference(&by_core, usual, usual) > 0.01);
                    assert!(difference(&by_core, &after.compliance, usual) < 1e-8);
                }
            }
        });
    }

    /// The declared machine with the elements that are written for a block's amplitudes.
    fn with_elements(world: &World, model: &Model, block: usize, amplitudes: &[f64]) -> Machine<f64> {
        let (columns, amplitudes) = (DMatrix::zeros(0, 0), amplitudes.to_vec());
        let family = world
            .elements(&Finding { block, gain: 0.0, rivals: Vec::new(), temper: 1.0, columns, amplitudes })
            .remove(0);
        let mut softer = model.declared;
        for (parameter, start) in family.parameters.iter().zip(&family.start) {
            parameter.add_to(&mut softer, parameter.prior.value(*start));
        }
        Machine::<f64>::new(&softer).unwrap()
    }

    /// What a block says of a worn stretch is what the core says with the element that is written for it.
    #[test]
    fn an_element_is_worn_where_its_block_is() {
        on_unit_loads(|world, readings, model| {
            let blocks: Vec<usize> =
                (0..world.blocks.len()).filter(|b| matches!(world.written[*b], Some(Says::Stretch(_)))).collect();
            assert!(blocks.len() > 30);
            for block in blocks {
                let amplitudes = vec![0.4, 0.0, 0.0];
                let softer = with_elements(world, model, block, &amplitudes);
                let [after, before] = solved(world, block, &amplitudes);
                for (pose, (before, after)) in readings.poses.iter().zip(before.iter().zip(&after)) {
                    let by_core = softer.stiffness(&pose.pose).unwrap().matrix().try_inverse().unwrap();
                    assert!(difference(&by_core, &after.compliance, &before.compliance) < 1e-9);
                }
            }
        });
    }

    /// What a block says with amplitudes of rank 1 is what the core says with the elements that are written for it.
    #[test]
    fn elements_of_a_block_are_its_compliance() {
        let mut rng = fastrand::Rng::with_seed(17);
        on_unit_loads(|world, readings, model| {
            let mut places = Vec::new();
            for (block, written) in world.written.iter().enumerate() {
                let Some(Says::Directions(written)) = written else { continue };
                let n = written.units.len();
                // along one line among forces that yield together
                let group = block % n / written.together;
                let mut of = |i: usize| if i / written.together == group { 0.2 * (rng.f64() - 0.5) } else { 0.0 };
                let root: Vec<f64> = (0..n).map(&mut of).collect();
                let amplitudes: Vec<f64> = entries(n, written.together)
                    .map(|(i, j)| root[i] * root[j] * if i == j { 1.0 } else { 2.0 })
                    .collect();
                let softer = with_elements(world, model, block, &amplitudes);
                let [after, before] = solved(world, block, &amplitudes);
                for (pose, (before, after)) in readings.poses.iter().zip(before.iter().zip(&after)) {
                    let by_core = softer.stiffness(&pose.pose).unwrap().matrix().try_inverse().unwrap();
                    let error = difference(&by_core, &after.compliance, &before.compliance);
                    // weights are kept to 1.5e-5 of the greatest
                    assert!(error < 1e-4, "{:?}: {error:e}", world.blocks[block].places);
                }
                places.extend(world.blocks[block].places.iter().cloned());
            }
            places.sort();
            places.dedup();
            assert_eq!(places.len(), 12, "every place has a block: {places:?}");
        });
    }
}

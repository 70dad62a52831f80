//! Blocks of columns for every place of the machine, for [`pkm_diagnosis::places`].
//!
//! Everything linear that yields adds a compliance to the one that the eight transmitted wrenches meet (`elastic`); laws of the
//! load add elongations; errors of the measurement add displacements (`terms`). `limbs`, `platforms`, `measurement` and `steps` list
//! the blocks, `named` those of the effects that have a formula.

mod coupled;
mod elastic;
mod limbs;
mod local;
mod measurement;
mod named;
mod platforms;
pub mod sites;
mod steps;
mod terms;
mod ties;
mod turned;
mod world;

use pkm_diagnosis::places::{Block, Inferred};
use pkm_diagnosis::{Levels, Noise, Problem};

use self::coupled::Written;
use self::elastic::Frame;
use self::local::Stretch;
use self::terms::{Term, symmetric};
use super::model::Model;
use crate::files::readings::Readings;

pub use self::limbs::part;
pub use self::world::World;

/// Where something is, how it moves, and what it depends on.
#[derive(Clone, Debug)]
pub struct Whereabouts {
    /// Places, the most affected first.
    pub places: Vec<String>,
    /// Motion.
    pub motion: &'static str,
    /// Law.
    pub law: &'static str,
    /// ln of the prior weight: sizes are measured and loads weighed before anybody doubts them, and their columns follow much
    /// that is on no list.
    pub ln_prior: f64,
}

/// How elements say what a block found.
#[derive(Clone)]
enum Says {
    /// A compliance of a place, or a tie, by its main directions.
    Directions(Written),
    /// A worn stretch of a limb.
    Stretch(Stretch),
}

/// Blocks under construction.
struct Blocks<'a> {
    problem: &'a Problem<'a>,
    model: &'a Model,
    readings: &'a Readings,
    frames: &'a [Frame],
    /// Mean compliance that the transmitted wrenches meet, and mean terminal compliance: the scales of blocks.
    usual: (elastic::M8, elastic::M6),
    /// Wrenches that pass under each condition and where the load turned, of the declared machine.
    passing: Vec<(elastic::V8, elastic::V8)>,
    list: Vec<(Block, Vec<Term>)>,
    /// By block: how elements say it, if they do.
    written: Vec<Option<Says>>,
}

impl Blocks<'_> {
    fn add(&mut self, places: &[String], motion: &'static str, law: &'static str, terms: Vec<Term>) {
        self.add_with(places, motion, law, terms, 0, 0.0);
    }

    fn add_with(
        &mut self,
        places: &[String],
        motion: &'static str,
        law: &'static str,
        terms: Vec<Term>,
        forces: usize,
        ln_prior: f64,
    ) {
        if !terms.is_empty() {
            let block = Block { places: places.to_vec(), motion, law, columns: terms.len(), forces, ln_prior };
            self.list.push((block, terms));
            self.written.push(None);
        }
    }

    /// A compliance of the forces that pass a place, and how elements say it.
    fn add_compliance(&mut self, places: &[String], forces: &dyn Fn(&Frame) -> Vec<elastic::V8>, written: Written) {
        let terms = symmetric(self.frames, forces, &written.units, &[&|_| 1.0], written.together);
        self.add_written(places, terms, written);
    }

    fn add_written(&mut self, places: &[String], terms: Vec<Term>, written: Written) {
        let forces = written.units.len();
        let whole = if written.together == forces { forces } else { 0 };
        self.add_with(places, "general", "constant", terms, whole, 0.0);
        self.write_last(Says::Directions(written));
    }

    /// How elements say the block that was added last.
    fn write_last(&mut self, says: Says) {
        if let Some(last) = self.written.last_mut() {
            *last = Some(says);
        }
    }

    /// Whether what a pose has of its own is looked for.
    fn looks_at_single_poses(&self) -> bool {
        self.frames.len() <= self.problem.rules.max_single_poses
    }

    /// Rms of a sum of the wrenches that pass, over the readings.
    fn usual_load(&self, of: impl Fn(&Frame) -> elastic::V8) -> f64 {
        let sums: Vec<elastic::V8> = self.frames.iter().map(of).collect();
        let squares =
            self.passing.iter().zip(&self.readings.conditions).map(|((now, _), c)| sums[c.pose].dot(now).powi(2));
        (squares.sum::<f64>() / self.passing.len() as f64).sqrt().max(f64::MIN_POSITIVE)
    }

    fn mean(&self, of: impl Fn(&Frame) -> f64) -> f64 {
        self.frames.iter().map(of).sum::<f64>() / self.frames.len() as f64
    }

    fn spread(&self, of: impl Fn(&Frame) -> f64) -> f64 {
        let mean = self.mean(&of);
        self.mean(|f| (of(f) - mean).powi(2)).sqrt().max(f64::MIN_POSITIVE)
    }
}

/// What the readings say of places.
pub fn infer(levels: &Levels<'_>, noise: &Noise, model: &Model, readings: &Readings) -> Option<(World, Inferred)> {
    let world = World::new(levels.plain, model, readings)?;
    let inferred = pkm_diagnosis::places::infer(levels, noise, &world.on(levels.plain, readings))?;
    Some((world, inferred))
}

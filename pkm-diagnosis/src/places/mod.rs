//! Where something yields, whatever its formula.
//!
//! Candidates with a formula (`crate::search`) share a weakness: what a formula misses becomes another name. Here each place
//! has *blocks*: columns for everything that may yield there, under a zero-mean normal prior whose scale the evidence
//! chooses. Sets of blocks are compared by evidence, each linear about its own optimum; steps forward, removal and
//! exchange. The result is places with probabilities, which decide what the search by formulas may name.

mod evidence;
mod low_rank;
mod search;

use nalgebra::{DMatrix, DVector};

pub use search::{NOWHERE, infer};

/// A family of columns at one place.
#[derive(Clone, Debug)]
pub struct Block {
    /// Where it is; several when it acts alike in several places, the most affected first; none for a smooth residual that
    /// goes with no place.
    pub places: Vec<String>,
    /// In which direction it gives.
    pub motion: &'static str,
    /// What it depends on.
    pub law: &'static str,
    /// Columns.
    pub columns: usize,
    /// Number of forces when the columns are the entries of a symmetric compliance on these, row by row of the lower triangle
    /// and scaled so that an off-diagonal amplitude is twice the entry; else 0.
    pub forces: usize,
    /// ln of the prior weight.
    pub ln_prior: f64,
}

/// Values of the unknowns.
#[derive(Clone, Debug)]
pub struct State {
    /// Declared values, in units of their uncertainty.
    pub declared: Vec<f64>,
    /// Amplitudes of blocks, in units of their prior scale 1.
    pub blocks: Vec<(usize, Vec<f64>)>,
}

/// A forward model with blocks.
pub trait PlaceModel: Sync {
    /// Number of declared values.
    fn declared(&self) -> usize;

    /// What may yield.
    fn blocks(&self) -> &[Block];

    /// The model at a state. `None` where it has no prediction.
    fn at<'a>(&'a self, state: &State) -> Option<Box<dyn AtState + 'a>>;
}

/// A model at a state.
pub trait AtState: Sync {
    /// Whitened predictions.
    fn predicted(&self) -> &DVector<f64>;

    /// Their derivatives by the declared values.
    fn declared(&self) -> DMatrix<f64>;

    /// Their derivatives by the amplitudes of a block.
    fn block(&self, block: usize) -> Option<DMatrix<f64>>;
}

/// A block that may be what was found.
#[derive(Clone, Debug)]
pub struct Rival {
    /// Which.
    pub block: usize,
    /// Where it is, [`NOWHERE`] if it has no place.
    pub places: Vec<String>,
    /// That it is the one.
    pub probability: f64,
}

/// A finding.
#[derive(Clone, Debug)]
pub struct Finding {
    /// The likeliest block.
    pub block: usize,
    /// Gain in ln evidence over the set without it.
    pub gain: f64,
    /// What could stand there, one block a place or places that act alike, given the other findings; the likeliest first. What their
    /// probabilities lack of 1 is that nothing is there.
    pub rivals: Vec<Rival>,
    /// What differences of ln evidence were divided by for these probabilities.
    pub temper: f64,
    /// What it may do to the readings: whitened columns of one prior standard deviation.
    pub columns: DMatrix<f64>,
    /// Amplitudes of the likeliest block's columns.
    pub amplitudes: Vec<f64>,
}

/// What was inferred.
#[derive(Clone, Debug)]
pub struct Inferred {
    /// In the order of their gains.
    pub findings: Vec<Finding>,
    /// What could be found beside these and gains too little: blocks with probabilities that one is there after all.
    pub refused: Vec<Rival>,
    /// Sets of blocks that were compared, by their evidence alone; the likeliest first.
    pub alternatives: Vec<(Vec<usize>, f64)>,
    /// Reduced χ² of the whitened readings.
    pub reduced_chi2: f64,
}

impl Inferred {
    /// Probability that something acts on the readings which goes with no place.
    pub fn none_of_these(&self) -> f64 {
        let nowhere = |rivals: &[Rival]| {
            let all = rivals.iter().filter(|r| r.places.iter().any(|place| place == NOWHERE));
            all.map(|r| r.probability).sum::<f64>()
        };
        let found = self.findings.iter().map(|f| nowhere(&f.rivals));
        1.0 - found.chain([nowhere(&self.refused)]).map(|p| 1.0 - p).product::<f64>()
    }
}

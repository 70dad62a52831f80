//! Columns of blocks: what each does to a reading.

use std::sync::Arc;

use nalgebra::DVector;

use super::elastic::{Frame, M6, M8, M68, V8};

/// Elongations in the sense of the transmitted wrenches at a pose, from these and from those where the load turned.
pub type Law = Arc<dyn Fn(usize, &V8, &V8) -> V8 + Send + Sync>;
/// A displacement of what is read.
pub type Direct = Arc<dyn Fn(&Seen<'_>) -> [f64; 6] + Send + Sync>;
/// How far a reading lags behind, from what it would be without that, and would have been where the load turned: 0 if it did not.
pub type Lag = Arc<dyn Fn(f64, f64) -> f64 + Send + Sync>;

/// One condition, as terms see it.
pub struct Seen<'a> {
    /// Terminal compliance.
    pub compliance: &'a M6,
    /// Index of the pose.
    pub pose: usize,
    /// At A.
    pub wrench: [f64; 6],
    /// Predicted displacement where the sensor is.
    pub displacement: [f64; 6],
}

/// One column.
#[derive(Clone)]
pub enum Term {
    /// A compliance that the transmitted wrenches meet, by pose.
    Elastic(Arc<Vec<M8>>),
    /// The same at one pose alone.
    AtPose(usize, Box<M8>),
    /// A stiffness at A beside the mechanism, by pose.
    Beside(Arc<Vec<M6>>),
    /// The same times a factor of each entry of the whitened readings.
    Times(Arc<Vec<M8>>, Arc<Vec<f64>>),
    /// An elongation.
    Law(Law),
    /// A displacement of the reading.
    Direct(Direct),
    /// What a channel lags behind.
    Lag(usize, Lag),
    /// A displacement by entry.
    Entry(Arc<Vec<f64>>),
    /// A whitened column, valid near the declared machine.
    Fixed(Arc<DVector<f64>>),
}

/// Rows of a matrix of forces.
pub fn rows(forces: &M68, which: &[usize]) -> Vec<V8> {
    which.iter().map(|i| forces.row(*i).transpose()).collect()
}

/// Entries of a symmetric compliance of so many forces, of which so many after another yield `together`, row by row of the lower
/// triangle: all of them where all do, the diagonal where each does by itself.
pub fn entries(forces: usize, together: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..forces).flat_map(move |i| (i - i % together..=i).map(move |j| (i, j)))
}

/// Symmetric compliances on some forces times shapes of the pose, see [`entries`].
pub fn symmetric(
    frames: &[Frame],
    forces: &dyn Fn(&Frame) -> Vec<V8>,
    units: &[f64],
    shapes: &[&dyn Fn(&Frame) -> f64],
    together: usize,
) -> Vec<Term> {
    let rows: Vec<Vec<V8>> = frames.iter().map(forces).collect();
    let mut terms = Vec::new();
    for (i, j) in entries(units.len(), together) {
        let unit = 0.5 * (units[i] * units[j]).sqrt();
        for shape in shapes {
            let of =
                |(f, r): (&Frame, &Vec<V8>)| (r[i] * r[j].transpose() + r[j] * r[i].transpose()) * (unit * shape(f));
            terms.push(Term::Elastic(Arc::new(frames.iter().zip(&rows).map(of).collect())));
        }
    }
    terms
}

/// Terms of several limbs that have one amplitude.
pub fn alike(limbs: &[Vec<Term>]) -> Vec<Term> {
    let count = limbs.iter().map(Vec::len).min().unwrap_or(0);
    let sum = |k: usize| {
        let mut sum: Vec<M8> = Vec::new();
        for limb in limbs {
            if let Term::Elastic(e) = &limb[k] {
                sum.resize(e.len(), M8::zeros());
                sum.iter_mut().zip(e.iter()).for_each(|(s, e)| *s += e);
            }
        }
        Term::Elastic(Arc::new(sum))
    };
    (0..count).map(sum).collect()
}

//! What blocks found as elements, compliances as coupled ones and stiffnesses of ties: what was inferred goes to the controller with
//! its directions.

use nalgebra::{DMatrix, DVector, Vector3};
use pkm_core::effects::{Element, MAX_ELEMENT_PARAMETERS, Motion, Place};
use pkm_core::machine::Geometry;

use super::terms::entries;

/// Greatest weight.
const MAX_WEIGHT: f64 = 7.99;
/// Most weights of a coupled element.
const MAX_WEIGHTS: usize = MAX_ELEMENT_PARAMETERS - 1;
/// Most elements that say one compliance: the greatest of its main directions.
const MAX_ELEMENTS: usize = 4;
/// The same where it is said by those alone in which it yields: all six of what is at A.
const MAX_YIELDING: usize = 6;
/// Least share of the greatest that is worth an element.
const MIN_SHARE: f64 = 1e-3;

/// How the compliance of a block, or the stiffness of a tie, is written as elements.
#[derive(Clone)]
pub struct Written {
    /// Places that have it alike.
    pub places: Vec<Place>,
    motion: Motion,
    /// Scale of each of the block's forces, m/N or rad/(N·m); of a tie N/m.
    pub units: Vec<f64>,
    /// How many of these after another yield together.
    pub together: usize,
    /// Components of an element's direction by the block's forces.
    to_direction: DMatrix<f64>,
}

impl Written {
    /// Each force of the block is one component of the direction.
    pub fn of(places: &[Place], units: &[f64], component: &dyn Fn(usize) -> usize) -> Self {
        let to_direction = DMatrix::from_fn(MAX_WEIGHTS, units.len(), |i, n| f64::from(component(n) == i));
        Self::coupled(places, units, to_direction)
    }

    fn coupled(places: &[Place], units: &[f64], to_direction: DMatrix<f64>) -> Self {
        let (places, units, together) = (places.to_vec(), units.to_vec(), units.len());
        Self { places, motion: Motion::Coupled, units, together, to_direction }
    }

    /// The same where at most so many forces after another yield together, and not with the others.
    pub fn by(self, together: usize) -> Self {
        Self { together: together.min(self.units.len()), ..self }
    }

    /// A tie of a place along axes, with the scale of each.
    pub fn tie(place: Place, motion: Motion, units: &[f64]) -> Self {
        Self { motion, ..Self::of(&[place], units, &|n| n) }
    }

    /// Whether less than nothing of it is nonsense: a compliance may be less than declared, a tie is there or is not.
    pub fn is_one_sided(&self) -> bool {
        self.motion.is_tie()
    }

    /// The same of other places.
    pub fn at(self, places: &[Place]) -> Self {
        Self { places: places.to_vec(), ..self }
    }

    /// Some components of the wrench at B, of which the forces and moments at the base points are the sum.
    pub fn of_ground(g: &Geometry, units: &[f64], which: &[usize]) -> Self {
        let points = [Vector3::new(0.0, -g.b1_m, 0.0), Vector3::new(0.0, g.b1_m, 0.0), Vector3::new(g.b2_m, 0.0, 0.0)];
        let of = |component: usize| {
            let mut direction = DVector::zeros(MAX_WEIGHTS);
            for (limb, point) in points.iter().enumerate() {
                let axis = Vector3::ith(component % 3, 1.0);
                let force = if component < 3 { axis } else { axis.cross(point) };
                direction.rows_mut(3 * limb, 3).copy_from(&force);
                if component >= 3 {
                    direction[9 + 2 * limb] = axis.x;
                    direction[10 + 2 * limb] = axis.z;
                }
            }
            direction
        };
        let columns: Vec<DVector<f64>> = which.iter().map(|k| of(*k)).collect();
        Self::coupled(&[Place::Base], units, DMatrix::from_columns(&columns))
    }

    /// By what an element's direction is divided, so that its weights are what they should be.
    fn size(&self, direction: &DVector<f64>) -> f64 {
        if self.motion.is_tie() {
            // its stiffness is that along its line
            let [along, about] = [0, 3].map(|first| direction.rows(first, 3).norm());
            along.max(about)
        } else {
            direction.amax() / MAX_WEIGHT
        }
    }

    /// The elements that say the compliance with these amplitudes of the block's columns, each at every place alike, and
    /// its compliance in m/N, or stiffness in N/m; the greatest first, and those alone that yield if asked for.
    pub fn elements(&self, amplitudes: &[f64], yielding: bool) -> Vec<(Vec<Element>, f64)> {
        let n = self.units.len();
        let mut compliance = DMatrix::zeros(n, n);
        for ((i, j), amplitude) in entries(n, self.together).zip(amplitudes) {
            compliance[(i, j)] = amplitude * if i == j { 1.0 } else { 0.5 };
            compliance[(j, i)] = compliance[(i, j)];
        }
        let eigen = compliance.symmetric_eigen();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].abs().total_cmp(&eigen.eigenvalues[*a].abs()));
        let greatest = order.first().map_or(0.0, |k| eigen.eigenvalues[*k].abs());
        let is_worth = |k: &usize| {
            let value = eigen.eigenvalues[*k];
            value.abs() > MIN_SHARE * greatest && (value > 0.0 || !(yielding || self.is_one_sided()))
        };
        let kept = order.into_iter().filter(is_worth).take(if yielding { MAX_YIELDING } else { MAX_ELEMENTS });
        kept.filter_map(|k| {
            let roots = DVector::from_fn(n, |i, _| eigen.eigenvectors[(i, k)] * self.units[i].sqrt());
            let direction = &self.to_direction * roots;
            let size = self.size(&direction);
            let parameters: [f64; MAX_ELEMENT_PARAMETERS] =
                std::array::from_fn(|i| if i == 0 { 0.0 } else { direction[i - 1] / size });
            let of = |place: &Place| Element::from_names(place.name()?, self.motion.name(), "constant", parameters);
            let elements = self.places.iter().map(of).collect::<Option<Vec<Element>>>()?;
            Some((elements, eigen.eigenvalues[k] * size * size))
        })
        .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_that_yield_are_all_said_and_no_other() {
        let written = Written::of(&[Place::Tool], &[1e-9; 6], &|n| n).by(1);
        let signs = |amplitudes: &[f64; 6], yielding: bool| -> Vec<f64> {
            written.elements(amplitudes, yielding).iter().map(|(_, compliance)| compliance.signum()).collect()
        };
        let amplitudes = [5.0, 4.0, -3.0, 2.0, 1.0, -0.5];
        assert_eq!(signs(&amplitudes, false), [1.0, 1.0, -1.0, 1.0]);
        assert_eq!(signs(&amplitudes, true), [1.0; 4]);
        assert_eq!(signs(&amplitudes.map(f64::abs), true), [1.0; 6]);
    }
}

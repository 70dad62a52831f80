//! How well a period's deflection is known.

use nalgebra::Vector3;

use crate::correction::TableUncertainty;
use crate::estimation::Estimator;
use crate::scalar::Scalar;
use crate::types::TipUncertainty;

/// How well the deflection under a load is known, and how much of it is compensated for that reason.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Known<T> {
    /// Of the tip's translation along u, v, w under the load that is compensated.
    pub uncertainty: TipUncertainty<T>,
    /// Share of the deflection that is compensated beside the gain: 1 where the tip moves by more than its expanded uncertainty,
    /// see [`TipUncertainty::known_share`]; thermal growth has no part in either. A controller that compensates the whole or nothing takes
    /// `enabled` away below 1.
    pub share: T,
}

/// What there is to know a deflection by, beside machine and table.
pub(crate) struct Knowledge<'a, T, const N: usize> {
    /// How far the table may be off.
    pub table: Option<&'a TableUncertainty<T>>,
    /// What was learned, with its own uncertainty.
    pub learned: Option<&'a Estimator<T, N>>,
}

impl<T: Scalar> Knowledge<'_, T, 0> {
    /// Nothing.
    pub const NONE: Self = Self { table: None, learned: None };
}

impl<T: Scalar, const N: usize> Knowledge<'_, T, N> {
    /// From the variances of both, the way of the tip and what the zeros hold of a weight; `None` when neither is there.
    pub fn known(&self, variance_m2: &Vector3<T>, moved_m: &Vector3<T>, held_m: &Vector3<T>) -> Option<Known<T>> {
        if self.table.is_none() && self.learned.is_none() {
            return None;
        }
        let uncertainty = TipUncertainty { variance_m2: *variance_m2 };
        // where a load cancels the weight next to nothing moves the tip, and what is compensated is the zeros' part
        let [share, of_held] = [moved_m, held_m].map(|way_m| uncertainty.known_share(way_m));
        Some(Known { uncertainty, share: if of_held > share { of_held } else { share } })
    }
}

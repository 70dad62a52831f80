//! What a compensated deflection is predicted by, and how well it is known.

use nalgebra::Vector3;

use crate::correction::{CorrectionTable, TableUncertainty};
use crate::estimation::Estimator;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::TipUncertainty;

/// What stays from period to period: machine and table, and what is known of both. `N` amplitudes were learned, 0 without an estimator.
///
/// ```
/// use pkm_core::Model;
/// use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64, UNCERTAINTY_F64};
///
/// let model = Model::new(&MACHINE_F64, &TABLE_F64).with_uncertainty(&UNCERTAINTY_F64);
/// assert!(model.learned.is_none());
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Model<'a, T, const N: usize = 0> {
    /// At its temperature, see [`Machine::at_temperature`].
    pub machine: &'a Machine<T>,
    /// Of this machine.
    pub table: &'a CorrectionTable<'a, T>,
    /// Of this table, as `fit` has written it beside the table.
    pub uncertainty: Option<&'a TableUncertainty<T>>,
    /// What was learned of this machine with this table, after its [step](Estimator::follow) of the period.
    pub learned: Option<&'a Estimator<T, N>>,
}

impl<'a, T> Model<'a, T> {
    /// Machine and table as they are: all of the deflection that they predict counts as known.
    pub const fn new(machine: &'a Machine<T>, table: &'a CorrectionTable<'a, T>) -> Self {
        Self { machine, table, uncertainty: None, learned: None }
    }
}

impl<'a, T, const N: usize> Model<'a, T, N> {
    /// The same with the table's uncertainty.
    #[must_use]
    pub const fn with_uncertainty(self, uncertainty: &'a TableUncertainty<T>) -> Self {
        Self { uncertainty: Some(uncertainty), ..self }
    }

    /// The same with what was learned.
    #[must_use]
    pub const fn with_learned<const M: usize>(self, learned: &'a Estimator<T, M>) -> Model<'a, T, M> {
        let Self { machine, table, uncertainty, .. } = self;
        Model { machine, table, uncertainty, learned: Some(learned) }
    }
}

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

impl<T: Scalar, const N: usize> Model<'_, T, N> {
    /// From the variances of table and amplitudes, the way of the tip and what the zeros hold of a weight; `None` when neither is there.
    pub(crate) fn known(
        &self,
        variance_m2: &Vector3<T>,
        moved_m: &Vector3<T>,
        held_m: &Vector3<T>,
    ) -> Option<Known<T>> {
        if self.uncertainty.is_none() && self.learned.is_none() {
            return None;
        }
        let uncertainty = TipUncertainty { variance_m2: *variance_m2 };
        // where a load cancels the weight next to nothing moves the tip, and what is compensated is the zeros' part
        let [share, of_held] = [moved_m, held_m].map(|way_m| uncertainty.known_share(way_m));
        Some(Known { uncertainty, share: if of_held > share { of_held } else { share } })
    }
}

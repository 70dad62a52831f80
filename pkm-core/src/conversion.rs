//! Machines, wrists and tables in another number type.

use crate::correction::{Basis, CorrectionTable};
use crate::effects::ActiveEffects;
use crate::machine::{LimbCompliance, Machine, Sizes};
use crate::scalar::Scalar;
use crate::wrist::Wrist;

/// The nearest numbers of another type.
pub(crate) fn converted<U: Scalar, const N: usize>(numbers: &[f64; N]) -> [U; N] {
    numbers.map(U::from_f64)
}

impl Sizes<f64> {
    fn converted<U: Scalar>(&self) -> Sizes<U> {
        let [a1, a2, b1, b2] = converted(&[self.a1, self.a2, self.b1, self.b2]);
        Sizes { a1, a2, b1, b2 }
    }
}

impl LimbCompliance<f64> {
    fn converted<U: Scalar>(&self) -> LimbCompliance<U> {
        let [axial, bending, torsion] = converted(&[self.axial, self.bending, self.torsion]);
        LimbCompliance {
            base_linear: converted(&self.base_linear),
            base_angular: converted(&self.base_angular),
            platform_linear: converted(&self.platform_linear),
            platform_angular: converted(&self.platform_angular),
            axial,
            bending,
            torsion,
            coupled: self.coupled,
        }
    }
}

impl Machine<f64> {
    /// The same machine in another number type, for a host that runs the formulas on its own.
    pub fn converted<U: Scalar>(&self) -> Machine<U> {
        let [one, two, three] = &self.limbs;
        Machine {
            declared: self.declared.converted(),
            actual: self.actual.converted(),
            q_min: converted(&self.q_min),
            q_max: converted(&self.q_max),
            limbs: [one.converted(), two.converted(), three.converted()],
            softness: converted(&self.softness),
            effects: ActiveEffects::converted(&self.effects),
        }
    }
}

impl Wrist<f64> {
    /// The same wrist in another number type.
    pub fn converted<U: Scalar>(&self) -> Wrist<U> {
        Wrist {
            offset: U::from_f64(self.offset),
            first_d: U::from_f64(self.first_d),
            first_b: U::from_f64(self.first_b),
            second_b: U::from_f64(self.second_b),
            flange: U::from_f64(self.flange),
            min: converted(&self.min),
            max: converted(&self.max),
            home_z0: U::from_f64(self.home_z0),
            home_determinant: U::from_f64(self.home_determinant),
            margin: U::from_f64(self.margin),
        }
    }
}

impl<'a> CorrectionTable<'a, f64> {
    /// The same table in another number type. Its coefficients go to `store`; `None` where that is too short for them, at most
    /// 27 for each term.
    pub fn converted<'b, U: Scalar>(&self, store: &'b mut [U]) -> Option<CorrectionTable<'b, U>>
    where
        'a: 'b,
    {
        let numbers = self.diagonal.iter().chain(self.factor.unwrap_or(&[]));
        let count = self.diagonal.len() + self.factor.map_or(0, <[f64]>::len);
        let store = store.get_mut(..count)?;
        for (to, from) in store.iter_mut().zip(numbers) {
            *to = U::from_f64(*from);
        }
        let (diagonal, factor) = store.split_at_checked(self.diagonal.len())?;
        let Basis { centre, half_width, terms } = &self.basis;
        let basis = Basis { centre: converted(centre), half_width: converted(half_width), terms };
        Some(CorrectionTable { basis, diagonal, factor: self.factor.map(|_| factor) })
    }
}

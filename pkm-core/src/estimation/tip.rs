//! What was learned, at the tip.

use nalgebra::Vector3;

use super::Estimator;
use super::reading::TipEstimate;
use crate::kinematics::Posture;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::StiffnessError;
use crate::types::{Deflection, Wrench};

impl<T: Scalar, const N: usize> Estimator<T, N> {
    /// What was learned of the tip's deflection, from the displacements of A per unit of each amplitude
    /// ([`Machine::sensitivities`]). The uncertainty is that of the best values, and what they say beyond what is compensated.
    pub fn tip(&self, sensitivities: &[Deflection<T>; N], tip_m: Vector3<T>) -> TipEstimate<T> {
        let mut tip = TipEstimate { deflection: Deflection::ZERO, variance_m2: Vector3::zeros() };
        self.add_tip(sensitivities, tip_m, (&mut tip.deflection, &mut tip.variance_m2));
        tip
    }

    #[inline(never)] // takes no stack while the stiffness is worked out
    fn add_tip(
        &self,
        sensitivities: &[Deflection<T>; N],
        tip_m: Vector3<T>,
        (moved, variance_m2): (&mut Deflection<T>, &mut Vector3<T>),
    ) {
        let mut rows = [[T::ZERO; N]; 3];
        let [along_u, along_v, along_w] = &mut rows;
        let mut sum = *moved;
        for (n, (moved, own)) in sensitivities.iter().zip(&self.scaled).enumerate() {
            sum = sum.plus(&moved.times(own.deviation * self.applied[n]));
            let seen_m = moved.seen_at(tip_m).translation_m * own.deviation;
            [along_u[n], along_v[n], along_w[n]] = seen_m.into();
        }
        *moved = sum;
        // what the best values say beyond what is compensated
        let mut left = self.filter.mean;
        left.iter_mut().zip(&self.applied).for_each(|(left, applied)| *left -= *applied);
        for (variance, row) in variance_m2.iter_mut().zip(&rows) {
            let left = (0..N).fold(T::ZERO, |sum, n| sum + row[n] * left[n]);
            *variance += left * left + self.filter.variance_of(row);
        }
    }

    /// What is used for compensation of the warmth beyond what temperature sensors say, K.
    pub(crate) fn warmer_k(&self) -> T {
        let warmth = self.applied.get(self.warmth).zip(self.scaled.get(self.warmth));
        warmth.map_or(T::ZERO, |(applied, own)| own.deviation * *applied)
    }

    /// Adds what was learned of compliances to a displacement of A under a load, and its variances to those of the tip. Of warmth nothing: it
    /// is no part of what the load does, and [`warmer_k`](Self::warmer_k) has it.
    #[inline(never)] // takes no stack while the stiffness is worked out
    pub(crate) fn add_to(
        &self,
        machine: &Machine<T>,
        posture: &Posture<T>,
        wrench: &Wrench<T>,
        tip_m: Vector3<T>,
        sums: (&mut Deflection<T>, &mut Vector3<T>),
    ) -> Result<(), StiffnessError> {
        // written over; zeros would take a period longer than copies
        let mut sensitivities = [*sums.0; N];
        machine.put_sensitivities(posture, wrench, self.each_amplitude(), &mut sensitivities)?;
        if let Some(grown) = sensitivities.get_mut(self.warmth) {
            *grown = Deflection::ZERO;
        }
        self.add_tip(&sensitivities, tip_m, sums);
        Ok(())
    }
}

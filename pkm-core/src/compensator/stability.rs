//! The loop that a force sensor closes through the compensation (`docs/stability.md`).

use nalgebra::{Matrix3, Vector3};

use crate::linalg::from_columns;
use crate::scalar::Scalar;
use crate::stiffness::{StiffnessError, StiffnessFactor};
use crate::types::Wrench;

/// Gain of the loop tip → contact force → sensor → compensation → tip, at rest. Positive feedback: stable below 1, and slower to
/// settle by 1/(1 − loop gain).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LoopGain<T> {
    /// Compliance of the tip in its softest direction, m/N.
    pub compliance_m_per_n: T,
    /// γ K_e C/(1 + K_e C) in that direction, with the gain γ of the compensator.
    pub loop_gain: T,
}

impl<T: Scalar> LoopGain<T> {
    /// For a tip that touches a workpiece, whichever way.
    ///
    /// # Arguments
    /// * `factor`: of K_m at the pose.
    /// * `tip_m`: the tip in A-uvw, m.
    /// * `contact_n_per_m`: stiffness K_e of workpiece and contact, N/m, 0 or more.
    /// * `gain`: [`CompensatorSettings::gain`](super::CompensatorSettings::gain).
    ///
    /// # Errors
    /// [`StiffnessError::NotFinite`]: an argument or the result is not finite, or the contact's stiffness is negative.
    ///
    /// ```
    /// use pkm_core::compensator::LoopGain;
    /// use pkm_core::nalgebra::Vector3;
    /// use pkm_core::{Pose, tables::reference::{MACHINE_F64, TABLE_F64}};
    /// let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
    /// let k_m = TABLE_F64.factor_form(&MACHINE_F64, &pose)?.factor;
    /// let steel = LoopGain::new(&k_m, Vector3::new(0.0, 0.0, 0.3), 1e8, 0.7)?;
    /// assert!(steel.loop_gain < 0.7);
    /// // the table's compliance may be this much too large before the loop is unstable
    /// assert!(1.0 / steel.loop_gain > 1.4);
    /// # Ok::<(), pkm_core::CorrectionError>(())
    /// ```
    pub fn new(
        factor: &StiffnessFactor<T>,
        tip_m: Vector3<T>,
        contact_n_per_m: T,
        gain: T,
    ) -> Result<Self, StiffnessError> {
        let (o, i) = (T::ZERO, T::ONE);
        let mut compliance = [[i, o, o], [o, i, o], [o, o, i]];
        for column in &mut compliance {
            let push = Wrench { force_n: (*column).into(), ..Wrench::ZERO };
            *column = factor.deflection(&push.moved_to_a(tip_m))?.seen_at(tip_m).translation_m.into();
        }
        let compliance_m_per_n = greatest_eigenvalue(&from_columns(compliance));
        let stiffer = contact_n_per_m * compliance_m_per_n;
        let loop_gain = gain * stiffer / (T::ONE + stiffer);
        if stiffer >= T::ZERO && loop_gain.is_finite() {
            Ok(Self { compliance_m_per_n, loop_gain })
        } else {
            Err(StiffnessError::NotFinite)
        }
    }
}

/// Of a symmetric matrix, in closed form: q + 2 p cos(φ/3), cos φ = det((A − q)/p)/2 (O. K. Smith, Commun. ACM 4 (1961) 168).
fn greatest_eigenvalue<T: Scalar>(a: &Matrix3<T>) -> T {
    let three = T::from_f64(3.0);
    let q = (a.m11 + a.m22 + a.m33) / three;
    let [x, y, z] = [a.m11 - q, a.m22 - q, a.m33 - q];
    let (xy, xz, yz) = (a.m12, a.m13, a.m23);
    let (xy2, xz2, yz2) = (xy * xy, xz * xz, yz * yz);
    let two = T::from_f64(2.0);
    let p = ((x * x + y * y + z * z + two * (xy2 + xz2 + yz2)) / (two * three)).sqrt();
    if !(p > T::ZERO) {
        return q;
    }
    let [x, y, z, xy, xz, yz] = [x, y, z, xy, xz, yz].map(|entry| entry / p);
    let half_determinant = (x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)) / two;
    let cos = if half_determinant > T::ONE {
        T::ONE
    } else if half_determinant < -T::ONE {
        -T::ONE
    } else {
        half_determinant
    };
    q + two * p * (cos.acos() / three).cos()
}

//! K_p of a machine: its limbs, what couples them, and what is in series with them.

use nalgebra::Vector3;

use super::{Stiffness, StiffnessError, check_diagonal};
use crate::elastic::{ALL, Chain, Series, soften, stiffen};
use crate::kinematics::Posture;
use crate::linalg::{self, Lower};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::Pose;

impl<T: Scalar> Machine<T> {
    /// Terminal stiffness K_p at A in A-uvw (Eqs. 7-9), with the machine's effects.
    ///
    /// Accuracy: without effects it equals the dense 24×24 structural matrix of Eq. 8 to 1e-13 of √(k_ii k_jj) in
    /// f64. In f32 it is within 2e-5 of f64 in the same measure, without any scaling inside: K_p is a sum of positive
    /// springs, in which nothing cancels. With effects in series (base, wrist), which subtract, within 1e-3 for 1e-9 m/N
    /// and 1e-6 rad/(N·m).
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse), and [`StiffnessError::NotPositiveDefinite`] when rounding leaves a
    /// limb without compliance or a direction without stiffness.
    ///
    /// ```
    /// use pkm_core::{Pose, StiffnessError, tables::reference};
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let k_p = reference::MACHINE_F64.stiffness(&pose)?;
    /// let k = k_p.principal() / 1e6; // N/µm
    /// assert!(k.z > k.x && k.z > k.y);
    /// assert_eq!(k_p.matrix(), k_p.matrix().transpose());
    /// # Ok::<(), StiffnessError>(())
    /// ```
    pub fn stiffness(&self, pose: &Pose<T>) -> Result<Stiffness<T>, StiffnessError> {
        let mut lower = linalg::zero();
        self.add_stiffness_below_tool(&self.posture(pose)?, &mut lower)?;
        self.add_tool_compliance(&mut lower)?;
        check_diagonal(&lower)?;
        Ok(Stiffness { lower })
    }

    /// Adds K_p without what is elastic between A and the tool, what correction tables apply to, to zeros.
    pub(crate) fn add_stiffness_below_tool(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        if self.effects.any() {
            self.add_stiffness_with_effects(p, k)
        } else {
            self.add_stiffness_without_effects(p, k)
        }
    }

    // this and what follows are apart, so that they don't take the stack all at once
    #[inline(never)]
    fn add_stiffness_without_effects(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        // nothing couples a limb's axial force with its other wrenches
        let (first, second) = (self.chain_1_2::<0, false>(p, T::ZERO), self.chain_1_2::<1, false>(p, T::ZERO));
        for limb in [first, second] {
            let (mut axial, mut others) = limb.split();
            axial.add_stiffness_to(k, [1, 2, 3])?;
            others.add_stiffness_to(k, [0, 4, 5])?;
        }
        let (mut axial, mut sideways) = self.chain_3::<false>(p, T::ZERO).split();
        axial.add_stiffness_to(k, [0, 1, 2, 4, 5])?;
        Ok(sideways.add_stiffness_to(k, [1, 2, 4, 5])?)
    }

    #[inline(never)]
    fn add_stiffness_with_effects(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        // by reference: `?` would copy all of it
        let actual = self.actual(p);
        let actual = match &actual {
            Ok(actual) => actual,
            Err(e) => return Err((*e).into()),
        };
        self.add_limbs_with_effects(&actual.posture, k)?;
        let definite = self.add_compliance_in_series(&actual.posture, k);
        actual.given_back_matrix(k);
        if definite { check_diagonal(k) } else { Err(StiffnessError::NotPositiveDefinite) }
    }

    /// Softens K by what yields at B and between limbs and A; false when a negative compliance leaves nothing definite.
    #[inline(never)]
    fn add_compliance_in_series(&self, p: &Posture<T>, k: &mut Lower<T>) -> bool {
        let (at, axes) = (p.n() * -p.l, p.base());
        let mut definite = true;
        self.effects.at_base(|compliance| definite &= Series { at, axes, compliance }.soften(k));
        self.effects.at_hub(|compliance| definite &= Series::at_a(compliance).soften(k));
        definite
    }

    #[inline(never)]
    fn add_limbs_with_effects(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let mut limbs = Chain::zero();
        self.limbs_with_effects(p, &mut limbs, k);
        Ok(limbs.add_stiffness_to(k, ALL)?)
    }

    /// Turns zeros into the three limbs together, with what effects add inside them; and into what is beside them in K, lower
    /// triangle. At the actual posture.
    #[inline(never)]
    pub(super) fn limbs_with_effects(&self, p: &Posture<T>, limbs: &mut Chain<T, 8>, beside: &mut Lower<T>) {
        let offset = self.effects.offset();
        let mut p = *p;
        p.offset(offset);
        let (p, [h, h_3]) = (&p, offset);
        self.put_limb_with_effects::<0, 0>(p, h, limbs, beside);
        self.put_limb_with_effects::<1, 3>(p, h, limbs, beside);
        self.put_limb_3_with_effects(p, h_3, limbs, beside);
        self.couple_limbs_1_2(p, limbs);
        if self.effects.are_coupled() {
            self.couple(p, offset, limbs);
        }
        if self.effects.are_ties() {
            self.tie(p, offset, beside);
        }
    }

    #[inline(never)]
    fn tie(&self, p: &Posture<T>, offset: [T; 2], beside: &mut Lower<T>) {
        self.effects.ties(|limb| self.frame_of(p, offset, limb), |pull, stiffness| stiffen(beside, &pull, stiffness));
    }

    #[inline(never)]
    fn couple(&self, p: &Posture<T>, offset: [T; 2], limbs: &mut Chain<T, 8>) {
        let length = |limb: usize| p.q.as_slice().get(limb).copied().unwrap_or(T::ZERO);
        self.effects.couple(|limb| self.frame_of(p, offset, limb), length, &p.base(), limbs);
    }

    #[inline(never)]
    fn couple_limbs_1_2(&self, p: &Posture<T>, limbs: &mut Chain<T, 8>) {
        let z = p.x().cross(&p.y());
        self.effects.between_arms_1_2(|bridge| limbs.add_mode(Vector3::z(), T::ONE, bridge));
        self.effects.between_bases_1_2(|[together, opposed]| {
            limbs.add_mode(z, T::ONE, together);
            limbs.add_mode(z, -T::ONE, opposed);
        });
    }

    /// Softens K by what lies between A and the tool; true if there was any.
    pub(crate) fn add_tool_compliance(&self, k: &mut Lower<T>) -> Result<bool, StiffnessError> {
        let (mut any, mut definite) = (false, true);
        if self.effects.any() {
            self.effects.at_tool(|compliance| {
                any = true;
                definite &= Series::at_a(compliance).soften(k);
            });
            self.effects.coupled_at_tool(|motion, compliance| {
                any = true;
                definite &= soften(k, motion, compliance);
            });
        }
        if any {
            check_diagonal(k)?;
        }
        if definite { Ok(any) } else { Err(StiffnessError::NotPositiveDefinite) }
    }
}

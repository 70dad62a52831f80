//! The transmitted wrenches of a posture one by one, for programs that identify what yields.

use nalgebra::{Matrix3, SMatrix, Vector3};

use crate::elastic::{Chain, LimbFrame};
use crate::kinematics::Posture;
use crate::linalg::{self, from_columns};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::StiffnessError;
use crate::types::Pose;

/// What the limbs transmit at a pose, and the compliance that it meets: K = H D⁻¹ Hᵀ, before what is in series at B and
/// A (paper, Eqs. 7-9; `docs/theory.md`). As [`Machine::stiffness`] has it, to rounding: 1e-13 of √(k_ii k_jj) in f64.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission<T> {
    /// Columns of H: three wrenches of limb 1, three of limb 2, two of limb 3, at A in A-uvw. The first of each limb is its
    /// axial force.
    pub wrenches: SMatrix<T, 6, 8>,
    /// D, lower triangle: m/N, m/(N·m) and rad/(N·m).
    pub compliance: SMatrix<T, 8, 8>,
    /// By limb.
    pub limbs: [LimbFrame<T>; 3],
    /// B in A-uvw, m.
    pub base_m: Vector3<T>,
    /// Unit vectors x, y, z of B in A-uvw, as columns.
    pub base_axes: Matrix3<T>,
}

impl<T: Scalar> Machine<T> {
    /// The wrenches that the limbs transmit at a pose and the compliance that these meet, with the machine's effects. For
    /// identification on a host; a control cycle has no use for it.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse).
    pub fn transmission(&self, pose: &Pose<T>) -> Result<Transmission<T>, StiffnessError> {
        let actual = self.actual(&self.posture(pose)?)?;
        let mut all = Chain::<T, 8>::zero();
        self.limbs_with_effects(&actual.posture, &mut all, &mut linalg::zero());
        let mut compliance = [[T::ZERO; 8]; 8];
        for i in 0..8 {
            for j in 0..=i {
                compliance[j][i] = all.compliance[i][j];
            }
        }
        let offset = self.effects.offset();
        let mut p = actual.posture;
        p.offset(offset);
        let limbs = [0, 1, 2].map(|limb| self.frame_of(&p, offset, limb));
        let (wrenches, compliance) = (from_columns(all.wrenches), from_columns(compliance));
        Ok(Transmission { wrenches, compliance, limbs, base_m: p.n() * -p.l, base_axes: p.base() })
    }

    /// Of a limb (0, 1, 2), A_i out of their plane by `offset`, as the posture has it.
    #[inline(never)]
    pub(super) fn frame_of(&self, p: &Posture<T>, [h, h_3]: [T; 2], limb: usize) -> LimbFrame<T> {
        match limb {
            0 => self.frame_1_2::<0>(p, h),
            1 => self.frame_1_2::<1>(p, h),
            _ => self.frame_3(p, h_3),
        }
    }
}

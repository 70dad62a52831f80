//! What an effect may change in the model.

use super::{EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::scalar::Scalar;

/// The four sizes of the platforms.
#[derive(Clone, Copy)]
pub(crate) enum Size {
    A1,
    A2,
    B1,
    B2,
}

/// How an effect changes the model. Every method has a default that changes nothing.
pub(crate) trait Effect {
    const INFO: EffectInfo;

    /// The size of a platform that differs from the declared one by the first parameter.
    const SIZE: Option<Size> = None;

    /// Adds compliance inside a limb.
    fn in_limb<T: Scalar, const N: usize>(_parameters: &[T; MAX_PARAMETERS], _limb: &mut Limb<'_, T, N>) {}

    /// Whether [`elongation`](Self::elongation) does anything.
    const DEPENDS_ON_LOAD: bool = false;

    /// How much longer a limb gets under a tension in N than its linear compliance says, in m.
    fn elongation<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _tension: T) -> T {
        T::ZERO
    }

    /// The part of a limb's elongation that depends on where the loading turned, in m: from the tensions of the
    /// linear model under the load and at the turns, the outermost first. Asked for when [`DEPENDS_ON_LOAD`](Self::DEPENDS_ON_LOAD).
    fn lag<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _tension: T, _turns: &[T]) -> T {
        T::ZERO
    }

    /// Tension in a limb (0, 1, 2) before any load, N.
    fn tension<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _limb: usize) -> T {
        T::ZERO
    }

    /// How far A_1 and A_2, and A_3, lie out of the platform's plane, along w, m.
    fn offset<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Relative loss of stiffness of limb bodies and of joints per kelvin.
    fn softening<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Relative growth of the limbs and of the platforms per kelvin.
    fn growth<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Compliances c, m/N, by which B_1 and B_2 both move along z of B by c (F_1 + F_2) of the forces there, and by
    /// ± c (F_1 − F_2).
    fn between_bases_1_2<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 2]> {
        None
    }

    /// Compliance, m/N, by which A_1 and A_2 both move along w by c (F_1 + F_2) of the forces there.
    fn between_arms_1_2<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<T> {
        None
    }

    /// Compliance between the ground and the mechanism: at B with the axes of B, both given in A-uvw.
    fn at_base<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }

    /// Compliance between the limbs and A, along and about u, v, w.
    fn at_hub<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }

    /// Whether it lies between A and the tool, and so comes after the correction table.
    const AT_TOOL: bool = false;

    /// Compliance between A and the tool, along and about u, v, w.
    fn at_tool<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }
}

//! The way of three screws on which a tip goes straight.

use nalgebra::{SVector, Vector3};

use crate::kinematics::Posture;
use crate::linalg::is_finite;
use crate::machine::Machine;
use crate::scalar::Scalar;

/// Second derivative of the screws along a way on which a tip, in A-uvw, goes straight, and which the screws begin by `way`. `None` where σ
/// does not move the tip along y.
#[inline(never)] // takes no stack while the stiffness is worked out
pub(super) fn straight<T: Scalar>(
    machine: &Machine<T>,
    posture: &Posture<T>,
    tip_m: Vector3<T>,
    way: &Vector3<T>,
) -> Option<Vector3<T>> {
    let declared = &machine.declared;
    let elongations = way.component_mul(&posture.q).into();
    let [dtheta, dsigma, dl] = declared.rates(posture, elongations);
    // the tip is at (u, y, l + n) of the axes that turn with θ; of u, σ changes nothing
    let (u, y, n) = (tip_m.x, posture.y().dot(&tip_m), posture.n().dot(&tip_m));
    let (along, dalong) = (posture.l + n, dl + y * dsigma);
    let ddsigma = -(y * dsigma * dsigma) / n;
    let ddtheta = (u * dtheta - T::from_f64(2.0) * dalong) * dtheta / along;
    let ddl = u * ddtheta + along * dtheta * dtheta + n * dsigma * dsigma - y * ddsigma;
    let o = T::ZERO;
    let (first, second) = (SVector::from([dtheta, dsigma, dl, o, o]), SVector::from([ddtheta, ddsigma, ddl, o, o]));
    let [first, second, third, _, _] = declared.joint_motion(posture, &[first, second]).acceleration.into();
    let screws = Vector3::new(first, second, third);
    is_finite(&screws).then_some(screws)
}

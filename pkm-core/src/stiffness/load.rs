//! What effects that depend on the load add to a deflection.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::{LoadHistory, StiffnessError, factor, finite};
use crate::elastic::{ALL, Chain};
use crate::kinematics::{Actual, Posture};
use crate::linalg::{self, Lower, is_finite, length};
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::types::{Deflection, Pose, Wrench};

/// Most iterations for the tensions of preloaded limbs under load-dependent elongation.
pub const MAX_ITERATIONS: usize = 30;

/// N with N = N₀ − M ε(N), by fixed-point iteration. Without preload M is 0 and N is N₀: an elongation turns the
/// mechanism's screws, and six equations of balance fix the tensions of a mechanism whose screws move freely
/// (`docs/theory.md`, Effects). With preload M ε' is the ratio of the geometric stiffness to that of the contacts.
fn tensions<T: Scalar>(
    m: &Matrix3<T>,
    linear: &Vector3<T>,
    elongations: impl Fn(&Vector3<T>) -> Vector3<T>,
) -> Result<Vector3<T>, StiffnessError> {
    let tolerance = T::SLACK * (length(linear) + T::ONE);
    let mut n = *linear;
    for _ in 0..MAX_ITERATIONS {
        let next = linear - m * elongations(&n);
        let change = next - n;
        n = next;
        if length(&change) <= tolerance {
            return Ok(n);
        }
    }
    Err(StiffnessError::NotConverged)
}

/// Number of each limb's axial force among the eight wrenches.
const AXIAL: [usize; 3] = [0, 3, 6];

/// The wrench at A per unit of elongation of one limb with A held, and the tensions of all three.
#[inline(never)] // what it works with takes no stack while the limbs are put together
fn add_response<T: Scalar>(limbs: &Chain<T, 8>, axial: usize, moved: &mut Vector6<T>, tensions: &mut [T; 3]) {
    let x = limbs.response(axial);
    *moved = limbs.combined(&x);
    for (tension, at) in tensions.iter_mut().zip(AXIAL) {
        *tension = x[at];
    }
}

/// How a machine with load-dependent effects answers loads at one pose.
#[derive(Clone, Copy, Debug)]
pub struct LoadResponse<'a, T> {
    machine: &'a Machine<T>,
    /// `None` when nothing depends on the load.
    limbs: Option<LimbResponse<T>>,
}

#[derive(Clone, Copy, Debug)]
struct LimbResponse<T> {
    actual: Actual<T>,
    /// Displacement of A per unit of elongation of each limb.
    moved: [Vector6<T>; 3],
    /// Tension in limb i taken by a unit of elongation of limb j: 0 unless limbs are preloaded.
    m: Matrix3<T>,
}

impl<T: Scalar> LimbResponse<T> {
    /// Tensions of the linear model under a load at A in commanded A-uvw.
    fn linear_tensions(&self, load: Vector6<T>) -> Vector3<T> {
        let load = self.actual.seen(load);
        let [one, two, three] = &self.moved;
        Vector3::new(one.dot(&load), two.dot(&load), three.dot(&load))
    }
}

impl<T: Scalar> LoadResponse<'_, T> {
    /// See [`Machine::load_dependent_deflection`].
    ///
    /// # Errors
    /// A wrench or a deflection that is not finite; [`StiffnessError::NotConverged`].
    pub fn deflection(&self, wrench: &Wrench<T>, turned_at: &Wrench<T>) -> Result<Deflection<T>, StiffnessError> {
        let turned_at = turned_at.to_vector();
        if !is_finite(&turned_at) {
            return Err(StiffnessError::NotFinite);
        }
        self.after(wrench, |limbs, tensions| {
            let turns = limbs.linear_tensions(turned_at);
            let lag = |limb, tension, turn| self.machine.effects.lag(limb, tension, &[turn]);
            let ([n1, n2, n3], [t1, t2, t3]) = ((*tensions).into(), turns.into());
            Vector3::new(lag(0, n1, t1), lag(1, n2, t2), lag(2, n3, t3))
        })
    }

    /// The same where friction has a history, which goes on by this load: one call a period.
    ///
    /// # Errors
    /// Those of [`deflection`](Self::deflection).
    pub fn deflection_after(
        &self,
        wrench: &Wrench<T>,
        history: &mut LoadHistory<T>,
    ) -> Result<Deflection<T>, StiffnessError> {
        self.after(wrench, |_, tensions| {
            history.go_on(tensions);
            let lag = |limb, tension| self.machine.effects.lag(limb, tension, history.turns(limb));
            Vector3::new(lag(0, tensions.x), lag(1, tensions.y), lag(2, tensions.z))
        })
    }

    /// `lag` is that of each limb under the tensions of the linear model.
    #[inline(never)]
    fn after(
        &self,
        wrench: &Wrench<T>,
        lag: impl FnOnce(&LimbResponse<T>, &Vector3<T>) -> Vector3<T>,
    ) -> Result<Deflection<T>, StiffnessError> {
        let load = wrench.to_vector();
        if !is_finite(&load) {
            return Err(StiffnessError::NotFinite);
        }
        let Some(limbs) = &self.limbs else {
            return Ok(Deflection::ZERO);
        };
        let LimbResponse { actual, moved, m } = limbs;
        let effects = &self.machine.effects;
        let linear = limbs.linear_tensions(load);
        let lag = lag(limbs, &linear);
        // the lag is known from the linear tensions: what it does to them comes before the solve
        let linear = linear - m * lag;
        let elongations = |n: &Vector3<T>| {
            Vector3::new(effects.elongation(0, n.x), effects.elongation(1, n.y), effects.elongation(2, n.z))
        };
        let e = elongations(&tensions(m, &linear, elongations)?) + lag;
        let mut d = Vector6::zeros();
        for (moved, e) in moved.iter().zip(e.as_slice()) {
            d += moved * *e;
        }
        finite(Deflection::from_vector(actual.given_back(d)))
    }
}

/// No deflection, where nothing depends on the load.
fn none_under<T: Scalar>(wrenches: &[&Wrench<T>]) -> Result<Deflection<T>, StiffnessError> {
    let finite = wrenches.iter().all(|w| is_finite(&w.force_n) && is_finite(&w.moment_nm));
    if finite { Ok(Deflection::ZERO) } else { Err(StiffnessError::NotFinite) }
}

impl<T: Scalar> Machine<T> {
    /// What load-dependent effects add to the displacement of A under a wrench, on top of the linear deflection (of
    /// K_p or of a corrected K_m). Zero, and next to no work, when the machine has none.
    ///
    /// The tensions of the three limbs are those of the linear model; under preload they are found by at most
    /// [`MAX_ITERATIONS`] fixed-point iterations (`docs/theory.md`, Effects). In f32 the whole deflection of the
    /// reference machine in its box is within 1e-4 of f64.
    ///
    /// `turned_at` is the load at which the loading turned back: zero when it has only grown. Friction asks for
    /// it, nothing else does. A longer history has [`LoadResponse::deflection_after`].
    ///
    /// # Errors
    /// Those of [`stiffness`](Self::stiffness); a wrench or a deflection that is not finite;
    /// [`StiffnessError::NotConverged`].
    pub fn load_dependent_deflection(
        &self,
        pose: &Pose<T>,
        wrench: &Wrench<T>,
        turned_at: &Wrench<T>,
    ) -> Result<Deflection<T>, StiffnessError> {
        self.load_dependent_deflection_at(&self.posture(pose)?, wrench, turned_at)
    }

    #[inline(never)]
    pub(crate) fn load_dependent_deflection_at(
        &self,
        posture: &Posture<T>,
        wrench: &Wrench<T>,
        turned_at: &Wrench<T>,
    ) -> Result<Deflection<T>, StiffnessError> {
        if !self.effects.depend_on_load() {
            return none_under(&[wrench, turned_at]);
        }
        // by reference: `?` would copy all of it
        match &self.load_response_at(posture) {
            Ok(response) => response.deflection(wrench, turned_at),
            Err(e) => Err(*e),
        }
    }

    /// The same where friction has a history; without one, of a load that has only grown.
    #[inline(never)]
    pub(crate) fn load_dependent_deflection_after(
        &self,
        posture: &Posture<T>,
        wrench: &Wrench<T>,
        history: Option<&mut LoadHistory<T>>,
    ) -> Result<Deflection<T>, StiffnessError> {
        if !self.effects.depend_on_load() {
            return none_under(&[wrench]);
        }
        match &self.load_response_at(posture) {
            Ok(response) => match history {
                Some(history) => response.deflection_after(wrench, history),
                None => response.deflection(wrench, &Wrench::ZERO),
            },
            Err(e) => Err(*e),
        }
    }

    /// What [`load_dependent_deflection`](Self::load_dependent_deflection) needs of a pose, for many loads there.
    ///
    /// # Errors
    /// Those of [`stiffness`](Self::stiffness).
    pub fn load_response(&self, pose: &Pose<T>) -> Result<LoadResponse<'_, T>, StiffnessError> {
        self.load_response_at(&self.posture(pose)?)
    }

    // apart, as what a load does with it is: neither takes stack while the other runs
    #[inline(never)]
    fn load_response_at(&self, posture: &Posture<T>) -> Result<LoadResponse<'_, T>, StiffnessError> {
        if !self.effects.depend_on_load() {
            return Ok(LoadResponse { machine: self, limbs: None });
        }
        let mut limbs =
            LimbResponse { actual: self.actual(posture)?, moved: [Vector6::zeros(); 3], m: Matrix3::zeros() };
        let mut lower = linalg::zero();
        self.add_limb_response(&mut limbs, &mut lower)?;
        self.release(&mut limbs, &mut lower)?;
        Ok(LoadResponse { machine: self, limbs: Some(limbs) })
    }

    /// Turns the wrenches and tensions of A held into displacements and tensions of A free. `k` is of no use afterwards.
    #[inline(never)] // takes no stack while the limbs are put together
    fn release(&self, limbs: &mut LimbResponse<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        factor(k)?;
        let wrenches = limbs.moved;
        for (moved, wrench) in limbs.moved.iter_mut().zip(&wrenches) {
            *moved = linalg::solve(k, wrench);
        }
        if self.effects.are_ties() || (0..3).any(|limb| self.effects.tension(limb) != T::ZERO) {
            for (column, moved) in limbs.m.data.0.iter_mut().zip(&limbs.moved) {
                for (entry, wrench) in column.iter_mut().zip(&wrenches) {
                    *entry -= wrench.dot(moved);
                }
            }
        } else {
            // the two cancel but for rounding
            limbs.m = Matrix3::zeros();
        }
        Ok(())
    }

    /// Turns zeros into K, lower triangle, and with A held, `moved` into the wrenches at A per unit of elongation of each
    /// limb, `m` into the tensions.
    #[inline(never)]
    fn add_limb_response(&self, limbs: &mut LimbResponse<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let mut chain = Chain::zero();
        self.limbs_with_effects(&limbs.actual.posture, &mut chain, k);
        for ((first, moved), tensions) in AXIAL.into_iter().zip(&mut limbs.moved).zip(&mut limbs.m.data.0) {
            add_response(&chain, first, moved, tensions);
        }
        Ok(chain.add_stiffness_to(k, ALL)?)
    }
}

//! Terminal stiffness of the parallel mechanism from its limbs (paper, Eqs. 7-9; `docs/theory.md`).
//!
//! A limb passes on to the moving platform only the wrenches that its free axes cannot release: three for
//! limbs 1 and 2, two for limb 3. Written as columns H_i, with D_i = H_iᵀ C_i H_i the compliance of everything
//! elastic in the limb's chain as these wrenches see it,
//!
//! > K_p = Σ H_i D_i⁻¹ H_iᵀ.
//!
//! A `Chain` holds H_i and D_i. Whatever else is elastic between B_i and A ([`effects`](crate::effects)) adds its
//! Hᵀ C H to D_i; what is elastic under B or behind A is in series with the sum.

use core::fmt;

use crate::effects::{Limb, Series};
use crate::kinematics::{Actual, KinematicsError, Posture};
use crate::linalg::{self, Lower};
use crate::machine::{Machine, Sizes};
use crate::scalar::Scalar;
use crate::types::{Deflection, Pose, Wrench};
use crate::vector::{cross, dot, less};

/// Why there is no stiffness for a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StiffnessError {
    /// The pose has no posture.
    Kinematics(KinematicsError),
    /// The 6×6 is not positive definite in this number type.
    NotPositiveDefinite,
    /// A wrench, a temperature or a deflection is NaN or infinite.
    NotFinite,
    /// The limb forces under load-dependent effects were not found.
    NotConverged,
}

impl fmt::Display for StiffnessError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Kinematics(e) => e.fmt(f),
            Self::NotPositiveDefinite => f.write_str("the stiffness matrix is not positive definite"),
            Self::NotFinite => f.write_str("the wrench, the temperature or the deflection is not finite"),
            Self::NotConverged => f.write_str("the limb forces under load-dependent effects were not found"),
        }
    }
}

impl core::error::Error for StiffnessError {}

impl From<KinematicsError> for StiffnessError {
    fn from(e: KinematicsError) -> Self {
        Self::Kinematics(e)
    }
}

/// A symmetric 6×6 stiffness at A in A-uvw: N/m, N/rad, N·m/m and N·m/rad by block.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Stiffness<T> {
    lower: Lower<T>,
}

impl<T: Scalar> Stiffness<T> {
    /// From a matrix of which the lower triangle is read.
    pub fn from_lower(matrix: &[[T; 6]; 6]) -> Self {
        Self { lower: *matrix }
    }

    /// All 36 entries, row by row.
    pub fn matrix(&self) -> [[T; 6]; 6] {
        let mut full = self.lower;
        for i in 0..6 {
            for j in 0..i {
                full[j][i] = full[i][j];
            }
        }
        full
    }

    /// The principal stiffnesses k11…k66: resistance to one displacement with the other five held at 0.
    pub fn principal(&self) -> [T; 6] {
        let k = &self.lower;
        [k[0][0], k[1][1], k[2][2], k[3][3], k[4][4], k[5][5]]
    }

    /// Cholesky factor, translations first.
    ///
    /// # Errors
    /// [`StiffnessError::NotPositiveDefinite`], also for NaN or infinity in the matrix.
    pub fn factor(&self) -> Result<StiffnessFactor<T>, StiffnessError> {
        let mut lower = self.lower;
        factor(&mut lower)?;
        Ok(StiffnessFactor { lower })
    }
}

/// Softening in series subtracts, and rounding may leave nothing; squares of levers may be too small for a number.
fn check_diagonal<T: Scalar>(k: &Lower<T>) -> Result<(), StiffnessError> {
    let positive = (0..6).all(|i| k[i][i] > T::ZERO);
    if positive { Ok(()) } else { Err(StiffnessError::NotPositiveDefinite) }
}

/// K, lower triangle, turned into its Cholesky factor.
pub(crate) fn factor<T: Scalar>(lower: &mut Lower<T>) -> Result<(), StiffnessError> {
    if linalg::cholesky(lower) { Ok(()) } else { Err(StiffnessError::NotPositiveDefinite) }
}

/// A stiffness as its lower triangular Cholesky factor F, K = F Fᵀ: ready for deflections.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StiffnessFactor<T> {
    pub(crate) lower: Lower<T>,
}

impl<T: Scalar> StiffnessFactor<T> {
    /// K = F Fᵀ.
    pub fn stiffness(&self) -> Stiffness<T> {
        Stiffness { lower: linalg::square(&self.lower) }
    }

    /// Displacement of A under a wrench at A, by two triangular solves.
    ///
    /// # Errors
    /// [`StiffnessError::NotFinite`] when the wrench or the result is not finite.
    pub fn deflection(&self, wrench: &Wrench<T>) -> Result<Deflection<T>, StiffnessError> {
        finite(Deflection::from_array(linalg::solve(&self.lower, &wrench.to_array())))
    }

    /// The factor's entries; above the diagonal they are 0.
    pub fn lower(&self) -> [[T; 6]; 6] {
        self.lower
    }
}

/// One limb: the `N` wrenches it transmits, at A in A-uvw, and the compliance they meet.
pub(crate) struct Chain<T, const N: usize> {
    wrenches: [[T; 6]; N],
    /// Hᵀ C H, lower triangle.
    compliance: [[T; N]; N],
}

macro_rules! split {
    ($n:literal, $rest:literal) => {
        impl<T: Scalar> Chain<T, $n> {
            /// The first wrench and the others, when no compliance couples them.
            fn split(self) -> (Chain<T, 1>, Chain<T, $rest>) {
                let ([first, others @ ..], [[own, ..], ..]) = (self.wrenches, self.compliance);
                let mut compliance = [[T::ZERO; $rest]; $rest];
                for i in 0..$rest {
                    for j in 0..i + 1 {
                        compliance[i][j] = self.compliance[i + 1][j + 1];
                    }
                }
                (Chain { wrenches: [first], compliance: [[own]] }, Chain { wrenches: others, compliance })
            }
        }
    };
}

split!(3, 2);
split!(2, 1);

impl<T: Scalar> Chain<T, 6> {
    /// Puts limb 1 (`LIMB` = 0) or 2 beside the other, for what couples them.
    fn put<const LIMB: usize>(&mut self, limb: &Chain<T, 3>) {
        for i in 0..3 {
            self.wrenches[3 * LIMB + i] = limb.wrenches[i];
            for j in 0..=i {
                self.compliance[3 * LIMB + i][3 * LIMB + j] = limb.compliance[i][j];
            }
        }
    }

    /// Both limbs' bases, or their ends, move along an axis by `compliance` times the sum of their forces along it, the second
    /// limb's taken with the sign.
    fn add_mode(&mut self, axis: [T; 3], sign: T, compliance: T) {
        let mut forces = [T::ZERO; 6];
        for (i, (seen, wrench)) in forces.iter_mut().zip(&self.wrenches).enumerate() {
            *seen = dot(force(wrench), axis) * if i < 3 { T::ONE } else { sign };
        }
        for i in 0..6 {
            for j in 0..=i {
                self.compliance[i][j] += compliance * forces[i] * forces[j];
            }
        }
    }
}

impl<T: Scalar, const N: usize> Chain<T, N> {
    fn zero() -> Self {
        Self { wrenches: [[T::ZERO; 6]; N], compliance: [[T::ZERO; N]; N] }
    }

    /// Something that gives at a point, along and about three axes. All in A-uvw.
    pub fn add_joint(&mut self, at: [T; 3], axes: &[[T; 3]; 3], compliance: [T; 6]) {
        let mut seen = [[T::ZERO; 6]; N];
        for (seen, wrench) in seen.iter_mut().zip(&self.wrenches) {
            let (force, moment) = (force(wrench), moment_at(wrench, at));
            let [x, y, z] = axes;
            *seen = [dot(force, *x), dot(force, *y), dot(force, *z), dot(moment, *x), dot(moment, *y), dot(moment, *z)];
        }
        for i in 0..N {
            for j in 0..=i {
                for c in 0..6 {
                    self.compliance[i][j] += compliance[c] * seen[i][c] * seen[j][c];
                }
            }
        }
    }

    /// A beam from one point to another that carries the limb's wrenches. `second` is a direction off its axis,
    /// `compliance` 1/EA, 1/EI about the beam's second and its third axis, 1/GJ. All in A-uvw.
    pub fn add_beam(&mut self, from: [T; 3], to: [T; 3], second: [T; 3], compliance: [T; 4]) {
        let along = [to[0] - from[0], to[1] - from[1], to[2] - from[2]];
        let length = dot(along, along).sqrt();
        let x = along.map(|c| c / length);
        let z = cross(x, second);
        let z = z.map(|c| c / dot(z, z).sqrt());
        let y = cross(z, x);
        // axial force, torque, and the bending moments at both ends: they run linearly between
        let mut seen = [[T::ZERO; 6]; N];
        for (seen, wrench) in seen.iter_mut().zip(&self.wrenches) {
            let (start, end) = (moment_at(wrench, from), moment_at(wrench, to));
            *seen = [dot(force(wrench), x), dot(start, x), dot(start, y), dot(end, y), dot(start, z), dot(end, z)];
        }
        let [axial, about_y, about_z, torsion] = compliance.map(|c| c * length);
        let (two, sixth) = (T::from_f64(2.0), T::from_f64(1.0 / 6.0));
        for i in 0..N {
            for j in 0..=i {
                let (a, b) = (&seen[i], &seen[j]);
                let bending =
                    |s: usize, e: usize| sixth * (two * (a[s] * b[s] + a[e] * b[e]) + a[s] * b[e] + a[e] * b[s]);
                self.compliance[i][j] +=
                    axial * a[0] * b[0] + torsion * a[1] * b[1] + about_y * bending(2, 3) + about_z * bending(4, 5);
            }
        }
    }

    /// D⁻¹ times the unit vector of one wrench: what all wrenches of the limb grow by when the limb alone gets
    /// longer in the sense of that one by one unit, the platform held.
    fn response(&self, wrench: usize) -> [T; N] {
        let mut d = self.compliance;
        let mut x = [T::ZERO; N];
        for (i, x) in x.iter_mut().enumerate() {
            *x = if i == wrench { T::ONE } else { T::ZERO };
        }
        let mut ratios = [[T::ZERO; N]; N];
        for j in 0..N {
            for i in j + 1..N {
                let ratio = d[i][j] / d[j][j];
                for m in j + 1..=i {
                    d[i][m] -= ratio * d[m][j];
                }
                x[i] -= ratio * x[j];
                ratios[i][j] = ratio;
            }
        }
        for j in (0..N).rev() {
            x[j] = x[j] / d[j][j];
            for i in j + 1..N {
                x[j] -= ratios[i][j] * x[i];
            }
        }
        x
    }

    /// Sum of the wrenches, each times a factor.
    fn combined(&self, factors: &[T; N]) -> [T; 6] {
        let mut sum = [T::ZERO; 6];
        for (wrench, factor) in self.wrenches.iter().zip(factors) {
            for (sum, c) in sum.iter_mut().zip(wrench) {
                *sum += *factor * *c;
            }
        }
        sum
    }

    /// K += H D⁻¹ Hᵀ, by D = L Δ Lᵀ: with Y = L⁻¹ Hᵀ the limb is N springs in parallel. `at` are the components of the
    /// wrenches that are not 0. The limb is of no use afterwards; a copy of it would take stack.
    fn add_stiffness_to<const M: usize>(&mut self, k: &mut Lower<T>, at: [usize; M]) -> Result<(), StiffnessError> {
        let (d, y) = (&mut self.compliance, &mut self.wrenches);
        for j in 0..N {
            if !(d[j][j] > T::ZERO) {
                return Err(StiffnessError::NotPositiveDefinite);
            }
            let spring = T::ONE / d[j][j];
            for i in j + 1..N {
                let ratio = d[i][j] * spring;
                for m in j + 1..i + 1 {
                    d[i][m] -= ratio * d[m][j];
                }
                for c in at {
                    y[i][c] -= ratio * y[j][c];
                }
            }
            for r in 0..M {
                let scaled = y[j][at[r]] * spring;
                for c in 0..r + 1 {
                    k[at[r]][at[c]] += scaled * y[j][at[c]];
                }
            }
        }
        Ok(())
    }
}

/// All components of a six-vector.
const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

/// Most iterations for the tensions of preloaded limbs under load-dependent elongation.
pub const MAX_ITERATIONS: usize = 30;

/// N with N = N₀ − M ε(N), by fixed-point iteration. Without preload M is 0 and N is N₀: an elongation turns the
/// mechanism's screws, and six equations of balance fix the tensions of a mechanism whose screws move freely
/// (`docs/theory.md`, Effects). With preload M ε' is the ratio of the geometric stiffness to that of the contacts.
fn tensions<T: Scalar>(
    m: &[[T; 3]; 3],
    linear: &[T; 3],
    elongations: impl Fn(&[T; 3]) -> [T; 3],
) -> Result<[T; 3], StiffnessError> {
    let tolerance = T::SLACK * (dot(*linear, *linear).sqrt() + T::ONE);
    let mut n = *linear;
    for _ in 0..MAX_ITERATIONS {
        let e = elongations(&n);
        let mut next = *linear;
        for (next, row) in next.iter_mut().zip(m) {
            *next -= dot(*row, e);
        }
        let change = less(next, n);
        n = next;
        if dot(change, change).sqrt() <= tolerance {
            return Ok(n);
        }
    }
    Err(StiffnessError::NotConverged)
}

fn force<T: Scalar>(wrench: &[T; 6]) -> [T; 3] {
    [wrench[0], wrench[1], wrench[2]]
}

/// Moment of a wrench at A about another point.
fn moment_at<T: Scalar>(wrench: &[T; 6], at: [T; 3]) -> [T; 3] {
    let lever = cross(at, force(wrench));
    [wrench[3] - lever[0], wrench[4] - lever[1], wrench[5] - lever[2]]
}

fn product<T: Scalar>(a: &[T; 6], b: &[T; 6]) -> T {
    a.iter().zip(b).fold(T::ZERO, |sum, (a, b)| sum + *a * *b)
}

/// What can be said: a deflection that overflows cannot.
pub(crate) fn finite<T: Scalar>(d: Deflection<T>) -> Result<Deflection<T>, StiffnessError> {
    if d.to_array().iter().all(|v| v.is_finite()) { Ok(d) } else { Err(StiffnessError::NotFinite) }
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
    moved: [[T; 6]; 3],
    /// Tension in limb i taken by a unit of elongation of limb j: 0 unless limbs are preloaded.
    m: [[T; 3]; 3],
}

impl<T: Scalar> LoadResponse<'_, T> {
    /// See [`Machine::load_dependent_deflection`].
    ///
    /// # Errors
    /// A wrench or a deflection that is not finite; [`StiffnessError::NotConverged`].
    #[inline(never)]
    pub fn deflection(&self, wrench: &Wrench<T>, turned_at: &Wrench<T>) -> Result<Deflection<T>, StiffnessError> {
        let (load, turned_at) = (wrench.to_array(), turned_at.to_array());
        if !load.iter().chain(&turned_at).all(|f| f.is_finite()) {
            return Err(StiffnessError::NotFinite);
        }
        let o = T::ZERO;
        let Some(LimbResponse { actual, moved, m }) = &self.limbs else {
            return Ok(Deflection::ZERO);
        };
        let effects = &self.machine.effects;
        let (load, turned_at) = (actual.seen(load), actual.seen(turned_at));
        let mut linear = moved.map(|moved| product(&moved, &load));
        let mut lag = [o; 3];
        for i in 0..3 {
            lag[i] = effects.lag(i, linear[i], product(&moved[i], &turned_at));
        }
        // the lag is known from the linear tensions: what it does to them comes before the solve
        for (linear, row) in linear.iter_mut().zip(m) {
            *linear -= dot(*row, lag);
        }
        let elongations = |n: &[T; 3]| [0, 1, 2].map(|limb| effects.elongation(limb, n[limb]));
        let elongations = elongations(&tensions(m, &linear, elongations)?);
        let mut d = [o; 6];
        for (moved, (e, lag)) in moved.iter().zip(elongations.into_iter().zip(lag)) {
            let e = e + lag;
            for (d, c) in d.iter_mut().zip(moved) {
                *d += e * *c;
            }
        }
        finite(Deflection::from_array(actual.given_back(d)))
    }
}

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
    /// let [k11, k22, k33, ..] = k_p.principal().map(|k| k / 1e6); // N/µm
    /// assert!(k33 > k11 && k33 > k22);
    /// assert_eq!(k_p.matrix()[0][1], k_p.matrix()[1][0]);
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
        sideways.add_stiffness_to(k, [1, 2, 4, 5])
    }

    #[inline(never)]
    fn add_stiffness_with_effects(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let actual = self.actual(*p)?;
        let p = &actual.posture;
        self.add_limbs_with_effects(p, k)?;
        let (n, x, y) = (p.n(), p.x(), p.y());
        let at = n.map(|c| -p.l * c);
        let axes = [x, y, cross(x, y)];
        let mut definite = true;
        self.effects.at_base(|compliance| definite &= Series { at, axes, compliance }.soften(k));
        self.effects.at_hub(|compliance| definite &= Series::at_a(compliance).soften(k));
        actual.given_back_matrix(k);
        if definite { check_diagonal(k) } else { Err(StiffnessError::NotPositiveDefinite) }
    }

    #[inline(never)]
    fn add_limbs_with_effects(&self, p: &Posture<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let (mut pair, mut third) = (Chain::zero(), Chain::zero());
        self.chains_with_effects(p, &mut pair, &mut third, k);
        pair.add_stiffness_to(k, ALL)?;
        third.add_stiffness_to(k, ALL)
    }

    /// Turns zeros into limbs 1 and 2 together, and limb 3, with what effects add inside them; and into what is
    /// beside them in K, lower triangle. At the actual posture.
    #[inline(never)]
    fn chains_with_effects(
        &self,
        p: &Posture<T>,
        pair: &mut Chain<T, 6>,
        third: &mut Chain<T, 2>,
        beside: &mut Lower<T>,
    ) {
        let offset = self.effects.offset();
        let mut p = *p;
        p.offset(offset);
        let (p, [h, h_3]) = (&p, offset);
        self.put_limb_with_effects::<0>(p, h, pair, beside);
        self.put_limb_with_effects::<1>(p, h, pair, beside);
        *third = self.chain_3::<true>(p, h_3);
        self.add_effects_3(p, h_3, third, beside);
        let z = cross(p.x(), p.y());
        let w = [T::ZERO, T::ZERO, T::ONE];
        self.effects.between_arms_1_2(|bridge| pair.add_mode(w, T::ONE, bridge));
        self.effects.between_bases_1_2(|[together, opposed]| {
            pair.add_mode(z, T::ONE, together);
            pair.add_mode(z, -T::ONE, opposed);
        });
    }

    #[inline(never)]
    fn put_limb_with_effects<const LIMB: usize>(
        &self,
        p: &Posture<T>,
        h: T,
        pair: &mut Chain<T, 6>,
        beside: &mut Lower<T>,
    ) {
        let mut limb = self.chain_1_2::<LIMB, true>(p, h);
        self.add_effects_1_2::<LIMB>(p, h, &mut limb, beside);
        pair.put::<LIMB>(&limb);
    }

    /// What load-dependent effects add to the displacement of A under a wrench, on top of the linear deflection (of
    /// K_p or of a corrected K_m). Zero, and next to no work, when the machine has none.
    ///
    /// The tensions of the three limbs are those of the linear model; under preload they are found by at most
    /// [`MAX_ITERATIONS`] fixed-point iterations (`docs/theory.md`, Effects). In f32 the whole deflection of the
    /// reference machine in its box is within 1e-4 of f64.
    ///
    /// `turned_at` is the load at which the loading last turned back: zero when it has only grown. Friction asks for
    /// it, nothing else does.
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
        // by reference: `?` would copy all of it
        match &self.load_response_at(posture) {
            Ok(response) => response.deflection(wrench, turned_at),
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
        let mut limbs = LimbResponse { actual: self.actual(*posture)?, moved: [[T::ZERO; 6]; 3], m: [[T::ZERO; 3]; 3] };
        let mut lower = linalg::zero();
        self.add_limb_response(&mut limbs, &mut lower)?;
        factor(&mut lower)?;
        let wrenches = limbs.moved;
        for (moved, wrench) in limbs.moved.iter_mut().zip(&wrenches) {
            *moved = linalg::solve(&lower, wrench);
        }
        let preloaded = (0..3).any(|limb| self.effects.tension(limb) != T::ZERO);
        for i in 0..3 {
            for j in 0..3 {
                // without preload the two cancel but for rounding
                let left = limbs.m[i][j] - product(&wrenches[i], &limbs.moved[j]);
                limbs.m[i][j] = if preloaded { left } else { T::ZERO };
            }
        }
        Ok(LoadResponse { machine: self, limbs: Some(limbs) })
    }

    /// Turns zeros into K, lower triangle, and with A held, `moved` into the wrenches at A per unit of elongation of each
    /// limb, `m` into the tensions.
    #[inline(never)]
    fn add_limb_response(&self, limbs: &mut LimbResponse<T>, k: &mut Lower<T>) -> Result<(), StiffnessError> {
        let o = T::ZERO;
        let (mut pair, mut third) = (Chain::zero(), Chain::zero());
        self.chains_with_effects(&limbs.actual.posture, &mut pair, &mut third, k);
        let (x1, x2, x3) = (pair.response(0), pair.response(3), third.response(0));
        limbs.moved = [pair.combined(&x1), pair.combined(&x2), third.combined(&x3)];
        limbs.m = [[x1[0], x2[0], o], [x1[3], x2[3], o], [o, o, x3[0]]];
        pair.add_stiffness_to(k, ALL)?;
        third.add_stiffness_to(k, ALL)
    }

    /// Displacement of A when the machine is warmer by `rise_k` (K) than at the zero reading and no load acts, to first
    /// order, by its `thermal-expansion` effect: limbs and platforms grow, the encoders read the same. Zero when the
    /// machine has none. Growth of everything alike moves A by its share of L along BA and turns nothing.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse); a rise or a displacement that is not finite.
    ///
    /// ```
    /// use pkm_core::tables::reference::PARAMETERS;
    /// use pkm_core::{Machine, MachineParameters, Pose};
    /// let effects = PARAMETERS.effects.with("thermal-expansion", [11e-6, 11e-6, 0.0]).unwrap();
    /// let steel = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    /// let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
    /// let moved = steel.thermal_deflection(&pose, 10.0)?;
    /// assert!((moved.translation_m[2] - 10.0 * 11e-6 * 0.53).abs() < 1e-12);
    /// # Ok::<(), pkm_core::StiffnessError>(())
    /// ```
    pub fn thermal_deflection(&self, pose: &Pose<T>, rise_k: T) -> Result<Deflection<T>, StiffnessError> {
        let commanded = self.posture(pose)?;
        if !rise_k.is_finite() {
            return Err(StiffnessError::NotFinite);
        }
        let o = T::ZERO;
        let [limbs, platforms] = self.effects.growth().map(|rate| rate * rise_k);
        if limbs == o && platforms == o {
            return Ok(Deflection::ZERO);
        }
        let actual = self.actual(commanded)?;
        let (p, Sizes { a1, a2, b1, b2 }) = (&actual.posture, self.actual);
        let (sin, cos, l) = (p.sin_sigma, p.cos_sigma, p.l);
        let [q1, q2, q3] = p.q;
        // q dq = … of each limb, with what its own growth and the platforms' bring on the right
        let (along, across) = (p.along_n, p.along_y[0]);
        let both = across * across;
        let first = limbs * q1 * q1 - platforms * (both - along[0] * sin * a1);
        let second = limbs * q2 * q2 - platforms * (both + along[1] * sin * a1);
        let (sum, difference) = (first + second, second - first);
        let half = T::from_f64(0.5) / (l * l * cos - a1 * b1 * sin * sin);
        let dl = half * (sum * l * cos - difference * b1 * sin);
        let dsigma = half * (difference * l / a1 - sum * sin);
        // limb 3, whose q² is L² + a2² + b2² − 2 b2 (L sin θ + a2 cos θ)
        let reach = l * p.sin_theta + a2 * p.cos_theta;
        let grown = platforms * (a2 * a2 + b2 * b2 - b2 * (reach + a2 * p.cos_theta)) - limbs * q3 * q3;
        let dtheta = (dl * (l - b2 * p.sin_theta) + grown) / (b2 * (l * p.cos_theta - a2 * p.sin_theta));
        let (n, y) = (p.n(), p.y());
        let moved = [l * dtheta, dl * n[1], dl * n[2], dsigma, dtheta * y[1], dtheta * y[2]];
        finite(Deflection::from_array(actual.given_back(moved)))
    }

    /// Softens K by what lies between A and the tool; true if there was any.
    pub(crate) fn add_tool_compliance(&self, k: &mut Lower<T>) -> Result<bool, StiffnessError> {
        let (mut any, mut definite) = (false, true);
        if self.effects.any() {
            self.effects.at_tool(|compliance| {
                any = true;
                definite &= Series::at_a(compliance).soften(k);
            });
        }
        if any {
            check_diagonal(k)?;
        }
        if definite { Ok(any) } else { Err(StiffnessError::NotPositiveDefinite) }
    }

    fn add_effects_1_2<const LIMB: usize>(&self, p: &Posture<T>, h: T, chain: &mut Chain<T, 3>, beside: &mut Lower<T>) {
        let (y, n, u) = (p.y(), p.n(), [T::ONE, T::ZERO, T::ZERO]);
        let side = if LIMB == 0 { -T::ONE } else { T::ONE };
        let (zy, zn) = (p.along_y[LIMB] / p.q[LIMB], p.along_n[LIMB] / p.q[LIMB]);
        let mix = |a: T, b: T| [a * y[0] + b * n[0], a * y[1] + b * n[1], a * y[2] + b * n[2]];
        let z = mix(zy, zn);
        self.add_effects(
            Limb {
                index: LIMB,
                q: p.q[LIMB],
                base: mix(side * self.actual.b1, -p.l),
                platform: [T::ZERO, side * self.actual.a1, h],
                axes: [u, cross(z, u), z],
                base_axes: [u, y, cross(u, y)],
                axial: self.limbs[LIMB].axial,
                bending: self.limbs[LIMB].bending,
                torsion: self.limbs[LIMB].torsion,
                chain,
            },
            beside,
        );
    }

    #[inline(never)]
    fn add_effects_3(&self, p: &Posture<T>, h: T, chain: &mut Chain<T, 2>, beside: &mut Lower<T>) {
        let (x, z) = Self::leaning_3(p, h);
        let axes = [x, cross(z, x), z];
        let platform = [self.actual.a2, T::ZERO, h];
        let q = p.q[2];
        self.add_effects(
            Limb {
                index: 2,
                q,
                base: [platform[0] - q * z[0], platform[1] - q * z[1], platform[2] - q * z[2]],
                platform,
                axes,
                base_axes: axes,
                axial: self.limbs[2].axial,
                bending: self.limbs[2].bending,
                torsion: self.limbs[2].torsion,
                chain,
            },
            beside,
        );
    }

    /// Adds what effects have inside a limb to it, and what its tension adds to K beside it.
    fn add_effects<const N: usize>(&self, mut limb: Limb<'_, T, N>, beside: &mut Lower<T>) {
        self.effects.in_limb(&mut limb);
        let tension = self.effects.tension(limb.index);
        if tension != T::ZERO {
            let [_, across, _] = limb.axes;
            let ([x, y, z], [a, b, c]) = (across, cross(limb.platform, across));
            let wrench = [x, y, z, a, b, c];
            let spring = tension / limb.q;
            for i in 0..6 {
                for j in 0..=i {
                    beside[i][j] += spring * wrench[i] * wrench[j];
                }
            }
        }
    }

    /// Limb 1 (`LIMB` = 0) or 2. All of it lies in the plane of y of B and n = BA/|BA|, square to u. The wrenches are the
    /// axial force, the force along u through B_i, and the couple about n. With `OFFSET` A_i is `h` out of its plane.
    fn chain_1_2<const LIMB: usize, const OFFSET: bool>(&self, p: &Posture<T>, h: T) -> Chain<T, 3> {
        let side = if LIMB == 0 { -T::ONE } else { T::ONE };
        let c = &self.limbs[LIMB];
        let (q, sin, cos) = (p.q[LIMB], p.sin_sigma, p.cos_sigma);
        // limb axis in (y, n), and in A-uvw, where y = (0, cos σ, −sin σ) and n = (0, sin σ, cos σ)
        let (zy, zn) = (p.along_y[LIMB] / q, p.along_n[LIMB] / q);
        let (zv, zw) = (zy * cos + zn * sin, zn * cos - zy * sin);
        let o = T::ZERO;
        let b = side * self.actual.b1;
        let lever = side * self.actual.a1 * zw;
        let wrenches = [
            [o, zv, zw, if OFFSET { lever - h * zv } else { lever }, o, o],
            [T::ONE, o, o, o, -p.l * cos - b * sin, p.l * sin - b * cos],
            [o, o, o, o, sin, cos],
        ];

        // The force through B_i meets the cantilever like a load on its tip that leaves no moment at B_i; the
        // uncoupled one (diagonal) takes the tip's moment −q as a second load.
        let (force_share, mixed_share) = if c.coupled { (1.0 / 3.0, 0.5) } else { (4.0 / 3.0, 1.0) };
        let bend = q * c.bending;
        let tilt = c.platform_angular[1];
        let (zy2, zn2) = (zy * zy, zn * zn);
        let axial = zy2 * c.base_linear[1] + zn2 * c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let force = c.base_linear[0] + c.platform_linear[0] + q * q * (T::from_f64(force_share) * bend + tilt);
        let mixed = zy * q * (T::from_f64(mixed_share) * bend + tilt);
        let couple = c.base_angular[2] + zy2 * (bend + tilt) + zn2 * (q * c.torsion + c.platform_angular[2]);
        Chain { wrenches, compliance: [[axial, o, o], [o, force, o], [o, mixed, couple]] }
    }

    /// x and z of limb 3 in A-uvw when A3 is `h` along w out of its plane: then it leans out of the plane across y of B.
    fn leaning_3(p: &Posture<T>, h: T) -> ([T; 3], [T; 3]) {
        let (y, n, q) = (p.y(), p.n(), p.q[2]);
        let [zu, zn, zy] = [p.limb_3[0] / q, p.limb_3[1] / q, -p.sin_sigma * h / q];
        let z = [zu, zn * n[1] + zy * y[1], zn * n[2] + zy * y[2]];
        let size = (T::ONE - zy * zy).sqrt();
        ([-zy * z[0] / size, (y[1] - zy * z[1]) / size, (y[2] - zy * z[2]) / size], z)
    }

    /// Limb 3: the axial force and the force along y of B, both through A3. With `OFFSET` A3 is `h` along w out of its plane.
    fn chain_3<const OFFSET: bool>(&self, p: &Posture<T>, h: T) -> Chain<T, 2> {
        let c = &self.limbs[2];
        let q = p.q[2];
        let a2 = self.actual.a2;
        let wrenches = if OFFSET {
            let (x, z) = Self::leaning_3(p, h);
            [z, x].map(|f| {
                let [a, b, c] = cross([a2, T::ZERO, h], f);
                [f[0], f[1], f[2], a, b, c]
            })
        } else {
            let (zu, zn) = (p.limb_3[0] / q, p.limb_3[1] / q);
            let through_a3 = |u: T, v: T, w: T| [u, v, w, T::ZERO, -a2 * w, a2 * v];
            [through_a3(zu, zn * p.sin_sigma, zn * p.cos_sigma), through_a3(T::ZERO, p.cos_sigma, -p.sin_sigma)]
        };
        let axial = c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let sideways = c.base_linear[0]
            + c.platform_linear[0]
            + q * q * (c.base_angular[1] + q * c.bending * T::from_f64(1.0 / 3.0));
        Chain { wrenches, compliance: [[axial, T::ZERO], [T::ZERO, sideways]] }
    }
}

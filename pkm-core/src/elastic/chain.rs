//! The wrenches that a limb transmits and the compliance that they meet.

use nalgebra::{Matrix3, Vector3, Vector6};

use crate::linalg::{Lower, NotPositiveDefinite, axes, length};
use crate::scalar::Scalar;

/// The `N` wrenches that a limb, or all three, transmit, at A in A-uvw, and the compliance they meet.
pub(crate) struct Chain<T, const N: usize> {
    pub wrenches: [[T; 6]; N],
    /// Hᵀ C H, lower triangle.
    pub compliance: [[T; N]; N],
}

macro_rules! split {
    ($n:literal, $rest:literal) => {
        impl<T: Scalar> Chain<T, $n> {
            /// The first wrench and the others, when no compliance couples them.
            pub fn split(self) -> (Chain<T, 1>, Chain<T, $rest>) {
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

impl<T: Scalar> Chain<T, 8> {
    /// Puts a limb beside the others, for what couples them: its first wrench becomes number `FIRST`.
    pub fn put<const FIRST: usize, const N: usize>(&mut self, limb: &Chain<T, N>) {
        for i in 0..N {
            self.wrenches[FIRST + i] = limb.wrenches[i];
            for j in 0..=i {
                self.compliance[FIRST + i][FIRST + j] = limb.compliance[i][j];
            }
        }
    }

    /// Something that gives by `compliance` times a linear function s of the wrenches, in the direction that does work with it:
    /// D += c a aᵀ, `seen` is a.
    pub fn add_seen(&mut self, seen: &[T; 8], compliance: T) {
        for i in 0..8 {
            for j in 0..=i {
                self.compliance[i][j] += compliance * seen[i] * seen[j];
            }
        }
    }

    /// The bases of limbs 1 and 2, or their ends, move along an axis by `compliance` times the sum of their forces along it, the
    /// second limb's taken with the sign.
    pub fn add_mode(&mut self, axis: Vector3<T>, sign: T, compliance: T) {
        let mut forces = [T::ZERO; 8];
        for (i, (seen, wrench)) in forces.iter_mut().zip(&self.wrenches).take(6).enumerate() {
            *seen = force(wrench).dot(&axis) * if i < 3 { T::ONE } else { sign };
        }
        self.add_seen(&forces, compliance);
    }
}

impl<T: Scalar, const N: usize> Chain<T, N> {
    pub fn zero() -> Self {
        Self { wrenches: [[T::ZERO; 6]; N], compliance: [[T::ZERO; N]; N] }
    }

    /// Something that gives at a point, along and about three axes. All in A-uvw.
    pub fn add_joint(&mut self, at: &Vector3<T>, frame: &Matrix3<T>, compliance: [T; 6]) {
        let [x, y, z] = axes(frame);
        let mut seen = [[T::ZERO; 6]; N];
        for (seen, wrench) in seen.iter_mut().zip(&self.wrenches) {
            let (force, moment) = (force(wrench), moment_at(wrench, at));
            *seen = [force.dot(&x), force.dot(&y), force.dot(&z), moment.dot(&x), moment.dot(&y), moment.dot(&z)];
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
    pub fn add_beam(&mut self, from: &Vector3<T>, to: &Vector3<T>, second: &Vector3<T>, compliance: [T; 4]) {
        let along = to - from;
        let size = length(&along);
        let x = along / size;
        let z = x.cross(second);
        let z = z / length(&z);
        let y = z.cross(&x);
        // axial force, torque, and the bending moments at both ends: they run linearly between
        let mut seen = [[T::ZERO; 6]; N];
        for (seen, wrench) in seen.iter_mut().zip(&self.wrenches) {
            let (start, end) = (moment_at(wrench, from), moment_at(wrench, to));
            *seen = [force(wrench).dot(&x), start.dot(&x), start.dot(&y), end.dot(&y), start.dot(&z), end.dot(&z)];
        }
        let [axial, about_y, about_z, torsion] = compliance.map(|c| c * size);
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
    pub fn response(&self, wrench: usize) -> [T; N] {
        let mut d = self.compliance;
        let mut x = [T::ZERO; N];
        for (i, x) in x.iter_mut().enumerate() {
            *x = if i == wrench { T::ONE } else { T::ZERO };
        }
        for j in 0..N {
            // from the last row up: a row's ratio takes the place of what the rows below it have used
            for i in (j + 1..N).rev() {
                let ratio = d[i][j] / d[j][j];
                for m in j + 1..=i {
                    d[i][m] -= ratio * d[m][j];
                }
                x[i] -= ratio * x[j];
                d[i][j] = ratio;
            }
        }
        for j in (0..N).rev() {
            x[j] /= d[j][j];
            for i in j + 1..N {
                x[j] -= d[i][j] * x[i];
            }
        }
        x
    }

    /// Sum of the wrenches, each times a factor.
    pub fn combined(&self, factors: &[T; N]) -> Vector6<T> {
        let mut sum = [T::ZERO; 6];
        for (wrench, factor) in self.wrenches.iter().zip(factors) {
            for (sum, c) in sum.iter_mut().zip(wrench) {
                *sum += *factor * *c;
            }
        }
        sum.into()
    }

    /// K += H D⁻¹ Hᵀ, by D = L Δ Lᵀ: with Y = L⁻¹ Hᵀ the limb is N springs in parallel. `at` are the components of the
    /// wrenches that are not 0. The limb is of no use afterwards; a copy of it would take stack.
    pub fn add_stiffness_to<const M: usize>(
        &mut self,
        k: &mut Lower<T>,
        at: [usize; M],
    ) -> Result<(), NotPositiveDefinite> {
        let (d, y, k) = (&mut self.compliance, &mut self.wrenches, &mut k.data.0);
        for j in 0..N {
            if !(d[j][j] > T::ZERO) {
                return Err(NotPositiveDefinite);
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
                    k[at[c]][at[r]] += scaled * y[j][at[c]];
                }
            }
        }
        Ok(())
    }
}

/// All components of a six-vector.
pub(crate) const ALL: [usize; 6] = [0, 1, 2, 3, 4, 5];

fn force<T: Scalar>(wrench: &[T; 6]) -> Vector3<T> {
    Vector3::new(wrench[0], wrench[1], wrench[2])
}

/// Moment of a wrench at A about another point.
fn moment_at<T: Scalar>(wrench: &[T; 6], at: &Vector3<T>) -> Vector3<T> {
    Vector3::new(wrench[3], wrench[4], wrench[5]) - at.cross(&force(wrench))
}

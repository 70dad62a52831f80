//! The number types that the formulas run on.

use nalgebra::{ClosedAddAssign, ClosedDivAssign, ClosedMulAssign, ClosedSubAssign};
use num_traits::{One, Zero};

/// `f32` or `f64` on a controller: every accuracy stated in this crate was measured for these two. A host may bring a type of its
/// own, to run the same formulas over a range of poses at once; what it gives is for that type to prove.
///
/// Roots and transcendental functions come from `libm` on every platform, so that a host and a
/// controller that run the same code get the same bits. Sine and cosine in `f32` up to a right angle are our own: `libm`
/// takes them by way of `f64`, which a Cortex-M4F does in software.
///
/// It has what products, sums and differences of nalgebra's matrices ask for. Not nalgebra's `RealField`: that brings roots and
/// trigonometry of its own, which are other ones on a host with the standard library.
pub trait Scalar:
    nalgebra::Scalar
    + Copy
    + Default
    + PartialOrd
    + Zero
    + One
    + ClosedAddAssign
    + ClosedSubAssign
    + ClosedMulAssign
    + ClosedDivAssign
    + core::ops::Neg<Output = Self>
{
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Distance from 1 to the next greater number.
    const EPSILON: Self;
    /// What rounding may add at a limit before the limit counts as passed: 1e-9 in `f64`, 1e-5 in `f32`,
    /// relative to the greatest length of each screw for travel, to half its width for a table's box. Also where a solve on limb tensions
    /// stops, relative to them.
    const SLACK: Self;
    /// Square of the relative error from which one more Newton step leaves no more than rounding does, also where the
    /// determinant is a tenth of home's: 2.2e-16 in `f64`, 1e-9 in `f32`.
    const LAST_STEP: Self;

    /// The nearest value of this type.
    fn from_f64(value: f64) -> Self;
    /// The same value as `f64`, exactly.
    fn to_f64(self) -> f64;
    /// True for everything but infinities and NaN.
    fn is_finite(self) -> bool;
    /// Absolute value.
    fn abs(self) -> Self;
    /// Square root; NaN below zero.
    fn sqrt(self) -> Self;
    /// Cube root.
    fn cbrt(self) -> Self;
    /// Greatest whole number that is not greater.
    fn floor(self) -> Self;
    /// Sine and cosine of an angle in rad; in `f32` within 1.5 units in the last place up to a right angle.
    fn sin_cos(self) -> (Self, Self);
    /// Cosine of an angle in rad.
    fn cos(self) -> Self;
    /// Arc cosine in rad, 0…π.
    fn acos(self) -> Self;
    /// Angle in rad, −π…π, of the point (`x`, `self`).
    fn atan2(self, x: Self) -> Self;
}

macro_rules! scalar {
    ($t:ty, $slack:expr, $last_step:expr, $sqrt:path, $cbrt:path, $floor:path, $sincos:path, $cos:path, $acos:path, $atan2:path) => {
        impl Scalar for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = <$t>::EPSILON;
            const SLACK: Self = $slack;
            const LAST_STEP: Self = $last_step;

            #[inline]
            fn from_f64(value: f64) -> Self {
                value as Self
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn is_finite(self) -> bool {
                <$t>::is_finite(self)
            }
            #[inline]
            fn abs(self) -> Self {
                <$t>::abs(self)
            }
            #[inline]
            fn sqrt(self) -> Self {
                $sqrt(self)
            }
            #[inline]
            fn cbrt(self) -> Self {
                $cbrt(self)
            }
            #[inline]
            fn floor(self) -> Self {
                $floor(self)
            }
            #[inline]
            fn sin_cos(self) -> (Self, Self) {
                $sincos(self)
            }
            #[inline]
            fn cos(self) -> Self {
                $cos(self)
            }
            #[inline]
            fn acos(self) -> Self {
                $acos(self)
            }
            #[inline]
            fn atan2(self, x: Self) -> Self {
                $atan2(self, x)
            }
        }
    };
}

scalar!(f32, 1e-5, 1e-9, libm::sqrtf, libm::cbrtf, libm::floorf, sin_cos, libm::cosf, libm::acosf, libm::atan2f);
scalar!(f64, 1e-9, f64::EPSILON, libm::sqrt, libm::cbrt, libm::floor, libm::sincos, libm::cos, libm::acos, libm::atan2);

/// Polynomials in z = x² for |x| ≤ π/4 (sin x / x and cos x, least greatest error: 3.6e-9 and 1e-10), and beyond by what is
/// left to the right angle.
fn sin_cos(angle: f32) -> (f32, f32) {
    use core::f32::consts::{FRAC_PI_2, FRAC_PI_4};
    let size = angle.abs();
    if !(size <= FRAC_PI_2) {
        return libm::sincosf(angle);
    }
    // π/2 = FRAC_PI_2 + REST; the difference is exact
    const REST: f32 = -4.371_139e-8;
    let near = size <= FRAC_PI_4;
    let x = if near { size } else { (FRAC_PI_2 - size) + REST };
    let z = x * x;
    let sin = x + x * z * (-0.166_666_55 + z * (0.008_332_176 + z * -0.000_195_169_75));
    let half = 0.5 * z;
    let rough = 1.0 - half;
    let cos = rough + (((1.0 - rough) - half) + z * z * (0.041_666_646 + z * (-0.001_388_736_4 + z * 2.443_808_8e-5)));
    let (sin, cos) = if near { (sin, cos) } else { (cos, sin) };
    (if angle < 0.0 { -sin } else { sin }, cos)
}

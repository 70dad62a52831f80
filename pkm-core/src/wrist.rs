//! The two rotary joints between moving platform and tool (paper, Table 1).
//!
//! The axis of the first is w, set off along u; the second is square to it. With r = b1 + b2 cos β2 − f sin β2 and
//! h = d1 + b2 sin β2 + f cos β2 the tip stands at (offset + r cos β1, r sin β1, h) in A-uvw.

use core::fmt;

use nalgebra::{Matrix3, Vector2, Vector3};

use crate::checksum::{START, over_numbers, over_numbers_f32};
use crate::linalg::frame;
use crate::scalar::Scalar;

/// The numbers of a wrist, SI, unchecked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristParameters {
    /// From A to the first axis along u, m.
    pub offset_m: f64,
    /// d of the first joint: along its axis to the second axis, m.
    pub first_d_m: f64,
    /// b of the first joint: from the first axis to the second, m.
    pub first_b_m: f64,
    /// b of the second joint: from its axis to the spindle's, m.
    pub second_b_m: f64,
    /// From there along the spindle to the tool's tip, m.
    pub flange_m: f64,
    /// Least β1, β2 in rad.
    pub min_rad: [f64; 2],
    /// Greatest β1, β2 in rad.
    pub max_rad: [f64; 2],
    /// Z0 of the home configuration θ = σ = β1 = β2 = 0, m: the middle of the box of poses.
    pub home_z0_m: f64,
    /// Least share of the home configuration's determinant, 0 to 1, see
    /// [`FiveAxis::normalised_determinant`](crate::FiveAxis::normalised_determinant).
    pub singularity_margin: f64,
}

/// Which number of [`WristParameters`] an error is about. Joints count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs)] // the variants are the fields' own names
pub enum WristError {
    Offset,
    FirstD,
    FirstB,
    SecondB,
    Flange,
    /// Not finite, beyond ±π, or the least not below the greatest.
    Limits {
        joint: u8,
    },
    HomeZ0,
    /// Not from 0 up to below 1.
    SingularityMargin,
    /// The home configuration is singular: b1 + b2 or Z0 + d1 is 0.
    HomeIsSingular,
}

impl fmt::Display for WristError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Limits { joint } => write!(f, "the limits of wrist joint {joint} are reversed or beyond ±180°"),
            Self::HomeIsSingular => f.write_str("the wrist is singular in its home configuration"),
            Self::SingularityMargin => f.write_str("the wrist's singularity margin is not from 0 to below 1"),
            Self::HomeZ0 => f.write_str("Z0 of the wrist's home is not above 0 and below 100 m"),
            _ => f.write_str("a size of the wrist is not finite or beyond 100 m"),
        }
    }
}

impl core::error::Error for WristError {}

/// A checked wrist in `f32` or `f64`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrist<T> {
    pub(crate) offset: T,
    pub(crate) first_d: T,
    pub(crate) first_b: T,
    pub(crate) second_b: T,
    pub(crate) flange: T,
    pub(crate) min: [T; 2],
    pub(crate) max: [T; 2],
    pub(crate) home_z0: T,
    pub(crate) home_determinant: T,
    pub(crate) margin: T,
}

impl WristParameters {
    /// Table 1 of the paper, joints within ±90°, home at Z0 = 530 mm, margin 0.1.
    pub const PAPER: Self = Self {
        offset_m: -0.02,
        first_d_m: 0.417,
        first_b_m: -0.035,
        second_b_m: -0.15,
        flange_m: 0.19,
        min_rad: [-core::f64::consts::FRAC_PI_2; 2],
        max_rad: [core::f64::consts::FRAC_PI_2; 2],
        home_z0_m: 0.53,
        singularity_margin: 0.1,
    };

    /// Checks every number.
    ///
    /// # Errors
    /// The first number that fails.
    pub const fn check(&self) -> Result<(), WristError> {
        const fn sane(length_m: f64) -> bool {
            length_m.abs() <= 100.0
        }
        let sizes = [
            (self.offset_m, WristError::Offset),
            (self.first_d_m, WristError::FirstD),
            (self.first_b_m, WristError::FirstB),
            (self.second_b_m, WristError::SecondB),
            (self.flange_m, WristError::Flange),
            (self.home_z0_m, WristError::HomeZ0),
        ];
        let mut i = 0;
        while i < sizes.len() {
            if !sane(sizes[i].0) {
                return Err(sizes[i].1);
            }
            i += 1;
        }
        let mut i = 0;
        while i < 2 {
            let (low, high) = (self.min_rad[i], self.max_rad[i]);
            if !(low >= -core::f64::consts::PI && high <= core::f64::consts::PI && low < high) {
                return Err(WristError::Limits { joint: i as u8 + 1 });
            }
            i += 1;
        }
        if !(self.home_z0_m > 0.0) {
            return Err(WristError::HomeZ0);
        }
        if !(self.singularity_margin >= 0.0 && self.singularity_margin < 1.0) {
            return Err(WristError::SingularityMargin);
        }
        if self.home_determinant().abs() < 1e-9 {
            return Err(WristError::HomeIsSingular);
        }
        Ok(())
    }

    /// The tip in A-uvw with both joints at 0, m.
    pub const fn tip_at_zero_m(&self) -> Vector3<f64> {
        Vector3::new(self.offset_m + self.first_b_m + self.second_b_m, 0.0, self.first_d_m + self.flange_m)
    }

    /// Of ∂(tip, axis)/∂(θ, σ, Z0, β1, β2) in the home configuration, m².
    const fn home_determinant(&self) -> f64 {
        (self.home_z0_m + self.first_d_m) * (self.first_b_m + self.second_b_m)
    }

    /// Checksum as of [`MachineParameters`](crate::MachineParameters::checksum).
    pub const fn checksum(&self) -> u64 {
        let hash = over_numbers(START, &[self.offset_m, self.first_d_m, self.first_b_m, self.second_b_m]);
        let hash = over_numbers(hash, &[self.flange_m, self.home_z0_m, self.singularity_margin]);
        over_numbers(over_numbers(hash, &self.min_rad), &self.max_rad)
    }
}

macro_rules! wrist {
    ($t:ty, $over:path) => {
        impl Wrist<$t> {
            /// Checks the parameters; works in a `const`.
            ///
            /// # Errors
            /// The first number that [`WristParameters::check`] refuses.
            ///
            /// ```
            /// use pkm_core::{Wrist, WristError, WristParameters};
            /// let longer = WristParameters { flange_m: 0.25, ..WristParameters::PAPER };
            /// assert!(Wrist::<f32>::new(&longer).is_ok());
            /// let straight = WristParameters { first_b_m: 0.15, ..longer }; // b1 + b2 = 0
            /// assert_eq!(Wrist::<f64>::new(&straight), Err(WristError::HomeIsSingular));
            /// ```
            pub const fn new(p: &WristParameters) -> Result<Self, WristError> {
                if let Err(error) = p.check() {
                    return Err(error);
                }
                Ok(Self {
                    offset: p.offset_m as $t,
                    first_d: p.first_d_m as $t,
                    first_b: p.first_b_m as $t,
                    second_b: p.second_b_m as $t,
                    flange: p.flange_m as $t,
                    min: [p.min_rad[0] as $t, p.min_rad[1] as $t],
                    max: [p.max_rad[0] as $t, p.max_rad[1] as $t],
                    home_z0: p.home_z0_m as $t,
                    home_determinant: p.home_determinant() as $t,
                    margin: p.singularity_margin as $t,
                })
            }

            /// Checksum of its numbers as they are in memory.
            pub const fn checksum(&self) -> u64 {
                let Self { offset, first_d, first_b, second_b, flange, min, max, home_z0, home_determinant, margin } =
                    self;
                let hash = $over(START, &[*offset, *first_d, *first_b, *second_b, *flange]);
                let hash = $over($over(hash, min), max);
                $over(hash, &[*home_z0, *home_determinant, *margin])
            }
        }
    };
}

wrist!(f32, over_numbers_f32);
wrist!(f64, over_numbers);

/// Where the wrist holds the tool, in A-uvw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WristPosture<T> {
    pub sin1: T,
    pub cos1: T,
    pub sin2: T,
    pub cos2: T,
    /// From the first axis to the tip, away from it and along it.
    pub r: T,
    pub h: T,
    pub tip: Vector3<T>,
}

impl<T: Scalar> Wrist<T> {
    /// r and h of a β2, m: from the first axis to the tip, away from it and along it.
    #[inline(always)]
    pub fn arm_m(&self, sin_beta2: T, cos_beta2: T) -> Vector2<T> {
        let r = self.first_b + self.second_b * cos_beta2 - self.flange * sin_beta2;
        Vector2::new(r, self.first_d + self.second_b * sin_beta2 + self.flange * cos_beta2)
    }

    #[inline(always)] // where it is needed most, its parts stay in registers
    pub(crate) fn held(&self, beta: Vector2<T>) -> WristPosture<T> {
        let ((sin1, cos1), (sin2, cos2)) = (beta.x.sin_cos(), beta.y.sin_cos());
        let [r, h] = self.arm_m(sin2, cos2).into();
        WristPosture { sin1, cos1, sin2, cos2, r, h, tip: Vector3::new(self.offset + cos1 * r, sin1 * r, h) }
    }

    /// The first joint, from 1, that is beyond its limits.
    pub(crate) fn beyond_limits(&self, beta: Vector2<T>) -> Option<u8> {
        let betas: [T; 2] = beta.into();
        let beyond = |i: usize| !(betas[i] >= self.min[i] - T::SLACK && betas[i] <= self.max[i] + T::SLACK);
        (0..2).find(|i| beyond(*i)).map(|i| i as u8 + 1)
    }
}

impl<T: Scalar> WristPosture<T> {
    /// Axes of T_h in A-uvw, as columns: x, y, z; z is the tool's axis. At β1 = β2 = 0 they are u, v, w. Positive β1 turns them about w,
    /// positive β2 about their own −y.
    pub fn axes(&self) -> Matrix3<T> {
        frame(
            Vector3::new(self.cos1 * self.cos2, self.sin1 * self.cos2, self.sin2),
            Vector3::new(-self.sin1, self.cos1, T::ZERO),
            Vector3::new(-self.cos1 * self.sin2, -self.sin1 * self.sin2, self.cos2),
        )
    }
}

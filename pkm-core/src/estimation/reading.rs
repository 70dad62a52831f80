//! What goes into an estimator, and what comes out.

use core::fmt;

use nalgebra::{Vector3, Vector6};

use super::MAX_AMPLITUDES;
use crate::correction::CorrectionError;
use crate::scalar::Scalar;
use crate::types::{Deflection, Domain, Pose, TipUncertainty, Wrench};

/// Most components of a reading.
pub const MAX_COMPONENTS: usize = 6;

/// Where and under which load something is read.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Touch<T> {
    /// When, s since any fixed time: a clock that goes on while the controller is off.
    pub time_s: u32,
    /// Where the machine stands.
    pub pose: Pose<T>,
    /// Where the tip is in A-uvw, m.
    pub tip_m: Vector3<T>,
    /// Load on the tip, its moment about the tip, in A-uvw.
    pub wrench: Wrench<T>,
    /// How much warmer the machine is than at its zero reading by its sensors, K; 0 without sensors, and where what is read has no growth in it.
    pub rise_k: T,
}

/// One component of what was read.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TipReading<T> {
    /// What is read: weights of the tip's translation and of its rotation, in A-uvw. A probe has a unit vector and no rotation.
    pub direction: Vector6<T>,
    /// By how much the tip has moved since the zero reading, m or rad: by the load and, of a machine with `thermal-expansion`, by growth. Who
    /// reads it loaded and unloaded and takes the difference leaves growth out, and gives 0 as [`Touch::rise_k`] and learns no
    /// [`Amplitude::RISE`](super::Amplitude::RISE).
    pub read: T,
    /// Standard deviation of `read`, above 0.
    pub deviation: T,
}

/// Why a reading is not taken in. No amplitude has moved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal {
    /// What is read is NaN or infinite, or a deviation not above 0.
    NotFinite,
    /// No component, or more than [`MAX_COMPONENTS`].
    Components,
    /// Before the last reading.
    Backwards,
    /// The load moves the tip by too little to tell anything.
    NotExcited,
    /// The same numbers as in the four readings before, or the same in one component that should have moved.
    Stuck,
    /// The tip goes against the deflection that the load makes.
    WrongSign,
    /// Further from what is expected than noise and what is unknown explain.
    Unexpected,
    /// There is no deflection at the pose, or pose, load or temperature are not finite.
    Model(CorrectionError),
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("the reading is not finite, or its deviation not above 0"),
            Self::Components => f.write_str("a reading has one to six components"),
            Self::Backwards => f.write_str("the reading is older than the last one"),
            Self::NotExcited => f.write_str("the load is too small for the reading to tell anything"),
            Self::Stuck => f.write_str("the probe says the same over and over"),
            Self::WrongSign => {
                f.write_str("the tip goes against its load: the sign of the probe or of the load is wrong")
            }
            Self::Unexpected => f.write_str("the reading is too far from what is expected"),
            Self::Model(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for Refusal {}

impl<E: Into<CorrectionError>> From<E> for Refusal {
    fn from(e: E) -> Self {
        Self::Model(e.into())
    }
}

/// What a reading did.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Learned<T> {
    /// χ² of its components before they were taken in: their number, on average.
    pub chi_squared: T,
    /// Which amplitudes count as unknown again from here on, because innovations had one sign.
    pub changed: [bool; MAX_AMPLITUDES],
    /// Where the pose stands to the table's box; `None` where no table was given. Outside of it the machine's amplitudes are learned from
    /// what the table says by extrapolation.
    pub domain: Option<Domain>,
}

/// An amplitude that has changed since acceptance.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Alarm {
    /// Its change since acceptance, in its unit.
    pub change: f64,
    /// Standard deviation of the change.
    pub deviation: f64,
    /// Probability that the change is of this sign and greater than what is worth an alarm.
    pub probability: f64,
    /// Readings since it was found, the one that has shown it included; all readings where it came little by little.
    pub readings: u32,
}

/// What was learned of the tip's deflection under a load.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TipEstimate<T> {
    /// Displacement of A that is to be added to that of machine and table, by what is used for compensation.
    pub deflection: Deflection<T>,
    /// Expected squares of what is left of the tip's translation along u, v, w after that, m²: its variances from the covariance of the
    /// amplitudes, and the squares of what their best values say beyond what is used, the accepted ones included.
    pub variance_m2: Vector3<T>,
}

impl<T: Scalar> TipEstimate<T> {
    /// Expanded uncertainty of the tip's translation along u, v, w, coverage 95 % (k = 1.96), m.
    pub fn u95_m(&self) -> Vector3<T> {
        self.uncertainty().u95_m()
    }

    /// See [`TipUncertainty::known_share`].
    pub fn known_share(&self, translation_m: &Vector3<T>) -> T {
        self.uncertainty().known_share(translation_m)
    }

    fn uncertainty(&self) -> TipUncertainty<T> {
        TipUncertainty { variance_m2: self.variance_m2 }
    }
}

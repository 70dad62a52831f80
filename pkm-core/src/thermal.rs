//! The machine at other temperatures than the declared one: softer, and grown.

use core::fmt;

use crate::kinematics::Posture;
use crate::machine::{LimbCompliance, Machine, Sizes};
use crate::scalar::Scalar;
use crate::stiffness::{self, StiffnessError};
use crate::types::{Deflection, Pose};

/// Temperature that stiffnesses are declared for, °C.
pub const DECLARED_TEMPERATURE_C: f64 = 20.0;
/// No temperature is below.
const ABSOLUTE_ZERO_C: f64 = -273.15;

/// Why there is no machine at a temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TemperatureError {
    /// NaN or infinite.
    NotFinite,
    /// The `thermal-modulus` effect would leave no stiffness, or the temperature is below absolute zero.
    NoStiffness,
}

impl fmt::Display for TemperatureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "the temperature is not finite",
            Self::NoStiffness => "no machine has this temperature and a stiffness",
        })
    }
}

impl core::error::Error for TemperatureError {}

/// How much warmer parts of a machine are than at its zero reading, K. One number for all of it, as of a single sensor or of a
/// mean, becomes one by `into()`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TemperatureRise<T> {
    /// Of limbs 1, 2, 3: the mean over the length of each.
    pub limbs_k: [T; 3],
    /// Of both platforms.
    pub platforms_k: T,
}

impl<T: Copy> From<T> for TemperatureRise<T> {
    fn from(rise_k: T) -> Self {
        Self { limbs_k: [rise_k; 3], platforms_k: rise_k }
    }
}

impl<T: Scalar> TemperatureRise<T> {
    /// All of the machine warmer by so much.
    pub(crate) fn plus(self, rise_k: T) -> Self {
        Self { limbs_k: self.limbs_k.map(|own| own + rise_k), platforms_k: self.platforms_k + rise_k }
    }
}

impl<T: Scalar> LimbCompliance<T> {
    /// Compliances of body and joints times a factor each.
    pub(crate) fn softened(mut self, [body, joints]: [T; 2]) -> Self {
        for c in [&mut self.axial, &mut self.bending, &mut self.torsion] {
            *c *= body;
        }
        let ends =
            [&mut self.base_linear, &mut self.base_angular, &mut self.platform_linear, &mut self.platform_angular];
        for c in ends.into_iter().flatten() {
            *c *= joints;
        }
        self
    }
}

impl<T: Scalar> Machine<T> {
    /// The machine at a temperature in °C, by its `thermal-modulus` effect: of every declared stiffness of a limb body
    /// (of a joint) the share 1 − rate × (T − 20 °C) is left. Stiffnesses that other effects bring stay. Elements whose law
    /// is the temperature get theirs. Without either it is the same machine. The temperature is that of the result,
    /// whatever that of `self` was.
    ///
    /// # Errors
    /// The temperature is not finite; it is below absolute zero, or the share would not be above 0.
    ///
    /// ```
    /// use pkm_core::thermal::TemperatureError;
    /// use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS};
    /// use pkm_core::{Machine, MachineParameters};
    /// assert_eq!(MACHINE_F64.at_temperature(35.0), Ok(MACHINE_F64));
    /// assert_eq!(MACHINE_F64.at_temperature(-300.0), Err(TemperatureError::NoStiffness));
    /// let effects = PARAMETERS.effects.with("thermal-modulus", [4e-4, 4e-4, 0.0]).unwrap();
    /// let steel = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    /// assert_ne!(steel.at_temperature(35.0), Ok(steel));
    /// assert_eq!(steel.at_temperature(20.0), Ok(steel));
    /// assert_eq!(steel.at_temperature(1e4), Err(TemperatureError::NoStiffness));
    /// ```
    pub fn at_temperature(&self, temperature_c: T) -> Result<Self, TemperatureError> {
        if !temperature_c.is_finite() {
            return Err(TemperatureError::NotFinite);
        }
        // of every machine: the thermometer is broken
        if temperature_c < T::from_f64(ABSOLUTE_ZERO_C) {
            return Err(TemperatureError::NoStiffness);
        }
        let mut machine = *self;
        let rates = self.effects.softening();
        if rates == [T::ZERO; 2] && !self.effects.elements.depend_on_temperature() {
            return Ok(machine);
        }
        let warmer_k = temperature_c - T::from_f64(DECLARED_TEMPERATURE_C);
        let [body, joints] = rates.map(|rate| T::ONE - rate * warmer_k);
        if !(body > T::ZERO && joints > T::ZERO && body.is_finite() && joints.is_finite()) {
            return Err(TemperatureError::NoStiffness);
        }
        machine.effects.elements.set_temperature(warmer_k);
        machine.softness = [T::ONE / body, T::ONE / joints];
        Ok(machine)
    }

    /// Displacement of A when the machine is warmer than at the zero reading and no load acts, to first order, by its
    /// `thermal-expansion` effect: each limb grows by its own rise, the platforms by theirs, the encoders read the same. Zero
    /// when the machine has none. Growth of everything alike moves A by its share of L along BA and turns nothing; a limb that
    /// grows alone turns the platform.
    ///
    /// # Arguments
    /// * `rise`: in K, one number for all of the machine or a [`TemperatureRise`].
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
    /// assert!((moved.translation_m.z - 10.0 * 11e-6 * 0.53).abs() < 1e-12);
    /// # Ok::<(), pkm_core::StiffnessError>(())
    /// ```
    pub fn thermal_deflection(
        &self,
        pose: &Pose<T>,
        rise: impl Into<TemperatureRise<T>>,
    ) -> Result<Deflection<T>, StiffnessError> {
        self.thermal_deflection_at(&self.posture(pose)?, &rise.into())
    }

    #[inline(never)] // takes no stack while the stiffness is worked out
    pub(crate) fn thermal_deflection_at(
        &self,
        commanded: &Posture<T>,
        rise: &TemperatureRise<T>,
    ) -> Result<Deflection<T>, StiffnessError> {
        let TemperatureRise { limbs_k: [first_k, second_k, third_k], platforms_k } = *rise;
        let [of_limbs, of_platforms] = self.effects.growth();
        if of_limbs == T::ZERO && of_platforms == T::ZERO {
            // a rise that is not finite is none, also of what does not grow
            let finite = (first_k + second_k + third_k + platforms_k).is_finite();
            return if finite { Ok(Deflection::ZERO) } else { Err(StiffnessError::NotFinite) };
        }
        let [limb_1, limb_2, limb_3] = [first_k, second_k, third_k].map(|rise_k| of_limbs * rise_k);
        let platforms = of_platforms * platforms_k;
        let actual = self.actual(commanded)?;
        let (p, Sizes { a1, a2, b2, .. }) = (&actual.posture, self.actual);
        let (sin, l) = (p.sin_sigma, p.l);
        let [q1, q2, q3] = p.q.into();
        // q dq = … of each limb, with what its own growth and the platforms' bring on the right
        let (along, across) = (p.along_n, p.along_y[0]);
        let both = across * across;
        let first = limb_1 * q1 * q1 - platforms * (both - along[0] * sin * a1);
        let second = limb_2 * q2 * q2 - platforms * (both + along[1] * sin * a1);
        // limb 3, whose q² is L² + a2² + b2² − 2 b2 (L sin θ + a2 cos θ)
        let reach = l * p.sin_theta + a2 * p.cos_theta;
        let third = limb_3 * q3 * q3 - platforms * (a2 * a2 + b2 * b2 - b2 * (reach + a2 * p.cos_theta));
        let moved = self.actual.moved(p, [first, second, third]);
        stiffness::finite(Deflection::from_vector(actual.given_back(moved)))
    }
}

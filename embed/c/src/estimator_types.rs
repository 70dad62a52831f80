//! What crosses the border of an estimator.

use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{
    Alarm, Amplitude, AmplitudeSettings, Estimator, EstimatorSettings, EstimatorSettingsError, Learned, Refusal,
    StateError, TipReading, Touch,
};
use pkm_core::nalgebra::Vector6;
use pkm_core::{Domain, Scalar};

use crate::{PKM_AMPLITUDES, PkmDomain, PkmError, PkmPoint, PkmPose, PkmWrench};

/// What an amplitude is of. Its unit is m/N along, rad/(N m) about an axis, and K of the temperature.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkmAmplitude {
    /// Compliance of limb 1 along its axis: drive, nut, bearings and screw together.
    Limb1 = 1,
    /// The same of limb 2.
    Limb2 = 2,
    /// The same of limb 3.
    Limb3 = 3,
    /// Compliance under the base along x of B.
    BaseX = 10,
    /// Along y.
    BaseY = 11,
    /// Along z.
    BaseZ = 12,
    /// About x.
    BaseRx = 13,
    /// About y.
    BaseRy = 14,
    /// About z.
    BaseRz = 15,
    /// Compliance behind A, of spindle, holder and tool, along u.
    ToolU = 20,
    /// Along v.
    ToolV = 21,
    /// Along w.
    ToolW = 22,
    /// About u.
    ToolRu = 23,
    /// About v.
    ToolRv = 24,
    /// About w.
    ToolRw = 25,
    /// How much warmer the machine is than its sensors say.
    Rise = 30,
    /// By how much more than the tip moves the sensor reads, as a share; never compensated.
    Gain = 31,
}

/// What is known of an amplitude before the first reading, and how it may move.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmAmplitudeSettings {
    /// A `PkmAmplitude`.
    pub amplitude: i32,
    /// Its value when the table was accepted: 0 where table and machine hold all of it. Changes count from here, and they alone are
    /// compensated.
    pub accepted: f64,
    /// Standard deviation of the value before anything is read, above 0.
    pub deviation: f64,
    /// Standard deviation of its drift in a day, at least 0.
    pub drift_per_day: f64,
    /// Least value that physics allows, at most `accepted`.
    pub least: f64,
    /// Greatest value that physics allows, at least `accepted`.
    pub most: f64,
    /// Fastest change of what is used for compensation, above 0, each second.
    pub rate_per_s: f64,
    /// A change by this is worth an alarm, above 0, and within reach of `least` or `most`.
    pub alarm: f64,
}

/// Settings of an estimator; docs/estimation.md says how to choose them.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmEstimatorSettings {
    /// What is learned, none twice (a limb yields along its axis alike wherever it does); those behind `count` are not looked at.
    pub amplitudes: [PkmAmplitudeSettings; PKM_AMPLITUDES],
    /// How many, 1 to `PKM_AMPLITUDES`.
    pub count: u32,
    /// Standard deviation of the model's own error as a share of the deflection, 0 to 1.
    pub model_share: f64,
}

/// Where and under which load something is read.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTouch<T> {
    /// When, s since any fixed time: a clock that goes on while the controller is off.
    pub time_s: u32,
    /// Where the machine stands.
    pub pose: PkmPose<T>,
    /// Where the tip is.
    pub tip: PkmPoint<T>,
    /// Load on the tip, its moment about the tip, in the axes of A-uvw.
    pub wrench: PkmWrench<T>,
    /// How much warmer the machine is than at its zero reading by its sensors; 0 without sensors.
    pub rise_k: T,
}

/// Where and under which load the tool of the five axes is read.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmToolTouch<T> {
    /// As `pkm_estimator_learn` takes it.
    pub touch: PkmTouch<T>,
    /// Axes x, y, z of B in A-uvw: directions of readings along them, without rotation.
    pub base_axes: [[T; 3]; 3],
}

/// One component of what was read.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTipReading<T> {
    /// What is read: weights of the tip's translation along and of its rotation about u, v, w. A probe has a unit vector and no
    /// rotation.
    pub direction: [T; 6],
    /// By how much the tip has moved since the zero reading, m or rad: by the load and, of a machine with `thermal-expansion`, by growth. Who
    /// reads it loaded and unloaded and takes the difference leaves growth out, and gives 0 as the touch's `rise_k` and learns no
    /// PKM_AMPLITUDE_RISE.
    pub read: T,
    /// Standard deviation of `read`, above 0.
    pub deviation: T,
}

/// What a reading did.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmLearned<T> {
    /// Chi squared of its components before they were taken in: their number, on average.
    pub chi_squared: T,
    /// Not 0 where an amplitude counts as unknown again from here on, because something has changed.
    pub changed: [i32; PKM_AMPLITUDES],
    /// Where the pose stands to the table's box: outside of it, it is learned from what the table says by extrapolation.
    pub domain: PkmDomain,
}

/// What is known of an amplitude, in its unit.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmAmplitudeState {
    /// Best value.
    pub value: f64,
    /// Its standard deviation.
    pub deviation: f64,
    /// What is compensated of its change since acceptance: as much as is known well enough, and the rate has let it follow.
    pub applied: f64,
    /// Not 0: it has changed since acceptance by what is worth an alarm. The rest is 0 without one.
    pub alarm: i32,
    /// Readings since the change was found.
    pub alarm_readings: u32,
    /// The change since acceptance.
    pub change: f64,
    /// Probability that the change is of this sign and greater than what is worth an alarm.
    pub probability: f64,
}

/// What an estimator knows.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmEstimatorState {
    /// In the order of the settings; zeros behind their count.
    pub amplitudes: [PkmAmplitudeState; PKM_AMPLITUDES],
    /// Readings that were taken in.
    pub readings: u32,
    /// Readings in a row that were refused as unexpected, stuck, of the wrong sign, or older than the last: some twenty are a broken sensor or a machine
    /// beyond what it may learn, or a clock that was wrong once.
    pub refused: u32,
    /// When the last reading was taken in, s.
    pub time_s: u32,
    /// When the first reading was taken in, s: what was accepted is as old as that.
    pub began_s: u32,
}

/// Which of two slots holds the newest whole state.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PkmNewest {
    /// 0 the first, 1 the second: write the next state to the other one.
    pub slot: u32,
    /// Its sequence number: the next state gets the one that follows.
    pub sequence: u32,
}

/// Of the numbers of [`PkmAmplitude`].
fn amplitude(number: i32) -> Option<Amplitude> {
    use Motion::{Axial, Ru, Rv, Rw, Rx, Ry, Rz, U, V, W, X, Y, Z};
    let (place, motion) = match number {
        1 => (Place::Body { limb: 1 }, Axial),
        2 => (Place::Body { limb: 2 }, Axial),
        3 => (Place::Body { limb: 3 }, Axial),
        10 => (Place::Base, X),
        11 => (Place::Base, Y),
        12 => (Place::Base, Z),
        13 => (Place::Base, Rx),
        14 => (Place::Base, Ry),
        15 => (Place::Base, Rz),
        20 => (Place::Tool, U),
        21 => (Place::Tool, V),
        22 => (Place::Tool, W),
        23 => (Place::Tool, Ru),
        24 => (Place::Tool, Rv),
        25 => (Place::Tool, Rw),
        30 => return Some(Amplitude::RISE),
        31 => return Some(Amplitude::GAIN),
        _ => return None,
    };
    Amplitude::compliance(place, motion)
}

impl PkmEstimatorSettings {
    pub(crate) fn core<const N: usize>(&self) -> Result<EstimatorSettings<N>, EstimatorSettingsError> {
        let unknown = AmplitudeSettings {
            amplitude: Amplitude::RISE,
            accepted: 0.0,
            deviation: 0.0,
            drift_per_day: 0.0,
            least: 0.0,
            most: 0.0,
            rate_per_s: 0.0,
            alarm: 0.0,
        };
        let mut amplitudes = [unknown; N];
        for (number, (to, own)) in (1..).zip(amplitudes.iter_mut().zip(&self.amplitudes)) {
            let Some(amplitude) = amplitude(own.amplitude) else {
                return Err(EstimatorSettingsError::Amplitude { amplitude: number, setting: "amplitude" });
            };
            *to = AmplitudeSettings {
                amplitude,
                accepted: own.accepted,
                deviation: own.deviation,
                drift_per_day: own.drift_per_day,
                least: own.least,
                most: own.most,
                rate_per_s: own.rate_per_s,
                alarm: own.alarm,
            };
        }
        Ok(EstimatorSettings { amplitudes, model_share: self.model_share })
    }
}

impl<T: Scalar> PkmTouch<T> {
    pub(crate) fn core(&self) -> Touch<T> {
        Touch {
            time_s: self.time_s,
            pose: self.pose.core(),
            tip_m: self.tip.uvw_m.into(),
            wrench: self.wrench.core(),
            rise_k: self.rise_k,
        }
    }
}

impl<T: Scalar> From<Touch<T>> for PkmTouch<T> {
    fn from(Touch { time_s, pose, tip_m, wrench, rise_k }: Touch<T>) -> Self {
        let wrench = PkmWrench { force_n: wrench.force_n.into(), moment_nm: wrench.moment_nm.into() };
        Self { time_s, pose: pose.into(), tip: PkmPoint { uvw_m: tip_m.into() }, wrench, rise_k }
    }
}

impl<T: Scalar> PkmTipReading<T> {
    pub(crate) fn core(&self) -> TipReading<T> {
        TipReading { direction: Vector6::from(self.direction), read: self.read, deviation: self.deviation }
    }
}

impl<T: Scalar> From<Learned<T>> for PkmLearned<T> {
    fn from(Learned { chi_squared, changed, domain }: Learned<T>) -> Self {
        // every call here has a table, and with one there is a domain
        let domain = domain.unwrap_or(Domain::Outside).into();
        Self { chi_squared, changed: changed.map(i32::from), domain }
    }
}

impl PkmEstimatorState {
    pub(crate) fn of<T: Scalar, const N: usize>(estimator: &Estimator<T, N>) -> Self {
        let nothing = PkmAmplitudeState {
            value: 0.0,
            deviation: 0.0,
            applied: 0.0,
            alarm: 0,
            alarm_readings: 0,
            change: 0.0,
            probability: 0.0,
        };
        let mut amplitudes = [nothing; PKM_AMPLITUDES];
        let known = estimator.values().into_iter().zip(estimator.applied()).zip(estimator.alarms());
        for (to, (((value, deviation), applied), alarm)) in amplitudes.iter_mut().zip(known) {
            *to = PkmAmplitudeState { value, deviation, applied, ..nothing };
            if let Some(Alarm { change, probability, readings, .. }) = alarm {
                *to = PkmAmplitudeState { alarm: 1, alarm_readings: readings, change, probability, ..*to };
            }
        }
        let (readings, refused, time_s) = (estimator.readings(), estimator.refused(), estimator.time_s());
        Self { amplitudes, readings, refused, time_s, began_s: estimator.began_s() }
    }
}

impl From<EstimatorSettingsError> for PkmError {
    fn from(_: EstimatorSettingsError) -> Self {
        Self::SettingOutOfRange
    }
}

impl From<Refusal> for PkmError {
    fn from(refusal: Refusal) -> Self {
        match refusal {
            Refusal::NotFinite => Self::NotFinite,
            Refusal::Components => Self::ReadingComponents,
            Refusal::Backwards => Self::ReadingBackwards,
            Refusal::NotExcited => Self::ReadingNotExcited,
            Refusal::Stuck => Self::ReadingStuck,
            Refusal::WrongSign => Self::ReadingWrongSign,
            Refusal::Unexpected => Self::ReadingUnexpected,
            Refusal::Model(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

impl From<StateError> for PkmError {
    fn from(error: StateError) -> Self {
        match error {
            StateError::NotWhole => Self::StateNotWhole,
            StateError::Other => Self::OtherState,
            StateError::TooShort => Self::WrongSize,
            _ => Self::Unknown,
        }
    }
}

//! What a controller learns from: a reading of the tip; and what it knows.

use pkm_core::compensator;
use pkm_core::estimation::{self, Estimator, MAX_AMPLITUDES, TipReading, Touch};
use pkm_core::nalgebra::Vector6;
use serde::{Deserialize, Serialize};

use crate::TableNumbers;
use crate::demand::are_finite;
use crate::reply::Checksum;

/// A reading of the tip under a known load.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// When, where and under which load; every number finite.
    pub touch: Touch<f64>,
    /// By what the tip has moved along u, v, w since the zero reading, by load and growth; finite.
    pub read_m: [f64; 3],
    /// Standard deviations of that; finite.
    pub deviation_m: [f64; 3],
}

impl Probe {
    /// As the estimator takes it.
    pub fn readings(&self) -> [TipReading<f64>; 3] {
        let [u, v, w] = [Vector6::x(), Vector6::y(), Vector6::z()];
        let ([read_u, read_v, read_w], [of_u, of_v, of_w]) = (self.read_m, self.deviation_m);
        [(u, read_u, of_u), (v, read_v, of_v), (w, read_w, of_w)].map(|(direction, read, deviation)| TipReading {
            direction,
            read,
            deviation,
        })
    }

    pub(crate) fn is_finite(&self) -> bool {
        let Touch { time_s: _, pose, tip_m, wrench, rise_k } = &self.touch;
        let numbers = self.read_m.iter().chain(&self.deviation_m).chain([rise_k]);
        are_finite(pose, wrench, tip_m) && numbers.into_iter().all(|number| number.is_finite())
    }
}

/// What a controller knows of the amplitudes that it learns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Learned {
    /// Why the reading of this `probe` was not taken in.
    pub refused: Option<Refusal>,
    /// Readings that were taken in.
    pub readings: u32,
    /// When the first of them was taken in, s by the clock of `probe`: what was accepted is as old as that.
    pub began_s: u32,
    /// When the last of them was taken in, s.
    pub time_s: u32,
    /// Of the amplitudes, in m/N, rad/(N·m) or K.
    pub values: TableNumbers,
    /// Standard deviations of the values.
    pub deviations: TableNumbers,
    /// Of each amplitude, where its change is worth one.
    pub alarms: [Option<Alarm>; MAX_AMPLITUDES],
    /// [`pkm_core::checksum`] over the state as it is saved, with the sequence number 0.
    pub state: Checksum,
    /// Sequence number of the state that was saved last; none was when it is null.
    pub saved: Option<u32>,
    /// What the compensation adds to the screw lengths, in the arithmetic of the latest demand.
    pub offset_m: [f64; 3],
    /// Why the latest demand is not compensated as usual; none, too, when there is none.
    pub fault: Option<OffsetFault>,
    /// Periods in which it has compensated a demand since the start.
    pub compensated: u32,
}

/// Why a reading was not taken in: those of [`estimation::Refusal`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Refusal {
    /// A deviation not above 0, or a number beyond the arithmetic.
    NotFinite,
    /// Before the last reading.
    Backwards,
    /// The load moves the tip by too little to tell anything.
    NotExcited,
    /// The same numbers as in the four readings before.
    Stuck,
    /// The tip goes against the deflection that the load makes.
    WrongSign,
    /// Further from what is expected than noise and what is unknown explain.
    Unexpected,
    /// There is no deflection at the pose.
    Model,
    /// Another reason.
    Other,
}

impl From<estimation::Refusal> for Refusal {
    fn from(e: estimation::Refusal) -> Self {
        match e {
            estimation::Refusal::NotFinite => Self::NotFinite,
            estimation::Refusal::Backwards => Self::Backwards,
            estimation::Refusal::NotExcited => Self::NotExcited,
            estimation::Refusal::Stuck => Self::Stuck,
            estimation::Refusal::WrongSign => Self::WrongSign,
            estimation::Refusal::Unexpected => Self::Unexpected,
            estimation::Refusal::Model(_) => Self::Model,
            _ => Self::Other,
        }
    }
}

/// Why a demand is not compensated as usual: those of [`compensator::Fault`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OffsetFault {
    /// The wrench is not finite in the arithmetic of the demand.
    WrenchNotFinite,
    /// The wrench is beyond the greatest force or moment.
    WrenchTooLarge,
    /// The wrench was the same for too long.
    WrenchStuck,
    /// A temperature is missing, out of range, or has jumped.
    TemperatureLost,
    /// The pose is outside the table's box.
    OutsideBox,
    /// There is no posture, no deflection, or no way for the three screws to compensate it at the pose.
    Model,
    /// Another reason: the five axes' own, which a controller of this protocol does not compensate, or one that this version does not know.
    Other,
}

impl From<compensator::Fault> for OffsetFault {
    fn from(e: compensator::Fault) -> Self {
        match e {
            compensator::Fault::WrenchNotFinite => Self::WrenchNotFinite,
            compensator::Fault::WrenchTooLarge => Self::WrenchTooLarge,
            compensator::Fault::WrenchStuck => Self::WrenchStuck,
            compensator::Fault::TemperatureLost => Self::TemperatureLost,
            compensator::Fault::OutsideBox => Self::OutsideBox,
            compensator::Fault::Correction(_) | compensator::Fault::Compensation(_) => Self::Model,
            _ => Self::Other,
        }
    }
}

/// An amplitude that has changed since acceptance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Alarm {
    /// By how much.
    pub change: f64,
    /// Probability that it has changed by more than is worth an alarm.
    pub probability: f64,
    /// Since so many readings.
    pub readings: u32,
}

impl Learned {
    /// What an estimator of a machine knows, without compensation. `None` when it has more amplitudes than fit into a line.
    ///
    /// # Arguments
    /// * `state`: its state as it is saved, with the sequence number 0.
    pub fn new<const N: usize>(
        estimator: &Estimator<f64, N>,
        state: &[u8],
        refused: Option<estimation::Refusal>,
        saved: Option<u32>,
    ) -> Option<Self> {
        let values = estimator.values();
        let mut alarms = [None; MAX_AMPLITUDES];
        for (place, alarm) in alarms.iter_mut().zip(estimator.alarms()) {
            let told =
                |estimation::Alarm { change, probability, readings, .. }| Alarm { change, probability, readings };
            *place = alarm.map(told);
        }
        Some(Self {
            refused: refused.map(Refusal::from),
            readings: estimator.readings(),
            began_s: estimator.began_s(),
            time_s: estimator.time_s(),
            values: TableNumbers::new(&values.map(|(value, _)| value))?,
            deviations: TableNumbers::new(&values.map(|(_, deviation)| deviation))?,
            alarms,
            state: Checksum::over(state),
            saved,
            offset_m: [0.0; 3],
            fault: None,
            compensated: 0,
        })
    }

    pub(crate) fn is_finite(&self) -> bool {
        let mut alarms = self.alarms.iter().flatten();
        let alarms = alarms.all(|alarm| alarm.change.is_finite() && alarm.probability.is_finite());
        let offset = self.offset_m.iter().all(|offset| offset.is_finite());
        self.values.are_finite() && self.deviations.are_finite() && alarms && offset
    }
}

//! What an integrator chooses, and its ranges.

use core::fmt;

/// What a compensator does where the pose is outside the box that the table was fitted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OutsideBox {
    /// The offset stays what it was.
    Hold,
    /// The offset goes to zero at the rate limit.
    Fade,
    /// The table is extrapolated.
    Extrapolate,
}

/// Settings of a [`Compensator`](super::Compensator), in SI units. [`DEFAULT`](Self::DEFAULT) is for a force sensor and a period
/// of 1 ms; what it costs and why it is stable: `docs/stability.md`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct CompensatorSettings {
    /// Time from one update to the next, 1e-6 s to 1 s.
    pub period_s: f64,
    /// Share of the load's deflection that is compensated, 0 to 1. With a force sensor below 1; 1 is for a load that is
    /// computed, not measured. Thermal growth is compensated whole.
    pub gain: f64,
    /// Time constant of the first-order low-pass on the wrench, 0 s to 10 s and at most 1e5 periods; 0 is no filter.
    pub filter_s: f64,
    /// Dead band: this much is taken off the size of the filtered force, 0 N to `max_force_n`.
    pub dead_band_n: f64,
    /// The same of the moment, 0 N·m to `max_moment_nm`.
    pub dead_band_nm: f64,
    /// A reading with a greater force is refused, N, above 0 and at most 1e9.
    pub max_force_n: f64,
    /// A reading with a greater moment is refused, N·m, above 0 and at most 1e9.
    pub max_moment_nm: f64,
    /// How long the last good reading stands in for refused ones, 0 s to 10 s. Then the load counts as zero.
    pub hold_s: f64,
    /// After how long of equal readings a sensor counts as stuck, 0 s to 1000 s, a period at least; 0 is never, for a load that is
    /// computed.
    pub stuck_s: f64,
    /// Largest offset of a screw, above 0 m and at most 0.01 m.
    pub max_screw_m: f64,
    /// Largest offset of a wrist joint, above 0 rad and at most 0.1 rad.
    pub max_wrist_rad: f64,
    /// Fastest offset of a screw, above 0 m/s and at most 1 m/s, and fast enough for the largest offset in 1e6 periods.
    pub screw_rate_m_per_s: f64,
    /// Fastest offset of a wrist joint, above 0 rad/s and at most 10 rad/s, and as fast.
    pub wrist_rate_rad_per_s: f64,
    /// What to do outside the table's box.
    pub outside_box: OutsideBox,
}

/// Most periods of a filter's time constant, and of the way to the largest offset. What is slower is lost in the rounding of `f32`: the
/// filter stops short of the load, and the offset does not come back.
const MAX_FILTER_PERIODS: f64 = 1e5;
const MAX_WAY_PERIODS: f64 = 1e6;

/// The first setting that is out of its range; see [`CompensatorSettings`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SettingsError {
    /// Name of the field.
    pub setting: &'static str,
}

impl fmt::Display for SettingsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the compensator's {} is out of its range", self.setting)
    }
}

impl core::error::Error for SettingsError {}

impl CompensatorSettings {
    /// For a force sensor and a period of 1 ms.
    pub const DEFAULT: Self = Self {
        period_s: 1e-3,
        gain: 0.7,
        filter_s: 0.02,
        dead_band_n: 5.0,
        dead_band_nm: 0.5,
        max_force_n: 5e3,
        max_moment_nm: 1e3,
        hold_s: 0.01,
        stuck_s: 1.0,
        max_screw_m: 0.5e-3,
        max_wrist_rad: 1e-3,
        screw_rate_m_per_s: 5e-3,
        wrist_rate_rad_per_s: 10e-3,
        outside_box: OutsideBox::Fade,
    };

    /// Checks every number.
    ///
    /// # Errors
    /// The first setting that is out of its range, NaN included.
    pub const fn check(&self) -> Result<(), SettingsError> {
        let slowest = 1.0 / (MAX_WAY_PERIODS * self.period_s);
        let (slowest_screw, slowest_turn) = (self.max_screw_m * slowest, self.max_wrist_rad * slowest);
        // least, and whether it is allowed; greatest
        let ranges = [
            (self.period_s, 1e-6, true, 1.0, "period_s"),
            (self.gain, 0.0, true, 1.0, "gain"),
            (self.filter_s, 0.0, true, (MAX_FILTER_PERIODS * self.period_s).min(10.0), "filter_s"),
            (self.max_force_n, 0.0, false, 1e9, "max_force_n"),
            (self.max_moment_nm, 0.0, false, 1e9, "max_moment_nm"),
            (self.dead_band_n, 0.0, true, self.max_force_n, "dead_band_n"),
            (self.dead_band_nm, 0.0, true, self.max_moment_nm, "dead_band_nm"),
            (self.hold_s, 0.0, true, 10.0, "hold_s"),
            (self.stuck_s, 0.0, true, 1000.0, "stuck_s"),
            (self.max_screw_m, 0.0, false, 0.01, "max_screw_m"),
            (self.max_wrist_rad, 0.0, false, 0.1, "max_wrist_rad"),
            (self.screw_rate_m_per_s, slowest_screw, true, 1.0, "screw_rate_m_per_s"),
            (self.wrist_rate_rad_per_s, slowest_turn, true, 10.0, "wrist_rate_rad_per_s"),
        ];
        let mut i = 0;
        while i < ranges.len() {
            let (value, least, or_equal, most, setting) = ranges[i];
            if !((value > least || or_equal && value == least) && value <= most) {
                return Err(SettingsError { setting });
            }
            i += 1;
        }
        Ok(())
    }

    /// Periods in a time, to the nearest whole one. Of a time above 0 there is one at least: 0 may mean never.
    pub(super) fn periods(&self, time_s: f64) -> u32 {
        let periods = (time_s / self.period_s + 0.5) as u32;
        if periods == 0 && time_s > 0.0 { 1 } else { periods }
    }
}

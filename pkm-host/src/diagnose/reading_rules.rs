//! Numbers by which readings are doubted, left out or refused before the statistics take them, with their reasons; what one check alone
//! needs stands beside it. The thresholds of the statistics, which some of these checks use as well, are [`Rules`](pkm_diagnosis::Rules).

// single columns

/// Least temperature in °C that is probably in kelvins: no machine is measured at 150 °C. Angles in radians:
/// [`MAX_RADIANS`](crate::pose::MAX_RADIANS).
pub const MIN_KELVIN: f64 = 150.0;
/// Temperature in °C above which all are probably in °F: a shop has 59 to 95 °F, and no machine stays above 55 °C.
pub const MIN_FAHRENHEIT: f64 = 55.0;
/// Least distance in mm of a point of the readings that is not probably in metres.
pub const MIN_POINT_MM: f64 = 1.0;
/// Numbers that instruments write for "no value", without their sign.
pub const PLACEHOLDERS: [f64; 8] = [999.0, 999.9, 999.99, 9999.0, 9999.9, 9999.99, 99999.0, 32767.0];
/// Greatest scatter of a load, as a share of it, median of a file: a load that scatters by more is not at rest, or not of that reading.
pub const MAX_LOAD_RANDOM: f64 = 0.05;
/// Ratio to the median of its column above which such a number is no reading.
pub const MIN_PLACEHOLDER_RATIO: f64 = 10.0;
/// Readings from which on a channel that always says the same is refused: that is no coincidence.
pub const MIN_CONSTANT_READINGS: usize = 10;

// the noise

/// Ratio of the spread of repeats to the median spread of all in a channel above which they are not of one thing.
pub const MAX_SPREAD_RATIO: f64 = 50.0;
/// Mean square of the residuals over the declared variance below which that is no noise of these readings.
pub const MIN_SHARE_OF_DECLARED_VARIANCE: f64 = 0.1;
/// The same above which noise and misfit are not told apart without repeats.
pub const MAX_SHARE_OF_DECLARED_VARIANCE: f64 = 2.0;
/// From how many numbers on: of 60, so little is no chance.
pub const MIN_NUMBERS_OF_DECLARED_NOISE: usize = 60;

// repeats

/// Share by which repeats read more than the first readings, and its standard deviations, from which on that is said.
pub const MIN_SCALE_OF_REPEATS: f64 = 0.005;
pub const MIN_SCALE_SD: f64 = 8.0;
/// From how many poses that share is known.
pub const MIN_POSES_OF_SCALE: usize = 4;

// series

/// Warmth of the machine within a series, K, from which on it grows by more than a sensor drifts.
pub const MAX_WARMING_K: f64 = 0.5;
/// Greatest drift of a zero over a series, in standard deviations of a reading, beside which what is found is still said: one of 6 had the
/// base named for it, one of 3 nothing.
pub const MAX_SOUND_DRIFT_SD: f64 = 4.0;
/// Least number of equal readings in a row of one sensor that sticks.
pub const MIN_STUCK_READINGS: usize = 5;
/// By how many steps of the sensor the declared machine has to move meanwhile: so far off no machine is.
pub const MIN_STUCK_STEPS: f64 = 20.0;

// single rows

/// Largest cosine between what was read and what the machine gives at which a row has the wrong sign.
pub const MAX_REVERSED_COSINE: f64 = -0.8;
/// Least median cosine of all rows, whatever its sign, at which a single one with the wrong sign is to be seen.
pub const MIN_MEDIAN_COSINE: f64 = 0.8;
/// Least deflection of such a row, as a share of the median of all.
pub const MIN_REVERSED_SIZE: f64 = 0.5;
/// Largest deflection of such a row over what the machine gives.
pub const MAX_REVERSED_RATIO: f64 = 2.0;
/// Least deflection of a row without a load, beyond its series' zero, that is that of a load, as a share of the median of its series.
pub const MIN_LOST_SIZE: f64 = 0.5;
/// The same in standard deviations of the noise.
pub const MIN_LOST_SD: f64 = 8.0;
/// Rows without a load that may be those, as a share of all: where more are, the zero is another than the others of its series say.
pub const MAX_LOST_SHARE: f64 = 1.0 / 3.0;
/// Largest deflection of a row in a unit a thousand times as large, as a share of what the machine gives and of the median of all rows.
pub const MAX_OTHER_UNIT_RATIO: f64 = 0.02;
/// Least deflection that the machine gives there, in standard deviations of the noise.
pub const MIN_OTHER_UNIT_SD: f64 = 8.0;
/// Least number of loads that were read so: a single number is a gross error, and an unknown zero hides one load.
pub const MIN_OTHER_UNIT_LOADS: usize = 3;
/// Largest share of all rows that is wrong by itself: where more are, it is one slip or the machine.
pub const MAX_SHARE_OF_ROWS: f64 = 0.05;

// single poses, and the readings as a whole; poses: `Rules::min_pose_ratio`, `Rules::max_pose_share`

/// Squares left of a repeat of a pose, over the usual ones, from which on the noise is taken from the others: a repeat that is wrong makes
/// up some of it.
pub const MIN_SUSPECT_RATIO: f64 = 5.0;
/// Least number of readings of a repeat of a pose that may have been taken otherwise: fewer fit too much.
pub const MIN_READINGS_OF_REPEAT: usize = 6;
/// Most poses that stand out beside which one number of a pose may be mistyped: where more do, it is not people.
pub const MAX_MISTYPED_POSES: usize = 3;
/// Share of what the best known way to take a pose leaves, below which another number in it is likelier: that number is fitted.
pub const MAX_SHARE_OF_KNOWN_WAY: f64 = 0.5;
/// Ratio of what two ways to take the readings leave up to which both are named.
pub const MAX_ALIKE_RATIO: f64 = 1.1;
/// What may be left with a lever, in noise variances a number: three free numbers mend some of what a machine's parts do as well.
pub const MAX_LEFT_WITH_LEVER: f64 = 1.5;
/// Least lever that a load may have without a word of it, m.
pub const MIN_LEVER_M: f64 = 0.05;
/// Greatest one, m: none is longer.
pub const MAX_LEVER_M: f64 = 2.0;
/// Error of an identified model on held-out readings, in percent of these, beyond which they are not what they are taken for.
pub const MAX_HELD_OUT_PERCENT: f64 = 50.0;

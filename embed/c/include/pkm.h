/* pkm: kinematics and stiffness of an Exechon-like parallel kinematic machine. Generated from embed/c/src by
 * `cargo xtask header`; change it there.
 *
 * Units: SI, in every name: m, rad, N, N m; temperatures in degrees Celsius.
 * Frames: B-xyz sits on the fixed platform, x from B to B3, y from B to B2. A-uvw sits on the moving platform, u from A
 * to A3, v from A to A2, w towards the tool. T_h is the tool: with both angles of the wrist at 0 its x, y, z are u, v, w; a positive first
 * angle turns it about +w, a positive second one about its own -y. A load acts on the tool. Six-vectors: u, v, w, about u, v, w.
 * Errors: every function that computes returns a PkmError and writes its result (where the last pointer that is not to const leads) only
 * when that is PKM_ERROR_OK. Null and misaligned pointers, NaN and infinities are errors, where a function does not say otherwise. GCC and Clang warn when one is ignored.
 * Numbers: functions that end in _f64 compute in double, those in _f32 in float; the same bits on a PC as on a Cortex-M.
 * Nothing allocates, blocks, keeps state, or calls back; every function may be called from several threads and from
 * interrupts. Input and result may be the same memory. A compensator or an estimator is state, in memory that the caller gives:
 * it is updated by one caller at a time, and apart from its inputs and results.
 * Stack: the core takes at most 5,632 bytes on a Cortex-M in functions that end in _f64, 3,072 in _f32 (checks/budgets.toml);
 * copies of inputs and result come on top. Time: bounded; a pkm_tool_inverse looks at no more than 64 configurations, two or
 * three along a path, and a pkm_tool_compensated at no more than 16 in all, with four deflections. The floating-point unit must be on before the
 * first call.
 * One library holds one machine, one wrist and one table; other tables of the machine may come while the program runs
 * (pkm_table_receive). For several machines use the Rust crate pkm-core.
 * C99 or C++11.
 */

#ifndef PKM_H
#define PKM_H

#include <stddef.h>
#include <stdint.h>

/* Of this header; pkm_version() is that of the library. */
#define PKM_VERSION "0.5.1"

#if defined(__GNUC__)
#define PKM_MUST_USE __attribute__((warn_unused_result))
#else
#define PKM_MUST_USE
#endif

// Most amplitudes that an estimator learns.
#define PKM_AMPLITUDES 8

// Most terms of a table that comes while the program runs: all up to the fourth degree.
#define PKM_TABLE_TERMS 35

// Size of a `PkmMachine` in numbers of its type.
#define PKM_MACHINE_NUMBERS 290

// What every function returns. The numbers stay what they are in later versions; new ones may come.
enum PkmError
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The result was written.
  PKM_ERROR_OK = 0,
  // A pointer is null.
  PKM_ERROR_NULL_POINTER = 1,
  // A pointer is not aligned for its type.
  PKM_ERROR_MISALIGNED = 2,
  // An input, or what would come of it, is NaN or infinite.
  PKM_ERROR_NOT_FINITE = 3,
  // Memory, a slot or a structure has a size that does not fit: too small, or the header is that of another version.
  PKM_ERROR_WRONG_SIZE = 4,
  // No assembly exists in the working mode: an angle beyond a right angle, Z0 not above 0, the far side of a
  // singularity, or lengths that don't close.
  PKM_ERROR_UNREACHABLE = 10,
  // Too near to a direct singularity.
  PKM_ERROR_SINGULAR = 11,
  // The screw of limb 1 would leave its travel, further than the others.
  PKM_ERROR_OUT_OF_TRAVEL_LIMB1 = 12,
  // The screw of limb 2 would leave its travel, further than the others.
  PKM_ERROR_OUT_OF_TRAVEL_LIMB2 = 13,
  // The screw of limb 3 would leave its travel, further than the others.
  PKM_ERROR_OUT_OF_TRAVEL_LIMB3 = 14,
  // The stiffness is not positive definite in this number type.
  PKM_ERROR_NOT_POSITIVE_DEFINITE = 20,
  // The limb forces under load-dependent effects were not found.
  PKM_ERROR_NOT_CONVERGED = 21,
  // No stiffness would be left at this temperature, or it is below absolute zero.
  PKM_ERROR_NO_STIFFNESS = 22,
  // The table has no factor form.
  PKM_ERROR_NO_FACTOR_FORM = 30,
  // A coefficient of the table that must be positive is not, at this pose; only outside the table's box.
  PKM_ERROR_NOT_POSITIVE = 31,
  // The numbers are no table: too many or too few, out of range, or more terms than there is room for.
  PKM_ERROR_NOT_A_TABLE = 32,
  // The screws cannot move the tip in every direction: it is too near to the plane through A, or through B, that is
  // square to BA.
  PKM_ERROR_NOT_COMPENSABLE = 40,
  // The load displaces the tip by more than a hundredth of the distance from B to A: no machine is at work there. Is it in N and N·m?
  PKM_ERROR_DISPLACED_TOO_FAR = 41,
  // A tool is out of the five axes' reach from where they stand, or `near` is no place where they can (all zeros).
  PKM_ERROR_TOOL_UNREACHABLE = 50,
  // Where the five axes stand, or on the way, two configurations meet that hold the tool alike.
  PKM_ERROR_TOOL_SINGULAR = 51,
  // The first joint of the wrist would leave its limits.
  PKM_ERROR_WRIST_LIMIT1 = 52,
  // The second joint of the wrist would leave its limits.
  PKM_ERROR_WRIST_LIMIT2 = 53,
  // The machine in memory is not the one that was built.
  PKM_ERROR_DAMAGED_MACHINE = 60,
  // The wrist in memory is not the one that was built.
  PKM_ERROR_DAMAGED_WRIST = 61,
  // The table in memory is not the one that was built.
  PKM_ERROR_DAMAGED_TABLE = 62,
  // The library has another machine than the program is for.
  PKM_ERROR_OTHER_MACHINE = 63,
  // The library has another wrist, or another length of the tool, than the program is for.
  PKM_ERROR_OTHER_WRIST = 64,
  // The library has another table than the program is for.
  PKM_ERROR_OTHER_TABLE = 65,
  // Kinematics do not compute the bits that they should: processor, its floating-point unit or its mode, compiler.
  PKM_ERROR_SELF_TEST_KINEMATICS = 66,
  // Stiffness and compensation do not compute the bits that they should.
  PKM_ERROR_SELF_TEST_STIFFNESS = 67,
  // The five axes do not compute the bits that they should.
  PKM_ERROR_SELF_TEST_FIVE_AXES = 68,
  // The compensator does not compute the bits that it should.
  PKM_ERROR_SELF_TEST_COMPENSATOR = 69,
  // A setting of a compensator or an estimator is out of its range.
  PKM_ERROR_SETTING_OUT_OF_RANGE = 70,
  // The memory holds no compensator or estimator of this version and kind.
  PKM_ERROR_NOT_INITIALISED = 71,
  // The uncertainty of the table in memory is not the one that was built.
  PKM_ERROR_DAMAGED_UNCERTAINTY = 72,
  // The reading of the wrench is NaN or infinite.
  PKM_ERROR_WRENCH_NOT_FINITE = 80,
  // The reading of the wrench is beyond the greatest force or moment.
  PKM_ERROR_WRENCH_TOO_LARGE = 81,
  // The readings of the wrench were equal for too long.
  PKM_ERROR_WRENCH_STUCK = 82,
  // A temperature rise is not finite, beyond 100 K either way, has jumped, or runs away.
  PKM_ERROR_TEMPERATURE_LOST = 83,
  // The pose is outside the table's box.
  PKM_ERROR_OUTSIDE_BOX = 84,
  // A weight or its centre of mass is NaN or infinite.
  PKM_ERROR_WEIGHT_NOT_FINITE = 85,
  // A weight is beyond 1e5 N, ten tonnes.
  PKM_ERROR_WEIGHT_TOO_HEAVY = 86,
  // A centre of mass is farther than 10 m.
  PKM_ERROR_WEIGHT_TOO_FAR = 87,
  // Where the machine was zeroed the weight cannot be compensated, so that there is no reference: outside the table's box, or no
  // place, posture or stiffness there.
  PKM_ERROR_WEIGHT_NO_REFERENCE = 88,
  // A reading of the tip has no component, or more than six.
  PKM_ERROR_READING_COMPONENTS = 90,
  // A reading of the tip is older than the last one.
  PKM_ERROR_READING_BACKWARDS = 91,
  // The load moves the tip by too little for the reading to tell anything.
  PKM_ERROR_READING_NOT_EXCITED = 92,
  // The probe has said the same five times in a row.
  PKM_ERROR_READING_STUCK = 93,
  // The tip goes against the deflection that its load makes: the sign of probe or load is wrong.
  PKM_ERROR_READING_WRONG_SIGN = 94,
  // A reading of the tip is further from what is expected than noise and what is unknown explain.
  PKM_ERROR_READING_UNEXPECTED = 95,
  // No saved state is whole.
  PKM_ERROR_STATE_NOT_WHOLE = 96,
  // The saved state is that of another machine or table, or of other amplitudes.
  PKM_ERROR_OTHER_STATE = 97,
  // The tip was read while an offset acted, which takes some of its deflection away. Of controllers, as LinuxCNC's module: no function has it.
  PKM_ERROR_READING_COMPENSATED = 98,
  // An error of the core that has no number here.
  PKM_ERROR_UNKNOWN = 255,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PkmError PkmError;
#else
typedef int32_t PkmError;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Where a pose stands to the box that a table was fitted on.
enum PkmDomain
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // In the box or on its edge: the table's stated errors hold.
  PKM_DOMAIN_INSIDE = 0,
  // Outside: the value is an extrapolation for which nobody has vouched; it is computed all the same.
  PKM_DOMAIN_OUTSIDE = 1,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PkmDomain PkmDomain;
#else
typedef int32_t PkmDomain;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// Which limit holds an offset back.
enum PkmLimit
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The offset is what was asked for.
  PKM_LIMIT_NONE = 0,
  // What was asked for is larger than the largest offset.
  PKM_LIMIT_SIZE = 1,
  // The offset is on its way, at its rate limit.
  PKM_LIMIT_RATE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PkmLimit PkmLimit;
#else
typedef int32_t PkmLimit;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a compensator does where the pose is outside the box that the table was fitted on.
enum PkmOutsideBox
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // The offset stays what it was.
  PKM_OUTSIDE_BOX_HOLD = 0,
  // The offset goes to zero at the rate limit.
  PKM_OUTSIDE_BOX_FADE = 1,
  // The table is extrapolated.
  PKM_OUTSIDE_BOX_EXTRAPOLATE = 2,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PkmOutsideBox PkmOutsideBox;
#else
typedef int32_t PkmOutsideBox;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What an amplitude is of. Its unit is m/N along, rad/(N m) about an axis, and K of the temperature.
enum PkmAmplitude
#if defined(__cplusplus) || __STDC_VERSION__ >= 202311L
  : int32_t
#endif // defined(__cplusplus) || __STDC_VERSION__ >= 202311L
 {
  // Compliance of limb 1 along its axis: drive, nut, bearings and screw together.
  PKM_AMPLITUDE_LIMB1 = 1,
  // The same of limb 2.
  PKM_AMPLITUDE_LIMB2 = 2,
  // The same of limb 3.
  PKM_AMPLITUDE_LIMB3 = 3,
  // Compliance under the base along x of B.
  PKM_AMPLITUDE_BASE_X = 10,
  // Along y.
  PKM_AMPLITUDE_BASE_Y = 11,
  // Along z.
  PKM_AMPLITUDE_BASE_Z = 12,
  // About x.
  PKM_AMPLITUDE_BASE_RX = 13,
  // About y.
  PKM_AMPLITUDE_BASE_RY = 14,
  // About z.
  PKM_AMPLITUDE_BASE_RZ = 15,
  // Compliance behind A, of spindle, holder and tool, along u.
  PKM_AMPLITUDE_TOOL_U = 20,
  // Along v.
  PKM_AMPLITUDE_TOOL_V = 21,
  // Along w.
  PKM_AMPLITUDE_TOOL_W = 22,
  // About u.
  PKM_AMPLITUDE_TOOL_RU = 23,
  // About v.
  PKM_AMPLITUDE_TOOL_RV = 24,
  // About w.
  PKM_AMPLITUDE_TOOL_RW = 25,
  // How much warmer the machine is than its sensors say.
  PKM_AMPLITUDE_RISE = 30,
  // By how much more than the tip moves the sensor reads, as a share; never compensated.
  PKM_AMPLITUDE_GAIN = 31,
};
#ifndef __cplusplus
#if __STDC_VERSION__ >= 202311L
typedef enum PkmAmplitude PkmAmplitude;
#else
typedef int32_t PkmAmplitude;
#endif // __STDC_VERSION__ >= 202311L
#endif // __cplusplus

// What a compensator of the three screws keeps from period to period.
typedef struct PkmCompensator_f32 PkmCompensator_f32;

// What a compensator of the three screws keeps from period to period.
typedef struct PkmCompensator_f64 PkmCompensator_f64;

// What is in the caller's memory.
typedef struct PkmEstimator_f32 PkmEstimator_f32;

// What is in the caller's memory.
typedef struct PkmEstimator_f64 PkmEstimator_f64;

// Room for a table that comes while the program runs.
typedef struct PkmTableBuffer_f32 PkmTableBuffer_f32;

// Room for a table that comes while the program runs.
typedef struct PkmTableBuffer_f64 PkmTableBuffer_f64;

// How far a table may be off, as the fit has found it.
typedef struct PkmTableUncertainty_f32 PkmTableUncertainty_f32;

// How far a table may be off, as the fit has found it.
typedef struct PkmTableUncertainty_f64 PkmTableUncertainty_f64;

// A correction table.
typedef struct PkmTable_f32 PkmTable_f32;

// A correction table.
typedef struct PkmTable_f64 PkmTable_f64;

// What a compensator of the five axes keeps from period to period.
typedef struct PkmToolCompensator_f32 PkmToolCompensator_f32;

// What a compensator of the five axes keeps from period to period.
typedef struct PkmToolCompensator_f64 PkmToolCompensator_f64;

// A wrist: the two rotary joints between moving platform and tool.
typedef struct PkmWrist_f32 PkmWrist_f32;

// A wrist: the two rotary joints between moving platform and tool.
typedef struct PkmWrist_f64 PkmWrist_f64;

// A checked machine. Look at it only through the functions; copy it freely, but pass none that did not come from
// `pkm_machine` or `pkm_at_temperature`: one that was not initialised is not noticed.
typedef struct {
  // Not for reading.
  double opaque[PKM_MACHINE_NUMBERS];
} PkmMachine_f64;

// Where the moving platform stands, R_y(theta) R_x(sigma).
typedef struct {
  // About y of B, within a right angle either way.
  double theta_rad;
  // About u, within a right angle either way.
  double sigma_rad;
  // Height of A over B along z of B, above 0.
  double z0_m;
} PkmPose_f64;

// Lengths |A_i B_i| of limbs 1, 2, 3: what the screws set.
typedef struct {
  // q1, q2, q3.
  double q_m[3];
} PkmLengths_f64;

// Derivatives of the screw lengths of limbs 1, 2, 3.
typedef struct {
  // By theta.
  double by_theta_m_per_rad[3];
  // By sigma.
  double by_sigma_m_per_rad[3];
  // By Z0.
  double by_z0_m_per_m[3];
} PkmJacobian_f64;

// Distances to the two direct singularities, without dimension: 0 there, 1 at the most.
typedef struct {
  // Of limbs 1 and 2.
  double limbs_1_2;
  // Of limb 3.
  double limb_3;
} PkmSingularityDistance_f64;

// Distance to the nearest end of travel.
typedef struct {
  // Negative outside.
  double margin_m;
  // The limb it belongs to: 1, 2, 3.
  uint32_t limb;
} PkmTravelMargin_f64;

// A symmetric stiffness at A in A-uvw, order u, v, w, about u, v, w.
typedef struct {
  // By block: N/m, N/rad; N m/m, N m/rad.
  double k_si[6][6];
} PkmStiffness_f64;

// Corrected stiffness K_m, and whether it may be trusted.
typedef struct {
  // K_m.
  PkmStiffness_f64 stiffness;
  // Where the pose stands to the table's box.
  PkmDomain domain;
} PkmCorrected_f64;

// A load on the moving platform, in the axes of A-uvw.
typedef struct {
  // Along u, v, w.
  double force_n[3];
  // About A (or about the tip, where a function says so), around u, v, w.
  double moment_nm[3];
} PkmWrench_f64;

// Displacement of the moving platform at A, in A-uvw.
typedef struct {
  // Of A along u, v, w.
  double translation_m[3];
  // About u, v, w.
  double rotation_rad[3];
} PkmDeflection_f64;

// How much warmer parts of a machine are than at its zero reading, K. With a single sensor all four numbers are its.
typedef struct {
  // Of limbs 1, 2, 3: the mean over the length of each.
  double limbs_k[3];
  // Of both platforms.
  double platforms_k;
} PkmTemperatureRise_f64;

// A point of the moving platform in A-uvw.
typedef struct {
  // From A along u, v, w.
  double uvw_m[3];
} PkmPoint_f64;

// What to command so that a loaded tip is where it should be.
typedef struct {
  // The pose to command.
  PkmPose_f64 pose;
  // Its screw lengths.
  PkmLengths_f64 lengths;
} PkmCompensated_f64;

// What one cycle of a controller computes.
typedef struct {
  // Screw lengths of the pose without load.
  PkmLengths_f64 lengths;
  // Displacement of A under the load.
  PkmDeflection_f64 deflection;
  // What to command under the load.
  PkmCompensated_f64 compensated;
  // Where the pose stands to the table's box.
  PkmDomain domain;
} PkmCycle_f64;

// A checked machine. Look at it only through the functions; copy it freely, but pass none that did not come from
// `pkm_machine` or `pkm_at_temperature`: one that was not initialised is not noticed.
typedef struct {
  // Not for reading.
  float opaque[PKM_MACHINE_NUMBERS];
} PkmMachine_f32;

// Where the moving platform stands, R_y(theta) R_x(sigma).
typedef struct {
  // About y of B, within a right angle either way.
  float theta_rad;
  // About u, within a right angle either way.
  float sigma_rad;
  // Height of A over B along z of B, above 0.
  float z0_m;
} PkmPose_f32;

// Lengths |A_i B_i| of limbs 1, 2, 3: what the screws set.
typedef struct {
  // q1, q2, q3.
  float q_m[3];
} PkmLengths_f32;

// Derivatives of the screw lengths of limbs 1, 2, 3.
typedef struct {
  // By theta.
  float by_theta_m_per_rad[3];
  // By sigma.
  float by_sigma_m_per_rad[3];
  // By Z0.
  float by_z0_m_per_m[3];
} PkmJacobian_f32;

// Distances to the two direct singularities, without dimension: 0 there, 1 at the most.
typedef struct {
  // Of limbs 1 and 2.
  float limbs_1_2;
  // Of limb 3.
  float limb_3;
} PkmSingularityDistance_f32;

// Distance to the nearest end of travel.
typedef struct {
  // Negative outside.
  float margin_m;
  // The limb it belongs to: 1, 2, 3.
  uint32_t limb;
} PkmTravelMargin_f32;

// A symmetric stiffness at A in A-uvw, order u, v, w, about u, v, w.
typedef struct {
  // By block: N/m, N/rad; N m/m, N m/rad.
  float k_si[6][6];
} PkmStiffness_f32;

// Corrected stiffness K_m, and whether it may be trusted.
typedef struct {
  // K_m.
  PkmStiffness_f32 stiffness;
  // Where the pose stands to the table's box.
  PkmDomain domain;
} PkmCorrected_f32;

// A load on the moving platform, in the axes of A-uvw.
typedef struct {
  // Along u, v, w.
  float force_n[3];
  // About A (or about the tip, where a function says so), around u, v, w.
  float moment_nm[3];
} PkmWrench_f32;

// Displacement of the moving platform at A, in A-uvw.
typedef struct {
  // Of A along u, v, w.
  float translation_m[3];
  // About u, v, w.
  float rotation_rad[3];
} PkmDeflection_f32;

// How much warmer parts of a machine are than at its zero reading, K. With a single sensor all four numbers are its.
typedef struct {
  // Of limbs 1, 2, 3: the mean over the length of each.
  float limbs_k[3];
  // Of both platforms.
  float platforms_k;
} PkmTemperatureRise_f32;

// A point of the moving platform in A-uvw.
typedef struct {
  // From A along u, v, w.
  float uvw_m[3];
} PkmPoint_f32;

// What to command so that a loaded tip is where it should be.
typedef struct {
  // The pose to command.
  PkmPose_f32 pose;
  // Its screw lengths.
  PkmLengths_f32 lengths;
} PkmCompensated_f32;

// What one cycle of a controller computes.
typedef struct {
  // Screw lengths of the pose without load.
  PkmLengths_f32 lengths;
  // Displacement of A under the load.
  PkmDeflection_f32 deflection;
  // What to command under the load.
  PkmCompensated_f32 compensated;
  // Where the pose stands to the table's box.
  PkmDomain domain;
} PkmCycle_f32;

// Settings of a compensator; `pkm_compensator_defaults` writes the defaults, which are for a force sensor. What they cost, and
// why they are stable: docs/stability.md.
typedef struct {
  // Time from one update to the next, 1e-6 s to 1 s. Default 1e-3 s.
  double period_s;
  // Share of the load's deflection that is compensated, 0 to 1. Default 0.7: below 1 with a force sensor; 1 is for a load that
  // is computed. Thermal growth is compensated whole.
  double gain;
  // Time constant of the first-order low-pass on the wrench, 0 s to 10 s and at most 1e5 periods; 0 is no filter. Default 0.02 s.
  double filter_s;
  // Dead band: this much is taken off the size of the filtered force, 0 N to `max_force_n`. Default 5 N.
  double dead_band_n;
  // The same of the moment, 0 N m to `max_moment_nm`. Default 0.5 N m.
  double dead_band_nm;
  // A reading with a greater force is refused, above 0 N and at most 1e9 N. Default 5e3 N.
  double max_force_n;
  // A reading with a greater moment is refused, above 0 N m and at most 1e9 N m. Default 1e3 N m.
  double max_moment_nm;
  // How long the last good reading stands in for refused ones, 0 s to 10 s; then the load counts as zero. Default 0.01 s.
  double hold_s;
  // After how long of equal readings a sensor counts as stuck, 0 s to 1000 s, a period at least; 0 is never, for a load that is
  // computed. Default 1 s.
  double stuck_s;
  // Largest offset of a screw, above 0 m and at most 0.01 m. Default 0.5e-3 m.
  double max_screw_m;
  // Largest offset of a wrist joint, above 0 rad and at most 0.1 rad. Default 1e-3 rad.
  double max_wrist_rad;
  // Fastest offset of a screw, above 0 m/s and at most 1 m/s, and fast enough for the largest offset in 1e6 periods. Default
  // 5e-3 m/s.
  double screw_rate_m_per_s;
  // Fastest offset of a wrist joint, above 0 rad/s and at most 10 rad/s, and as fast. Default 10e-3 rad/s.
  double wrist_rate_rad_per_s;
  // A `PkmOutsideBox`. Default PKM_OUTSIDE_BOX_FADE.
  int32_t outside_box;
} PkmCompensatorSettings;

// The machine that a program is for, by the checksums that its `coefficients.rs` states.
typedef struct {
  // As `pkm_machine_checksum`.
  uint64_t machine;
  // As `pkm_wrist_checksum`.
  uint64_t wrist;
  // As `pkm_table_checksum`.
  uint64_t table;
} PkmChecksums;

// What sensors say in a period. Numbers may be NaN or infinite: then there is no reading, which is a fault with a defined
// reaction and no error.
typedef struct {
  // Not 0: the machine is homed, on, and the reading means the load on the tool. At 0 the offset goes to zero at the rate
  // limit, and the load is forgotten.
  int32_t enabled;
  // Load on the tool, its moment about the tip: in the axes of A-uvw for three screws, in those of T_h for five axes. What a
  // dynamometer under the workpiece reads has the other sign.
  PkmWrench_f64 wrench;
  // How much warmer limbs and platforms are than at the zero reading; 0 without a sensor.
  PkmTemperatureRise_f64 rise;
} PkmReading_f64;

// What a compensator asks for: always finite, within the largest offset, and no further from the last one than the rate limit
// lets it in a period, as long as nobody else writes to its memory. The limits scale the offsets of all joints as one vector, so that the tip keeps its direction.
typedef struct {
  // To be added to the lengths of the screws.
  double screws_m[3];
  // To be added to joints 1 and 2 of the wrist; 0 of a compensator for three screws.
  double wrist_rad[2];
  // Which limit holds it back.
  PkmLimit limit;
  // Where the pose stands to the table's box.
  PkmDomain domain;
  // The gravest fault of this period, 0 when there is none; `pkm_error_text` says it in words. The offset is to be commanded with every fault. Those of the model end 0.1 s after their cause, and so do those of a wrench whose load already counts as zero; that of the box
  // ends when the pose is back by a hundredth of the half widths; the others end with their cause.
  PkmError fault;
} PkmOffset_f64;

// Where the five axes stand.
typedef struct {
  // Of the moving platform.
  PkmPose_f64 pose;
  // Joints 1 and 2 of the wrist.
  double beta_rad[2];
} PkmConfiguration_f64;

// What sensors say in a period. Numbers may be NaN or infinite: then there is no reading, which is a fault with a defined
// reaction and no error.
typedef struct {
  // Not 0: the machine is homed, on, and the reading means the load on the tool. At 0 the offset goes to zero at the rate
  // limit, and the load is forgotten.
  int32_t enabled;
  // Load on the tool, its moment about the tip: in the axes of A-uvw for three screws, in those of T_h for five axes. What a
  // dynamometer under the workpiece reads has the other sign.
  PkmWrench_f32 wrench;
  // How much warmer limbs and platforms are than at the zero reading; 0 without a sensor.
  PkmTemperatureRise_f32 rise;
} PkmReading_f32;

// What a compensator asks for: always finite, within the largest offset, and no further from the last one than the rate limit
// lets it in a period, as long as nobody else writes to its memory. The limits scale the offsets of all joints as one vector, so that the tip keeps its direction.
typedef struct {
  // To be added to the lengths of the screws.
  float screws_m[3];
  // To be added to joints 1 and 2 of the wrist; 0 of a compensator for three screws.
  float wrist_rad[2];
  // Which limit holds it back.
  PkmLimit limit;
  // Where the pose stands to the table's box.
  PkmDomain domain;
  // The gravest fault of this period, 0 when there is none; `pkm_error_text` says it in words. The offset is to be commanded with every fault. Those of the model end 0.1 s after their cause, and so do those of a wrench whose load already counts as zero; that of the box
  // ends when the pose is back by a hundredth of the half widths; the others end with their cause.
  PkmError fault;
} PkmOffset_f32;

// Where the five axes stand.
typedef struct {
  // Of the moving platform.
  PkmPose_f32 pose;
  // Joints 1 and 2 of the wrist.
  float beta_rad[2];
} PkmConfiguration_f32;

// What is known of an amplitude before the first reading, and how it may move.
typedef struct {
  // A `PkmAmplitude`.
  int32_t amplitude;
  // Its value when the table was accepted: 0 where table and machine hold all of it. Changes count from here, and they alone are
  // compensated.
  double accepted;
  // Standard deviation of the value before anything is read, above 0.
  double deviation;
  // Standard deviation of its drift in a day, at least 0.
  double drift_per_day;
  // Least value that physics allows, at most `accepted`.
  double least;
  // Greatest value that physics allows, at least `accepted`.
  double most;
  // Fastest change of what is used for compensation, above 0, each second.
  double rate_per_s;
  // A change by this is worth an alarm, above 0, and within reach of `least` or `most`.
  double alarm;
} PkmAmplitudeSettings;

// Settings of an estimator; docs/estimation.md says how to choose them.
typedef struct {
  // What is learned, none twice (a limb yields along its axis alike wherever it does); those behind `count` are not looked at.
  PkmAmplitudeSettings amplitudes[PKM_AMPLITUDES];
  // How many, 1 to `PKM_AMPLITUDES`.
  uint32_t count;
  // Standard deviation of the model's own error as a share of the deflection, 0 to 1.
  double model_share;
} PkmEstimatorSettings;

// Which of two slots holds the newest whole state.
typedef struct {
  // 0 the first, 1 the second: write the next state to the other one.
  uint32_t slot;
  // Its sequence number: the next state gets the one that follows.
  uint32_t sequence;
} PkmNewest;

// Where and under which load something is read.
typedef struct {
  // When, s since any fixed time: a clock that goes on while the controller is off.
  uint32_t time_s;
  // Where the machine stands.
  PkmPose_f64 pose;
  // Where the tip is.
  PkmPoint_f64 tip;
  // Load on the tip, its moment about the tip, in the axes of A-uvw.
  PkmWrench_f64 wrench;
  // How much warmer the machine is than at its zero reading by its sensors; 0 without sensors.
  double rise_k;
} PkmTouch_f64;

// One component of what was read.
typedef struct {
  // What is read: weights of the tip's translation along and of its rotation about u, v, w. A probe has a unit vector and no
  // rotation.
  double direction[6];
  // By how much the tip has moved since the zero reading, m or rad: by the load and, of a machine with `thermal-expansion`, by growth. Who
  // reads it loaded and unloaded and takes the difference leaves growth out, and gives 0 as the touch's `rise_k` and learns no
  // PKM_AMPLITUDE_RISE.
  double read;
  // Standard deviation of `read`, above 0.
  double deviation;
} PkmTipReading_f64;

// What a reading did.
typedef struct {
  // Chi squared of its components before they were taken in: their number, on average.
  double chi_squared;
  // Not 0 where an amplitude counts as unknown again from here on, because something has changed.
  int32_t changed[PKM_AMPLITUDES];
  // Where the pose stands to the table's box: outside of it, it is learned from what the table says by extrapolation.
  PkmDomain domain;
} PkmLearned_f64;

// Where and under which load the tool of the five axes is read.
typedef struct {
  // As `pkm_estimator_learn` takes it.
  PkmTouch_f64 touch;
  // Axes x, y, z of B in A-uvw: directions of readings along them, without rotation.
  double base_axes[3][3];
} PkmToolTouch_f64;

// What is known of an amplitude, in its unit.
typedef struct {
  // Best value.
  double value;
  // Its standard deviation.
  double deviation;
  // What is compensated of its change since acceptance: as much as is known well enough, and the rate has let it follow.
  double applied;
  // Not 0: it has changed since acceptance by what is worth an alarm. The rest is 0 without one.
  int32_t alarm;
  // Readings since the change was found.
  uint32_t alarm_readings;
  // The change since acceptance.
  double change;
  // Probability that the change is of this sign and greater than what is worth an alarm.
  double probability;
} PkmAmplitudeState;

// What an estimator knows.
typedef struct {
  // In the order of the settings; zeros behind their count.
  PkmAmplitudeState amplitudes[PKM_AMPLITUDES];
  // Readings that were taken in.
  uint32_t readings;
  // Readings in a row that were refused as unexpected, stuck, of the wrong sign, or older than the last: some twenty are a broken sensor or a machine
  // beyond what it may learn, or a clock that was wrong once.
  uint32_t refused;
  // When the last reading was taken in, s.
  uint32_t time_s;
  // When the first reading was taken in, s: what was accepted is as old as that.
  uint32_t began_s;
} PkmEstimatorState;

// How well a deflection of the tip is known, and how much of it is compensated for that reason.
typedef struct {
  // Expanded uncertainty of the tip's translation along u, v, w, coverage 95 % (k = 1.96).
  double u95_m[3];
  // 1 where the tip moves by more than its expanded uncertainty, else the share that its way is of that. A controller that
  // compensates the whole or nothing takes anything below 1 for nothing.
  double share;
} PkmKnown_f64;

// What a compensator asks for that compensates no more than is known.
typedef struct {
  // What it asks for.
  PkmOffset_f64 offset;
  // How well the deflection under the load that is compensated is known; zeros where `is_known` is 0.
  PkmKnown_f64 known;
  // Not 0: there is a deflection in this period. 0 when not enabled, outside the box unless its setting is to extrapolate, and with a fault of the model.
  int32_t is_known;
} PkmKnownOffset_f64;

// Where and under which load something is read.
typedef struct {
  // When, s since any fixed time: a clock that goes on while the controller is off.
  uint32_t time_s;
  // Where the machine stands.
  PkmPose_f32 pose;
  // Where the tip is.
  PkmPoint_f32 tip;
  // Load on the tip, its moment about the tip, in the axes of A-uvw.
  PkmWrench_f32 wrench;
  // How much warmer the machine is than at its zero reading by its sensors; 0 without sensors.
  float rise_k;
} PkmTouch_f32;

// One component of what was read.
typedef struct {
  // What is read: weights of the tip's translation along and of its rotation about u, v, w. A probe has a unit vector and no
  // rotation.
  float direction[6];
  // By how much the tip has moved since the zero reading, m or rad: by the load and, of a machine with `thermal-expansion`, by growth. Who
  // reads it loaded and unloaded and takes the difference leaves growth out, and gives 0 as the touch's `rise_k` and learns no
  // PKM_AMPLITUDE_RISE.
  float read;
  // Standard deviation of `read`, above 0.
  float deviation;
} PkmTipReading_f32;

// What a reading did.
typedef struct {
  // Chi squared of its components before they were taken in: their number, on average.
  float chi_squared;
  // Not 0 where an amplitude counts as unknown again from here on, because something has changed.
  int32_t changed[PKM_AMPLITUDES];
  // Where the pose stands to the table's box: outside of it, it is learned from what the table says by extrapolation.
  PkmDomain domain;
} PkmLearned_f32;

// Where and under which load the tool of the five axes is read.
typedef struct {
  // As `pkm_estimator_learn` takes it.
  PkmTouch_f32 touch;
  // Axes x, y, z of B in A-uvw: directions of readings along them, without rotation.
  float base_axes[3][3];
} PkmToolTouch_f32;

// How well a deflection of the tip is known, and how much of it is compensated for that reason.
typedef struct {
  // Expanded uncertainty of the tip's translation along u, v, w, coverage 95 % (k = 1.96).
  float u95_m[3];
  // 1 where the tip moves by more than its expanded uncertainty, else the share that its way is of that. A controller that
  // compensates the whole or nothing takes anything below 1 for nothing.
  float share;
} PkmKnown_f32;

// What a compensator asks for that compensates no more than is known.
typedef struct {
  // What it asks for.
  PkmOffset_f32 offset;
  // How well the deflection under the load that is compensated is known; zeros where `is_known` is 0.
  PkmKnown_f32 known;
  // Not 0: there is a deflection in this period. 0 when not enabled, outside the box unless its setting is to extrapolate, and with a fault of the model.
  int32_t is_known;
} PkmKnownOffset_f32;

// A cycle that compensates no more than is known.
typedef struct {
  // Its deflection is the whole; `compensated` makes up for the share that is known.
  PkmCycle_f64 cycle;
  // How well.
  PkmKnown_f64 known;
} PkmKnownCycle_f64;

// A cycle that compensates no more than is known.
typedef struct {
  // Its deflection is the whole; `compensated` makes up for the share that is known.
  PkmCycle_f32 cycle;
  // How well.
  PkmKnown_f32 known;
} PkmKnownCycle_f32;

// What is said of a table before its numbers.
typedef struct {
  // Checksum of the machine that it was fitted for, as `pkm_machine_checksum`.
  uint64_t machine;
  // Its own checksum, as the third assertion of its `coefficients.rs` states it.
  uint64_t table;
  // Number of terms, 1 to `PKM_TABLE_TERMS`.
  uint32_t terms;
  // Not 0: it has the factor form as well, which `pkm_table_receive` asks for.
  int32_t factor_form;
} PkmTableHeader;

// Looks through the table in service while the program runs, some numbers each period.
typedef struct {
  // What the table has to sum up to.
  uint64_t expected;
  // Of the numbers of this round.
  uint64_t sum;
  // How many they are.
  uint32_t next;
  // Not 0: found to be damaged, which stays so.
  uint32_t is_damaged;
} PkmTableWatch;

// What the five drives are told.
typedef struct {
  // Of the three screws.
  PkmLengths_f64 lengths;
  // Joints 1 and 2 of the wrist.
  double beta_rad[2];
} PkmJoints_f64;

// A tool's tip and the direction of its axis from flange to tip, in B-xyz: what a part program asks for.
typedef struct {
  // x, y, z of the tip.
  double tip_m[3];
  // Of length 1 where a function gives it, any length above 0 where one takes it.
  double axis[3];
} PkmTool_f64;

// Where joint values put the five axes and the tool.
typedef struct {
  // Of the five axes.
  PkmConfiguration_f64 configuration;
  // Of the tool.
  PkmTool_f64 tool;
} PkmToolPlace_f64;

// A solution of the five-axis inverse kinematics.
typedef struct {
  // Where the five axes stand.
  PkmConfiguration_f64 configuration;
  // What the drives are told.
  PkmJoints_f64 joints;
  // Distance from the singularity locus of the five axes: 1 in the home configuration, 0 on the locus.
  double normalised_determinant;
} PkmToolSolution_f64;

// A tool's tip, in B-xyz, and where the wrist's joints stand: what a part program in the axes X Y Z A B asks for.
typedef struct {
  // x, y, z of the tip.
  double tip_m[3];
  // Joints 1 and 2 of the wrist.
  double beta_rad[2];
} PkmTip_f64;

// What to command so that a loaded tool is where it should be.
typedef struct {
  // What to command, and where the five axes then would stand without the load.
  PkmToolSolution_f64 solution;
  // What the load moves the tip by there, along x, y, z of B.
  double translation_m[3];
  // What it turns the tool by, about x, y, z of B.
  double rotation_rad[3];
  // How far the loaded tool then is from where it should be, by the model: the tip's distance, and home's Z0 times the axis's, m.
  double remaining_m;
  // 1 where that is at most 1e-4 of the deflection, 0 where it is the best of too few tries.
  int32_t converged;
  // Where the commanded pose stands to the table's box.
  PkmDomain domain;
} PkmCompensatedTool_f64;

// How tip and axis of a tool move, along x, y, z of B. Of a tool that moves along its axis or stands still, the axis's rates are 0.
typedef struct {
  // Velocity of the tip.
  double tip_m_per_s[3];
  // First time derivative of the axis, of length 1: angular velocity × axis.
  double axis_per_s[3];
  // Acceleration of the tip.
  double tip_m_per_s2[3];
  // Second time derivative of the axis.
  double axis_per_s2[3];
} PkmToolMotion_f64;

// How the joints move: three screws in m/s and m/s², then the wrist in rad/s and rad/s².
typedef struct {
  // Of each joint.
  double velocity[5];
  // Of each joint.
  double acceleration[5];
} PkmJointMotion_f64;

// What the five drives are told.
typedef struct {
  // Of the three screws.
  PkmLengths_f32 lengths;
  // Joints 1 and 2 of the wrist.
  float beta_rad[2];
} PkmJoints_f32;

// A tool's tip and the direction of its axis from flange to tip, in B-xyz: what a part program asks for.
typedef struct {
  // x, y, z of the tip.
  float tip_m[3];
  // Of length 1 where a function gives it, any length above 0 where one takes it.
  float axis[3];
} PkmTool_f32;

// Where joint values put the five axes and the tool.
typedef struct {
  // Of the five axes.
  PkmConfiguration_f32 configuration;
  // Of the tool.
  PkmTool_f32 tool;
} PkmToolPlace_f32;

// A solution of the five-axis inverse kinematics.
typedef struct {
  // Where the five axes stand.
  PkmConfiguration_f32 configuration;
  // What the drives are told.
  PkmJoints_f32 joints;
  // Distance from the singularity locus of the five axes: 1 in the home configuration, 0 on the locus.
  float normalised_determinant;
} PkmToolSolution_f32;

// A tool's tip, in B-xyz, and where the wrist's joints stand: what a part program in the axes X Y Z A B asks for.
typedef struct {
  // x, y, z of the tip.
  float tip_m[3];
  // Joints 1 and 2 of the wrist.
  float beta_rad[2];
} PkmTip_f32;

// What to command so that a loaded tool is where it should be.
typedef struct {
  // What to command, and where the five axes then would stand without the load.
  PkmToolSolution_f32 solution;
  // What the load moves the tip by there, along x, y, z of B.
  float translation_m[3];
  // What it turns the tool by, about x, y, z of B.
  float rotation_rad[3];
  // How far the loaded tool then is from where it should be, by the model: the tip's distance, and home's Z0 times the axis's, m.
  float remaining_m;
  // 1 where that is at most 1e-4 of the deflection, 0 where it is the best of too few tries.
  int32_t converged;
  // Where the commanded pose stands to the table's box.
  PkmDomain domain;
} PkmCompensatedTool_f32;

// How tip and axis of a tool move, along x, y, z of B. Of a tool that moves along its axis or stands still, the axis's rates are 0.
typedef struct {
  // Velocity of the tip.
  float tip_m_per_s[3];
  // First time derivative of the axis, of length 1: angular velocity × axis.
  float axis_per_s[3];
  // Acceleration of the tip.
  float tip_m_per_s2[3];
  // Second time derivative of the axis.
  float axis_per_s2[3];
} PkmToolMotion_f32;

// How the joints move: three screws in m/s and m/s², then the wrist in rad/s and rad/s².
typedef struct {
  // Of each joint.
  float velocity[5];
  // Of each joint.
  float acceleration[5];
} PkmJointMotion_f32;

// The weight of something rigid: only what no force sensor shows.
typedef struct {
  // Mass times g, as a force along x, y, z of B; at most 1e5 N.
  double force_n[3];
  // Its centre of mass, at most 10 m away: of what is rigid with the platform in A-uvw; of what turns with the tool in the axes of the
  // tool, from its tip.
  double centre_m[3];
} PkmWeight_f64;

// The weight of something rigid: only what no force sensor shows.
typedef struct {
  // Mass times g, as a force along x, y, z of B; at most 1e5 N.
  float force_n[3];
  // Its centre of mass, at most 10 m away: of what is rigid with the platform in A-uvw; of what turns with the tool in the axes of the
  // tool, from its tip.
  float centre_m[3];
} PkmWeight_f32;





#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

// The compiled-in machine.
const PkmMachine_f64 *pkm_machine_f64(void);

// The compiled-in correction table.
const PkmTable_f64 *pkm_table_f64(void);

// The compiled-in wrist.
const PkmWrist_f64 *pkm_wrist_f64(void);

// Whether machine, wrist, table and its uncertainty are in memory as they were built: computes their checksums again from memory.
// Ask when the program starts.
//
// Errors: DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE, DAMAGED_UNCERTAINTY.
PKM_MUST_USE
PkmError pkm_verify_f64(void);

// Computes known poses of the reference machine, whatever machine the library has, and compares their bits. Finds a processor in
// another rounding mode, a broken floating-point unit, a compiler that reorders arithmetic. Ask when the program starts; it takes
// some 2 KB of stack more than the others, for the compensators that it runs.
//
// Errors: SELF_TEST_KINEMATICS, SELF_TEST_STIFFNESS, SELF_TEST_FIVE_AXES, SELF_TEST_COMPENSATOR.
PKM_MUST_USE
PkmError pkm_self_test_f64(void);

// Bytes that the library takes for a machine. A program that was compiled with the header of another version may
// give less room.
size_t pkm_machine_size_f64(void);

// The machine at a temperature in degrees Celsius, by its effect `thermal-modulus`; the same machine without
// it. Compute it when the temperature has changed, not in every cycle. `size` is the room for it: `sizeof *warm`.
//
// Errors: WRONG_SIZE, NOT_FINITE, NO_STIFFNESS.
PKM_MUST_USE
PkmError pkm_at_temperature_f64(const PkmMachine_f64 *machine,
                                double temperature_c,
                                PkmMachine_f64 *warm,
                                size_t size);

// Inverse kinematics: screw lengths of a pose.
//
// Errors: NOT_FINITE, UNREACHABLE, SINGULAR, OUT_OF_TRAVEL_LIMB1 to 3, in this order; called "those of a
// pose" below.
PKM_MUST_USE PkmError pkm_inverse_f64(const PkmMachine_f64 *machine, const PkmPose_f64 *pose, PkmLengths_f64 *lengths);

// Forward kinematics: the pose of screw lengths, in the working mode, in closed form.
//
// Errors: those of a pose in another order, since travel is looked at first: NOT_FINITE, OUT_OF_TRAVEL_LIMB1 to 3,
// UNREACHABLE, SINGULAR.
PKM_MUST_USE PkmError pkm_forward_f64(const PkmMachine_f64 *machine, const PkmLengths_f64 *lengths, PkmPose_f64 *pose);

// Derivatives of the screw lengths by the pose.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_jacobian_f64(const PkmMachine_f64 *machine,
                          const PkmPose_f64 *pose,
                          PkmJacobian_f64 *jacobian);

// How far a pose is from the direct singularities.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_singularity_distance_f64(const PkmMachine_f64 *machine,
                                      const PkmPose_f64 *pose,
                                      PkmSingularityDistance_f64 *distance);

// How far screw lengths are from the nearest end of travel.
//
// Errors: NOT_FINITE.
PKM_MUST_USE
PkmError pkm_travel_margin_f64(const PkmMachine_f64 *machine,
                               const PkmLengths_f64 *lengths,
                               PkmTravelMargin_f64 *margin);

// Basic stiffness K_p, without a table.
//
// Errors: those of a pose, NOT_POSITIVE_DEFINITE.
PKM_MUST_USE
PkmError pkm_stiffness_f64(const PkmMachine_f64 *machine,
                           const PkmPose_f64 *pose,
                           PkmStiffness_f64 *stiffness);

// Whether a pose lies in the box that the table was fitted on.
//
// Errors: NOT_FINITE.
PKM_MUST_USE PkmError pkm_domain_f64(const PkmTable_f64 *table, const PkmPose_f64 *pose, PkmDomain *domain);

// Corrected stiffness K_m, the table's factor form on the basic stiffness.
//
// Errors: those of a pose, NOT_POSITIVE_DEFINITE, NO_FACTOR_FORM, NOT_POSITIVE.
PKM_MUST_USE
PkmError pkm_corrected_stiffness_f64(const PkmMachine_f64 *machine,
                                     const PkmTable_f64 *table,
                                     const PkmPose_f64 *pose,
                                     PkmCorrected_f64 *corrected);

// Displacement of A under a load at A: that of K_m, and what the machine's load-dependent effects add.
// `turned_at` is the load at which the loading last turned back, for friction; null when it has only grown
// from zero. Outside the table's box it is computed all the same: ask `pkm_domain`.
//
// Errors: those of the corrected stiffness, NOT_FINITE, NOT_CONVERGED.
PKM_MUST_USE
PkmError pkm_deflection_f64(const PkmMachine_f64 *machine,
                            const PkmTable_f64 *table,
                            const PkmPose_f64 *pose,
                            const PkmWrench_f64 *wrench,
                            const PkmWrench_f64 *turned_at,
                            PkmDeflection_f64 *deflection);

// Displacement of A without load when the machine is warmer than at the zero reading, each limb and the platforms
// by their own `rise`, by its effect `thermal-expansion`; zero without it.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_thermal_deflection_f64(const PkmMachine_f64 *machine,
                                    const PkmPose_f64 *pose,
                                    const PkmTemperatureRise_f64 *rise,
                                    PkmDeflection_f64 *deflection);

// Pose and screw lengths to command so that the tip, displaced by `deflection` of A, stands where it would
// without. The tip's position is made up for, the orientation is not.
//
// Errors: those of a pose, for `pose` or for the one to command; NOT_COMPENSABLE.
PKM_MUST_USE
PkmError pkm_compensated_f64(const PkmMachine_f64 *machine,
                             const PkmPose_f64 *pose,
                             const PkmDeflection_f64 *deflection,
                             const PkmPoint_f64 *tip,
                             PkmCompensated_f64 *compensated);

// One cycle of a controller: screw lengths, deflection under a load on the tip (its moment about the tip, in
// the axes of A-uvw) that has only grown from zero, and the screw lengths that make up for it. The tip is given
// for the wrist as it stands; with one that turns use `pkm_tool_compensated`. No filter, no rate limit, the whole deflection: for a
// load that is computed, never for one that is measured, which takes a compensator.
//
// Outside the table's box (`domain`) all is computed all the same: a controller that may not extrapolate commands
// `lengths`, without compensation, or stops. On an error nothing is written: hold the last command, or ask
// `pkm_inverse` for the lengths without load.
//
// Errors: those of `pkm_deflection` and of `pkm_compensated`.
PKM_MUST_USE
PkmError pkm_cycle_f64(const PkmMachine_f64 *machine,
                       const PkmTable_f64 *table,
                       const PkmPose_f64 *pose,
                       const PkmWrench_f64 *wrench_at_tip,
                       const PkmPoint_f64 *tip,
                       PkmCycle_f64 *cycle);

// The compiled-in machine.
const PkmMachine_f32 *pkm_machine_f32(void);

// The compiled-in correction table.
const PkmTable_f32 *pkm_table_f32(void);

// The compiled-in wrist.
const PkmWrist_f32 *pkm_wrist_f32(void);

// Whether machine, wrist, table and its uncertainty are in memory as they were built: computes their checksums again from memory.
// Ask when the program starts.
//
// Errors: DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE, DAMAGED_UNCERTAINTY.
PKM_MUST_USE
PkmError pkm_verify_f32(void);

// Computes known poses of the reference machine, whatever machine the library has, and compares their bits. Finds a processor in
// another rounding mode, a broken floating-point unit, a compiler that reorders arithmetic. Ask when the program starts; it takes
// some 2 KB of stack more than the others, for the compensators that it runs.
//
// Errors: SELF_TEST_KINEMATICS, SELF_TEST_STIFFNESS, SELF_TEST_FIVE_AXES, SELF_TEST_COMPENSATOR.
PKM_MUST_USE
PkmError pkm_self_test_f32(void);

// Bytes that the library takes for a machine. A program that was compiled with the header of another version may
// give less room.
size_t pkm_machine_size_f32(void);

// The machine at a temperature in degrees Celsius, by its effect `thermal-modulus`; the same machine without
// it. Compute it when the temperature has changed, not in every cycle. `size` is the room for it: `sizeof *warm`.
//
// Errors: WRONG_SIZE, NOT_FINITE, NO_STIFFNESS.
PKM_MUST_USE
PkmError pkm_at_temperature_f32(const PkmMachine_f32 *machine,
                                float temperature_c,
                                PkmMachine_f32 *warm,
                                size_t size);

// Inverse kinematics: screw lengths of a pose.
//
// Errors: NOT_FINITE, UNREACHABLE, SINGULAR, OUT_OF_TRAVEL_LIMB1 to 3, in this order; called "those of a
// pose" below.
PKM_MUST_USE PkmError pkm_inverse_f32(const PkmMachine_f32 *machine, const PkmPose_f32 *pose, PkmLengths_f32 *lengths);

// Forward kinematics: the pose of screw lengths, in the working mode, in closed form.
//
// Errors: those of a pose in another order, since travel is looked at first: NOT_FINITE, OUT_OF_TRAVEL_LIMB1 to 3,
// UNREACHABLE, SINGULAR.
PKM_MUST_USE PkmError pkm_forward_f32(const PkmMachine_f32 *machine, const PkmLengths_f32 *lengths, PkmPose_f32 *pose);

// Derivatives of the screw lengths by the pose.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_jacobian_f32(const PkmMachine_f32 *machine,
                          const PkmPose_f32 *pose,
                          PkmJacobian_f32 *jacobian);

// How far a pose is from the direct singularities.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_singularity_distance_f32(const PkmMachine_f32 *machine,
                                      const PkmPose_f32 *pose,
                                      PkmSingularityDistance_f32 *distance);

// How far screw lengths are from the nearest end of travel.
//
// Errors: NOT_FINITE.
PKM_MUST_USE
PkmError pkm_travel_margin_f32(const PkmMachine_f32 *machine,
                               const PkmLengths_f32 *lengths,
                               PkmTravelMargin_f32 *margin);

// Basic stiffness K_p, without a table.
//
// Errors: those of a pose, NOT_POSITIVE_DEFINITE.
PKM_MUST_USE
PkmError pkm_stiffness_f32(const PkmMachine_f32 *machine,
                           const PkmPose_f32 *pose,
                           PkmStiffness_f32 *stiffness);

// Whether a pose lies in the box that the table was fitted on.
//
// Errors: NOT_FINITE.
PKM_MUST_USE PkmError pkm_domain_f32(const PkmTable_f32 *table, const PkmPose_f32 *pose, PkmDomain *domain);

// Corrected stiffness K_m, the table's factor form on the basic stiffness.
//
// Errors: those of a pose, NOT_POSITIVE_DEFINITE, NO_FACTOR_FORM, NOT_POSITIVE.
PKM_MUST_USE
PkmError pkm_corrected_stiffness_f32(const PkmMachine_f32 *machine,
                                     const PkmTable_f32 *table,
                                     const PkmPose_f32 *pose,
                                     PkmCorrected_f32 *corrected);

// Displacement of A under a load at A: that of K_m, and what the machine's load-dependent effects add.
// `turned_at` is the load at which the loading last turned back, for friction; null when it has only grown
// from zero. Outside the table's box it is computed all the same: ask `pkm_domain`.
//
// Errors: those of the corrected stiffness, NOT_FINITE, NOT_CONVERGED.
PKM_MUST_USE
PkmError pkm_deflection_f32(const PkmMachine_f32 *machine,
                            const PkmTable_f32 *table,
                            const PkmPose_f32 *pose,
                            const PkmWrench_f32 *wrench,
                            const PkmWrench_f32 *turned_at,
                            PkmDeflection_f32 *deflection);

// Displacement of A without load when the machine is warmer than at the zero reading, each limb and the platforms
// by their own `rise`, by its effect `thermal-expansion`; zero without it.
//
// Errors: those of a pose.
PKM_MUST_USE
PkmError pkm_thermal_deflection_f32(const PkmMachine_f32 *machine,
                                    const PkmPose_f32 *pose,
                                    const PkmTemperatureRise_f32 *rise,
                                    PkmDeflection_f32 *deflection);

// Pose and screw lengths to command so that the tip, displaced by `deflection` of A, stands where it would
// without. The tip's position is made up for, the orientation is not.
//
// Errors: those of a pose, for `pose` or for the one to command; NOT_COMPENSABLE.
PKM_MUST_USE
PkmError pkm_compensated_f32(const PkmMachine_f32 *machine,
                             const PkmPose_f32 *pose,
                             const PkmDeflection_f32 *deflection,
                             const PkmPoint_f32 *tip,
                             PkmCompensated_f32 *compensated);

// One cycle of a controller: screw lengths, deflection under a load on the tip (its moment about the tip, in
// the axes of A-uvw) that has only grown from zero, and the screw lengths that make up for it. The tip is given
// for the wrist as it stands; with one that turns use `pkm_tool_compensated`. No filter, no rate limit, the whole deflection: for a
// load that is computed, never for one that is measured, which takes a compensator.
//
// Outside the table's box (`domain`) all is computed all the same: a controller that may not extrapolate commands
// `lengths`, without compensation, or stops. On an error nothing is written: hold the last command, or ask
// `pkm_inverse` for the lengths without load.
//
// Errors: those of `pkm_deflection` and of `pkm_compensated`.
PKM_MUST_USE
PkmError pkm_cycle_f32(const PkmMachine_f32 *machine,
                       const PkmTable_f32 *table,
                       const PkmPose_f32 *pose,
                       const PkmWrench_f32 *wrench_at_tip,
                       const PkmPoint_f32 *tip,
                       PkmCycle_f32 *cycle);

// Writes the default settings. `size` is the room for them: `sizeof *settings`.
//
// Errors: WRONG_SIZE.
PKM_MUST_USE PkmError pkm_compensator_defaults(PkmCompensatorSettings *settings, size_t size);

// Name of the first setting that is out of its range, or "settings_size" when that is not the library's; null when all are
// within, or when there are none.
const char *pkm_compensator_setting_out_of_range(const PkmCompensatorSettings *settings,
                                                 size_t settings_size);

// Bytes that a compensator takes.
size_t pkm_compensator_size_f64(void);

// A compensator's address is a multiple of this.
size_t pkm_compensator_align_f64(void);

// Makes a compensator without an offset in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied. The
// library must have the machine, wrist and table of `built_for`, undamaged: a table of another machine would move
// this one.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, OTHER_WRIST, OTHER_TABLE, DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE,
// SETTING_OUT_OF_RANGE: `pkm_compensator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_compensator_init_f64(PkmCompensator_f64 *compensator,
                                  size_t size,
                                  const PkmCompensatorSettings *settings,
                                  size_t settings_size,
                                  const PkmChecksums *built_for);

// Back to no offset and no load at once; a weight and its reference stay as they were set. The offset steps: for drives that are off. To take it
// away from drives that are on, update with `enabled` at 0.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_reset_f64(PkmCompensator_f64 *compensator);

// Bytes that a compensator takes.
size_t pkm_tool_compensator_size_f64(void);

// A compensator's address is a multiple of this.
size_t pkm_tool_compensator_align_f64(void);

// Makes a compensator without an offset in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied. The
// library must have the machine, wrist and table of `built_for`, undamaged: a table of another machine would move
// this one.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, OTHER_WRIST, OTHER_TABLE, DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE,
// SETTING_OUT_OF_RANGE: `pkm_compensator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_tool_compensator_init_f64(PkmToolCompensator_f64 *compensator,
                                       size_t size,
                                       const PkmCompensatorSettings *settings,
                                       size_t settings_size,
                                       const PkmChecksums *built_for);

// Back to no offset and no load at once; a weight and its reference stay as they were set. The offset steps: for drives that are off. To take it
// away from drives that are on, update with `enabled` at 0.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_reset_f64(PkmToolCompensator_f64 *compensator);

// A period of a compensator for the three screws, with a tip that is rigid with the moving platform. `machine` is at its
// temperature; `pose` is where it should stand without the compensation. What is wrong with pose or reading is a fault
// of the offset, and no error: the offset is always written, and to be commanded. `size` is the room for it:
// `sizeof *offset`.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_f64(PkmCompensator_f64 *compensator,
                                    const PkmMachine_f64 *machine,
                                    const PkmTable_f64 *table,
                                    const PkmPose_f64 *pose,
                                    const PkmPoint_f64 *tip,
                                    const PkmReading_f64 *reading,
                                    PkmOffset_f64 *offset,
                                    size_t size);

// A period of a compensator for all five axes: tip and axis of the tool are compensated. `configuration` is where the
// axes should stand without the compensation; the rest is as for three screws.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_f64(PkmToolCompensator_f64 *compensator,
                                         const PkmMachine_f64 *machine,
                                         const PkmTable_f64 *table,
                                         const PkmWrist_f64 *wrist,
                                         const PkmConfiguration_f64 *configuration,
                                         const PkmReading_f64 *reading,
                                         PkmOffset_f64 *offset,
                                         size_t size);

// Bytes that a compensator takes.
size_t pkm_compensator_size_f32(void);

// A compensator's address is a multiple of this.
size_t pkm_compensator_align_f32(void);

// Makes a compensator without an offset in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied. The
// library must have the machine, wrist and table of `built_for`, undamaged: a table of another machine would move
// this one.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, OTHER_WRIST, OTHER_TABLE, DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE,
// SETTING_OUT_OF_RANGE: `pkm_compensator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_compensator_init_f32(PkmCompensator_f32 *compensator,
                                  size_t size,
                                  const PkmCompensatorSettings *settings,
                                  size_t settings_size,
                                  const PkmChecksums *built_for);

// Back to no offset and no load at once; a weight and its reference stay as they were set. The offset steps: for drives that are off. To take it
// away from drives that are on, update with `enabled` at 0.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_reset_f32(PkmCompensator_f32 *compensator);

// Bytes that a compensator takes.
size_t pkm_tool_compensator_size_f32(void);

// A compensator's address is a multiple of this.
size_t pkm_tool_compensator_align_f32(void);

// Makes a compensator without an offset in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied. The
// library must have the machine, wrist and table of `built_for`, undamaged: a table of another machine would move
// this one.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, OTHER_WRIST, OTHER_TABLE, DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE,
// SETTING_OUT_OF_RANGE: `pkm_compensator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_tool_compensator_init_f32(PkmToolCompensator_f32 *compensator,
                                       size_t size,
                                       const PkmCompensatorSettings *settings,
                                       size_t settings_size,
                                       const PkmChecksums *built_for);

// Back to no offset and no load at once; a weight and its reference stay as they were set. The offset steps: for drives that are off. To take it
// away from drives that are on, update with `enabled` at 0.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_reset_f32(PkmToolCompensator_f32 *compensator);

// A period of a compensator for the three screws, with a tip that is rigid with the moving platform. `machine` is at its
// temperature; `pose` is where it should stand without the compensation. What is wrong with pose or reading is a fault
// of the offset, and no error: the offset is always written, and to be commanded. `size` is the room for it:
// `sizeof *offset`.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_f32(PkmCompensator_f32 *compensator,
                                    const PkmMachine_f32 *machine,
                                    const PkmTable_f32 *table,
                                    const PkmPose_f32 *pose,
                                    const PkmPoint_f32 *tip,
                                    const PkmReading_f32 *reading,
                                    PkmOffset_f32 *offset,
                                    size_t size);

// A period of a compensator for all five axes: tip and axis of the tool are compensated. `configuration` is where the
// axes should stand without the compensation; the rest is as for three screws.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_f32(PkmToolCompensator_f32 *compensator,
                                         const PkmMachine_f32 *machine,
                                         const PkmTable_f32 *table,
                                         const PkmWrist_f32 *wrist,
                                         const PkmConfiguration_f32 *configuration,
                                         const PkmReading_f32 *reading,
                                         PkmOffset_f32 *offset,
                                         size_t size);

// What a number of `PkmError` means, in English; never null, also for a number that is none.
const char *pkm_error_text(int32_t error);

// Name of the first setting of an estimator that is out of its range, or "settings_size" when that is not the library's; null when
// all are within, or when there are none. The number of its amplitude, from 1, goes to `amplitude` unless that is null: 0 of a setting
// that is none's.
const char *pkm_estimator_setting_out_of_range(const PkmEstimatorSettings *settings,
                                               size_t settings_size,
                                               uint32_t *amplitude);

// Bytes of the saved state of so many amplitudes; the same of both number types.
size_t pkm_estimator_state_bytes(uint32_t count);

// Which of two slots, of `size` bytes each, holds the newest whole state of so many amplitudes.
//
// Errors: SETTING_OUT_OF_RANGE: not 1 to `PKM_AMPLITUDES` amplitudes. WRONG_SIZE: the slots are shorter than `pkm_estimator_state_bytes`. STATE_NOT_WHOLE: in neither. Nothing was saved, or both are damaged: begin with the first and sequence number 1.
PKM_MUST_USE
PkmError pkm_estimator_newest(uint32_t count,
                              const uint8_t *first,
                              const uint8_t *second,
                              size_t size,
                              PkmNewest *found);

// Bytes that an estimator takes.
size_t pkm_estimator_size_f64(void);

// An estimator's address is a multiple of this.
size_t pkm_estimator_align_f64(void);

// Makes an estimator that has read nothing in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied.
//
// Errors: WRONG_SIZE, SETTING_OUT_OF_RANGE: `pkm_estimator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_estimator_init_f64(PkmEstimator_f64 *estimator,
                                size_t size,
                                const PkmEstimatorSettings *settings,
                                size_t settings_size);

// Takes a reading of one to six components in. `machine` is at its temperature. It takes about as long as a cycle. On an
// error no amplitude has moved.
//
// Errors: NOT_INITIALISED, those of `pkm_corrected_stiffness`, NOT_FINITE (also of a deviation that is not above 0),
// READING_COMPONENTS, READING_BACKWARDS, READING_NOT_EXCITED, READING_STUCK, READING_WRONG_SIGN, READING_UNEXPECTED.
PKM_MUST_USE
PkmError pkm_estimator_learn_f64(PkmEstimator_f64 *estimator,
                                 const PkmMachine_f64 *machine,
                                 const PkmTable_f64 *table,
                                 const PkmTouch_f64 *touch,
                                 const PkmTipReading_f64 *readings,
                                 size_t count,
                                 PkmLearned_f64 *learned);

// Where and under which load the tool of the five axes is read: `wrench` is on the tool at its tip, in the tool's own axes, as a
// reading of a compensator has it; time and rise are as in a `PkmTouch`.
//
// Errors: those of `pkm_tool_forward`.
PKM_MUST_USE
PkmError pkm_tool_touch_f64(const PkmMachine_f64 *machine,
                            const PkmWrist_f64 *wrist,
                            const PkmConfiguration_f64 *configuration,
                            const PkmWrench_f64 *wrench,
                            uint32_t time_s,
                            double rise_k,
                            PkmToolTouch_f64 *touch);

// A period of the compensation: what it uses goes to what is worth compensating, at most at the rates of the settings.
//
// Errors: NOT_INITIALISED, NOT_FINITE, also where the period is below 0.
PKM_MUST_USE PkmError pkm_estimator_follow_f64(PkmEstimator_f64 *estimator, double period_s);

// What it knows, and alarms. `size` is the room for it: `sizeof *state`.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_estimator_state_f64(const PkmEstimator_f64 *estimator, PkmEstimatorState *state, size_t size);

// Writes what it knows beyond `table`, with which it has learned, into a slot of `size` bytes, at least
// `pkm_estimator_state_bytes`. A controller keeps two slots in memory that stays and writes over the older one, as
// `pkm_estimator_newest` says: a cut at any byte leaves the newer. `sequence` is one more than that of the last save. Nothing is
// written on an error.
//
// Errors: NOT_INITIALISED, WRONG_SIZE.
PKM_MUST_USE
PkmError pkm_estimator_save_f64(const PkmEstimator_f64 *estimator,
                                const PkmTable_f64 *table,
                                uint32_t sequence,
                                uint8_t *slot,
                                size_t size);

// Goes on from what was saved in a slot of `size` bytes, the newest of two, with `table` in service. On an error nothing has
// changed. What was learned beyond another table, or on another machine, is refused: this table may have it already. For that
// reason begin anew where a table of `pkm_table_receive` comes into service. After a start `pkm_table` is in service again, or
// what was received first: restore with that.
//
// Errors: NOT_INITIALISED, WRONG_SIZE, STATE_NOT_WHOLE, OTHER_STATE.
PKM_MUST_USE
PkmError pkm_estimator_restore_f64(PkmEstimator_f64 *estimator,
                                   const PkmTable_f64 *table,
                                   const uint8_t *slot,
                                   size_t size);

// `pkm_compensator_update` with what was learned, which has taken its `pkm_estimator_follow` of the period. No more is
// compensated than is known: by the estimator, and by `uncertainty`, that of the table, unless it is null.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_learned_f64(PkmCompensator_f64 *compensator,
                                            const PkmMachine_f64 *machine,
                                            const PkmTable_f64 *table,
                                            const PkmTableUncertainty_f64 *uncertainty,
                                            const PkmEstimator_f64 *estimator,
                                            const PkmPose_f64 *pose,
                                            const PkmPoint_f64 *tip,
                                            const PkmReading_f64 *reading,
                                            PkmKnownOffset_f64 *offset,
                                            size_t size);

// The same for all five axes: `pkm_tool_compensator_update` with what was learned.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_learned_f64(PkmToolCompensator_f64 *compensator,
                                                 const PkmMachine_f64 *machine,
                                                 const PkmTable_f64 *table,
                                                 const PkmTableUncertainty_f64 *uncertainty,
                                                 const PkmEstimator_f64 *estimator,
                                                 const PkmWrist_f64 *wrist,
                                                 const PkmConfiguration_f64 *configuration,
                                                 const PkmReading_f64 *reading,
                                                 PkmKnownOffset_f64 *offset,
                                                 size_t size);

// Bytes that an estimator takes.
size_t pkm_estimator_size_f32(void);

// An estimator's address is a multiple of this.
size_t pkm_estimator_align_f32(void);

// Makes an estimator that has read nothing in memory of the caller: of at least as many bytes, `size`, and of the alignment
// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied.
//
// Errors: WRONG_SIZE, SETTING_OUT_OF_RANGE: `pkm_estimator_setting_out_of_range` names it.
PKM_MUST_USE
PkmError pkm_estimator_init_f32(PkmEstimator_f32 *estimator,
                                size_t size,
                                const PkmEstimatorSettings *settings,
                                size_t settings_size);

// Takes a reading of one to six components in. `machine` is at its temperature. It takes about as long as a cycle. On an
// error no amplitude has moved.
//
// Errors: NOT_INITIALISED, those of `pkm_corrected_stiffness`, NOT_FINITE (also of a deviation that is not above 0),
// READING_COMPONENTS, READING_BACKWARDS, READING_NOT_EXCITED, READING_STUCK, READING_WRONG_SIGN, READING_UNEXPECTED.
PKM_MUST_USE
PkmError pkm_estimator_learn_f32(PkmEstimator_f32 *estimator,
                                 const PkmMachine_f32 *machine,
                                 const PkmTable_f32 *table,
                                 const PkmTouch_f32 *touch,
                                 const PkmTipReading_f32 *readings,
                                 size_t count,
                                 PkmLearned_f32 *learned);

// Where and under which load the tool of the five axes is read: `wrench` is on the tool at its tip, in the tool's own axes, as a
// reading of a compensator has it; time and rise are as in a `PkmTouch`.
//
// Errors: those of `pkm_tool_forward`.
PKM_MUST_USE
PkmError pkm_tool_touch_f32(const PkmMachine_f32 *machine,
                            const PkmWrist_f32 *wrist,
                            const PkmConfiguration_f32 *configuration,
                            const PkmWrench_f32 *wrench,
                            uint32_t time_s,
                            float rise_k,
                            PkmToolTouch_f32 *touch);

// A period of the compensation: what it uses goes to what is worth compensating, at most at the rates of the settings.
//
// Errors: NOT_INITIALISED, NOT_FINITE, also where the period is below 0.
PKM_MUST_USE PkmError pkm_estimator_follow_f32(PkmEstimator_f32 *estimator, float period_s);

// What it knows, and alarms. `size` is the room for it: `sizeof *state`.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_estimator_state_f32(const PkmEstimator_f32 *estimator, PkmEstimatorState *state, size_t size);

// Writes what it knows beyond `table`, with which it has learned, into a slot of `size` bytes, at least
// `pkm_estimator_state_bytes`. A controller keeps two slots in memory that stays and writes over the older one, as
// `pkm_estimator_newest` says: a cut at any byte leaves the newer. `sequence` is one more than that of the last save. Nothing is
// written on an error.
//
// Errors: NOT_INITIALISED, WRONG_SIZE.
PKM_MUST_USE
PkmError pkm_estimator_save_f32(const PkmEstimator_f32 *estimator,
                                const PkmTable_f32 *table,
                                uint32_t sequence,
                                uint8_t *slot,
                                size_t size);

// Goes on from what was saved in a slot of `size` bytes, the newest of two, with `table` in service. On an error nothing has
// changed. What was learned beyond another table, or on another machine, is refused: this table may have it already. For that
// reason begin anew where a table of `pkm_table_receive` comes into service. After a start `pkm_table` is in service again, or
// what was received first: restore with that.
//
// Errors: NOT_INITIALISED, WRONG_SIZE, STATE_NOT_WHOLE, OTHER_STATE.
PKM_MUST_USE
PkmError pkm_estimator_restore_f32(PkmEstimator_f32 *estimator,
                                   const PkmTable_f32 *table,
                                   const uint8_t *slot,
                                   size_t size);

// `pkm_compensator_update` with what was learned, which has taken its `pkm_estimator_follow` of the period. No more is
// compensated than is known: by the estimator, and by `uncertainty`, that of the table, unless it is null.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_learned_f32(PkmCompensator_f32 *compensator,
                                            const PkmMachine_f32 *machine,
                                            const PkmTable_f32 *table,
                                            const PkmTableUncertainty_f32 *uncertainty,
                                            const PkmEstimator_f32 *estimator,
                                            const PkmPose_f32 *pose,
                                            const PkmPoint_f32 *tip,
                                            const PkmReading_f32 *reading,
                                            PkmKnownOffset_f32 *offset,
                                            size_t size);

// The same for all five axes: `pkm_tool_compensator_update` with what was learned.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_learned_f32(PkmToolCompensator_f32 *compensator,
                                                 const PkmMachine_f32 *machine,
                                                 const PkmTable_f32 *table,
                                                 const PkmTableUncertainty_f32 *uncertainty,
                                                 const PkmEstimator_f32 *estimator,
                                                 const PkmWrist_f32 *wrist,
                                                 const PkmConfiguration_f32 *configuration,
                                                 const PkmReading_f32 *reading,
                                                 PkmKnownOffset_f32 *offset,
                                                 size_t size);

// Version of the library. A library goes with the header of its version, `PKM_VERSION`: compare them when the program starts.
const char *pkm_version(void);

// Checksum of the compiled-in machine, as its `coefficients.rs` states it (`checksum() == 0x...`). Compare it, the
// wrist's and the table's when the program starts: a library that was built without PKM_COEFFICIENTS has the reference
// machine.
uint64_t pkm_machine_checksum(void);

// Checksum of the compiled-in wrist, as its `coefficients.rs` states it: the machine's does not cover it.
uint64_t pkm_wrist_checksum(void);

// Checksum of the compiled-in table, as its `coefficients.rs` and `coefficients.json` state it.
uint64_t pkm_table_checksum(void);

// How far the compiled-in table may be off; null when its `coefficients.rs` does not say.
const PkmTableUncertainty_f64 *pkm_table_uncertainty_f64(void);

// `pkm_cycle` with the uncertainty of the tip's deflection, of which as much is compensated as is known. `uncertainty` is
// that of the table.
//
// Errors: those of `pkm_cycle`; NOT_FINITE also of an uncertainty that overflows.
PKM_MUST_USE
PkmError pkm_cycle_known_f64(const PkmMachine_f64 *machine,
                             const PkmTable_f64 *table,
                             const PkmTableUncertainty_f64 *uncertainty,
                             const PkmPose_f64 *pose,
                             const PkmWrench_f64 *wrench_at_tip,
                             const PkmPoint_f64 *tip,
                             PkmKnownCycle_f64 *known);

// `pkm_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_known_f64(PkmCompensator_f64 *compensator,
                                          const PkmMachine_f64 *machine,
                                          const PkmTable_f64 *table,
                                          const PkmTableUncertainty_f64 *uncertainty,
                                          const PkmPose_f64 *pose,
                                          const PkmPoint_f64 *tip,
                                          const PkmReading_f64 *reading,
                                          PkmKnownOffset_f64 *offset,
                                          size_t size);

// `pkm_tool_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_known_f64(PkmToolCompensator_f64 *compensator,
                                               const PkmMachine_f64 *machine,
                                               const PkmTable_f64 *table,
                                               const PkmTableUncertainty_f64 *uncertainty,
                                               const PkmWrist_f64 *wrist,
                                               const PkmConfiguration_f64 *configuration,
                                               const PkmReading_f64 *reading,
                                               PkmKnownOffset_f64 *offset,
                                               size_t size);

// How far the compiled-in table may be off; null when its `coefficients.rs` does not say.
const PkmTableUncertainty_f32 *pkm_table_uncertainty_f32(void);

// `pkm_cycle` with the uncertainty of the tip's deflection, of which as much is compensated as is known. `uncertainty` is
// that of the table.
//
// Errors: those of `pkm_cycle`; NOT_FINITE also of an uncertainty that overflows.
PKM_MUST_USE
PkmError pkm_cycle_known_f32(const PkmMachine_f32 *machine,
                             const PkmTable_f32 *table,
                             const PkmTableUncertainty_f32 *uncertainty,
                             const PkmPose_f32 *pose,
                             const PkmWrench_f32 *wrench_at_tip,
                             const PkmPoint_f32 *tip,
                             PkmKnownCycle_f32 *known);

// `pkm_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_compensator_update_known_f32(PkmCompensator_f32 *compensator,
                                          const PkmMachine_f32 *machine,
                                          const PkmTable_f32 *table,
                                          const PkmTableUncertainty_f32 *uncertainty,
                                          const PkmPose_f32 *pose,
                                          const PkmPoint_f32 *tip,
                                          const PkmReading_f32 *reading,
                                          PkmKnownOffset_f32 *offset,
                                          size_t size);

// `pkm_tool_compensator_update` that compensates no more than is known. `uncertainty` is that of the table.
//
// Errors: WRONG_SIZE, NOT_INITIALISED.
PKM_MUST_USE
PkmError pkm_tool_compensator_update_known_f32(PkmToolCompensator_f32 *compensator,
                                               const PkmMachine_f32 *machine,
                                               const PkmTable_f32 *table,
                                               const PkmTableUncertainty_f32 *uncertainty,
                                               const PkmWrist_f32 *wrist,
                                               const PkmConfiguration_f32 *configuration,
                                               const PkmReading_f32 *reading,
                                               PkmKnownOffset_f32 *offset,
                                               size_t size);

// Bytes that a buffer for a table takes.
size_t pkm_table_buffer_size_f64(void);

// A buffer's address is a multiple of this.
size_t pkm_table_buffer_align_f64(void);

// Makes a table of `count` numbers in memory of the caller, of at least as many bytes, `size`, and of the alignment that the
// functions above say, and gives its address, which is within that memory. The numbers, in double for float as well:
// centre and half width of the box (theta, sigma in rad, z0 in m), three exponents a term, six rows of the diagonal
// form of one coefficient a term and 21 of the factor form, as they stand in `coefficients.rs`. They are copied, so that
// their memory, which is apart from the buffer, may go.
//
// The table lasts until its buffer is written, moved or freed. To change tables while a machine runs take two buffers: fill
// the one that is not in use, in any thread, and let the controller take the new address between two periods. The other
// buffer may be filled when the first period with the new address has begun and no other thread uses the old one: nothing
// in the library keeps it. A compensator goes to the new table at its rate limit; without one the command steps.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, DAMAGED_TABLE (the numbers have another checksum, or the memory does not keep
// them), NOT_A_TABLE, NO_FACTOR_FORM (the library needs it). The table that was in the buffer must not be used any more then.
PKM_MUST_USE
PkmError pkm_table_receive_f64(PkmTableBuffer_f64 *buffer,
                               size_t size,
                               const PkmTableHeader *header,
                               const double *numbers,
                               size_t count,
                               const PkmTable_f64 **table);

// Begins to watch a table, as it is in memory now: after `pkm_verify`, or when it has come. Outside of the periods; it goes
// through all of the table.
//
// Errors: NULL_POINTER, MISALIGNED, no others.
PKM_MUST_USE
PkmError pkm_table_watch_begin_f64(PkmTableWatch *watch,
                                   const PkmTable_f64 *table);

// Looks at the next eight numbers of the table that the period uses. A bit that flips in a table of n numbers, 6 + 30 for each
// term, is found within 2 (n / 8 + 1) periods, n / 8 rounded down: at the end of the next round where this one has passed it.
// Compensate no more then: a compensator whose reading is not `enabled` takes its offset back at its rate.
//
// Errors: DAMAGED_TABLE, from then on.
PKM_MUST_USE
PkmError pkm_table_watch_f64(PkmTableWatch *watch,
                             const PkmTable_f64 *table);

// Bytes that a buffer for a table takes.
size_t pkm_table_buffer_size_f32(void);

// A buffer's address is a multiple of this.
size_t pkm_table_buffer_align_f32(void);

// Makes a table of `count` numbers in memory of the caller, of at least as many bytes, `size`, and of the alignment that the
// functions above say, and gives its address, which is within that memory. The numbers, in double for float as well:
// centre and half width of the box (theta, sigma in rad, z0 in m), three exponents a term, six rows of the diagonal
// form of one coefficient a term and 21 of the factor form, as they stand in `coefficients.rs`. They are copied, so that
// their memory, which is apart from the buffer, may go.
//
// The table lasts until its buffer is written, moved or freed. To change tables while a machine runs take two buffers: fill
// the one that is not in use, in any thread, and let the controller take the new address between two periods. The other
// buffer may be filled when the first period with the new address has begun and no other thread uses the old one: nothing
// in the library keeps it. A compensator goes to the new table at its rate limit; without one the command steps.
//
// Errors: WRONG_SIZE, OTHER_MACHINE, DAMAGED_TABLE (the numbers have another checksum, or the memory does not keep
// them), NOT_A_TABLE, NO_FACTOR_FORM (the library needs it). The table that was in the buffer must not be used any more then.
PKM_MUST_USE
PkmError pkm_table_receive_f32(PkmTableBuffer_f32 *buffer,
                               size_t size,
                               const PkmTableHeader *header,
                               const double *numbers,
                               size_t count,
                               const PkmTable_f32 **table);

// Begins to watch a table, as it is in memory now: after `pkm_verify`, or when it has come. Outside of the periods; it goes
// through all of the table.
//
// Errors: NULL_POINTER, MISALIGNED, no others.
PKM_MUST_USE
PkmError pkm_table_watch_begin_f32(PkmTableWatch *watch,
                                   const PkmTable_f32 *table);

// Looks at the next eight numbers of the table that the period uses. A bit that flips in a table of n numbers, 6 + 30 for each
// term, is found within 2 (n / 8 + 1) periods, n / 8 rounded down: at the end of the next round where this one has passed it.
// Compensate no more then: a compensator whose reading is not `enabled` takes its offset back at its rate.
//
// Errors: DAMAGED_TABLE, from then on.
PKM_MUST_USE
PkmError pkm_table_watch_f32(PkmTableWatch *watch,
                             const PkmTable_f32 *table);

// Forward kinematics of the five axes: configuration, tip and axis of joint values.
//
// Errors: those of `pkm_forward`, then NOT_FINITE of the wrist's angles, WRIST_LIMIT1, WRIST_LIMIT2.
PKM_MUST_USE
PkmError pkm_tool_forward_f64(const PkmMachine_f64 *machine,
                              const PkmWrist_f64 *wrist,
                              const PkmJoints_f64 *joints,
                              PkmToolPlace_f64 *place);

// Inverse kinematics of the five axes: the configuration for a tool, on the same side of the singularity locus
// as `near`, the last configuration of the path. At its start `near` is the `configuration` that
// `pkm_tool_forward` gives for the measured joints; one of zeros is none (Z0 is above 0), and TOOL_UNREACHABLE.
//
// Errors: NOT_FINITE, TOOL_SINGULAR, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2.
PKM_MUST_USE
PkmError pkm_tool_inverse_f64(const PkmMachine_f64 *machine,
                              const PkmWrist_f64 *wrist,
                              const PkmTool_f64 *tool,
                              const PkmConfiguration_f64 *near,
                              PkmToolSolution_f64 *solution);

// Inverse kinematics of the five axes with the wrist's joints at given angles: what a controller needs whose axes
// are the tip's position and these angles. In closed form, and without a configuration to begin from.
//
// Errors: NOT_FINITE, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
PKM_MUST_USE
PkmError pkm_tip_inverse_f64(const PkmMachine_f64 *machine,
                             const PkmWrist_f64 *wrist,
                             const PkmTip_f64 *tip,
                             PkmToolSolution_f64 *solution);

// The same, also where the machine is nearer to the singularity locus than the wrist's margin, on the side of home: for a
// controller that drives a machine out of there. `normalised_determinant` of the result says how near it is.
//
// Errors: those of `pkm_tip_inverse`; TOOL_SINGULAR only on the locus and beyond it.
PKM_MUST_USE
PkmError pkm_tip_inverse_any_margin_f64(const PkmMachine_f64 *machine,
                                        const PkmWrist_f64 *wrist,
                                        const PkmTip_f64 *tip,
                                        PkmToolSolution_f64 *solution);

// What to command so that a loaded tool stands where `tool` asks, tip and axis. The load acts on the tool at
// its tip, in the axes of T_h. No filter, no rate limit, the whole deflection: for a load that is computed, never for one that is
// measured, which takes a compensator. `near` is as for
// `pkm_tool_inverse`, and no further from the tool than a period's step: this takes a bounded number of instructions. Where
// they do not do, it gives the best that it found, with what remains and `converged` 0. `domain` is that of the
// pose to command.
//
// Errors: those of the inverse kinematics and of `pkm_deflection`, on the way as at its end.
PKM_MUST_USE
PkmError pkm_tool_compensated_f64(const PkmMachine_f64 *machine,
                                  const PkmTable_f64 *table,
                                  const PkmWrist_f64 *wrist,
                                  const PkmTool_f64 *tool,
                                  const PkmWrench_f64 *wrench,
                                  const PkmConfiguration_f64 *near,
                                  PkmCompensatedTool_f64 *compensated);

// Velocities and accelerations of the joints that move the tool as asked, in closed form.
//
// Errors: NOT_FINITE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
PKM_MUST_USE
PkmError pkm_joint_motion_f64(const PkmMachine_f64 *machine,
                              const PkmWrist_f64 *wrist,
                              const PkmConfiguration_f64 *configuration,
                              const PkmToolMotion_f64 *motion,
                              PkmJointMotion_f64 *joints);

// The greatest share, at most 1, of the feed at which no joint exceeds `limits`, greatest sizes for each, on the same curve at a
// steady feed. 0 where a number is NaN, or a joint moves whose limit is 0.
//
// Errors: none but those of the pointers.
PKM_MUST_USE
PkmError pkm_feed_share_f64(const PkmJointMotion_f64 *joints,
                            const PkmJointMotion_f64 *limits,
                            double *share);

// Forward kinematics of the five axes: configuration, tip and axis of joint values.
//
// Errors: those of `pkm_forward`, then NOT_FINITE of the wrist's angles, WRIST_LIMIT1, WRIST_LIMIT2.
PKM_MUST_USE
PkmError pkm_tool_forward_f32(const PkmMachine_f32 *machine,
                              const PkmWrist_f32 *wrist,
                              const PkmJoints_f32 *joints,
                              PkmToolPlace_f32 *place);

// Inverse kinematics of the five axes: the configuration for a tool, on the same side of the singularity locus
// as `near`, the last configuration of the path. At its start `near` is the `configuration` that
// `pkm_tool_forward` gives for the measured joints; one of zeros is none (Z0 is above 0), and TOOL_UNREACHABLE.
//
// Errors: NOT_FINITE, TOOL_SINGULAR, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2.
PKM_MUST_USE
PkmError pkm_tool_inverse_f32(const PkmMachine_f32 *machine,
                              const PkmWrist_f32 *wrist,
                              const PkmTool_f32 *tool,
                              const PkmConfiguration_f32 *near,
                              PkmToolSolution_f32 *solution);

// Inverse kinematics of the five axes with the wrist's joints at given angles: what a controller needs whose axes
// are the tip's position and these angles. In closed form, and without a configuration to begin from.
//
// Errors: NOT_FINITE, TOOL_UNREACHABLE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
PKM_MUST_USE
PkmError pkm_tip_inverse_f32(const PkmMachine_f32 *machine,
                             const PkmWrist_f32 *wrist,
                             const PkmTip_f32 *tip,
                             PkmToolSolution_f32 *solution);

// The same, also where the machine is nearer to the singularity locus than the wrist's margin, on the side of home: for a
// controller that drives a machine out of there. `normalised_determinant` of the result says how near it is.
//
// Errors: those of `pkm_tip_inverse`; TOOL_SINGULAR only on the locus and beyond it.
PKM_MUST_USE
PkmError pkm_tip_inverse_any_margin_f32(const PkmMachine_f32 *machine,
                                        const PkmWrist_f32 *wrist,
                                        const PkmTip_f32 *tip,
                                        PkmToolSolution_f32 *solution);

// What to command so that a loaded tool stands where `tool` asks, tip and axis. The load acts on the tool at
// its tip, in the axes of T_h. No filter, no rate limit, the whole deflection: for a load that is computed, never for one that is
// measured, which takes a compensator. `near` is as for
// `pkm_tool_inverse`, and no further from the tool than a period's step: this takes a bounded number of instructions. Where
// they do not do, it gives the best that it found, with what remains and `converged` 0. `domain` is that of the
// pose to command.
//
// Errors: those of the inverse kinematics and of `pkm_deflection`, on the way as at its end.
PKM_MUST_USE
PkmError pkm_tool_compensated_f32(const PkmMachine_f32 *machine,
                                  const PkmTable_f32 *table,
                                  const PkmWrist_f32 *wrist,
                                  const PkmTool_f32 *tool,
                                  const PkmWrench_f32 *wrench,
                                  const PkmConfiguration_f32 *near,
                                  PkmCompensatedTool_f32 *compensated);

// Velocities and accelerations of the joints that move the tool as asked, in closed form.
//
// Errors: NOT_FINITE, those of a pose, WRIST_LIMIT1, WRIST_LIMIT2, TOOL_SINGULAR.
PKM_MUST_USE
PkmError pkm_joint_motion_f32(const PkmMachine_f32 *machine,
                              const PkmWrist_f32 *wrist,
                              const PkmConfiguration_f32 *configuration,
                              const PkmToolMotion_f32 *motion,
                              PkmJointMotion_f32 *joints);

// The greatest share, at most 1, of the feed at which no joint exceeds `limits`, greatest sizes for each, on the same curve at a
// steady feed. 0 where a number is NaN, or a joint moves whose limit is 0.
//
// Errors: none but those of the pointers.
PKM_MUST_USE
PkmError pkm_feed_share_f32(const PkmJointMotion_f32 *joints,
                            const PkmJointMotion_f32 *limits,
                            float *share);

// What platform and tool weigh, for a compensator of the three screws. From now on it compensates what that does beyond what
// it did where the machine was zeroed, whole; the offset goes there at its rate limit. The reference is worked out with the
// machine, as warm as it was, and the table: set the weight again when another table comes. `zeroed_at` and `tip` are pose and tip of the
// zero. It takes the time of an update. With an error the weight stays what it was.
//
// Errors: NOT_INITIALISED, WEIGHT_NOT_FINITE, WEIGHT_TOO_HEAVY, WEIGHT_TOO_FAR, WEIGHT_NO_REFERENCE.
PKM_MUST_USE
PkmError pkm_compensator_set_weight_f64(PkmCompensator_f64 *compensator,
                                        const PkmMachine_f64 *machine,
                                        const PkmTable_f64 *table,
                                        const PkmWeight_f64 *weight,
                                        const PkmPose_f64 *zeroed_at,
                                        const PkmPoint_f64 *tip);

// No weight from now on, as after the init.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_compensator_clear_weight_f64(PkmCompensator_f64 *compensator);

// The same for the five axes: `platform` is what is rigid with the platform, `tool` what turns with the tool.
//
// Errors: those for three screws.
PKM_MUST_USE
PkmError pkm_tool_compensator_set_weight_f64(PkmToolCompensator_f64 *compensator,
                                             const PkmMachine_f64 *machine,
                                             const PkmTable_f64 *table,
                                             const PkmWrist_f64 *wrist,
                                             const PkmWeight_f64 *platform,
                                             const PkmWeight_f64 *tool,
                                             const PkmConfiguration_f64 *zeroed_at);

// No weight from now on, as after the init.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_tool_compensator_clear_weight_f64(PkmToolCompensator_f64 *compensator);

// What platform and tool weigh, for a compensator of the three screws. From now on it compensates what that does beyond what
// it did where the machine was zeroed, whole; the offset goes there at its rate limit. The reference is worked out with the
// machine, as warm as it was, and the table: set the weight again when another table comes. `zeroed_at` and `tip` are pose and tip of the
// zero. It takes the time of an update. With an error the weight stays what it was.
//
// Errors: NOT_INITIALISED, WEIGHT_NOT_FINITE, WEIGHT_TOO_HEAVY, WEIGHT_TOO_FAR, WEIGHT_NO_REFERENCE.
PKM_MUST_USE
PkmError pkm_compensator_set_weight_f32(PkmCompensator_f32 *compensator,
                                        const PkmMachine_f32 *machine,
                                        const PkmTable_f32 *table,
                                        const PkmWeight_f32 *weight,
                                        const PkmPose_f32 *zeroed_at,
                                        const PkmPoint_f32 *tip);

// No weight from now on, as after the init.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_compensator_clear_weight_f32(PkmCompensator_f32 *compensator);

// The same for the five axes: `platform` is what is rigid with the platform, `tool` what turns with the tool.
//
// Errors: those for three screws.
PKM_MUST_USE
PkmError pkm_tool_compensator_set_weight_f32(PkmToolCompensator_f32 *compensator,
                                             const PkmMachine_f32 *machine,
                                             const PkmTable_f32 *table,
                                             const PkmWrist_f32 *wrist,
                                             const PkmWeight_f32 *platform,
                                             const PkmWeight_f32 *tool,
                                             const PkmConfiguration_f32 *zeroed_at);

// No weight from now on, as after the init.
//
// Errors: NOT_INITIALISED.
PKM_MUST_USE PkmError pkm_tool_compensator_clear_weight_f32(PkmToolCompensator_f32 *compensator);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PKM_H */

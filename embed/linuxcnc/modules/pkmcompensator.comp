component pkmcompensator "Stiffness, deflection and compensation of an Exechon-like machine of five axes";

description """
Stands between controller and drives. Every period: how far to move the joints so that the loaded tool, tip and axis, stands where
the unloaded one would. The offsets are added to what the controller commands, and taken off what the drives report, so that the
controller sees the machine without them. The compensator of pkm.h decides how much is commanded, and how fast: the offsets of all
joints are scaled as one vector, so that the tip keeps its direction whichever joint has reached its limit.

Only while \\fBenable\\fR is true: it has to say that the machine is homed and on. Without it the offsets go to zero at their rate
limit, and the load is forgotten. Wrench and temperatures may be NaN when there is no reading. \\fBfault\\fR says that the load is not
compensated as usual, \\fBfault-code\\fR why; a fault ends with its cause.

.B loadrt pkmcompensator machine=0123456789abcdef wrist=0123456789abcdef table=0123456789abcdef

loads only where the machine, the wrist and the table that are compiled in have these checksums, are in memory as they were built, and
the processor computes known poses to the last bit.

It learns from readings of the tip under a load, docs/estimation.md: at a rising edge of \\fBprobe\\fR the reading of that period is taken in.
With \\fBstate=FILE\\fR it goes on from what FILE holds, and writes what it knows there when it is unloaded: no file is touched while
it runs. What was learned beyond another machine or table goes to FILE.old. What is learned is compensated while \\fBuse-learned\\fR is true.

After a repair a rising edge of \\fBforget\\fR has it begin anew.

Parameters are settings of the compensator, docs/stability.md. With \\fBplatform-weight-*\\fR or \\fBtool-weight-*\\fR, and the joints
\\fBzeroed-at-*\\fR, it compensates what gravity does beyond what it did there. A change is taken up while \\fBenable\\fR is false and all offsets are
zero; until then \\fBsettings-pending\\fR is true.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
option extra_setup yes;
option extra_cleanup yes;
include <math.h>;
include <stdio.h>;
include <time.h>;
include <unistd.h>;
include "pkm.h";
include "learned.h";

pin in bit enable "the machine is homed and on, and the wrench means the load on the tool";
pin in float joint-#[5] "where the joints stand without the offsets: three screws in mm, wrist in degrees";
pin in float fx "force on the tool at its tip in N, in the tool's axes: with A and B at 0 those of the platform; a positive B turns it about its own -y";
pin in float fy;
pin in float fz;
pin in float mx "moment about the tip in N m";
pin in float my;
pin in float mz;
pin in float rise-limb-1-k "how much warmer limb 1 is than at the zero reading, K; 0 without a sensor; one sensor goes to all four";
pin in float rise-limb-2-k "the same of limb 2";
pin in float rise-limb-3-k "the same of limb 3";
pin in float rise-platforms-k "the same of both platforms";
pin in bit use-learned "compensate with what was learned, and no more than is known by it";
pin in bit probe "at its rising edge the tip is read; refused while an offset acts";
pin in bit forget "at its rising edge all that was learned is forgotten: after a repair";
pin in float probe-x-um "by what the tip has moved along x of the base since the machine was zeroed, by load and growth; NaN where it is not read";
pin in float probe-y-um;
pin in float probe-z-um;
pin in float probe-deviation-um = 1.0 "standard deviation of each of the three";
pin out s32 probe-code "why the last reading was not taken in: a PkmError of pkm.h; 0 when it was";
pin out s32 state-code "why it does not go on from a saved state: a PkmError; 0 when it does, or when none is asked for";
pin out u32 readings-taken "readings that were taken in";
pin out u32 first-reading-s "when the first was, s since 1970 by the computer's clock: what was accepted is as old as that; 0 before it";
pin out u32 last-reading-s "when the last was: what is known is as old as that";
pin out u32 readings-refused "readings in a row that were too far from what was expected, stuck, or of the wrong sign";
pin out float learned-#[6] "what was learned: compliances of limbs 1, 2, 3 and under the base along x, y, z, nm/N";
pin out float learned-deviation-#[6] "standard deviations";
pin out bit alarm-#[6] "it has changed since acceptance by what is worth an alarm";
pin out float alarm-probability-#[6] "with this probability; 0 without an alarm";
pin out u32 alarm-readings-#[6] "since so many readings";
pin out bit any-alarm "there is an alarm";
pin in float command-#[5] "what the controller commands: mm, degrees";
pin out float drive-#[5] "the same with the offsets, for the drives";
pin in float drive-fb-#[5] "what the drives report";
pin out float feedback-#[5] "the same without the offsets, for the controller";
pin out float offset-#[5] "what is added to the joints: mm, degrees";
pin out bit active "an offset is beyond rounding, 1e-9 mm or degrees";
pin out bit settings-pending "a parameter has changed, and is not taken up before enable is false and all offsets are zero";
pin out bit fault "the load is not compensated as usual";
pin out s32 fault-code "why not: a PkmError of pkm.h; 0 without a fault";
pin out bit sensor-fault "the load or a temperature is not read as usual: fault-code 80 to 83; what to stop the machine on";
pin out s32 limit "what holds the offsets back: 0 nothing, 1 the largest offset, 2 the rate limit";
pin out bit ok "whether the results below are of this period; those of the place are where why is about the load";
pin out s32 why "why not: a PkmError of pkm.h";
pin out bit inside-box "whether the correction table was fitted here; false where the place is not known";
pin out float share "normalised Jacobian determinant of the five axes: 1 at home, 0 at a singularity and where the place is not known";
pin out float distance-1-2 "distance from the singularity of limbs 1 and 2, 0 there, 1 at the most";
pin out float distance-3 "the same of limb 3";
pin out u32 table-high "checksum of the correction table, as coefficients.json states it: first eight digits";
pin out u32 table-low "last eight digits";
pin out float tip-x-um "what the load, as it is read, moves the tip by along x of the base";
pin out float tip-y-um;
pin out float tip-z-um;
pin out float turn-x-urad "what it turns the tool by about x of the base";
pin out float turn-y-urad;
pin out float turn-z-urad;
pin out float k-11 "K_m at A in A-uvw: N/m, N/rad or N m/m, N m/rad";
pin out float k-12; pin out float k-13; pin out float k-14; pin out float k-15; pin out float k-16;
pin out float k-22; pin out float k-23; pin out float k-24; pin out float k-25; pin out float k-26;
pin out float k-33; pin out float k-34; pin out float k-35; pin out float k-36;
pin out float k-44; pin out float k-45; pin out float k-46;
pin out float k-55; pin out float k-56;
pin out float k-66;
pin out s32 last-ns "time of the last period";
pin io s32 max-ns "longest time of a period; may be set to 0";
param rw float gain "share of the deflection that is compensated; below 1 with a force sensor";
param rw float filter-s "time constant of the low-pass on the wrench";
param rw float dead-band-n "taken off the size of the force";
param rw float dead-band-nm "taken off the size of the moment";
param rw float max-force-n "a reading with a greater force is refused";
param rw float max-moment-nm "a reading with a greater moment is refused";
param rw float hold-s "how long the last good reading stands in for refused ones";
param rw float stuck-s "after how long of equal readings the sensor is stuck; 0 for a load that is computed";
param rw float max-screw-mm "largest offset of a screw";
param rw float max-wrist-deg "largest offset of a wrist joint";
param rw float screw-rate-mm-per-s "fastest offset of a screw";
param rw float wrist-rate-deg-per-s "fastest offset of a wrist joint";
param rw s32 outside-box "outside the table's box: 0 hold the offsets, 1 let them go to zero, 2 extrapolate";
param rw float platform-weight-x-n "weight of what is rigid with the platform, as a force along x of the base; only what no sensor shows";
param rw float platform-weight-y-n;
param rw float platform-weight-z-n;
param rw float platform-centre-u-mm "its centre of mass from A, in the platform's axes";
param rw float platform-centre-v-mm;
param rw float platform-centre-w-mm;
param rw float tool-weight-x-n "weight of what turns with the tool, as a force along x of the base; only what no sensor shows";
param rw float tool-weight-y-n;
param rw float tool-weight-z-n;
param rw float tool-centre-x-mm "its centre of mass from the tip, in the tool's axes";
param rw float tool-centre-y-mm;
param rw float tool-centre-z-mm;
param rw float zeroed-at-#[5] "where the joints stood when the machine was zeroed: mm, degrees; weights ask for it";
function from_drives fp "takes the offsets off the feedback; before motion-controller in the servo thread";
function to_drives fp "all the rest; behind motion-controller";
;;

#include <string.h>
#include "checksums.h"

/* fields of pkm.h are called so */
#undef gain
#undef filter_s
#undef dead_band_n
#undef dead_band_nm
#undef max_force_n
#undef max_moment_nm
#undef hold_s
#undef stuck_s
#undef outside_box
#undef limit
#undef fault

static const double MM = 1e3, DEG = 180.0 / 3.14159265358979323846;

static char *machine, *wrist, *table, *state;
RTAPI_MP_STRING(machine, "checksum of the machine that this configuration is for");
RTAPI_MP_STRING(wrist, "of its wrist, with the tool's length");
RTAPI_MP_STRING(table, "and of its correction table");
RTAPI_MP_STRING(state, "file that keeps what was learned");

/* in HAL's memory */
static PkmToolCompensator_f64 *compensator;

static PkmEstimator_f64 *estimator;

/* readings that the file has, and what came of reading it */
static uint32_t readings_saved;
static PkmError restored = PKM_ERROR_OK;

/* whether the pins say what is known: they are not there yet when the module is set up */
static int is_told;

/* What it is made with. */
typedef struct {
    PkmCompensatorSettings set;
    PkmWeight_f64 platform, tool;
    PkmJoints_f64 zeroed_at;
} Asked;

/* what it was asked to be made with, and whether it could be */
static Asked asked;
static PkmError asked_found = PKM_ERROR_NOT_INITIALISED;

/* the table that is compiled in, some numbers of it each period */
static PkmTableWatch watch;

/* whether it compensated in the last period */
static int was_on;

/* whether probe and forget were true then: one that is true from the start is no edge */
static int was_probed = 1, was_to_forget = 1;

static int has_forgotten;

/* whether a drive reports no number */
static int is_drive_lost;

/* why the compensator itself has failed: it is not asked again, or its offset would come back from where it was */
static PkmError failed = PKM_ERROR_OK;

static int weighs(const PkmWeight_f64 *weight) {
    return weight->force_n[0] != 0 || weight->force_n[1] != 0 || weight->force_n[2] != 0;
}

static PkmError make(const Asked *with) {
    const PkmChecksums sums = {pkm_machine_checksum(), pkm_wrist_checksum(), pkm_table_checksum()};
    PkmError found = pkm_tool_compensator_init_f64(compensator, pkm_tool_compensator_size_f64(), &with->set,
                                                   sizeof with->set, &sums);
    if (found != PKM_ERROR_OK || (!weighs(&with->platform) && !weighs(&with->tool))) return found;
    PkmToolPlace_f64 zero;
    if (pkm_tool_forward_f64(pkm_machine_f64(), pkm_wrist_f64(), &with->zeroed_at, &zero) != PKM_ERROR_OK) {
        return PKM_ERROR_WEIGHT_NO_REFERENCE;
    }
    return pkm_tool_compensator_set_weight_f64(compensator, pkm_machine_f64(), pkm_table_f64(), pkm_wrist_f64(),
                                               &with->platform, &with->tool, &zero.configuration);
}

static void take_weights(const struct __comp_state *__comp_inst, Asked *now) {
    now->platform = (PkmWeight_f64){{platform_weight_x_n, platform_weight_y_n, platform_weight_z_n},
                                    {platform_centre_u_mm / MM, platform_centre_v_mm / MM, platform_centre_w_mm / MM}};
    now->tool = (PkmWeight_f64){{tool_weight_x_n, tool_weight_y_n, tool_weight_z_n},
                                {tool_centre_x_mm / MM, tool_centre_y_mm / MM, tool_centre_z_mm / MM}};
    now->zeroed_at = (PkmJoints_f64){{{zeroed_at(0) / MM, zeroed_at(1) / MM, zeroed_at(2) / MM}},
                                     {zeroed_at(3) / DEG, zeroed_at(4) / DEG}};
}

/* What the parameters ask for. */
static void ask(const struct __comp_state *__comp_inst, long period_ns, Asked *now) {
    memset(now, 0, sizeof *now); /* what lies between the numbers is compared, too */
    PkmCompensatorSettings *set = &now->set;
    set->period_s = period_ns * 1e-9;
    set->gain = __comp_inst->gain;
    set->filter_s = __comp_inst->filter_s;
    set->dead_band_n = __comp_inst->dead_band_n;
    set->dead_band_nm = __comp_inst->dead_band_nm;
    set->max_force_n = __comp_inst->max_force_n;
    set->max_moment_nm = __comp_inst->max_moment_nm;
    set->hold_s = __comp_inst->hold_s;
    set->stuck_s = __comp_inst->stuck_s;
    set->max_screw_m = max_screw_mm / MM;
    set->max_wrist_rad = max_wrist_deg / DEG;
    set->screw_rate_m_per_s = screw_rate_mm_per_s / MM;
    set->wrist_rate_rad_per_s = wrist_rate_deg_per_s / DEG;
    set->outside_box = __comp_inst->outside_box;
    take_weights(__comp_inst, now);
}

/* Makes the compensator anew. */
static void take(const Asked *now) {
    asked = *now;
    asked_found = make(now);
    if (asked_found != PKM_ERROR_OK) {
        const char *name = pkm_compensator_setting_out_of_range(&now->set, sizeof now->set);
        rtapi_print_msg(RTAPI_MSG_ERR, "pkmcompensator: %s%s%s; nothing is compensated\n", pkm_error_text(asked_found),
                        name ? ": " : "", name ? name : "");
    }
}

_Static_assert(LEARNED_COUNT <= 6, "there are pins for six");

/* Two states in turn, docs/estimation.md, one behind the other in the file. */
static unsigned char slots[2][1024];

static void read_slots(size_t bytes) {
    FILE *from = fopen(state, "rb");
    if (!from) return;
    for (int i = 0; i < 2; i++) {
        if (fread(slots[i], 1, bytes, from) != bytes) break;
    }
    fclose(from);
}

/* Goes on from the newest state that is whole. Not in the thread. */
static PkmError restore(void) {
    const size_t bytes = pkm_estimator_state_bytes(LEARNED_COUNT);
    PkmNewest newest;
    read_slots(bytes);
    PkmError found = pkm_estimator_newest(LEARNED_COUNT, slots[0], slots[1], bytes, &newest);
    if (found == PKM_ERROR_OK) found = pkm_estimator_restore_f64(estimator, pkm_table_f64(), slots[newest.slot], bytes);
    return found;
}

/* Writes what is known over the older state. Not in the thread. */
static int save(void) {
    const size_t bytes = pkm_estimator_state_bytes(LEARNED_COUNT);
    PkmNewest newest = {1, 0};
    if (pkm_estimator_newest(LEARNED_COUNT, slots[0], slots[1], bytes, &newest) != PKM_ERROR_OK) newest.slot = 1;
    const uint32_t to = 1 - newest.slot;
    if (pkm_estimator_save_f64(estimator, pkm_table_f64(), newest.sequence + 1, slots[to], bytes) != PKM_ERROR_OK) return 0;
    if (restored == PKM_ERROR_OTHER_STATE) {
        char old[4096];
        const int length = snprintf(old, sizeof old, "%s.old", state);
        if (length < 0 || (size_t)length >= sizeof old || rename(state, old)) return 0;
    }
    FILE *file = fopen(state, "r+b");
    if (!file) file = fopen(state, "w+b");
    if (!file) return 0;
    int done = !fseek(file, (long)(to * bytes), SEEK_SET) && fwrite(slots[to], 1, bytes, file) == bytes;
    done = !fflush(file) && !fsync(fileno(file)) && done;
    return !fclose(file) && done;
}

/* Whether the file of the state may be written, or made where there is none. */
static int may_be_written(void) {
    char folder[4096];
    if (!access(state, F_OK)) return !access(state, W_OK);
    if (!*state || strlen(state) >= sizeof folder) return 0;
    strcpy(folder, state);
    char *end = strrchr(folder, '/');
    if (end == folder) return !access("/", W_OK);
    if (end) *end = 0;
    return !access(end ? folder : ".", W_OK);
}

static uint32_t readings_known(void) {
    PkmEstimatorState known;
    return pkm_estimator_state_f64(estimator, &known, sizeof known) == PKM_ERROR_OK ? known.readings : 0;
}

/* What is known, to the pins. */
static void tell(struct __comp_state *__comp_inst) {
    PkmEstimatorState known;
    if (pkm_estimator_state_f64(estimator, &known, sizeof known) != PKM_ERROR_OK) return;
    is_told = 1;
    state_code = restored;
    readings_taken = known.readings;
    first_reading_s = known.began_s;
    last_reading_s = known.time_s;
    readings_refused = known.refused;
    any_alarm = 0;
    for (int i = 0; i < LEARNED_COUNT; i++) {
        const PkmAmplitudeState *own = &known.amplitudes[i];
        learned(i) = own->value * 1e9;
        learned_deviation(i) = own->deviation * 1e9;
        alarm(i) = own->alarm;
        alarm_probability(i) = own->probability;
        alarm_readings(i) = own->alarm_readings;
        if (own->alarm) any_alarm = 1;
    }
}

/* Takes the tip's reading in. */
static PkmError take_in(struct __comp_state *__comp_inst, const PkmConfiguration_f64 *configuration, const PkmWrench_f64 *wrench) {
    const double read_um[3] = {probe_x_um, probe_y_um, probe_z_um};
    /* one temperature is known of the whole */
    const double rise = (rise_limb_1_k + rise_limb_2_k + rise_limb_3_k + rise_platforms_k) / 4;
    PkmToolTouch_f64 at;
    PkmTipReading_f64 readings[3];
    PkmLearned_f64 done;
    size_t count = 0;
    memset(readings, 0, sizeof readings);
    PkmError found = pkm_tool_touch_f64(pkm_machine_f64(), pkm_wrist_f64(), configuration, wrench, (uint32_t)time(NULL), rise, &at);
    if (found != PKM_ERROR_OK) return found;
    for (int i = 0; i < 3; i++) {
        if (read_um[i] != read_um[i]) continue;
        memcpy(readings[count].direction, at.base_axes[i], sizeof at.base_axes[i]);
        readings[count].read = read_um[i] * 1e-6;
        readings[count].deviation = probe_deviation_um * 1e-6;
        count++;
    }
    return pkm_estimator_learn_f64(estimator, pkm_machine_f64(), pkm_table_f64(), &at.touch, readings, count, &done);
}

/* Stiffness where the machine stands, and what the load does to it. The place is told also where the load is not read. */
static PkmError show(struct __comp_state *__comp_inst, const PkmToolPlace_f64 *place, const PkmWrench_f64 *wrench) {
    const PkmMachine_f64 *of = pkm_machine_f64();
    const PkmTable_f64 *by = pkm_table_f64();
    const PkmWrist_f64 *with = pkm_wrist_f64();
    const PkmConfiguration_f64 *at = &place->configuration;
    const PkmWrench_f64 none = {{0, 0, 0}, {0, 0, 0}};
    PkmSingularityDistance_f64 distance;
    PkmCorrected_f64 corrected;
    PkmCompensatedTool_f64 loaded;
    PkmError found = pkm_singularity_distance_f64(of, &at->pose, &distance);
    if (found == PKM_ERROR_OK) found = pkm_corrected_stiffness_f64(of, by, &at->pose, &corrected);
    PkmError of_load = found;
    if (found == PKM_ERROR_OK) {
        of_load = pkm_tool_compensated_f64(of, by, with, &place->tool, wrench, at, &loaded);
        if (of_load != PKM_ERROR_OK) found = pkm_tool_compensated_f64(of, by, with, &place->tool, &none, at, &loaded);
    }
    const int is_known = found == PKM_ERROR_OK;
    inside_box = is_known && corrected.domain == PKM_DOMAIN_INSIDE && loaded.domain == PKM_DOMAIN_INSIDE;
    share = is_known ? loaded.solution.normalised_determinant : 0;
    if (!is_known) return found;

    distance_1_2 = distance.limbs_1_2;
    distance_3 = distance.limb_3;
#define K(I, J) k_##I##J = corrected.stiffness.k_si[I - 1][J - 1]
    K(1, 1), K(1, 2), K(1, 3), K(1, 4), K(1, 5), K(1, 6);
    K(2, 2), K(2, 3), K(2, 4), K(2, 5), K(2, 6);
    K(3, 3), K(3, 4), K(3, 5), K(3, 6);
    K(4, 4), K(4, 5), K(4, 6);
    K(5, 5), K(5, 6);
    K(6, 6);
#undef K
    if (of_load != PKM_ERROR_OK) return of_load;
    tip_x_um = loaded.translation_m[0] * 1e6;
    tip_y_um = loaded.translation_m[1] * 1e6;
    tip_z_um = loaded.translation_m[2] * 1e6;
    turn_x_urad = loaded.rotation_rad[0] * 1e6;
    turn_y_urad = loaded.rotation_rad[1] * 1e6;
    turn_z_urad = loaded.rotation_rad[2] * 1e6;
    return PKM_ERROR_OK;
}

/* Lets the offsets go, at their rate limit, where the compensator itself has failed. */
static void let_go(struct __comp_state *__comp_inst, double period_s) {
    for (int i = 0; i < 5; i++) {
        const double most = period_s * (i < 3 ? asked.set.screw_rate_m_per_s * MM : asked.set.wrist_rate_rad_per_s * DEG);
        const double left = offset(i);
        offset(i) = left > most ? left - most : left < -most ? left + most : 0;
    }
}

/* A period of the compensator. `stands` is an error when there is no place to compensate at: it is told of one that is no number, and forgets nothing. */
static void compensate(struct __comp_state *__comp_inst, PkmError stands, const PkmConfiguration_f64 *configuration,
                       const PkmWrench_f64 *wrench, double period_s) {
    const PkmError kept = pkm_table_watch_f64(&watch, pkm_table_f64());
    const PkmError unready = kept != PKM_ERROR_OK ? kept : asked_found;
    was_on = enable && unready == PKM_ERROR_OK;
    const PkmReading_f64 reading = {was_on, *wrench, {{rise_limb_1_k, rise_limb_2_k, rise_limb_3_k}, rise_platforms_k}};
    PkmKnownOffset_f64 learned_to;
    memset(&learned_to, 0, sizeof learned_to);
    PkmOffset_f64 to;
    memset(&to, 0, sizeof to);
    PkmError found = failed;
    if (failed != PKM_ERROR_OK) {
        let_go(__comp_inst, period_s);
    } else if (use_learned) {
        found = pkm_estimator_follow_f64(estimator, period_s);
        if (found == PKM_ERROR_OK) {
            found = pkm_tool_compensator_update_learned_f64(compensator, pkm_machine_f64(), pkm_table_f64(), NULL, estimator,
                                                            pkm_wrist_f64(), configuration, &reading, &learned_to, sizeof learned_to);
        }
        to = learned_to.offset;
    } else {
        found = pkm_tool_compensator_update_f64(compensator, pkm_machine_f64(), pkm_table_f64(), pkm_wrist_f64(),
                                                configuration, &reading, &to, sizeof to);
    }
    failed = found;
    if (failed == PKM_ERROR_OK) {
        for (int i = 0; i < 5; i++) offset(i) = i < 3 ? to.screws_m[i] * MM : to.wrist_rad[i - 3] * DEG;
        *__comp_inst->limit = to.limit;
        const PkmError missing = unready != PKM_ERROR_OK ? unready : stands;
        found = enable && missing != PKM_ERROR_OK ? missing : to.fault;
    }
    int is_active = 0;
    for (int i = 0; i < 5; i++) is_active |= fabs(offset(i)) > 1e-9;
    active = is_active;
    fault_code = found;
    *__comp_inst->fault = found != PKM_ERROR_OK;
    sensor_fault = found >= PKM_ERROR_WRENCH_NOT_FINITE && found <= PKM_ERROR_TEMPERATURE_LOST;
}

FUNCTION(from_drives) {
    (void)period;
    int is_lost = 0;
    for (int i = 0; i < 5; i++) {
        const double stands = drive_fb(i) - offset(i);
        /* LinuxCNC finds no following error in NaN: where it was last is one as soon as the joint moves */
        if (isfinite(stands)) feedback(i) = stands;
        else is_lost = 1;
    }
    is_drive_lost = is_lost;
}

FUNCTION(to_drives) {
    const long long begun = rtapi_get_time();
    /* before place and load, which are to be of its period */
    const int is_edge = probe && !was_probed, is_to_forget = forget && !was_to_forget;
    was_probed = probe;
    was_to_forget = forget;
    table_high = pkm_table_checksum() >> 32;
    table_low = (hal_u32_t)pkm_table_checksum();
    Asked now;
    ask(__comp_inst, period, &now);
    settings_pending = memcmp(&now, &asked, sizeof now) != 0;
    if (settings_pending && !was_on && !active) {
        take(&now);
        settings_pending = 0;
    }

    const PkmJoints_f64 joints = {{{joint(0) / MM, joint(1) / MM, joint(2) / MM}}, {joint(3) / DEG, joint(4) / DEG}};
    const PkmWrench_f64 wrench = {{fx, fy, fz}, {mx, my, mz}};
    PkmToolPlace_f64 place;
    memset(&place, 0, sizeof place);
    const PkmError stands = is_drive_lost ? PKM_ERROR_NOT_FINITE
                                          : pkm_tool_forward_f64(pkm_machine_f64(), pkm_wrist_f64(), &joints, &place);
    if (stands == PKM_ERROR_OK) {
        why = show(__comp_inst, &place, &wrench);
    } else {
        why = stands;
        inside_box = 0;
        share = 0;
        place.configuration = (PkmConfiguration_f64){{NAN, NAN, NAN}, {NAN, NAN}};
    }
    ok = why == PKM_ERROR_OK;
    if (is_edge) {
        probe_code = stands != PKM_ERROR_OK ? stands
                     : active               ? PKM_ERROR_READING_COMPENSATED
                                            : take_in(__comp_inst, &place.configuration, &wrench);
        is_told = 0;
    }
    if (is_to_forget) {
        /* settings and memory are those of the start, which it began with */
        if (pkm_estimator_init_f64(estimator, pkm_estimator_size_f64(), &LEARNED, sizeof LEARNED) == PKM_ERROR_OK) has_forgotten = 1;
        is_told = 0;
    }
    if (!is_told) tell(__comp_inst);
    compensate(__comp_inst, stands, &place.configuration, &wrench, period * 1e-9);
    int is_commanded = 1;
    for (int i = 0; i < 5; i++) {
        const double commanded = command(i) + offset(i);
        /* a drive that is asked for NaN does what its maker thought of */
        if (isfinite(commanded)) drive(i) = commanded;
        else is_commanded = 0;
    }
    if (!is_commanded) {
        fault_code = PKM_ERROR_NOT_FINITE;
        *__comp_inst->fault = 1;
    }

    last_ns = rtapi_get_time() - begun;
    if (last_ns > max_ns) max_ns = last_ns;
}

EXTRA_SETUP() {
    (void)prefix;
    (void)extra_arg;
    const char *us = "pkmcompensator";
    if (!is_for(us, "machine", machine, pkm_machine_checksum()) || !is_for(us, "wrist", wrist, pkm_wrist_checksum()) ||
        !is_for(us, "table", table, pkm_table_checksum()) || !is_sound(us)) {
        return -EINVAL;
    }
    Asked with;
    memset(&with, 0, sizeof with);
    PkmError found = pkm_compensator_defaults(&with.set, sizeof with.set);
    compensator = hal_malloc(pkm_tool_compensator_size_f64());
    if (found == PKM_ERROR_OK) found = make(&with);
    if (found == PKM_ERROR_OK) found = pkm_table_watch_begin_f64(&watch, pkm_table_f64());
    PkmEstimator_f64 *room = hal_malloc(pkm_estimator_size_f64());
    if (found == PKM_ERROR_OK) found = pkm_estimator_init_f64(room, pkm_estimator_size_f64(), &LEARNED, sizeof LEARNED);
    if (found != PKM_ERROR_OK) {
        rtapi_print_msg(RTAPI_MSG_ERR, "pkmcompensator: %s\n", pkm_error_text(found));
        return -EINVAL;
    }
    __comp_inst->gain = with.set.gain;
    __comp_inst->filter_s = with.set.filter_s;
    __comp_inst->dead_band_n = with.set.dead_band_n;
    __comp_inst->dead_band_nm = with.set.dead_band_nm;
    __comp_inst->max_force_n = with.set.max_force_n;
    __comp_inst->max_moment_nm = with.set.max_moment_nm;
    __comp_inst->hold_s = with.set.hold_s;
    __comp_inst->stuck_s = with.set.stuck_s;
    max_screw_mm = with.set.max_screw_m * MM;
    max_wrist_deg = with.set.max_wrist_rad * DEG;
    screw_rate_mm_per_s = with.set.screw_rate_m_per_s * MM;
    wrist_rate_deg_per_s = with.set.wrist_rate_rad_per_s * DEG;
    __comp_inst->outside_box = with.set.outside_box;
    estimator = room;
    if (state) restored = restore();
    if (restored != PKM_ERROR_OK) {
        /* without a file it is the first start */
        rtapi_print_msg(access(state, F_OK) ? RTAPI_MSG_WARN : RTAPI_MSG_ERR, "pkmcompensator: %s: %s; it begins with nothing learned\n", state,
                        pkm_error_text(restored));
    }
    if (state && !may_be_written()) {
        rtapi_print_msg(RTAPI_MSG_ERR, "pkmcompensator: %s: may not be written: what is learned will be lost\n", state);
    }
    readings_saved = readings_known();
    return 0;
}

/* The threads are at rest, and this is none of theirs. */
EXTRA_CLEANUP() {
    /* also called when the set-up failed */
    if (!estimator || !state || (readings_known() == readings_saved && !has_forgotten)) return;
    if (!save()) rtapi_print_msg(RTAPI_MSG_ERR, "pkmcompensator: %s: what was learned could not be written\n", state);
}

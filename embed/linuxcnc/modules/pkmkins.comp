component pkmkins "Kinematics of an Exechon-like machine of five axes, for motmod";

description """
Joints 0, 1, 2 are the lengths of the three screws in mm, joints 3 and 4 the wrist in degrees. Axes X Y Z are the tool's tip in
mm in the frame B of the machine's base, A and B the wrist's joints in degrees: the coordinates of `pkm-host compensate`.

Both directions are closed forms. A target that is unreachable, beyond travel or limits, or too near to a singularity is
refused with a message, and motmod then does not begin the move, or stops on the way before it gets there.

Where the machine stands is answered with the last command, whatever the place, so that the drives hold it there: connect
\\fBcommand-N\\fR to joint.N.pos-cmd. Nearer to the singularity locus than the margin, only moves away from the locus are taken.

.B loadrt pkmkins machine=0123456789abcdef wrist=0123456789abcdef linear=mm angular=degree

loads only where the machine and the wrist that are compiled in have these checksums, are in memory as they were built, the processor
computes known poses to the last bit, and LinuxCNC counts in mm and degrees: linear=[TRAJ]LINEAR_UNITS angular=[TRAJ]ANGULAR_UNITS.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
option extra_setup yes;
include "pkm.h";

pin in float command-#[5] "joint.N.pos-cmd: what motmod commanded in the last period, mm and degrees";
pin out bit held "the last target is refused to others: the machine stands there, or it leads out of the margin";
pin out s32 why "why the last refusal was, of a target or of joint values: a PkmError of pkm.h; 0 after a good target";
pin out u32 refused "targets and joint values refused so far";
pin out float share "of the last target: normalised Jacobian determinant of the five axes, 1 at home, 0 at a singularity";
pin out float inverse-axis-#[5] "last target that was not refused: X Y Z A B";
pin out float inverse-joint-#[5] "its joints";
pin out float forward-joint-#[5] "last joint values that were not refused";
pin out float forward-axis-#[5] "their X Y Z A B";
pin out s32 inverse-ns "time of the last inverse";
pin out s32 forward-ns "time of the last forward";
pin io s32 inverse-max-ns "longest time of an inverse; may be set to 0";
pin io s32 forward-max-ns "longest time of a forward; may be set to 0";
;;

#include <rtapi_math.h>
#include <kinematics.h>
#include "checksums.h"

static char *machine, *wrist, *linear, *angular;
RTAPI_MP_STRING(machine, "checksum of the machine that this configuration is for");
RTAPI_MP_STRING(wrist, "and of its wrist, with the tool's length");
RTAPI_MP_STRING(linear, "LinuxCNC's units of length: mm");
RTAPI_MP_STRING(angular, "and of angles: degree");

/* Whether LinuxCNC counts as this component does: in other units the machine would go to another place. */
static int counts_in(const char *setting, const char *units, const char *ours, const char *also) {
    if (units && (!strcmp(units, ours) || !strcmp(units, also))) return 1;
    rtapi_print_msg(RTAPI_MSG_ERR, "pkmkins: [TRAJ]%s is %s, and has to be %s: loadrt [KINS]KINEMATICS linear=[TRAJ]LINEAR_UNITS "
                    "angular=[TRAJ]ANGULAR_UNITS\n", setting, units ? units : "not told", ours);
    return 0;
}

static const double MM = 1e3, DEG = 180.0 / 3.14159265358979323846;

static PkmError said;

/* mm and degrees: a target this near to where the last command put the machine is where it stands */
static const double STANDS = 0.05;

/* Rounding of a share: a target that is not nearer to the locus than the last command may seem to be by this. */
static const double SAME_SHARE = 1e-12;

/* Where the last command put the machine, and its distance from the singularity locus, infinite on it and beyond: from there
   no way out is known. False when it put it nowhere: beyond travel, not homed, or nothing is connected. */
static int commanded(struct __comp_state *__comp_inst, double axis[5], double *share_there) {
    const PkmJoints_f64 joints = {{{command(0) / MM, command(1) / MM, command(2) / MM}}, {command(3) / DEG, command(4) / DEG}};
    PkmToolPlace_f64 place;
    PkmToolSolution_f64 solution;
    if (pkm_tool_forward_f64(pkm_machine_f64(), pkm_wrist_f64(), &joints, &place) != PKM_ERROR_OK) return 0;
    PkmTip_f64 tip;
    for (int i = 0; i < 3; i++) axis[i] = (tip.tip_m[i] = place.tool.tip_m[i]) * MM;
    for (int i = 0; i < 2; i++) axis[3 + i] = (tip.beta_rad[i] = joints.beta_rad[i]) * DEG;
    const PkmError found = pkm_tip_inverse_any_margin_f64(pkm_machine_f64(), pkm_wrist_f64(), &tip, &solution);
    *share_there = found == PKM_ERROR_OK ? solution.normalised_determinant : INFINITY;
    return 1;
}

/* A target that the machine may not go to. It may well stand there all the same: jogged joint by joint, or run on after a stop.
   motmod asks for where it stands as long as it moves by axes. Answers with the last command, never with the feedback: the
   drives would follow their own error. */
static PkmError answer_refused(struct __comp_state *__comp_inst, const PkmTip_f64 *tip, const double axis[5], PkmError refusal,
                               PkmToolSolution_f64 *solution, double *joint) {
    double there[5], share_there, off = 0;
    if (!commanded(__comp_inst, there, &share_there)) return refusal;
    if (refusal == PKM_ERROR_TOOL_SINGULAR &&
        pkm_tip_inverse_any_margin_f64(pkm_machine_f64(), pkm_wrist_f64(), tip, solution) == PKM_ERROR_OK &&
        solution->normalised_determinant >= share_there - SAME_SHARE) {
        for (int i = 0; i < 5; i++) joint[i] = i < 3 ? solution->joints.lengths.q_m[i] * MM : axis[i];
        return PKM_ERROR_OK;
    }
    for (int i = 0; i < 5; i++) {
        const double d = fabs(axis[i] - there[i]);
        if (!(d <= off)) off = d;
    }
    if (!(off <= STANDS)) return refusal;
    for (int i = 0; i < 5; i++) joint[i] = command(i);
    return PKM_ERROR_OK;
}

int kinematicsInverse(const EmcPose *world, double *joint, const KINEMATICS_INVERSE_FLAGS *iflags,
                      KINEMATICS_FORWARD_FLAGS *fflags) {
    (void)iflags;
    (void)fflags;
    struct __comp_state *__comp_inst = __comp_first_inst;
    const long long begun = rtapi_get_time();
    const double axis[5] = {world->tran.x, world->tran.y, world->tran.z, world->a, world->b};
    const PkmTip_f64 tip = {{axis[0] / MM, axis[1] / MM, axis[2] / MM}, {axis[3] / DEG, axis[4] / DEG}};
    PkmToolSolution_f64 solution;
    PkmError found = pkm_tip_inverse_f64(pkm_machine_f64(), pkm_wrist_f64(), &tip, &solution);
    held = 0;
    if (found != PKM_ERROR_OK) {
        found = answer_refused(__comp_inst, &tip, axis, found, &solution, joint);
        if (found == PKM_ERROR_OK) {
            why = said = found;
            held = 1;
            return 0;
        }
        refused++;
        /* once for a row of the same */
        if (found != said) rtapi_print_msg(RTAPI_MSG_ERR, "pkmkins: target refused: %s\n", pkm_error_text(found));
        why = said = found;
        return -1;
    }
    why = said = found;
    share = solution.normalised_determinant;
    for (int i = 0; i < 5; i++) {
        joint[i] = i < 3 ? solution.joints.lengths.q_m[i] * MM : axis[i];
        inverse_axis(i) = axis[i];
        inverse_joint(i) = joint[i];
    }
    inverse_ns = rtapi_get_time() - begun;
    if (inverse_ns > inverse_max_ns) inverse_max_ns = inverse_ns;
    return 0;
}

int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *fflags,
                      KINEMATICS_INVERSE_FLAGS *iflags) {
    (void)fflags;
    (void)iflags;
    struct __comp_state *__comp_inst = __comp_first_inst;
    const long long begun = rtapi_get_time();
    const PkmJoints_f64 joints = {{{joint[0] / MM, joint[1] / MM, joint[2] / MM}}, {joint[3] / DEG, joint[4] / DEG}};
    PkmToolPlace_f64 place;
    const PkmError found = pkm_tool_forward_f64(pkm_machine_f64(), pkm_wrist_f64(), &joints, &place);
    if (found != PKM_ERROR_OK) {
        /* without a message: it is asked in every period */
        refused++;
        why = found;
        return -1;
    }
    const double *tip_m = place.tool.tip_m;
    const double axis[5] = {tip_m[0] * MM, tip_m[1] * MM, tip_m[2] * MM, joint[3], joint[4]};
    *world = (EmcPose){.tran = {axis[0], axis[1], axis[2]}, .a = axis[3], .b = axis[4]};
    for (int i = 0; i < 5; i++) {
        forward_joint(i) = joint[i];
        forward_axis(i) = axis[i];
    }
    forward_ns = rtapi_get_time() - begun;
    if (forward_ns > forward_max_ns) forward_max_ns = forward_ns;
    return 0;
}

KINEMATICS_TYPE kinematicsType(void) {
    return KINEMATICS_BOTH;
}

KINS_NOT_SWITCHABLE
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsInverse);
EXPORT_SYMBOL(kinematicsForward);

EXTRA_SETUP() {
    (void)prefix;
    (void)extra_arg;
    (void)__comp_inst;
    const char *us = "pkmkins";
    const int fits = is_for(us, "machine", machine, pkm_machine_checksum()) &&
                     is_for(us, "wrist", wrist, pkm_wrist_checksum()) && is_sound(us) &&
                     counts_in("LINEAR_UNITS", linear, "mm", "metric") && counts_in("ANGULAR_UNITS", angular, "degree", "deg");
    return fits ? 0 : -EINVAL;
}

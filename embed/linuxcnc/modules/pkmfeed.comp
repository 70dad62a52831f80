component pkmfeed "How fast the joints of an Exechon-like machine move, and what share of the feed they allow";

description """
Every period: velocities and accelerations of the joints that the commanded motion of the tool asks for, by the machine's
Jacobian and its time derivative, and \\fBfeed-share\\fR, the greatest share of the programmed feed at which no joint exceeds its
limits on the way that the tool is on. Connect it to motion.adaptive-feed; it acts where a program says M52 P1.

The share belongs to a place, a direction and a programmed feed, not to the speed at which the tool happens to move: how the
joints move is divided by that speed, so that a share that acts does not change the share. There is no loop that could hunt.

Values are those of the period before: differences over three periods belong to the middle one. The share does not look ahead.
Where it falls the controller brakes with the acceleration of its axes.

.B loadrt pkmfeed machine=0123456789abcdef wrist=0123456789abcdef

loads only where the machine and the wrist that are compiled in have these checksums, are in memory as they were built, and the processor
computes known poses to the last bit.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
option extra_setup yes;
include "pkm.h";

pin in float joint-#[5] "joint.N.pos-cmd: three screws in mm, wrist in degrees";
pin in float requested-vel "motion.requested-vel: programmed feed in mm/s, in degrees/s where the wrist turns alone";
pin in float feed-override = 1.0 "what the feed is multiplied with besides, or the greatest that it may be";
pin in float max-velocity-#[5] = 1e9 "mm/s, degrees/s";
pin in float max-acceleration-#[5] = 1e9 "mm/s2, degrees/s2, at a steady feed";
pin out float velocity-#[5] "mm/s, degrees/s";
pin out float acceleration-#[5] "mm/s2, degrees/s2";
pin out float feed-share = 1.0 "0 to 1, for motion.adaptive-feed";
pin out bit ok "whether velocities and accelerations are of the period before; if not they stay what they were";
pin out s32 why "why not: a PkmError of pkm.h";
pin out s32 last-ns "time of the last period";
function _ fp "behind motion-controller in the servo thread";
;;

#include <rtapi_math.h>
#include "checksums.h"

static const double MM = 1e3, DEG = 180.0 / 3.14159265358979323846;

static char *machine, *wrist;
RTAPI_MP_STRING(machine, "checksum of the machine that this configuration is for");
RTAPI_MP_STRING(wrist, "of its wrist, with the tool's length");

/* mm/s: a tip that is slower stays, and the feed is that of the wrist's turn */
static const double STAYS = 1e-6;

/* mm/s or degrees/s: below it differences over a period say nothing about the curve that the tool is on */
static const double SLOW = 0.1;

/* where the tool was commanded to be two periods ago, one period ago, and now; how many of them are known */
static PkmToolPlace_f64 place[3];
static int known;

/* first and second derivatives of the joints by the way, as the feed counts it: mm, or degrees of the wrist's turn */
static PkmJointMotion_f64 by_way;

static double dot(const double *a, const double *b, int n) {
    double sum = 0;
    for (int i = 0; i < n; i++) sum += a[i] * b[i];
    return sum;
}

/* First and second time derivative of three vectors a period of `s` apart. */
static void differences(const double *a, const double *b, const double *c, double s, double first[3], double second[3]) {
    for (int i = 0; i < 3; i++) {
        first[i] = (c[i] - a[i]) / (2 * s);
        second[i] = (c[i] - 2 * b[i] + a[i]) / (s * s);
    }
}

/* How tool and joints moved in the middle one of the last three periods. */
static PkmError motion_of(const struct __comp_state *__comp_inst, double s, PkmToolMotion_f64 *tool, PkmJointMotion_f64 *joints) {
    const PkmJoints_f64 now = {{{joint(0) / MM, joint(1) / MM, joint(2) / MM}}, {joint(3) / DEG, joint(4) / DEG}};
    place[0] = place[1];
    place[1] = place[2];
    const PkmError stands = pkm_tool_forward_f64(pkm_machine_f64(), pkm_wrist_f64(), &now, &place[2]);
    if (stands != PKM_ERROR_OK) {
        known = 0;
        return stands;
    }
    if (known < 3) known++;
    if (known < 3) return PKM_ERROR_NOT_INITIALISED;
    const PkmTool_f64 *a = &place[0].tool, *b = &place[1].tool, *c = &place[2].tool;
    differences(a->tip_m, b->tip_m, c->tip_m, s, tool->tip_m_per_s, tool->tip_m_per_s2);
    differences(a->axis, b->axis, c->axis, s, tool->axis_per_s, tool->axis_per_s2);
    return pkm_joint_motion_f64(pkm_machine_f64(), pkm_wrist_f64(), &place[1].configuration, tool, joints);
}

/* Takes the time out of a motion. The feed is the tip's, and the wrist's where the tip stays. */
static void take_way(const PkmToolMotion_f64 *tool, const PkmJointMotion_f64 *joints) {
    const int tip_moves = MM * sqrt(dot(tool->tip_m_per_s, tool->tip_m_per_s, 3)) > STAYS;
    const double *first = tip_moves ? tool->tip_m_per_s : joints->velocity + 3;
    const double *second = tip_moves ? tool->tip_m_per_s2 : joints->acceleration + 3;
    const int n = tip_moves ? 3 : 2;
    const double speed = (tip_moves ? MM : DEG) * sqrt(dot(first, first, n));
    if (!(speed >= SLOW)) {
        /* a tool that begins to move goes on as it went, and so slowly that the curve does not count */
        for (int i = 0; i < 5; i++) by_way.acceleration[i] = 0;
        return;
    }
    /* of the accelerations, what comes from a change of speed does not belong to a steady feed */
    const double gain = dot(first, second, n) / dot(first, first, n);
    for (int i = 0; i < 5; i++) {
        by_way.velocity[i] = joints->velocity[i] / speed;
        by_way.acceleration[i] = (joints->acceleration[i] - gain * joints->velocity[i]) / (speed * speed);
    }
}

/* The share of the programmed feed that the joints allow on the way last taken. */
static double allowed(const struct __comp_state *__comp_inst) {
    const double feed = requested_vel * feed_override;
    PkmJointMotion_f64 full, most;
    for (int i = 0; i < 5; i++) {
        const double unit = i < 3 ? MM : DEG;
        full.velocity[i] = by_way.velocity[i] * feed;
        full.acceleration[i] = by_way.acceleration[i] * feed * feed;
        most.velocity[i] = max_velocity(i) / unit;
        most.acceleration[i] = max_acceleration(i) / unit;
    }
    double share;
    return pkm_feed_share_f64(&full, &most, &share) == PKM_ERROR_OK ? share : 0;
}

FUNCTION(_) {
    const long long begun = rtapi_get_time();
    PkmToolMotion_f64 tool;
    PkmJointMotion_f64 joints;
    why = motion_of(__comp_inst, period * 1e-9, &tool, &joints);
    ok = why == PKM_ERROR_OK;
    if (ok) {
        for (int i = 0; i < 5; i++) {
            const double unit = i < 3 ? MM : DEG;
            velocity(i) = joints.velocity[i] * unit;
            acceleration(i) = joints.acceleration[i] * unit;
        }
        take_way(&tool, &joints);
    }
    feed_share = allowed(__comp_inst);
    last_ns = rtapi_get_time() - begun;
}

EXTRA_SETUP() {
    (void)prefix;
    (void)extra_arg;
    (void)__comp_inst;
    const char *us = "pkmfeed";
    const int fits = is_for(us, "machine", machine, pkm_machine_checksum()) &&
                     is_for(us, "wrist", wrist, pkm_wrist_checksum()) && is_sound(us);
    return fits ? 0 : -EINVAL;
}

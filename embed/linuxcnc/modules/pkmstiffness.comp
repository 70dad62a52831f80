component pkmstiffness "Stiffness, deflection and compensation of an Exechon-like machine of five axes";

description """
Every period: the stiffness K_m where the machine stands, what the load on the tool does to it, and how far to move the joints
so that the loaded tool, tip and axis, stands where the unloaded one would. After a refusal, such as a pose that has no
stiffness or a load that cannot be made up for, \\fBok\\fR is false, the offsets are 0 and the other results stay what they were.

Feed \\fBjoint-N\\fR with where the joints stand without the compensation, else it would be made up for itself.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
include "pkm.h";

pin in float joint-#[5] "where the joints stand: three screws in mm, wrist in degrees";
pin in float fx "force on the tool at its tip in N, in the tool's axes: z along its axis, y the second axis of the wrist";
pin in float fy;
pin in float fz;
pin in float mx "moment about the tip in N m";
pin in float my;
pin in float mz;
pin out bit ok "whether the results are of this period";
pin out s32 why "why not: a PkmError of pkm.h";
pin out bit inside-box "whether the correction table was fitted here; else it is extrapolated";
pin out float share "distance from the singular surface of the five axes, 1 at home, 0 on it";
pin out float distance-1-2 "distance from the singularity of limbs 1 and 2, 0 there, 1 at the most";
pin out float distance-3 "the same of limb 3";
pin out u32 table-high "checksum of the correction table, as coefficients.json states it: first eight digits";
pin out u32 table-low "last eight digits";
pin out float tip-x-um "what the load moves the tip by along x of the base";
pin out float tip-y-um;
pin out float tip-z-um;
pin out float turn-x-urad "what it turns the tool by about x of the base";
pin out float turn-y-urad;
pin out float turn-z-urad;
pin out float offset-#[5] "what to add to the joints to make up for it: mm, degrees";
pin out float k-11 "K_m at A in A-uvw: N/m, N/rad or N m/m, N m/rad";
pin out float k-12; pin out float k-13; pin out float k-14; pin out float k-15; pin out float k-16;
pin out float k-22; pin out float k-23; pin out float k-24; pin out float k-25; pin out float k-26;
pin out float k-33; pin out float k-34; pin out float k-35; pin out float k-36;
pin out float k-44; pin out float k-45; pin out float k-46;
pin out float k-55; pin out float k-56;
pin out float k-66;
pin out s32 last-ns "time of the last period";
pin io s32 max-ns "longest time of a period; may be set to 0";
function _ fp "all of it; behind motion-controller in the servo thread";
;;


static const double MM = 1e3, DEG = 180.0 / 3.14159265358979323846;

static PkmError compute(struct __comp_state *__comp_inst) {
    const PkmMachine_f64 *machine = pkm_machine_f64();
    const PkmTable_f64 *table = pkm_table_f64();
    const PkmWrist_f64 *wrist = pkm_wrist_f64();
    const PkmJoints_f64 joints = {{{joint(0) / MM, joint(1) / MM, joint(2) / MM}}, {joint(3) / DEG, joint(4) / DEG}};
    const PkmWrench_f64 wrench = {{fx, fy, fz}, {mx, my, mz}};
    PkmToolPlace_f64 place;
    PkmSingularityDistance_f64 distance;
    PkmCorrected_f64 corrected;
    PkmCompensatedTool_f64 loaded;
    PkmError found = pkm_tool_forward_f64(machine, wrist, &joints, &place);
    const PkmPose_f64 *pose = &place.configuration.pose;
    if (found == PKM_ERROR_OK) found = pkm_singularity_distance_f64(machine, pose, &distance);
    if (found == PKM_ERROR_OK) found = pkm_corrected_stiffness_f64(machine, table, pose, &corrected);
    if (found == PKM_ERROR_OK) {
        found = pkm_tool_compensated_f64(machine, table, wrist, &place.tool, &wrench, &place.configuration, &loaded);
    }
    if (found != PKM_ERROR_OK) return found;

    inside_box = corrected.domain == PKM_DOMAIN_INSIDE && loaded.domain == PKM_DOMAIN_INSIDE;
    share = loaded.hold.home_share;
    distance_1_2 = distance.limbs_1_2;
    distance_3 = distance.limb_3;
    tip_x_um = loaded.translation_m[0] * 1e6;
    tip_y_um = loaded.translation_m[1] * 1e6;
    tip_z_um = loaded.translation_m[2] * 1e6;
    turn_x_urad = loaded.rotation_rad[0] * 1e6;
    turn_y_urad = loaded.rotation_rad[1] * 1e6;
    turn_z_urad = loaded.rotation_rad[2] * 1e6;
    for (int i = 0; i < 5; i++) {
        const PkmJoints_f64 *to = &loaded.hold.joints;
        offset(i) = (i < 3 ? to->lengths.q_m[i] * MM : to->beta_rad[i - 3] * DEG) - joint(i);
    }
#define K(I, J) k_##I##J = corrected.stiffness.k_si[I - 1][J - 1]
    K(1, 1), K(1, 2), K(1, 3), K(1, 4), K(1, 5), K(1, 6);
    K(2, 2), K(2, 3), K(2, 4), K(2, 5), K(2, 6);
    K(3, 3), K(3, 4), K(3, 5), K(3, 6);
    K(4, 4), K(4, 5), K(4, 6);
    K(5, 5), K(5, 6);
    K(6, 6);
#undef K
    return found;
}

FUNCTION(_) {
    (void)period;
    const long long begun = rtapi_get_time();
    table_high = pkm_table_checksum() >> 32;
    table_low = (hal_u32_t)pkm_table_checksum();
    why = compute(__comp_inst);
    ok = why == PKM_ERROR_OK;
    if (!ok) {
        /* an offset of another place would push the drives beyond travel */
        for (int i = 0; i < 5; i++) offset(i) = 0;
    }
    last_ns = rtapi_get_time() - begun;
    if (last_ns > max_ns) max_ns = last_ns;
}

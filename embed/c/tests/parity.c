/* Prints what every function computes at poses in and around the table's box, bit for bit, for `cargo xtask c` to hold
 * against the host: a line a call, its name, error and the bits of its result as a double. */

#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "pkm.h"

/* `count` numbers of a result, when there is one. */
#define PRINT(T, S)                                                                                   \
    static void print_##S(const char *name, PkmError error, const void *result, size_t count) {       \
        printf("%s %ld", name, (long)error);                                                          \
        for (size_t i = 0; error == PKM_ERROR_OK && i < count; i++) {                                 \
            T number;                                                                                 \
            memcpy(&number, (const char *)result + i * sizeof(number), sizeof(number));               \
            const double value = (double)number;                                                      \
            uint64_t bits;                                                                            \
            memcpy(&bits, &value, sizeof(bits));                                                      \
            printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));  \
        }                                                                                             \
        putchar('\n');                                                                                \
    }

#define EVERYTHING(T, S)                                                                                          \
    PRINT(T, S)                                                                                                   \
    static void everything_##S(double theta, double sigma, double z0) {                                           \
        static PkmMachine_##S warm;                                                                               \
        const PkmMachine_##S *machine = pkm_machine_##S();                                                        \
        const PkmTable_##S *table = pkm_table_##S();                                                              \
        const PkmPose_##S pose = {(T)theta, (T)sigma, (T)z0};                                                     \
        const PkmWrench_##S wrench = {{100, -50, -400}, {2, -8, 5}}, turned_at = {{150, -20, -600}, {3, -8, 9}};  \
        const PkmPoint_##S tip = {{(T)0.03, (T)-0.02, (T)0.3}};                                                   \
        PkmLengths_##S lengths = {{0, 0, 0}};                                                                     \
        PkmPose_##S forward;                                                                                      \
        PkmJacobian_##S jacobian;                                                                                 \
        PkmSingularityDistance_##S distance;                                                                      \
        PkmTravelMargin_##S margin;                                                                               \
        PkmStiffness_##S stiffness;                                                                               \
        PkmCorrected_##S corrected;                                                                               \
        PkmDeflection_##S deflection = {{0, 0, 0}, {0, 0, 0}}, thermal;                                           \
        const PkmTemperatureRise_##S rise = {{(T)4.5, (T)2.5, (T)-1}, (T)3};                                      \
        PkmCompensated_##S compensated;                                                                           \
        PkmCycle_##S cycle;                                                                                       \
        PkmDomain domain;                                                                                         \
        const PkmWrist_##S *wrist = pkm_wrist_##S();                                                              \
        const PkmConfiguration_##S home = {{0, 0, (T)0.53}, {0, 0}};                                              \
        PkmJoints_##S joints;                                                                                     \
        PkmToolPlace_##S place;                                                                                   \
        PkmTip_##S at_tip;                                                                                        \
        PkmToolSolution_##S solution;                                                                             \
        PkmCompensatedTool_##S loaded;                                                                            \
        const PkmToolMotion_##S motion = {{(T)0.1, (T)-0.05, (T)0.02}, {(T)0.2, (T)0.1, (T)-0.3},                 \
                                          {1, 2, -3}, {(T)0.5, (T)-0.4, (T)0.1}};                                 \
        const PkmJointMotion_##S limits = {{(T)0.05, (T)0.05, (T)0.05, 1, 1}, {2, 2, 2, 10, 10}};                 \
        PkmJointMotion_##S moved = {{0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}};                                            \
        T share;                                                                                                  \
        static uint64_t room[128];                                                                                \
        PkmCompensator_##S *screws = (PkmCompensator_##S *)(void *)room;                                          \
        PkmToolCompensator_##S *axes = (PkmToolCompensator_##S *)(void *)room;                                    \
        const PkmTableUncertainty_##S *doubt = pkm_table_uncertainty_##S();                                       \
        const PkmChecksums sums = {pkm_machine_checksum(), pkm_wrist_checksum(), pkm_table_checksum()};           \
        const PkmReading_##S in = {1, wrench, rise};                                                              \
        PkmCompensatorSettings set;                                                                               \
        PkmKnownCycle_##S known;                                                                                  \
        PkmKnownOffset_##S offset;                                                                                \
        PkmError error;                                                                                           \
        if (pkm_compensator_defaults(&set, sizeof set)) return;                                                   \
        set.outside_box = PKM_OUTSIDE_BOX_EXTRAPOLATE;                                                            \
        print_##S("pose_" #S, PKM_ERROR_OK, &pose, 3);                                                            \
        print_##S("inverse", pkm_inverse_##S(machine, &pose, &lengths), &lengths, 3);                             \
        print_##S("forward", pkm_forward_##S(machine, &lengths, &forward), &forward, 3);                          \
        print_##S("jacobian", pkm_jacobian_##S(machine, &pose, &jacobian), &jacobian, 9);                         \
        print_##S("distance", pkm_singularity_distance_##S(machine, &pose, &distance), &distance, 2);             \
        print_##S("margin", pkm_travel_margin_##S(machine, &lengths, &margin), &margin, 1);                       \
        printf("limb 0 %ld\n", (long)margin.limb);                                                                \
        print_##S("k_p", pkm_stiffness_##S(machine, &pose, &stiffness), &stiffness, 36);                          \
        print_##S("domain", pkm_domain_##S(table, &pose, &domain), &domain, 0);                                   \
        printf("outside 0 %d\n", domain == PKM_DOMAIN_OUTSIDE);                                                   \
        print_##S("k_m", pkm_corrected_stiffness_##S(machine, table, &pose, &corrected), &corrected, 36);         \
        print_##S("deflection", pkm_deflection_##S(machine, table, &pose, &wrench, &turned_at, &deflection),      \
                  &deflection, 6);                                                                                \
        print_##S("compensated", pkm_compensated_##S(machine, &pose, &deflection, &tip, &compensated),            \
                  &compensated, 6);                                                                               \
        print_##S("thermal", pkm_thermal_deflection_##S(machine, &pose, &rise, &thermal), &thermal, 6);           \
        print_##S("cycle", pkm_cycle_##S(machine, table, &pose, &wrench, &tip, &cycle), &cycle, 15);              \
        print_##S("warm", pkm_at_temperature_##S(machine, (T)31.5, &warm, sizeof warm), &warm, 0);                \
        print_##S("k_p_warm", pkm_stiffness_##S(&warm, &pose, &stiffness), &stiffness, 36);                       \
        joints.lengths = lengths;                                                                                 \
        joints.beta_rad[0] = (T)0.3;                                                                              \
        joints.beta_rad[1] = (T)-0.2;                                                                             \
        memset(&place, 0, sizeof(place));                                                                         \
        print_##S("tool_forward", pkm_tool_forward_##S(machine, wrist, &joints, &place), &place, 11);             \
        print_##S("tool_inverse", pkm_tool_inverse_##S(machine, wrist, &place.tool, &home, &solution), &solution, 11); \
        memcpy(at_tip.tip_m, place.tool.tip_m, sizeof(at_tip.tip_m));                                             \
        memcpy(at_tip.beta_rad, joints.beta_rad, sizeof(at_tip.beta_rad));                                        \
        print_##S("tip_inverse", pkm_tip_inverse_##S(machine, wrist, &at_tip, &solution), &solution, 11);         \
        at_tip.beta_rad[1] = (T)0.98;                                                                             \
        print_##S("any_margin", pkm_tip_inverse_any_margin_##S(machine, wrist, &at_tip, &solution), &solution, 11); \
        print_##S("tool_compensated",                                                                             \
                  pkm_tool_compensated_##S(machine, table, wrist, &place.tool, &wrench, &home, &loaded), &loaded, 18);\
        print_##S("joint_motion",                                                                                 \
                  pkm_joint_motion_##S(machine, wrist, &place.configuration, &motion, &moved), &moved, 10);       \
        print_##S("feed_share", pkm_feed_share_##S(&moved, &limits, &share), &share, 1);                          \
        error = pkm_cycle_known_##S(machine, table, doubt, &pose, &wrench, &tip, &known);                         \
        print_##S("cycle_known", error, &known, 15);                                                              \
        print_##S("known", error, &known.known, 4);                                                               \
        if (pkm_compensator_init_##S(screws, sizeof room, &set, sizeof set, &sums)) return;                       \
        error = pkm_compensator_update_known_##S(screws, machine, table, doubt, &pose, &tip, &in, &offset,        \
                                                  sizeof offset);                                                 \
        print_##S("offset", error, &offset, 3);                                                                   \
        print_##S("of_offset", error, &offset.known, 4);                                                          \
        if (pkm_tool_compensator_init_##S(axes, sizeof room, &set, sizeof set, &sums)) return;                    \
        error = pkm_tool_compensator_update_known_##S(axes, machine, table, doubt, wrist, &place.configuration,   \
                                                      &in, &offset, sizeof offset);                               \
        print_##S("tool_offset", error, &offset, 5);                                                              \
        print_##S("of_tool_offset", error, &offset.known, 4);                                                     \
        printf("self_test 0 %d\n", (int)pkm_self_test_##S());                                                     \
    }

EVERYTHING(double, f64)
EVERYTHING(float, f32)

int main(void) {
    for (int t = -3; t <= 3; t++) {
        for (int s = -3; s <= 3; s++) {
            for (int z = -1; z <= 1; z++) {
                const double theta = 0.11 * t, sigma = 0.11 * s, z0 = 0.53 + 0.07 * z;
                everything_f64(theta, sigma, z0);
                everything_f32(theta, sigma, z0);
            }
        }
    }
    return 0;
}

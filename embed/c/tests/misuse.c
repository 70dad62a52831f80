/* What a caller may get wrong: every mistake is an error with a text, and writes nothing. */

#include <fenv.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "pkm.h"

static int failures;

static void check(int holds, const char *what, int line) {
    if (!holds) {
        printf("misuse.c:%d: %s\n", line, what);
        failures++;
    }
}
#define CHECK(condition) check((condition), #condition, __LINE__)

/* The result must hold what it held. */
#define REFUSED(expected, result, call)                                \
    do {                                                               \
        memset(&(result), 0xA5, sizeof(result));                       \
        CHECK((call) == (expected));                                   \
        for (size_t i = 0; i < sizeof(result); i++) {                  \
            CHECK(((const unsigned char *)&(result))[i] == 0xA5);      \
        }                                                              \
    } while (0)

/* What a compensator carries: a refusal changes nothing. */
static void weights(PkmCompensator_f64 *c, const PkmPoint_f64 *tip) {
    const PkmMachine_f64 *machine = pkm_machine_f64();
    const PkmTable_f64 *table = pkm_table_f64();
    const PkmPose_f64 zero = {0.0, 0.0, 0.53}, away = {0.2, -0.15, 0.55}, unset = {0.0, 0.0, 0.0};
    const PkmReading_f64 reading = {1, {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}}, {{0.0, 0.0, 0.0}, 0.0}};
    const PkmWeight_f64 weight = {{600.0, -150.0, -480.0}, {0.02, -0.01, 0.1}};
    const PkmWeight_f64 wrong[] = {{{NAN, 0.0, 0.0}, {0.0, 0.0, 0.0}}, {{0.0, 1.1e5, 0.0}, {0.0, 0.0, 0.0}},
                                   {{0.0, 1.0, 0.0}, {0.0, 0.0, 11.0}}};
    const PkmError refusals[] = {PKM_ERROR_WEIGHT_NOT_FINITE, PKM_ERROR_WEIGHT_TOO_HEAVY, PKM_ERROR_WEIGHT_TOO_FAR};
    static uint64_t before[128];
    PkmOffset_f64 offset;

    CHECK(pkm_compensator_set_weight_f64(c, machine, table, &weight, &zero, tip) == PKM_ERROR_OK);
    memcpy(before, c, pkm_compensator_size_f64());
    for (int i = 0; i < 3; i++) {
        CHECK(pkm_compensator_set_weight_f64(c, machine, table, &wrong[i], &zero, tip) == refusals[i]);
        CHECK(strcmp(pkm_error_text(refusals[i]), "unknown error") != 0);
    }
    CHECK(pkm_compensator_set_weight_f64(c, machine, table, &weight, &unset, tip) == PKM_ERROR_WEIGHT_NO_REFERENCE);
    CHECK(pkm_compensator_set_weight_f64(c, machine, table, NULL, &zero, tip) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_compensator_set_weight_f64(c, machine, table, &weight, NULL, tip) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_compensator_set_weight_f64(NULL, machine, table, &weight, &zero, tip) == PKM_ERROR_NULL_POINTER);
    CHECK(memcmp(before, c, pkm_compensator_size_f64()) == 0);
    CHECK(pkm_compensator_update_f64(c, machine, table, &zero, tip, &reading, &offset, sizeof offset) == PKM_ERROR_OK);
    CHECK(offset.screws_m[0] == 0.0 && offset.screws_m[1] == 0.0 && offset.screws_m[2] == 0.0);
    CHECK(pkm_compensator_update_f64(c, machine, table, &away, tip, &reading, &offset, sizeof offset) == PKM_ERROR_OK);
    CHECK(offset.screws_m[0] != 0.0);
    CHECK(pkm_compensator_clear_weight_f64(c) == PKM_ERROR_OK && pkm_compensator_clear_weight_f64(NULL) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_compensator_reset_f64(c) == PKM_ERROR_OK);
    CHECK(pkm_compensator_update_f64(c, machine, table, &away, tip, &reading, &offset, sizeof offset) == PKM_ERROR_OK);
    CHECK(offset.screws_m[0] == 0.0);
}

/* A compensator's memory, machine, settings, inputs. */
static void compensators(void) {
    const PkmMachine_f64 *machine = pkm_machine_f64();
    const PkmTable_f64 *table = pkm_table_f64();
    const PkmPose_f64 pose = {0.1, -0.05, 0.53};
    const PkmPoint_f64 tip = {{0.0, 0.0, 0.3}};
    const PkmConfiguration_f64 home = {{0.0, 0.0, 0.53}, {0.0, 0.0}};
    const PkmReading_f64 reading = {1, {{0.0, 0.0, -400.0}, {0.0, 0.0, 0.0}}, {{NAN, NAN, NAN}, NAN}};
    const PkmChecksums ours = {pkm_machine_checksum(), pkm_wrist_checksum(), pkm_table_checksum()};
    static uint64_t room[128], tool_room[128];
    PkmCompensator_f64 *c = (PkmCompensator_f64 *)(void *)room;
    PkmToolCompensator_f64 *tool = (PkmToolCompensator_f64 *)(void *)tool_room;
    const size_t size = pkm_compensator_size_f64();
    PkmCompensatorSettings set;
    PkmOffset_f64 offset;

    CHECK(size > 0 && size <= sizeof room && pkm_tool_compensator_size_f64() <= sizeof tool_room);
    CHECK(pkm_compensator_size_f32() < size && pkm_compensator_align_f64() == 8 && pkm_tool_compensator_align_f32() == 8);
    REFUSED(PKM_ERROR_WRONG_SIZE, set, pkm_compensator_defaults(&set, sizeof set - 8));
    CHECK(pkm_compensator_defaults(NULL, sizeof set) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_compensator_defaults(&set, sizeof set) == PKM_ERROR_OK);
    CHECK(set.gain == 0.7 && set.period_s == 1e-3 && set.outside_box == PKM_OUTSIDE_BOX_FADE);
    CHECK(pkm_compensator_setting_out_of_range(&set, sizeof set) == NULL);

    /* memory that nothing was made in */
    REFUSED(PKM_ERROR_NOT_INITIALISED, offset,
            pkm_compensator_update_f64(c, machine, table, &pose, &tip, &reading, &offset, sizeof offset));
    CHECK(pkm_compensator_reset_f64(c) == PKM_ERROR_NOT_INITIALISED);
    CHECK(pkm_compensator_reset_f64(NULL) == PKM_ERROR_NULL_POINTER);

    REFUSED(PKM_ERROR_WRONG_SIZE, room, pkm_compensator_init_f64(c, size - 1, &set, sizeof set, &ours));
    REFUSED(PKM_ERROR_WRONG_SIZE, room, pkm_compensator_init_f64(c, size, &set, sizeof set - 8, &ours));
    REFUSED(PKM_ERROR_NULL_POINTER, room, pkm_compensator_init_f64(c, size, NULL, sizeof set, &ours));
    REFUSED(PKM_ERROR_NULL_POINTER, room, pkm_compensator_init_f64(c, size, &set, sizeof set, NULL));
    CHECK(pkm_compensator_init_f64(NULL, size, &set, sizeof set, &ours) == PKM_ERROR_NULL_POINTER);
    REFUSED(PKM_ERROR_MISALIGNED, room,
            pkm_compensator_init_f64((PkmCompensator_f64 *)(void *)((char *)room + 4), size, &set, sizeof set, &ours));
    const PkmChecksums others[] = {{1, ours.wrist, ours.table}, {ours.machine, 1, ours.table}, {ours.machine, ours.wrist, 1}};
    const PkmError refusals[] = {PKM_ERROR_OTHER_MACHINE, PKM_ERROR_OTHER_WRIST, PKM_ERROR_OTHER_TABLE};
    for (int i = 0; i < 3; i++) {
        REFUSED(refusals[i], room, pkm_compensator_init_f64(c, size, &set, sizeof set, &others[i]));
    }
    PkmCompensatorSettings wrong = set;
    wrong.gain = 1.01;
    REFUSED(PKM_ERROR_SETTING_OUT_OF_RANGE, room, pkm_compensator_init_f64(c, size, &wrong, sizeof wrong, &ours));
    CHECK(strcmp(pkm_compensator_setting_out_of_range(&wrong, sizeof wrong), "gain") == 0);
    wrong = set;
    wrong.outside_box = 3;
    REFUSED(PKM_ERROR_SETTING_OUT_OF_RANGE, room, pkm_compensator_init_f64(c, size, &wrong, sizeof wrong, &ours));
    CHECK(strcmp(pkm_compensator_setting_out_of_range(&wrong, sizeof wrong), "outside_box") == 0);
    CHECK(strcmp(pkm_compensator_setting_out_of_range(&set, sizeof set - 8), "settings_size") == 0);

    CHECK(pkm_compensator_init_f64(c, sizeof room, &set, sizeof set, &ours) == PKM_ERROR_OK);
    REFUSED(PKM_ERROR_NULL_POINTER, offset,
            pkm_compensator_update_f64(c, NULL, table, &pose, &tip, &reading, &offset, sizeof offset));
    REFUSED(PKM_ERROR_NULL_POINTER, offset,
            pkm_compensator_update_f64(c, machine, table, &pose, &tip, NULL, &offset, sizeof offset));
    CHECK(pkm_compensator_update_f64(c, machine, table, &pose, &tip, &reading, NULL, sizeof offset) == PKM_ERROR_NULL_POINTER);
    /* the room of a header of another version, which the library must not write to */
    REFUSED(PKM_ERROR_WRONG_SIZE, offset,
            pkm_compensator_update_f64(c, machine, table, &pose, &tip, &reading, &offset, sizeof offset - 8));
    REFUSED(PKM_ERROR_WRONG_SIZE, offset,
            pkm_compensator_update_f64(c, machine, table, &pose, &tip, &reading, &offset, sizeof(PkmOffset_f32)));
    PkmKnownOffset_f64 known;
    REFUSED(PKM_ERROR_WRONG_SIZE, known,
            pkm_compensator_update_known_f64(c, machine, table, pkm_table_uncertainty_f64(), &pose, &tip, &reading, &known,
                                             sizeof known - 8));
    REFUSED(PKM_ERROR_WRONG_SIZE, known,
            pkm_compensator_update_learned_f64(c, machine, table, NULL, NULL, &pose, &tip, &reading, &known, sizeof offset));
    /* a sensor that lies is a fault with a reaction, and no error */
    CHECK(pkm_compensator_update_f64(c, machine, table, &pose, &tip, &reading, &offset, sizeof offset) == PKM_ERROR_OK);
    CHECK(offset.fault == PKM_ERROR_TEMPERATURE_LOST && offset.screws_m[0] != 0.0 && offset.wrist_rad[0] == 0.0);
    CHECK(pkm_compensator_reset_f64(c) == PKM_ERROR_OK);
    weights(c, &tip);

    /* a compensator of the other kind, and what was left of it */
    memcpy(tool_room, room, sizeof room);
    REFUSED(PKM_ERROR_NOT_INITIALISED, offset,
            pkm_tool_compensator_update_f64(tool, machine, table, pkm_wrist_f64(), &home, &reading, &offset, sizeof offset));
    CHECK(pkm_tool_compensator_init_f64(tool, sizeof tool_room, &set, sizeof set, &ours) == PKM_ERROR_OK);
    REFUSED(PKM_ERROR_WRONG_SIZE, offset,
            pkm_tool_compensator_update_f64(tool, machine, table, pkm_wrist_f64(), &home, &reading, &offset, sizeof offset + 8));
    REFUSED(PKM_ERROR_WRONG_SIZE, known,
            pkm_tool_compensator_update_known_f64(tool, machine, table, pkm_table_uncertainty_f64(), pkm_wrist_f64(), &home,
                                                  &reading, &known, sizeof known + 8));
    REFUSED(PKM_ERROR_WRONG_SIZE, known,
            pkm_tool_compensator_update_learned_f64(tool, machine, table, NULL, NULL, pkm_wrist_f64(), &home, &reading, &known,
                                                    sizeof offset));
    CHECK(pkm_tool_compensator_update_f64(tool, machine, table, pkm_wrist_f64(), &home, &reading, &offset, sizeof offset) == PKM_ERROR_OK);
}

/* A processor in another rounding mode is found, where the C library can set one: newlib for the Cortex-M has none. */
static void self_test(void) {
#ifdef FE_TOWARDZERO
    const int usual = fegetround();
    CHECK(fesetround(FE_TOWARDZERO) == 0);
    const PkmError single = pkm_self_test_f32(), twice = pkm_self_test_f64();
    CHECK(fesetround(usual) == 0);
    CHECK(single == PKM_ERROR_SELF_TEST_KINEMATICS && twice == PKM_ERROR_SELF_TEST_KINEMATICS);
#endif
    CHECK(pkm_self_test_f32() == PKM_ERROR_OK && pkm_self_test_f64() == PKM_ERROR_OK);
}

int main(void) {
    const PkmMachine_f64 *machine = pkm_machine_f64();
    const PkmTable_f64 *table = pkm_table_f64();
    const PkmPose_f64 pose = {0.1, -0.05, 0.53};
    const PkmWrench_f64 wrench = {{120.0, 0.0, -400.0}, {0.0, 0.0, 5.0}};
    const PkmPoint_f64 tip = {{0.0, 0.0, 0.3}};
    PkmLengths_f64 lengths;
    PkmDeflection_f64 deflection;
    PkmCompensated_f64 compensated;
    PkmCycle_f64 cycle;
    PkmDomain domain;
    PkmTravelMargin_f64 margin;
    static PkmMachine_f64 warm;
    const PkmWrist_f64 *wrist = pkm_wrist_f64();
    const PkmTool_f64 tool = {{-0.2, 0.0, 1.13}, {0.0, 0.0, 1.0}};
    const PkmConfiguration_f64 home = {{0.0, 0.0, 0.53}, {0.0, 0.0}};
    const PkmJoints_f64 joints = {{{0.55, 0.55, 0.53}}, {0.0, 0.0}};
    const PkmTip_f64 too_far = {{-0.2, 0.0, 11.3}, {0.0, 0.0}}, off_side = {{-0.2, 1.13, 0.0}, {0.0, 0.0}};
    PkmToolPlace_f64 place;
    PkmToolSolution_f64 solution;
    PkmCompensatedTool_f64 loaded;

    REFUSED(PKM_ERROR_NULL_POINTER, lengths, pkm_inverse_f64(NULL, &pose, &lengths));
    REFUSED(PKM_ERROR_NULL_POINTER, lengths, pkm_inverse_f64(machine, NULL, &lengths));
    CHECK(pkm_inverse_f64(machine, &pose, NULL) == PKM_ERROR_NULL_POINTER);
    REFUSED(PKM_ERROR_NULL_POINTER, cycle, pkm_cycle_f64(machine, NULL, &pose, &wrench, &tip, &cycle));
    REFUSED(PKM_ERROR_NULL_POINTER, cycle, pkm_cycle_f64(machine, table, &pose, NULL, &tip, &cycle));
    REFUSED(PKM_ERROR_NULL_POINTER, cycle, pkm_cycle_f64(machine, table, &pose, &wrench, NULL, &cycle));
    REFUSED(PKM_ERROR_NULL_POINTER, domain, pkm_domain_f64(NULL, &pose, &domain));
    REFUSED(PKM_ERROR_NULL_POINTER, place, pkm_tool_forward_f64(machine, NULL, &joints, &place));
    REFUSED(PKM_ERROR_NULL_POINTER, solution, pkm_tool_inverse_f64(machine, wrist, &tool, NULL, &solution));
    REFUSED(PKM_ERROR_NULL_POINTER, solution, pkm_tip_inverse_f64(machine, wrist, NULL, &solution));
    REFUSED(PKM_ERROR_OUT_OF_TRAVEL_LIMB1, solution, pkm_tip_inverse_f64(machine, wrist, &too_far, &solution));
    REFUSED(PKM_ERROR_TOOL_UNREACHABLE, solution, pkm_tip_inverse_f64(machine, wrist, &off_side, &solution));
    REFUSED(PKM_ERROR_NULL_POINTER, loaded,
            pkm_tool_compensated_f64(machine, NULL, wrist, &tool, &wrench, &home, &loaded));

    /* aligned for nothing */
    union {
        PkmPose_f64 pose;
        unsigned char bytes[sizeof(PkmPose_f64) + 1];
    } raw;
    memset(&raw, 0, sizeof(raw));
    const PkmPose_f64 *crooked = (const PkmPose_f64 *)(const void *)(raw.bytes + 1);
    REFUSED(PKM_ERROR_MISALIGNED, lengths, pkm_inverse_f64(machine, crooked, &lengths));
    REFUSED(PKM_ERROR_MISALIGNED, raw.pose,
            pkm_forward_f64(machine, &lengths, (PkmPose_f64 *)(void *)(raw.bytes + 1)));

    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < 3; i++) {
        const PkmPose_f64 bad_pose = {0.1, bad[i], 0.53};
        const PkmWrench_f64 bad_wrench = {{0.0, 0.0, 0.0}, {0.0, bad[i], 0.0}};
        const PkmPoint_f64 bad_tip = {{0.0, bad[i], 0.3}};
        const PkmLengths_f64 bad_lengths = {{0.5, 0.5, bad[i]}};
        const PkmDeflection_f64 bad_deflection = {{bad[i], 0.0, 0.0}, {0.0, 0.0, 0.0}};
        REFUSED(PKM_ERROR_NOT_FINITE, lengths, pkm_inverse_f64(machine, &bad_pose, &lengths));
        REFUSED(PKM_ERROR_NOT_FINITE, domain, pkm_domain_f64(table, &bad_pose, &domain));
        REFUSED(PKM_ERROR_NOT_FINITE, margin, pkm_travel_margin_f64(machine, &bad_lengths, &margin));
        REFUSED(PKM_ERROR_NOT_FINITE, deflection,
                pkm_deflection_f64(machine, table, &pose, &bad_wrench, NULL, &deflection));
        REFUSED(PKM_ERROR_NOT_FINITE, deflection,
                pkm_deflection_f64(machine, table, &pose, &wrench, &bad_wrench, &deflection));
        const PkmTemperatureRise_f64 bad_limb = {{0.0, bad[i], 0.0}, 0.0}, bad_platforms = {{0.0, 0.0, 0.0}, bad[i]};
        REFUSED(PKM_ERROR_NOT_FINITE, deflection, pkm_thermal_deflection_f64(machine, &pose, &bad_limb, &deflection));
        REFUSED(PKM_ERROR_NOT_FINITE, deflection, pkm_thermal_deflection_f64(machine, &pose, &bad_platforms, &deflection));
        REFUSED(PKM_ERROR_NOT_FINITE, warm, pkm_at_temperature_f64(machine, bad[i], &warm, sizeof warm));
        REFUSED(PKM_ERROR_NOT_FINITE, compensated,
                pkm_compensated_f64(machine, &pose, &bad_deflection, &tip, &compensated));
        REFUSED(PKM_ERROR_NOT_FINITE, cycle, pkm_cycle_f64(machine, table, &pose, &bad_wrench, &tip, &cycle));
        REFUSED(PKM_ERROR_NOT_FINITE, cycle, pkm_cycle_f64(machine, table, &pose, &wrench, &bad_tip, &cycle));
        const PkmTool_f64 bad_tool = {{0.0, 0.0, bad[i]}, {0.0, 0.0, 1.0}};
        const PkmJoints_f64 bad_joints = {{{0.55, 0.55, 0.53}}, {bad[i], 0.0}};
        REFUSED(PKM_ERROR_NOT_FINITE, place, pkm_tool_forward_f64(machine, wrist, &bad_joints, &place));
        REFUSED(PKM_ERROR_NOT_FINITE, solution, pkm_tool_inverse_f64(machine, wrist, &bad_tool, &home, &solution));
        REFUSED(PKM_ERROR_NOT_FINITE, loaded,
                pkm_tool_compensated_f64(machine, table, wrist, &tool, &bad_wrench, &home, &loaded));
    }
    const PkmTool_f64 aside = {{0.0, 4.0, 0.9}, {0.0, 0.0, 1.0}}, no_axis = {{0.0, 0.0, 1.1}, {0.0, 0.0, 0.0}};
    const PkmConfiguration_f64 singular = {{0.0, 0.0, 0.53}, {0.0, 1.0}};
    const PkmJoints_f64 bent = {{{0.55, 0.55, 0.53}}, {0.0, 2.0}};
    solution.normalised_determinant = 0.0;
    CHECK(pkm_tool_inverse_f64(machine, wrist, &aside, &home, &solution) != PKM_ERROR_OK && solution.normalised_determinant == 0.0);
    REFUSED(PKM_ERROR_NOT_FINITE, solution, pkm_tool_inverse_f64(machine, wrist, &no_axis, &home, &solution));
    REFUSED(PKM_ERROR_TOOL_SINGULAR, solution, pkm_tool_inverse_f64(machine, wrist, &tool, &singular, &solution));
    REFUSED(PKM_ERROR_WRIST_LIMIT2, place, pkm_tool_forward_f64(machine, wrist, &bent, &place));

    const PkmPose_f64 high = {0.1, 0.0, 0.9}, turned = {1.6, 0.0, 0.53};
    const PkmPoint_f64 at_a = {{0.0, 0.0, 0.0}};
    REFUSED(PKM_ERROR_OUT_OF_TRAVEL_LIMB1, lengths, pkm_inverse_f64(machine, &high, &lengths));
    REFUSED(PKM_ERROR_UNREACHABLE, lengths, pkm_inverse_f64(machine, &turned, &lengths));
    /* no pose has such lengths; that they are out of travel, or not finite, is said first */
    const PkmLengths_f64 long_and_short = {{0.6, 9.0, 0.1}}, long_and_nan = {{NAN, 9.0, 0.1}};
    PkmPose_f64 reached = pose;
    REFUSED(PKM_ERROR_OUT_OF_TRAVEL_LIMB2, reached, pkm_forward_f64(machine, &long_and_short, &reached));
    REFUSED(PKM_ERROR_NOT_FINITE, reached, pkm_forward_f64(machine, &long_and_nan, &reached));
    const PkmJoints_f64 far_and_nan = {{{0.6, 9.0, 0.1}}, {NAN, 0.0}};
    REFUSED(PKM_ERROR_OUT_OF_TRAVEL_LIMB2, place, pkm_tool_forward_f64(machine, wrist, &far_and_nan, &place));
    REFUSED(PKM_ERROR_NOT_COMPENSABLE, cycle, pkm_cycle_f64(machine, table, &pose, &wrench, &at_a, &cycle));

    /* result in the memory of the input */
    CHECK(strcmp(pkm_version(), PKM_VERSION) == 0);
    CHECK(pkm_machine_size_f64() == sizeof warm && pkm_machine_size_f32() == sizeof(PkmMachine_f32));
    CHECK(pkm_verify_f64() == PKM_ERROR_OK && pkm_verify_f32() == PKM_ERROR_OK);
    /* a header of a version with fewer effects */
    REFUSED(PKM_ERROR_WRONG_SIZE, warm, pkm_at_temperature_f64(machine, 25.0, &warm, sizeof warm - sizeof(double)));
    CHECK(pkm_at_temperature_f64(machine, 25.0, &warm, sizeof warm) == PKM_ERROR_OK);
    CHECK(pkm_at_temperature_f64(&warm, 20.0, &warm, sizeof warm) == PKM_ERROR_OK);
    CHECK(pkm_cycle_f64(&warm, table, &pose, &wrench, &tip, &cycle) == PKM_ERROR_OK);

    compensators();
    self_test();

    for (int32_t code = -2; code < 300; code++) {
        CHECK(pkm_error_text(code) != NULL && strlen(pkm_error_text(code)) > 0);
    }
    CHECK(strcmp(pkm_error_text(-1), pkm_error_text(PKM_ERROR_UNKNOWN)) == 0);
    CHECK(strcmp(pkm_error_text(PKM_ERROR_NULL_POINTER), "a pointer is null") == 0);
    puts(failures ? "misuse: FAILED" : "misuse: every mistake is an error");
    return failures != 0;
}

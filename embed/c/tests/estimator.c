/* Lets an estimator read good and bad readings, saves and restores what it knows, and compensates with it, for `cargo xtask c` to
 * hold against the host: a line a reading with its error and the bits of chi squared and of sums over all that is known. What may be
 * got wrong is here too. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "pkm.h"

#define READINGS 120
#define COUNT 6

#define CHECK(condition)                                             \
    do {                                                             \
        if (!(condition)) {                                          \
            printf("estimator.c:%d: %s\n", __LINE__, #condition);    \
            return 1;                                                \
        }                                                            \
    } while (0)

static uint32_t state;

static int32_t next(int32_t from, int32_t below) {
    state = state * 1664525u + 1013904223u;
    return from + (int32_t)((state >> 8) % (uint32_t)(below - from));
}

static uint64_t sum;

static void add(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof(bits));
    sum = (sum ^ bits) * 0x100000001b3u;
}

static void print(uint64_t bits) {
    printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));
}

static void print_number(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof(bits));
    print(bits);
}

static PkmEstimatorSettings settings(void) {
    static const int32_t learned[COUNT] = {PKM_AMPLITUDE_LIMB1, PKM_AMPLITUDE_LIMB2, PKM_AMPLITUDE_LIMB3,
                                           PKM_AMPLITUDE_BASE_Z, PKM_AMPLITUDE_TOOL_RU, PKM_AMPLITUDE_RISE};
    static const double deviations[COUNT] = {1e-9, 1e-9, 1e-9, 1e-9, 1e-8, 1.0};
    PkmEstimatorSettings set;
    memset(&set, 0, sizeof set);
    set.count = COUNT;
    set.model_share = 0.02;
    for (int i = 0; i < COUNT; i++) {
        const double d = deviations[i];
        const PkmAmplitudeSettings own = {learned[i], 0.0, d, d / 128, -4 * d, 32 * d, d / 64, d / 1024};
        set.amplitudes[i] = own;
    }
    return set;
}

/* Slots and sequence of the saved states, and one that is torn. */
static uint8_t slots[2][1024];

static int misuse(void) {
    static uint64_t room[512];
    PkmEstimatorSettings set = settings();
    PkmEstimatorState known;
    PkmNewest newest;
    uint32_t amplitude = 9;
    PkmEstimator_f64 *e = (PkmEstimator_f64 *)(void *)room;
    const PkmTable_f64 *t = pkm_table_f64();
    const size_t size = pkm_estimator_size_f64(), bytes = pkm_estimator_state_bytes(COUNT);
    CHECK(size <= sizeof room && pkm_estimator_size_f32() < size && 8 % pkm_estimator_align_f64() == 0);
    CHECK(pkm_estimator_state_f64(e, &known, sizeof known) == PKM_ERROR_NOT_INITIALISED);
    CHECK(pkm_estimator_follow_f64(e, 1e-3) == PKM_ERROR_NOT_INITIALISED);
    CHECK(pkm_estimator_init_f64(e, size - 1, &set, sizeof set) == PKM_ERROR_WRONG_SIZE);
    CHECK(pkm_estimator_init_f64(e, size, &set, sizeof set - 8) == PKM_ERROR_WRONG_SIZE);
    CHECK(pkm_estimator_init_f64(e, size, NULL, sizeof set) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_estimator_setting_out_of_range(&set, sizeof set, &amplitude) == NULL && amplitude == 9);
    set.amplitudes[2].alarm = 0.0;
    CHECK(pkm_estimator_init_f64(e, size, &set, sizeof set) == PKM_ERROR_SETTING_OUT_OF_RANGE);
    CHECK(!strcmp(pkm_estimator_setting_out_of_range(&set, sizeof set, &amplitude), "alarm") && amplitude == 3);
    set = settings();
    set.amplitudes[5].amplitude = 4;
    CHECK(!strcmp(pkm_estimator_setting_out_of_range(&set, sizeof set, &amplitude), "amplitude") && amplitude == 6);
    set.amplitudes[5].amplitude = PKM_AMPLITUDE_LIMB1;
    CHECK(!strcmp(pkm_estimator_setting_out_of_range(&set, sizeof set, &amplitude), "amplitude") && amplitude == 6);
    CHECK(!strcmp(pkm_estimator_setting_out_of_range(&set, sizeof set - 8, &amplitude), "settings_size") && amplitude == 0);
    for (uint32_t count = 0; count <= 9; count += 9) {
        set.count = count;
        CHECK(!strcmp(pkm_estimator_setting_out_of_range(&set, sizeof set, NULL), "count"));
        CHECK(pkm_estimator_newest(count, slots[0], slots[1], sizeof slots[0], &newest) == PKM_ERROR_SETTING_OUT_OF_RANGE);
    }
    for (set = settings(), set.count = 1; set.count <= PKM_AMPLITUDES; set.count++) {
        set.amplitudes[6] = set.amplitudes[7] = set.amplitudes[0];
        set.amplitudes[6].amplitude = PKM_AMPLITUDE_TOOL_U;
        set.amplitudes[7].amplitude = PKM_AMPLITUDE_BASE_RX;
        CHECK(pkm_estimator_init_f64(e, size, &set, sizeof set) == PKM_ERROR_OK);
        CHECK(pkm_estimator_save_f64(e, t, 1, slots[0], pkm_estimator_state_bytes(set.count) - 1) == PKM_ERROR_WRONG_SIZE);
        CHECK(pkm_estimator_save_f64(e, t, 1, slots[0], pkm_estimator_state_bytes(set.count)) == PKM_ERROR_OK);
    }
    set = settings();
    CHECK(pkm_estimator_init_f64(e, size, &set, sizeof set) == PKM_ERROR_OK);
    CHECK(pkm_estimator_state_f64(e, &known, sizeof known - 8) == PKM_ERROR_WRONG_SIZE);
    CHECK(pkm_estimator_follow_f64(e, NAN) == PKM_ERROR_NOT_FINITE);
    /* of eight amplitudes */
    CHECK(pkm_estimator_restore_f64(e, t, slots[0], sizeof slots[0]) == PKM_ERROR_STATE_NOT_WHOLE);
    memset(slots, 0xff, sizeof slots);
    CHECK(pkm_estimator_newest(COUNT, slots[0], slots[1], bytes, &newest) == PKM_ERROR_STATE_NOT_WHOLE);
    CHECK(pkm_estimator_newest(COUNT, slots[0], slots[1], bytes - 1, &newest) == PKM_ERROR_WRONG_SIZE);
    CHECK(pkm_estimator_restore_f64(e, t, slots[0], bytes - 1) == PKM_ERROR_WRONG_SIZE);
    CHECK(pkm_estimator_newest(COUNT, slots[0], NULL, bytes, &newest) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_estimator_save_f64(e, t, 1, NULL, bytes) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_estimator_restore_f64(e, t, NULL, bytes) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_estimator_save_f64(e, NULL, 1, slots[0], bytes) == PKM_ERROR_NULL_POINTER);
    CHECK(pkm_estimator_restore_f64(e, NULL, slots[0], bytes) == PKM_ERROR_NULL_POINTER);
    /* of other amplitudes */
    CHECK(pkm_estimator_save_f64(e, t, 1, slots[0], bytes) == PKM_ERROR_OK);
    set.amplitudes[0].amplitude = PKM_AMPLITUDE_TOOL_U;
    CHECK(pkm_estimator_init_f64(e, size, &set, sizeof set) == PKM_ERROR_OK);
    CHECK(pkm_estimator_restore_f64(e, t, slots[0], bytes) == PKM_ERROR_OTHER_STATE);
    memset(slots, 0xff, sizeof slots);
    return 0;
}

#define RUN(T, S)                                                                                                      \
    static int run_##S(void) {                                                                                         \
        static uint64_t room[512], screws_room[128], axes_room[128];                                                   \
        const PkmEstimatorSettings set = settings();                                                                   \
        const PkmChecksums sums = {pkm_machine_checksum(), pkm_wrist_checksum(), pkm_table_checksum()};                \
        const PkmMachine_##S *machine = pkm_machine_##S();                                                             \
        const PkmTable_##S *table = pkm_table_##S();                                                                   \
        PkmEstimator_##S *e = (PkmEstimator_##S *)(void *)room;                                                        \
        PkmCompensator_##S *screws = (PkmCompensator_##S *)(void *)screws_room;                                        \
        PkmToolCompensator_##S *axes = (PkmToolCompensator_##S *)(void *)axes_room;                                    \
        PkmCompensatorSettings compensation;                                                                           \
        const size_t bytes = pkm_estimator_state_bytes(COUNT);                                                         \
        PkmNewest newest;                                                                                              \
        uint32_t sequence = 0;                                                                                         \
        state = 1;                                                                                                     \
        sum = 0;                                                                                                       \
        memset(slots, 0xff, sizeof slots);                                                                             \
        CHECK(pkm_compensator_defaults(&compensation, sizeof compensation) == PKM_ERROR_OK);                           \
        compensation.stuck_s = 0;                                                                                      \
        CHECK(pkm_estimator_init_##S(e, sizeof room, &set, sizeof set) == PKM_ERROR_OK);                               \
        CHECK(pkm_compensator_init_##S(screws, sizeof screws_room, &compensation, sizeof compensation, &sums) == 0);   \
        CHECK(pkm_tool_compensator_init_##S(axes, sizeof axes_room, &compensation, sizeof compensation, &sums) == 0);  \
        for (int32_t n = 0; n < READINGS; n++) {                                                                       \
            PkmTouch_##S touch;                                                                                        \
            PkmTipReading_##S read[7];                                                                                 \
            PkmLearned_##S learned;                                                                                    \
            PkmDeflection_##S moved;                                                                                   \
            PkmEstimatorState known;                                                                                   \
            PkmKnownOffset_##S offset;                                                                                 \
            size_t components = 3;                                                                                     \
            memset(&touch, 0, sizeof touch);                                                                           \
            memset(&read, 0, sizeof read);                                                                             \
            memset(&learned, 0, sizeof learned);                                                                       \
            touch.time_s = 1000u + 600u * (uint32_t)n;                                                                 \
            touch.pose.theta_rad = (T)(next(-50, 51) / 256.0);                                                         \
            touch.pose.sigma_rad = (T)(next(-50, 51) / 256.0);                                                         \
            touch.pose.z0_m = (T)(next(520, 560) / 1024.0);                                                            \
            if (n % 20 == 9) touch.pose.theta_rad = (T)0.375;                                                          \
            for (int i = 0; i < 3; i++) touch.wrench.force_n[i] = (T)next(-1000, 1001);                                \
            CHECK(pkm_deflection_##S(machine, table, &touch.pose, &touch.wrench, NULL, &moved) == PKM_ERROR_OK);       \
            for (int i = 0; i < 3; i++) {                                                                              \
                /* the machine is a sixteenth softer from the middle on */                                             \
                const T share = n < READINGS / 2 ? 1 : (T)1.0625;                                                      \
                const T softer = moved.translation_m[i] * share;                                                       \
                read[i].direction[i] = 1;                                                                              \
                read[i].read = softer + (T)(next(-300, 301) / 1073741824.0);                                           \
                read[i].deviation = (T)(1 / 4194304.0);                                                                \
            }                                                                                                          \
            if (n % 10 == 3) read[1].read = NAN;                                                                       \
            if (n % 10 == 4) touch.time_s = 1000;                                                                      \
            if (n % 10 == 5) components = n % 20 == 5 ? 0 : 7;                                                         \
            if (n % 10 == 6) for (int i = 0; i < 3; i++) read[i].direction[i] = 0;                                     \
            if (n % 10 == 7) for (int i = 0; i < 3; i++) read[i].read = -read[i].read;                                 \
            if (n % 20 == 8) read[0].read *= 64;                                                                       \
            if (n % 20 == 18) touch.pose.z0_m = 9;                                                                     \
            PkmError error = pkm_estimator_learn_##S(e, machine, table, &touch, read, components, &learned);           \
            CHECK(pkm_estimator_follow_##S(e, 1) == PKM_ERROR_OK);                                                     \
            if (n % 7 == 6) {                                                                                          \
                /* over the older one; now and then the power goes, and the one before is read back */                 \
                uint32_t to = 0;                                                                                       \
                if (pkm_estimator_newest(COUNT, slots[0], slots[1], sizeof slots[0], &newest) == PKM_ERROR_OK) {       \
                    CHECK(newest.sequence == sequence);                                                                \
                    to = 1 - newest.slot;                                                                              \
                }                                                                                                      \
                sequence++;                                                                                            \
                CHECK(pkm_estimator_save_##S(e, table, sequence, slots[to], sizeof slots[to]) == PKM_ERROR_OK);        \
                if (n % 14 == 13) {                                                                                    \
                    memset(slots[to] + (size_t)n, 0xff, bytes - (size_t)n);                                            \
                    CHECK(pkm_estimator_restore_##S(e, table, slots[to], bytes) == PKM_ERROR_STATE_NOT_WHOLE);         \
                    CHECK(pkm_estimator_newest(COUNT, slots[0], slots[1], bytes, &newest) == PKM_ERROR_OK);            \
                    sequence--;                                                                                        \
                    CHECK(newest.slot == 1 - to && newest.sequence == sequence);                                       \
                    CHECK(pkm_estimator_restore_##S(e, table, slots[newest.slot], bytes) == PKM_ERROR_OK);             \
                }                                                                                                      \
            }                                                                                                          \
            CHECK(pkm_estimator_state_##S(e, &known, sizeof known) == PKM_ERROR_OK);                                   \
            add(known.began_s);                                                                                        \
            uint32_t alarms = 0;                                                                                       \
            for (int i = 0; i < PKM_AMPLITUDES; i++) {                                                                 \
                const PkmAmplitudeState *own = &known.amplitudes[i];                                                   \
                add(own->value);                                                                                       \
                add(own->deviation);                                                                                   \
                add(own->applied);                                                                                     \
                add(own->change);                                                                                      \
                add(own->probability);                                                                                 \
                add(own->alarm_readings);                                                                              \
                add(learned.changed[i] != 0);                                                                          \
                alarms |= (uint32_t)(own->alarm != 0) << i;                                                            \
            }                                                                                                          \
            add(learned.domain == PKM_DOMAIN_OUTSIDE);                                                                 \
            const PkmReading_##S in = {1, {{100, -50, -400}, {2, -8, 5}}, {{0, 0, 0}, 0}};                             \
            const PkmConfiguration_##S stands = {{(T)0.125, (T)-0.0625, (T)0.53125}, {(T)0.125, (T)-0.125}};           \
            const PkmPoint_##S tip = {{(T)0.03125, (T)-0.015625, (T)0.3125}};                                          \
            const PkmTableUncertainty_##S *doubt = n % 2 ? NULL : pkm_table_uncertainty_##S();                         \
            CHECK(pkm_compensator_update_learned_##S(screws, machine, table, doubt, e, &stands.pose, &tip, &in,        \
                                                     &offset, sizeof offset) == PKM_ERROR_OK);                         \
            CHECK(offset.is_known);                                                                                    \
            for (int i = 0; i < 3; i++) add(offset.offset.screws_m[i]), add(offset.known.u95_m[i]);                    \
            add(offset.known.share);                                                                                   \
            CHECK(pkm_tool_compensator_update_learned_##S(axes, machine, table, doubt, e, pkm_wrist_##S(), &stands,    \
                                                          &in, &offset, sizeof offset) == PKM_ERROR_OK);               \
            for (int i = 0; i < 3; i++) add(offset.offset.screws_m[i]), add(offset.known.u95_m[i]);                    \
            for (int i = 0; i < 2; i++) add(offset.offset.wrist_rad[i]);                                               \
            PkmToolTouch_##S at_tool;                                                                                  \
            CHECK(pkm_tool_touch_##S(machine, pkm_wrist_##S(), &stands, &in.wrench, 7, 2, &at_tool) == PKM_ERROR_OK);  \
            CHECK(at_tool.touch.time_s == 7 && at_tool.touch.rise_k == 2);                                             \
            for (int i = 0; i < 3; i++) {                                                                              \
                add(at_tool.touch.tip.uvw_m[i]);                                                                       \
                add(at_tool.touch.wrench.force_n[i]);                                                                  \
                add(at_tool.touch.wrench.moment_nm[i]);                                                                \
                for (int j = 0; j < 3; j++) add(at_tool.base_axes[i][j]);                                              \
            }                                                                                                          \
            printf("estimator_" #S " %ld %ld %lu %lu %lu %lx", (long)n, (long)error, (unsigned long)known.readings,    \
                   (unsigned long)known.refused, (unsigned long)known.time_s, (unsigned long)alarms);                  \
            print_number(learned.chi_squared);                                                                         \
            print(sum);                                                                                                \
            putchar('\n');                                                                                             \
        }                                                                                                              \
        return 0;                                                                                                      \
    }

RUN(double, f64)
RUN(float, f32)

int main(void) {
    return misuse() || run_f64() || run_f32();
}

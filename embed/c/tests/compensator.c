/* Runs the compensators for thousands of periods with readings that lie, stick, jump and vanish, for `cargo xtask c` to hold
 * against the host, in the last quarter with a weight: every 50 periods a line with the kind, the period, the last limit, domain and fault, the bits of the last
 * offsets as doubles, and a sum over all offsets so far. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "pkm.h"

#define PERIODS 4000

static uint32_t state;

static int32_t next(int32_t from, int32_t below) {
    state = state * 1664525u + 1013904223u;
    return from + (int32_t)((state >> 8) % (uint32_t)(below - from));
}

/* What happens in a period, in numbers that float and double have alike on every computer. */
typedef struct {
    double pose[3], beta[2], wrench[6], rise[4];
    int32_t enabled;
} Period;

static void happen(Period *p, int32_t k) {
    if (k % 64 == 0) {
        p->pose[0] = next(-60, 61) / 200.0;
        p->pose[1] = next(-60, 61) / 200.0;
        p->pose[2] = next(500, 561) / 1000.0;
        p->beta[0] = next(-100, 101) / 500.0;
        p->beta[1] = next(-100, 101) / 500.0;
    }
    p->enabled = (k / 256) % 5 != 4 && next(0, 200) != 0;
    /* now and then the sensor is stuck */
    if ((k / 512) % 3 != 2) {
        for (int i = 0; i < 6; i++) p->wrench[i] = next(-1000, 1001) / (i < 3 ? 2.0 : 100.0);
        const int32_t broken = next(0, 40);
        if (broken == 0) p->wrench[1] = NAN;
        if (broken == 1) p->wrench[2] = 1e6;
    }
    for (int i = 0; i < 4; i++) p->rise[i] = i + next(-4, 5) / 10.0;
    const int32_t lost = next(0, 200);
    if (lost < 4) p->rise[lost] = NAN;
    if (lost == 4) p->rise[2] = 60;
}

static uint64_t sum;

static uint64_t bits_of(double value) {
    uint64_t bits;
    memcpy(&bits, &value, sizeof(bits));
    sum = (sum ^ bits) * 0x100000001b3u;
    return bits;
}

static void print(uint64_t bits) {
    printf(" %08lx%08lx", (unsigned long)(bits >> 32), (unsigned long)(bits & 0xFFFFFFFFu));
}

static const PkmChecksums *built_for(void) {
    static PkmChecksums sums;
    sums.machine = pkm_machine_checksum();
    sums.wrist = pkm_wrist_checksum();
    sums.table = pkm_table_checksum();
    return &sums;
}

static int settings(PkmCompensatorSettings *s) {
    if (pkm_compensator_defaults(s, sizeof *s) != PKM_ERROR_OK) return -1;
    s->stuck_s = 0.1;
    s->max_screw_m = 4e-6;
    s->max_wrist_rad = 1e-5;
    s->screw_rate_m_per_s = 1e-3;
    return 0;
}

/* JOINTS is 3 or 5, CARRY a call that sets a weight, UPDATE one that updates with `in` and `out`. */
#define RUN(NAME, KIND, T, S, JOINTS, CARRY, UPDATE)                                                                \
    static int run_##NAME##_##S(void) {                                                                             \
        static uint64_t room[128];                                                                                  \
        PkmCompensatorSettings set;                                                                                 \
        Period p;                                                                                                   \
        memset(&p, 0, sizeof(p));                                                                                   \
        KIND##_##S *compensator = (KIND##_##S *)(void *)room;                                                       \
        if (settings(&set) || sizeof(room) < pkm_##NAME##_size_##S() || 8 % pkm_##NAME##_align_##S()) return 1;     \
        if (pkm_##NAME##_init_##S(compensator, sizeof(room), &set, sizeof(set), built_for())) return 1;             \
        state = JOINTS;                                                                                             \
        sum = 0;                                                                                                    \
        for (int32_t k = 0; k < PERIODS; k++) {                                                                     \
            PkmReading_##S in;                                                                                      \
            PkmOffset_##S out;                                                                                      \
            uint64_t bits[JOINTS];                                                                                  \
            happen(&p, k);                                                                                          \
            in.enabled = p.enabled;                                                                                 \
            in.rise.platforms_k = (T)p.rise[3];                                                                     \
            for (int i = 0; i < 3; i++) {                                                                           \
                in.rise.limbs_k[i] = (T)p.rise[i];                                                                  \
                in.wrench.force_n[i] = (T)p.wrench[i];                                                              \
                in.wrench.moment_nm[i] = (T)p.wrench[3 + i];                                                        \
            }                                                                                                       \
            const PkmConfiguration_##S at = {{(T)p.pose[0], (T)p.pose[1], (T)p.pose[2]},                            \
                                             {(T)p.beta[0], (T)p.beta[1]}};                                         \
            if (k == PERIODS / 2 && pkm_##NAME##_reset_##S(compensator)) return 1;                                  \
            if (k == 3 * PERIODS / 4 && CARRY) return 1;                                                            \
            if (UPDATE) return 1;                                                                                   \
            const T joint[5] = {out.screws_m[0], out.screws_m[1], out.screws_m[2], out.wrist_rad[0], out.wrist_rad[1]};\
            for (int i = 0; i < JOINTS; i++) bits[i] = bits_of(joint[i]);                                           \
            if (JOINTS == 3 && (out.wrist_rad[0] != 0 || out.wrist_rad[1] != 0)) return 1;                          \
            if (k % 50 != 49) continue;                                                                             \
            printf(#NAME "_" #S " %ld %ld %ld %ld", (long)k, (long)out.limit, (long)out.domain, (long)out.fault);   \
            for (int i = 0; i < JOINTS; i++) print(bits[i]);                                                        \
            print(sum);                                                                                             \
            putchar('\n');                                                                                          \
        }                                                                                                           \
        return 0;                                                                                                   \
    }

#define BOTH(T, S)                                                                                                  \
    static const PkmPoint_##S tip_##S = {{(T)0.01, (T)-0.02, (T)0.3}};                                              \
    static const PkmConfiguration_##S home_##S = {{(T)0.0, (T)0.0, (T)0.53}, {(T)0.0, (T)0.0}};                     \
    static const PkmWeight_##S platform_##S = {{(T)600.0, (T)-150.0, (T)-480.0}, {(T)0.02, (T)-0.01, (T)0.1}};      \
    static const PkmWeight_##S carried_##S = {{(T)150.0, (T)-37.5, (T)-120.0}, {(T)0.12, (T)0.01, (T)-0.2}};        \
    RUN(compensator, PkmCompensator, T, S, 3,                                                                       \
        pkm_compensator_set_weight_##S(compensator, pkm_machine_##S(), pkm_table_##S(), &platform_##S,              \
                                       &home_##S.pose, &tip_##S),                                                   \
        pkm_compensator_update_##S(compensator, pkm_machine_##S(), pkm_table_##S(), &at.pose, &tip_##S, &in, &out,  \
                                   sizeof out))                                                                     \
    RUN(tool_compensator, PkmToolCompensator, T, S, 5,                                                              \
        pkm_tool_compensator_set_weight_##S(compensator, pkm_machine_##S(), pkm_table_##S(), pkm_wrist_##S(),       \
                                            &platform_##S, &carried_##S, &home_##S),                                \
        pkm_tool_compensator_update_##S(compensator, pkm_machine_##S(), pkm_table_##S(), pkm_wrist_##S(), &at, &in, &out,\
                                        sizeof out))

BOTH(double, f64)
BOTH(float, f32)

int main(void) {
    return run_compensator_f64() || run_tool_compensator_f64() || run_compensator_f32() || run_tool_compensator_f32();
}

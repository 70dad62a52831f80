/* What the compensation learns from readings of the tip (docs/estimation.md): the drives of the three limbs, and the base along its
 * axes. Numbers for a machine of the reference's size, in m/N: yours to change before the modules are built. A state that was saved with
 * other amplitudes, or other accepted values or deviations of them, is not read. */
#ifndef PKM_LEARNED_H
#define PKM_LEARNED_H

#include "pkm.h"

#define LEARNED_COUNT 6
#define COMPLIANCE(OF) {.amplitude = OF, .accepted = 0, .deviation = 1e-9, .drift_per_day = 1e-11, .least = -4e-9, .most = 4e-8, \
                        .rate_per_s = 1e-9, .alarm = 2e-10}

static const PkmEstimatorSettings LEARNED = {
    .amplitudes = {COMPLIANCE(PKM_AMPLITUDE_LIMB1), COMPLIANCE(PKM_AMPLITUDE_LIMB2), COMPLIANCE(PKM_AMPLITUDE_LIMB3),
                   COMPLIANCE(PKM_AMPLITUDE_BASE_X), COMPLIANCE(PKM_AMPLITUDE_BASE_Y), COMPLIANCE(PKM_AMPLITUDE_BASE_Z)},
    .count = LEARNED_COUNT,
    .model_share = 0.02,
};

#endif

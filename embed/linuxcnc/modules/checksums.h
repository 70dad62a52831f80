/* Whether a module fits its configuration, and computes what it was built to. Behind pkm.h. */
#ifndef PKM_CHECKSUMS_H
#define PKM_CHECKSUMS_H

#include <string.h>

/* `sum` is compiled in, `wanted` is what the configuration names: NULL when it names none. */
static inline int is_for(const char *component, const char *what, const char *wanted, unsigned long long sum) {
    char text[17];
    rtapi_snprintf(text, sizeof(text), "%016llx", sum);
    if (wanted && !strcmp(wanted, text)) return 1;
    rtapi_print_msg(RTAPI_MSG_ERR, "%s: the %s compiled in is %s, this configuration is for %s: build modules and "
                    "configuration from one machine file (cargo xtask linuxcnc build)\n", component, what, text,
                    wanted ? wanted : "none that it names");
    return 0;
}

/* Machine, wrist and table are in memory as they were built, and the processor computes known poses to the last bit. */
static inline int is_sound(const char *component) {
    PkmError found = pkm_verify_f64();
    if (found == PKM_ERROR_OK) found = pkm_self_test_f64();
    if (found == PKM_ERROR_OK) return 1;
    rtapi_print_msg(RTAPI_MSG_ERR, "%s: %s\n", component, pkm_error_text(found));
    return 0;
}

#endif

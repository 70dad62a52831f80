/* Whether a module fits its configuration. */
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

#endif

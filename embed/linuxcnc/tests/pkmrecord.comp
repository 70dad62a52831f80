component pkmrecord "Keeps what pins hold in every period, and writes it to a file when it is unloaded: for the tests alone";

description """
The file holds rows of doubles in the computer's own byte order: the time that the thread has run since \fBbegin\fR in ns, by
the clock on the wall and by the processor's clock, then real and flags and whole numbers. Nothing is allocated while the thread
runs.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
option extra_setup yes;
option extra_cleanup yes;
include <stdio.h>;
include <stdlib.h>;
include <string.h>;
include <time.h>;

pin in float real-###[99];
pin in bit flag-#[5];
pin in s32 whole-#[6];
pin out u32 rows;
function begin fp "first in the thread";
function before fp "before what is to be timed on its own";
function after fp "behind it";
function end fp "last in the thread";
;;

#define REALS 99
#define ROW (3 + REALS + 5 + 6)
#define MOST_ROWS 200000

static char *file;
RTAPI_MP_STRING(file, "file to write");
static double *kept;
static long long wall, cpu, cpu_ours;

static long long thread_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}

FUNCTION(begin) {
    (void)period;
    (void)__comp_inst;
    wall = rtapi_get_time();
    cpu = thread_ns();
}

FUNCTION(before) {
    (void)period;
    (void)__comp_inst;
    cpu_ours = -thread_ns();
}

FUNCTION(after) {
    (void)period;
    (void)__comp_inst;
    cpu_ours += thread_ns();
}

FUNCTION(end) {
    (void)period;
    if (rows == MOST_ROWS) return;
    double *row = kept + (size_t)rows * ROW;
    *row++ = rtapi_get_time() - wall;
    *row++ = thread_ns() - cpu;
    *row++ = cpu_ours;
    for (int i = 0; i < REALS; i++) *row++ = real(i);
    for (int i = 0; i < 5; i++) *row++ = flag(i);
    for (int i = 0; i < 6; i++) *row++ = whole(i);
    rows++;
}

EXTRA_SETUP() {
    (void)prefix;
    (void)extra_arg;
    (void)__comp_inst;
    const size_t bytes = sizeof(double) * ROW * MOST_ROWS;
    if (!file || !(kept = malloc(bytes))) return -EINVAL;
    memset(kept, 0, bytes);
    return 0;
}

EXTRA_CLEANUP() {
    struct __comp_state *__comp_inst = __comp_first_inst;
    /* also called when the set-up failed */
    FILE *to = __comp_inst ? fopen(file, "wb") : NULL;
    if (to) {
        fwrite(kept, sizeof(double) * ROW, rows, to);
        fclose(to);
    }
    free(kept);
}

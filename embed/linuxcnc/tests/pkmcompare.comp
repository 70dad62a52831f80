component pkmcompare "pkmkins and genhexkins side by side: for the tests alone";

description """
Takes both to and fro along a path, a point a period, and times every call. Both have to be loaded; they are found by their
files, since both name their functions alike.""";

author "pkm";
license "Dual MIT/GPL";
option singleton yes;
option extra_setup yes;
option extra_cleanup yes;
include <dlfcn.h>;
include <math.h>;
include <stdio.h>;
include <stdlib.h>;
include <kinematics.h>;

pin in u32 max-iterations "of genhexkins; set to 0 before each forward, since its last-iterations is not kept up in 2.9";
pin in float home-#[3] "where the path of pkmkins is: the middle of it";
pin in float size "and how far it goes, mm";
pin in float turn "degrees";
pin out u32 count;
function _ fp;
;;

#define MOST 200000
#undef max_iterations /* it could only be read */

static char *modules, *file;
RTAPI_MP_STRING(modules, "folder of the modules");
RTAPI_MP_STRING(file, "file to write");

typedef struct {
    int (*forward)(const double *, EmcPose *, const KINEMATICS_FORWARD_FLAGS *, KINEMATICS_INVERSE_FLAGS *);
    int (*inverse)(const EmcPose *, double *, const KINEMATICS_INVERSE_FLAGS *, KINEMATICS_FORWARD_FLAGS *);
} Kins;

/* A row: refusals and greatest error of inverse and forward together (mm, degrees; inches), ns of inverse, of forward from
 * where it stands and from home, iterations of the two. */
typedef struct {
    double refused, error, inverse_ns, forward_ns, cold_ns, iterations, cold_iterations;
} Row;

static Kins kins[2];
static EmcPose stands[2], rests[2];
static Row *kept;

static int find(Kins *of, const char *name) {
    char path[500];
    snprintf(path, sizeof(path), "%s/%s.so", modules, name);
    void *module = dlopen(path, RTLD_NOLOAD | RTLD_NOW);
    if (!module) return -1;
    of->forward = dlsym(module, "kinematicsForward");
    of->inverse = dlsym(module, "kinematicsInverse");
    return of->forward && of->inverse ? 0 : -1;
}

static double apart(const EmcPose *a, const EmcPose *b) {
    const double off[6] = {a->tran.x - b->tran.x, a->tran.y - b->tran.y, a->tran.z - b->tran.z, a->a - b->a, a->b - b->b, a->c - b->c};
    double most = 0;
    for (int i = 0; i < 6; i++) most = fmax(most, fabs(off[i]));
    return most;
}

FUNCTION(_) {
    (void)period;
    if (count == MOST) return;
    const double t = count * 1e-3;
    for (int which = 0; which < 2; which++) {
        /* 0.1 mm and less than 0.1 degrees a period */
        const double wide = which ? 3 : size, turned = which ? 5 : turn;
        EmcPose *rest = &rests[which], to;
        *rest = which ? (EmcPose){.tran = {0, 0, 20}} : (EmcPose){.tran = {home(0), home(1), home(2)}};
        to = *rest;
        to.tran.x += wide * sin(1.1 * t);
        to.tran.y += wide * sin(1.7 * t);
        to.tran.z += 0.5 * wide * sin(2.3 * t);
        to.a += turned * sin(0.7 * t);
        to.b += turned * sin(1.3 * t);
        Row *row = &kept[2 * count + which];
        double joint[16] = {0};
        KINEMATICS_FORWARD_FLAGS fflags = 0;
        KINEMATICS_INVERSE_FLAGS iflags = 0;
        /* the first forward of genhexkins begins from nothing and fails */
        if (!count || kept[2 * (count - 1) + which].refused) stands[which] = to;
        const long long a = rtapi_get_time();
        row->refused = kins[which].inverse(&to, joint, &iflags, &fflags) != 0;
        *__comp_inst->max_iterations = 0;
        const long long b = rtapi_get_time();
        row->refused += kins[which].forward(joint, &stands[which], &fflags, &iflags) != 0;
        const long long c = rtapi_get_time();
        row->iterations = which ? *__comp_inst->max_iterations : 0;
        EmcPose cold = *rest;
        *__comp_inst->max_iterations = 0;
        const long long d = rtapi_get_time();
        row->refused += kins[which].forward(joint, &cold, &fflags, &iflags) != 0;
        const long long e = rtapi_get_time();
        row->cold_iterations = which ? *__comp_inst->max_iterations : 0;
        row->error = fmax(apart(&stands[which], &to), apart(&cold, &to));
        row->inverse_ns = b - a;
        row->forward_ns = c - b;
        row->cold_ns = e - d;
    }
    count++;
}

EXTRA_SETUP() {
    (void)prefix;
    (void)extra_arg;
    (void)__comp_inst;
    kept = calloc(2 * MOST, sizeof(Row));
    if (!kept || !modules || !file || find(&kins[0], "pkmkins") || find(&kins[1], "genhexkins")) {
        rtapi_print_msg(RTAPI_MSG_ERR, "pkmcompare: load pkmkins and genhexkins first, and give modules= and file=\n");
        return -EINVAL;
    }
    return 0;
}

EXTRA_CLEANUP() {
    struct __comp_state *__comp_inst = __comp_first_inst;
    /* also called when the set-up failed */
    FILE *to = __comp_inst ? fopen(file, "wb") : NULL;
    if (to) {
        fwrite(kept, 2 * sizeof(Row), count, to);
        fclose(to);
    }
    free(kept);
}

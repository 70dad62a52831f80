/* One cycle of a controller: where the screws go so that a loaded tip is where it should be; then with the wrist, tip and axis.
 * The same source on a PC and on a Cortex-M; `cargo xtask c` builds and runs it on both.
 *
 * Build the library in the folder embed/c, with the coefficients.rs of your machine (`pkm-host fit`), always with --release:
 * a debug build does not link (it misses pkm_a_panic_is_reachable).
 *   PC:        PKM_COEFFICIENTS=/path/to/coefficients.rs cargo build --release
 *   Cortex-M7: the same with RUSTFLAGS="-C target-cpu=cortex-m7" and --target thumbv7em-none-eabihf
 *              (without the target-cpu f64 is computed in software, 16 times as many instructions; a Cortex-M4F does that
 *              anyway: use f32 there)
 * then, in this folder:
 *   PC:        cc -I../include cycle.c ../target/release/libpkm.a -lm -o cycle
 *   Cortex-M7: arm-none-eabi-gcc -mthumb -mcpu=cortex-m7 -mfpu=fpv5-d16 -mfloat-abi=hard -O2 -I../include cycle.c start.c
 *              ../target/thumbv7em-none-eabihf/release/libpkm.a -lm -T mps2.ld --specs=rdimon.specs -nostartfiles
 *              -Wl,--gc-sections -o cycle.elf
 *              qemu-system-arm -M mps2-an500 -nographic -semihosting-config enable=on,target=native -kernel cycle.elf
 * Without -Wl,--gc-sections the whole library would be linked, and newlib's _fini asked for. -mfloat-abi=hard must be that of
 * the whole project: for softfp or soft build the library with --target thumbv7em-none-eabi. The floating-point unit must be
 * on before the first call (start.c does it). From CMake:
 *   add_library(pkm STATIC IMPORTED)
 *   set_target_properties(pkm PROPERTIES IMPORTED_LOCATION ${PKM}/target/thumbv7em-none-eabihf/release/libpkm.a
 *                         INTERFACE_INCLUDE_DIRECTORIES ${PKM}/include)
 *   target_link_libraries(firmware pkm m) */

#include <stdio.h>
#include <string.h>

#include "pkm.h"

int main(void) {
    // structs of another version may have other sizes
    if (strcmp(pkm_version(), PKM_VERSION) != 0) {
        fprintf(stderr, "pkm: the header is of version %s, the library of %s\n", PKM_VERSION, pkm_version());
        return 1;
    }

    const PkmPose_f64 pose = {.theta_rad = 0.1, .sigma_rad = -0.05, .z0_m = 0.53};
    const PkmPoint_f64 tip = {.uvw_m = {0.0, 0.0, 0.3}};
    const PkmWrench_f64 cutting = {.force_n = {120.0, 0.0, -400.0}, .moment_nm = {0.0, 0.0, 5.0}};

    PkmCycle_f64 cycle;
    PkmError error = pkm_cycle_f64(pkm_machine_f64(), pkm_table_f64(), &pose, &cutting, &tip, &cycle);
    if (error != PKM_ERROR_OK) {
        fprintf(stderr, "pkm: %s\n", pkm_error_text(error));
        return 1;
    }
    if (cycle.domain == PKM_DOMAIN_OUTSIDE) {
        puts("the table was not fitted here: what follows is an extrapolation");
    }
    printf("pkm %s, machine %016llx, table %016llx\n", pkm_version(), (unsigned long long)pkm_machine_checksum(),
           (unsigned long long)pkm_table_checksum());
    puts("limb  screw_mm  with_load_mm");
    for (int limb = 0; limb < 3; limb++) {
        printf("%4d  %8.4f  %12.4f\n", limb + 1, 1e3 * cycle.lengths.q_m[limb],
               1e3 * cycle.compensated.lengths.q_m[limb]);
    }
    const double *moved_m = cycle.deflection.translation_m;
    printf("A would move by %.2f %.2f %.2f um along u, v, w\n", 1e6 * moved_m[0], 1e6 * moved_m[1], 1e6 * moved_m[2]);

    const PkmTool_f64 tool = {.tip_m = {-0.15, 0.02, 1.12}, .axis = {0.05, 0.0, 1.0}};
    // home; a controller begins with the configuration that pkm_tool_forward_f64 gives for the measured joints
    const PkmConfiguration_f64 near = {.pose = {.theta_rad = 0.0, .sigma_rad = 0.0, .z0_m = 0.53}, .beta_rad = {0.0, 0.0}};
    PkmCompensatedTool_f64 command;
    error = pkm_tool_compensated_f64(pkm_machine_f64(), pkm_table_f64(), pkm_wrist_f64(), &tool, &cutting, &near, &command);
    if (error != PKM_ERROR_OK) {
        fprintf(stderr, "pkm: %s\n", pkm_error_text(error));
        return 1;
    }
    if (!command.converged) {
        fprintf(stderr, "pkm: the tip would be %g m off: is the load plausible?\n", command.remaining_m);
        return 1;
    }
    const PkmJoints_f64 *joints = &command.solution.joints;
    printf("five axes: %.4f %.4f %.4f mm, %.6f %.6f rad, normalised determinant %.3f\n", 1e3 * joints->lengths.q_m[0],
           1e3 * joints->lengths.q_m[1], 1e3 * joints->lengths.q_m[2], joints->beta_rad[0], joints->beta_rad[1],
           command.solution.normalised_determinant);
    return 0;
}

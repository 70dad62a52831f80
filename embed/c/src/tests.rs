//! The border from Rust; `tests/misuse.c` does it from C.

use std::ffi::c_void;

use pkm_core::checksum::{START, over_byte, over_numbers};

use super::*;

const PATTERN: u64 = 0xA5A5_A5A5_A5A5_A5A5;

/// Calls a function with each of its pointers null, then misaligned, the result's last; then with all of them right.
fn misuse<const N: usize>(inputs: [*const c_void; N], call: impl Fn([*const c_void; N], *mut c_void) -> PkmError) {
    // as large as the largest result, a machine in f64, and more
    let mut result = [PATTERN; 512];
    let to = result.as_mut_ptr().cast::<c_void>();
    for i in 0..N {
        let mut bad = inputs;
        bad[i] = std::ptr::null();
        assert_eq!(call(bad, to), PkmError::NullPointer, "input {i}");
        bad[i] = inputs[i].wrapping_byte_add(1);
        assert_eq!(call(bad, to), PkmError::Misaligned, "input {i}");
    }
    assert_eq!(call(inputs, std::ptr::null_mut()), PkmError::NullPointer, "result");
    assert_eq!(call(inputs, to.wrapping_byte_add(1)), PkmError::Misaligned, "result");
    assert_eq!(result, [PATTERN; 512], "a refusal writes nothing");
    assert_eq!(call(inputs, result.as_mut_ptr().cast()), PkmError::Ok);
    // a machine has bytes between its numbers that nobody writes: what was written is read byte by byte
    // SAFETY: of the array; the first byte of every result is a number's
    assert_ne!(unsafe { result.as_ptr().cast::<u8>().read() }, PATTERN as u8);
}

macro_rules! misuse_of_every_function {
    ($test:ident, $t:ty, $machine:ident, $table:ident, $verify:ident, $machine_size:ident, $at_temperature:ident, $inverse:ident, $forward:ident,
     $jacobian:ident, $distance:ident, $margin:ident, $stiffness:ident, $domain:ident, $corrected:ident,
     $deflection:ident, $thermal:ident, $compensated:ident, $cycle:ident, $wrist:ident, $tool_forward:ident, $tool_inverse:ident,
     $tip_inverse:ident, $tip_inverse_any_margin:ident, $tool_compensated:ident, $joint_motion:ident, $feed_share:ident) => {
        #[test]
        fn $test() {
            let pose = PkmPose::<$t> { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
            let lengths = PkmLengths::<$t> { q_m: [0.57, 0.55, 0.52] };
            let wrench = PkmWrench::<$t> { force_n: [1.0, 2.0, 3.0], moment_nm: [0.0; 3] };
            let moved = PkmDeflection::<$t> { translation_m: [1e-5; 3], rotation_rad: [0.0; 3] };
            let tip = PkmPoint::<$t> { uvw_m: [0.0, 0.0, 0.3] };
            let (m, t) = ($machine().cast::<c_void>(), $table().cast::<c_void>());
            let p = |value| std::ptr::from_ref::<PkmPose<$t>>(value).cast::<c_void>();
            let (p, q) = (p(&pose), std::ptr::from_ref(&lengths).cast());
            let (w, d) = (std::ptr::from_ref(&wrench).cast(), std::ptr::from_ref(&moved).cast());
            let at = std::ptr::from_ref(&tip).cast();
            let joints = PkmJoints { lengths, beta_rad: [0.1, -0.1] };
            let tool = PkmTool::<$t> { tip_m: [-0.2, 0.0, 1.13], axis: [0.0, 0.0, 1.0] };
            let home = PkmPose::<$t> { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
            let near = PkmConfiguration::<$t> { pose: home, beta_rad: [0.0; 2] };
            let (j, v) = (std::ptr::from_ref(&joints).cast(), $wrist().cast::<c_void>());
            let (to_hold, n) = (std::ptr::from_ref(&tool).cast(), std::ptr::from_ref(&near).cast());
            let tip = PkmTip::<$t> { tip_m: tool.tip_m, beta_rad: [0.1, -0.1] };
            let at_tip = std::ptr::from_ref(&tip).cast();
            // SAFETY: every pointer is null, misaligned, or leads to what the function asks for
            unsafe {
                let size = $machine_size();
                assert_eq!(size, size_of::<PkmMachine<$t>>());
                misuse([m], |[m], to| $at_temperature(m.cast(), 30.0, to.cast(), size));
                let mut room = [PATTERN; 512];
                for wrong in [0, size - size_of::<$t>(), size + 1] {
                    let to = room.as_mut_ptr().cast();
                    assert_eq!($at_temperature(m.cast(), 30.0, to, wrong), PkmError::WrongSize);
                }
                assert_eq!(room, [PATTERN; 512]);
                assert_eq!($verify(), PkmError::Ok);
                misuse([m, p], |[m, p], to| $inverse(m.cast(), p.cast(), to.cast()));
                misuse([m, q], |[m, q], to| $forward(m.cast(), q.cast(), to.cast()));
                misuse([m, p], |[m, p], to| $jacobian(m.cast(), p.cast(), to.cast()));
                misuse([m, p], |[m, p], to| $distance(m.cast(), p.cast(), to.cast()));
                misuse([m, q], |[m, q], to| $margin(m.cast(), q.cast(), to.cast()));
                misuse([m, p], |[m, p], to| $stiffness(m.cast(), p.cast(), to.cast()));
                misuse([t, p], |[t, p], to| $domain(t.cast(), p.cast(), to.cast()));
                misuse([m, t, p], |[m, t, p], to| $corrected(m.cast(), t.cast(), p.cast(), to.cast()));
                misuse([m, t, p, w], |[m, t, p, w], to| {
                    $deflection(m.cast(), t.cast(), p.cast(), w.cast(), std::ptr::null(), to.cast())
                });
                let rise = PkmTemperatureRise::<$t> { limbs_k: [4.5, 2.5, -1.0], platforms_k: 3.0 };
                let rise = std::ptr::from_ref(&rise).cast();
                misuse([m, p, rise], |[m, p, rise], to| $thermal(m.cast(), p.cast(), rise.cast(), to.cast()));
                misuse([m, p, d, at], |[m, p, d, at], to| {
                    $compensated(m.cast(), p.cast(), d.cast(), at.cast(), to.cast())
                });
                misuse([m, t, p, w, at], |[m, t, p, w, at], to| {
                    $cycle(m.cast(), t.cast(), p.cast(), w.cast(), at.cast(), to.cast())
                });
                misuse([m, v, j], |[m, v, j], to| $tool_forward(m.cast(), v.cast(), j.cast(), to.cast()));
                misuse([m, v, to_hold, n], |[m, v, tool, n], to| {
                    $tool_inverse(m.cast(), v.cast(), tool.cast(), n.cast(), to.cast())
                });
                misuse([m, v, at_tip], |[m, v, tip], to| $tip_inverse(m.cast(), v.cast(), tip.cast(), to.cast()));
                misuse([m, v, at_tip], |[m, v, tip], to| {
                    $tip_inverse_any_margin(m.cast(), v.cast(), tip.cast(), to.cast())
                });
                misuse([m, t, v, to_hold, w, n], |[m, t, v, tool, w, n], to| {
                    let (m, t, v) = (m.cast(), t.cast(), v.cast());
                    $tool_compensated(m, t, v, tool.cast(), w.cast(), n.cast(), to.cast())
                });
                let motion = PkmToolMotion::<$t> {
                    tip_m_per_s: [0.1; 3],
                    axis_per_s: [0.0; 3],
                    tip_m_per_s2: [0.0; 3],
                    axis_per_s2: [0.0; 3],
                };
                let moves = std::ptr::from_ref(&motion).cast();
                misuse([m, v, n, moves], |[m, v, n, moves], to| {
                    $joint_motion(m.cast(), v.cast(), n.cast(), moves.cast(), to.cast())
                });
                let limits = PkmJointMotion::<$t> { velocity: [1.0; 5], acceleration: [1.0; 5] };
                let limits = std::ptr::from_ref(&limits).cast();
                misuse([limits, limits], |[joints, limits], to| $feed_share(joints.cast(), limits.cast(), to.cast()));
            }
        }
    };
}

misuse_of_every_function!(
    misuse_f64,
    f64,
    pkm_machine_f64,
    pkm_table_f64,
    pkm_verify_f64,
    pkm_machine_size_f64,
    pkm_at_temperature_f64,
    pkm_inverse_f64,
    pkm_forward_f64,
    pkm_jacobian_f64,
    pkm_singularity_distance_f64,
    pkm_travel_margin_f64,
    pkm_stiffness_f64,
    pkm_domain_f64,
    pkm_corrected_stiffness_f64,
    pkm_deflection_f64,
    pkm_thermal_deflection_f64,
    pkm_compensated_f64,
    pkm_cycle_f64,
    pkm_wrist_f64,
    pkm_tool_forward_f64,
    pkm_tool_inverse_f64,
    pkm_tip_inverse_f64,
    pkm_tip_inverse_any_margin_f64,
    pkm_tool_compensated_f64,
    pkm_joint_motion_f64,
    pkm_feed_share_f64
);
misuse_of_every_function!(
    misuse_f32,
    f32,
    pkm_machine_f32,
    pkm_table_f32,
    pkm_verify_f32,
    pkm_machine_size_f32,
    pkm_at_temperature_f32,
    pkm_inverse_f32,
    pkm_forward_f32,
    pkm_jacobian_f32,
    pkm_singularity_distance_f32,
    pkm_travel_margin_f32,
    pkm_stiffness_f32,
    pkm_domain_f32,
    pkm_corrected_stiffness_f32,
    pkm_deflection_f32,
    pkm_thermal_deflection_f32,
    pkm_compensated_f32,
    pkm_cycle_f32,
    pkm_wrist_f32,
    pkm_tool_forward_f32,
    pkm_tool_inverse_f32,
    pkm_tip_inverse_f32,
    pkm_tip_inverse_any_margin_f32,
    pkm_tool_compensated_f32,
    pkm_joint_motion_f32,
    pkm_feed_share_f32
);

macro_rules! misuse_of_compensators {
    ($test:ident, $t:ty, $machine:ident, $table:ident, $wrist:ident, $init:ident, $update:ident, $tool_init:ident, $tool_update:ident,
     $uncertainty:ident, $cycle_known:ident, $update_known:ident, $tool_update_known:ident) => {
        #[test]
        fn $test() {
            let sums = PkmChecksums {
                machine: pkm_machine_checksum(),
                wrist: pkm_wrist_checksum(),
                table: pkm_table_checksum(),
            };
            let (mut screws, mut tool) = ([0u64; 128], [0u64; 128]);
            let (screws, tool) = (screws.as_mut_ptr().cast(), tool.as_mut_ptr().cast());
            let pose = PkmPose::<$t> { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
            let at = PkmConfiguration { pose, beta_rad: [0.1, -0.1] };
            let wrench = PkmWrench { force_n: [10.0, 20.0, -300.0], moment_nm: [0.0; 3] };
            let reading = PkmReading::<$t> {
                enabled: 1,
                wrench,
                rise: PkmTemperatureRise { limbs_k: [0.0; 3], platforms_k: 0.0 },
            };
            let tip = PkmPoint::<$t> { uvw_m: [0.0, 0.0, 0.3] };
            fn to<T>(value: &T) -> *const c_void {
                std::ptr::from_ref(value).cast()
            }
            let (m, t, w) = ($machine().cast(), $table().cast(), $wrist().cast());
            // SAFETY: every pointer is null, misaligned, or leads to what the function asks for
            unsafe {
                let mut set = std::mem::zeroed::<PkmCompensatorSettings>();
                let size = size_of_val(&set);
                assert_eq!(pkm_compensator_defaults(&mut set, size), PkmError::Ok);
                misuse([to(&set), to(&sums)], |[set, sums], to| $init(to.cast(), 1024, set.cast(), size, sums.cast()));
                misuse([to(&set), to(&sums)], |[set, sums], to| {
                    $tool_init(to.cast(), 1024, set.cast(), size, sums.cast())
                });
                assert_eq!($init(screws, 1024, &set, size, &sums), PkmError::Ok);
                assert_eq!($tool_init(tool, 1024, &set, size, &sums), PkmError::Ok);
                let (c, p, r) = (screws.cast_const().cast(), to(&pose), to(&reading));
                let (room, known_room) = (size_of::<PkmOffset<$t>>(), size_of::<PkmKnownOffset<$t>>());
                misuse([c, m, t, p, to(&tip), r], |[c, m, t, p, tip, r], to| {
                    $update(c.cast_mut().cast(), m.cast(), t.cast(), p.cast(), tip.cast(), r.cast(), to.cast(), room)
                });
                let c = tool.cast_const().cast();
                misuse([c, m, t, w, to(&at), r], |[c, m, t, w, at, r], to| {
                    $tool_update(
                        c.cast_mut().cast(),
                        m.cast(),
                        t.cast(),
                        w.cast(),
                        at.cast(),
                        r.cast(),
                        to.cast(),
                        room,
                    )
                });
                let u = $uncertainty().cast();
                misuse([c, m, t, u, w, to(&at), r], |[c, m, t, u, w, at, r], to| {
                    let (c, at, r) = (c.cast_mut().cast(), at.cast(), r.cast());
                    $tool_update_known(c, m.cast(), t.cast(), u.cast(), w.cast(), at, r, to.cast(), known_room)
                });
                let c = screws.cast_const().cast();
                misuse([c, m, t, u, p, to(&tip), r], |[c, m, t, u, p, tip, r], to| {
                    let (c, tip, r) = (c.cast_mut().cast(), tip.cast(), r.cast());
                    $update_known(c, m.cast(), t.cast(), u.cast(), p.cast(), tip, r, to.cast(), known_room)
                });
                misuse([m, t, u, p, to(&wrench), to(&tip)], |[m, t, u, p, wrench, tip], to| {
                    $cycle_known(m.cast(), t.cast(), u.cast(), p.cast(), wrench.cast(), tip.cast(), to.cast())
                });
            }
        }
    };
}

misuse_of_compensators!(
    misuse_of_compensators_f64,
    f64,
    pkm_machine_f64,
    pkm_table_f64,
    pkm_wrist_f64,
    pkm_compensator_init_f64,
    pkm_compensator_update_f64,
    pkm_tool_compensator_init_f64,
    pkm_tool_compensator_update_f64,
    pkm_table_uncertainty_f64,
    pkm_cycle_known_f64,
    pkm_compensator_update_known_f64,
    pkm_tool_compensator_update_known_f64
);
misuse_of_compensators!(
    misuse_of_compensators_f32,
    f32,
    pkm_machine_f32,
    pkm_table_f32,
    pkm_wrist_f32,
    pkm_compensator_init_f32,
    pkm_compensator_update_f32,
    pkm_tool_compensator_init_f32,
    pkm_tool_compensator_update_f32,
    pkm_table_uncertainty_f32,
    pkm_cycle_known_f32,
    pkm_compensator_update_known_f32,
    pkm_tool_compensator_update_known_f32
);

#[test]
fn the_header_is_of_this_version() {
    let header = include_str!("../include/pkm.h");
    assert!(header.contains(concat!("#define PKM_VERSION \"", env!("CARGO_PKG_VERSION"), "\"\n")));
}

#[test]
fn every_error_of_the_header_has_a_text_and_no_other_number() {
    let text = |code| {
        // SAFETY: never null, and of the program's length of life
        unsafe { std::ffi::CStr::from_ptr(pkm_error_text(code)) }
    };
    let codes = include_str!("../include/pkm.h").lines().filter_map(|line| {
        let (name, code) = line.trim().strip_prefix("PKM_ERROR_")?.strip_suffix(',')?.split_once(" = ")?;
        (name != "UNKNOWN").then(|| code.parse::<i32>().unwrap())
    });
    let codes: Vec<_> = codes.collect();
    let texts: std::collections::HashSet<_> = codes.iter().map(|code| text(*code)).collect();
    assert!(codes.len() > 30 && texts.len() == codes.len(), "{texts:?}");
    // and no other number has one
    for code in -1..=256 {
        assert_eq!(text(code) != c"unknown error", codes.contains(&code), "{code}: {:?}", text(code));
    }
}

macro_rules! tables {
    ($test:ident, $t:ty, $size:ident, $align:ident, $receive:ident, $begin:ident, $watch:ident, $machine:ident, $table:ident, $cycle:ident) => {
        #[test]
        fn $test() {
            let sent = coefficients::TABLE_F64;
            let numbers: Vec<f64> = sent.numbers().collect();
            let terms = u32::from(sent.header(0).terms);
            let header =
                PkmTableHeader { machine: pkm_machine_checksum(), table: pkm_table_checksum(), terms, factor_form: 1 };
            let size = $size();
            let mut room = vec![PATTERN; size.div_ceil(8)];
            let buffer = room.as_mut_ptr().cast::<PkmTableBuffer<$t>>();
            let mut table = std::ptr::null();
            assert!($align() <= 8 && buffer.is_aligned());
            let (pose, tip) = (PkmPose::<$t> { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 }, [0.0, 0.0, 0.3]);
            let (wrench, tip) = (PkmWrench::<$t> { force_n: [10.0; 3], moment_nm: [1.0; 3] }, PkmPoint { uvw_m: tip });
            let count = numbers.len();
            // SAFETY: pointers to what the functions ask for, or null
            unsafe {
                let mut receive = |header: &PkmTableHeader, numbers: &[f64]| {
                    $receive(buffer, size, header, numbers.as_ptr(), numbers.len(), &mut table)
                };
                assert_eq!(receive(&header, &numbers), PkmError::Ok);
                let cycle = |table| {
                    let mut cycle = std::mem::MaybeUninit::<PkmCycle<$t>>::uninit();
                    assert_eq!($cycle($machine(), table, &pose, &wrench, &tip, cycle.as_mut_ptr()), PkmError::Ok);
                    cycle.assume_init()
                };
                assert_eq!(cycle(table), cycle($table()));
                let taken = table;

                let mut watch = std::mem::MaybeUninit::<PkmTableWatch>::uninit();
                assert_eq!($begin(watch.as_mut_ptr(), table), PkmError::Ok);
                let mut watch = watch.assume_init();
                assert!((0..1000).all(|_| $watch(&mut watch, table) == PkmError::Ok));
                let mut other = PkmTableWatch { expected: watch.expected ^ 1, ..watch };
                assert!((0..1000).any(|_| $watch(&mut other, table) == PkmError::DamagedTable));
                assert_eq!($watch(&mut other, table), PkmError::DamagedTable, "it stays so");
                assert_eq!($watch(std::ptr::null_mut(), table), PkmError::NullPointer);
                assert_eq!($watch(&mut watch, std::ptr::null()), PkmError::NullPointer);
                assert_eq!($begin(std::ptr::null_mut(), table), PkmError::NullPointer);
                assert_eq!($begin(&mut watch, std::ptr::null()), PkmError::NullPointer);

                let mut receive = |header: &PkmTableHeader, numbers: &[f64]| {
                    $receive(buffer, size, header, numbers.as_ptr(), numbers.len(), &mut table)
                };
                let mut changed = numbers.clone();
                changed[count - 1] = changed[count - 1].next_up();
                assert_eq!(receive(&header, &changed), PkmError::DamagedTable);
                let wrong = [
                    (PkmTableHeader { machine: 1, ..header }, PkmError::OtherMachine),
                    (PkmTableHeader { table: 1, ..header }, PkmError::DamagedTable),
                    (PkmTableHeader { terms: terms + 1, ..header }, PkmError::NotATable),
                    (PkmTableHeader { terms: 256 + terms, ..header }, PkmError::NotATable),
                    (PkmTableHeader { factor_form: 0, ..header }, PkmError::NotATable),
                ];
                for (header, error) in &wrong {
                    assert_eq!(receive(header, &numbers), *error, "{header:?}");
                }
                assert_eq!(receive(&header, &numbers[1..]), PkmError::NotATable);
                let exponents = 6..6 + 3 * terms as usize;
                let diagonal = &numbers[..exponents.end + 6 * terms as usize];
                let sum = diagonal.iter().enumerate().fold(START, |sum, (place, number)| {
                    let is_exponent = exponents.contains(&place);
                    if is_exponent { over_byte(sum, *number as u8) } else { over_numbers(sum, &[*number]) }
                });
                let of_diagonal = PkmTableHeader { table: sum, factor_form: 0, ..header };
                assert_eq!(receive(&of_diagonal, diagonal), PkmError::NoFactorForm);
                let many = vec![0.0; 6 + 30 * 36];
                assert_eq!(receive(&PkmTableHeader { terms: 36, ..header }, &many), PkmError::NotATable);
                let (h, n) = (&raw const header, numbers.as_ptr());
                let to = &raw mut table;
                let null = std::ptr::null_mut();
                assert_eq!($receive(buffer, size - 1, h, n, count, to), PkmError::WrongSize);
                assert_eq!($receive(null, size, h, n, count, to), PkmError::NullPointer);
                assert_eq!($receive(buffer, size, std::ptr::null(), n, count, to), PkmError::NullPointer);
                assert_eq!($receive(buffer, size, h, std::ptr::null(), count, to), PkmError::NullPointer);
                assert_eq!($receive(buffer, size, h, n, count, std::ptr::null_mut()), PkmError::NullPointer);
                assert_eq!($receive(buffer.wrapping_byte_add(1), size, h, n, count, to), PkmError::Misaligned);
                assert_eq!(table, taken, "a refusal writes no address");
            }
        }
    };
}

tables! {
    tables_come_in_f64, f64, pkm_table_buffer_size_f64, pkm_table_buffer_align_f64, pkm_table_receive_f64,
    pkm_table_watch_begin_f64, pkm_table_watch_f64, pkm_machine_f64, pkm_table_f64, pkm_cycle_f64
}
tables! {
    tables_come_in_f32, f32, pkm_table_buffer_size_f32, pkm_table_buffer_align_f32, pkm_table_receive_f32,
    pkm_table_watch_begin_f32, pkm_table_watch_f32, pkm_machine_f32, pkm_table_f32, pkm_cycle_f32
}

macro_rules! states {
    ($test:ident, $t:ty, $size:ident, $init:ident, $save:ident, $restore:ident, $buffer_size:ident, $receive:ident, $table:ident) => {
        /// What was learned beyond a table that was received goes with it, and not with that of the next start, which may have it.
        #[test]
        fn $test() {
            let mut numbers: Vec<f64> = coefficients::TABLE_F64.numbers().collect();
            let terms = usize::from(coefficients::TABLE_F64.header(0).terms);
            let last = numbers.len() - 1;
            numbers[last] = numbers[last].next_up();
            let sum = numbers.iter().enumerate().fold(START, |sum, (place, number)| {
                let is_exponent = (6..6 + 3 * terms).contains(&place);
                if is_exponent { over_byte(sum, *number as u8) } else { over_numbers(sum, &[*number]) }
            });
            let header =
                PkmTableHeader { machine: pkm_machine_checksum(), table: sum, terms: terms as u32, factor_form: 1 };
            let amplitude = PkmAmplitudeSettings {
                amplitude: PkmAmplitude::Limb1 as i32,
                accepted: 0.0,
                deviation: 1e-9,
                drift_per_day: 1e-11,
                least: -4e-9,
                most: 4e-8,
                rate_per_s: 1e-11,
                alarm: 2e-10,
            };
            let settings =
                PkmEstimatorSettings { amplitudes: [amplitude; PKM_AMPLITUDES], count: 1, model_share: 0.02 };
            let mut room = vec![PATTERN; $buffer_size().div_ceil(8)];
            let (mut memory, mut slot) = (vec![PATTERN; $size().div_ceil(8)], [0_u8; 128]);
            let size = slot.len();
            let estimator = memory.as_mut_ptr().cast();
            let mut received = std::ptr::null();
            // SAFETY: pointers to what the functions ask for
            unsafe {
                let (numbers, count, buffer) = (numbers.as_ptr(), numbers.len(), room.as_mut_ptr().cast());
                assert_eq!($receive(buffer, $buffer_size(), &header, numbers, count, &mut received), PkmError::Ok);
                let begin = || $init(estimator, $size(), &settings, size_of_val(&settings));
                assert_eq!(begin(), PkmError::Ok);
                for (beyond, other) in [(received, $table()), ($table(), received)] {
                    assert_eq!($save(estimator, beyond, 1, slot.as_mut_ptr(), size), PkmError::Ok);
                    assert_eq!(begin(), PkmError::Ok);
                    let restore = |table| $restore(estimator, table, slot.as_ptr(), size);
                    assert_eq!(restore(other), PkmError::OtherState);
                    assert_eq!(restore(beyond), PkmError::Ok);
                    let (slot, mut found) = (slot.as_ptr(), PkmNewest { slot: 1, sequence: 0 });
                    assert_eq!(pkm_estimator_newest(1, slot, slot, size, &raw mut found), PkmError::Ok);
                    assert_eq!(found, PkmNewest { slot: 0, sequence: 1 });
                }
            }
        }
    };
}

states! {
    a_state_goes_with_its_table_in_f64, f64, pkm_estimator_size_f64, pkm_estimator_init_f64, pkm_estimator_save_f64, pkm_estimator_restore_f64,
    pkm_table_buffer_size_f64, pkm_table_receive_f64, pkm_table_f64
}
states! {
    a_state_goes_with_its_table_in_f32, f32, pkm_estimator_size_f32, pkm_estimator_init_f32, pkm_estimator_save_f32, pkm_estimator_restore_f32,
    pkm_table_buffer_size_f32, pkm_table_receive_f32, pkm_table_f32
}

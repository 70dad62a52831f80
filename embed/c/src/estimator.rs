//! The core's estimator, what a machine learns while it works, in memory of the caller.

use core::ffi::{CStr, c_char};
use core::{ptr, slice};

use pkm_core::checksum::{START, over_text};
use pkm_core::estimation::{
    Estimator, EstimatorSettingsError, MAX_AMPLITUDES, MAX_COMPONENTS, Slot, newest, state_bytes,
};
use pkm_core::{FiveAxis, Model, Scalar};

use crate::pointers::{answer, given, given_slice, taken};
use crate::{
    PkmCompensator, PkmConfiguration, PkmError, PkmEstimatorSettings, PkmEstimatorState, PkmKnownOffset, PkmLearned,
    PkmMachine, PkmNewest, PkmOffset, PkmPoint, PkmPose, PkmReading, PkmTable, PkmTableUncertainty, PkmTipReading,
    PkmToolCompensator, PkmToolTouch, PkmTouch, PkmWrench, PkmWrist, pkm_machine_checksum,
};

/// Most amplitudes that an estimator learns.
pub const PKM_AMPLITUDES: usize = 8;
const _: () = assert!(PKM_AMPLITUDES == MAX_AMPLITUDES, "another number of amplitudes than the core's");

/// What a saved state goes with: the machine, and the table in service, of either arithmetic.
fn model<T>(table: &PkmTable<T>) -> u64 {
    pkm_machine_checksum() ^ table.checksum
}

/// An estimator of any number of amplitudes.
macro_rules! any {
    ($($name:ident $n:literal),*) => {
        #[allow(clippy::large_enum_variant)] // the memory is of the largest
        enum Any<T> { $($name(Estimator<T, $n>)),* }

        impl<T: Scalar> Any<T> {
            fn new(settings: &PkmEstimatorSettings) -> Result<Self, EstimatorSettingsError> {
                match settings.count {
                    $($n => Ok(Self::$name(Estimator::new(&settings.core::<$n>()?)?)),)*
                    _ => Err(EstimatorSettingsError::Count),
                }
            }
        }

        /// The same for each number of amplitudes.
        macro_rules! each {
            ($any:expr, $estimator:ident => $do:expr) => {
                match $any { $(Any::$name($estimator) => $do),* }
            };
        }
    };
}
any! { One 1, Two 2, Three 3, Four 4, Five 5, Six 6, Seven 7, Eight 8 }

/// What is in the caller's memory.
pub struct PkmEstimator<T> {
    /// Tells an estimator of this version and kind from other memory.
    tag: u64,
    any: Any<T>,
}

impl<T: Scalar> PkmEstimator<T> {
    const TAG: u64 = over_text(START ^ size_of::<Self>() as u64, concat!("estimator ", env!("CARGO_PKG_VERSION")));

    fn new(settings: &PkmEstimatorSettings) -> Result<Self, PkmError> {
        Ok(Self { tag: Self::TAG, any: Any::new(settings)? })
    }

    fn running(&self) -> Result<&Any<T>, PkmError> {
        if self.tag == Self::TAG { Ok(&self.any) } else { Err(PkmError::NotInitialised) }
    }

    fn running_mut(&mut self) -> Result<&mut Any<T>, PkmError> {
        if self.tag == Self::TAG { Ok(&mut self.any) } else { Err(PkmError::NotInitialised) }
    }
}

/// Name of the first setting of an estimator that is out of its range, or "settings_size" when that is not the library's; null when
/// all are within, or when there are none. The number of its amplitude, from 1, goes to `amplitude` unless that is null: 0 of a setting
/// that is none's.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pkm_estimator_setting_out_of_range(
    settings: *const PkmEstimatorSettings,
    settings_size: usize,
    amplitude: *mut u32,
) -> *const c_char {
    // SAFETY: the caller's promise
    let Some((number, name)) = (unsafe { out_of_range(settings, settings_size) }) else { return ptr::null() };
    // SAFETY: the caller's promise
    if let Ok(to) = unsafe { taken(amplitude) } {
        *to = number.into();
    }
    name.as_ptr()
}

/// Number of the amplitude, and name of the setting.
///
/// # Safety
/// As of the function for C.
unsafe fn out_of_range(settings: *const PkmEstimatorSettings, settings_size: usize) -> Option<(u8, &'static CStr)> {
    if settings_size != size_of::<PkmEstimatorSettings>() {
        return Some((0, c"settings_size"));
    }
    // SAFETY: the caller's promise
    let settings = unsafe { given(settings) }.ok()?;
    Some(match Any::<f64>::new(settings).err()? {
        EstimatorSettingsError::Count => (0, c"count"),
        EstimatorSettingsError::ModelShare => (0, c"model_share"),
        EstimatorSettingsError::Twice { amplitude } => (amplitude, c"amplitude"),
        EstimatorSettingsError::Amplitude { amplitude, setting } => {
            let name = match setting {
                "accepted" => c"accepted",
                "deviation" => c"deviation",
                "drift_per_day" => c"drift_per_day",
                "least" => c"least",
                "most" => c"most",
                "rate_per_s" => c"rate_per_s",
                "alarm" => c"alarm",
                _ => c"amplitude",
            };
            (amplitude, name)
        }
        _ => (0, c"settings"),
    })
}

/// Bytes of the saved state of so many amplitudes; the same of both number types.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_estimator_state_bytes(count: u32) -> usize {
    state_bytes((count as usize).min(PKM_AMPLITUDES))
}

/// Which of two slots, of `size` bytes each, holds the newest whole state of so many amplitudes.
///
/// Errors: SETTING_OUT_OF_RANGE: not 1 to `PKM_AMPLITUDES` amplitudes. WRONG_SIZE: the slots are shorter than `pkm_estimator_state_bytes`. STATE_NOT_WHOLE: in neither. Nothing was saved, or both are damaged: begin with the first and sequence number 1.
#[must_use]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pkm_estimator_newest(
    count: u32,
    first: *const u8,
    second: *const u8,
    size: usize,
    found: *mut PkmNewest,
) -> PkmError {
    // SAFETY: the caller's promise
    unsafe {
        answer(found, || {
            let amplitudes = count as usize;
            if !(1..=PKM_AMPLITUDES).contains(&amplitudes) {
                return Err(PkmError::SettingOutOfRange);
            }
            if size < state_bytes(amplitudes) {
                return Err(PkmError::WrongSize);
            }
            let (first, second) = (given_slice(first, size)?, given_slice(second, size)?);
            let (slot, sequence) = newest(amplitudes, first, second).ok_or(PkmError::StateNotWhole)?;
            Ok(PkmNewest { slot: u32::from(slot == Slot::B), sequence })
        })
    }
}

macro_rules! estimator {
    (
        $t:ident, size $size:ident, align $align:ident, init $init:ident, learn $learn:ident, tool_touch $tool_touch:ident, follow $follow:ident,
        state $state:ident, save $save:ident, restore $restore:ident, update_learned $update_learned:ident,
        tool_update_learned $tool_update_learned:ident
    ) => {
        /// Bytes that an estimator takes.
        #[unsafe(no_mangle)]
        pub extern "C" fn $size() -> usize {
            size_of::<PkmEstimator<$t>>()
        }

        /// An estimator's address is a multiple of this.
        #[unsafe(no_mangle)]
        pub extern "C" fn $align() -> usize {
            align_of::<PkmEstimator<$t>>()
        }

        /// Makes an estimator that has read nothing in memory of the caller: of at least as many bytes, `size`, and of the alignment
        /// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied.
        ///
        /// Errors: WRONG_SIZE, SETTING_OUT_OF_RANGE: `pkm_estimator_setting_out_of_range` names it.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $init(
            estimator: *mut PkmEstimator<$t>,
            size: usize,
            settings: *const PkmEstimatorSettings,
            settings_size: usize,
        ) -> PkmError {
            if size < size_of::<PkmEstimator<$t>>() || settings_size != size_of::<PkmEstimatorSettings>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe { answer(estimator, || PkmEstimator::new(given(settings)?)) }
        }

        /// Takes a reading of one to six components in. `machine` is at its temperature. It takes about as long as a cycle. On an
        /// error no amplitude has moved.
        ///
        /// Errors: NOT_INITIALISED, those of `pkm_corrected_stiffness`, NOT_FINITE (also of a deviation that is not above 0),
        /// READING_COMPONENTS, READING_BACKWARDS, READING_NOT_EXCITED, READING_STUCK, READING_WRONG_SIGN, READING_UNEXPECTED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $learn(
            estimator: *mut PkmEstimator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            touch: *const PkmTouch<$t>,
            readings: *const PkmTipReading<$t>,
            count: usize,
            learned: *mut PkmLearned<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(learned, || {
                    let (machine, table, touch) = (given(machine)?.core(), &given(table)?.core, given(touch)?.core());
                    let first = given(readings)?;
                    let any = taken(estimator)?.running_mut()?;
                    if !(1..=MAX_COMPONENTS).contains(&count) {
                        return Err(PkmError::ReadingComponents);
                    }
                    let mut all = [first.core(); MAX_COMPONENTS];
                    for (to, reading) in all.iter_mut().zip(slice::from_raw_parts(readings, count)) {
                        *to = reading.core();
                    }
                    let readings = all.get(..count).ok_or(PkmError::ReadingComponents)?;
                    Ok(each!(any, estimator => estimator.learn(machine, Some(table), &touch, readings))?.into())
                })
            }
        }

        /// Where and under which load the tool of the five axes is read: `wrench` is on the tool at its tip, in the tool's own axes, as a
        /// reading of a compensator has it; time and rise are as in a `PkmTouch`.
        ///
        /// Errors: those of `pkm_tool_forward`.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_touch(
            machine: *const PkmMachine<$t>,
            wrist: *const PkmWrist<$t>,
            configuration: *const PkmConfiguration<$t>,
            wrench: *const PkmWrench<$t>,
            time_s: u32,
            rise_k: $t,
            touch: *mut PkmToolTouch<$t>,
        ) -> PkmError {
            // SAFETY: the caller's promise
            unsafe {
                answer(touch, || {
                    let five = FiveAxis { machine: given(machine)?.core(), wrist: &given(wrist)?.0 };
                    let (configuration, wrench) = (given(configuration)?.core(), given(wrench)?.core());
                    let touch = five.touch(&configuration, &wrench, time_s, rise_k)?.into();
                    // columns
                    Ok(PkmToolTouch { touch, base_axes: configuration.base_axes().into() })
                })
            }
        }

        /// A period of the compensation: what it uses goes to what is worth compensating, at most at the rates of the settings.
        ///
        /// Errors: NOT_INITIALISED, NOT_FINITE, also where the period is below 0.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $follow(estimator: *mut PkmEstimator<$t>, period_s: $t) -> PkmError {
            if !(period_s >= 0.0 && period_s.is_finite()) {
                return PkmError::NotFinite;
            }
            // SAFETY: the caller's promise
            match unsafe { taken(estimator) }.and_then(PkmEstimator::running_mut) {
                Ok(any) => each!(any, estimator => estimator.follow(period_s)),
                Err(error) => return error,
            }
            PkmError::Ok
        }

        /// What it knows, and alarms. `size` is the room for it: `sizeof *state`.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $state(
            estimator: *const PkmEstimator<$t>,
            state: *mut PkmEstimatorState,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmEstimatorState>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(state, || {
                    Ok(each!(given(estimator)?.running()?, estimator => PkmEstimatorState::of(estimator)))
                })
            }
        }

        /// Writes what it knows beyond `table`, with which it has learned, into a slot of `size` bytes, at least
        /// `pkm_estimator_state_bytes`. A controller keeps two slots in memory that stays and writes over the older one, as
        /// `pkm_estimator_newest` says: a cut at any byte leaves the newer. `sequence` is one more than that of the last save. Nothing is
        /// written on an error.
        ///
        /// Errors: NOT_INITIALISED, WRONG_SIZE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $save(
            estimator: *const PkmEstimator<$t>,
            table: *const PkmTable<$t>,
            sequence: u32,
            slot: *mut u8,
            size: usize,
        ) -> PkmError {
            // SAFETY: the caller's promise
            let saved = unsafe { given(estimator) }.and_then(PkmEstimator::running).and_then(|any| {
                // SAFETY: the caller's promise
                let (table, slot) = unsafe {
                    taken(slot)?;
                    (given(table)?, slice::from_raw_parts_mut(slot, size))
                };
                Ok(each!(any, estimator => estimator.save(model(table), sequence, slot))?)
            });
            saved.map_or_else(|error| error, |()| PkmError::Ok)
        }

        /// Goes on from what was saved in a slot of `size` bytes, the newest of two, with `table` in service. On an error nothing has
        /// changed. What was learned beyond another table, or on another machine, is refused: this table may have it already. For that
        /// reason begin anew where a table of `pkm_table_receive` comes into service. After a start `pkm_table` is in service again, or
        /// what was received first: restore with that.
        ///
        /// Errors: NOT_INITIALISED, WRONG_SIZE, STATE_NOT_WHOLE, OTHER_STATE.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $restore(
            estimator: *mut PkmEstimator<$t>,
            table: *const PkmTable<$t>,
            slot: *const u8,
            size: usize,
        ) -> PkmError {
            // SAFETY: the caller's promise
            let restored = unsafe { taken(estimator) }.and_then(PkmEstimator::running_mut).and_then(|any| {
                // SAFETY: the caller's promise
                let (table, slot) = unsafe { (given(table)?, given_slice(slot, size)?) };
                Ok(each!(any, estimator => estimator.restore(model(table), slot))?)
            });
            restored.map_or_else(|error| error, |()| PkmError::Ok)
        }

        /// `pkm_compensator_update` with what was learned, which has taken its `pkm_estimator_follow` of the period. No more is
        /// compensated than is known: by the estimator, and by `uncertainty`, that of the table, unless it is null.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $update_learned(
            compensator: *mut PkmCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            uncertainty: *const PkmTableUncertainty<$t>,
            estimator: *const PkmEstimator<$t>,
            pose: *const PkmPose<$t>,
            tip: *const PkmPoint<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmKnownOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmKnownOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    let (tip, reading) = (given(tip)?.uvw_m.into(), given(reading)?.core());
                    let uncertainty = if uncertainty.is_null() { None } else { Some(&given(uncertainty)?.0) };
                    let any = given(estimator)?.running()?;
                    let compensator = taken(compensator)?.0.running()?;
                    let model = Model { uncertainty, ..Model::new(machine, table) };
                    let offset = each!(any, learned => {
                        compensator.update(&model.with_learned(learned), &pose, tip, &reading)
                    });
                    Ok(PkmKnownOffset::of(PkmOffset::of(offset), offset.known))
                })
            }
        }

        /// The same for all five axes: `pkm_tool_compensator_update` with what was learned.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_update_learned(
            compensator: *mut PkmToolCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            uncertainty: *const PkmTableUncertainty<$t>,
            estimator: *const PkmEstimator<$t>,
            wrist: *const PkmWrist<$t>,
            configuration: *const PkmConfiguration<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmKnownOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmKnownOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, table, wrist) = (given(machine)?.core(), &given(table)?.core, &given(wrist)?.0);
                    let reading = given(reading)?.core();
                    let uncertainty = if uncertainty.is_null() { None } else { Some(&given(uncertainty)?.0) };
                    let configuration = given(configuration)?.core();
                    let any = given(estimator)?.running()?;
                    let compensator = taken(compensator)?.0.running()?;
                    let model = Model { uncertainty, ..Model::new(machine, table) };
                    let offset = each!(any, learned => {
                        compensator.update(&model.with_learned(learned), wrist, &configuration, &reading)
                    });
                    Ok(PkmKnownOffset::of(PkmOffset::of(offset), offset.known))
                })
            }
        }
    };
}

estimator! {
    f64, size pkm_estimator_size_f64, align pkm_estimator_align_f64, init pkm_estimator_init_f64,
    learn pkm_estimator_learn_f64, tool_touch pkm_tool_touch_f64, follow pkm_estimator_follow_f64, state pkm_estimator_state_f64,
    save pkm_estimator_save_f64, restore pkm_estimator_restore_f64,
    update_learned pkm_compensator_update_learned_f64, tool_update_learned pkm_tool_compensator_update_learned_f64
}
estimator! {
    f32, size pkm_estimator_size_f32, align pkm_estimator_align_f32, init pkm_estimator_init_f32,
    learn pkm_estimator_learn_f32, tool_touch pkm_tool_touch_f32, follow pkm_estimator_follow_f32, state pkm_estimator_state_f32,
    save pkm_estimator_save_f32, restore pkm_estimator_restore_f32,
    update_learned pkm_compensator_update_learned_f32, tool_update_learned pkm_tool_compensator_update_learned_f32
}

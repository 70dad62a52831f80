//! The core's compensator, compensation with state, in memory of the caller.

use core::ffi::{CStr, c_char};
use core::ptr;

use pkm_core::checksum::{START, over_text};
use pkm_core::compensator::{
    Compensator, CompensatorSettings, Fault, Limit, Offset, OutsideBox, Reading, SettingsError,
};
use pkm_core::{Model, Scalar};

use crate::pointers::{answer, given, taken};
use crate::{
    PkmConfiguration, PkmDomain, PkmError, PkmMachine, PkmPoint, PkmPose, PkmTable, PkmTemperatureRise, PkmWrench,
    PkmWrist, pkm_machine_checksum, pkm_table_checksum, pkm_verify_f32, pkm_verify_f64, pkm_wrist_checksum,
};

/// What a compensator does where the pose is outside the box that the table was fitted on.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkmOutsideBox {
    /// The offset stays what it was.
    Hold = 0,
    /// The offset goes to zero at the rate limit.
    Fade = 1,
    /// The table is extrapolated.
    Extrapolate = 2,
}

/// Settings of a compensator; `pkm_compensator_defaults` writes the defaults, which are for a force sensor. What they cost, and
/// why they are stable: docs/stability.md.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmCompensatorSettings {
    /// Time from one update to the next, 1e-6 s to 1 s. Default 1e-3 s.
    pub period_s: f64,
    /// Share of the load's deflection that is compensated, 0 to 1. Default 0.7: below 1 with a force sensor; 1 is for a load that
    /// is computed. Thermal growth is compensated whole.
    pub gain: f64,
    /// Time constant of the first-order low-pass on the wrench, 0 s to 10 s and at most 1e5 periods; 0 is no filter. Default 0.02 s.
    pub filter_s: f64,
    /// Dead band: this much is taken off the size of the filtered force, 0 N to `max_force_n`. Default 5 N.
    pub dead_band_n: f64,
    /// The same of the moment, 0 N m to `max_moment_nm`. Default 0.5 N m.
    pub dead_band_nm: f64,
    /// A reading with a greater force is refused, above 0 N and at most 1e9 N. Default 5e3 N.
    pub max_force_n: f64,
    /// A reading with a greater moment is refused, above 0 N m and at most 1e9 N m. Default 1e3 N m.
    pub max_moment_nm: f64,
    /// How long the last good reading stands in for refused ones, 0 s to 10 s; then the load counts as zero. Default 0.01 s.
    pub hold_s: f64,
    /// After how long of equal readings a sensor counts as stuck, 0 s to 1000 s, a period at least; 0 is never, for a load that is
    /// computed. Default 1 s.
    pub stuck_s: f64,
    /// Largest offset of a screw, above 0 m and at most 0.01 m. Default 0.5e-3 m.
    pub max_screw_m: f64,
    /// Largest offset of a wrist joint, above 0 rad and at most 0.1 rad. Default 1e-3 rad.
    pub max_wrist_rad: f64,
    /// Fastest offset of a screw, above 0 m/s and at most 1 m/s, and fast enough for the largest offset in 1e6 periods. Default
    /// 5e-3 m/s.
    pub screw_rate_m_per_s: f64,
    /// Fastest offset of a wrist joint, above 0 rad/s and at most 10 rad/s, and as fast. Default 10e-3 rad/s.
    pub wrist_rate_rad_per_s: f64,
    /// A `PkmOutsideBox`. Default PKM_OUTSIDE_BOX_FADE.
    pub outside_box: i32,
}

/// The machine that a program is for, by the checksums that its `coefficients.rs` states.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PkmChecksums {
    /// As `pkm_machine_checksum`.
    pub machine: u64,
    /// As `pkm_wrist_checksum`.
    pub wrist: u64,
    /// As `pkm_table_checksum`.
    pub table: u64,
}

/// What sensors say in a period. Numbers may be NaN or infinite: then there is no reading, which is a fault with a defined
/// reaction and no error.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmReading<T> {
    /// Not 0: the machine is homed, on, and the reading means the load on the tool. At 0 the offset goes to zero at the rate
    /// limit, and the load is forgotten.
    pub enabled: i32,
    /// Load on the tool, its moment about the tip: in the axes of A-uvw for three screws, in those of T_h for five axes. What a
    /// dynamometer under the workpiece reads has the other sign.
    pub wrench: PkmWrench<T>,
    /// How much warmer limbs and platforms are than at the zero reading; 0 without a sensor.
    pub rise: PkmTemperatureRise<T>,
}

/// Which limit holds an offset back.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkmLimit {
    /// The offset is what was asked for.
    None = 0,
    /// What was asked for is larger than the largest offset.
    Size = 1,
    /// The offset is on its way, at its rate limit.
    Rate = 2,
}

/// What a compensator asks for: always finite, within the largest offset, and no further from the last one than the rate limit
/// lets it in a period, as long as nobody else writes to its memory. The limits scale the offsets of all joints as one vector, so that the tip keeps its direction.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmOffset<T> {
    /// To be added to the lengths of the screws.
    pub screws_m: [T; 3],
    /// To be added to joints 1 and 2 of the wrist; 0 of a compensator for three screws.
    pub wrist_rad: [T; 2],
    /// Which limit holds it back.
    pub limit: PkmLimit,
    /// Where the pose stands to the table's box.
    pub domain: PkmDomain,
    /// The gravest fault of this period, 0 when there is none; `pkm_error_text` says it in words. The offset is to be commanded with every fault. Those of the model end 0.1 s after their cause, and so do those of a wrench whose load already counts as zero; that of the box
    /// ends when the pose is back by a hundredth of the half widths; the others end with their cause.
    pub fault: PkmError,
}

/// What is in the caller's memory.
pub(crate) struct Kept<T, const JOINTS: usize> {
    /// Tells a compensator of this version and kind from other memory.
    tag: u64,
    compensator: Compensator<T, JOINTS>,
}

/// What a compensator of the three screws keeps from period to period.
pub struct PkmCompensator<T>(pub(crate) Kept<T, 3>);

/// What a compensator of the five axes keeps from period to period.
pub struct PkmToolCompensator<T>(pub(crate) Kept<T, 5>);

impl<T: Scalar, const JOINTS: usize> Kept<T, JOINTS> {
    const TAG: u64 = over_text(START ^ (size_of::<Self>() * 8 + JOINTS) as u64, env!("CARGO_PKG_VERSION"));

    fn new(settings: &PkmCompensatorSettings, built_for: &PkmChecksums, memory: PkmError) -> Result<Self, PkmError> {
        if built_for.machine != pkm_machine_checksum() {
            return Err(PkmError::OtherMachine);
        }
        if built_for.wrist != pkm_wrist_checksum() {
            return Err(PkmError::OtherWrist);
        }
        if built_for.table != pkm_table_checksum() {
            return Err(PkmError::OtherTable);
        }
        if memory != PkmError::Ok {
            return Err(memory);
        }
        Ok(Self { tag: Self::TAG, compensator: Compensator::new(&settings.core()?)? })
    }

    pub(crate) fn running(&mut self) -> Result<&mut Compensator<T, JOINTS>, PkmError> {
        if self.tag == Self::TAG { Ok(&mut self.compensator) } else { Err(PkmError::NotInitialised) }
    }
}

impl PkmCompensatorSettings {
    fn core(&self) -> Result<CompensatorSettings, SettingsError> {
        let outside_box = match self.outside_box {
            0 => OutsideBox::Hold,
            1 => OutsideBox::Fade,
            2 => OutsideBox::Extrapolate,
            _ => return Err(SettingsError { setting: "outside_box" }),
        };
        let Self { period_s, gain, filter_s, dead_band_n, dead_band_nm, max_force_n, max_moment_nm, .. } = *self;
        let Self { hold_s, stuck_s, max_screw_m, max_wrist_rad, screw_rate_m_per_s, wrist_rate_rad_per_s, .. } = *self;
        let settings = CompensatorSettings {
            period_s,
            gain,
            filter_s,
            dead_band_n,
            dead_band_nm,
            max_force_n,
            max_moment_nm,
            hold_s,
            stuck_s,
            max_screw_m,
            max_wrist_rad,
            screw_rate_m_per_s,
            wrist_rate_rad_per_s,
            outside_box,
        };
        settings.check().map(|()| settings)
    }
}

impl From<CompensatorSettings> for PkmCompensatorSettings {
    fn from(s: CompensatorSettings) -> Self {
        let outside_box = match s.outside_box {
            OutsideBox::Hold => PkmOutsideBox::Hold,
            OutsideBox::Fade => PkmOutsideBox::Fade,
            OutsideBox::Extrapolate => PkmOutsideBox::Extrapolate,
        };
        Self {
            period_s: s.period_s,
            gain: s.gain,
            filter_s: s.filter_s,
            dead_band_n: s.dead_band_n,
            dead_band_nm: s.dead_band_nm,
            max_force_n: s.max_force_n,
            max_moment_nm: s.max_moment_nm,
            hold_s: s.hold_s,
            stuck_s: s.stuck_s,
            max_screw_m: s.max_screw_m,
            max_wrist_rad: s.max_wrist_rad,
            screw_rate_m_per_s: s.screw_rate_m_per_s,
            wrist_rate_rad_per_s: s.wrist_rate_rad_per_s,
            outside_box: outside_box as i32,
        }
    }
}

impl<T: Scalar> PkmReading<T> {
    pub(crate) fn core(&self) -> Reading<T> {
        Reading { enabled: self.enabled != 0, wrench: self.wrench.core(), rise: self.rise.core() }
    }
}

impl<T: Scalar> PkmOffset<T> {
    pub(crate) fn of<const JOINTS: usize>(Offset { joints, limit, domain, fault, .. }: Offset<T, JOINTS>) -> Self {
        let joint = |i: usize| joints.get(i).copied().unwrap_or(T::ZERO);
        let limit = match limit {
            Limit::None => PkmLimit::None,
            Limit::Size => PkmLimit::Size,
            Limit::Rate => PkmLimit::Rate,
        };
        Self {
            screws_m: [joint(0), joint(1), joint(2)],
            wrist_rad: [joint(3), joint(4)],
            limit,
            domain: domain.into(),
            fault: fault.map_or(PkmError::Ok, Fault::into),
        }
    }
}

/// Writes the default settings. `size` is the room for them: `sizeof *settings`.
///
/// Errors: WRONG_SIZE.
#[must_use]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pkm_compensator_defaults(settings: *mut PkmCompensatorSettings, size: usize) -> PkmError {
    if size != size_of::<PkmCompensatorSettings>() {
        return PkmError::WrongSize;
    }
    // SAFETY: the caller's promise
    unsafe { answer(settings, || Ok(CompensatorSettings::DEFAULT.into())) }
}

/// Name of the first setting that is out of its range, or "settings_size" when that is not the library's; null when all are
/// within, or when there are none.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pkm_compensator_setting_out_of_range(
    settings: *const PkmCompensatorSettings,
    settings_size: usize,
) -> *const c_char {
    if settings_size != size_of::<PkmCompensatorSettings>() {
        return c"settings_size".as_ptr();
    }
    // SAFETY: the caller's promise
    let Ok(settings) = (unsafe { given(settings) }) else { return ptr::null() };
    let Err(SettingsError { setting }) = settings.core() else { return ptr::null() };
    let name: &'static CStr = match setting {
        "period_s" => c"period_s",
        "gain" => c"gain",
        "filter_s" => c"filter_s",
        "dead_band_n" => c"dead_band_n",
        "dead_band_nm" => c"dead_band_nm",
        "max_force_n" => c"max_force_n",
        "max_moment_nm" => c"max_moment_nm",
        "hold_s" => c"hold_s",
        "stuck_s" => c"stuck_s",
        "max_screw_m" => c"max_screw_m",
        "max_wrist_rad" => c"max_wrist_rad",
        "screw_rate_m_per_s" => c"screw_rate_m_per_s",
        "wrist_rate_rad_per_s" => c"wrist_rate_rad_per_s",
        _ => c"outside_box",
    };
    name.as_ptr()
}

/// What compensators of three screws and of five axes have in common.
macro_rules! memory {
    ($kind:ident, $t:ident, $verify:ident, size $size:ident, align $align:ident, init $init:ident, reset $reset:ident) => {
        /// Bytes that a compensator takes.
        #[unsafe(no_mangle)]
        pub extern "C" fn $size() -> usize {
            size_of::<$kind<$t>>()
        }

        /// A compensator's address is a multiple of this.
        #[unsafe(no_mangle)]
        pub extern "C" fn $align() -> usize {
            align_of::<$kind<$t>>()
        }

        /// Makes a compensator without an offset in memory of the caller: of at least as many bytes, `size`, and of the alignment
        /// that the functions above say; `settings_size` is `sizeof *settings`. It holds no pointer, and may be copied. The
        /// library must have the machine, wrist and table of `built_for`, undamaged: a table of another machine would move
        /// this one.
        ///
        /// Errors: WRONG_SIZE, OTHER_MACHINE, OTHER_WRIST, OTHER_TABLE, DAMAGED_MACHINE, DAMAGED_WRIST, DAMAGED_TABLE,
        /// SETTING_OUT_OF_RANGE: `pkm_compensator_setting_out_of_range` names it.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $init(
            compensator: *mut $kind<$t>,
            size: usize,
            settings: *const PkmCompensatorSettings,
            settings_size: usize,
            built_for: *const PkmChecksums,
        ) -> PkmError {
            if size < size_of::<$kind<$t>>() || settings_size != size_of::<PkmCompensatorSettings>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe { answer(compensator, || Ok($kind(Kept::new(given(settings)?, given(built_for)?, $verify())?))) }
        }

        /// Back to no offset and no load at once; a weight and its reference stay as they were set. The offset steps: for drives that are off. To take it
        /// away from drives that are on, update with `enabled` at 0.
        ///
        /// Errors: NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $reset(compensator: *mut $kind<$t>) -> PkmError {
            // SAFETY: the caller's promise
            match unsafe { taken(compensator) }.and_then(|kept| kept.0.running()) {
                Ok(compensator) => compensator.reset(),
                Err(error) => return error,
            }
            PkmError::Ok
        }
    };
}

macro_rules! compensator {
    ($t:ident, update $update:ident, tool_update $tool_update:ident) => {
        /// A period of a compensator for the three screws, with a tip that is rigid with the moving platform. `machine` is at its
        /// temperature; `pose` is where it should stand without the compensation. What is wrong with pose or reading is a fault
        /// of the offset, and no error: the offset is always written, and to be commanded. `size` is the room for it:
        /// `sizeof *offset`.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $update(
            compensator: *mut PkmCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            pose: *const PkmPose<$t>,
            tip: *const PkmPoint<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, table, pose) = (given(machine)?.core(), &given(table)?.core, given(pose)?.core());
                    let (tip, reading) = (given(tip)?.uvw_m.into(), given(reading)?.core());
                    let compensator = taken(compensator)?.0.running()?;
                    Ok(PkmOffset::of(compensator.update(&Model::new(machine, table), &pose, tip, &reading)))
                })
            }
        }

        /// A period of a compensator for all five axes: tip and axis of the tool are compensated. `configuration` is where the
        /// axes should stand without the compensation; the rest is as for three screws.
        ///
        /// Errors: WRONG_SIZE, NOT_INITIALISED.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $tool_update(
            compensator: *mut PkmToolCompensator<$t>,
            machine: *const PkmMachine<$t>,
            table: *const PkmTable<$t>,
            wrist: *const PkmWrist<$t>,
            configuration: *const PkmConfiguration<$t>,
            reading: *const PkmReading<$t>,
            offset: *mut PkmOffset<$t>,
            size: usize,
        ) -> PkmError {
            if size != size_of::<PkmOffset<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise
            unsafe {
                answer(offset, || {
                    let (machine, table, wrist) = (given(machine)?.core(), &given(table)?.core, &given(wrist)?.0);
                    let (configuration, reading) = (given(configuration)?.core(), given(reading)?.core());
                    let compensator = taken(compensator)?.0.running()?;
                    let model = Model::new(machine, table);
                    Ok(PkmOffset::of(compensator.update(&model, wrist, &configuration, &reading)))
                })
            }
        }
    };
}

memory! {
    PkmCompensator, f64, pkm_verify_f64, size pkm_compensator_size_f64, align pkm_compensator_align_f64,
    init pkm_compensator_init_f64, reset pkm_compensator_reset_f64
}
memory! {
    PkmToolCompensator, f64, pkm_verify_f64, size pkm_tool_compensator_size_f64, align pkm_tool_compensator_align_f64,
    init pkm_tool_compensator_init_f64, reset pkm_tool_compensator_reset_f64
}
compensator! { f64, update pkm_compensator_update_f64, tool_update pkm_tool_compensator_update_f64 }

memory! {
    PkmCompensator, f32, pkm_verify_f32, size pkm_compensator_size_f32, align pkm_compensator_align_f32,
    init pkm_compensator_init_f32, reset pkm_compensator_reset_f32
}
memory! {
    PkmToolCompensator, f32, pkm_verify_f32, size pkm_tool_compensator_size_f32, align pkm_tool_compensator_align_f32,
    init pkm_tool_compensator_init_f32, reset pkm_tool_compensator_reset_f32
}
compensator! { f32, update pkm_compensator_update_f32, tool_update pkm_tool_compensator_update_f32 }

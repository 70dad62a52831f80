//! The core's errors as numbers.

use core::ffi::{CStr, c_char};

use pkm_core::TemperatureError;
use pkm_core::checksum::Damaged;
use pkm_core::compensator::{Fault, SettingsError, WeightError};
use pkm_core::self_test::SelfTestFault;
use pkm_core::{
    CompensationError, CorrectionError, CycleError, KinematicsError, StiffnessError, ToolDeflectionError, ToolError,
};

/// What every function returns. The numbers stay what they are in later versions; new ones may come.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkmError {
    /// The result was written.
    Ok = 0,
    /// A pointer is null.
    NullPointer = 1,
    /// A pointer is not aligned for its type.
    Misaligned = 2,
    /// An input, or what would come of it, is NaN or infinite.
    NotFinite = 3,
    /// Memory, a slot or a structure has a size that does not fit: too small, or the header is that of another version.
    WrongSize = 4,
    /// No assembly exists in the working mode: an angle beyond a right angle, Z0 not above 0, the far side of a
    /// singularity, or lengths that don't close.
    Unreachable = 10,
    /// Too near to a direct singularity.
    Singular = 11,
    /// The screw of limb 1 would leave its travel, further than the others.
    OutOfTravelLimb1 = 12,
    /// The screw of limb 2 would leave its travel, further than the others.
    OutOfTravelLimb2 = 13,
    /// The screw of limb 3 would leave its travel, further than the others.
    OutOfTravelLimb3 = 14,
    /// The stiffness is not positive definite in this number type.
    NotPositiveDefinite = 20,
    /// The limb forces under load-dependent effects were not found.
    NotConverged = 21,
    /// No stiffness would be left at this temperature, or it is below absolute zero.
    NoStiffness = 22,
    /// The table has no factor form.
    NoFactorForm = 30,
    /// A coefficient of the table that must be positive is not, at this pose; only outside the table's box.
    NotPositive = 31,
    /// The numbers are no table: too many or too few, out of range, or more terms than there is room for.
    NotATable = 32,
    /// The screws cannot move the tip in every direction: it is too near to the plane through A, or through B, that is
    /// square to BA.
    NotCompensable = 40,
    /// The load displaces the tip by more than a hundredth of the distance from B to A: no machine is at work there. Is it in N and N·m?
    DisplacedTooFar = 41,
    /// A tool is out of the five axes' reach from where they stand, or `near` is no place where they can (all zeros).
    ToolUnreachable = 50,
    /// Where the five axes stand, or on the way, two configurations meet that hold the tool alike.
    ToolSingular = 51,
    /// The first joint of the wrist would leave its limits.
    WristLimit1 = 52,
    /// The second joint of the wrist would leave its limits.
    WristLimit2 = 53,
    /// The machine in memory is not the one that was built.
    DamagedMachine = 60,
    /// The wrist in memory is not the one that was built.
    DamagedWrist = 61,
    /// The table in memory is not the one that was built.
    DamagedTable = 62,
    /// The library has another machine than the program is for.
    OtherMachine = 63,
    /// The library has another wrist, or another length of the tool, than the program is for.
    OtherWrist = 64,
    /// The library has another table than the program is for.
    OtherTable = 65,
    /// Kinematics do not compute the bits that they should: processor, its floating-point unit or its mode, compiler.
    SelfTestKinematics = 66,
    /// Stiffness and compensation do not compute the bits that they should.
    SelfTestStiffness = 67,
    /// The five axes do not compute the bits that they should.
    SelfTestFiveAxes = 68,
    /// The compensator does not compute the bits that it should.
    SelfTestCompensator = 69,
    /// A setting of a compensator or an estimator is out of its range.
    SettingOutOfRange = 70,
    /// The memory holds no compensator or estimator of this version and kind.
    NotInitialised = 71,
    /// The uncertainty of the table in memory is not the one that was built.
    DamagedUncertainty = 72,
    /// The reading of the wrench is NaN or infinite.
    WrenchNotFinite = 80,
    /// The reading of the wrench is beyond the greatest force or moment.
    WrenchTooLarge = 81,
    /// The readings of the wrench were equal for too long.
    WrenchStuck = 82,
    /// A temperature rise is not finite, beyond 100 K either way, has jumped, or runs away.
    TemperatureLost = 83,
    /// The pose is outside the table's box.
    OutsideBox = 84,
    /// A weight or its centre of mass is NaN or infinite.
    WeightNotFinite = 85,
    /// A weight is beyond 1e5 N, ten tonnes.
    WeightTooHeavy = 86,
    /// A centre of mass is farther than 10 m.
    WeightTooFar = 87,
    /// Where the machine was zeroed the weight cannot be compensated, so that there is no reference: outside the table's box, or no
    /// place, posture or stiffness there.
    WeightNoReference = 88,
    /// A reading of the tip has no component, or more than six.
    ReadingComponents = 90,
    /// A reading of the tip is older than the last one.
    ReadingBackwards = 91,
    /// The load moves the tip by too little for the reading to tell anything.
    ReadingNotExcited = 92,
    /// The probe has said the same five times in a row.
    ReadingStuck = 93,
    /// The tip goes against the deflection that its load makes: the sign of probe or load is wrong.
    ReadingWrongSign = 94,
    /// A reading of the tip is further from what is expected than noise and what is unknown explain.
    ReadingUnexpected = 95,
    /// No saved state is whole.
    StateNotWhole = 96,
    /// The saved state is that of another machine or table, or of other amplitudes.
    OtherState = 97,
    /// The tip was read while an offset acted, which takes some of its deflection away. Of controllers, as LinuxCNC's module: no function has it.
    ReadingCompensated = 98,
    /// An error of the core that has no number here.
    Unknown = 255,
}

/// What a number of `PkmError` means, in English; never null, also for a number that is none.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_error_text(error: i32) -> *const c_char {
    let text: &'static CStr = match error {
        0 => c"no error",
        1 => c"a pointer is null",
        2 => c"a pointer is not aligned for its type",
        3 => c"an input, or what would come of it, is not finite",
        4 => c"memory, slot or structure has a size that does not fit",
        10 => c"no assembly exists in the working mode",
        11 => c"too near to a direct singularity",
        12 => c"the screw of limb 1 would leave its travel",
        13 => c"the screw of limb 2 would leave its travel",
        14 => c"the screw of limb 3 would leave its travel",
        20 => c"the stiffness matrix is not positive definite",
        21 => c"the limb forces under load-dependent effects were not found",
        22 => c"no stiffness would be left at this temperature, or it is below absolute zero",
        30 => c"the table has no factor form",
        31 => c"a coefficient of the table is not positive at this pose",
        32 => c"the numbers are no table, or there is no room for its terms",
        40 => c"the screws cannot move the tip in every direction",
        41 => c"the load displaces the tip by more than a hundredth of the distance from B to A",
        50 => c"the tool is out of reach from where the machine stands, or the machine cannot stand there",
        51 => c"too near to a singularity of the five axes",
        52 => c"wrist joint 1 would leave its limits",
        53 => c"wrist joint 2 would leave its limits",
        60 => c"the machine in memory is damaged",
        61 => c"the wrist in memory is damaged",
        62 => c"the table in memory is damaged",
        63 => c"the library has another machine than the program is for",
        64 => c"the library has another wrist than the program is for",
        65 => c"the library has another table than the program is for",
        66 => c"the self-test of the kinematics has other bits",
        67 => c"the self-test of stiffness and compensation has other bits",
        68 => c"the self-test of the five axes has other bits",
        69 => c"the self-test of the compensator has other bits",
        70 => c"a setting is out of its range",
        71 => c"the memory holds no compensator or estimator of this version and kind",
        72 => c"the table's uncertainty in memory is damaged",
        80 => c"the reading of the wrench is not finite",
        81 => c"the reading of the wrench is beyond its greatest",
        82 => c"the reading of the wrench is stuck",
        83 => c"a temperature is lost",
        84 => c"the pose is outside the table's box",
        85 => c"a weight or its centre of mass is not finite",
        86 => c"a weight is beyond 1e5 N",
        87 => c"a centre of mass is farther than 10 m",
        88 => c"the weight has no reference where the machine was zeroed",
        90 => c"the reading of the tip has no component, or more than six",
        91 => c"the reading of the tip is older than the last one",
        92 => c"the load is too small for the reading of the tip to tell anything",
        93 => c"the probe says the same over and over",
        94 => c"the tip goes against its load: the sign of the probe or of the load is wrong",
        95 => c"the reading of the tip is too far from what is expected",
        96 => c"no saved state is whole",
        97 => c"the saved state is that of another machine or table, or of other amplitudes",
        98 => c"the tip was read while an offset acted: probe with the compensation off",
        _ => c"unknown error",
    };
    text.as_ptr()
}

impl From<Damaged> for PkmError {
    fn from(damaged: Damaged) -> Self {
        match damaged {
            Damaged::Machine => Self::DamagedMachine,
            Damaged::Wrist => Self::DamagedWrist,
            Damaged::Table => Self::DamagedTable,
            Damaged::Uncertainty => Self::DamagedUncertainty,
            _ => Self::Unknown,
        }
    }
}

impl From<SelfTestFault> for PkmError {
    fn from(e: SelfTestFault) -> Self {
        match e {
            SelfTestFault::Kinematics => Self::SelfTestKinematics,
            SelfTestFault::Stiffness => Self::SelfTestStiffness,
            SelfTestFault::FiveAxes => Self::SelfTestFiveAxes,
            SelfTestFault::Compensator => Self::SelfTestCompensator,
        }
    }
}

impl From<KinematicsError> for PkmError {
    fn from(error: KinematicsError) -> Self {
        match error {
            KinematicsError::NotFinite => Self::NotFinite,
            KinematicsError::Unreachable => Self::Unreachable,
            KinematicsError::Singular => Self::Singular,
            KinematicsError::OutOfTravel { limb: 1 } => Self::OutOfTravelLimb1,
            KinematicsError::OutOfTravel { limb: 2 } => Self::OutOfTravelLimb2,
            KinematicsError::OutOfTravel { .. } => Self::OutOfTravelLimb3,
            _ => Self::Unknown,
        }
    }
}

impl From<StiffnessError> for PkmError {
    fn from(error: StiffnessError) -> Self {
        match error {
            StiffnessError::Kinematics(e) => e.into(),
            StiffnessError::NotPositiveDefinite => Self::NotPositiveDefinite,
            StiffnessError::NotFinite => Self::NotFinite,
            StiffnessError::NotConverged => Self::NotConverged,
            _ => Self::Unknown,
        }
    }
}

impl From<TemperatureError> for PkmError {
    fn from(error: TemperatureError) -> Self {
        match error {
            TemperatureError::NotFinite => Self::NotFinite,
            TemperatureError::NoStiffness => Self::NoStiffness,
            _ => Self::Unknown,
        }
    }
}

impl From<CorrectionError> for PkmError {
    fn from(error: CorrectionError) -> Self {
        match error {
            CorrectionError::Stiffness(e) => e.into(),
            CorrectionError::NoFactorForm => Self::NoFactorForm,
            CorrectionError::NotPositive { .. } => Self::NotPositive,
            _ => Self::Unknown,
        }
    }
}

impl From<CompensationError> for PkmError {
    fn from(error: CompensationError) -> Self {
        match error {
            CompensationError::NotFinite => Self::NotFinite,
            CompensationError::Singular => Self::NotCompensable,
            CompensationError::TooFar => Self::DisplacedTooFar,
            CompensationError::Kinematics(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

impl From<CycleError> for PkmError {
    fn from(error: CycleError) -> Self {
        match error {
            CycleError::Correction(e) => e.into(),
            CycleError::Compensation(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

impl From<ToolError> for PkmError {
    fn from(error: ToolError) -> Self {
        match error {
            ToolError::NotFinite => Self::NotFinite,
            ToolError::Unreachable => Self::ToolUnreachable,
            ToolError::Singular => Self::ToolSingular,
            ToolError::WristLimit { joint: 1 } => Self::WristLimit1,
            ToolError::WristLimit { .. } => Self::WristLimit2,
            ToolError::Kinematics(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

impl From<ToolDeflectionError> for PkmError {
    fn from(error: ToolDeflectionError) -> Self {
        match error {
            ToolDeflectionError::Tool(e) => e.into(),
            ToolDeflectionError::Stiffness(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

impl From<SettingsError> for PkmError {
    fn from(_: SettingsError) -> Self {
        Self::SettingOutOfRange
    }
}

impl From<WeightError> for PkmError {
    fn from(error: WeightError) -> Self {
        match error {
            WeightError::NotFinite => Self::WeightNotFinite,
            WeightError::TooHeavy => Self::WeightTooHeavy,
            WeightError::TooFar => Self::WeightTooFar,
            WeightError::NoReference(_) => Self::WeightNoReference,
            _ => Self::Unknown,
        }
    }
}

impl From<Fault> for PkmError {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::WrenchNotFinite => Self::WrenchNotFinite,
            Fault::WrenchTooLarge => Self::WrenchTooLarge,
            Fault::WrenchStuck => Self::WrenchStuck,
            Fault::TemperatureLost => Self::TemperatureLost,
            Fault::OutsideBox => Self::OutsideBox,
            Fault::Correction(e) => e.into(),
            Fault::Compensation(e) => e.into(),
            Fault::Tool(e) => e.into(),
            _ => Self::Unknown,
        }
    }
}

//! What is said of readings before anything is said of the machine.

use serde::Serialize;

/// What a warning is about, for programs: these are the names in `--json`, of `diagnose` and of `check`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WarningKind {
    /// All readings are in another frame, point, unit or sign than the file says.
    ReadingsTakenOtherwise,
    /// The same of single poses, which are left out.
    PoseTakenOtherwise,
    /// Rows with the wrong sign.
    ReversedSign,
    /// Rows in a unit a thousand times as large.
    RowsInOtherUnit,
    /// Rows whose load was lost.
    LoadMissing,
    /// A series that stands at several poses.
    SeriesAtSeveralPoses,
    /// One name of a pose at several places.
    PoseNameAtSeveralPositions,
    /// The noise is known from so few repeats that nothing counts as explained.
    FewDegreesOfFreedom,
    /// Repeats that are equal to the last digit.
    EqualRepeats,
    /// A declared noise that is far more than the readings have.
    DeclaredNoiseTooGreat,
    /// Declared noise that is less than what is left, without repeats.
    DeclaredNoiseTooSmall,
    /// Residuals that go with the order of the readings.
    OrderOfReadings,
    /// More declared values would have to change than a machine has wrong.
    ManyGreatChanges,
    /// Held-out readings that the identified model misses by their size.
    HeldOutContradicts,
    /// Angles that look like radians.
    AnglesInRadians,
    /// Temperatures that look like kelvins.
    TemperatureInKelvin,
    /// Temperatures that look like °F.
    TemperatureInFahrenheit,
    /// A point of the readings that looks like metres.
    PointInMetres,
    /// Rows without a temperature, where others have one.
    TemperatureLeftOut,
    /// Numbers such as 9999 that stand for no value.
    Placeholder,
    /// A channel that always reads the same.
    ConstantChannel,
    /// Loads that scatter by more than a load at rest does.
    LoadsThatScatter,
    /// Loads that never turn.
    LoadsOfOneSign,
    /// Too few repeats to take the noise from.
    FewRepeats,
    /// Repeats that differ by far more than the others.
    RepeatsDiffer,
    /// Repeats that all differ from the first readings in the same proportion.
    RepeatsOfOtherScale,
    /// Zeros that drift while a series is read.
    DriftWithinSeries,
    /// Values that stay the same while the load changes.
    StuckReadings,
    /// Something that was found began at one of the poses.
    ChangeBetweenPoses,
    /// Rows that stand in the file twice.
    DuplicateRow,
    /// A number that no noise explains.
    GrossError,
    /// Readings that are hundreds of times what the declared machine gives, or a hundredth.
    OtherUnits,
    /// What `diagnose` refuses.
    CannotBeDiagnosed,
    /// Nothing to take the noise from, which `diagnose` refuses.
    UnknownNoise,
}

impl WarningKind {
    /// Whether readings of which this is said are not to be relied on, whatever the size of what is said.
    fn makes_unsound(self) -> bool {
        matches!(
            self,
            Self::ReadingsTakenOtherwise | Self::DeclaredNoiseTooGreat | Self::ManyGreatChanges | Self::StuckReadings
        )
    }
}

/// A reason to look at the readings before the machine, in a diagnosis.
#[derive(Clone, Debug, Serialize)]
pub struct Warning {
    /// For programs.
    pub kind: WarningKind,
    /// For people.
    pub message: String,
    /// Lines of the file, where it is about some.
    pub lines: Vec<u64>,
    /// Whether the readings that it is about were left out, so that what is found stands without them.
    pub left_out: bool,
    /// Whether readings of which this is said are not to be relied on.
    #[serde(skip)]
    pub makes_unsound: bool,
}

impl Warning {
    /// Of the readings as a whole, which are not left out.
    pub fn new(kind: WarningKind, message: String) -> Self {
        Self { kind, message, lines: Vec::new(), left_out: false, makes_unsound: kind.makes_unsound() }
    }

    /// With its full stop, where it is no question.
    pub fn sentence(&self) -> String {
        format!("{}{}", self.message, if self.message.ends_with('?') { "" } else { "." })
    }
}

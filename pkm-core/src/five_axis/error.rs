//! What may go wrong with tools.

use core::fmt;

use crate::correction::CorrectionError;
use crate::kinematics::KinematicsError;
use crate::stiffness::StiffnessError;

/// Why there is no configuration for a tool, or no tool for a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ToolError {
    /// An input is NaN or infinite, or an axis has no direction.
    NotFinite,
    /// Out of the machine's reach from where it stands, or where it is said to stand is nowhere (Z0 not above 0, an angle
    /// beyond ±90°).
    Unreachable,
    /// Where it stands, or on the way, two configurations meet that hold the tool alike: the normalised Jacobian determinant is
    /// below the wrist's margin.
    Singular,
    /// A frame is no rotation, or one that these five axes cannot take.
    Inconsistent,
    /// A wrist joint would leave its limits. Joints count from 1.
    WristLimit {
        /// The first that does.
        joint: u8,
    },
    /// The parallel mechanism cannot take the pose.
    Kinematics(KinematicsError),
}

impl fmt::Display for ToolError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotFinite => f.write_str("an input is not a finite number, or an axis has no direction"),
            Self::Unreachable => f.write_str("out of reach from where the machine stands"),
            Self::Singular => f.write_str("too near to a singularity of the five axes"),
            Self::Inconsistent => f.write_str("the frame is none that these five axes can take"),
            Self::WristLimit { joint } => write!(f, "wrist joint {joint} would leave its limits"),
            Self::Kinematics(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for ToolError {}

impl From<KinematicsError> for ToolError {
    fn from(e: KinematicsError) -> Self {
        Self::Kinematics(e)
    }
}

/// Why a deflection of the tool cannot be worked out or compensated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum ToolDeflectionError {
    /// There is no configuration.
    Tool(ToolError),
    /// There is no stiffness or no deflection in it.
    Stiffness(CorrectionError),
}

impl fmt::Display for ToolDeflectionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Tool(e) => e.fmt(f),
            Self::Stiffness(e) => e.fmt(f),
        }
    }
}

impl core::error::Error for ToolDeflectionError {}

impl<E: Into<ToolError>> From<E> for ToolDeflectionError {
    fn from(e: E) -> Self {
        Self::Tool(e.into())
    }
}

impl From<CorrectionError> for ToolDeflectionError {
    fn from(e: CorrectionError) -> Self {
        Self::Stiffness(e)
    }
}

impl From<StiffnessError> for ToolDeflectionError {
    fn from(e: StiffnessError) -> Self {
        Self::Stiffness(e.into())
    }
}

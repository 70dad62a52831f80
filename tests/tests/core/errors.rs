//! Every error says what is wrong, in words of its own, and an error within another in the same.

use std::collections::HashSet;
use std::fmt::Display;

use pkm_core::checksum::Damaged;
use pkm_core::correction::TransferError;
use pkm_core::machine::{End, MachineError, Member, Parameter, Problem};
use pkm_core::{
    CompensationError, CorrectionError, CycleError, Fault, KinematicsError, StiffnessError, TableError,
    TemperatureError, ToolDeflectionError, ToolError, WristError,
};

/// Text of each, all different.
fn texts<E: Display>(errors: &[E]) -> Vec<String> {
    let texts: Vec<String> = errors.iter().map(E::to_string).collect();
    assert!(texts.iter().all(|text| text.len() > 10), "{texts:?}");
    assert_eq!(texts.iter().collect::<HashSet<_>>().len(), texts.len(), "{texts:?}");
    texts
}

#[test]
fn every_error_says_what_is_wrong() {
    use KinematicsError::OutOfTravel;
    let kinematics =
        [KinematicsError::NotFinite, KinematicsError::Unreachable, KinematicsError::Singular, OutOfTravel { limb: 2 }];
    assert!(texts(&kinematics)[3].contains("limb 2"));
    let stiffness = [
        StiffnessError::Kinematics(kinematics[1]),
        StiffnessError::NotPositiveDefinite,
        StiffnessError::NotFinite,
        StiffnessError::NotConverged,
    ];
    assert_eq!(texts(&stiffness)[0], kinematics[1].to_string());
    let correction = [
        CorrectionError::Stiffness(stiffness[1]),
        CorrectionError::NoFactorForm,
        CorrectionError::NotPositive { row: 5 },
    ];
    assert_eq!(texts(&correction)[0], stiffness[1].to_string());
    assert!(texts(&correction)[2].contains("row 5"));
    let compensation = [
        CompensationError::NotFinite,
        CompensationError::Singular,
        CompensationError::TooFar,
        CompensationError::Kinematics(kinematics[0]),
    ];
    assert_eq!(texts(&compensation)[3], kinematics[0].to_string());
    let cycle = [CycleError::Correction(correction[2]), CycleError::Compensation(compensation[1])];
    assert_eq!(texts(&cycle), [correction[2].to_string(), compensation[1].to_string()]);
    let tool = [
        ToolError::NotFinite,
        ToolError::Unreachable,
        ToolError::Singular,
        ToolError::Inconsistent,
        ToolError::WristLimit { joint: 1 },
        ToolError::Kinematics(kinematics[3]),
    ];
    let tool_texts = texts(&tool);
    assert!(tool_texts[4].contains("joint 1") && tool_texts[5] == kinematics[3].to_string());
    let loaded = [ToolDeflectionError::Tool(tool[2]), ToolDeflectionError::Stiffness(correction[1])];
    assert_eq!(texts(&loaded), [tool[2].to_string(), correction[1].to_string()]);
    let transfer = [
        TransferError::OtherMachine,
        TransferError::TermCount,
        TransferError::NumberCount,
        TransferError::Table(TableError::EmptyBox),
        TransferError::Checksum,
        TransferError::Memory,
    ];
    assert_eq!(texts(&transfer)[3], TableError::EmptyBox.to_string());
    let faults = [
        Fault::WrenchNotFinite,
        Fault::WrenchTooLarge,
        Fault::WrenchStuck,
        Fault::TemperatureLost,
        Fault::OutsideBox,
        Fault::Correction(correction[2]),
        Fault::Compensation(compensation[1]),
        Fault::Tool(tool[4]),
    ];
    texts(&[Damaged::Machine, Damaged::Wrist, Damaged::Table]);
    let inner = [correction[2].to_string(), compensation[1].to_string(), tool[4].to_string()];
    assert_eq!(texts(&faults)[5..], inner);
    texts(&[
        TableError::TermCount,
        TableError::Exponent,
        TableError::CoefficientCount,
        TableError::NotFinite,
        TableError::EmptyBox,
        TableError::Uncertainty,
    ]);
    texts(&[TemperatureError::NotFinite, TemperatureError::NoStiffness]);
    let wrist = [WristError::Flange, WristError::SingularityMargin, WristError::HomeIsSingular];
    texts(&[&wrist[..], &[1, 2].map(|joint| WristError::Limits { joint })].concat());
}

#[test]
fn what_is_wrong_with_a_machine_is_named() {
    let (limb, axis) = (3, 1);
    let mut parameters = vec![
        Parameter::A1,
        Parameter::A2,
        Parameter::B1,
        Parameter::B2,
        Parameter::TravelMin { limb },
        Parameter::TravelMax { limb },
        Parameter::Effect { effect: 0, parameter: 0 },
        Parameter::Effect { effect: 255, parameter: 0 },
    ];
    for end in [End::Base, End::Platform] {
        parameters.push(Parameter::JointLinear { limb, end, axis });
        parameters.push(Parameter::JointAngular { limb, end, axis });
    }
    for member in [Member::Rod, Member::Screw] {
        parameters.push(Parameter::Young { limb, member });
        parameters.push(Parameter::Shear { limb, member });
        parameters.push(Parameter::Outer { limb, member });
        parameters.push(Parameter::Inner { limb, member });
    }
    for (text, parameter) in texts(&parameters).iter().zip(&parameters) {
        let of_limb = !matches!(parameter, Parameter::A1 | Parameter::A2 | Parameter::B1 | Parameter::B2)
            && !matches!(parameter, Parameter::Effect { .. });
        assert!(!of_limb || text.contains('3'), "{text}");
    }
    let problems = [
        Problem::NotFinite,
        Problem::NotPositive,
        Problem::NotReleased,
        Problem::Reversed,
        Problem::Negative,
        Problem::TooLarge,
        Problem::Bore,
    ];
    texts(&problems);
    let error = MachineError { parameter: Parameter::B2, problem: Problem::Negative };
    assert_eq!(error.to_string(), "the platform size b2 is negative");
}

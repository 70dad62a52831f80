//! Every number of a machine is checked, and an error names it.

use std::collections::HashSet;

use pkm_core::effects::EFFECTS;
use pkm_core::machine::{End, Joint, MachineError, MachineParameters, Member, Parameter, Problem, Tube};
use pkm_core::tables::reference::PARAMETERS;

type Number = Box<dyn Fn(&mut MachineParameters) -> &mut f64>;

fn joint(p: &mut MachineParameters, limb: usize, end: End) -> &mut Joint {
    match end {
        End::Base => &mut p.limbs[limb].base_joint,
        End::Platform => &mut p.limbs[limb].platform_joint,
    }
}

fn tube(p: &mut MachineParameters, limb: usize, member: Member) -> &mut Tube {
    match member {
        Member::Rod => &mut p.limbs[limb].body.rod,
        Member::Screw => &mut p.limbs[limb].body.screw,
    }
}

/// What `check` says of the reference machine with one number changed.
fn with(number: &Number, value: f64) -> Result<(), MachineError> {
    let mut p = PARAMETERS;
    *number(&mut p) = value;
    p.check()
}

/// Angular axes of universal, revolute and spherical joints that turn freely.
fn is_free(limb: usize, end: End, axis: usize) -> bool {
    match (limb, end) {
        (0 | 1, End::Base) => axis < 2,
        (2, End::Platform) => true,
        _ => axis == 0,
    }
}

/// Which effect, which of its numbers, and what it is; the numbers of the machine itself are checked when a table compiles.
#[test]
fn a_checksum_covers_every_effect() {
    let mut sums = HashSet::from([PARAMETERS.checksum()]);
    for (e, effect) in EFFECTS.iter().enumerate() {
        for n in 0..effect.parameters.len() {
            for value in [1e-9, 2e-9] {
                let mut p = PARAMETERS;
                p.effects.parameters[e][n] = value;
                assert!(sums.insert(p.checksum()), "{} {n}", effect.id);
            }
        }
    }
}

#[test]
fn every_number_of_a_machine_is_checked() {
    let mut positive: Vec<(Number, Parameter)> = vec![
        (Box::new(|p| &mut p.geometry.a1_m), Parameter::A1),
        (Box::new(|p| &mut p.geometry.a2_m), Parameter::A2),
        (Box::new(|p| &mut p.geometry.b1_m), Parameter::B1),
        (Box::new(|p| &mut p.geometry.b2_m), Parameter::B2),
    ];
    let mut sizes: Vec<(Number, Parameter)> = Vec::new();
    for i in 0..3 {
        let limb = i as u8 + 1;
        sizes.push((Box::new(move |p| &mut p.travel.min_m[i]), Parameter::TravelMin { limb }));
        sizes.push((Box::new(move |p| &mut p.travel.max_m[i]), Parameter::TravelMax { limb }));
        for (end, n) in [End::Base, End::Platform].into_iter().flat_map(|end| [0, 1, 2].map(|n| (end, n))) {
            let axis = n as u8;
            positive.push((
                Box::new(move |p| &mut joint(p, i, end).linear_n_per_m[n]),
                Parameter::JointLinear { limb, end, axis },
            ));
            let angular: Number = Box::new(move |p| &mut joint(p, i, end).angular_nm_per_rad[n]);
            let parameter = Parameter::JointAngular { limb, end, axis };
            if is_free(i, end, n) {
                for value in [1.0, -1.0, f64::NAN] {
                    assert_eq!(with(&angular, value), Err(MachineError { parameter, problem: Problem::NotReleased }));
                }
            } else {
                positive.push((angular, parameter));
            }
        }
        for member in [Member::Rod, Member::Screw] {
            positive.push((Box::new(move |p| &mut tube(p, i, member).young_pa), Parameter::Young { limb, member }));
            positive.push((Box::new(move |p| &mut tube(p, i, member).shear_pa), Parameter::Shear { limb, member }));
            sizes.push((Box::new(move |p| &mut tube(p, i, member).outer_m), Parameter::Outer { limb, member }));
            let inner: Number = Box::new(move |p| &mut tube(p, i, member).inner_m);
            let outer = tube(&mut { PARAMETERS }, i, member).outer_m;
            let refused = |problem| Err(MachineError { parameter: Parameter::Inner { limb, member }, problem });
            assert_eq!(with(&inner, f64::INFINITY), refused(Problem::NotFinite));
            assert_eq!(with(&inner, -1e-9), refused(Problem::Bore));
            assert_eq!(with(&inner, outer), refused(Problem::Bore));
            assert_eq!((with(&inner, 0.0), with(&inner, 0.999 * outer)), (Ok(()), Ok(())));
        }
        let same: Number = Box::new(move |p| &mut p.travel.max_m[i]);
        let reversed = MachineError { parameter: Parameter::TravelMax { limb }, problem: Problem::Reversed };
        assert_eq!(with(&same, PARAMETERS.travel.min_m[i]), Err(reversed));
        assert_eq!(with(&same, PARAMETERS.travel.min_m[i].next_up()), Ok(()));
    }
    for (number, parameter) in &positive {
        for value in [1.1e-30, 0.9e30] {
            assert_eq!(with(number, value), Ok(()), "{parameter}");
        }
    }
    for (number, parameter) in positive.iter().chain(&sizes) {
        let refused = |problem| Err(MachineError { parameter: *parameter, problem });
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert_eq!(with(number, value), refused(Problem::NotFinite), "{parameter}");
        }
        for value in [0.0, -1.0, 1e-30, 1e30] {
            assert_eq!(with(number, value), refused(Problem::NotPositive), "{parameter}");
        }
    }
}

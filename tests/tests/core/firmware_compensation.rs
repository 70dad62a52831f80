//! The firmware's compensation in two arithmetics.

use pkm_core::compensator::{Fault, Weight, WeightError};
use pkm_core::estimation::{TipReading, Touch};
use pkm_core::nalgebra::{Vector3, Vector6};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64};
use pkm_core::{Basis, CorrectionTable, Deflection, Machine, MachineParameters, Model, Pose, Wrench};
use pkm_protocol::{Arithmetic, Carried, Demand};

use crate::compensator::MODEL;
use crate::estimation::drives;

#[path = "../../../embed/firmware/src/compensation.rs"]
mod firmware;

use firmware::{Compensation, Models, Weighed};

const SINGLE: Model<'static, f32> = Model::new(&MACHINE_F32, &TABLE_F32);
const PERIOD_S: f64 = 1e-3;
/// Of a screw, by default.
const RATE_M_PER_S: f64 = 5e-3;

#[test]
fn an_offset_does_not_leap_between_arithmetics() {
    let models = Models { single: SINGLE, double: MODEL };
    // little is unknown, so that all is compensated
    let mut settings = drives();
    settings.amplitudes.iter_mut().for_each(|own| {
        (own.deviation, own.least, own.most) = (own.deviation / 100.0, 0.0, own.deviation);
        own.drift_per_day /= 100.0;
    });
    let mut task = Compensation::new(&settings, PERIOD_S).unwrap();
    task.narrow();
    let demand = |arithmetic| Demand {
        arithmetic,
        pose: Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 },
        wrench_at_tip: Wrench { force_n: Vector3::new(300.0, 0.0, -900.0), moment_nm: Vector3::zeros() },
        tip_m: Vector3::new(0.0, 0.0, 0.3),
        rises_k: [Some(0.0); 4],
    };
    let size = |offset: [f64; 3]| Vector3::from(offset).amax();
    let mut at_rest = Vec::new();
    for arithmetic in [Arithmetic::F64, Arithmetic::F32, Arithmetic::F64] {
        let mut least = f64::INFINITY;
        for _ in 0..600 {
            let before = Vector3::from(task.offset_m);
            task.period(&models, Some(demand(arithmetic)));
            let step = (Vector3::from(task.offset_m) - before).amax();
            assert!(step <= 1.001 * RATE_M_PER_S * PERIOD_S, "{step:e} m in a period");
            least = least.min(size(task.offset_m));
        }
        // it was gone, and has come again
        assert!(least < RATE_M_PER_S * PERIOD_S && size(task.offset_m) > 2.0 * RATE_M_PER_S * PERIOD_S, "{least:e}");
        at_rest.push(task.offset_m);
    }
    let apart = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).amax();
    assert!(apart(at_rest[0], at_rest[2]) < 1e-8 && apart(at_rest[0], at_rest[1]) < 0.5e-6, "{at_rest:?}");
}

/// What was learned beyond a table is not compensated with another, and leaves at the rate limit.
#[test]
fn a_table_that_comes_is_not_added_to_what_was_learned() {
    let models = Models { single: SINGLE, double: MODEL };
    let mut settings = drives();
    settings.amplitudes.iter_mut().for_each(|own| own.rate_per_s = own.deviation);
    let mut task = Compensation::new(&settings, PERIOD_S).unwrap();
    let demand = Demand {
        arithmetic: Arithmetic::F64,
        pose: Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 },
        wrench_at_tip: Wrench { force_n: Vector3::new(300.0, 0.0, -900.0), moment_nm: Vector3::zeros() },
        tip_m: Vector3::new(0.0, 0.0, 0.3),
        rises_k: [Some(0.0); 4],
    };
    let settled = |task: &mut Compensation| {
        for _ in 0..2000 {
            let before = Vector3::from(task.offset_m);
            task.period(&models, Some(demand));
            let step = (Vector3::from(task.offset_m) - before).amax();
            assert!(step <= 1.001 * RATE_M_PER_S * PERIOD_S, "{step:e} m in a period");
        }
        Vector3::from(task.offset_m)
    };
    let fresh = settled(&mut task.clone());
    // limb 1's drive is softer than machine and table say
    let (pose, tip_m) = (demand.pose, demand.tip_m);
    for n in 0..60 {
        let force_n = Vector3::ith(n as usize % 3, 900.0);
        let wrench = Wrench { force_n, moment_nm: Vector3::zeros() };
        let at_a = wrench.moved_to_a(tip_m);
        let predicted = TABLE_F64.cycle(&MACHINE_F64, &pose, &at_a, tip_m).unwrap().deflection;
        let moved = MACHINE_F64.sensitivities(&pose, &at_a, &task.learner.amplitudes()).unwrap();
        let more = Deflection::from_vector(moved[0].to_vector() * settings.amplitudes[0].deviation);
        let seen = predicted.plus(&more).seen_at(tip_m).translation_m;
        let readings = [0, 1, 2].map(|axis| {
            let read = seen[axis] + 1e-9 * f64::from(n % 5);
            TipReading { direction: Vector6::ith(axis, 1.0), read, deviation: 0.3e-6 }
        });
        let touch = Touch { time_s: 600 * n, pose, tip_m, wrench, rise_k: 0.0 };
        task.learner.absorb(&touch, &predicted, &moved, &readings).expect("taken in");
    }
    let learned = settled(&mut task);
    assert!((learned - fresh).amax() > 0.05e-6, "{learned:?} {fresh:?}");
    task.forget(&settings);
    assert!((settled(&mut task) - fresh).amax() < 1e-12);
    assert_eq!(task.learner.readings(), 0);
}

const CARRIED: Carried = Carried {
    weight: Weight { force_n: Vector3::new(785.0, 20.0, -30.0), centre_m: Vector3::new(0.01, 0.02, 0.1) },
    zeroed_at: Pose { theta_rad: -0.2, sigma_rad: 0.1, z0_m: 0.52 },
    tip_m: Vector3::new(0.0, 0.0, 0.3),
};

/// At the zero of a cold machine a weight asks for nothing, with a table and with the one that follows it, if its reference comes along.
#[test]
fn a_weight_has_the_reference_of_the_table_in_service() {
    // a table whose first term, the constant, is another one
    let terms = usize::from(TABLE_F64.header(0).terms);
    let numbers: Vec<f64> = TABLE_F64.numbers().collect();
    let exponents: Vec<[u8; 3]> = numbers[6..6 + 3 * terms]
        .chunks_exact(3)
        .map(|of| [of[0], of[1], of[2]].map(|exponent| exponent as u8))
        .collect();
    let (diagonal, factor) = numbers[6 + 3 * terms..].split_at(6 * terms);
    let factor: Vec<f64> = factor.iter().map(|number| number * 1.05).collect();
    let [a, b, c, d, e, f] = numbers[..6] else { panic!("a box") };
    let other = CorrectionTable::<f64>::new(
        Basis::<f64>::new([a, b, c], [d, e, f], &exponents).unwrap(),
        diagonal,
        Some(&factor),
    );
    let other = other.unwrap();
    // which grows when it is warm
    let effects = PARAMETERS.effects.with("thermal-expansion", [11e-6, 14e-6, 0.0]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let models = Models { single: SINGLE, double: Model::new(&machine, &TABLE_F64) };
    let next = Models { double: Model::new(&machine, &other), ..models };

    let mut task = Compensation::new(&drives(), PERIOD_S).unwrap();
    let demand = |pose, rises_k| Demand {
        arithmetic: Arithmetic::F64,
        pose,
        wrench_at_tip: Wrench::ZERO,
        tip_m: CARRIED.tip_m,
        rises_k,
    };
    let mut settled = |models: &Models<'_>, weighed: Option<Weighed>, demand: Demand| {
        if let Some(weighed) = &weighed {
            task.carry(weighed);
        }
        for _ in 0..200 {
            let before = Vector3::from(task.offset_m);
            task.period(models, Some(demand));
            let step = (Vector3::from(task.offset_m) - before).amax();
            assert!(step <= 1.001 * RATE_M_PER_S * PERIOD_S, "{step:e} m in a period");
        }
        (task.offset_m, task.fault)
    };
    let (home, away) = (CARRIED.zeroed_at, Pose { theta_rad: 0.2, ..CARRIED.zeroed_at });
    let none = ([0.0; 3], None);
    let cold = [Some(0.0); 4];
    assert_eq!(settled(&models, None, demand(away, cold)), none);
    let of_first = Weighed::new(&models, &CARRIED).unwrap();
    assert_eq!(settled(&models, Some(of_first), demand(home, cold)), none);
    let (offset, fault) = settled(&models, None, demand(away, cold));
    assert!(Vector3::from(offset).amax() > 5e-6 && fault.is_none(), "{offset:?}");
    let of_second = Weighed::new(&next, &CARRIED).unwrap();
    assert_eq!(settled(&next, Some(of_second), demand(home, cold)), none);
    // which the first one's is not
    let (offset, _) = settled(&next, Some(of_first), demand(home, cold));
    assert!(Vector3::from(offset).amax() > 1e-7, "{offset:?}");

    let outside = Carried { zeroed_at: Pose { theta_rad: 1.0, ..home }, ..CARRIED };
    let refused = Weighed::new(&next, &outside).err();
    assert_eq!(refused, Some(WeightError::NoReference(Fault::OutsideBox)));

    // warmer by less than noise, so that it is believed at once; and with the sensor lost: the last that it said
    let (warm, _) = settled(&next, Some(of_second), demand(home, [Some(0.0), Some(0.9), Some(0.0), Some(0.0)]));
    assert!(warm[1].abs() > 3e-6 && warm[0].abs() < 1e-6, "{warm:?}");
    assert_eq!(
        settled(&next, None, demand(home, [Some(0.0), None, Some(0.0), Some(0.0)])),
        (warm, Some(Fault::TemperatureLost))
    );
}

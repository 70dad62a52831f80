//! The compensator: what it asks for when all is well, its limits, and a defined output for every fault.

use nalgebra::{SVector, Vector2, Vector3};
use pkm_core::compensator::{Compensator, CompensatorSettings, Fault, Limit, Offset, OutsideBox, Reading};
use pkm_core::machine::BodyKind;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST_F32, WRIST_F64};
use pkm_core::{
    Configuration, CorrectionError, CorrectionTable, Domain, FiveAxis, JointValues, KinematicsError, Machine,
    MachineParameters, Model, Pose, Scalar, ScrewLengths, TemperatureRise, ToolError, Wrench,
};
use pkm_tests::{between, cases, random_parameters, random_pose, seeded};

/// Of the reference machine.
pub const MODEL: Model<'static, f64> = Model::new(&MACHINE_F64, &TABLE_F64);
const TIP_M: Vector3<f64> = Vector3::new(0.01, -0.02, 0.3);
const POSE: Pose<f64> = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
const OUTSIDE: Pose<f64> = Pose { theta_rad: 0.3, ..POSE };
pub const LOAD: Wrench<f64> =
    Wrench { force_n: Vector3::new(100.0, -50.0, -400.0), moment_nm: Vector3::new(2.0, -8.0, 5.0) };
/// What is asked for is what the model says, at once.
pub const BARE: CompensatorSettings = CompensatorSettings {
    gain: 1.0,
    filter_s: 0.0,
    dead_band_n: 0.0,
    dead_band_nm: 0.0,
    stuck_s: 0.0,
    max_screw_m: 0.01,
    max_wrist_rad: 0.1,
    screw_rate_m_per_s: 1.0,
    wrist_rate_rad_per_s: 10.0,
    period_s: 0.01,
    ..CompensatorSettings::DEFAULT
};

pub fn on(wrench: Wrench<f64>) -> Reading<f64> {
    Reading { enabled: true, wrench, rise: 0.0.into() }
}

fn times(s: f64, wrench: &Wrench<f64>) -> Wrench<f64> {
    Wrench { force_n: wrench.force_n * s, moment_nm: wrench.moment_nm * s }
}

fn compensator(settings: &CompensatorSettings) -> Compensator<f64, 3> {
    Compensator::new(settings).unwrap()
}

fn update(compensator: &mut Compensator<f64, 3>, pose: &Pose<f64>, reading: &Reading<f64>) -> Offset<f64, 3> {
    compensator.update(&MODEL, pose, TIP_M, reading)
}

fn settled(compensator: &mut Compensator<f64, 3>, pose: &Pose<f64>, reading: &Reading<f64>) -> Offset<f64, 3> {
    (0..999).for_each(|_| _ = update(compensator, pose, reading));
    update(compensator, pose, reading)
}

/// What a load does while the machine stands outside the table's box is part of what friction remembers.
#[test]
fn friction_remembers_a_load_outside_the_box() {
    let effects = PARAMETERS.effects.with("friction-hysteresis", [5e-6, 0.0, 50.0]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let model = Model::new(&machine, &TABLE_F64);
    let press = |n: f64| on(Wrench { force_n: Vector3::new(0.0, 0.0, n), ..Wrench::ZERO });
    let after = |outside_box: OutsideBox, away: Pose<f64>| {
        let mut c = compensator(&CompensatorSettings { outside_box, ..BARE });
        for (pose, n) in [(POSE, 200.0), (away, 800.0), (away, 200.0)] {
            (0..50).for_each(|_| _ = c.update(&model, &pose, TIP_M, &press(n)));
        }
        (0..50).map(|_| c.update(&model, &POSE, TIP_M, &press(200.0))).last().unwrap().joints
    };
    let once = after(OutsideBox::Fade, POSE);
    let grown = {
        let mut c = compensator(&BARE);
        (0..50).map(|_| c.update(&model, &POSE, TIP_M, &press(200.0))).last().unwrap().joints
    };
    assert!((once - grown).norm() > 5e-6, "a load that was greater leaves {}", (once - grown).norm());
    for outside_box in [OutsideBox::Fade, OutsideBox::Hold, OutsideBox::Extrapolate] {
        let back = after(outside_box, OUTSIDE);
        assert!((back - once).norm() < 1e-6, "{outside_box:?}: {} µm", 1e6 * (back - once).norm());
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let d = CompensatorSettings::DEFAULT;
    assert_eq!(d.check(), Ok(()));
    assert_eq!(BARE.check(), Ok(()));
    for bad in [f64::NAN, -1e-9, f64::INFINITY, 1e10] {
        let wrong = [
            (CompensatorSettings { period_s: bad, ..d }, "period_s"),
            (CompensatorSettings { gain: bad, ..d }, "gain"),
            (CompensatorSettings { filter_s: bad, ..d }, "filter_s"),
            (CompensatorSettings { dead_band_n: bad, ..d }, "dead_band_n"),
            (CompensatorSettings { dead_band_nm: bad, ..d }, "dead_band_nm"),
            (CompensatorSettings { max_force_n: bad, ..d }, "max_force_n"),
            (CompensatorSettings { max_moment_nm: bad, ..d }, "max_moment_nm"),
            (CompensatorSettings { hold_s: bad, ..d }, "hold_s"),
            (CompensatorSettings { stuck_s: bad, ..d }, "stuck_s"),
            (CompensatorSettings { max_screw_m: bad, ..d }, "max_screw_m"),
            (CompensatorSettings { max_wrist_rad: bad, ..d }, "max_wrist_rad"),
            (CompensatorSettings { screw_rate_m_per_s: bad, ..d }, "screw_rate_m_per_s"),
            (CompensatorSettings { wrist_rate_rad_per_s: bad, ..d }, "wrist_rate_rad_per_s"),
        ];
        for (settings, name) in wrong {
            let refused = Compensator::<f32, 5>::new(&settings).unwrap_err();
            assert_eq!(refused.setting, name, "{bad}");
            assert!(refused.to_string().contains(name));
        }
    }
    for zero in [CompensatorSettings { max_screw_m: 0.0, ..d }, CompensatorSettings { period_s: 0.0, ..d }] {
        assert!(zero.check().is_err());
    }
}

#[test]
fn without_filter_and_limits_it_is_the_cycle() {
    let mut compensator = compensator(&BARE);
    let offset = update(&mut compensator, &POSE, &on(LOAD));
    let cycle = TABLE_F64.cycle(&MACHINE_F64, &POSE, &LOAD, TIP_M).unwrap();
    let expected = cycle.compensated.lengths.q_m - cycle.lengths.q_m;
    assert_eq!(
        offset,
        Offset { joints: expected, limit: Limit::None, domain: Domain::Inside, fault: None, known: None }
    );
    assert_eq!(compensator.joints(), expected);
    // nothing is kept of a load once it is switched off
    assert_eq!(update(&mut compensator, &POSE, &Reading { enabled: false, ..on(LOAD) }).joints, Vector3::zeros());
}

#[test]
fn a_reset_is_a_new_beginning() {
    let warm = Reading { rise: 3.0.into(), ..on(LOAD) };
    let mut used = compensator(&CompensatorSettings::DEFAULT);
    assert_ne!(settled(&mut used, &POSE, &warm).joints, Vector3::zeros());
    used.reset();
    assert_eq!(used, compensator(&CompensatorSettings::DEFAULT));
}

#[test]
fn gain_dead_band_and_growth_are_what_the_settings_say() {
    let full = update(&mut compensator(&BARE), &POSE, &on(LOAD)).joints;
    let half = update(&mut compensator(&CompensatorSettings { gain: 0.5, ..BARE }), &POSE, &on(LOAD)).joints;
    for i in 0..3 {
        assert!((half[i] - 0.5 * full[i]).abs() < 1e-3 * full[i].abs(), "{half:?} {full:?}");
    }
    // the size of a force is shortened by the band, its direction stays
    let force = Wrench { moment_nm: Vector3::zeros(), ..LOAD };
    let size = force.force_n.norm();
    let banded = CompensatorSettings { dead_band_n: 20.0, dead_band_nm: 1.0, ..BARE };
    let shortened = update(&mut compensator(&BARE), &POSE, &on(times(1.0 - 20.0 / size, &force))).joints;
    let dead = update(&mut compensator(&banded), &POSE, &on(force)).joints;
    assert!((0..3).all(|i| (dead[i] - shortened[i]).abs() < 1e-15));
    let small = Wrench { force_n: Vector3::new(0.0, 0.0, 19.9), moment_nm: Vector3::new(0.9, 0.0, 0.0) };
    assert_eq!(update(&mut compensator(&banded), &POSE, &on(small)).joints, Vector3::zeros());
    // growth is no feedback: it is compensated whole
    let effects = PARAMETERS.effects.with("thermal-expansion", [11e-6, 11e-6, 0.0]).unwrap();
    let steel = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let warm = Reading { rise: 10.0.into(), ..on(Wrench::ZERO) };
    let mut compensator = compensator(&CompensatorSettings { gain: 0.5, ..BARE });
    let offset = compensator.update(&Model::new(&steel, &TABLE_F64), &POSE, TIP_M, &warm).joints;
    let grown = steel.thermal_deflection(&POSE, 10.0).unwrap();
    let (to, from) = (steel.compensated(&POSE, &grown, TIP_M).unwrap().lengths, steel.inverse(&POSE).unwrap());
    assert_eq!(offset, to.q_m - from.q_m);
    assert!(offset.iter().all(|o| o.abs() > 1e-5));
}

#[test]
fn the_filter_is_of_first_order() {
    let settings = CompensatorSettings { filter_s: 0.09, ..BARE };
    let mut filtered = compensator(&settings);
    let mut share = 0.0;
    for _ in 0..30 {
        // weight: period / (period + time constant)
        share += 0.1 * (1.0 - share);
        let offset = update(&mut filtered, &POSE, &on(LOAD)).joints;
        let expected = update(&mut compensator(&BARE), &POSE, &on(times(share, &LOAD))).joints;
        assert!((0..3).all(|i| (offset[i] - expected[i]).abs() < 1e-12), "{offset:?} {expected:?}");
    }
}

/// Tip of a pose in B-xyz.
fn tip_of(pose: &Pose<f64>) -> Vector3<f64> {
    let axes = pkm_core::kinematics::platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
    Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m) + axes * TIP_M
}

/// While either limit acts, on the way out and back, the tip is on the line between its unloaded and its compensated place, up to the
/// greatest force and moment that are believed.
#[test]
fn a_limited_tip_stays_on_its_line() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(200) {
        let pose = Pose {
            theta_rad: between(&mut rng, -0.26, 0.26),
            sigma_rad: between(&mut rng, -0.26, 0.26),
            z0_m: between(&mut rng, 0.5, 0.56),
        };
        let mut any = |size: f64| Vector3::from_fn(|_, _| between(&mut rng, -1.0, 1.0)).normalize() * size;
        let load = Wrench { force_n: any(0.999 * BARE.max_force_n), moment_nm: any(0.999 * BARE.max_moment_nm) };
        let lengths = MACHINE_F64.inverse(&pose).unwrap().q_m;
        let cycle = TABLE_F64.cycle(&MACHINE_F64, &pose, &load, TIP_M).unwrap();
        let (from, to) = (tip_of(&pose), tip_of(&cycle.compensated.pose));
        let way = to - from;
        // so slow that the rate limit acts from the first step to the last, and a size that is not reached by all
        let largest = (cycle.compensated.lengths.q_m - lengths).amax();
        let settings = CompensatorSettings { max_screw_m: 0.6 * largest, screw_rate_m_per_s: largest, ..BARE };
        let mut limited = compensator(&settings);
        let mut met = [false; 2];
        for period in 0..200 {
            let offset = update(&mut limited, &pose, &Reading { enabled: period < 100, ..on(load) });
            met[0] |= offset.limit == Limit::Size;
            met[1] |= offset.limit == Limit::Rate;
            let q_m = lengths + offset.joints;
            let gone = tip_of(&MACHINE_F64.forward(&ScrewLengths { q_m }).unwrap()) - from;
            let along = gone.dot(&way) / way.norm_squared();
            assert!((-1e-3..=0.65).contains(&along), "{along}");
            worst = worst.max((gone - along * way).norm());
        }
        assert_eq!(met, [true; 2]);
        assert_eq!(limited.joints(), Vector3::zeros());
    }
    println!("the tip is at most {:.1e} µm beside its line", 1e6 * worst);
    assert!(worst < 1e-7, "{worst:e}");
}

/// The smallest limits that settings allow are none in f32.
#[test]
fn a_limit_that_is_none_in_f32_leaves_no_offset() {
    for max_screw_m in [1e-300, 1e-46, 1e-44, 1e-38, 1e-30, 1e-12] {
        let mut limited = Compensator::<f32, 3>::new(&CompensatorSettings { max_screw_m, ..BARE }).unwrap();
        let pose = Pose { theta_rad: 0.1_f32, sigma_rad: -0.05, z0_m: 0.53 };
        let wrench = Wrench { force_n: Vector3::new(100.0, -50.0, -400.0), moment_nm: Vector3::new(2.0, -8.0, 5.0) };
        for enabled in [true, true, true, false, false] {
            let reading = Reading { enabled, wrench, rise: 0.0.into() };
            let offset = limited.update(&Model::new(&MACHINE_F32, &TABLE_F32), &pose, TIP_M.cast(), &reading);
            let most = offset.joints.amax();
            assert!(f64::from(most) <= max_screw_m * (1.0 + 1e-6), "{max_screw_m:e}: {}", offset.joints);
        }
    }
}

/// Offsets of up to 10 mm are gone within the periods that the rate limit takes when they are taken back, wherever the tip is, but for
/// one in a thousand, which takes a tenth more at most.
#[test]
fn an_offset_is_taken_back_in_hardly_more_periods_than_its_rate_takes() {
    let settings = CompensatorSettings { screw_rate_m_per_s: 0.005, outside_box: OutsideBox::Extrapolate, ..BARE };
    let mut rng = seeded();
    let (mut runs, mut late, mut worst) = (0, 0, 1.0_f64);
    for _ in 0..cases(3000) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let pose = Pose { theta_rad: within(0.26), sigma_rad: within(0.26), z0_m: 0.53 + within(0.03) };
        let tip_m = Vector3::from_fn(|_, _| within(0.5));
        let load = Wrench { force_n: Vector3::from_fn(|_, _| within(2800.0)), moment_nm: Vector3::zeros() };
        let mut limited = compensator(&settings);
        let at_once = CompensatorSettings { screw_rate_m_per_s: BARE.screw_rate_m_per_s, ..settings };
        let way = compensator(&at_once).update(&MODEL, &pose, tip_m, &on(load));
        let needed = (way.joints.amax() / (settings.screw_rate_m_per_s * settings.period_s)).ceil();
        if way.fault.is_some() || needed < 10.0 {
            continue;
        }
        (0..2 * needed as usize).for_each(|_| _ = limited.update(&MODEL, &pose, tip_m, &on(load)));
        assert!((limited.joints() - way.joints).amax() < 1e-9, "{} {}", limited.joints(), way.joints);
        let off = Reading { enabled: false, ..on(load) };
        let mut periods = 0.0;
        while limited.joints() != Vector3::zeros() {
            limited.update(&MODEL, &pose, tip_m, &off);
            periods += 1.0;
        }
        runs += 1;
        late += usize::from(periods > needed + 1.0);
        worst = worst.max(periods / needed);
    }
    println!("{late} of {runs} late, {worst:.3} times at worst");
    assert!(runs > 1000 && late * 1000 <= runs && worst < 1.1, "{late} of {runs}, {worst}");
}

/// The same of five axes, with screws in m and a wrist in rad, whichever of their limits acts, up to 2 kN and 20 N·m.
#[test]
fn a_limited_tool_stays_on_its_line() {
    const LOAD_N: f64 = 2e3;
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let mut rng = seeded();
    let (mut worst, mut runs) = (0.0_f64, 0);
    for case in 0..cases(400) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let pose = Pose { theta_rad: within(0.24), sigma_rad: within(0.24), z0_m: 0.53 + within(0.028) };
        let stands = Configuration { pose, beta_rad: Vector2::new(within(1.2), -0.3 + within(0.3)) };
        let load = Wrench::from_vector([1.0, 1.0, 1.0, 0.01, 0.01, 0.01].map(|share| within(share * LOAD_N)).into());
        let Ok(from) = five.joints(&stands) else { continue };
        let moved = |by: &SVector<f64, 5>| {
            let q_m = from.lengths.q_m + by.fixed_rows::<3>(0);
            let beta_rad = from.beta_rad + by.fixed_rows::<2>(3);
            five.forward(&JointValues { lengths: ScrewLengths { q_m }, beta_rad }).map(|(_, tool)| tool)
        };
        let mut free = Compensator::<f64, 5>::new(&BARE).unwrap();
        let asked = free.update(&MODEL, five.wrist, &stands, &on(load));
        let (Ok(at), Ok(to)) = (moved(&SVector::zeros()), moved(&asked.joints)) else { continue };
        if asked.fault.is_some() || asked.limit != Limit::None {
            continue;
        }
        // either joint's limit is the narrower one: 0.6 of what is asked, in 60 periods and more
        let (screw, turn) = (asked.joints.fixed_rows::<3>(0).amax(), asked.joints.fixed_rows::<2>(3).amax());
        let [max_screw_m, max_wrist_rad] =
            if case % 2 == 0 { [0.6 * screw, 0.9 * turn] } else { [0.9 * screw, 0.6 * turn] };
        let (screw_rate_m_per_s, wrist_rate_rad_per_s) = (screw, turn);
        let settings =
            CompensatorSettings { max_screw_m, max_wrist_rad, screw_rate_m_per_s, wrist_rate_rad_per_s, ..BARE };
        let mut limited = Compensator::<f64, 5>::new(&settings).unwrap();
        let mut met = [false; 2];
        let way = to.tip_m - at.tip_m;
        for period in 0..200 {
            let offset = limited.update(&MODEL, five.wrist, &stands, &Reading { enabled: period < 100, ..on(load) });
            met[0] |= offset.limit == Limit::Size;
            met[1] |= offset.limit == Limit::Rate;
            let Ok(tool) = moved(&offset.joints) else { panic!("{stands:?}") };
            let gone = tool.tip_m - at.tip_m;
            let along = gone.dot(&way) / way.norm_squared();
            assert!((-1e-3..=0.65).contains(&along), "{along}");
            worst = worst.max((gone - along * way).norm());
        }
        assert_eq!(met, [true; 2]);
        assert_eq!(limited.joints(), SVector::<f64, 5>::zeros());
        runs += 1;
    }
    assert!(runs > cases(400) / 2);
    println!("the tip of five axes is at most {:.1e} µm beside its line", 1e6 * worst);
    assert!(worst < 1e-7, "{worst:e}");
}

#[test]
fn what_is_refused_is_held_and_then_fades() {
    let d = CompensatorSettings { stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let nan = Wrench { force_n: Vector3::new(0.0, f64::NAN, 0.0), ..LOAD };
    let spike = times(100.0, &LOAD);
    for (bad, fault) in [(nan, Fault::WrenchNotFinite), (spike, Fault::WrenchTooLarge)] {
        let mut compensator = compensator(&d);
        let before = settled(&mut compensator, &POSE, &on(LOAD));
        assert_eq!((before.fault, before.limit), (None, Limit::None));
        // 10 ms are 10 periods
        for _ in 0..10 {
            let held = update(&mut compensator, &POSE, &on(bad));
            assert_eq!(held.fault, Some(fault));
            assert!((0..3).all(|i| (held.joints[i] - before.joints[i]).abs() < 1e-15));
        }
        let faded = settled(&mut compensator, &POSE, &on(bad));
        assert!(faded.joints.iter().all(|o| o.abs() < 1e-15), "{faded:?}");
        assert_eq!(settled(&mut compensator, &POSE, &on(LOAD)).fault, None);
    }
}

#[test]
fn a_sensor_without_noise_is_stuck() {
    let mut compensator = compensator(&CompensatorSettings::DEFAULT);
    let noisy = |period: usize| on(times(1.0 + 1e-12 * (period % 2) as f64, &LOAD));
    for period in 0..3000 {
        assert_eq!(update(&mut compensator, &POSE, &noisy(period)).fault, None);
    }
    for _ in 0..999 {
        assert_eq!(update(&mut compensator, &POSE, &noisy(1)).fault, None);
    }
    assert_eq!(update(&mut compensator, &POSE, &noisy(1)).fault, Some(Fault::WrenchStuck));
    assert!(settled(&mut compensator, &POSE, &noisy(1)).joints.iter().all(|o| o.abs() < 1e-15));
    // 0.1 s
    for period in 2..101 {
        assert_eq!(update(&mut compensator, &POSE, &noisy(period)).fault, Some(Fault::WrenchStuck));
    }
    assert_eq!(update(&mut compensator, &POSE, &noisy(101)).fault, None);
}

/// A program that takes `enabled` away more often than every `stuck_s` does not hide a sensor that is stuck.
#[test]
fn a_stuck_sensor_is_found_although_the_compensation_is_switched_off_and_on() {
    let mut compensator = compensator(&CompensatorSettings::DEFAULT);
    let found = |period: usize, compensator: &mut Compensator<f64, 3>| {
        let reading = Reading { enabled: period % 1000 < 900, ..on(LOAD) };
        update(compensator, &POSE, &reading).fault
    };
    assert!((0..900).all(|period| found(period, &mut compensator).is_none()));
    assert!((900..5000).any(|period| found(period, &mut compensator) == Some(Fault::WrenchStuck)));
    compensator.reset();
    assert!((0..900).all(|period| found(period, &mut compensator).is_none()));
}

/// A plug of the load cell, or of an encoder, that makes contact for 60 ms and none for 30 ms: the offset goes, and does not come and go with it.
#[test]
fn a_sensor_that_comes_and_goes_does_not_shake_the_machine() {
    let no_load = Wrench { force_n: Vector3::repeat(f64::NAN), ..LOAD };
    let nowhere = Pose { z0_m: f64::NAN, ..POSE };
    for (pose, load) in [(POSE, no_load), (nowhere, LOAD)] {
        let mut compensator = compensator(&CompensatorSettings { stuck_s: 0.0, ..CompensatorSettings::DEFAULT });
        let mut last = settled(&mut compensator, &POSE, &on(LOAD)).joints.norm();
        for period in 0..3000 {
            let (pose, load) = if period % 90 < 30 { (pose, load) } else { (POSE, LOAD) };
            let now = update(&mut compensator, &pose, &on(load));
            assert!(now.joints.norm() <= last && now.fault.is_some(), "{period}: {now:?}");
            last = now.joints.norm();
        }
        assert!(last < 1e-15);
    }
}

#[test]
fn a_lost_temperature_is_the_last_one() {
    let steel = steel();
    let mut compensator = compensator(&BARE);
    let mut at = |rise_k: f64| at_rise(&mut compensator, &steel, rise_k.into());
    let warm = at(8.0);
    assert_eq!(warm.fault, None);
    for lost in [f64::NAN, f64::INFINITY, -101.0, 9.01, -20.0] {
        assert_eq!(at(lost), Offset { fault: Some(Fault::TemperatureLost), ..warm });
    }
    // as much as noise
    assert_eq!(at(7.1).fault, None);
}

fn steel() -> Machine<f64> {
    let effects = PARAMETERS.effects.with("thermal-expansion", [11e-6, 14e-6, 0.0]).unwrap();
    Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap()
}

fn at_rise(
    compensator: &mut Compensator<f64, 3>,
    machine: &Machine<f64>,
    rise: TemperatureRise<f64>,
) -> Offset<f64, 3> {
    compensator.update(&Model::new(machine, &TABLE_F64), &POSE, TIP_M, &Reading { rise, ..on(Wrench::ZERO) })
}

/// One sensor of four fails: its own last good reading stands in, and the others are followed.
#[test]
fn one_temperature_of_several_is_lost_alone() {
    let steel = steel();
    let rise = |[first, second, third, platforms_k]: [f64; 4]| TemperatureRise {
        limbs_k: [first, second, third],
        platforms_k,
    };
    let before = [8.0, 6.0, -2.0, 3.0];
    for sensor in 0..4 {
        for broken in [f64::NAN, f64::NEG_INFINITY, 150.0, before[sensor] + 1.01, before[sensor] - 40.0] {
            let mut with_fault = compensator(&BARE);
            assert_eq!(at_rise(&mut with_fault, &steel, rise(before)).fault, None);
            let (mut read, mut meant) = (before.map(|k| k + 0.5), before.map(|k| k + 0.5));
            (read[sensor], meant[sensor]) = (broken, before[sensor]);
            let expected = at_rise(&mut compensator(&BARE), &steel, rise(meant));
            assert_eq!(expected.fault, None);
            for _ in 0..5 {
                let found = at_rise(&mut with_fault, &steel, rise(read));
                assert_eq!(found, Offset { fault: Some(Fault::TemperatureLost), ..expected });
            }
            // it ends with its cause
            assert_eq!(at_rise(&mut with_fault, &steel, rise(meant)), expected);
        }
    }
}

/// A sensor that comes back finds a machine that has gone on warming up: 0.1 K for each second. One that begins, or begins again
/// because nothing was compensated meanwhile, is believed.
#[test]
fn a_sensor_that_comes_back_is_believed() {
    let steel = steel();
    let mut compensator = compensator(&BARE);
    let mut at = |rise_k: f64| at_rise(&mut compensator, &steel, rise_k.into()).fault;
    let lost = Some(Fault::TemperatureLost);
    assert_eq!(at(5.0), None);
    // 20 s of 10 ms
    (0..2000).for_each(|_| assert_eq!(at(f64::NAN), lost));
    assert_eq!((at(8.5), at(7.9)), (lost, None));
    assert_eq!(at(60.0), lost);
    let off = Reading { enabled: false, ..on(Wrench::ZERO) };
    compensator.update(&Model::new(&steel, &TABLE_F64), &POSE, TIP_M, &off);
    assert_eq!(at_rise(&mut compensator, &steel, 60.0.into()).fault, None);
}

#[test]
fn outside_the_box_it_does_what_was_chosen() {
    for outside_box in [OutsideBox::Hold, OutsideBox::Fade, OutsideBox::Extrapolate] {
        let mut compensator = compensator(&CompensatorSettings { outside_box, ..BARE });
        let inside = update(&mut compensator, &POSE, &on(LOAD));
        let outside = update(&mut compensator, &OUTSIDE, &on(LOAD));
        assert_eq!((inside.domain, outside.domain), (Domain::Inside, Domain::Outside));
        let cycle = TABLE_F64.cycle(&MACHINE_F64, &OUTSIDE, &LOAD, TIP_M).unwrap();
        let (expected, fault) = match outside_box {
            OutsideBox::Hold => (inside.joints, Some(Fault::OutsideBox)),
            OutsideBox::Fade => (Vector3::zeros(), Some(Fault::OutsideBox)),
            OutsideBox::Extrapolate => (cycle.compensated.lengths.q_m - cycle.lengths.q_m, None),
        };
        assert_eq!((outside.joints, outside.fault), (expected, fault));
        // a reading that is wrong as well
        let lost = Wrench { force_n: Vector3::repeat(f64::NAN), ..LOAD };
        assert_eq!(update(&mut compensator, &OUTSIDE, &on(lost)).fault, Some(Fault::WrenchNotFinite));
        // no pose at all: nothing is held
        let mut at_nowhere = compensator;
        let nowhere = update(&mut at_nowhere, &Pose { z0_m: f64::NAN, ..POSE }, &on(LOAD));
        assert_eq!((nowhere.joints, nowhere.domain), (Vector3::zeros(), Domain::Outside));
        assert_eq!(nowhere.fault, Some(Fault::from(CorrectionError::from(KinematicsError::NotFinite))));
        let far = update(&mut compensator, &Pose { z0_m: 0.9, ..POSE }, &on(LOAD));
        assert_eq!(far.joints, if outside_box == OutsideBox::Hold { inside.joints } else { Vector3::zeros() });
    }
}

/// A machine that stands on a face of the table's box, under the noise of its encoders, is not shaken: it is out when it was out once, and back
/// when it is back by a hundredth of the box.
#[test]
fn a_machine_on_a_face_of_the_box_is_not_shaken() {
    let face_m = POSE.z0_m
        + (1..)
            .map(|n| 1e-6 * f64::from(n))
            .find(|dz_m| TABLE_F64.domain(&Pose { z0_m: POSE.z0_m + dz_m, ..POSE }) == Domain::Outside)
            .unwrap();
    let mut rng = seeded();
    for outside_box in [OutsideBox::Hold, OutsideBox::Fade] {
        let mut compensator =
            compensator(&CompensatorSettings { outside_box, stuck_s: 0.0, ..CompensatorSettings::DEFAULT });
        let inside = settled(&mut compensator, &POSE, &on(LOAD)).joints;
        let mut last = inside;
        for period in 0..2000 {
            let pose = Pose { z0_m: face_m + between(&mut rng, -1e-6, 1e-6), ..POSE };
            let now = update(&mut compensator, &pose, &on(LOAD));
            // the load's share of the face in the first periods, then one way alone
            let to_end = |joints: &Vector3<f64>| if outside_box == OutsideBox::Hold { 0.0 } else { joints.norm() };
            assert!(period < 20 || to_end(&now.joints) <= to_end(&last), "{period}: {now:?} after {last:?}");
            assert!(period < 20 || now.fault == Some(Fault::OutsideBox), "{now:?}");
            assert!(period < 20 || outside_box == OutsideBox::Fade || now.joints == last, "{now:?} after {last:?}");
            last = now.joints;
        }
        // still out just inside of the face, back beyond a hundredth of 30 mm
        assert_eq!(
            update(&mut compensator, &Pose { z0_m: face_m - 0.2e-3, ..POSE }, &on(LOAD)).fault,
            Some(Fault::OutsideBox)
        );
        assert_eq!(update(&mut compensator, &Pose { z0_m: face_m - 0.4e-3, ..POSE }, &on(LOAD)).fault, None);
        // what is switched off begins anew
        update(&mut compensator, &Pose { z0_m: face_m + 1e-3, ..POSE }, &on(LOAD));
        update(&mut compensator, &POSE, &Reading { enabled: false, ..on(LOAD) });
        assert_eq!(update(&mut compensator, &Pose { z0_m: face_m - 0.2e-3, ..POSE }, &on(LOAD)).fault, None);
    }
}

/// A machine that stands on the margin of its singularity locus, under the noise of its encoders, is not shaken either: where the model had no answer
/// the offset comes back when it has had one for 0.1 s.
#[test]
fn a_machine_on_a_margin_is_not_shaken() {
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let settings = CompensatorSettings { stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let new = || Compensator::<f64, 5>::new(&settings).unwrap();
    let update = |compensator: &mut Compensator<f64, 5>, beta2_rad: f64| {
        let configuration = Configuration { pose: POSE, beta_rad: Vector2::new(0.0, beta2_rad) };
        compensator.update(&MODEL, five.wrist, &configuration, &on(LOAD))
    };
    let (mut limit_rad, mut beyond_rad) = (0.0, 1.5);
    while beyond_rad - limit_rad > 1e-9 {
        let middle = 0.5 * (limit_rad + beyond_rad);
        *if update(&mut new(), middle).fault.is_none() { &mut limit_rad } else { &mut beyond_rad } = middle;
    }
    let mut compensator = new();
    let mut at = |beta2_rad: f64| update(&mut compensator, beta2_rad);
    let mut rng = seeded();
    let mut last = (0..999).map(|_| at(limit_rad - 0.01)).last().unwrap().joints;
    assert!(last.norm() > 1e-6);
    for period in 0..2000 {
        let now = at(limit_rad + between(&mut rng, -1e-6, 1e-6));
        // the load's share of the limit in the first periods, then one way alone
        assert!(period < 20 || now.joints.norm() <= last.norm(), "{period}: {now:?} after {last:?}");
        assert!(period < 20 || matches!(now.fault, Some(Fault::Tool(_))), "{now:?}");
        last = now.joints;
    }
    assert_eq!(last.norm(), 0.0);
    let faults: Vec<_> = (0..100).map(|_| at(limit_rad - 1e-3).fault).collect();
    assert!(faults[..99].iter().all(|fault| matches!(fault, Some(Fault::Tool(_)))));
    assert_eq!(faults[99], None);
}

/// 1e6 periods of three screws and of five axes beside them, in f64 and in f32 alike, with every fault at random times.
#[test]
fn no_fault_makes_it_leap() {
    let settings = CompensatorSettings { stuck_s: 0.05, ..CompensatorSettings::DEFAULT };
    let double = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let single = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
    faulty_periods(&settings, &TABLE_F64, &double, cases(1_000_000));
    faulty_periods(&settings, &TABLE_F32, &single, cases(1_000_000));
}

/// No number beyond its largest, and none further from the last than the rate limit, but for rounding.
fn keeps_limits<const N: usize>(settings: &CompensatorSettings, last: &SVector<f64, N>, now: &SVector<f64, N>) {
    for i in 0..N {
        let of = |screw: f64, wrist: f64| if i < 3 { screw } else { wrist };
        let most = of(settings.max_screw_m, settings.max_wrist_rad);
        let rate = of(settings.screw_rate_m_per_s, settings.wrist_rate_rad_per_s);
        assert!(now[i].is_finite() && now[i].abs() <= most * (1.0 + 1e-6), "{now:?}");
        let step = rate * settings.period_s * (1.0 + 1e-5) + 1e-10;
        assert!((now[i] - last[i]).abs() <= step, "{now:?} after {last:?}");
    }
}

fn faulty_periods<T: Scalar>(
    settings: &CompensatorSettings,
    table: &CorrectionTable<'_, T>,
    five: &FiveAxis<'_, T>,
    periods: usize,
) {
    let mut rng = seeded();
    let mut compensator = Compensator::<T, 3>::new(settings).unwrap();
    let mut of_five = Compensator::<T, 5>::new(settings).unwrap();
    let number = |v: f64| T::from_f64(v);
    let (mut fault, mut left) = (0, 0);
    let (mut last, mut last_of_five) = (SVector::<f64, 3>::zeros(), SVector::<f64, 5>::zeros());
    let mut faults = std::collections::HashSet::new();
    let (mut read, mut ever) = ([0.0; 6], [0.0_f64; 2]);
    for period in 0..periods {
        if left == 0 {
            (fault, left) = (rng.usize(0..10), rng.usize(1..400));
        }
        left -= 1;
        let t = 1e-3 * period as f64;
        let mut pose = [0.24 * (0.31 * t).sin(), 0.24 * (0.17 * t).sin(), 0.53 + 0.028 * (0.23 * t).sin()];
        let mut wrench = [100.0, -50.0, -400.0, 2.0, -8.0, 5.0].map(|w| w * (1.0 + 0.5 * t.sin()));
        wrench.iter_mut().for_each(|w| *w += between(&mut rng, -2.0, 2.0));
        let (mut enabled, mut rise) = (true, TemperatureRise::from(number((0.01 * t).sin())));
        match fault {
            1 => wrench = read,
            2 => wrench[period % 6] = f64::NAN,
            3 => wrench = wrench.map(|w| w * if period % 7 == 0 { 1e3 } else { 1.0 }),
            4 => wrench = wrench.map(|w| -w),
            5 => wrench = wrench.map(|w| 8.0 * w),
            6 => pose[0] *= 2.0,
            7 if period % 2 == 0 => continue,
            8 => rise.limbs_k[period % 3] = number(f64::INFINITY),
            9 => enabled = false,
            _ => {}
        }
        read = wrench;
        let pose = Pose { theta_rad: number(pose[0]), sigma_rad: number(pose[1]), z0_m: number(pose[2]) };
        let reading = Reading { enabled, wrench: Wrench::from_vector(wrench.map(number).into()), rise };
        let offset = compensator.update(&Model::new(five.machine, table), &pose, TIP_M.map(number), &reading);
        faults.insert(offset.fault.map(|f| f.to_string()));
        let now = offset.joints.map(T::to_f64);
        keeps_limits(settings, &last, &now);
        last = now;
        ever[0] = ever[0].max(now.amax());
        let stands = Configuration { pose, beta_rad: Vector2::new(number(0.9 * (0.13 * t).sin()), number(-0.2)) };
        let now = of_five.update(&Model::new(five.machine, table), five.wrist, &stands, &reading).joints.map(T::to_f64);
        keeps_limits(settings, &last_of_five, &now);
        last_of_five = now;
        ever[1] = ever[1].max(now.fixed_rows::<2>(3).amax());
    }
    assert!(ever[0] > 50e-6 && ever[1] > 20e-6, "{ever:?}");
    // none; three of the wrench; temperature; box
    assert!(periods < 1000 || faults.len() == 6, "{faults:?}");
}

/// Each with the reaction of `docs/stability.md`; `cargo xtask qemu` does the same on a Cortex-M.
#[test]
fn every_fault_has_its_reaction() {
    let outcomes: Vec<_> = pkm_faults::outcomes().collect();
    assert_eq!(outcomes.len(), 22);
    for outcome in &outcomes {
        assert!(outcome.result.is_ok(), "{outcome}");
    }
}

/// All limits and a finite output on machines of any proportions, whatever the pose and the reading.
#[test]
fn random_machines_are_kept_within_the_limits() {
    let terms = [[0, 0, 0]];
    let basis = pkm_core::Basis::<f64>::new([0.0, 0.0, 1.0], [1.5, 1.5, 1.0], &terms).unwrap();
    let (diagonal, mut factor) = ([1.0; 6], [0.0; 21]);
    for row in [0, 2, 5, 9, 14, 20] {
        factor[row] = 1.0;
    }
    let table = CorrectionTable::<f64>::new(basis, &diagonal, Some(&factor)).unwrap();
    let mut rng = seeded();
    for _ in 0..cases(500) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let settings = CompensatorSettings {
            outside_box: [OutsideBox::Hold, OutsideBox::Fade, OutsideBox::Extrapolate][rng.usize(0..3)],
            ..CompensatorSettings::DEFAULT
        };
        let mut compensator = compensator(&settings);
        let mut last = [0.0; 3];
        for _ in 0..200 {
            let mut pose = random_pose(&mut rng, &machine, size, 0.0);
            let any = [0.0, 1.0, -1e3, 1e300, f64::NAN, f64::NEG_INFINITY, 5e-324];
            let mut wrench = [0; 6].map(|_| between(&mut rng, -3e3, 3e3));
            if rng.u8(..) < 16 {
                wrench[rng.usize(0..6)] = any[rng.usize(0..7)];
            }
            if rng.u8(..) < 16 {
                pose.sigma_rad = any[rng.usize(0..7)];
            }
            let tip = Vector3::from_fn(|_, _| size * between(&mut rng, -1.0, 1.0));
            let reading = Reading { enabled: rng.u8(..) > 8, ..on(Wrench::from_vector(wrench.into())) };
            let now = compensator.update(&Model::new(&machine, &table), &pose, tip, &reading).joints;
            for i in 0..3 {
                assert!(now[i].abs() <= settings.max_screw_m * (1.0 + 1e-12), "{now:?}");
                assert!((now[i] - last[i]).abs() <= 5e-6 * (1.0 + 1e-9), "{now:?} after {last:?}");
            }
            last = now.into();
        }
    }
}

#[test]
fn five_axes_are_compensated_by_one_step() {
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(2000) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let pose = Pose { theta_rad: within(0.24), sigma_rad: within(0.24), z0_m: 0.53 + within(0.028) };
        let stands = Configuration { pose, beta_rad: Vector2::new(within(1.2), -0.3 + within(0.3)) };
        let wrench =
            Wrench { force_n: Vector3::from_fn(|_, _| within(50.0)), moment_nm: Vector3::from_fn(|_, _| within(5.0)) };
        let (Ok(tool), Ok(from)) = (five.tool(&stands), five.joints(&stands)) else { continue };
        let Ok(whole) = five.compensated(Some(&TABLE_F64), &tool, &wrench, &stands) else { continue };
        let mut compensator = Compensator::<f64, 5>::new(&BARE).unwrap();
        let offset = compensator.update(&MODEL, five.wrist, &stands, &on(wrench));
        assert_eq!((offset.fault, offset.limit), (None, Limit::None));
        let [q1, q2, q3] = (whole.solution.joints.lengths.q_m - from.lengths.q_m).into();
        let [b1, b2] = (whole.solution.joints.beta_rad - from.beta_rad).into();
        let expected = SVector::from([q1, q2, q3, b1, b2]);
        worst = worst.max((expected - offset.joints).amax() / expected.amax());
    }
    println!("five axes: {worst:.1e} of the offset from the iterated compensation");
    assert!(worst > 0.0 && worst < 2e-3, "{worst:e}");
}

#[test]
fn five_axes_refuse_with_a_code_and_fade() {
    let five = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
    let stands = Configuration { pose: POSE, beta_rad: Vector2::new(0.3, -0.2) };
    let mut compensator = Compensator::<f64, 5>::new(&BARE).unwrap();
    assert!(compensator.update(&MODEL, five.wrist, &stands, &on(LOAD)).joints.iter().all(|o| *o != 0.0));
    let turned = Configuration { beta_rad: Vector2::new(2.0, -0.2), ..stands };
    let refused = compensator.update(&MODEL, five.wrist, &turned, &on(LOAD));
    assert_eq!(refused.fault, Some(Fault::Tool(ToolError::WristLimit { joint: 1 })));
    assert_eq!(refused.joints, SVector::<f64, 5>::zeros());
}

//! Every layer once in both arithmetics, with what it gives and what it refuses: few and quick, so that Miri can run them
//! (`cargo xtask miri`). Accuracy over many machines is the business of the crate `tests`.

use pkm_core::correction::{FACTOR_ENTRIES, TableError, narrow};
use pkm_core::effects::{EFFECTS, Effects};
use pkm_core::machine::{MachineError, Parameter, Problem};
use pkm_core::nalgebra::{Matrix3, Matrix6, Vector2, Vector3, Vector6};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST};
use pkm_core::{
    Basis, CompensationError, Configuration, CorrectionError, CorrectionTable, CycleError, Domain, FiveAxis,
    JointValues, KinematicsError, Machine, MachineParameters, Pose, Scalar, ScrewLengths, Stiffness, StiffnessError,
    TemperatureError, Tool, ToolDeflectionError, ToolError, Wrench, Wrist, WristError, WristParameters, checksum,
};

fn pose<T: Scalar>(theta_rad: f64, sigma_rad: f64, z0_m: f64) -> Pose<T> {
    let [theta_rad, sigma_rad, z0_m] = [theta_rad, sigma_rad, z0_m].map(T::from_f64);
    Pose { theta_rad, sigma_rad, z0_m }
}

fn vector<T: Scalar>(components: [f64; 3]) -> Vector3<T> {
    components.map(T::from_f64).into()
}

fn wrench<T: Scalar>(force_n: [f64; 3], moment_nm: [f64; 3]) -> Wrench<T> {
    Wrench { force_n: vector(force_n), moment_nm: vector(moment_nm) }
}

/// Within so many roundings of a number's size.
#[track_caller]
fn assert_near<T: Scalar>(found: T, expected: f64, size: f64, roundings: f64) {
    let off = (found.to_f64() - expected).abs();
    assert!(off <= roundings * T::EPSILON.to_f64() * size, "{found:?} is not {expected}");
}

fn kinematics<T: Scalar>(machine: &Machine<T>) {
    // upright, limbs 1 and 2 are hypotenuses over b1 − a1, limb 3 one over b2 − a2
    let upright = machine.inverse(&pose(0.0, 0.0, 0.53)).unwrap();
    let g = PARAMETERS.geometry;
    for (q, base) in upright.q_m.iter().zip([g.b1_m - g.a1_m, g.b1_m - g.a1_m, g.b2_m - g.a2_m]) {
        assert_near(*q, 0.53f64.hypot(base), 1.0, 4.0);
    }
    let there = pose::<T>(0.1, -0.05, 0.53);
    let lengths = machine.inverse(&there).unwrap();
    let back = machine.forward(&lengths).unwrap();
    assert_near(back.theta_rad, 0.1, 1.0, 100.0);
    assert_near(back.sigma_rad, -0.05, 1.0, 100.0);
    assert_near(back.z0_m, 0.53, 1.0, 100.0);
    // straight up, every length grows by its share along z
    let jacobian = machine.jacobian(&pose(0.0, 0.0, 0.53)).unwrap();
    for (dq_dz0, q) in jacobian.column(2).iter().zip(&upright.q_m) {
        assert_near(*dq_dz0, 0.53 / q.to_f64(), 1.0, 10.0);
    }
    let distance = machine.singularity_distance(&pose(0.0, 0.0, 0.53)).unwrap();
    let l2 = 0.53f64 * 0.53;
    assert_near(distance.limbs_1_2, l2 / (l2 + g.a1_m * g.b1_m), 1.0, 10.0);
    assert_near(distance.limb_3, 0.53 / 0.53f64.hypot(g.a2_m), 1.0, 10.0);
    assert!(machine.travel_margin_m(&upright).is_ok_and(|(margin_m, _)| margin_m > T::ZERO));

    assert_eq!(machine.inverse(&pose(f64::NAN, 0.0, 0.53)), Err(KinematicsError::NotFinite));
    assert_eq!(machine.inverse(&pose(2.0, 0.0, 0.53)), Err(KinematicsError::Unreachable));
    assert_eq!(machine.inverse(&pose(0.0, 0.0, -0.53)), Err(KinematicsError::Unreachable));
    // B, A and A3 in one line: limb 3 cannot hold θ
    let in_line = pose(1.0, 0.0, PARAMETERS.geometry.a2_m * 1f64.sin());
    assert_eq!(machine.inverse(&in_line), Err(KinematicsError::Singular));
    assert!(matches!(machine.inverse(&pose(0.0, 0.0, 0.9)), Err(KinematicsError::OutOfTravel { limb: 1..=3 })));
    let lengths = |q: [f64; 3]| ScrewLengths { q_m: vector(q) };
    assert_eq!(machine.forward(&lengths([f64::INFINITY, 0.5, 0.5])), Err(KinematicsError::NotFinite));
    assert_eq!(machine.forward(&lengths([0.5, 0.5, 0.9])), Err(KinematicsError::OutOfTravel { limb: 3 }));
    assert_eq!(machine.forward(&lengths([0.42, 0.77, 0.5])), Err(KinematicsError::Unreachable));
}

fn stiffness<T: Scalar>(machine: &Machine<T>) {
    let there = pose::<T>(0.1, -0.05, 0.53);
    let k = machine.stiffness(&there).unwrap();
    let (full, factor) = (k.matrix(), k.factor().unwrap());
    // the lower triangle is all that is read
    let mut lower = full;
    lower.fill_upper_triangle(T::from_f64(f64::NAN), 1);
    assert_eq!(Stiffness::from_lower(&lower).matrix(), full);
    for i in 0..6 {
        assert_eq!(k.principal()[i], full[(i, i)]);
        for j in 0..6 {
            let size = (full[(i, i)].to_f64() * full[(j, j)].to_f64()).sqrt();
            assert_near(factor.stiffness().matrix()[(i, j)], full[(i, j)].to_f64(), size, 20.0);
        }
    }
    // K d = f
    let load = wrench::<T>([120.0, 0.0, -400.0], [0.0, 0.0, 5.0]);
    let d = factor.deflection(&load).unwrap();
    let moved = d.to_vector();
    for (found, force) in (full * moved).iter().zip([120.0, 0.0, -400.0, 0.0, 0.0, 5.0]) {
        assert_near(*found, force, 400.0, 2e3);
    }
    assert_eq!(factor.lower()[(0, 5)], T::ZERO);
    let nowhere = wrench([f64::NAN, 0.0, 0.0], [0.0; 3]);
    assert_eq!(factor.deflection(&nowhere), Err(StiffnessError::NotFinite));
    assert_eq!(Stiffness::from_lower(&Matrix6::<T>::zeros()).factor(), Err(StiffnessError::NotPositiveDefinite));
    assert!(matches!(machine.stiffness(&pose(2.0, 0.0, 0.5)), Err(StiffnessError::Kinematics(_))));
    // a force through a point, and a point that a turn moves
    let at = vector([0.0, 0.0, 0.3]);
    assert_near(load.moved_to_a(at).moment_nm.y, 0.3 * 120.0, 36.0, 2.0);
    assert_near(d.seen_at(at).translation_m.y, (d.translation_m.y - d.rotation_rad.x * at.z).to_f64(), 1e-3, 2.0);
    assert_eq!(d.plus(&d).rotation_rad, d.rotation_rad + d.rotation_rad);
}

/// One effect at a time: a sound stiffness, and springs in series make nothing stiffer.
fn effects<T: Scalar>(build: impl Fn(&MachineParameters) -> Result<Machine<T>, MachineError>) {
    let there = pose::<T>(0.1, -0.05, 0.53);
    let load = wrench::<T>([120.0, 0.0, -400.0], [0.0, 0.0, 5.0]);
    let none = wrench::<T>([0.0; 3], [0.0; 3]);
    let basic = build(&PARAMETERS).unwrap();
    let plain = basic.stiffness(&there).unwrap().principal();
    for effect in EFFECTS {
        let mut parameters = [0.0; 6];
        for (value, name) in parameters.iter_mut().zip(effect.names()) {
            *value = match name {
                name if name.ends_with("per_nm2") => 1e-7,
                name if name.ends_with("per_n") || name.ends_with("per_nm") => 1e-9,
                name if name.ends_with("per_k") => 1e-5,
                name if name.ends_with("_n") => 100.0,
                name if name.ends_with("tube_m") || name.ends_with("ram_m") => 0.35,
                _ => 1e-6,
            };
        }
        let effects = Effects::NONE.with(effect.id, parameters).unwrap();
        let machine = build(&MachineParameters { effects, ..PARAMETERS }).unwrap();
        let k = machine.stiffness(&there).unwrap_or_else(|e| panic!("{}: {e}", effect.id));
        assert!(k.factor().is_ok(), "{}", effect.id);
        // tension stiffens, and so does a ram inside its tube
        if !effect.signed && effect.id != "telescopic-limb" {
            for (k, plain) in k.principal().iter().zip(&plain) {
                assert!(k.to_f64() <= plain.to_f64() * (1.0 + 50.0 * T::EPSILON.to_f64()), "{}", effect.id);
            }
        }
        assert!(machine.load_dependent_deflection(&there, &load, &none).is_ok(), "{}", effect.id);
        let response = machine.load_response(&there).unwrap();
        assert_eq!(response.deflection(&wrench([f64::NAN; 3], [0.0; 3]), &none), Err(StiffnessError::NotFinite));
        assert!(machine.thermal_deflection(&there, T::from_f64(10.0)).is_ok());
        assert!(machine.at_temperature(T::from_f64(35.0)).is_ok());
    }
    assert_eq!(Effects::NONE.with("magic", [1.0]), None);
    assert_eq!(Effects::NONE.with("preload", [1.0; 3]), None);
    assert_eq!(Effects::NONE.with("wrist-compliance", [1e-9; 2]).unwrap().below_tool(), Effects::NONE);
    // springs in series: the wrist's compliance adds to the mechanism's
    let effects = Effects::NONE.with("wrist-compliance", [1e-8, 0.0]).unwrap();
    let soft = build(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let push = wrench::<T>([0.0, 0.0, 100.0], [0.0; 3]);
    let along = |machine: &Machine<T>| {
        machine.stiffness(&there).unwrap().factor().unwrap().deflection(&push).unwrap().translation_m.z.to_f64()
    };
    assert_near(T::from_f64(along(&soft) - along(&basic)), 100.0 * 1e-8, 1e-6, 1e3);

    // warm: growth of everything alike moves A by its share of its height, and what is left of a modulus is its share
    let effects = Effects::NONE.with("thermal-expansion", [1e-5, 1e-5]).unwrap();
    let steel = build(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let grown = steel.thermal_deflection(&pose(0.0, 0.0, 0.53), T::from_f64(10.0)).unwrap();
    assert_near(grown.translation_m.z, 1e-4 * 0.53, 1e-4, 100.0);
    assert_eq!(steel.thermal_deflection(&there, T::from_f64(f64::NAN)), Err(StiffnessError::NotFinite));
    let effects = Effects::NONE.with("thermal-modulus", [1e-3, 1e-3]).unwrap();
    let warm = build(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let k = warm.at_temperature(T::from_f64(120.0)).unwrap().stiffness(&there).unwrap().principal();
    for (k, plain) in k.iter().zip(&plain) {
        assert_near(*k, 0.9 * plain.to_f64(), plain.to_f64(), 20.0);
    }
    assert_eq!(warm.at_temperature(T::from_f64(1e4)), Err(TemperatureError::NoStiffness));
    assert_eq!(warm.at_temperature(T::from_f64(f64::INFINITY)), Err(TemperatureError::NotFinite));
}

fn correction<T: Scalar>(machine: &Machine<T>, fitted: &CorrectionTable<'_, T>, doubling: &CorrectionTable<'_, T>) {
    let there = pose::<T>(0.1, -0.05, 0.53);
    let plain = machine.stiffness(&there).unwrap().matrix();
    // G = 2 and C = 4 everywhere: four times the stiffness
    for corrected in [doubling.factor_form(machine, &there), doubling.diagonal_form(machine, &there)] {
        let k = corrected.unwrap().factor.stiffness().matrix();
        for i in 0..6 {
            for j in 0..6 {
                let size = (plain[(i, i)].to_f64() * plain[(j, j)].to_f64()).sqrt();
                assert_near(k[(i, j)], 4.0 * plain[(i, j)].to_f64(), size, 100.0);
            }
        }
    }
    assert_eq!(doubling.coefficients(&there), Vector6::repeat(T::from_f64(4.0)));
    assert!(doubling.has_factor_form());
    assert_eq!(fitted.domain(&there), Domain::Inside);
    assert_eq!(fitted.domain(&pose(0.5, 0.0, 0.53)), Domain::Outside);
    assert_eq!(fitted.domain(&pose(f64::NAN, 0.0, 0.53)), Domain::Outside);
    assert!(matches!(fitted.factor_form(machine, &pose(0.0, 0.0, 9.0)), Err(CorrectionError::Stiffness(_))));

    // a tip pushed back is commanded further out, by the deflection that it meets
    let (push, tip) = (wrench::<T>([0.0, 0.0, -400.0], [0.0; 3]), vector([0.0, 0.0, 0.3]));
    let cycle = fitted.cycle(machine, &there, &push, tip).unwrap();
    assert_eq!(cycle.lengths, machine.inverse(&there).unwrap());
    let pose_to = cycle.compensated.pose;
    assert!(pose_to.z0_m > there.z0_m);
    assert_eq!(machine.compensated(&there, &cycle.deflection, tip), Ok(cycle.compensated));
    let nowhere = wrench([f64::INFINITY, 0.0, 0.0], [0.0; 3]);
    assert!(matches!(fitted.cycle(machine, &there, &nowhere, tip), Err(CycleError::Correction(_))));
    assert_eq!(machine.compensated(&there, &cycle.deflection, Vector3::zeros()), Err(CompensationError::Singular));
    assert_eq!(
        machine.compensated(&there, &cycle.deflection, vector([f64::NAN; 3])),
        Err(CompensationError::NotFinite)
    );
}

fn five_axes<T: Scalar>(five: &FiveAxis<'_, T>, table: &CorrectionTable<'_, T>) {
    let home = Configuration { pose: pose::<T>(0.0, 0.0, 0.53), beta_rad: Vector2::zeros() };
    // at home the tip stands where the wrist's sizes put it
    let tool = five.tool(&home).unwrap();
    let expected = WRIST.tip_at_zero_m() + Vector3::z() * 0.53;
    for (found, expected) in tool.tip_m.iter().zip(&expected) {
        assert_near(*found, *expected, 1.0, 4.0);
    }
    assert_near(five.normalised_determinant(&home).unwrap(), 1.0, 1.0, 10.0);
    let there = Configuration { pose: pose::<T>(0.05, -0.03, 0.54), beta_rad: [0.2, -0.1].map(T::from_f64).into() };
    let frame = five.frame(&there).unwrap();
    let aim = Tool { tip_m: frame.tip_m, axis: frame.axes.column(2).into() };
    let joints = five.joints(&there).unwrap();
    assert!(five.forward(&joints).is_ok());
    for solution in [
        five.inverse(&aim, &home),
        five.search(&aim, &home),
        five.inverse_frame(&frame),
        five.inverse_at(frame.tip_m, there.beta_rad),
    ] {
        let found = solution.unwrap();
        for (q, expected) in found.joints.lengths.q_m.iter().zip(&joints.lengths.q_m) {
            assert_near(*q, expected.to_f64(), 1.0, 200.0);
        }
    }
    let k = five.machine.stiffness(&there.pose).unwrap();
    assert!(five.tip_stiffness(&k, &there).unwrap().factor().is_ok());
    let load = wrench::<T>([120.0, 0.0, -400.0], [0.0, 0.0, 5.0]);
    for table in [None, Some(table)] {
        let compensated = five.compensated(table, &aim, &load, &home).unwrap();
        let deflection = five.deflection(table, &compensated.solution.configuration, &load).unwrap();
        assert_eq!(deflection, compensated.deflection);
        let held = five.tool(&compensated.solution.configuration).unwrap();
        let loaded = held.tip_m + deflection.translation_m;
        for (loaded, aim) in loaded.iter().zip(&aim.tip_m) {
            assert_near(*loaded, aim.to_f64(), 1.0, 1e3f64.max(2e-8 / T::EPSILON.to_f64()));
        }
    }

    let nan = T::from_f64(f64::NAN);
    let bad = Configuration { beta_rad: Vector2::repeat(nan), ..home };
    assert_eq!(five.frame(&bad), Err(ToolError::NotFinite));
    assert_eq!(five.joints(&bad), Err(ToolError::NotFinite));
    let turned = Configuration { beta_rad: Vector2::new(T::ZERO, T::from_f64(3.0)), ..home };
    assert_eq!(five.tool(&turned), Err(ToolError::WristLimit { joint: 2 }));
    assert_eq!(five.inverse(&Tool { axis: Vector3::zeros(), ..aim }, &home), Err(ToolError::NotFinite));
    assert_eq!(five.inverse_at(Vector3::repeat(nan), there.beta_rad), Err(ToolError::NotFinite));
    let far = Vector3::repeat(T::from_f64(9.0));
    assert!(matches!(
        five.search(&Tool { tip_m: far, ..aim }, &home),
        Err(ToolError::Unreachable | ToolError::Singular)
    ));
    let x = frame.axes.column(0);
    let skew = pkm_core::ToolFrame { axes: Matrix3::from_columns(&[x, x, x]), ..frame };
    assert_eq!(five.inverse_frame(&skew), Err(ToolError::Inconsistent));
    let out = JointValues { lengths: ScrewLengths { q_m: far }, beta_rad: Vector2::zeros() };
    assert!(matches!(five.forward(&out), Err(ToolError::Kinematics(_))));
    let nowhere = wrench([f64::NAN; 3], [0.0; 3]);
    assert!(matches!(five.compensated(None, &aim, &nowhere, &home), Err(ToolDeflectionError::Stiffness(_))));
}

/// A table beyond the range of its number type: too stiff, too soft, and no number at all.
macro_rules! beyond_range {
    ($test:ident, $t:ty, $machine:ident) => {
        #[test]
        fn $test() {
            let there = pose::<$t>(0.1, -0.05, 0.53);
            let refused = Err(CorrectionError::Stiffness(StiffnessError::NotPositiveDefinite));
            for size in [<$t>::MAX / 4.0, <$t>::from_bits(1)] {
                let (mut factor, diagonal) = ([0.0; FACTOR_ENTRIES], [size; 6]);
                for i in 0..6 {
                    factor[i * (i + 3) / 2] = size;
                }
                let basis = Basis::<$t>::new([0.0, 0.0, 0.53], [0.3, 0.3, 0.1], &[[0; 3]]).unwrap();
                let table = CorrectionTable::<$t>::new(basis, &diagonal, Some(&factor)).unwrap();
                assert_eq!(table.factor_form(&$machine, &there), refused);
                if size > 1.0 {
                    assert_eq!(table.diagonal_form(&$machine, &there), refused);
                }
            }
            // infinite times a coefficient of 0
            let (mut factor, diagonal) = ([0.0; 2 * FACTOR_ENTRIES], [1.0; 12]);
            for i in 0..6 {
                factor[i * (i + 3)] = 1.0;
            }
            let basis = Basis::<$t>::new([0.0, 0.0, 0.53], [<$t>::MIN_POSITIVE; 3], &[[0; 3], [6, 6, 0]]).unwrap();
            let table = CorrectionTable::<$t>::new(basis, &diagonal, Some(&factor)).unwrap();
            assert!(table.factor_form(&$machine, &there).is_err());
        }
    };
}

#[test]
fn levers_beyond_f32() {
    // with A1 and A2 in A nothing holds the platform about u
    let mut p = PARAMETERS;
    p.geometry.a1_m = 1e-29;
    let machine = Machine::<f32>::new(&p).unwrap();
    assert_eq!(machine.stiffness(&pose(0.1, 0.0, 0.53)), Err(StiffnessError::NotPositiveDefinite));
}

beyond_range!(tables_beyond_f64, f64, MACHINE_F64);
beyond_range!(tables_beyond_f32, f32, MACHINE_F32);

macro_rules! layers {
    ($test:ident, $t:ty, $machine:ident, $table:ident) => {
        #[test]
        fn $test() {
            kinematics(&$machine);
            stiffness(&$machine);
            effects(Machine::<$t>::new);
            let (diagonal, mut factor) = ([4.0 as $t; 6], [0.0; FACTOR_ENTRIES]);
            for i in 0..6 {
                factor[i * (i + 3) / 2] = 2.0;
            }
            let basis = Basis::<$t>::new([0.0, 0.0, 0.53], [0.3, 0.3, 0.1], &[[0; 3]]).unwrap();
            let table = CorrectionTable::<$t>::new(basis, &diagonal, Some(&factor)).unwrap();
            assert_eq!(basis.monomials(&pose(0.1, 0.0, 0.5))[..2], [1.0, 0.0]);
            assert_eq!(basis.domain(&pose(0.1, 0.0, 0.5)), Domain::Inside);
            correction(&$machine, &$table, &table);

            let bad = |e| Err::<(), _>(e);
            let new = |half_width, terms: &'static [[u8; 3]]| Basis::<$t>::new([0.0; 3], half_width, terms).map(drop);
            assert_eq!(new([1.0; 3], &[]), bad(TableError::TermCount));
            assert_eq!(new([1.0; 3], &[[7, 0, 0]]), bad(TableError::Exponent));
            assert_eq!(new([0.0; 3], &[[0; 3]]), bad(TableError::EmptyBox));
            assert_eq!(new([<$t>::NAN; 3], &[[0; 3]]), bad(TableError::NotFinite));
            let table = |diagonal: &[$t]| CorrectionTable::<$t>::new(basis, diagonal, None).map(drop);
            assert_eq!(table(&[1.0; 5]), bad(TableError::CoefficientCount));
            assert_eq!(table(&[<$t>::INFINITY; 6]), bad(TableError::NotFinite));
            let negative = CorrectionTable::<$t>::new(basis, &[-1.0; 6], None).unwrap();
            let there = pose(0.1, -0.05, 0.53);
            assert_eq!(negative.factor_form(&$machine, &there), Err(CorrectionError::NoFactorForm));
            assert_eq!(negative.diagonal_form(&$machine, &there), Err(CorrectionError::NotPositive { row: 1 }));

            let wrist = Wrist::<$t>::new(&WRIST).unwrap();
            five_axes(&FiveAxis { machine: &$machine, wrist: &wrist }, &$table);
            let arm = wrist.arm_m(0.0, 1.0);
            assert_near(arm.x, WRIST.first_b_m + WRIST.second_b_m, 1.0, 2.0);
            assert_near(arm.y, WRIST.first_d_m + WRIST.flange_m, 1.0, 2.0);
            let flat = WristParameters { first_b_m: 0.15, ..WRIST };
            assert_eq!(Wrist::<$t>::new(&flat), Err(WristError::HomeIsSingular));
            let turned = WristParameters { min_rad: [1.0, -4.0], ..WRIST };
            assert_eq!(Wrist::<$t>::new(&turned), Err(WristError::Limits { joint: 2 }));
        }
    };
}

layers!(layers_f64, f64, MACHINE_F64, TABLE_F64);
layers!(layers_f32, f32, MACHINE_F32, TABLE_F32);

#[test]
fn parameters_are_checked_and_summed_up() {
    let refused = |p: &MachineParameters| Machine::<f64>::new(p).unwrap_err();
    let mut p = PARAMETERS;
    p.geometry.a1_m = f64::NAN;
    assert_eq!(refused(&p), MachineError { parameter: Parameter::A1, problem: Problem::NotFinite });
    p.geometry.a1_m = -0.1;
    assert_eq!(refused(&p), MachineError { parameter: Parameter::A1, problem: Problem::NotPositive });
    let mut p = PARAMETERS;
    p.travel.max_m[1] = p.travel.min_m[1];
    assert_eq!(refused(&p), MachineError { parameter: Parameter::TravelMax { limb: 2 }, problem: Problem::Reversed });
    let mut p = PARAMETERS;
    p.limbs[2].platform_joint.angular_nm_per_rad[1] = 1.0;
    assert_eq!(refused(&p).problem, Problem::NotReleased);
    let mut p = PARAMETERS;
    p.limbs[0].body.rod.inner_m = 1.0;
    assert_eq!(refused(&p).problem, Problem::Bore);
    for (value, problem) in [(f64::INFINITY, Problem::NotFinite), (-1e-9, Problem::Negative), (1.0, Problem::TooLarge)]
    {
        let effects = Effects::NONE.with("base-compliance", [value]).unwrap();
        assert_eq!(refused(&MachineParameters { effects, ..PARAMETERS }).problem, problem);
    }

    let effects = Effects::NONE.with("geometry-a1", [0.001]).unwrap();
    let off = MachineParameters { effects, ..PARAMETERS };
    assert_eq!(off.actual_geometry().a1_m, PARAMETERS.geometry.a1_m + 0.001);
    assert_ne!(off.checksum(), PARAMETERS.checksum());
    assert_ne!(WRIST.checksum(), WristParameters { flange_m: 0.2, ..WRIST }.checksum());
    assert_ne!(TABLE_F64.checksum(), 0);
    assert_eq!(narrow(&[0.1]), [0.1f32]);
    // FNV-1a of no bytes and of "a"
    assert_eq!(checksum::START, 0xcbf2_9ce4_8422_2325);
    assert_eq!(checksum::over_byte(checksum::START, b'a'), 0xaf63_dc4c_8601_ec8c);
}

#[test]
fn every_error_says_something() {
    let messages = [
        KinematicsError::NotFinite.to_string(),
        KinematicsError::OutOfTravel { limb: 2 }.to_string(),
        StiffnessError::NotConverged.to_string(),
        StiffnessError::from(KinematicsError::Singular).to_string(),
        CorrectionError::NotPositive { row: 3 }.to_string(),
        CorrectionError::from(KinematicsError::Unreachable).to_string(),
        TableError::EmptyBox.to_string(),
        CompensationError::Singular.to_string(),
        CycleError::Compensation(CompensationError::NotFinite).to_string(),
        TemperatureError::NoStiffness.to_string(),
        ToolError::WristLimit { joint: 1 }.to_string(),
        WristError::Limits { joint: 1 }.to_string(),
    ];
    for message in messages {
        assert!(message.len() > 10, "{message}");
    }
}

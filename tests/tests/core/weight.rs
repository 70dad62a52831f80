//! The weight that a machine carries, against rigid bodies in the field of gravity and the dense structural matrix.

use nalgebra::{
    Isometry3, Matrix3, Matrix6, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3, Vector6,
};
use pkm_core::compensator::{
    CarriedWeight, Compensator, CompensatorSettings, Fault, Limit, Offset, OutsideBox, Reading, Weight, WeightError,
};
use pkm_core::correction::FACTOR_ENTRIES;
use pkm_core::estimation::Estimator;
use pkm_core::machine::BodyKind;
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, UNCERTAINTY_F64, WRIST, WRIST_F32, WRIST_F64,
};
use pkm_core::{
    Basis, CompensationError, Configuration, CorrectionTable, Domain, FiveAxis, Machine, MachineParameters, Model,
    Pose, Scalar, ToolError, Wrench,
};
use pkm_tests::{
    between, cases, distance, keep_worst, random_parameters, random_pose, seeded, space, structural_stiffness,
};

use crate::compensator::{BARE as WHOLE, LOAD, MODEL, on};
use crate::estimation::drives;

const ON_PLAIN: Model<'static, f64> = Model::new(&MACHINE_F64, &PLAIN);
const FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
const TIP_M: Vector3<f64> = Vector3::new(0.01, -0.02, 0.3);
const HOME: Configuration<f64> =
    Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }, beta_rad: Vector2::new(0.0, 0.0) };
const PLACE: Configuration<f64> =
    Configuration { pose: Pose { theta_rad: 0.2, sigma_rad: -0.15, z0_m: 0.55 }, beta_rad: Vector2::new(0.4, -0.3) };
/// 80 kg of platform and spindle, 20 kg of tool, with g along neither axis of B.
const PLATFORM: Weight<f64> =
    Weight { force_n: Vector3::new(600.0, -150.0, -480.0), centre_m: Vector3::new(0.02, -0.01, 0.1) };
const TOOL: Weight<f64> =
    Weight { force_n: Vector3::new(150.0, -37.5, -120.0), centre_m: Vector3::new(0.12, 0.01, -0.2) };
/// A share of what the model says, at once.
const BARE: CompensatorSettings = CompensatorSettings { gain: 0.7, ..WHOLE };

/// Of the reference machine.
fn of_screws() -> CarriedWeight<f64, 3> {
    CarriedWeight::<f64, 3>::new(&MODEL, &PLATFORM, &HOME.pose, TIP_M).unwrap()
}

fn of_axes() -> CarriedWeight<f64, 5> {
    CarriedWeight::<f64, 5>::new(&MODEL, &WRIST_F64, &PLATFORM, &TOOL, &HOME).unwrap()
}

fn screws(settings: &CompensatorSettings) -> Compensator<f64, 3> {
    let mut compensator = Compensator::new(settings).unwrap();
    compensator.set_weight(Some(of_screws()));
    compensator
}

fn axes(settings: &CompensatorSettings) -> Compensator<f64, 5> {
    let mut compensator = Compensator::new(settings).unwrap();
    compensator.set_weight(Some(of_axes()));
    compensator
}

fn update(compensator: &mut Compensator<f64, 3>, pose: &Pose<f64>, reading: &Reading<f64>) -> Offset<f64, 3> {
    compensator.update(&MODEL, pose, TIP_M, reading)
}

fn settled(compensator: &mut Compensator<f64, 3>, pose: &Pose<f64>, reading: &Reading<f64>) -> Offset<f64, 3> {
    (0..999).for_each(|_| _ = update(compensator, pose, reading));
    update(compensator, pose, reading)
}

/// Nothing is carried wherever the machine was zeroed, and the load is compensated as without it: a share of what it does, not
/// what a share of it would do, which differ where a clearance is to be taken up.
#[test]
fn a_weight_of_no_force_is_none() {
    let nothing = Weight { force_n: Vector3::zeros(), ..PLATFORM };
    let outside = Pose { theta_rad: 1.0, ..HOME.pose };
    assert_eq!(TABLE_F64.domain(&outside), Domain::Outside);
    let loose = PARAMETERS.effects.with_element("limb.1.body", "axial", "load", [0.0, 0.0, 0.0, 0.0, 1e-5, 20.0]);
    let loose = MachineParameters { effects: loose.unwrap(), ..PARAMETERS };
    let machine = Machine::<f64>::new(&loose).unwrap();
    let of_screws = CarriedWeight::<f64, 3>::new(&Model::new(&machine, &TABLE_F64), &nothing, &outside, TIP_M).unwrap();
    let five = FiveAxis { machine: &machine, ..FIVE };
    let away = Configuration { pose: outside, ..HOME };
    let of_axes =
        CarriedWeight::<f64, 5>::new(&Model::new(five.machine, &TABLE_F64), five.wrist, &nothing, &Weight::ZERO, &away)
            .unwrap();
    let reading = Reading { enabled: true, wrench: LOAD, rise: 0.0.into() };
    let offsets = |screws, axes| {
        let mut of_screws = Compensator::<f64, 3>::new(&BARE).unwrap();
        of_screws.set_weight(screws);
        let mut of_axes = Compensator::<f64, 5>::new(&BARE).unwrap();
        of_axes.set_weight(axes);
        let screws = of_screws.update(&Model::new(&machine, &TABLE_F64), &PLACE.pose, TIP_M, &reading).joints;
        (screws, of_axes.update(&Model::new(&machine, &TABLE_F64), five.wrist, &PLACE, &reading).joints)
    };
    let without = offsets(None, None);
    assert!(without.0.amax() > 1e-6 && without.1.amax() > 1e-6);
    assert_eq!(offsets(Some(of_screws), Some(of_axes)), without);
}

/// The platform in B-xyz, by its definition.
fn platform_of(pose: &Pose<f64>) -> Isometry3<f64> {
    let turn = Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad);
    let at = Translation3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m);
    Isometry3::from_parts(at, UnitQuaternion::from_rotation_matrix(&turn))
}

/// The tool in B-xyz, by Table 1 of the paper.
fn tool_of(stands: &Configuration<f64>) -> Isometry3<f64> {
    let about = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let along = |x: f64, z: f64| Translation3::new(x, 0.0, z);
    let quarter = std::f64::consts::FRAC_PI_2;
    let [beta1, beta2] = stands.beta_rad.into();
    platform_of(&stands.pose)
        * along(WRIST.offset_m, 0.0)
        * about(Vector3::z_axis(), beta1)
        * along(WRIST.first_b_m, WRIST.first_d_m)
        * about(Vector3::x_axis(), quarter)
        * about(Vector3::z_axis(), beta2)
        * along(WRIST.second_b_m, 0.0)
        * about(Vector3::x_axis(), -quarter)
        * along(0.0, WRIST.flange_m)
}

/// How weights, each with the body that carries it, move the platform: velocity of A and turn in B-xyz, by K_p of the dense structural
/// matrix. All in B-xyz, where gravity stands still.
fn sag(
    parameters: &MachineParameters,
    pose: &Pose<f64>,
    weights: &[(Isometry3<f64>, Weight<f64>)],
) -> [Vector3<f64>; 2] {
    let platform = platform_of(pose);
    let a = platform.translation.vector;
    let mut at_a = [Vector3::zeros(); 2];
    for (body, weight) in weights {
        let centre = (body * nalgebra::Point3::from(weight.centre_m)).coords;
        at_a[0] += weight.force_n;
        at_a[1] += (centre - a).cross(&weight.force_n);
    }
    let turn = platform.rotation.to_rotation_matrix();
    let whole: Matrix6<f64> = structural_stiffness(parameters, pose);
    let mut load = Vector6::zeros();
    load.fixed_rows_mut::<3>(0).copy_from(&(turn.transpose() * at_a[0]));
    load.fixed_rows_mut::<3>(3).copy_from(&(turn.transpose() * at_a[1]));
    let moved = whole.try_inverse().unwrap() * load;
    [turn * moved.fixed_rows::<3>(0).into_owned(), turn * moved.fixed_rows::<3>(3).into_owned()]
}

/// Newton's way to the unknowns that `shown` shows as `asked`, by differences, at `from`.
fn solved<const N: usize, const M: usize>(
    from: SVector<f64, N>,
    asked: &SVector<f64, M>,
    shown: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
) -> SVector<f64, N> {
    let mut at = from;
    for _ in 0..8 {
        let columns: [SVector<f64, M>; N] = std::array::from_fn(|i| {
            let mut by = SVector::<f64, N>::zeros();
            by[i] = 1e-5;
            (shown(&(at + by)) - shown(&(at - by))) / 2e-5
        });
        let jacobian = SMatrix::<f64, M, N>::from_columns(&columns);
        let normal = jacobian.transpose() * jacobian;
        at += normal.try_inverse().unwrap() * jacobian.transpose() * (asked - shown(&at));
    }
    at
}

/// Lengths of the screws, in double-double before they are rounded.
fn lengths_of(parameters: &MachineParameters, pose: &Pose<f64>) -> Vector3<f64> {
    let at = space(&parameters.geometry, pose);
    Vector3::from_fn(|i, _| f64::from(distance(&at.platform[i], &at.base[i])))
}

fn pose_of(values: &[f64]) -> Pose<f64> {
    Pose { theta_rad: values[0], sigma_rad: values[1], z0_m: values[2] }
}

/// What has to be added to the screws for a tip that sags to stand where it would without the weight.
fn screws_against(
    parameters: &MachineParameters,
    pose: &Pose<f64>,
    tip_m: Vector3<f64>,
    weight: &Weight<f64>,
) -> Vector3<f64> {
    let platform = platform_of(pose);
    let [moved, turned] = sag(parameters, pose, &[(platform, *weight)]);
    let arm = platform.rotation * tip_m;
    let shown = |at: &Vector3<f64>| {
        let platform = platform_of(&pose_of(at.as_slice()));
        platform.translation.vector + platform.rotation * tip_m
    };
    let from = Vector3::new(pose.theta_rad, pose.sigma_rad, pose.z0_m);
    let asked = shown(&from) - moved - turned.cross(&arm);
    lengths_of(parameters, &pose_of(solved(from, &asked, shown).as_slice())) - lengths_of(parameters, pose)
}

/// The same of five axes, of the reference machine.
fn axes_against(stands: &Configuration<f64>, platform: &Weight<f64>, tool: &Weight<f64>) -> SVector<f64, 5> {
    let frame = tool_of(stands);
    let carrier = platform_of(&stands.pose);
    let [moved, turned] = sag(&PARAMETERS, &stands.pose, &[(carrier, *platform), (frame, *tool)]);
    let configuration =
        |at: &SVector<f64, 5>| Configuration { pose: pose_of(at.as_slice()), beta_rad: Vector2::new(at[3], at[4]) };
    let shown = |at: &SVector<f64, 5>| {
        let frame = tool_of(&configuration(at));
        let (tip, axis) = (frame.translation.vector, frame.rotation * Vector3::z());
        SVector::<f64, 6>::from([tip.x, tip.y, tip.z, axis.x, axis.y, axis.z])
    };
    let Pose { theta_rad, sigma_rad, z0_m } = stands.pose;
    let from = SVector::<f64, 5>::from([theta_rad, sigma_rad, z0_m, stands.beta_rad.x, stands.beta_rad.y]);
    let tip = moved + turned.cross(&(frame.translation.vector - carrier.translation.vector));
    let axis = turned.cross(&(frame.rotation * Vector3::z()));
    let asked = shown(&from) - SVector::<f64, 6>::from([tip.x, tip.y, tip.z, axis.x, axis.y, axis.z]);
    let to = solved(from, &asked, shown);
    let lengths = lengths_of(&PARAMETERS, &pose_of(to.as_slice())) - lengths_of(&PARAMETERS, &stands.pose);
    [lengths.x, lengths.y, lengths.z, to[3] - from[3], to[4] - from[4]].into()
}

/// A table that changes nothing, everywhere.
const DIAGONAL: [f64; 6] = [1.0; 6];
const FACTOR: [f64; FACTOR_ENTRIES] = {
    let mut factor = [0.0; FACTOR_ENTRIES];
    let (mut row, mut at) = (0, 0);
    while row < 6 {
        factor[at] = 1.0;
        row += 1;
        at += row + 1;
    }
    factor
};
const PLAIN: CorrectionTable<'static, f64> = {
    let Ok(basis) = Basis::<f64>::new([0.0, 0.0, 25.0], [2.0, 2.0, 25.0], &[[0, 0, 0]]) else { panic!("no basis") };
    match CorrectionTable::<f64>::new(basis, &DIAGONAL, Some(&FACTOR)) {
        Ok(table) => table,
        Err(_) => panic!("no table"),
    }
};

/// How far a is from b, as a share of the greatest of what b is the difference of.
fn share_apart<const N: usize>(a: &SVector<f64, N>, here: &SVector<f64, N>, there: &SVector<f64, N>) -> f64 {
    (a - (here - there)).norm() / here.norm().max(there.norm())
}

/// Machines of any proportions, poses all over their working mode.
#[test]
fn three_screws_are_what_statics_and_the_structural_matrix_say() {
    let mut rng = seeded();
    let mut worst = 0.0;
    for case in 0..cases(300) {
        let kind = [BodyKind::Diagonal, BodyKind::Beam][case % 2];
        let parameters = random_parameters(&mut rng, kind);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let mut pose = || random_pose(&mut rng, &machine, size, 0.2);
        let (pose, zero) = (pose(), pose());
        let mut within = |half: f64| between(&mut rng, -half, half);
        let arm = pose.z0_m.min(zero.z0_m) / 2.0;
        let tip_m = Vector3::new(within(0.2 * arm), within(0.2 * arm), arm);
        let direction = Vector3::from_fn(|_, _| within(1.0));
        let mut weight = Weight { force_n: direction, centre_m: Vector3::from_fn(|_, _| within(arm)) };
        // so light that the machine answers in proportion
        let unit = [&pose, &zero].map(|pose| screws_against(&parameters, pose, tip_m, &weight).amax());
        weight.force_n *= 1e-7 * size / unit[0].max(unit[1]);
        let carried = CarriedWeight::<f64, 3>::new(&Model::new(&machine, &PLAIN), &weight, &zero, tip_m).unwrap();
        let mut compensator = Compensator::<f64, 3>::new(&BARE).unwrap();
        compensator.set_weight(Some(carried));
        let found = compensator.update(&Model::new(&machine, &PLAIN), &pose, tip_m, &on(Wrench::ZERO));
        assert_eq!((found.fault, found.limit), (None, Limit::None), "{case}");
        let [here, there] = [&pose, &zero].map(|pose| screws_against(&parameters, pose, tip_m, &weight));
        keep_worst(&mut worst, share_apart(&found.joints, &here, &there));
    }
    println!("three screws: {worst:.1e} of what the weight does");
    assert!(worst < 1e-5);
}

/// The reference machine with its wrist, at any place outside of its margin. So light that it answers in proportion.
#[test]
fn five_axes_are_what_statics_and_the_structural_matrix_say() {
    let mut rng = seeded();
    let (mut worst, mut done) = (0.0, 0);
    while done < cases(300) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let mut stands = || Configuration {
            pose: Pose { theta_rad: within(0.26), sigma_rad: within(0.26), z0_m: 0.53 + within(0.03) },
            beta_rad: Vector2::new(within(1.2), within(0.6)),
        };
        let (stands, zero) = (stands(), stands());
        let mut weight = |size: f64| Weight {
            force_n: Vector3::from_fn(|_, _| within(size)),
            centre_m: Vector3::from_fn(|_, _| within(0.3)),
        };
        let (platform, tool) = (weight(0.08), weight(0.03));
        let refused = |e| matches!(e, WeightError::NoReference(Fault::Tool(ToolError::Singular)));
        let carried = match CarriedWeight::<f64, 5>::new(&ON_PLAIN, &WRIST_F64, &platform, &tool, &zero) {
            Ok(carried) => carried,
            Err(e) => {
                assert!(refused(e), "{e}");
                continue;
            }
        };
        let mut compensator = Compensator::<f64, 5>::new(&BARE).unwrap();
        compensator.set_weight(Some(carried));
        let found = compensator.update(&ON_PLAIN, &WRIST_F64, &stands, &on(Wrench::ZERO));
        if found.fault == Some(Fault::Tool(ToolError::Singular)) {
            continue;
        }
        assert_eq!((found.fault, found.limit), (None, Limit::None));
        let [here, there] = [&stands, &zero].map(|stands| axes_against(stands, &platform, &tool));
        keep_worst(&mut worst, share_apart(&found.joints, &here, &there));
        done += 1;
    }
    println!("five axes: {worst:.1e} of what the weight does");
    assert!(worst < 1e-4);
}

/// One Newton step takes a whole platform and a whole tool, too; what it leaves is of second order.
#[test]
fn a_hundred_kilograms_are_compensated_by_one_step() {
    let mut rng = seeded();
    let (mut worst, mut largest, mut limited, mut runs) = ([0.0; 2], [0.0; 4], 0, 0);
    while runs < cases(300) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let pose = Pose { theta_rad: within(0.24), sigma_rad: within(0.24), z0_m: 0.53 + within(0.028) };
        let stands = Configuration { pose, beta_rad: Vector2::new(within(1.2), -0.3 + within(0.3)) };
        let mut three = Compensator::<f64, 3>::new(&BARE).unwrap();
        three.set_weight(Some(CarriedWeight::<f64, 3>::new(&ON_PLAIN, &PLATFORM, &HOME.pose, TIP_M).unwrap()));
        let found = three.update(&ON_PLAIN, &pose, TIP_M, &on(Wrench::ZERO)).joints;
        let [here, there] = [&pose, &HOME.pose].map(|pose| screws_against(&PARAMETERS, pose, TIP_M, &PLATFORM));
        keep_worst(&mut worst[0], share_apart(&found, &here, &there));
        let mut five = Compensator::<f64, 5>::new(&BARE).unwrap();
        five.set_weight(Some(CarriedWeight::<f64, 5>::new(&ON_PLAIN, &WRIST_F64, &PLATFORM, &TOOL, &HOME).unwrap()));
        let offset = five.update(&ON_PLAIN, &WRIST_F64, &stands, &on(Wrench::ZERO));
        let [here, there] = [&stands, &HOME].map(|stands| axes_against(stands, &PLATFORM, &TOOL));
        keep_worst(&mut worst[1], share_apart(&offset.joints, &here, &there));
        let table = axes(&BARE).update(&MODEL, &WRIST_F64, &stands, &on(Wrench::ZERO)).joints;
        let asked = update(&mut screws(&BARE), &pose, &on(Wrench::ZERO)).joints;
        keep_worst(&mut largest[0], asked.amax());
        keep_worst(&mut largest[1], table.fixed_rows::<3>(0).amax());
        keep_worst(&mut largest[2], table.fixed_rows::<2>(3).amax());
        limited += usize::from(table.fixed_rows::<3>(0).amax() > 0.5e-3 || table.fixed_rows::<2>(3).amax() > 1e-3);
        runs += 1;
    }
    println!("left of 80 and 100 kg: {worst:?}; asked for {largest:?}; {limited} of {runs} beyond the default limits");
    assert!(worst[0] < 1e-2 && worst[1] < 1e-2);
}

#[test]
fn where_the_machine_was_zeroed_there_is_nothing_to_do() {
    let (mut three, mut five) = (screws(&BARE), axes(&BARE));
    assert_eq!(update(&mut three, &HOME.pose, &on(Wrench::ZERO)).joints, Vector3::zeros());
    assert_eq!(five.update(&MODEL, &WRIST_F64, &HOME, &on(Wrench::ZERO)).joints, SVector::<f64, 5>::zeros());
    // nor where only a share of it is known
    let known = MODEL.with_uncertainty(&UNCERTAINTY_F64);
    let doubted = three.update(&known, &HOME.pose, TIP_M, &on(Wrench::ZERO));
    assert!(doubted.known.is_some() && doubted.joints.amax() < 1e-15, "{doubted:?}");
    assert!(update(&mut three, &PLACE.pose, &on(Wrench::ZERO)).joints.amax() > 1e-6);
    // a machine that rubs remembers the weight and the load, not the way to the place
    let effects = PARAMETERS.effects.with("friction-hysteresis", [2e-6, 0.0, 50.0]).unwrap();
    let rubbing = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let carried =
        CarriedWeight::<f64, 3>::new(&Model::new(&rubbing, &TABLE_F64), &PLATFORM, &HOME.pose, TIP_M).unwrap();
    let mut compensator = Compensator::<f64, 3>::new(&BARE).unwrap();
    compensator.set_weight(Some(carried));
    let mut at = |wrench| compensator.update(&Model::new(&rubbing, &TABLE_F64), &HOME.pose, TIP_M, &on(wrench)).joints;
    assert_eq!(at(Wrench::ZERO), Vector3::zeros());
    at(LOAD);
    assert!(at(Wrench::ZERO).amax() > 1e-7, "the load left no lag");
}

/// Turned about the z axis of B by 180° with everything else mirrored, the field of gravity is a mirror image: σ, y and limbs 1 and 2
/// change sides. And a machine that hangs sags the other way by as much.
#[test]
fn a_mirror_image_has_mirrored_offsets() {
    let machine = &MACHINE_F64;
    let offset = |zero: &Pose<f64>, pose: &Pose<f64>, weight: &Weight<f64>, tip_m| {
        let carried = CarriedWeight::<f64, 3>::new(&Model::new(machine, &PLAIN), weight, zero, tip_m).unwrap();
        let mut compensator = Compensator::<f64, 3>::new(&BARE).unwrap();
        compensator.set_weight(Some(carried));
        compensator.update(&Model::new(machine, &PLAIN), pose, tip_m, &on(Wrench::ZERO)).joints
    };
    let beside = |v: Vector3<f64>| Vector3::new(v.x, -v.y, v.z);
    let across = |pose: &Pose<f64>| Pose { sigma_rad: -pose.sigma_rad, ..*pose };
    let zero = Pose { theta_rad: -0.1, sigma_rad: 0.05, z0_m: 0.51 };
    let here = offset(&zero, &PLACE.pose, &PLATFORM, TIP_M);
    let mirrored = Weight { force_n: beside(PLATFORM.force_n), centre_m: beside(PLATFORM.centre_m) };
    let there = offset(&across(&zero), &across(&PLACE.pose), &mirrored, beside(TIP_M));
    assert!((Vector3::new(there.y, there.x, there.z) - here).amax() < 1e-12, "{here:?} {there:?}");
    let hanging = Weight { force_n: -PLATFORM.force_n, ..PLATFORM };
    assert!((offset(&zero, &PLACE.pose, &hanging, TIP_M) + here).amax() < 2e-3 * here.amax());
    // from the zero to the place and back is nothing, but for what is of second order
    assert!((offset(&PLACE.pose, &zero, &PLATFORM, TIP_M) + here).amax() < 1e-12);
}

/// A reading is filtered, freed of its dead band, multiplied by the gain and believed up to its greatest; a weight is not.
#[test]
fn a_weight_is_no_reading() {
    let weight = |settings| update(&mut screws(settings), &PLACE.pose, &on(Wrench::ZERO)).joints;
    let whole = weight(&BARE);
    assert!(whole.amax() > 3e-6, "{whole:?}");
    let strict = CompensatorSettings {
        gain: 0.0,
        filter_s: 1.0,
        dead_band_n: 1e3,
        dead_band_nm: 1e2,
        max_force_n: 1e3,
        max_moment_nm: 1e2,
        ..BARE
    };
    assert_eq!(weight(&strict), whole);
    // load and weight add up, but for what is of second order
    let mut bare = Compensator::<f64, 3>::new(&BARE).unwrap();
    let load = update(&mut bare, &PLACE.pose, &on(LOAD)).joints;
    let both = update(&mut screws(&BARE), &PLACE.pose, &on(LOAD)).joints;
    assert!((both - load - whole).amax() < 1e-3 * load.amax(), "{both:?} {load:?} {whole:?}");
    // a sensor that is lost takes its load with it, and no more
    let nan = on(Wrench { force_n: Vector3::repeat(f64::NAN), ..LOAD });
    let lost = settled(&mut screws(&BARE), &PLACE.pose, &nan);
    assert_eq!((lost.joints, lost.fault), (whole, Some(Fault::WrenchNotFinite)));
    // of five axes alike
    let five = |compensator: &mut Compensator<f64, 5>, wrench| {
        compensator.update(&MODEL, &WRIST_F64, &PLACE, &on(wrench)).joints
    };
    let whole = five(&mut axes(&BARE), Wrench::ZERO);
    assert_eq!(five(&mut axes(&strict), Wrench::ZERO), whole);
    let load = five(&mut Compensator::new(&BARE).unwrap(), LOAD);
    let both = five(&mut axes(&BARE), LOAD);
    assert!((both - load - whole).amax() < 1e-3 * load.amax(), "{both:?} {load:?} {whole:?}");
}

#[test]
fn it_comes_and_goes_within_the_limits() {
    let d = CompensatorSettings { stuck_s: 0.0, ..CompensatorSettings::DEFAULT };
    let longest = 1.000001 * d.screw_rate_m_per_s * d.period_s;
    let heavier = |weight: &Weight<f64>| Weight { force_n: weight.force_n * 3.0, ..*weight };
    let again = CarriedWeight::<f64, 3>::new(&MODEL, &heavier(&PLATFORM), &HOME.pose, TIP_M).unwrap();
    let elsewhere = CarriedWeight::<f64, 3>::new(&ON_PLAIN, &PLATFORM, &HOME.pose, TIP_M).unwrap();
    let mut compensator = Compensator::<f64, 3>::new(&d).unwrap();
    let mut last = Vector3::zeros();
    let mut ends = Vec::new();
    // none, one, a heavier one, another table with its reference, switched off, on, out of the box, none
    for phase in 0..8 {
        match phase {
            1 => compensator.set_weight(Some(of_screws())),
            2 => compensator.set_weight(Some(again)),
            3 => compensator.set_weight(Some(elsewhere)),
            7 => compensator.set_weight(None),
            _ => {}
        }
        let table = if phase == 3 { &PLAIN } else { &TABLE_F64 };
        let pose = if phase == 6 { Pose { theta_rad: 0.4, ..PLACE.pose } } else { PLACE.pose };
        for _ in 0..300 {
            let reading = Reading { enabled: phase != 4, ..on(Wrench::ZERO) };
            let offset = compensator.update(&Model::new(&MACHINE_F64, table), &pose, TIP_M, &reading);
            assert!((offset.joints - last).amax() <= longest, "{phase}");
            assert_eq!(offset.fault, (phase == 6).then_some(Fault::OutsideBox));
            last = offset.joints;
        }
        ends.push(last);
    }
    for zero in [0, 4, 6, 7] {
        assert_eq!(ends[zero], Vector3::zeros(), "{zero}");
    }
    assert!((ends[2] - 3.0 * ends[1]).amax() < 1e-2 * ends[2].amax(), "{ends:?}");
    assert!(ends[1].amax() > 3e-6 && (ends[3] - ends[1]).amax() > 1e-7, "{ends:?}");
    // at the largest offset it is held, and it may be held or extrapolated outside of the box
    let small = CompensatorSettings { max_screw_m: 0.5 * ends[1].amax(), ..d };
    let held = settled(&mut screws(&small), &PLACE.pose, &on(Wrench::ZERO));
    assert_eq!(held.limit, Limit::Size);
    assert!(held.joints.amax() <= small.max_screw_m * 1.000001);
    let outside = Pose { theta_rad: 0.4, ..PLACE.pose };
    for (outside_box, holds) in [(OutsideBox::Hold, true), (OutsideBox::Extrapolate, false)] {
        let mut compensator = screws(&CompensatorSettings { outside_box, ..d });
        let before = settled(&mut compensator, &PLACE.pose, &on(Wrench::ZERO)).joints;
        let after = settled(&mut compensator, &outside, &on(Wrench::ZERO)).joints;
        assert_eq!(before == after, holds);
        assert!(after.amax() > 1e-6);
    }
}

#[test]
fn a_reset_keeps_the_weight() {
    let mut compensator = screws(&BARE);
    let before = update(&mut compensator, &PLACE.pose, &on(LOAD)).joints;
    compensator.reset();
    assert_eq!(compensator, screws(&BARE));
    assert_eq!(update(&mut compensator, &PLACE.pose, &on(LOAD)).joints, before);
}

/// What is not known of a table is not known of a weight's deflection either.
#[test]
fn of_a_weight_no_more_is_compensated_than_is_known() {
    let learned = Estimator::<f64, 6>::new(&drives()).unwrap();
    let whole = update(&mut screws(&BARE), &PLACE.pose, &on(Wrench::ZERO)).joints;
    let known = MODEL.with_uncertainty(&UNCERTAINTY_F64);
    let certain = screws(&BARE).update(&known, &PLACE.pose, TIP_M, &on(Wrench::ZERO));
    assert_eq!((certain.joints, certain.known.unwrap().share), (whole, 1.0));
    let doubted = screws(&BARE).update(&MODEL.with_learned(&learned), &PLACE.pose, TIP_M, &on(Wrench::ZERO));
    let known = doubted.known.unwrap();
    assert!(known.uncertainty.u95_m().amax() > 0.0);
    // at the start nothing is learned: the same deflection, as far as it is known
    assert!((doubted.joints - whole * known.share).amax() < 1e-3 * whole.amax(), "{doubted:?} {whole:?}");
    let five = axes(&BARE).update(&MODEL.with_learned(&learned), &WRIST_F64, &PLACE, &on(Wrench::ZERO));
    let whole = axes(&BARE).update(&MODEL, &WRIST_F64, &PLACE, &on(Wrench::ZERO)).joints;
    assert!((five.joints - whole * five.known.unwrap().share).amax() < 2e-3 * whole.amax());
}

/// Where the load on the tip cancels the weight, next to nothing moves the tip; what the zeros hold is known as before.
#[test]
fn a_load_that_cancels_the_weight_leaves_the_reference() {
    let at = &HOME.pose;
    let sag = |wrench: &Wrench<f64>| {
        let wrench = wrench.moved_to_a(TIP_M);
        let moved = MACHINE_F64.deflection(Some(&TABLE_F64), &HOME.pose, &wrench, &Wrench::ZERO).unwrap();
        moved.seen_at(TIP_M).translation_m
    };
    let force = |force_n: Vector3<f64>| Wrench { force_n, ..Wrench::ZERO };
    let compliance = Matrix3::from_columns(&[0, 1, 2].map(|i| sag(&force(Vector3::ith(i, 1.0)))));
    let base = platform_of(&HOME.pose).rotation.inverse();
    let weight_n = base * PLATFORM.force_n;
    let weight = Wrench { force_n: weight_n, moment_nm: (PLATFORM.centre_m - TIP_M).cross(&weight_n) };
    let cancels_n = -compliance.try_inverse().unwrap() * sag(&weight) / BARE.gain;
    for share in [0.99, 1.0, 1.01] {
        let reading = on(force(cancels_n * share));
        let whole = screws(&BARE).update(&MODEL, at, TIP_M, &reading).joints;
        assert!(whole.amax() > 20e-6, "{whole:?}");
        let known = screws(&BARE).update(&MODEL.with_uncertainty(&UNCERTAINTY_F64), at, TIP_M, &reading);
        assert_eq!((known.joints, known.known.unwrap().share), (whole, 1.0));
    }
}

#[test]
fn what_cannot_be_a_weight_is_refused() {
    let new =
        |weight: &Weight<f64>, pose: &Pose<f64>| CarriedWeight::<f64, 3>::new(&MODEL, weight, pose, TIP_M).map(|_| ());
    let five = |platform: &Weight<f64>, tool: &Weight<f64>, zero: &Configuration<f64>| {
        CarriedWeight::<f64, 5>::new(&MODEL, &WRIST_F64, platform, tool, zero).map(|_| ())
    };
    let force = |x: f64| Weight { force_n: Vector3::new(x, 0.0, 0.0), ..PLATFORM };
    let centre = |x: f64| Weight { centre_m: Vector3::new(0.0, 0.0, x), ..PLATFORM };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for wrong in [force(bad), centre(bad)] {
            assert_eq!(new(&wrong, &HOME.pose), Err(WeightError::NotFinite));
            assert_eq!(five(&wrong, &TOOL, &HOME), Err(WeightError::NotFinite));
            assert_eq!(five(&PLATFORM, &wrong, &HOME), Err(WeightError::NotFinite));
        }
        let nowhere = Pose { z0_m: bad, ..HOME.pose };
        assert!(matches!(new(&PLATFORM, &nowhere), Err(WeightError::NoReference(_))));
    }
    for heavy in [1.0001e5, -1e6, 1e200, f64::MAX] {
        assert_eq!(new(&force(heavy), &HOME.pose), Err(WeightError::TooHeavy));
        assert_eq!(five(&PLATFORM, &force(heavy), &HOME), Err(WeightError::TooHeavy));
    }
    for far in [10.001, -1e3, 1e200] {
        assert_eq!(new(&centre(far), &HOME.pose), Err(WeightError::TooFar));
        assert_eq!(five(&centre(far), &TOOL, &HOME), Err(WeightError::TooFar));
    }
    // what nobody has set is zeros
    let unset = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.0 };
    let outside = Pose { theta_rad: 0.4, ..HOME.pose };
    assert_eq!(new(&PLATFORM, &outside), Err(WeightError::NoReference(Fault::OutsideBox)));
    assert_eq!(new(&PLATFORM, &unset), Err(WeightError::NoReference(Fault::OutsideBox)));
    let turned = Configuration { beta_rad: Vector2::new(2.0, 0.0), ..HOME };
    let wrist = Fault::Tool(ToolError::WristLimit { joint: 1 });
    assert_eq!(five(&PLATFORM, &TOOL, &turned), Err(WeightError::NoReference(wrist)));
    // ten tonnes along the limbs, and across them, where they displace the tip by centimetres
    let along = Weight { force_n: Vector3::new(0.0, 0.0, -1e5), ..PLATFORM };
    assert_eq!((new(&along, &HOME.pose), new(&centre(10.0), &HOME.pose)), (Ok(()), Ok(())));
    let too_far = Fault::Compensation(CompensationError::TooFar);
    assert_eq!(new(&force(-1e5), &HOME.pose), Err(WeightError::NoReference(too_far)));
    for error in [WeightError::NotFinite, WeightError::TooHeavy, WeightError::TooFar, WeightError::NoReference(wrist)] {
        assert!(!error.to_string().is_empty());
    }
}

fn narrow(v: Vector3<f64>) -> Vector3<f32> {
    v.cast()
}

/// f32 within 0.3 µm of f64, as of a load.
#[test]
fn single_precision_follows() {
    let mut rng = seeded();
    let slim = |weight: &Weight<f64>| Weight { force_n: narrow(weight.force_n), centre_m: narrow(weight.centre_m) };
    let model = &Model::new(&MACHINE_F32, &TABLE_F32);
    let home = HOME.narrow();
    let three = CarriedWeight::<f32, 3>::new(model, &slim(&PLATFORM), &home.pose, narrow(TIP_M));
    let five = CarriedWeight::<f32, 5>::new(model, &WRIST_F32, &slim(&PLATFORM), &slim(&TOOL), &home);
    let (three, five) = (three.unwrap(), five.unwrap());
    let mut worst = [0.0; 3];
    for _ in 0..cases(1000) {
        let mut within = |half: f64| between(&mut rng, -half, half);
        let stands = Configuration {
            pose: Pose { theta_rad: within(0.26), sigma_rad: within(0.26), z0_m: 0.53 + within(0.029) },
            beta_rad: Vector2::new(within(1.0), within(0.3)),
        };
        let at = stands.narrow();
        let mut rough = Compensator::<f32, 3>::new(&BARE).unwrap();
        rough.set_weight(Some(three));
        let reading = Reading { enabled: true, wrench: Wrench::ZERO, rise: 0.0.into() };
        let found = rough.update(model, &at.pose, narrow(TIP_M), &reading).joints;
        let exact = update(&mut screws(&BARE), &stands.pose, &on(Wrench::ZERO)).joints;
        keep_worst(&mut worst[0], (found.cast::<f64>() - exact).amax());
        let mut rough = Compensator::<f32, 5>::new(&BARE).unwrap();
        rough.set_weight(Some(five));
        let found = rough.update(model, &WRIST_F32, &at, &reading).joints.cast::<f64>();
        let exact = axes(&BARE).update(&MODEL, &WRIST_F64, &stands, &on(Wrench::ZERO)).joints;
        let off = found - exact;
        keep_worst(&mut worst[1], off.fixed_rows::<3>(0).amax());
        keep_worst(&mut worst[2], off.fixed_rows::<2>(3).amax());
    }
    println!(
        "f32: {:.3} µm of three screws; {:.3} µm and {:.3} µrad of five axes",
        worst[0] * 1e6,
        worst[1] * 1e6,
        worst[2] * 1e6
    );
    assert!(worst[0] < 0.3e-6 && worst[1] < 0.5e-6 && worst[2] < 1e-6);
}

trait Narrow {
    fn narrow(&self) -> Configuration<f32>;
}

impl Narrow for Configuration<f64> {
    fn narrow(&self) -> Configuration<f32> {
        let [theta_rad, sigma_rad, z0_m] =
            [self.pose.theta_rad, self.pose.sigma_rad, self.pose.z0_m].map(f32::from_f64);
        Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: self.beta_rad.cast() }
    }
}

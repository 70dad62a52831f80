//! The five axes against the product of Table 1's matrices, against differences of it, and against the stiffness carried
//! to the tip by hand.

use std::f64::consts::{FRAC_PI_2, PI};

use fastrand::Rng;
use nalgebra::{Matrix3, Matrix4, Matrix6, Rotation3, SVector, Translation3, Vector2, Vector3, Vector6};
use pkm_core::five_axis::rest_to_rest_s;
use pkm_core::machine::BodyKind;
use pkm_core::tables::reference::{
    MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64, WRIST, WRIST_F32, WRIST_F64,
};
use pkm_core::{
    Configuration, Domain, FiveAxis, JointValues, KinematicsError, Machine, MachineParameters, Pose, ScrewLengths,
    StiffnessError, Tool, ToolDeflectionError, ToolError, ToolFrame, ToolMotion, ToolSolution, Wrench, Wrist,
    WristError, WristParameters,
};
use pkm_tests::{between, cases, first, keep_worst, random_parameters, random_pose, seeded};

const FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
const HOME: Configuration<f64> =
    Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }, beta_rad: Vector2::new(0.0, 0.0) };

/// Anywhere within travel and joint limits.
fn configuration(rng: &mut Rng) -> Configuration<f64> {
    let mut w = |low: f64, high: f64| between(rng, low, high);
    Configuration {
        pose: Pose { theta_rad: w(-0.9, 0.9), sigma_rad: w(-0.9, 0.9), z0_m: w(0.3, 0.8) },
        beta_rad: Vector2::new(w(-FRAC_PI_2, FRAC_PI_2), w(-FRAC_PI_2, FRAC_PI_2)),
    }
}

/// Within the wrist's margin and limits and the screws' travel.
fn holdable(rng: &mut Rng, five: &FiveAxis<'_, f64>) -> (Configuration<f64>, Tool<f64>) {
    first(|| {
        let c = configuration(rng);
        matches!(five.normalised_determinant(&c), Ok(0.1..)).then_some((c, five.tool(&c).ok()?))
    })
}

/// Eq. 2 as published: T_p by its own definition, the wrist as four rows of Table 1.
fn table_1(c: &Configuration<f64>, p: &WristParameters) -> Matrix4<f64> {
    let row = |beta: f64, d: f64, alpha: f64, b: f64| {
        Rotation3::from_axis_angle(&Vector3::z_axis(), beta).to_homogeneous()
            * Translation3::new(0.0, 0.0, d).to_homogeneous()
            * Translation3::new(b, 0.0, 0.0).to_homogeneous()
            * Rotation3::from_axis_angle(&Vector3::x_axis(), alpha).to_homogeneous()
    };
    let [beta1, beta2] = c.beta_rad.into();
    let Pose { theta_rad, sigma_rad, z0_m } = c.pose;
    Translation3::new(z0_m * theta_rad.tan(), 0.0, z0_m).to_homogeneous()
        * Rotation3::from_axis_angle(&Vector3::y_axis(), theta_rad).to_homogeneous()
        * Rotation3::from_axis_angle(&Vector3::x_axis(), sigma_rad).to_homogeneous()
        * row(0.0, 0.0, 0.0, p.offset_m)
        * row(beta1, p.first_d_m, FRAC_PI_2, p.first_b_m)
        * row(beta2, 0.0, -FRAC_PI_2, p.second_b_m)
        * row(0.0, p.flange_m, 0.0, 0.0)
}

/// ∂(tip, axis)/∂(θ, σ, Z0, β1, β2) by differences, with the axis itself for a sixth column: its determinant is that of tip and
/// the axis's two directions.
fn determinant_by_differences(c: &Configuration<f64>, p: &WristParameters) -> f64 {
    const H: f64 = 1e-5;
    let mut j = Matrix6::zeros();
    for i in 0..5 {
        let seen = |by: f64| {
            let mut c = *c;
            let Pose { theta_rad, sigma_rad, z0_m } = &mut c.pose;
            let beta = &mut *c.beta_rad;
            *[theta_rad, sigma_rad, z0_m, &mut beta.x, &mut beta.y][i] += by;
            let t = table_1(&c, p);
            Vector6::new(t[(0, 3)], t[(1, 3)], t[(2, 3)], t[(0, 2)], t[(1, 2)], t[(2, 2)])
        };
        j.set_column(i, &((seen(H) - seen(-H)) / (2.0 * H)));
    }
    let t = table_1(c, p);
    j.set_column(5, &Vector6::new(0.0, 0.0, 0.0, t[(0, 2)], t[(1, 2)], t[(2, 2)]));
    j.determinant()
}

fn random_wrist(rng: &mut Rng) -> WristParameters {
    let mut w = |low: f64, high: f64| between(rng, low, high);
    first(|| {
        let p = WristParameters {
            offset_m: w(-0.1, 0.1),
            first_d_m: w(-0.1, 0.6),
            first_b_m: w(-0.1, 0.1),
            second_b_m: w(-0.25, 0.25),
            flange_m: w(0.0, 0.4),
            min_rad: [-3.0; 2],
            max_rad: [3.0; 2],
            home_z0_m: w(0.3, 1.0),
            singularity_margin: 0.1,
        };
        ((p.first_b_m + p.second_b_m).abs() > 0.05).then_some(p)
    })
}

fn apart(a: &Tool<f64>, b: &Tool<f64>) -> [f64; 2] {
    [(a.tip_m - b.tip_m).norm(), (a.axis - b.axis).norm()]
}

fn configurations_apart(a: &Configuration<f64>, b: &Configuration<f64>) -> f64 {
    let all = |c: &Configuration<f64>| [c.pose.theta_rad, c.pose.sigma_rad, c.pose.z0_m, c.beta_rad[0], c.beta_rad[1]];
    all(a).iter().zip(all(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn the_frame_is_the_product_of_table_1() {
    let mut rng = seeded();
    for _ in 0..cases(2000) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).expect("a machine");
        let p = random_wrist(&mut rng);
        let wrist = Wrist::<f64>::new(&p).expect("a wrist");
        let five = FiveAxis { machine: &machine, wrist: &wrist };
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m, 0.05);
        let c =
            Configuration { pose, beta_rad: Vector2::new(between(&mut rng, -2.0, 2.0), between(&mut rng, -2.0, 2.0)) };
        let frame = five.frame(&c).expect("a frame");
        let upright = Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 1.0 }, ..HOME };
        let above = table_1(&upright, &p);
        for (i, tip) in p.tip_at_zero_m().iter().enumerate() {
            assert!((tip - above[(i, 3)] + if i == 2 { 1.0 } else { 0.0 }).abs() < 1e-14);
        }
        let t = table_1(&c, &p);
        for i in 0..3 {
            assert!((frame.tip_m[i] - t[(i, 3)]).abs() < 1e-14 * (1.0 + pose.z0_m));
            for column in 0..3 {
                assert!((frame.axes[(i, column)] - t[(i, column)]).abs() < 1e-14);
            }
        }
        let joints = five.joints(&c).expect("joint values");
        assert!(configurations_apart(&five.forward(&joints).expect("a configuration").0, &c) < 1e-10);

        let home = Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: p.home_z0_m }, ..HOME };
        let share = determinant_by_differences(&c, &p) / determinant_by_differences(&home, &p);
        let found = five.normalised_determinant(&c).expect("a share");
        assert!((found - share).abs() < 1e-5 * (1.0 + share.abs()), "{found} {share}");
    }
    assert!(determinant_by_differences(&HOME, &WRIST) < 0.0);
    assert_eq!((FIVE.normalised_determinant(&HOME), WRIST), (Ok(1.0), WristParameters::PAPER));
}

#[test]
fn every_reachable_tool_on_the_home_side_is_found() {
    let mut rng = seeded();
    let (mut worst, mut at_once, mut same) = ([0.0_f64; 2], 0, 0);
    let targets = cases(100_000);
    for _ in 0..targets {
        let (c, tool) = holdable(&mut rng, &FIVE);
        at_once += usize::from(FIVE.inverse(&tool, &HOME).is_ok());
        let found = FIVE.search(&tool, &HOME).unwrap_or_else(|e| panic!("{e:?} at {c:?}"));
        let off = apart(&FIVE.forward(&found.joints).expect("in reach").1, &tool);
        worst = [worst[0].max(off[0]), worst[1].max(off[1])];
        assert!(found.normalised_determinant >= 0.1);
        same += usize::from(configurations_apart(&found.configuration, &c) < 1e-7);
    }
    println!("worst {worst:?}; {at_once} straight from home; {same} as drawn");
    assert!(worst[0] <= 1e-12 && worst[1] <= 1e-12, "{worst:?}");
    // 99.2 %; and in its working mode this machine holds a tool in one way only
    assert!(at_once > targets * 99 / 100 && same == targets, "{at_once} {same}");
}

#[test]
fn a_tip_with_the_wrist_given_is_held_in_closed_form() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(100_000) {
        let (c, tool) = holdable(&mut rng, &FIVE);
        let found = FIVE.inverse_at(tool.tip_m, c.beta_rad).unwrap_or_else(|e| panic!("{e:?} at {c:?}"));
        worst = worst.max(configurations_apart(&found.configuration, &c));
        assert_eq!((found.iterations, found.configuration.beta_rad), (0, c.beta_rad));
        let share = FIVE.normalised_determinant(&found.configuration).unwrap();
        assert!(
            (share - found.normalised_determinant).abs() < 1e-12 * share,
            "{share} {}",
            found.normalised_determinant
        );
    }
    println!("worst {worst:e}");
    assert!(worst <= 1e-12, "{worst:e}");

    let [x, y, z] = FIVE.tool(&HOME).unwrap().tip_m.into();
    let at = |tip: [f64; 3], beta: [f64; 2]| FIVE.inverse_at(tip.into(), beta.into());
    assert_eq!(at([f64::NAN, y, z], [0.0; 2]), Err(ToolError::NotFinite));
    assert_eq!(at([x, y, z], [0.0, f64::INFINITY]), Err(ToolError::NotFinite));
    assert_eq!(at([x, 2.0, z], [0.0; 2]), Err(ToolError::Unreachable));
    assert_eq!(at([0.0, y, 0.1], [0.0; 2]), Err(ToolError::Unreachable));
    let too_far = Err(ToolError::Kinematics(KinematicsError::OutOfTravel { limb: 1 }));
    assert_eq!(at([x, y, z + 1.0], [0.0; 2]), too_far);
    let turned = Configuration { beta_rad: Vector2::new(0.0, 1.6), ..HOME };
    let tip_m = table_1(&turned, &WRIST).fixed_view::<3, 1>(0, 3).into_owned();
    assert_eq!(FIVE.inverse_at(tip_m, turned.beta_rad), Err(ToolError::WristLimit { joint: 2 }));
    for _ in 0..cases(1000) {
        let (c, tool) = first(|| {
            let c = configuration(&mut rng);
            matches!(FIVE.normalised_determinant(&c), Ok(..0.0999)).then_some((c, FIVE.tool(&c).ok()?))
        });
        assert_eq!(FIVE.inverse_at(tool.tip_m, c.beta_rad), Err(ToolError::Singular));
        // a machine that stands there can be driven out
        let share = FIVE.normalised_determinant(&c).unwrap();
        match FIVE.inverse_at_any_margin(tool.tip_m, c.beta_rad) {
            Ok(found) => assert!(
                found.normalised_determinant > 0.0 && found.normalised_determinant < 0.1,
                "{share} {}",
                found.normalised_determinant
            ),
            Err(e) => assert!(e == ToolError::Singular && share <= 1e-12, "{e:?} at {share}"),
        }
    }
}

/// A machine of any proportions with a wrist of its size.
struct Other {
    machine: Machine<f64>,
    wrist: Wrist<f64>,
    size_m: f64,
    home_z0_m: f64,
}

impl Other {
    fn random(rng: &mut Rng) -> Self {
        let parameters = random_parameters(rng, BodyKind::Beam);
        let machine = Machine::<f64>::new(&parameters).expect("a machine");
        let size_m = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let mut p = random_wrist(rng);
        for length in [&mut p.offset_m, &mut p.first_d_m, &mut p.first_b_m, &mut p.second_b_m, &mut p.flange_m] {
            *length *= size_m;
        }
        p.home_z0_m *= 2.0 * size_m;
        Self { machine, wrist: Wrist::<f64>::new(&p).expect("a wrist"), size_m, home_z0_m: p.home_z0_m }
    }

    fn five(&self) -> FiveAxis<'_, f64> {
        FiveAxis { machine: &self.machine, wrist: &self.wrist }
    }

    fn configuration(&self, rng: &mut Rng) -> Configuration<f64> {
        let mut w = |low: f64, high: f64| between(rng, low, high);
        let pose = Pose { theta_rad: w(-0.8, 0.8), sigma_rad: w(-0.8, 0.8), z0_m: self.home_z0_m * w(0.6, 1.6) };
        Configuration { pose, beta_rad: Vector2::new(w(-1.5, 1.5), w(-1.5, 1.5)) }
    }
}

#[test]
fn other_machines_hold_tools_on_their_home_side() {
    let mut rng = seeded();
    let (mut found, mut tried) = (0, 0);
    for _ in 0..cases(300) {
        let other = Other::random(&mut rng);
        let (five, size) = (other.five(), other.size_m);
        let home = Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: other.home_z0_m }, ..HOME };
        for _ in 0..30 {
            let c = other.configuration(&mut rng);
            let (Ok(tool), Ok(0.1..)) = (five.tool(&c), five.normalised_determinant(&c)) else { continue };
            tried += 1;
            if let Ok(solution) = five.search(&tool, &home) {
                found += 1;
                let off = apart(&five.tool(&solution.configuration).expect("a tool"), &tool);
                assert!(off[0] < 1e-11 * size && off[1] < 1e-11, "{off:?}");
            }
        }
    }
    println!("{found} of {tried}");
    assert!(found * 1000 >= tried * 995, "{found} of {tried}");
}

#[test]
fn a_path_is_followed_without_a_jump_up_to_the_singular_surface() {
    let mut rng = seeded();
    let (mut iterations, mut refused, mut done) = (Vec::new(), 0, 0);
    let paths = cases(300).max(100);
    for _ in 0..paths {
        let (mut c, _) = holdable(&mut rng, &FIVE);
        let to = configuration(&mut rng);
        // through configurations in a straight line, so that the right ones are known
        let from = c;
        const STEPS: usize = 400;
        for step in 1..=STEPS {
            let share = step as f64 / STEPS as f64;
            let mix = |a: f64, b: f64| a + share * (b - a);
            let right = Configuration {
                pose: Pose {
                    theta_rad: mix(from.pose.theta_rad, to.pose.theta_rad),
                    sigma_rad: mix(from.pose.sigma_rad, to.pose.sigma_rad),
                    z0_m: mix(from.pose.z0_m, to.pose.z0_m),
                },
                beta_rad: Vector2::new(mix(from.beta_rad[0], to.beta_rad[0]), mix(from.beta_rad[1], to.beta_rad[1])),
            };
            let Ok(tool) = FIVE.tool(&right) else { break };
            let distance = FIVE.normalised_determinant(&right).expect("a share");
            match FIVE.inverse(&tool, &c) {
                Ok(ToolSolution { configuration, iterations: n, normalised_determinant, .. }) => {
                    assert!(configurations_apart(&configuration, &right) < 1e-8, "a jump");
                    assert!(distance >= 0.1 - 1e-9 && (normalised_determinant - distance).abs() < 1e-6);
                    iterations.push(n);
                    c = configuration;
                    done += usize::from(step == STEPS);
                }
                Err(e) => {
                    assert!(e == ToolError::Singular && distance < 0.1, "{e:?} {distance}");
                    refused += 1;
                    break;
                }
            }
        }
    }
    iterations.sort_unstable();
    let (median, most) = (iterations[iterations.len() / 2], iterations[iterations.len() - 1]);
    println!("looks: median {median}, most {most}; {done} paths to their end, {refused} up to the surface");
    assert!(median <= 3 && most <= 6 && done > paths / 10 && refused > paths / 10, "{median} {most} {done} {refused}");
}

#[test]
fn a_whole_frame_is_solved_in_closed_form() {
    let mut rng = seeded();
    for n in 0..cases(20_000) {
        let (mut c, _) = holdable(&mut rng, &FIVE);
        // on and about the configurations where the wrist's second axis is square to the plane y = 0
        match n % 4 {
            0 => (c.pose.sigma_rad, c.beta_rad[0]) = (0.0, 0.0),
            1 => (c.pose.sigma_rad, c.beta_rad[0]) = (1e-9 * c.pose.sigma_rad, 1e-9 * c.beta_rad[0]),
            _ => {}
        }
        let Ok(frame) = FIVE.frame(&c) else { continue };
        if !matches!(FIVE.normalised_determinant(&c), Ok(0.1..)) {
            continue;
        }
        let found = FIVE.inverse_frame(&frame).unwrap_or_else(|e| panic!("{e:?} at {c:?}"));
        assert!(configurations_apart(&found.configuration, &c) < 1e-9, "{found:?} {c:?}");
    }
    // a wrist that turns almost all the way round: the closed form's angle leaves ±180°
    let wide = WristParameters { min_rad: [-3.1; 2], max_rad: [3.1; 2], ..WRIST };
    let five = FiveAxis { wrist: &Wrist::<f64>::new(&wide).expect("a wrist"), ..FIVE };
    for _ in 0..cases(20_000) {
        let c = first(|| {
            let beta_rad = Vector2::from_fn(|_, _| between(&mut rng, -3.1, 3.1));
            let c = Configuration { beta_rad, ..configuration(&mut rng) };
            matches!(five.normalised_determinant(&c), Ok(0.1..)).then_some(c)
        });
        let frame = five.frame(&c).expect("a frame");
        let found = five.inverse_frame(&frame).unwrap_or_else(|e| panic!("{e:?} at {c:?}"));
        assert!(configurations_apart(&found.configuration, &c) < 1e-7, "{found:?} {c:?}");
    }
    let frame = FIVE.frame(&HOME).expect("a frame");
    let [x, y, z] = [0, 1, 2].map(|i| frame.axes.column(i).into_owned());
    for axes in [[x, y, y], [y, x, z], [Vector3::zeros(), y, z], [y, -Vector3::x(), z]] {
        let axes = Matrix3::from_columns(&axes);
        assert_eq!(FIVE.inverse_frame(&ToolFrame { axes, ..frame }), Err(ToolError::Inconsistent), "{axes:?}");
    }
    let aside = ToolFrame { tip_m: Vector3::new(frame.tip_m[0], 1e-3, frame.tip_m[2]), ..frame };
    assert_eq!(FIVE.inverse_frame(&aside), Err(ToolError::Inconsistent));
}

/// From A in A-uvw to the tip in the axes of T_h: displacements there = this · displacements here.
fn transport(c: &Configuration<f64>, p: &WristParameters) -> (Matrix6<f64>, Matrix3<f64>) {
    let at = |beta_rad| table_1(&Configuration { beta_rad, ..*c }, p);
    let platform = Rotation3::from_axis_angle(&Vector3::y_axis(), c.pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), c.pose.sigma_rad);
    let t_h = at(c.beta_rad);
    let tool: Matrix3<f64> = t_h.fixed_view::<3, 3>(0, 0).into();
    let a = Vector3::new(c.pose.z0_m * c.pose.theta_rad.tan(), 0.0, c.pose.z0_m);
    let tip: Vector3<f64> = platform.inverse() * (t_h.fixed_view::<3, 1>(0, 3) - a);
    let into_tool = tool.transpose() * platform.matrix();
    let mut x = Matrix6::zeros();
    x.fixed_view_mut::<3, 3>(0, 0).copy_from(&into_tool);
    x.fixed_view_mut::<3, 3>(3, 3).copy_from(&into_tool);
    x.fixed_view_mut::<3, 3>(0, 3).copy_from(&(-into_tool * tip.cross_matrix()));
    (x, tool)
}

fn wrench(rng: &mut Rng, force_n: f64, moment_nm: f64) -> Wrench<f64> {
    let mut three = |size: f64| Vector3::from_fn(|_, _| between(rng, -size, size));
    Wrench { force_n: three(force_n), moment_nm: three(moment_nm) }
}

fn in_box(rng: &mut Rng) -> Configuration<f64> {
    first(|| {
        let mut c = configuration(rng);
        c.pose = Pose {
            theta_rad: between(rng, -0.25, 0.25),
            sigma_rad: between(rng, -0.25, 0.25),
            z0_m: between(rng, 0.505, 0.555),
        };
        matches!(FIVE.normalised_determinant(&c), Ok(0.12..)).then_some(c)
    })
}

#[test]
fn stiffness_and_deflection_are_carried_to_the_tip() {
    let mut rng = seeded();
    for _ in 0..cases(500) {
        let c = in_box(&mut rng);
        let (x, tool) = transport(&c, &WRIST);
        let k_m = TABLE_F64.factor_form(&MACHINE_F64, &c.pose).expect("in the box").factor.stiffness();
        let compliance = x * k_m.matrix().try_inverse().expect("definite") * x.transpose();
        let seen = FIVE.tip_stiffness(&k_m, &c).expect("a stiffness").matrix();
        assert!((seen * compliance - Matrix6::identity()).abs().max() < 1e-9);

        let w = wrench(&mut rng, 1000.0, 50.0);
        let found = FIVE.deflection(Some(&TABLE_F64), &c, &w).expect("a deflection");
        assert_eq!(found.domain, Some(Domain::Inside));
        let d = compliance * w.to_vector();
        let moved = tool * Vector3::new(d[0], d[1], d[2]);
        let turned = tool * Vector3::new(d[3], d[4], d[5]);
        assert!((found.translation_m - moved).norm() < 1e-11 * moved.norm());
        assert!((found.rotation_rad - turned).norm() < 1e-11 * turned.norm());
    }
}

fn loaded(tool: &Tool<f64>, translation_m: Vector3<f64>, rotation_rad: Vector3<f64>) -> Tool<f64> {
    Tool { tip_m: tool.tip_m + translation_m, axis: (tool.axis + rotation_rad.cross(&tool.axis)).normalize() }
}

/// Greatest part of the deflection of tip and of axis that is left after a share of it was compensated, beyond what was to be left.
fn left(five: &FiveAxis<'_, f64>, machine: &Machine<f64>, table: bool, share: f64, rng: &mut Rng) -> [f64; 2] {
    let table = table.then_some(&TABLE_F64);
    let mut worst = [0.0_f64; 2];
    for _ in 0..cases(300) {
        let c = in_box(rng);
        let target = five.tool(&c).expect("a tool");
        let w = wrench(rng, 2000.0, 200.0);
        let found = match five.compensated_in_part(table, &target, &w, share, &c) {
            // a command may be out of what the target is in
            Err(ToolDeflectionError::Tool(ToolError::WristLimit { .. } | ToolError::Singular)) => continue,
            found => found.expect("compensated"),
        };
        let there = five.tool(&found.solution.configuration).expect("a tool");
        let d = five.deflection(table, &found.solution.configuration, &w).expect("a deflection");
        assert_eq!(d, found.deflection);
        assert_eq!(machine.inverse(&found.solution.configuration.pose), Ok(found.solution.joints.lengths));
        let before = apart(&loaded(&target, d.translation_m, d.rotation_rad), &target);
        let after = apart(&loaded(&there, share * d.translation_m, share * d.rotation_rad), &target);
        worst = [0, 1].map(|i| worst[i].max(after[i] / before[i]));
    }
    worst
}

#[test]
fn a_loaded_tool_stands_where_it_was_asked_for() {
    let mut rng = seeded();
    let effects = PARAMETERS.effects.with("clearance", [2e-6, 100.0, 0.0]);
    for (table, effects, share) in [(true, None, 1.0), (false, None, 1.0), (true, effects, 1.0), (true, effects, 0.6)] {
        let parameters = MachineParameters { effects: effects.unwrap_or(PARAMETERS.effects), ..PARAMETERS };
        let machine = Machine::<f64>::new(&parameters).expect("a machine");
        let five = FiveAxis { machine: &machine, wrist: &WRIST_F64 };
        let worst = left(&five, &machine, table, share, &mut rng);
        println!("left: {worst:?}");
        assert!(worst[0] <= 1e-3 && worst[1] <= 1e-3, "{worst:?}");
    }
}

/// A tool that moves on a curve: along a parabola, and about an axis.
struct Curve {
    from: Tool<f64>,
    tip: [Vector3<f64>; 2],
    about: Vector3<f64>,
    turn: [f64; 2],
}

impl Curve {
    fn random(rng: &mut Rng, from: Tool<f64>, speed: f64) -> Self {
        let mut three = |size: f64| Vector3::from_fn(|_, _| between(rng, -size, size));
        let (tip, about) = ([three(speed), three(3.0 * speed)], three(1.0).normalize());
        Self { from, tip, about, turn: [between(rng, -speed, speed), between(rng, -3.0 * speed, 3.0 * speed)] }
    }

    fn at(&self, t: f64) -> Tool<f64> {
        let tip_m = self.from.tip_m + self.tip[0] * t + self.tip[1] * (0.5 * t * t);
        let angle = self.turn[0] * t + self.turn[1] * (0.5 * t * t);
        let axis = Rotation3::from_scaled_axis(self.about * angle) * self.from.axis;
        Tool { tip_m, axis }
    }

    /// At its beginning.
    fn motion(&self) -> ToolMotion<f64> {
        let across = self.about.cross(&self.from.axis);
        ToolMotion {
            tip_m_per_s: self.tip[0],
            axis_per_s: across * self.turn[0],
            tip_m_per_s2: self.tip[1],
            axis_per_s2: across * self.turn[1] + self.about.cross(&across) * self.turn[0].powi(2),
        }
    }
}

/// First and second derivative of the joints by central differences of sixth order.
fn differences(five: &FiveAxis<'_, f64>, curve: &Curve, near: &Configuration<f64>) -> Option<[SVector<f64, 5>; 2]> {
    const H: f64 = 2e-3;
    let joints = |n: i32| {
        let tool = curve.at(f64::from(n) * H);
        // a second time from where the first ended: its last step leaves some 1e-12, which a difference shows
        let found = five.inverse(&tool, near).and_then(|found| five.inverse(&tool, &found.configuration)).ok()?;
        let JointValues { lengths, beta_rad } = found.joints;
        Some(SVector::<f64, 5>::from([lengths.q_m.x, lengths.q_m.y, lengths.q_m.z, beta_rad.x, beta_rad.y]))
    };
    let (mut first, mut second) = (SVector::zeros(), joints(0)? * (-49.0 / 18.0));
    for (n, a, b) in [(1, 0.75, 1.5), (2, -0.15, -0.15), (3, 1.0 / 60.0, 1.0 / 90.0)] {
        let (ahead, behind) = (joints(n)?, joints(-n)?);
        first += (ahead - behind) * a;
        second += (ahead + behind) * b;
    }
    Some([first / H, second / (H * H)])
}

#[test]
fn joints_move_as_differences_of_the_inverse_say() {
    let mut rng = seeded();
    let (mut worst, mut worst_f32) = ([0.0_f64; 2], [0.0_f64; 2]);
    let single = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
    let mut seen = 0;
    for _ in 0..cases(5000) {
        let (c, tool) = holdable(&mut rng, &FIVE);
        let share = FIVE.normalised_determinant(&c).expect("a share");
        // slow where a little of the tool is much of the joints: the differences have to be good
        let curve = Curve::random(&mut rng, tool, 0.05 * share.min(1.0).powi(2));
        let Some(expected) = differences(&FIVE, &curve, &c) else { continue };
        let motion = curve.motion();
        let Ok(found) = FIVE.joint_motion(&c, &motion) else { panic!("{c:?}") };
        seen += 1;
        let size = |v: &SVector<f64, 5>| v.amax().max(1e-3 * curve.turn[0].abs());
        let found = [found.velocity, found.acceleration];
        for i in 0..2 {
            keep_worst(&mut worst[i], (found[i] - expected[i]).amax() / size(&expected[i]));
        }
        let Pose { theta_rad, sigma_rad, z0_m } = c.pose;
        let narrow = Configuration {
            pose: Pose { theta_rad: theta_rad as f32, sigma_rad: sigma_rad as f32, z0_m: z0_m as f32 },
            beta_rad: c.beta_rad.cast(),
        };
        let slim = ToolMotion {
            tip_m_per_s: motion.tip_m_per_s.cast(),
            axis_per_s: motion.axis_per_s.cast(),
            tip_m_per_s2: motion.tip_m_per_s2.cast(),
            axis_per_s2: motion.axis_per_s2.cast(),
        };
        let Ok(rough) = single.joint_motion(&narrow, &slim) else { continue };
        for (i, rough) in [rough.velocity, rough.acceleration].into_iter().enumerate() {
            keep_worst(&mut worst_f32[i], (rough.cast::<f64>() - found[i]).amax() / size(&found[i]));
        }
    }
    println!("{seen} motions: velocity and acceleration within {worst:?}; f32 {worst_f32:?}");
    assert!(seen > cases(5000) * 9 / 10);
    assert!(worst[0] <= 1e-8 && worst[1] <= 1e-5, "{worst:?}");
    assert!(worst_f32[0] <= 2e-5 && worst_f32[1] <= 2e-5, "{worst_f32:?}");
}

#[test]
fn joints_of_other_machines_move_as_differences_of_the_inverse_say() {
    let mut rng = seeded();
    let (mut worst, mut seen, mut machines) = ([0.0_f64; 2], 0, 0);
    for _ in 0..cases(500) {
        let other = Other::random(&mut rng);
        let (five, before) = (other.five(), seen);
        for _ in 0..20 {
            let c = other.configuration(&mut rng);
            let (Ok(tool), Ok(share @ 0.1..)) = (five.tool(&c), five.normalised_determinant(&c)) else { continue };
            // slow where a little of the tool is much of the joints; the tip by the machine's size
            let mut curve = Curve::random(&mut rng, tool, 0.04 * share.min(1.0).powi(2));
            curve.tip.iter_mut().for_each(|derivative| *derivative *= other.size_m.min(1.0));
            let Some(expected) = differences(&five, &curve, &c) else { continue };
            let Ok(found) = five.joint_motion(&c, &curve.motion()) else { panic!("{c:?}") };
            seen += 1;
            let size = |v: &SVector<f64, 5>| v.amax().max(1e-3 * curve.turn[0].abs());
            for (i, found) in [found.velocity, found.acceleration].into_iter().enumerate() {
                keep_worst(&mut worst[i], (found - expected[i]).amax() / size(&expected[i]));
            }
        }
        machines += usize::from(seen > before);
    }
    println!("{seen} motions of {machines} machines: velocity and acceleration within {worst:?}");
    assert!(machines > cases(500) * 4 / 5, "{machines}");
    assert!(worst[0] <= 1e-8 && worst[1] <= 1e-5, "{worst:?}");
}

#[test]
fn a_feed_is_as_fast_as_the_slowest_joint_lets_it() {
    let o = Vector3::zeros();
    let along = |speed: f64| {
        let curve = Vector3::new(0.0, speed * speed / 0.1, 0.0);
        ToolMotion { tip_m_per_s: Vector3::new(speed, 0.0, 0.0), axis_per_s: o, tip_m_per_s2: curve, axis_per_s2: o }
    };
    let c = Configuration { beta_rad: Vector2::new(0.3, -0.2), ..HOME };
    let (v, a) = (SVector::from([0.1, 0.1, 0.1, 0.5, 0.5]), SVector::from([1.0, 1.0, 1.0, 5.0, 5.0]));
    let mut limited = [0; 2];
    for speed in [1e-3, 0.05, 0.2, 1.0, 10.0] {
        let joints = FIVE.joint_motion(&c, &along(speed)).unwrap();
        let share = joints.feed_share(&v, &a);
        // at that feed one limit is met, and none exceeded
        let slower = FIVE.joint_motion(&c, &along(share * speed)).unwrap();
        let used = slower.velocity.abs().component_div(&v).max().max(slower.acceleration.abs().component_div(&a).max());
        assert!(if share < 1.0 { (used - 1.0).abs() < 1e-9 } else { used <= 1.0 }, "{speed}: {share} {used}");
        limited[usize::from(share < 1.0)] += 1;
    }
    assert!(limited[0] > 0 && limited[1] > 1, "{limited:?}");
    let joints = FIVE.joint_motion(&c, &along(0.05)).unwrap();
    assert_eq!(joints.feed_share(&SVector::zeros(), &a), 0.0);
    assert_eq!(joints.feed_share(&SVector::repeat(f64::NAN), &a), 0.0);
    // a motion that is no number is none that a joint may make
    for joint in 0..5 {
        let mut unknown = joints;
        unknown.velocity[joint] = f64::NAN;
        assert_eq!(unknown.feed_share(&v, &a), 0.0);
        unknown = joints;
        unknown.acceleration[joint] = f64::NAN;
        assert_eq!(unknown.feed_share(&v, &a), 0.0);
    }

    let nan = ToolMotion { axis_per_s: Vector3::repeat(f64::NAN), ..along(1.0) };
    assert_eq!(FIVE.joint_motion(&c, &nan), Err(ToolError::NotFinite));
    assert_eq!(FIVE.joint_motion(&c, &along(1e200)), Err(ToolError::NotFinite));
    let singular = Configuration { beta_rad: Vector2::new(0.0, 0.45), ..HOME };
    assert!(matches!(FIVE.normalised_determinant(&singular), Ok(..0.1)));
    assert_eq!(FIVE.joint_motion(&singular, &along(1.0)), Err(ToolError::Singular));
    let turned = Configuration { beta_rad: Vector2::new(2.0, 0.0), ..HOME };
    assert_eq!(FIVE.joint_motion(&turned, &along(1.0)), Err(ToolError::WristLimit { joint: 1 }));
}

#[test]
fn a_joint_goes_as_far_from_rest_to_rest_as_its_limits_let_it() {
    let (mut rng, mut ramps, mut worst) = (seeded(), 0, 0.0_f64);
    for _ in 0..cases(1000) {
        let [way, velocity, acceleration] = [0; 3].map(|_| 10_f64.powf(between(&mut rng, -3.0, 1.0)));
        let time = rest_to_rest_s(-way, velocity, acceleration);
        // as fast as it gets in half of the time, for the time without one ramp
        let peak = velocity.min(0.5 * time * acceleration);
        keep_worst(&mut worst, (peak * (time - peak / acceleration) / way - 1.0).abs());
        ramps += usize::from(peak < velocity);
        let single = f64::from(rest_to_rest_s(way as f32, velocity as f32, acceleration as f32));
        assert!((single / time - 1.0).abs() < 1e-6, "{way} {velocity} {acceleration}");
    }
    assert!(worst < 1e-14 && ramps > cases(100), "{worst} {ramps}");
    assert_eq!(rest_to_rest_s(0.0, 1.0, 1.0), 0.0);
}

/// Of the tip's distance, and home's Z0 times the axis's.
fn size([tip, axis]: [f64; 2]) -> f64 {
    tip + WRIST.home_z0_m * axis
}

#[test]
fn a_compensation_with_too_few_tries_says_what_remains() {
    let mut rng = seeded();
    let clearance = PARAMETERS.effects.with("clearance", [4e-3, 3.0]).unwrap();
    let loose = Machine::<f64>::new(&MachineParameters { effects: clearance, ..PARAMETERS }).expect("a machine");
    let (mut given, mut converged, mut few) = (0, 0, 0);
    for n in 0..cases(1000) {
        let machine = if n % 2 == 0 { &loose } else { &MACHINE_F64 };
        let five = FiveAxis { machine, wrist: &WRIST_F64 };
        let c = in_box(&mut rng);
        let target = five.tool(&c).expect("a tool");
        // up to some centimetres and degrees away, which takes many looks
        let away = |rng: &mut Rng| between(rng, -0.05, 0.05);
        let Pose { theta_rad, sigma_rad, z0_m } = c.pose;
        let pose = Pose { theta_rad: theta_rad + away(&mut rng), sigma_rad: sigma_rad + away(&mut rng), z0_m };
        let near = Configuration { pose, beta_rad: c.beta_rad.map(|b| b + 10.0 * away(&mut rng)) };
        let w = wrench(&mut rng, if n % 2 == 0 { 20.0 } else { 2e4 }, 1.0);
        let Ok(found) = five.compensated(Some(&TABLE_F64), &target, &w, &near) else { continue };
        given += 1;
        let there = five.tool(&found.solution.configuration).expect("a tool");
        let d = five.deflection(Some(&TABLE_F64), &found.solution.configuration, &w).expect("a deflection");
        assert_eq!(d, found.deflection);
        let deflection = size([d.translation_m.norm(), d.rotation_rad.cross(&there.axis).norm()]);
        let off = [
            there.tip_m + d.translation_m - target.tip_m,
            there.axis + d.rotation_rad.cross(&there.axis) - target.axis,
        ];
        let remains = size(off.map(|v| v.norm()));
        let second_order = deflection * deflection / WRIST.home_z0_m;
        assert!((remains - found.remaining_m).abs() <= 1e-10 + 1.5 * second_order, "{remains} {found:?}");
        // better than nothing, whatever was left of the tries
        let held = five.inverse(&target, &near).expect("the first try").configuration;
        let bent = five.deflection(Some(&TABLE_F64), &held, &w).expect("a deflection");
        let bent = size([bent.translation_m.norm(), bent.rotation_rad.cross(&target.axis).norm()]);
        assert!(found.remaining_m <= bent * (1.0 + 1e-9), "{found:?} {bent}");
        assert_eq!(found.converged, found.remaining_m <= 1e-4 * deflection, "{found:?}");
        converged += usize::from(found.converged);
        few += usize::from(!found.converged);
    }
    println!("{given} given, {converged} converged, {few} not");
    assert!(converged > given / 10 && few > given / 100, "{given} {converged} {few}");
}

/// Where the Newton step stops, not where rounding does: near the margin the determinant magnifies what a step leaves.
#[test]
fn single_precision_leaves_no_step_undone_near_the_margin() {
    let mut rng = seeded();
    let five = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
    let mut worst = 0.0_f64;
    for _ in 0..cases(20_000) {
        let c = first(|| {
            let beta_rad = Vector2::new(between(&mut rng, -1.5, 1.5), between(&mut rng, 0.0, 0.5));
            let c = Configuration { beta_rad, ..configuration(&mut rng) };
            (matches!(FIVE.normalised_determinant(&c), Ok(0.101..0.15)) && FIVE.tool(&c).is_ok()).then_some(c)
        });
        let tool = FIVE.tool(&c).expect("a tool");
        // so far away that the error is about where the steps end
        let mut off = |size: f64| Vector3::from_fn(|_, _| between(&mut rng, -size, size));
        let (tip_m, axis) = (tool.tip_m + off(1.5e-4), tool.axis + off(1.5e-4));
        let target = Tool { tip_m: tip_m.cast::<f32>(), axis: axis.cast::<f32>() };
        let Pose { theta_rad, sigma_rad, z0_m } = c.pose;
        let pose = Pose { theta_rad: theta_rad as f32, sigma_rad: sigma_rad as f32, z0_m: z0_m as f32 };
        let near = Configuration { pose, beta_rad: c.beta_rad.cast::<f32>() };
        let Ok(solution) = five.inverse(&target, &near) else { continue };
        let Configuration { pose, beta_rad } = solution.configuration;
        let wide = Configuration {
            pose: Pose { theta_rad: pose.theta_rad.into(), sigma_rad: pose.sigma_rad.into(), z0_m: pose.z0_m.into() },
            beta_rad: beta_rad.map(f64::from),
        };
        let asked = Tool { tip_m: target.tip_m.cast::<f64>(), axis: target.axis.cast::<f64>() };
        let Ok(stands) = FIVE.tool(&wide) else { continue };
        worst = worst.max((stands.tip_m - asked.tip_m).norm());
    }
    println!("tip within {worst:e} m");
    assert!(worst < 4e-7, "{worst:e}");
}

#[test]
fn single_precision_follows() {
    let mut rng = seeded();
    let five = FiveAxis { machine: &MACHINE_F32, wrist: &WRIST_F32 };
    let near = Configuration { pose: Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 }, beta_rad: Vector2::zeros() };
    let (mut worst, mut left): ([f64; 2], f64) = ([0.0; 2], 0.0);
    for _ in 0..cases(5000) {
        let c = in_box(&mut rng);
        let tool = FIVE.tool(&c).expect("a tool");
        let target = Tool { tip_m: tool.tip_m.cast::<f32>(), axis: tool.axis.cast::<f32>() };
        let Ok(solution) = five.search(&target, &near) else { panic!("{c:?}") };
        let Configuration { pose, beta_rad } = solution.configuration;
        let wide = Configuration {
            pose: Pose { theta_rad: pose.theta_rad.into(), sigma_rad: pose.sigma_rad.into(), z0_m: pose.z0_m.into() },
            beta_rad: beta_rad.map(f64::from),
        };
        let off = apart(&FIVE.tool(&wide).expect("a tool"), &tool);
        worst = [worst[0].max(off[0]), worst[1].max(off[1])];

        let w = wrench(&mut rng, 500.0, 50.0);
        let load = Wrench { force_n: w.force_n.cast::<f32>(), moment_nm: w.moment_nm.cast::<f32>() };
        if let (Ok(single), Ok(double)) = (
            five.compensated(Some(&TABLE_F32), &target, &load, &solution.configuration),
            FIVE.compensated(Some(&TABLE_F64), &tool, &w, &c),
        ) {
            for (a, b) in single.solution.joints.lengths.q_m.iter().zip(&double.solution.joints.lengths.q_m) {
                left = left.max((f64::from(*a) - b).abs());
            }
        }
    }
    println!("tool within {worst:?}, compensated lengths within {left:e} m");
    assert!(worst[0] < 2e-6 && worst[1] < 3e-6 && left < 5e-6, "{worst:?} {left}");
}

#[test]
fn what_cannot_be_is_refused() {
    let tool = FIVE.tool(&HOME).expect("a tool");
    for bad in [f64::NAN, f64::INFINITY] {
        for i in 0..3 {
            let mut t = tool;
            t.tip_m[i] = bad;
            assert_eq!(FIVE.inverse(&t, &HOME), Err(ToolError::NotFinite));
            let mut t = tool;
            t.axis[i] = bad;
            assert_eq!(FIVE.search(&t, &HOME), Err(ToolError::NotFinite));
        }
        let c = Configuration { beta_rad: Vector2::new(0.0, bad), ..HOME };
        assert_eq!(FIVE.inverse(&tool, &c), Err(ToolError::NotFinite));
        assert_eq!(FIVE.frame(&c), Err(ToolError::NotFinite));
        let w = Wrench { force_n: Vector3::new(bad, 0.0, 0.0), moment_nm: Vector3::zeros() };
        assert!(matches!(FIVE.compensated(None, &tool, &w, &HOME), Err(ToolDeflectionError::Stiffness(_))));
        assert_eq!(FIVE.touch(&HOME, &w, 0, 0.0), Err(ToolError::NotFinite));
        assert_eq!(FIVE.touch(&HOME, &Wrench::ZERO, 0, bad), Err(ToolError::NotFinite));
    }
    // a finite load, a finite deflection, and a square of it that is not
    let w = Wrench { force_n: Vector3::new(1e170, 0.0, 0.0), moment_nm: Vector3::zeros() };
    assert!(FIVE.deflection(None, &HOME, &w).is_ok());
    assert!(matches!(FIVE.compensated(None, &tool, &w, &HOME), Err(ToolDeflectionError::Stiffness(_))));
    for (theta_rad, sigma_rad, z0_m) in
        [(1.6, 0.0, -0.5), (0.0, 1.6, 0.5), (0.0, -1.6, 0.5), (0.0, 0.0, -0.5), (0.0, 0.0, 0.0)]
    {
        let near = Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, ..HOME };
        assert_eq!(FIVE.inverse(&tool, &near), Err(ToolError::Unreachable), "{near:?}");
    }
    assert_eq!(FIVE.inverse(&Tool { axis: Vector3::zeros(), ..tool }, &HOME), Err(ToolError::NotFinite));
    let aside = Tool { tip_m: Vector3::new(0.0, 4.0, 0.9), ..tool };
    assert!(matches!(FIVE.search(&aside, &HOME), Err(ToolError::Unreachable | ToolError::Singular)));
    let c = Configuration { beta_rad: Vector2::new(0.0, -1.6), ..HOME };
    assert_eq!(FIVE.frame(&c), Err(ToolError::WristLimit { joint: 2 }));
    let joints = JointValues { lengths: ScrewLengths { q_m: Vector3::repeat(0.9) }, beta_rad: Vector2::zeros() };
    let out_of_travel = ToolError::Kinematics(KinematicsError::OutOfTravel { limb: 1 });
    assert_eq!(FIVE.forward(&joints), Err(out_of_travel));
    // a wrist whose limits exclude what the tool asks for
    let narrow = WristParameters { max_rad: [FRAC_PI_2, -0.1], ..WRIST };
    let wrist = Wrist::<f64>::new(&narrow).expect("a wrist");
    let five = FiveAxis { wrist: &wrist, ..FIVE };
    assert_eq!(five.inverse(&tool, &HOME), Err(ToolError::WristLimit { joint: 2 }));

    for (p, error) in [
        (WristParameters { flange_m: f64::NAN, ..WRIST }, WristError::Flange),
        (WristParameters { max_rad: [1.0, -2.0], ..WRIST }, WristError::Limits { joint: 2 }),
        (WristParameters { min_rad: [-PI - 0.1, 0.0], ..WRIST }, WristError::Limits { joint: 1 }),
        (WristParameters { second_b_m: 0.035, ..WRIST }, WristError::HomeIsSingular),
        (WristParameters { home_z0_m: 0.0, ..WRIST }, WristError::HomeZ0),
        (WristParameters { singularity_margin: 1.0, ..WRIST }, WristError::SingularityMargin),
    ] {
        assert_eq!(Wrist::<f64>::new(&p), Err(error));
    }
}

/// A load that is finite at A may bend a soft machine beyond the greatest number at a far tip.
#[test]
fn a_deflection_that_overflows_is_refused() {
    let mut parameters = PARAMETERS;
    for limb in &mut parameters.limbs {
        for joint in [&mut limb.base_joint, &mut limb.platform_joint] {
            joint.linear_n_per_m = [1e-3; 3];
        }
    }
    let machine = Machine::<f64>::new(&parameters).expect("a machine");
    let wrist = Wrist::<f64>::new(&WristParameters { flange_m: 90.0, ..WRIST }).expect("a wrist");
    let five = FiveAxis { machine: &machine, wrist: &wrist };
    let mut refused = 0;
    for exponent in 290..=305 {
        let load = Wrench { force_n: Vector3::new(10_f64.powi(exponent), 0.0, 0.0), moment_nm: Vector3::zeros() };
        match five.deflection(None, &HOME, &load) {
            Ok(d) => {
                assert!(d.translation_m.iter().chain(&d.rotation_rad).all(|v| v.is_finite()), "1e{exponent} N: {d:?}")
            }
            Err(e) => {
                assert_eq!(e, ToolDeflectionError::Stiffness(StiffnessError::NotFinite.into()));
                refused += 1;
            }
        }
    }
    assert!((1..16).contains(&refused), "{refused}");
}

//! Effects against the frame solver: the whole 6×6, on random machines.

use nalgebra::{Matrix3, Matrix6, Vector3};
use pkm_core::effects::{COUNT, EFFECTS};
use pkm_core::machine::{BodyKind, MachineParameters};
use pkm_core::tables::reference;
use pkm_core::{Machine, Pose, StiffnessError, Wrench};
use pkm_frame::{Frame, Node, Section};
use pkm_tests::{keep_worst, random_parameters, random_pose, scaled_difference, seeded};

/// A parameter of an effect, by its names in files.
fn amplitude(parameters: &MachineParameters, id: &str, name: &str) -> f64 {
    let effect = EFFECTS.iter().position(|e| e.id == id).unwrap_or_else(|| panic!("no effect {id}"));
    let parameter = EFFECTS[effect].parameters.iter().position(|p| *p == name).unwrap();
    parameters.effects.parameters[effect][parameter]
}

fn softened(stiffness: f64, compliance: f64) -> f64 {
    if stiffness == 0.0 { 0.0 } else { 1.0 / (1.0 / stiffness + compliance) }
}

/// A machine as a frame in A-uvw, A at the origin.
struct Assembled {
    frame: Frame,
    /// What the tool sits on.
    tool: Node,
    /// Ends of the limbs' bodies, their directions and EA/q.
    limbs: Vec<(Node, Node, Vector3<f64>, f64)>,
}

/// The machine with its effects, and with more compliance along each limb.
fn assemble(m: &MachineParameters, pose: &Pose<f64>, along: [f64; 3]) -> Assembled {
    let more_along = along;
    let mut limbs = Vec::new();
    let p = |id: &str, name: &str| amplitude(m, id, name);
    let g = &m.geometry;
    // B-xyz as seen from A-uvw
    let rotation = nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * nalgebra::Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad);
    let a_in_b = Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m);
    let seen = |point: Vector3<f64>| rotation.inverse() * (point - a_in_b);
    let turned = |axis: Vector3<f64>| rotation.inverse() * axis;
    let (x_b, y_b) = (turned(Vector3::x()), turned(Vector3::y()));
    let base = [Vector3::new(0.0, -g.b1_m, 0.0), Vector3::new(0.0, g.b1_m, 0.0), Vector3::new(g.b2_m, 0.0, 0.0)];
    let base = base.map(seen);
    let platform = [Vector3::new(0.0, -g.a1_m, 0.0), Vector3::new(0.0, g.a1_m, 0.0), Vector3::new(g.a2_m, 0.0, 0.0)];

    let mut frame = Frame::new();
    let mount = if p("base-compliance", "mount_m_per_n") > 0.0 {
        let mount = frame.node(seen(Vector3::zeros()));
        let (linear, angular) =
            (1.0 / p("base-compliance", "mount_m_per_n"), 1.0 / p("base-compliance", "mount_rad_per_nm"));
        let axes = Matrix3::from_columns(&[x_b, y_b, x_b.cross(&y_b)]);
        let stiffness = [linear, linear, linear, angular, angular, angular];
        frame.joint(Frame::GROUND, mount, seen(Vector3::zeros()), &axes, stiffness);
        mount
    } else {
        Frame::GROUND
    };
    // what limbs 1 and 2 stand on: carried by the mount, moving along z of B together and against each other
    let stands = if p("limb-coupling", "together_m_per_n") > 0.0 {
        let z_b = x_b.cross(&y_b);
        let stands = [frame.node(base[0]), frame.node(base[1])];
        let spring = |name: &str| 1.0 / p("limb-coupling", name);
        let shapes = [(vec![z_b, z_b], spring("together_m_per_n")), (vec![z_b, -z_b], spring("opposed_m_per_n"))];
        frame.modes(mount, &stands, &shapes);
        stands
    } else {
        [mount; 2]
    };
    let centre = frame.node(Vector3::zeros());
    let arm = "moving-platform-compliance";
    let elastic_arms = p(arm, "bending_per_nm2") > 0.0;
    for i in 0..3 {
        let limb = &m.limbs[i];
        let along = platform[i] - base[i];
        let (q, z) = (along.norm(), along.normalize());
        let x = if i == 2 { y_b } else { Vector3::x() };
        let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
        let base_axes = if i == 2 { axes } else { Matrix3::from_columns(&[x, y_b, x.cross(&y_b)]) };

        // what gives at one point along the same axes is in a row
        let (at_base, at_platform) =
            if i == 2 { ("revolute-3-joint", "spherical-joint") } else { ("universal-joint", "revolute-joint") };
        let radial = p(at_base, "radial_m_per_n") + p("base-compliance", "under_joints_m_per_n");
        let tilting = p(at_base, "tilting_rad_per_nm");
        let [kx, ky, kz] = limb.base_joint.linear_n_per_m.map(|k| softened(k, radial));
        let [ku, kv, kw] = limb.base_joint.angular_nm_per_rad.map(|k| softened(k, tilting));
        let foot = frame.node(base[i]);
        let stand = stands.get(i).copied().unwrap_or(mount);
        frame.joint(stand, foot, base[i], &base_axes, [kx, ky, kz, ku, kv, kw]);

        let (mut ea, mut ei, mut gj) = (0.0, 0.0, 0.0);
        for t in [&limb.body.rod, &limb.body.screw] {
            let pi = std::f64::consts::PI;
            ea += t.young_pa * pi * (t.outer_m.powi(2) - t.inner_m.powi(2)) / 4.0;
            ei += t.young_pa * pi * (t.outer_m.powi(4) - t.inner_m.powi(4)) / 64.0;
            gj += t.shear_pa * pi * (t.outer_m.powi(4) - t.inner_m.powi(4)) / 32.0;
        }
        let tube = Section { ea_n: ea, ei_nm2: (ei, ei), gj_nm2: gj };
        let head = frame.node(platform[i]);
        let tube_m = p("telescopic-limb", "tube_m");
        if tube_m > 0.0 && tube_m < q {
            let ram_ei = softened(ei, p("telescopic-limb", "ram_bending_per_nm2"));
            let end = base[i] + z * tube_m;
            let (outer, inner) = (frame.node(end), frame.node(end));
            frame.beam(foot, outer, x, &tube);
            frame.beam(inner, head, x, &Section { ei_nm2: (ram_ei, ram_ei), ..tube });
            frame.hinge(inner, outer, [x, z.cross(&x)]);
            let tilt = 1.0 / p("telescopic-limb", "guide_rad_per_nm");
            frame.joint(outer, inner, end, &axes, [0.0, 0.0, 0.0, tilt, tilt, 0.0]);
        } else {
            frame.beam(foot, head, x, &tube);
        }

        let extra = p(at_platform, "radial_m_per_n");
        let tilting = if i == 2 { 0.0 } else { p(at_platform, "tilting_rad_per_nm") };
        let drive = p(["limb-1-axial", "limb-2-axial", "limb-3-axial"][i], "axial_m_per_n")
            + p("screw-position", "axial_per_n") * q
            + more_along[i];
        limbs.push((foot, head, z, ea / q));
        let [kx, ky, kz] = limb.platform_joint.linear_n_per_m;
        let [ku, kv, kw] = limb.platform_joint.angular_nm_per_rad.map(|k| softened(k, tilting));
        let stiffness = [softened(kx, extra), softened(ky, extra), softened(kz, extra + drive), ku, kv, kw];
        if elastic_arms {
            let hub = frame.node(platform[i]);
            let section = Section {
                ea_n: 0.0,
                ei_nm2: (1.0 / p(arm, "in_plane_per_nm2"), 1.0 / p(arm, "bending_per_nm2")),
                gj_nm2: 1.0 / p(arm, "torsion_per_nm2"),
            };
            frame.beam(centre, hub, Vector3::z(), &section);
            frame.tie(hub, centre, if i == 2 { 0 } else { 1 });
            frame.joint(head, hub, platform[i], &axes, stiffness);
        } else {
            frame.joint(head, centre, platform[i], &axes, stiffness);
        }
    }
    if p("wrist-compliance", "linear_m_per_n") == 0.0 {
        return Assembled { frame, tool: centre, limbs };
    }
    let tool = frame.node(Vector3::zeros());
    let (linear, angular) =
        (1.0 / p("wrist-compliance", "linear_m_per_n"), 1.0 / p("wrist-compliance", "angular_rad_per_nm"));
    let stiffness = [linear, linear, linear, angular, angular, angular];
    frame.joint(centre, tool, Vector3::zeros(), &Matrix3::identity(), stiffness);
    Assembled { frame, tool, limbs }
}

#[test]
fn every_linear_effect_equals_the_frame_solver() {
    let mut rng = seeded();
    let mut worst = [0.0_f64; COUNT + 2];
    for n in 0..400 {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        // none, each alone, all together
        let which = n % (COUNT + 2);
        for (i, effect) in EFFECTS.iter().enumerate() {
            if which != i + 1 && which != COUNT + 1 {
                continue;
            }
            for (j, name) in effect.parameters.iter().enumerate() {
                // load-dependent ones have no part in K
                if ["clearance", "contact-stiffening"].contains(&effect.id) {
                    continue;
                }
                let share = 0.1 + rng.f64();
                parameters.effects.parameters[i][j] = share
                    * match name.rsplit_once('_').map(|(_, unit)| unit) {
                        Some("m") => 0.7 * size,
                        _ if name.ends_with("rad_per_nm") => 1e-6,
                        _ if name.ends_with("per_nm2") => 1e-5,
                        _ => 1e-9,
                    };
            }
        }
        let machine = Machine::<f64>::new(&parameters).unwrap();
        // nearer to a singularity the frame solver itself is no better than 1e-8
        let pose = random_pose(&mut rng, &machine, size, 0.3);
        let Assembled { frame, tool, .. } = assemble(&parameters, &pose, [0.0; 3]);
        let compliance = frame.compliance(tool).unwrap_or_else(|| panic!("a mechanism: {which}"));
        let reference: Matrix6<f64> = compliance.try_inverse().unwrap();
        let k = machine.stiffness(&pose).unwrap().matrix();
        keep_worst(&mut worst[which], scaled_difference(&k, &reference.into()));
    }
    for (which, error) in worst.iter().enumerate() {
        let name = which.checked_sub(1).and_then(|i| EFFECTS.get(i)).map_or("none or all", |e| e.id);
        println!("{name}: {error:.1e}");
    }
    for error in worst {
        assert!(error <= 1e-8, "{error:e}");
    }
}

/// ε(N) of the load-dependent effects, from their definitions.
fn elongation(m: &MachineParameters, n: f64) -> f64 {
    let p = |id: &str, name: &str| amplitude(m, id, name);
    let play = 0.5 * p("clearance", "play_m") * n / n.hypot(p("clearance", "taken_up_n"));
    let x = n / p("contact-stiffening", "reference_n");
    play + p("contact-stiffening", "unloaded_m_per_n") * n * (1.0 + x * x).powf(-1.0 / 6.0)
}

/// The same by secants: every limb gets the compliance ε(N)/N of the force found last, until nothing moves.
#[test]
fn load_dependent_effects_equal_the_frame_solver_with_secant_springs() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    let mut share = (f64::INFINITY, 0.0_f64);
    for n in 0..40 {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let mut set = |id: &str, values: [f64; 3]| {
            parameters.effects = parameters.effects.with(id, values).unwrap();
        };
        // others beside them in every second machine
        if n % 2 == 0 {
            set("limb-coupling", [1e-9, 2e-9, 0.0]);
            set("base-compliance", [1e-9, 1e-7, 1e-9]);
            set("limb-2-axial", [1e-9, 0.0, 0.0]);
        }
        set("clearance", [60e-6 * rng.f64(), 5.0 + 50.0 * rng.f64(), 0.0]);
        set("contact-stiffening", [2e-8 * rng.f64(), 20.0 + 500.0 * rng.f64(), 0.0]);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, size, 0.2);
        let mut between = |limit: f64| limit * (2.0 * rng.f64() - 1.0);
        let load: [f64; 6] = std::array::from_fn(|i| between(if i < 3 { 1000.0 } else { 200.0 * size }));
        let wrench = Wrench { force_n: [load[0], load[1], load[2]], moment_nm: [load[3], load[4], load[5]] };

        let mut secants = [0.0; 3];
        let mut found = Vector3::zeros();
        for _ in 0..2000 {
            let a = assemble(&parameters, &pose, secants);
            let u = a.frame.displacements(a.tool, load).unwrap();
            let tensions: Vec<f64> = a
                .limbs
                .iter()
                .map(|(foot, head, z, k)| z.dot(&(Frame::of(&u, *head) - Frame::of(&u, *foot))) * k)
                .collect();
            let next: [f64; 3] = std::array::from_fn(|i| {
                let n = if tensions[i].abs() < 1e-9 { 1e-9 } else { tensions[i] };
                0.5 * (secants[i] + elongation(&parameters, n) / n)
            });
            let change = (0..3).map(|i| (next[i] - secants[i]).abs() / next[i]).fold(0.0, f64::max);
            (secants, found) = (next, Frame::of(&u, a.tool));
            if change < 1e-13 {
                break;
            }
        }
        let linear = machine.stiffness(&pose).unwrap().factor().unwrap().deflection(&wrench).unwrap();
        let extra = machine.load_dependent_deflection(&pose, &wrench).unwrap();
        let sum = Vector3::from(linear.translation_m) + Vector3::from(extra.translation_m);
        keep_worst(&mut worst, (sum - found).norm() / found.norm());
        let part = Vector3::from(extra.translation_m).norm() / found.norm();
        share = (share.0.min(part), share.1.max(part));
    }
    println!("load-dependent: {worst:.1e}; they make {:.2} to {:.2} of the deflection", share.0, share.1);
    assert!(worst <= 1e-8, "{worst:e}");
    assert!(share.1 > 0.05, "nothing to see");
}

#[test]
fn load_dependent_deflection_in_single_precision_and_its_refusals() {
    let effects = reference::PARAMETERS.effects.with("clearance", [20e-6, 10.0, 0.0]).unwrap();
    let effects = effects.with("contact-stiffening", [5e-9, 100.0, 0.0]).unwrap();
    let parameters = MachineParameters { effects, ..reference::PARAMETERS };
    let (double, single) = (Machine::<f64>::new(&parameters).unwrap(), Machine::<f32>::new(&parameters).unwrap());
    let mut worst = 0.0_f64;
    let mut rng = seeded();
    let mut within = |middle: f64, half: f64| middle + half * (2.0 * rng.f64() - 1.0);
    for _ in 0..1000 {
        let pose = Pose { theta_rad: within(0.0, 0.26), sigma_rad: within(0.0, 0.26), z0_m: within(0.53, 0.03) };
        let narrow =
            Pose { theta_rad: pose.theta_rad as f32, sigma_rad: pose.sigma_rad as f32, z0_m: pose.z0_m as f32 };
        let force_n: [f64; 3] = std::array::from_fn(|_| within(0.0, 1000.0));
        let wide = Wrench { force_n, moment_nm: [0.0; 3] };
        let slim = Wrench { force_n: force_n.map(|f| f as f32), moment_nm: [0.0; 3] };
        let whole = |k: pkm_core::Stiffness<f64>| k.factor().unwrap().deflection(&wide).unwrap();
        let extra = double.load_dependent_deflection(&pose, &wide).unwrap();
        let expected = Vector3::from(whole(double.stiffness(&pose).unwrap()).plus(&extra).translation_m);
        let linear = single.stiffness(&narrow).unwrap().factor().unwrap().deflection(&slim).unwrap();
        let extra = single.load_dependent_deflection(&narrow, &slim).unwrap();
        let found = linear.plus(&extra).translation_m.map(f64::from);
        keep_worst(&mut worst, (Vector3::from(found) - expected).norm() / expected.norm());
    }
    println!("f32 load-dependent: {worst:.1e}");
    assert!(worst <= 1e-4, "{worst:e}");
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 };
    let bad = Wrench { force_n: [f64::NAN, 0.0, 0.0], moment_nm: [0.0; 3] };
    assert_eq!(double.load_dependent_deflection(&pose, &bad), Err(StiffnessError::NotFinite));
}

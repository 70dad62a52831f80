//! Effects against the frame solver: the whole 6×6, on random machines.

use nalgebra::{Matrix3, Matrix6, Vector3};
use pkm_core::effects::{COUNT, EFFECTS};
use pkm_core::machine::{BodyKind, MachineParameters};
use pkm_core::{Machine, Pose};
use pkm_frame::{Frame, Node, Section};
use pkm_tests::{random_parameters, random_pose, scaled_difference, seeded};

/// A parameter of an effect, by its names in files.
fn amplitude(parameters: &MachineParameters, id: &str, name: &str) -> f64 {
    let effect = EFFECTS.iter().position(|e| e.id == id).unwrap_or_else(|| panic!("no effect {id}"));
    let parameter = EFFECTS[effect].parameters.iter().position(|p| *p == name).unwrap();
    parameters.effects.parameters[effect][parameter]
}

fn softened(stiffness: f64, compliance: f64) -> f64 {
    if stiffness == 0.0 { 0.0 } else { 1.0 / (1.0 / stiffness + compliance) }
}

/// The machine with its effects as a frame in A-uvw, A at the origin. Returns the node that the tool sits on.
fn assemble(m: &MachineParameters, pose: &Pose<f64>) -> (Frame, Node) {
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
            + p("screw-position", "axial_per_n") * q;
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
        return (frame, centre);
    }
    let tool = frame.node(Vector3::zeros());
    let (linear, angular) =
        (1.0 / p("wrist-compliance", "linear_m_per_n"), 1.0 / p("wrist-compliance", "angular_rad_per_nm"));
    let stiffness = [linear, linear, linear, angular, angular, angular];
    frame.joint(centre, tool, Vector3::zeros(), &Matrix3::identity(), stiffness);
    (frame, tool)
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
        let pose = random_pose(&mut rng, &machine, size, 0.2);
        let (frame, tool) = assemble(&parameters, &pose);
        let compliance = frame.compliance(tool).unwrap_or_else(|| panic!("a mechanism: {which}"));
        let reference: Matrix6<f64> = compliance.try_inverse().unwrap();
        let k = machine.stiffness(&pose).unwrap().matrix();
        worst[which] = worst[which].max(scaled_difference(&k, &reference.into()));
    }
    for (which, error) in worst.iter().enumerate() {
        let name = which.checked_sub(1).and_then(|i| EFFECTS.get(i)).map_or("none or all", |e| e.id);
        println!("{name}: {error:.1e}");
    }
    for error in worst {
        assert!(error <= 1e-8, "{error:e}");
    }
}

//! Effects against the frame solver: the whole 6×6, on random machines.

use nalgebra::{DMatrix, Matrix3, Matrix6, Rotation3, Vector3};
use pkm_core::effects::{COUNT, EFFECTS, Effects, Expected, Law, MAX_PARAMETERS, Place};
use pkm_core::machine::{BodyKind, Geometry, MachineError, MachineParameters, Parameter, Problem};
use pkm_core::stiffness::LoadHistory;
use pkm_core::tables::reference;
use pkm_core::{Machine, Pose, ScrewLengths, StiffnessError, TemperatureError, TemperatureRise, Wrench};
use pkm_frame::{Frame, Node, Section};
use pkm_tests::single::narrow_pose;
use pkm_tests::{between, cases, keep_worst, random_parameters, random_pose, scaled_difference, seeded};

/// A parameter of an effect, by its names in files.
fn amplitude(parameters: &MachineParameters, id: &str, name: &str) -> f64 {
    let effect = EFFECTS.iter().position(|e| e.id == id).unwrap_or_else(|| panic!("no effect {id}"));
    let parameter = EFFECTS[effect].names().position(|p| p == name).unwrap();
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

/// R and A in B-xyz.
fn placed(pose: &Pose<f64>) -> (Rotation3<f64>, Vector3<f64>) {
    let rotation = Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad);
    (rotation, Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m))
}

fn triangle(half: f64, far: f64) -> [Vector3<f64>; 3] {
    [Vector3::new(0.0, -half, 0.0), Vector3::new(0.0, half, 0.0), Vector3::new(far, 0.0, 0.0)]
}

fn lengths_in_space(g: &Geometry, pose: &Pose<f64>) -> Vector3<f64> {
    let (rotation, a) = placed(pose);
    let (platform, base) = (triangle(g.a1_m, g.a2_m), triangle(g.b1_m, g.b2_m));
    Vector3::from_fn(|i, _| (a + rotation * platform[i] - base[i]).norm())
}

/// Platform sizes with their errors.
fn true_geometry(m: &MachineParameters) -> Geometry {
    let (g, error) = (&m.geometry, |size: &str| amplitude(m, &format!("geometry-{size}"), "error_m"));
    Geometry {
        a1_m: g.a1_m + error("a1"),
        a2_m: g.a2_m + error("a2"),
        b1_m: g.b1_m + error("b1"),
        b2_m: g.b2_m + error("b2"),
    }
}

/// The pose near another at which a geometry has given lengths, by Newton steps with slopes from differences.
fn pose_at(g: &Geometry, lengths: Vector3<f64>, near: &Pose<f64>) -> Pose<f64> {
    let of = |x: &Vector3<f64>| Pose { theta_rad: x[0], sigma_rad: x[1], z0_m: x[2] };
    let mut x = Vector3::new(near.theta_rad, near.sigma_rad, near.z0_m);
    for _ in 0..30 {
        let columns: [Vector3<f64>; 3] = std::array::from_fn(|i| {
            let h = Vector3::ith(i, 1e-6);
            (lengths_in_space(g, &of(&(x + h))) - lengths_in_space(g, &of(&(x - h)))) / 2e-6
        });
        let residual = lengths_in_space(g, &of(&x)) - lengths;
        if residual.norm() == 0.0 {
            break;
        }
        x -= Matrix3::from_columns(&columns).lu().solve(&residual).unwrap();
    }
    of(&x)
}

/// The machine with its effects at a temperature, and with more compliance along each limb. Everything in A-uvw of the
/// commanded pose, but from the A that the true geometry has.
fn assemble(m: &MachineParameters, pose: &Pose<f64>, along: [f64; 3], temperature_c: f64) -> Assembled {
    let more_along = along;
    let mut limbs = Vec::new();
    let p = |id: &str, name: &str| amplitude(m, id, name);
    let g = &true_geometry(m);
    let true_pose = pose_at(g, lengths_in_space(&m.geometry, pose), pose);
    let (commanded, _) = placed(pose);
    let (rotation, a_in_b) = placed(&true_pose);
    let seen = |point: Vector3<f64>| commanded.inverse() * (point - a_in_b);
    let turned = |axis: Vector3<f64>| commanded.inverse() * axis;
    let (x_b, y_b) = (turned(Vector3::x()), turned(Vector3::y()));
    let base = triangle(g.b1_m, g.b2_m).map(seen);
    let (u, w) = (turned(rotation * Vector3::x()), turned(rotation * Vector3::z()));
    let mut platform = triangle(g.a1_m, g.a2_m).map(|point| turned(rotation * point));
    platform[0] += w * p("platform-offset", "limbs_1_2_m");
    platform[1] += w * p("platform-offset", "limbs_1_2_m");
    platform[2] += w * p("platform-offset", "limb_3_m");
    let left = |rate: &str| 1.0 - p("thermal-modulus", rate) * (temperature_c - 20.0);
    let (left_of_bodies, left_of_joints) = (left("bodies_per_k"), left("joints_per_k"));

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
    let bridge = if elastic_arms {
        let bridge = frame.node(Vector3::zeros());
        frame.modes(centre, &[bridge], &[(vec![w], 1.0 / p(arm, "bridge_m_per_n"))]);
        bridge
    } else {
        centre
    };
    for i in 0..3 {
        let limb = &m.limbs[i];
        let along = platform[i] - base[i];
        let (q, z) = (along.norm(), along.normalize());
        let x = if i == 2 { (y_b - z * z.dot(&y_b)).normalize() } else { u };
        let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
        let base_axes = if i == 2 { axes } else { Matrix3::from_columns(&[x, y_b, x.cross(&y_b)]) };

        // what gives at one point along the same axes is in a row
        let (at_base, at_platform) =
            if i == 2 { ("revolute-3-joint", "spherical-joint") } else { ("universal-joint", "revolute-joint") };
        let radial = p(at_base, "radial_m_per_n") + p("base-compliance", "under_joints_m_per_n");
        let tilting = p(at_base, "tilting_rad_per_nm");
        let [kx, ky, kz] = limb.base_joint.linear_n_per_m.map(|k| softened(k * left_of_joints, radial));
        let [ku, kv, kw] = limb.base_joint.angular_nm_per_rad.map(|k| softened(k * left_of_joints, tilting));
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
        let [ea, ei, gj] = [ea, ei, gj].map(|k| k * left_of_bodies);
        let tube = Section { ea_n: ea, ei_nm2: (ei, ei), gj_nm2: gj };
        let head = frame.node(platform[i]);
        let tube_m = p("telescopic-limb", "tube_m");
        let aside = x * p("platform-offset", ["aside_1_m", "aside_2_m", "aside_3_m"][i]);
        if tube_m > 0.0 && tube_m < q {
            let ram_ei = softened(ei, p("telescopic-limb", "ram_bending_per_nm2"));
            let ram_gj = softened(gj, p("telescopic-limb", "ram_torsion_per_nm2"));
            let overlap = (tube_m + p("telescopic-limb", "ram_m") - q).max(0.01).min(tube_m);
            let [inner, outer] = [tube_m - overlap, tube_m].map(|s| base[i] + aside + z * s);
            let tube_outer = frame.node(outer);
            let (ram_inner, ram_outer) = (frame.node(inner), frame.node(outer));
            let (first, last) = if aside.norm() > 0.0 {
                (frame.node(base[i] + aside), frame.node(platform[i] + aside))
            } else {
                (foot, head)
            };
            // half of the tube's torsion sits where the ram is keyed to it
            let sleeve = Section { gj_nm2: 2.0 * gj, ..tube };
            let ram = Section { ei_nm2: (ram_ei, ram_ei), gj_nm2: ram_gj, ..tube };
            let tube_inner = if overlap < tube_m {
                let tube_inner = frame.node(inner);
                frame.beam(first, tube_inner, x, &sleeve);
                tube_inner
            } else {
                first
            };
            frame.beam(tube_inner, tube_outer, x, &sleeve);
            frame.beam(ram_inner, ram_outer, x, &ram);
            frame.beam(ram_outer, last, x, &ram);
            frame.tie(ram_outer, tube_outer, z);
            let guide = 1.0 / p("telescopic-limb", "guide_m_per_n");
            frame.joint(tube_inner, ram_inner, inner, &axes, [guide, guide, 0.0, 0.0, 0.0, 0.0]);
            frame.joint(tube_outer, ram_outer, outer, &axes, [guide, guide, 0.0, 0.0, 0.0, 2.0 * gj / tube_m]);
            if aside.norm() > 0.0 {
                frame.weld(first, foot);
                frame.weld(last, head);
            }
        } else if aside.norm() > 0.0 {
            let (first, last) = (frame.node(base[i] + aside), frame.node(platform[i] + aside));
            frame.beam(first, last, x, &tube);
            frame.weld(first, foot);
            frame.weld(last, head);
        } else {
            frame.beam(foot, head, x, &tube);
        }

        let extra = p(at_platform, "radial_m_per_n");
        let tilting = if i == 2 { 0.0 } else { p(at_platform, "tilting_rad_per_nm") };
        let drive = p(["limb-1-axial", "limb-2-axial", "limb-3-axial"][i], "axial_m_per_n")
            + (p("screw-position", "axial_per_n") + p("telescopic-limb", "screw_axial_per_n")) * q
            + more_along[i];
        limbs.push((foot, head, z, ea / q));
        let [kx, ky, kz] = limb.platform_joint.linear_n_per_m.map(|k| k * left_of_joints);
        let [ku, kv, kw] = limb.platform_joint.angular_nm_per_rad.map(|k| softened(k * left_of_joints, tilting));
        let stiffness = [softened(kx, extra), softened(ky, extra), softened(kz, extra + drive), ku, kv, kw];
        if elastic_arms {
            let hub = frame.node(platform[i]);
            let section = Section {
                ea_n: 0.0,
                ei_nm2: (1.0 / p(arm, "in_plane_per_nm2"), 1.0 / p(arm, "bending_per_nm2")),
                gj_nm2: 1.0 / p(arm, "torsion_per_nm2"),
            };
            let root = if i == 2 { centre } else { bridge };
            frame.beam(root, hub, w, &section);
            frame.tie(hub, root, platform[i].normalize());
            frame.joint(head, hub, platform[i], &axes, stiffness);
        } else {
            frame.joint(head, centre, platform[i], &axes, stiffness);
        }
        // a limb under tension is a pendulum to what it holds
        let tension = p("preload", if i == 2 { "limb_3_n" } else { "limbs_1_2_n" });
        frame.joint(mount, centre, platform[i], &axes, [0.0, tension / q, 0.0, 0.0, 0.0, 0.0]);
    }
    let hub_compliance = p(arm, "hub_rad_per_nm");
    let centre = if hub_compliance > 0.0 {
        let hub = frame.node(Vector3::zeros());
        for axis in [Vector3::x(), Vector3::y(), Vector3::z()] {
            frame.tie(hub, centre, axis);
        }
        let angular = 1.0 / hub_compliance;
        let stiffness = [0.0, 0.0, 0.0, angular, angular, angular];
        frame.joint(centre, hub, Vector3::zeros(), &Matrix3::identity(), stiffness);
        hub
    } else {
        centre
    };
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
    for n in 0..cases(20) * (COUNT + 2) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        // none, each alone, all together
        let which = n % (COUNT + 2);
        for (i, effect) in EFFECTS.iter().enumerate() {
            if which != i + 1 && which != COUNT + 1 {
                continue;
            }
            for (j, name) in effect.names().enumerate() {
                // bodies aside are the declared ones, not those of a telescope
                if which == COUNT + 1 && name.starts_with("aside") {
                    continue;
                }
                // load-dependent ones have no part in K
                if ["clearance", "contact-stiffening", "friction-hysteresis"].contains(&effect.id) {
                    continue;
                }
                // with all that is soft together a limb under pressure might buckle
                let signed = effect.signed && !(which == COUNT + 1 && effect.id == "preload");
                let share = (0.1 + rng.f64()) * if signed && rng.bool() { -1.0 } else { 1.0 };
                let g = &parameters.geometry;
                parameters.effects.parameters[i][j] = share
                    * match name.rsplit_once('_').map(|(_, unit)| unit) {
                        _ if name == "error_m" => 0.03 * g.a1_m.min(g.a2_m).min(g.b1_m).min(g.b2_m),
                        Some("m") if effect.id == "platform-offset" => 0.04 * size,
                        Some("m") => 0.7 * size,
                        _ if effect.id == "preload" => 1e3 * size,
                        Some("k") => 5e-4,
                        _ if name.ends_with("rad_per_nm") => 1e-6,
                        _ if name.ends_with("per_nm2") => 1e-5,
                        _ => 1e-9,
                    };
            }
        }
        let machine = Machine::<f64>::new(&parameters).unwrap();
        // nearer to a singularity the frame solver itself is no better than 1e-8
        let pose = random_pose(&mut rng, &machine, size, 0.3);
        // a ram that overlaps a tube by a good part of the tube: a stub would cost the frame solver its digits
        let telescope = EFFECTS.iter().position(|e| e.id == "telescopic-limb").unwrap();
        let [tube_m, ram_m, ..] = &mut parameters.effects.parameters[telescope];
        if *tube_m > 0.0 {
            let longest = machine.inverse(&pose).unwrap().q_m.max();
            *ram_m = longest - (0.3 + 0.4 * rng.f64()) * *tube_m;
        }
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let temperature = 20.0 + 50.0 * (2.0 * rng.f64() - 1.0);
        let Assembled { frame, tool, .. } = assemble(&parameters, &pose, [0.0; 3], temperature);
        let compliance = frame.compliance(tool).unwrap_or_else(|| panic!("a mechanism: {which}"));
        let reference: Matrix6<f64> = compliance.try_inverse().unwrap();
        let k = machine.at_temperature(temperature).unwrap().stiffness(&pose).unwrap().matrix();
        keep_worst(&mut worst[which], scaled_difference(&k, &reference));
    }
    for (which, error) in worst.iter().enumerate() {
        let name = which.checked_sub(1).and_then(|i| EFFECTS.get(i)).map_or("none or all", |e| e.id);
        assert!(
            *error <= 1e-8,
            "{name}: K is off by {error:e}: does `assemble` have this effect, where the core has it?"
        );
    }
}

/// ε(N) of the load-dependent effects, from their definitions.
fn elongation(m: &MachineParameters, n: f64) -> f64 {
    let p = |id: &str, name: &str| amplitude(m, id, name);
    let play = 0.5 * p("clearance", "play_m") * n / n.hypot(p("clearance", "taken_up_n").max(1.0));
    let x = n / p("contact-stiffening", "reference_n").max(1.0);
    play + p("contact-stiffening", "unloaded_m_per_n") * n * (1.0 + x * x).powf(-1.0 / 6.0)
}

impl Assembled {
    /// Tensions under given displacements of the nodes, with the bodies' own elongations.
    fn tensions(&self, u: &DMatrix<f64>, lag: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|i| {
            let (foot, head, z, k) = &self.limbs[i];
            (z.dot(&(Frame::of(u, *head) - Frame::of(u, *foot))) - lag[i]) * k
        })
    }

    /// Displacements under a load when the bodies, besides, get longer of themselves.
    fn displaced(&self, load: [f64; 6], lag: [f64; 3]) -> DMatrix<f64> {
        let mut loads = vec![(self.tool, load)];
        for ((foot, head, z, k), lag) in self.limbs.iter().zip(lag) {
            for (node, force) in [(*head, z * (k * lag)), (*foot, -z * (k * lag))] {
                loads.push((node, [force.x, force.y, force.z, 0.0, 0.0, 0.0]));
            }
        }
        self.frame.displacements(&loads).unwrap()
    }
}

/// Displacement of A by secants: every limb gets the compliance ε(N)/N of the force found last, until nothing moves.
fn settled(parameters: &MachineParameters, pose: &Pose<f64>, load: [f64; 6], lag: [f64; 3]) -> Vector3<f64> {
    let mut secants = [0.0; 3];
    // of the preload: what it takes up is no part of a deflection
    let before = {
        let p = |name| amplitude(parameters, "preload", name);
        [p("limbs_1_2_n"), p("limbs_1_2_n"), p("limb_3_n")]
    };
    for round in 0.. {
        let a = assemble(parameters, pose, secants, 20.0);
        let u = a.displaced(load, lag);
        let next: [f64; 3] = std::array::from_fn(|i| {
            let tension = a.tensions(&u, lag)[i];
            let n = if tension.abs() < 1e-9 { 1e-9 } else { tension };
            0.5 * (secants[i] + (elongation(parameters, before[i] + n) - elongation(parameters, before[i])) / n)
        });
        let change = (0..3).map(|i| (next[i] - secants[i]).abs() / (next[i] + 1e-30)).fold(0.0, f64::max);
        if change < 1e-13 || round == 2000 {
            return Frame::of(&u, a.tool);
        }
        secants = next;
    }
    unreachable!()
}

#[test]
fn load_dependent_effects_equal_the_frame_solver_with_secant_springs() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    let mut share = (f64::INFINITY, 0.0_f64);
    for n in 0..cases(40) {
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
        let wrench = Wrench::from_vector(load.into());

        let found = settled(&parameters, &pose, load, [0.0; 3]);
        let linear = machine.stiffness(&pose).unwrap().factor().unwrap().deflection(&wrench).unwrap();
        let extra = machine.load_dependent_deflection(&pose, &wrench, &Wrench::ZERO).unwrap();
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
    let effects = effects.with("friction-hysteresis", [2e-6, 1e-8, 20.0]).unwrap();
    let parameters = MachineParameters { effects, ..reference::PARAMETERS };
    let (double, single) = (Machine::<f64>::new(&parameters).unwrap(), Machine::<f32>::new(&parameters).unwrap());
    let mut worst = 0.0_f64;
    let mut rng = seeded();
    for _ in 0..cases(1000) {
        let mut within = |middle: f64, half: f64| middle + half * (2.0 * rng.f64() - 1.0);
        let pose = Pose { theta_rad: within(0.0, 0.26), sigma_rad: within(0.0, 0.26), z0_m: within(0.53, 0.03) };
        let narrow = narrow_pose(&pose);
        let force_n = Vector3::from_fn(|_, _| within(0.0, 1000.0));
        let wide = Wrench { force_n, moment_nm: Vector3::zeros() };
        let slim = Wrench { force_n: force_n.map(|f| f as f32), moment_nm: Vector3::zeros() };
        let whole = |k: pkm_core::Stiffness<f64>| k.factor().unwrap().deflection(&wide).unwrap();
        // before it turned, it was twice as much along one axis
        let mut force_there = force_n;
        force_there[rng.usize(..3)] *= 2.0;
        let wide_there = Wrench { force_n: force_there, moment_nm: Vector3::zeros() };
        let slim_there = Wrench { force_n: force_there.map(|f| f as f32), moment_nm: Vector3::zeros() };
        let extra = double.load_dependent_deflection(&pose, &wide, &wide_there).unwrap();
        let expected = Vector3::from(whole(double.stiffness(&pose).unwrap()).plus(&extra).translation_m);
        let linear = single.stiffness(&narrow).unwrap().factor().unwrap().deflection(&slim).unwrap();
        let extra = single.load_dependent_deflection(&narrow, &slim, &slim_there).unwrap();
        let found = linear.plus(&extra).translation_m.map(f64::from);
        keep_worst(&mut worst, (Vector3::from(found) - expected).norm() / expected.norm());
    }
    println!("f32 load-dependent: {worst:.1e}");
    assert!(worst <= 1e-4, "{worst:e}");
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 };
    let bad = Wrench { force_n: Vector3::new(f64::NAN, 0.0, 0.0), moment_nm: Vector3::zeros() };
    assert_eq!(double.load_dependent_deflection(&pose, &bad, &Wrench::ZERO), Err(StiffnessError::NotFinite));
    let any = Wrench::from_vector([100.0; 6].into());
    for machine in [double, reference::MACHINE_F64] {
        assert_eq!(machine.load_dependent_deflection(&pose, &any, &bad), Err(StiffnessError::NotFinite));
    }
}

/// Lags from the definition, with the frame solver's tensions; then the bodies get longer by them.
#[test]
fn friction_equals_its_definition_in_the_frame_solver() {
    let mut rng = seeded();
    let mut worst = [0.0_f64; 2];
    let mut seen = 0.0_f64;
    for n in 0..cases(60) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let mut set = |id: &str, values: [f64; 3]| {
            parameters.effects = parameters.effects.with(id, values).unwrap();
        };
        if n % 3 == 1 {
            set("limb-coupling", [1e-9, 2e-9, 0.0]);
            set("base-compliance", [1e-9, 1e-7, 1e-9]);
            set("preload", [5e3 * size, -1e3 * size, 0.0]);
            set("platform-offset", [0.02 * size, -0.01 * size, 0.0]);
            set("geometry-b1", [0.003 * size, 0.0, 0.0]);
            set("geometry-a2", [-0.002 * size, 0.0, 0.0]);
        }
        let plays = n % 2 == 1;
        if plays {
            set("clearance", [60e-6 * rng.f64(), 5.0 + 50.0 * rng.f64(), 0.0]);
        }
        let (lag_m, lag_m_per_n, reversal_n) = (10e-6 * rng.f64(), 1e-8 * rng.f64(), 100.0 * rng.f64());
        set("friction-hysteresis", [lag_m, lag_m_per_n, reversal_n]);
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, size, 0.3);
        let mut random_load = || -> [f64; 6] {
            std::array::from_fn(|i| (2.0 * rng.f64() - 1.0) * if i < 3 { 1000.0 } else { 200.0 * size })
        };
        let (load, mut turned_at) = (random_load(), random_load());
        if n % 4 == 0 {
            turned_at = [0.0; 6];
        }

        let a = assemble(&parameters, &pose, [0.0; 3], 20.0);
        let here = a.tensions(&a.displaced(load, [0.0; 3]), [0.0; 3]);
        let there = a.tensions(&a.displaced(turned_at, [0.0; 3]), [0.0; 3]);
        let lag: [f64; 3] = std::array::from_fn(|i| {
            // the first loading up to the turn, and twice that curve back from there until it meets its other side (Masing)
            let first = |n: f64| n / n.hypot(reversal_n.max(1.0));
            let most = lag_m + lag_m_per_n * here[i].abs().max(there[i].abs());
            let back = first(there[i]) + 2.0 * first(0.5 * (here[i] - there[i]));
            -most * if here[i].abs() < there[i].abs() { back } else { first(here[i]) }
        });
        let expected = settled(&parameters, &pose, load, lag);

        let (wrench, turned_at) = (Wrench::from_vector(load.into()), Wrench::from_vector(turned_at.into()));
        let linear = machine.stiffness(&pose).unwrap().factor().unwrap().deflection(&wrench).unwrap();
        let extra = machine.load_dependent_deflection(&pose, &wrench, &turned_at).unwrap();
        let found = Vector3::from(linear.plus(&extra).translation_m);
        keep_worst(&mut worst[usize::from(plays)], (found - expected).norm() / expected.norm());
        seen = seen.max(Vector3::from(extra.translation_m).norm() / expected.norm());
    }
    println!("friction: alone {:.1e}, with clearance {:.1e}; up to {seen:.2} of the deflection", worst[0], worst[1]);
    assert!(worst[0] <= 1e-8 && worst[1] <= 1e-8, "{worst:?}");
    assert!(seen > 0.05, "nothing to see");
}

#[test]
fn friction_makes_a_loop_of_the_right_sign() {
    let effects = reference::PARAMETERS.effects.with("friction-hysteresis", [2e-6, 5e-9, 20.0]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..reference::PARAMETERS }).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    let linear = machine.stiffness(&pose).unwrap().factor().unwrap();
    let peak = [300.0, -200.0, -800.0, 20.0, 10.0, -5.0];
    let at = |share: f64| Wrench::from_vector(peak.map(|f| f * share).into());
    // displacement along the load, linear and of friction, in the sense of work
    let along = |d: pkm_core::Deflection<f64>| {
        d.translation_m.iter().chain(&d.rotation_rad).zip(peak).map(|(d, f)| d * f).sum::<f64>()
    };
    let lagging = |share: f64, turned_at: &Wrench<f64>| {
        let extra = machine.load_dependent_deflection(&pose, &at(share), turned_at).unwrap();
        along(extra) / along(linear.deflection(&at(1.0)).unwrap())
    };
    assert_eq!(lagging(0.0, &Wrench::ZERO), 0.0);
    // at the turn no leap
    assert!((lagging(1.0, &at(1.0)) - lagging(1.0, &Wrench::ZERO)).abs() < 1e-15);
    for step in 1..=9 {
        let share = f64::from(step) / 10.0;
        let (loading, unloading) = (lagging(share, &Wrench::ZERO), lagging(share, &at(1.0)));
        assert!(loading < -1e-3 && unloading > loading + 1e-3, "{share}: {loading:e} {unloading:e}");
    }
    // it does not come back to where it began
    assert!(lagging(0.0, &at(1.0)) > 1e-3);
}

/// A machine with friction alone, and the history of its load.
struct Rubbing {
    machine: Machine<f64>,
    history: LoadHistory<f64>,
}

impl Rubbing {
    const POSE: Pose<f64> = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };

    fn new(lag: [f64; 3]) -> Self {
        let effects = reference::PARAMETERS.effects.with("friction-hysteresis", lag).unwrap();
        let machine = Machine::<f64>::new(&MachineParameters { effects, ..reference::PARAMETERS }).unwrap();
        Self { machine, history: LoadHistory::new() }
    }

    /// Displacement of A by friction when the load goes on to this share of a peak.
    fn to(&mut self, share: f64) -> Vector3<f64> {
        let wrench = Wrench::from_vector([300.0, -200.0, -800.0, 20.0, 10.0, -5.0].map(|f| f * share).into());
        let response = self.machine.load_response(&Self::POSE).unwrap();
        response.deflection_after(&wrench, &mut self.history).unwrap().translation_m
    }
}

#[test]
fn friction_does_not_leap_where_the_load_turns() {
    let lag = [2e-6, 5e-9, 20.0];
    // the steepest part of a curve: as steep as at its beginning
    let step = 1e-3;
    let steepest = Rubbing::new(lag).to(step).norm() * 1.6;
    let mut rng = seeded();
    let mut rubbing = Rubbing::new(lag);
    let (mut share, mut last) = (0.0, Vector3::zeros());
    for _ in 0..cases(200) {
        // loops of any size, noise among them
        let goal = between(&mut rng, -1.0, 1.0) * [1.0, 0.1, 0.004][rng.usize(..3)];
        let steps = ((goal - share).abs() / step).ceil();
        let by = (goal - share) / steps.max(1.0);
        for _ in 0..steps as usize {
            share += by;
            let now = rubbing.to(share);
            assert!((now - last).norm() <= 2.0 * steepest, "{share}: {:e} {steepest:e}", (now - last).norm());
            last = now;
        }
    }
}

#[test]
fn closed_loops_of_friction_leave_no_trace() {
    let lag = [2e-6, 5e-9, 20.0];
    let near = |a: Vector3<f64>, b: Vector3<f64>| assert!((a - b).norm() < 1e-15, "{a} {b}");
    let mut rubbing = Rubbing::new(lag);
    rubbing.to(1.0);
    let down = rubbing.to(0.2);
    // a loop within, another within that, and back
    for share in [0.7, 0.4, 0.5, 0.4, 0.7] {
        rubbing.to(share);
    }
    near(rubbing.to(0.2), down);
    // past the first turn it is as if it had never turned; and the other side is the mirror image
    let beyond = rubbing.to(1.1);
    near(beyond, Rubbing::new(lag).to(1.1));
    rubbing.to(0.3);
    near(rubbing.to(-1.1), -beyond);
    // one turn is what `turned_at` says
    let mut rubbing = Rubbing::new(lag);
    rubbing.to(0.8);
    let found = rubbing.to(-0.1);
    let at = |share: f64| Wrench::from_vector([300.0, -200.0, -800.0, 20.0, 10.0, -5.0].map(|f| f * share).into());
    let said = rubbing.machine.load_dependent_deflection(&Rubbing::POSE, &at(-0.1), &at(0.8)).unwrap();
    near(found, said.translation_m);
}

/// More loops within loops than are remembered, as noise makes them, are forgotten with the first turn beyond them: what follows is as
/// without them.
#[test]
fn noise_does_not_hide_a_turn() {
    let lag = [2e-6, 5e-9, 20.0];
    let mut rng = seeded();
    for _ in 0..cases(300) {
        let (mut noisy, mut clean) = (Rubbing::new(lag), Rubbing::new(lag));
        let mut turns = [1.0, between(&mut rng, -0.9, 0.3)];
        for share in turns {
            assert_eq!(noisy.to(share), clean.to(share));
        }
        for _ in 0..rng.usize(1..12) {
            let [out, within] = turns;
            turns = [within, out + (within - out) * between(&mut rng, 0.05, 0.6)];
            noisy.to(turns[1]);
        }
        for share in
            [between(&mut rng, -1.0, -0.91), between(&mut rng, 0.31, 0.95), 0.3, 1.2, between(&mut rng, -1.1, 0.0)]
        {
            let (found, expected) = (noisy.to(share), clean.to(share));
            assert!((found - expected).norm() < 1e-15, "{share}: {found} {expected}");
        }
    }
}

/// A preload beyond the play's force takes the play up: the residual of the play's elongation is a hundredth.
#[test]
fn a_preload_takes_up_the_play() {
    let moved = |preload_n: f64| {
        let effects = reference::PARAMETERS.effects.with("clearance", [20e-6, 20.0]).unwrap();
        let effects = effects.with("preload", [preload_n, preload_n]).unwrap();
        let machine = Machine::<f64>::new(&MachineParameters { effects, ..reference::PARAMETERS }).unwrap();
        let push = Wrench::from_vector([0.0, 0.0, -100.0, 0.0, 0.0, 0.0].into());
        let d = machine.load_dependent_deflection(&Rubbing::POSE, &push, &Wrench::ZERO).unwrap();
        d.translation_m.norm()
    };
    assert!(
        moved(2000.0) < 0.01 * moved(0.0) && moved(-2000.0) < 0.01 * moved(0.0),
        "{:e} {:e}",
        moved(2000.0),
        moved(0.0)
    );
}

#[test]
fn a_uniform_rise_makes_a_similar_machine() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(1000) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        parameters.effects = parameters.effects.with("thermal-expansion", [12e-6, 12e-6, 0.0]).unwrap();
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let pose = random_pose(&mut rng, &machine, size, 0.05);
        let moved = machine.thermal_deflection(&pose, 30.0).unwrap();
        let (rotation, a) = placed(&pose);
        let expected = rotation.inverse() * a * (12e-6 * 30.0);
        keep_worst(&mut worst, (Vector3::from(moved.translation_m) - expected).norm() / expected.norm());
        keep_worst(&mut worst, Vector3::from(moved.rotation_rad).norm() / (12e-6 * 30.0));
    }
    println!("uniform rise: {worst:.1e}");
    assert!(worst <= 1e-11, "{worst:e}");
}

/// Limbs and platforms by a temperature of their own each, by ±1 K about none, and by 20 K.
#[test]
fn thermal_deflection_is_the_slope_of_forward_kinematics_of_grown_machines() {
    let mut rng = seeded();
    let (mut worst, mut worst_whole) = (0.0_f64, 0.0_f64);
    for n in 0..cases(500) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let mut rate = || 1e-5 * (2.0 * rng.f64() - 1.0);
        let rises: [f64; 4] = if n % 4 == 0 { [1.0; 4] } else { std::array::from_fn(|_| 1e5 * rate()) };
        let (limbs, platforms) = match n % 3 {
            0 => (rate(), 0.0),
            1 => (0.0, rate()),
            _ => (rate(), rate()),
        };
        parameters.effects = parameters.effects.with("thermal-expansion", [limbs, platforms, 0.0]).unwrap();
        if n % 2 == 1 {
            for size in ["a1", "a2", "b1", "b2"] {
                let error = [1e3 * rate() * parameters.geometry.a1_m, 0.0, 0.0];
                parameters.effects = parameters.effects.with(&format!("geometry-{size}"), error).unwrap();
            }
        }
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, parameters.geometry.a1_m + parameters.geometry.b1_m, 0.3);
        let q = machine.inverse(&pose).unwrap().q_m;
        let actual = true_geometry(&parameters);
        let grown = |rise: f64| {
            let part = |size: f64| size * (1.0 + platforms * rises[3] * rise);
            let geometry = Geometry {
                a1_m: part(actual.a1_m),
                a2_m: part(actual.a2_m),
                b1_m: part(actual.b1_m),
                b2_m: part(actual.b2_m),
            };
            let effects = pkm_core::effects::Effects::NONE;
            let machine = Machine::<f64>::new(&MachineParameters { geometry, effects, ..parameters }).unwrap();
            placed(
                &machine
                    .forward(&ScrewLengths { q_m: Vector3::from_fn(|i, _| q[i] * (1.0 + limbs * rises[i] * rise)) })
                    .unwrap(),
            )
        };
        let ((r_up, a_up), (r_down, a_down)) = (grown(1.0), grown(-1.0));
        let commanded = placed(&pose).0.inverse();
        let translation = commanded * (a_up - a_down) / 2.0;
        // the skew part: an angle from its cosine would have lost its digits
        let r = (r_up * r_down.inverse()).into_inner();
        let axis = Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]) / 2.0;
        let rotation = commanded * axis / 2.0;
        let [first, second, third, platforms_k] = rises;
        let apart = TemperatureRise { limbs_k: [first, second, third], platforms_k };
        let found = machine.thermal_deflection(&pose, apart).unwrap();
        if n % 4 == 0 {
            assert_eq!(machine.thermal_deflection(&pose, 1.0), Ok(found));
        }
        let size = translation.norm() + rotation.norm();
        keep_worst(&mut worst, (Vector3::from(found.translation_m) - translation).norm() / size);
        keep_worst(&mut worst, (Vector3::from(found.rotation_rad) - rotation).norm() / size);
        // the whole way, with all that is not of first order
        let whole = commanded * (grown(20.0).1 - grown(0.0).1);
        keep_worst(&mut worst_whole, (Vector3::from(found.translation_m) * 20.0 - whole).norm() / (20.0 * size));
    }
    println!("thermal deflection: {worst:.1e}, of 20 K whole: {worst_whole:.1e}");
    assert!(worst <= 1e-6 && worst_whole <= 1e-2, "{worst:e} {worst_whole:e}");
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 };
    for rise in [f64::NAN, f64::INFINITY] {
        let mut apart = TemperatureRise::from(0.0);
        apart.limbs_k[1] = rise;
        let one_sensor = TemperatureRise { platforms_k: rise, ..0.0.into() };
        for rise in [rise.into(), apart, one_sensor] {
            assert_eq!(reference::MACHINE_F64.thermal_deflection(&pose, rise), Err(StiffnessError::NotFinite));
        }
    }
}

#[test]
fn a_temperature_is_that_of_the_result() {
    let effects = reference::PARAMETERS.effects.with("thermal-modulus", [4e-4, -1e-3, 0.0]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..reference::PARAMETERS }).unwrap();
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.05, z0_m: 0.53 };
    let k = |machine: &Machine<f64>| machine.stiffness(&pose).unwrap().matrix();
    let direct = machine.at_temperature(45.0).unwrap();
    // as often as a controller updates it in a day, rounding must not add up
    let mut by_way = machine;
    let mut narrow = Machine::<f32>::new(&MachineParameters { effects, ..reference::PARAMETERS }).unwrap();
    let narrow_direct = narrow.at_temperature(45.0).unwrap();
    for step in 0..cases(100_000) {
        by_way = by_way.at_temperature(45.0 + 0.01 * (step % 100) as f64).unwrap();
        narrow = narrow.at_temperature(45.0 + 0.01 * (step % 100) as f32).unwrap();
    }
    assert_eq!(by_way.at_temperature(45.0), Ok(direct));
    assert_eq!(narrow.at_temperature(45.0), Ok(narrow_direct));
    assert!(scaled_difference(&k(&direct), &k(&machine)) > 1e-4);
    assert_eq!(machine.at_temperature(f64::NAN), Err(TemperatureError::NotFinite));
    assert_eq!(reference::MACHINE_F64.at_temperature(f64::INFINITY), Err(TemperatureError::NotFinite));
    assert_eq!(machine.at_temperature(20.0 + 1.0 / 4e-4), Err(TemperatureError::NoStiffness));
    assert_eq!(machine.at_temperature(20.0 - 1.0 / 1e-3), Err(TemperatureError::NoStiffness));
}

#[test]
fn only_signed_effects_may_be_negative_and_all_have_bounds() {
    for (e, effect) in EFFECTS.iter().enumerate() {
        for p in 0..effect.parameters.len() {
            let check = |value: f64| {
                let mut parameters = reference::PARAMETERS;
                parameters.effects.parameters[e][p] = value;
                parameters.check()
            };
            let refused = |problem| {
                let parameter = Parameter::Effect { effect: e as u8, parameter: p as u8 };
                Err(MachineError { parameter, problem })
            };
            let (negative, small) = (check(-1e-6), check(1e-6));
            assert_eq!(negative, if effect.signed { Ok(()) } else { refused(Problem::Negative) }, "{}", effect.id);
            assert_eq!(small, Ok(()), "{}", effect.id);
            assert_eq!(check(f64::NAN), refused(Problem::NotFinite));
            assert_eq!(check(1e6), refused(Problem::TooLarge));
            if effect.signed {
                assert_eq!(check(-1e6), refused(Problem::TooLarge));
            }
        }
    }
    // see `Problem::TooLarge`
    for (e, effect) in EFFECTS.iter().enumerate().filter(|(_, effect)| !effect.id.starts_with("geometry-")) {
        for (p, name) in effect.names().enumerate() {
            let limit = match effect.id {
                "platform-offset" => 0.1,
                "thermal-modulus" => 0.05,
                "thermal-expansion" => 1e-3,
                _ if name.ends_with("per_nm2") => 1e3,
                _ if ["play_m", "lag_m"].contains(&name) => 1e-2,
                _ if name.ends_with("_per_n") || name.ends_with("_per_nm") => 1e-3,
                _ => 1e6,
            };
            for (share, expected) in [(0.999, true), (1.001, false)] {
                let mut parameters = reference::PARAMETERS;
                parameters.effects.parameters[e][p] = share * limit;
                assert_eq!(parameters.check().is_ok(), expected, "{} {name}", effect.id);
            }
        }
    }
    let geometry = reference::PARAMETERS.geometry;
    let sizes = [geometry.a1_m, geometry.a2_m, geometry.b1_m, geometry.b2_m];
    for (id, size) in ["geometry-a1", "geometry-a2", "geometry-b1", "geometry-b2"].into_iter().zip(sizes) {
        let check = |share: f64| {
            let effects = reference::PARAMETERS.effects.with(id, [share * size, 0.0, 0.0]).unwrap();
            MachineParameters { effects, ..reference::PARAMETERS }.check().is_ok()
        };
        assert!(check(0.49) && check(-0.49) && !check(0.5) && !check(-0.5), "{id}");
    }
}

#[test]
fn effects_are_set_by_their_names() {
    for (e, effect) in EFFECTS.iter().enumerate() {
        let mut expected = Effects::NONE;
        expected.parameters[e][0] = 1e-9;
        assert_eq!(Effects::NONE.with(effect.id, [1e-9]), Some(expected));
        // what was there goes; what does not exist is 0 or refused
        let mut other = expected;
        other.parameters[e] = [2e-9; MAX_PARAMETERS];
        assert_eq!(other.with(effect.id, [1e-9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]), Some(expected));
        assert_eq!(Effects::NONE.with(effect.id, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e-9]), None);
    }
    for unknown in ["no-such-effect", "", "clearanc", "clearances"] {
        assert_eq!(Effects::NONE.with(unknown, [1e-9]), None);
    }
}

/// What an effect adds to the compliance at a pose, without and with a table; none where it adds nothing to K.
fn added(effect: usize, pose: &Pose<f64>) -> Option<[Matrix6<f64>; 2]> {
    let compliances = |effects: Effects| {
        let machine = Machine::<f64>::new(&MachineParameters { effects, ..reference::PARAMETERS }).ok()?;
        let plain = machine.stiffness(pose).ok()?.matrix().try_inverse()?;
        let corrected =
            reference::TABLE_F64.factor_form(&machine, pose).ok()?.factor.stiffness().matrix().try_inverse()?;
        Some([plain, corrected])
    };
    let mut effects = Effects::NONE;
    effects.parameters[effect][..EFFECTS[effect].parameters.len()].fill(1e-9);
    let ([plain, corrected], [without, without_corrected]) = (compliances(effects)?, compliances(Effects::NONE)?);
    let added = [plain - without, corrected - without_corrected];
    (added[0].norm() > 1e-9 * without.norm()).then_some(added)
}

#[test]
fn what_lies_at_the_tool_comes_after_the_table_and_is_said_to() {
    let pose = Pose { theta_rad: 0.1, sigma_rad: -0.15, z0_m: 0.52 };
    let all = Effects { parameters: [[1e-9; MAX_PARAMETERS]; COUNT], ..Effects::NONE };
    for (e, (effect, left)) in EFFECTS.iter().zip(all.below_tool().parameters).enumerate() {
        let is_said = left == [0.0; MAX_PARAMETERS];
        let acts = added(e, &pose).is_some_and(|[plain, corrected]| {
            // no table changes what is in a row with it
            (plain - corrected).norm() < 1e-6 * plain.norm()
        });
        assert_eq!(is_said, acts, "{}: `AT_TOOL` in its file is {is_said}, and `at_tool` says {acts}", effect.id);
    }
}

#[test]
fn places_motions_and_laws_are_those_that_elements_have() {
    for effect in EFFECTS {
        let Expected { places, motion, law, .. } = effect.expected;
        assert!(Law::from_name(law).is_some(), "{}: no law `{law}`", effect.id);
        for name in places {
            let place = Place::from_name(name);
            assert!(place.is_some() || *name == "geometry", "{}: no place `{name}`", effect.id);
            let mut motions = place.map_or(&[][..], Place::motions).iter().map(|m| m.name());
            let is_any = ["general", "lateral"].contains(&motion) || motions.any(|m| m == motion);
            assert!(is_any, "{}: no motion `{motion}` of `{name}`", effect.id);
        }
    }
}

#[test]
fn a_geometry_that_cannot_close_is_an_error_of_kinematics() {
    let effects =
        reference::PARAMETERS.effects.with("geometry-b2", [-0.45 * reference::PARAMETERS.geometry.b2_m, 0.0, 0.0]);
    let effects =
        effects.and_then(|e| e.with("geometry-a2", [0.45 * reference::PARAMETERS.geometry.a2_m, 0.0, 0.0])).unwrap();
    let mut parameters = MachineParameters { effects, ..reference::PARAMETERS };
    parameters.travel = pkm_core::machine::Travel { min_m: [1e-3; 3], max_m: [10.0; 3] };
    let machine = Machine::<f64>::new(&parameters).unwrap();
    let mut refused = 0;
    for theta in -80..80 {
        let pose = Pose { theta_rad: f64::from(theta).to_radians(), sigma_rad: 0.0, z0_m: 0.2 };
        if machine.inverse(&pose).is_err() {
            continue;
        }
        match machine.stiffness(&pose) {
            Ok(_) => {}
            Err(StiffnessError::Kinematics(_)) => refused += 1,
            Err(other) => panic!("{other}"),
        }
    }
    assert!(refused > 0);
}

/// The host asks what the effects do, and knows none of these by name.
#[test]
fn effects_tell_what_a_host_has_to_mind() {
    let told = |asked: fn(&Effects) -> bool| -> Vec<&str> {
        assert!(!asked(&Effects::NONE));
        let each = EFFECTS.iter().enumerate().flat_map(|(i, effect)| (0..effect.parameters.len()).map(move |n| (i, n)));
        let mut ids: Vec<_> = each
            .filter(|(i, n)| {
                let mut effects = Effects::NONE;
                effects.parameters[*i][*n] = 1e-9;
                asked(&effects)
            })
            .map(|(i, _)| EFFECTS[i].id)
            .collect();
        ids.dedup();
        ids
    };
    assert_eq!(told(Effects::soften_with_temperature), ["thermal-modulus"]);
    assert_eq!(told(Effects::grow_with_temperature), ["thermal-expansion"]);
    assert_eq!(told(Effects::preload_limbs), ["preload"]);
    let element = |law| Effects::NONE.with_element("limb.2.body", "axial", law, [1e-9]).expect("an element");
    assert!(element("temperature").soften_with_temperature() && !element("constant").soften_with_temperature());
}

//! Elements against the compliance of the eight transmitted wrenches, assembled from vectors: K = H (D + Σ c a aᵀ)⁻¹ Hᵀ.

use fastrand::Rng;
use nalgebra::{Matrix3, Matrix6, Rotation3, SMatrix, SVector, Vector3, Vector6};
use pkm_core::effects::{Effects, Element, Law, MAX_ELEMENT_PARAMETERS, MAX_ELEMENTS, Motion, Place, WEIGHT_STEPS};
use pkm_core::machine::{BodyKind, Joint, MachineError, MachineParameters, Parameter, Problem};
use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS};
use pkm_core::{Deflection, Machine, Pose, StiffnessError, Wrench};
use pkm_tests::{cases, keep_worst, random_parameters, random_pose, scaled_difference, seeded};

type Matrix8 = SMatrix<f64, 8, 8>;

/// One limb at a pose, in A-uvw with A as the origin.
struct Limb {
    base: Vector3<f64>,
    platform: Vector3<f64>,
    /// x, y, z.
    axes: [Vector3<f64>; 3],
    base_axes: [Vector3<f64>; 3],
    q: f64,
    /// Its columns of H.
    columns: std::ops::Range<usize>,
}

struct Transmission {
    limbs: [Limb; 3],
    /// The eight wrenches at A: forces and moments.
    h: SMatrix<f64, 6, 8>,
    /// B and the axes of B-xyz.
    b: Vector3<f64>,
    xyz: [Vector3<f64>; 3],
}

fn transmission(m: &MachineParameters, pose: &Pose<f64>) -> Transmission {
    let g = &m.geometry;
    let turn = (Rotation3::from_axis_angle(&Vector3::y_axis(), pose.theta_rad)
        * Rotation3::from_axis_angle(&Vector3::x_axis(), pose.sigma_rad))
    .inverse();
    let a = Vector3::new(pose.z0_m * pose.theta_rad.tan(), 0.0, pose.z0_m);
    let triangle = |half: f64, far: f64| {
        [Vector3::new(0.0, -half, 0.0), Vector3::new(0.0, half, 0.0), Vector3::new(far, 0.0, 0.0)]
    };
    let (platform, base) = (triangle(g.a1_m, g.a2_m), triangle(g.b1_m, g.b2_m).map(|b| turn * (b - a)));
    let (u, y) = (Vector3::x(), turn * Vector3::y());
    let mut h = SMatrix::<f64, 6, 8>::zeros();
    let mut put = |column: usize, force: Vector3<f64>, at: Vector3<f64>, couple: Vector3<f64>| {
        h.fixed_view_mut::<3, 1>(0, column).copy_from(&force);
        h.fixed_view_mut::<3, 1>(3, column).copy_from(&(at.cross(&force) + couple));
    };
    let o = Vector3::zeros();
    let limbs = std::array::from_fn(|i| {
        let along = platform[i] - base[i];
        let z = along.normalize();
        let x = if i == 2 { y } else { u };
        let axes = [x, z.cross(&x), z];
        put(3 * i, z, platform[i], o);
        if i == 2 {
            put(7, y, platform[i], o);
        } else {
            put(3 * i + 1, u, base[i], o);
            put(3 * i + 2, o, o, u.cross(&y));
        }
        Limb {
            base: base[i],
            platform: platform[i],
            axes,
            base_axes: if i == 2 { axes } else { [u, y, u.cross(&y)] },
            q: along.norm(),
            columns: 3 * i..8.min(3 * i + 3),
        }
    });
    Transmission { limbs, h, b: turn * -a, xyz: [turn * Vector3::x(), y, turn * Vector3::z()] }
}

impl Transmission {
    /// Forces along three axes and moments about them at a point, of each wrench that passes there.
    fn seen(
        &self,
        at: Vector3<f64>,
        axes: &[Vector3<f64>; 3],
        columns: std::ops::Range<usize>,
    ) -> [SVector<f64, 8>; 6] {
        std::array::from_fn(|k| {
            SVector::from_fn(|j, _| {
                if !columns.contains(&j) {
                    return 0.0;
                }
                let force: Vector3<f64> = self.h.fixed_view::<3, 1>(0, j).into();
                let moment: Vector3<f64> = self.h.fixed_view::<3, 1>(3, j).into();
                let vector = if k < 3 { force } else { moment - at.cross(&force) };
                vector.dot(&axes[k % 3])
            })
        })
    }

    fn compliance(&self, m: &MachineParameters) -> Matrix8 {
        let mut d = Matrix8::zeros();
        for (limb, parameters) in self.limbs.iter().zip(&m.limbs) {
            let all = |at, axes| self.seen(at, axes, limb.columns.clone());
            let mut joint = |joint: &Joint, seen: [SVector<f64, 8>; 6]| {
                for (k, s) in joint.linear_n_per_m.iter().chain(&joint.angular_nm_per_rad).zip(seen) {
                    d += if *k == 0.0 { Matrix8::zeros() } else { s * s.transpose() / *k };
                }
            };
            let (at_base, at_platform) = (all(limb.base, &limb.axes), all(limb.platform, &limb.axes));
            joint(&parameters.base_joint, all(limb.base, &limb.base_axes));
            joint(&parameters.platform_joint, at_platform);
            let (mut ea, mut ei, mut gj) = (0.0, 0.0, 0.0);
            for t in [&parameters.body.rod, &parameters.body.screw] {
                let (outer, inner) = (0.5 * t.outer_m, 0.5 * t.inner_m);
                let pi = std::f64::consts::PI;
                ea += t.young_pa * pi * (outer.powi(2) - inner.powi(2));
                ei += t.young_pa * pi / 4.0 * (outer.powi(4) - inner.powi(4));
                gj += t.shear_pa * pi / 2.0 * (outer.powi(4) - inner.powi(4));
            }
            d += at_base[2] * at_base[2].transpose() * (limb.q / ea);
            d += at_base[5] * at_base[5].transpose() * (limb.q / gj);
            d += bending(&at_base, &at_platform) * (limb.q / ei);
        }
        d
    }

    /// What a coupled element sees: all that passes at its place, by its weights.
    fn coupled(&self, e: &Element) -> SVector<f64, 8> {
        let uvw = [Vector3::x(), Vector3::y(), Vector3::z()];
        let seen: Vec<SVector<f64, 8>> = match e.place {
            Place::Tool => self.seen(Vector3::zeros(), &uvw, 0..8).into(),
            Place::BaseJoint { limb } | Place::PlatformJoint { limb } => {
                let l = &self.limbs[usize::from(limb) - 1];
                let is_base = matches!(e.place, Place::BaseJoint { .. });
                let (at, axes) = if is_base { (l.base, l.base_axes) } else { (l.platform, l.axes) };
                self.seen(at, &axes, l.columns.clone()).into()
            }
            Place::Body { limb } => {
                let own = self.limbs[usize::from(limb) - 1].columns.clone();
                own.map(|k| SVector::from_fn(|j, _| f64::from(u8::from(j == k)))).collect()
            }
            Place::MovingPlatform => {
                let at = |l: &Limb| self.seen(l.platform, &uvw, l.columns.clone());
                let forces = self.limbs.iter().flat_map(|l| at(l)[..3].to_vec());
                forces.chain(self.limbs[..2].iter().flat_map(|l| at(l)[3..].to_vec())).collect()
            }
            Place::Base => {
                let at = |l: &Limb| self.seen(l.base, &self.xyz, l.columns.clone());
                let forces = self.limbs.iter().flat_map(|l| at(l)[..3].to_vec());
                forces.chain(self.limbs.iter().flat_map(|l| [at(l)[3], at(l)[5]])).collect()
            }
        };
        assert_eq!(seen.len() + 1, e.parameter_names().len());
        seen.iter().zip(&e.parameters[1..]).fold(SVector::zeros(), |sum, (s, weight)| sum + s * *weight)
    }

    /// Σ c a aᵀ.
    fn elements(&self, effects: &Effects, warmer_k: f64) -> Matrix8 {
        let mut sum = Matrix8::zeros();
        for e in effects.elements.iter().flatten() {
            if e.motion == Motion::Coupled {
                let q = e.place.limb().map_or(0.0, |limb| self.limbs[usize::from(limb) - 1].q);
                let s = self.coupled(e);
                sum += s * s.transpose() * law(e, q, warmer_k);
                continue;
            }
            let rotation = usize::from(e.motion.is_rotation()) * 3;
            let axis = |motions: &[Motion]| motions.iter().position(|m| *m == e.motion).unwrap();
            let Some(limb) = e.place.limb() else {
                let (at, axes, motions) = if e.place == Place::Base {
                    (self.b, self.xyz, [Motion::X, Motion::Y, Motion::Z, Motion::Rx, Motion::Ry, Motion::Rz])
                } else {
                    let uvw = [Vector3::x(), Vector3::y(), Vector3::z()];
                    (Vector3::zeros(), uvw, [Motion::U, Motion::V, Motion::W, Motion::Ru, Motion::Rv, Motion::Rw])
                };
                let s = self.seen(at, &axes, 0..8)[axis(&motions)];
                sum += s * s.transpose() * law(e, 0.0, warmer_k);
                continue;
            };
            let limb = &self.limbs[usize::from(limb) - 1];
            let c = law(e, limb.q, warmer_k);
            let at = if matches!(e.place, Place::PlatformJoint { .. }) { limb.platform } else { limb.base };
            let seen = |at| self.seen(at, &limb.axes, limb.columns.clone());
            let s = seen(at);
            let outer = |k: usize| s[k] * s[k].transpose();
            sum += c * match e.motion {
                Motion::Axial | Motion::Torsion => outer(2 + rotation),
                Motion::Tilting if matches!(e.place, Place::Body { .. }) => {
                    bending(&seen(limb.base), &seen(limb.platform))
                }
                _ => outer(rotation) + outer(1 + rotation),
            };
        }
        sum
    }

    fn stiffness(&self, d: &Matrix8) -> Matrix6<f64> {
        self.h * d.cholesky().expect("positive definite").inverse() * self.h.transpose()
    }
}

/// ∫ M Mᵀ ds/q about x and y of moments that run linearly from one end to the other.
fn bending(at_base: &[SVector<f64, 8>; 6], at_platform: &[SVector<f64, 8>; 6]) -> Matrix8 {
    let mut sum = Matrix8::zeros();
    for axis in [3, 4] {
        let (a, b) = (at_base[axis], at_platform[axis]);
        sum += (a * a.transpose() + b * b.transpose()) / 3.0 + (a * b.transpose() + b * a.transpose()) / 6.0;
    }
    sum
}

fn law(e: &Element, q: f64, warmer_k: f64) -> f64 {
    let [a, b, c, d, local, at, half, ..] = e.parameters;
    match e.law {
        Law::Constant => a,
        Law::Extension => {
            let worn = if (q - at).abs() < half { (1.0 - ((q - at) / half).powi(2)).powi(2) } else { 0.0 };
            a + b * (q - d) + c * (q - d).powi(2) + local * worn
        }
        Law::Periodic => a + b * (2.0 * std::f64::consts::PI * q / c + d).sin(),
        Law::Temperature => a * warmer_k,
        Law::Load | Law::Direction => 0.0,
    }
}

/// An element of any place, motion and linear law, of a size that a machine may have.
fn random_element(rng: &mut Rng, size: f64) -> Element {
    let place = Place::ALL[rng.usize(..Place::ALL.len())];
    // ties are no compliances
    let motions: Vec<Motion> = place.motions().iter().copied().filter(|m| !m.is_tie()).collect();
    let motion = motions[rng.usize(..motions.len())];
    let laws = [Law::Constant, Law::Extension, Law::Periodic, Law::Temperature];
    let law = laws[rng.usize(..if place.limb().is_some() { 4 } else { 1 })];
    let law = if place.limb().is_none() && rng.bool() { Law::Temperature } else { law };
    let law = if motion == Motion::Coupled { Law::Constant } else { law };
    // in a limb it may take away what the declared parts have
    let share = if place.limb().is_some() && rng.u8(..4) == 0 { -0.1 } else { 1.0 + rng.f64() };
    let unit = share * if motion.is_rotation() { 1e-6 } else { 1e-9 };
    let parameters: &[f64] = match law {
        Law::Constant => &[unit],
        Law::Extension => {
            let [length, at, half] = [1.0, 1.5, 0.5].map(|s| s * size * rng.f64());
            &[unit, 0.1 * unit / size, 0.1 * unit / size.powi(2), length, 0.5 * unit, at, half]
        }
        Law::Periodic => &[unit, 0.1 * unit, 0.02 * size, rng.f64()],
        _ => &[unit / 50.0],
    };
    let mut element = Element::from_names(place.name().unwrap(), motion.name(), law.name(), []).unwrap();
    element.parameters[..parameters.len()].copy_from_slice(parameters);
    if motion == Motion::Coupled {
        let names = element.parameter_names();
        for (weight, name) in element.parameters.iter_mut().zip(names).skip(1) {
            // moments act over a lever of a tenth of the machine
            let scale = if name.ends_with("per_m") { (10.0 / size).min(10.0) } else { 1.0 };
            *weight = ((rng.f64() - 0.5) * scale * WEIGHT_STEPS).round() / WEIGHT_STEPS;
        }
    }
    element
}

#[test]
fn linear_elements_equal_the_transmitted_wrenches_in_64_bits() {
    let mut rng = seeded();
    let (mut worst, mut worst_plain) = (0.0_f64, 0.0_f64);
    for _ in 0..cases(2000) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let plain = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &plain, size, 0.2);
        let number = rng.usize(1..=MAX_ELEMENTS);
        for slot in parameters.effects.elements.iter_mut().take(number) {
            *slot = Some(random_element(&mut rng, size));
        }
        let warmer_k = 40.0 * rng.f64();
        let machine = Machine::<f64>::new(&parameters).unwrap().at_temperature(20.0 + warmer_k).unwrap();
        let transmission = transmission(&parameters, &pose);
        let d = transmission.compliance(&parameters);
        let expected = transmission.stiffness(&d);
        keep_worst(&mut worst_plain, scaled_difference(&plain.stiffness(&pose).unwrap().matrix(), &expected));
        let expected = transmission.stiffness(&(d + transmission.elements(&parameters.effects, warmer_k)));
        let found = machine.stiffness(&pose).unwrap().matrix();
        keep_worst(&mut worst, scaled_difference(&found, &expected));
    }
    println!("elements: {worst:.1e}; without them {worst_plain:.1e}");
    assert!(worst <= 1e-9 && worst_plain <= 1e-9, "{worst:e} {worst_plain:e}");
}

/// Where a point of a rod goes that hangs between a joint that stays and one that moves, and stretches evenly: it turns by the
/// smallest rotation.
fn carried(limb: &Limb, point: Vector3<f64>, platform: Vector3<f64>) -> Vector3<f64> {
    let (before, after) = (limb.platform - limb.base, platform - limb.base);
    let arm = point - limb.base;
    let along = arm.dot(&before) / before.norm_squared();
    // nalgebra's rotation between two vectors takes the arc cosine, which is blunt for small turns
    let axis = before.cross(&after);
    let turn = Rotation3::new(axis.normalize() * axis.norm().atan2(before.dot(&after)));
    limb.base + after * along + turn * (arm - before * along)
}

/// How far what a tie added to a stiffness K is from that of a spring whose length is known as a function of the platform's small motions,
/// relative to what such a spring adds: that is not lost beside what was there.
fn error_of_tie(
    added: &Matrix6<f64>,
    k: &Matrix6<f64>,
    stiffness: f64,
    size: f64,
    length: impl Fn(Vector6<f64>) -> f64,
) -> f64 {
    let step = 1e-5 * size;
    let lever = |j: usize| if j < 3 { 1.0 } else { 1.0 / size };
    let longer = Vector6::from_fn(|j, _| {
        let moved = Vector6::ith(j, step * lever(j));
        (length(moved) - length(-moved)) / (2.0 * step * lever(j))
    });
    let expected = longer * longer.transpose() * stiffness;
    let both = |m: &Matrix6<f64>, i: usize, j: usize| (m[(i, i)] * m[(j, j)]).sqrt();
    let scale = |i: usize, j: usize| both(&expected, i, j) + 1e-6 * both(k, i, j);
    Matrix6::from_fn(|i, j| (added[(i, j)] - expected[(i, j)]).abs() / scale(i, j)).max()
}

/// A tie pulls by what the bodies' middles move against each other, half way between them, as the platform moves by a little.
#[test]
fn a_tie_adds_the_stiffness_of_a_spring_between_two_rods() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(300) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let plain = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &plain, size, 0.2);
        let (from, to, motion) =
            [(1, 2, "tied_to_limb_2"), (1, 3, "tied_to_limb_3"), (2, 3, "tied_to_limb_3")][rng.usize(..3)];
        let axis = Vector3::from_fn(|_, _| rng.f64() - 0.5);
        let stiffness = 1e7 * rng.f64();
        let place = format!("limb.{from}.body");
        let element = Element::from_names(&place, motion, "constant", [stiffness, axis.x, axis.y, axis.z]).unwrap();
        parameters.effects.elements[2] = Some(element);
        let tied = Machine::<f64>::new(&parameters).unwrap().stiffness(&pose).unwrap().matrix();
        let k = plain.stiffness(&pose).unwrap().matrix();

        let t = transmission(&parameters, &pose);
        let limbs = [&t.limbs[from - 1], &t.limbs[to - 1]];
        let point = limbs.iter().fold(Vector3::zeros(), |sum, l| sum + (l.base + l.platform) * 0.25);
        let apart = |d: Vector6<f64>| {
            let [first, second] = limbs.map(|l| {
                let turn = Rotation3::new(Vector3::new(d[3], d[4], d[5]));
                carried(l, point, turn * l.platform + Vector3::new(d[0], d[1], d[2]))
            });
            axis.dot(&(first - second))
        };
        keep_worst(&mut worst, error_of_tie(&(tied - k), &k, stiffness, size, apart));
    }
    println!("ties: {worst:.1e}");
    assert!(worst <= 1e-6, "{worst:e}");
}

/// A spring from a point of the base to one of the platform pulls along its line by as much as it becomes longer. Its wrench at A is
/// that of a force at the point of the platform.
#[test]
fn a_tie_to_the_base_adds_the_stiffness_of_a_spring_between_two_points() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(300) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let plain = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &plain, size, 0.2);
        // in A-uvw
        let [on_base, on_platform] = [size, 0.3 * size].map(|s| Vector3::from_fn(|_, _| s * (2.0 * rng.f64() - 1.0)));
        let line = (on_platform - on_base).normalize();
        let turn = on_platform.cross(&line);
        let stiffness = 1e7 * rng.f64();
        let weights = [stiffness, line.x, line.y, line.z, turn.x, turn.y, turn.z];
        let element = Element::from_names("moving_platform", "tied_to_base", "constant", weights).unwrap();
        parameters.effects.elements[1] = Some(element);
        let tied = Machine::<f64>::new(&parameters).unwrap().stiffness(&pose).unwrap().matrix();
        let k = plain.stiffness(&pose).unwrap().matrix();

        let length = |d: Vector6<f64>| {
            let turned = Rotation3::new(Vector3::new(d[3], d[4], d[5])) * on_platform;
            (turned + Vector3::new(d[0], d[1], d[2]) - on_base).norm()
        };
        keep_worst(&mut worst, error_of_tie(&(tied - k), &k, stiffness, size, length));
    }
    println!("ties to the base: {worst:.1e}");
    assert!(worst <= 1e-6, "{worst:e}");
}

fn stiffness_with(effects: Effects, pose: &Pose<f64>) -> Result<Matrix6<f64>, StiffnessError> {
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    Ok(machine.stiffness(pose)?.matrix())
}

const POSE: Pose<f64> = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };

#[test]
fn elements_equal_the_effects_that_they_coincide_with() {
    let same = |elements: &[(&str, &str, f64)], effect: &str, parameters: [f64; 5]| {
        let mut effects = Effects::NONE;
        for (place, motion, c) in elements {
            effects = effects.with_element(place, motion, "constant", [*c]).unwrap();
        }
        let named = Effects::NONE.with(effect, parameters).unwrap();
        let (found, expected) = (stiffness_with(effects, &POSE).unwrap(), stiffness_with(named, &POSE).unwrap());
        assert!(scaled_difference(&found, &expected) < 1e-14, "{effect}");
        // and an element takes the effect back
        let mut none = named;
        for (place, motion, c) in elements {
            none = none.with_element(place, motion, "constant", [-c]).unwrap();
        }
        let basic = stiffness_with(Effects::NONE, &POSE).unwrap();
        assert!(scaled_difference(&stiffness_with(none, &POSE).unwrap(), &basic) < 1e-12, "{effect}");
    };
    let six = |place: &'static str, motions: [&'static str; 6]| {
        [0, 1, 2, 3, 4, 5].map(|i| (place, motions[i], if i < 3 { 2e-9 } else { 3e-8 }))
    };
    let base = six("base", ["x", "y", "z", "rx", "ry", "rz"]);
    same(&base, "base-compliance", [2e-9, 3e-8, 0.0, 0.0, 0.0]);
    same(&six("tool", ["u", "v", "w", "ru", "rv", "rw"]), "wrist-compliance", [2e-9, 3e-8, 0.0, 0.0, 0.0]);
    let hub = [("moving_platform", "ru", 3e-8), ("moving_platform", "rv", 3e-8), ("moving_platform", "rw", 3e-8)];
    same(&hub, "moving-platform-compliance", [0.0, 0.0, 0.0, 3e-8, 0.0]);
    for part in ["base_joint", "body", "platform_joint"] {
        same(&[(&format!("limb.2.{part}"), "axial", 2e-9)], "limb-2-axial", [2e-9, 0.0, 0.0, 0.0, 0.0]);
    }
    let spherical = [("limb.3.platform_joint", "axial", 2e-9), ("limb.3.platform_joint", "lateral", 2e-9)];
    same(&spherical, "spherical-joint", [2e-9, 0.0, 0.0, 0.0, 0.0]);
    let revolute = [
        ("limb.3.base_joint", "axial", 2e-9),
        ("limb.3.base_joint", "lateral", 2e-9),
        ("limb.3.base_joint", "tilting", 3e-7),
        ("limb.3.base_joint", "torsion", 3e-7),
    ];
    same(&revolute, "revolute-3-joint", [2e-9, 3e-7, 0.0, 0.0, 0.0]);
}

#[test]
fn a_table_is_fitted_without_what_sits_at_the_tool() {
    let base = Effects::NONE.with_element("base", "x", "constant", [1e-9]).unwrap();
    let both = base.with_element("tool", "u", "constant", [1e-9]).unwrap();
    assert_eq!(both.below_tool(), base);
}

#[test]
fn a_compliance_below_zero_is_refused_where_nothing_is_left() {
    for place in Place::ALL {
        for motion in place.motions().iter().filter(|m| !m.is_tie()) {
            let at = |c: f64| {
                let element = Element::from_names(place.name().unwrap(), motion.name(), "constant", [c]).unwrap();
                // a coupled one sees the first force that passes there
                let weights = [c, f64::from(u8::from(*motion == Motion::Coupled))];
                let element =
                    Element { parameters: std::array::from_fn(|i| weights.get(i).copied().unwrap_or(0.0)), ..element };
                let mut effects = Effects::NONE;
                effects.elements[0] = Some(element);
                let parameters = MachineParameters { effects, ..PARAMETERS };
                let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
                let narrow = Machine::<f32>::new(&parameters).unwrap().stiffness(&pose);
                (stiffness_with(effects, &POSE).map(|_| ()), narrow.map(|_| ()))
            };
            let refused = Err(StiffnessError::NotPositiveDefinite);
            // an S joint passes no moment on, the R joint of limb 3 none about the axis that limb 3 may turn about
            let is_free = matches!((place, motion), (Place::PlatformJoint { limb: 3 }, Motion::Tilting))
                || place.limb() == Some(3) && *motion == Motion::Torsion;
            let passes = !is_free;
            let expected = if passes { (refused, refused) } else { (Ok(()), Ok(())) };
            assert_eq!(at(-9e-4), expected, "{place:?} {motion:?}");
            let little = if motion.is_rotation() { -1e-9 } else { -1e-10 };
            assert_eq!(at(little), (Ok(()), Ok(())), "{place:?} {motion:?}");
        }
    }
}

#[test]
fn laws_of_the_load_lengthen_a_limb_by_their_definition() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    let mut seen = 0.0_f64;
    for n in 0..cases(500) {
        let mut parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let limb = rng.u8(1..=3);
        let mut sign = |amount: f64| if rng.bool() { amount } else { -amount };
        // files of before have no tension above which the law is straight
        let straight_above = [0.0, 150.0, 0.5][n % 3];
        let load_law = [sign(1e-8), sign(1e-11), sign(1e-11), sign(1e-14), 20e-6, 30.0, straight_above];
        let hysteresis = [2e-6, 1e-8, 50.0];
        let place = ["base_joint", "body", "platform_joint"][n % 3];
        let place = format!("limb.{limb}.{place}");
        let effects = parameters.effects.with_element(&place, "axial", "load", load_law).unwrap();
        parameters.effects = effects.with_element(&place, "axial", "direction", hysteresis).unwrap();
        if n % 2 == 0 {
            parameters.effects = parameters.effects.with("base-compliance", [1e-9, 1e-7, 1e-9]).unwrap();
        }
        let machine = Machine::<f64>::new(&parameters).unwrap();
        let pose = random_pose(&mut rng, &machine, size, 0.2);
        let mut load = || Vector6::from_fn(|i, _| (rng.f64() - 0.5) * if i < 3 { 2000.0 } else { 400.0 * size });
        let (wrench, turned_at) = (load(), load());

        // six equations of balance and no moment from the screws but their tensions: statics alone
        let transmission = transmission(&parameters, &pose);
        let d = transmission.compliance(&parameters).cholesky().unwrap();
        let k = transmission.stiffness(&transmission.compliance(&parameters)).cholesky().unwrap();
        let column = 3 * (usize::from(limb) - 1);
        let tension = |w: &Vector6<f64>| (d.solve(&(transmission.h.transpose() * k.solve(w))))[column];
        let (here, there) = (tension(&wrench), tension(&turned_at));
        let [a, b, c, e, play, width, _] = load_law;
        let first = |n: f64| n / n.hypot(hysteresis[2]);
        let back = first(there) + 2.0 * first(0.5 * (here - there));
        let lag = if here.abs() < there.abs() { back } else { first(here) };
        let grown = if straight_above > 0.0 { (here / straight_above.max(1.0)).hypot(1.0) } else { 1.0 };
        let elongation = a * here.abs()
            + (b * here.powi(2) + c * here * here.abs()) / grown
            + e * here.powi(3) / grown.powi(2)
            + 0.5 * play * here / here.hypot(width)
            - (hysteresis[0] + hysteresis[1] * here.abs().max(there.abs())) * lag;
        // work of a unit wrench: the tension that it causes times the elongation
        let expected = Vector6::from_fn(|i, _| elongation * tension(&Vector6::ith(i, 1.0)));

        let (wrench, turned_at) = (Wrench::from_vector(wrench), Wrench::from_vector(turned_at));
        let found = machine.load_dependent_deflection(&pose, &wrench, &turned_at).unwrap();
        keep_worst(&mut worst, (found.to_vector() - expected).norm() / expected.norm());
        seen = seen.max(elongation.abs());
    }
    println!("load laws: {worst:.1e}, elongations up to {seen:.1e} m");
    assert!(worst <= 1e-8, "{worst:e}");
    // nothing of it without a load that depends
    let linear = Effects::NONE.with_element("limb.1.body", "axial", "constant", [1e-9]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects: linear, ..PARAMETERS }).unwrap();
    let any = Wrench::from_vector([100.0; 6].into());
    assert_eq!(machine.load_dependent_deflection(&POSE, &any, &Wrench::ZERO), Ok(Deflection::ZERO));
}

/// So that no law of the load needs a solve (`docs/theory.md`, Effects): M = d − Vᵀ K⁻¹ V, whatever the compliances of limbs
/// that are coupled in every way, and wherever A_1, A_2, A_3 lie along w.
#[test]
fn elongation_of_a_limb_causes_no_tension() {
    let mut rng = seeded();
    let mut worst = 0.0_f64;
    for _ in 0..cases(5000) {
        let parameters = random_parameters(&mut rng, BodyKind::Beam);
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let pose = random_pose(&mut rng, &Machine::<f64>::new(&parameters).unwrap(), size, 0.2);
        let mut t = transmission(&parameters, &pose);
        let offset = [0.1 * size * (rng.f64() - 0.5), 0.1 * size * (rng.f64() - 0.5)];
        for (i, limb) in t.limbs.iter().enumerate() {
            let platform = limb.platform + Vector3::z() * offset[i / 2];
            let z = (platform - limb.base).normalize();
            t.h.fixed_view_mut::<3, 1>(0, 3 * i).copy_from(&z);
            t.h.fixed_view_mut::<3, 1>(3, 3 * i).copy_from(&platform.cross(&z));
        }
        let y = t.xyz[1];
        let third = t.limbs[2].platform + Vector3::z() * offset[1];
        t.h.fixed_view_mut::<3, 1>(3, 7).copy_from(&third.cross(&y));
        // rotations in the size of the machine, or the inverse of K loses the digits that are to be seen
        t.h.fixed_rows_mut::<3>(3).scale_mut(1.0 / size);
        let root = Matrix8::from_fn(|_, _| 0.25 * (rng.f64() - 0.5)) + Matrix8::identity();
        let inverse = (root * root.transpose()).cholesky().unwrap().inverse();
        let k = t.h * inverse * t.h.transpose();
        let m = inverse - inverse * t.h.transpose() * k.cholesky().unwrap().inverse() * t.h * inverse;
        for (i, j) in [(0, 0), (0, 3), (0, 6), (3, 3), (3, 6), (6, 6)] {
            keep_worst(&mut worst, m[(i, j)].abs() / inverse.norm());
        }
    }
    println!("tension by elongation: {worst:.1e}");
    assert!(worst <= 1e-9, "{worst:e}");
}

#[test]
fn a_temperature_law_is_zero_where_stiffnesses_are_declared() {
    let effects = Effects::NONE.with_element("limb.3.base_joint", "tilting", "temperature", [2e-7]).unwrap();
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    let k = |machine: &Machine<f64>| machine.stiffness(&POSE).unwrap().matrix();
    assert!(scaled_difference(&k(&machine), &k(&MACHINE_F64)) < 1e-14);
    let constant = Effects::NONE.with_element("limb.3.base_joint", "tilting", "constant", [3e-6]).unwrap();
    let expected = stiffness_with(constant, &POSE).unwrap();
    let warm = machine.at_temperature(35.0).unwrap();
    assert!(scaled_difference(&k(&warm), &expected) < 1e-14);
    assert_eq!(warm.at_temperature(20.0), Ok(machine));
}

#[test]
fn what_does_not_fit_together_is_refused_by_name_and_by_check() {
    let element = |place: &str, motion: &str, law: &str| Effects::NONE.with_element(place, motion, law, [1e-9]);
    for place in Place::ALL {
        let name = place.name().unwrap();
        assert_eq!(Place::from_name(name), Some(place));
        for motion in [
            "axial",
            "lateral",
            "tilting",
            "torsion",
            "u",
            "v",
            "w",
            "ru",
            "rv",
            "rw",
            "x",
            "y",
            "z",
            "rx",
            "ry",
            "rz",
            "coupled",
            "tied_to_limb_2",
            "tied_to_limb_3",
            "tied_to_base",
        ] {
            let is_one = motion != "coupled" && !motion.starts_with("tied");
            let known = place.motions().iter().any(|m| m.name() == motion);
            assert_eq!(element(name, motion, "constant").is_some(), known, "{name} {motion}");
            for law in Law::ALL {
                assert_eq!(Law::from_name(law.name()), Some(law));
                let fits = known
                    && match law {
                        Law::Constant => true,
                        Law::Temperature => is_one,
                        Law::Extension | Law::Periodic => place.limb().is_some() && is_one,
                        Law::Load | Law::Direction => place.limb().is_some() && motion == "axial",
                    };
                assert_eq!(element(name, motion, law.name()).is_some(), fits, "{name} {motion} {}", law.name());
            }
        }
    }
    for (place, motion, law) in [
        ("limb.4.body", "axial", "constant"),
        ("", "x", "constant"),
        ("base", "x", "square"),
        ("base", "xx", "constant"),
    ] {
        assert_eq!(element(place, motion, law), None);
    }
    assert_eq!(Effects::NONE.with_element("base", "x", "constant", [1e-9, 1e-9]), None);
    assert!(Effects::NONE.with_element("base", "x", "constant", [1e-9, 0.0]).is_some());
    let mut full = Effects::NONE;
    for _ in 0..MAX_ELEMENTS {
        full = full.with_element("base", "x", "constant", [1e-9]).unwrap();
    }
    assert_eq!(full.with_element("base", "x", "constant", [1e-9]), None);

    let checked = |e: Element| {
        let mut parameters = PARAMETERS;
        parameters.effects.elements[3] = Some(e);
        parameters.check()
    };
    let good = Effects::NONE.with_element("limb.1.body", "axial", "periodic", [1e-9, 1e-10, 0.01]).unwrap();
    let good = good.elements[0].unwrap();
    assert_eq!(checked(good), Ok(()));
    let refused = |parameter, problem| Err(MachineError { parameter, problem });
    for (local, half, is_good) in [(0.0, 0.0, true), (1e-9, 0.1, true), (1e-9, 0.0, false), (0.0, -0.1, false)] {
        let law = [1e-9, 0.0, 0.0, 0.5, local, 0.6, half];
        let worn = Effects::NONE.with_element("limb.1.body", "axial", "extension", law).unwrap().elements[0].unwrap();
        let parameter = Parameter::Element { element: 3, parameter: 6 };
        assert_eq!(checked(worn), if is_good { Ok(()) } else { refused(parameter, Problem::NotPositive) });
    }
    let of_place = |parameter| refused(parameter, Problem::NotOfPlace);
    let element = 3;
    assert_eq!(
        checked(Element { place: Place::Body { limb: 0 }, ..good }),
        of_place(Parameter::ElementPlace { element })
    );
    assert_eq!(checked(Element { motion: Motion::X, ..good }), of_place(Parameter::ElementMotion { element }));
    let lateral = Element { motion: Motion::Lateral, law: Law::Load, ..good };
    assert_eq!(checked(lateral), of_place(Parameter::ElementLaw { element }));
    // no play and no lag of 10 mm
    for (law, index) in [(Law::Load, 4), (Law::Direction, 0)] {
        let mut loose = Element { motion: Motion::Axial, law, parameters: [0.0; MAX_ELEMENT_PARAMETERS], ..good };
        loose.parameters[index] = 0.999e-2;
        assert_eq!(checked(loose), Ok(()));
        loose.parameters[index] = 1e-2;
        assert_eq!(checked(loose), refused(Parameter::Element { element, parameter: index as u8 }, Problem::TooLarge));
    }
    for (index, value, problem) in [
        (0, f64::NAN, Problem::NotFinite),
        (0, 1e-3, Problem::TooLarge),
        (1, -1e-3, Problem::TooLarge),
        (2, 0.0, Problem::NotPositive),
        (2, -0.01, Problem::NotPositive),
        (3, 1e6, Problem::TooLarge),
        (4, 1e-9, Problem::TooLarge),
    ] {
        let mut bad = good;
        bad.parameters[index] = value;
        assert_eq!(checked(bad), refused(Parameter::Element { element, parameter: index as u8 }, problem));
    }
    // all that is per newton or newton metre has one limit, whatever its powers
    let lengths = [0.0, 0.0, 0.0, 0.5, 0.0, 0.6, 0.1];
    let tilts =
        Effects::NONE.with_element("limb.3.body", "tilting", "extension", lengths).unwrap().elements[0].unwrap();
    for (index, limit) in [(0, 1e-3), (1, 1e-3), (2, 1e-3), (3, 1e6), (4, 1e-3), (5, 1e6)] {
        let mut large = tilts;
        large.parameters[index] = 0.999 * limit;
        assert_eq!(checked(large), Ok(()));
        large.parameters[index] = limit;
        assert_eq!(checked(large), refused(Parameter::Element { element, parameter: index as u8 }, Problem::TooLarge));
    }
    // of limb 3 two wrenches pass along the body
    let coupled = Effects::NONE.with_element("limb.3.body", "coupled", "constant", [1e-9, 0.5, -7.9]).unwrap();
    let coupled = coupled.elements[0].unwrap();
    assert_eq!(checked(coupled), Ok(()));
    for (index, value, problem) in [
        (0, 1e-3, Problem::TooLarge),
        (1, f64::NAN, Problem::NotFinite),
        (2, -8.0, Problem::TooLarge),
        (3, 1.0, Problem::TooLarge),
    ] {
        let mut bad = coupled;
        bad.parameters[index] = value;
        assert_eq!(checked(bad), refused(Parameter::Element { element, parameter: index as u8 }, problem));
    }
    assert_eq!(Effects::NONE.with_element("limb.3.body", "coupled", "constant", [1e-9, 0.5, 1.0, 1.0]), None);
}

#[test]
fn every_part_of_an_element_is_in_the_checksum() {
    let sum = |place: &str, motion: &str, law: &str, c: f64| {
        let effects = Effects::NONE.with_element(place, motion, law, [c]).unwrap();
        MachineParameters { effects, ..PARAMETERS }.checksum()
    };
    let coupled = |[x, y]: [f64; 2]| {
        let effects = Effects::NONE.with_element("base", "coupled", "constant", [1e-9, x, y]).unwrap();
        MachineParameters { effects, ..PARAMETERS }.checksum()
    };
    let load = |straight_above_n: f64| {
        let law = [0.0, 1e-12, 0.0, 0.0, 0.0, 0.0, straight_above_n];
        let effects = Effects::NONE.with_element("limb.1.body", "axial", "load", law).unwrap();
        MachineParameters { effects, ..PARAMETERS }.checksum()
    };
    let all = [
        PARAMETERS.checksum(),
        load(0.0),
        load(100.0),
        load(300.0),
        sum("base", "x", "constant", 1e-9),
        sum("base", "y", "constant", 1e-9),
        sum("base", "x", "temperature", 1e-9),
        sum("base", "x", "constant", 2e-9),
        sum("limb.1.body", "axial", "constant", 1e-9),
        sum("limb.1.base_joint", "axial", "constant", 1e-9),
        sum("limb.1.body", "tied_to_limb_2", "constant", 1e-9),
        sum("limb.1.body", "tied_to_limb_3", "constant", 1e-9),
        sum("moving_platform", "tied_to_base", "constant", 1e-9),
        coupled([1.0, 0.0]),
        coupled([0.5, 0.0]),
        coupled([0.0, 1.0]),
    ];
    for (i, a) in all.iter().enumerate() {
        assert!(all[i + 1..].iter().all(|b| a != b));
    }
}

/// Axes that the comparison above takes as they are.
#[test]
fn the_reference_is_right_handed() {
    let t = transmission(&PARAMETERS, &POSE);
    for axes in t.limbs.iter().map(|limb| limb.axes).chain([t.xyz]) {
        assert!((Matrix3::from_columns(&axes).determinant() - 1.0).abs() < 1e-12);
    }
}

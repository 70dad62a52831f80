//! What the sensor would read without noise: a dense frame of the true machine at each pose, and beyond it three
//! forces along the limbs that answer to gaps, contacts and friction.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use pkm_frame::{Frame, Node, Section};

use crate::effects::Effect;
use crate::forms;
use crate::machine::{Limb, Machine, Pose};

/// Force and moment.
pub type Wrench = Vector6<f64>;

/// One reading that is to be taken.
#[derive(Clone, Debug)]
pub struct Row {
    /// The commanded pose: its place in the list of poses.
    pub pose: usize,
    /// What the file says.
    pub wrench: Wrench,
    /// What acts, with errors that nobody declared.
    pub applied: Wrench,
    /// Readings that share a zero; consecutive rows are in time order.
    pub series: usize,
    /// Which repeat.
    pub repeat: usize,
    /// On the falling branch.
    pub unload: bool,
    /// °C.
    pub temperature: f64,
}

/// The true machine.
#[derive(Clone, Debug)]
pub struct World {
    /// Geometry that the controller believes in.
    pub nominal: Machine,
    /// True numbers.
    pub machine: Machine,
    /// And what they don't say.
    pub effects: Vec<Effect>,
    /// Scales a telescopic body so that at mid-stroke it is as stiff as the rod that was declared.
    telescope: [f64; 3],
}

/// A machine at a pose, reduced: tool deflection = c·w + bᵀ·ε, tension = b·w − m·ε, ε what the limbs grow beyond.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// Compliance at the tool.
    pub c: Matrix6<f64>,
    /// Tensions of the limbs under unit loads.
    pub b: SMatrix<f64, 3, 6>,
    /// Loss of tension by lengthening.
    pub m: Matrix3<f64>,
    /// Compliance along each limb that friction bypasses.
    pub path: [f64; 3],
}

/// The frame at a pose and what must be asked of it.
struct Assembled {
    frame: Frame,
    tool: Node,
    limbs: Vec<(Node, Node, Vector3<f64>, f64)>,
}

fn softened(stiffness: f64, compliance: f64) -> f64 {
    if stiffness == 0.0 { 0.0 } else { 1.0 / (1.0 / stiffness + compliance) }
}

fn both(axes: &Matrix3<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(axes);
    m
}

/// Motion of a frame's origin from the motion of another's: `r` from the first to the second, both in axes of the first.
fn shifted(turn: &Matrix3<f64>, r: &Vector3<f64>) -> Matrix6<f64> {
    let mut m = both(turn);
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&(r.cross_matrix() * turn));
    m
}

/// A tube at the base and a ram at the platform: two guides at the ends of their overlap, a key, the screw inside.
#[allow(clippy::too_many_arguments)]
fn telescope(
    frame: &mut Frame,
    ends: (Node, Node),
    (from, z, q): (Vector3<f64>, Vector3<f64>, f64),
    axes: &Matrix3<f64>,
    limb: &Limb,
    effect: &Effect,
    scale: f64,
    stroke: (f64, f64),
) {
    let (ea, ei, gj) = limb.section();
    let inner_at = q - (stroke.0 - 0.020);
    let outer_at = stroke.1 + [0.060, 0.030][effect.variant] - (stroke.0 - 0.020);
    // nearly equal sections that the guides let bend apart, or unequal ones; in torsion as declared
    let tilt = 1.0 + [0.05, 0.4][effect.variant] * effect.amplitude;
    let section = |ei: f64| Section { ea_n: ea, ei_nm2: (ei, ei), gj_nm2: gj };
    let (tube, ram) = (section(scale * ei * tilt), section(scale * ei / tilt));
    let guide = scale * ei * 1e4 / (effect.amplitude * effect.share(0));
    let x = axes.column(0).into_owned();
    let mut at = |s: f64| frame.node(from + z * s);
    let [tube_low, tube_end] = [at(inner_at), at(outer_at)];
    let [ram_end, ram_high] = [at(inner_at), at(outer_at)];
    frame.beam(ends.0, tube_low, x, &tube);
    frame.beam(tube_low, tube_end, x, &tube);
    frame.beam(ram_end, ram_high, x, &ram);
    frame.beam(ram_high, ends.1, x, &ram);
    frame.joint(tube_low, ram_end, from + z * inner_at, axes, [guide, guide, 0.0, 0.0, 0.0, 0.0]);
    let key = 1e7;
    frame.joint(tube_end, ram_high, from + z * outer_at, axes, [guide, guide, 0.0, 0.0, 0.0, key]);
    frame.joint(ends.0, ends.1, from, axes, [0.0, 0.0, ea / q, 0.0, 0.0, 0.0]);
}

/// Lengths of all limbs over the poses that a machine of this kind is used at.
const STROKE: (f64, f64) = (0.440, 0.720);

impl World {
    /// Works out what depends on the machine alone.
    pub fn new(nominal: Machine, machine: Machine, effects: Vec<Effect>) -> Self {
        let mut world = Self { nominal, machine, effects, telescope: [1.0; 3] };
        if let Some(effect) = world.of("telescopic-limb") {
            let q = 0.5 * (STROKE.0 + STROKE.1);
            world.telescope = std::array::from_fn(|i| {
                let limb = &world.machine.limbs[i];
                let mut frame = Frame::new();
                let tip = frame.node(Vector3::z() * q);
                let line = (Vector3::zeros(), Vector3::z(), q);
                telescope(&mut frame, (Frame::GROUND, tip), line, &Matrix3::identity(), limb, effect, 1.0, STROKE);
                let c = frame.compliance(tip).expect("a telescope stands")[(0, 0)];
                c / (q.powi(3) / (3.0 * limb.section().1))
            });
        }
        world
    }

    /// The same machine with other effects.
    pub fn with(&self, effects: Vec<Effect>) -> Self {
        Self::new(self.nominal.clone(), self.machine.clone(), effects)
    }

    fn of(&self, id: &str) -> Option<&Effect> {
        self.effects.iter().find(|e| e.id == id)
    }

    fn amplitude(&self, id: &str) -> f64 {
        self.of(id).map_or(0.0, |e| e.amplitude)
    }

    /// The machine with the geometry that it really has.
    fn built(&self) -> Machine {
        let mut m = self.machine.clone();
        for (id, i) in [("geometry-a1", 0), ("geometry-b1", 2)] {
            if let Some(e) = self.of(id) {
                m.geometry[i] += e.sign(0) * e.amplitude * 1e-3;
            }
        }
        m
    }

    /// The true pose at a commanded one.
    fn reached(&self, commanded: &Pose) -> Pose {
        self.built().pose_of(self.nominal.lengths(commanded), commanded)
    }

    fn assemble(&self, commanded: &Pose, temperature: f64) -> Assembled {
        let mut machine = self.built();
        let pose = self.reached(commanded);
        if let Some(e) = self.of("thermal-modulus") {
            let loss = e.amplitude * 1e-2 * (temperature - 20.0);
            let factor = if e.variant == 0 { 1.0 - loss } else { (-loss).exp() };
            for limb in &mut machine.limbs {
                limb.body.iter_mut().for_each(|t| {
                    t.young *= factor;
                    t.shear *= if e.variant == 0 { factor } else { 1.0 };
                });
            }
        }
        if let Some(e) = self.of("form-warm-joints") {
            let factor = (-e.amplitude * 1e-2 * (temperature - 20.0)).exp();
            for limb in &mut machine.limbs {
                let joint = if e.variant == 0 { &mut limb.base } else { &mut limb.platform };
                joint.iter_mut().for_each(|k| *k *= factor);
            }
        }
        let rotation = pose.rotation().transpose();
        let seen = |p: Vector3<f64>| rotation * (p - pose.origin());
        let (x_b, y_b, z_b) = (rotation * Vector3::x(), rotation * Vector3::y(), rotation * Vector3::z());
        let axes_b = Matrix3::from_columns(&[x_b, y_b, z_b]);
        let (base, mut platform) = machine.places();
        let base = base.map(seen);
        if let Some(e) = self.of("platform-offset").filter(|e| e.variant == 0) {
            platform.iter_mut().for_each(|p| p.z += e.sign(0) * e.amplitude * 1e-3);
        }

        let mut frame = Frame::new();
        let mut stands = [Frame::GROUND; 3];
        let in_b = |k: Matrix6<f64>| both(&axes_b) * k * both(&axes_b).transpose();
        if let Some(e) = self.of("form-base-mount") {
            let mount = frame.node(seen(Vector3::zeros()));
            frame.spring(Frame::GROUND, mount, seen(Vector3::zeros()), &in_b(forms::stiffness(e, 0)));
            stands = [mount; 3];
        }
        if let Some(e) = self.of("form-base-feet") {
            for i in 0..3 {
                stands[i] = frame.node(base[i]);
                frame.spring(Frame::GROUND, stands[i], base[i], &in_b(forms::stiffness(e, i)));
            }
        }
        if let Some(e) = self.of("base-compliance") {
            let c = e.amplitude * 1e-9;
            if e.variant == 0 {
                let mount = frame.node(seen(Vector3::zeros()));
                let k = std::array::from_fn(|i| 1.0 / (c * e.share(i) * if i < 3 { 1.0 } else { 15.0 }));
                frame.joint(Frame::GROUND, mount, seen(Vector3::zeros()), &axes_b, k);
                stands = [mount; 3];
            } else {
                // feet tilt so little that only their yielding counts
                for i in 0..3 {
                    stands[i] = frame.node(base[i]);
                    let k: [f64; 6] = std::array::from_fn(|j| if j < 3 { 1.0 / (c * e.share(j)) } else { 1e9 });
                    frame.joint(Frame::GROUND, stands[i], base[i], &axes_b, k);
                }
            }
        }
        if let Some(e) = self.of("limb-coupling") {
            let carried = [frame.node(base[0]), frame.node(base[1])];
            let k = 1e9 / e.amplitude;
            let opposed = [0.5, 3.0][e.variant] * e.share(0) * k;
            frame.modes(stands[0], &carried, &[(vec![z_b, z_b], k), (vec![z_b, -z_b], opposed)]);
            stands[..2].copy_from_slice(&carried);
        }

        let centre = frame.node(Vector3::zeros());
        let mut corners = [centre; 3];
        if let Some(e) = self.of("moving-platform-compliance") {
            corners = platform.map(|p| frame.node(p));
            let ei = 2.67e-3 / (e.amplitude * 1e-9);
            // about the normal of the plate first
            let plate = |f: f64| Section {
                ea_n: 3000.0 * f * ei,
                ei_nm2: (3.0 * e.share(0) * f * ei, f * ei),
                gj_nm2: 0.8 * e.share(1) * f * ei,
            };
            for i in 0..3 {
                // arms clamped at A, or a ring with thinner spokes
                frame.beam(centre, corners[i], Vector3::z(), &plate([1.0, 0.7][e.variant]));
                if e.variant == 1 {
                    frame.beam(corners[i], corners[(i + 1) % 3], Vector3::z(), &plate(0.5 * e.share(2)));
                }
            }
        }

        if let Some(e) = self.of("form-platform-bores") {
            corners = platform.map(|p| frame.node(p));
            for i in 0..3 {
                frame.spring(centre, corners[i], platform[i], &forms::stiffness(e, i));
            }
        }
        if let Some(e) = self.of("form-platform-ribs") {
            corners = platform.map(|p| frame.node(p));
            let ei = 2.67e-3 / (e.amplitude * 1e-9);
            for i in 0..3 {
                // arms of three sections, and a rib across to the next arm's middle
                let section =
                    |f: f64| Section { ea_n: 2000.0 * f * ei, ei_nm2: (2.0 * f * ei, f * ei), gj_nm2: 0.5 * f * ei };
                let middle = frame.node(0.6 * platform[i]);
                frame.beam(centre, middle, Vector3::z(), &section(2.0 * e.share(i)));
                frame.beam(middle, corners[i], Vector3::z(), &section(e.share(i + 1)));
                let next = (i + 1) % 3;
                if next != 0 {
                    frame.beam(middle, corners[next], Vector3::z(), &section(0.3 * e.share(i + 3)));
                }
            }
        }

        let mut limbs = Vec::new();
        let mut middles = Vec::new();
        for i in 0..3 {
            let limb = &machine.limbs[i];
            let along = platform[i] - base[i];
            let (q, z) = (along.norm(), along.normalize());
            let x = if i == 2 { y_b } else { Vector3::x() };
            let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
            let mut base_axes =
                if i == 2 { axes } else { Matrix3::from_columns(&[Vector3::x(), y_b, Vector3::x().cross(&y_b)]) };
            let mut platform_axes = axes;
            if let Some(e) = self.of("misaligned-joint-axes") {
                let turn = |k: usize| {
                    let angle =
                        Vector3::new(0.0, e.shape[2 * i + k], e.shape[(2 * i + k + 3) % 8]) * e.amplitude.to_radians();
                    *nalgebra::Rotation3::new(angle).matrix()
                };
                platform_axes *= turn(0);
                if i == 2 {
                    base_axes *= turn(1);
                }
            }

            let (at_base, at_platform) =
                if i == 2 { ("revolute-3-joint", "spherical-joint") } else { ("universal-joint", "revolute-joint") };
            let give = |id: &str, k: [f64; 6]| -> [f64; 6] {
                let Some(e) = self.of(id) else { return k };
                std::array::from_fn(|j| match (e.variant, j < 3) {
                    (0, true) => softened(k[j], e.amplitude * 1e-9 * e.share(j)),
                    (1, false) => softened(k[j], e.amplitude * 3e-7 * e.share(j)),
                    _ => k[j],
                })
            };
            let base_k = give(at_base, limb.base);
            let mut platform_k = give(at_platform, limb.platform);
            let mut drive = self.amplitude(["limb-1-axial", "limb-2-axial", "limb-3-axial"][i]) * 1e-9;
            if let Some(e) = self.of("screw-position") {
                drive += e.amplitude * 1e-9 * if e.variant == 0 { q } else { (q - machine.travel[0][i]).max(0.0) };
            }
            if let Some(e) = self.of("periodic-screw") {
                let turns = q / (0.05 + 0.02 * e.shape[i]);
                drive += e.amplitude * 1e-9 * (1.0 + (std::f64::consts::TAU * turns + 3.0 * e.shape[3]).sin());
            }
            if let Some(e) = self.of("form-screw") {
                drive += forms::screw(e, i, q);
            }
            platform_k[2] = softened(platform_k[2], drive);
            let (mut stand, mut corner) = (stands[i], corners[i]);
            let own = |id: &str| self.of(id).filter(|e| forms::limb(e) == i);
            if let Some(e) = own("form-base-joint") {
                let housing = frame.node(base[i]);
                frame.spring(stand, housing, base[i], &in_b(forms::stiffness(e, 0)));
                stand = housing;
            }
            if let Some(e) = own("form-platform-joint") {
                let housing = frame.node(platform[i]);
                frame.spring(corner, housing, platform[i], &forms::stiffness(e, 0));
                corner = housing;
            }

            // joint axes may miss the limb's own line, which is felt at a fifth of the size; the joints stay where they are
            let aside = match self.of("platform-offset") {
                Some(e) if e.variant == 1 => {
                    axes.column(if i == 2 { 0 } else { 1 }) * (0.2 * e.sign(i) * e.amplitude * 1e-3)
                }
                _ => Vector3::zeros(),
            };
            let (foot, head) = (frame.node(base[i] + aside), frame.node(platform[i] + aside));
            let coupled = |k: [f64; 6], last: bool| {
                let mut matrix = Matrix6::from_diagonal(&k.into());
                let mut couple = |id: &str, a: usize, b: usize| {
                    let e = self.of(id)?;
                    // one hand for all limbs, or each its own
                    let c = e.amplitude * e.sign(if e.variant == 0 { 0 } else { i });
                    let root = (k[a] * k[b]).sqrt();
                    for (row, column, value) in [(a, a, k[a]), (b, b, k[b]), (a, b, -c * root), (b, a, -c * root)] {
                        matrix[(row, column)] = value / (1.0 - c * c);
                    }
                    Some(())
                };
                // at the joint that holds the limb's torsion
                if last == (i != 2) {
                    _ = couple("screw-torsion-with-extension", 2, 5);
                }
                if last {
                    // along the axis of rotation: across it a limb carries no force
                    _ = couple("lateral-axial-coupling", 0, 2);
                }
                matrix
            };
            let turned = |k: Matrix6<f64>, axes: &Matrix3<f64>| both(axes) * k * both(axes).transpose();
            frame.spring(stand, foot, base[i], &turned(coupled(base_k, false), &base_axes));
            let (ea, ei, gj) = limb.section();
            if let Some(e) = self.of("telescopic-limb") {
                let line = (base[i] + aside, z, q);
                telescope(&mut frame, (foot, head), line, &axes, limb, e, self.telescope[i], STROKE);
            } else {
                let section = Section { ea_n: ea, ei_nm2: (ei, ei), gj_nm2: gj };
                if self.of("cable-carrier-between-limbs").is_some() {
                    let middle = frame.node(0.5 * (base[i] + platform[i]) + aside);
                    frame.beam(foot, middle, x, &section);
                    frame.beam(middle, head, x, &section);
                    middles.push(middle);
                } else {
                    frame.beam(foot, head, x, &section);
                }
            }
            frame.spring(head, corner, platform[i], &turned(coupled(platform_k, true), &platform_axes));
            if let Some(e) = self.of("preload") {
                // the force turns with the limb; the second form has the weaker third limb of a real machine
                let n = e.amplitude * 1e3 * if i == 2 && e.variant == 1 { 0.5 } else { 1.0 } * e.share(i);
                let mut k = Matrix6::zeros();
                k.fixed_view_mut::<3, 3>(0, 0).copy_from(&((Matrix3::identity() - z * z.transpose()) * (n / q)));
                frame.spring(Frame::GROUND, corners[i], platform[i], &k);
            }
            limbs.push((foot, head, z, ea / q));
        }
        if let Some(e) = self.of("cable-carrier-between-limbs") {
            let k = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) * (e.amplitude * 1e6);
            let at = 0.25 * (base[0] + platform[0] + base[2] + platform[2]);
            frame.spring(middles[0], middles[2], at, &k);
        }

        let mut tool = centre;
        let mut behind = |k: Matrix6<f64>| {
            let next = frame.node(Vector3::zeros());
            frame.spring(tool, next, Vector3::zeros(), &k);
            tool = next;
        };
        if let Some(e) = self.of("wrist-compliance") {
            let c = e.amplitude * 1e-9;
            let slack = if e.variant == 0 { 15.0 } else { 60.0 };
            let k: [f64; 6] = std::array::from_fn(|i| 1.0 / (c * e.share(i) * if i < 3 { 1.0 } else { slack }));
            behind(Matrix6::from_diagonal(&k.into()));
        }
        if let Some(e) = self.of("form-tool") {
            behind(forms::stiffness(e, 0));
        }
        if let Some(e) = self.of("resonant-bracket") {
            let (angle, width) = (pose.0[e.variant] - 0.15 * e.shape[0], 0.06);
            let c = 1e-14 + e.amplitude * 1e-9 * (-0.5 * (angle / width).powi(2)).exp();
            let direction = Vector3::new(e.shape[1], e.shape[2], e.shape[3]).normalize();
            let mut k = Matrix6::identity() * 1e12;
            let soft = direction * direction.transpose();
            k.fixed_view_mut::<3, 3>(0, 0).copy_from(&((Matrix3::identity() - soft) * 1e12 + soft / c));
            behind(k);
        }
        Assembled { frame, tool, limbs }
    }

    /// Whether a force along a limb can lengthen it in any other way than in proportion.
    fn depends_on_load(&self) -> bool {
        let ids = ["clearance", "contact-stiffening", "friction-hysteresis", "cubic-hardening", "form-load"];
        ids.iter().any(|id| self.of(id).is_some())
    }

    /// The machine at a commanded pose.
    pub fn reduced(&self, pose: &Pose, temperature: f64) -> Reduced {
        let Assembled { frame, tool, limbs } = self.assemble(pose, temperature);
        let c = frame.compliance(tool).expect("a machine of the box stands");
        let mut all = Reduced { c, b: SMatrix::zeros(), m: Matrix3::zeros(), path: [0.0; 3] };
        if !self.depends_on_load() {
            return all;
        }
        let solve =
            |node: Node, load: Vector6<f64>| frame.displacements(&[(node, load.into())]).expect("it stood just now");
        let stretch = |u: &nalgebra::DMatrix<f64>, i: usize| {
            let (foot, head, z, _) = &limbs[i];
            z.dot(&(Frame::of(u, *head) - Frame::of(u, *foot)))
        };
        for j in 0..6 {
            let u = solve(tool, Vector6::ith(j, 1.0));
            (0..3).for_each(|i| all.b[(i, j)] = limbs[i].3 * stretch(&u, i));
        }
        for j in 0..3 {
            // a limb that grows by 1 pushes its ends apart with k, and k is missing in its own tension
            let (foot, head, z, k) = limbs[j];
            let push = Vector6::new(z.x, z.y, z.z, 0.0, 0.0, 0.0) * k;
            let u = solve(head, push) + solve(foot, -push);
            (0..3).for_each(|i| all.m[(i, j)] = limbs[i].3 * (f64::from(u8::from(i == j)) - stretch(&u, i)));
            all.path[j] = 1.0 / k + 1.0 / self.machine.limbs[j].platform[2];
        }
        all
    }

    /// How much longer a limb is under its tension than in proportion, and the friction it then has.
    fn growth(&self, limb: usize, n: f64, before: (f64, f64), path: f64) -> (f64, f64) {
        let (n_before, friction_before) = before;
        let mut e = 0.0;
        if let Some(play) = self.of("clearance") {
            let half = 0.5e-6 * play.amplitude * play.share(limb);
            e += match play.variant {
                // inside the gap only a weak spring holds the middle
                0 => half * (n / 3.0).clamp(-1.0, 1.0),
                _ => half * (n / 15.0).atan() / std::f64::consts::FRAC_PI_2,
            };
        }
        if let Some(contact) = self.of("contact-stiffening") {
            let x = (n / 100.0).abs().max(1e-3);
            // ball against groove, N^(2/3), or a roller, about N^0.9
            e += contact.amplitude * 1e-9 * n * x.powf([-1.0 / 3.0, -0.1][contact.variant]);
        }
        if let Some(hard) = self.of("cubic-hardening") {
            let x = (n / 1000.0).powi(2);
            e -= hard.amplitude * 1e-9 * n * x / (1.0 + x);
        }
        if let Some(form) = self.of("form-load") {
            e += forms::growth(form, limb, n);
        }
        let mut friction = 0.0;
        if let Some(rub) = self.of("friction-hysteresis") {
            let limit = rub.amplitude * rub.share(limb);
            let step = n - n_before;
            friction = match rub.variant {
                // a spring of its own in a row with a slider, beside the limb's path
                0 => (friction_before + 0.5 * step).clamp(-limit, limit),
                // the same with a round knee
                _ if step == 0.0 => friction_before,
                _ => {
                    let end = limit * step.signum();
                    end + (friction_before - end) * (-0.5 * step.abs() / limit).exp()
                }
            };
            e -= path * friction;
        }
        (e, friction)
    }

    /// Solves N + M ε(N) = B w by damped Newton steps.
    fn tensions(&self, at: &Reduced, w: &Wrench, before: &[(f64, f64); 3]) -> Vector3<f64> {
        let free = at.b * w;
        let growth = |n: &Vector3<f64>| Vector3::from_fn(|i, _| self.growth(i, n[i], before[i], at.path[i]).0);
        let miss = |n: &Vector3<f64>| n + at.m * growth(n) - free;
        let mut n = free;
        for _ in 0..80 {
            let now = miss(&n);
            if now.norm() < 1e-9 * (1.0 + free.norm()) {
                break;
            }
            let slope = Vector3::from_fn(|i, _| {
                let (h, g) = (1e-4 * (1.0 + n[i].abs()), |v| self.growth(i, v, before[i], at.path[i]).0);
                (g(n[i] + h) - g(n[i] - h)) / (2.0 * h)
            });
            let jacobian = Matrix3::identity() + at.m * Matrix3::from_diagonal(&slope);
            let Some(step) = jacobian.lu().solve(&now) else { break };
            let mut share = 1.0;
            while share > 1e-3 && miss(&(n - step * share)).norm() > now.norm() * (1.0 - 0.1 * share) {
                share *= 0.5;
            }
            n -= step * share;
        }
        n
    }

    /// Deflection of the platform at the commanded A-uvw for every row, in time order; what only the sensor makes of
    /// it is left out unless asked for.
    pub fn deflections(&self, poses: &[Pose], rows: &[Row], sensed: bool) -> Vec<Vector6<f64>> {
        let thermal = self.of("thermal-modulus").or(self.of("form-warm-joints")).is_some();
        // a smooth function of temperature: three points of it are enough
        let nodes: &[f64] = if thermal { &[15.0, 22.0, 29.0] } else { &[20.0] };
        let prepared: Vec<_> = poses
            .iter()
            .map(|pose| {
                let true_pose = self.reached(pose);
                let (r, _) = pose.motion_to(&true_pose);
                let turn = pose.rotation().transpose() * true_pose.rotation();
                (nodes.iter().map(|t| self.reduced(pose, *t)).collect::<Vec<_>>(), shifted(&turn, &r))
            })
            .collect();
        let mut state = [(0.0, 0.0); 3];
        let mut series = usize::MAX;
        let mut all = Vec::with_capacity(rows.len());
        for row in rows {
            if row.series != series {
                (state, series) = ([(0.0, 0.0); 3], row.series);
            }
            let (nodes_here, carry) = &prepared[row.pose];
            let at = interpolated(nodes, nodes_here, row.temperature);
            let w = carry.transpose() * self.acting(&row.applied, sensed);
            let mut d = at.c * w;
            if self.depends_on_load() {
                let n = self.tensions(&at, &w, &state);
                let found: [(f64, f64); 3] = std::array::from_fn(|i| self.growth(i, n[i], state[i], at.path[i]));
                d += at.b.transpose() * Vector3::from_fn(|i, _| found[i].0);
                state = std::array::from_fn(|i| (n[i], found[i].1));
            }
            d = carry * d;
            if let Some(e) = self.of("thermal-expansion") {
                let pose = &poses[row.pose];
                let mut q = self.nominal.lengths(pose);
                let strain = e.amplitude * 1e-6 * (row.temperature - 20.0);
                for (i, q) in q.iter_mut().enumerate() {
                    *q *= 1.0 + strain * if e.variant == 0 { 1.0 } else { e.share(i) };
                }
                let (shift, turn) = pose.motion_to(&self.built().pose_of(q, &self.reached(pose)));
                let (shift_0, turn_0) = pose.motion_to(&self.reached(pose));
                let (shift, turn) = (shift - shift_0, turn - turn_0);
                d += Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
            }
            all.push(if sensed { self.read(d) } else { d });
        }
        all
    }

    /// What acts when `w` was meant to.
    fn acting(&self, w: &Wrench, sensed: bool) -> Wrench {
        let mut w = *w;
        if let Some(e) = self.of("load-gain").filter(|_| sensed) {
            w *= 1.0 + e.sign(0) * e.amplitude * 1e-2;
        }
        if let Some(e) = self.of("load-point").filter(|_| sensed) {
            let r = Vector3::new(e.shape[0], e.shape[1], e.shape[2]).normalize() * (e.amplitude * 1e-3);
            let f: Vector3<f64> = w.fixed_rows::<3>(0).into();
            let m = w.fixed_rows::<3>(3) + r.cross(&f);
            w.fixed_rows_mut::<3>(3).copy_from(&m);
        }
        w
    }

    /// What the sensor makes of a deflection.
    fn read(&self, mut d: Vector6<f64>) -> Vector6<f64> {
        if let Some(e) = self.of("sensor-rotation") {
            let axis = Vector3::new(e.shape[0], e.shape[1], e.shape[2]).normalize();
            d = both(nalgebra::Rotation3::new(axis * (e.amplitude * 1e-3)).matrix()) * d;
        }
        if let Some(e) = self.of("sensor-scale") {
            (0..3).for_each(|i| d[i] *= 1.0 + e.sign(0) * e.amplitude * 1e-2);
        }
        if let Some(e) = self.of("form-sensor") {
            d = forms::sensed(e, &d);
        }
        d
    }
}

/// Lagrange's polynomial through the nodes.
fn interpolated(nodes: &[f64], values: &[Reduced], t: f64) -> Reduced {
    let mut sum = Reduced { c: Matrix6::zeros(), b: SMatrix::zeros(), m: Matrix3::zeros(), path: [0.0; 3] };
    for (i, value) in values.iter().enumerate() {
        let others = nodes.iter().enumerate().filter(|(j, _)| *j != i);
        let weight: f64 = others.map(|(_, n)| (t - n) / (nodes[i] - n)).product();
        sum.c += value.c * weight;
        sum.b += value.b * weight;
        sum.m += value.m * weight;
        (0..3).for_each(|k| sum.path[k] += value.path[k] * weight);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSE: Pose = Pose([0.12, -0.08, 0.54]);

    fn effect(id: &'static str, variant: usize, amplitude: f64) -> Effect {
        Effect { id, variant, amplitude, shape: [0.0; 8] }
    }

    fn world(effects: Vec<Effect>) -> World {
        World::new(Machine::reference(), Machine::reference(), effects)
    }

    /// A load up to its top and down again in equal steps along one axis.
    fn ramp(axis: usize, top: f64, steps: usize) -> Vec<Row> {
        let up = (1..=steps).map(|i| (i, false));
        let down = (1..steps).rev().map(|i| (i, true));
        let row = |(i, unload): (usize, bool)| {
            let wrench = Wrench::ith(axis, top * i as f64 / steps as f64);
            Row { pose: 0, wrench, applied: wrench, series: 1, repeat: 1, unload, temperature: 20.0 }
        };
        up.chain(down).map(row).collect()
    }

    #[test]
    fn without_effects_it_is_linear_and_symmetric() {
        let w = world(Vec::new());
        let c = w.reduced(&POSE, 20.0).c;
        assert!((c - c.transpose()).norm() < 1e-9 * c.norm() && c.symmetric_eigenvalues().min() > 0.0);
        let d = w.deflections(&[POSE], &ramp(1, 1000.0, 2), true);
        assert!((d[1] - d[0] * 2.0).norm() < 1e-12 * d[1].norm() && (d[2] - d[0]).norm() < 1e-15);
    }

    #[test]
    fn a_longer_limb_moves_the_tool_by_what_its_tension_says() {
        // a spring in a row with limb 1, solved as a frame and by the reduction: C + bᵀb c/(1 + m c). The tensions of
        // the plain machine follow from balance alone, and m is 0; ground springs have a part in them
        let others = effect("preload", 0, 10.0);
        for others in [vec![], vec![others]] {
            let nothing = [others, vec![effect("clearance", 0, 0.0)]].concat();
            let Reduced { c, b, m, .. } = world(nothing.clone()).reduced(&POSE, 20.0);
            assert_eq!(m.norm() > 1.0, nothing.len() > 1, "{m}");
            assert!((m - m.transpose()).norm() < 1e-4 * m.norm() + 1e-3, "{m}");
            let softer = world([nothing, vec![effect("limb-1-axial", 0, 5.0)]].concat()).reduced(&POSE, 20.0).c;
            let row = b.row(0);
            let expected = c + row.transpose() * row * (5e-9 / (1.0 + m[(0, 0)] * 5e-9));
            let miss = (softer - expected).norm() / (softer - c).norm();
            assert!(miss < 1e-5, "{miss:e}");
        }
    }

    #[test]
    fn a_gap_costs_its_width_and_no_more() {
        let rows = ramp(0, 1000.0, 20);
        let (with, without) = (world(vec![effect("clearance", 0, 10.0)]), world(Vec::new()));
        let (d, linear) = (with.deflections(&[POSE], &rows, true), without.deflections(&[POSE], &rows, true));
        let extra: Vec<f64> = (0..20).map(|i| d[i][0] - linear[i][0]).collect();
        // closed from a few newtons on, then constant
        assert!(extra[0] > 1e-6 && (extra[19] - extra[9]).abs() < 0.05 * extra[19], "{extra:?}");
        let b = with.reduced(&POSE, 20.0).b;
        let most: f64 = (0..3).map(|i| b[(i, 0)].abs() * 5e-6).sum();
        assert!(extra.iter().all(|e| *e <= most * 1.0001), "{} > {most}", extra[19]);
    }

    #[test]
    fn hertz_is_softer_at_small_loads() {
        let d = |w: &World| w.deflections(&[POSE], &ramp(2, 1000.0, 10), true);
        let (with, without) = (d(&world(vec![effect("contact-stiffening", 0, 2.0)])), d(&world(Vec::new())));
        let extra = |i: usize| (with[i][2] - without[i][2]) / (i + 1) as f64;
        // N^(2/3): ten times the load, 10^(-1/3) of the extra compliance, as far as the limbs' forces stay in proportion
        let ratio = extra(9) / extra(0);
        assert!((ratio / 10_f64.powf(-1.0 / 3.0) - 1.0).abs() < 0.05, "{ratio}");
    }

    #[test]
    fn friction_opens_a_loop_that_takes_energy_and_closes_without_it() {
        for variant in 0..2 {
            let rows = ramp(0, 1000.0, 10);
            let d = |limit: f64| {
                world(vec![effect("friction-hysteresis", variant, limit)]).deflections(&[POSE], &rows, true)
            };
            let (loop_, none, stuck) = (d(60.0), d(1e-9), d(1e9));
            let linear = world(Vec::new()).deflections(&[POSE], &rows, true);
            for i in 0..9 {
                let unload = rows.len() - 1 - i;
                assert!(loop_[unload][0] > loop_[i][0], "form {variant}: at the same load it stays behind");
                assert!((none[unload] - linear[i]).norm() < 1e-6 * linear[i].norm());
                assert!((stuck[unload] - stuck[i]).norm() < 1e-6 * linear[i].norm());
            }
            assert!(stuck[9][0] < loop_[9][0] && loop_[9][0] < linear[9][0]);
        }
    }

    #[test]
    fn weak_effects_vanish() {
        let bare = world(Vec::new()).deflections(&[POSE], &ramp(1, 1000.0, 2), true);
        for spec in crate::effects::LISTED
            .iter()
            .chain([&crate::effects::COUPLING])
            .chain(&crate::effects::OUTSIDE)
            .chain(&forms::FORMS)
        {
            for variant in 0..spec.variants {
                // a telescope has no such limit
                if spec.id == "telescopic-limb" {
                    continue;
                }
                let mut e = effect(spec.id, variant, 1e-5 * spec.range.1);
                e.shape = [0.3, -0.4, 0.5, -0.6, 0.7, -0.2, 0.1, 0.9];
                let d = world(vec![e]).deflections(&[POSE], &ramp(1, 1000.0, 2), true);
                let change = (d[1] - bare[1]).norm() / bare[1].norm();
                assert!(change < 2e-3, "{} form {variant}: {change:e}", spec.id);
            }
        }
    }

    #[test]
    fn a_telescope_is_the_declared_rod_at_mid_stroke_and_softer_when_long() {
        let e = effect("telescopic-limb", 0, 1.0);
        let w = world(vec![e.clone()]);
        let limb = &w.machine.limbs[0];
        let tip = |q: f64| {
            let mut frame = Frame::new();
            let tip = frame.node(Vector3::z() * q);
            let line = (Vector3::zeros(), Vector3::z(), q);
            telescope(&mut frame, (Frame::GROUND, tip), line, &Matrix3::identity(), limb, &e, w.telescope[0], STROKE);
            let c = frame.compliance(tip).unwrap();
            assert!((c[(2, 2)] / (q / limb.section().0) - 1.0).abs() < 1e-9, "the screw carries along the limb");
            c[(0, 0)] / (q.powi(3) / (3.0 * limb.section().1))
        };
        assert!((tip(0.58) - 1.0).abs() < 1e-9 && tip(0.70) > 1.02 && tip(0.46) < 0.98);
    }

    #[test]
    fn a_hot_machine_is_softer_and_longer() {
        let mut rows = ramp(0, 1000.0, 1);
        rows[0].temperature = 26.0;
        let d = |e: Vec<Effect>| world(e).deflections(&[POSE], &rows, true)[0];
        let bare = d(Vec::new());
        assert!(d(vec![effect("thermal-modulus", 0, 0.1)])[0] > bare[0]);
        // all lengths by the same share: nearly along the line from B to A, by more than that share of it
        let grown = d(vec![effect("thermal-expansion", 0, 1.0)]) - bare;
        let far = Vector3::new(grown[0], grown[1], grown[2]).norm();
        assert!((3e-6..2e-5).contains(&far), "{far}");
    }
}

//! The dense frame of a machine at a pose, with what the true one has beyond the declared.

use nalgebra::{Matrix3, Matrix6, Vector3, Vector6};
use pkm_frame::{Frame, Node, Section};

use super::{World, both};
use crate::effects::Effect;
use crate::forms;
use crate::machine::{Limb, Machine, Pose};

/// Lengths of all limbs over the poses that a machine of this kind is used at.
pub(super) const STROKE: (f64, f64) = (0.440, 0.720);

/// The frame at a pose and what must be asked of it.
pub(super) struct Assembled {
    pub frame: Frame,
    pub tool: Node,
    /// Foot, head, direction and stiffness along it of each limb's body.
    pub limbs: Vec<(Node, Node, Vector3<f64>, f64)>,
}

fn softened(stiffness: f64, compliance: f64) -> f64 {
    if stiffness == 0.0 { 0.0 } else { 1.0 / (1.0 / stiffness + compliance) }
}

/// A tube at the base and a ram at the platform: two guides at the ends of their overlap, a key, the screw inside. Gives the tube's end.
#[allow(clippy::too_many_arguments)]
pub(super) fn telescope(
    frame: &mut Frame,
    ends: (Node, Node),
    (from, z, q): (Vector3<f64>, Vector3<f64>, f64),
    axes: &Matrix3<f64>,
    limb: &Limb,
    effect: &Effect,
    scale: f64,
    stroke: (f64, f64),
) -> Node {
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
    tube_end
}

/// A limb's place at a pose, in A-uvw: number, ends, length, and axes x, y, z as columns.
struct Line {
    i: usize,
    base: Vector3<f64>,
    platform: Vector3<f64>,
    q: f64,
    axes: Matrix3<f64>,
    /// How far its joints are beside its own line.
    aside: Vector3<f64>,
}

/// A frame on the way: what the parts before have left for the next ones.
struct Builder<'a> {
    world: &'a World,
    /// With its true geometry, at the temperature of the pose.
    machine: Machine,
    frame: Frame,
    /// The axes of B in A-uvw, as columns.
    axes_b: Matrix3<f64>,
    /// The origin of B in A-uvw.
    origin_b: Vector3<f64>,
    base: [Vector3<f64>; 3],
    platform: [Vector3<f64>; 3],
}

impl Assembled {
    /// The frame of a world at a commanded pose.
    pub fn new(world: &World, commanded: &Pose, temperature: f64) -> Self {
        let pose = world.reached(commanded);
        let rotation = pose.rotation().transpose();
        let seen = |p: Vector3<f64>| rotation * (p - pose.origin());
        let machine = at_temperature(world, temperature);
        let (base, mut platform) = machine.places();
        if let Some(e) = world.of("platform-offset").filter(|e| e.variant == 0) {
            platform.iter_mut().for_each(|p| p.z += e.sign(0) * e.amplitude * 1e-3);
        }
        let mut builder = Builder {
            world,
            machine,
            frame: Frame::new(),
            axes_b: rotation,
            origin_b: seen(Vector3::zeros()),
            base: base.map(seen),
            platform,
        };
        let stands = builder.base();
        let centre = builder.frame.node(Vector3::zeros());
        let corners = builder.platform(centre);
        let limbs = builder.limbs(&stands, &corners);
        builder.hose(centre);
        let tool = builder.tool(centre, &pose);
        Self { frame: builder.frame, tool, limbs }
    }
}

/// The machine as it was built, with what warmth makes of its moduli and joints.
fn at_temperature(world: &World, temperature: f64) -> Machine {
    let mut machine = world.built();
    if let Some(e) = world.of("thermal-modulus") {
        let loss = e.amplitude * 1e-2 * (temperature - 20.0);
        let factor = if e.variant == 0 { 1.0 - loss } else { (-loss).exp() };
        for limb in &mut machine.limbs {
            limb.body.iter_mut().for_each(|t| {
                t.young *= factor;
                t.shear *= if e.variant == 0 { factor } else { 1.0 };
            });
        }
    }
    if let Some(e) = world.of("form-warm-joints") {
        let factor = (-e.amplitude * 1e-2 * (temperature - 20.0)).exp();
        for limb in &mut machine.limbs {
            let joint = if e.variant == 0 { &mut limb.base } else { &mut limb.platform };
            joint.iter_mut().for_each(|k| *k *= factor);
        }
    }
    machine
}

/// A stiffness in other axes.
fn turned(k: Matrix6<f64>, axes: &Matrix3<f64>) -> Matrix6<f64> {
    both(axes) * k * both(axes).transpose()
}

impl Builder<'_> {
    fn of(&self, id: &str) -> Option<&'_ Effect> {
        self.world.of(id)
    }

    /// What the limbs stand on: the ground, or what gives between it and them.
    fn base(&mut self) -> [Node; 3] {
        let Self { world, frame, axes_b, origin_b, base, .. } = self;
        let mut stands = [Frame::GROUND; 3];
        if let Some(e) = world.of("form-base-mount") {
            let mount = frame.node(*origin_b);
            frame.spring(Frame::GROUND, mount, *origin_b, &turned(forms::stiffness(e, 0), axes_b));
            stands = [mount; 3];
        }
        if let Some(e) = world.of("form-base-feet") {
            for i in 0..3 {
                stands[i] = frame.node(base[i]);
                frame.spring(Frame::GROUND, stands[i], base[i], &turned(forms::stiffness(e, i), axes_b));
            }
        }
        if let Some(e) = world.of("base-compliance") {
            let c = e.amplitude * 1e-9;
            if e.variant == 0 {
                let mount = frame.node(*origin_b);
                let k = std::array::from_fn(|i| 1.0 / (c * e.share(i) * if i < 3 { 1.0 } else { 15.0 }));
                frame.joint(Frame::GROUND, mount, *origin_b, axes_b, k);
                stands = [mount; 3];
            } else {
                // feet tilt so little that only their yielding counts
                for i in 0..3 {
                    stands[i] = frame.node(base[i]);
                    let k: [f64; 6] = std::array::from_fn(|j| if j < 3 { 1.0 / (c * e.share(j)) } else { 1e9 });
                    frame.joint(Frame::GROUND, stands[i], base[i], axes_b, k);
                }
            }
        }
        if let Some(e) = world.of("limb-coupling") {
            let carried = [frame.node(base[0]), frame.node(base[1])];
            let k = 1e9 / e.amplitude;
            let opposed = [0.5, 3.0][e.variant] * e.share(0) * k;
            let z_b = axes_b.column(2).into_owned();
            frame.modes(stands[0], &carried, &[(vec![z_b, z_b], k), (vec![z_b, -z_b], opposed)]);
            stands[..2].copy_from_slice(&carried);
        }
        stands
    }

    /// What the limbs hold on the moving platform: its centre, or what gives between it and them.
    fn platform(&mut self, centre: Node) -> [Node; 3] {
        let Self { world, frame, platform, .. } = self;
        let mut corners = [centre; 3];
        if let Some(e) = world.of("moving-platform-compliance") {
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
        if let Some(e) = world.of("form-platform-bores") {
            corners = platform.map(|p| frame.node(p));
            for i in 0..3 {
                frame.spring(centre, corners[i], platform[i], &forms::stiffness(e, i));
            }
        }
        if let Some(e) = world.of("form-platform-ribs") {
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
        corners
    }

    /// The limbs, and what ties two of them.
    fn limbs(&mut self, stands: &[Node; 3], corners: &[Node; 3]) -> Vec<(Node, Node, Vector3<f64>, f64)> {
        let mut limbs = Vec::new();
        let mut middles = Vec::new();
        for i in 0..3 {
            let line = self.line(i);
            let (stand, corner) = self.housings(&line, stands[i], corners[i]);
            let foot = self.frame.node(line.base + line.aside);
            let head = self.frame.node(line.platform + line.aside);
            let [(base_k, base_axes), (platform_k, platform_axes)] = self.joints(&line);
            self.frame.spring(stand, foot, line.base, &turned(self.coupled(i, base_k, false), &base_axes));
            middles.extend(self.body(&line, foot, head));
            self.frame.spring(head, corner, line.platform, &turned(self.coupled(i, platform_k, true), &platform_axes));
            let z = line.axes.column(2).into_owned();
            if let Some(e) = self.of("preload") {
                // the force turns with the limb; the second form has the weaker third limb of a real machine
                let n = e.amplitude * 1e3 * if i == 2 && e.variant == 1 { 0.5 } else { 1.0 } * e.share(i);
                let mut k = Matrix6::zeros();
                let across = (Matrix3::identity() - z * z.transpose()) * (n / line.q);
                k.fixed_view_mut::<3, 3>(0, 0).copy_from(&across);
                self.frame.spring(Frame::GROUND, corners[i], line.platform, &k);
            }
            limbs.push((foot, head, z, self.machine.limbs[i].section().0 / line.q));
        }
        if let Some(e) = self.world.of("cable-carrier-between-limbs") {
            let k = Matrix6::from_diagonal(&Vector6::new(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)) * (e.amplitude * 1e6);
            let at = 0.25 * (self.base[0] + self.platform[0] + self.base[2] + self.platform[2]);
            self.frame.spring(middles[0], middles[2], at, &k);
        }
        limbs
    }

    /// A pack of hoses from a bracket at the frame, beside the limbs, to the platform's other side: it springs along its line, and a fifth as much
    /// across.
    fn hose(&mut self, centre: Node) {
        let Some(e) = self.of("hose-from-base") else { return };
        let (beside, to) = [([0, 2], 1), ([1, 1], 2)][e.variant];
        let out = 0.5 * (self.base[beside[0]] + self.base[beside[1]]) - self.origin_b;
        let from = self.origin_b + out * (1.5 * e.share(0)) + self.axes_b.column(2) * (0.4 * out.norm() * e.share(1));
        let to = 0.5 * e.share(2) * self.platform[to] + Vector3::z() * (0.1 * e.shape[3] * out.norm());
        let d = (to - from).normalize();
        let mut k = Matrix6::zeros();
        let spring = d * d.transpose() * 0.8 + Matrix3::identity() * 0.2;
        k.fixed_view_mut::<3, 3>(0, 0).copy_from(&(spring * (e.amplitude * 1e6)));
        self.frame.spring(Frame::GROUND, centre, to, &k);
    }

    fn line(&self, i: usize) -> Line {
        let (base, platform) = (self.base[i], self.platform[i]);
        let along = platform - base;
        let z = along.normalize();
        let x = if i == 2 { self.axes_b.column(1).into_owned() } else { Vector3::x() };
        let axes = Matrix3::from_columns(&[x, z.cross(&x), z]);
        // joint axes may miss the limb's own line, which is felt at a fifth of the size; the joints stay where they are
        let aside = match self.of("platform-offset") {
            Some(e) if e.variant == 1 => {
                axes.column(if i == 2 { 0 } else { 1 }) * (0.2 * e.sign(i) * e.amplitude * 1e-3)
            }
            _ => Vector3::zeros(),
        };
        Line { i, base, platform, q: along.norm(), axes, aside }
    }

    /// Housings that give, in front of a limb's joints.
    fn housings(&mut self, line: &Line, mut stand: Node, mut corner: Node) -> (Node, Node) {
        let Self { world, frame, axes_b, .. } = self;
        let own = |id: &str| world.of(id).filter(|e| forms::limb(e) == line.i);
        if let Some(e) = own("form-base-joint") {
            let housing = frame.node(line.base);
            frame.spring(stand, housing, line.base, &turned(forms::stiffness(e, 0), axes_b));
            stand = housing;
        }
        if let Some(e) = own("form-platform-joint") {
            let housing = frame.node(line.platform);
            frame.spring(corner, housing, line.platform, &forms::stiffness(e, 0));
            corner = housing;
        }
        (stand, corner)
    }

    /// Stiffness and axes of a limb's joints at base and platform.
    fn joints(&self, line: &Line) -> [([f64; 6], Matrix3<f64>); 2] {
        let i = line.i;
        let y_b = self.axes_b.column(1).into_owned();
        let mut base_axes =
            if i == 2 { line.axes } else { Matrix3::from_columns(&[Vector3::x(), y_b, Vector3::x().cross(&y_b)]) };
        let mut platform_axes = line.axes;
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
        let limb = &self.machine.limbs[i];
        let mut platform_k = give(at_platform, limb.platform);
        platform_k[2] = softened(platform_k[2], self.drive(line));
        [(give(at_base, limb.base), base_axes), (platform_k, platform_axes)]
    }

    /// Compliance of a limb's drive beyond the declared one.
    fn drive(&self, &Line { i, q, .. }: &Line) -> f64 {
        let mut drive = self.world.amplitude(["limb-1-axial", "limb-2-axial", "limb-3-axial"][i]) * 1e-9;
        if let Some(e) = self.of("screw-position") {
            drive += e.amplitude * 1e-9 * if e.variant == 0 { q } else { (q - self.machine.travel[0][i]).max(0.0) };
        }
        if let Some(e) = self.of("periodic-screw") {
            let turns = q / (0.05 + 0.02 * e.shape[i]);
            drive += e.amplitude * 1e-9 * (1.0 + (std::f64::consts::TAU * turns + 3.0 * e.shape[3]).sin());
        }
        if let Some(e) = self.of("form-screw") {
            drive += forms::screw(e, i, q);
        }
        drive
    }

    /// A joint's stiffness with what couples its directions; `last` is the one at the platform.
    fn coupled(&self, i: usize, k: [f64; 6], last: bool) -> Matrix6<f64> {
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
    }

    /// The body between foot and head; where something is tied to it, its middle or a telescope's tube.
    fn body(&mut self, line: &Line, foot: Node, head: Node) -> Option<Node> {
        let Self { world, frame, machine, .. } = self;
        let limb = &machine.limbs[line.i];
        let (from, z) = (line.base + line.aside, line.axes.column(2).into_owned());
        if let Some(e) = world.of("telescopic-limb") {
            let (axes, scale) = (&line.axes, world.telescope[line.i]);
            let tube = telescope(frame, (foot, head), (from, z, line.q), axes, limb, e, scale, STROKE);
            return world.of("cable-carrier-between-limbs").map(|_| tube);
        }
        let (ea, ei, gj) = limb.section();
        let section = Section { ea_n: ea, ei_nm2: (ei, ei), gj_nm2: gj };
        let x = line.axes.column(0).into_owned();
        if world.of("cable-carrier-between-limbs").is_none() {
            frame.beam(foot, head, x, &section);
            return None;
        }
        let middle = frame.node(0.5 * (line.base + line.platform) + line.aside);
        frame.beam(foot, middle, x, &section);
        frame.beam(middle, head, x, &section);
        Some(middle)
    }

    /// What the tool is held by, behind the platform's centre.
    fn tool(&mut self, centre: Node, pose: &Pose) -> Node {
        let Self { world, frame, .. } = self;
        let mut tool = centre;
        let mut behind = |k: Matrix6<f64>| {
            let next = frame.node(Vector3::zeros());
            frame.spring(tool, next, Vector3::zeros(), &k);
            tool = next;
        };
        if let Some(e) = world.of("wrist-compliance") {
            let c = e.amplitude * 1e-9;
            let slack = if e.variant == 0 { 15.0 } else { 60.0 };
            let k: [f64; 6] = std::array::from_fn(|i| 1.0 / (c * e.share(i) * if i < 3 { 1.0 } else { slack }));
            behind(Matrix6::from_diagonal(&k.into()));
        }
        if let Some(e) = world.of("form-tool") {
            behind(forms::stiffness(e, 0));
        }
        if let Some(e) = world.of("resonant-bracket") {
            let (angle, width) = (pose.0[e.variant] - 0.15 * e.shape[0], 0.06);
            let c = 1e-14 + e.amplitude * 1e-9 * (-0.5 * (angle / width).powi(2)).exp();
            let direction = Vector3::new(e.shape[1], e.shape[2], e.shape[3]).normalize();
            let mut k = Matrix6::identity() * 1e12;
            let soft = direction * direction.transpose();
            k.fixed_view_mut::<3, 3>(0, 0).copy_from(&((Matrix3::identity() - soft) * 1e12 + soft / c));
            behind(k);
        }
        tool
    }
}

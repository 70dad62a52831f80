//! What the sensor would read without noise: a dense frame of the true machine at each pose, and beyond it three
//! forces along the limbs that answer to gaps, contacts and friction.

mod assembly;
#[cfg(test)]
mod tests;

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use pkm_frame::{Frame, Node};

use self::assembly::{Assembled, STROKE, telescope};
use crate::effects::Effect;
use crate::forms;
use crate::machine::{Machine, Pose};
use crate::mounts;

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

    /// Whether a force along a limb can lengthen it in any other way than in proportion.
    fn depends_on_load(&self) -> bool {
        let ids = ["clearance", "contact-stiffening", "friction-hysteresis", "cubic-hardening", "form-load"];
        ids.iter().any(|id| self.of(id).is_some())
    }

    /// The machine at a commanded pose.
    pub fn reduced(&self, pose: &Pose, temperature: f64) -> Reduced {
        let Assembled { frame, tool, limbs } = Assembled::new(self, pose, temperature);
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
            if let Some(e) = self.of("loose-tool-holder") {
                d += mounts::of_holder(e, &w);
            }
            if let Some(e) = self.of("foot-that-lifts") {
                d += mounts::of_foot(e, &self.reached(&poses[row.pose]), &w);
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

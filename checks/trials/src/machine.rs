//! A machine and its kinematics, written apart from the core on purpose: the core must not be its own truth.

use std::f64::consts::PI;
use std::fmt::Write as _;

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::Random;

/// A round section, m and Pa.
#[derive(Clone, Copy, Debug)]
pub struct Tube {
    /// Young's modulus.
    pub young: f64,
    /// Shear modulus.
    pub shear: f64,
    /// Outer diameter.
    pub outer: f64,
    /// Inner diameter.
    pub inner: f64,
}

impl Tube {
    fn area(&self) -> f64 {
        PI * (self.outer.powi(2) - self.inner.powi(2)) / 4.0
    }

    fn inertia(&self) -> f64 {
        PI * (self.outer.powi(4) - self.inner.powi(4)) / 64.0
    }
}

/// A limb: stiffnesses of its joints along and about their axes (0: released), and two tubes side by side.
#[derive(Clone, Copy, Debug)]
pub struct Limb {
    /// At B_i, N/m and N·m/rad.
    pub base: [f64; 6],
    /// At A_i.
    pub platform: [f64; 6],
    /// Rod and lead screw.
    pub body: [Tube; 2],
}

impl Limb {
    /// EA, EI and GJ of the body.
    pub fn section(&self) -> (f64, f64, f64) {
        let sum = |f: &dyn Fn(&Tube) -> f64| self.body.iter().map(f).sum::<f64>();
        (sum(&|t| t.young * t.area()), sum(&|t| t.young * t.inertia()), sum(&|t| 2.0 * t.shear * t.inertia()))
    }
}

/// One declared stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// An entry of the joint at B_i.
    Base(usize),
    /// An entry of the joint at A_i.
    Platform(usize),
    /// Young's modulus of the body.
    Young,
    /// Shear modulus of the body.
    Shear,
}

/// What a machine file says, in SI.
#[derive(Clone, Debug)]
pub struct Machine {
    /// a1, a2, b1, b2.
    pub geometry: [f64; 4],
    /// Least and greatest screw lengths.
    pub travel: [[f64; 3]; 2],
    /// In order.
    pub limbs: [Limb; 3],
}

/// θ, σ in rad and Z0 in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose(pub [f64; 3]);

impl Pose {
    /// Axes of A-uvw in B, as columns.
    pub fn rotation(&self) -> Matrix3<f64> {
        let y = Rotation3::from_axis_angle(&Vector3::y_axis(), self.0[0]);
        *(y * Rotation3::from_axis_angle(&Vector3::x_axis(), self.0[1])).matrix()
    }

    /// The point A in B.
    pub fn origin(&self) -> Vector3<f64> {
        Vector3::new(self.0[2] * self.0[0].tan(), 0.0, self.0[2])
    }

    /// The small motion from here to `other`, translation of A and rotation, in the axes of A-uvw here.
    pub fn motion_to(&self, other: &Self) -> (Vector3<f64>, Vector3<f64>) {
        let turn = Rotation3::from_matrix_unchecked(self.rotation().transpose() * other.rotation());
        (self.rotation().transpose() * (other.origin() - self.origin()), turn.scaled_axis())
    }
}

impl Machine {
    /// The reference machine.
    pub fn reference() -> Self {
        let body =
            [(0.060, 0.036), (0.032, 0.0)].map(|(outer, inner)| Tube { young: 206e9, shear: 79.23e9, outer, inner });
        let side = Limb {
            base: [2.0e8, 2.0e8, 3.0e8, 0.0, 0.0, 2.0e5],
            platform: [2.5e8, 2.5e8, 2.5e8, 0.0, 3.0e5, 3.0e5],
            body,
        };
        let third = Limb {
            base: [2.5e8, 2.5e8, 2.5e8, 0.0, 4.0e5, 4.0e5],
            platform: [2.0e8, 2.0e8, 2.0e8, 0.0, 0.0, 0.0],
            body,
        };
        Self { geometry: [0.180, 0.220, 0.350, 0.380], travel: [[0.420; 3], [0.770; 3]], limbs: [side, side, third] }
    }

    /// The X150 with our stiffnesses.
    pub fn x150() -> Self {
        let body =
            [(0.030, 0.020), (0.016, 0.0)].map(|(outer, inner)| Tube { young: 206e9, shear: 79.23e9, outer, inner });
        let side = Limb {
            base: [6.0e7, 6.0e7, 9.0e7, 0.0, 0.0, 1.5e4],
            platform: [8.0e7, 8.0e7, 8.0e7, 0.0, 2.0e4, 2.0e4],
            body,
        };
        let third = Limb {
            base: [8.0e7, 8.0e7, 8.0e7, 0.0, 2.5e4, 2.5e4],
            platform: [7.0e7, 7.0e7, 7.0e7, 0.0, 0.0, 0.0],
            body,
        };
        let travel = [[0.242, 0.242, 0.210], [0.280, 0.280, 0.287]];
        Self { geometry: [0.050, 0.086, 0.050, 0.180], travel, limbs: [side, side, third] }
    }

    /// A relative of the reference machine, limbs 1 and 2 alike; numbers are rounded as a drawing has them.
    pub fn random(rng: &mut Random) -> Self {
        let mut m = Self::reference();
        for g in &mut m.geometry {
            *g = (*g * rng.between(0.9, 1.1) * 1e3).round() / 1e3;
        }
        let [mut side, _, mut third] = m.limbs;
        for limb in [&mut side, &mut third] {
            for joint in [&mut limb.base, &mut limb.platform] {
                let (linear, angular) = (rng.log_between(0.5, 2.0), rng.log_between(0.5, 2.0));
                for (i, k) in joint.iter_mut().enumerate() {
                    *k = (*k * if i < 3 { linear } else { angular } / 1e3).round() * 1e3;
                }
            }
        }
        m.limbs = [side, side, third];
        m.travel = [[0.400; 3], [0.800; 3]];
        m
    }

    /// Places of the base joints in B and of the platform joints in A-uvw.
    pub fn places(&self) -> ([Vector3<f64>; 3], [Vector3<f64>; 3]) {
        let [a1, a2, b1, b2] = self.geometry;
        let three = |one: f64, two: f64| {
            [Vector3::new(0.0, -one, 0.0), Vector3::new(0.0, one, 0.0), Vector3::new(two, 0.0, 0.0)]
        };
        (three(b1, b2), three(a1, a2))
    }

    /// Screw lengths.
    pub fn lengths(&self, pose: &Pose) -> [f64; 3] {
        let (base, platform) = self.places();
        std::array::from_fn(|i| (pose.origin() + pose.rotation() * platform[i] - base[i]).norm())
    }

    /// Whether the screws reach it.
    pub fn reaches(&self, pose: &Pose) -> bool {
        (self.lengths(pose).iter().zip(&self.travel[0])).all(|(q, least)| q >= least)
            && (self.lengths(pose).iter().zip(&self.travel[1])).all(|(q, most)| q <= most)
    }

    /// The pose of given lengths by Newton's method, from a pose near it.
    pub fn pose_of(&self, lengths: [f64; 3], near: &Pose) -> Pose {
        let mut pose = *near;
        for _ in 0..20 {
            let now = self.lengths(&pose);
            let short = Vector3::from_fn(|i, _| lengths[i] - now[i]);
            let jacobian = Matrix3::from_fn(|i, j| {
                let at = |h: f64| {
                    let mut p = pose;
                    p.0[j] += h;
                    self.lengths(&p)[i]
                };
                (at(1e-5) - at(-1e-5)) / 2e-5
            });
            let step = jacobian.lu().solve(&short).expect("no pose of the box is singular");
            (0..3).for_each(|j| pose.0[j] += step[j]);
            if step.norm() < 1e-14 {
                break;
            }
        }
        pose
    }

    /// Every declared stiffness: limb and part.
    pub fn stiffnesses(&self) -> Vec<(usize, Part)> {
        let mut all = Vec::new();
        for (i, limb) in self.limbs.iter().enumerate() {
            all.extend((0..6).filter(|j| limb.base[*j] > 0.0).map(|j| (i, Part::Base(j))));
            all.extend((0..6).filter(|j| limb.platform[*j] > 0.0).map(|j| (i, Part::Platform(j))));
            all.extend([(i, Part::Young), (i, Part::Shear)]);
        }
        all
    }

    /// Multiplies one of them.
    pub fn scale(&mut self, (limb, part): (usize, Part), factor: f64) {
        let limb = &mut self.limbs[limb];
        match part {
            Part::Base(j) => limb.base[j] *= factor,
            Part::Platform(j) => limb.platform[j] *= factor,
            Part::Young => limb.body.iter_mut().for_each(|t| t.young *= factor),
            Part::Shear => limb.body.iter_mut().for_each(|t| t.shear *= factor),
        }
    }

    /// The machine file.
    pub fn toml(&self, name: &str) -> String {
        let mut s = format!("format = 1\nname = \"{name}\"\n\n[geometry]\n");
        for (key, value) in ["a1_mm", "a2_mm", "b1_mm", "b2_mm"].iter().zip(self.geometry) {
            _ = writeln!(s, "{key} = {:.4}", value * 1e3);
        }
        let list = |values: &[f64], factor: f64| {
            let each: Vec<String> = values
                .iter()
                .map(|v| if *v == 0.0 { "0.0".to_owned() } else { format!("{:.8e}", v * factor) })
                .collect();
            format!("[{}]", each.join(", "))
        };
        _ = writeln!(s, "\n[travel]");
        for (key, values) in ["min_mm", "max_mm"].iter().zip(self.travel) {
            _ = writeln!(s, "{key} = {}", list(&values, 1e3));
        }
        for limb in &self.limbs {
            _ = writeln!(s, "\n[[limb]]");
            for (joint, k) in [("base", limb.base), ("platform", limb.platform)] {
                let (linear, angular) = (list(&k[..3], 1.0), list(&k[3..], 1.0));
                _ = writeln!(s, "[limb.{joint}_joint]\nlinear_n_per_m = {linear}\nangular_nm_per_rad = {angular}");
            }
            _ = writeln!(s, "[limb.body]\nkind = \"beam\"");
            for (key, t) in ["rod", "screw"].iter().zip(limb.body) {
                let (young, shear) = (t.young / 1e9, t.shear / 1e9);
                let (outer, inner) = (t.outer * 1e3, t.inner * 1e3);
                _ = writeln!(
                    s,
                    "{key} = {{ young_gpa = {young:.6}, shear_gpa = {shear:.6}, outer_mm = {outer:.5}, inner_mm = {inner:.5} }}"
                );
            }
        }
        s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forward_kinematics_inverts_the_lengths() {
        let m = Machine::reference();
        let pose = Pose([0.1, -0.15, 0.54]);
        let found = m.pose_of(m.lengths(&pose), &Pose([0.0, 0.0, 0.5]));
        (0..3).for_each(|i| assert!((found.0[i] - pose.0[i]).abs() < 1e-12));
    }

    #[test]
    fn lengths_are_those_of_a_real_machine() {
        // an Exechon X150 at θ = σ = 0, L = 259.5 mm
        let m = Machine { geometry: [0.050, 0.086, 0.050, 0.180], ..Machine::reference() };
        let q = m.lengths(&Pose([0.0, 0.0, 0.2595]));
        for (q, expected) in q.iter().zip([0.2595, 0.2595, 0.2760]) {
            assert!((q - expected).abs() < 1e-4, "{q}");
        }
    }
}

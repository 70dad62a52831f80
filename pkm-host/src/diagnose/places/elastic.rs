//! The elastic model as a sum of compliances on the eight transmitted wrenches: δ = P D λ, λ = Pᵀ w, P = K⁻¹ H D⁻¹.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use pkm_core::machine::Machine;
use pkm_core::{LimbFrame, MachineParameters, Pose, Transmission, Wrench};

use super::turned;
use crate::diagnose::declared::Declared;

/// Eight transmitted wrenches.
pub type V8 = SVector<f64, 8>;
/// A compliance that they meet.
pub type M8 = SMatrix<f64, 8, 8>;
/// Six components at A from eight wrenches.
pub type M68 = SMatrix<f64, 6, 8>;
/// Terminal compliance.
pub type M6 = SMatrix<f64, 6, 6>;

/// One pose of the declared machine.
pub struct Frame {
    /// Columns of H: the transmitted wrenches at A.
    pub wrenches: M68,
    /// Compliance by declared stiffness.
    pub parts: Vec<M8>,
    /// Compliance that no declared stiffness scales.
    pub rest: M8,
    /// What passes base and platform joint of each limb: forces and moments along and about its axes.
    pub joints: [[M68; 2]; 3],
    /// How these joints move along and about their axes, free turns included.
    pub motions: [[M68; 2]; 3],
    /// The forces at the platform joints along u, v, w.
    pub bores: [M68; 3],
    /// The wrench at B along the axes of B, on the whole of the base.
    pub ground: M68,
    /// Forces on the three base points, along the axes of B.
    pub points: [M68; 3],
    /// Joints of each limb.
    pub limbs: [LimbFrame<f64>; 3],
    /// Limb lengths, m.
    pub q: [f64; 3],
    /// θ, σ in rad, Z0 in m.
    pub pose: [f64; 3],
}

/// Components at a point, along axes, of wrenches given at A.
fn seen(h: &M68, columns: std::ops::Range<usize>, at: Vector3<f64>, axes: &Matrix3<f64>) -> M68 {
    let mut out = M68::zeros();
    for k in columns {
        let there = Wrench::from_vector(h.column(k).into_owned()).moved_to_a(-at);
        let along = Wrench { force_n: axes.tr_mul(&there.force_n), moment_nm: axes.tr_mul(&there.moment_nm) };
        out.set_column(k, &along.to_vector());
    }
    out
}

/// A symmetric matrix of its lower triangle.
pub fn full(lower: &M8) -> M8 {
    M8::from_fn(|i, j| lower[(i.max(j), i.min(j))])
}

impl Frame {
    /// D of the declared machine.
    pub fn compliance(&self) -> M8 {
        self.parts.iter().fold(self.rest, |sum, part| sum + part)
    }

    /// All poses of a machine.
    pub fn all(declared: &MachineParameters, stiffnesses: &[Declared], poses: &[Pose<f64>]) -> Option<Vec<Self>> {
        let machine = Machine::<f64>::new(declared).ok()?;
        let stiffer: Option<Vec<Machine<f64>>> = (stiffnesses.iter())
            .map(|s| {
                let mut changed = *declared;
                s.each(&mut changed, |v| *v *= 2.0);
                Machine::<f64>::new(&changed).ok()
            })
            .collect();
        let stiffer = stiffer?;
        poses.iter().map(|pose| Self::new(declared, &machine, &stiffer, pose)).collect()
    }

    fn new(
        declared: &MachineParameters,
        machine: &Machine<f64>,
        changed: &[Machine<f64>],
        pose: &Pose<f64>,
    ) -> Option<Self> {
        let t: Transmission<f64> = machine.transmission(pose).ok()?;
        let d = full(&t.compliance);
        let h = t.wrenches;
        let parts: Option<Vec<M8>> =
            (changed.iter()).map(|m| Some((d - full(&m.transmission(pose).ok()?.compliance)) * 2.0)).collect();
        let parts = parts?;
        let rest = d - parts.iter().fold(M8::zeros(), |a, b| a + b);
        let own = [0..3, 3..6, 6..8];
        let unit = Matrix3::identity();
        let of = |limb: usize, joint: usize| {
            let l = &t.limbs[limb];
            seen(&h, own[limb].clone(), l.joints_m[joint], &l.axes[joint])
        };
        let joints: [[M68; 2]; 3] = std::array::from_fn(|limb| [of(limb, 0), of(limb, 1)]);
        let terminal = solve(&h, &d, &M6::zeros())?.compliance;
        Some(Self {
            motions: std::array::from_fn(|limb| turned::motions(declared, &t, &terminal, limb, &joints[limb])),
            joints,
            bores: std::array::from_fn(|limb| seen(&h, own[limb].clone(), t.limbs[limb].joints_m[1], &unit)),
            ground: seen(&h, 0..8, t.base_m, &t.base_axes),
            points: std::array::from_fn(|limb| seen(&h, own[limb].clone(), t.limbs[limb].joints_m[0], &t.base_axes)),
            limbs: t.limbs,
            q: std::array::from_fn(|i| t.limbs[i].length_m),
            pose: [pose.theta_rad, pose.sigma_rad, pose.z0_m],
            wrenches: h,
            parts,
            rest,
        })
    }
}

/// One pose at some state of the unknowns.
pub struct Solved {
    /// Displacements at A by elongation in the sense of each wrench.
    pub response: M68,
    /// Terminal compliance.
    pub compliance: M6,
}

/// P and K⁻¹ for a compliance and a stiffness beside it; `None` if they are not positive definite.
pub fn solve(h: &M68, d: &M8, beside: &M6) -> Option<Solved> {
    let chol = d.cholesky()?;
    let dinv_ht = chol.solve(&h.transpose());
    let k = h * dinv_ht + beside;
    let c = k.cholesky()?.inverse();
    Some(Solved { response: c * dinv_ht.transpose(), compliance: c })
}

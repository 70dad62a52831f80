//! A controller's cycle in `f32` against `f64`: the same demand, machine and table rounded to `f32`.

use fastrand::Rng;
use nalgebra::{Matrix6, Vector3};
use pkm_core::correction::EQ_11;
use pkm_core::kinematics::SINGULARITY_MARGIN;
use pkm_core::machine::{BodyKind, Travel};
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64};
use pkm_core::{Basis, CorrectionTable, Cycle, Machine, MachineParameters, Pose, Wrench};

use crate::{between, first, keep_worst, log_between, random_parameters, scaled_difference};

/// Where demands are drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Region {
    /// The reference machine with its table, in the table's box; 1 kN and 100 N·m on each axis.
    Box,
    /// Random machines with random tables at a singularity distance of at least 0.05, angles to 69°, Z0 0.1 to 3 times
    /// a1 + b1; 1 kN and 100 N·m on each axis, or what moves the tip by 1e-3 of L.
    Machines,
    /// The reference machine with such tables and loads and without ends of travel: angles to 85°, Z0 0.05 m to 5 m, up
    /// to the singularities.
    Wide,
    /// Random machines like that: angles to 85°, Z0 0.02 to 20 times a1 + b1, up to the singularities.
    Edge,
}

/// Errors of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Errors {
    /// Of the worst screw length, m.
    pub lengths_m: f64,
    /// Of K_m, relative to √(k_ii k_jj).
    pub k_m: f64,
    /// Of the deflection: of translation or rotation, relative to itself.
    pub deflection: f64,
    /// Of the worst compensated screw length, m.
    pub compensated_m: f64,
}

impl Errors {
    /// In the order of the fields, lengths relative to one.
    pub fn relative_to(&self, length_m: f64) -> [f64; 4] {
        [self.lengths_m / length_m, self.k_m, self.deflection, self.compensated_m / length_m]
    }

    fn new(single: &Cycle<f32>, double: &Cycle<f64>) -> Self {
        let lengths = |a: Vector3<f32>, b: Vector3<f64>| (a.cast::<f64>() - b).amax();
        let relative = |a: Vector3<f32>, b: Vector3<f64>| (a.cast::<f64>() - b).norm() / b.norm();
        let k = single.corrected.factor.stiffness().matrix().cast::<f64>();
        let mut deflection = relative(single.deflection.translation_m, double.deflection.translation_m);
        keep_worst(&mut deflection, relative(single.deflection.rotation_rad, double.deflection.rotation_rad));
        Self {
            lengths_m: lengths(single.lengths.q_m, double.lengths.q_m),
            k_m: scaled_difference(&k, &double.corrected.factor.stiffness().matrix()),
            deflection,
            compensated_m: lengths(single.compensated.lengths.q_m, double.compensated.lengths.q_m),
        }
    }
}

/// A demand that `f64` answers.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Of the demand.
    pub pose: Pose<f64>,
    /// At the pose, m.
    pub longest_screw_m: f64,
    /// Of K_p or K_m, the greater, with rows and columns scaled to a diagonal of ones.
    pub condition: f64,
    /// `None` when `f32` refuses.
    pub errors: Option<Errors>,
}

struct Demand {
    pose: Pose<f64>,
    wrench: Wrench<f64>,
    tip_m: Vector3<f64>,
}

fn narrow(v: [f64; 3]) -> [f32; 3] {
    v.map(|v| v as f32)
}

/// In single precision.
pub fn narrow_pose(pose: &Pose<f64>) -> Pose<f32> {
    Pose { theta_rad: pose.theta_rad as f32, sigma_rad: pose.sigma_rad as f32, z0_m: pose.z0_m as f32 }
}

fn condition(k: Matrix6<f64>) -> f64 {
    let values = Matrix6::from_fn(|i, j| k[(i, j)] / (k[(i, i)] * k[(j, j)]).sqrt()).symmetric_eigenvalues();
    values.max() / values.min()
}

impl Demand {
    /// `None` when `f64` has no answer.
    fn case(
        &self,
        machines: (&Machine<f64>, &Machine<f32>),
        tables: (&CorrectionTable<'_, f64>, &CorrectionTable<'_, f32>),
    ) -> Option<Case> {
        let pose = narrow_pose(&self.pose);
        let (force_n, moment_nm) = (self.wrench.force_n.cast::<f32>(), self.wrench.moment_nm.cast::<f32>());
        let (wrench, tip_m) = (Wrench { force_n, moment_nm }, self.tip_m.cast::<f32>());
        let single = tables.1.cycle(machines.1, &pose, &wrench, tip_m);

        // exactly the same in f64
        let [theta_rad, sigma_rad, z0_m] = [pose.theta_rad, pose.sigma_rad, pose.z0_m].map(f64::from);
        let pose = Pose { theta_rad, sigma_rad, z0_m };
        let wrench = Wrench { force_n: force_n.cast(), moment_nm: moment_nm.cast() };
        let double = tables.0.cycle(machines.0, &pose, &wrench, tip_m.cast()).ok()?;
        let (k_p, k_m) = (machines.0.stiffness(&pose).ok()?, double.corrected.factor.stiffness());
        Some(Case {
            pose,
            longest_screw_m: double.lengths.q_m.max(),
            condition: condition(k_p.matrix()).max(condition(k_m.matrix())),
            errors: single.ok().map(|single| Errors::new(&single, &double)),
        })
    }
}

fn three(rng: &mut Rng, size: f64) -> [f64; 3] {
    std::array::from_fn(|_| between(rng, -size, size))
}

/// The factor form with the paper's terms, as far from a neutral table as the reference table is.
fn random_rows(rng: &mut Rng) -> Vec<f64> {
    let mut rows = Vec::new();
    for row in 0..6 {
        for column in 0..=row {
            let middle = if row == column { between(rng, 0.6, 1.4) } else { between(rng, -0.3, 0.3) };
            rows.extend(EQ_11.map(|term| if term == [0; 3] { middle } else { between(rng, -0.03, 0.03) }));
        }
    }
    rows
}

impl Region {
    /// Largest errors in the box, as [`Errors::relative_to`] 1 m has them.
    pub const IN_BOX: [f64; 4] = [2.5e-7, 2e-6, 1e-4, 3e-7];
    /// What 99 of 100 demands of [`Machines`](Self::Machines) stay within, lengths relative to the longest screw.
    pub const MOST_MACHINES: [f64; 4] = [2e-7, 2e-4, 5e-3, 5e-7];
    /// Largest error of a screw length relative to the longest, anywhere.
    pub const LENGTHS: f64 = 1e-6;
    /// Largest error of K_m and of the deflection anywhere, in units of [`Case::condition`] times 2^-24, which is what
    /// one rounding to `f32` does.
    pub const OF_CONDITION: f64 = 32.0;

    /// What K_m and deflection stay within for a condition. From 1 on `f32` is of no use and may be refused.
    pub fn bound(condition: f64) -> f64 {
        Self::OF_CONDITION * condition * f64::from(f32::EPSILON) / 2.0
    }

    /// A demand that `f64` answers, and what `f32` makes of it.
    pub fn draw(self, rng: &mut Rng) -> Case {
        first(|| if self == Self::Box { in_box(rng) } else { self.anywhere(rng) })
    }

    fn anywhere(self, rng: &mut Rng) -> Option<Case> {
        let kind = if rng.bool() { BodyKind::Beam } else { BodyKind::Diagonal };
        let mut parameters = random_parameters(rng, kind);
        if self == Self::Wide {
            parameters = MachineParameters { travel: Travel { min_m: [1e-6; 3], max_m: [1e3; 3] }, ..PARAMETERS };
        }
        let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
        let widest = 85_f64.to_radians();
        let (angle, low_m, high_m, margin) = match self {
            Self::Wide => (widest, 0.05, 5.0, SINGULARITY_MARGIN),
            Self::Edge => (widest, 0.02 * size, 20.0 * size, SINGULARITY_MARGIN),
            Self::Box | Self::Machines => (1.2, 0.1 * size, 3.0 * size, 0.05),
        };
        let machine = Machine::<f64>::new(&parameters).ok()?;
        let pose = Pose {
            theta_rad: between(rng, -angle, angle),
            sigma_rad: between(rng, -angle, angle),
            z0_m: log_between(rng, low_m, high_m),
        };
        let distance = machine.singularity_distance(&pose).ok()?;
        if distance.limbs_1_2.min(distance.limb_3) < margin {
            return None;
        }

        // the pose is somewhere in the table's box
        let half_width = [0.26, 0.26, 0.06 * pose.z0_m];
        let scaled = three(rng, 1.0);
        let at = [pose.theta_rad, pose.sigma_rad, pose.z0_m];
        let centre: [f64; 3] = std::array::from_fn(|i| at[i] - half_width[i] * scaled[i]);
        let rows = random_rows(rng);
        let slim: Vec<f32> = rows.iter().map(|v| *v as f32).collect();
        // no cycle asks for the diagonal form
        let unused = 6 * EQ_11.len();
        let table = Basis::<f64>::new(centre, half_width, &EQ_11)
            .and_then(|basis| CorrectionTable::<f64>::new(basis, &rows[..unused], Some(&rows)))
            .ok()?;
        let slim = Basis::<f32>::new(narrow(centre), narrow(half_width), &EQ_11)
            .and_then(|basis| CorrectionTable::<f32>::new(basis, &slim[..unused], Some(&slim)))
            .ok()?;

        // ahead in the direction of BA
        let l = pose.z0_m / pose.theta_rad.cos();
        let mut part = |low: f64, high: f64| l * between(rng, low, high);
        let (aside, ahead) = (part(-0.2, 0.2), part(0.5, 2.0));
        let (sin, cos) = pose.sigma_rad.sin_cos();
        let tip_m = Vector3::new(part(-0.2, 0.2), aside * cos + ahead * sin, ahead * cos - aside * sin);
        let (force_n, moment_nm) = (Vector3::from(three(rng, 1000.0)), Vector3::from(three(rng, 100.0)));
        let k_m = table.factor_form(&machine, &pose).ok()?.factor;
        let bent = k_m.deflection(&Wrench { force_n, moment_nm }.moved_to_a(tip_m)).ok()?;
        let share = (1e-3 * l / bent.seen_at(tip_m).translation_m.norm()).min(1.0);
        let wrench = Wrench { force_n: force_n * share, moment_nm: moment_nm * share };
        let single = Machine::<f32>::new(&parameters).ok()?;
        Demand { pose, wrench, tip_m }.case((&machine, &single), (&table, &slim))
    }
}

fn in_box(rng: &mut Rng) -> Option<Case> {
    let [theta_rad, sigma_rad, _] = three(rng, 15_f64.to_radians());
    let pose = Pose { theta_rad, sigma_rad, z0_m: between(rng, 0.5, 0.56) };
    let wrench = Wrench { force_n: three(rng, 1000.0).into(), moment_nm: three(rng, 100.0).into() };
    let [u, v, w] = three(rng, 1.0);
    let tip_m = Vector3::new(0.05 * u, 0.05 * v, 0.3 + 0.1 * w);
    Demand { pose, wrench, tip_m }.case((&MACHINE_F64, &MACHINE_F32), (&TABLE_F64, &TABLE_F32))
}

//! What crosses the border: the core's quantities as C structures.

use pkm_core::nalgebra::Matrix3;
use pkm_core::{
    Compensated, CompensatedTool, Configuration, Corrected, CorrectionTable, Cycle, Deflection, Domain, JointMotion,
    JointValues, Machine, Pose, Scalar, ScrewLengths, SingularityDistance, Stiffness, TemperatureRise, Tool,
    ToolMotion, ToolSolution, Wrench, Wrist,
};

/// Size of a `PkmMachine` in numbers of its type.
pub const PKM_MACHINE_NUMBERS: usize = size_of::<Machine<f64>>() / size_of::<f64>();

/// A checked machine. Look at it only through the functions; copy it freely, but pass none that did not come from
/// `pkm_machine` or `pkm_at_temperature`: one that was not initialised is not noticed.
#[repr(C)]
pub struct PkmMachine<T> {
    /// Not for reading.
    pub opaque: [T; PKM_MACHINE_NUMBERS],
}

/// A correction table.
pub struct PkmTable<T: 'static> {
    pub(crate) core: CorrectionTable<'static, T>,
    /// Its checksum in `f64`, whatever its numbers are kept in.
    pub(crate) checksum: u64,
}

/// A wrist: the two rotary joints between moving platform and tool.
pub struct PkmWrist<T>(pub(crate) Wrist<T>);

/// Where the moving platform stands, R_y(theta) R_x(sigma).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmPose<T> {
    /// About y of B, within a right angle either way.
    pub theta_rad: T,
    /// About u, within a right angle either way.
    pub sigma_rad: T,
    /// Height of A over B along z of B, above 0.
    pub z0_m: T,
}

/// Lengths |A_i B_i| of limbs 1, 2, 3: what the screws set.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmLengths<T> {
    /// q1, q2, q3.
    pub q_m: [T; 3],
}

/// A load on the moving platform, in the axes of A-uvw.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmWrench<T> {
    /// Along u, v, w.
    pub force_n: [T; 3],
    /// About A (or about the tip, where a function says so), around u, v, w.
    pub moment_nm: [T; 3],
}

/// How much warmer parts of a machine are than at its zero reading, K. With a single sensor all four numbers are its.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTemperatureRise<T> {
    /// Of limbs 1, 2, 3: the mean over the length of each.
    pub limbs_k: [T; 3],
    /// Of both platforms.
    pub platforms_k: T,
}

/// Displacement of the moving platform at A, in A-uvw.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmDeflection<T> {
    /// Of A along u, v, w.
    pub translation_m: [T; 3],
    /// About u, v, w.
    pub rotation_rad: [T; 3],
}

/// A point of the moving platform in A-uvw.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmPoint<T> {
    /// From A along u, v, w.
    pub uvw_m: [T; 3],
}

/// Derivatives of the screw lengths of limbs 1, 2, 3.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmJacobian<T> {
    /// By theta.
    pub by_theta_m_per_rad: [T; 3],
    /// By sigma.
    pub by_sigma_m_per_rad: [T; 3],
    /// By Z0.
    pub by_z0_m_per_m: [T; 3],
}

/// Distances to the two direct singularities, without dimension: 0 there, 1 at the most.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmSingularityDistance<T> {
    /// Of limbs 1 and 2.
    pub limbs_1_2: T,
    /// Of limb 3.
    pub limb_3: T,
}

/// Distance to the nearest end of travel.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTravelMargin<T> {
    /// Negative outside.
    pub margin_m: T,
    /// The limb it belongs to: 1, 2, 3.
    pub limb: u32,
}

/// A symmetric stiffness at A in A-uvw, order u, v, w, about u, v, w.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmStiffness<T> {
    /// By block: N/m, N/rad; N m/m, N m/rad.
    pub k_si: [[T; 6]; 6],
}

/// Where a pose stands to the box that a table was fitted on.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PkmDomain {
    /// In the box or on its edge: the table's stated errors hold.
    Inside = 0,
    /// Outside: the value is an extrapolation for which nobody has vouched; it is computed all the same.
    Outside = 1,
}

/// Corrected stiffness K_m, and whether it may be trusted.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmCorrected<T> {
    /// K_m.
    pub stiffness: PkmStiffness<T>,
    /// Where the pose stands to the table's box.
    pub domain: PkmDomain,
}

/// What to command so that a loaded tip is where it should be.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmCompensated<T> {
    /// The pose to command.
    pub pose: PkmPose<T>,
    /// Its screw lengths.
    pub lengths: PkmLengths<T>,
}

/// What one cycle of a controller computes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmCycle<T> {
    /// Screw lengths of the pose without load.
    pub lengths: PkmLengths<T>,
    /// Displacement of A under the load.
    pub deflection: PkmDeflection<T>,
    /// What to command under the load.
    pub compensated: PkmCompensated<T>,
    /// Where the pose stands to the table's box.
    pub domain: PkmDomain,
}

/// Where the five axes stand.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmConfiguration<T> {
    /// Of the moving platform.
    pub pose: PkmPose<T>,
    /// Joints 1 and 2 of the wrist.
    pub beta_rad: [T; 2],
}

/// What the five drives are told.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmJoints<T> {
    /// Of the three screws.
    pub lengths: PkmLengths<T>,
    /// Joints 1 and 2 of the wrist.
    pub beta_rad: [T; 2],
}

/// A tool's tip and the direction of its axis from flange to tip, in B-xyz: what a part program asks for.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTool<T> {
    /// x, y, z of the tip.
    pub tip_m: [T; 3],
    /// Of length 1 where a function gives it, any length above 0 where one takes it.
    pub axis: [T; 3],
}

/// A tool's tip, in B-xyz, and where the wrist's joints stand: what a part program in the axes X Y Z A B asks for.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmTip<T> {
    /// x, y, z of the tip.
    pub tip_m: [T; 3],
    /// Joints 1 and 2 of the wrist.
    pub beta_rad: [T; 2],
}

/// Where joint values put the five axes and the tool.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmToolPlace<T> {
    /// Of the five axes.
    pub configuration: PkmConfiguration<T>,
    /// Of the tool.
    pub tool: PkmTool<T>,
}

/// A solution of the five-axis inverse kinematics.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmToolSolution<T> {
    /// Where the five axes stand.
    pub configuration: PkmConfiguration<T>,
    /// What the drives are told.
    pub joints: PkmJoints<T>,
    /// Distance from the singularity locus of the five axes: 1 in the home configuration, 0 on the locus.
    pub normalised_determinant: T,
}

/// What to command so that a loaded tool is where it should be.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmCompensatedTool<T> {
    /// What to command, and where the five axes then would stand without the load.
    pub solution: PkmToolSolution<T>,
    /// What the load moves the tip by there, along x, y, z of B.
    pub translation_m: [T; 3],
    /// What it turns the tool by, about x, y, z of B.
    pub rotation_rad: [T; 3],
    /// How far the loaded tool then is from where it should be, by the model: the tip's distance, and home's Z0 times the axis's, m.
    pub remaining_m: T,
    /// 1 where that is at most 1e-4 of the deflection, 0 where it is the best of too few tries.
    pub converged: i32,
    /// Where the commanded pose stands to the table's box.
    pub domain: PkmDomain,
}

/// How tip and axis of a tool move, along x, y, z of B. Of a tool that moves along its axis or stands still, the axis's rates are 0.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmToolMotion<T> {
    /// Velocity of the tip.
    pub tip_m_per_s: [T; 3],
    /// First time derivative of the axis, of length 1: angular velocity × axis.
    pub axis_per_s: [T; 3],
    /// Acceleration of the tip.
    pub tip_m_per_s2: [T; 3],
    /// Second time derivative of the axis.
    pub axis_per_s2: [T; 3],
}

/// How the joints move: three screws in m/s and m/s², then the wrist in rad/s and rad/s².
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PkmJointMotion<T> {
    /// Of each joint.
    pub velocity: [T; 5],
    /// Of each joint.
    pub acceleration: [T; 5],
}

impl<T: Scalar> PkmToolMotion<T> {
    pub(crate) fn core(&self) -> ToolMotion<T> {
        ToolMotion {
            tip_m_per_s: self.tip_m_per_s.into(),
            axis_per_s: self.axis_per_s.into(),
            tip_m_per_s2: self.tip_m_per_s2.into(),
            axis_per_s2: self.axis_per_s2.into(),
        }
    }
}

impl<T: Scalar> PkmJointMotion<T> {
    pub(crate) fn core(&self) -> JointMotion<T> {
        JointMotion { velocity: self.velocity.into(), acceleration: self.acceleration.into() }
    }
}

impl<T: Scalar> From<JointMotion<T>> for PkmJointMotion<T> {
    fn from(JointMotion { velocity, acceleration }: JointMotion<T>) -> Self {
        Self { velocity: velocity.into(), acceleration: acceleration.into() }
    }
}

impl<T: Scalar> PkmPose<T> {
    pub(crate) fn core(&self) -> Pose<T> {
        Pose { theta_rad: self.theta_rad, sigma_rad: self.sigma_rad, z0_m: self.z0_m }
    }
}

impl<T: Scalar> PkmLengths<T> {
    pub(crate) fn core(&self) -> ScrewLengths<T> {
        ScrewLengths { q_m: self.q_m.into() }
    }
}

impl<T: Scalar> PkmWrench<T> {
    pub(crate) fn core(&self) -> Wrench<T> {
        Wrench { force_n: self.force_n.into(), moment_nm: self.moment_nm.into() }
    }
}

impl<T: Scalar> PkmTemperatureRise<T> {
    pub(crate) fn core(&self) -> TemperatureRise<T> {
        TemperatureRise { limbs_k: self.limbs_k, platforms_k: self.platforms_k }
    }
}

impl<T: Scalar> PkmDeflection<T> {
    pub(crate) fn core(&self) -> Deflection<T> {
        Deflection { translation_m: self.translation_m.into(), rotation_rad: self.rotation_rad.into() }
    }
}

impl<T: Scalar> PkmConfiguration<T> {
    pub(crate) fn core(&self) -> Configuration<T> {
        Configuration { pose: self.pose.core(), beta_rad: self.beta_rad.into() }
    }
}

impl<T: Scalar> PkmJoints<T> {
    pub(crate) fn core(&self) -> JointValues<T> {
        JointValues { lengths: self.lengths.core(), beta_rad: self.beta_rad.into() }
    }
}

impl<T: Scalar> PkmTool<T> {
    pub(crate) fn core(&self) -> Tool<T> {
        Tool { tip_m: self.tip_m.into(), axis: self.axis.into() }
    }
}

impl<T> From<Pose<T>> for PkmPose<T> {
    fn from(Pose { theta_rad, sigma_rad, z0_m }: Pose<T>) -> Self {
        Self { theta_rad, sigma_rad, z0_m }
    }
}

impl<T: Scalar> From<ScrewLengths<T>> for PkmLengths<T> {
    fn from(ScrewLengths { q_m }: ScrewLengths<T>) -> Self {
        Self { q_m: q_m.into() }
    }
}

impl<T: Scalar> From<Deflection<T>> for PkmDeflection<T> {
    fn from(Deflection { translation_m, rotation_rad }: Deflection<T>) -> Self {
        Self { translation_m: translation_m.into(), rotation_rad: rotation_rad.into() }
    }
}

impl<T: Scalar> From<Matrix3<T>> for PkmJacobian<T> {
    fn from(jacobian: Matrix3<T>) -> Self {
        let [by_theta_m_per_rad, by_sigma_m_per_rad, by_z0_m_per_m] = jacobian.into();
        Self { by_theta_m_per_rad, by_sigma_m_per_rad, by_z0_m_per_m }
    }
}

impl<T> From<SingularityDistance<T>> for PkmSingularityDistance<T> {
    fn from(SingularityDistance { limbs_1_2, limb_3 }: SingularityDistance<T>) -> Self {
        Self { limbs_1_2, limb_3 }
    }
}

impl<T: Scalar> From<Stiffness<T>> for PkmStiffness<T> {
    fn from(stiffness: Stiffness<T>) -> Self {
        // symmetric: its columns are its rows
        Self { k_si: stiffness.matrix().into() }
    }
}

impl From<Domain> for PkmDomain {
    fn from(domain: Domain) -> Self {
        match domain {
            Domain::Inside => Self::Inside,
            Domain::Outside => Self::Outside,
        }
    }
}

impl<T: Scalar> From<Corrected<T>> for PkmCorrected<T> {
    fn from(Corrected { factor, domain }: Corrected<T>) -> Self {
        Self { stiffness: factor.stiffness().into(), domain: domain.into() }
    }
}

impl<T: Scalar> From<Compensated<T>> for PkmCompensated<T> {
    fn from(Compensated { pose, lengths }: Compensated<T>) -> Self {
        Self { pose: pose.into(), lengths: lengths.into() }
    }
}

impl<T: Scalar> From<Cycle<T>> for PkmCycle<T> {
    fn from(Cycle { lengths, corrected, deflection, compensated }: Cycle<T>) -> Self {
        Self {
            lengths: lengths.into(),
            deflection: deflection.into(),
            compensated: compensated.into(),
            domain: corrected.domain.into(),
        }
    }
}

impl<T: Scalar> From<Configuration<T>> for PkmConfiguration<T> {
    fn from(Configuration { pose, beta_rad }: Configuration<T>) -> Self {
        Self { pose: pose.into(), beta_rad: beta_rad.into() }
    }
}

impl<T: Scalar> From<Tool<T>> for PkmTool<T> {
    fn from(Tool { tip_m, axis }: Tool<T>) -> Self {
        Self { tip_m: tip_m.into(), axis: axis.into() }
    }
}

impl<T: Scalar> From<ToolSolution<T>> for PkmToolSolution<T> {
    fn from(
        ToolSolution { configuration, joints: JointValues { lengths, beta_rad }, normalised_determinant, .. }: ToolSolution<T>,
    ) -> Self {
        let joints = PkmJoints { lengths: lengths.into(), beta_rad: beta_rad.into() };
        Self { configuration: configuration.into(), joints, normalised_determinant }
    }
}

impl<T: Scalar> From<CompensatedTool<T>> for PkmCompensatedTool<T> {
    fn from(CompensatedTool { solution, deflection, remaining_m, converged }: CompensatedTool<T>) -> Self {
        Self {
            solution: solution.into(),
            translation_m: deflection.translation_m.into(),
            rotation_rad: deflection.rotation_rad.into(),
            remaining_m,
            converged: converged.into(),
            // every call here has a table, and with one there is a domain
            domain: deflection.domain.unwrap_or(Domain::Outside).into(),
        }
    }
}

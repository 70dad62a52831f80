//! Stiffness and deflection at the tool, and their compensation.

use nalgebra::{SVector, Vector2, Vector3};

use super::state::State;
use super::{
    CompensatedTool, Configuration, FiveAxis, Tool, ToolDeflection, ToolDeflectionError, ToolError, ToolSolution,
};
use crate::compensation::{self, Doubt, Load};
use crate::correction::{CorrectionTable, TableUncertainty};
use crate::estimation::Estimator;
use crate::kinematics::platform_axes;
use crate::linalg::{self, axes, length, split, unit};
use crate::model::{Known, Model};
use crate::scalar::Scalar;
use crate::stiffness::{self, LoadHistory, Stiffness, StiffnessError};
use crate::thermal::TemperatureRise;
use crate::types::{Deflection, Wrench};
use crate::wrist::Wrist;

/// Most times that [`FiveAxis::compensated`] works out a deflection. Two or three do where K alone yields, four with clearance.
pub const MAX_DEFLECTIONS: usize = 4;
/// Most configurations that [`FiveAxis::compensated`] looks at. On a path some six do.
pub const MAX_COMPENSATION_ITERATIONS: u8 = 16;
/// What [`FiveAxis::compensated`] leaves of a deflection, at the most: of the tip's plus home's Z0 times the axis's.
pub const COMPENSATED_TO: f64 = 1e-4;

impl<T: Scalar> Wrist<T> {
    /// A load on the tool at its tip, in the axes of T_h, as one on the platform at A.
    #[inline(never)]
    pub fn wrench_at_a(&self, beta_rad: Vector2<T>, wrench: &Wrench<T>) -> Wrench<T> {
        let held = self.held(beta_rad);
        let axes = held.axes();
        let turned = Wrench { force_n: axes * wrench.force_n, moment_nm: axes * wrench.moment_nm };
        turned.moved_to_a(held.tip)
    }
}

impl<T: Scalar> FiveAxis<'_, T> {
    /// A stiffness at A in A-uvw as the tool sees it: at the tip, in the axes of T_h. What is elastic in the wrist has to be in it
    /// (effect `wrist-compliance`).
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame).
    pub fn tip_stiffness(
        &self,
        at_a: &Stiffness<T>,
        configuration: &Configuration<T>,
    ) -> Result<Stiffness<T>, ToolError> {
        self.joints(configuration)?;
        let held = self.wrist.held(configuration.beta_rad);
        // symmetric: its columns are its rows
        let (axes, k) = (axes(&held.axes()), at_a.matrix().data.0);
        let mut seen = linalg::zero();
        for row in 0..6 {
            let turning = row >= 3;
            let axis = axes[row % 3];
            // what A does when the tip moves along an axis, or the tool turns about one at the tip
            let (v, w) = if turning { (held.tip.cross(&axis), axis) } else { (axis, Vector3::zeros()) };
            let wrench = k.map(|[a, b, c, d, e, f]| Vector3::new(a, b, c).dot(&v) + Vector3::new(d, e, f).dot(&w));
            let (force, moment) = split(wrench.into());
            let moment = moment - held.tip.cross(&force);
            for i in 0..3 {
                (seen.data.0[i][row], seen.data.0[3 + i][row]) = (axes[i].dot(&force), axes[i].dot(&moment));
            }
        }
        Ok(Stiffness::from_lower(&seen))
    }

    /// How a load moves the tool, by K_m in the factor form or, without a table, by K_p; with what load-dependent effects add.
    ///
    /// # Arguments
    /// * `wrench`: on the tool at its tip, in the axes of T_h.
    ///
    /// # Errors
    /// Those of [`frame`](Self::frame), [`CorrectionTable::factor_form`] and [`Machine::load_dependent_deflection`](crate::Machine::load_dependent_deflection).
    pub fn deflection(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
    ) -> Result<ToolDeflection<T>, ToolDeflectionError> {
        self.joints(configuration)?;
        self.deflection_of(table, configuration, wrench, None, None)
    }

    // what is turned before and after it takes no stack while the mechanism's own is worked out
    #[inline(never)]
    fn deflection_of(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
        history: Option<&mut LoadHistory<T>>,
        doubt: Option<&mut Doubt<'_, T>>,
    ) -> Result<ToolDeflection<T>, ToolDeflectionError> {
        let Configuration { pose, beta_rad } = configuration;
        let at_a = self.wrist.wrench_at_a(*beta_rad, wrench);
        let at_a = compensation::deflection(self.machine, table, pose, &at_a, history, doubt)?;
        let Deflection { translation_m, rotation_rad } = stiffness::finite(self.seen_at_tip(configuration, &at_a))?;
        Ok(ToolDeflection { translation_m, rotation_rad, domain: table.map(|table| table.domain(pose)) })
    }

    /// A displacement of A, in A-uvw, as that of the tip, in B-xyz.
    #[inline(never)]
    fn seen_at_tip(&self, configuration: &Configuration<T>, at_a: &Deflection<T>) -> Deflection<T> {
        let Configuration { pose, beta_rad } = configuration;
        let Deflection { translation_m, rotation_rad } = at_a.seen_at(self.wrist.held(*beta_rad).tip);
        let platform = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
        Deflection { translation_m: platform * translation_m, rotation_rad: platform * rotation_rad }
    }

    /// The configuration to command so that the loaded tool stands where `tool` asks, tip and axis: the tool is held where
    /// the deflection of the last try takes it from there, until the deflection changes by no more than [`COMPENSATED_TO`].
    ///
    /// It fits a controller's period: at most [`MAX_DEFLECTIONS`] deflections, and in all of its inverse kinematics together
    /// [`MAX_COMPENSATION_ITERATIONS`] configurations. Where these do not do, the best try is given, with what remains of the
    /// deflection. A machine that does not stand near the tool takes [`inverse`](Self::inverse) first.
    ///
    /// # Arguments
    /// * `wrench`: on the tool at its tip, in the axes of T_h, which the load turns with.
    /// * `near`: as for [`inverse`](Self::inverse).
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse) and of [`deflection`](Self::deflection), on the way as at its end.
    pub fn compensated(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        tool: &Tool<T>,
        wrench: &Wrench<T>,
        near: &Configuration<T>,
    ) -> Result<CompensatedTool<T>, ToolDeflectionError> {
        self.compensated_in_part(table, tool, wrench, T::ONE, near)
    }

    /// The same for a share of the deflection, which no one limits to 0 to 1: as much as is known ([`TipUncertainty::known_share`](crate::TipUncertainty::known_share)).
    /// Where effects depend on the load that is not the deflection under a share of the load.
    ///
    /// # Errors
    /// Those of [`compensated`](Self::compensated).
    pub fn compensated_in_part(
        &self,
        table: Option<&CorrectionTable<'_, T>>,
        tool: &Tool<T>,
        wrench: &Wrench<T>,
        share: T,
        near: &Configuration<T>,
    ) -> Result<CompensatedTool<T>, ToolDeflectionError> {
        let mut iterations_left = MAX_COMPENSATION_ITERATIONS;
        let axis = unit(&tool.axis).ok_or(ToolError::NotFinite)?;
        let mut solution = match &self.inverse_within(tool, near, &mut iterations_left) {
            Ok(solution) => *solution,
            // by reference: `?` would copy all of it
            Err(e) => return Err((*e).into()),
        };
        let mut undone = [Vector3::zeros(); 2];
        let mut best = None;
        for left in (0..MAX_DEFLECTIONS).rev() {
            match &self.deflection_of(table, &solution.configuration, wrench, None, None) {
                Ok(deflection) => self.keep_better(axis, &solution, (deflection, share), &mut undone, &mut best)?,
                Err(e) => return Err(*e),
            }
            if left == 0 || best.is_some_and(|best: CompensatedTool<T>| best.converged) {
                break;
            }
            let held = Tool { tip_m: tool.tip_m - undone[0], axis: axis - undone[1] };
            match &self.inverse_within(&held, &solution.configuration, &mut iterations_left) {
                Ok(found) => solution = *found,
                Err(_) if iterations_left == 0 => break,
                Err(e) => return Err((*e).into()),
            }
        }
        best.ok_or(ToolDeflectionError::Tool(ToolError::Unreachable))
    }

    /// What to add to the joint values of a configuration: the gain times the deflection of the tool under a load, what the weight does
    /// beyond the zeros, and all of the thermal growth, undone by one Newton step.
    pub(crate) fn offsets<const N: usize>(
        &self,
        model: &Model<'_, T, N>,
        configuration: &Configuration<T>,
        load: &mut Load<'_, T, 5>,
        history: &mut LoadHistory<T>,
    ) -> Result<(SVector<T, 5>, Option<Known<T>>), ToolDeflectionError> {
        self.joints(configuration)?;
        let mut doubt = self.doubt(model.uncertainty, configuration.beta_rad);
        load.add_weight(|carried| carried.on_tool(self, configuration));
        // by reference: `?` would copy all of it
        match &self.deflection_of(Some(model.table), configuration, &load.wrench, Some(history), Some(&mut doubt)) {
            Ok(loaded) => {
                let ToolDeflection { translation_m, rotation_rad, .. } = *loaded;
                let mut moved = Deflection { translation_m, rotation_rad };
                if let Some(learned) = model.learned {
                    self.add_learned(learned, configuration, &load.wrench, &mut moved, &mut doubt)?;
                    load.rise = load.rise.plus(learned.warmer_k());
                }
                let known = model.known(&doubt.variance_m2, &moved.translation_m, &load.held_m());
                if let Some(known) = &known {
                    moved = moved.times(known.share);
                }
                let offsets = self.offsets_against(configuration, &moved.times(load.gain), load.rise)?;
                let share = known.as_ref().map_or(T::ONE, |known| known.share);
                Ok((load.carried.map_or(offsets, |carried| carried.beyond_zero(offsets, share)), known))
            }
            Err(e) => Err(*e),
        }
    }

    #[inline(never)] // takes no stack while the deflection is worked out
    fn doubt<'a>(&self, table: Option<&'a TableUncertainty<T>>, beta_rad: Vector2<T>) -> Doubt<'a, T> {
        Doubt { table, tip_m: self.wrist.held(beta_rad).tip, variance_m2: Vector3::zeros() }
    }

    /// Adds what was learned to a deflection of the tool, and to what is doubted of it.
    #[inline(never)] // takes no stack while the deflection is worked out
    fn add_learned<const N: usize>(
        &self,
        learned: &Estimator<T, N>,
        configuration: &Configuration<T>,
        wrench: &Wrench<T>,
        moved: &mut Deflection<T>,
        doubt: &mut Doubt<'_, T>,
    ) -> Result<(), ToolDeflectionError> {
        let Configuration { pose, beta_rad } = configuration;
        let posture = self.machine.posture(pose).map_err(StiffnessError::from)?;
        let at_a = self.wrist.wrench_at_a(*beta_rad, wrench);
        let mut own = Deflection::ZERO;
        learned.add_to(self.machine, &posture, &at_a, doubt.tip_m, (&mut own, &mut doubt.variance_m2))?;
        *moved = moved.plus(&self.seen_at_tip(configuration, &own));
        Ok(())
    }

    #[inline(never)] // takes no stack while the deflection is worked out
    fn offsets_against(
        &self,
        configuration: &Configuration<T>,
        loaded: &Deflection<T>,
        rise: TemperatureRise<T>,
    ) -> Result<SVector<T, 5>, ToolDeflectionError> {
        let grown = self.machine.thermal_deflection(&configuration.pose, rise)?;
        let moved = loaded.plus(&self.seen_at_tip(configuration, &grown));
        let frame = self.frame_of(configuration);
        let [_, _, axis] = axes(&frame.axes);
        let target = Tool { tip_m: frame.tip_m - moved.translation_m, axis: axis - moved.rotation_rad.cross(&axis) };
        let state = State::of(configuration);
        let newton = self.wrist.newton_step(&state, &target);
        if !(newton.determinant >= self.wrist.margin) {
            return Err(ToolError::Singular.into());
        }
        let from = self.joints(configuration)?;
        let to = self.joints(&state.moved(newton.step, T::ONE).configuration())?;
        let [q1, q2, q3] = (to.lengths.q_m - from.lengths.q_m).into();
        let [beta1, beta2] = (to.beta_rad - from.beta_rad).into();
        Ok([q1, q2, q3, beta1, beta2].into())
    }

    /// Takes a try in place of the best if less of its deflection's share remains, and that share, of tip and axis, as what the next one
    /// undoes.
    #[inline(never)] // what it works with takes no stack while the next deflection is worked out
    fn keep_better(
        &self,
        axis: Vector3<T>,
        solution: &ToolSolution<T>,
        (deflection, share): (&ToolDeflection<T>, T),
        undone: &mut [Vector3<T>; 2],
        best: &mut Option<CompensatedTool<T>>,
    ) -> Result<(), StiffnessError> {
        let turned = deflection.rotation_rad * share;
        let now = [deflection.translation_m * share, turned.cross(&(axis - undone[1]))];
        let size = |[tip, axis]: [Vector3<T>; 2]| length(&tip) + self.wrist.home_z0 * length(&axis);
        let remaining_m = size([now[0] - undone[0], now[1] - undone[1]]);
        // a deflection may be finite where its square is not
        if !remaining_m.is_finite() {
            return Err(StiffnessError::NotFinite);
        }
        if best.as_ref().is_none_or(|best| remaining_m < best.remaining_m) {
            let converged = remaining_m <= T::from_f64(COMPENSATED_TO) * size(now);
            *best = Some(CompensatedTool { solution: *solution, deflection: *deflection, remaining_m, converged });
        }
        *undone = now;
        Ok(())
    }
}

//! All configurations that may reach a hole from a cell of positions of the table.
//!
//! For a given axis of the tool β1 and β2 leave σ from the axis' component along y of B and θ from the others, and the tip
//! then leaves |AB| and where the cross slide stands: both follow from β1, β2 and the rotary axis without a search. So boxes of
//! β1 and β2 are divided, thrown away where nothing in them can reach the hole, and narrowed by Newton's method, which loses no
//! solution.

use nalgebra::{Vector2, Vector3};
use pkm_core::effects::Effects;
use pkm_core::kinematics::platform_axes;
use pkm_core::{Configuration, CorrectionTable, FiveAxis, Pose, Scalar, Stiffness, Wrench};

use super::boxes::{Beside, Box2, Cell, Joints, Known, MIN_BOX_RAD};
use super::newton::{Narrowed, narrowed};
use super::targets::Target;
use super::taylor::{THREE, Taylor, decided};
use super::whitened::{Whitened, length};
use super::{Objective, PlacementModel};
use crate::files::job::PerAxis;

/// What a limit may be passed by, relative, before nothing is taken to be there: more than the core's own slack.
const SLACK: f64 = 1e-7;
/// Where a box beside a great cell is divided, rad: over a greater one a cost is hardly known.
const MAX_BOX_RAD: f64 = 0.03;
/// Boxes of a hole that one may take the place of: solutions that a box's edge goes through are in two, or at its corner in four.
const MAX_MERGED: usize = 4;
/// Newton's steps for that.
const MERGING_STEPS: usize = 3;
/// Boxes that are looked at for a hole and a cell, at the most.
const MAX_BOXES: usize = 3000;

/// A box in which a cell's solutions follow from the position: β1 and β2 over the cell.
#[derive(Clone, Debug)]
pub(super) struct Solved<const N: usize> {
    pub within: Box2,
    /// `None`: the box is small beside the cell, or tells nothing.
    over_cell: Option<[Taylor<N>; 2]>,
    /// Where the machine stands over the cell, or over the box if nothing is known over the cell, if that was looked at.
    stand: Option<Stand<N>>,
    /// Whether limits were looked at for that.
    is_possible: bool,
    /// K_m there, if that was computed.
    whitened: Option<Box<Whitened<N>>>,
}

impl<const N: usize> Solved<N> {
    fn new(within: Box2, over_cell: Option<[Taylor<N>; 2]>, stand: Option<Stand<N>>) -> Self {
        Self { within, over_cell, stand, is_possible: false, whitened: None }
    }
}

/// A hole in B, constant, times the sine and times the cosine of the rotary axis, and what its tool bears.
struct Turning<const N: usize> {
    tip: [Vector3<f64>; 3],
    axis: [Vector3<f64>; 3],
    /// With the moment that goes with each of `forces_n`, if there are any.
    wrench: Wrench<Taylor<N>>,
    forces_n: Vec<Vector3<f64>>,
    /// With how much more than by its stiffness the machine may yield.
    weight: f64,
}

/// The core's formulas over cells, for one job.
pub(super) struct Cover<'a, const N: usize> {
    model: &'a PlacementModel<'a>,
    /// Without travel and limits, which are looked at one by one.
    five: FiveAxis<'a, Taylor<N>>,
    table: Option<CorrectionTable<'a, Taylor<N>>>,
    holes: Vec<Turning<N>>,
    /// x and y of W in B.
    slides: [Vector3<f64>; 2],
}

/// Where the machine stands over a cell, and its cross slide.
#[derive(Clone, Debug)]
struct Stand<const N: usize> {
    configuration: Configuration<Taylor<N>>,
    slide: [Taylor<N>; 2],
}

/// What a hole costs over a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cost<const N: usize> {
    /// No position of the cell costs less.
    pub low: f64,
    /// In the symbols of the cell: nowhere more than what it costs.
    pub over: Taylor<N>,
}

impl<const N: usize> Cost<N> {
    pub fn at_least(low: f64) -> Self {
        Self { low, over: Taylor::constant(low) }
    }
}

/// Whether it stands there at all.
enum Standing<const N: usize> {
    Nowhere,
    Unknown,
    /// Perhaps.
    At(Stand<N>),
}

fn vector<const N: usize>(v: &Vector3<f64>) -> Vector3<Taylor<N>> {
    v.map(Taylor::constant)
}

impl<'a, const N: usize> Cover<'a, N> {
    pub fn new(
        model: &'a PlacementModel<'a>,
        five: FiveAxis<'a, Taylor<N>>,
        table: Option<CorrectionTable<'a, Taylor<N>>>,
        targets: &[Target<'_>],
    ) -> Self {
        let at = |dx_m: f64, dy_m: f64, rotary_rad: f64| model.job.table_in_base(&PerAxis { dx_m, dy_m, rotary_rad });
        let zero = at(0.0, 0.0, 0.0);
        let slides = [at(1.0, 0.0, 0.0), at(0.0, 1.0, 0.0)].map(|frame| frame.origin_m - zero.origin_m);
        // a + b sin + c cos by its values at 0, a right angle and twice that
        let turns = [0.0, 0.5, 1.0].map(|turn| at(0.0, 0.0, turn * std::f64::consts::PI));
        let parts = |[zero, right, back]: [Vector3<f64>; 3]| {
            let constant = (zero + back) * 0.5;
            [constant, right - constant, (zero - back) * 0.5]
        };
        let turning = |target: &Target<'_>| {
            let Target { hole, wrench, weight, off_m: [x, y], softer, .. } = target;
            let off_m = slides[0] * *x + slides[1] * *y;
            Turning {
                tip: parts(turns.map(|frame| frame.origin_m + frame.rotation * hole.tip_m + off_m)),
                axis: parts(turns.map(|frame| frame.rotation * hole.axis)),
                wrench: Wrench { force_n: vector(&wrench.force_n), moment_nm: vector(&wrench.moment_nm) },
                forces_n: target.forces_n.clone(),
                weight: weight * softer,
            }
        };
        Self { model, five, table, holes: targets.iter().map(turning).collect(), slides }
    }

    /// Everything within the wrist's limits.
    pub fn whole(&self) -> Vec<Box2> {
        let wrist = &self.model.reach.file.wrist_parameters;
        let of = |pick: fn(f64, f64) -> f64| [0, 1].map(|i| 0.5 * pick(wrist.max_rad[i], wrist.min_rad[i]));
        let (middle, half): ([f64; 2], [f64; 2]) = (of(|max, min| max + min), of(|max, min| max - min));
        // the core takes β up to half a turn
        let half = [0, 1].map(|i: usize| f64::min(half[i] + SLACK, std::f64::consts::PI - middle[i].abs()));
        [1.0, -1.0].map(|side| Box2::unknown(middle, half, side)).into()
    }

    fn angle(cell: &Cell) -> Taylor<N> {
        let [.., middle] = cell.middle;
        if N == THREE { Taylor::range(middle, cell.half[2], 2) } else { Taylor::constant(middle) }
    }

    /// Where β1 and β2 put the machine and the cross slide for a hole.
    fn stand(&self, hole: usize, beta: [Taylor<N>; 2], angle: Taylor<N>, side: f64) -> Standing<N> {
        let (sin, cos) = angle.sin_cos();
        let turned = |[constant, by_sin, by_cos]: &[Vector3<f64>; 3]| {
            vector(constant) + vector(by_sin) * sin + vector(by_cos) * cos
        };
        let (tip, axis) = (turned(&self.holes[hole].tip), turned(&self.holes[hole].axis));
        let beta_rad = Vector2::from(beta);
        let home = Taylor::constant(self.model.reach.file.wrist_parameters.home_z0_m);
        let zero = Taylor::ZERO;
        let upright = Configuration { pose: Pose { theta_rad: zero, sigma_rad: zero, z0_m: home }, beta_rad };
        let held = match decided(|| self.five.tool(&upright)) {
            Some(Ok(held)) => held,
            Some(Err(_)) => return Standing::Nowhere,
            None => return Standing::Unknown,
        };
        let arm = held.tip_m - Vector3::new(zero, zero, home);
        let [ax, ay, az]: [Taylor<N>; 3] = held.axis.into();
        let [ex, ey, ez]: [Taylor<N>; 3] = axis.into();
        let (across2, plane2) = (ay * ay + az * az, ex * ex + ez * ez);
        let left = across2 - ey * ey;
        if left.high() < 0.0 {
            return Standing::Nowhere;
        }
        let along_n = left.root_of_positive() * Taylor::constant(side);
        let theta = ((along_n * ex - ax * ez) / plane2, (ax * ex + along_n * ez) / plane2);
        let sigma = ((ay * along_n - az * ey) / across2, (ay * ey + az * along_n) / across2);
        if theta.1.high() < 0.0 || sigma.1.high() < 0.0 {
            return Standing::Nowhere;
        }
        let arm = platform_axes(theta, sigma) * arm;
        let n = Vector3::new(theta.0, zero, theta.1);
        let [x, y] = self.slides.map(|slide| vector(&slide));
        let square = vector(&self.slides[0].cross(&self.slides[1]));
        let l = (tip - arm).dot(&square) / n.dot(&square);
        let moved = n * l + arm - tip;
        let pose = Pose { theta_rad: theta.0.atan2(theta.1), sigma_rad: sigma.0.atan2(sigma.1), z0_m: l * theta.1 };
        Standing::At(Stand { configuration: Configuration { pose, beta_rad }, slide: [moved.dot(&x), moved.dot(&y)] })
    }

    /// Whether these configurations are within all limits: `None` where some may be, and some may not.
    fn within(&self, configuration: &Configuration<Taylor<N>>) -> Option<bool> {
        let mut all = true;
        let mut beyond = |value: Taylor<N>, low: f64, high: f64| {
            all &= value.low() >= low && value.high() <= high;
            value.low() > high || value.high() < low
        };
        let Pose { theta_rad, sigma_rad, z0_m } = configuration.pose;
        if let Some(numbers) = self.model.numbers.filter(|_| !self.model.extrapolate) {
            for (i, value) in [theta_rad, sigma_rad, z0_m].into_iter().enumerate() {
                let (centre, half) = (numbers.centre[i], numbers.half_width[i] * (1.0 + SLACK));
                if beyond(value, centre - half, centre + half) {
                    return Some(false);
                }
            }
        }
        let file = self.model.reach.file;
        match decided(|| self.five.machine.inverse(&configuration.pose)) {
            None => return None,
            Some(Err(_)) => return Some(false),
            Some(Ok(lengths)) => {
                let travel = &file.parameters.travel;
                for (i, q) in lengths.q_m.iter().enumerate() {
                    let slack = SLACK * travel.max_m[i];
                    if beyond(*q, travel.min_m[i] - slack, travel.max_m[i] + slack) {
                        return Some(false);
                    }
                }
            }
        }
        match decided(|| self.five.normalised_determinant(configuration)) {
            Some(Ok(share)) if beyond(share, self.model.reach.margin() - SLACK, f64::INFINITY) => Some(false),
            Some(Ok(_)) => all.then_some(true),
            Some(Err(_)) => Some(false),
            None => None,
        }
    }

    fn over(within: &Box2) -> [Taylor<N>; 2] {
        [0, 1].map(|i| Taylor::range(within.middle[i], within.half[i], i))
    }

    /// Narrows boxes to what may reach a hole from a cell.
    pub fn solved(&self, hole: usize, cell: &Cell, boxes: impl IntoIterator<Item = Box2>) -> Vec<Solved<N>> {
        let (mut open, mut solved): (Vec<Box2>, Vec<_>) = (boxes.into_iter().collect(), Vec::new());
        let mut count = 0;
        while let Some(mut within) = open.pop() {
            count += 1;
            match within.beside(cell) {
                Beside::Outside => continue,
                // every configuration of it is a solution: there is nothing to narrow
                Beside::Inside => {
                    solved.push(Solved::new(within, None, None));
                    continue;
                }
                Beside::Partly => {}
            }
            let (narrowed, over_box) = match self.stand(hole, Self::over(&within), Self::angle(cell), within.side) {
                Standing::Nowhere => continue,
                Standing::Unknown => (Narrowed::No, None),
                Standing::At(stand) => {
                    let narrowed = narrowed(&within, &stand.slide, cell);
                    // limits take longer than a step, and are looked at again where the cost is
                    if matches!(narrowed, Narrowed::No) && self.within(&stand.configuration) == Some(false) {
                        continue;
                    }
                    (narrowed, Some(stand))
                }
            };
            match narrowed {
                Narrowed::Empty => {}
                Narrowed::Solved(None) if within.half[0].max(within.half[1]) > MAX_BOX_RAD => {
                    open.extend(within.halves())
                }
                Narrowed::Solved(over_cell) => {
                    if let (None, Some(stand)) = (over_cell, &over_box) {
                        within.slide = [0, 1].map(|i: usize| [stand.slide[i].middle(), stand.slide[i].spread()]);
                    }
                    solved.push(Solved::new(within, over_cell, over_box.filter(|_| over_cell.is_none())));
                }
                _ if count > MAX_BOXES || within.half[0].max(within.half[1]) < MIN_BOX_RAD => {
                    solved.push(Solved::new(within, None, over_box));
                }
                Narrowed::To { middle, half } => open.push(Box2 { middle, half, ..within }),
                Narrowed::No => open.extend(within.halves()),
            }
        }
        solved
    }

    /// Puts a box with tools on one side in place of several, where its solutions follow from the position all over the cell.
    pub fn merge(&self, hole: usize, cell: &Cell, side: f64, solved: &mut Vec<Solved<N>>) {
        let parts = || solved.iter().map(|one| &one.within).filter(|within| within.side == side);
        if !(2..=MAX_MERGED).contains(&parts().count()) {
            return;
        }
        let ends = [0, 1].map(|i: usize| {
            let low = parts().map(|part| part.middle[i] - part.half[i]).fold(f64::INFINITY, f64::min);
            [low, parts().map(|part| part.middle[i] + part.half[i]).fold(f64::NEG_INFINITY, f64::max)]
        });
        let mut hull = Box2::unknown(ends.map(|[a, b]| 0.5 * (a + b)), ends.map(|[a, b]| 0.5 * (b - a)), side);
        for _ in 0..MERGING_STEPS {
            let Standing::At(stand) = self.stand(hole, Self::over(&hull), Self::angle(cell), side) else { return };
            match narrowed(&hull, &stand.slide, cell) {
                Narrowed::To { middle, half } => hull = Box2 { middle, half, ..hull },
                Narrowed::Solved(Some(over_cell)) => {
                    solved.retain(|one| one.within.side != side);
                    solved.push(Solved::new(hull, Some(over_cell), None));
                    return;
                }
                _ => return,
            }
        }
    }

    /// What a hole costs by an objective where a cell's solutions are in a box; `None`: none of them is possible. `kept`: where
    /// the box keeps that.
    pub fn cost(
        &self,
        (objective, kept): (Objective, usize),
        hole: usize,
        cell: &Cell,
        solved: &mut Solved<N>,
    ) -> Option<Cost<N>> {
        let (widths, known) = (solved.within.widths(cell), solved.within.known[kept]);
        // a box that is small beside the cell costs what it cost before the cell was divided
        if solved.over_cell.is_none() && solved.within.is_as_wide(cell, &known.bounded) {
            return Some(Cost::at_least(known.low));
        }
        let cost = self.new_cost(objective, hole, cell, solved)?;
        let low = cost.low.max(known.low);
        solved.within.known[kept] = Known { low, bounded: widths };
        Some(Cost { low, ..cost })
    }

    /// Where the machine stands over a cell whose solutions are in a box; nowhere if that is beyond a limit all over it.
    fn possible(&self, hole: usize, cell: &Cell, solved: &mut Solved<N>) -> Standing<N> {
        if solved.stand.is_none() {
            let beta = solved.over_cell.unwrap_or(Self::over(&solved.within));
            match self.stand(hole, beta, Self::angle(cell), solved.within.side) {
                Standing::At(stand) => solved.stand = Some(stand),
                standing => return standing,
            }
        }
        let Some(stand) = &solved.stand else { return Standing::Unknown };
        if !solved.is_possible && self.within(&stand.configuration) == Some(false) {
            return Standing::Nowhere;
        }
        solved.is_possible = true;
        Standing::At(stand.clone())
    }

    fn new_cost(&self, objective: Objective, hole: usize, cell: &Cell, solved: &mut Solved<N>) -> Option<Cost<N>> {
        let configuration = match self.possible(hole, cell, solved) {
            Standing::Nowhere => return None,
            Standing::Unknown => return Some(Cost::at_least(0.0)),
            Standing::At(stand) => stand.configuration,
        };
        let Some(cost) = decided(|| self.cost_of(objective, hole, &configuration, &mut solved.whitened)) else {
            solved.whitened = None;
            return Some(Cost::at_least(0.0));
        };
        let over = cost?;
        // all costs are positive
        let low = over.low().max(0.0);
        Some(if solved.over_cell.is_some() && low > 0.0 { Cost { low, over } } else { Cost::at_least(low) })
    }

    fn cost_of(
        &self,
        objective: Objective,
        hole: usize,
        configuration: &Configuration<Taylor<N>>,
        known: &mut Option<Box<Whitened<N>>>,
    ) -> Option<Taylor<N>> {
        let Turning { wrench, forces_n, weight, .. } = &self.holes[hole];
        let (five, pose) = (&self.five, &configuration.pose);
        let factor = self.table.as_ref().filter(|table| table.has_factor_form());
        let plain = self.model.reach.file.parameters.effects == Effects::NONE && !self.model.diagonal;
        if let Some(table) = factor.filter(|_| plain && known.is_none()) {
            *known = Some(Box::new(Whitened::new(five, table, pose)?));
        }
        let cost = match objective {
            Objective::Paper => {
                let sum = match (&known, &self.table) {
                    (Some(whitened), _) => whitened.trace(),
                    (_, None) => sum_of(&five.machine.stiffness(pose).ok()?),
                    (_, Some(table)) if self.model.diagonal => {
                        sum_of(&table.diagonal_form(five.machine, pose).ok()?.factor.stiffness())
                    }
                    (_, Some(table)) => sum_of(&table.factor_form(five.machine, pose).ok()?.factor.stiffness()),
                };
                Taylor::ONE / sum
            }
            Objective::CycleTime => Taylor::ZERO,
            Objective::TipWorst | Objective::TipMean => match &known {
                // of several loads the worst, each of which costs no more than the worst of them all
                Some(whitened) => {
                    let moved = whitened.moved_by(five, configuration.beta_rad, wrench, forces_n)?;
                    let lengths = moved.iter().map(length);
                    lengths.max_by(|a, b| a.low().total_cmp(&b.low()))?
                }
                None => length(&five.deflection(factor, configuration, wrench).ok()?.translation_m),
            },
        };
        Some(cost * Taylor::constant(*weight))
    }

    /// The joints over a cell whose solutions are in a box, screws first; `None`: none of them is possible.
    pub fn joints(&self, hole: usize, cell: &Cell, solved: &mut Solved<N>) -> Option<[Taylor<N>; 5]> {
        // symbols of a box are no symbols of the cell
        let within_rest = |[middle, spread]: [f64; 2]| Taylor { rest: spread, ..Taylor::constant(middle) };
        let is_box = solved.over_cell.is_none();
        // a box that is small beside the cell has the joints that it had before the cell was divided
        if is_box && solved.within.is_as_wide(cell, &solved.within.joints.bounded) {
            return Some(solved.within.joints.ranges.map(within_rest));
        }
        let configuration = match self.possible(hole, cell, solved) {
            Standing::Nowhere => return None,
            Standing::Unknown => return Some([Taylor::UNKNOWN; 5]),
            Standing::At(stand) => stand.configuration,
        };
        let Some(Ok(lengths)) = decided(|| self.five.machine.inverse(&configuration.pose)) else {
            return Some([Taylor::UNKNOWN; 5]);
        };
        let ([q1, q2, q3], [beta1, beta2]): ([_; 3], [_; 2]) = (lengths.q_m.into(), configuration.beta_rad.into());
        let joints = [q1, q2, q3, beta1, beta2];
        if !is_box {
            return Some(joints);
        }
        let ranges = joints.map(|joint| [joint.middle(), joint.spread()]);
        solved.within.joints = Joints { ranges, bounded: solved.within.widths(cell) };
        Some(ranges.map(within_rest))
    }

    /// By how much a hole's costs are more than how far its tip moves.
    pub fn weight(&self, hole: usize) -> f64 {
        self.holes[hole].weight
    }

    /// How each of some forces with its load's moment moves a hole's tip, or its load if there are none, over a cell whose solutions are in a box, and whether all of the cell reaches it;
    /// `None` where that is not known.
    pub fn moved(
        &self,
        hole: usize,
        cell: &Cell,
        solved: &Solved<N>,
        forces_n: &[Vector3<f64>],
    ) -> Option<(Vec<Vector3<Taylor<N>>>, bool)> {
        let Standing::At(Stand { configuration, .. }) =
            self.stand(hole, solved.over_cell?, Self::angle(cell), solved.within.side)
        else {
            return None;
        };
        let Turning { wrench, .. } = &self.holes[hole];
        let moved = decided(|| {
            let whitened = Whitened::new(&self.five, self.table.as_ref()?, &configuration.pose)?;
            whitened.moved_by(&self.five, configuration.beta_rad, wrench, forces_n)
        });
        Some((moved??, self.within(&configuration) == Some(true)))
    }
}

fn sum_of<const N: usize>(stiffness: &Stiffness<Taylor<N>>) -> Taylor<N> {
    stiffness.principal().iter().fold(Taylor::ZERO, |sum, k| sum + *k)
}

//! Grid and polish, and which method finds a placement.

use pkm_core::Configuration;
use rayon::prelude::*;

use super::certify::{Certificate, Limits};
use super::front::Front;
use super::grid::{Grid, grid_axes, mean_k, places};
use super::polish::{self, Polish};
use super::robust::Robust;
use super::targets::Target;
use super::{Miss, Objective, PlacementModel, Posture};
use crate::error::Result;
use crate::files::job::{Axis, Job, PerAxis, Position};
use crate::progress::Progress;

/// How the optimum is searched for. A grid is computed in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Method {
    /// Branch and bound: with a proof of how much better any other position could be.
    Certified,
    /// Every position of a dense grid, the best of them polished.
    Grid,
    /// The paper's genetic algorithm (Section 6.1, step 5).
    Ga,
    /// Differential evolution.
    De,
}

impl Method {
    /// On the command line and in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Certified => "certified",
            Self::Grid => "grid",
            Self::Ga => "ga",
            Self::De => "de",
        }
    }
}

/// How to search.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Grid: and polish; else the evolution whose result stands beside the grid's.
    pub method: Method,
    /// Of the grid along x and y, m.
    pub step_m: f64,
    /// Of the grid of the rotary axis, rad.
    pub step_rad: f64,
    /// Of the evolution.
    pub seed: u64,
    /// Of branch and bound.
    pub limits: Limits,
    /// A Pareto front of tip-worst against this objective, with so many points at the most, each within its own limits.
    pub front: Option<(Objective, usize, Limits)>,
}

/// Positions of a coarse lattice along each axis, to see in how many ways holes are reached.
const LATTICE: usize = 21;

/// Where the table should stand for a series and an objective.
#[derive(Clone, Debug)]
pub struct Placement {
    /// Which series of the job; several are placed together.
    pub series: Vec<usize>,
    /// Of [`Placed::grids`].
    pub grid: usize,
    /// What is small there.
    pub objective: Objective,
    /// The optimum.
    pub position: Position,
    /// SI.
    pub value: f64,
    /// The grid's best, and its value.
    pub grid_best: (Position, f64),
    /// Share of the grid that reaches every hole.
    pub feasible_share: f64,
    /// The paper's Q: mean over k11…k66 of (max − optimum)/(max − min), of means over the holes, over the feasible grid.
    pub q_ratio: f64,
    /// How each hole is reached.
    pub holes: Vec<Posture>,
    /// The same with the table at rest in the middle of its travel, if that reaches all.
    pub before: Option<(f64, Vec<Posture>)>,
    /// Evaluations and the best value so far, of an evolution.
    pub convergence: Vec<(usize, f64)>,
    /// Of branch and bound.
    pub certificate: Option<Certificate>,
}

/// Everything for a job.
pub struct Placed {
    /// By series, those placed together last, then by objective.
    pub placements: Vec<Placement>,
    /// Of each series, and of those together.
    pub grids: Vec<Grid>,
    /// Of the same, where the job says what is not sure.
    pub robust: Vec<Robust>,
    /// Of the same, where one is asked for.
    pub fronts: Vec<Front>,
}

/// A position's value, and its postures, one a hole.
pub(super) type Judged = (f64, Vec<Posture>);
/// The same with the position.
pub(super) type Polished = (f64, Position, Vec<Posture>);

/// Looks for one position of some holes.
pub(super) struct Searcher<'a> {
    pub(super) model: &'a PlacementModel<'a>,
    /// "series `A`".
    pub(super) name: String,
    pub(super) targets: Vec<Target<'a>>,
    /// More than one posture reached a hole somewhere: all have to be looked for everywhere.
    several: bool,
    pub(super) progress: &'a Progress<'a>,
}

impl<'a> Searcher<'a> {
    fn new(
        model: &'a PlacementModel<'a>,
        series: &[usize],
        targets: Vec<Target<'a>>,
        progress: &'a Progress<'a>,
    ) -> Self {
        let names: Vec<_> = series.iter().map(|n| format!("`{}`", model.job.series[*n].name)).collect();
        Self {
            model,
            name: format!("series {}", names.join(" + ")),
            several: in_several_ways(model, &targets),
            targets,
            progress,
        }
    }

    pub(super) fn reached(
        &self,
        position: &Position,
        hole: usize,
        state: &mut State,
    ) -> std::result::Result<Vec<Posture>, Miss> {
        let target = &self.targets[hole];
        if self.several {
            return self.model.postures(target, position);
        }
        match self.model.near(target, position, &mut state.near[hole]) {
            Some(posture) => Ok(vec![posture]),
            None if state.is_near => Err(Miss::Reach),
            None => self.model.postures(target, position),
        }
    }

    /// Postures for every hole; the first hole that is out of reach, tried first the next time.
    pub(super) fn all(&self, position: &Position, state: &mut State) -> Option<Vec<Vec<Posture>>> {
        let mut found: Vec<Vec<Posture>> = vec![Vec::new(); self.targets.len()];
        for n in 0..state.order.len() {
            let hole = state.order[n];
            match self.reached(position, hole, state) {
                Ok(postures) => found[hole] = postures,
                Err(_) => {
                    state.order[..=n].rotate_right(1);
                    return None;
                }
            }
        }
        Some(found)
    }

    /// For evolution: holes out of reach, then the value.
    pub(super) fn penalised(&self, objective: Objective, position: &Position, state: &mut State) -> (usize, f64) {
        let count = self.targets.len();
        let found: Vec<_> = (0..count).filter_map(|hole| self.reached(position, hole, state).ok()).collect();
        match count - found.len() {
            0 => (0, self.cheapest(objective, &found).0),
            missing => (missing, f64::INFINITY),
        }
    }

    pub(super) fn state(&self) -> State {
        let count = self.targets.len();
        State { near: vec![self.model.reach.home(); count], order: (0..count).collect(), is_near: false }
    }
}

/// What the next position starts from.
#[derive(Clone)]
pub(super) struct State {
    pub(super) near: Vec<Configuration<f64>>,
    order: Vec<usize>,
    /// What Newton's steps do not reach from `near` is taken to be out of reach: no search for other postures.
    pub(super) is_near: bool,
}

/// Whether holes are reached in more than one way, in the table's box or not, from some position of a coarse lattice.
fn in_several_ways(model: &PlacementModel<'_>, targets: &[Target<'_>]) -> bool {
    lattice(model.job).par_iter().any(|position| {
        targets.iter().any(|target| model.reach.in_working_mode(&model.tool(target, position)).count() > 1)
    })
}

pub(super) fn lattice(job: &Job) -> Vec<Position> {
    let along = |limits: [f64; 2]| places(limits, ((limits[1] - limits[0]) / (LATTICE - 1) as f64).max(1e-12));
    let [xs, ys, angles] = Axis::ALL.map(|axis| along(job.limits[axis]));
    let mut all = Vec::new();
    // a fifth as many angles
    for rotary_rad in angles.into_iter().step_by(5) {
        for dy_m in &ys {
            all.extend(xs.iter().map(|dx_m| Position { dx_m: *dx_m, dy_m: *dy_m, rotary_rad }));
        }
    }
    all
}

/// Places the workpiece for every series and objective.
///
/// # Errors
/// No position of the grid reaches every hole: which, and by how much.
pub fn place(
    model: &PlacementModel<'_>,
    objectives: &[Objective],
    options: &Options,
    progress: &Progress<'_>,
) -> Result<Placed> {
    let job = model.job;
    let axes = grid_axes(job, options)?;
    let mut groups: Vec<Vec<usize>> = (0..job.series.len()).map(|n| vec![n]).collect();
    if job.together {
        groups.push((0..job.series.len()).collect());
    }
    let searchers: Vec<Searcher<'_>> =
        groups.iter().map(|group| Searcher::new(model, group, Target::of(job, group), progress)).collect();
    let mut grids = Vec::new();
    for searcher in &searchers {
        let grid = searcher.grid(objectives, axes.clone());
        if (0..objectives.len()).any(|o| grid.best(o).is_none()) {
            return Err(searcher.unreachable(options));
        }
        grids.push(grid);
    }
    let each = (0..groups.len()).flat_map(|group| (0..objectives.len()).map(move |o| (group, o)));
    let placed = |(n, o): (usize, usize)| -> Result<Placement> {
        let (searcher, grid) = (&searchers[n], &grids[n]);
        let Found { best, convergence, certificate } = searcher.found(objectives[o], grid, o, options);
        let (Some((value, position, holes)), Some(grid_best)) = (best, grid.best(o)) else {
            return Err(searcher.unreachable(options));
        };
        let middle = PerAxis::of(|axis| 0.5 * (job.limits[axis][0] + job.limits[axis][1]));
        Ok(Placement {
            series: groups[n].clone(),
            grid: n,
            objective: objectives[o],
            position,
            value,
            grid_best,
            feasible_share: grid.feasible_share(),
            q_ratio: grid.q_ratio(o, &mean_k(&holes)),
            before: searcher.judged(objectives[o], &middle, &mut searcher.state()),
            holes,
            convergence,
            certificate: certificate.map(|certificate| certificate.of(value)),
        })
    };
    let placements: Vec<Result<Placement>> = each.collect::<Vec<_>>().into_par_iter().map(placed).collect();
    // the first failure, whichever came first
    let placements: Vec<Placement> = placements.into_iter().collect::<Result<_>>()?;
    let tip_worst = objectives.iter().position(|objective| *objective == Objective::TipWorst);
    let robust: Vec<Result<Robust>> = match (&job.robust, tip_worst) {
        (Some(uncertain), Some(o)) => (groups.par_iter().enumerate())
            .map(|(n, group)| {
                let searcher = Searcher::new(model, group, Target::robust(job, group, uncertain), progress);
                let starts = grids[n].optima(o);
                searcher.robust(&placements[n * objectives.len() + o], &grids[n], (&starts, &options.limits), uncertain)
            })
            .collect(),
        _ => Vec::new(),
    };
    let fronts = fronts(&searchers, &grids, &placements, (objectives, options));
    Ok(Placed { placements, grids, robust: robust.into_iter().collect::<Result<_>>()?, fronts })
}

/// Of each group of series, where both objectives are among those that it was placed by.
fn fronts(
    searchers: &[Searcher<'_>],
    grids: &[Grid],
    placements: &[Placement],
    (objectives, options): (&[Objective], &Options),
) -> Vec<Front> {
    let column = |objective: Objective| objectives.iter().position(|o| *o == objective);
    let Some((other, points, limits)) = &options.front else { return Vec::new() };
    let (Some(tip), Some(other)) = (column(Objective::TipWorst), column(*other)) else { return Vec::new() };
    let of_group = |(n, searcher): (usize, &Searcher<'_>)| {
        let ends = [tip, other].map(|o| &placements[n * objectives.len() + o]);
        searcher.front(ends, (&grids[n], [tip, other]), *points, limits)
    };
    searchers.par_iter().enumerate().map(of_group).collect()
}

/// What a method has found.
#[derive(Default)]
struct Found {
    best: Option<Polished>,
    convergence: Vec<(usize, f64)>,
    certificate: Option<Certificate>,
}

impl Searcher<'_> {
    /// The optimum by an objective, the grid's `column`.
    fn found(&self, objective: Objective, grid: &Grid, column: usize, options: &Options) -> Found {
        let optima = grid.optima(column);
        let polished = |starts: &[Position], effort| self.polished(objective, starts, grid, effort);
        match options.method {
            Method::Certified => {
                // as good as the gap that is asked for needs it: cells lead to better places than more starts
                let start = polished(&optima[..1.min(optima.len())], polish::ROUGH);
                let last =
                    Polish { searcher: self, goal: objective.into(), spacing: grid.spacing(), effort: polish::LAST };
                let (best, certificate) = self.certified(&last, start, &options.limits);
                let best = best.map(|best| last.onward(best));
                Found { best, certificate: Some(certificate), ..Found::default() }
            }
            Method::Grid => Found { best: polished(&optima, polish::FULL), ..Found::default() },
            method => {
                let mut convergence = Vec::new();
                let best = match self.evolved(objective, method, options.seed, &mut convergence) {
                    Some(position) if method == Method::Ga => {
                        let judged = self.judged(objective, &position, &mut self.state());
                        judged.map(|(value, holes)| (value, position, holes))
                    }
                    Some(position) => {
                        let starts: Vec<_> =
                            [position].into_iter().chain(grid.best(column).map(|best| best.0)).collect();
                        polished(&starts, polish::FULL)
                    }
                    None => polished(&optima, polish::FULL),
                };
                Found { best, convergence, certificate: None }
            }
        }
    }
}

impl Searcher<'_> {
    /// The best that is found from some starts.
    fn polished(
        &self,
        objective: Objective,
        starts: &[Position],
        grid: &Grid,
        effort: polish::Effort,
    ) -> Option<Polished> {
        let polish = Polish { searcher: self, goal: objective.into(), spacing: grid.spacing(), effort };
        let all: Vec<Polished> = starts.par_iter().filter_map(|start| polish.from(*start)).collect();
        all.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

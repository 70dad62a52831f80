//! What branch and bound knows of a cell of positions, and what it learns by looking at one.

use std::cmp::Ordering;

use pkm_core::Scalar;

use super::boxes::{Box2, Cell};
use super::cover::{Cost, Cover, Solved};
use super::goal::Goal;
use super::search::{Polished as Best, Searcher, State};
use super::targets::Target;
use super::taylor::{ROUNDING, Taylor};
use super::{Objective, Posture};

/// Holes whose cost is bounded over a cell, at the least, where the greatest counts: a mean of two may be bounded better than either.
const MIN_BOUNDED_HOLES: usize = 3;
/// Of what is kept of a cell and its boxes: of the objective that is to be small, of the one that may not be too great.
const MINIMISED: usize = 0;
const LIMITED: usize = 1;
/// Powers of ten: by which the other objective's excess may count, both as shares of their sizes. The paper's objective differs by
/// some 1e-4 where tips move ten times as much.
const FACTORS: [f64; 2] = [-2.0, 6.0];

/// A cell that is not done with.
pub(super) struct Node {
    pub cell: Cell,
    /// Of the objective.
    pub bound: f64,
    /// Of each hole.
    pub boxes: Vec<Vec<Box2>>,
    /// What no position of the cell betters, of each hole: by the objective that is to be small, and by the other one.
    pub lows: [Vec<f64>; 2],
    /// How the middle of the cell that it is a part of is reached.
    pub state: State,
    /// Along which it is divided next.
    pub divide: usize,
}

impl PartialEq for Node {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Node {}

impl PartialOrd for Node {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Node {
    /// The least bound is the greatest: it comes first out of a heap.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_place = || {
            let pairs = self.cell.middle.iter().zip(&other.cell.middle);
            pairs.map(|(a, b)| a.total_cmp(b)).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
        };
        other.bound.total_cmp(&self.bound).then_with(by_place)
    }
}

/// What looking at a cell gives.
pub(super) struct Seen {
    /// `None`: no position of it reaches all holes.
    pub node: Option<Node>,
    /// The middle, judged.
    pub best: Option<Best>,
    /// A bound of what needs no more looking at.
    pub done: f64,
}

/// Along which a cell is longest, a rad counting as half a metre.
pub(super) fn widest(cell: &Cell) -> usize {
    let size = |i: usize| cell.half[i] * if i == 2 { 0.5 } else { 1.0 };
    (0..3).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap_or(0)
}

impl Node {
    pub fn parts(&self) -> [Self; 2] {
        [-1.0, 1.0].map(|sign| {
            let mut cell = self.cell;
            cell.half[self.divide] *= 0.5;
            cell.middle[self.divide] += sign * cell.half[self.divide];
            Self { cell, boxes: self.boxes.clone(), lows: self.lows.clone(), state: self.state.clone(), ..*self }
        })
    }
}

pub(super) struct Search<'a, const N: usize> {
    pub searcher: &'a Searcher<'a>,
    pub cover: Cover<'a, N>,
    pub goal: Goal,
    pub gap: f64,
}

impl<const N: usize> Search<'_, N> {
    /// Bounds the goal over a cell. `value`: the best that is known.
    pub fn seen(&self, mut node: Node, value: f64) -> Seen {
        let enough = value * (1.0 - self.gap);
        let (in_middle, best) = self.in_middle(&mut node);
        let mut order: Vec<usize> = (0..in_middle.len()).collect();
        // what misses the middle first, since it may miss the whole cell, and then what costs most
        order.sort_by(|a, b| in_middle[*b].total_cmp(&in_middle[*a]));
        let (objective, nowhere) = (self.goal.least, f64::INFINITY);
        let (mut costs, mut reached) = (Vec::new(), vec![None; order.len()]);
        if objective == Objective::CycleTime {
            let Some(ways) = self.ways(MINIMISED, &mut node, reached) else {
                return Seen { node: None, best, done: nowhere };
            };
            node.bound = objective.value(node.lows[MINIMISED].iter().copied()).max(node.bound);
            (costs, reached, order) = (ways, vec![None; in_middle.len()], Vec::new());
        }
        for (n, hole) in order.into_iter().enumerate() {
            let bound = objective.value(node.lows[MINIMISED].iter().copied());
            // nowhere in the cell is the least of this one, and of those after it, above its value in the middle
            if objective == Objective::TipWorst && n >= MIN_BOUNDED_HOLES && in_middle[hole] <= bound {
                break;
            }
            let mut solved = self.solved(hole, &mut node);
            let Some(cost) = self.cost(MINIMISED, hole, &mut node, &mut solved) else {
                return Seen { node: None, best, done: nowhere };
            };
            reached[hole] = Some(solved);
            costs.push(cost);
            node.bound = objective.value(node.lows[MINIMISED].iter().copied()).max(node.bound);
            if node.bound >= enough {
                return Seen { node: None, best, done: node.bound };
            }
        }
        let mut whole = together(objective, &costs);
        if let Some((other, most)) = self.goal.most.filter(|_| whole.low().max(node.bound) < enough) {
            let Some(over) = self.kept_to(other, most, &mut node, reached) else {
                return Seen { node: None, best, done: nowhere };
            };
            whole = beside(&whole, &over, most);
        }
        node.bound = whole.low().max(node.bound);
        if node.bound >= enough {
            return Seen { node: None, best, done: node.bound };
        }
        node.divide = self.division(&node.cell, &whole);
        Seen { node: Some(node), best, done: f64::INFINITY }
    }

    /// A function that is nowhere above the other objective; `None` if that is greater than it may be all over the cell. `reached`:
    /// what is known of some holes.
    fn kept_to(
        &self,
        other: Objective,
        most: f64,
        node: &mut Node,
        reached: Vec<Option<Vec<Solved<N>>>>,
    ) -> Option<Taylor<N>> {
        let is_above = |low: f64| low * (1.0 - ROUNDING) > most;
        if other == Objective::CycleTime {
            let ways = self.ways(LIMITED, node, reached)?;
            let is_nowhere = is_above(other.value(node.lows[LIMITED].iter().copied()));
            return Some(together(other, &ways)).filter(|over| !is_nowhere && !is_above(over.low()));
        }
        let mut costs = Vec::new();
        for (hole, solved) in reached.into_iter().enumerate() {
            let mut solved = solved.unwrap_or_else(|| self.solved(hole, node));
            costs.push(self.cost(LIMITED, hole, node, &mut solved)?);
            if is_above(other.value(node.lows[LIMITED].iter().copied())) {
                return None;
            }
        }
        Some(together(other, &costs)).filter(|over| !is_above(over.low()))
    }

    /// Boxes with all solutions of a hole over a cell.
    pub fn solved(&self, hole: usize, node: &mut Node) -> Vec<Solved<N>> {
        let mut solved = self.cover.solved(hole, &node.cell, node.boxes[hole].drain(..));
        // the least time of several pairs is no polynomial, and of two holes hardly known without; deflections are known better box by box
        if [Some(self.goal.least), self.goal.most.map(|most| most.0)].contains(&Some(Objective::CycleTime)) {
            for side in [1.0, -1.0] {
                self.cover.merge(hole, &node.cell, side, &mut solved);
            }
        }
        solved
    }

    /// What each hole costs in the middle of a cell, infinity where it is out of reach, and what the middle is worth if none is.
    fn in_middle(&self, node: &mut Node) -> (Vec<f64>, Option<Best>) {
        let (searcher, position) = (self.searcher, node.cell.position());
        let reached = |hole| searcher.reached(&position, hole, &mut node.state).unwrap_or_default();
        let found: Vec<Vec<Posture>> = (0..searcher.targets.len()).map(reached).collect();
        let cost = |(postures, target): (&Vec<Posture>, &Target<'_>)| {
            let costs = postures.iter().map(|posture| target.weight * self.goal.least.cost(posture));
            costs.fold(f64::INFINITY, f64::min)
        };
        let costs: Vec<f64> = found.iter().zip(&searcher.targets).map(cost).collect();
        let all = found.iter().all(|postures| !postures.is_empty());
        let best = all.then(|| searcher.best_of(self.goal, &found)).flatten();
        let best = best.map(|(value, holes)| (value, position, holes));
        (costs, best)
    }

    /// Of the best way to reach a hole, by the objective that is to be small or by the other one. What is not possible is taken out.
    fn cost(&self, kept: usize, hole: usize, node: &mut Node, solved: &mut Vec<Solved<N>>) -> Option<Cost<N>> {
        let objective = if kept == MINIMISED { self.goal.least } else { self.goal.most?.0 };
        let mut costs = Vec::new();
        solved.retain_mut(|one| {
            let cost = self.cover.cost((objective, kept), hole, &node.cell, one);
            costs.extend(cost);
            cost.is_some()
        });
        let cost = match costs.as_slice() {
            [] => return None,
            [one] => *one,
            // the least of several is no polynomial
            all => Cost::at_least(all.iter().map(|cost| cost.low).fold(f64::INFINITY, f64::min)),
        };
        node.boxes[hole] = solved.iter().map(|one| one.within).collect();
        node.lows[kept][hole] = cost.low.max(node.lows[kept][hole]);
        Some(cost)
    }

    /// Along which a cell's bound gains most by halving it.
    fn division(&self, cell: &Cell, whole: &Taylor<N>) -> usize {
        let gain = |i: usize| whole.spread_by(i);
        let moving = (0..Taylor::<N>::SYMBOLS).filter(|i| cell.half[*i] > 0.0);
        let best = moving.max_by(|a, b| gain(*a).total_cmp(&gain(*b))).filter(|i| gain(*i) > 0.0);
        let widest = widest(cell);
        // not without end along one axis alone
        best.filter(|best| cell.half[*best] * 8.0 > cell.half[widest]).unwrap_or(widest)
    }
}

/// The mean of two with the greatest bound.
fn best_mean<const N: usize>(a: &Taylor<N>, b: &Taylor<N>) -> Taylor<N> {
    let mean = |share: f64| Taylor::ZERO.plus(1.0 - share, a).plus(share, b);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..12 {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if mean(left).low() < mean(right).low() { low = left } else { high = right }
    }
    mean(0.5 * (low + high))
}

/// A function that is nowhere above an objective.
fn together<const N: usize>(objective: Objective, costs: &[Cost<N>]) -> Taylor<N> {
    let sum = || costs.iter().fold(Taylor::ZERO, |sum, cost| sum + cost.over);
    match objective {
        Objective::Paper | Objective::CycleTime => sum(),
        Objective::TipMean => Taylor::ZERO.plus(1.0 / costs.len() as f64, &sum()),
        // the greatest of all is not less than any mean of them: the best mean of two, then of that and a third
        Objective::TipWorst => {
            let worst = costs.iter().map(|cost| cost.over).max_by(|a, b| a.low().total_cmp(&b.low()));
            let mut mixed = worst.unwrap_or(Taylor::ZERO);
            for _ in 0..2 {
                let better = costs.iter().map(|cost| best_mean(&mixed, &cost.over));
                let better = better.max_by(|a, b| a.low().total_cmp(&b.low()));
                mixed = better.filter(|better| better.low() > mixed.low()).unwrap_or(mixed);
            }
            mixed
        }
    }
}

/// A function that is nowhere above a cost where another one is at most some value: with that one's excess, which is not positive
/// there, times a factor.
fn beside<const N: usize>(cost: &Taylor<N>, other: &Taylor<N>, most: f64) -> Taylor<N> {
    let excess = Taylor::constant(-most * (1.0 + ROUNDING)).plus(1.0, other);
    let scale = cost.middle().abs() / most;
    let with = |power: f64| cost.plus(scale * 10_f64.powf(power), &excess);
    let [mut low, mut high] = FACTORS;
    for _ in 0..20 {
        let (left, right) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if with(left).low() < with(right).low() { low = left } else { high = right }
    }
    let best = with(0.5 * (low + high));
    if best.low() > cost.low() { best } else { *cost }
}

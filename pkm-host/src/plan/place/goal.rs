//! What a search looks for: the least of an objective, perhaps where another one is not above some value.

use super::search::{Judged, Searcher, State};
use super::targets::Target;
use super::{Objective, PlacementModel, Posture};
use crate::files::job::Position;

/// What is to be small, and what may not be greater than some value, SI.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    pub least: Objective,
    pub most: Option<(Objective, f64)>,
}

impl From<Objective> for Goal {
    fn from(least: Objective) -> Self {
        Self { least, most: None }
    }
}

impl PlacementModel<'_> {
    /// What a choice of postures, one a hole, is worth.
    fn worth(&self, objective: Objective, targets: &[Target<'_>], postures: &[Posture]) -> f64 {
        if objective == Objective::CycleTime {
            return objective.value(self.ways_s(targets, postures).into_iter());
        }
        objective.value(postures.iter().zip(targets).map(|(p, target)| target.weight * objective.cost(p)))
    }

    /// The same for one of the job's series by itself.
    pub(crate) fn worth_of(&self, objective: Objective, series: usize, postures: &[Posture]) -> f64 {
        self.worth(objective, &Target::of(self.job, &[series]), postures)
    }
}

impl Searcher<'_> {
    /// What a choice of postures, one a hole, is worth.
    pub fn worth(&self, objective: Objective, postures: &[Posture]) -> f64 {
        self.model.worth(objective, &self.targets, postures)
    }

    /// Of all postures that reach a hole the one that costs least, and what they all cost together.
    pub fn cheapest(&self, objective: Objective, found: &[Vec<Posture>]) -> Judged {
        if objective == Objective::CycleTime {
            let best = self.quickest(found);
            return (self.worth(objective, &best), best);
        }
        let cost = |p: &Posture| objective.cost(p);
        let best: Vec<Posture> =
            found.iter().filter_map(|p| p.iter().min_by(|a, b| cost(a).total_cmp(&cost(b))).copied()).collect();
        (self.worth(objective, &best), best)
    }

    /// The same for a goal; `None` where the other objective is greater than it may be.
    pub fn best_of(&self, goal: Goal, found: &[Vec<Posture>]) -> Option<Judged> {
        let best = self.cheapest(goal.least, found);
        let Some((other, most)) = goal.most else { return Some(best) };
        if self.worth(other, &best.1) <= most {
            return Some(best);
        }
        // holes that are reached in other ways
        let (value, postures) = self.cheapest(other, found);
        (value <= most).then(|| (self.worth(goal.least, &postures), postures))
    }

    pub fn judged(&self, goal: impl Into<Goal>, position: &Position, state: &mut State) -> Option<Judged> {
        self.all(position, state).and_then(|found| self.best_of(goal.into(), &found))
    }
}

//! The search over sets of blocks: steps forward, removal, exchange.

use rayon::prelude::*;

use super::evidence::{Evidence, Family, Linear, Set};
use super::{Finding, Inferred, PlaceModel, Rival, State, low_rank};
use crate::levels::Levels;
use crate::noise::{Noise, NoiseSource};

/// The place of a block that has none.
pub const NOWHERE: &str = "none";

/// A set that was compared, linear about its own optimum.
#[derive(Clone)]
struct Tried {
    ln: f64,
    set: Set,
    state: State,
}

struct Search<'a> {
    evidence: Evidence<'a>,
    best: Tried,
    /// All families at the best state.
    linear: Linear,
    /// Every set that was compared, by families.
    compared: Vec<(Vec<usize>, f64)>,
    /// Families that were tried beside the best set and gain too little, with what they gain.
    refused: Vec<(usize, f64)>,
}

/// Infers where the readings ask for more than the declared model. `None` where there are none, or some are not finite, and where the
/// model has no prediction.
pub fn infer(levels: &Levels<'_>, noise: &Noise, model: &dyn PlaceModel) -> Option<Inferred> {
    let (rules, observed) = (levels.plain.rules, levels.plain.observed());
    if observed.is_empty() || !observed.iter().all(|value| value.is_finite()) {
        return None;
    }
    let families = (0..model.blocks().len())
        .map(|block| Family { block, combinations: None, ln_prior: model.blocks()[block].ln_prior })
        .collect();
    let evidence = Evidence {
        model,
        whiteners: rules.block_levels.iter().map(|l| levels.problems[*l].whitener).collect(),
        is_declared: noise.source == NoiseSource::Declared,
        dof: if noise.dof > 0.0 { noise.dof.max(rules.min_dof_of_kind) } else { rules.dof_of_declared_noise },
        observed,
        rules,
        families,
    };
    let start = State { declared: vec![0.0; model.declared()], blocks: Vec::new() };
    let none = Set { members: Vec::new(), level: 0, scatter: 0 };
    let (ln, set, state) = evidence.optimum(&start, &none, rules.block_steps)?;
    let all: Vec<usize> = (0..evidence.families.len()).collect();
    let linear = evidence.linear(&state, &all)?;
    let (compared, best) = (vec![(Vec::new(), ln)], Tried { ln, set, state });
    let mut search = Search { evidence, linear, compared, refused: Vec::new(), best };
    for _ in 0..rules.max_blocks {
        if !search.forward()? {
            break;
        }
        search.revise()?;
    }
    search.result()
}

impl Search<'_> {
    fn all(&self) -> Vec<usize> {
        (0..self.evidence.families.len()).collect()
    }

    fn open(&self) -> Vec<usize> {
        let is_open = |f: &usize| self.best.set.members.iter().all(|m| m.0 != *f);
        self.all().into_iter().filter(is_open).collect()
    }

    /// Takes over a set.
    fn accept(&mut self, tried: Tried) -> Option<()> {
        self.best = tried;
        self.linear = self.evidence.linear(&self.best.state, &self.all())?;
        Some(())
    }

    /// A set about its own optimum.
    fn tried(&mut self, set: &Set) -> Option<Tried> {
        let (ln, set, state) = self.evidence.optimum(&self.best.state, set, self.evidence.rules.block_steps)?;
        let mut families: Vec<usize> = set.members.iter().map(|m| m.0).collect();
        families.sort_unstable();
        self.compared.push((families, ln));
        Some(Tried { ln, set, state })
    }

    /// Adds families of low rank about what the whole compliances would be.
    fn derive(&mut self) -> Option<()> {
        let e = &self.evidence;
        let others = e.without_member(&self.linear, &self.best.set);
        let mut new = Vec::new();
        for f in self.open() {
            let (block, family) = (e.block(f), &e.families[f]);
            if block.forces == 0 || family.combinations.is_some() {
                continue;
            }
            let (_, scale, level) = e.best_member(&self.linear, &others, f);
            let set = Set { level, ..self.best.set.with(f, scale) };
            let last = set.members.len() - 1;
            let Some((state, _)) = e.solve(&self.linear, &set) else { continue };
            for rank in 1..=2 {
                if let Some(combinations) = low_rank::tangent(&state.blocks[last].1, block.forces, rank) {
                    let ln_prior = family.ln_prior + e.rules.ln_prior_of_low_rank;
                    new.push(Family { block: family.block, combinations: Some(combinations), ln_prior });
                }
            }
        }
        self.evidence.families.extend(new);
        let all = self.all();
        // the blocks are those at the same state: only their combinations are new
        self.evidence.widen(&mut self.linear, &all)
    }

    /// Sets of some members and one more, which goes to a place among them, by their evidence at the best state.
    fn ranked(&self, others: &Set, at: usize) -> Vec<(f64, Set)> {
        let eliminated = self.evidence.without_member(&self.linear, others);
        let of = |f: usize| {
            let (ln, scale, level) = self.evidence.best_member(&self.linear, &eliminated, f);
            let mut set = Set { level, ..others.clone() };
            set.members.insert(at, (f, scale));
            (ln, set)
        };
        let mut ranked: Vec<(f64, Set)> = self.open().into_par_iter().map(of).collect();
        ranked.sort_by(|a, b| b.0.total_cmp(&a.0));
        ranked
    }

    /// Adds the best family; false if none gains enough.
    fn forward(&mut self) -> Option<bool> {
        self.derive()?;
        let ranked = self.ranked(&self.best.set, self.best.set.members.len());
        let tried = ranked.iter().take(self.evidence.rules.blocks_tried);
        let tried: Vec<Tried> = tried.filter_map(|(_, set)| self.tried(set)).collect();
        let gain = |t: &Tried| t.set.members.last().map(|m| (m.0, t.ln - self.best.ln));
        self.refused = tried.iter().filter_map(gain).collect();
        let best = tried.into_iter().max_by(|a, b| a.ln.total_cmp(&b.ln));
        let least = self.best.ln + self.evidence.rules.min_block_gain;
        match best.filter(|b| b.ln > least) {
            Some(best) => {
                self.refused.clear();
                self.accept(best).map(|()| true)
            }
            None => Some(false),
        }
    }

    /// Removes members that others have made needless, and exchanges members for likelier ones.
    fn revise(&mut self) -> Option<()> {
        let rules = self.evidence.rules;
        let mut at = 0;
        while at < self.best.set.members.len() && self.best.set.members.len() > 1 {
            let without = self.best.set.without(at);
            if let Some(tried) = self.tried(&without).filter(|t| t.ln > self.best.ln - rules.min_block_gain) {
                self.accept(tried)?;
                continue;
            }
            let ranked = self.ranked(&without, at);
            let floor = self.best.ln - rules.exchange_margin;
            let close: Vec<Set> =
                ranked.into_iter().take(rules.exchanges_tried).filter(|r| r.0 > floor).map(|r| r.1).collect();
            let tried: Vec<Tried> = close.iter().filter_map(|set| self.tried(set)).collect();
            let best = tried.into_iter().max_by(|a, b| a.ln.total_cmp(&b.ln));
            if let Some(best) = best.filter(|b| b.ln > self.best.ln + rules.min_exchange_gain) {
                self.accept(best)?;
            }
            at += 1;
        }
        Some(())
    }

    /// Where the block of a family is.
    fn places(&self, family: usize) -> Vec<String> {
        let places = &self.evidence.block(family).places;
        if places.is_empty() { vec![NOWHERE.to_owned()] } else { places.clone() }
    }

    /// Of what the likeliest set leaves of the whitened readings.
    fn reduced_chi2(&self) -> Option<f64> {
        let (_, rest) = self.evidence.solve(&self.linear, &self.best.set)?;
        Some(rest / self.evidence.observed.len() as f64)
    }

    /// What differences of ln evidence are divided by before they become probabilities: what is left beyond the noise makes every one of them
    /// as much greater than it is.
    fn temper(&self) -> Option<f64> {
        Some(self.evidence.rules.temper_of_places * self.reduced_chi2()?.max(1.0))
    }

    fn rival(&self, family: usize, probability: f64) -> Rival {
        Rival { block: self.evidence.families[family].block, places: self.places(family), probability }
    }

    /// What was tried beside the findings in vain, as one more of them.
    fn refused(&self) -> Option<Vec<Rival>> {
        let (least, temper) = (self.evidence.rules.min_block_gain, self.temper()?);
        let odds = |gain: f64| ((gain - least) / temper).exp();
        let total: f64 = 1.0 + self.refused.iter().map(|r| odds(r.1)).sum::<f64>();
        Some(self.refused.iter().map(|(family, gain)| self.rival(*family, odds(*gain) / total)).collect())
    }

    /// One member's place: all that could stand there, the other members kept.
    fn finding(&mut self, at: usize) -> Option<Finding> {
        let own = self.best.set.members[at].0;
        let ranked = self.ranked(&self.best.set.without(at), at);
        let floor = self.best.ln - self.evidence.rules.rival_margin;
        // one rival a place, or places that act alike, the likeliest: how many blocks these have says nothing of them
        let mut seen: Vec<Vec<String>> = vec![self.places(own)];
        let mut close: Vec<Set> = Vec::new();
        for (_, set) in ranked.into_iter().filter(|r| r.0 > floor) {
            let places = self.places(set.members[at].0);
            if close.len() < self.evidence.rules.rivals_tried && !seen.contains(&places) {
                seen.push(places);
                close.push(set);
            }
        }
        let mut rivals = vec![(own, self.best.clone())];
        for set in close {
            rivals.extend(self.tried(&set).map(|t| (set.members[at].0, t)));
        }
        let without = self.best.set.without(at);
        let without = self.tried(&without).map(|t| t.ln);
        let gain = without.map_or(0.0, |ln| self.best.ln - ln);
        let top = rivals.iter().fold(f64::NEG_INFINITY, |m, r| m.max(r.1.ln));
        let temper = self.temper()?;
        let tempered = |ln: f64| ((ln - top) / temper).exp();
        // that nothing is there is a rival without a place
        let total: f64 = rivals.iter().map(|r| r.1.ln).chain(without).map(tempered).sum();
        let rival = |(family, tried): &(usize, Tried)| self.rival(*family, tempered(tried.ln) / total);
        let mut all: Vec<Rival> = rivals.iter().map(rival).collect();
        all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        let (likeliest, state) = rivals
            .iter()
            .max_by(|a, b| a.1.ln.total_cmp(&b.1.ln))
            .map_or((own, &self.best.state), |(family, tried)| (*family, &tried.state));
        let block = self.evidence.families[likeliest].block;
        let of_block = |(b, amplitudes): (usize, Vec<f64>)| (b == block).then_some(amplitudes);
        let amplitudes = self.evidence.of_blocks(state).blocks.into_iter().find_map(of_block).unwrap_or_default();
        let columns = self.linear.columns_of(own)? * self.best.set.members[at].1;
        Some(Finding { block, gain, rivals: all, temper, columns, amplitudes })
    }

    fn result(mut self) -> Option<Inferred> {
        let mut findings: Vec<Finding> =
            (0..self.best.set.members.len()).map(|at| self.finding(at)).collect::<Option<_>>()?;
        findings.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let top = self.compared.iter().fold(f64::NEG_INFINITY, |m, c| m.max(c.1));
        self.compared.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut sets: Vec<(Vec<usize>, f64)> = Vec::new();
        for (families, ln) in &self.compared {
            let mut blocks: Vec<usize> = families.iter().map(|f| self.evidence.families[*f].block).collect();
            blocks.sort_unstable();
            if sets.iter().all(|s| s.0 != blocks) {
                sets.push((blocks, (ln - top).exp()));
            }
        }
        let total: f64 = sets.iter().map(|s| s.1).sum();
        sets.iter_mut().for_each(|s| s.1 /= total);
        sets.truncate(self.evidence.rules.rivals_tried);
        Some(Inferred { findings, alternatives: sets, refused: self.refused()?, reduced_chi2: self.reduced_chi2()? })
    }
}

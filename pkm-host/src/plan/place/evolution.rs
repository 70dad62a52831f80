//! The paper's genetic algorithm, and differential evolution.

use std::f64::consts::PI;

use fastrand::Rng;
use rayon::prelude::*;

use super::Objective;
use super::search::{Method, Searcher};
use crate::files::job::{PerAxis, Position};

/// Individuals, and generations after the first: 4,960 evaluations.
const POPULATION: usize = 40;
const GENERATIONS: usize = 123;
/// Shares of the genetic algorithm's children that are crossed, and of their genes that are mutated, by how much at first.
const CROSSED: f64 = 0.9;
const MUTATED: f64 = 0.2;
const MUTATION: f64 = 0.2;
/// Share of the genes that differential evolution exchanges.
const EXCHANGED: f64 = 0.9;

/// An individual of an evolution: where between its limits each axis stands, 0 to 1.
type Shares = [f64; 3];

impl Searcher<'_> {
    /// The paper's genetic algorithm, or differential evolution.
    pub(super) fn evolved(
        &self,
        objective: Objective,
        method: Method,
        seed: u64,
        convergence: &mut Vec<(usize, f64)>,
    ) -> Option<Position> {
        let mut rng = Rng::with_seed(seed);
        let position = |shares: &Shares| {
            PerAxis::of(|axis| {
                let [low, high] = self.model.job.limits[axis];
                low + shares[axis as usize] * (high - low)
            })
        };
        let judged = |all: &[Shares]| -> Vec<(usize, f64)> {
            all.par_iter().map(|shares| self.penalised(objective, &position(shares), &mut self.state())).collect()
        };
        let mut all: Vec<Shares> = (0..POPULATION).map(|_| [rng.f64(), rng.f64(), rng.f64()]).collect();
        let mut costs = judged(&all);
        let told = format!("{}, {}", self.name, objective.name());
        for generation in 0..=GENERATIONS {
            (self.progress)(&told, generation as u64, GENERATIONS as u64);
            let best = (0..POPULATION).reduce(|best, i| if is_better(costs[i], costs[best]) { i } else { best })?;
            if costs[best].0 == 0 {
                convergence.push(((generation + 1) * POPULATION, costs[best].1));
            }
            if generation == GENERATIONS {
                return (costs[best].0 == 0).then(|| position(&all[best]));
            }
            let next = match method {
                Method::De => mixed(&mut rng, &all),
                _ => bred(&mut rng, (&all, &costs), best, generation),
            };
            let found = judged(&next);
            for i in 0..POPULATION {
                if method != Method::De || !is_better(costs[i], found[i]) {
                    (all[i], costs[i]) = (next[i], found[i]);
                }
            }
        }
        None
    }
}

/// How many constraints an individual breaks, and its cost.
type Cost = (usize, f64);

fn is_better(a: Cost, b: Cost) -> bool {
    a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)).is_lt()
}

/// A generation of differential evolution: beside each individual the sum of one and the weighted difference of two, with some of its own genes.
fn mixed(rng: &mut Rng, all: &[Shares]) -> Vec<Shares> {
    let of = |own: &Shares| {
        let [a, b, c] = [0; 3].map(|_| all[rng.usize(..POPULATION)]);
        let (weight, kept) = (0.5 + 0.5 * rng.f64(), rng.usize(..3));
        std::array::from_fn(|d| {
            let mixed = a[d] + weight * (b[d] - c[d]);
            if d == kept || rng.f64() < EXCHANGED { reflected(mixed) } else { own[d] }
        })
    };
    all.iter().map(of).collect()
}

/// A generation of the paper's genetic algorithm, real-coded: tournaments, blend crossover, mutation that narrows, the best two kept.
fn bred(rng: &mut Rng, (all, costs): (&[Shares], &[Cost]), best: usize, generation: usize) -> Vec<Shares> {
    let width = MUTATION * (1.0 - generation as f64 / GENERATIONS as f64).powi(3) + 5e-4;
    let mut tournament = || {
        let [a, b] = [0; 2].map(|_| rng.usize(..POPULATION));
        let winner = all[if is_better(costs[b], costs[a]) { b } else { a }];
        (winner, rng.f64(), [rng.f64(), rng.f64(), rng.f64()])
    };
    let mut children: Vec<Shares> = Vec::with_capacity(POPULATION);
    while children.len() < POPULATION {
        let ((a, crossed, share), (b, ..)) = (tournament(), tournament());
        // from a third beyond the one to a third beyond the other
        let mixed = |d: usize| a[d] + (share[d] * 5.0 / 3.0 - 1.0 / 3.0) * (b[d] - a[d]);
        children.push(std::array::from_fn(|d| if crossed < CROSSED { mixed(d) } else { a[d] }));
    }
    for gene in children.iter_mut().flatten() {
        if rng.f64() < MUTATED {
            *gene += width * (-2.0 * (1.0 - rng.f64()).ln()).sqrt() * (2.0 * PI * rng.f64()).cos();
        }
        *gene = reflected(*gene);
    }
    let second = (0..POPULATION)
        .filter(|i| *i != best)
        .fold(best, |second, i| if second == best || is_better(costs[i], costs[second]) { i } else { second });
    (children[0], children[1]) = (all[best], all[second]);
    children
}

/// Back into 0…1 from beyond.
fn reflected(share: f64) -> f64 {
    let folded = share.rem_euclid(2.0);
    if folded > 1.0 { 2.0 - folded } else { folded }
}

//! Evidence of sets of blocks in the linear model at a state.

mod elimination;

use std::collections::BTreeMap;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::{Block, PlaceModel, State};
use crate::fit::squared;
use crate::rules::Rules;
use crate::whitening::Whitener;

/// What sets are made of: a block of the model, or combinations of its columns.
#[derive(Clone, Debug)]
pub struct Family {
    /// Of the model.
    pub block: usize,
    /// Columns of the family from those of the block; none for the block itself.
    pub combinations: Option<DMatrix<f64>>,
    /// ln of the prior weight.
    pub ln_prior: f64,
}

/// Some families with their prior scales, and the errors under which the readings are judged.
#[derive(Clone, Debug)]
pub struct Set {
    /// Families and prior scales.
    pub members: Vec<(usize, f64)>,
    /// Level of the errors that readings have in common.
    pub level: usize,
    /// Index of the scatter of declared values.
    pub scatter: usize,
}

impl Set {
    /// The same with one more member.
    pub fn with(&self, family: usize, scale: f64) -> Self {
        let mut set = self.clone();
        set.members.push((family, scale));
        set
    }

    /// The same without a member.
    pub fn without(&self, at: usize) -> Self {
        let mut set = self.clone();
        set.members.remove(at);
        set
    }
}

/// Inner products under one level of common errors.
struct Products {
    /// Of what every set may hold, with itself: declared values, members of the state, data.
    held: DMatrix<f64>,
    /// By wanted family: with what is held, and with itself. No set has two families of which neither is held.
    with_held: DMatrix<f64>,
    own: Vec<DMatrix<f64>>,
    /// By scatter: the part of each column, and of the data, that declared values take, and ln of their determinant.
    taken: Vec<(DMatrix<f64>, f64)>,
}

/// Inner products of a block's columns under one level: with what is held, and with themselves.
struct Part {
    with_held: DMatrix<f64>,
    own: DMatrix<f64>,
}

/// The linear model at a state. Columns of blocks are as long as the readings are many: what is kept of them is their inner
/// products.
pub struct Linear {
    wanted: Vec<usize>,
    /// First column of each wanted family, and the data's.
    starts: Vec<usize>,
    /// First of the held columns of each wanted family that is a member of the state.
    held_at: Vec<Option<usize>>,
    products: Vec<Products>,
    /// By block that is wanted: its products, level by level.
    parts: BTreeMap<usize, Vec<Part>>,
    /// Families of the state with their whitened columns.
    members: Vec<(usize, DMatrix<f64>)>,
    declared: usize,
}

fn ln_determinant(c: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * c.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>()
}

impl Linear {
    fn position(&self, family: usize) -> Option<usize> {
        self.wanted.iter().position(|w| *w == family)
    }

    /// Whitened columns of a member of the state.
    pub fn columns_of(&self, family: usize) -> Option<&DMatrix<f64>> {
        self.members.iter().find(|m| m.0 == family).map(|m| &m.1)
    }

    fn product(&self, p: &Products, (w, i): (usize, usize), (v, j): (usize, usize)) -> f64 {
        if w == v {
            p.own[w][(i - self.starts[w], j - self.starts[w])]
        } else if let Some(at) = self.held_at[w] {
            p.with_held[(at + i - self.starts[w], j)]
        } else if let Some(at) = self.held_at[v] {
            p.with_held[(at + j - self.starts[v], i)]
        } else {
            f64::NAN
        }
    }
}

/// What every set may hold: declared values, members of the state, data.
fn held(declared: &DMatrix<f64>, members: &[(usize, DMatrix<f64>)], data: &DVector<f64>) -> DMatrix<f64> {
    let of_members = members.iter().flat_map(|m| m.1.column_iter());
    let columns: Vec<_> = declared.column_iter().chain(of_members).chain([data.column(0)]).collect();
    DMatrix::from_columns(&columns)
}

/// Readings, model and rules together.
pub struct Evidence<'a> {
    /// What predicts.
    pub model: &'a dyn PlaceModel,
    /// By level of common errors.
    pub whiteners: Vec<&'a Whitener>,
    /// Degrees of freedom of the noise.
    pub dof: f64,
    /// Whether the noise was declared, and not seen in repeats.
    pub is_declared: bool,
    /// Whitened readings.
    pub observed: &'a DVector<f64>,
    /// What decides.
    pub rules: &'a Rules,
    /// What sets are made of.
    pub families: Vec<Family>,
}

impl Evidence<'_> {
    /// The block of a family.
    pub fn block(&self, family: usize) -> &Block {
        &self.model.blocks()[self.families[family].block]
    }

    fn width(&self, family: usize) -> usize {
        let f = &self.families[family];
        f.combinations.as_ref().map_or(self.block(family).columns, DMatrix::ncols)
    }

    /// A state of families as one of blocks.
    pub fn of_blocks(&self, state: &State) -> State {
        let blocks = state.blocks.iter().map(|(family, a)| {
            let f = &self.families[*family];
            let own = f
                .combinations
                .as_ref()
                .map_or_else(|| a.clone(), |c| (c * DVector::from_column_slice(a)).as_slice().to_vec());
            (f.block, own)
        });
        let mut merged: Vec<(usize, Vec<f64>)> = Vec::new();
        for (block, own) in blocks {
            match merged.iter_mut().find(|m| m.0 == block) {
                Some((_, there)) => there.iter_mut().zip(own).for_each(|(t, o)| *t += o),
                None => merged.push((block, own)),
            }
        }
        State { declared: state.declared.clone(), blocks: merged }
    }

    /// The linear model at a state for some families; those of the state must be among them.
    pub fn linear(&self, state: &State, wanted: &[usize]) -> Option<Linear> {
        let at = self.model.at(&self.of_blocks(state))?;
        let declared = at.declared();
        let mut data = self.observed - at.predicted();
        data.gemv(1.0, &declared, &DVector::from_column_slice(&state.declared), 1.0);
        let mut members = Vec::new();
        for (f, amplitudes) in &state.blocks {
            let family = &self.families[*f];
            let columns = at.block(family.block)?;
            let columns = match &family.combinations {
                Some(c) => columns * c,
                None => columns,
            };
            data.gemv(1.0, &columns, &DVector::from_column_slice(amplitudes), 1.0);
            members.push((*f, columns));
        }
        let held = held(&declared, &members, &data);
        let by_held = held.transpose();
        let lost_of_held: Vec<DMatrix<f64>> = self.whiteners.par_iter().map(|w| w.lost(&by_held)).collect();
        let is_member = |f: &usize| members.iter().any(|m| m.0 == *f);
        let mut blocks: Vec<usize> = wanted.iter().filter(|f| !is_member(f)).map(|f| self.families[*f].block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let parts = blocks.into_par_iter().map(|block| {
            let columns = at.block(block)?;
            let rows = columns.transpose();
            let (with_held, own) = (&by_held * &columns, &rows * &columns);
            let of = |(whitener, lost_of_held): (&&Whitener, &DMatrix<f64>)| {
                let lost = whitener.lost(&rows);
                Part { with_held: &with_held - lost_of_held * lost.transpose(), own: &own - squared(&lost) }
            };
            Some((block, self.whiteners.iter().zip(&lost_of_held).map(of).collect()))
        });
        let parts = parts.collect::<Option<Vec<(usize, Vec<Part>)>>>()?.into_iter().collect();
        let all = &by_held * &held;
        let products = lost_of_held.iter().map(|lost| Products {
            held: &all - squared(lost),
            with_held: DMatrix::zeros(0, 0),
            own: Vec::new(),
            taken: Vec::new(),
        });
        let mut linear = Linear {
            wanted: Vec::new(),
            starts: Vec::new(),
            held_at: Vec::new(),
            products: products.collect(),
            parts,
            members,
            declared: declared.ncols(),
        };
        self.widen(&mut linear, wanted)?;
        Some(linear)
    }

    /// Takes other families of the same blocks.
    pub fn widen(&self, l: &mut Linear, wanted: &[usize]) -> Option<()> {
        l.wanted = wanted.to_vec();
        l.starts = vec![0];
        for f in wanted {
            l.starts.push(l.starts[l.starts.len() - 1] + self.width(*f));
        }
        let mut next = l.declared;
        let mut firsts = Vec::new();
        for (f, columns) in &l.members {
            firsts.push((*f, next));
            next += columns.ncols();
        }
        l.held_at = wanted.iter().map(|f| firsts.iter().find(|m| m.0 == *f).map(|m| m.1)).collect();
        for (level, p) in l.products.iter_mut().enumerate() {
            let rows = p.held.nrows();
            let mut with_held = DMatrix::zeros(rows, l.starts[wanted.len()] + 1);
            p.own.clear();
            for (w, f) in wanted.iter().enumerate() {
                let width = self.width(*f);
                let family = &self.families[*f];
                let mut target = with_held.columns_mut(l.starts[w], width);
                if let Some(at) = l.held_at[w] {
                    target.copy_from(&p.held.columns(at, width));
                    p.own.push(p.held.view((at, at), (width, width)).clone_owned());
                    continue;
                }
                let part = &l.parts.get(&family.block)?[level];
                match &family.combinations {
                    Some(c) => {
                        target.gemm(1.0, &part.with_held, c, 0.0);
                        p.own.push(c.tr_mul(&(&part.own * c)));
                    }
                    None => {
                        target.copy_from(&part.with_held);
                        p.own.push(part.own.clone());
                    }
                }
            }
            with_held.set_column(l.starts[wanted.len()], &p.held.column(rows - 1));
            let declared = p.held.view((0, 0), (l.declared, l.declared));
            let taken = self.rules.declared_scatters.iter().map(|s| {
                let chol = (declared * (s * s) + DMatrix::identity(l.declared, l.declared)).cholesky()?;
                let x = chol.l_dirty().solve_lower_triangular(&(with_held.rows(0, l.declared) * *s))?;
                Some((x, ln_determinant(&chol) + self.whiteners[level].log_determinant))
            });
            p.taken = taken.collect::<Option<Vec<_>>>()?;
            p.with_held = with_held;
        }
        Some(())
    }

    /// The best scales, level and scatter of a set, one after another until nothing changes much.
    pub fn tuned(&self, l: &Linear, set: &Set) -> (f64, Set) {
        let mut best = (self.ln_evidence(l, set), set.clone());
        for _ in 0..3 {
            let before = best.0;
            for member in 0..set.members.len() {
                best = self.best_scale(l, &best.1, member);
            }
            for level in 0..self.whiteners.len() {
                for scatter in 0..self.rules.declared_scatters.len() {
                    let set = Set { level, scatter, ..best.1.clone() };
                    let ln = self.ln_evidence(l, &set);
                    if ln > best.0 {
                        best = (ln, set);
                    }
                }
            }
            if best.0 - before < 1e-3 {
                break;
            }
        }
        best
    }

    /// Most likely state of a set in the linear model, and the squared whitened residuals there.
    pub fn solve(&self, l: &Linear, set: &Set) -> Option<(State, f64)> {
        let scatter = self.rules.declared_scatters[set.scatter];
        let p = &l.products[set.level];
        // wanted family, its column, prior scale; declared values have no family
        let mut index: Vec<(Option<usize>, usize, f64)> = (0..l.declared).map(|j| (None, j, scatter)).collect();
        for (f, scale) in &set.members {
            let at = l.position(*f)?;
            index.extend((l.starts[at]..l.starts[at + 1]).map(|c| (Some(at), c, *scale)));
        }
        let product = |a: &(Option<usize>, usize, f64), b: &(Option<usize>, usize, f64)| {
            let unscaled = match (a.0, b.0) {
                (None, None) => p.held[(a.1, b.1)],
                (None, Some(_)) => p.with_held[(a.1, b.1)],
                (Some(_), None) => p.with_held[(b.1, a.1)],
                (Some(w), Some(v)) => l.product(p, (w, a.1), (v, b.1)),
            };
            unscaled * a.2 * b.2
        };
        let n = index.len();
        let data = p.held.nrows() - 1;
        let with_data = |a: &(Option<usize>, usize, f64)| {
            a.2 * if a.0.is_none() { p.held[(data, a.1)] } else { p.with_held[(data, a.1)] }
        };
        let information = DMatrix::from_fn(n, n, |i, j| product(&index[i], &index[j]) + f64::from(u8::from(i == j)));
        let slope = DVector::from_iterator(n, index.iter().map(with_data));
        let y = information.cholesky()?.solve(&slope);
        let rest = p.held[(data, data)] - slope.dot(&y) - y.norm_squared();
        let values: Vec<f64> = y.iter().zip(&index).map(|(v, (.., s))| v * s).collect();
        let (declared, mut others) = values.split_at(l.declared);
        let mut blocks = Vec::new();
        for (f, _) in &set.members {
            let (own, after) = others.split_at(self.width(*f));
            blocks.push((*f, own.to_vec()));
            others = after;
        }
        Some((State { declared: declared.to_vec(), blocks }, rest))
    }

    /// Gauss-Newton steps from a state; the evidence is linear about where they end.
    pub fn optimum(&self, start: &State, set: &Set, steps: usize) -> Option<(f64, Set, State)> {
        let wanted: Vec<usize> = set.members.iter().map(|m| m.0).collect();
        let own = |f: &usize| {
            let own = start.blocks.iter().find(|s| s.0 == *f).map(|s| s.1.clone());
            (*f, own.unwrap_or_else(|| vec![0.0; self.width(*f)]))
        };
        let mut state = State { declared: start.declared.clone(), blocks: wanted.iter().map(own).collect() };
        let mut l = self.linear(&state, &wanted)?;
        let mut best = self.tuned(&l, set);
        let mut left = steps;
        for _ in 0..MAX_STEPS {
            if left == 0 {
                break;
            }
            let Some(step) = self.step((&state, &l), &best.1, &wanted) else { break };
            // far from an optimum a step counts for nothing
            left -= usize::from(!step.is_halved);
            (state, l) = (step.state, step.linear);
            let before = best.0;
            best = self.tuned(&l, &best.1);
            if (best.0 - before).abs() < 0.05 {
                break;
            }
        }
        Some((best.0, best.1, state))
    }

    /// Squares of what a set leaves of the readings at the state where a model is linear, and of the state in units of its prior.
    fn squares(&self, l: &Linear, set: &Set, state: &State) -> f64 {
        let p = &l.products[set.level];
        let scatter = self.rules.declared_scatters[set.scatter];
        let scaled = |(f, own): &(usize, Vec<f64>)| {
            let scale = set.members.iter().find(|m| m.0 == *f).map_or(1.0, |m| m.1);
            own.iter().map(|x| (x / scale).powi(2)).sum::<f64>()
        };
        let prior = state.declared.iter().map(|x| (x / scatter).powi(2)).sum::<f64>();
        let prior = prior + state.blocks.iter().map(scaled).sum::<f64>();
        // as the model was made: data minus all columns times the state
        let all = state.declared.iter().chain(state.blocks.iter().flat_map(|b| &b.1)).map(|x| -x).chain([1.0]);
        let all = DVector::from_iterator(p.held.nrows(), all);
        (&p.held * &all).dot(&all) + prior
    }

    /// As far toward the most likely state of a set in the linear model as the model has predictions and the squares get less.
    fn step(&self, (from, l): (&State, &Linear), set: &Set, wanted: &[usize]) -> Option<Step> {
        let (to, before) = (self.solve(l, set)?.0, self.squares(l, set, from));
        [1.0, 0.5, 0.25, 0.125, 0.0625].into_iter().find_map(|share| {
            let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect::<Vec<f64>>();
            let blocks = from.blocks.iter().zip(&to.blocks).map(|(a, b)| (a.0, mix(&a.1, &b.1))).collect();
            let state = State { declared: mix(&from.declared, &to.declared), blocks };
            let linear = self.linear(&state, wanted)?;
            let after = self.squares(&linear, set, &state);
            (after <= before).then_some(Step { state, linear, is_halved: after < 0.5 * before })
        })
    }
}

/// Most Gauss-Newton steps to an optimum, those that halve the squares included.
const MAX_STEPS: usize = 20;

/// Where a step leads to.
struct Step {
    state: State,
    linear: Linear,
    is_halved: bool,
}

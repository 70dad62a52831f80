//! Evidence of sets of blocks in the linear model at a state.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::{Block, PlaceModel, State};
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

/// Inner products of columns under one level of common errors. Only pairs that can be in one set are kept: all columns with
/// those of the state's members, and each family with itself.
struct Products {
    shared: DMatrix<f64>,
    own: Vec<DMatrix<f64>>,
    /// By scatter: the part of each column, and of the data, that declared values take, and ln of their determinant.
    taken: Vec<(DMatrix<f64>, f64)>,
}

/// The linear model at a state.
pub struct Linear {
    wanted: Vec<usize>,
    /// First column of each wanted family, and the data's.
    starts: Vec<usize>,
    /// Place of each wanted family among the shared columns.
    shared_at: Vec<Option<usize>>,
    products: Vec<Products>,
    /// Whitened readings about the state.
    data: DVector<f64>,
    columns: DMatrix<f64>,
    declared: usize,
}

fn ln_determinant(c: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * c.l_dirty().diagonal().iter().map(|v| v.ln()).sum::<f64>()
}

impl Linear {
    fn position(&self, family: usize) -> Option<usize> {
        self.wanted.iter().position(|w| *w == family)
    }

    /// Whitened columns of a family; none of one that is not wanted.
    pub fn columns_of(&self, family: usize) -> DMatrix<f64> {
        let own = self.position(family).map_or(0..0, |at| self.starts[at]..self.starts[at + 1]);
        self.columns.columns(self.declared + own.start, own.len()).clone_owned()
    }

    fn product(&self, p: &Products, (w, i): (usize, usize), (v, j): (usize, usize)) -> f64 {
        if w == v {
            p.own[w][(i - self.starts[w], j - self.starts[w])]
        } else if let Some(at) = self.shared_at[w] {
            p.shared[(at + i - self.starts[w], j)]
        } else if let Some(at) = self.shared_at[v] {
            p.shared[(at + j - self.starts[v], i)]
        } else {
            f64::NAN
        }
    }
}

/// Readings, model and rules together.
pub struct Evidence<'a> {
    /// What predicts.
    pub model: &'a dyn PlaceModel,
    /// By level of common errors.
    pub whiteners: Vec<&'a Whitener>,
    /// Degrees of freedom of the noise.
    pub dof: f64,
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
        let mut blocks: Vec<usize> = wanted.iter().map(|f| self.families[*f].block).collect();
        blocks.sort_unstable();
        blocks.dedup();
        let (predicted, by_block) = self.model.linear(&self.of_blocks(state), &blocks)?;
        let declared = self.model.declared();
        let mut first = vec![declared];
        for b in &blocks {
            first.push(first[first.len() - 1] + self.model.blocks()[*b].columns);
        }
        let mut starts = vec![0];
        for f in wanted {
            starts.push(starts[starts.len() - 1] + self.width(*f));
        }
        let mut columns = DMatrix::zeros(by_block.nrows(), declared + starts[wanted.len()]);
        columns.columns_mut(0, declared).copy_from(&by_block.columns(0, declared));
        for (f, start) in wanted.iter().zip(&starts) {
            let family = &self.families[*f];
            let at = blocks.binary_search(&family.block).ok()?;
            let own = by_block.columns(first[at], first[at + 1] - first[at]);
            let mut target = columns.columns_mut(declared + start, self.width(*f));
            match &family.combinations {
                Some(c) => target.gemm(1.0, &own, c, 0.0),
                None => target.copy_from(&own),
            }
        }
        let mut data = self.observed - predicted;
        for (j, x) in state.declared.iter().enumerate() {
            data.axpy(*x, &columns.column(j), 1.0);
        }
        for (f, a) in &state.blocks {
            let at = wanted.iter().position(|w| w == f)?;
            for (k, a) in a.iter().enumerate() {
                data.axpy(*a, &columns.column(declared + starts[at] + k), 1.0);
            }
        }
        let mut shared_at = vec![None; wanted.len()];
        let mut shared: Vec<usize> = Vec::new();
        for (w, f) in wanted.iter().enumerate() {
            if state.blocks.iter().any(|s| s.0 == *f) {
                shared_at[w] = Some(shared.len());
                shared.extend(starts[w]..starts[w + 1]);
            }
        }
        shared.push(starts[wanted.len()]);
        let products = (0..self.whiteners.len())
            .into_par_iter()
            .map(|level| self.products(level, &columns, &data, &starts, &shared))
            .collect::<Option<Vec<_>>>()?;
        Some(Linear { wanted: wanted.to_vec(), starts, shared_at, products, data, columns, declared })
    }

    fn products(
        &self,
        level: usize,
        columns: &DMatrix<f64>,
        data: &DVector<f64>,
        starts: &[usize],
        shared: &[usize],
    ) -> Option<Products> {
        let declared = self.model.declared();
        let whitener = self.whiteners[level];
        let n = columns.ncols();
        let mut all = columns.clone().insert_column(n, 0.0);
        all.set_column(n, data);
        for mut c in all.column_iter_mut() {
            whitener.shrink(c.as_mut_slice());
        }
        let a = all.columns(0, declared).transpose();
        let rest = all.columns(declared, n + 1 - declared);
        let (aa, ab) = (&a * all.columns(0, declared), &a * rest);
        let shared = rest.select_columns(shared).transpose() * rest;
        let own = starts.windows(2).map(|w| {
            let c = rest.columns(w[0], w[1] - w[0]);
            c.transpose() * c
        });
        let taken = self.rules.declared_scatters.iter().map(|s| {
            let chol = (&aa * (s * s) + DMatrix::identity(declared, declared)).cholesky()?;
            let x = chol.l_dirty().solve_lower_triangular(&(&ab * *s))?;
            Some((x, ln_determinant(&chol) + whitener.log_determinant))
        });
        Some(Products { shared, own: own.collect(), taken: taken.collect::<Option<Vec<_>>>()? })
    }

    /// ln evidence of a set, with the priors of its members. The variance of the noise is known from so many degrees of
    /// freedom only, so that the readings are Student, not normal.
    pub fn ln_evidence(&self, l: &Linear, set: &Set) -> f64 {
        let rules = self.rules;
        let p = &l.products[set.level];
        let (taken, ln_declared) = &p.taken[set.scatter];
        let (data, data_row) = (l.starts[l.wanted.len()], p.shared.nrows() - 1);
        let mut index: Vec<(usize, usize, f64)> = Vec::new();
        let mut ln_prior = rules.ln_prior_of_scatter * set.scatter as f64 + rules.ln_prior_of_level * set.level as f64;
        for (f, scale) in &set.members {
            let Some(at) = l.position(*f) else { return f64::NEG_INFINITY };
            index.extend((l.starts[at]..l.starts[at + 1]).map(|c| (at, c, *scale)));
            ln_prior += self.families[*f].ln_prior - (rules.block_scales.len() as f64).ln();
        }
        let n = index.len();
        let mut m = DMatrix::identity(n, n);
        for i in 0..n {
            for j in 0..=i {
                let (a, b) = (index[i], index[j]);
                let g = l.product(p, (a.0, a.1), (b.0, b.1)) - taken.column(a.1).dot(&taken.column(b.1));
                m[(i, j)] += g * a.2 * b.2;
                if i != j {
                    m[(j, i)] = m[(i, j)];
                }
            }
        }
        let g = DVector::from_fn(n, |i, _| {
            let (_, column, scale) = index[i];
            (p.shared[(data_row, column)] - taken.column(column).dot(&taken.column(data))) * scale
        });
        let all = p.shared[(data_row, data)] - taken.column(data).norm_squared();
        let Some(chol) = m.cholesky() else { return f64::NEG_INFINITY };
        let rest = (all - g.dot(&chol.solve(&g))).max(f64::MIN_POSITIVE);
        let count = self.observed.len() as f64;
        -0.5 * (ln_determinant(&chol) + ln_declared) - 0.5 * (self.dof + count) * (rest / self.dof).ln_1p() + ln_prior
    }

    /// The best scale of one member, and level, for a set.
    pub fn best_scale(&self, l: &Linear, set: &Set, member: usize) -> (f64, Set) {
        let tries = self.rules.block_scales.iter().flat_map(|s| (0..self.whiteners.len()).map(move |level| (s, level)));
        let of = |(scale, level): (&f64, usize)| {
            let mut set = set.clone();
            set.members[member].1 = *scale;
            set.level = level;
            (self.ln_evidence(l, &set), set)
        };
        tries.map(of).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::NEG_INFINITY, set.clone()))
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
        let mut index: Vec<(usize, f64)> = (0..l.declared).map(|j| (j, scatter)).collect();
        for (f, scale) in &set.members {
            let at = l.position(*f)?;
            index.extend((l.starts[at]..l.starts[at + 1]).map(|c| (l.declared + c, *scale)));
        }
        let n = index.len();
        let mut j = DMatrix::zeros(l.data.len(), n);
        for (k, (c, s)) in index.iter().enumerate() {
            j.set_column(k, &(l.columns.column(*c) * *s));
        }
        let mut d = l.data.clone();
        let whitener = self.whiteners[set.level];
        whitener.shrink(d.as_mut_slice());
        for mut c in j.column_iter_mut() {
            whitener.shrink(c.as_mut_slice());
        }
        let y = (j.transpose() * &j + DMatrix::identity(n, n)).cholesky()?.solve(&j.tr_mul(&d));
        let rest = (d - &j * &y).norm_squared();
        let values: Vec<f64> = y.iter().zip(&index).map(|(v, (_, s))| v * s).collect();
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
        for _ in 0..steps {
            let Some((next, new)) = self.step(&state, &self.solve(&l, &best.1)?.0, &wanted) else { break };
            (state, l) = (next, new);
            let before = best.0;
            best = self.tuned(&l, &best.1);
            if (best.0 - before).abs() < 0.05 {
                break;
            }
        }
        Some((best.0, best.1, state))
    }

    /// As far toward a state as the model has predictions.
    fn step(&self, from: &State, to: &State, wanted: &[usize]) -> Option<(State, Linear)> {
        [1.0, 0.5, 0.25, 0.125].into_iter().find_map(|share| {
            let mix = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a + share * (b - a)).collect::<Vec<f64>>();
            let blocks = from.blocks.iter().zip(&to.blocks).map(|(a, b)| (a.0, mix(&a.1, &b.1))).collect();
            let state = State { declared: mix(&from.declared, &to.declared), blocks };
            let l = self.linear(&state, wanted)?;
            Some((state, l))
        })
    }
}

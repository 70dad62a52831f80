//! Places inferred by blocks, on the chain of springs: what yields there follows no formula that any block has.

use nalgebra::{DMatrix, DVector};
use pkm_diagnosis::places::{AtState, Block, Inferred, NOWHERE, PlaceModel, Rival, State, infer};
use pkm_diagnosis::{Flaw, Levels, Noise, Observations, Problem, Reading, Rules, Unknown, Whitener, levels};

use crate::spring_chain::{COMPLIANCE, Chain, chain, read};

/// What one column of a block adds to the deflection, from the parts of the springs that are out and the force.
type Column = fn(&[f64; 3], f64) -> f64;

/// The chain with blocks.
struct Blocks<'a> {
    chain: &'a Chain,
    problem: &'a Problem<'a>,
    blocks: Vec<Block>,
    columns: Vec<Vec<Column>>,
}

impl<'a> Blocks<'a> {
    fn new(chain: &'a Chain, problem: &'a Problem<'a>) -> Self {
        let all: [(&str, &'static str, Vec<Column>); 4] = [
            ("foundation", "constant", vec![|_, f| COMPLIANCE * f]),
            ("spring 1", "extension", vec![|q, f| COMPLIANCE * f * q[0] * q[0], |q, f| COMPLIANCE * f * q[0].powi(3)]),
            ("spring 2", "extension", vec![|q, f| COMPLIANCE * f * q[1] * q[1], |q, f| COMPLIANCE * f * q[1].powi(3)]),
            ("", "load", vec![|_, f| COMPLIANCE * f.abs(), |_, f| COMPLIANCE * f * f.abs() / 100.0]),
        ];
        let (mut blocks, mut columns) = (Vec::new(), Vec::new());
        for (place, law, own) in all {
            let places = if place.is_empty() { Vec::new() } else { vec![place.to_owned()] };
            blocks.push(Block { places, motion: "axial", law, columns: own.len(), forces: 0, ln_prior: 0.0 });
            columns.push(own);
        }
        Self { chain, problem, blocks, columns }
    }
}

impl PlaceModel for Blocks<'_> {
    fn declared(&self) -> usize {
        3
    }

    fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    fn at<'a>(&'a self, state: &State) -> Option<Box<dyn AtState + 'a>> {
        let springs = [0, 1, 2].map(Unknown);
        let mut predicted = self.problem.predict(&springs, &state.declared)?;
        for (block, amplitudes) in &state.blocks {
            predicted.gemv(1.0, &self.block(*block), &DVector::from_column_slice(amplitudes), 1.0);
        }
        let declared = self.problem.jacobian(&springs, &state.declared, 0..3)?;
        Some(Box::new(AtSprings { blocks: self, predicted, declared }))
    }
}

impl Blocks<'_> {
    fn block(&self, block: usize) -> DMatrix<f64> {
        let column = |of: &Column| -> DVector<f64> {
            let values: Vec<f64> = self.chain.conditions.iter().map(|(q, f)| of(q, *f)).collect();
            self.problem.whitened(&values).into()
        };
        DMatrix::from_columns(&self.columns[block].iter().map(column).collect::<Vec<_>>())
    }
}

/// The chain with some stiffnesses.
struct AtSprings<'a> {
    blocks: &'a Blocks<'a>,
    predicted: DVector<f64>,
    declared: DMatrix<f64>,
}

impl AtState for AtSprings<'_> {
    fn predicted(&self) -> &DVector<f64> {
        &self.predicted
    }

    fn declared(&self) -> DMatrix<f64> {
        self.declared.clone()
    }

    fn block(&self, block: usize) -> Option<DMatrix<f64>> {
        Some(self.blocks.block(block))
    }
}

/// What is inferred, and the springs fitted without it and beside what was found, as disturbances.
fn inferred_and_fitted(chain: &Chain, read: &Observations) -> (Inferred, [DVector<f64>; 2]) {
    let rules = Rules::DEFAULT;
    let noise = Noise::estimate(read, &rules).unwrap();
    let whitener = Whitener::new(read, &noise);
    let plain = Problem::new(read, &whitener, chain, &rules);
    let whiteners = levels::whiteners(&plain);
    let levels = Levels::new(&plain, &whiteners);
    let found = infer(&levels, &noise, &Blocks::new(chain, &plain)).unwrap();
    let columns: Vec<_> = found.findings.iter().flat_map(|f| f.columns.column_iter()).collect();
    let disturbed = if columns.is_empty() {
        whiteners.clone()
    } else {
        levels::disturbed(&whiteners, &DMatrix::from_columns(&columns))
    };
    let springs = [0, 1, 2].map(Unknown);
    let fitted = [&levels, &Levels::new(&plain, &disturbed)].map(|l| l.fit(&springs, &[0.0; 3], 0).unwrap().1.x);
    (found, fitted)
}

fn inferred(chain: &Chain, read: &Observations) -> Inferred {
    inferred_and_fitted(chain, read).0
}

/// Readings of a chain in which something else yields.
fn with(chain: &Chain, seed: u64, extra: impl Fn(&[f64; 3], f64) -> f64) -> Observations {
    let mut read = read(chain, &[], seed);
    for r in &mut read.readings {
        let (q, f) = &chain.conditions[r.condition];
        r.observed[0] = r.observed[0].map(|v| v + extra(q, *f));
    }
    read
}

#[test]
fn nothing_is_found_in_clean_readings() {
    let chain = chain();
    let mut chi2 = 0.0;
    for seed in 0..20 {
        let found = inferred(&chain, &read(&chain, &[], seed));
        assert!(found.findings.is_empty(), "seed {seed}: {:?}", found.findings);
        chi2 += found.reduced_chi2 / 20.0;
    }
    assert!((0.9..1.1).contains(&chi2), "{chi2}");
}

/// Of two series the zeros have one degree of freedom: taken for as small as they happen to seem, they left something to be found in 14
/// of these 300 readings.
#[test]
fn nothing_is_found_in_clean_readings_of_two_series() {
    let chain = chain();
    let is_named =
        |seed: &u64| !inferred(&chain, &read(&chain, &[], *seed).without(|r| r.series == 2)).findings.is_empty();
    let named = (1000..1300).filter(is_named).count();
    assert!(named <= 3, "{named}");
}

#[test]
fn readings_that_cannot_be_are_refused() {
    let chain = chain();
    let good = read(&chain, &[], 1);
    assert_eq!(good.check(), Ok(()));
    let flaw = |change: fn(&mut Reading)| {
        let mut bad = good.clone();
        change(&mut bad.readings[7]);
        bad.check().map_err(|bad| (bad.reading, bad.flaw))
    };
    assert_eq!(flaw(|r| r.observed[0] = Some(f64::NAN)), Err((7, Flaw::NotFinite)));
    assert_eq!(flaw(|r| r.drawn = vec![f64::INFINITY]), Err((7, Flaw::NotFinite)));
    assert_eq!(flaw(|r| r.sigma[0] = Some(0.0)), Err((7, Flaw::Deviation)));
    assert_eq!(flaw(|r| r.observed.clear()), Err((7, Flaw::Count)));
    assert_eq!(flaw(|r| r.condition = 1000), Err((7, Flaw::Number)));
    assert_eq!(flaw(|r| r.series = 20_260_611), Err((7, Flaw::Number)));
    // and what was not checked is no clean bill
    let mut bad = good.clone();
    bad.readings[7].observed[0] = Some(f64::NAN);
    let rules = Rules::DEFAULT;
    let noise = Noise::estimate(&good, &rules).unwrap();
    let whitener = Whitener::new(&bad, &noise);
    let plain = Problem::new(&bad, &whitener, &chain, &rules);
    let whiteners = levels::whiteners(&plain);
    assert!(infer(&Levels::new(&plain, &whiteners), &noise, &Blocks::new(&chain, &plain)).is_none());
}

#[test]
fn a_place_is_found_whatever_its_formula() {
    let chain = chain();
    for seed in 0..10 {
        let found = inferred(&chain, &with(&chain, seed, |q, f| 0.6 * COMPLIANCE * f * q[0].powf(2.5)));
        assert_eq!(found.findings.len(), 1, "seed {seed}: {:?}", found.findings);
        let Rival { places, probability, .. } = &found.findings[0].rivals[0];
        assert_eq!(places, &["spring 1"], "seed {seed}");
        assert!(*probability > 0.95, "seed {seed}: {probability}");
        let total: f64 = found.alternatives.iter().map(|a| a.1).sum();
        assert!(total <= 1.0 + 1e-12 && total > 0.9, "seed {seed}: {total}");
    }
}

/// What the declared springs would have to do in its stead leads whole Gauss-Newton steps astray, to squares below zero in the linear
/// model and to nothing found.
#[test]
fn a_place_is_found_however_much_it_yields() {
    let chain = chain();
    for times in [3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0] {
        for seed in 0..5 {
            let found = inferred(&chain, &with(&chain, seed, |q, f| times * COMPLIANCE * f * q[0].powf(2.5)));
            assert_eq!(found.findings[0].rivals[0].places, ["spring 1"], "{times} times, seed {seed}");
            assert!(found.reduced_chi2 > 0.0, "{times} times, seed {seed}: {}", found.reduced_chi2);
        }
    }
}

#[test]
fn what_goes_with_no_place_is_said_to_be_nowhere() {
    let chain = chain();
    let found = inferred(&chain, &with(&chain, 5, |_, f| 0.3 * COMPLIANCE * f.abs()));
    assert_eq!(found.findings[0].rivals[0].places, [NOWHERE]);
    assert!(found.none_of_these() > 0.95, "{}", found.none_of_these());
}

/// Readings that something disturbs say as much of the springs as undisturbed ones, once that is known.
#[test]
fn springs_are_identified_beside_disturbances() {
    let chain = chain();
    let (mut without, mut beside) = (0.0, 0.0);
    for seed in 0..5 {
        let (_, [clean, _]) = inferred_and_fitted(&chain, &read(&chain, &[], seed));
        let disturbed = with(&chain, seed, |_, f| 0.1 * COMPLIANCE * f * f.abs() / 100.0);
        let (found, fitted) = inferred_and_fitted(&chain, &disturbed);
        assert_eq!(found.findings[0].rivals[0].places, [NOWHERE], "seed {seed}");
        without += (&fitted[0] - &clean).norm() / 5.0;
        beside += (&fitted[1] - &clean).norm() / 5.0;
    }
    assert!(without > 0.5 && beside < 0.2 * without, "{without:.3} {beside:.3}");
}

//! Numbers read in coarse steps, against simulation.

use pkm_diagnosis::{Noise, NoiseSource, Observations, Reading, Rules, rounding};

use crate::support::*;

const STEP: f64 = 10e-6;
const PLACES: usize = 40_000;

/// Readings of many places, each in two series, `off` a model and with a scatter of `sd`, in steps; and what the model says.
fn read(sd: f64, off: f64) -> (Observations, Vec<f64>) {
    let mut rng = fastrand::Rng::with_seed(3);
    let places: Vec<f64> = (0..PLACES).map(|_| 100.0 * STEP * (rng.f64() - 0.5)).collect();
    let mut rounded = |place: f64| (place / STEP + off + sd * normal(&mut rng)).round() * STEP;
    let mut one = |n: usize, series: usize| {
        let mut observed = [None; CHANNELS];
        observed[0] = Some(rounded(places[n]));
        reading(n, series, observed)
    };
    let rows = (0..2 * PLACES).map(|row| one(row / 2, row % 2)).collect();
    let mut observations = observations((0..PLACES).collect(), rows);
    observations.channels[0].resolution = STEP;
    let said = places.iter().flat_map(|place| [*place, 0.0, 0.0, 0.0, 0.0, 0.0]).collect();
    (observations, said)
}

/// Mean of what numbers are off what a model says, in steps, and their deviation over the one that they are said to have.
fn off(observations: &Observations, noise: &Noise, said: &[f64]) -> [f64; 2] {
    let (normal, its_noise) = rounding::unrounded(observations, noise, said).unwrap();
    let of = |r: &Reading| (r.observed[0].unwrap() - said[r.condition * CHANNELS]) / STEP;
    let all: Vec<f64> = normal.readings.iter().map(of).collect();
    let count = all.len() as f64;
    let mean = all.iter().sum::<f64>() / count;
    let square = all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count;
    [mean, square.sqrt() * STEP / its_noise.within[0]]
}

fn estimated(observations: &Observations) -> Noise {
    Noise::estimate(observations, &Rules::DEFAULT).unwrap()
}

#[test]
fn scatter_before_rounding_is_told_by_repeats_after_it() {
    // of the finest 3 % of the repeats differ, some 1,300
    for (sd, tolerance) in [(0.03, 0.08), (0.08, 0.04), (0.16, 0.03), (0.25, 0.03), (0.4, 0.03), (2.0, 0.03)] {
        near(estimated(&read(sd, 0.0).0).unrounded[0], sd * STEP, tolerance);
    }
}

#[test]
fn rounded_numbers_scatter_about_the_right_model_as_they_are_said_to() {
    for sd in [0.02, 0.05, 0.08, 0.16, 0.25, 0.3] {
        let (observations, said) = read(sd, 0.0);
        let [mean, deviation] = off(&observations, &estimated(&observations), &said);
        assert!(mean.abs() < 0.01, "{sd}: {mean} steps");
        // no less than 0.05 steps is reckoned with, as models are not surer than that of where a number lies
        if sd < 0.05 { assert!((0.5..0.8).contains(&deviation)) } else { near(deviation, 1.0, 0.07) }
    }
}

/// A model that is off by a part of the scatter is so by as much in the numbers, and one that is off by steps by these.
#[test]
fn rounded_numbers_are_off_a_wrong_model_by_what_it_is_off() {
    for (sd, wrong, tolerance) in [(0.16, 0.05, 0.1), (0.3, 0.05, 0.1), (0.08, 4.0, 0.03), (0.3, 4.0, 0.03)] {
        let (observations, said) = read(sd, wrong);
        near(off(&observations, &estimated(&observations), &said)[0], wrong, tolerance);
    }
}

#[test]
fn steps_that_are_less_than_the_scatter_change_nothing() {
    let (observations, said) = read(0.5, 0.0);
    let noise = estimated(&observations);
    assert!(rounding::unrounded(&observations, &noise, &said).is_none());
    assert_eq!(rounding::coarse(&observations, &noise), []);
    let (coarser, _) = read(0.3, 0.0);
    let [(channel, sd)] = rounding::coarse(&coarser, &estimated(&coarser))[..] else { panic!() };
    assert_eq!(channel, 0);
    near(sd, 0.3, 0.05);
}

/// What a series is off by its zero is where its numbers lie in their steps, and stays in them.
#[test]
fn numbers_lie_in_their_steps_where_the_zero_of_their_series_puts_them() {
    let (observations, said) = read(0.16, 0.3);
    let noise = Noise { between: vec![STEP; CHANNELS], ..estimated(&observations) };
    near(off(&observations, &noise, &said)[0], 0.3, 0.02);
}

/// Few repeats that never differ are not free of scatter: of ten pairs that scatter by 0.05 steps more than half never differ.
#[test]
fn repeats_that_never_differ_tell_a_scatter_by_their_number() {
    let unrounded = |pairs: usize| {
        let (mut observations, _) = read(0.0, 0.0);
        observations.readings.truncate(2 * pairs);
        estimated(&observations).unrounded[0] / STEP
    };
    let [few, some, many] = [11, 101, 10_001].map(unrounded);
    assert!((0.07..0.1).contains(&few) && (0.005..0.02).contains(&some) && many < 0.001, "{few} {some} {many}");
}

/// What is declared has rounding in it or has not; no deviation is taken for far less than a slightly smaller one.
#[test]
fn a_declared_deviation_is_one_before_rounding_or_after_it() {
    let unrounded = |sd: f64| {
        let (mut observations, _) = read(0.1, 0.0);
        observations.readings.truncate(100);
        observations.readings.iter_mut().for_each(|r| r.sigma = vec![Some(sd * STEP); 2]);
        Noise::as_declared(&observations).unwrap().unrounded[0] / STEP
    };
    near(unrounded(0.05), 0.05, 1e-9);
    near(unrounded(0.6), (0.36_f64 - 1.0 / 12.0).sqrt(), 1e-9);
    let all: Vec<f64> = (1..60).map(|n| unrounded(0.01 * f64::from(n))).collect();
    assert!(all.windows(2).all(|pair| pair[1] >= pair[0] && pair[1] < pair[0] + 0.06), "{all:?}");
    // as much as rounding alone
    assert!((0.14..0.16).contains(&unrounded(12.0_f64.sqrt().recip())));
}

/// Repeats of a coarse dial differ seldom, but they differ: copied rows never do, and alone give way to what is declared.
#[test]
fn repeats_in_steps_are_no_copied_rows() {
    let source = |sd: f64| {
        let (mut observations, _) = read(sd, 0.0);
        observations.readings.truncate(400);
        observations.readings.iter_mut().for_each(|r| r.sigma = vec![Some(STEP); 2]);
        estimated(&observations).source
    };
    assert_eq!((source(0.08), source(0.0)), (NoiseSource::Repeats, NoiseSource::Declared));
}

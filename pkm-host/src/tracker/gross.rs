//! Gross errors of single points, such as a reflector that was mistaken for another in one of many readings.
//!
//! Reflectors of a body keep their places on it, wherever it is and whatever it carries. So each set of its points, unloaded or
//! loaded, is compared with the shape that all sets have in common, by U95 and by the scatter of all of them.

use std::collections::HashMap;

use nalgebra::Vector3;
use pkm_diagnosis::robust::median;

use super::rigid::{Motion, Pair};
use super::survey::{MIN_REFLECTORS, Survey};
use crate::error::lines_text;
use crate::files::points::{Point, State};
use crate::files::reflectors::On;

/// Standard deviations from which a point is named, as those of gross errors in a diagnosis.
const MIN_SD: f64 = 8.0;
/// Least sets of points of a body: of two that differ nobody knows which is right.
const MIN_SETS: usize = 3;
/// Times that the sets are laid on their common shape, at first on that of one of them.
const ROUNDS: usize = 3;
/// Δχ² within which another reflector may as well be the one that is wrong: three standard deviations.
const INDISTINCT_CHI2: f64 = 9.0;

/// Points of one body that were measured together.
struct Set<'a> {
    /// Reading, or series of unloaded points.
    name: &'a str,
    state: State,
    points: Vec<Point>,
}

/// A set with a gross error.
struct GrossError<'a> {
    set: &'a Set<'a>,
    /// Its points that may be the wrong one.
    points: Vec<Point>,
    /// How far off it is, in standard deviations.
    by_sd: f64,
}

/// What is said of points that are off the places where all other sets have them.
pub(super) fn warnings(survey: &Survey<'_>) -> Vec<String> {
    let mut all = Vec::new();
    for on in [On::Platform, On::Base] {
        let sets = sets(survey, on);
        let errors = errors(&sets);
        let mut said: Vec<(String, Vec<&GrossError<'_>>)> = Vec::new();
        for error in &errors {
            let names: Vec<String> = error.points.iter().map(|p| format!("`{}`", survey.name(p.reflector))).collect();
            match said.iter_mut().find(|(other, _)| *other == names.join(", ")) {
                Some((_, same)) => same.push(error),
                None => said.push((names.join(", "), vec![error])),
            }
        }
        all.extend(said.iter().filter_map(|(names, errors)| text(survey, names, errors)));
    }
    all
}

/// One warning for all sets in which the same reflector is wrong.
fn text(survey: &Survey<'_>, names: &str, errors: &[&GrossError<'_>]) -> Option<String> {
    let (first, others) = errors.split_first()?;
    let names = names.rsplit_once(", ").map_or(names.to_owned(), |(others, last)| format!("{others} or {last}"));
    let lines: Vec<u64> = others.iter().filter_map(|e| Some(e.points.first()?.line)).collect();
    let more = if lines.is_empty() { String::new() } else { format!(", and less far in {}", lines_text(&lines)) };
    Some(format!(
        "{}:{}: point: {names} in {}, {}, is {:.0} standard deviations off its place among the others, as all readings have \
         it{more}: was it mistaken for another, knocked, or mistyped? Correct it, or measure these points again; else leave out the \
         readings that have it",
        survey.points.source.name,
        first.points.first()?.line,
        first.set.name,
        first.set.state.name(),
        first.by_sd
    ))
}

/// All sets of points of a body, in the file's order, that can tell a shape.
fn sets<'a>(survey: &Survey<'a>, on: On) -> Vec<Set<'a>> {
    let points = survey.points;
    let of = |name: &'a str, state: State| {
        let points = points.sets.get(&(name.to_owned(), state))?.iter();
        let points: Vec<Point> = points.filter(|p| survey.is_on(p, on)).copied().collect();
        (points.len() >= MIN_REFLECTORS).then_some(Set { name, state, points })
    };
    let states = [State::Unloaded, State::Loaded];
    points.names.iter().flat_map(|(name, _)| states.map(|state| of(name, state))).flatten().collect()
}

/// Where the reflectors of a body are on it, by index; of some, nothing is known yet.
type Shape = HashMap<usize, Vector3<f64>>;

/// The middle of each reflector's places.
fn middle(places: impl Iterator<Item = (usize, Vector3<f64>)>) -> Shape {
    let mut of_reflector: HashMap<usize, Vec<Vector3<f64>>> = HashMap::new();
    places.for_each(|(reflector, at_m)| of_reflector.entry(reflector).or_default().push(at_m));
    let along =
        |places: &[Vector3<f64>], i: usize| median(&mut places.iter().map(|at_m| at_m[i]).collect::<Vec<f64>>());
    let middle = |places: &[Vector3<f64>]| Vector3::from_fn(|i, _| along(places, i).unwrap_or(0.0));
    of_reflector.iter().map(|(reflector, places)| (*reflector, middle(places))).collect()
}

impl Set<'_> {
    /// From a shape to the points that it has.
    fn pairs(&self, shape: &Shape) -> Vec<(Point, Pair)> {
        let pair = |p: &Point| {
            let before_m = *shape.get(&p.reflector)?;
            Some((*p, Pair { before_m, after_m: p.at_m.into(), sd_m: [0.0, p.sd_m] }))
        };
        self.points.iter().filter_map(pair).collect()
    }

    /// Its points, laid on a shape.
    fn laid_on(&self, shape: &Shape) -> Vec<(usize, Vector3<f64>)> {
        let pairs: Vec<Pair> = self.pairs(shape).into_iter().map(|(_, pair)| pair).collect();
        if pairs.len() < MIN_REFLECTORS {
            return Vec::new();
        }
        let motion = Motion::fit(&pairs);
        self.points.iter().map(|p| (p.reflector, motion.back(&p.at_m.into()))).collect()
    }
}

/// χ² that a rigid motion leaves.
fn chi2(pairs: &[Pair]) -> f64 {
    let motion = Motion::fit(pairs);
    pairs.iter().map(|p| (p.after_m - motion.of(&p.before_m)).norm_squared() / p.variance()).sum()
}

/// The shape that all sets have in common.
fn common_shape(sets: &[Set<'_>]) -> Shape {
    let most = sets.iter().max_by_key(|set| set.points.len());
    let start = most.into_iter().flat_map(|set| &set.points).map(|p| (p.reflector, Vector3::from(p.at_m))).collect();
    (0..ROUNDS).fold(start, |shape, _| middle(sets.iter().flat_map(|set| set.laid_on(&shape))))
}

/// Sets that one point keeps from having the shape of the others, the worst first.
fn errors<'a>(sets: &'a [Set<'a>]) -> Vec<GrossError<'a>> {
    if sets.len() < MIN_SETS {
        return Vec::new();
    }
    let shape = common_shape(sets);
    let fit = |set: &'a Set<'a>| {
        let (points, pairs): (Vec<Point>, Vec<Pair>) = set.pairs(&shape).into_iter().unzip();
        (pairs.len() >= MIN_REFLECTORS).then(|| {
            let chi2 = chi2(&pairs);
            (set, points, pairs, chi2)
        })
    };
    let fits: Vec<_> = sets.iter().filter_map(fit).collect();
    // half of the sets may have a gross error; a smaller scatter than U95 says is no reason to be stricter
    let mut scatters: Vec<f64> = fits.iter().map(|(.., pairs, chi2)| chi2 / median_chi2(3 * pairs.len() - 6)).collect();
    scatters.sort_by(f64::total_cmp);
    let variance = scatters.get(scatters.len().saturating_sub(1) / 2).map_or(1.0, |v| v.max(1.0));
    let error = |(set, points, pairs, all): (&'a Set<'a>, Vec<Point>, Vec<Pair>, f64)| {
        let without = |n: usize| chi2(&[&pairs[..n], &pairs[n + 1..]].concat()) / variance;
        let rest: Vec<f64> = (0..pairs.len()).map(without).collect();
        let least = rest.iter().copied().fold(f64::INFINITY, f64::min);
        let by_sd = (all / variance - least).sqrt();
        let is_suspect = |(_, rest): &(Point, f64)| *rest < least + INDISTINCT_CHI2;
        let points = points.into_iter().zip(rest).filter(is_suspect).map(|(point, _)| point).collect();
        (by_sd > MIN_SD).then_some(GrossError { set, points, by_sd })
    };
    let mut errors: Vec<GrossError<'_>> = fits.into_iter().filter_map(error).collect();
    errors.sort_by(|a, b| b.by_sd.total_cmp(&a.by_sd));
    errors
}

/// Median of χ² (E. B. Wilson, M. M. Hilferty, The distribution of chi-square, PNAS 17, 1931).
fn median_chi2(dof: usize) -> f64 {
    let k = dof as f64;
    k * (1.0 - 2.0 / (9.0 * k)).powi(3)
}

//! Repeats that all differ in the same proportion: no noise, but a sensor, a load or a machine that was another.

use std::collections::BTreeMap;

use nalgebra::Vector6;
use pkm_core::Wrench;

use super::reading_rules::{MAX_WARMING_K, MIN_POSES_OF_SCALE, MIN_SCALE_OF_REPEATS, MIN_SCALE_SD};
use super::warning::{Warning, WarningKind};
use crate::files::readings::{CHANNELS, KINDS, Reading, Readings};
use crate::pose::ROTATION_ARM_M;

/// Sums over the pairs of one pose: squared means, and means times differences.
#[derive(Clone, Copy, Default)]
struct Sums {
    squares: f64,
    products: f64,
}

/// How much more the later ones of pairs read, as a share of the mean, with its standard deviation. Errors of one pose go together, since
/// readings share their zero: so much as the poses differ it is not known.
fn share(poses: &BTreeMap<usize, Sums>) -> Option<(f64, f64)> {
    let squares: f64 = poses.values().map(|s| s.squares).sum();
    let share = poses.values().map(|s| s.products).sum::<f64>() / squares;
    let left: f64 = poses.values().map(|s| (s.products - share * s.squares).powi(2)).sum();
    (squares > 0.0 && poses.len() >= MIN_POSES_OF_SCALE).then(|| (share, left.sqrt() / squares))
}

/// A load, its moments as forces at the arm of rotations.
fn weighed(load: &Wrench<f64>) -> Vector6<f64> {
    let mut w = load.to_vector();
    w.fixed_rows_mut::<3>(3).scale_mut(1.0 / ROTATION_ARM_M);
    w
}

/// Pairs of a first reading of a load and the one that repeats it for the `nth` time, at one warmth.
fn pairs(readings: &Readings, nth: usize) -> Vec<[&Reading; 2]> {
    let mut of_load: BTreeMap<usize, Vec<&Reading>> = BTreeMap::new();
    for r in &readings.readings {
        of_load.entry(r.repeat_of).or_default().push(r);
    }
    let warmth = |r: &Reading| readings.conditions[r.condition].temperature_c;
    let all = of_load.values().filter_map(|all| Some([*all.first()?, *all.get(nth)?]));
    all.filter(|[a, b]| (warmth(a) - warmth(b)).abs() <= MAX_WARMING_K).collect()
}

/// Of repeats that read more than the first readings of their loads, or less, by the same share everywhere.
pub fn of_other_scale(readings: &Readings) -> Option<Warning> {
    for (nth, name) in [(1, "second"), (2, "third"), (3, "fourth")] {
        let mut found = Vec::new();
        for (kind, what) in ["translations", "rotations"].into_iter().enumerate() {
            let mut poses: BTreeMap<usize, Sums> = BTreeMap::new();
            for [first, later] in pairs(readings, nth) {
                let conditions = [first, later].map(|r| &readings.conditions[r.condition]);
                // recorded loads differ a little, and deflections with them
                let [w, other] = conditions.map(|c| weighed(&c.wrench));
                let as_loaded = if w == other { 1.0 } else { w.norm_squared() / w.dot(&other) };
                if !(0.8..=1.25).contains(&as_loaded) {
                    continue;
                }
                let sums = poses.entry(conditions[0].pose).or_default();
                for c in (0..CHANNELS).filter(|c| KINDS[*c] == kind) {
                    let (Some(x), Some(y)) = (first.observed[c], later.observed[c]) else { continue };
                    let y = y * as_loaded;
                    sums.squares += 0.25 * (x + y).powi(2);
                    sums.products += 0.5 * (x + y) * (y - x);
                }
            }
            poses.retain(|_, sums| sums.squares > 0.0);
            let Some((share, sd)) = share(&poses) else { continue };
            if share.abs() > MIN_SCALE_OF_REPEATS && share.abs() > MIN_SCALE_SD * sd {
                let more = if share > 0.0 { "more" } else { "less" };
                found.push(format!("{what} {:.1} % (± {:.1} %) {more}", 100.0 * share.abs(), 200.0 * sd));
            }
        }
        if !found.is_empty() {
            let message = format!(
                "where a load was read again, the {name} reading has {} than the first, everywhere alike. This counts as noise, and hides \
                 what is less: was it another sensor, load cell or load, or had the machine changed? Diagnose the repeats apart",
                found.join(" and ")
            );
            return Some(Warning::new(WarningKind::RepeatsOfOtherScale, message));
        }
    }
    None
}

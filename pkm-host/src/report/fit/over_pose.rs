//! Pictures of the corrections, and of what the polynomials leave of them, over the pose.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::{STIFFNESSES, SYMBOLS};
use crate::error::Result;
use crate::fit::{Fit, Sample};
use crate::page::plot::{Mark, Panel, Series};
use crate::page::{charts, fold, on_screen};
use crate::pose::file_units;

const VARIABLES: [&str; 3] = ["θ in °", "σ in °", "Z0 in mm"];

/// Poses with about the same value of a variable: by value when there are few, else in seven bins.
fn levels(samples: &[Sample], variable: usize) -> BTreeMap<i64, (f64, Vec<usize>)> {
    let values: Vec<f64> = samples.iter().map(|s| file_units(&s.pose.pose)[variable]).collect();
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let group = |step: f64| {
        let mut groups: BTreeMap<i64, (f64, Vec<usize>)> = BTreeMap::new();
        for (i, v) in values.iter().enumerate() {
            groups.entry(((v - low) / step).round() as i64).or_default().1.push(i);
        }
        for (mean, members) in groups.values_mut() {
            *mean = members.iter().map(|i| values[*i]).sum::<f64>() / members.len() as f64;
        }
        groups
    };
    let exact = group(1e-6);
    if exact.len() <= 12 { exact } else { group((high - low) / 7.0) }
}

/// Fig. 5: mean of a coefficient over the levels of each variable.
fn tendencies(samples: &[Sample], i: usize) -> [Panel; 3] {
    [0, 1, 2].map(|v| Panel {
        title: format!("mean of c{} over {}", STIFFNESSES[i], SYMBOLS[v]),
        x_label: VARIABLES[v].into(),
        y_label: format!("mean of c{}", STIFFNESSES[i]),
        series: vec![Series {
            name: String::new(),
            points: levels(samples, v)
                .values()
                .map(|(x, members)| {
                    (*x, members.iter().map(|m| samples[*m].ratios()[i]).sum::<f64>() / members.len() as f64)
                })
                .collect(),
            mark: Mark::Line,
        }],
    })
}

/// Most poses that a plot shows.
const MAX_SHOWN: usize = 2000;

/// Of how many poses one is shown, and the words for that.
fn thinned(poses: usize) -> (usize, String) {
    let step = poses.div_ceil(MAX_SHOWN).max(1);
    (step, if step > 1 { format!(", one of {step} poses") } else { String::new() })
}

/// Fig. 6: a coefficient over one variable, marked by another.
fn combinations(samples: &[Sample], i: usize) -> [Panel; 3] {
    let (step, shown) = thinned(samples.len());
    [(0, 2), (1, 2), (1, 0)].map(|(x, by)| Panel {
        title: format!("c{} over {}, by {}{shown}", STIFFNESSES[i], SYMBOLS[x], VARIABLES[by]),
        x_label: VARIABLES[x].into(),
        y_label: format!("c{}", STIFFNESSES[i]),
        series: levels(samples, by)
            .values()
            .map(|(level, members)| {
                let point = |m: &usize| (file_units(&samples[*m].pose.pose)[x], samples[*m].ratios()[i]);
                let mut points: Vec<(f64, f64)> = members.iter().step_by(step).map(point).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series { name: ((level * 100.0).round() / 100.0).to_string(), points, mark: Mark::Line }
            })
            .collect(),
    })
}

/// Residuals of a fitted coefficient over each variable, at both sets of poses.
fn residuals(fit: &Fit, i: usize) -> Result<[Panel; 3]> {
    let table = fit.numbers.table()?;
    let relative = |s: &Sample| {
        let measured = s.ratios()[i];
        100.0 * (table.coefficients(&s.pose.pose)[i] - measured) / measured
    };
    Ok([0, 1, 2].map(|v| {
        let series = |name: &str, samples: &[Sample], mark| {
            let (step, shown) = thinned(samples.len());
            let points = samples.iter().step_by(step).map(|s| (file_units(&s.pose.pose)[v], relative(s))).collect();
            Series { name: format!("{name}{shown}"), points, mark }
        };
        let mut all = vec![series("training", &fit.training, Mark::Dot)];
        all.extend(fit.verification.as_ref().map(|v| series("verification", &v.samples, Mark::Cross)));
        Panel {
            title: format!("k{}, corrected: error over {}", STIFFNESSES[i], SYMBOLS[v]),
            x_label: VARIABLES[v].into(),
            y_label: "error in %".into(),
            series: all,
        }
    }))
}

/// Where paper sends readers of the corrections.
const CORRECTIONS: &str = "this page on a screen; as polynomials in coefficients.json";

/// Small pictures by coefficient and variable.
pub(super) fn over_pose(fit: &Fit) -> Result<Markup> {
    let each = |of: &dyn Fn(usize) -> [Panel; 3]| (0..6).flat_map(of).collect::<Vec<_>>();
    let left: Vec<Panel> =
        (0..6).map(|i| residuals(fit, i)).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    Ok(html! {
        (fold("What the fitted polynomials leave", &charts(
            "Error of the corrected k11…k66 at each pose, over each variable: it should show no pattern.",
            &left,
        )?))
        (on_screen("Corrections over each variable", CORRECTIONS, &charts(
            "Mean of the correction c_ii, which makes k_ii of K_p that of the data (paper, Fig. 5).",
            &each(&|i| tendencies(&fit.training, i)),
        )?))
        (on_screen("Corrections at every pose", CORRECTIONS, &charts(
            "c_ii by the value of another variable (paper, Fig. 6).",
            &each(&|i| combinations(&fit.training, i)),
        )?))
    })
}

//! What placements do, and the verdict on them.

use super::{digits, front, mm, name, robust, series_name, um, worst};
use crate::page::Finding;
use crate::plan::implausible_load;
use crate::plan::place::search::{Placed, Placement};
use crate::plan::place::{Objective, PlacementModel, Posture};

/// Whether series that are placed together count for more or less than others.
fn is_weighted(model: &PlacementModel<'_>, p: &Placement) -> bool {
    p.series.len() > 1 && p.series.iter().any(|n| model.job.series[*n].weight != 1.0)
}

/// Holes that are held worse than with the table in the middle.
fn held_worse(p: &Placement) -> usize {
    let Some((_, before)) = &p.before else { return 0 };
    // beyond what a search leaves of its steps
    let is_worse = |(now, before): &(f64, f64)| *now > *before * (1.0 + 1e-6);
    p.holes.iter().zip(before).filter_map(|(now, before)| um(now).zip(um(before))).filter(is_worse).count()
}

/// "2 of 7 holes": a series that has its own position and shares one as well is in two counts, never twice in one.
fn worse_of_all<'a>(placements: impl Iterator<Item = &'a Placement> + Clone) -> String {
    let worse: usize = placements.clone().map(held_worse).sum();
    format!("{worse} of {} holes", placements.map(|p| p.holes.len()).sum::<usize>())
}

/// How many holes are held worse than with the table in the middle, with each series by itself and with all together.
fn worse_holes<'a>(model: &PlacementModel<'_>, placements: impl Iterator<Item = &'a Placement> + Clone) -> String {
    let apart = worse_of_all(placements.clone().filter(|p| p.series.len() == 1));
    let than = "are held worse than with the table in the middle";
    match placements.clone().find(|p| p.series.len() > 1) {
        None => format!("{apart} {than}."),
        Some(together) => format!(
            "{apart} {than} where each series has its own position, {} in the one for series {}.",
            worse_of_all(std::iter::once(together)),
            series_name(model, together)
        ),
    }
}

/// Three digits, for the verdict.
pub(super) fn short(objective: Objective, value: f64) -> String {
    let value = objective.value_in_unit(value);
    match objective {
        Objective::Paper => format!("{value:.2e}"),
        Objective::CycleTime => format!("{value:.3} s"),
        Objective::TipWorst | Objective::TipMean => {
            let digits = (2.0 - value.log10().floor()).clamp(0.0, 6.0) as usize;
            format!("{value:.digits$} µm")
        }
    }
}

/// What the verdict is on: the tip's deflection, if it is an objective.
pub(super) fn judged(placed: &Placed) -> Objective {
    let mut all = placed.placements.iter().map(|p| p.objective);
    all.clone().find(|o| o.is_of_tips()).or(all.next()).unwrap_or(Objective::Paper)
}

/// Whether a placement is no worse than the table in the middle.
fn is_no_worse(p: &Placement) -> bool {
    p.before.as_ref().is_none_or(|(before, _)| p.value <= *before)
}

/// Whether it is better by more than what a search leaves of its steps.
fn is_better(p: &Placement) -> bool {
    p.before.as_ref().is_none_or(|(before, _)| p.value < *before * (1.0 - 1e-6))
}

/// What a placement does.
fn of_placement(model: &PlacementModel<'_>, p: &Placement) -> Finding {
    let shown = |value: f64| digits(p.objective, p.objective.value_in_unit(value));
    let turned = match &model.job.rotary {
        Some(_) => format!(", turned to {:.3}°", p.position.rotary_rad.to_degrees()),
        None => String::new(),
    };
    let unit = if p.objective == Objective::Paper { format!(" {}", p.objective.unit()) } else { String::new() };
    let weighted = is_weighted(model, p);
    let unit = if weighted { format!("{unit} (weighted)") } else { unit };
    let mut text = format!(
        "Series {}: table at dx = {:.3} mm, dy = {:.3} mm{turned}: {}{unit}, ",
        name(model, p),
        mm(p.position.dx_m),
        mm(p.position.dy_m),
        shown(p.value)
    );
    match &p.before {
        Some((before, _)) => text.push_str(&format!("{} with the table in the middle", shown(*before))),
        None => text.push_str("with the table in the middle not every hole is in reach"),
    }
    let before = p.before.as_ref().and_then(|(_, postures)| worst(postures));
    let mut finding = if is_no_worse(p) { Finding::good(text) } else { Finding::warning(text) };
    if let Some(um) = worst(&p.holes).filter(|_| !p.objective.is_of_tips()) {
        finding.text.push_str(&format!("; worst tip deflection {um:.3} µm"));
        if let Some(before) = before.filter(|before| um > *before) {
            finding.text.push_str(&format!(", WORSE than {before:.3} µm there"));
            finding = Finding::warning(finding.text);
        }
    }
    finding.text.push('.');
    if let Some(c) = p.certificate {
        let percent = 100.0 * c.gap;
        let sentence =
            format!(" Proved: no position gives less than {}, which is {percent:.3} % less.", shown(c.bound));
        finding.text.push_str(&sentence);
    }
    let outside = p.holes.iter().filter(|h| h.outside_box).count();
    if outside > 0 {
        let holes = if outside == 1 { "hole" } else { "holes" };
        finding.text.push_str(&format!(" EXTRAPOLATED: {outside} {holes} outside the table's box."));
        finding = Finding::warning(finding.text);
    }
    finding
}

/// "15.2 µm instead of 31.1 µm (series A)".
fn gain(model: &PlacementModel<'_>, p: &Placement, judged: Objective) -> String {
    let weighted = is_weighted(model, p);
    // a weight is no way that a tip moves
    let of_tip = weighted && judged == Objective::TipWorst;
    let note = if weighted && !of_tip { ", weighted" } else { "" };
    let said = |value: f64, holes: &[Posture]| {
        let of_holes = worst(holes).filter(|_| of_tip).map(|um| um / 1e6);
        short(judged, of_holes.unwrap_or(value))
    };
    let than = p.before.as_ref().map_or("out of reach".to_owned(), |(value, holes)| said(*value, holes));
    let series = series_name(model, p);
    format!("{} instead of {than} (series {series}{note})", said(p.value, &p.holes))
}

/// What the placements do. The verdict is on those by the tip's deflection, if there are any.
pub(super) fn findings(model: &PlacementModel<'_>, placed: &Placed) -> Vec<Finding> {
    let judged = judged(placed);
    let counts = |p: &&Placement| p.objective == judged;
    let counted = || placed.placements.iter().filter(counts);
    let what = match judged {
        Objective::Paper => "the paper's objective is",
        Objective::TipWorst => "the tip moves at most",
        Objective::TipMean => "the tip moves in the mean",
        Objective::CycleTime => "the ways between holes take",
    };
    let gains = counted().map(|p| gain(model, p, judged)).collect::<Vec<_>>().join(", ");
    let uncertain = robust::of_the_verdict(model, placed);
    let verdict = if counted().any(|p| p.holes.iter().any(|h| h.outside_box)) {
        Finding::warning(format!("Places found, some of them by extrapolation: {what} {gains}.{uncertain}"))
    } else if !counted().any(is_better) {
        let no_other = "none was found that is better than the table in the middle";
        Finding::warning(format!("Every hole is in reach, but {no_other}: {what} {gains}.{uncertain}"))
    } else if counted().all(is_no_worse) && counted().any(|p| held_worse(p) > 0) {
        let worse = worse_holes(model, counted());
        Finding::good(format!("Every hole is in reach, and {what} {gains}. {worse}{uncertain}"))
    } else if counted().all(is_better) {
        Finding::good(format!("Every hole is in reach, and {what} {gains}.{uncertain}"))
    } else {
        Finding::warning(format!("Every hole is in reach, not every series is better off: {what} {gains}.{uncertain}"))
    };
    // those that the verdict is on come first
    let mut all: Vec<&Placement> = placed.placements.iter().collect();
    all.sort_by_key(|p| p.objective != judged);
    let mut findings = vec![verdict];
    if model.table.is_none() {
        findings
            .push(Finding::warning("Uncorrected: no correction table was given, and no data back the basic model."));
    }
    let most_um = placed.placements.iter().filter_map(|p| worst(&p.holes)).fold(0.0, f64::max);
    findings.extend(implausible_load("A tip moves by", most_um / 1e6).map(Finding::warning));
    findings.extend(all.into_iter().map(|p| of_placement(model, p)));
    findings.extend(robust::findings(model, placed));
    findings.extend(front::findings(model, placed));
    findings
}

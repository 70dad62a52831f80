//! What a report says of Pareto fronts.

use std::fmt::Write;

use maud::{Markup, html};

use super::verdict::short;
use super::{digits, figures, mm, names};
use crate::error::Result;
use crate::page::plot::{Mark, Panel, Series};
use crate::page::{Finding, charts, table};
use crate::plan::place::search::Placed;
use crate::plan::place::{Front, Objective, PlacementModel, Point};

/// Share of a front's extent that is left free about it in its picture.
const MARGIN: f64 = 0.08;

fn um(m: f64) -> f64 {
    Objective::TipWorst.value_in_unit(m)
}

fn shown(objective: Objective, value: f64) -> String {
    digits(objective, objective.value_in_unit(value))
}

/// What a front says in a sentence, and what is proved of it.
pub(super) fn findings(model: &PlacementModel<'_>, placed: &Placed) -> Vec<Finding> {
    let finding = |front: &Front| {
        let (series, other) = (names(model, &front.series), front.other.name());
        let value = |point: &Point| {
            format!("{} at {}", short(Objective::TipWorst, point.tip_m), shown(front.other, point.other))
        };
        let gap = 100.0 * front.points.iter().map(|point| point.certificate.gap).fold(0.0, f64::max);
        match front.points.as_slice() {
            [first, .., last] => Finding::good(format!(
                "Series {series}, tip-worst against {other}: {} points from {} to {}. Proved: where {other} is no greater, no tip moves more than {gap:.3} % less.",
                front.points.len(),
                value(first),
                value(last)
            )),
            all => Finding::warning(format!(
                "Series {series}: tip-worst and {other} do NOT conflict: one position is the best by both ({}).",
                all.iter().map(value).collect::<String>()
            )),
        }
    };
    placed.fronts.iter().map(finding).collect()
}

/// Columns of a front's table.
fn heads(front: &Front) -> [String; 7] {
    let other = format!("{}, {}", front.other.name(), front.other.unit());
    ["tip µm", &other, "no tip below, µm", "gap %", "dx mm", "dy mm", "rotary °"].map(str::to_owned)
}

fn cells(front: &Front, point: &Point) -> [String; 7] {
    let (position, c) = (&point.position, point.certificate);
    [
        format!("{:.3}", um(point.tip_m)),
        figures(front.other, front.other.value_in_unit(point.other)),
        format!("{:.3}", um(c.bound)),
        format!("{:.3}", 100.0 * c.gap),
        format!("{:.3}", mm(position.dx_m)),
        format!("{:.3}", mm(position.dy_m)),
        format!("{:.3}", position.rotary_rad.to_degrees()),
    ]
}

/// Fronts in figures, for a terminal.
pub(super) fn text(model: &PlacementModel<'_>, placed: &Placed) -> String {
    let mut text = String::new();
    for front in &placed.fronts {
        let _ = writeln!(text, "\nPareto front of series {}:", names(model, &front.series));
        let rows: Vec<_> =
            [heads(front)].into_iter().chain(front.points.iter().map(|point| cells(front, point))).collect();
        let letters = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: [usize; 7] = std::array::from_fn(letters);
        for row in &rows {
            let line = row.iter().zip(widths).map(|(cell, width)| format!("  {cell:>width$}")).collect::<String>();
            let _ = writeln!(text, "{line}");
        }
    }
    text
}

/// The outline of all that no position reaches, from `low` to `high` of the picture.
fn unreached(front: &Front, low: [f64; 2], high: [f64; 2]) -> Vec<(f64, f64)> {
    let other = |value: f64| front.other.value_in_unit(value);
    let first = other(front.other_bound).max(low[0]);
    let mut outline = vec![(low[0], low[1]), (low[0], high[1]), (first, high[1])];
    let mut from = first;
    for (n, step) in front.proved.iter().enumerate() {
        // what is proved for greater values holds for smaller ones
        let bound = um(front.proved[n..].iter().map(|step| step.bound_m).fold(0.0, f64::max));
        let to = step.other_at_most.map_or(high[0], other).clamp(from, high[0]);
        outline.extend([(from, bound), (to, bound)]);
        from = to;
    }
    outline.push((high[0], low[1]));
    outline
}

fn panel(model: &PlacementModel<'_>, front: &Front) -> Panel {
    let place = |point: &Point| (front.other.value_in_unit(point.other), um(point.tip_m));
    let points: Vec<(f64, f64)> = front.points.iter().map(place).collect();
    // from the bounds to the greatest values, and some more
    let extent = |values: &mut dyn Iterator<Item = f64>, bound: f64| {
        let greatest = values.fold(bound, f64::max);
        let more = (MARGIN * (greatest - bound)).max(1e-3 * greatest);
        [bound - more, greatest + more]
    };
    let least_tip = front.proved.last().map_or(0.0, |step| um(step.bound_m));
    let x = extent(&mut points.iter().map(|p| p.0), front.other.value_in_unit(front.other_bound));
    let y = extent(&mut points.iter().map(|p| p.1), least_tip);
    let series = |name: String, points: Vec<(f64, f64)>, mark: Mark| Series { name, points, mark };
    let end = |point: Option<&(f64, f64)>| point.copied().into_iter().collect::<Vec<_>>();
    Panel {
        title: format!("series {}", names(model, &front.series)),
        x_label: format!("{}, {}", front.other.name(), front.other.unit()),
        y_label: "tip-worst, µm".into(),
        series: vec![
            series("front".into(), points.clone(), Mark::Step),
            series(format!("best by {}", front.other.name()), end(points.first()), Mark::Cross),
            series("best by tip-worst".into(), end(points.last()), Mark::Cross),
            series("no position (proved)".into(), unreached(front, [x[0], y[0]], [x[1], y[1]]), Mark::Band),
        ],
    }
}

/// Fronts in pictures and figures.
pub(super) fn section(model: &PlacementModel<'_>, placed: &Placed) -> Result<Markup> {
    let panels: Vec<Panel> = placed.fronts.iter().map(|front| panel(model, front)).collect();
    let of_front = |front: &Front| {
        let caption = format!(
            "Series {}: each position is the one whose worst tip moves least among those whose {} is no greater, as far as the gap goes",
            names(model, &front.series),
            front.other.name()
        );
        let (heads, numbers) = (heads(front), 1..=front.points.len());
        let rows = front.points.iter().map(|point| cells(front, point).to_vec());
        let rows: Vec<_> = numbers.map(|n| n.to_string()).zip(rows).collect();
        table(&caption, &heads.each_ref().map(String::as_str), &rows)
    };
    Ok(html! {
        @if !placed.fronts.is_empty() {
            h2 { "What less tip deflection takes" }
            (charts("Low and left is good. No position is in the shaded area.", &panels)?)
            @for front in &placed.fronts { (of_front(front)) }
        }
    })
}

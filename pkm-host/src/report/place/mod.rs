//! The text and `report.html` of a placement; `placement.json` is in [`document`](document()).

mod document;
mod front;
mod robust;
mod verdict;

use std::ops::Range;

use maud::{Markup, html};

use crate::error::Result;
use crate::files::job::{Axis, Series};
use crate::files::source::Source;
use crate::page::plot::{self, HeatMap, Mark, Panel, Series as Points};
use crate::page::{Finding, Page, charts, fold, map_pictures, of_file, pictures, table};
use crate::plan::place::Grid;
use crate::plan::place::search::{Method, Options, Placed, Placement};
use crate::plan::place::{Objective, PlacementModel, Posture};
use crate::pose::file_units;

use self::verdict::{findings, judged};
pub use document::document;

fn mm(m: f64) -> f64 {
    m * 1e3
}

fn um(p: &Posture) -> Option<f64> {
    p.deflection_m.map(|d| d * 1e6)
}

/// Whether the method draws numbers.
fn is_random(options: &Options) -> bool {
    matches!(options.method, Method::Ga | Method::De)
}

/// Of each series that is placed with others: its objective there, and where it is placed alone.
fn compared<'a>(
    model: &'a PlacementModel<'_>,
    placed: &'a Placed,
    p: &'a Placement,
) -> impl Iterator<Item = (&'a Series, f64, f64)> {
    let mut rest = p.holes.as_slice();
    p.series.iter().filter_map(move |n| {
        let series = &model.job.series[*n];
        let (own, after) = rest.split_at(series.holes.len());
        rest = after;
        let alone = placed.placements.iter().find(|other| other.series == [*n] && other.objective == p.objective)?;
        Some((series, model.worth_of(p.objective, *n, own), alone.value))
    })
}

/// Of a value in the objective's unit.
fn figures(objective: Objective, value: f64) -> String {
    match objective {
        Objective::Paper => format!("{value:.5e}"),
        Objective::TipWorst | Objective::TipMean => format!("{value:.3}"),
        Objective::CycleTime => format!("{value:.4}"),
    }
}

/// The same with the unit, but for the paper's, which is long.
fn digits(objective: Objective, value: f64) -> String {
    let figures = figures(objective, value);
    if objective == Objective::Paper { figures } else { format!("{figures} {}", objective.unit()) }
}

/// Greatest deflection of the tip over the holes, µm; none with a diagonal table.
fn worst(holes: &[Posture]) -> Option<f64> {
    holes.iter().filter_map(um).reduce(f64::max)
}

/// "A by tip-worst".
fn name(model: &PlacementModel<'_>, p: &Placement) -> String {
    format!("{} by {}", series_name(model, p), p.objective.name())
}

/// "A", or "A + B".
fn series_name(model: &PlacementModel<'_>, p: &Placement) -> String {
    names(model, &p.series)
}

fn names(model: &PlacementModel<'_>, series: &[usize]) -> String {
    series.iter().map(|n| model.job.series[*n].name.as_str()).collect::<Vec<_>>().join(" + ")
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(model: &PlacementModel<'_>, placed: &Placed) -> [Finding; 2] {
    let counted = || placed.placements.iter().filter(|p| p.objective == judged(placed));
    let proved = counted().all(|p| p.certificate.is_some());
    let extrapolated = counted().any(|p| p.holes.iter().any(|h| h.outside_box));
    let sure = match (proved, extrapolated) {
        (_, true) => "by the model, beyond what its table was fitted to: a guess there.",
        (true, false) => "by the model, and by its bounds no other place can be much better, as said below.",
        (false, false) => {
            "by the model; a search from the best point of a grid ended here, which proves nothing about other places: --method certified does."
        }
    };
    // who says what is not sure wants the place that stands it
    let chosen: Vec<&Placement> = match placed.robust.as_slice() {
        [] => counted().collect(),
        robust => robust.iter().map(|robust| &robust.placement).collect(),
    };
    let against = if placed.robust.is_empty() { "" } else { ", against the worst case" };
    let places: Vec<String> = (chosen.into_iter())
        .map(|p| {
            let [x, y] = model.job.in_cross_slide_m(&p.position).map(mm);
            let turned = model
                .job
                .rotary
                .as_ref()
                .map_or(String::new(), |_| format!(" turned to {:.3}°", p.position.rotary_rad.to_degrees()));
            format!("for series {} set the cross slide to x = {x:.3} mm, y = {y:.3} mm{turned}", series_name(model, p))
        })
        .collect();
    [Finding::good(sure).sure(), Finding::good(format!("{}{against}.", places.join("; "))).todo()]
}

/// For people at a terminal.
pub fn text(model: &PlacementModel<'_>, options: &Options, placed: &Placed) -> String {
    let findings = findings(model, placed).into_iter().map(|f| format!("- {}\n", f.text)).collect::<String>();
    let seed = if is_random(options) { format!("  seed {}\n", options.seed) } else { String::new() };
    findings + &front::text(model, placed) + &seed
}

/// All placements in figures.
fn overview(model: &PlacementModel<'_>, placed: &Placed) -> Markup {
    let row = |p: &Placement| {
        let shown = |value: f64| digits(p.objective, p.objective.value_in_unit(value));
        let [x, y] = model.job.in_cross_slide_m(&p.position).map(mm);
        let cells = vec![
            format!("{:.3}", mm(p.position.dx_m)),
            format!("{:.3}", mm(p.position.dy_m)),
            format!("{:.3}", p.position.rotary_rad.to_degrees()),
            format!("{x:.3}"),
            format!("{y:.3}"),
            shown(p.value),
            p.before.as_ref().map_or("–".into(), |(before, _)| shown(*before)),
            shown(p.grid_best.1),
            worst(&p.holes).map_or("–".into(), |um| format!("{um:.3}")),
            format!("{:.3}", p.q_ratio),
            format!("{:.1}", 100.0 * p.feasible_share),
        ];
        (name(model, p), cells)
    };
    let heads = [
        "dx mm",
        "dy mm",
        "rotary °",
        "cross slide x mm",
        "y mm",
        "objective",
        "in the middle",
        "best of the grid",
        "worst tip µm",
        "Q",
        "grid in reach %",
    ];
    let rows: Vec<_> = placed.placements.iter().map(row).collect();
    let has_paper = placed.placements.iter().any(|p| p.objective == Objective::Paper);
    let unit = if has_paper { format!("; objective paper in {}", Objective::Paper.unit()) } else { String::new() };
    table(&format!("Where the table goes, and what that does{unit}"), &heads, &rows)
}

/// What one position for all series costs each of them.
fn one_for_all(model: &PlacementModel<'_>, placed: &Placed) -> Markup {
    let together = placed.placements.iter().filter(|p| p.series.len() > 1);
    let rows: Vec<_> = together
        .flat_map(|p| {
            compared(model, placed, p).map(|(series, here, alone)| {
                let shown = |value: f64| digits(p.objective, p.objective.value_in_unit(value));
                let more = format!("{:+.2}", 100.0 * (here / alone - 1.0));
                let name = format!("{} by {}", series.name, p.objective.name());
                (name, vec![series.weight.to_string(), shown(here), shown(alone), more])
            })
        })
        .collect();
    let heads = ["weight", "in one position for all", "placed alone", "more %"];
    html! {
        @if !rows.is_empty() { (table("What one position for all series costs each of them", &heads, &rows)) }
    }
}

/// From the first to the last of some places on a grid's axis, with a neighbour at each end.
fn extent(places: impl Iterator<Item = usize> + Clone, count: usize) -> Range<usize> {
    let (first, last) = (places.clone().min().unwrap_or(0), places.max().unwrap_or(count - 1));
    first.saturating_sub(1)..(last + 2).min(count)
}

/// The map of a grid at the angle of a placement.
fn map(model: &PlacementModel<'_>, grid: &Grid, column: usize, p: &Placement) -> Result<String> {
    let [xs, ys, angles] = Axis::ALL.map(|axis| &grid.axes[axis]);
    let nearest = |all: &[f64], v: f64| {
        (0..all.len()).min_by(|a, b| (all[*a] - v).abs().total_cmp(&(all[*b] - v).abs())).unwrap_or(0)
    };
    let [x, y, slice] = Axis::ALL.map(|axis| nearest(&grid.axes[axis], p.position[axis]));
    let nearest_cell = (x, y);
    let cell = |x: usize, y: usize, a: usize| grid.cells[column][(a * ys.len() + y) * xs.len() + x].as_ref();
    let value = |x: usize, y: usize, a: usize| cell(x, y, a).map(|c| p.objective.value_in_unit(c.value));
    let title = format!("{}, {}", name(model, p), p.objective.unit());
    let in_mm = |v: &[f64]| v.iter().copied().map(mm).collect::<Vec<_>>();
    if xs.len() > 1 && ys.len() > 1 {
        // where something is in reach, and the optimum
        let known = |x: &usize, y: &usize| (*x, *y) == nearest_cell || value(*x, *y, slice).is_some();
        let columns = extent((0..xs.len()).filter(|x| (0..ys.len()).any(|y| known(x, &y))), xs.len());
        let rows = extent((0..ys.len()).filter(|y| (0..xs.len()).any(|x| known(&x, y))), ys.len());
        let extrapolated = |x: usize, y: usize| cell(x, y, slice).is_some_and(|c| c.outside_box);
        let some_are = columns.clone().any(|x| rows.clone().any(|y| extrapolated(x, y)));
        return plot::heat_map(&HeatMap {
            title: if some_are { format!("{title}; striped: extrapolated") } else { title },
            x_label: "dx in mm".into(),
            y_label: "dy in mm".into(),
            x: in_mm(&xs[columns.clone()]),
            y: in_mm(&ys[rows.clone()]),
            value: &|x, y| value(columns.start + x, rows.start + y, slice),
            extrapolated: &|x, y| extrapolated(columns.start + x, rows.start + y),
            mark: Some([mm(p.position.dx_m), mm(p.position.dy_m)]),
        });
    }
    // one axis alone: a curve
    let (label, points): (&str, Vec<(f64, f64)>) = if angles.len() > 1 {
        (
            "rotary axis in °",
            (0..angles.len()).filter_map(|a| Some((angles[a].to_degrees(), value(x, y, a)?))).collect(),
        )
    } else if xs.len() > 1 {
        ("dx in mm", (0..xs.len()).filter_map(|x| Some((mm(xs[x]), value(x, y, slice)?))).collect())
    } else {
        ("dy in mm", (0..ys.len()).filter_map(|y| Some((mm(ys[y]), value(x, y, slice)?))).collect())
    };
    let series = vec![Points { name: "grid".into(), points, mark: Mark::Dot }];
    let panel = Panel { title, x_label: label.into(), y_label: p.objective.unit().into(), series };
    plot::panel(&panel)
}

/// Workpiece and machine from above, in W.
fn plan_view(model: &PlacementModel<'_>, placed: &Placed) -> Result<Markup> {
    let job = model.job;
    let at = |p: &Placement| -> Vec<(f64, f64)> {
        let table = job.table_in_world_at(&p.position);
        let holes = p.series.iter().flat_map(|n| &job.series[*n].holes);
        holes.map(|hole| table.origin_m + table.rotation * hole.tip_m).map(|p| (mm(p.x), mm(p.y))).collect()
    };
    let base = job.base_in_world.origin_m;
    let mut series =
        vec![Points { name: "B of the machine".into(), points: vec![(mm(base.x), mm(base.y))], mark: Mark::Cross }];
    for p in &placed.placements {
        series.push(Points { name: name(model, p), points: at(p), mark: Mark::Numbered });
    }
    let panel = Panel {
        title: "holes at the optima".into(),
        x_label: "x of W in mm".into(),
        y_label: "y of W in mm".into(),
        series,
    };
    Ok(pictures(
        "The holes where each objective puts them, with their numbers in the tables, seen along z of W; to scale.",
        &[plot::panel(&panel)?],
    ))
}

fn convergence(model: &PlacementModel<'_>, placed: &Placed) -> Vec<Panel> {
    let evolved = placed.placements.iter().filter(|p| !p.convergence.is_empty());
    let panel = |p: &Placement| Panel {
        title: name(model, p),
        x_label: "evaluations".into(),
        y_label: format!("best so far, {}", p.objective.unit()),
        series: vec![Points {
            name: "best".into(),
            points: p.convergence.iter().map(|(n, v)| (*n as f64, p.objective.value_in_unit(*v))).collect(),
            mark: Mark::Line,
        }],
    };
    evolved.map(panel).collect()
}

fn hole_table(model: &PlacementModel<'_>, p: &Placement) -> Markup {
    let rows: Vec<_> = (0..p.holes.len())
        .map(|i| {
            let (after, before) = (&p.holes[i], p.before.as_ref().map(|(_, postures)| &postures[i]));
            let shown = |p: Option<&Posture>, of: &dyn Fn(&Posture) -> String| p.map_or("–".into(), of);
            let c = &after.solution.configuration;
            let [theta, sigma, z0] = file_units(&c.pose);
            let mut cells = vec![
                format!("{theta:.2}"),
                format!("{sigma:.2}"),
                format!("{z0:.1}"),
                format!("{:.2}", c.beta_rad[0].to_degrees()),
                format!("{:.2}", c.beta_rad[1].to_degrees()),
            ];
            cells.extend(after.k.iter().map(|k| format!("{k:.3e}")));
            cells.push(shown(before, &|p| format!("{:.3e}", p.k[2])));
            let deflection = |p: &Posture| um(p).map_or("–".into(), |um| format!("{um:.3}"));
            cells.push(deflection(after));
            cells.push(shown(before, &deflection));
            cells.push(if after.outside_box { "outside the box".into() } else { "ok".into() });
            (format!("hole {}", i + 1), cells)
        })
        .collect();
    let head = [
        "θ °",
        "σ °",
        "Z0 mm",
        "β1 °",
        "β2 °",
        "k11 N/m",
        "k22",
        "k33",
        "k44 N·m/rad",
        "k55",
        "k66",
        "k33 before",
        "tip µm",
        "before",
        "status",
    ];
    let caption = format!(
        "Series {}: postures and stiffness at A, deflection of the tip under the series' wrench; before: table in the middle",
        name(model, p)
    );
    table(&caption, &head, &rows)
}

/// `report.html`.
///
/// # Errors
/// What the drawing library says.
pub fn html(
    model: &PlacementModel<'_>,
    table: Option<&Source>,
    options: &Options,
    placed: &Placed,
    warnings: &[String],
) -> Result<String> {
    let objectives = placed.placements.len() / placed.grids.len();
    let evolution = convergence(model, placed);
    let of_place = |(n, p): (usize, &Placement)| map(model, &placed.grids[p.grid], n % objectives, p);
    let maps = placed.placements.iter().enumerate().map(of_place);
    let body = html! {
        h2 { "Where the table goes" }
        (overview(model, placed))
        (one_for_all(model, placed))
        (robust::section(model, placed))
        (front::section(model, placed)?)
        (plan_view(model, placed)?)
        h2 { "What the table's position does" }
        (map_pictures(
            "Low is good, and the ring is the optimum. Where there is no colour a hole is out of reach.",
            &maps.collect::<Result<Vec<_>>>()?,
        ))
        h2 { "Holes" }
        @for p in &placed.placements {
            (fold(&format!("{} holes of series {}", p.holes.len(), name(model, p)), &hole_table(model, p)))
        }
        @if !evolution.is_empty() {
            h2 { "Convergence" }
            (charts("The best value so far: it should be flat at its end.", &evolution)?)
        }
    };
    let file = model.reach.file;
    let facts = vec![
        ("Method", options.method.name().to_owned()),
        ("Seed", if is_random(options) { options.seed.to_string() } else { "none".into() }),
        ("Machine file", of_file(&file.source)),
        ("Job", of_file(&model.job.source)),
        ("Correction table", table.map_or("none: the basic model".into(), of_file)),
    ];
    let mut findings = findings(model, placed);
    findings.extend(advice(model, placed));
    Ok(Page { title: format!("Placement on {}", file.name), findings: &findings, warnings, body, facts }.html())
}

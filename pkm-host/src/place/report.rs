//! `placement.json`, the text, and `report.html`.

use serde_json::{Value, json};

use super::job::{Axis, Position};
use super::search::{Grid, Method, Options, Placed, Placement};
use super::{Bench, Objective, Posture};
use crate::dataset::file_units;
use crate::error::Result;
use crate::plot::{self, HeatMap, Mark, Panel, Series as Points};
use crate::report::{escape, page, table};

fn mm(m: f64) -> f64 {
    m * 1e3
}

fn um(p: &Posture) -> Option<f64> {
    p.deflection_m.map(|d| d * 1e6)
}

fn holes(placement: &Placement) -> Vec<Value> {
    let hole = |p: &Posture| {
        let c = &p.hold.configuration;
        let [theta_deg, sigma_deg, z0_mm] = file_units(&c.pose);
        json!({
            "q_mm": p.hold.joints.lengths.q_m.map(mm),
            "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
            "beta1_deg": c.beta_rad[0].to_degrees(), "beta2_deg": c.beta_rad[1].to_degrees(),
            "home_share": p.hold.home_share,
            "k": p.k,
            "deflection_um": um(p),
            "status": if p.outside_box { "outside_box" } else { "ok" },
        })
    };
    placement.holes.iter().map(hole).collect()
}

/// `placement.json`.
pub fn document(bench: &Bench<'_>, options: &Options, placed: &Placed) -> Value {
    let series = placed.placements.iter().map(|p| {
        let unit = |value: f64| p.objective.value_in_unit(value);
        let (at, value) = p.certified;
        let step = placed.grids[p.series].spacing();
        json!({
            "name": bench.job.series[p.series].name,
            "objective": p.objective.name(),
            "dx_mm": mm(p.position.dx_m), "dy_mm": mm(p.position.dy_m), "rotary_deg": p.position.rotary_rad.to_degrees(),
            "cross_slide_mm": bench.job.in_cross_slide_m(&p.position).map(mm),
            "value": unit(p.value), "unit": p.objective.unit(),
            "q_ratio": p.q_ratio,
            "grid_certified": {
                "step_mm": mm(step.dx_m.max(step.dy_m)), "step_deg": step.rotary_rad.to_degrees(),
                "dx_mm": mm(at.dx_m), "dy_mm": mm(at.dy_m), "rotary_deg": at.rotary_rad.to_degrees(),
                "value": unit(value),
            },
            "feasible_share": p.feasible_share,
            "holes": holes(p),
            "before": p.before.as_ref().map(|(value, postures)| json!({
                "value": unit(*value),
                "deflection_um": postures.iter().map(um).collect::<Vec<_>>(),
                "k": postures.iter().map(|p| p.k).collect::<Vec<_>>(),
            })),
            "convergence": p.convergence.iter().map(|(n, v)| (*n, unit(*v))).collect::<Vec<_>>(),
        })
    });
    let method = match options.method {
        Method::Grid => "grid",
        Method::Ga => "ga",
        Method::De => "de",
    };
    json!({
        "machine": bench.reach.file.name, "machine_sha256": bench.reach.file.source.sha256(),
        "job_sha256": bench.job.sha256, "method": method, "allow_extrapolation": bench.extrapolate,
        "seed": (options.method != Method::Grid).then_some(options.seed),
        "series": series.collect::<Vec<_>>(),
    })
}

fn digits(objective: Objective, value: f64) -> String {
    match objective {
        Objective::Paper => format!("{value:.5e}"),
        Objective::TipWorst | Objective::TipMean => format!("{value:.3} µm"),
    }
}

/// What a placement does, in a sentence or two.
fn sentences(bench: &Bench<'_>, options: &Options, placed: &Placed) -> Vec<String> {
    let mut all = Vec::new();
    for p in &placed.placements {
        let shown = |value: f64| digits(p.objective, p.objective.value_in_unit(value));
        let turned = match &bench.job.rotary {
            Some(_) => format!(", {:.3}°", p.position.rotary_rad.to_degrees()),
            None => String::new(),
        };
        let [x, y] = bench.job.in_cross_slide_m(&p.position).map(mm);
        let mut text = format!(
            "series {}, {}: dx = {:.3} mm, dy = {:.3} mm{turned} (cross slide {x:.3}, {y:.3} mm): {}",
            bench.job.series[p.series].name,
            p.objective.name(),
            mm(p.position.dx_m),
            mm(p.position.dy_m),
            shown(p.value)
        );
        match &p.before {
            Some((before, _)) => text.push_str(&format!(", {} with the table in the middle", shown(*before))),
            None => text.push_str("; with the table in the middle not every hole is in reach"),
        }
        let worst = p.holes.iter().filter_map(um).fold(0.0, f64::max);
        if p.objective == Objective::Paper && worst > 0.0 {
            text.push_str(&format!("; worst tip deflection {worst:.3} µm"));
        }
        text.push_str(&format!(
            "; Q {:.3}; best of the grid {} ({:.1} % of it in reach)",
            p.q_ratio,
            shown(p.certified.1),
            100.0 * p.feasible_share
        ));
        let outside = p.holes.iter().filter(|h| h.outside_box).count();
        if outside > 0 {
            text.push_str(&format!("; EXTRAPOLATED: {outside} holes outside the table's box"));
        }
        all.push(text);
    }
    if options.method != Method::Grid {
        all.push(format!("seed {}", options.seed));
    }
    all
}

/// For people at a terminal.
pub fn text(bench: &Bench<'_>, options: &Options, placed: &Placed) -> String {
    sentences(bench, options, placed).iter().map(|s| format!("{s}\n")).collect()
}

/// The map of a grid at the angle of a placement.
fn map(bench: &Bench<'_>, grid: &Grid, column: usize, p: &Placement) -> Result<String> {
    let [xs, ys, angles] = Axis::ALL.map(|axis| &grid.axes[axis]);
    let nearest = |all: &[f64], v: f64| {
        (0..all.len()).min_by(|a, b| (all[*a] - v).abs().total_cmp(&(all[*b] - v).abs())).unwrap_or(0)
    };
    let [x, y, slice] = Axis::ALL.map(|axis| nearest(&grid.axes[axis], p.position[axis]));
    let value = |x: usize, y: usize, a: usize| {
        let cell = grid.cells[column][(a * ys.len() + y) * xs.len() + x].as_ref();
        cell.map(|c| p.objective.value_in_unit(c.value))
    };
    let caption = format!("{}: {} in {}", bench.job.series[p.series].name, p.objective.name(), p.objective.unit());
    let in_mm = |v: &[f64]| v.iter().copied().map(mm).collect::<Vec<_>>();
    if xs.len() > 1 && ys.len() > 1 {
        return plot::heat_map(&HeatMap {
            title: format!("{caption}; white: a hole is out of reach"),
            x_label: "dx in mm".into(),
            y_label: "dy in mm".into(),
            x: in_mm(xs),
            y: in_mm(ys),
            value: &|x, y| value(x, y, slice),
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
    plot::panels(&[Panel {
        title: caption.clone(),
        x_label: label.into(),
        y_label: p.objective.unit().into(),
        series: vec![Points { name: "grid".into(), points, mark: Mark::Dot }],
    }])
}

/// Workpiece and machine from above, in W.
fn plan_view(bench: &Bench<'_>, placed: &Placed) -> Result<String> {
    let job = bench.job;
    let at = |position: &Position, series: usize| -> Vec<(f64, f64)> {
        let table = job.table_in_world_at(position);
        let holes = job.series[series].holes.iter();
        holes.map(|hole| table.origin_m + table.rotation * hole.tip_m).map(|p| (mm(p.x), mm(p.y))).collect()
    };
    let base = job.base_in_world.origin_m;
    let mut series =
        vec![Points { name: "B of the machine".into(), points: vec![(mm(base.x), mm(base.y))], mark: Mark::Cross }];
    for p in &placed.placements {
        let name = format!("{} by {}", job.series[p.series].name, p.objective.name());
        series.push(Points { name, points: at(&p.position, p.series), mark: Mark::Dot });
    }
    plot::panels(&[Panel {
        title: "holes at the optima, seen along z of W".into(),
        x_label: "x of W in mm".into(),
        y_label: "y of W in mm".into(),
        series,
    }])
}

fn convergence(bench: &Bench<'_>, placed: &Placed) -> Result<Option<String>> {
    let panels: Vec<Panel> = placed
        .placements
        .iter()
        .filter(|p| !p.convergence.is_empty())
        .map(|p| Panel {
            title: format!("{} by {}", bench.job.series[p.series].name, p.objective.name()),
            x_label: "evaluations".into(),
            y_label: format!("best so far, {}", p.objective.unit()),
            series: vec![Points {
                name: "best".into(),
                points: p.convergence.iter().map(|(n, v)| (*n as f64, p.objective.value_in_unit(*v))).collect(),
                mark: Mark::Line,
            }],
        })
        .collect();
    if panels.is_empty() { Ok(None) } else { plot::panels(&panels).map(Some) }
}

fn hole_table(bench: &Bench<'_>, p: &Placement) -> String {
    let rows: Vec<_> = (0..p.holes.len())
        .map(|i| {
            let (after, before) = (&p.holes[i], p.before.as_ref().map(|(_, postures)| &postures[i]));
            let shown = |p: Option<&Posture>, of: &dyn Fn(&Posture) -> String| p.map_or("–".into(), of);
            let c = &after.hold.configuration;
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
        "Series {} by {}: postures and stiffness at A, deflection of the tip under the series' wrench; before: table in the middle",
        bench.job.series[p.series].name,
        p.objective.name()
    );
    table(&caption, &head, &rows)
}

/// `report.html`.
///
/// # Errors
/// What the drawing library says.
pub fn html(bench: &Bench<'_>, options: &Options, placed: &Placed) -> Result<String> {
    let title = format!("Placement on {}", bench.reach.file.name);
    let mut body = format!("<h1>{}</h1>\n<ul>\n", escape(&title));
    for sentence in sentences(bench, options, placed) {
        body.push_str(&format!("<li>{}</li>\n", escape(&sentence)));
    }
    body.push_str("</ul>\n<h2>Workpiece</h2>\n");
    body.push_str(&plan_view(bench, placed)?);
    let objectives = placed.placements.len() / placed.grids.len();
    for (n, p) in placed.placements.iter().enumerate() {
        let heading = format!("Series {} by {}", bench.job.series[p.series].name, p.objective.name());
        body.push_str(&format!("<h2>{}</h2>\n", escape(&heading)));
        body.push_str(&map(bench, &placed.grids[p.series], n % objectives, p)?);
        body.push_str(&hole_table(bench, p));
    }
    if let Some(svg) = convergence(bench, placed)? {
        body.push_str("<h2>Convergence</h2>\n");
        body.push_str(&svg);
    }
    Ok(page(&title, &body))
}

//! The machine and its errors, before and after, as SVG.

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::machine::BELTS;
use crate::study::{Prediction, RunResult, Study};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Drawn = Result<(), String>;

/// Colours that a colour-blind reader can tell apart (Okabe and Ito), before and after.
const COLOURS: [RGBColor; 2] = [RGBColor(213, 94, 0), RGBColor(0, 114, 178)];
const GREY: RGBColor = RGBColor(90, 90, 90);
const NAMES: [&str; 2] = ["anchors alone", "identified model"];
/// Width and height of both charts together.
const SIZE: (u32, u32) = (960, 400);
/// Radius of a circle for an error of 1 mm, in pixels.
const PIXELS_PER_MM: f64 = 8.0;
const FONT: (&str, i32) = ("sans-serif", 14);

fn failed(e: impl std::fmt::Display) -> String {
    e.to_string()
}

/// Draws a study.
///
/// # Errors
/// What the drawing library says.
pub fn svg(study: &Study) -> Result<String, String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        let (left, right) = area.split_horizontally(500);
        machine(&left, study)?;
        errors(&right, study)?;
        area.present().map_err(failed)?;
    }
    let fixed = format!("width=\"{}\" height=\"{}\" ", SIZE.0, SIZE.1);
    let title = "<title>The belt machine with the errors at its points, and errors in runs that had no part</title>";
    Ok(text.replacen(&fixed, "role=\"img\" ", 1).replacen('>', &format!(">\n{title}"), 1))
}

/// Root mean square over the runs of what [`Prediction::by_point_m`] has, in mm.
fn by_point_mm(study: &Study, of: fn(&RunResult) -> &Prediction) -> Vec<f64> {
    let points = study.runs.first().map_or(0, |r| of(r).by_point_m.len());
    let square = |point: usize| study.runs.iter().map(|r| of(r).by_point_m[point].powi(2)).sum::<f64>();
    (0..points).map(|p| 1e3 * (square(p) / study.runs.len() as f64).sqrt()).collect()
}

/// Anchors, belts to one place, and the error at each point as the radius of a circle.
fn machine(area: &Area<'_>, study: &Study) -> Drawn {
    let anchors = study.together.after.machine.anchors.places_m();
    let mut chart = ChartBuilder::on(area)
        .caption("Error of a condition at each point (circle below: 1 mm)", FONT)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(44)
        .build_cartesian_2d(-0.2..3.3, -0.25..2.35)
        .map_err(failed)?;
    chart.configure_mesh().disable_mesh().x_desc("x, m").y_desc("y, m").draw().map_err(failed)?;
    let Some(first) = study.runs.first() else { return Ok(()) };
    let places: Vec<(f64, f64)> = first.diagnosis.model.places_m().map(|p| (p.x, p.y)).collect();
    let middle = places[places.len() / 2];
    for (name, anchor) in BELTS.iter().zip(anchors) {
        let at = (anchor.x, anchor.y);
        chart.draw_series([PathElement::new([at, middle], GREY.stroke_width(1))]).map_err(failed)?;
        chart.draw_series([Circle::new(at, 4, BLACK.filled())]).map_err(failed)?;
        let beside = (anchor.x + if anchor.x > 1.5 { 0.06 } else { -0.15 }, anchor.y + 0.12);
        chart.draw_series([Text::new(*name, beside, FONT)]).map_err(failed)?;
    }
    let radii = [by_point_mm(study, |r| &r.before), by_point_mm(study, |r| &r.after)];
    for (radii, colour) in radii.iter().zip(COLOURS) {
        let circle = |(at, mm): (&(f64, f64), &f64)| Circle::new(*at, PIXELS_PER_MM * mm, colour.stroke_width(2));
        chart.draw_series(places.iter().zip(radii).map(circle)).map_err(failed)?;
    }
    chart.draw_series([Circle::new((1.52, -0.12), PIXELS_PER_MM, BLACK.stroke_width(2))]).map_err(failed)?;
    Ok(())
}

/// Errors in the other runs by the run that was fitted, with 95 % intervals.
fn errors(area: &Area<'_>, study: &Study) -> Drawn {
    let mut chart = ChartBuilder::on(area)
        .caption("Runs that had no part, 95 % over points", FONT)
        .margin(10)
        .x_label_area_size(36)
        .y_label_area_size(44)
        .build_cartesian_2d(0.4..study.runs.len() as f64 + 0.6, 0.0..2.9)
        .map_err(failed)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_desc("run that was fitted").y_desc("rms of a condition, mm").x_labels(study.runs.len());
    mesh.x_label_formatter(&|v| format!("{v:.0}")).light_line_style(WHITE).draw().map_err(failed)?;
    let of: [fn(&RunResult) -> &Prediction; 2] = [|r| &r.before, |r| &r.after];
    for ((of, colour), name) in of.into_iter().zip(COLOURS).zip(NAMES) {
        let rms = study.runs.iter().enumerate().map(|(n, r)| (n as f64 + 1.0, of(r)));
        let bar = |(x, p): (f64, &Prediction)| {
            p.interval_m.map(|[l, h]| PathElement::new([(x, 1e3 * l), (x, 1e3 * h)], colour.stroke_width(2)))
        };
        chart.draw_series(rms.clone().filter_map(bar)).map_err(failed)?;
        let dots = chart.draw_series(rms.map(|(x, p)| Circle::new((x, 1e3 * p.rms_m), 4, colour.filled())));
        dots.map_err(failed)?.label(name).legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    let mut labels = chart.configure_series_labels();
    labels.position(SeriesLabelPosition::UpperRight).background_style(WHITE).label_font(FONT);
    labels.draw().map_err(failed)
}

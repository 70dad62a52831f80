//! Charts as SVG text.

use maud::html;
use plotters::coord::Shift;
use plotters::prelude::*;

use crate::error::{Failure, Result};

/// Colours that a colour-blind reader can tell apart (Okabe and Ito).
pub(crate) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(90, 90, 90),
    RGBColor(148, 103, 40),
];

/// Width and height of a chart; its letters are read at this size and a little below.
const PANEL: (u32, u32) = (420, 315);

/// How the points of a series are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Filled circles.
    Dot,
    /// Crosses.
    Cross,
    /// Filled circles on a line.
    Line,
    /// Lines from each point at an even place to the next, which has a filled circle: vectors.
    Vector,
}

/// Points with a name for the legend.
pub struct Series {
    /// In the legend.
    pub name: String,
    /// x, y.
    pub points: Vec<(f64, f64)>,
    /// How they are drawn.
    pub mark: Mark,
}

/// One chart.
pub struct Panel {
    /// Above it.
    pub title: String,
    /// With unit.
    pub x_label: String,
    /// With unit.
    pub y_label: String,
    /// In the legend's order.
    pub series: Vec<Series>,
}

pub(crate) fn failed(e: impl std::fmt::Display) -> Failure {
    Failure::other(format!("cannot draw a plot: {e}"))
}

/// Draws what a title names, for readers and for those who can't see it.
pub(crate) fn svg(
    title: &str,
    size: (u32, u32),
    draw: impl FnOnce(&DrawingArea<SVGBackend<'_>, Shift>) -> Result<()>,
) -> Result<String> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
        area.fill(&WHITE).map_err(failed)?;
        draw(&area)?;
        area.present().map_err(failed)?;
    }
    // numbers for a screen: a fixed size would not fit a narrow one
    let fixed = format!("width=\"{}\" height=\"{}\" ", size.0, size.1);
    let named = html! { title { (title) } }.into_string();
    Ok(text.replacen(&fixed, "role=\"img\" ", 1).replacen('>', &format!(">\n{named}"), 1))
}

/// Range of values with a margin, never empty.
fn range(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let margin = if high > low { 0.06 * (high - low) } else { 0.05 * high.abs().max(1e-3) };
    low - margin..high + margin
}

/// A chart of its own.
///
/// # Errors
/// What the drawing library says.
pub fn panel(panel: &Panel) -> Result<String> {
    svg(&panel.title, PANEL, |area| draw(area, panel, false))
}

/// Charts side by side.
///
/// # Errors
/// What the drawing library says.
pub fn panels(panels: &[Panel]) -> Result<String> {
    grid(panels, panels.len(), false)
}

/// Charts in rows of some, logarithmic both ways: coordinates above 0.
///
/// # Errors
/// What the drawing library says.
pub fn logarithmic_panels(panels: &[Panel], columns: usize) -> Result<String> {
    grid(panels, columns, true)
}

fn grid(panels: &[Panel], columns: usize, logarithmic: bool) -> Result<String> {
    let rows = panels.len().div_ceil(columns);
    let titles: Vec<&str> = panels.iter().map(|p| p.title.as_str()).collect();
    svg(&titles.join("; "), (PANEL.0 * columns as u32, PANEL.1 * rows as u32), |area| {
        for (cell, panel) in area.split_evenly((rows, columns)).iter().zip(panels) {
            draw(cell, panel, logarithmic)?;
        }
        Ok(())
    })
}

/// A number of an axis without digits that are rounding, or zeros.
fn plain(v: &f64, range: &std::ops::Range<f64>) -> String {
    // what should be 0 is rounding of the axis' length
    let v = if v.abs() < 1e-6 * (range.end - range.start) { 0.0 } else { *v };
    let rounded: f64 = format!("{v:.6e}").parse().unwrap_or(v);
    if rounded != 0.0 && !(1e-4..1e6).contains(&rounded.abs()) { format!("{rounded:e}") } else { rounded.to_string() }
}

/// Widens the range that costs less, above what is drawn or to its right, and says where the legend goes.
fn make_room_for_legend(
    panel: &Panel,
    logarithmic: bool,
    x_range: &mut std::ops::Range<f64>,
    y_range: &mut std::ops::Range<f64>,
) -> SeriesLabelPosition {
    if panel.series.len() < 2 {
        return SeriesLabelPosition::UpperRight;
    }
    // its mark and some 8 pixels a letter, of 320; some 20 pixels a line, of 215
    let longest = panel.series.iter().map(|s| s.name.chars().count()).max().unwrap_or(0);
    let (wide, high) = ((60.0 + 8.0 * longest as f64) / 320.0, (20.0 + 20.0 * panel.series.len() as f64) / 215.0);
    let grown = |range: &std::ops::Range<f64>, share: f64| share / (1.0 - share) * (range.end - range.start);
    if high < wide && !logarithmic {
        y_range.end += grown(y_range, high);
        return SeriesLabelPosition::UpperRight;
    }
    x_range.end += grown(x_range, wide.min(0.6));
    if logarithmic { SeriesLabelPosition::UpperRight } else { SeriesLabelPosition::MiddleRight }
}

fn draw(area: &DrawingArea<SVGBackend<'_>, Shift>, panel: &Panel, logarithmic: bool) -> Result<()> {
    let scale = |v: f64| if logarithmic { v.log10() } else { v };
    let scaled = |s: &Series| s.points.iter().map(|(x, y)| (scale(*x), scale(*y))).collect::<Vec<_>>();
    let points = || panel.series.iter().flat_map(scaled);
    let (mut x_range, mut y_range) = (range(points().map(|p| p.0)), range(points().map(|p| p.1)));
    let legend = make_room_for_legend(panel, logarithmic, &mut x_range, &mut y_range);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, ("sans-serif", 16))
        .margin(8)
        // half of a number may stand beyond the end of an axis
        .margin_right(24)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(x_range.clone(), y_range.clone())
        .map_err(failed)?;
    // between powers of ten there are no round numbers to show
    let power = |v: &f64| if v.fract().abs() < 1e-6 { format!("1e{v:.0}") } else { String::new() };
    let (of_x, of_y) = (|v: &f64| plain(v, &x_range), |v: &f64| plain(v, &y_range));
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(&panel.x_label)
        .y_desc(&panel.y_label)
        .x_labels(6)
        .y_labels(6)
        .label_style(("sans-serif", 14))
        .axis_desc_style(("sans-serif", 15))
        .light_line_style(TRANSPARENT);
    if logarithmic {
        mesh.x_label_formatter(&power).y_label_formatter(&power);
    } else {
        mesh.x_label_formatter(&of_x).y_label_formatter(&of_y);
    }
    mesh.draw().map_err(failed)?;
    for (i, series) in panel.series.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let points = scaled(series).into_iter();
        let drawn = match series.mark {
            Mark::Dot => chart.draw_series(points.map(|p| Circle::new(p, 3, colour.filled()).into_dyn())),
            Mark::Cross => chart.draw_series(points.map(|p| Cross::new(p, 4, colour.stroke_width(2)).into_dyn())),
            Mark::Vector => {
                let ends: Vec<(f64, f64)> = points.collect();
                let line = |p: &[(f64, f64)]| PathElement::new(p.to_vec(), colour.stroke_width(1));
                chart.draw_series(ends.chunks_exact(2).map(line)).map_err(failed)?;
                let tips = ends.into_iter().skip(1).step_by(2);
                chart.draw_series(tips.map(|p| Circle::new(p, 2, colour.filled()).into_dyn()))
            }
            Mark::Line => {
                chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2))).map_err(failed)?;
                chart.draw_series(points.map(|p| Circle::new(p, 3, colour.filled()).into_dyn()))
            }
        };
        let cross = series.mark == Mark::Cross;
        drawn.map_err(failed)?.label(&series.name).legend(move |(x, y)| {
            if cross {
                Cross::new((x + 8, y), 4, colour.stroke_width(2)).into_dyn()
            } else {
                Circle::new((x + 8, y), 4, colour.filled()).into_dyn()
            }
        });
    }
    if panel.series.len() > 1 {
        chart
            .configure_series_labels()
            .position(legend)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(190, 190, 190))
            .label_font(("sans-serif", 14))
            .draw()
            .map_err(failed)?;
    }
    Ok(())
}

/// Groups of bars on a logarithmic axis: a group a label, a bar a series.
///
/// # Errors
/// What the drawing library says.
pub fn bars(title: &str, y_label: &str, labels: &[&str], series: &[(&str, Vec<f64>)]) -> Result<String> {
    svg(title, (900, 420), |area| {
        let values = || series.iter().flat_map(|(_, v)| v.iter().copied().filter(|v| *v > 0.0));
        let low = 10_f64.powf(values().fold(f64::INFINITY, f64::min).log10().floor());
        // room above the highest bar for the legend
        let room = if series.len() > 4 { 100.0 } else { 10.0 };
        let high = room * 10_f64.powf(values().fold(low * 10.0, f64::max).log10().ceil());
        let mut chart = ChartBuilder::on(area)
            .caption(title, ("sans-serif", 20))
            .margin(10)
            .x_label_area_size(36)
            .y_label_area_size(80)
            .build_cartesian_2d(0.0..labels.len() as f64, (low..high).log_scale())
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .disable_x_axis()
            .y_desc(y_label)
            .y_label_formatter(&|v| format!("{v}"))
            .label_style(("sans-serif", 16))
            .axis_desc_style(("sans-serif", 17))
            .draw()
            .map_err(failed)?;
        let width = 0.8 / series.len() as f64;
        for (i, (name, values)) in series.iter().enumerate() {
            let colour = COLOURS[i % COLOURS.len()];
            let bar = |(group, value): (usize, &f64)| {
                let left = group as f64 + 0.1 + width * i as f64;
                Rectangle::new([(left, low), (left + 0.92 * width, value.max(low))], colour.filled())
            };
            chart
                .draw_series(values.iter().enumerate().map(bar))
                .map_err(failed)?
                .label(*name)
                .legend(move |(x, y)| Rectangle::new([(x, y - 5), (x + 14, y + 5)], colour.filled()));
        }
        for (group, label) in labels.iter().enumerate() {
            let middle = chart.backend_coord(&(group as f64 + 0.5, low));
            let style =
                ("sans-serif", 16).into_font().into_text_style(area).pos(plotters::style::text_anchor::Pos::new(
                    plotters::style::text_anchor::HPos::Center,
                    plotters::style::text_anchor::VPos::Top,
                ));
            area.draw_text(label, &style, (middle.0, middle.1 + 8)).map_err(failed)?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(RGBColor(190, 190, 190))
            .label_font(("sans-serif", 16))
            .draw()
            .map_err(failed)
    })
}

/// Values over two axes, as colours.
pub struct HeatMap<'a> {
    /// Above it.
    pub title: String,
    /// With unit.
    pub x_label: String,
    /// With unit.
    pub y_label: String,
    /// Evenly spaced, at least two.
    pub x: Vec<f64>,
    /// The same.
    pub y: Vec<f64>,
    /// By the places in `x` and `y`; blank where there is none.
    pub value: &'a dyn Fn(usize, usize) -> Option<f64>,
    /// A place to mark.
    pub mark: Option<[f64; 2]>,
}

/// Cells along an axis of a heat map, and colours of its bar, at the most.
const CELLS: usize = 120;
const SHADES: usize = 24;

/// A heat map with its bar: dark is low.
///
/// # Errors
/// What the drawing library says.
pub fn heat_map(map: &HeatMap<'_>) -> Result<String> {
    let (nx, ny) = (map.x.len(), map.y.len());
    let (skip_x, skip_y) = (nx.div_ceil(CELLS), ny.div_ceil(CELLS));
    let cells: Vec<(usize, usize, f64)> = (0..ny)
        .step_by(skip_y)
        .flat_map(|y| (0..nx).step_by(skip_x).filter_map(move |x| (map.value)(x, y).map(|v| (x, y, v))))
        .collect();
    let (low, high) = cells.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (.., v)| (l.min(*v), h.max(*v)));
    // the best is what people look for: shades closer together there
    let shade = |v: f64| {
        let share = if high > low { ((v - low) / (high - low)).sqrt() } else { 0.0 };
        ((share * SHADES as f64) as usize).min(SHADES - 1)
    };
    let colour = |shade: usize| {
        let t = shade as f64 / (SHADES - 1) as f64;
        let mix = |a: f64, b: f64, c: f64| if t < 0.5 { a + (b - a) * 2.0 * t } else { b + (c - b) * (2.0 * t - 1.0) };
        RGBColor(mix(68.0, 33.0, 253.0) as u8, mix(1.0, 145.0, 231.0) as u8, mix(84.0, 140.0, 37.0) as u8)
    };
    let (step_x, step_y) = (skip_x as f64 * (map.x[1] - map.x[0]), skip_y as f64 * (map.y[1] - map.y[0]));
    svg(&map.title, (760, 520), |area| {
        let (left, right) = area.split_horizontally(640);
        let x_range = map.x[0] - 0.5 * step_x..map.x[nx - 1] + 0.5 * step_x;
        let y_range = map.y[0] - 0.5 * step_y..map.y[ny - 1] + 0.5 * step_y;
        let mut chart = ChartBuilder::on(&left)
            .caption(&map.title, ("sans-serif", 18))
            .margin(8)
            .x_label_area_size(48)
            .y_label_area_size(76)
            .build_cartesian_2d(x_range.clone(), y_range.clone())
            .map_err(failed)?;
        chart
            .configure_mesh()
            .disable_mesh()
            .x_desc(&map.x_label)
            .y_desc(&map.y_label)
            .x_label_formatter(&|v| plain(v, &x_range))
            .y_label_formatter(&|v| plain(v, &y_range))
            .label_style(("sans-serif", 16))
            .axis_desc_style(("sans-serif", 17))
            .draw()
            .map_err(failed)?;
        // neighbours of a shade in one piece
        let pieces = cells.chunk_by(|a, b| a.1 == b.1 && b.0 == a.0 + skip_x && shade(a.2) == shade(b.2));
        let rectangles = pieces.map(|piece| {
            let (first, last) = (piece[0], piece[piece.len() - 1]);
            let (x, y) = (map.x[first.0] - 0.5 * step_x, map.y[first.1] - 0.5 * step_y);
            let corner = (map.x[last.0] + 0.5 * step_x, y + step_y);
            Rectangle::new([(x, y), corner], colour(shade(first.2)).filled())
        });
        chart.draw_series(rectangles).map_err(failed)?;
        if let Some([x, y]) = map.mark {
            let marks =
                [Circle::new((x, y), 7, COLOURS[1].stroke_width(3)), Circle::new((x, y), 2, COLOURS[1].filled())];
            chart.draw_series(marks).map_err(failed)?;
        }
        if cells.is_empty() {
            return Ok(());
        }
        let value = |shade: f64| low + (high - low) * (shade / SHADES as f64).powi(2);
        let text = ("sans-serif", 16).into_font();
        for n in 0..SHADES {
            let (top, bottom) = (470 - 17 * (n as i32 + 1), 470 - 17 * n as i32);
            right.draw(&Rectangle::new([(8, top), (28, bottom)], colour(n).filled())).map_err(failed)?;
            if n % 6 == 0 || n == SHADES - 1 {
                let (at, y) = if n == 0 { (0.0, bottom) } else { (n as f64 + 1.0, top) };
                let label = number(value(at));
                right.draw(&Text::new(label, (33, y - 8), text.clone())).map_err(failed)?;
            }
        }
        Ok(())
    })
}

/// Four digits.
fn number(v: f64) -> String {
    if v != 0.0 && !(1e-2..1e5).contains(&v.abs()) {
        format!("{v:.3e}")
    } else {
        format!("{v:.4}").chars().take(7).collect()
    }
}

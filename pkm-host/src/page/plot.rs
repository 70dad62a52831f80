//! Charts as SVG text.

use maud::html;
use plotters::coord::Shift;
use plotters::prelude::*;

use super::chart::{self, Drawing};
use crate::error::{Failure, Result};

pub(crate) use super::chart::bars::Bar;

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

/// How the points of a series are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Filled circles.
    Dot,
    /// Filled circles with their numbers, from 1.
    Numbered,
    /// Crosses.
    Cross,
    /// Filled circles on a line.
    Line,
    /// Filled circles, each with a line along x and then along y to the next.
    Step,
    /// Lines from each point at an even place to the next, which has a filled circle: vectors.
    Vector,
    /// A filled area: its outline, once around.
    Band,
}

impl Mark {
    /// For a page's script.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Dot | Self::Numbered => "dot",
            Self::Cross => "cross",
            Self::Line => "line",
            Self::Step => "step",
            Self::Vector => "vector",
            Self::Band => "band",
        }
    }
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

fn whole(title: &str, drawing: &Drawing) -> String {
    chart::svg(title, drawing.width, drawing.height, &drawing.body)
}

/// A chart of its own.
///
/// # Errors
/// Coordinates that its axes cannot have.
pub fn panel(panel: &Panel) -> Result<String> {
    keyed(panel, &[])
}

/// The same with keys by series and point: rows of the page's tables have the same ones.
pub(crate) fn keyed(panel: &Panel, keys: &[Vec<usize>]) -> Result<String> {
    Ok(whole(&panel.title, &chart::panel(panel, keys, false)?))
}

/// Charts side by side.
///
/// # Errors
/// Coordinates that their axes cannot have.
pub fn panels(panels: &[Panel]) -> Result<String> {
    grid(panels, panels.len(), false)
}

/// Charts in rows of some, logarithmic both ways: coordinates above 0.
///
/// # Errors
/// Other coordinates.
pub fn logarithmic_panels(panels: &[Panel], columns: usize) -> Result<String> {
    grid(panels, columns, true)
}

fn grid(panels: &[Panel], columns: usize, logarithmic: bool) -> Result<String> {
    let titles: Vec<&str> = panels.iter().map(|p| p.title.as_str()).collect();
    Ok(whole(&titles.join("; "), &chart::grid(panels, columns, logarithmic)?))
}

/// Groups of bars on a logarithmic axis: a group a label, a bar a series.
pub(crate) fn bars(title: &str, y_label: &str, labels: &[&str], series: &[(&str, Vec<Bar>)]) -> Result<String> {
    Ok(whole(title, &chart::bars::drawing(title, y_label, labels, series)?))
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
    /// Where a value is extrapolated: it is striped, and the colours' range is of the others if there are any.
    pub extrapolated: &'a dyn Fn(usize, usize) -> bool,
    /// A place to mark.
    pub mark: Option<[f64; 2]>,
}

/// A heat map with its bar: dark is low.
///
/// # Errors
/// Coordinates that its axes cannot have.
pub fn heat_map(map: &HeatMap<'_>) -> Result<String> {
    Ok(whole(&map.title, &chart::heat::drawing(map)?))
}

//! Charts as SVG text, hand-written, so that a page's script finds series and values in them: see `page.js`.
//!
//! A legend has a band of its own above the data. A dot is a line of no length with round ends: a few bytes.

mod axis;
pub(crate) mod bars;
pub(super) mod heat;

use std::fmt::Write;

use maud::{Markup, html};

use self::axis::Axis;
use super::plot::{COLOURS, Mark, Panel, Series};
use crate::error::Result;

/// Pixels; letters are read at this size and a little below.
const WIDTH: f64 = 380.0;
const HEIGHT: f64 = 190.0;
/// Of a plot whose axes have the same scale.
const HEIGHTS: [f64; 2] = [120.0, 330.0];
const LEFT: f64 = 70.0;
/// Half of a number may stand beyond the end of an axis.
const RIGHT: f64 = 20.0;
const BOTTOM: f64 = 50.0;
const LINE: f64 = 20.0;
/// Between strips.
const GAP: f64 = 12.0;
/// What a letter takes of a line, about.
const LETTER: f64 = 7.4;
/// The same of a name in a legend, at the most: the next one follows right behind it.
const LEGEND_LETTER: f64 = 8.2;
/// Points of a series from which on another would cover it: each series gets a strip of its own.
const MAX_POINTS_OVERLAID: usize = 60;
/// Opacity of a band.
const BAND: &str = ".3";
/// Points of a line that are marked each.
const MAX_POINTS_MARKED: usize = 60;

/// What is drawn, without the frame of an SVG.
pub(super) struct Drawing {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) body: Markup,
}

/// Rounded to a hundredth of a pixel.
fn px(v: f64) -> f64 {
    (v * 100.0).round() / 100.0 + 0.0
}

/// A colour as SVG has it.
fn colour(i: usize) -> String {
    let c = COLOURS[i % COLOURS.len()];
    format!("#{:02x}{:02x}{:02x}", c.0, c.1, c.2)
}

/// A whole SVG of a drawing. Without a fixed size: that would not fit a narrow screen.
pub(super) fn svg(title: &str, width: f64, height: f64, body: &Markup) -> String {
    let view = format!("0 0 {} {}", width.ceil(), height.ceil());
    let svg = html! {
        svg xmlns="http://www.w3.org/2000/svg" role="img" viewBox=(view) font-family="sans-serif" font-size="14" fill="#000000" {
            title { (title) }
            rect width="100%" height="100%" fill="#FFFFFF" {}
            (body)
        }
    };
    svg.into_string()
}

/// Words in lines of so many letters.
fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(last) if last.is_empty() => last.push_str(word),
            Some(last) if last.chars().count() + 1 + word.chars().count() <= letters => {
                last.push(' ');
                last.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Names of series beside their signs, in as many lines as they need from a height on; the height of these.
pub(super) fn legend(names: &[&str], width: f64, top: f64, mark: impl Fn(usize) -> Option<Mark>) -> (Markup, f64) {
    let (mut x, mut y) = (10.0, top);
    let mut places = Vec::new();
    for name in names {
        let own = 34.0 + LEGEND_LETTER * name.chars().count() as f64;
        if x > 10.0 && x + own > width {
            (x, y) = (10.0, y + LINE);
        }
        places.push((x, y));
        x += own;
    }
    let entry = |i: usize| {
        let (x, y) = places[i];
        let cross = mark(i) == Some(Mark::Cross);
        let sign = if cross {
            format!("M{},{}l10,10m-10,0l10-10", x + 2.0, y + 4.0)
        } else {
            format!("M{},{}h8", x + 3.0, y + 9.0)
        };
        html! {
            g data-legend=(i) {
                rect x=(x) y=(y) width=(22.0 + LETTER * names[i].chars().count() as f64) height="19" fill="#FFFFFF" {}
                path d=(sign) stroke=(colour(i)) fill="none" stroke-width=(if cross { 2 } else { 10 })
                    stroke-opacity=[(mark(i) == Some(Mark::Band)).then_some(BAND)] {}
                text x=(x + 17.0) y=(y + 14.0) { (names[i]) }
            }
        }
    };
    (html! { @for i in 0..names.len() { (entry(i)) } }, y - top + LINE)
}

/// What a label gives as its unit: "θ in °", "residual, µm".
fn unit(label: &str) -> Option<&str> {
    label.rsplit_once(" in ").or_else(|| label.rsplit_once(", ")).map(|(_, unit)| unit)
}

/// The plot's place, and what its axes are.
struct Plot {
    x: Axis,
    y: Axis,
    top: f64,
    height: f64,
}

impl Plot {
    fn at(&self, (x, y): (f64, f64)) -> (f64, f64) {
        let width = WIDTH - LEFT - RIGHT;
        (px(LEFT + width * self.x.share(x)), px(self.top + self.height * (1.0 - self.y.share(y))))
    }

    /// Grid, numbers and ends of the axes; numbers of x are below the last strip alone.
    fn axes(&self, with_x: bool) -> Markup {
        let (right, bottom) = (WIDTH - RIGHT, self.top + self.height);
        let mut grid = String::new();
        let ticks_y = self.y.ticks((self.height / 28.0).clamp(2.0, 7.0));
        let longest = self.x.ticks(6.0).iter().map(|t| t.1.chars().count()).max().unwrap_or(1) as f64;
        let ticks_x = self.x.ticks(((WIDTH - LEFT - RIGHT) / (LETTER * longest + 16.0)).clamp(2.0, 6.0));
        for (v, _) in &ticks_y {
            let _ = write!(grid, "M{LEFT},{}H{right}", self.at((self.value_x(), *v)).1);
        }
        for (v, _) in &ticks_x {
            let _ = write!(grid, "M{},{}V{bottom}", self.at((*v, self.value_y())).0, self.top);
        }
        html! {
            path d=(grid) stroke="#b4b4b4" stroke-width=".6" {}
            path d=(format!("M{LEFT},{}V{bottom}H{right}", self.top)) stroke="#000000" fill="none" {}
            g text-anchor="end" { @for (v, label) in &ticks_y { text x=(LEFT - 6.0) y=(px(self.at((self.value_x(), *v)).1 + 5.0)) { (label) } } }
            @if with_x {
                g text-anchor="middle" { @for (v, label) in &ticks_x { text x=(self.at((*v, self.value_y())).0) y=(bottom + 18.0) { (label) } } }
            }
        }
    }

    /// Any values on the axes.
    fn value_x(&self) -> f64 {
        if self.x.logarithmic { 10_f64.powf(self.x.low) } else { self.x.low }
    }

    fn value_y(&self) -> f64 {
        if self.y.logarithmic { 10_f64.powf(self.y.low) } else { self.y.low }
    }

    /// A series; the keys of its points are those of rows of the page's tables.
    fn series(&self, i: usize, series: &Series, keys: &[usize]) -> Markup {
        let points: Vec<(f64, f64)> = series.points.iter().map(|p| self.at(*p)).collect();
        let (mut dots, mut line) = (String::new(), String::new());
        for (n, (x, y)) in points.iter().enumerate() {
            let start = match series.mark {
                Mark::Line | Mark::Step | Mark::Band => n == 0,
                Mark::Vector => n % 2 == 0,
                Mark::Dot | Mark::Numbered | Mark::Cross => false,
            };
            let marked = match series.mark {
                Mark::Dot | Mark::Numbered | Mark::Step => true,
                Mark::Line => points.len() <= MAX_POINTS_MARKED,
                Mark::Vector => n % 2 == 1,
                Mark::Cross | Mark::Band => false,
            };
            let _ = match series.mark {
                Mark::Dot | Mark::Numbered => Ok(()),
                Mark::Cross => write!(line, "M{},{}l8,8m-8,0l8-8", px(x - 4.0), px(y - 4.0)),
                _ if start => write!(line, "M{x},{y}"),
                // with every point in the path, where the page's script finds it
                Mark::Step => write!(line, "H{x}V{y}M{x},{y}"),
                _ => write!(line, "L{x},{y}"),
            };
            if marked {
                let _ = write!(dots, "M{x},{y}h0");
            }
        }
        let keys = (!keys.is_empty()).then(|| keys.iter().map(ToString::to_string).collect::<Vec<_>>().join(" "));
        let (size, width) = if series.mark == Mark::Vector { (4, "1") } else { (6, "2") };
        let place = format!("{} {}", self.top, self.top + self.height);
        html! {
            g data-series=(i) data-name=(series.name) data-place=(place) data-mark=(series.mark.name()) data-keys=[keys] {
                @if series.mark == Mark::Band {
                    path d={ (line) "z" } fill=(colour(i)) fill-opacity=(BAND) {}
                } @else {
                    @if !line.is_empty() { path d=(line) stroke=(colour(i)) fill="none" stroke-width=(width) {} }
                    @if !dots.is_empty() { path d=(dots) stroke=(colour(i)) fill="none" stroke-width=(size) stroke-linecap="round" {} }
                    @if series.mark == Mark::Numbered {
                        g.numbers font-size="12" {
                            @for (n, (x, y)) in points.iter().enumerate() { text x=(px(x + 5.0)) y=(px(y - 4.0)) { (n + 1) } }
                        }
                    }
                }
            }
        }
    }
}

/// A chart of points, with keys by series and point.
pub(super) fn panel(panel: &Panel, keys: &[Vec<usize>], logarithmic: bool) -> Result<Drawing> {
    let points = || panel.series.iter().flat_map(|s| s.points.iter());
    let (mut x, mut y) =
        (Axis::new(points().map(|p| p.0), logarithmic)?, Axis::new(points().map(|p| p.1), logarithmic)?);
    let (width, mut height) = (WIDTH - LEFT - RIGHT, HEIGHT);
    let (unit_x, unit_y) = (unit(&panel.x_label), unit(&panel.y_label));
    if !logarithmic && unit_x.is_some() && unit_x == unit_y {
        height = (width * y.length() / x.length()).clamp(HEIGHTS[0], HEIGHTS[1]);
        let per_pixel = (x.length() / width).max(y.length() / height);
        (x, y) = (x.of_length(per_pixel * width), y.of_length(per_pixel * height));
    }
    let title = wrapped(&panel.title, ((WIDTH - 20.0) / LETTER) as usize);
    let mut top = 8.0 + LINE * title.len() as f64;
    let names: Vec<&str> = panel.series.iter().map(|s| s.name.as_str()).collect();
    let legend = (names.len() > 1).then(|| legend(&names, WIDTH, top, |i| Some(panel.series[i].mark)));
    top += 8.0 + legend.as_ref().map_or(0.0, |l| l.1);
    let covers = |s: &&Series| s.mark == Mark::Dot && s.points.len() > MAX_POINTS_OVERLAID;
    let strips = if panel.series.iter().filter(covers).count() > 1 { panel.series.len() } else { 1 };
    let own = (height - GAP * (strips - 1) as f64) / strips as f64;
    let plot = |n: usize| Plot { x: x.clone(), y: y.clone(), top: top + n as f64 * (own + GAP), height: own };
    let bottom = top + height;
    let axes = format!(
        "{} {} {LEFT} {} {} {} {}",
        x.low,
        x.high,
        WIDTH - RIGHT,
        y.low,
        y.high,
        if logarithmic { "log" } else { "linear" }
    );
    let none = Vec::new();
    let body = html! {
        g.chart data-axes=(axes) data-x=(panel.x_label) data-y=(panel.y_label) {
            g text-anchor="middle" {
                @for (n, line) in title.iter().enumerate() { text x=(WIDTH / 2.0) y=(LINE * (n + 1) as f64) font-size="15" { (line) } }
                text x=((LEFT + WIDTH - RIGHT) / 2.0) y=(bottom + 40.0) { (panel.x_label) }
                text transform=(format!("translate(16,{}) rotate(-90)", px((top + bottom) / 2.0))) { (panel.y_label) }
            }
            @if let Some((legend, _)) = &legend { (legend) }
            @for n in 0..strips { (plot(n).axes(n + 1 == strips)) }
            @for (i, s) in panel.series.iter().enumerate() {
                (plot(if strips > 1 { i } else { 0 }).series(i, s, keys.get(i).unwrap_or(&none)))
            }
        }
    };
    Ok(Drawing { width: WIDTH, height: bottom + BOTTOM, body })
}

/// Charts in rows.
pub(super) fn grid(panels: &[Panel], columns: usize, logarithmic: bool) -> Result<Drawing> {
    let drawn: Vec<Drawing> = panels.iter().map(|p| panel(p, &[], logarithmic)).collect::<Result<_>>()?;
    let mut top = 0.0;
    let mut body = html! {};
    for row in drawn.chunks(columns) {
        for (n, one) in row.iter().enumerate() {
            let moved = format!("translate({},{})", n as f64 * WIDTH, px(top));
            body = html! { (body) g transform=(moved) { (one.body) } };
        }
        top += row.iter().map(|d| d.height).fold(0.0, f64::max);
    }
    Ok(Drawing { width: WIDTH * columns.min(panels.len()) as f64, height: top, body })
}

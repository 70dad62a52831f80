//! Values over two axes, as colours, with a bar that says what these stand for.

use std::fmt::Write;

use maud::html;

use super::axis::{Axis, plain};
use super::{Drawing, LETTER, colour, px, unit};
use crate::error::Result;
use crate::page::plot::HeatMap;

/// Cells along an axis, and colours of the bar, at the most.
const CELLS: usize = 120;
const SHADES: usize = 24;
/// Stripes of what is extrapolated: apart along x, colours and widths, which are seen on every shade; px.
const STRIPES_APART: f64 = 12.0;
const STRIPES: [(&str, u32); 2] = [("#000000", 3), ("#FFFFFF", 1)];

const LEFT: f64 = 76.0;
const TOP: f64 = 36.0;
/// The longer side of the map.
const SIDE: f64 = 330.0;
/// The shorter side is not shorter than this.
const SHORTEST: f64 = 120.0;
const BAR: f64 = 110.0;
const BAR_HEIGHT: f64 = 240.0;
const BOTTOM: f64 = 54.0;

/// Dark is low: purple, green, yellow.
fn shade_colour(shade: usize) -> String {
    let t = shade as f64 / (SHADES - 1) as f64;
    let mix = |a: f64, b: f64, c: f64| if t < 0.5 { a + (b - a) * 2.0 * t } else { b + (c - b) * (2.0 * t - 1.0) };
    let channel = |a, b, c| mix(a, b, c) as u8;
    format!("#{:02x}{:02x}{:02x}", channel(68.0, 33.0, 253.0), channel(1.0, 145.0, 231.0), channel(84.0, 140.0, 37.0))
}

/// Four digits.
fn number(v: f64) -> String {
    plain(format!("{v:.3e}").parse().unwrap_or(v))
}

/// Width and height of the map: the same scale on both axes where both have the same unit.
fn size(map: &HeatMap<'_>, [across, up]: [f64; 2]) -> (f64, f64) {
    let unit_x = unit(&map.x_label);
    if unit_x.is_none() || unit_x != unit(&map.y_label) {
        return (SIDE, 0.75 * SIDE);
    }
    let scale = SIDE / across.max(up);
    ((across * scale).max(SHORTEST), (up * scale).max(SHORTEST))
}

/// Of the values that are not extrapolated, if there are any.
fn range(values: &[Vec<Option<f64>>], extrapolated: &[Vec<bool>]) -> [f64; 2] {
    let all = || values.iter().flatten().zip(extrapolated.iter().flatten()).filter_map(|(v, far)| Some(((*v)?, *far)));
    let none_is_near = all().all(|(_, far)| far);
    let counted = all().filter(|(_, far)| none_is_near || !far);
    counted.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], (v, _)| [low.min(v), high.max(v)])
}

/// A path for each shade, neighbours in a row in one piece.
fn pieces(
    values: &[Vec<Option<f64>>],
    shade: impl Fn(f64) -> usize,
    corner: impl Fn(usize, usize) -> (f64, f64),
) -> Vec<String> {
    let mut pieces = vec![String::new(); SHADES];
    for (row, values) in values.iter().enumerate() {
        let mut column = 0;
        for piece in values.chunk_by(|a, b| a.map(&shade) == b.map(&shade)) {
            if let Some(shade) = piece[0].map(&shade) {
                let ((left, down), (right, up)) = (corner(row, column), corner(row + 1, column + piece.len()));
                let _ = write!(pieces[shade], "M{left},{down}H{right}V{up}H{left}z");
            }
            column += piece.len();
        }
    }
    pieces
}

/// A path from corner to corner of cells, and on through the next ones, so many of them apart.
fn stripes(marked: &[Vec<bool>], apart: usize, corner: impl Fn(usize, usize) -> (f64, f64)) -> String {
    let mut path = String::new();
    for (row, marked) in marked.iter().enumerate() {
        let mut column = row % apart;
        while let Some(is_marked) = marked.get(column) {
            if *is_marked {
                let ((left, down), (right, up)) = (corner(row, column), corner(row + 1, column + 1));
                let _ = write!(path, "M{left},{down}L{right},{up}");
            }
            column += apart;
        }
    }
    path
}

pub(in crate::page) fn drawing(map: &HeatMap<'_>) -> Result<Drawing> {
    let (nx, ny) = (map.x.len(), map.y.len());
    let (skip_x, skip_y) = (nx.div_ceil(CELLS), ny.div_ceil(CELLS));
    let columns: Vec<usize> = (0..nx).step_by(skip_x).collect();
    let rows: Vec<usize> = (0..ny).step_by(skip_y).collect();
    let values: Vec<Vec<Option<f64>>> =
        rows.iter().map(|y| columns.iter().map(|x| (map.value)(*x, *y)).collect()).collect();
    let extrapolated: Vec<Vec<bool>> =
        rows.iter().map(|y| columns.iter().map(|x| (map.extrapolated)(*x, *y)).collect()).collect();
    let [low, high] = range(&values, &extrapolated);
    // the best is what people look for: shades closer together there
    let shade = |v: f64| {
        let share = if high > low { ((v - low) / (high - low)).clamp(0.0, 1.0).sqrt() } else { 0.0 };
        ((share * SHADES as f64) as usize).min(SHADES - 1)
    };
    let step = [skip_x as f64 * (map.x[1] - map.x[0]), skip_y as f64 * (map.y[1] - map.y[0])];
    let axis = |first: f64, count: usize, step: f64| {
        Axis::new([first].into_iter(), false).map(|a| Axis {
            low: first - step / 2.0,
            high: first + (count as f64 - 0.5) * step,
            ..a
        })
    };
    let (x, y) = (axis(map.x[0], columns.len(), step[0])?, axis(map.y[0], rows.len(), step[1])?);
    let (width, height) = size(map, [x.length(), y.length()]);
    let (right, bottom) = (LEFT + width, TOP + height);
    let at = |p: [f64; 2]| (px(LEFT + width * x.share(p[0])), px(bottom - height * y.share(p[1])));

    let corner = |row: usize, column: usize| at([x.low + column as f64 * step[0], y.low + row as f64 * step[1]]);
    let pieces = pieces(&values, shade, corner);
    let stripes = stripes(&extrapolated, (STRIPES_APART * columns.len() as f64 / width).ceil() as usize, corner);
    let written = |v: &Option<f64>| v.map_or("-".to_owned(), number);
    let grid: Vec<String> = values.iter().map(|row| row.iter().map(written).collect::<Vec<_>>().join(" ")).collect();
    let axes = format!("{} {} {LEFT} {right} {} {} linear", x.low, x.high, y.low, y.high);
    let value = |shade: f64| low + (high - low) * (shade / SHADES as f64).powi(2);
    let bar_left = right + 24.0;
    let shade_top = |n: usize| px(TOP + BAR_HEIGHT * (1.0 - n as f64 / SHADES as f64));
    let longest = x.ticks(6.0).iter().map(|t| t.1.chars().count()).max().unwrap_or(1) as f64;
    let ticks_x = x.ticks((width / (LETTER * longest + 16.0)).clamp(2.0, 7.0));
    let body = html! {
        g.heat data-axes=(axes) data-x=(map.x_label) data-y=(map.y_label) data-name=(map.title)
            data-place=(format!("{TOP} {bottom}")) data-values=(grid.join("|")) {
            g shape-rendering="crispEdges" {
                @for (n, d) in pieces.iter().enumerate().filter(|(_, d)| !d.is_empty()) { path d=(d) fill=(shade_colour(n)) {} }
            }
            @if !stripes.is_empty() {
                @for (colour, wide) in STRIPES { path d=(stripes) stroke=(colour) stroke-width=(wide) fill="none" {} }
            }
            path d=(format!("M{LEFT},{TOP}V{bottom}H{right}")) stroke="#000000" fill="none" {}
            @for (v, label) in ticks_x { text x=(at([v, y.low]).0) y=(bottom + 18.0) text-anchor="middle" { (label) } }
            @for (v, label) in y.ticks((height / 40.0).max(2.0)) { text x=(LEFT - 6.0) y=(at([x.low, v]).1 + 5.0) text-anchor="end" { (label) } }
            text x=((LEFT + right) / 2.0) y=(bottom + 42.0) text-anchor="middle" { (map.x_label) }
            text transform=(format!("translate(18,{}) rotate(-90)", px((TOP + bottom) / 2.0))) text-anchor="middle" { (map.y_label) }
            text x=(LEFT) y="22" font-size="16" { (map.title) }
            @if let Some(mark) = map.mark {
                @let (x, y) = at(mark);
                circle cx=(x) cy=(y) r="7" fill="none" stroke="#FFFFFF" stroke-width="6" {}
                circle cx=(x) cy=(y) r="7" fill="none" stroke=(colour(1)) stroke-width="3" {}
                circle cx=(x) cy=(y) r="2" fill=(colour(1)) {}
            }
            @if low <= high {
                @for n in 0..SHADES {
                    rect x=(bar_left) y=(shade_top(n + 1)) width="20" height=(px(BAR_HEIGHT / SHADES as f64)) fill=(shade_colour(n)) {}
                    @if n % 6 == 0 || n == SHADES - 1 {
                        @let (of, y) = if n == 0 { (0, shade_top(0)) } else { (n + 1, shade_top(n + 1) + 8.0) };
                        text x=(bar_left + 26.0) y=(y) { (number(value(of as f64))) }
                    }
                }
            }
        }
    };
    Ok(Drawing { width: right + 24.0 + BAR, height: (bottom + BOTTOM).max(TOP + BAR_HEIGHT + 12.0), body })
}

#[cfg(test)]
mod tests {
    use super::range;

    #[test]
    fn colours_range_over_what_is_not_extrapolated_or_over_all_where_nothing_else_is() {
        let values = [vec![Some(2.0), None, Some(9.0)], vec![Some(1.0), Some(4.0), None]];
        assert_eq!(range(&values, &[vec![false, false, true], vec![true, false, true]]), [2.0, 4.0]);
        assert_eq!(range(&values, &[vec![true; 3], vec![true; 3]]), [1.0, 9.0]);
    }
}

//! The path of a tool seen at a slant, coloured by how far the load takes the tip.

use std::fmt::Write as _;

use crate::plan::track::{LineErrors, PathPlace};

/// Of the picture, its empty border, and the room for axes and legend below the path.
const SIZE: [f64; 2] = [900.0, 560.0];
const BORDER: f64 = 40.0;
const LEGEND: f64 = 90.0;
/// Room for the name of a line.
const NAME: f64 = 100.0;
/// From no error to the greatest.
const COLOURS: [&str; 6] = ["#fdae6b", "#fd8d3c", "#f16913", "#d94801", "#a63603", "#5f1c02"];

/// On the screen, to the right and down: x to the right and toward the eye, y to the right and away, z down, as the tool points at the workpiece.
fn seen([x, y, z]: [f64; 3]) -> [f64; 2] {
    let (sin, cos) = 30_f64.to_radians().sin_cos();
    [cos * (x + y), sin * (x - y) + z]
}

/// The picture. A line's number stands where the error is greatest.
pub(super) fn svg(places: &[PathPlace], worst: Option<&LineErrors>) -> String {
    let ends =
        places.iter().map(|p| seen(p.tip_m)).fold([[f64::INFINITY; 2], [f64::NEG_INFINITY; 2]], |[low, high], p| {
            [[low[0].min(p[0]), low[1].min(p[1])], [high[0].max(p[0]), high[1].max(p[1])]]
        });
    let spans: [f64; 2] = std::array::from_fn(|i| (ends[1][i] - ends[0][i]).max(1e-4));
    let scale = [SIZE[0], SIZE[1] - LEGEND]
        .into_iter()
        .zip(spans)
        .map(|(s, span)| (s - 2.0 * BORDER) / span)
        .fold(f64::INFINITY, f64::min);
    let left = (SIZE[0] - spans[0] * scale) / 2.0;
    let at = |tip_m: [f64; 3]| {
        let p = seen(tip_m);
        [left + (p[0] - ends[0][0]) * scale, BORDER + (p[1] - ends[0][1]) * scale]
    };
    let greatest = places.iter().filter_map(|p| p.before_m).fold(0.0, f64::max);
    let colour = |before_m: f64| {
        let share = if greatest > 0.0 { before_m / greatest } else { 0.0 };
        COLOURS[((share * COLOURS.len() as f64) as usize).min(COLOURS.len() - 1)]
    };
    let [width, height] = SIZE;
    // white in dark mode too, and its letters dark: the colours of the largest errors are
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
         font-size=\"15\" style=\"--ink:#14181d;background:#fff\">\n<title>The path of the tip, coloured by its error</title>\n<rect width=\"{width}\" height=\"{height}\" \
         fill=\"#ffffff\"/>\n<g fill=\"none\" stroke-linecap=\"round\">"
    );
    let mut last: Option<&str> = None;
    for pair in places.windows(2).filter(|pair| !pair[1].is_fresh) {
        let ([a, b], to) = (at(pair[0].tip_m), at(pair[1].tip_m));
        let stroke = match (pair[0].before_m, pair[1].before_m) {
            (_, None) => "#b0b0b0\" stroke-width=\"1\" stroke-dasharray=\"4 4",
            (before, Some(after)) => colour(before.map_or(after, |before| before.max(after))),
        };
        _ = write!(s, "<path d=\"M{a:.1},{b:.1}L{:.1},{:.1}\" stroke=\"{stroke}\"", to[0], to[1]);
        s.push_str(if pair[1].before_m.is_some() { " stroke-width=\"2.5\"/>" } else { "/>" });
        last = Some(stroke);
    }
    s.push_str("</g>\n");
    if let Some(line) = worst.filter(|_| last.is_some()) {
        let [x, y] = at(line.worst.tip_m);
        // its name away from the path, but within the picture
        let is_right = !(NAME..=SIZE[0] / 2.0).contains(&x) && x < SIZE[0] - NAME;
        let (side, anchor) = if is_right { (10.0, "start") } else { (-10.0, "end") };
        _ = writeln!(
            s,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" fill=\"none\" stroke=\"#000000\" stroke-width=\"1.5\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">line {}</text>",
            x + side,
            y + 14.0,
            line.worst.line
        );
    }
    s + &axes() + &legend(greatest, scale) + "</svg>\n"
}

/// Directions of B, in the corner.
fn axes() -> String {
    let [x0, y0] = [70.0, SIZE[1] - 60.0];
    let axis = |(i, name): (usize, &str)| {
        let [x, y] = seen(std::array::from_fn(|k| if k == i { 36.0 } else { 0.0 }));
        format!(
            "<path d=\"M{x0},{y0}l{x:.1},{y:.1}\" stroke=\"#000000\" stroke-width=\"1.5\"/><text x=\"{:.1}\" y=\"{:.1}\">{name}</text>",
            x0 + 1.25 * x - 4.0,
            y0 + 1.25 * y + 5.0
        )
    };
    ["x", "y", "z"].into_iter().enumerate().map(axis).collect::<String>() + "\n"
}

/// Colours with their errors, and a bar of a round length.
fn legend(greatest_m: f64, scale: f64) -> String {
    let (mut s, y) = (String::new(), SIZE[1] - 34.0);
    for (n, colour) in COLOURS.into_iter().enumerate() {
        _ = write!(s, "<rect x=\"{}\" y=\"{y}\" width=\"36\" height=\"14\" fill=\"{colour}\"/>", 240 + 36 * n);
    }
    let longest_mm = 0.2 * SIZE[0] / scale * 1e3;
    let power = 10_f64.powf(longest_mm.log10().floor());
    let bar_mm = [5.0, 2.0].into_iter().map(|n| n * power).find(|mm| *mm <= longest_mm).unwrap_or(power);
    let long = bar_mm / 1e3 * scale;
    _ = writeln!(
        s,
        "<text x=\"232\" y=\"{0}\" text-anchor=\"end\">0</text><text x=\"464\" y=\"{0}\">{1:.1} µm</text>\
         <path d=\"M600,{2}h{long:.1}\" stroke=\"#000000\" stroke-width=\"3\"/><text x=\"{3:.1}\" y=\"{0}\">{bar_mm} mm</text>",
        y + 12.0,
        greatest_m * 1e6,
        y + 7.0,
        608.0 + long
    );
    s
}

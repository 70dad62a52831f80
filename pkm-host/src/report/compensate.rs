//! What came of a compensated path: pictures of the tip's error, the report, text and JSON.

use maud::html;
use serde_json::{Value, json};

use crate::error::Result;
use crate::page::plot::{self, Mark, Panel, Series};
use crate::page::{self, Finding, Page};
use crate::plan::feed::{HeldFeeds, NotHeld, NotHeldCuts, TooFast};
use crate::plan::implausible_load;
use crate::plan::track::{Error, LineErrors, Nearest, Tally, Track};
use crate::report::path3d;

/// A determinant below this many times the limit is a warning.
const WARNING_RATIO: f64 = 1.5;
/// What may be left between points, as a share of what the load does.
const MAX_AT_MIDPOINTS: f64 = 0.1;
/// What may be left of the axis' error, as a share of what the load does.
const MAX_AXIS_LEFT: f64 = 0.5;

/// Of each stretch of the path the greatest value in µm over the way in mm; 0 where there is no load.
fn along(track: &Track, name: &str, error: Error) -> Series {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for stretch in &track.stretches {
        let point = stretch.greatest(error);
        let way_mm = point.path_length_m * 1e3;
        if let Some((last_mm, _)) = points.last().copied().filter(|_| stretch.is_behind_gap) {
            points.extend([(last_mm, 0.0), (way_mm, 0.0)]);
        }
        points.push((way_mm, point.error_m(error) * 1e6));
    }
    Series { name: name.to_owned(), points, mark: Mark::Line }
}

fn errors(track: &Track) -> Panel {
    // residuals near zero are as intended
    let mut series = vec![along(track, "uncompensated", Error::Before), along(track, "compensated", Error::After)];
    if track.load_off.count > 0 {
        series.insert(1, along(track, "compensated, load off", Error::LoadOff));
    }
    if track.u95.count > 0 {
        series.push(along(track, "U95 of the prediction", Error::U95));
    }
    Panel {
        title: "error of the tip, as the model predicts it".to_owned(),
        x_label: "path length in mm".to_owned(),
        y_label: "µm".to_owned(),
        series,
    }
}

/// Error of the tip along the way.
///
/// # Errors
/// What the drawing library says.
pub fn picture(track: &Track) -> Result<String> {
    plot::panels(&[errors(track)])
}

/// Where the loaded path is, seen along an axis of B, and its point of greatest error.
fn view(track: &Track, [right, up]: [usize; 2]) -> Panel {
    let name = |axis: usize| format!("{} in mm", ["x", "y", "z"][axis]);
    let at = |tip_m: [f64; 3]| (tip_m[right] * 1e3, tip_m[up] * 1e3);
    let series = |name: &str, points: Vec<(f64, f64)>, mark| Series { name: name.to_owned(), points, mark };
    let loaded = track.places.iter().filter(|p| p.before_m.is_some()).map(|p| at(p.tip_m));
    Panel {
        title: format!("tip under load, {} over {}", ["x", "y", "z"][up], ["x", "y", "z"][right]),
        x_label: name(right),
        y_label: name(up),
        series: vec![
            series("path", loaded.collect(), Mark::Dot),
            series("greatest error", track.worst.iter().take(1).map(|l| at(l.worst.tip_m)).collect(), Mark::Cross),
        ],
    }
}

/// The lines with the greatest errors: line, way, and the greatest errors on it.
fn worst_lines(track: &Track) -> Vec<(String, Vec<String>)> {
    let row = |LineErrors { worst, after_m }: &LineErrors| {
        let [x, y, z] = worst.tip_m.map(|m| format!("{:.3}", m * 1e3));
        let [dx, dy, dz] = worst.before_m.map(|m| format!("{:.2}", m * 1e6));
        let sizes = [worst.error_m(Error::Before), *after_m].map(|m| format!("{:.3}", m * 1e6));
        (format!("line {}", worst.line), [&[x, y, z, dx, dy, dz][..], &sizes].concat())
    };
    track.worst.iter().map(row).collect()
}

/// Where limits come nearest: what, how much is left, on which line and where.
fn margins(track: &Track, limit: f64) -> Vec<(String, Vec<String>)> {
    let row = |name: String, room: String, nearest: &Nearest| {
        let [x, y, z] = nearest.tip_m.map(|m| format!("{:.3}", m * 1e3));
        (name, vec![room, nearest.line.to_string(), x, y, z])
    };
    let margins = &track.margins;
    let mut rows = Vec::new();
    if let Some(n) = &margins.travel {
        rows.push(row(format!("travel of screw {}", n.which + 1), format!("{:.3} mm", n.room * 1e3), n));
    }
    if let Some(n) = &margins.wrist {
        rows.push(row(format!("wrist joint β{}", n.which + 1), format!("{:.3}°", n.room.to_degrees()), n));
    }
    if let Some(n) = &margins.determinant {
        let room = format!("{:.1} % of home's determinant, limit {:.1} %", n.room * 100.0, limit * 100.0);
        rows.push(row("singularity".to_owned(), room, n));
    }
    if let Some(n) = &margins.extent {
        let name = format!("the table's box, {}", ["θ", "σ", "Z0"][n.which]);
        rows.push(row(name, format!("{:.1} % of its half width", n.room * 100.0), n));
    }
    rows
}

/// What the result rests on.
fn assumptions(track: &Track) -> Vec<String> {
    let mut all = vec![
        "All errors are what the model predicts: of the deflection under the stated load alone, with nothing of friction's \
         history, of the drives' following error or of thermal growth."
            .to_owned(),
        "Rapid moves have no load. Between two points of the new path the control goes straight.".to_owned(),
    ];
    if track.estimated > 0 {
        all.push(format!(
            "The load of {} moves is estimated by Kienzle's law from S, F, the tool's edges and the stated engagement, as the \
             mean over a turn at the tip: no ripple from tooth to tooth, no wear, no run-out, and the engagement is not checked.",
            track.estimated
        ));
    }
    if track.feeds.is_none() {
        all.push("Feeds were not held against limits of the joints: --limits does.".to_owned());
    }
    all
}

/// How well the table knows what was compensated.
fn known(track: &Track) -> Option<Finding> {
    if track.u95.count == 0 {
        return None;
    }
    let u95_um = track.u95.max * 1e6;
    let text = format!("How far the table may be off moves the tip by {u95_um:.2} µm at most (U95, coverage 95 %).");
    Some(match unsure(track) {
        Some(warning) => Finding::warning(format!("{text} Not all of the deflection is known: {warning}.")),
        None => Finding::good(format!("{text} Everywhere it is less than the deflection.")),
    })
}

/// A warning where the expanded uncertainty exceeds the deflection, so that not all of it is compensated.
pub fn unsure(track: &Track) -> Option<String> {
    (track.unsure > 0).then(|| {
        format!(
            "at {} of {} loaded points the expanded uncertainty exceeds the deflection; there only the share that is known is \
             compensated, {:.0} % at least",
            track.unsure,
            track.before[0].count,
            100.0 * track.least_known_share
        )
    })
}

/// Points that are too far apart.
pub fn far_apart(track: &Track) -> Option<String> {
    let is_much = track.at_midpoints.max > MAX_AT_MIDPOINTS * track.before[0].max;
    is_much.then(|| {
        let most_um = track.at_midpoints.max * 1e6;
        format!("at midpoints between points {most_um:.2} µm are left: points that are closer leave less (--step-mm)")
    })
}

/// What becomes of the axis.
fn of_axis(track: &Track) -> Option<Finding> {
    let [before, after] = [&track.before[1], &track.after[1]].map(|t| t.max * 1e6);
    let text = format!("The load turns the tool's axis by {before:.1} µrad at most; {after:.1} µrad are left");
    (track.before[1].count > 0).then(|| match after > MAX_AXIS_LEFT * before {
        true => Finding::warning(format!("{text}, which the axes of the path do not turn back.")),
        false => Finding::good(format!("{text}.")),
    })
}

/// What to think of it.
fn findings(track: &Track, limit: f64) -> Vec<Finding> {
    if track.stretches.is_empty() {
        return vec![Finding::warning("No load acts anywhere on the path: nothing was compensated.")];
    }
    let [before, after] = [&track.before[0], &track.after[0]].map(|t| t.max * 1e6);
    let text = format!(
        "The load takes the tip {before:.1} µm from its path at most; with the new commands {after:.4} µm are left"
    );
    let with_load_off = match track.load_off.count {
        0 => String::new(),
        _ => format!(
            " under the stated load, and up to {:.2} µm if that is off by its uncertainty",
            track.load_off.max * 1e6
        ),
    };
    let mut all = vec![match track.u95.count {
        0 => Finding::warning(format!("{text}{with_load_off}, by this model: nothing says how far that is off.")),
        _ => Finding::good(format!("{text}{with_load_off}.")),
    }];
    // what is more is among the warnings
    if track.at_midpoints.count > 0 && far_apart(track).is_none() {
        let most_um = track.at_midpoints.max * 1e6;
        all.push(Finding::good(format!("At midpoints between points at most {most_um:.4} µm are left.")));
    }
    all.extend(of_axis(track));
    if track.extrapolated > 0 {
        let points = track.points;
        let text = format!(
            "{} of {points} points lie outside the table's box: what is compensated there is extrapolated.",
            track.extrapolated
        );
        all.insert(0, Finding::bad(text));
    }
    all.extend(known(track));
    let [least, limit] = [track.min_normalised_determinant(), limit].map(|share| 100.0 * share);
    let text = format!(
        "Closest to a singularity the determinant is {least:.1} % of that at home; below {limit} % it is refused."
    );
    all.push(if least < WARNING_RATIO * limit { Finding::warning(text) } else { Finding::good(text) });
    all
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(track: &Track) -> Vec<Finding> {
    if track.stretches.is_empty() {
        return vec![Finding::good("give the loads: in the CSV, with --wrench, or for a program with --tools.").todo()];
    }
    let sure = if track.u95.count > 0 {
        "all of this is by the model that the new commands are made with; how far its table may be off is said below."
    } else {
        "all of this is by the model that the new commands are made with, and nothing here says how far that is off: a table that pkm-host fit writes does."
    };
    let todo = match (track.extrapolated > 0, track.too_fast.is_empty()) {
        (true, _) => {
            "move the work into the table's box (pkm-host place), or fit a table that reaches as far, before this path is run."
        }
        (_, false) => {
            "lower the feed on the lines that are named below, then run the new file in place of the old one."
        }
        (false, true) if far_apart(track).is_some() => {
            "have points written between those of the path (--step-mm), then run the new file in place of the old one."
        }
        (false, true) => {
            "run the new file in place of the old one; measure the first part where the error was greatest."
        }
    };
    vec![Finding::good(sure).sure(), Finding::good(todo).todo()]
}

/// Loads that are hardly in the units that they are taken for.
pub fn implausible(track: &Track) -> Option<String> {
    implausible_load("the load takes the tip off its path by", track.before[0].max)
}

/// Lines that ask too much of a joint.
pub fn too_fast(track: &Track, file: &str) -> Vec<String> {
    let line = |t: &TooFast| {
        let TooFast { line, feed_per_min, allowed_per_min, unit, of_a_turn } = t;
        // down, so that what is written holds
        let allowed = (allowed_per_min * 10.0).floor() / 10.0;
        let product = if *of_a_turn { " (G95: F times S)" } else { "" };
        format!(
            "{file}:{line}: {feed_per_min} {unit}{product} is too fast for a joint, {allowed} {unit} is within its limits"
        )
    };
    track.too_fast.iter().map(line).collect()
}

/// Cuts that limits say nothing about.
pub fn not_held(track: &Track, file: &str) -> Option<String> {
    let feeds = track.feeds.as_ref().filter(|feeds| feeds.not_held() > 0)?;
    let cuts = |NotHeldCuts { why, count, line }: &NotHeldCuts| {
        let why = match why {
            NotHeld::InverseTime => "in G93 (1 over the minutes of a move)",
            NotHeld::OfATurn => "in G95 (mm a turn) without S or F in force",
            NotHeld::NoFeed => "without an F in force",
            NotHeld::NoBeginning => "from a place that is not known",
        };
        let more = if *count == 1 { String::new() } else { format!(" and {} more", count - 1) };
        format!("{why} at line {line}{more}")
    };
    let (left_out, held) = (feeds.not_held(), feeds.held);
    let reasons = feeds.not_held.iter().map(cuts).collect::<Vec<_>>().join(", ");
    Some(format!(
        "{file}: --limits: the feed of {left_out} of {} cuts could not be held against the joints' limits: {reasons}; only an F \
         in mm/min (G94), or in mm a turn with S (G95), can",
        left_out + held
    ))
}

/// The report; `limit` is the least normalised determinant that the machine file allows.
///
/// # Errors
/// What the drawing library says.
pub fn html(track: &Track, facts: &[(&str, String)], warnings: &[String], limit: f64) -> Result<String> {
    let components = Panel {
        title: "by component, uncompensated".to_owned(),
        x_label: "path length in mm".to_owned(),
        y_label: "µm".to_owned(),
        series: [("x", Error::X), ("y", Error::Y), ("z", Error::Z)].map(|(name, e)| along(track, name, e)).into(),
    };
    let panels = [errors(track), components, view(track, [0, 1]), view(track, [0, 2])];
    let heads = ["x in mm", "y in mm", "z in mm", "dx in µm", "dy in µm", "dz in µm", "off in µm", "compensated in µm"];
    let body = html! {
        @if !track.stretches.is_empty() {
            h2 { "Error of the tip" }
            (page::picture("The path of the tip in B, coloured by how far the load takes the tip from it; grey: no load. A long path is drawn through some of its points.", &path3d::svg(&track.places, track.worst.first())))
            (page::charts("How far the load takes the tip from its path, and where, in the axes of B. Of each stretch the greatest.", &panels)?)
            h2 { "Lines" }
            (page::table(
                "The lines with the greatest error: where it is on each, what the load does there, and the greatest that is left on the line.",
                &heads,
                &worst_lines(track),
            ))
        }
        h2 { "Limits" }
        (page::table(
            "Where the path, as it is commanded, comes nearest to what the machine and the table allow.",
            &["left", "line", "x in mm", "y in mm", "z in mm"],
            &margins(track, limit),
        ))
        h2 { "What it rests on" }
        ul { @for text in assumptions(track) { li { (text) } } }
    };
    let title = "Compensated tool path".to_owned();
    let mut findings = findings(track, limit);
    findings.extend(advice(track));
    Ok(Page { title, findings: &findings, warnings, body, facts: facts.to_vec() }.html())
}

/// For the terminal; `limit` is the least normalised determinant that the machine file allows.
pub fn text(track: &Track, limit: f64) -> String {
    let micro = |t: &Tally| format!("{:.4} at most, {:.4} rms", t.max * 1e6, t.rms() * 1e6);
    let [before, after] = [&track.before, &track.after];
    let mut text = format!(
        "error of the tip in µm, as the model predicts it: {}; compensated {}\n\
         error of the axis in µrad: {}; compensated {}\n",
        micro(&before[0]),
        micro(&after[0]),
        micro(&before[1]),
        micro(&after[1]),
    );
    if track.at_midpoints.count > 0 {
        text.push_str(&format!("of the tip at midpoints between points in µm: {}\n", micro(&track.at_midpoints)));
    }
    if track.load_off.count > 0 {
        text.push_str(&format!("if the load is off by its uncertainty, µm: {}\n", micro(&track.load_off)));
    }
    if track.u95.count > 0 {
        text.push_str(&format!("expanded uncertainty U95 of the deflection in µm: {}\n", micro(&track.u95)));
    }
    if track.estimated > 0 {
        text.push_str(&format!("load of {} moves estimated from the cut\n", track.estimated));
    }
    if let Some(feeds) = track.feeds.as_ref().filter(|feeds| feeds.held > 0) {
        let lines = track.too_fast.len();
        text.push_str(&format!(
            "feed of {} moves held against the joints' limits: too fast in {lines} {}\n",
            feeds.held,
            if lines == 1 { "line" } else { "lines" }
        ));
    }
    let [least, limit] = [track.min_normalised_determinant(), limit].map(|share| 100.0 * share);
    text.push_str(&format!("closest to a singularity: determinant at {least:.1} % of home (limit {limit} %)\n"));
    text
}

/// For `--json`.
pub fn document(track: &Track) -> Value {
    let micro = |t: &Tally| json!({ "max": t.max * 1e6, "rms": t.rms() * 1e6 });
    let [before, after] = [&track.before, &track.after];
    let nearest = |n: &Option<Nearest>, unit: f64| {
        n.as_ref().map(|n| json!({ "left": n.room * unit, "number": n.which + 1, "line": n.line }))
    };
    json!({
        "points": track.points,
        "loaded_points": track.before[0].count,
        "error_before_um": micro(&before[0]),
        "error_after_um": micro(&after[0]),
        "axis_error_before_urad": micro(&before[1]),
        "axis_error_after_urad": micro(&after[1]),
        "error_at_midpoints_um": (track.at_midpoints.count > 0).then(|| micro(&track.at_midpoints)),
        "error_if_load_off_um": (track.load_off.count > 0).then(|| micro(&track.load_off)),
        "u95_um": (track.u95.count > 0).then(|| micro(&track.u95)),
        "unsure_points": track.unsure,
        "least_known_share": (track.u95.count > 0).then_some(track.least_known_share),
        "estimated_moves": track.estimated,
        "min_normalised_determinant": track.min_normalised_determinant(),
        "nearest_limits": {
            "travel_mm": nearest(&track.margins.travel, 1e3),
            "wrist_deg": nearest(&track.margins.wrist, 1_f64.to_degrees()),
            "determinant": nearest(&track.margins.determinant, 1.0),
            "box_share": nearest(&track.margins.extent, 1.0),
        },
        "extrapolated_points": track.extrapolated,
        "feeds_checked": track.feeds.as_ref().map_or(0, |feeds| feeds.held),
        "feeds_not_checked": track.feeds.as_ref().map_or(0, HeldFeeds::not_held),
        "too_fast": track.too_fast.iter().map(|t| json!({
            "line": t.line,
            "feed_per_min": t.feed_per_min,
            "allowed_per_min": t.allowed_per_min,
            "unit": t.unit,
        })).collect::<Vec<_>>(),
    })
}

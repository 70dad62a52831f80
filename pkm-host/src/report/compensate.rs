//! What came of a compensated path: pictures of the tip's error, the report, text and JSON.

use maud::html;
use serde_json::{Value, json};

use crate::error::Result;
use crate::plan::compensate::{LoadedPoint, Tally, Track};
use crate::plan::feed::TooFast;
use crate::report::page::{self, Finding, Page};
use crate::report::plot::{self, Mark, Panel, Series};

/// Lines of the program in the report's table.
const SHOWN: usize = 12;
/// A determinant below this many times the limit is a warning.
const NEAR: f64 = 1.5;

/// Of as many stretches of the path as a screen shows, the greatest value in µm over the way in mm.
fn along(track: &Track, name: &str, of: impl Fn(&LoadedPoint) -> f64) -> Series {
    const STRETCHES: usize = 250;
    let stretch = track.loaded.len().div_ceil(STRETCHES).max(1);
    let greatest = |part: &[LoadedPoint]| {
        let worst = part.iter().max_by(|a, b| of(a).abs().total_cmp(&of(b).abs()));
        worst.map(|p| (p.way_m * 1e3, of(p) * 1e6))
    };
    let points = track.loaded.chunks(stretch).filter_map(greatest).collect();
    Series { name: name.to_owned(), points, mark: Mark::Line }
}

fn errors(track: &Track) -> Panel {
    // residuals near zero are as intended
    let mut series =
        vec![along(track, "uncompensated", LoadedPoint::before), along(track, "compensated", |p| p.after_m)];
    if track.u95.count > 0 {
        series.push(along(track, "U95 of the prediction", |p| p.known.map_or(0.0, |known| known.u95_m)));
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
    let at = |p: &LoadedPoint| (p.tip_m[right] * 1e3, p.tip_m[up] * 1e3);
    let step = track.loaded.len().div_ceil(2000).max(1);
    let series = |name: &str, points: Vec<(f64, f64)>, mark| Series { name: name.to_owned(), points, mark };
    let worst = track.loaded.iter().max_by(|a, b| a.before().total_cmp(&b.before()));
    Panel {
        title: format!("tip under load, {} over {}", ["x", "y", "z"][up], ["x", "y", "z"][right]),
        x_label: name(right),
        y_label: name(up),
        series: vec![
            series("path", track.loaded.iter().step_by(step).map(at).collect(), Mark::Dot),
            series("greatest error", worst.map(at).into_iter().collect(), Mark::Cross),
        ],
    }
}

/// The lines with the greatest errors: line, way, and the greatest errors on it.
fn worst_lines(track: &Track) -> Vec<(String, Vec<String>)> {
    let mut lines: Vec<(LoadedPoint, f64)> = Vec::new();
    for p in &track.loaded {
        match lines.last_mut().filter(|(worst, _)| worst.line == p.line) {
            Some((worst, after)) => {
                *after = after.max(p.after_m);
                if p.before() > worst.before() {
                    *worst = *p;
                }
            }
            None => lines.push((*p, p.after_m)),
        }
    }
    lines.sort_by(|a, b| b.0.before().total_cmp(&a.0.before()));
    let row = |(p, after): &(LoadedPoint, f64)| {
        let [x, y, z] = p.tip_m.map(|m| format!("{:.3}", m * 1e3));
        let [dx, dy, dz] = p.before_m.map(|m| format!("{:.2}", m * 1e6));
        let sizes = [p.before(), *after].map(|m| format!("{:.3}", m * 1e6));
        (format!("line {}", p.line), [&[x, y, z, dx, dy, dz][..], &sizes].concat())
    };
    lines.iter().take(SHOWN).map(row).collect()
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

/// A warning where the expanded uncertainty exceeds what is compensated.
pub fn unsure(track: &Track) -> Option<String> {
    let share = track.loaded.iter().filter_map(|p| Some(p.known?.share)).fold(1.0, f64::min);
    (track.unsure > 0).then(|| {
        format!(
            "at {} of {} loaded points the expanded uncertainty exceeds the deflection; a controller that compensates what is \
             known would compensate {:.0} % there at least",
            track.unsure,
            track.loaded.len(),
            100.0 * share
        )
    })
}

/// What to think of it.
fn findings(track: &Track, limit: f64) -> Vec<Finding> {
    if track.loaded.is_empty() {
        return vec![Finding::warning("No load acts anywhere on the path: nothing was compensated.")];
    }
    let [before, after] = [&track.before[0], &track.after[0]].map(|t| t.max * 1e6);
    let mut all = vec![Finding::good(format!(
        "The load takes the tip {before:.1} µm from its path at most; with the new commands {after:.4} µm are left."
    ))];
    if track.extrapolated > 0 {
        let points = track.points;
        let text = format!(
            "{} of {points} points lie outside the table's box: what is compensated there is extrapolated.",
            track.extrapolated
        );
        all.insert(0, Finding::bad(text));
    }
    all.extend(known(track));
    let [least, limit] = [track.least_share, limit].map(|share| 100.0 * share);
    let text = format!(
        "Closest to a singularity the determinant is {least:.1} % of that at home; below {limit} % it is refused."
    );
    all.push(if least < NEAR * limit { Finding::warning(text) } else { Finding::good(text) });
    all.push(Finding::good(
        "All errors are what the model predicts: of the deflection under the stated load alone, with nothing of friction's \
         history, of the drives' following error or of thermal growth.",
    ));
    all
}

/// Lines that ask too much of a joint.
pub fn too_fast(track: &Track) -> Vec<String> {
    let line = |t: &TooFast| {
        let TooFast { line, feed_per_min, allowed_per_min, unit } = t;
        // down, so that what is written holds
        let allowed = (allowed_per_min * 10.0).floor() / 10.0;
        format!("line {line}: {feed_per_min} {unit} is too fast for a joint, {allowed} {unit} is within its limits")
    };
    track.too_fast.iter().map(line).collect()
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
        series: (0..3).map(|i| along(track, ["x", "y", "z"][i], move |p| p.before_m[i])).collect(),
    };
    let panels = [errors(track), components, view(track, [0, 1]), view(track, [0, 2])];
    let heads = ["x in mm", "y in mm", "z in mm", "dx in µm", "dy in µm", "dz in µm", "off in µm", "compensated in µm"];
    let body = html! {
        @if !track.loaded.is_empty() {
            h2 { "Error of the tip" }
            (page::charts("How far the load takes the tip from its path, and where, in the axes of B. Of each stretch the greatest.", &panels)?)
            h2 { "Lines" }
            (page::table(
                "The lines with the greatest error: where it is on each, what the load does there, and the greatest that is left on the line.",
                &heads,
                &worst_lines(track),
            ))
        }
    };
    let title = "Compensated tool path".to_owned();
    Ok(Page { title, findings: &findings(track, limit), warnings, body, facts: facts.to_vec() }.html())
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
    if track.halfway.count > 0 {
        text.push_str(&format!("of the tip at midpoints between points in µm: {}\n", micro(&track.halfway)));
    }
    if track.u95.count > 0 {
        text.push_str(&format!("expanded uncertainty U95 of the deflection in µm: {}\n", micro(&track.u95)));
    }
    if track.feeds > 0 {
        let lines = track.too_fast.len();
        text.push_str(&format!(
            "feed of {} moves held against the joints' limits: too fast in {lines} lines\n",
            track.feeds
        ));
    }
    let [least, limit] = [track.least_share, limit].map(|share| 100.0 * share);
    text.push_str(&format!("closest to a singularity: determinant at {least:.1} % of home (limit {limit} %)\n"));
    text
}

/// For `--json`.
pub fn document(track: &Track) -> Value {
    let micro = |t: &Tally| json!({ "max": t.max * 1e6, "rms": t.rms() * 1e6 });
    let [before, after] = [&track.before, &track.after];
    json!({
        "points": track.points,
        "loaded_points": track.loaded.len(),
        "error_before_um": micro(&before[0]),
        "error_after_um": micro(&after[0]),
        "axis_error_before_urad": micro(&before[1]),
        "axis_error_after_urad": micro(&after[1]),
        "error_halfway_um": (track.halfway.count > 0).then(|| micro(&track.halfway)),
        "u95_um": (track.u95.count > 0).then(|| micro(&track.u95)),
        "unsure_points": track.unsure,
        "min_home_share": track.least_share,
        "extrapolated_points": track.extrapolated,
        "feeds_checked": track.feeds,
        "too_fast": track.too_fast.iter().map(|t| json!({
            "line": t.line,
            "feed_per_min": t.feed_per_min,
            "allowed_per_min": t.allowed_per_min,
            "unit": t.unit,
        })).collect::<Vec<_>>(),
    })
}

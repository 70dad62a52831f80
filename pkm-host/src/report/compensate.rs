//! What came of a compensated path: the plot of the tip's error, text and JSON.

use serde_json::{Value, json};

use crate::error::Result;
use crate::plan::compensate::{Tally, Track};
use crate::report::plot::{self, Mark, Panel, Series};

/// Error of the tip along the way: of as many stretches as a screen shows, the greatest.
///
/// # Errors
/// What the drawing library says.
pub fn picture(track: &Track) -> Result<String> {
    const STRETCHES: usize = 250;
    let stretch = track.curve.len().div_ceil(STRETCHES).max(1);
    let series = |name: &str, column: usize| {
        let of = |part: &[[f64; 3]]| {
            let worst = part.iter().max_by(|a, b| a[column].total_cmp(&b[column]));
            worst.map(|p| (p[0] * 1e3, p[column] * 1e6))
        };
        let points = track.curve.chunks(stretch).filter_map(of).collect();
        Series { name: name.to_owned(), points, mark: Mark::Line }
    };
    // residuals near zero are as intended
    plot::panels(&[Panel {
        title: "error of the tip, as the model predicts it".to_owned(),
        x_label: "path length in mm".to_owned(),
        y_label: "µm".to_owned(),
        series: vec![series("uncompensated", 1), series("compensated", 2)],
    }])
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
    let [least, limit] = [track.least_share, limit].map(|share| 100.0 * share);
    text.push_str(&format!("closest to a singularity: determinant at {least:.1} % of home (limit {limit} %)\n"));
    text
}

/// For `--json`.
pub fn document(track: &Track) -> Value {
    let micro = |t: &Tally| json!({ "max": t.max * 1e6, "rms": t.rms() * 1e6 });
    let [before, after] = [&track.before, &track.after];
    json!({
        "points": track.points.iter().map(Vec::len).sum::<usize>(),
        "loaded_points": track.curve.len(),
        "error_before_um": micro(&before[0]),
        "error_after_um": micro(&after[0]),
        "axis_error_before_urad": micro(&before[1]),
        "axis_error_after_urad": micro(&after[1]),
        "error_halfway_um": (track.halfway.count > 0).then(|| micro(&track.halfway)),
        "min_home_share": track.least_share,
        "extrapolated_points": track.extrapolated,
    })
}

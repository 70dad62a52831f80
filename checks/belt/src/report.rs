//! A study as text and as JSON. Lengths are in mm here, and stretches in parts per thousand.

use std::fmt::Write;

use pkm_diagnosis::ForwardModel;
use pkm_diagnosis::places::{Finding, Rival};
use serde_json::{Value, json};

use crate::diagnosis::Diagnosis;
use crate::machine::{COORDINATE_NAMES, Effect};
use crate::model::{COMMON_SCALE, amplitude, effect};
use crate::study::{Prediction, Study, TL_Y, named};

/// Most places that a text lists beside the likeliest.
const MAX_RIVALS: usize = 2;

/// An amplitude in the unit of reports, with its unit.
fn unit(of: Effect) -> (f64, &'static str) {
    match of {
        Effect::Stretch(..) | Effect::Scale(_) => (1e3, "mm/m"),
        Effect::Yielding(..) | Effect::Zero(_) => (1e3, "mm"),
        Effect::Sag(_) => (1.0, "1/m²"),
    }
}

/// A finding in words: what, where, by which law, how much.
fn finding_text(diagnosis: &Diagnosis, finding: &Finding) -> String {
    let candidate = &diagnosis.model.candidates()[finding.block];
    let (scale, unit) = unit(effect(finding.block));
    let amount = diagnosis.after.value(&diagnosis.model, amplitude(finding.block));
    let amount = amount.map_or(String::new(), |(v, e)| format!(", {:.2} ± {:.2} {unit}", scale * v, scale * e));
    format!("{}{amount}", candidate.name())
}

fn run_text(diagnosis: &Diagnosis) -> String {
    let findings = &diagnosis.inferred.findings;
    if findings.is_empty() {
        return "nothing is missing".into();
    }
    let text = |f: &Finding| {
        let places: Vec<String> = f
            .rivals
            .iter()
            .take(1 + MAX_RIVALS)
            .map(|r| format!("{} {:.1} %", r.places.join(" and "), 100.0 * r.probability))
            .collect();
        let head = if named(f).is_some() { "named" } else { "not decided" };
        format!("{head}: {}\n    likeliest: {}", places.join(", "), finding_text(diagnosis, f))
    };
    findings.iter().map(text).collect::<Vec<_>>().join("\n  ")
}

fn prediction_text(p: &Prediction) -> String {
    let interval = p.interval_m.map_or(String::new(), |[l, h]| format!(" ({:.2} to {:.2})", 1e3 * l, 1e3 * h));
    format!("{:.2}{interval}", 1e3 * p.rms_m)
}

/// The whole study as text.
pub fn text(study: &Study) -> String {
    let mut out = String::new();
    let [before, after] = study.median_rms_m().map(|v| 1e3 * v);
    let runs = study.runs.len();
    line(&mut out, format!("{runs} runs, each diagnosed alone; it then predicts the {} others.", runs - 1));
    line(
        &mut out,
        format!("Rms of a condition of closure in runs that had no part, median: {before:.2} mm with identified"),
    );
    line(&mut out, format!("anchors alone, {after:.2} mm with the identified model."));
    for (n, run) in study.runs.iter().enumerate() {
        let (b, a) = (prediction_text(&run.before), prediction_text(&run.after));
        line(&mut out, format!("\nrun {}: others {b} -> {a} mm (95 % over places)", n + 1));
        line(&mut out, format!("  {}", run_text(&run.diagnosis)));
    }
    line(&mut out, format!("\nAll runs together:\n  {}", run_text(&study.together)));
    let levels = [&study.together.before, &study.together.after].map(|i| 1e3 * i.between_visits_m);
    let repeats = study.together.repeat_sd_m.map(|s| format!("{:.2}", 1e3 * s)).join(", ");
    line(
        &mut out,
        format!("  repeats of bl, br, tr, tl scatter by {repeats} mm; visits to a point by {:.1} mm", levels[1]),
    );
    line(&mut out, format!("  (by {:.1} mm with anchors alone, whose misfit counts as scatter then)", levels[0]));
    line(&mut out, "\nScatter of anchor coordinates over the runs (greatest less least), mm:".into());
    for (i, name) in COORDINATE_NAMES.iter().enumerate() {
        let [tool, anchors, found] = study.scatter_m(i).map(|v| 1e3 * v);
        line(
            &mut out,
            format!(
                "  {name}: {tool:.1} by the maker's tool, {anchors:.1} anchors alone, {found:.1} with the identified model"
            ),
        );
    }
    steps_text(&mut out, study);
    tension_text(&mut out, study);
    let hidden = hidden(&study.together);
    line(
        &mut out,
        "\nNot identifiable with these readings, as moved anchors do the same at any plausible size:".into(),
    );
    hidden.iter().for_each(|name| line(&mut out, format!("  {name}")));
    let left = 100.0 * study.together.common_scale_left;
    line(
        &mut out,
        format!("A common factor on all lengths scales the anchors: {left:.3} % of its signal is left then. An"),
    );
    line(&mut out, "independent length between two anchors would fix it.".into());
    out
}

fn line(out: &mut String, text: String) {
    // writing to a string cannot fail
    let _ = writeln!(out, "{text}");
}

/// The runs one by one.
fn steps_text(out: &mut String, study: &Study) {
    line(
        out,
        "\nRuns one by one: what a recursive fit knows after each, and a fit of all runs up to it at once in brackets."
            .into(),
    );
    line(
        out,
        "Rms of a condition of the run before it was seen, mm: recursive, at once, by the first run alone.".into(),
    );
    for (n, step) in study.steps.iter().enumerate() {
        let [own, batch] = step.stretch.map(|v| 1e3 * v);
        let [own_y, batch_y] = step.anchors.map(|a| 1e3 * a.coordinates_m[TL_Y]);
        let rms = step.predicted_m.map_or("–".to_owned(), |p| p.map(|v| format!("{:.2}", 1e3 * v)).join(", "));
        line(
            out,
            format!(
                "  run {}: {rms}; stretch {own:.2} ± {:.2} ({batch:.2}) mm/m, tl y {own_y:.1} ({batch_y:.1}) mm",
                n + 1,
                1e3 * step.stretch_error
            ),
        );
    }
}

fn tension_text(out: &mut String, study: &Study) {
    line(out, "\nTension test: by how much bl and br come out longer when slack, mm.".into());
    for slack in &study.tension {
        let [bl, br] = slack.read_m.map(|v| 1e3 * v);
        let [tr, tl] = slack.upper_read_m.map(|v| 1e3 * v);
        if slack.is_test {
            let mean = |v: [f64; 2]| 500.0 * (v[0] + v[1]);
            let [low, high] = slack.interval_m[0].map(|v| 1e3 * v);
            let (held, free) = (mean(slack.held_m), mean(slack.free_m));
            line(
                out,
                format!(
                    "  read {bl:.2}, {br:.2} (tr, tl: {tr:.2}, {tl:.2}); predicted {held:.1} if friction holds the sled, {free:.1} if it"
                ),
            );
            line(out, format!("  follows; 95 % interval of a reading over both: {low:.1} to {high:.1}"));
        } else {
            line(out, format!("  control, slack twice: read {bl:.2}, {br:.2}; predicted 0"));
        }
    }
}

/// Candidates that the readings cannot tell from other anchors.
fn hidden(diagnosis: &Diagnosis) -> Vec<String> {
    let candidates = diagnosis.model.candidates().iter().zip(&diagnosis.identifiable);
    candidates.filter(|(_, seen)| !**seen).map(|(c, _)| c.name()).collect()
}

fn diagnosis_json(diagnosis: &Diagnosis) -> Value {
    let place = |r: &Rival| json!({ "place": r.places.join(" and "), "probability": r.probability });
    let findings = diagnosis.inferred.findings.iter().map(|f| {
        let (scale, unit) = unit(effect(f.block));
        let value = diagnosis.after.value(&diagnosis.model, amplitude(f.block));
        json!({
            "named": named(f),
            "candidate": diagnosis.model.candidates()[f.block].name(),
            "ln_gain": f.gain,
            "places": f.rivals.iter().map(place).collect::<Vec<_>>(),
            "amplitude": value.map(|v| scale * v.0),
            "standard_error": value.map(|v| scale * v.1),
            "unit": unit,
        })
    });
    let alternatives = diagnosis.inferred.alternatives.iter().map(|(blocks, p)| {
        let names: Vec<String> = blocks.iter().map(|b| diagnosis.model.candidates()[*b].name()).collect();
        json!({ "candidates": names, "probability": p })
    });
    let anchors = |c: [f64; COORDINATE_NAMES.len()]| -> Value {
        COORDINATE_NAMES.iter().zip(c).map(|(name, v)| ((*name).to_owned(), json!(1e3 * v))).collect()
    };
    json!({
        "findings": findings.collect::<Vec<_>>(),
        "alternatives": alternatives.collect::<Vec<_>>(),
        "reduced_chi2": diagnosis.inferred.reduced_chi2,
        "repeat_sd_mm": diagnosis.repeat_sd_m.map(|s| 1e3 * s),
        "between_visits_mm": {
            "anchors_alone": 1e3 * diagnosis.before.between_visits_m, "found": 1e3 * diagnosis.after.between_visits_m,
        },
        "anchors_mm": {
            "tool": anchors(diagnosis.model.anchors().coordinates_m),
            "anchors_alone": anchors(diagnosis.before.machine.anchors.coordinates_m),
            "found": anchors(diagnosis.after.machine.anchors.coordinates_m),
        },
        "not_identifiable": hidden(diagnosis),
        "common_scale_identifiable": diagnosis.identifiable[COMMON_SCALE],
        "common_scale_signal_left": diagnosis.common_scale_left,
    })
}

/// The whole study as one JSON document.
pub fn json(study: &Study) -> Value {
    let prediction = |p: &Prediction| {
        json!({
            "rms_mm": 1e3 * p.rms_m,
            "interval_95_mm": p.interval_m.map(|i| i.map(|v| 1e3 * v)),
            "by_run_mm": p.by_run_m.iter().map(|v| 1e3 * v).collect::<Vec<_>>(),
        })
    };
    let runs = study.runs.iter().map(|r| {
        let mut run = diagnosis_json(&r.diagnosis);
        run["others"] = json!({ "anchors_alone": prediction(&r.before), "found": prediction(&r.after) });
        run
    });
    let tension = study.tension.iter().map(|s| {
        json!({
            "test": s.is_test,
            "read_mm": s.read_m.map(|v| 1e3 * v),
            "upper_read_mm": s.upper_read_m.map(|v| 1e3 * v),
            "predicted_held_mm": s.held_m.map(|v| 1e3 * v),
            "predicted_free_mm": s.free_m.map(|v| 1e3 * v),
            "interval_95_mm": s.interval_m.map(|i| i.map(|v| 1e3 * v)),
        })
    });
    let steps = study.steps.iter().map(|s| {
        json!({
            "anchors_mm": s.anchors.map(|a| a.coordinates_m.map(|v| 1e3 * v)),
            "stretch_mm_per_m": s.stretch.map(|v| 1e3 * v),
            "stretch_standard_error": 1e3 * s.stretch_error,
            "predicted_rms_mm": s.predicted_m.map(|p| p.map(|v| 1e3 * v)),
        })
    });
    let [before, after] = study.median_rms_m().map(|v| 1e3 * v);
    let [tool, anchors, found] = study.scatter_m(TL_Y).map(|v| 1e3 * v);
    json!({
        "median_rms_mm": { "anchors_alone": before, "found": after },
        "tl_y_range_mm": { "tool": tool, "anchors_alone": anchors, "found": found },
        "runs": runs.collect::<Vec<_>>(),
        "together": diagnosis_json(&study.together),
        "tension": tension.collect::<Vec<_>>(),
        "one_by_one": steps.collect::<Vec<_>>(),
    })
}

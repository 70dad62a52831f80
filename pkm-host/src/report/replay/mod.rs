//! What came of a replayed log: the report, text and JSON.

mod findings;

use maud::html;
use pkm_core::K95;
use pkm_core::estimation::{Alarm, AmplitudeSettings, Refusal};
use pkm_diagnosis::robust::upper_median;
use serde_json::{Value, json};

use self::findings::{advice, findings, said};
use crate::diagnose::{self, Diagnosis};
use crate::error::Result;
use crate::files::dataset::{POINT_COLUMNS, POSE_COLUMNS, WRENCH_COLUMNS, pose_cells, to_csv};
use crate::files::learn::{named, units};
use crate::files::log::TIME_COLUMN;
use crate::page::plot::{Mark, Panel, Series};
use crate::page::{self, Page};
use crate::pose::{tidy, written_units};
use crate::replay::{BATCH, LogDiagnosis, Proposal, Replay, Step};

/// Points of a curve, at most.
const POINTS: usize = 400;
const DAY_S: f64 = 86_400.0;
/// Of all charts.
const DAYS: &str = "days since the first reading";
/// So many times the usual interval may be as wide as what a chart of values shows, or the first one would flatten the curve.
const MAX_INTERVAL_RATIO: f64 = 3.0;

/// As in `--json`.
fn code(refusal: &Refusal) -> &'static str {
    match refusal {
        Refusal::NotFinite => "not_finite",
        Refusal::Components => "components",
        Refusal::Backwards => "backwards",
        Refusal::NotExcited => "not_excited",
        Refusal::Stuck => "stuck",
        Refusal::WrongSign => "wrong_sign",
        Refusal::Unexpected => "unexpected",
        _ => "model",
    }
}

fn days(replay: &Replay, step: usize) -> f64 {
    let first = replay.steps.first().map_or(0, |step| step.time_s);
    (f64::from(replay.steps[step].time_s) - f64::from(first)) / DAY_S
}

/// Mean and band of each amplitude over time.
fn curves(replay: &Replay) -> Vec<Panel> {
    let stride = replay.steps.len().div_ceil(POINTS).max(1);
    let curve = |n: usize, k: f64, scale: f64| -> Vec<(f64, f64)> {
        (replay.steps.iter().enumerate().step_by(stride))
            // between readings that were taken in drift widens the band
            .filter(|(i, step)| *i == 0 || step.outcome.is_ok())
            .map(|(i, step)| (days(replay, i), step.values[n]))
            // what drift has made of it since the last reading that was taken in
            .chain(at_end(replay).map(|values| (days(replay, replay.steps.len() - 1), values[n])))
            .map(|(day, (best, deviation))| (day, scale * (best + k * deviation)))
            .collect()
    };
    let panel = |(n, own): (usize, &AmplitudeSettings)| {
        let (_, unit, scale) = units(own.amplitude);
        let best = curve(n, 0.0, scale);
        let mut widths: Vec<f64> = replay.steps.iter().map(|step| scale * K95 * step.values[n].1).collect();
        let room = MAX_INTERVAL_RATIO * upper_median(&mut widths).unwrap_or(0.0);
        let reach = |sign: f64| best.iter().map(|(_, value)| sign * value).fold(f64::NEG_INFINITY, f64::max) + room;
        let (low, high) = (-reach(-1.0), reach(1.0));
        let edge = |k: f64| curve(n, k, scale).into_iter().map(move |(day, value)| (day, value.clamp(low, high)));
        let band: Vec<_> = edge(-K95).chain(edge(K95).rev()).collect();
        Panel {
            title: named(own.amplitude),
            x_label: DAYS.to_owned(),
            y_label: unit.to_owned(),
            series: vec![
                Series { name: "95 % interval".to_owned(), points: band, mark: Mark::Band },
                Series { name: "best value".to_owned(), points: best, mark: Mark::Line },
            ],
        }
    };
    replay.learn.amplitudes.iter().enumerate().map(panel).collect()
}

fn innovations(replay: &Replay) -> Panel {
    let taken = replay.steps.iter().enumerate().filter_map(|(i, step)| Some((days(replay, i), step.outcome.ok()?)));
    Panel {
        title: "χ² of each reading over its components: 1 on average".to_owned(),
        x_label: DAYS.to_owned(),
        y_label: "χ² over components".to_owned(),
        series: vec![Series { name: "readings".to_owned(), points: taken.collect(), mark: Mark::Dot }],
    }
}

/// Readings that the estimator learned from.
fn taken_in(replay: &Replay) -> usize {
    replay.steps.iter().filter(|step| step.outcome.is_ok()).count()
}

/// Readings in the fit.
fn fitted(replay: &Replay) -> usize {
    taken_in(replay).min(BATCH)
}

/// Lines of readings that were taken in outside the table's box.
fn outside_box(replay: &Replay) -> Vec<u64> {
    replay.steps.iter().filter(|step| step.outside_box).map(|step| step.line).collect()
}

/// What is known of the amplitudes at the log's last row; `None` of a log without rows.
fn at_end(replay: &Replay) -> Option<Vec<(f64, f64)>> {
    let last = replay.steps.last()?;
    Some(last.values.iter().zip(&replay.age.deviations).map(|((best, _), deviation)| (*best, *deviation)).collect())
}

/// Readings that were refused, by code.
fn refusals(steps: &[Step]) -> Vec<(&'static str, usize)> {
    let mut counts: Vec<(&'static str, usize)> = Vec::new();
    for refusal in steps.iter().filter_map(|step| step.outcome.as_ref().err()) {
        match counts.iter_mut().find(|(name, _)| *name == code(refusal)) {
            Some((_, count)) => *count += 1,
            None => counts.push((code(refusal), 1)),
        }
    }
    counts
}

/// Share of the variance before anything was read that is left: 1 where nothing that was touched tells anything.
fn variance_left(own: &AmplitudeSettings, (_, deviation): &(f64, f64)) -> f64 {
    (deviation / own.deviation).powi(2)
}

fn rows(replay: &Replay) -> Vec<(String, Vec<String>)> {
    let (Some(last), Some(values)) = (replay.steps.last(), at_end(replay)) else { return Vec::new() };
    let own = replay.learn.amplitudes.iter().zip(&values);
    let row = |(n, (own, value)): (usize, (&AmplitudeSettings, &(f64, f64)))| {
        let (_, unit, scale) = units(own.amplitude);
        let written = |(value, deviation): (f64, f64)| format!("{:.3} ± {:.3}", scale * value, scale * K95 * deviation);
        let batch = replay.batch.as_ref().map_or("–".to_owned(), |batch| written(batch[n]));
        let left = format!("{:.2} %", 100.0 * variance_left(own, &last.values[n]));
        (named(own.amplitude), vec![unit.to_owned(), written(*value), batch, left, format!("{:.3}", scale * own.alarm)])
    };
    own.enumerate().map(row).collect()
}

fn next_rows(replay: &Replay) -> Vec<(String, Vec<String>)> {
    let row = |(n, p): (usize, &Proposal)| {
        let force = <[f64; 3]>::from(p.force_n).map(|part| part.to_string()).join(", ");
        let left: Vec<_> = p.variance_left.iter().map(|share| format!("{:.2}", 100.0 * share)).collect();
        let cells = pose_cells(&p.pose).into_iter().chain([force, left.join(", ")]);
        (format!("N{:02}", n + 1), cells.collect())
    };
    replay.next.iter().enumerate().map(row).collect()
}

/// What to probe next, as a log whose times and readings are still to be written: all that `probe` of the line protocol asks for.
pub fn next_csv(replay: &Replay) -> String {
    let header = [TIME_COLUMN, POSE_COLUMNS[0], POSE_COLUMNS[1], POSE_COLUMNS[2], POSE_COLUMNS[3]].into_iter();
    let read = ["dx_um", "dy_um", "dz_um", "sigma_linear_um"];
    let header = header.chain(POINT_COLUMNS).chain(WRENCH_COLUMNS).chain(read).map(str::to_owned);
    let row = |(n, p): (usize, &Proposal)| {
        let mut row = vec![String::new(), format!("N{:02}", n + 1)];
        row.extend(pose_cells(&p.pose));
        row.extend(p.tip_m.iter().map(|m| tidy(m * 1e3).to_string()));
        row.extend(p.force_n.iter().map(f64::to_string).chain(["0", "0", "0", "", "", ""].map(str::to_owned)));
        row.push(tidy(p.deviation_m * 1e6).to_string());
        row
    };
    to_csv(b',', &header.collect::<Vec<_>>(), replay.next.iter().enumerate().map(row))
}

/// Of which readings a diagnosis speaks.
fn of_which(diagnosed: &LogDiagnosis) -> String {
    let LogDiagnosis { from_line, readings, .. } = diagnosed;
    format!(
        "Of the {readings} readings that were taken in from line {from_line} on, held against the machine file alone. They stand in readings.csv, \
         of which diagnose makes a report of its own, with what to measure next."
    )
}

/// What it says.
fn diagnosis_said(diagnosed: &LogDiagnosis) -> Vec<String> {
    match &diagnosed.outcome {
        Ok(diagnosis) => diagnose::sentences::findings(diagnosis).into_iter().map(|finding| finding.text).collect(),
        Err(failure) => vec![format!("No diagnosis: {}.", failure.message)],
    }
}

/// The report.
///
/// # Errors
/// What the drawing library says.
pub fn html(replay: &Replay, facts: &[(&str, String)], warnings: &[String]) -> Result<String> {
    let refused: Vec<_> =
        refusals(&replay.steps).into_iter().map(|(n, count)| (n.to_owned(), vec![count.to_string()])).collect();
    let alarms: Vec<_> =
        replay.raised().map(|(step, alarm)| (format!("line {}", step.line), vec![said(replay, alarm)])).collect();
    let fit = format!("fit of the last {}, 95 %", fitted(replay));
    let body = html! {
        h2 { "What was learned" }
        (page::charts("Best value of each amplitude, reading by reading, and where it is with a probability of 95 %, as far as the chart goes.", &curves(replay))?)
        (page::table("At the end of the log, beside one fit of many readings, which averages over a change where the estimator follows it. Variance left: of what was unknown before the first reading. Worth an alarm: a change since acceptance by more, where it is proven.",
            &["unit", "estimator, 95 %", &fit, "variance left", "worth an alarm"], &rows(replay)))
        h2 { "Readings" }
        (page::charts("How far each reading that was taken in was from what was expected of it, in noise variances.", &[innovations(replay)])?)
        @if !refused.is_empty() { (page::table("Readings that were refused. None of them has moved an amplitude.", &["readings"], &refused)) }
        @if !alarms.is_empty() { (page::table("Alarms, each where it was raised.", &["alarm"], &alarms)) }
        @if let Some(diagnosed) = &replay.diagnosed {
            h2 { "What a diagnosis says" }
            p { (of_which(diagnosed)) }
            ul { @for said in diagnosis_said(diagnosed) { li { (said) } } }
        }
        @if !replay.next.is_empty() {
            h2 { "Where to probe next" }
            (page::table(
                "Each is what tells most after those before it. Variance left: of each amplitude the share of what was unknown before the first reading.",
                &["θ in °", "σ in °", "Z0 in mm", "force along u, v, w in N", "variance left in %"],
                &next_rows(replay),
            ))
        }
    };
    let title = "What a controller would have learned".to_owned();
    let mut findings = findings(replay);
    findings.extend(advice(replay));
    Ok(Page { title, findings: &findings, warnings, body, facts: facts.to_vec() }.html())
}

/// For the terminal.
pub fn text(replay: &Replay) -> String {
    let mut text: String = findings(replay).into_iter().map(|finding| format!("{}\n", finding.text)).collect();
    let fitted = fitted(replay);
    for (name, cells) in rows(replay) {
        text.push_str(&format!(
            "  {name}: {} {} (fit of the last {fitted}: {}), {} of its variance left\n",
            cells[1], cells[0], cells[2], cells[3]
        ));
    }
    for (name, cells) in next_rows(replay) {
        let [theta, sigma, z0, force, left] = [0, 1, 2, 3, 4].map(|n| &cells[n]);
        text.push_str(&format!(
            "  probe {name} at θ {theta}°, σ {sigma}°, Z0 {z0} mm under {force} N: leaves {left} % of the variances\n"
        ));
    }
    if let Some(diagnosed) = &replay.diagnosed {
        text.push_str(&format!("A diagnosis. {}\n", of_which(diagnosed)));
        text.extend(diagnosis_said(diagnosed).iter().map(|said| format!("  - {said}\n")));
    }
    for (name, count) in refusals(&replay.steps) {
        text.push_str(&format!("  refused as {name}: {count}\n"));
    }
    text
}

/// What was known after each reading, as CSV: values, deviations and what is compensated in the amplitudes' units, alarms by the amplitudes'
/// numbers from 1.
pub fn steps_csv(replay: &Replay) -> String {
    let mut header = ["line", TIME_COLUMN, "status", "chi_squared", "changed", "alarms"].map(str::to_owned).to_vec();
    let numbers = 1..=replay.learn.amplitudes.len();
    header.extend(numbers.clone().flat_map(|n| [format!("value_{n}"), format!("deviation_{n}")]));
    header.extend(numbers.map(|n| format!("compensated_{n}")));
    let rows = replay.steps.iter().map(|step| {
        let status = step.outcome.as_ref().map_or_else(code, |_| "taken");
        let chi_squared = step.outcome.as_ref().map_or(String::new(), f64::to_string);
        let alarms = step.alarms.iter().map(|(n, _)| (n + 1).to_string()).collect::<Vec<_>>().join(" ");
        let mut row = vec![step.line.to_string(), step.time_s.to_string(), status.to_owned(), chi_squared];
        row.extend([u8::from(step.changed).to_string(), alarms]);
        row.extend(step.values.iter().flat_map(|(value, deviation)| [value.to_string(), deviation.to_string()]));
        row.extend(step.compensated.iter().map(f64::to_string));
        row
    });
    to_csv(b',', &header, rows)
}

fn alarm_json(replay: &Replay, (n, alarm): &(usize, Alarm)) -> Value {
    let amplitude = replay.learn.amplitudes[*n].amplitude;
    json!({
        "amplitude": named(amplitude), "unit": units(amplitude).0, "change": alarm.change, "deviation": alarm.deviation,
        "probability": alarm.probability, "readings": alarm.readings,
    })
}

/// Of the diagnosis' own document what was found.
fn diagnosis_json(diagnosed: &LogDiagnosis) -> Value {
    let mut found = diagnosed.outcome.as_ref().map_or(Value::Null, Diagnosis::to_json);
    json!({
        "from_line": diagnosed.from_line, "readings": diagnosed.readings,
        "refused": diagnosed.outcome.as_ref().err().map(|failure| &failure.message),
        "verdict": found["verdict"].take(), "effects": found["effects"].take(),
        "declared_value_findings": found["declared_value_findings"].take(), "inspect": found["condition"]["inspect"].take(),
    })
}

/// For `--json`, and `replay.json`.
pub fn document(replay: &Replay) -> Value {
    let last = replay.steps.last();
    let amplitudes: Vec<Value> = (replay.learn.amplitudes.iter().enumerate())
        .map(|(n, own)| {
            let value = last.map(|step| step.values[n]);
            json!({
                "amplitude": named(own.amplitude), "unit": units(own.amplitude).0, "accepted": own.accepted,
                "value": value.map(|v| v.0), "deviation": value.map(|v| v.1),
                "compensated": last.map(|step| step.compensated[n]),
                "deviation_at_end": last.map(|_| replay.age.deviations[n]),
                "variance_left": value.map(|v| variance_left(own, &v)),
                "batch_value": replay.batch.as_ref().map(|b| b[n].0),
                "batch_deviation": replay.batch.as_ref().map(|b| b[n].1),
                "settings": {
                    "deviation": own.deviation, "drift_per_day": own.drift_per_day, "least": own.least, "most": own.most,
                    "rate_per_s": own.rate_per_s, "alarm": own.alarm,
                },
            })
        })
        .collect();
    let refused: Vec<Value> = (replay.steps.iter())
        .filter_map(|step| Some(json!({ "line": step.line, "code": code(step.outcome.as_ref().err()?) })))
        .collect();
    let days = |age_s: u32| (taken_in(replay) > 0).then(|| f64::from(age_s) / DAY_S);
    let raised = replay.raised().map(|(step, alarm)| {
        let mut alarm = alarm_json(replay, alarm);
        alarm["line"] = json!(step.line);
        alarm
    });
    json!({
        "readings": replay.steps.len(),
        "taken": taken_in(replay),
        "model_share": replay.learn.model_share,
        "days_since_first": days(replay.age.since_first_s),
        "days_since_last": days(replay.age.since_last_s),
        "changes_at_lines": replay.steps.iter().filter(|step| step.changed).map(|step| step.line).collect::<Vec<_>>(),
        "outside_box_at_lines": outside_box(replay),
        "amplitudes": amplitudes,
        "alarms": raised.collect::<Vec<_>>(),
        "standing": replay.standing().iter().map(|alarm| alarm_json(replay, alarm)).collect::<Vec<_>>(),
        "refused": refused,
        "diagnosis": replay.diagnosed.as_ref().map(diagnosis_json),
        "next": replay.next.iter().map(|p| json!({
            "pose": written_units(&p.pose), "force_n": <[f64; 3]>::from(p.force_n), "variance_left": p.variance_left,
        })).collect::<Vec<_>>(),
    })
}

//! What people read after a fit: tables like the paper's 3 and 4, and `report.html`.

pub(super) mod findings;
mod over_pose;

use std::fmt::Write;

use maud::{Markup, html};
use pkm_core::correction::EQ_11;

use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::fit::export::Provenance;
use crate::fit::{DeflectionError, DeflectionErrors, Evaluation, Fit};
use crate::page::plot::{self, Bar};
use crate::page::{Page, on_screen, picture, table};
use crate::pose::ROTATION_ARM_M;
use crate::report::paper;
use findings::{advice, conclusion, poses};
use over_pose::over_pose;
use serde_json::{Value, json};

pub(super) const STIFFNESSES: [&str; 6] = ["11", "22", "33", "44", "55", "66"];
const LOADS: [&str; 6] = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"];
const SYMBOLS: [&str; 3] = ["θ", "σ", "Z0"];

/// A number with its digits; a dash for the standard deviation of a single pose, which there is not.
pub(super) fn figure(value: f64, digits: usize) -> String {
    if value.is_nan() { "–".to_owned() } else { format!("{value:.digits$}") }
}

/// Tables for the terminal.
pub fn summary(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> String {
    let mut text = String::new();
    let mut line = |label: &str, cells: [String; 6]| {
        let cells = cells.map(|c| format!(" {c:>9}")).concat();
        let _ = writeln!(text, "  {label:<36}{cells}");
    };
    let numbers = |values: &[f64; 6], digits: usize| values.map(|v| figure(v, digits));
    for (name, e) in [("training", Some(trained)), ("verification", verified)] {
        let Some(e) = e else { continue };
        line(&format!("{name}, {}", poses(e.poses)), STIFFNESSES.map(|s| format!("k{s}")));
        line("error of K_p in %, mean", numbers(&e.basic.re_percent.mean, 2));
        let re = &e.improved.re_percent;
        line("error of the diagonal form in %, mean", numbers(&re.mean, 2));
        line("  standard deviation", numbers(&re.stdev, 2));
        line("  max", numbers(&re.max, 2));
        line("  min", numbers(&re.min, 2));
        if let Some(f) = &e.factor {
            line("error of the factor form in %, mean", numbers(&f.re_percent.mean, 2));
        }
        line("correction effect me, mean", numbers(&e.improved.me.statistics.mean, 3));
        for (i, band) in ["≥ 0.9", "0.6-0.9", "0-0.6", "< 0"].iter().enumerate() {
            line(&format!("  poses with me {band}"), e.improved.me.bands.map(|b| b[i].to_string()));
        }
        for (place, errors) in [("at A", &e.deflection_percent), ("at the tip", &e.tip_deflection_percent)] {
            if errors.basic.is_some() {
                line(&format!("deflection error {place} in % under"), LOADS.map(str::to_owned));
            }
            for (name, errors) in forms(errors) {
                line(&format!("  {name}, mean"), numbers(&errors, 2));
            }
        }
    }
    let _ = writeln!(text, "  {} terms, condition number of the fit {:.1}", fit.numbers.terms.len(), fit.condition);
    for finding in conclusion(fit, trained, verified) {
        let _ = writeln!(text, "- {}", finding.text);
    }
    text
}

/// Deflection errors of the models that there are.
fn models(d: &DeflectionErrors) -> Vec<(&'static str, &DeflectionError)> {
    let all = [
        ("K_p", &d.basic),
        ("Eq. 10 as published", &d.diagonal_literal),
        ("diagonal form", &d.diagonal),
        ("factor form", &d.factor),
    ];
    all.into_iter().filter_map(|(name, e)| Some((name, e.as_ref()?))).collect()
}

/// The mean ones.
fn forms(d: &DeflectionErrors) -> Vec<(&'static str, [f64; 6])> {
    models(d).into_iter().map(|(name, e)| (name, e.mean)).collect()
}

/// `with_effect`: the correction effect too, where no table of the paper's stands beside it.
fn error_tables(trained: &Evaluation, verified: Option<&Evaluation>, with_effect: bool) -> Markup {
    let sets =
        || [("training", Some(trained)), ("verification", verified)].into_iter().filter_map(|(n, e)| Some((n, e?)));
    let cells = |values: &[f64; 6], digits: usize| values.map(|v| figure(v, digits)).to_vec();
    let mut effect = Vec::new();
    let mut error = Vec::new();
    let mut load = Vec::new();
    for (set, e) in sets() {
        let me = &e.improved.me;
        for (name, values) in [
            ("mean", &me.statistics.mean),
            ("stdev", &me.statistics.stdev),
            ("max", &me.statistics.max),
            ("min", &me.statistics.min),
        ] {
            effect.push((format!("{set}: {name}"), cells(values, 3)));
        }
        let bands = me.bands.map(|b| b.map(|n| n.to_string()).join(" / ")).to_vec();
        effect.push((format!("{set}: poses ≥ 0.9 / 0.6-0.9 / 0-0.6 / < 0"), bands));
        let models = [("K_p", Some(&e.basic.re_percent)), ("diagonal form", Some(&e.improved.re_percent))];
        for (model, s) in models.into_iter().chain([("factor form", e.factor.as_ref().map(|f| &f.re_percent))]) {
            let Some(s) = s else { continue };
            for (name, values) in [("mean", &s.mean), ("stdev", &s.stdev), ("max", &s.max), ("min", &s.min)] {
                error.push((format!("{set}, {model}: {name}"), cells(values, 2)));
            }
        }
        for (place, errors) in [("A", &e.deflection_percent), ("tip", &e.tip_deflection_percent)] {
            let row = |(n, v): (&str, [f64; 6])| (format!("{set}, at {place}, {n}: mean"), cells(&v, 2));
            load.extend(forms(errors).into_iter().map(row));
        }
    }
    let heads = STIFFNESSES.map(|s| format!("k{s}"));
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let deflections = format!(
        "Deflection error in % under the six unit loads at A and at the tool's tip (wrist joints at 0), rotations times \
         {ROTATION_ARM_M} m"
    );
    html! {
        @if !load.is_empty() { (table(&deflections, &LOADS, &load)) }
        (table("Relative error of principal stiffnesses in % (paper, Table 4, Eq. 14)", &heads, &error))
        @if with_effect {
            (table(
                "Correction effect me of the diagonal form (paper, Table 3, Eq. 13 with absolute values)",
                &heads,
                &effect,
            ))
        }
    }
}

fn coefficient_tables(fit: &Fit) -> Markup {
    let names = |t: &[u8; 3]| {
        let mut name = String::new();
        for (symbol, n) in SYMBOLS.iter().zip(t) {
            match n {
                0 => {}
                1 => name.push_str(symbol),
                n => name.push_str(&format!("{symbol}^{n}")),
            }
            if *n > 0 {
                name.push(' ');
            }
        }
        if name.is_empty() { "1".to_owned() } else { name.trim_end().to_owned() }
    };
    let heads: Vec<String> = fit.numbers.terms.iter().map(names).collect();
    let heads: Vec<&str> = heads.iter().map(String::as_str).collect();
    let rows: Vec<(String, Vec<String>)> = fit
        .polynomials
        .iter()
        .map(|p| {
            let cell = |((c, e), used): ((&f64, &f64), &bool)| {
                if *used { format!("{c:.4e} ± {e:.0e}") } else { "-".to_owned() }
            };
            let cells = p.coefficients.iter().zip(&p.standard_errors).zip(&p.used).map(cell).collect();
            (p.name.clone(), cells)
        })
        .collect();
    let paper_heads = EQ_11.map(|t| names(&t));
    let paper_rows: Vec<_> =
        (1..).zip(fit.paper_e).map(|(i, row)| (format!("e{i}j"), row.map(|v| format!("{v:.6e}")).to_vec())).collect();
    let left_out: Vec<_> = fit
        .polynomials
        .iter()
        .map(|p| {
            let gain = 100.0 * (1.0 - p.loo_rms / p.paper_loo_rms);
            let cells = vec![
                p.used.iter().filter(|u| **u).count().to_string(),
                format!("{:.2e}", p.loo_rms),
                format!("{:.2e}", p.paper_loo_rms),
                format!("{gain:.0} %"),
            ];
            (p.name.clone(), cells)
        })
        .collect();
    html! {
        (table(
            "Leave-one-out error of each polynomial on the training poses (rms), and what its terms gain over the paper's",
            &["terms", "rms", "rms with the paper's terms", "gain"],
            &left_out,
        ))
        (table("Coefficients in scaled variables, ± one standard error", &heads, &rows))
        (table(
            "The paper's e_ij of Eq. 11 in ° and mm (with selected terms: those of Eq. 12 on the same data)",
            &paper_heads.each_ref().map(String::as_str),
            &paper_rows,
        ))
    }
}

/// `fit.json`, but for its warnings.
pub fn document(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> Value {
    let polynomials: Vec<Value> = fit
        .polynomials
        .iter()
        .map(|p| {
            let terms: Vec<_> =
                fit.numbers.terms.iter().zip(&p.used).filter_map(|(t, used)| used.then_some(*t)).collect();
            json!({
                "name": p.name,
                "terms": terms,
                "coefficients": p.coefficients,
                "standard_errors": p.standard_errors,
                "leave_one_out_rms": p.loo_rms,
                "leave_one_out_rms_paper_terms": p.paper_loo_rms,
            })
        })
        .collect();
    json!({
        "train": trained,
        "verify": verified,
        "condition": fit.condition,
        "terms": fit.numbers.terms,
        "term_choice": fit.choice.name(),
        "selected": polynomials,
    })
}

/// `report.html`.
///
/// # Errors
/// What the drawing library says.
pub fn html(p: &Provenance<'_>, fit: &Fit, warnings: &[String]) -> Result<String> {
    let (shown, on) = match p.verified {
        Some(v) => (v, "verification"),
        None => (p.training, "training"),
    };
    let bar = |e: &DeflectionError, i: usize| Bar { value: Some(e.mean[i]), interval: Some([e.mean[i], e.max[i]]) };
    let bars: Vec<(&str, Vec<Bar>)> = models(&shown.deflection_percent)
        .into_iter()
        .map(|(name, e)| (name, (0..6).map(|i| bar(e, i)).collect()))
        .collect();
    let file = MachineFile::read(None)?;
    // the paper's machine, and the data that stand beside the paper's
    let of_the_paper = p.file.machine_sha256 == file.source.sha256()
        && p.file.data_sha256 == Source::embedded(pkm_fixtures::TRAINING).sha256();
    let body = html! {
        @if !bars.is_empty() {
            @let title = format!("Deflection error under unit loads, {on} poses, mean");
            (picture(
                "How wrong each model is about the deflection of A under a force or moment along each axis: lower is better. The line goes up to the \
                 error at the worst pose.",
                &plot::bars(&title, "error in %", &LOADS, &bars)?,
            ))
        }
        h2 { "Errors" }
        (error_tables(p.training, p.verified, !of_the_paper))
        @if of_the_paper {
            h2 { "Beside the paper's printed values" }
            (paper::compared(fit, &file, p.training, p.verified)?)
        }
        h2 { "Over the pose" }
        (over_pose(fit)?)
        h2 { "Coefficients" }
        (on_screen("All terms of all polynomials", "coefficients.json and fit.json", &coefficient_tables(fit)))
    };
    let [theta, sigma, z0] = fit.extent.ranges();
    let facts = vec![
        ("Command", p.command.to_owned()),
        ("Machine file, SHA-256", p.file.machine_sha256.clone()),
        ("Data", format!("{}, {} poses, SHA-256 {}", p.file.data, p.poses, p.file.data_sha256)),
        ("Verification", p.verification.map_or("none".into(), |(name, sha)| format!("{name}, SHA-256 {sha}"))),
        ("Box, outside which the controller gets a status", format!("θ {theta:?}°, σ {sigma:?}°, Z0 {z0:?} mm")),
        ("Condition number of the fit", format!("{:.1}", fit.condition)),
    ];
    let mut findings = conclusion(fit, p.training, p.verified);
    findings.extend(advice(fit, p.training, p.verified, findings[0].state));
    Ok(Page { title: format!("Stiffness table of {}", p.file.machine), findings: &findings, warnings, body, facts }
        .html())
}

//! What people read after a fit: tables like the paper's 3 and 4, and `report.html`.

use std::collections::BTreeMap;
use std::fmt::Write;

use maud::{Markup, html};
use pkm_core::correction::EQ_11;

use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::fit::export::Provenance;
use crate::fit::{DeflectionError, DeflectionErrors, Evaluation, Fit, Sample, TermChoice};
use crate::page::plot::{self, Bar, Mark, Panel, Series};
use crate::page::{Finding, Page, State, charts, fold, on_screen, picture, table};
use crate::pose::{ROTATION_ARM_M, file_units};
use crate::report::paper;
use serde_json::{Value, json};

/// A mean error that a model of the stiffness may have where it is used, %.
pub(crate) const USABLE_PERCENT: f64 = 5.0;
pub(super) const STIFFNESSES: [&str; 6] = ["11", "22", "33", "44", "55", "66"];
const LOADS: [&str; 6] = ["Fx", "Fy", "Fz", "Mx", "My", "Mz"];
const SYMBOLS: [&str; 3] = ["θ", "σ", "Z0"];
const VARIABLES: [&str; 3] = ["θ in °", "σ in °", "Z0 in mm"];

/// Tables for the terminal.
pub fn summary(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> String {
    let mut text = String::new();
    let mut line = |label: &str, cells: [String; 6]| {
        let cells = cells.map(|c| format!(" {c:>9}")).concat();
        let _ = writeln!(text, "  {label:<36}{cells}");
    };
    let numbers = |values: &[f64; 6], digits: usize| values.map(|v| format!("{v:.digits$}"));
    for (name, e) in [("training", Some(trained)), ("verification", verified)] {
        let Some(e) = e else { continue };
        line(&format!("{name}, {} poses", e.poses), STIFFNESSES.map(|s| format!("k{s}")));
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

/// What the fit is worth, in sentences.
fn conclusion(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> Vec<Finding> {
    let (e, on) = match verified {
        Some(v) if fit.verification_in_training() > 0 => {
            (v, "verification poses that had a part in the fit themselves")
        }
        Some(v) => (v, "the verification poses, which had no part in the fit"),
        None => (trained, "the training poses themselves: give --verify to judge the table by others"),
    };
    let worst = |v: &[f64; 6]| v.iter().copied().fold(0.0, f64::max);
    // deflections are judged where there are whole matrices
    let loaded = if e.deflection_percent.factor.is_some() { e } else { trained };
    let forms = forms(&loaded.deflection_percent);
    let tested = verified.is_some_and(|v| v.deflection_percent.factor.is_some());
    let mut findings = vec![verdict(loaded, tested && fit.verification_in_training() == 0)];
    if verified.is_some() && !tested && loaded.deflection_percent.factor.is_some() {
        findings.push(Finding::warning(
            "The verification poses have the six principal stiffnesses alone: deflections are judged by the training poses.",
        ));
    }
    findings.push(Finding::good(format!(
        "Principal stiffnesses: mean error at most {:.2} % with the table (diagonal form), up to {:.1} % without, on {on}.",
        worst(&e.improved.re_percent.mean),
        worst(&e.basic.re_percent.mean)
    )));
    if e.outside_box > 0 {
        findings.push(Finding::warning(format!(
            "{} of these {} poses lie outside the table's box: extrapolated.",
            e.outside_box, e.poses
        )));
    }
    if let Some((_, basic)) = forms.first() {
        for (name, errors) in &forms[1..] {
            // by more than rounding: K_p may be exact
            let is_worse = |i: &usize| errors[*i] > basic[*i] + 1e-3;
            let worse: Vec<&str> = (0..6).filter(is_worse).map(|i| LOADS[i]).collect();
            let worst_of_these = |v: &[f64; 6]| (0..6).filter(is_worse).map(|i| v[i]).fold(0.0, f64::max);
            findings.push(if worse.is_empty() {
                Finding::good(format!(
                    "Deflection of A under load, {name}: mean error at most {:.2} %, where the model without a table (K_p) is \
                     wrong by up to {:.1} %.",
                    worst(errors),
                    worst(basic)
                ))
            } else {
                Finding::bad(format!(
                    "Deflection of A under load, {name}: WORSE than the model without a table (K_p) under {} (up to {:.0} % against \
                     {:.0} %). Don't predict deflections with it.",
                    worse.join(", "),
                    worst_of_these(errors),
                    worst_of_these(basic)
                ))
            });
        }
    }
    findings
}

/// Whether to use the table, by its factor form, which is what predicts deflections.
fn verdict(e: &Evaluation, by_others: bool) -> Finding {
    let d = &e.deflection_percent;
    let Some((factor, basic)) = d.factor.as_ref().zip(d.basic.as_ref()) else {
        return Finding::warning(
            "The table is for the six principal stiffnesses alone. The data hold no more: there is no factor form, and \
             nothing can be said about deflections under load.",
        );
    };
    let greatest = |values: &[f64; 6]| values.iter().copied().fold(0.0, f64::max);
    let error = greatest(&factor.mean);
    let at_tip = e.tip_deflection_percent.factor.as_ref().map_or(error, |f| greatest(&f.mean));
    if (0..6).any(|i| factor.mean[i] > basic.mean[i]) {
        Finding::bad(format!("Don't use the table: it predicts deflections worse than no table ({error:.1} % off)."))
    } else if error > USABLE_PERCENT {
        Finding::warning(format!(
            "The table is rough: it predicts deflections with a mean error of {error:.1} % at A, more than {USABLE_PERCENT} %, and {at_tip:.1} % \
             at the tool's tip."
        ))
    } else if !by_others {
        Finding::warning(format!(
            "The table follows its own data to {error:.1} % in deflection at A, {at_tip:.1} % at the tool's tip; no other poses have tested it."
        ))
    } else {
        Finding::good(format!(
            "The table can be used: it predicts deflections with a mean error of {error:.1} % at most at A, {at_tip:.1} % at the tool's tip, on \
             poses that it was not fitted to."
        ))
    }
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>, state: State) -> Vec<Finding> {
    let mut all = Vec::new();
    let by_others = verified.filter(|v| v.deflection_percent.factor.is_some());
    let loaded = by_others.unwrap_or(trained);
    if let Some((at_a, at_tip)) =
        loaded.deflection_percent.factor.as_ref().zip(loaded.tip_deflection_percent.factor.as_ref())
    {
        let [at_a, at_tip] = [at_a, at_tip].map(|f| f.max.iter().copied().fold(0.0, f64::max));
        let off =
            format!("under the worst of six loads, it is {at_a:.1} % off at A and {at_tip:.1} % at the tool's tip");
        all.push(
            Finding::good(match by_others {
                Some(e) => format!("at the worst of {} verification poses, {off}.", e.poses),
                None => format!(
                    "at the worst of its own {} poses, {off}; between them it may be more, which nothing here tells.",
                    trained.poses
                ),
            })
            .sure(),
        );
    }
    let [theta, sigma, z0] = fit.extent.ranges().map(|[low, high]| format!("{low} to {high}"));
    let inside = format!("θ {theta}°, σ {sigma}°, Z0 {z0} mm");
    let select = (fit.choice != TermChoice::Select).then_some("let the fit choose its terms with --terms select");
    all.push(Finding::good(match state {
        State::Good => format!("compile coefficients.rs into the controller and use the factor form, inside {inside}: outside the status says so."),
        State::Warning => {
            let others = by_others.is_none().then_some("give other poses with all 21 entries of K with --verify");
            let whole = loaded.deflection_percent.factor.is_none().then_some("give all 21 entries of K");
            let ways = [select, whole, others, Some("compute or measure more poses (pkm-host plan)")];
            format!("{}.", ways.into_iter().flatten().collect::<Vec<_>>().join(", or "))
        }
        State::Bad => {
            let first = select.map(|select| format!("{select}; if that is no better, ")).unwrap_or_default();
            format!("{first}check that the data are of this machine file, at A in A-uvw and in SI units.")
        }
    }).todo());
    all
}

/// `with_effect`: the correction effect too, where no table of the paper's stands beside it.
fn error_tables(trained: &Evaluation, verified: Option<&Evaluation>, with_effect: bool) -> Markup {
    let sets =
        || [("training", Some(trained)), ("verification", verified)].into_iter().filter_map(|(n, e)| Some((n, e?)));
    let cells = |values: &[f64; 6], digits: usize| values.map(|v| format!("{v:.digits$}")).to_vec();
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

/// Poses with about the same value of a variable: by value when there are few, else in seven bins.
fn levels(samples: &[Sample], variable: usize) -> BTreeMap<i64, (f64, Vec<usize>)> {
    let values: Vec<f64> = samples.iter().map(|s| file_units(&s.pose.pose)[variable]).collect();
    let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(*v), h.max(*v)));
    let group = |step: f64| {
        let mut groups: BTreeMap<i64, (f64, Vec<usize>)> = BTreeMap::new();
        for (i, v) in values.iter().enumerate() {
            groups.entry(((v - low) / step).round() as i64).or_default().1.push(i);
        }
        for (mean, members) in groups.values_mut() {
            *mean = members.iter().map(|i| values[*i]).sum::<f64>() / members.len() as f64;
        }
        groups
    };
    let exact = group(1e-6);
    if exact.len() <= 12 { exact } else { group((high - low) / 7.0) }
}

/// Fig. 5: mean of a coefficient over the levels of each variable.
fn tendencies(samples: &[Sample], i: usize) -> [Panel; 3] {
    [0, 1, 2].map(|v| Panel {
        title: format!("mean of c{} over {}", STIFFNESSES[i], SYMBOLS[v]),
        x_label: VARIABLES[v].into(),
        y_label: format!("mean of c{}", STIFFNESSES[i]),
        series: vec![Series {
            name: String::new(),
            points: levels(samples, v)
                .values()
                .map(|(x, members)| {
                    (*x, members.iter().map(|m| samples[*m].ratios()[i]).sum::<f64>() / members.len() as f64)
                })
                .collect(),
            mark: Mark::Line,
        }],
    })
}

/// Most poses that a plot shows.
const MOST_SHOWN: usize = 2000;

/// Of how many poses one is shown, and the words for that.
fn thinned(poses: usize) -> (usize, String) {
    let step = poses.div_ceil(MOST_SHOWN).max(1);
    (step, if step > 1 { format!(", one of {step} poses") } else { String::new() })
}

/// Fig. 6: a coefficient over one variable, marked by another.
fn combinations(samples: &[Sample], i: usize) -> [Panel; 3] {
    let (step, shown) = thinned(samples.len());
    [(0, 2), (1, 2), (1, 0)].map(|(x, by)| Panel {
        title: format!("c{} over {}, by {}{shown}", STIFFNESSES[i], SYMBOLS[x], VARIABLES[by]),
        x_label: VARIABLES[x].into(),
        y_label: format!("c{}", STIFFNESSES[i]),
        series: levels(samples, by)
            .values()
            .map(|(level, members)| {
                let point = |m: &usize| (file_units(&samples[*m].pose.pose)[x], samples[*m].ratios()[i]);
                let mut points: Vec<(f64, f64)> = members.iter().step_by(step).map(point).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                Series { name: ((level * 100.0).round() / 100.0).to_string(), points, mark: Mark::Line }
            })
            .collect(),
    })
}

/// Residuals of a fitted coefficient over each variable, at both sets of poses.
fn residuals(fit: &Fit, i: usize) -> Result<[Panel; 3]> {
    let table = fit.numbers.table()?;
    let relative = |s: &Sample| {
        let measured = s.ratios()[i];
        100.0 * (table.coefficients(&s.pose.pose)[i] - measured) / measured
    };
    Ok([0, 1, 2].map(|v| {
        let series = |name: &str, samples: &[Sample], mark| {
            let (step, shown) = thinned(samples.len());
            let points = samples.iter().step_by(step).map(|s| (file_units(&s.pose.pose)[v], relative(s))).collect();
            Series { name: format!("{name}{shown}"), points, mark }
        };
        let mut all = vec![series("training", &fit.training, Mark::Dot)];
        all.extend(fit.verification.as_ref().map(|s| series("verification", s, Mark::Cross)));
        Panel {
            title: format!("k{}, corrected: error over {}", STIFFNESSES[i], SYMBOLS[v]),
            x_label: VARIABLES[v].into(),
            y_label: "error in %".into(),
            series: all,
        }
    }))
}

/// Where paper sends readers of the corrections.
const CORRECTIONS: &str = "this page on a screen; as polynomials in coefficients.json";

/// Small pictures by coefficient and variable.
fn over_pose(fit: &Fit) -> Result<Markup> {
    let each = |of: &dyn Fn(usize) -> [Panel; 3]| (0..6).flat_map(of).collect::<Vec<_>>();
    let left: Vec<Panel> =
        (0..6).map(|i| residuals(fit, i)).collect::<Result<Vec<_>>>()?.into_iter().flatten().collect();
    Ok(html! {
        (fold("What the fitted polynomials leave", &charts(
            "Error of the corrected k11…k66 at each pose, over each variable: it should show no pattern.",
            &left,
        )?))
        (on_screen("Corrections over each variable", CORRECTIONS, &charts(
            "Mean of the correction c_ii, which makes k_ii of K_p that of the data (paper, Fig. 5).",
            &each(&|i| tendencies(&fit.training, i)),
        )?))
        (on_screen("Corrections at every pose", CORRECTIONS, &charts(
            "c_ii by the value of another variable (paper, Fig. 6).",
            &each(&|i| combinations(&fit.training, i)),
        )?))
    })
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
        ("Data", format!("{}, {} poses, SHA-256 {}", p.file.data, fit.training.len(), p.file.data_sha256)),
        ("Verification", p.verification.map_or("none".into(), |(name, sha)| format!("{name}, SHA-256 {sha}"))),
        ("Box, outside which the controller gets a status", format!("θ {theta:?}°, σ {sigma:?}°, Z0 {z0:?} mm")),
        ("Condition number of the fit", format!("{:.1}", fit.condition)),
    ];
    let mut findings = conclusion(fit, p.training, p.verified);
    findings.extend(advice(fit, p.training, p.verified, findings[0].state));
    Ok(Page { title: format!("Stiffness table of {}", p.file.machine), findings: &findings, warnings, body, facts }
        .html())
}

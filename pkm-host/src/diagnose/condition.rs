//! Badges and the machine's condition on the page of a diagnosis.

use maud::{Markup, html};

use super::Diagnosis;
use super::badges::{Badge, Grade};
use super::estimates::Estimate;
use crate::files::verified::Quantity;
use crate::page::{Finding, badges, on_screen, table};

/// A badge as a finding.
fn finding(badge: &Badge) -> Finding {
    let words = badge.verdict.replace('_', " ");
    match badge.grade {
        Grade::Good => Finding::good(words),
        Grade::Doubtful => Finding::warning(words),
        Grade::Bad => Finding::bad(words),
    }
}

/// Is the measurement sound, is the model good enough.
pub fn judgements(d: &Diagnosis) -> Markup {
    let (measurement, model) = (Badge::measurement(d), Badge::model(d));
    badges(&[
        ("Is the measurement sound?", finding(&measurement), measurement.reasons.as_slice()),
        ("Is the model good enough?", finding(&model), model.reasons.as_slice()),
    ])
}

/// What the machine is like, whatever the model lacks.
pub fn condition(d: &Diagnosis) -> Markup {
    let estimates = &d.estimates;
    let percent = |ln: f64| format!("{:.1}", 100.0 * ln);
    let cells = |q: &Quantity| {
        vec![
            format!("{:.4e}", q.declared),
            format!("{:.4e}", q.identified),
            q.unit.clone(),
            format!("{:+.1}", 100.0 * q.change().exp_m1()),
            percent(q.expanded_uncertainty),
            q.state.replace('_', " "),
        ]
    };
    let rows: Vec<_> = estimates.condition.iter().map(|q| (q.what.clone(), cells(q))).collect();
    let heads = ["declared", "identified", "unit", "change %", "± %, 95 %", "state"];
    let known = match estimates.coverage.degrees_of_freedom {
        Some(dof) => format!("k = {:.2}, from {dof:.0} degrees of freedom of the noise", estimates.coverage.k),
        None => format!("k = {:.2}, with the noise as declared", estimates.coverage.k),
    };
    html! {
        h2 { "Condition of the machine" }
        @if Badge::measurement(d).grade == Grade::Bad {
            p { "Nothing is said of it while the measurement is unsound; what makes up for the readings is in diagnosis.json." }
        } @else {
            @if d.leaves_more_than_noise() {
                p { "More than noise is left: values may make up for what the model lacks, and sound parts pass for worn." }
            }
            // the others are among the findings
            @if estimates.notable().is_empty() && let Some(sentence) = estimates.none_differs() {
                p { (sentence) }
            }
            (table("Stiffness as declared and as identified, with its expanded uncertainty", &heads, &rows))
            p { "Expanded uncertainties cover 95 % (" (known) ")." }
        }
    }
}

/// Every estimate with its uncertainty.
pub fn estimates(d: &Diagnosis) -> Markup {
    let cells = |e: &Estimate| {
        [e.value, e.standard_uncertainty, e.expanded_uncertainty].iter().map(|v| format!("{v:.4e}")).collect()
    };
    let rows: Vec<(String, Vec<String>)> = d.estimates.all.iter().map(|e| (e.name.clone(), cells(e))).collect();
    let heads = ["value", "standard uncertainty", "expanded uncertainty"];
    on_screen(
        "All estimates",
        "diagnosis.json and covariance.csv",
        &table("In the units of machine.toml; their covariance is in covariance.csv", &heads, &rows),
    )
}

//! What two diagnoses say of a change: text, JSON and the page.

use maud::html;
use serde_json::{Value, json};

use crate::diagnose::text::probability;
use crate::diagnose::verify::{Change, INCONCLUSIVE, Verification};
use crate::page::{Finding, Page, table};

/// Of probabilities.
const DECIMALS: usize = 4;

/// One change in a sentence.
fn sentence(c: &Change) -> String {
    format!(
        "{}: {:.1} % {} (± {:.1} %, probability {})",
        c.what,
        c.change_percent.abs(),
        c.verdict,
        c.expanded_uncertainty_percent,
        probability(c.probability, DECIMALS)
    )
}

/// The findings in sentences, the verdict first; what it is to be doubted for stands before it where it is that nothing has changed.
fn findings(v: &Verification) -> Vec<Finding> {
    let changed: Vec<&Change> = v.changes.iter().filter(|c| ["softer", "stiffer"].contains(&c.verdict)).collect();
    let verdict = match (v.verdict, changed.first()) {
        (INCONCLUSIVE, _) => Finding::bad("No conclusion: the measurement of one of the two diagnoses is unsound."),
        ("unchanged", _) => {
            let least = v.changes.iter().map(|c| c.expanded_uncertainty_percent).fold(0.0, f64::max);
            Finding::good(format!(
                "Nothing has changed beyond its uncertainty: what is compared is known to {least:.1} % or better."
            ))
        }
        (_, Some(first)) => Finding::warning(format!("The machine has changed: {}.", sentence(first))),
        (_, None) => {
            Finding::warning("What was found has changed, the machine's stiffnesses have not beyond uncertainty.")
        }
    };
    let mut all: Vec<Finding> =
        v.caveats.iter().map(|caveat| Finding::bad(format!("Keep in mind: {caveat}."))).collect();
    all.insert(if v.verdict == "unchanged" { all.len() } else { 0 }, verdict);
    all.extend(changed.iter().skip(1).map(|c| Finding::warning(format!("{}.", sentence(c)))));
    all.extend(v.findings.iter().map(|f| {
        let text = format!("{}.", f.text);
        if f.verdict == "new" || f.verdict == "stronger" { Finding::warning(text) } else { Finding::good(text) }
    }));
    all
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(v: &Verification) -> [Finding; 2] {
    let sure = if v.verdict == INCONCLUSIVE {
        "not at all: what makes up for readings that are not what they are taken for is no stiffness of the machine."
    } else if v.caveats.is_empty() {
        "noise alone would bring a change as great as those that are named in one comparison of a hundred."
    } else {
        "less than the figures say: the two diagnoses can be compared in part only: see what is to be kept in mind."
    };
    let todo = match (v.verdict, v.caveats.is_empty()) {
        ("unchanged", true) => "nothing: tables and compensation stay as they are.",
        ("unchanged", false) => {
            "settle what is to be kept in mind and compare again; tables stay as they are until then."
        }
        (INCONCLUSIVE, _) => {
            "check the readings that are unsound or take them again, diagnose them and compare; tables stay as they are until then."
        }
        _ => "if a repair was to bring this, make a new table; if not, inspect what is named first.",
    };
    [Finding::good(sure).sure(), Finding::good(todo).todo()]
}

/// For the terminal.
pub(crate) fn text(v: &Verification) -> String {
    let mut text: String = findings(v).iter().map(|f| format!("- {}\n", f.text)).collect();
    if v.verdict == INCONCLUSIVE {
        return text;
    }
    text.push_str("                    before        after   change %    ± 95 %   probability\n");
    for c in &v.changes {
        text.push_str(&format!(
            "  {:<13} {:>12.4e} {:>12.4e} {:>+10.2} {:>9.2} {:>13}  {} ({})\n",
            c.quantity,
            c.before,
            c.after,
            c.change_percent,
            c.expanded_uncertainty_percent,
            probability(c.probability, DECIMALS),
            c.verdict,
            c.unit
        ));
    }
    let is_beyond_its_own =
        |c: &&Change| c.verdict == "unchanged" && c.change_percent.abs() > c.expanded_uncertainty_percent;
    if let Some(c) = v.changes.iter().find(is_beyond_its_own) {
        text.push_str(&format!(
            "  {} is unchanged though beyond its ± 95 %: among {} quantities noise brings one such now and then\n",
            c.quantity,
            v.changes.len()
        ));
    }
    text
}

/// For programs.
pub(crate) fn document(v: &Verification, facts: &[(&str, String)]) -> Value {
    let mut document = json!(v);
    document["from"] =
        facts.iter().map(|(name, value)| (name.to_lowercase(), json!(value))).collect::<serde_json::Map<_, _>>().into();
    document
}

/// `report.html`.
pub(crate) fn html(v: &Verification, machine: &str, facts: Vec<(&str, String)>, warnings: &[String]) -> String {
    let cells = |c: &Change| {
        let dof = c.degrees_of_freedom.map_or("-".to_owned(), |d| format!("{d:.0}"));
        vec![
            format!("{:.4e}", c.before),
            format!("{:.4e}", c.after),
            c.unit.clone(),
            format!("{:+.2}", c.change_percent),
            format!("{:.2}", c.expanded_uncertainty_percent),
            format!("{:.2}", c.k),
            dof,
            probability(c.probability, DECIMALS),
            c.verdict.to_owned(),
        ]
    };
    let rows: Vec<_> = v.changes.iter().map(|c| (c.what.clone(), cells(c))).collect();
    let heads = ["before", "after", "unit", "change %", "± %", "k", "degrees of freedom", "probability", "verdict"];
    let fates: Vec<_> = v.findings.iter().map(|f| (f.finding.clone(), vec![f.verdict.to_owned()])).collect();
    let body = html! {
        h2 { "Stiffness before and after" }
        @if v.verdict == INCONCLUSIVE {
            p { "Nothing is said of it while a measurement is unsound; what makes up for its readings is in verify.json." }
        } @else {
            (table("Change with its expanded uncertainty (95 %), and the probability that it has this sign", &heads, &rows))
            p {
                "A change is named where noise alone would bring any as great in one comparison of a hundred. Neither machine \
                 is held to the declared values: few of them are taken to have changed, and the readings of both say which."
            }
        }
        @if !fates.is_empty() {
            h2 { "What became of the findings" }
            (table("Effects and declared values", &["verdict"], &fates))
        }
    };
    let mut findings = findings(v);
    findings.extend(advice(v));
    Page { title: format!("What has changed: {machine}"), findings: &findings, warnings, body, facts }.html()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_beyond_its_own_interval_that_is_none_says_why() {
        let change = |change_percent: f64| Change {
            quantity: "k33".into(),
            what: "platform at the middle of the box, along w".into(),
            unit: "N/m".into(),
            before: 1e8,
            after: 1e8 * (1.0 + change_percent / 100.0),
            change_percent,
            standard_uncertainty_percent: 8.0,
            expanded_uncertainty_percent: 16.0,
            k: 2.0,
            degrees_of_freedom: None,
            p: 0.02,
            probability: 0.99,
            verdict: "unchanged",
        };
        let said = |percent: f64| {
            let changes = vec![change(percent), change(0.0)];
            text(&Verification { verdict: "unchanged", changes, findings: Vec::new(), caveats: Vec::new() })
        };
        assert!(said(18.0).contains("k33 is unchanged though beyond its ± 95 %: among 2 quantities"), "{}", said(18.0));
        assert!(!said(15.0).contains("though"), "{}", said(15.0));
    }
}

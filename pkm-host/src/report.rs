//! What people read after a fit: tables like the paper's 3 and 4, and `report.html`.

use crate::error::Result;
use crate::export::Provenance;
use crate::fit::{Evaluation, Fit};

/// Tables for the terminal.
pub fn summary(fit: &Fit, trained: &Evaluation, verified: Option<&Evaluation>) -> String {
    let mut text = String::new();
    let mut line = |label: &str, values: &[f64; 6], digits: usize| {
        let cells = values.map(|v| format!("{v:>9.digits$}")).join("");
        text.push_str(&format!("  {label:<34}{cells}\n"));
    };
    for (name, e) in [("training", Some(trained)), ("verification", verified)] {
        let Some(e) = e else { continue };
        line(&format!("{name}, {} poses", e.poses), &[11.0, 22.0, 33.0, 44.0, 55.0, 66.0], 0);
        line("re %, basic K_p: mean", &e.basic.re_percent.mean, 2);
        let re = &e.improved.re_percent;
        line("re %, diagonal form: mean", &re.mean, 2);
        line("  standard deviation", &re.stdev, 2);
        line("  max", &re.max, 2);
        line("  min", &re.min, 2);
        if let Some(f) = &e.factor {
            line("re %, factor form: mean", &f.re_percent.mean, 2);
        }
        line("me, diagonal form: mean", &e.improved.me.statistics.mean, 3);
        line("  min", &e.improved.me.statistics.min, 3);
        let d = &e.deflection_percent;
        for (name, d) in [
            ("deflection %, K_p: mean", &d.basic),
            ("  Eq. 10 to the letter", &d.diagonal_literal),
            ("  diagonal form", &d.diagonal),
            ("  factor form", &d.factor),
        ] {
            if let Some(d) = d {
                line(name, &d.mean, 2);
            }
        }
    }
    text.push_str(&format!("  condition number of the fit {:.1}, {} terms\n", fit.condition, fit.numbers.terms.len()));
    text
}

/// x
pub fn fit_report(_p: &Provenance<'_>, _fit: &Fit) -> Result<String> {
    Ok(String::new())
}

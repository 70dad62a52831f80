//! What came of driving firmware, as text and JSON.

use serde_json::{Value, json};

use crate::hil::{Campaign, CycleCounts, Outcome};

/// Median and greatest ticks, and the same in instructions where they are known.
fn cost(outcome: &Outcome, of: &CycleCounts) -> Option<([u32; 2], Option<[f64; 2]>)> {
    let (&worst, &median) = of.ticks.last().zip(of.ticks.get(of.ticks.len() / 2))?;
    let instructions = |i: f64| [median, worst].map(|t| (f64::from(t) * i).round());
    Some(([median, worst], outcome.instructions_in_tick.map(instructions)))
}

/// For the terminal.
pub fn text(outcome: &Outcome, campaign: &Campaign) -> String {
    let findings = &outcome.findings;
    let mut text = format!(
        "{}: {} poses (seed {}), {} bad lines sent on purpose, {:.0} replies/s\n",
        outcome.name,
        campaign.poses,
        campaign.seed,
        findings.bad_lines,
        outcome.replies as f64 / outcome.seconds
    );
    if outcome.table_sent {
        text.push_str("the table was sent, and put into service while the firmware ran\n");
    }
    for (name, of) in ["f32", "f64"].into_iter().zip(&findings.of) {
        let Some(([median, worst], instructions)) = cost(outcome, of) else { continue };
        let mut cost = match instructions {
            Some([median, worst]) => format!("{median} instructions (worst {worst}) a cycle"),
            None => {
                let us = |t: u32| f64::from(t) / f64::from(outcome.ticks_hz) * 1e6;
                format!("{:.1} µs (worst {:.1}) a cycle", us(median), us(worst))
            }
        };
        if campaign.steps > 1 {
            cost.push_str(" at a sweep's worst");
        }
        text.push_str(&format!(
            "{name}: {} cycles, {} outside the box, {} refused; {cost}; {} overruns\n",
            of.cycles, of.outside_box, of.refused, of.overruns
        ));
    }
    if findings.of.iter().any(|of| of.overruns > 0) {
        text.push_str("overruns: periods without a cycle, since one took longer than a period; reported, no failure\n");
    }
    let [q, k, d] = findings.precision;
    text.push_str(&format!("f32 against f64 in the box: screws {q:.1e} m, K_m {k:.1e}, deflection {d:.1e}\n"));
    text.push_str(&format!("stack: {} bytes used\n", outcome.stack_used_bytes));
    text
}

/// `hil.json`.
pub fn document(outcome: &Outcome, campaign: &Campaign) -> Value {
    let findings = &outcome.findings;
    let mut document = outcome.hello.clone();
    document["table_sent"] = outcome.table_sent.into();
    for (name, of) in ["f32", "f64"].into_iter().zip(&findings.of) {
        let Some(([median, worst], instructions)) = cost(outcome, of) else { continue };
        document[name] = json!({
            "cycles": of.cycles, "outside_box": of.outside_box, "refused": of.refused, "overruns": of.overruns,
            "ticks": { "median": median, "worst": worst },
            "instructions": instructions.map(|[median, worst]| json!({ "median": median, "worst": worst })),
        });
    }
    let [q, k, d] = findings.precision;
    for (key, value) in [
        ("seed", json!(campaign.seed)),
        ("poses", json!(campaign.poses)),
        ("steps", json!(campaign.steps)),
        ("bad_lines", json!(findings.bad_lines)),
        ("differing", json!(findings.differing)),
        ("worst_deviation", json!(findings.worst_deviation)),
        ("f32_against_f64", json!({ "q_m": q, "k_relative": k, "deflection_relative": d })),
        ("stack_used_bytes", json!(outcome.stack_used_bytes)),
        ("seconds", json!(outcome.seconds)),
    ] {
        document[key] = value;
    }
    document
}

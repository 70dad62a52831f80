//! What people read after a diagnosis: a summary for the terminal, and `report.html`.

use std::fmt::Write;

use maud::{Markup, html};
use pkm_diagnosis::NoiseSource;

use super::advice::next_step;
use super::badges::{Badge, Grade};
use super::compare::{Errors, RIVALS, Rival, of};
use super::sentences::{certainty, findings};
use super::{Diagnosis, HeldOut, SEED, Verdict, condition, readings_table, residual_plots, text};
use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, GAUGE, Readings};
use crate::page::plot::{self, Bar};
use crate::page::{Finding, Page, of_file, on_screen, picture, table};
use crate::page::{p_in_words, p_value};
use crate::pose::written_units;

/// For the terminal.
pub fn text(d: &Diagnosis) -> String {
    let mut text = String::new();
    for finding in findings(d) {
        let _ = writeln!(text, "- {}", finding.text);
    }
    let _ = writeln!(text, "  rms translation error in µm           readings   held out, with its 95 % interval");
    for (rival, _, name) in RIVALS {
        if let (Some(a), Some(b)) = (of(&d.errors, rival), of(&d.held_out.all, rival)) {
            let (own, other, interval) = (a.linear_um_rms, b.linear_um_rms, interval(b));
            let _ = writeln!(text, "  {name:<36} {own:>9.3} {other:>10.3}   {interval}");
        }
    }
    if let Some(e) = d.held_out.as_measured.as_deref().and_then(|errors| of(errors, Rival::After)) {
        let (name, error, interval) = ("identified model, as measured", e.linear_um_rms, interval(e));
        let _ = writeln!(text, "  {name:<36} {:>9} {error:>10.3}   {interval}", "");
    }
    let _ = writeln!(
        text,
        "  machine.toml: every stiffness differs a little from the declared one, as all are weighed against their declared \
         uncertainty; what is wrong is named above\n  seed {SEED}"
    );
    text
}

/// Limits of the translation error, µm.
pub fn interval(e: &Errors) -> String {
    match e.linear_um_rms_interval {
        None => "too few poses".to_owned(),
        Some([low, _]) if e.linear_um_rms_interval_open => format!("{low:.3}, no upper end"),
        Some([low, high]) => format!("{low:.3} to {high:.3}"),
    }
}

fn error_cells(e: &Errors) -> Vec<String> {
    // no rotation was read
    let angular = |shown: String| if e.angular_urad_rms == 0.0 { "-".to_owned() } else { shown };
    vec![
        format!("{:.3}", e.linear_um_rms),
        interval(e),
        format!("{:.2}", e.linear_um_max),
        format!("{:.2}", e.linear_percent),
        angular(format!("{:.3}", e.angular_urad_rms)),
        angular(format!("{:.2}", e.angular_percent)),
        format!("{:.2}", e.chi2_per_dof),
    ]
}

/// By group and model.
fn error_rows(groups: &[(String, &[(Rival, Errors)])]) -> Vec<(String, Vec<String>)> {
    let rows = |(group, errors): &(String, &[(Rival, Errors)])| {
        let row = |(rival, _, name): &(Rival, &str, &str)| {
            Some((format!("{group}: {name}"), error_cells(of(errors, *rival)?)))
        };
        RIVALS.iter().filter_map(row).collect::<Vec<_>>()
    };
    groups.iter().flat_map(rows).collect()
}

const ERROR_HEADS: [&str; 7] =
    ["rms µm", "95 % interval", "max µm", "% of translation", "rms µrad", "% of rotation", "χ²/dof"];

/// The candidates of each round, the best first.
fn rounds(d: &Diagnosis) -> Markup {
    let heads =
        ["Δχ²", "degrees of freedom", "p", "2 Δ ln E", "cross-validated gain, %", "poses that gain, %", "rejected"];
    let tables = d.search.rounds.iter().zip(&d.names).enumerate().map(|(n, (round, names))| {
        let mut shown: Vec<&str> = Vec::new();
        let rows: Vec<_> = (round.ranking.iter().zip(names))
            .filter(|(_, name)| {
                let new = !shown.contains(&name.as_str());
                shown.push(name);
                new
            })
            .take(12)
            .map(|(r, name)| {
                let cells = vec![
                    format!("{:.1}", r.score.statistic),
                    r.score.dof.to_string(),
                    p_value(r.score.p),
                    r.gain.map_or("-".into(), |g| format!("{g:.1}")),
                    r.gain.map_or("-".into(), |_| format!("{:.2}", 100.0 * r.left_out_gain)),
                    r.gain.map_or("-".into(), |_| format!("{:.0}", 100.0 * r.poses_that_gain)),
                    r.rejected.map_or(String::new(), str::to_owned),
                ];
                (name.clone(), cells)
            })
            .collect();
        let p = round.p_family;
        table(&format!("Round {}: family-wise p-value of the best candidate {}", n + 1, p_value(p)), &heads, &rows)
    });
    let legend = text::LEGEND.map(|(what, means)| format!("{what}: {means}"));
    html! {
        p { (legend.join(". ")) "." }
        @for table in tables { (table) }
    }
}

/// Where the page comes from.
fn facts(
    file: &MachineFile,
    readings: &Readings,
    held_out: Option<&Readings>,
    d: &Diagnosis,
) -> Vec<(&'static str, String)> {
    // the gauge's, where there is one, last
    let used = if d.noise.within[GAUGE] > 0.0 { CHANNELS } else { GAUGE };
    let micro = |v: &[f64]| v[..used].iter().map(|v| format!("{:.2}", v * 1e6)).collect::<Vec<_>>().join(", ");
    let from = if d.noise.source == NoiseSource::Repeats { "by repeats" } else { "as declared" };
    let misfit = |of: &pkm_diagnosis::verdict::LackOfFit| format!("{:.3}, {}", of.statistic, p_in_words(of.p));
    vec![
        ("Seed", SEED.to_string()),
        ("Machine file", of_file(&file.source)),
        ("Data", format!("{}, {} scalar observations at {} poses", of_file(&readings.source), d.size.0, d.size.1)),
        ("Held-out readings", held_out.map_or("none: poses left out in turn".into(), |h| of_file(&h.source))),
        ("Noise by channel, µm and µrad", format!("{}, {from}", micro(&d.noise.within))),
        ("Zero error of a series, likewise", micro(&d.noise.between)),
        ("Misfit over noise, before", misfit(&d.judgement.before)),
        ("Misfit over noise, after", misfit(&d.judgement.after)),
    ]
}

/// Errors by group of readings: those that were fitted, all others, and then parts of these.
fn groups(d: &Diagnosis) -> Vec<(String, &[(Rival, Errors)])> {
    let held = &d.held_out;
    let others = if held.given { "held out, all" } else { "poses left out" };
    let mut groups = vec![("the readings".to_owned(), d.errors.as_slice()), (others.to_owned(), held.all.as_slice())];
    groups.extend(held.as_measured.iter().map(|errors| ("held out, as measured".to_owned(), errors.as_slice())));
    groups.extend(
        (held.zones.iter())
            .map(|(zone, errors)| (format!("held out, {}", zone.name().replace('_', " ")), errors.as_slice())),
    );
    groups
}

/// Under the picture of the errors by group of readings.
fn caption_of_errors(held: &HeldOut) -> String {
    let as_measured = " As measured: with the error of the measurement that was found; the others without it.";
    format!(
        "Rms translation error of each model, on the readings that it was fitted to and on others, which are those that count: all, \
         and by where their poses lie and whether their loads were read before.{} Lines: 95 % intervals, where there are poses enough; \
         without an end where there is no upper one.",
        if held.as_measured.is_some() { as_measured } else { "" }
    )
}

/// The translation error of a model, none where it has none.
fn bar(e: Option<&Errors>) -> Bar {
    Bar {
        value: e.map(|e| e.linear_um_rms),
        interval: e.and_then(|e| {
            let open = e.linear_um_rms_interval_open;
            e.linear_um_rms_interval.map(|[low, high]| [low, if open { f64::INFINITY } else { high }])
        }),
    }
}

/// `report.html`.
///
/// # Errors
/// What the drawing library says.
pub fn html(
    file: &MachineFile,
    readings: &Readings,
    held_out: Option<&Readings>,
    d: &Diagnosis,
    warnings: &[String],
) -> Result<String> {
    let groups = groups(d);
    // the readings and all others; what follows are groups of these
    let (main, subsets) = groups.split_at(2);
    let labels: Vec<&str> = groups.iter().map(|(name, _)| name.trim_start_matches("held out, ")).collect();
    let bars: Vec<(&str, Vec<Bar>)> = RIVALS
        .iter()
        .map(|(rival, _, name)| (*name, groups.iter().map(|(_, e)| bar(of(e, *rival))).collect()))
        .collect();
    let on_others = d.steps.iter().all(|s| s.held_out.is_some());
    let steps: Vec<_> =
        (d.steps.iter()).map(|s| (s.found.join(", "), error_cells(s.held_out.as_ref().unwrap_or(&s.errors)))).collect();
    let structure: Vec<_> =
        (d.structure.iter()).map(|s| (s.factor.to_owned(), vec![format!("{:.2}", s.share), p_value(s.p)])).collect();
    let proposals: Vec<_> = (d.proposals.iter().enumerate())
        .map(|(n, p)| {
            let [theta, sigma, z0] = written_units(&p.pose).map(|v| v.to_string());
            ((n + 1).to_string(), vec![theta, sigma, z0, text::load(&p.wrench), p.separates.join(" from ")])
        })
        .collect();
    let amplitudes: Vec<_> = d.detectable.iter().map(|d| (d.id.clone(), vec![d.text()])).collect();
    let body = html! {
        (condition::judgements(d))
        h2 { "Before and after" }
        (picture(
            &caption_of_errors(&d.held_out),
            &plot::bars("Translation error, rms", "µm", &labels, &bars)?,
        ))
        (condition::condition(d))
        h2 { "Residuals over pose, load and limb force" }
        (residual_plots::charts(file, readings, d)?)
        (readings_table::list(readings, d))
        h2 { "Errors" }
        (table("Errors of each model, on the readings and on others", &ERROR_HEADS, &error_rows(main)))
        @if !subsets.is_empty() {
            (on_screen("Errors on each group of the held-out readings", "diagnosis.json", &table(
                "Errors of each model, on groups of the held-out readings", &ERROR_HEADS, &error_rows(subsets),
            )))
        }
        @if steps.len() > 1 {
            @let on = if on_others { "held out, all" } else { "the readings" };
            (table(&format!("After each find, errors on {on}"), &ERROR_HEADS, &steps))
        }
        (table("What the remaining misfit goes with: its share, and the probability of as much by chance (p)", &["share", "p"], &structure))
        h2 { "What to measure next" }
        @if proposals.is_empty() && d.judgement.verdict == Verdict::Ambiguous {
            p { "No reading that would tell the rivals apart is proposed." }
        } @else if proposals.is_empty() {
            p { "There are no rivals to tell apart." }
        } @else {
            (table("In this order", &["θ °", "σ °", "Z0 mm", "load at A", "tells"], &proposals))
        }
        (condition::estimates(d))
        h2 { "What was tried" }
        (on_screen("Candidates, round by round", "diagnosis.json", &rounds(d)))
        h2 { "What these readings can show" }
        (on_screen(
            "Smallest amplitudes",
            "diagnosis.json",
            &table("Smallest amplitude that would be found (λ = 30)", &["amplitude"], &amplitudes),
        ))
    };
    let facts = facts(file, readings, held_out, d);
    let mut findings = findings(d);
    if Badge::measurement(d).grade != Grade::Bad {
        findings.push(Finding::good(certainty(d)).sure());
    }
    findings.push(Finding::good(next_step(d)).todo());
    Ok(Page { title: format!("Diagnosis of {}", file.name), findings: &findings, warnings, body, facts }.html())
}

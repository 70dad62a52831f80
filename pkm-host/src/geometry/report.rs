//! What people read of an identified geometry: sentences for the terminal, and `report.html`.

use maud::{Markup, html};
use pkm_diagnosis::verdict::LackOfFit;

use super::model::Meaning;
use super::outcome::{Estimate, Identification, MAX_PULL_SD, Rival, TriedState, Verdict};
use crate::error::{Result, lines_text};
use crate::files::machine::MachineFile;
use crate::files::unloaded::{Unloaded, UnloadedReading};
use crate::page::p_value;
use crate::page::plot::{Mark, Panel, Series};
use crate::page::{Finding, Page, charts, fold, of_file, table};

/// Standard deviations from which a difference from the declared value is one.
const SIGNIFICANT_SD: f64 = 3.0;
/// Share of a picture's width that the longest error vector takes.
const LONGEST_VECTOR: f64 = 0.15;

fn number(e: &Estimate, value: f64) -> String {
    format!("{:+.4} ± {:.4} {}", 1e3 * value, 1e3 * e.sd, e.unit())
}

/// What a combination needs to be told.
fn remedy(parts: &[(Meaning, f64)]) -> &'static str {
    let has = |is: fn(Meaning) -> bool| parts.iter().any(|(m, _)| is(*m));
    if has(|m| m == Meaning::Beta(1)) && has(|m| matches!(m, Meaning::Wrist(3 | 4))) {
        "measure a second ball on the spindle's axis, at another tool_z_mm: one alone cannot tell the tool's length from its lean"
    } else if has(|m| matches!(m, Meaning::Wrist(_) | Meaning::Beta(_))) {
        "measure more angles of the wrist, and two balls on the spindle's axis"
    } else {
        "measure three or more targets on the platform, and poses over the whole travel"
    }
}

fn held_out_sentence(found: &Identification, rival: Rival) -> String {
    found.held_out_of(rival).map_or(String::new(), |e| {
        format!("{:.1} µm rms, {:.1} µm at most", e.kinds[0].rms * 1e6, e.kinds[0].max * 1e6)
    })
}

fn ratio(found: &Identification, rival: Rival) -> f64 {
    found.held_out_of(rival).map_or(f64::NAN, |e| e.chi2_per_dof.sqrt())
}

/// Names of the findings, with what the readings cannot tell them from.
fn names(found: &Identification) -> String {
    let of = |state: TriedState| -> Vec<&str> {
        found.tried.iter().filter(|t| t.state == state).map(|t| t.id.as_str()).collect()
    };
    let alike = of(TriedState::Alike);
    let or = if alike.is_empty() {
        String::new()
    } else {
        format!(" (the readings cannot tell it from {})", alike.join(", "))
    };
    of(TriedState::Found).join(" and ") + &or
}

fn verdict(found: &Identification) -> Finding {
    let how = if found.held_out.0 { "held-out poses" } else { "poses left out in turn" };
    let before_after = format!(
        "Volumetric error on {how}: declared geometry {}; identified {} ({:.2} times the noise)",
        held_out_sentence(found, Rival::Declared),
        held_out_sentence(found, Rival::Identified),
        ratio(found, Rival::Identified),
    );
    let with = || format!("; with it {}", held_out_sentence(found, Rival::WithFound));
    match found.verdict {
        Verdict::Adequate => Finding::good(format!("{before_after}. The residuals are noise.")),
        Verdict::Explained => Finding::warning(format!(
            "{before_after}. The rest is {}: with it the residuals are noise{}. The controller's kinematics cannot hold it: mend the \
             joints, or accept the error of the identified geometry.",
            names(found),
            with()
        )),
        Verdict::PartlyExplained => Finding::warning(format!(
            "{before_after}. {} accounts for part of what remains{}; a significant misfit is left, and deviations are too small.",
            names(found),
            with()
        )),
        Verdict::Unexplained => Finding::bad(format!(
            "{before_after}. The residuals are more than noise, and neither axes or places of joints nor pitches of screws account for them: is the \
             declared noise right, was anything loose or warm, did the instrument move, are two targets exchanged, is an angle of another \
             unit or sign?"
        )),
    }
}

/// What the identified numbers are, and what to do with them.
fn numbers(found: &Identification) -> Vec<Finding> {
    if found.is_far_from_any_machine() {
        return vec![Finding::bad(
            "The readings are not those of a machine with any such sizes: nothing is said of home positions and sizes, and machine.toml has the \
             declared ones. Look first at the readings that stand out.",
        )];
    }
    if !found.is_of_use() {
        return vec![Finding::bad(
            "The identified geometry predicts places that had no part in it no better than the declared one: nothing is said of home positions and \
             sizes, and machine.toml has the declared ones.",
        )];
    }
    let mut all = Vec::new();
    let list = |of: Vec<String>| of.join(", ");
    let zeros = found.zeros();
    let told = |e: &&Estimate| e.identifiable;
    let add = |(name, e): &(String, &Estimate)| format!("{name} {}", number(e, e.held));
    let some: Vec<String> = zeros.iter().filter(|(_, e)| e.identifiable).map(add).collect();
    if !some.is_empty() {
        all.push(Finding::good(format!(
            "Add to the home positions of the drives, ± one standard deviation: {}.",
            list(some)
        )));
    }
    let is_size = |e: &&Estimate| matches!(e.meaning, Meaning::Size(_) | Meaning::Wrist(_) | Meaning::ToolY);
    let change = |e: &Estimate| format!("{} {}", e.meaning.key(), number(e, e.value - e.declared));
    let differs = |e: &&Estimate| (e.value - e.declared).abs() > SIGNIFICANT_SD * e.sd;
    let changed: Vec<String> =
        found.estimates.iter().filter(is_size).filter(told).filter(differs).map(change).collect();
    all.push(Finding::good(if changed.is_empty() {
        format!("No size differs from its declared value by more than {SIGNIFICANT_SD} of its standard deviations.")
    } else {
        let has = if found.found().next().is_none() { "has them" } else { "has those that suit the controller" };
        format!("True sizes less declared ones, ± one standard deviation: {}. machine.toml {has}.", list(changed))
    }));
    if let Some(e) = found.estimates.iter().find(|e| e.meaning == Meaning::ToolY).filter(differs) {
        all.push(Finding::warning(format!(
            "The tip sits {} (± one standard deviation) beside the plane of the wrist: the controller's kinematics have no such offset, align the spindle or the ball.",
            number(e, e.value)
        )));
    }
    all
}

/// The sentences of the conclusion, the most important first.
fn findings(found: &Identification) -> Vec<Finding> {
    let mut all = vec![verdict(found)];
    all.extend(numbers(found));
    for d in found.directions.iter().filter(|d| !d.is_identified()) {
        all.push(Finding::warning(format!(
            "The readings do not tell {} ({}): it stays within its declared uncertainty; {}.",
            if d.parts.len() == 1 { "one number" } else { "a combination of numbers that change together" },
            d.text(),
            remedy(&d.parts)
        )));
    }
    for e in found.estimates.iter().filter(|e| found.is_of_use() && e.pull_sd().abs() > MAX_PULL_SD) {
        all.push(Finding::warning(format!(
            "{} is {:.1} declared deviations from its declared value: is uncertainty.{} too small, or the machine another?",
            e.meaning.key(),
            e.pull_sd().abs(),
            if e.meaning.is_angle() { "geometry_mrad" } else { "geometry_mm" }
        )));
    }
    for s in found.suspects.iter().filter(|s| s.is_excluded) {
        all.push(Finding::warning(format!(
            "Line {} is {:.0} standard deviations off and was left out: measure it again.",
            s.line, s.residual_sd
        )));
    }
    let many: Vec<u64> = found.suspects.iter().filter(|s| !s.is_excluded).map(|s| s.line).collect();
    if !many.is_empty() {
        all.push(Finding::warning(format!(
            "{} readings are farther off than noise goes, too many to be left out as single errors ({}): look at these first.",
            many.len(),
            lines_text(&many)
        )));
    }
    all
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(found: &Identification) -> [Finding; 2] {
    let unknown = found.directions.iter().filter(|d| !d.is_identified()).count();
    let told = match unknown {
        0 => "the readings tell every number".to_owned(),
        n => format!("{n} of {} combinations of numbers are not told by the readings", found.directions.len()),
    };
    let noise = found.lack_of_fit.get(1).map_or(String::new(), |l| format!("; lack of fit p = {:.2}", l.p));
    let todo = match found.verdict {
        Verdict::Adequate if unknown == 0 => "put the zeros into the drives, and use machine.toml from now on.",
        Verdict::Adequate => {
            "use machine.toml, and measure what is proposed below before the numbers are taken for the machine's."
        }
        Verdict::Explained => {
            "mend the joints that are named, then measure again; until then machine.toml is the best the controller can hold."
        }
        Verdict::PartlyExplained | Verdict::Unexplained => {
            "look for what was loose or warm and check the declared noise, then measure again."
        }
    };
    [Finding::good(format!("{told}{noise}.")).sure(), Finding::good(todo).todo()]
}

/// For the terminal.
pub fn text(found: &Identification) -> String {
    let mut text = format!("{} numbers at {} poses\n", found.size.0, found.size.1);
    for e in found.estimates.iter().filter(|_| found.is_of_use()) {
        let mark = if e.identifiable { "" } else { "  not identifiable" };
        text.push_str(&format!(
            "  {:<18} {:>12.4} -> {:>12.4} {} (sd {:.4}){mark}\n",
            e.meaning.key(),
            1e3 * e.declared,
            1e3 * e.value,
            e.unit(),
            1e3 * e.sd
        ));
    }
    findings(found).iter().for_each(|f| text.push_str(&format!("- {}\n", f.text)));
    text
}

/// A round number below another.
fn round(value: f64) -> f64 {
    let power = 10_f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].into_iter().map(|n| n * power).find(|n| *n <= value).unwrap_or(power)
}

/// A place and its error along two axes of the measuring frame, m.
type Vector = ([f64; 2], [f64; 2]);

/// Errors at the places measured.
fn vectors(unloaded: &Unloaded, found: &Identification, said: &[[f64; 4]], [right, up]: [usize; 2]) -> Vec<Vector> {
    let vector = |(r, said): (&UnloadedReading, &[f64; 4])| {
        let at = [r.observed[right]?, r.observed[up]?];
        Some((at, [at[0] - said[right], at[1] - said[up]]))
    };
    found.kept(unloaded).zip(said).filter_map(vector).collect()
}

/// How many times as long as they are vectors are drawn; none where there are none.
fn exaggeration(all: &[Vector]) -> Option<f64> {
    let extent = [0, 1].map(|i| {
        let (low, high) =
            all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (p, _)| (l.min(p[i]), h.max(p[i])));
        high - low
    });
    let longest = all.iter().map(|(_, e)| e[0].hypot(e[1])).fold(0.0, f64::max);
    (longest > 0.0).then(|| round(LONGEST_VECTOR * extent[0].max(extent[1]) / longest))
}

fn vector_panel(name: &str, [right, up]: [usize; 2], all: &[Vector], factor: f64) -> Panel {
    let ends = |(at, e): &([f64; 2], [f64; 2])| {
        let end = |i: usize| 1e3 * (at[i] + factor * e[i]);
        [(1e3 * at[0], 1e3 * at[1]), (end(0), end(1))]
    };
    let axis = |i: usize| format!("{} in mm", ["x", "y", "z"][i]);
    Panel {
        title: format!("{name}, errors {factor} times"),
        x_label: axis(right),
        y_label: axis(up),
        series: vec![Series { name: name.to_owned(), points: all.iter().flat_map(ends).collect(), mark: Mark::Vector }],
    }
}

/// Pictures: errors before and after.
fn pictures(unloaded: &Unloaded, found: &Identification) -> Result<Markup> {
    let views = [[0, 1], [0, 2]];
    let rivals = [("declared", &found.said_declared_m), ("identified", &found.said_m)];
    let mut panels = Vec::new();
    for (name, said) in rivals {
        let of_views = views.map(|view| vectors(unloaded, found, said, view));
        // the same for both views: they are compared
        let Some(factor) = of_views.iter().filter_map(|all| exaggeration(all)).reduce(f64::min) else { continue };
        let drawn = views.iter().zip(&of_views).filter(|(_, all)| !all.is_empty());
        panels.extend(drawn.map(|(view, all)| vector_panel(name, *view, all, factor)));
    }
    if panels.is_empty() {
        return Ok(html! {});
    }
    charts(
        "Measured places less predicted ones, in the measuring frame, before and after; the dot is the measured end. Errors that are left \
         should point anywhere.",
        &panels,
    )
}

fn parameters(found: &Identification) -> Markup {
    let row = |e: &Estimate| {
        let mm = |v: f64| format!("{:.4}", 1e3 * v);
        let cells = vec![
            e.unit().to_owned(),
            mm(e.declared),
            mm(e.value),
            mm(e.value - e.declared),
            mm(e.sd),
            if e.identifiable { "yes" } else { "no" }.to_owned(),
            mm(e.held),
        ];
        (e.meaning.key(), cells)
    };
    let heads = ["unit", "declared", "identified", "change", "sd", "identifiable", "for the controller"];
    table(
        "Numbers of the machine with one standard deviation. Zeros are true positions less commanded ones. For the controller: as \
         machine.toml has them; other than the true ones where its kinematics make up for what they cannot hold.",
        &heads,
        &found.estimates.iter().map(row).collect::<Vec<_>>(),
    )
}

fn errors(found: &Identification) -> Markup {
    let lack = |l: &LackOfFit| vec![format!("{:.2}", l.statistic), p_value(l.p)];
    let rows: Vec<(String, Vec<String>)> = [
        ("declared", Rival::Declared),
        ("identified", Rival::Identified),
        ("identified with its findings", Rival::WithFound),
    ]
    .into_iter()
    .zip(&found.lack_of_fit)
    .map(|((name, rival), l)| {
        let own = found.errors.iter().find(|(r, _)| *r == rival).map(|(_, e)| e);
        let of = |e: Option<&pkm_diagnosis::validation::Errors>| {
            e.map_or(vec![String::new(); 3], |e| {
                let k = &e.kinds[0];
                vec![
                    format!("{:.2}", k.rms * 1e6),
                    format!("{:.2}", k.max * 1e6),
                    format!("{:.3}", e.chi2_per_dof.sqrt()),
                ]
            })
        };
        (name.to_owned(), [of(own), of(found.held_out_of(rival)), lack(l)].concat())
    })
    .collect();
    let heads = [
        "rms in µm",
        "greatest in µm",
        "over noise",
        "held out: rms in µm",
        "greatest in µm",
        "over noise",
        "reduced χ² or F",
        "p",
    ];
    table("Length of the error of measured places, or of distances, and the test for more than noise.", &heads, &rows)
}

/// `report.html`.
///
/// # Errors
/// What the drawing library says.
pub fn html(
    file: &MachineFile,
    unloaded: &Unloaded,
    held_out: Option<&Unloaded>,
    found: &Identification,
    warnings: &[String],
) -> Result<String> {
    let direction = |d: &super::Direction| {
        let told = if d.is_identified() { "yes" } else { "no" };
        (format!("{:.3e}", d.singular_value), vec![told.to_owned(), d.text()])
    };
    let tried = |t: &super::Tried| {
        let state = match t.state {
            TriedState::Found => "found",
            TriedState::Alike => "cannot be told from it",
            TriedState::Rejected => "rejected",
        };
        (t.id.clone(), vec![format!("{:.1}", t.gain), format!("{:.3}", t.left_out_gain), state.to_owned()])
    };
    let directions: Vec<_> = found.directions.iter().map(direction).collect();
    let body = html! {
        h2 { "Errors before and after" }
        (pictures(unloaded, found)?)
        (errors(found))
        h2 { "Geometry" }
        (parameters(found))
        (fold("What the readings tell: singular values", &table(
            "Each line a combination of numbers, in declared deviations: how many times noise its declared uncertainty is. Below 3 it is not identified.",
            &["identified", "combination"],
            &directions,
        )))
        @if !found.tried.is_empty() {
            (table(
                "What was tried beside the geometry: gain of 2 ln evidence, and share of the squared error on poses left out that it saves.",
                &["gain", "saved", ""],
                &found.tried.iter().map(tried).collect::<Vec<_>>(),
            ))
        }
    };
    let mut facts = vec![("Machine", of_file(&file.source)), ("Readings", of_file(&unloaded.source))];
    facts.extend(held_out.map(|h| ("Held-out readings", of_file(&h.source))));
    let mut findings = findings(found);
    findings.extend(advice(found));
    Ok(Page { title: "Geometry of the unloaded machine".into(), findings: &findings, warnings, body, facts }.html())
}

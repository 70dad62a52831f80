//! Rates over many sets, as tables.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::{Answer, Outcome};
use crate::effects::is_of_the_measurement;

/// Wilson's 95 % interval of a rate.
pub fn wilson(hits: usize, of: usize) -> (f64, f64) {
    let (n, p, z) = (of as f64, hits as f64 / of as f64, 1.959_964);
    let middle = (p + z * z / (2.0 * n)) / (1.0 + z * z / n);
    let half = z / (1.0 + z * z / n) * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

/// A table: heads, then rows of cells.
struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    fn new(head: &[&str]) -> Self {
        Self { head: head.iter().map(|s| (*s).to_owned()).collect(), rows: Vec::new() }
    }

    fn text(&self, markdown: bool) -> String {
        let all = || [&self.head].into_iter().chain(&self.rows);
        let width = |i: usize| all().map(|r| r[i].chars().count()).max().unwrap_or(0);
        let mut s = String::new();
        for (n, row) in all().enumerate() {
            let cells: Vec<String> = row.iter().enumerate().map(|(i, c)| format!("{c:<w$}", w = width(i))).collect();
            _ = if markdown { writeln!(s, "| {} |", cells.join(" | ")) } else { writeln!(s, "{}", cells.join("  ")) };
            if n == 0 && markdown {
                _ = writeln!(s, "|{}", "---|".repeat(row.len()));
            }
        }
        s
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    if n == 0 { f64::NAN } else { 0.5 * (values[(n - 1) / 2] + values[n / 2]) }
}

/// Sets of one kind.
fn of_kind<'a>(outcomes: &'a [Outcome], kind: &str) -> Vec<&'a Outcome> {
    outcomes.iter().filter(|o| o.truth.kind == kind).collect()
}

/// Those with λ within bounds.
fn within<'a>(outcomes: &[&'a Outcome], low: f64, high: f64) -> Vec<&'a Outcome> {
    outcomes.iter().filter(|o| (low..high).contains(&o.truth.lambda)).copied().collect()
}

fn answered(o: &Outcome, says: impl Fn(&Answer) -> bool) -> bool {
    o.answer.as_ref().is_ok_and(says)
}

fn everywhere(o: &Outcome) -> bool {
    o.located().iter().all(|there| *there)
}

/// Held-out error of the identified model over that of re-identified stiffnesses.
fn over_reidentified(o: &Outcome) -> f64 {
    o.answer.as_ref().map_or(f64::NAN, |a| a.after / a.retuned.max(1e-12))
}

fn is_worse(o: &Outcome) -> bool {
    over_reidentified(o) > 1.05
}

/// Answered sets with effects of the machine alone: what the sensor adds is not in held-out deflections.
fn of_the_machine(outcomes: &[Outcome]) -> Vec<&Outcome> {
    let machine = |o: &&Outcome| {
        o.answer.is_ok()
            && ["one", "two"].contains(&o.truth.kind.as_str())
            && !o.truth.effects.iter().any(|(id, ..)| is_of_the_measurement(id))
    };
    outcomes.iter().filter(machine).collect()
}

/// Answered sets whose truth has forms that no candidate has.
fn of_forms(outcomes: &[Outcome]) -> Vec<&Outcome> {
    let forms = [of_kind(outcomes, "forms"), of_kind(outcomes, "form-pairs")].concat();
    forms.into_iter().filter(|o| o.answer.is_ok()).collect()
}

/// How often something is so, by kind.
struct Rates(Table);

impl Rates {
    /// A row, unless there are no such sets.
    fn add(&mut self, name: &str, among: &[&Outcome], target: &str, hit: impl Fn(&Outcome) -> bool) {
        if among.is_empty() {
            return;
        }
        let hits = among.iter().filter(|o| hit(o)).count();
        let (low, high) = wilson(hits, among.len());
        let percent = |x: f64| format!("{:.1} %", 100.0 * x);
        let share = percent(hits as f64 / among.len() as f64);
        let interval = format!("{:.1}-{:.1} %", 100.0 * low, 100.0 * high);
        let (hits, of) = (hits.to_string(), among.len().to_string());
        self.0.rows.push(vec![name.to_owned(), hits, of, share, interval, target.to_owned()]);
    }

    /// Where there is nothing to be found.
    fn of_nothing(&mut self, outcomes: &[Outcome]) {
        let found = |o: &Outcome| answered(o, |a| !a.effects.is_empty());
        let clean = of_kind(outcomes, "none");
        self.add("clean: an effect named", &clean, "<= 1 %", found);
        self.add("clean: verdict not adequate", &clean, "", |o| !answered(o, |a| a.verdict == "adequate"));
        self.add("clean: lack of fit p < 0.01", &clean, "about 1 %", |o| answered(o, |a| a.lack_of_fit < 0.01));
        self.add("clean: a declared value blamed", &clean, "", |o| answered(o, |a| !a.findings.is_empty()));
        self.add("load errors: an effect named", &of_kind(outcomes, "load-errors"), "<= 2 %", found);
        self.add("15 % scatter: an effect named", &of_kind(outcomes, "scatter"), "<= 1 %", found);
    }

    /// Effects on the list, alone and in pairs, and wrong declared values.
    fn of_the_list(&mut self, outcomes: &[Outcome]) {
        let one = of_kind(outcomes, "one");
        for (name, low, high, target, place) in [
            ("one, λ < 30", 0.0, 30.0, "", ""),
            ("one, λ 30-100", 30.0, 100.0, ">= 85 %", ">= 90 %"),
            ("one, λ 100-400", 100.0, 400.0, "", ""),
            ("one, λ 400-1000", 400.0, 1000.0, "", ""),
            ("one, λ >= 1000", 1000.0, f64::INFINITY, "", ""),
            ("one, λ >= 100", 100.0, f64::INFINITY, ">= 95 %", ">= 97 %"),
        ] {
            let sets = within(&one, low, high);
            self.add(&format!("{name}: right class"), &sets, target, Outcome::is_right);
            self.add(&format!("{name}: a wrong name"), &sets, "", |o| !o.wrong().is_empty());
            self.add(&format!("{name}: right place"), &sets, place, |o| o.located() == [true]);
            self.add(&format!("{name}: a wrong place"), &sets, "<= 3 %", |o| o.misplaced() > 0);
        }
        self.add("declared value: found", &of_kind(outcomes, "declared"), ">= 95 %", Outcome::declared_found);
        let two = of_kind(outcomes, "two");
        let hits = |o: &Outcome| o.right().iter().filter(|r| **r).count();
        let both = |o: &Outcome| hits(o) == o.truth.effects.len() && o.wrong().is_empty();
        self.add("two: both and nothing else", &two, ">= 70 %", both);
        self.add("two: one right", &two, ">= 95 %", |o| hits(o) > 0);
        self.add("two: a wrong one", &two, "<= 10 %", |o| !o.wrong().is_empty());
        self.add("two: both places and no other", &two, ">= 80 %", |o| everywhere(o) && o.misplaced() == 0);
        self.add("two: a wrong place", &two, "<= 8 %", |o| o.misplaced() > 0);
    }

    /// Physics on no list, and places on it with other forms.
    fn of_other_forms(&mut self, outcomes: &[Outcome]) {
        let outside = of_kind(outcomes, "outside");
        self.add("outside the list: not claimed", &outside, ">= 95 %", |o| o.answer.is_ok() && !o.claimed());
        let missed = |a: &Answer| a.verdict == "adequate" && a.effects.is_empty();
        self.add("outside the list: of these missed", &outside, "", |o| answered(o, missed));
        let strong = within(&outside, 100.0, f64::INFINITY);
        self.add("outside the list, λ >= 100: right place", &strong, ">= 75 %", everywhere);
        self.add("outside the list: a wrong place", &outside, "<= 10 %", |o| o.misplaced() > 0);
        let forms = of_kind(outcomes, "forms");
        for (name, low, high, target) in
            [("a form, λ 30-100", 30.0, 100.0, ">= 85 %"), ("a form, λ >= 100", 100.0, f64::INFINITY, ">= 92 %")]
        {
            let sets = within(&forms, low, high);
            self.add(&format!("{name}: right place"), &sets, target, |o| o.located() == [true]);
            self.add(&format!("{name}: a wrong place"), &sets, "<= 8 %", |o| o.misplaced() > 0);
        }
        let pairs = of_kind(outcomes, "form-pairs");
        self.add("two forms: both places and no other", &pairs, ">= 65 %", |o| everywhere(o) && o.misplaced() == 0);
        self.add("two forms: a wrong place", &pairs, "<= 12 %", |o| o.misplaced() > 0);
    }

    /// Errors on poses that had no part.
    fn held_out(&mut self, outcomes: &[Outcome]) {
        let machine = of_the_machine(outcomes);
        self.add("held out: effect over re-identified above 1.05", &machine, "<= 2 %", is_worse);
        let forms = of_forms(outcomes);
        self.add("forms: held out, effect over re-identified above 1.05", &forms, "<= 4 %", is_worse);
        let answered: Vec<&Outcome> = outcomes.iter().filter(|o| o.answer.is_ok()).collect();
        self.add("held out, all kinds: above 1.05", &answered, "", is_worse);
        let inside = |o: &Outcome| {
            let answer = o.answer.as_ref().ok()?;
            let (low, high) = answer.interval?;
            Some((low..=high).contains(&answer.over_many?))
        };
        let bounded: Vec<&Outcome> = answered.iter().filter(|o| inside(o).is_some()).copied().collect();
        let name = "held out: error over 264 poses within the interval of 22";
        self.add(name, &bounded, "92-97 %", |o| inside(o) == Some(true));
    }
}

/// Medians and worst of ratios of held-out errors, and of seconds.
fn errors(outcomes: &[Outcome]) -> Table {
    let mut table = Table::new(&["held-out error", "sets", "median", "worst", "target of median"]);
    let mut add = |name: &str, values: Vec<f64>, target: &str| {
        if !values.is_empty() {
            let worst = values.iter().copied().fold(f64::NAN, f64::max);
            let cells = [values.len().to_string(), format!("{:.3}", median(values)), format!("{worst:.3}")];
            table.rows.push([vec![name.to_owned()], cells.to_vec(), vec![target.to_owned()]].concat());
        }
    };
    let ratios = |sets: &[&Outcome], low: f64| -> Vec<f64> {
        within(sets, low, f64::INFINITY).into_iter().map(over_reidentified).collect()
    };
    let machine = of_the_machine(outcomes);
    add("effect / re-identified, λ >= 100", ratios(&machine, 100.0), "<= 0.4");
    add("effect / re-identified, λ >= 1000", ratios(&machine, 1000.0), "<= 0.15");
    let forms = of_forms(outcomes);
    add("forms: effect / re-identified, λ >= 100", ratios(&forms, 100.0), "<= 0.6");
    add("forms: effect / re-identified, λ >= 1000", ratios(&forms, 1000.0), "<= 0.4");
    let gain = |o: &Outcome| o.answer.as_ref().map_or(f64::NAN, |a| a.after / a.before.max(1e-12));
    let strong = within(&machine, 400.0, f64::INFINITY);
    add("effect / declared, λ >= 400", strong.into_iter().map(gain).collect(), "");
    let sensed = outcomes.iter().filter(|o| o.truth.effects.iter().any(|(id, ..)| is_of_the_measurement(id)));
    let sensed = sensed.filter(|o| o.answer.is_ok());
    add("effect / re-identified, of the measurement", sensed.map(over_reidentified).collect(), "");
    add("seconds", outcomes.iter().map(|o| o.seconds).collect(), "");
    table
}

/// Lower ends of the groups of stated probabilities: tenths, and the last one more finely, where most are.
const STATED: [f64; 12] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99];

/// How often what is said with some probability is so.
fn calibration(outcomes: &[Outcome]) -> Table {
    let mut table = Table::new(&["place, stated probability", "finds", "stated, mean", "right", "95 %"]);
    let all: Vec<(f64, bool)> = outcomes.iter().flat_map(Outcome::stated).collect();
    for (n, low) in STATED.iter().enumerate() {
        let high = STATED.get(n + 1).copied().unwrap_or(f64::INFINITY);
        let group: Vec<&(f64, bool)> = all.iter().filter(|s| (*low..high).contains(&s.0)).collect();
        if group.is_empty() {
            continue;
        }
        let (count, hits) = (group.len(), group.iter().filter(|s| s.1).count());
        let (worst, best) = wilson(hits, count);
        let mean = group.iter().map(|s| s.0).sum::<f64>() / count as f64;
        table.rows.push(vec![
            format!("{low:.2}-{:.2}", high.min(1.0)),
            count.to_string(),
            format!("{mean:.3}"),
            format!("{:.3}", hits as f64 / count as f64),
            format!("{:.1}-{:.1} %", 100.0 * worst, 100.0 * best),
        ]);
    }
    table
}

/// Single effects by name.
fn by_effect(outcomes: &[Outcome]) -> Table {
    let mut ids: BTreeMap<&str, (usize, usize, Vec<&str>)> = BTreeMap::new();
    for o in within(&of_kind(outcomes, "one"), 30.0, f64::INFINITY) {
        let (hits, of, wrong) = ids.entry(&o.truth.effects[0].0).or_default();
        *hits += usize::from(o.is_right());
        *of += 1;
        wrong.extend(o.wrong());
    }
    let mut table = Table::new(&["one effect, λ >= 30", "right", "of", "named instead"]);
    for (id, (hits, of, wrong)) in ids {
        table.rows.push(vec![id.to_owned(), hits.to_string(), of.to_string(), wrong.join(", ")]);
    }
    table
}

/// All rates, as text or Markdown.
pub fn report(outcomes: &[Outcome], markdown: bool) -> String {
    let mut rates = Rates(Table::new(&["rate", "hits", "of", "share", "95 %", "target"]));
    rates.add("failed runs", &outcomes.iter().collect::<Vec<_>>(), "0", |o| o.answer.is_err());
    rates.of_nothing(outcomes);
    rates.of_the_list(outcomes);
    rates.of_other_forms(outcomes);
    rates.held_out(outcomes);
    let tables = [rates.0, errors(outcomes), calibration(outcomes), by_effect(outcomes)];
    let shown: Vec<String> = tables.iter().filter(|t| !t.rows.is_empty()).map(|t| t.text(markdown)).collect();
    shown.join("\n")
}

//! The one design of all reports: a page that stands alone, for screen, mobile and paper.
//!
//! Commands make their own pictures and tables; what a page is made of, and in which order, is said here. All of it can be read without the
//! script, which adds values under the pointer, series that are switched off, tables that are sorted, and ways between rows and points.

mod chart;
pub mod plot;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use self::plot::Panel;
use crate::error::Result;
use crate::files::source::Source;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("page.js");
/// Around what a page says first.
const HEADLINE: [&str; 2] = ["<p class=\"headline\">", "</p>"];

/// Sections from which on a page has a list of them.
const CONTENTS: usize = 3;

/// Sentences beside the first that are shown at once.
const SHOWN: usize = 5;
/// Letters beside each other on a printed page of a table: what is wider is cut into several.
const LETTERS: usize = 160;
/// What the borders of a cell take of that.
const BORDERS: usize = 1;
/// Letters of the cells beside a name with which two tables have room beside each other on paper.
const HALF: usize = 48;
/// Letters of name and cells of a table of which three parts have.
const THIRD: usize = LETTERS / 3;
/// Rows of tables that are not parted on paper.
const MAX_ROWS_KEPT_TOGETHER: usize = 26;
/// A cell of more letters is a sentence, in as many lines as it needs.
const SENTENCE: usize = 30;

/// What to think of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum State {
    Good,
    Warning,
    Bad,
}

impl State {
    fn class(self) -> &'static str {
        match self {
            Self::Good => "good",
            Self::Warning => "warning",
            Self::Bad => "bad",
        }
    }

    fn symbol(self) -> &'static str {
        match self {
            Self::Good => "✓",
            Self::Warning => "⚠",
            Self::Bad => "✗",
        }
    }

    fn word(self) -> &'static str {
        match self {
            Self::Good => "Good",
            Self::Warning => "Take care",
            Self::Bad => "Don't rely on it",
        }
    }
}

/// What a sentence is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// What was found.
    Found,
    /// How sure that is.
    Sure,
    /// What to do about it.
    Todo,
}

/// A sentence of the conclusion. The first of several is the verdict.
pub(crate) struct Finding {
    pub(crate) state: State,
    pub(crate) text: String,
    role: Role,
}

impl Finding {
    fn new(state: State, text: impl Into<String>) -> Self {
        Self { state, text: text.into(), role: Role::Found }
    }

    /// Says how sure the verdict is: shown right below it.
    pub(crate) fn sure(self) -> Self {
        Self { role: Role::Sure, ..self }
    }

    /// Says what to do: shown right below the verdict.
    pub(crate) fn todo(self) -> Self {
        Self { role: Role::Todo, ..self }
    }

    pub(crate) fn good(text: impl Into<String>) -> Self {
        Self::new(State::Good, text)
    }

    pub(crate) fn warning(text: impl Into<String>) -> Self {
        Self::new(State::Warning, text)
    }

    pub(crate) fn bad(text: impl Into<String>) -> Self {
        Self::new(State::Bad, text)
    }
}

/// A page, in the order in which it is read.
pub(crate) struct Page<'a> {
    pub(crate) title: String,
    /// At least one.
    pub(crate) findings: &'a [Finding],
    /// Of the files and the call, said after the first finding.
    pub(crate) warnings: &'a [String],
    /// Pictures, then tables.
    pub(crate) body: Markup,
    /// Where it comes from, beside the program's version.
    pub(crate) facts: Vec<(&'a str, String)>,
}

impl Page<'_> {
    pub(crate) fn html(self) -> String {
        let verdict = &self.findings[0];
        let warnings: Vec<Finding> = self.warnings.iter().map(Finding::warning).collect();
        let of = |role: Role| self.findings[1..].iter().filter(move |f| f.role == role);
        let others: Vec<&Finding> = warnings.iter().chain(of(Role::Found)).collect();
        // a heading for one takes as much room as that one
        let shown = if others.len() == SHOWN + 1 { others.len() } else { others.len().min(SHOWN) };
        let (shown, more) = others.split_at(shown);
        let list = |findings: &[&Finding]| {
            html! {
                ul {
                    @for f in findings {
                        @if f.state == State::Good { li { (f.text) } }
                        @else { li class=(f.state.class()) { (f.state.symbol()) " " (f.text) } }
                    }
                }
            }
        };
        let (body, sections) = sections(&self.body.into_string());
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    main {
                        h1 { (self.title) }
                        section.verdict.(verdict.state.class()) {
                            p.state { span aria-hidden="true" { (verdict.state.symbol()) } " " (verdict.state.word()) }
                            (PreEscaped(HEADLINE[0])) (verdict.text) (PreEscaped(HEADLINE[1]))
                            @for (role, words) in [(Role::Sure, "How sure"), (Role::Todo, "What to do")] {
                                @for f in of(role) { p { strong { (words) ": " } (f.text) } }
                            }
                            @if !shown.is_empty() { (list(shown)) }
                            @if !more.is_empty() { (fold(&format!("{} more", more.len()), &list(more))) }
                        }
                        @if sections.len() >= CONTENTS {
                            nav aria-label="Contents" { ul { @for (id, title) in &sections { li { a href={ "#" (id) } { (PreEscaped(title)) } } } } }
                        }
                        (PreEscaped(body))
                        h2 id="origin" { "Where this comes from" }
                        dl {
                            dt { "Program" }
                            dd { "pkm-host " (env!("CARGO_PKG_VERSION")) }
                            @for (name, value) in &self.facts { dt { (name) } dd { (value) } }
                        }
                    }
                    script { (PreEscaped(SCRIPT)) }
                }
            }
        };
        page.into_string() + "\n"
    }
}

/// What a page says first, as it stands in it.
pub(crate) fn headline(html: &str) -> Option<&str> {
    let (_, rest) = html.split_once(HEADLINE[0])?;
    Some(rest.split_once(HEADLINE[1])?.0)
}

/// The first picture of a page, as it stands there, without its caption.
pub(crate) fn first_picture(html: &str) -> Option<String> {
    const END: &str = "</svg>";
    let (_, rest) = html.split_once("<figure class=\"picture")?;
    let several = rest.starts_with('s');
    let rest = &rest[rest.find("<svg")?..];
    let svg = PreEscaped(&rest[..rest.find(END)? + END.len()]);
    let figure =
        html! { figure.picture[!several].pictures[several] { div tabindex=[(!several).then_some("0")] { (svg) } } };
    Some(figure.into_string())
}

/// A page that says when it was made, too: not one that has to be the same whenever it is made.
pub(crate) fn dated(html: &str, when: &str) -> String {
    let fact = html! { dt { "Made" } dd { (when) } }.into_string();
    html.replacen("</dl></main>", &format!("{fact}</dl></main>"), 1)
}

/// Judgements side by side, each with its name and reasons.
pub(crate) fn badges(all: &[(&str, Finding, &[String])]) -> Markup {
    html! {
        div.badges {
            @for (name, finding, reasons) in all {
                section.badge.(finding.state.class()) {
                    h2 { (name) }
                    p { strong { (finding.state.symbol()) " " (finding.text) } }
                    @for reason in *reasons { p { (reason) } }
                }
            }
        }
    }
}

/// Gives each heading of a body a name to go to: the body, and the names with their titles.
fn sections(body: &str) -> (String, Vec<(String, String)>) {
    let mut parts = body.split("<h2>");
    let mut named = parts.next().unwrap_or_default().to_owned();
    let mut all = Vec::new();
    for (n, part) in parts.enumerate() {
        let id = format!("section-{}", n + 1);
        let title = part.split("</h2>").next().unwrap_or_default();
        // a heading that is a link is one already
        let text = title.split('<').map(|t| t.rsplit_once('>').map_or(t, |(_, text)| text)).collect();
        named.push_str(&format!("<h2 id=\"{id}\">{part}"));
        all.push((id, text));
    }
    (named, all)
}

/// Name and checksum of a file that was read.
pub(crate) fn of_file(source: &Source) -> String {
    format!("{}, SHA-256 {}", source.file_name(), source.sha256())
}

/// A picture that is too wide for a mobile.
pub(crate) fn picture(caption: &str, svg: &str) -> Markup {
    html! { figure.picture { div tabindex="0" { (PreEscaped(svg)) } figcaption { (caption) } } }
}

/// Small pictures under one caption, as many beside each other as there is room for.
pub(crate) fn pictures(caption: &str, svgs: &[String]) -> Markup {
    html! { figure.pictures.pairs[svgs.len() == 4] { div { @for svg in svgs { (PreEscaped(svg)) } } figcaption { (caption) } } }
}

/// Maps under one caption: larger on paper than other small pictures, since their numbers are small.
pub(crate) fn map_pictures(caption: &str, svgs: &[String]) -> Markup {
    html! { figure.pictures.maps.pairs[svgs.len() == 4] { div { @for svg in svgs { (PreEscaped(svg)) } } figcaption { (caption) } } }
}

/// Charts under one caption.
pub(crate) fn charts(caption: &str, panels: &[Panel]) -> Result<Markup> {
    Ok(pictures(caption, &panels.iter().map(plot::panel).collect::<Result<Vec<_>>>()?))
}

/// The same with keys by series and point, as rows of [`keyed_table`] have them.
pub(crate) fn keyed_charts(caption: &str, panels: &[(Panel, Vec<Vec<usize>>)]) -> Result<Markup> {
    let drawn = panels.iter().map(|(panel, keys)| plot::keyed(panel, keys));
    Ok(pictures(caption, &drawn.collect::<Result<Vec<_>>>()?))
}

/// A table with a name a row, cut where a printed page ends.
pub(crate) fn table(caption: &str, heads: &[&str], rows: &[(String, Vec<String>)]) -> Markup {
    keyed_table(caption, heads, rows, &[])
}

/// The same with a key a row: it leads to the points of charts that have the same one. Paper has its first rows alone.
pub(crate) fn keyed_table(caption: &str, heads: &[&str], rows: &[(String, Vec<String>)], keys: &[usize]) -> Markup {
    let letters = |text: &str| text.chars().count();
    let cell_width = |text: &str| letters(text).min(SENTENCE);
    let word = |text: &str| text.split(' ').map(letters).max().unwrap_or(0);
    let widths: Vec<usize> = (heads.iter().enumerate())
        .map(|(i, head)| BORDERS + rows.iter().map(|r| cell_width(&r.1[i])).fold(word(head), usize::max))
        .collect();
    let names = rows.iter().map(|r| word(&r.0)).fold(letters("deflection"), usize::max) + BORDERS;
    let parts = widths.iter().sum::<usize>().div_ceil(LETTERS.saturating_sub(names).max(1)).max(1);
    let columns = heads.len().div_ceil(parts).max(1);
    let sentences: Vec<bool> = (0..heads.len()).map(|i| rows.iter().any(|r| letters(&r.1[i]) > SENTENCE)).collect();
    let (cells, whole) = (widths.iter().sum::<usize>(), keys.is_empty());
    let half = whole && !sentences.contains(&true) && cells <= HALF && rows.len() <= MAX_ROWS_KEPT_TOGETHER;
    let longest = rows.iter().map(|r| letters(&r.0)).max().unwrap_or(0);
    let slim = whole && longest + cells <= THIRD && rows.len() > MAX_ROWS_KEPT_TOGETHER;
    html! {
        figure.table.long[!whole].half[half].slim[slim] {
            figcaption { (caption) }
            @for first in (0..heads.len()).step_by(columns) {
                @let part = first..heads.len().min(first + columns);
                div tabindex="0" {
                    table {
                        thead { tr { td {} @for i in part.clone() { th.words[sentences[i]] scope="col" { (heads[i]) } } } }
                        tbody {
                            @for (n, (name, cells)) in rows.iter().enumerate() {
                                tr data-key=[keys.get(n)] {
                                    th scope="row" { (name) }
                                    @for i in part.clone() { td.words[sentences[i]] { (cells[i]) } }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What is long and in a file too: folded on a screen, and on paper the name of that file.
pub(crate) fn on_screen(summary: &str, file: &str, body: &Markup) -> Markup {
    html! {
        details.screen { summary { (summary) } (body) }
        p.paper { strong { (summary) } ": in " (file) "." }
    }
}

/// What is long: open on paper.
pub(crate) fn fold(summary: &str, body: &Markup) -> Markup {
    html! { details { summary { (summary) } (body) } }
}

/// Smallest probability that is written as a number: smaller ones are no longer exact, or 0.
const MIN_P: f64 = 1e-300;

/// A probability that a test gives, for a cell.
pub(crate) fn p_value(p: f64) -> String {
    if p < MIN_P { format!("< {MIN_P:e}") } else { format!("{p:.1e}") }
}

/// The same in a sentence, as `p = 1.2e-5`.
pub(crate) fn p_in_words(p: f64) -> String {
    if p < MIN_P { format!("p {}", p_value(p)) } else { format!("p = {}", p_value(p)) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_probability_that_underflows_is_no_zero() {
        assert_eq!((super::p_value(1.24e-5), super::p_value(0.0)), ("1.2e-5".into(), "< 1e-300".into()));
        assert_eq!((super::p_in_words(0.03), super::p_in_words(1e-310)), ("p = 3.0e-2".into(), "p < 1e-300".into()));
    }
}

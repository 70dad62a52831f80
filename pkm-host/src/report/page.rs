//! The one design of all reports: a page that stands alone, without script, for screen, mobile and paper.
//!
//! Commands make their own pictures and tables; what a page is made of, and in which order, is said here.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::error::Result;
use crate::files::source::Source;
use crate::report::plot::{self, Panel};

const STYLE: &str = include_str!("style.css");

/// Sentences beside the first that are shown at once.
const SHOWN: usize = 5;
/// Letters beside each other on a printed page of a table: what is wider is cut into several.
const LETTERS: usize = 130;
/// What the borders of a cell take of that.
const BORDERS: usize = 1;
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

/// A sentence of the conclusion. The first of several is the verdict.
pub(crate) struct Finding {
    pub(crate) state: State,
    pub(crate) text: String,
}

impl Finding {
    pub(crate) fn good(text: impl Into<String>) -> Self {
        Self { state: State::Good, text: text.into() }
    }

    pub(crate) fn warning(text: impl Into<String>) -> Self {
        Self { state: State::Warning, text: text.into() }
    }

    pub(crate) fn bad(text: impl Into<String>) -> Self {
        Self { state: State::Bad, text: text.into() }
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
        let others: Vec<&Finding> = warnings.iter().chain(&self.findings[1..]).collect();
        let (shown, more) = others.split_at(others.len().min(SHOWN));
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
                    h1 { (self.title) }
                    section.verdict.(verdict.state.class()) {
                        p.state { span aria-hidden="true" { (verdict.state.symbol()) } " " (verdict.state.word()) }
                        p.headline { (verdict.text) }
                        @if !shown.is_empty() { (list(shown)) }
                        @if !more.is_empty() { (fold(&format!("{} more", more.len()), &list(more))) }
                    }
                    (self.body)
                    h2 { "Where this comes from" }
                    dl {
                        dt { "Program" }
                        dd { "pkm-host " (env!("CARGO_PKG_VERSION")) }
                        @for (name, value) in &self.facts { dt { (name) } dd { (value) } }
                    }
                }
            }
        };
        page.into_string() + "\n"
    }
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
    html! { figure.pictures { div { @for svg in svgs { (PreEscaped(svg)) } } figcaption { (caption) } } }
}

/// Charts under one caption.
pub(crate) fn charts(caption: &str, panels: &[Panel]) -> Result<Markup> {
    Ok(pictures(caption, &panels.iter().map(plot::panel).collect::<Result<Vec<_>>>()?))
}

/// A table with a name a row, cut where a printed page ends.
pub(crate) fn table(caption: &str, heads: &[&str], rows: &[(String, Vec<String>)]) -> Markup {
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
    html! {
        figure.table {
            figcaption { (caption) }
            @for first in (0..heads.len()).step_by(columns) {
                @let part = first..heads.len().min(first + columns);
                div tabindex="0" {
                    table {
                        thead { tr { td {} @for i in part.clone() { th.words[sentences[i]] scope="col" { (heads[i]) } } } }
                        tbody {
                            @for (name, cells) in rows {
                                tr {
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

/// What is long: open on paper.
pub(crate) fn fold(summary: &str, body: &Markup) -> Markup {
    html! { details { summary { (summary) } (body) } }
}

//! The page that leads to the reports of a demonstration.

use maud::{PreEscaped, html};

use crate::page::{Finding, Page, fold};

/// What one call made.
pub(crate) struct Exhibit {
    pub(crate) title: &'static str,
    /// What it is for.
    pub(crate) about: &'static str,
    /// Its page, from the folder.
    pub(crate) page: &'static str,
    /// As it is typed.
    pub(crate) command: String,
    /// What it printed.
    pub(crate) said: String,
    /// What its page says first, as HTML.
    pub(crate) headline: Option<String>,
    /// The first picture of its page, as HTML.
    pub(crate) picture: Option<String>,
}

/// `index.html`.
pub(crate) fn page(exhibits: &[Exhibit]) -> String {
    let findings = [
        Finding::good("Every page below was made just now, from the data in the folder data."),
        Finding::good("All readings are simulated, by solvers that share no code with this program."),
        Finding::good("In this folder every call can be made again, with other data."),
    ];
    let body = html! {
        @for exhibit in exhibits {
            h2 { a href=(exhibit.page) { (exhibit.title) } }
            p { (exhibit.about) }
            @if let Some(headline) = &exhibit.headline { p { strong { (PreEscaped(headline)) } } }
            @if let Some(picture) = &exhibit.picture { (PreEscaped(picture)) }
            // what scrolls has to be reached by keys
            pre tabindex="0" { (exhibit.command) }
            (fold("what it said", &html! { pre tabindex="0" { (exhibit.said.trim_end()) } }))
        }
    };
    Page { title: "What pkm-host makes".into(), findings: &findings, warnings: &[], body, facts: Vec::new() }.html()
}

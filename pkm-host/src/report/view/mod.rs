//! The page of `view`: the machine in 3D, driven by the core as WebAssembly.
//!
//! The page is one file: markup, style, scripts, the module and the data. What it computes with is `CORE`, built from `embed/wasm`
//! by `cargo xtask wasm`; the scripts turn pictures and write numbers down, and know no mechanics.

mod data;

use base64::prelude::{BASE64_STANDARD, Engine};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use pkm_view::{START, View};

use crate::error::{Failure, Result};
use crate::files::results::{DiagnosisResult, PlacementResult};
use crate::files::source;
use crate::plan::model::Model;
use crate::plan::play::PlayedPoint;

/// `embed/wasm`, built.
const CORE: &[u8] = include_bytes!("core.wasm");
const STYLE: &str = include_str!("view.css");
/// In the order in which they need each other.
const SCRIPTS: [&str; 10] = [
    include_str!("math.js"),
    include_str!("core.js"),
    include_str!("mesh.js"),
    include_str!("renderer.js"),
    include_str!("scene.js"),
    include_str!("controls.js"),
    include_str!("results.js"),
    include_str!("pointer.js"),
    include_str!("documents.js"),
    include_str!("main.js"),
];

/// Poses over which page and program compare their results.
pub const SWEPT_POSES: u32 = 10_000;

/// What is shown beside the machine.
pub struct Shown {
    /// Findings and readings.
    pub diagnosis: Option<DiagnosisResult>,
    /// Holes.
    pub placement: Option<PlacementResult>,
    /// To be played.
    pub path: Option<PlayedPath>,
}

/// A path as configurations.
pub struct PlayedPath {
    /// Of its file.
    pub name: String,
    /// In the path's order.
    pub points: Vec<PlayedPoint>,
}

/// A page, and what the core says of the machine.
pub struct ViewPage {
    /// The whole file.
    pub html: String,
    /// Over the results of [`SWEPT_POSES`] poses, 16 hexadecimal digits.
    pub checksum: String,
}

/// SHA-256 of the WebAssembly module.
pub fn core_sha256() -> String {
    source::sha256(CORE)
}

/// The page of a machine.
///
/// # Errors
/// A machine or a table that the core refuses.
pub fn page(model: &Model, shown: &Shown, warnings: &[String]) -> Result<ViewPage> {
    let machine = data::machine_numbers(&model.machine);
    let refused = |text: pkm_view::Text| Failure::input(String::from_utf8_lossy(text.bytes()).into_owned());
    let mut view = View::new(&machine).map_err(refused)?;
    let table = model.table.as_ref().map(data::table_numbers);
    if let Some(table) = &table {
        view.set_table(table).map_err(refused)?;
    }
    let checksum = format!("{:016x}", view.sweep(START, 0, SWEPT_POSES));
    let data = data::document(model, &machine, table.as_deref(), shown, &checksum, warnings);
    // as JSON has them, `<` is in texts alone
    let data = data.to_string().replace('<', "\\u003c");
    let core = BASE64_STANDARD.encode(CORE);
    let title = format!("Machine {}", model.machine.name);
    let html = markup(&title, &data, &core, shown).into_string() + "\n";
    Ok(ViewPage { html, checksum })
}

fn markup(title: &str, data: &str, core: &str, shown: &Shown) -> Markup {
    // nothing may be asked for; the module is compiled from the page's own bytes
    let policy =
        "default-src 'none'; script-src 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; img-src data:";
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta http-equiv="Content-Security-Policy" content=(policy);
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                header {
                    h1 { (title) }
                    p #state.state role="status" { "Starting" }
                    p #checksum.state { "Not compared yet" }
                }
                main {
                    (stage())
                    (panels(shown))
                }
                noscript { p { "This page needs JavaScript: it computes with the machine's own model." } }
                script #data type="application/json" { (PreEscaped(data)) }
                script #core type="application/wasm-base64" { (core) }
                script { (PreEscaped("\"use strict\";\n")) @for script in SCRIPTS { (PreEscaped(script)) } }
            }
        }
    }
}

/// The picture and what turns it.
fn stage() -> Markup {
    html! {
        section #stage aria-label="Picture of the machine" {
            canvas #picture tabindex="0" role="application" aria-roledescription="3D picture" aria-describedby="keys"
                aria-label="The machine in 3D" {}
            div #labels aria-hidden="true" {}
            p #legend {}
            div #tools role="toolbar" aria-label="Picture" {
                fieldset.segmented {
                    legend.hidden { "What dragging does" }
                    label { input type="radio" name="drag" value="turn" checked; span { "Turn" } }
                    label { input type="radio" name="drag" value="tip"; span { "Drag tip" } }
                    label { input type="radio" name="drag" value="platform"; span { "Drag platform" } }
                }
                div.buttons {
                    button type="button" data-look="iso" { "Iso" }
                    button type="button" data-look="front" { "Front" }
                    button type="button" data-look="side" { "Side" }
                    button type="button" data-look="top" { "Top" }
                }
            }
            p #keys.hidden {
                "Arrow keys turn the picture, plus and minus zoom. With Shift the arrow keys move the tip by 1 mm along x and y, Page Up and \
                 Page Down along z."
            }
        }
    }
}

fn panels(shown: &Shown) -> Markup {
    html! {
        div #panels {
            section #warnings aria-label="Warnings" hidden {}
            section #position aria-labelledby="position-title" {
                h2 #position-title { "Position" }
                p #refused role="alert" {}
                div #position-rows {}
            }
            section #load aria-labelledby="load-title" { h2 #load-title { "Load on the tool, at its tip, in its axes" } div #load-rows {} }
            section #result aria-labelledby="result-title" { h2 #result-title { "What the core says" } div #result-body {} }
            details #model { summary { "Effects and elements" } div #model-body {} }
            details #shown { summary { "What is drawn" } div #shown-body {} }
            section #files aria-labelledby="files-title" {
                h2 #files-title { "Diagnosis, placement, path" }
                p { label for="file" { "Open a " code { "diagnosis.json" } ", a " code { "placement.json" } " or a path (CSV) of this machine:" } }
                input #file type="file" accept=".json,.csv";
                p #file-message role="status" {}
                section #diagnosis hidden[shown.diagnosis.is_none()] aria-label="Diagnosis" {}
                section #placement hidden[shown.placement.is_none()] aria-label="Placement" {}
                section #path hidden[shown.path.is_none()] aria-label="Path" {}
            }
            details #origin { summary { "Where this comes from" } dl #origin-body {} }
        }
    }
}

//! `view`: the machine on a page, to be turned and driven.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::TableArgs;
use super::session::{Output, Session};
use crate::error::Result;
use crate::files::results::{DiagnosisResult, PlacementResult};
use crate::files::source::{self, Source};
use crate::files::tool_path::ToolPath;
use crate::plan::model::Form;
use crate::plan::play::played;
use crate::report::view::{self as report, PlayedPath, Shown};

/// Writes one page that opens from disk, without a network: the machine in 3D, to be turned, driven and loaded, with what the
/// core says of it. The page computes with the core itself, as WebAssembly, and shows that its results are this program's, bit for
/// bit. It opens diagnosis.json, placement.json and paths (CSV) of the same machine, too.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// coefficients.json of `fit`; without it the page has the basic model alone.
    #[arg(long, value_name = "JSON")]
    table: Option<PathBuf>,
    /// diagnosis.json of `diagnose` of this machine: its readings, and where the findings are.
    #[arg(long, value_name = "JSON")]
    diagnosis: Option<PathBuf>,
    /// placement.json of `place` of this machine: the holes.
    #[arg(long, value_name = "JSON")]
    placement: Option<PathBuf>,
    /// A path that `compensate` wrote, CSV or G-code that needs neither a job nor a tool table, to be played.
    #[arg(long, value_name = "FILE")]
    path: Option<PathBuf>,
    /// Page to write.
    #[arg(long, value_name = "HTML")]
    out: PathBuf,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let model = session.model(&TableArgs { table: args.table.clone(), form: Form::Auto })?;
    let file = &model.machine;
    session.warn(file.wrist_warning());
    file.five_axis()?;
    let read = |path: &Option<PathBuf>| path.as_deref().map(Source::read).transpose();
    let (diagnosis, placement) = (read(&args.diagnosis)?, read(&args.placement)?);
    let path = match &args.path {
        None => None,
        Some(path) => {
            let (path, source) = ToolPath::read_any(path)?;
            session.warn(path.warnings().to_vec());
            let points = played(file, &source.name, path.moves())?;
            Some(PlayedPath { name: source.file_name(), points })
        }
    };
    let shown = Shown {
        diagnosis: diagnosis.as_ref().map(|s| DiagnosisResult::parse(s, file)).transpose()?,
        placement: placement.as_ref().map(|s| PlacementResult::parse(s, file)).transpose()?,
        path,
    };
    let page = report::page(&model, &shown, &session.warnings)?;
    let inputs = [&args.table, &args.diagnosis, &args.placement, &args.path].map(|path| path.as_deref());
    let size = page.html.len();
    source::write(&args.out, page.html, &[&[session.machine_path()], &inputs[..]].concat())?;
    let out = args.out.display().to_string();
    let text = format!(
        "wrote {out} ({} KB); {} poses of it sum up to {}\n",
        size.div_ceil(1000),
        report::SWEPT_POSES,
        page.checksum
    );
    session.output(
        text,
        &json!({ "out": out, "bytes": size, "poses": report::SWEPT_POSES, "checksum": page.checksum,
            "core_sha256": report::core_sha256() }),
    )
}

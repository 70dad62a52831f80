//! `fit`: correction tables from stiffness data.

use std::path::PathBuf;

use serde_json::json;

use super::arguments::DateArgs;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::dataset;
use crate::files::machine::MachineFile;
use crate::files::source::{self, Source};
use crate::fit::export::{Provenance, rust_source};
use crate::fit::{self, Evaluation, Fit, TermChoice};
use crate::report::fit as report;

/// Correction tables from stiffness data (Eqs. 10-14).
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Stiffness CSV to fit; default, for the reference machine alone: its finite elements at 49 poses.
    #[arg(long, value_name = "CSV")]
    data: Option<PathBuf>,
    /// Stiffness CSV to judge by; default: 25 other poses when --data is not given.
    #[arg(long, value_name = "CSV")]
    verify: Option<PathBuf>,
    /// Which terms the polynomials get.
    #[arg(long, value_enum, default_value = "paper")]
    terms: TermChoice,
    #[command(flatten)]
    date: DateArgs,
    /// Folder for coefficients.rs, coefficients.json, fit.json and report.html.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// A fit with what it was made of and how good it is.
struct Fitted {
    machine: MachineFile,
    data: Source,
    verification: Option<Source>,
    fit: Fit,
    trained: Evaluation,
    verified: Option<Evaluation>,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let fitted = compute(args, session)?;
    let Fitted { machine, data, verification, fit, trained, verified } = &fitted;
    let table = fit.table_file(machine, data);
    let mut command = format!("pkm-host fit --machine {} --data {}", machine.source.file_name(), data.file_name());
    let verification = verification.as_ref().map(|s| (s.file_name(), s.sha256()));
    if let Some((name, _)) = &verification {
        command.push_str(&format!(" --verify {name}"));
    }
    command.push_str(&format!(" --terms {}", args.terms.name()));
    let provenance = Provenance {
        command: &command,
        file: &table,
        poses: fit.training.len(),
        verification: verification.as_ref().map(|(name, sha)| (name.as_str(), sha.as_str())),
        training: trained,
        verified: verified.as_ref(),
    };
    let document = report::document(fit, trained, verified.as_ref());
    let mut with_warnings = document.clone();
    with_warnings["warnings"] = json!(session.warnings);
    let wrote = source::write_all(
        &args.out,
        &[
            ("coefficients.rs", rust_source(&provenance, fit, machine)?),
            ("coefficients.json", table.to_json()),
            ("fit.json", source::json(&with_warnings)),
            ("report.html", args.date.of(report::html(&provenance, fit, &session.warnings)?)),
        ],
        &[session.machine_path(), args.data.as_deref(), args.verify.as_deref()],
    )?;
    let summary = report::summary(fit, trained, verified.as_ref());
    session.output(format!("{summary}\n{wrote}"), &document)
}

fn compute(args: &Args, session: &mut Session) -> Result<Fitted> {
    let machine = session.machine()?;
    session.warn(machine.wrist_warning());
    if machine.wrist.is_err() {
        let name = &machine.source.name;
        session.warn([format!("{name}: the wrist is singular at home: coefficients.rs has no WRIST")]);
    }
    // the data are the mechanism's at A; what sits on A comes after the table
    let (below, tip_m) = (machine.below_tool()?, machine.wrist_parameters.tip_at_zero_m());
    let source = session.read_or_fixture(args.data.as_deref(), pkm_fixtures::TRAINING, "--data", &machine)?;
    let training = dataset::read_stiffness(source, &machine)?;
    // the fixture's verification poses go with the fixture's training poses
    let verification = match (&args.verify, &args.data) {
        (Some(path), _) => Some(Source::read(path)?),
        (None, None) => Some(Source::embedded(pkm_fixtures::VERIFICATION)),
        (None, Some(_)) => None,
    };
    let verification = verification.map(|s| dataset::read_stiffness(s, &machine)).transpose()?;
    session.warn(training.warnings.iter().chain(verification.iter().flat_map(|v| &v.warnings)).cloned());

    let data = training.source.clone();
    let in_data = |f: Failure| if f.file.is_none() { f.in_file(&data.name) } else { f };
    let verification_source = verification.as_ref().map(|v| v.source.clone());
    let training = fit::samples(&below, training)?;
    let verification = verification.map(|v| fit::samples(&below, v)).transpose()?;
    session.warn(fit::read_otherwise(&below, &training, &data.name));
    session.warn(fit::stray_poses(&training, &data.name));
    let mut fit = fit::fit(training, verification, args.terms).map_err(in_data)?;
    fit.estimate_uncertainty(tip_m);
    let trained = fit::evaluate(&fit.training, &below, tip_m, &fit.numbers).map_err(in_data)?;
    let verified = match (&fit.verification, &verification_source) {
        (Some(judged_by), Some(source)) => {
            let unusable = |f: Failure| {
                let message = format!("the table fitted to {} is of no use here: {}", data.name, f.message);
                Failure { message, ..f }.in_file(&source.name)
            };
            Some(fit::evaluate(&judged_by.samples, &below, tip_m, &fit.numbers).map_err(unusable)?)
        }
        _ => None,
    };
    session.warn(fit.warnings(&data, verification_source.as_ref(), verified.as_ref()));
    session.warn(fit::too_sure(&fit, &below, tip_m));
    Ok(Fitted { machine, data, verification: verification_source, fit, trained, verified })
}

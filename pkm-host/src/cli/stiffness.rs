//! `stiffness`: the 6×6 at poses.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pkm_core::thermal::DECLARED_TEMPERATURE_C;

use super::arguments::TableArgs;
use super::session::{Output, Session};
use crate::error::Result;
use crate::files::{dataset, source};
use crate::plan::model::extrapolation_warning;
use crate::report::stiffness as report;

/// Terminal stiffness at poses: basic, or corrected by a table.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with pose,theta_deg,sigma_deg,z0_mm or pose,q1_mm,q2_mm,q3_mm.
    #[arg(long, value_name = "CSV")]
    poses: PathBuf,
    #[command(flatten)]
    table: TableArgs,
    /// Stiffness CSV to write, 21 columns.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let model = session.model(&args.table)?;
    session.warn(model.machine.load_warning());
    let source = source::Source::read(&args.poses)?;
    let file = source.name.clone();
    let (poses, warnings) = dataset::read_poses(source, &model.machine)?;
    session.warn(warnings);
    if args.out.is_some() {
        // a stiffness file has one line a pose
        dataset::refuse_doubled_ids(&file, &poses)?;
    }
    let solved = model.solve(poses.iter().map(|p| (p, DECLARED_TEMPERATURE_C))).map_err(|f| f.in_file(file))?;
    session.warn(extrapolation_warning(&solved));

    let mut text = report::text(&poses, &solved);
    if let Some(out) = &args.out {
        let inputs = [session.machine_path(), Some(&args.poses), args.table.table.as_deref()];
        source::write(out, report::csv(&poses, &solved), &inputs)?;
        text.push_str(&format!("wrote {}\n", out.display()));
    }
    session.output(text, &BTreeMap::from([("poses", report::documents(&poses, &solved))]))
}

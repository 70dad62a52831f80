//! `map`: principal stiffnesses over the workspace, and the paper's claims about them (Section 5.2).

use std::path::PathBuf;

use pkm_core::effects::Effects;
use pkm_core::nalgebra::Vector3;
use pkm_core::{CorrectionError, Domain, Machine, Pose, StiffnessError, TableUncertainty};
use serde_json::{Value, json};

use super::arguments::{DateArgs, TableArgs, finite, list};
use super::bar::bar;
use super::session::{Output, Session};
use crate::error::{Failure, Result, status};
use crate::files::{dataset, source};
use crate::plan::map::{self, Map, Window, claims};
use crate::plan::model::{Applied, Form, solve_at, u95_m_per_n};
use crate::report::map::{self as report, Sheet, picture};

/// Maps of k11…k66 over the workspace (Fig. 7), of how far a table may be off at the tip where it says so, and whether the paper's Section 5.2 is true of this machine.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    table: TableArgs,
    /// σ in °, within ±90; several with commas between: a picture each.
    #[arg(long, value_parser = finite, allow_hyphen_values = true, value_delimiter = ',', default_value = "0")]
    sigma_deg: Vec<f64>,
    /// Least and greatest X0 of the window in mm; default: the machine's workspace.
    #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "LEAST,GREATEST")]
    x0_mm: Option<[f64; 2]>,
    /// Least and greatest Z0 of the window in mm; default: the machine's workspace.
    #[arg(long, value_parser = list::<2>, allow_hyphen_values = true, value_name = "LEAST,GREATEST")]
    z0_mm: Option<[f64; 2]>,
    /// Between points of the CSV in mm; default: 100 to 250 points along the longer side.
    #[arg(long, value_parser = finite, allow_hyphen_values = true)]
    step_mm: Option<f64>,
    #[command(flatten)]
    date: DateArgs,
    /// Folder for map.csv, map.svg (with several σ map-sigma-….svg) and report.html; built with the feature png, PNG pictures too.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Args {
    fn check(&self) -> Result<()> {
        for (option, range) in [("--x0-mm", self.x0_mm), ("--z0-mm", self.z0_mm)] {
            if let Some([low, high]) = range.filter(|[low, high]| low >= high || low.abs().max(high.abs()) > 1e6) {
                let message = format!("{option}: expected least,greatest within ±1e6 mm, found {low:?},{high:?}");
                return Err(Failure::usage(message));
            }
        }
        if let Some(step) = self.step_mm.filter(|step| *step <= 0.0) {
            return Err(Failure::usage(format!("--step-mm: expected a number above 0, found {step}")));
        }
        for (i, sigma) in self.sigma_deg.iter().enumerate() {
            if sigma.abs() >= 90.0 || self.sigma_deg[..i].contains(sigma) {
                let message = format!("--sigma-deg: expected different angles within ±90, found {sigma}");
                return Err(Failure::usage(message));
            }
        }
        Ok(())
    }
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    args.check()?;
    let model = session.model(&args.table)?;
    session.warn(model.machine.load_warning());
    let file = &model.machine;
    let applied = model.applied()?;
    let uncertainty = model.table.as_ref().and_then(|table| table.uncertainty.as_ref());
    let known = Known { applied, uncertainty, tip_m: file.wrist_parameters.tip_at_zero_m() };
    let value = |machine: &Machine<f64>, pose: &Pose<f64>| known.value_at(machine, pose);
    let name = match &known.applied {
        None => "basic",
        Some((_, Form::Diagonal)) => "diagonal",
        Some(_) => "factor",
    };
    let effects = if file.parameters.effects == Effects::NONE { "" } else { " with the machine's effects" };
    let described = match name {
        "basic" => format!("K_p{effects}"),
        form => format!("K_p{effects}, corrected by its table, {form} form"),
    };
    let pose_box = model.table.as_ref().map_or(file.pose_box, |table| table.pose_box);
    let window = Window { x0_mm: args.x0_mm, z0_mm: args.z0_mm, step_mm: args.step_mm };

    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let (mut rows, mut maps, mut sheets) = (Vec::new(), Vec::new(), Vec::new());
    for &sigma in &args.sigma_deg {
        let map = Map::new(file, &value, sigma, &window, &bar())?;
        let machine_name: String = file.name.chars().take(60).collect();
        let title = format!("Principal stiffnesses of {machine_name} at A in A-uvw, σ = {sigma}°: {described}");
        let legend = picture::Legend { title: &title, pose_box, table: model.table.is_some() };
        let picture = picture::draw(file, &value, &map, &legend)?;
        let stem = if args.sigma_deg.len() == 1 { "map".to_owned() } else { format!("map-sigma-{sigma}") };
        files.push((format!("{stem}.svg"), picture.whole.clone().into_bytes()));
        #[cfg(feature = "png")]
        files.push((format!("{stem}.png"), picture::png(&picture.whole)?));
        rows.extend(map.rows());
        maps.push(map.to_json());
        let claims = [("workspace", false), ("box of the table", true)]
            .map(|(over, inside_alone)| (over, claims::check(&map, inside_alone)));
        sheets.push(Sheet { map, picture, claims });
    }
    let html = report::html(file, model.table.as_ref().map(|t| &t.source), &described, &sheets, &session.warnings);
    let html = args.date.of(html);
    files.push(("map.csv".into(), dataset::to_csv(b',', &map::header(), rows).into_bytes()));
    files.push(("report.html".into(), html.into_bytes()));
    source::write_all(&args.out, &files, &[session.machine_path(), args.table.table.as_deref()])?;
    let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
    let mut text: String = sheets.iter().map(report::text).collect();
    text.push_str(&format!("wrote {} to {}\n", names.join(", "), args.out.display()));
    let checked: Vec<Value> = sheets.iter().flat_map(report::claims_json).collect();
    let json = json!({
        "machine": file.name, "model": name, "maps": maps, "claims": checked, "files": names,
    });
    session.output(text, &json)
}

/// What a map is drawn of.
struct Known<'a> {
    applied: Applied<'a>,
    uncertainty: Option<&'a TableUncertainty<f64>>,
    /// With the wrist at 0.
    tip_m: Vector3<f64>,
}

impl Known<'_> {
    fn value_at(&self, machine: &Machine<f64>, pose: &Pose<f64>) -> std::result::Result<map::Value, &'static str> {
        let solved = match solve_at(&self.applied, machine, pose) {
            Ok(solved) => solved,
            Err(CorrectionError::Stiffness(StiffnessError::Kinematics(e))) => return Err(status(e)),
            // positive definite no more: a table far outside its box
            Err(_) => return Err("no_stiffness"),
        };
        let principal: [f64; 6] = solved.factor.stiffness().principal().into();
        if !principal.iter().all(|k| k.is_finite()) {
            return Err("no_stiffness");
        }
        let u95 = self.applied.as_ref().zip(self.uncertainty);
        let u95 = u95.map(|((table, _), known)| u95_m_per_n(table, known, &solved.factor, pose, self.tip_m));
        let inside = solved.domain.map(|d| d == Domain::Inside);
        Ok(map::Value { principal, inside, u95_m_per_n: u95.transpose().map_err(|_| "no_stiffness")? })
    }
}

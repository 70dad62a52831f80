//! The commands: read, compute, write, and the document for `--json`.

use std::collections::BTreeMap;
use std::path::Path;

use pkm_core::effects::Effects;
use pkm_core::tables::reference;
use pkm_core::{CorrectionError, CorrectionTable, Domain, Machine, Pose, StiffnessError, StiffnessFactor, Wrench};
use pkm_fixtures::Fixture;
use serde::Serialize;
use serde_json::{Value, json};

use crate::cli::output::Output;
use crate::diagnose::{self, outputs};
use crate::error::{Failure, Result, printable, status};
use crate::files::dataset::{self, DEFLECTION_COLUMNS, POSE_COLUMNS, WRENCH_COLUMNS, stiffness_columns};
use crate::files::job::Job;
use crate::files::machine::MachineFile;
use crate::files::readings::{REFERENCE_C, Readings};
use crate::files::source::{self, Source};
use crate::files::table::TableFile;
use crate::files::table_numbers::TableNumbers;
use crate::fit::{self, Fit, TermChoice};
use crate::hil;
use crate::plan::compensate::{self, Correction};
use crate::plan::map::{self, Map, Window, claims};
use crate::plan::place::{self, Bench, Objective};
use crate::plan::poses::{self, PlanKind};
use crate::pose::{NamedPose, PoseBox};
use crate::report::export::{Provenance, rust_source};
use crate::report::map::picture;

/// A file, or the fixture, which is the reference machine's: a machine of another size has no use for it.
fn read_or_fixture(path: Option<&Path>, fixture: Fixture, option: &str, machine: &MachineFile) -> Result<Source> {
    if path.is_none() {
        let reference = pkm_core::tables::reference::PARAMETERS;
        let (own, name) = (&machine.parameters, &machine.source.name);
        if (own.geometry, own.travel) != (reference.geometry, reference.travel) {
            let message = format!(
                "{option} is missing: what comes with the program is the reference machine's, not that of {name}"
            );
            return Err(Failure::usage(message));
        }
        if own.limbs != reference.limbs {
            eprintln!("warning: no {option}: {name} gets the reference machine's, {}", fixture.path);
        }
    }
    Source::read_or(path, fixture)
}

/// `compensate`: a tool path that cancels the deflection that the model predicts along it.
///
/// # Errors
/// See [`compensate::compensate`]; a table without factor form.
pub fn compensate(request: &compensate::Request<'_>) -> Result<Output> {
    let model = Model::read(request.machine, request.table, Form::Auto)?;
    let correction = model.table.as_ref().zip(request.table).map(|(t, file)| {
        let name = file.display().to_string();
        if t.form == Form::Diagonal {
            return Err(no_factor_form(request.table, "there is no path without it"));
        }
        Ok(Correction { table: t.numbers.table()?, extent: t.pose_box, name })
    });
    compensate::compensate(&model.machine, correction.transpose()?.as_ref(), request)
}

/// Deflections were asked of a table for principal stiffnesses alone.
fn no_factor_form(table: Option<&Path>, or: &str) -> Failure {
    let message = "has no factor form, and the diagonal form is wrong for loads: fit it on data with all 21 columns";
    let failure = Failure::input(format!("{message}; {or}")).at_column("factor");
    table.map_or(failure.clone(), |path| failure.in_file(path.display().to_string()))
}

/// Which model gives the stiffness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Form {
    /// Factor if the table has it, else diagonal.
    Auto,
    /// The paper's.
    Diagonal,
    /// Ours.
    Factor,
}

/// A machine, with a table or without.
struct Model {
    machine: MachineFile,
    table: Option<Table>,
}

struct Table {
    source: Source,
    numbers: TableNumbers,
    form: Form,
    /// Where it was fitted.
    pose_box: PoseBox,
}

/// A stiffness ready for loads, and where its pose stands to the table's box (`None` without a table).
struct Solved {
    factor: StiffnessFactor<f64>,
    domain: Option<Domain>,
}

impl Model {
    fn read(machine: Option<&Path>, table: Option<&Path>, form: Form) -> Result<Self> {
        let machine = MachineFile::read(machine)?;
        let Some(path) = table else {
            if form != Form::Auto {
                return Err(Failure::usage("--form says how a table is applied: give --table as well"));
            }
            return Ok(Self { machine, table: None });
        };
        let source = Source::read(path)?;
        let file = TableFile::parse(&source)?;
        if file.machine_sha256 != machine.source.sha256() {
            eprintln!(
                "warning: {} was fitted for machine `{}` from another machine file than {}",
                source.name, file.machine, machine.source.name
            );
        }
        let form = match (form, &file.factor) {
            (Form::Factor, None) => {
                let message = "has no factor form (its data had no couplings): use --form diagonal";
                return Err(Failure::input(message).in_file(source.name).at_column("factor"));
            }
            (Form::Auto, None) => Form::Diagonal,
            (Form::Auto, Some(_)) => Form::Factor,
            (form, _) => form,
        };
        let table = Table { source, numbers: file.numbers(), form, pose_box: file.extent };
        Ok(Self { machine, table: Some(table) })
    }

    /// The core's view of the table.
    fn applied(&self) -> Result<Applied<'_>> {
        self.table.as_ref().map(|t| Ok((t.numbers.table()?, t.form))).transpose()
    }

    /// Stiffness at every pose and temperature in °C.
    fn solve<'a>(&self, poses: impl IntoIterator<Item = (&'a NamedPose, f64)>) -> Result<Vec<Solved>> {
        let table = self.applied()?;
        poses
            .into_iter()
            .map(|(p, temperature_c)| {
                let failed = |e: String| Failure::input(format!("pose `{}`: {e}", p.id)).at_line(p.line);
                let machine = self.machine.machine.at_temperature(temperature_c).map_err(|e| failed(e.to_string()))?;
                let solved = solve_at(&table, &machine, &p.pose).map_err(|e| failed(e.to_string()))?;
                if solved.factor.stiffness().matrix().as_flattened().iter().all(|k| k.is_finite()) {
                    Ok(solved)
                } else {
                    Err(failed("the table gives a stiffness that is not finite".into()))
                }
            })
            .collect()
    }
}

type Applied<'a> = Option<(CorrectionTable<'a, f64>, Form)>;

fn solve_at(
    table: &Applied<'_>,
    machine: &Machine<f64>,
    pose: &Pose<f64>,
) -> std::result::Result<Solved, CorrectionError> {
    let corrected = match table {
        None => return Ok(Solved { factor: machine.stiffness(pose)?.factor()?, domain: None }),
        Some((table, Form::Diagonal)) => table.diagonal_form(machine, pose),
        Some((table, _)) => table.factor_form(machine, pose),
    };
    corrected.map(|c| Solved { factor: c.factor, domain: Some(c.domain) })
}

fn warn_outside(solved: &[Solved]) {
    let outside = solved.iter().filter(|s| s.domain == Some(Domain::Outside)).count();
    if outside > 0 {
        eprintln!("warning: {outside} of {} poses lie outside the table's box: extrapolated", solved.len());
    }
}

/// `stiffness`: the 6×6 at poses.
///
/// # Errors
/// Bad files, poses that the machine cannot take, an unwritable file.
pub fn stiffness(
    machine: Option<&Path>,
    poses: &Path,
    table: Option<&Path>,
    form: Form,
    out: Option<&Path>,
) -> Result<Output> {
    let inputs = [machine, Some(poses), table];
    let model = Model::read(machine, table, form)?;
    let source = Source::read(poses)?;
    let file = source.name.clone();
    let poses = dataset::read_poses(source, &model.machine)?;
    if out.is_some() {
        // a stiffness file has one line a pose
        dataset::refuse_doubled_ids(&file, &poses)?;
    }
    let solved = model.solve(poses.iter().map(|p| (p, REFERENCE_C))).map_err(|f| f.in_file(file))?;
    warn_outside(&solved);

    let mut header: Vec<String> = POSE_COLUMNS.map(str::to_owned).to_vec();
    header.extend(stiffness_columns().map(|(_, _, name)| name));
    let rows = poses.iter().zip(&solved).map(|(p, s)| {
        let k = s.factor.stiffness().matrix();
        let mut row = vec![p.id.clone()];
        row.extend(dataset::pose_cells(&p.pose));
        row.extend(stiffness_columns().map(|(i, j, _)| k[i][j].to_string()));
        row
    });
    #[derive(Serialize)]
    struct Document<'a> {
        inside_domain: Option<bool>,
        k: [[f64; 6]; 6],
        pose: &'a str,
        status: &'static str,
    }
    let documents = poses.iter().zip(&solved).map(|(p, s)| Document {
        inside_domain: s.domain.map(|d| d == Domain::Inside),
        k: s.factor.stiffness().matrix(),
        pose: &p.id,
        status: if s.domain == Some(Domain::Outside) { "outside_box" } else { "ok" },
    });
    let mut text = format!(
        "{:>10} {:>11} {:>11} {:>11} {:>11} {:>11} {:>11}\n",
        "pose", "k11 N/m", "k22 N/m", "k33 N/m", "k44 Nm/rad", "k55 Nm/rad", "k66 Nm/rad"
    );
    for (p, s) in poses.iter().zip(&solved) {
        let k = s.factor.stiffness().principal().map(|k| format!("{k:>11.4e}")).join(" ");
        let mark = if s.domain == Some(Domain::Outside) { "  outside the box" } else { "" };
        text.push_str(&format!("{:>10} {k}{mark}\n", p.id));
    }
    if let Some(out) = out {
        source::write(out, dataset::to_csv(b',', &header, rows), &inputs)?;
        text.push_str(&format!("wrote {}\n", out.display()));
    }
    Output::new(text, &BTreeMap::from([("poses", documents.collect::<Vec<_>>())]))
}

/// `predict`: measured data with the deflections of the model in place of the readings.
///
/// # Errors
/// Bad files, poses that the machine cannot take, an unwritable file.
pub fn predict(
    machine: Option<&Path>,
    data: Option<&Path>,
    table: Option<&Path>,
    form: Form,
    out: &Path,
) -> Result<Output> {
    let model = Model::read(machine, table, form)?;
    if form == Form::Auto && model.table.as_ref().is_some_and(|t| t.form == Form::Diagonal) {
        return Err(no_factor_form(table, "or give --form diagonal to have it all the same"));
    }
    let source = read_or_fixture(data, pkm_fixtures::MEASURED, "--data", &model.machine)?;
    let file = source.name.clone();
    let (sheet, readings) = Readings::read_conditions(source, &model.machine)?;
    let conditions: Vec<_> = readings.readings.iter().map(|r| readings.conditions[r.condition]).collect();
    let at = conditions.iter().map(|c| (&readings.poses[c.pose], c.temperature_c));
    let solved = model.solve(at).map_err(|f| f.in_file(&file))?;
    warn_outside(&solved);

    let mut header = sheet.header.clone();
    header.extend(DEFLECTION_COLUMNS.iter().filter(|c| !sheet.header.iter().any(|h| h == *c)).map(|c| c.to_string()));
    let columns: Vec<usize> = DEFLECTION_COLUMNS.iter().filter_map(|c| header.iter().position(|h| h == c)).collect();
    let mut rows = Vec::new();
    for ((row, c), solved) in sheet.rows.iter().zip(&conditions).zip(&solved) {
        let (machine, pose) = (&model.machine.machine, &readings.poses[c.pose].pose);
        let at_a: Wrench<f64> = c.wrench.moved_to_a(c.point_m);
        let linear = solved.factor.deflection(&at_a);
        let extra = machine.load_dependent_deflection(pose, &at_a, &c.turned_at.moved_to_a(c.point_m));
        let growth = machine.thermal_deflection(pose, c.rise_k);
        let failed = |e: StiffnessError| Failure::input(format!("no deflection: {e}")).in_file(&file).at_line(row.line);
        let deflection = linear.map_err(failed)?.plus(&extra.map_err(failed)?).plus(&growth.map_err(failed)?);
        let seen = deflection.seen_at(c.point_m);
        let mut cells = row.to_cells();
        cells.resize(header.len(), String::new());
        let micro = seen.to_array().map(|v| v * 1e6);
        for (column, value) in columns.iter().zip(micro) {
            cells[*column] = sheet.written(value);
        }
        rows.push(cells);
    }
    let count = rows.len();
    source::write(out, dataset::to_csv(sheet.delimiter(), &header, rows), &[machine, data, table])?;
    let outside = solved.iter().filter(|s| s.domain == Some(Domain::Outside)).count();
    Output::new(
        format!("wrote {} rows to {}\n", count, out.display()),
        &json!({ "rows": count, "outside_box": outside, "out": out.display().to_string() }),
    )
}

/// `plan`: poses to measure or compute at; with loads where the plan is to tell rivals apart.
///
/// # Errors
/// Bad options, poses that the machine cannot take, an unwritable file.
pub fn plan(
    machine: Option<&Path>,
    kind: &[String],
    pose_box: Option<PoseBox>,
    data: Option<&Path>,
    out: &Path,
) -> Result<Output> {
    let kind = PlanKind::parse(kind)?;
    let inputs = [machine, data];
    let mut machine = MachineFile::read(machine)?;
    machine.pose_box = pose_box.unwrap_or(machine.pose_box);
    let mut header = POSE_COLUMNS.map(str::to_owned).to_vec();
    let mut separates = Vec::new();
    let rows: Vec<Vec<String>> = if kind == PlanKind::Discriminate {
        let source = read_or_fixture(data, pkm_fixtures::MEASURED, "--data", &machine)?;
        let readings = Readings::read(source, &machine)?;
        let diagnosis = diagnose::diagnose(&machine, &readings, None)?;
        if diagnosis.proposals.is_empty() {
            return Err(
                Failure::other("these readings leave no two rivals to tell apart").in_file(readings.source.name)
            );
        }
        // with cells to write the readings in
        header.extend(WRENCH_COLUMNS.into_iter().chain(DEFLECTION_COLUMNS).map(str::to_owned));
        let row = |(n, p): (usize, &diagnose::next::Proposal)| {
            let load = p.wrench.to_array().map(|v| v.to_string());
            let load = load.into_iter().chain(DEFLECTION_COLUMNS.map(|_| String::new()));
            [format!("N{:02}", n + 1)].into_iter().chain(dataset::pose_cells(&p.pose)).chain(load).collect()
        };
        separates = diagnosis.proposals.iter().map(|p| p.separates.clone()).collect();
        diagnosis.proposals.iter().enumerate().map(row).collect()
    } else {
        if data.is_some() {
            return Err(Failure::usage("--data goes with --kind discriminate alone"));
        }
        let laid = poses::plan(kind, &machine)?;
        laid.iter().map(|p| [p.id.clone()].into_iter().chain(dataset::pose_cells(&p.pose)).collect()).collect()
    };
    let count = rows.len();
    source::write(out, dataset::to_csv(b',', &header, rows), &inputs)?;
    let mut text = format!("wrote {count} poses to {}\n", out.display());
    for (n, [a, b]) in separates.iter().enumerate() {
        text.push_str(&format!("  N{:02} tells {a} from {b}\n", n + 1));
    }
    Output::new(text, &json!({ "poses": count, "separates": separates, "out": out.display().to_string() }))
}

/// `fit`: correction tables from stiffness data.
///
/// # Errors
/// Bad files, poses that don't determine the terms, a correction that is not positive, an unwritable folder.
pub fn fit(
    machine: Option<&Path>,
    data: Option<&Path>,
    verify: Option<&Path>,
    choice: TermChoice,
    out: &Path,
) -> Result<Output> {
    let inputs = [machine, data, verify];
    let machine = MachineFile::read(machine)?;
    machine.warn_of_wrist();
    if machine.wrist.is_err() {
        eprintln!("warning: {}: the wrist is singular at home: coefficients.rs has no WRIST", machine.source.name);
    }
    // the data are the mechanism's at A; what sits on A comes after the table
    let (below, tip_m) = (machine.below_tool()?, machine.wrist_parameters.tip_at_zero_m());
    let source = read_or_fixture(data, pkm_fixtures::TRAINING, "--data", &machine)?;
    let training = dataset::read_stiffness(source, &machine)?;
    // the fixture's verification poses go with the fixture's training poses
    let verification = match (verify, data) {
        (Some(path), _) => Some(Source::read(path)?),
        (None, None) => Some(Source::embedded(pkm_fixtures::VERIFICATION)),
        (None, Some(_)) => None,
    };
    let verification = verification.map(|s| dataset::read_stiffness(s, &machine)).transpose()?;

    let data_source = training.source.clone();
    let in_data = |f: Failure| if f.file.is_none() { f.in_file(&data_source.name) } else { f };
    let verification_source = verification.as_ref().map(|v| v.source.clone());
    let training = fit::samples(&below, training)?;
    let verification = verification.map(|v| fit::samples(&below, v)).transpose()?;
    let fit = fit::fit(training, verification, choice).map_err(in_data)?;
    let trained = fit::evaluate(&fit.training, &below, tip_m, &fit.numbers).map_err(in_data)?;
    let verified = match (&fit.verification, &verification_source) {
        (Some(samples), Some(source)) => {
            let unusable = |f: Failure| {
                let message = format!("the table fitted to {} is of no use here: {}", data_source.name, f.message);
                Failure { message, ..f }.in_file(&source.name)
            };
            Some(fit::evaluate(samples, &below, tip_m, &fit.numbers).map_err(unusable)?)
        }
        _ => None,
    };

    let mut warnings = Vec::new();
    if let Some(v) = verified.as_ref().filter(|v| v.outside_box > 0) {
        warnings.push(format!(
            "{} of {} verification poses lie outside the table's box: extrapolated",
            v.outside_box, v.poses
        ));
    }
    let fitted_too = fit.verification_in_training();
    if fitted_too > 0 {
        warnings.push(format!(
            "{fitted_too} of {} verification poses are training poses too, and say nothing of others",
            fit.verification.as_ref().map_or(0, Vec::len)
        ));
    }
    let both = [(&data_source, &fit.training)].into_iter().chain(verification_source.iter().zip(&fit.verification));
    for (source, samples) in both {
        let columns = fit::suspicious_ratios(samples);
        if !columns.is_empty() {
            let shown: Vec<String> = columns.iter().map(|(name, ratio)| format!("{name} {ratio:.1e}")).collect();
            warnings.push(format!(
                "{}: stiffnesses far from the declared machine's, in the mean over the poses {} times: are they in N/m \
                 (1 N/mm = 1000 N/m) and N·m/rad?",
                printable(&source.name),
                shown.join(", ")
            ));
        }
    }
    if fit.extent.ranges()[..2].iter().flatten().all(|angle| angle.abs() < 0.6) {
        warnings.push(format!("{}: no angle is above 0.6°: are theta_deg and sigma_deg in degrees?", data_source.name));
    }
    warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));

    let file = TableFile::new(&machine, &data_source, &fit);
    let choice_name = match choice {
        TermChoice::Paper => "paper",
        TermChoice::Full => "full",
        TermChoice::Select => "select",
    };
    let mut command =
        format!("pkm-host fit --machine {} --data {}", machine.source.file_name(), data_source.file_name());
    let verification_name = verification_source.as_ref().map(|s| (s.file_name(), s.sha256()));
    if let Some((name, _)) = &verification_name {
        command.push_str(&format!(" --verify {name}"));
    }
    command.push_str(&format!(" --terms {choice_name}"));
    let provenance = Provenance {
        command: &command,
        file: &file,
        verification: verification_name.as_ref().map(|(name, sha)| (name.as_str(), sha.as_str())),
        training: &trained,
        verified: verified.as_ref(),
    };
    let rust = rust_source(&provenance, &fit, &machine)?;
    let mut document = fit_document(&fit, choice_name, &trained, verified.as_ref());
    document["warnings"] = json!(warnings);
    let summary = crate::report::fit::summary(&fit, &trained, verified.as_ref());
    let html = crate::report::fit::html(&provenance, &fit, &warnings)?;
    let wrote = source::write_all(
        out,
        &[
            ("coefficients.rs", rust),
            ("coefficients.json", file.to_json()),
            ("fit.json", source::json(&document)),
            ("report.html", html),
        ],
        &inputs,
    )?;
    Output::new(format!("{summary}\n{wrote}"), &document)
}

fn fit_document(fit: &Fit, choice: &str, trained: &fit::Evaluation, verified: Option<&fit::Evaluation>) -> Value {
    let polynomials: Vec<Value> = fit
        .polynomials
        .iter()
        .map(|p| {
            let terms: Vec<_> =
                fit.numbers.terms.iter().zip(&p.used).filter_map(|(t, used)| used.then_some(*t)).collect();
            json!({
                "name": p.name,
                "terms": terms,
                "coefficients": p.coefficients,
                "standard_errors": p.standard_errors,
                "leave_one_out_rms": p.loo_rms,
                "leave_one_out_rms_paper_terms": p.paper_loo_rms,
            })
        })
        .collect();
    json!({
        "train": trained,
        "verify": verified,
        "condition": fit.condition,
        "terms": fit.numbers.terms,
        "term_choice": choice,
        "selected": polynomials,
    })
}

/// `diagnose`: from readings to what the model lacks.
///
/// # Errors
/// Bad files, readings that cannot be diagnosed, a fit that does not converge, an unwritable folder.
pub fn diagnose(machine: Option<&Path>, data: Option<&Path>, holdout: Option<&Path>, out: &Path) -> Result<Output> {
    let file = MachineFile::read(machine)?;
    file.warn_of_wrist();
    let readings = Readings::read(read_or_fixture(data, pkm_fixtures::MEASURED, "--data", &file)?, &file)?;
    let held_out = holdout.map(|path| Readings::read(Source::read(path)?, &file)).transpose()?;
    if held_out.as_ref().is_some_and(|h| h.source.sha256() == readings.source.sha256()) {
        eprintln!("warning: --holdout has the readings of --data, and says nothing of others");
    }
    let diagnosis = diagnose::diagnose(&file, &readings, held_out.as_ref())?;
    let json = diagnosis.to_json();
    let machine_toml = outputs::machine_toml(&file, &diagnosis)?;
    let improved = MachineFile::parse(Source::from_text("machine.toml", machine_toml.clone()))?;
    let (rust, table) = outputs::table(&file, &improved, &readings, &diagnosis)?;
    let html = diagnose::report::html(&file, &readings, held_out.as_ref(), &diagnosis)?;
    let wrote = source::write_all(
        out,
        &[
            ("diagnosis.json", source::json(&json)),
            ("machine.toml", machine_toml),
            ("coefficients.rs", rust),
            ("coefficients.json", table.to_json()),
            ("report.html", html),
        ],
        &[machine, data, holdout],
    )?;
    Output::new(diagnose::report::text(&diagnosis) + &wrote, &json)
}

/// `map`: principal stiffnesses over the workspace, and the paper's claims about them (Section 5.2).
///
/// # Errors
/// Bad files and ranges, a σ that the machine cannot take, an unwritable folder.
pub fn map(
    machine: Option<&Path>,
    table: Option<&Path>,
    form: Form,
    sigma_deg: &[f64],
    window: &Window,
    out: &Path,
) -> Result<Output> {
    let model = Model::read(machine, table, form)?;
    let file = &model.machine;
    let applied = model.applied()?;
    let value = |machine: &Machine<f64>, pose: &Pose<f64>| match solve_at(&applied, machine, pose) {
        Ok(solved) => {
            let principal = solved.factor.stiffness().principal();
            let inside = solved.domain.map(|d| d == Domain::Inside);
            if principal.iter().all(|k| k.is_finite()) {
                Ok(map::Value { principal, inside })
            } else {
                Err("no_stiffness")
            }
        }
        Err(CorrectionError::Stiffness(StiffnessError::Kinematics(e))) => Err(status(e)),
        // positive definite no more: a table far outside its box
        Err(_) => Err("no_stiffness"),
    };
    let name = match &applied {
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

    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let (mut rows, mut maps, mut checked, mut sheets) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut text = String::new();
    for &sigma in sigma_deg {
        let map = Map::new(file, &value, sigma, window)?;
        let machine_name: String = file.name.chars().take(60).collect();
        let title = format!("Principal stiffnesses of {machine_name} at A in A-uvw, σ = {sigma}°: {described}");
        let legend = picture::Legend { title: &title, pose_box, table: table.is_some() };
        let picture = picture::draw(file, &value, &map, &legend)?;
        let png = picture::png(&picture.whole)?;
        let stem = if sigma_deg.len() == 1 { "map".to_owned() } else { format!("map-sigma-{sigma}") };
        files.extend([(format!("{stem}.svg"), picture.whole.clone().into_bytes()), (format!("{stem}.png"), png)]);
        rows.extend(map.rows());
        text.push_str(&map.summary());
        maps.push(map.to_json());
        let claims = [("workspace", false), ("box of the table", true)]
            .map(|(over, inside_alone)| (over, claims::check(&map, inside_alone)));
        for (over, claims) in &claims {
            if !claims.is_empty() {
                text.push_str(&format!("the paper's Section 5.2, over the {over}:\n"));
            }
            for c in claims {
                text.push_str(&format!("  {:<5}  {}\n         {}\n", c.holds, c.claim, c.text));
                checked.push(json!({
                    "sigma_deg": sigma, "over": over, "claim": c.claim, "holds": c.holds, "figures": c.figures,
                }));
            }
        }
        sheets.push(crate::report::map::Sheet { map, picture, claims });
    }
    let html = crate::report::map::html(file, model.table.as_ref().map(|t| &t.source), &described, &sheets);
    files.push(("map.csv".into(), dataset::to_csv(b',', &map::header(), rows).into_bytes()));
    files.push(("report.html".into(), html.into_bytes()));
    source::write_all(out, &files, &[machine, table])?;
    let names: Vec<_> = files.iter().map(|(name, _)| name.as_str()).collect();
    text.push_str(&format!("wrote {} to {}\n", names.join(", "), out.display()));
    let json = json!({
        "machine": file.name, "model": name, "maps": maps, "claims": checked, "files": names,
    });
    Output::new(text, &json)
}

/// What `place` is asked for.
pub struct PlaceOptions<'a> {
    /// None: paper and tip-worst.
    pub objectives: &'a [Objective],
    /// None: by what moves.
    pub method: Option<place::Method>,
    /// Of the grid.
    pub step_mm: f64,
    /// Of the grid.
    pub step_deg: f64,
    /// Of an evolution.
    pub seed: u64,
    /// Outside of the table's box too.
    pub extrapolate: bool,
}

/// `place`: where the workpiece should stand.
///
/// # Errors
/// Bad files, holes that are out of reach, an unwritable folder.
pub fn place(
    machine: Option<&Path>,
    job: Option<&Path>,
    table: Option<&Path>,
    form: Form,
    ask: &PlaceOptions<'_>,
    out: &Path,
) -> Result<Output> {
    let model = Model::read(machine, table, form)?;
    let inputs = [machine, job, table];
    let job = Job::parse(&read_or_fixture(job, pkm_fixtures::JOB, "--job", &model.machine)?)?;
    let mut objectives: Vec<Objective> = Vec::new();
    for objective in ask.objectives {
        if !objectives.contains(objective) {
            objectives.push(*objective);
        }
    }
    if objectives.is_empty() {
        objectives = vec![Objective::Paper, Objective::TipWorst];
    }
    let table = model.table.as_ref().map(|t| (&t.numbers, t.form == Form::Diagonal));
    let bench = Bench::new(&model.machine, table, &job, &objectives, ask.extrapolate)?;
    let usual = if job.slides_and_turns() { place::Method::De } else { place::Method::Grid };
    let options = place::Options {
        method: ask.method.unwrap_or(usual),
        step_m: ask.step_mm / 1e3,
        step_rad: ask.step_deg.to_radians(),
        seed: ask.seed,
    };
    let placed = place::place(&bench, &objectives, &options)?;
    let mut json = crate::report::place::document(&bench, &options, &placed);
    let table_source = model.table.as_ref().map(|t| &t.source);
    json["table_sha256"] = json!(table_source.map(Source::sha256));
    let html = crate::report::place::html(&bench, table_source, &options, &placed)?;
    let wrote = source::write_all(out, &[("placement.json", source::json(&json)), ("report.html", html)], &inputs)?;
    Output::new(crate::report::place::text(&bench, &options, &placed) + &wrote, &json)
}

/// `hil`: firmware that runs the core, held against the host reply by reply.
///
/// # Errors
/// Bad files, no firmware at the other end or one with another table, any difference, an unwritable folder.
pub fn hil(
    machine: Option<&Path>,
    table: Option<&Path>,
    target: &hil::Target,
    seed: u64,
    poses: u64,
    steps: u32,
    out: Option<&Path>,
) -> Result<Output> {
    let file = MachineFile::read(machine)?;
    let (pose_box, numbers, single);
    let twin = match table {
        None => {
            if machine.is_some() {
                return Err(Failure::usage("give --table as well: the firmware of a machine has its table"));
            }
            pose_box = file.pose_box;
            hil::Twin {
                checksums: [file.parameters.checksum(), reference::TABLE_F64.checksum()],
                double: (file.machine, reference::TABLE_F64),
                single: (reference::MACHINE_F32, reference::TABLE_F32),
            }
        }
        Some(path) => {
            let source = Source::read(path)?;
            let table = TableFile::parse(&source)?;
            pose_box = table.extent;
            numbers = table.numbers();
            single = numbers.narrowed();
            let double = numbers.table()?;
            let narrow = Machine::<f32>::new(&file.parameters).map_err(|e| Failure::other(e.to_string()))?;
            hil::Twin {
                checksums: [file.parameters.checksum(), double.checksum()],
                double: (file.machine, double),
                single: (narrow, single.table()?),
            }
        }
    };
    let campaign = hil::Campaign { seed, poses, steps, pose_box };
    let (mut text, json) = hil::run(target, &campaign, &twin)?;
    if let Some(out) = out {
        text.push_str(&source::write_all(out, &[("hil.json", source::json(&json))], &[machine, table])?);
    }
    Output::new(text, &json)
}

//! `compensate`: a tool path that cancels the deflection that the model predicts along it.

use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

use serde_json::json;

use super::arguments::{DateArgs, TableArgs, finite, list};
use super::bar::bar;
use super::session::{Output, Session};
use crate::error::{Failure, Result, printable};
use crate::files::dataset::MAX_LOAD;
use crate::files::gcode::{CHORD_MM, Setup};
use crate::files::job_program::ProgramJob;
use crate::files::limits::JointLimits;
use crate::files::source::{self, Source};
use crate::files::tool_path::{MARK, ToolPath, is_program};
use crate::files::tools::Tools;
use crate::page::of_file;
use crate::plan::compensate::{Correction, Request, walk};
use crate::plan::model::{Form, Model, no_factor_form};
use crate::plan::track::Track;
use crate::report::compensate as report;

/// A tool path that cancels the deflection that the model predicts along it; beside it a report and a plot of the tip's error.
///
/// The machine is led along the path step by step and never changes sides of a singularity. G-code of LinuxCNC and the
/// Fanuc family: X Y Z are the tip in the work frame in force (its axes are those of B, or turned as the job says); its direction is A B, the wrist's β1
/// and β2 in degrees, or on straight moves I J K, its axis in B, or the angles or the fixed direction that the job names. A
/// comment (wrench fx,fy,fz,mx,my,mz) sets the load from there on; G0 has none. Arcs, drilling cycles (G73 G81 G82 G83) and
/// subprograms (M98, O words) become straight moves, parameters and expressions numbers, loops all of their passes; G20, G91, G54-G59.3, G92, G52, G10 and G43 H are followed; what does not
/// move the tool is passed on, and what is not understood is refused with its line: docs/formats.md has the table.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// CSV with x_mm,y_mm,z_mm,i,j,k (tip and axis in B) and fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm (on the tool at the tip, in
    /// the tool's frame), or G-code (.ngc, .nc, .gcode, .cnc, .tap, .mpf).
    #[arg(long, value_name = "FILE")]
    path: PathBuf,
    /// coefficients.json of `fit`; without it the basic model with the machine file's effects.
    #[arg(long, value_name = "JSON")]
    table: Option<PathBuf>,
    /// For G-code: the cutting load on the tool at its tip, in the tool's frame, N and N·m.
    #[arg(long, value_parser = list::<6>, allow_hyphen_values = true, value_name = "FX,FY,FZ,MX,MY,MZ")]
    wrench: Option<[f64; 6]>,
    /// Cuts are divided so that from point to point the tip goes no farther than this and the axis (or a wrist's joint)
    /// turns by no more than 1°. Default: 2 for G-code; a CSV keeps its rows as they are unless this is given.
    #[arg(long, value_parser = finite, allow_hyphen_values = true, value_name = "MM")]
    step_mm: Option<f64>,
    /// For G-code: work frames and reference points in B ([offsets]: G54 = [x, y, z], G28 = [x, y, z, a, b]), the program's
    /// axes in B (axes = ["x", "-y", "-z"]), and what gives the tool's direction (head = "AC" or "BC", or tool_axis =
    /// [i, j, k]).
    #[arg(long, value_name = "TOML")]
    job: Option<PathBuf>,
    /// For G-code: lengths of tools over the machine file's flange, for G43 H; TOML, or LinuxCNC's tool table (.tbl). A TOML table with [material] and the
    /// tools' edges has cutting forces estimated from S, F and the engagement: docs/cutting.md.
    #[arg(long, value_name = "FILE")]
    tools: Option<PathBuf>,
    /// For G-code: how far the straight moves of an arc may be from it. Default: 0.001.
    #[arg(long, value_parser = finite, allow_hyphen_values = true, value_name = "MM")]
    chord_mm: Option<f64>,
    /// For G-code: has LinuxCNC's stand-alone interpreter read the program, rs274 or its path. It knows what is refused here: subroutines in other
    /// files, radius compensation (G41, G42), turned work frames, its own parameters, more cycles. The new program is
    /// written out: loops, subroutines and cycles as moves behind the lines that made them.
    #[arg(long, value_name = "RS274")]
    interpreter: Option<PathBuf>,
    /// For G-code: leaves out the lines that begin with `/`, as a control does whose block delete is on. Without it they are
    /// made, and written without the `/`.
    #[arg(long)]
    block_delete: bool,
    /// For G-code: greatest velocity and acceleration of each joint, TOML. Lines are named whose feed (F in mm/min, G94, or in mm a
    /// turn times S, G95) would take more, with the feed that does not.
    #[arg(long, value_name = "TOML")]
    limits: Option<PathBuf>,
    /// How far loads that are given may be off, as a share of them, 0.2 for 20 %: the report then says which error that leaves. Estimated loads have
    /// their material's u_rel.
    #[arg(long, value_parser = finite, allow_hyphen_values = true, value_name = "SHARE", default_value_t = 0.0)]
    load_u_rel: f64,
    /// Lets points pass that lie outside the table's box, and says so in the file.
    #[arg(long)]
    allow_extrapolation: bool,
    #[command(flatten)]
    date: DateArgs,
    /// File to write, in the path's format; the plot goes to the same name with .svg, and report.html into its folder.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Names and values for the report.
type Facts = Vec<(&'static str, String)>;

/// What stands beside the new path.
const REPORT: &str = "report.html";

impl Args {
    fn check(&self) -> Result<()> {
        if let Some(step) = self.step_mm.filter(|step| *step < 0.001) {
            return Err(Failure::usage(format!("--step-mm: expected at least 0.001, found {step}")));
        }
        if let Some(chord) = self.chord_mm.filter(|chord| !(1e-6..=1.0).contains(chord)) {
            return Err(Failure::usage(format!("--chord-mm: expected 1e-6 to 1, found {chord}")));
        }
        if !(0.0..=1.0).contains(&self.load_u_rel) {
            return Err(Failure::usage(format!("--load-u-rel: expected 0 to 1, found {}", self.load_u_rel)));
        }
        if is_program(&self.path) == Some(false) && (self.job.is_some() || self.tools.is_some()) {
            return Err(Failure::usage("--job and --tools are for G-code: a CSV gives the tool in B"));
        }
        let of_programs = [
            (self.interpreter.is_some(), "--interpreter is for G-code"),
            (self.limits.is_some(), "--limits is for G-code: a CSV has no feed"),
            (self.chord_mm.is_some(), "--chord-mm is for G-code: a CSV has no arcs"),
            (self.block_delete, "--block-delete is for G-code"),
        ];
        if is_program(&self.path) == Some(false)
            && let Some((_, why)) = of_programs.into_iter().find(|(given, _)| *given)
        {
            return Err(Failure::usage(why));
        }
        if let Some(load) = self.wrench.and_then(|w| w.into_iter().find(|f| f.abs() > MAX_LOAD)) {
            let message = format!("--wrench: expected numbers within ±{MAX_LOAD:e}, found {load:e}");
            return Err(Failure::usage(message));
        }
        Ok(())
    }

    /// What the program does not say of the machine, and for the report from which files.
    fn setup(&self, flange_mm: f64) -> Result<(Setup, Facts)> {
        let sources = [&self.job, &self.tools].map(|path| path.as_deref().map(Source::read).transpose());
        let [job, tools] = sources;
        let (job, tools) = (job?, tools?);
        let named = [("Job", &job), ("Tools", &tools)];
        let facts = named.into_iter().filter_map(|(name, source)| Some((name, of_file(source.as_ref()?)))).collect();
        let job = job.as_ref().map(ProgramJob::parse).transpose()?;
        let tools = tools.as_ref().map(|source| Tools::over_flange(source, flange_mm)).transpose()?;
        let ProgramJob { offsets, axes, head } = job.unwrap_or_default();
        let (chord_mm, block_delete) = (self.chord_mm.unwrap_or(CHORD_MM), self.block_delete);
        let tools = tools.unwrap_or_default();
        Ok((Setup { offsets, tools, axes, head, chord_mm, block_delete, is_only_played: false }, facts))
    }

    /// Names of the path and of the plot beside it.
    fn names(&self, svg: &Path) -> Result<[OsString; 2]> {
        let refused = |message| Err(Failure::usage(message).in_file(self.out.display().to_string()));
        match (source::name_of(&self.out), svg.file_name().filter(|_| svg != self.out)) {
            (Some(name), _) if name == REPORT => refused("expected another name: the report goes there"),
            (Some(name), Some(svg_name)) => Ok([name.into(), svg_name.into()]),
            _ => refused("expected the name of a file other than .svg: the plot goes there"),
        }
    }

    /// What a program's first comment says of it.
    fn origin(&self, model: &Model) -> String {
        let table = model.table.as_ref().map_or("no table".to_owned(), |t| t.source.file_name());
        let load = self.wrench.map_or(String::new(), |w| {
            format!(", load {} N, N m where the program sets none", w.map(|v| v.to_string()).join(" "))
        });
        let path = self.path.file_name().unwrap_or(OsStr::new("")).to_string_lossy();
        let names = [model.machine.name.as_str(), &table, &printable(&path)].join(", ");
        let reader = self.interpreter.as_ref().map_or(String::new(), |_| format!(", read by {}", self.reader()));
        format!("{MARK}: machine {names}{load}{reader}")
    }

    /// What reads a program.
    fn reader(&self) -> String {
        let own = || "pkm-host".to_owned();
        self.interpreter.as_ref().map_or_else(own, |rs274| format!("LinuxCNC's interpreter, {}", rs274.display()))
    }
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    let model = session.model(&TableArgs { table: args.table.clone(), form: Form::Auto })?;
    let table = model.table.as_ref().map(|t| match t.form {
        Form::Diagonal => Err(no_factor_form(&t.source, "there is no path without it")),
        _ => Ok(Correction {
            table: t.numbers.table()?,
            uncertainty: t.uncertainty,
            extent: t.pose_box,
            name: t.source.name.clone(),
        }),
    });
    let correction = table.transpose()?;
    args.check()?;
    let svg = args.out.with_extension("svg");
    let [name, svg_name] = args.names(&svg)?;
    let (setup, others) = args.setup(model.machine.wrist_parameters.flange_m * 1e3)?;
    let (path, source) = ToolPath::read(&args.path, args.wrench, &setup, args.interpreter.as_deref())?;
    let in_program = matches!(path, ToolPath::Program(_));
    let mut facts = [facts(args, &model, &source), others].concat();
    facts.extend(in_program.then(|| ("Read by", args.reader())));
    session.warn(path.warnings().to_vec());
    if is_program(&args.out).is_some_and(|to| to != in_program) {
        let message = "expected a name for the kind of file that --path is, CSV or G-code";
        return Err(Failure::usage(message).in_file(args.out.display().to_string()));
    }
    session.warn(model.machine.wrist_warning());
    let limits = args.limits.as_deref().map(Source::read).transpose()?;
    let limits = limits.as_ref().map(JointLimits::parse).transpose()?;
    let request = Request {
        file: &args.path.display().to_string(),
        moves: path.moves(),
        in_program,
        step_mm: args.step_mm,
        allow_extrapolation: args.allow_extrapolation,
        limits: limits.as_ref(),
        load_u_rel: args.load_u_rel,
    };
    let idle = args.allow_extrapolation && args.table.is_none();
    session.warn(idle.then(|| "--allow-extrapolation has no part here: no table says where it ends".to_owned()));
    let margin = model.machine.wrist_parameters.singularity_margin;
    let mut writer = path.writer();
    let track = walk(&model.machine, correction.as_ref(), &request, &mut |points| writer.push(points), &bar())?;
    session.warn(report::implausible(&track));
    session.warn(report::too_fast(&track, request.file));
    session.warn(report::not_held(&track, request.file));
    session.warn(report::unsure(&track));
    session.warn(report::far_apart(&track));
    let written = writer.finish(&notes(args, &model, &track, &path, session));
    let others = [&args.job, &args.tools, &args.limits].map(Option::as_deref);
    let inputs = [&[session.machine_path(), args.table.as_deref(), Some(args.path.as_path())], &others[..]].concat();
    let html = args.date.of(report::html(&track, &facts, &session.warnings, margin)?);
    let files = [(name, written), (svg_name, report::picture(&track)?), (REPORT.into(), html)];
    let folder = source::folder_of(&args.out);
    source::write_all(folder, &files, &inputs)?;
    let [out, plot, page] = [&args.out, &svg, &folder.join(REPORT)].map(|path| path.display().to_string());
    let points = track.points;
    let reader = args.interpreter.as_ref().map_or(String::new(), |_| format!("read by {}\n", args.reader()));
    let by_model = match &args.table {
        Some(_) => "",
        None => "no correction table (--table): by the machine file's model, and how far that is off is not known\n",
    };
    let text = format!(
        "{reader}wrote {points} points to {out} and their errors to {plot} and {page}\n{by_model}{}",
        report::text(&track, margin)
    );
    let mut json = report::document(&track);
    json["reader"] = json!(in_program.then(|| args.reader()));
    (json["out"], json["plot"], json["report"]) = (json!(out), json!(plot), json!(page));
    session.output(text, &json)
}

/// What the report says it stands on.
fn facts(args: &Args, model: &Model, path: &Source) -> Facts {
    let mut facts = vec![("Machine", format!("{}, {}", model.machine.name, of_file(&model.machine.source)))];
    facts.push(("Table", model.table.as_ref().map_or("none".to_owned(), |t| of_file(&t.source))));
    facts.push(("Path", of_file(path)));
    if let Some(wrench) = args.wrench {
        let load = wrench.map(|v| v.to_string()).join(", ");
        facts.push((
            "Load",
            format!("{load} N and N·m on the tool at its tip, in the tool's axes, where the path sets none"),
        ));
    }
    facts
}

/// What stands at the head of the new path.
fn notes(args: &Args, model: &Model, track: &Track, path: &ToolPath, session: &mut Session) -> Vec<String> {
    if track.stretches.is_empty() {
        session.warn(["no load anywhere on the path: nothing to compensate".to_owned()]);
    }
    let mut notes = Vec::new();
    if let ToolPath::Program(program) = path {
        notes.push(args.origin(model));
        if program.deletable > 0 {
            notes.push(format!("{MARK}: lines with /: {} carried out, and written without it", program.deletable));
        }
    }
    if track.extrapolated > 0 {
        let points = track.points;
        let beyond = format!("{} of {points} points lie outside the table's box: extrapolated", track.extrapolated);
        notes.push(format!("{MARK}: {beyond}"));
        session.warn([beyond]);
    }
    notes
}

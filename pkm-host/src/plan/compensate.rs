//! `compensate`: a tool path that cancels the deflection that the model predicts along it.
//!
//! The machine is led along the path in steps, from each configuration to the next, so that it never jumps to another way to
//! hold the tool; the first point is held as `ik` would. Where a load acts, the command is what [`pkm_core::FiveAxis::compensated`]
//! says, rounded as it is written; its error is what the loaded model makes of that written command.

use std::ffi::OsStr;
use std::path::Path;

use pkm_core::{Configuration, CorrectionTable, Domain, Hold, Pose, Tool, ToolDeflectionError, Wrench};
use serde_json::{Value, json};

use crate::cli::output::Output;
use crate::cli::progress;
use crate::error::{Failure, Result, printable};
use crate::files::dataset::{self, MOST_LOAD, Sheet, WRENCH_COLUMNS};
use crate::files::gcode::Program;
use crate::files::machine::MachineFile;
use crate::files::path::{Move, Place, Toward, part_of};
use crate::files::source::{self, Source};
use crate::plan::reach::Reach;
use crate::pose::{PoseBox, file_units};
use crate::report::plot::{self, Mark, Panel, Series};

/// Longest way of the tip in one step when none is given, mm.
pub const STEP_MM: f64 = 2.0;
/// Furthest turn of the axis or of a wrist's joint in one step, rad.
const STEP_RAD: f64 = std::f64::consts::PI / 180.0;
/// Two axes farther apart than this are opposite.
const OPPOSITE_RAD: f64 = 0.999 * std::f64::consts::PI;
/// Most steps of a path.
const MOST_STEPS: f64 = 5e6;
/// How a comment begins that says of a path that it went through here: in every program; in a CSV, which others read line by
/// line, only with something to tell.
const MARK: &str = "pkm-host compensate";
const TOOL_COLUMNS: [&str; 6] = ["x_mm", "y_mm", "z_mm", "i", "j", "k"];

/// What `compensate` is asked for.
pub struct Request<'a> {
    /// Machine file.
    pub machine: Option<&'a Path>,
    /// `coefficients.json`.
    pub table: Option<&'a Path>,
    /// CSV or G-code.
    pub path: &'a Path,
    /// The load of a program, unless its comments say otherwise.
    pub wrench: Option<[f64; 6]>,
    /// Longest way of the tip between two points.
    pub step_mm: Option<f64>,
    /// Whether points outside the table's box are let through.
    pub allow_extrapolation: bool,
    /// The file to write.
    pub out: &'a Path,
}

/// A correction and the box that it was fitted on.
pub struct Correction<'a> {
    /// In the factor form.
    pub table: CorrectionTable<'a, f64>,
    /// In the units of files.
    pub extent: PoseBox,
    /// Its file.
    pub name: String,
}

/// A path as it was read.
enum Read {
    Csv { sheet: Sheet, moves: Vec<Move> },
    Program(Program),
}

/// Whether a file is a program by its name, or else a CSV, if that says either.
fn is_program(file: &Path) -> Option<bool> {
    match file.extension().and_then(OsStr::to_str).unwrap_or("").to_lowercase().as_str() {
        "csv" => Some(false),
        "ngc" | "nc" | "gcode" | "cnc" | "tap" => Some(true),
        _ => None,
    }
}

/// `--path`.
fn read(request: &Request<'_>) -> Result<Read> {
    let is_program = match is_program(request.path) {
        Some(is_program) => is_program,
        None => {
            let message = "expected a name that ends in .csv, or for G-code in .ngc, .nc, .gcode, .cnc or .tap";
            return Err(Failure::usage(message).in_file(request.path.display().to_string()));
        }
    };
    let source = Source::read(request.path)?;
    let marked = |l: &str| l.strip_prefix(['(', '#']).is_some_and(|l| l.trim_start().starts_with(MARK));
    if let Some(line) = source.text()?.lines().position(marked) {
        let message = "this path is compensated already: give the one that it was made from";
        return Err(Failure::input(message).in_file(source.name).at_line(line as u64 + 1));
    }
    if is_program {
        return Ok(Read::Program(Program::parse(&source, request.wrench.map(Wrench::from_array))?));
    }
    if request.wrench.is_some() {
        return Err(Failure::usage("--wrench is for G-code: a CSV gives the load in its columns fx_n … mz_nm"));
    }
    read_csv(source).map(|(sheet, moves)| Read::Csv { sheet, moves })
}

/// A path as a CSV has it: its cells and its moves.
///
/// # Errors
/// See [`Sheet`]; an axis without direction.
pub fn read_csv(source: Source) -> Result<(Sheet, Vec<Move>)> {
    let known = [&TOOL_COLUMNS[..], &WRENCH_COLUMNS].concat();
    let sheet = Sheet::parse(source, &known)?;
    sheet.require(&known)?;
    let mut moves: Vec<Move> = Vec::new();
    for row in &sheet.rows {
        let [x, y, z, i, j, k] = sheet.numbers(row, TOOL_COLUMNS)?;
        if [i, j, k] == [0.0; 3] {
            return Err(sheet.failure(row, "i, j, k are all 0 and give the tool no direction").at_column("i"));
        }
        let wrench = Wrench::from_array(sheet.load(row)?);
        let to = Place { tip_m: [x, y, z].map(|v| v / 1e3), toward: Toward::Axis([i, j, k]) };
        let before = moves.last().map_or(wrench, |m| m.wrench[1]);
        moves.push(Move { line: row.line, to, wrench: [before, wrench] });
    }
    Ok((sheet, moves))
}

/// A place as a file holds it. A program has mm to six decimals, axes to nine, degrees to eight; a CSV three more.
fn rounded(place: &Place, in_program: bool) -> Place {
    let finer = if in_program { 1.0 } else { 1e3 };
    let to = |v: f64, unit: f64| (v * unit * finer).round() / (unit * finer);
    let toward = match place.toward {
        Toward::Axis(axis) => Toward::Axis(axis.map(|v| to(v, 1e9))),
        Toward::Wrist(beta) => Toward::Wrist(beta.map(|v| to(v.to_degrees(), 1e8).to_radians())),
    };
    Place { tip_m: place.tip_m.map(|v| to(v * 1e3, 1e6) / 1e3), toward }
}

/// Greatest and root mean square of some errors.
#[derive(Default)]
struct Tally {
    max: f64,
    squares: f64,
    count: usize,
}

impl Tally {
    fn add(&mut self, value: f64) {
        self.max = self.max.max(value);
        self.squares += value * value;
        self.count += 1;
    }

    fn micro(&self) -> Value {
        json!({ "max": self.max * 1e6, "rms": self.rms() * 1e6 })
    }

    fn rms(&self) -> f64 {
        if self.count == 0 { 0.0 } else { (self.squares / self.count as f64).sqrt() }
    }
}

/// A loaded tool against what was asked: of the tip in m, of the axis in rad.
struct Met {
    hold: Hold<f64>,
    off: [f64; 2],
    domain: Option<Domain>,
}

/// A point of the new path.
#[derive(Clone, Copy)]
struct Point {
    place: Place,
    wrench: Wrench<f64>,
}

/// What came of a path.
#[derive(Default)]
struct Track {
    /// New points of every move.
    points: Vec<Vec<Point>>,
    /// Tip and axis, as the path was and as it becomes.
    before: [Tally; 2],
    after: [Tally; 2],
    /// Tip, half-way from point to point.
    halfway: Tally,
    least_share: f64,
    extrapolated: usize,
    /// Way in m, error of the tip before and after in m.
    curve: Vec<[f64; 3]>,
}

/// How far outside a table's box a pose is.
fn outside_by(pose: &Pose<f64>, extent: &PoseBox) -> String {
    let names = [("θ", "°"), ("σ", "°"), ("Z0", " mm")];
    let beyond =
        file_units(pose).into_iter().zip(extent.ranges()).zip(names).filter_map(|((v, [low, high]), (name, unit))| {
            let by = (low - v).max(v - high);
            (by > 0.0).then(|| format!("{name} = {v:.4}{unit} is {by:.4}{unit} outside {low} to {high}{unit}"))
        });
    beyond.collect::<Vec<_>>().join(", ")
}

/// Where a walk is, for a message.
#[derive(Clone, Copy)]
struct Spot {
    line: u64,
    /// Line of the place that it comes from, when it is on the way.
    from: Option<u64>,
    tip_m: [f64; 3],
}

/// A walk along a path.
struct Walk<'a> {
    reach: Reach<'a>,
    correction: Option<&'a Correction<'a>>,
    file: String,
    allow_extrapolation: bool,
    in_program: bool,
    track: Track,
    /// The last loaded point: as asked, and as commanded.
    last: Option<(Place, Point)>,
    way_m: f64,
    spot: Spot,
}

impl Walk<'_> {
    fn table(&self) -> Option<&CorrectionTable<'_, f64>> {
        self.correction.map(|c| &c.table)
    }

    /// What the loaded model makes of a command.
    fn met(
        &self,
        command: &Place,
        wrench: &Wrench<f64>,
        asked: &Tool<f64>,
        near: &Configuration<f64>,
    ) -> std::result::Result<Met, ToolDeflectionError> {
        let hold = self.reach.stand(command, near)?;
        let tool = self.reach.five.tool(&hold.configuration)?;
        let moved = self.reach.five.deflection(self.table(), &hold.configuration, wrench)?;
        let ([rx, ry, rz], [i, j, k]) = (moved.rotation_rad, tool.axis);
        let swing = [ry * k - rz * j, rz * i - rx * k, rx * j - ry * i];
        let off = |now: [f64; 3], by: [f64; 3], goal: [f64; 3]| {
            (0..3).map(|i| (now[i] + by[i] - goal[i]).powi(2)).sum::<f64>().sqrt()
        };
        Ok(Met {
            hold,
            off: [off(tool.tip_m, moved.translation_m, asked.tip_m), off(tool.axis, swing, asked.axis)],
            domain: moved.domain,
        })
    }

    fn here(&self, failure: Failure) -> Failure {
        let [x, y, z] = self.spot.tip_m.map(|m| (m * 1e6).round() / 1e3 + 0.0);
        let way = self.spot.from.map_or(String::new(), |line| format!("on the way from line {line} to here, "));
        let message = format!("{way}tip {x}, {y}, {z} mm: {}", failure.message);
        Failure { message, ..failure }.in_file(&self.file).at_line(self.spot.line)
    }

    fn failure(&self, e: ToolDeflectionError, there: Option<Hold<f64>>) -> Failure {
        self.here(match e {
            ToolDeflectionError::Tool(e) => {
                let (status, why) = self.reach.refusal(e, there.as_ref());
                Failure::refused(status, why)
            }
            e => Failure::input(e.to_string()),
        })
    }

    /// The command for a point under load, and what it leaves.
    fn loaded(&mut self, asked: &Place, near: &Configuration<f64>, wrench: &Wrench<f64>) -> Result<Hold<f64>> {
        let tool_at = |configuration: &Configuration<f64>| {
            self.reach.five.tool(configuration).map_err(|e| self.failure(e.into(), None))
        };
        let tool = tool_at(near)?;
        let command = self.reach.five.compensated(self.table(), &tool, wrench, near).map_err(|e| {
            let there = self.reach.unlimited().compensated(self.table(), &tool, wrench, near);
            let failure = self.failure(e, there.ok().map(|c| c.hold));
            Failure { message: format!("{} (with the deflection made up for)", failure.message), ..failure }
        })?;
        let configuration = command.hold.configuration;
        let Tool { tip_m, axis } = tool_at(&configuration)?;
        let toward = match asked.toward {
            Toward::Axis(_) => Toward::Axis(axis),
            Toward::Wrist(_) => Toward::Wrist(configuration.beta_rad),
        };
        let place = rounded(&Place { tip_m, toward }, self.in_program);
        let failed = |e| self.failure(e, self.reach.stand_anywhere(&place, &configuration));
        let before = self.met(asked, wrench, &tool, near).map_err(failed)?;
        let after = self.met(&place, wrench, &tool, &configuration).map_err(failed)?;
        let outside = self.correction.filter(|_| after.domain == Some(Domain::Outside));
        if let Some(correction) = outside.filter(|_| !self.allow_extrapolation) {
            let amount = outside_by(&after.hold.configuration.pose, &correction.extent);
            let name = &correction.name;
            let why = format!("outside the box of {name}: {amount}; fit a table there, or give --allow-extrapolation");
            return Err(self.here(Failure::refused("outside_box", why)));
        }
        let halfway = self.last.map(|(last_asked, last)| {
            let meant = self.reach.stand(&last_asked.between(asked, 0.5), near)?;
            let meant = self.reach.five.tool(&meant.configuration)?;
            self.met(&last.place.between(&place, 0.5), &part_of(&[last.wrench, *wrench], 0.5), &meant, near)
        });
        let halfway = halfway.transpose().map_err(failed)?;
        let track = &mut self.track;
        if let Some(halfway) = halfway {
            track.halfway.add(halfway.off[0]);
        }
        for i in 0..2 {
            track.before[i].add(before.off[i]);
            track.after[i].add(after.off[i]);
        }
        track.extrapolated += usize::from(outside.is_some());
        track.least_share = track.least_share.min(after.hold.home_share);
        track.curve.push([self.way_m, before.off[0], after.off[0]]);
        let point = Point { place, wrench: *wrench };
        self.last = Some((*asked, point));
        self.put(point);
        Ok(after.hold)
    }

    fn put(&mut self, point: Point) {
        if let Some(points) = self.track.points.last_mut() {
            points.push(point);
        }
    }
}

/// Goes along a path. A program's cuts are divided into steps; a CSV's only where a step is given.
fn walk<'a>(
    machine: &'a MachineFile,
    correction: Option<&'a Correction<'a>>,
    (moves, in_program): (&[Move], bool),
    request: &Request<'_>,
) -> Result<Track> {
    let (file, fill) = (request.path, in_program || request.step_mm.is_some());
    let reach = Reach::new(machine)?;
    let step_m = request.step_mm.unwrap_or(STEP_MM) / 1e3;
    let steps = |a: &Place, b: &Place| {
        let [way, turn] = a.apart(b);
        (way / step_m).max(turn / STEP_RAD).ceil().max(1.0)
    };
    let all: f64 = moves.windows(2).map(|w| steps(&w[0].to, &w[1].to)).sum::<f64>() + 1.0;
    if !(all <= MOST_STEPS) {
        let message =
            format!("{all:.0} steps, {MOST_STEPS:.0} at the most: give a greater --step-mm (are lengths in mm?)");
        return Err(Failure::input(message).in_file(file.display().to_string()));
    }
    let bar = progress::late_bar(all as u64, "{bar:30} {pos} of {len} points");
    let track = Track { least_share: f64::INFINITY, ..Track::default() };
    let file = file.display().to_string();
    let allow_extrapolation = request.allow_extrapolation;
    let spot = Spot { line: 0, from: None, tip_m: [0.0; 3] };
    let mut walk =
        Walk { reach, correction, file, allow_extrapolation, in_program, track, last: None, way_m: 0.0, spot };
    let mut near = walk.reach.home();
    for (index, mv) in moves.iter().enumerate() {
        walk.track.points.push(Vec::new());
        let before = index.checked_sub(1).map(|i| &moves[i]);
        let from = before.map_or(mv.to, |m| m.to);
        let n = steps(&from, &mv.to) as usize;
        if from.apart(&mv.to)[1] > OPPOSITE_RAD && matches!(mv.to.toward, Toward::Axis(_)) {
            let why = "the axis turns by 180° at once, and which way is not said: give a point between";
            return Err(Failure::input(why).in_file(&walk.file).at_line(mv.line));
        }
        // where the load changes at once, so does the command
        let jumps = before.is_some_and(|b| mv.is_loaded() && b.wrench[1] != mv.wrench[0]);
        if jumps || !mv.is_loaded() {
            walk.last = None;
        }
        let [length, _] = from.apart(&mv.to);
        let begun = walk.way_m;
        for k in usize::from(!jumps)..=n {
            let (ends, share) = (k == n, k as f64 / n as f64);
            let asked = if ends { mv.to } else { from.between(&mv.to, share) };
            walk.way_m = begun + share * length;
            walk.spot = Spot { line: mv.line, from: before.filter(|_| !ends).map(|b| b.line), tip_m: asked.tip_m };
            let hold = match asked.toward {
                Toward::Axis(axis) if index == 0 => {
                    walk.reach.nearest(&Tool { tip_m: asked.tip_m, axis }, &near).map_err(|f| walk.here(f))?
                }
                _ => walk
                    .reach
                    .stand(&asked, &near)
                    .map_err(|e| walk.failure(e.into(), walk.reach.stand_anywhere(&asked, &near)))?,
            };
            near = hold.configuration;
            walk.track.least_share = walk.track.least_share.min(hold.home_share);
            let wrench = part_of(&mv.wrench, share);
            if wrench != Wrench::ZERO && (fill || ends) {
                near = walk.loaded(&asked, &near, &wrench)?.configuration;
                if !fill {
                    walk.last = None;
                }
            } else if ends || (fill && mv.is_loaded()) {
                walk.put(Point { place: rounded(&asked, in_program), wrench });
            }
            progress::advance(&bar, 1);
        }
    }
    bar.finish_and_clear();
    Ok(walk.track)
}

fn csv(sheet: &Sheet, points: &[Vec<Point>], notes: &[String]) -> String {
    let place = |name: &str| sheet.header.iter().position(|h| h == name);
    let columns: Vec<Option<usize>> = TOOL_COLUMNS.iter().chain(&WRENCH_COLUMNS).map(|name| place(name)).collect();
    let mut rows = Vec::new();
    for (row, points) in sheet.rows.iter().zip(points) {
        for (n, point) in points.iter().enumerate() {
            let mut cells = row.to_cells();
            let Toward::Axis(axis) = point.place.toward else { continue };
            let tip = point.place.tip_m.map(|m| (m * 1e12).round() / 1e9);
            let wrench = point.wrench.to_array();
            // a row's own wrench stays as it was written
            let values = tip.into_iter().chain(axis).chain(wrench);
            let values = if n + 1 == points.len() { values.take(6) } else { values.take(12) };
            for (column, value) in columns.iter().zip(values) {
                if let Some(column) = column {
                    cells[*column] = sheet.written(value + 0.0);
                }
            }
            rows.push(cells);
        }
    }
    let notes: String = notes.iter().map(|note| format!("# {note}\n")).collect();
    notes + &dataset::to_csv(sheet.delimiter(), &sheet.header, rows)
}

/// Error of the tip along the way: of as many stretches as a screen shows, the greatest.
fn picture(track: &Track) -> Result<String> {
    const STRETCHES: usize = 250;
    let stretch = track.curve.len().div_ceil(STRETCHES).max(1);
    let series = |name: &str, column: usize| {
        let of = |part: &[[f64; 3]]| {
            let worst = part.iter().max_by(|a, b| a[column].total_cmp(&b[column]));
            worst.map(|p| (p[0] * 1e3, p[column] * 1e6))
        };
        let points = track.curve.chunks(stretch).filter_map(of).collect();
        Series { name: name.to_owned(), points, mark: Mark::Line }
    };
    // what is left lies at zero, as it should
    plot::panels(&[Panel {
        title: "error of the tip, as the model predicts it".to_owned(),
        x_label: "way of the tip in mm".to_owned(),
        y_label: "µm".to_owned(),
        series: vec![series("as it was", 1), series("compensated", 2)],
    }])
}

/// `compensate`: the path that cancels the predicted deflection.
///
/// # Errors
/// A bad file or option, a path that the machine or the table does not allow, an unwritable file.
pub fn compensate(machine: &MachineFile, correction: Option<&Correction<'_>>, request: &Request<'_>) -> Result<Output> {
    if let Some(step) = request.step_mm.filter(|step| *step < 0.001) {
        return Err(Failure::usage(format!("--step-mm: expected at least 0.001, found {step}")));
    }
    if let Some(load) = request.wrench.and_then(|w| w.into_iter().find(|f| f.abs() > MOST_LOAD)) {
        let message = format!("--wrench: expected numbers within ±{MOST_LOAD:e}, found {load:e}");
        return Err(Failure::usage(message));
    }
    let svg = request.out.with_extension("svg");
    let (Some(name), Some(svg_name)) = (source::name_of(request.out), svg.file_name().filter(|_| svg != request.out))
    else {
        let message = "expected the name of a file other than .svg: the plot goes there";
        return Err(Failure::usage(message).in_file(request.out.display().to_string()));
    };
    let path = read(request)?;
    if is_program(request.out).is_some_and(|to| to != matches!(path, Read::Program(_))) {
        let message = "expected a name for the kind of file that --path is, CSV or G-code";
        return Err(Failure::usage(message).in_file(request.out.display().to_string()));
    }
    let moves = match &path {
        Read::Csv { moves, .. } => (&moves[..], false),
        Read::Program(program) => (&program.moves[..], true),
    };
    let track = walk(machine, correction, moves, request)?;
    let points: usize = track.points.iter().map(Vec::len).sum();
    if track.curve.is_empty() {
        eprintln!("warning: no load anywhere on the path: nothing to make up for");
    }

    let mut notes = Vec::new();
    if track.extrapolated > 0 {
        let beyond = format!("{} of {points} points lie outside the table's box: extrapolated", track.extrapolated);
        eprintln!("warning: {beyond}");
        notes.push(format!("{MARK}: {beyond}"));
    }
    let written = match &path {
        Read::Csv { sheet, .. } => csv(sheet, &track.points, &notes),
        Read::Program(program) => {
            let table = correction.map_or("no table", |c| c.name.rsplit(['/', '\\']).next().unwrap_or(&c.name));
            let load = request
                .wrench
                .map_or(String::new(), |w| format!(", load {} N, N m", w.map(|v| v.to_string()).join(" ")));
            let path = request.path.file_name().unwrap_or(OsStr::new("")).to_string_lossy();
            let names = [machine.name.as_str(), &printable(table), &printable(&path)].join(", ");
            notes.insert(0, format!("{MARK}: machine {names}{load}"));
            let places: Vec<Vec<Place>> = track.points.iter().map(|p| p.iter().map(|p| p.place).collect()).collect();
            program.written(&places, &notes)
        }
    };
    let inputs = [request.machine, request.table, Some(request.path)];
    source::write_all(source::folder_of(request.out), &[(name, written), (svg_name, picture(&track)?)], &inputs)?;

    let micro = |t: &Tally| format!("{:.4} at most, {:.4} rms", t.max * 1e6, t.rms() * 1e6);
    let [before, after] = [&track.before, &track.after];
    let mut text = format!(
        "wrote {points} points to {} and their errors to {}\n\
         error of the tip in µm, as the model predicts it: {}; compensated {}\n\
         error of the axis in µrad: {}; compensated {}\n",
        request.out.display(),
        svg.display(),
        micro(&before[0]),
        micro(&after[0]),
        micro(&before[1]),
        micro(&after[1]),
    );
    if track.halfway.count > 0 {
        text.push_str(&format!("of the tip half-way between points in µm: {}\n", micro(&track.halfway)));
    }
    text.push_str(&format!("least home share of the determinant {:.4}\n", track.least_share));
    let json = json!({
        "points": points,
        "loaded_points": track.curve.len(),
        "error_before_um": before[0].micro(),
        "error_after_um": after[0].micro(),
        "axis_error_before_urad": before[1].micro(),
        "axis_error_after_urad": after[1].micro(),
        "error_halfway_um": (track.halfway.count > 0).then(|| track.halfway.micro()),
        "min_home_share": track.least_share,
        "extrapolated_points": track.extrapolated,
        "out": request.out.display().to_string(),
        "plot": svg.display().to_string(),
    });
    Output::new(text, &json)
}

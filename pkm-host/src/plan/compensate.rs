//! `compensate`: a tool path that cancels the deflection that the model predicts along it.
//!
//! The machine is led along the path in steps, from each configuration to the next, so that it never jumps to another way to
//! hold the tool; the first point is held as `ik` would. Where a load acts, the command is what [`pkm_core::FiveAxis::compensated`]
//! says, rounded as it is written; its error is what the loaded model makes of that written command.

use pkm_core::kinematics::platform_axes;
use pkm_core::nalgebra::Vector3;
use pkm_core::{
    CompensatedTool, Configuration, CorrectionTable, Domain, JointValues, Pose, TableUncertainty, TipUncertainty, Tool,
    ToolDeflectionError, ToolSolution, Wrench,
};

use crate::error::{Failure, Result};
use crate::files::cutting::Cut;
use crate::files::limits::JointLimits;
use crate::files::machine::MachineFile;
use crate::files::path::{Load, Move, Place, Toward, part_of, rounded};
use crate::files::tool_path::Point;
use crate::plan::cutting::{self, MeanForce};
use crate::plan::feed::{JointTrack, NotHeld};
use crate::plan::implausible_load;
use crate::plan::reach::Reach;
use crate::plan::track::{Error, KnownDeflection, LoadedPoint, PathPlace, Track};
use crate::pose::{PoseBox, file_units};
use crate::progress::Progress;

/// Longest path of the tip in one step when none is given, mm.
pub const STEP_MM: f64 = 2.0;
/// Furthest turn of the axis or of a wrist's joint in one step, rad.
const STEP_RAD: f64 = std::f64::consts::PI / 180.0;
/// Two axes farther apart than this are opposite.
const OPPOSITE_RAD: f64 = 0.999 * std::f64::consts::PI;
/// Most steps of a path.
const MAX_STEPS: f64 = 5e6;
/// An estimated load that changes by no more than this share of it goes on without a point of its own.
const LOAD_TOLERANCE: f64 = 0.01;

/// A path and how it is walked.
pub struct Request<'a> {
    /// Its file, for messages.
    pub file: &'a str,
    /// In the file's order.
    pub moves: &'a [Move],
    /// G-code rather than CSV: always divided into steps, and rounded to its digits.
    pub in_program: bool,
    /// Longest path of the tip between two points; without it the rows of a CSV stay as they are.
    pub step_mm: Option<f64>,
    /// Whether points outside the table's box are let through.
    pub allow_extrapolation: bool,
    /// Of the joints, to hold the programmed feeds against.
    pub limits: Option<&'a JointLimits>,
    /// How far given loads may be off, as a share of them.
    pub load_u_rel: f64,
}

/// A correction and the box that it was fitted on.
pub struct Correction<'a> {
    /// In the factor form.
    pub table: CorrectionTable<'a, f64>,
    /// How far it may be off, where it says so.
    pub uncertainty: Option<TableUncertainty<f64>>,
    /// In the units of files.
    pub extent: PoseBox,
    /// Its file.
    pub name: String,
}

/// A loaded tool against what was asked.
struct LoadedTool {
    solution: ToolSolution<f64>,
    tip_off_m: [f64; 3],
    axis_off: [f64; 3],
    domain: Option<Domain>,
}

impl LoadedTool {
    /// How far off tip and axis are, in m and rad.
    fn off(&self) -> [f64; 2] {
        [self.tip_off_m, self.axis_off].map(length)
    }
}

fn length(v: [f64; 3]) -> f64 {
    v.into_iter().map(|x| x.powi(2)).sum::<f64>().sqrt()
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
struct PathPosition {
    line: u64,
    /// Line of the place that it comes from, when it is on the way.
    from: Option<u64>,
    tip_m: [f64; 3],
}

/// A walk along a path.
struct Walk<'a> {
    request: &'a Request<'a>,
    /// With the tool in hand.
    reach: &'a Reach<'a>,
    correction: Option<&'a Correction<'a>>,
    track: Track,
    /// The last loaded point: as asked, and as commanded.
    last: Option<(Place, Point)>,
    /// New points of the move that is being gone along.
    points: Vec<Point>,
    /// Where the machine stands, and its joints without the load.
    near: Configuration<f64>,
    stood: Option<JointValues<f64>>,
    /// Ends of the last chords of an arc.
    arc: JointTrack,
    /// The load at the end of the move before.
    ended: Wrench<f64>,
    /// The last cut that a force was estimated for.
    estimated: Option<(Cut, MeanForce)>,
    path_length_m: f64,
    position: PathPosition,
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
    ) -> std::result::Result<LoadedTool, ToolDeflectionError> {
        let solution = self.reach.stand(command, near)?;
        let tool = self.reach.five.tool(&solution.configuration)?;
        let moved = self.reach.five.deflection(self.table(), &solution.configuration, wrench)?;
        Ok(LoadedTool {
            solution,
            tip_off_m: (tool.tip_m + moved.translation_m - asked.tip_m).into(),
            axis_off: (tool.axis + moved.rotation_rad.cross(&tool.axis) - asked.axis).into(),
            domain: moved.domain,
        })
    }

    /// How well the table knows what a load does to the tool in a configuration.
    fn known(
        &self,
        configuration: &Configuration<f64>,
        wrench: &Wrench<f64>,
        moved_m: [f64; 3],
    ) -> std::result::Result<Option<KnownDeflection>, ToolDeflectionError> {
        let Some(Correction { table, uncertainty: Some(uncertainty), .. }) = self.correction else { return Ok(None) };
        let pose = &configuration.pose;
        let frame = self.reach.five.frame(configuration)?;
        // from B-xyz, and the load from the tool's axes, to A-uvw
        let to_a = platform_axes(pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos()).transpose();
        let tip_m = to_a * (frame.tip_m - pose.a_in_b_m());
        let turned = to_a * frame.axes;
        let at_tip = Wrench { force_n: turned * wrench.force_n, moment_nm: turned * wrench.moment_nm };
        let factor = table.factor_form(self.reach.five.machine, pose)?.factor;
        let found: TipUncertainty<f64> = table.tip_uncertainty(uncertainty, &factor, pose, &at_tip, tip_m)?;
        Ok(Some(KnownDeflection { u95_m: found.u95_m().norm(), share: found.known_share(&moved_m.into()) }))
    }

    /// What the loaded model makes of a point without compensation, and how well that is known.
    fn uncompensated(
        &self,
        asked: &Place,
        wrench: &Wrench<f64>,
        tool: &Tool<f64>,
        near: &Configuration<f64>,
    ) -> std::result::Result<(LoadedTool, Option<KnownDeflection>), ToolDeflectionError> {
        let before = self.met(asked, wrench, tool, near)?;
        let known = self.known(&before.solution.configuration, wrench, before.tip_off_m)?;
        Ok((before, known))
    }

    fn here(&self, failure: Failure) -> Failure {
        let [x, y, z] = self.position.tip_m.map(|m| (m * 1e6).round() / 1e3 + 0.0);
        let way = self.position.from.map_or(String::new(), |line| format!("on the way from line {line} to here, "));
        let message = format!("{way}tip {x}, {y}, {z} mm: {}", failure.message);
        Failure { message, ..failure }.in_file(self.request.file).at_line(self.position.line)
    }

    fn failure(&self, e: ToolDeflectionError, there: Option<ToolSolution<f64>>) -> Failure {
        self.here(match e {
            ToolDeflectionError::Tool(e) => {
                let (status, why) = self.reach.refusal(e, there.as_ref());
                Failure::refused(status, why)
            }
            e => Failure::input(e.to_string()),
        })
    }

    /// The command that takes a tool to where it would stand without a share of a load's deflection.
    fn command(
        &self,
        tool: &Tool<f64>,
        (wrench, share): (&Wrench<f64>, f64),
        near: &Configuration<f64>,
    ) -> Result<CompensatedTool<f64>> {
        let table = self.table();
        let command = self.reach.five.compensated_in_part(table, tool, wrench, share, near).map_err(|e| {
            let there = self.reach.unlimited().compensated_in_part(table, tool, wrench, share, near);
            let failure = self.failure(e, there.ok().map(|c| c.solution));
            Failure { message: format!("{} (with the deflection compensated)", failure.message), ..failure }
        })?;
        if command.converged {
            return Ok(command);
        }
        let left_um = command.remaining_m * 1e6;
        let why = format!("the deflection changes too much on the way: {left_um:.1} µm of it would remain");
        Err(self.here(Failure::input(why)))
    }

    /// The command for a point under load, and what it leaves.
    fn loaded(
        &mut self,
        asked: &Place,
        near: &Configuration<f64>,
        wrench: &Wrench<f64>,
        u_rel: f64,
    ) -> Result<(ToolSolution<f64>, LoadedPoint)> {
        let tool_at = |configuration: &Configuration<f64>| {
            self.reach.five.tool(configuration).map_err(|e| self.failure(e.into(), None))
        };
        let tool = tool_at(near)?;
        let uncompensated = self.uncompensated(asked, wrench, &tool, near);
        // as a controller does: of the deflection no more than is known
        let share = uncompensated.as_ref().ok().and_then(|(_, known)| *known).map_or(1.0, |known| known.share);
        let command = self.command(&tool, (wrench, share), near).map_err(|failure| {
            let moved_m = uncompensated.as_ref().map_or(f64::NAN, |(before, _)| before.off()[0]);
            let why = implausible_load("the load takes the tip off its path by", moved_m);
            Failure {
                message: [Some(failure.message), why].into_iter().flatten().collect::<Vec<_>>().join("; "),
                ..failure
            }
        })?;
        let configuration = command.solution.configuration;
        let Tool { tip_m, axis } = tool_at(&configuration)?;
        let toward = match asked.toward {
            Toward::Axis(_) => Toward::Axis(axis.into()),
            Toward::Wrist(_) => Toward::Wrist(configuration.beta_rad.into()),
            Toward::Head(head, angles) => Toward::Head(head, head.angles(axis.into(), angles)),
        };
        let place = rounded(&Place { tip_m: tip_m.into(), toward }, self.request.in_program);
        let failed = |e| self.failure(e, self.reach.stand_anywhere(&place, &configuration));
        let (before, known) = uncompensated.map_err(failed)?;
        let after = self.met(&place, wrench, &tool, &configuration).map_err(failed)?;
        let outside = self.correction.filter(|_| after.domain == Some(Domain::Outside));
        if let Some(correction) = outside.filter(|_| !self.request.allow_extrapolation) {
            let amount = outside_by(&after.solution.configuration.pose, &correction.extent);
            let name = &correction.name;
            let why = format!("outside the box of {name}: {amount}; fit a table there, or give --allow-extrapolation");
            return Err(self.here(Failure::refused("outside_box", why)));
        }
        let midpoint = self.last.map(|(last_asked, last)| {
            let meant = self.reach.stand(&last_asked.between(asked, 0.5), near)?;
            let meant = self.reach.five.tool(&meant.configuration)?;
            self.met(&last.place.between(&place, 0.5), &part_of(&[last.wrench, *wrench], 0.5), &meant, near)
        });
        let midpoint = midpoint.transpose().map_err(failed)?;
        let off_by = |share: f64| {
            let wrench = Wrench::from_vector(wrench.to_vector() * (1.0 + share));
            Ok(self.met(&place, &wrench, &tool, &configuration).map_err(failed)?.off()[0])
        };
        let load_off_m = if u_rel > 0.0 { f64::max(off_by(u_rel)?, off_by(-u_rel)?) } else { after.off()[0] };
        let track = &mut self.track;
        midpoint.iter().for_each(|midpoint| track.at_midpoints.add(midpoint.off()[0]));
        let [off_before, off_after] = [before.off(), after.off()];
        for i in 0..2 {
            track.before[i].add(off_before[i]);
            track.after[i].add(off_after[i]);
        }
        if u_rel > 0.0 {
            track.load_off.add(load_off_m);
        }
        if let Some(known) = known {
            track.u95.add(known.u95_m);
            track.unsure += usize::from(known.share < 1.0);
            track.least_known_share = track.least_known_share.min(known.share);
        }
        track.extrapolated += usize::from(outside.is_some());
        let (line, tip_m) = (self.position.line, asked.tip_m);
        let extent = self.correction.map(|c| &c.extent);
        track.margins.take(self.reach.file, &after.solution, extent, line, tip_m);
        let (before_m, after_m) = (before.tip_off_m, off_after[0]);
        let loaded =
            LoadedPoint { line, path_length_m: self.path_length_m, tip_m, before_m, after_m, load_off_m, known };
        track.take(loaded);
        let point = Point { place, wrench: *wrench, is_begin: false };
        self.last = Some((*asked, point));
        self.points.push(point);
        Ok((after.solution, loaded))
    }

    /// The load of a move at a share of it, with the machine in a configuration.
    fn wrench(
        &mut self,
        mv: &Move,
        from: &Place,
        share: f64,
        configuration: &Configuration<f64>,
    ) -> Result<Wrench<f64>> {
        let cut = match mv.load {
            Load::Given(wrenches) => return Ok(part_of(&wrenches, share)),
            Load::Cut(cut) => cut,
        };
        let mean = match self.estimated.filter(|(other, _)| *other == cut) {
            Some((_, mean)) => mean,
            None => self.estimated.insert((cut, cutting::milling(&cut))).1,
        };
        let frame = self.reach.five.frame(configuration).map_err(|e| self.failure(e.into(), None))?;
        let direction = frame.axes.transpose() * (Vector3::from(mv.to.tip_m) - Vector3::from(from.tip_m));
        Ok(cutting::wrench(&cut, &mean, &direction))
    }

    /// Whether the load at the beginning of a move is another than at the end of the one before. Where it is, so is the command: a cut
    /// without load begins where it is programmed. A rapid goes from where the machine stands.
    fn jumps(&mut self, mv: &Move, from: &Place) -> Result<bool> {
        let near = self.near;
        let begins = self.wrench(mv, from, 0.0, &near)?;
        if begins == Wrench::ZERO {
            return Ok(self.ended != Wrench::ZERO && !mv.is_rapid);
        }
        let change = (begins.to_vector() - self.ended.to_vector()).norm();
        Ok(match mv.load {
            Load::Given(_) => change > 0.0,
            Load::Cut(_) => change > LOAD_TOLERANCE * begins.to_vector().norm(),
        })
    }

    /// Holds the joints of a move against their limits; those of an arc also where its chords meet, which no chord by itself shows.
    fn hold_against(&mut self, limits: &JointLimits, joints: &JointTrack, mv: &Move, step: [f64; 2], steps: f64) {
        self.track.slow_down(joints.too_fast(step, mv, limits));
        if !mv.continues {
            self.arc = JointTrack::default();
        }
        self.arc.follow(joints);
        if mv.continues {
            self.track.slow_down(self.arc.too_fast(step.map(|way| steps * way), mv, limits));
        }
    }

    /// Goes along a move, in steps.
    fn go(&mut self, mv: &Move, before: Option<&Move>, n: u64, progress: &Progress<'_>) -> Result<()> {
        let Request { file, in_program, .. } = *self.request;
        let fill = in_program || self.request.step_mm.is_some();
        let from = before.map_or(mv.to, |m| m.to);
        let [length_m, turn_rad] = from.apart(&mv.to);
        if turn_rad > OPPOSITE_RAD && matches!(mv.to.toward, Toward::Axis(_)) {
            let why = "the axis turns by 180° at once, and which way is not said: give a point between";
            return Err(Failure::input(why).in_file(file).at_line(mv.line));
        }
        let jumps = before.is_some() && self.jumps(mv, &from)?;
        if jumps || !mv.is_loaded() {
            self.last = None;
        }
        let u_rel = if let Load::Cut(cut) = mv.load { cut.material.u_rel } else { self.request.load_u_rel };
        self.track.estimated += usize::from(matches!(mv.load, Load::Cut(_)));
        let begun = self.path_length_m;
        let mut joints = JointTrack::default();
        if !jumps && let Some(stood) = &self.stood {
            joints.add(stood);
        }
        for k in u64::from(!jumps)..=n {
            let (ends, share) = (k == n, k as f64 / n as f64);
            let asked = if ends { mv.to } else { from.between(&mv.to, share) };
            self.path_length_m = begun + share * length_m;
            self.position =
                PathPosition { line: mv.line, from: before.filter(|_| !ends).map(|b| b.line), tip_m: asked.tip_m };
            let solution = self.reach.along_path(&asked, &self.near, before.is_none()).map_err(|f| self.here(f))?;
            self.near = solution.configuration;
            joints.add(&solution.joints);
            self.stood = Some(solution.joints);
            let wrench = self.wrench(mv, &from, share, &solution.configuration)?;
            self.track.margins.take(self.reach.file, &solution, None, mv.line, asked.tip_m);
            let mut before_m = None;
            if wrench != Wrench::ZERO && (fill || ends) {
                let (loaded, point) = self.loaded(&asked, &solution.configuration, &wrench, u_rel)?;
                (self.near, before_m) = (loaded.configuration, Some(point.error_m(Error::Before)));
            } else if ends || (fill && (k == 0 || mv.is_loaded())) {
                self.points.push(Point { place: rounded(&asked, in_program), wrench, is_begin: false });
            }
            if k == 0
                && let Some(point) = self.points.last_mut()
            {
                point.is_begin = true;
            }
            self.ended = wrench;
            // what is not written under load is not computed either: nothing is known of its error
            let is_drawn = wrench == Wrench::ZERO || before_m.is_some();
            let place = PathPlace { tip_m: asked.tip_m, before_m, is_fresh: before.is_none() };
            self.track.step(is_drawn.then_some(place), ends);
            let [done, all] = self.track.steps;
            progress("points", done.min(all), all);
        }
        if let Some(limits) = self.request.limits.filter(|_| !mv.is_rapid) {
            let why_not = NotHeld::of(mv, before.is_some_and(|b| b.longer_m == mv.longer_m));
            if let Some(feeds) = self.track.feeds.as_mut().filter(|_| !mv.continues) {
                feeds.add(why_not, mv.line);
            }
            if why_not.is_none() {
                let steps = n as f64;
                let step = [length_m, from.turned_rad(&mv.to)].map(|way| way / steps);
                self.hold_against(limits, &joints, mv, step, steps);
            }
        }
        Ok(())
    }
}

/// The machine with each length of tool that the moves have.
fn with_tools(machine: &MachineFile, moves: &[Move]) -> Result<Vec<(f64, MachineFile)>> {
    let mut machines: Vec<(f64, MachineFile)> = vec![(0.0, machine.clone())];
    let mut length_m = 0.0;
    for mv in moves.iter().filter(|m| m.longer_m != std::mem::replace(&mut length_m, m.longer_m)) {
        if machines.iter().all(|(longer_m, _)| *longer_m != mv.longer_m) {
            machines.push((mv.longer_m, machine.with_longer_tool(mv.longer_m)?));
        }
    }
    Ok(machines)
}

/// Steps of a path, between points `steps` apart.
fn all_steps(moves: &[Move], steps: impl Fn(&Place, &Place) -> f64) -> Result<u64> {
    let between = |w: &[Move]| if w[1].is_fresh { 1.0 } else { steps(&w[0].to, &w[1].to) };
    let all = moves.windows(2).map(between).sum::<f64>() + 1.0;
    if all <= MAX_STEPS {
        return Ok(all as u64);
    }
    let message = format!("{all:.0} steps, {MAX_STEPS:.0} at the most: give a greater --step-mm (are lengths in mm?)");
    Err(Failure::input(message))
}

/// Goes along a path, and gives the new points of each move to `write`. A program's cuts are divided into steps; a CSV's only where a step is given.
///
/// # Errors
/// A path that the machine or the table does not allow.
pub fn walk<'a>(
    machine: &'a MachineFile,
    correction: Option<&'a Correction<'a>>,
    request: &Request<'a>,
    write: &mut dyn FnMut(&[Point]),
    progress: &Progress<'_>,
) -> Result<Track> {
    let Request { file, moves, .. } = *request;
    let machines = with_tools(machine, moves)?;
    let reaches = machines.iter().map(|(_, machine)| Reach::new(machine)).collect::<Result<Vec<_>>>()?;
    let step_m = request.step_mm.unwrap_or(STEP_MM) / 1e3;
    let steps = |a: &Place, b: &Place| {
        let [way, turn] = a.apart(b);
        (way / step_m).max(turn / STEP_RAD).ceil().max(1.0)
    };
    let all = all_steps(moves, steps).map_err(|f| f.in_file(file))?;
    let mut walk = Walk {
        request,
        reach: &reaches[0],
        correction,
        track: Track::of_steps(all, request.limits.is_some()),
        last: None,
        points: Vec::new(),
        near: reaches[0].home(),
        stood: None,
        arc: JointTrack::default(),
        ended: Wrench::ZERO,
        estimated: None,
        path_length_m: 0.0,
        position: PathPosition { line: 0, from: None, tip_m: [0.0; 3] },
    };
    for (index, mv) in moves.iter().enumerate() {
        walk.points.clear();
        let tool = machines.iter().position(|(longer_m, _)| *longer_m == mv.longer_m);
        walk.reach = &reaches[tool.unwrap_or(0)];
        let before = index.checked_sub(1).filter(|_| !mv.is_fresh).map(|i| &moves[i]);
        let n = before.map_or(1.0, |b| steps(&b.to, &mv.to)) as u64;
        walk.go(mv, before, n, progress)?;
        walk.track.points += walk.points.len();
        write(&walk.points);
    }
    progress("points", all, all);
    walk.track.finish();
    Ok(walk.track)
}

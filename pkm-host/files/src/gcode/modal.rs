//! What is in force in a program, and what a line's words do: where they move the tool.

use super::arcs::Plane;
use super::cycles::{Drill, DrillWords};
use super::motions::{TurnFeed, dwell};
use super::offsets::Offsets;
use super::words::{Line, Numbers};
use super::{Refusal, Setup, codes};
use crate::path::{FeedMode, Place, Toward};
use crate::tools::Called;

/// Of X Y Z or I J K, as far as they are known.
pub(super) type Axes = [Option<f64>; 3];

/// Greatest coordinate of a tip in B in mm and greatest angle in degrees: far beyond any machine.
const MAX_COORDINATE: f64 = 1e7;
/// Greatest offset, mm: a coordinate in the program is then within what a word may say.
const MAX_OFFSET: f64 = 1e8;
/// M words with P that move nothing. Not M67 and M68, which give LinuxCNC's component the load: it would be compensated twice.
const OVERRIDES_AND_OUTPUTS: [f64; 8] = [50.0, 51.0, 52.0, 53.0, 62.0, 63.0, 64.0, 65.0];

/// What moves the tool until another is named.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Motion {
    Rapid,
    Cut,
    Arc { clockwise: bool },
    Drill(Drill),
}

/// How a line with moves is written, and the coordinates of new points.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Style {
    pub form: Form,
    /// The program's origin in B, mm.
    pub origin_mm: [f64; 3],
    /// 1, or 25.4 for inches.
    pub unit_mm: f64,
    pub incremental: bool,
    /// `G93`: F is 1 over the minutes of a move.
    pub inverse_time: bool,
    /// Of a cut that only turns the tool, in `G94` and `G95`.
    pub turn_feed: Option<TurnFeed>,
    /// `G53`: on every line.
    pub in_machine: bool,
}

/// How a line with moves is written.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Form {
    /// `G0`, `G1`: with the line's own words.
    Straight,
    /// As straight cuts.
    Arc,
    /// As straight moves; after a cut a dwell of P.
    Drill { dwell: Option<f64> },
    /// As it is: the control moves to its reference point, X Y Z and the rotary axes where they are named.
    Reference { named: [bool; 5] },
}

/// Where a move ends.
pub(super) struct Stop {
    pub place: Place,
    pub rapid: bool,
    /// See [`Move::continues`](crate::path::Move::continues).
    pub continues: bool,
}

/// What a line did.
pub(super) enum Effect {
    /// No move.
    Nothing,
    /// Moves; the first begins at a place that is not known.
    Moves { form: Form, fresh: bool },
    /// A rapid move that cannot be checked, for this reason.
    Unchecked(String),
}

/// What is in force until it is said anew.
pub(super) struct Modal<'a> {
    pub setup: &'a Setup,
    pub motion: Option<Motion>,
    pub plane: Plane,
    pub unit_mm: f64,
    pub incremental: bool,
    pub center_is_absolute: bool,
    /// G93, G94 or G95.
    pub feed_mode: FeedMode,
    /// F of G94, see [`Move::feed_per_min`](crate::path::Move::feed_per_min).
    pub feed_per_min: Option<[f64; 2]>,
    /// F of G95, mm and as it stands.
    pub feed_per_turn: Option<[f64; 2]>,
    /// S.
    pub spindle_per_min: Option<f64>,
    /// `G99` (true) or `G98`, which is in force where the program says neither.
    pub retracts_to_r: Option<bool>,
    /// A hole's end depends on which of them that is.
    pub assumes_g98: bool,
    pub offsets: Offsets,
    /// The line that is carried out, in the file, from 1.
    pub line: u64,
    /// In hand.
    pub tool: Option<f64>,
    length_is_on: bool,
    /// Over the flange of the machine file, mm.
    pub length_mm: f64,
    /// Which tool's length that is; `None` where none is in force.
    pub length_of: Option<Called>,
    pub tip_mm: Axes,
    pub axis: Axes,
    pub turn_deg: [Option<f64>; 2],
    /// Where the last move ended, if all of it is known.
    pub last: Option<Place>,
    pub drill: DrillWords,
    /// Height before the first cycle of a row of them, mm.
    pub initial_mm: Option<f64>,
}

/// The target of a move as far as it is known.
pub(super) struct Target {
    pub tip_mm: Axes,
    pub axis: Axes,
    pub turn_deg: [Option<f64>; 2],
}

impl<'a> Modal<'a> {
    pub fn new(setup: &'a Setup) -> Self {
        Self {
            setup,
            motion: None,
            plane: Plane::XY,
            unit_mm: 1.0,
            incremental: false,
            center_is_absolute: false,
            feed_mode: FeedMode::OfAMinute,
            feed_per_min: None,
            feed_per_turn: None,
            spindle_per_min: None,
            retracts_to_r: None,
            assumes_g98: false,
            offsets: Offsets::new(setup),
            line: 0,
            tool: None,
            length_is_on: false,
            length_mm: 0.0,
            length_of: None,
            tip_mm: [None; 3],
            axis: [None; 3],
            turn_deg: [None; 2],
            last: None,
            drill: DrillWords::default(),
            initial_mm: None,
        }
    }

    /// What moves the tool from here on; a row of cycles ends with another motion, and what they were given is forgotten.
    pub fn set_motion(&mut self, motion: Option<Motion>) {
        self.motion = motion;
        if !matches!(motion, Some(Motion::Drill(_))) {
            (self.drill, self.initial_mm) = (DrillWords::default(), None);
        }
    }

    /// G93, G94 or G95: an F of another mode is no feed of this one.
    pub fn set_feed_mode(&mut self, mode: FeedMode) {
        (self.feed_mode, self.feed_per_min, self.feed_per_turn) = (mode, None, None);
    }

    /// F in force for a cut: mm a minute, and ° a minute where only the tool turns.
    pub fn feed_a_minute(&self) -> Option<[f64; 2]> {
        match self.feed_mode {
            FeedMode::OfAMinute => self.feed_per_min,
            FeedMode::OfATurn => {
                self.feed_per_turn.zip(self.spindle_per_min).map(|(feed, speed)| feed.map(|f| f * speed))
            }
            FeedMode::InverseTime => None,
        }
    }

    /// How points of this line are written.
    pub fn style(&self, form: Form, in_machine: bool) -> Style {
        Style {
            form,
            origin_mm: if in_machine { [0.0; 3] } else { self.offsets.total_mm() },
            unit_mm: self.unit_mm,
            incremental: self.incremental,
            inverse_time: self.feed_mode == FeedMode::InverseTime,
            turn_feed: self.turn_feed(),
            in_machine,
        }
    }

    /// Carries a line out; its moves go to `stops`. `loaded`: the last move ended under load, so that the new program stands
    /// elsewhere than this one says.
    pub fn take(&mut self, line: &Line<'_>, loaded: bool, stops: &mut Vec<Stop>) -> Result<Effect, Refusal> {
        let mut numbers = Numbers::of(line)?;
        let feed = numbers.take('F');
        if let Some(feed) = feed.filter(|feed| *feed < 0.0) {
            return Err(format!("F{feed}: a feed is not below 0"));
        }
        if let Some(speed) = numbers.take('S') {
            if speed < 0.0 {
                return Err(format!("S{speed}: a speed is not below 0: M4 turns the spindle backwards"));
            }
            self.spindle_per_min = (speed > 0.0).then_some(speed);
        }
        if line.words.first().is_some_and(|w| w.letter == 'N') {
            numbers.take('N');
        }
        numbers.take('T');
        let codes = codes::Codes::take(line, self)?;
        if self.feed_mode == FeedMode::InverseTime && feed == Some(0.0) {
            return Err("F0 in G93: a move would take for ever".into());
        }
        if let Some(feed) = feed {
            let feed = (feed > 0.0).then_some([feed * self.unit_mm, feed]);
            match self.feed_mode {
                FeedMode::OfAMinute => self.feed_per_min = feed,
                FeedMode::OfATurn => self.feed_per_turn = feed,
                FeedMode::InverseTime => {}
            }
        }
        if let Some(on) = codes.length {
            self.length_is_on = on;
        }
        self.take_length(codes.length, &mut numbers)?;
        let rotary = self.rotary_letters();
        let effect = match codes.other {
            Some(other) => self.take_other(other, line, &mut numbers, loaded, stops)?,
            None if codes.motion.is_some() || numbers.has_any(&format!("XYZIJK{rotary}")) => {
                self.take_motion(codes.motion.is_some(), line, &mut numbers, stops)?
            }
            None => Effect::Nothing,
        };
        self.leftover(line, &mut numbers)?;
        Ok(effect)
    }

    /// Letters of the program's rotary axes.
    pub fn rotary_letters(&self) -> &'static str {
        self.setup.head.map_or("AB", |head| head.letters())
    }

    /// Words that nothing has used.
    fn leftover(&self, line: &Line<'_>, numbers: &mut Numbers) -> Result<(), Refusal> {
        let passes = |code: &[f64]| line.words.iter().any(|w| w.is('G', code));
        let allowed = match () {
            () if passes(&[64.0]) => "PQ",
            () if passes(&[5.0, 5.1, 8.0, 187.0]) => "PQRE",
            () if line.words.iter().any(|w| w.is('M', &[98.0])) => "PL",
            () if line.words.iter().any(|w| w.is('M', &[99.0])) && line.has('P') => {
                return Err("`M99 P`: a return to a line by its number is not followed: write M99 alone".into());
            }
            () if line.words.iter().any(|w| w.is('M', &OVERRIDES_AND_OUTPUTS)) => "P",
            () => "",
        };
        let left = line
            .words
            .iter()
            .find(|w| !"GM".contains(w.letter) && numbers.take(w.letter).is_some() && !allowed.contains(w.letter));
        let Some(word) = left else { return Ok(()) };
        Err(format!("`{}` is not supported: {}", word.shown(), self.why_not(word.letter)))
    }

    /// G43 and G49; a length that changes leaves the tip's height unknown.
    fn take_length(&mut self, code: Option<bool>, numbers: &mut Numbers) -> Result<(), Refusal> {
        let number = match code {
            Some(false) => {
                numbers.take('H');
                Some(0.0)
            }
            Some(true) => Some(numbers.take('H').or(self.tool).ok_or("G43: H, the tool's number, is missing")?),
            None if self.length_is_on => numbers.take('H'),
            None => None,
        };
        let Some(number) = number else { return Ok(()) };
        let length_mm = if number == 0.0 { 0.0 } else { self.setup.length_mm(number)? };
        self.length_of = (number != 0.0).then_some(Called { number, line: self.line });
        if length_mm != self.length_mm {
            self.length_mm = length_mm;
            (self.tip_mm[2], self.last) = (None, None);
        }
        Ok(())
    }

    /// Words that act on this line alone.
    fn take_other(
        &mut self,
        other: u16,
        line: &Line<'_>,
        numbers: &mut Numbers,
        loaded: bool,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        let here = |name: &str| {
            let message = format!(
                "{name} right after a cut: the compensated tool stands some micrometres elsewhere, and so would all that \
                 follows; move it with G0 first"
            );
            if loaded { Err(message) } else { Ok(()) }
        };
        let lengths =
            |numbers: &mut Numbers, unit: f64| numbers.take_three(['X', 'Y', 'Z']).map(|v| v.map(|v| v * unit));
        match other {
            40 => dwell(line, numbers)?,
            100 if self.incremental => {
                return Err("G10 in G91: controls differ in what this does; write it in G90".into());
            }
            100 => {
                let (l, p) = (numbers.take('L'), numbers.take('P'));
                if l == Some(20.0) {
                    here("G10 L20")?;
                }
                let given = lengths(numbers, self.unit_mm);
                // a frame that is not turned
                for letter in "ABCR".chars() {
                    if numbers.take(letter).is_some_and(|v| v != 0.0) {
                        return Err(format!("G10: {letter} other than 0 is not supported: work frames are not turned"));
                    }
                }
                self.offsets.g10(l, p, given, self.tip_mm)?;
            }
            280 | 300 => return self.take_reference(other == 300, numbers, stops),
            520 => {
                let given = lengths(numbers, self.unit_mm);
                self.offsets.g52(given)?;
            }
            530 => return self.take_machine(line, numbers, stops),
            920 => {
                let given = lengths(numbers, self.unit_mm);
                if given == [None; 3] {
                    return Err(
                        "G92 without X Y Z; a limit of the spindle's speed (G92 S) is for lathes: remove it".into()
                    );
                }
                here("G92")?;
                self.offsets.g92(given, self.tip_mm)?;
            }
            _ => self.offsets.cancel_g92()?,
        }
        if self.offsets.total_mm().iter().any(|v| v.abs() > MAX_OFFSET) {
            return Err(format!("an offset beyond ±{MAX_OFFSET:e} mm"));
        }
        Ok(Effect::Nothing)
    }

    /// `G28`, `G30`: by way of the given point to the machine's reference, each named axis.
    fn take_reference(
        &mut self,
        second: bool,
        numbers: &mut Numbers,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        if second && numbers.take('P').is_some_and(|p| p != 2.0) {
            return Err("G30: only P2, the second reference point, is supported".into());
        }
        let rotary = self.rotary_letters();
        let all = !numbers.has_any(&format!("XYZ{rotary}"));
        let mut named = [all; 5];
        for (named, letter) in named.iter_mut().zip(format!("XYZ{rotary}").chars()) {
            *named |= numbers.has_any(&letter.to_string());
        }
        let reference = self.setup.offsets.references[usize::from(second)].filter(|_| self.length_mm == 0.0);
        let way = self.target(numbers, self.offsets.total_mm(), self.incremental, false)?;
        let mut there = Target { ..way };
        for i in 0..5 {
            if named[i] && i < 3 {
                there.tip_mm[i] = reference.map(|r| r[i]);
            } else if named[i] {
                there.turn_deg[i - 3] = reference.filter(|_| self.setup.head.is_none()).map(|r| r[i]);
            }
        }
        let known = self.last.is_some();
        let places = [self.place(&way), self.place(&there)];
        self.reach(there);
        let (way, there) = match places {
            [Ok(way), Ok(there)] => (way, there),
            _ if reference.is_none() => {
                let name = if second { "G30" } else { "G28" };
                return Ok(Effect::Unchecked(format!(
                    "{name} goes to a place that is not known here, since the job gives no `{name} = [x, y, z, a, b]` under \
                     [offsets] or a tool length is in force"
                )));
            }
            [Err(why), _] | [_, Err(why)] => return Ok(Effect::Unchecked(why)),
        };
        stops.extend([way, there].map(|place| Stop { place, rapid: true, continues: false }));
        self.last = Some(there);
        Ok(Effect::Moves { form: Form::Reference { named }, fresh: !known })
    }

    /// `G53`: coordinates of the machine.
    fn take_machine(
        &mut self,
        line: &Line<'_>,
        numbers: &mut Numbers,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        let rapid = match self.motion {
            Some(Motion::Rapid) => true,
            Some(Motion::Cut) => false,
            _ => return Err("G53 needs G0 or G1".into()),
        };
        if self.incremental {
            return Err("G53 in G91: its coordinates are absolute; write it in G90".into());
        }
        if self.length_mm == 0.0 {
            let target = self.target(numbers, [0.0; 3], false, true)?;
            return self.straight(target, rapid, line, stops);
        }
        let message =
            "G53 with a tool length in force: whether it moves the tip or the flange differs from control to control";
        if !rapid {
            return Err(format!("{message}; cancel it with G49 before this line"));
        }
        for (i, letter) in "XYZ".chars().enumerate() {
            if numbers.take(letter).is_some() {
                self.tip_mm[i] = None;
            }
        }
        let target = self.target(numbers, [0.0; 3], false, true)?;
        self.reach(target);
        Ok(Effect::Unchecked(message.to_owned()))
    }

    /// Takes the words of a target. I J K are the tool's axis where they are not an arc's centre.
    pub fn target(
        &self,
        numbers: &mut Numbers,
        origin_mm: [f64; 3],
        incremental: bool,
        has_axis: bool,
    ) -> Result<Target, Refusal> {
        let given = numbers.take_three(['X', 'Y', 'Z']);
        let tip_mm = std::array::from_fn(|i| match given[i] {
            None => self.tip_mm[i],
            Some(v) if incremental => self.tip_mm[i].map(|at| at + v * self.unit_mm),
            Some(v) => Some(v * self.unit_mm + origin_mm[i]),
        });
        let mut axis = self.axis;
        if has_axis && self.setup.head.is_none() {
            let given = numbers.take_three(['I', 'J', 'K']);
            axis = std::array::from_fn(|i| given[i].or(axis[i]));
        }
        let mut turn_deg = self.turn_deg;
        for (turn, letter) in turn_deg.iter_mut().zip(self.rotary_letters().chars()) {
            *turn = match numbers.take(letter) {
                None => *turn,
                Some(v) if incremental => turn.map(|at| at + v),
                Some(v) => Some(v),
            };
        }
        if let Some(beyond) = tip_mm.iter().chain(&turn_deg).flatten().find(|v| v.abs() > MAX_COORDINATE) {
            return Err(format!("a coordinate of {beyond:e}: expected mm and degrees within ±{MAX_COORDINATE:e}"));
        }
        Ok(Target { tip_mm, axis, turn_deg })
    }

    /// The tool is where a target says.
    pub fn reach(&mut self, target: Target) {
        (self.tip_mm, self.axis, self.turn_deg, self.last) = (target.tip_mm, target.axis, target.turn_deg, None);
    }

    /// Where the tool is to be, or why that is not known.
    pub fn place(&self, target: &Target) -> Result<Place, Refusal> {
        if target.axis.iter().any(Option::is_some) && target.turn_deg.iter().any(Option::is_some) {
            return Err("I J K and A B in one program: give the tool's direction in one of these ways".into());
        }
        let [Some(x), Some(y), Some(z)] = target.tip_mm else {
            let message = "the first move has to give all of X Y Z: where the tool comes from is not known at the beginning, \
                           after G43 or G49 with another length, and after G28 and G53 that are passed on";
            return Err(message.into());
        };
        let toward = match (self.setup.head, target.axis, target.turn_deg) {
            (Some(head), _, turn) if head.letters().is_empty() => Toward::Head(head, turn.map(|_| 0.0)),
            (Some(head), _, [Some(a), Some(b)]) => Toward::Head(head, [a, b].map(f64::to_radians)),
            (Some(head), ..) => {
                return Err(format!("the first move has to say where the tool points: both of {}", head.letters()));
            }
            (None, [Some(i), Some(j), Some(k)], _) if [i, j, k] == [0.0; 3] => {
                return Err("I J K are all 0 and give the tool no direction".into());
            }
            (None, [Some(i), Some(j), Some(k)], _) => Toward::Axis([i, j, k]),
            (None, _, [Some(a), Some(b)]) => Toward::Wrist([a.to_radians(), b.to_radians()]),
            _ => {
                let or_job = if self.setup.is_only_played { "" } else { ", or a --job with `tool_axis = [0, 0, 1]`" };
                return Err(format!(
                    "the first move has to say where the tool points: all of I J K (its axis in B, such as I0 J0 K1), or A and B \
                     (the wrist's joints in degrees){or_job}"
                ));
            }
        };
        Ok(Place { tip_m: [x, y, z].map(|v| v / 1e3), toward })
    }
}

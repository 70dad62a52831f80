//! The moves of a line: straight, arcs, cycles.

use super::Refusal;
use super::arcs::{Arc, ArcWords, Plane};
use super::cycles::{Drill, Hole};
use super::modal::{Effect, Form, Modal, Motion, Stop, Target};
use super::words::{Line, Numbers};
use crate::path::{FeedMode, Place, Toward};

/// Most moves of a line with a cycle.
const MAX_CYCLE_MOVES: f64 = 1e6;

/// F of a cut that only turns the tool.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct TurnFeed {
    pub deg_per_min: f64,
    /// `G94` or `G95`, and F as it stands there.
    pub mode: &'static str,
    pub word: f64,
}

/// G4.
pub(super) fn dwell(line: &Line<'_>, numbers: &mut Numbers) -> Result<(), Refusal> {
    let seconds = numbers.take('P');
    if seconds.is_some_and(|p| p < 0.0) {
        return Err("G4: a dwell is not below 0".into());
    }
    if seconds.is_none()
        && numbers.take('X').is_none()
        && numbers.take('U').is_none()
        && (line.has('F') || line.has('S'))
    {
        return Err("G4 with F or S alone is a dwell in Siemens' own mode, and a feed or a speed elsewhere: write G4 P (or X), and F \
                    and S in another line"
            .into());
    }
    if numbers.has_any("XYZIJKABC") {
        return Err("G4 with a move in one line".into());
    }
    Ok(())
}

impl Modal<'_> {
    /// F in force for a cut that only turns the tool: ° a minute, or in G95 ° a turn of the spindle.
    pub fn turn_feed(&self) -> Option<TurnFeed> {
        match self.feed_mode {
            FeedMode::OfAMinute => self.feed_per_min.map(|[_, word]| TurnFeed { deg_per_min: word, mode: "G94", word }),
            FeedMode::OfATurn => {
                let ([_, word], [_, deg_per_min]) = self.feed_per_turn.zip(self.feed_a_minute())?;
                Some(TurnFeed { deg_per_min, mode: "G95", word })
            }
            FeedMode::InverseTime => None,
        }
    }

    /// Refuses a loaded cut that only turns the tool in G95 without S: it is written with its time, which nobody knows then.
    pub fn check_turn(&self) -> Result<(), Refusal> {
        let lacks_speed = self.feed_per_turn.is_some() && self.spindle_per_min.is_none();
        if self.feed_mode == FeedMode::OfATurn && lacks_speed && !self.setup.is_only_played {
            return Err("a loaded cut that only turns the tool in G95 (° a turn of the spindle), whose time is not known without a \
                        speed: give S before it, or F in G94 (°/min)"
                .into());
        }
        Ok(())
    }

    /// Words that move the tool as G0 to G3 or a cycle.
    pub fn take_motion(
        &mut self,
        named: bool,
        line: &Line<'_>,
        numbers: &mut Numbers,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        let rotary = self.rotary_letters();
        let to_axis = numbers.has_any(&format!("XYZ{rotary}"));
        let origin_mm = self.offsets.total_mm();
        match self.motion {
            Some(motion @ (Motion::Rapid | Motion::Cut)) => {
                if !to_axis && !numbers.has_any("IJK") {
                    return Ok(Effect::Nothing);
                }
                let target = self.target(numbers, origin_mm, self.incremental, true)?;
                self.straight(target, motion == Motion::Rapid, line, stops)
            }
            Some(Motion::Arc { clockwise }) => self.arc(clockwise, line, numbers, stops),
            Some(Motion::Drill(drill)) if named || to_axis => self.drilled(drill, numbers, stops),
            Some(Motion::Drill(_)) => Ok(Effect::Nothing),
            None if to_axis || numbers.has_any("IJK") => {
                Err("a move before any G0 or G1, or after G80, which ends what was in force".into())
            }
            None => Ok(Effect::Nothing),
        }
    }

    /// A straight move, or one to be passed on unchecked.
    pub fn straight(
        &mut self,
        target: Target,
        rapid: bool,
        line: &Line<'_>,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        let place = self.place(&target);
        let before = self.last;
        if !rapid {
            self.check_feed(line.has('F'))?;
        }
        self.reach(target);
        match place {
            Ok(place) => {
                stops.push(Stop { place, rapid, continues: false });
                self.last = Some(place);
                Ok(Effect::Moves { form: Form::Straight, fresh: before.is_none() })
            }
            Err(why) if rapid && self.is_incomplete() => Ok(Effect::Unchecked(why)),
            Err(why) => Err(why),
        }
    }

    /// Whether a coordinate or the direction is still to be given.
    fn is_incomplete(&self) -> bool {
        let [axis_begun, turn_begun] =
            [self.axis.iter().any(Option::is_some), self.turn_deg.iter().any(Option::is_some)];
        let [has_axis, has_turn] = [self.axis.iter().all(Option::is_some), self.turn_deg.iter().all(Option::is_some)];
        let has_direction = match self.setup.head {
            Some(head) => has_turn || head.letters().is_empty(),
            None => has_axis || has_turn,
        };
        !(axis_begun && turn_begun) && (!has_direction || self.tip_mm.iter().any(Option::is_none))
    }

    fn check_feed(&self, has_feed: bool) -> Result<(), Refusal> {
        if self.feed_mode == FeedMode::InverseTime && !has_feed {
            return Err("G93: F is missing: every cut needs its own".into());
        }
        Ok(())
    }

    /// Where a move begins that cannot do without.
    fn start(&self, what: &str) -> Result<Place, Refusal> {
        self.last.ok_or_else(|| {
            format!("{what} from a place that is not known: begin with G0 and X Y Z, and where the tool points")
        })
    }

    fn arc(
        &mut self,
        clockwise: bool,
        line: &Line<'_>,
        numbers: &mut Numbers,
        stops: &mut Vec<Stop>,
    ) -> Result<Effect, Refusal> {
        let unit = self.unit_mm;
        let mut center_mm = numbers.take_three(['I', 'J', 'K']).map(|v| v.map(|v| v * unit));
        let radius_mm = numbers.take('R').map(|v| v * unit);
        if center_mm == [None; 3] && radius_mm.is_none() && !numbers.has_any("XYZABC") {
            return Ok(Effect::Nothing);
        }
        let start = self.start("an arc")?;
        self.check_feed(line.has('F'))?;
        let origin_mm = self.offsets.total_mm();
        if self.center_is_absolute {
            center_mm = std::array::from_fn(|i| center_mm[i].map(|v| v + origin_mm[i]));
        }
        let target = self.target(numbers, origin_mm, self.incremental, false)?;
        let end = self.place(&target)?;
        let words = ArcWords {
            clockwise,
            plane: self.plane,
            center_mm,
            center_is_absolute: self.center_is_absolute,
            radius_mm,
            turns: numbers.take('P'),
        };
        let [start_mm, end_mm] = [start.tip_m.map(|m| m * 1e3), target.tip_mm.map(Option::unwrap_or_default)];
        let arc = Arc::new(&words, start_mm, end_mm)?;
        let chords = arc.chords(self.setup.chord_mm)?;
        for n in 1..chords {
            let share = f64::from(n) / f64::from(chords);
            let tip_m = arc.point_mm(share, start_mm, end_mm).map(|mm| mm / 1e3);
            let place = Place { tip_m, ..start.between(&end, share) };
            stops.push(Stop { place, rapid: false, continues: n > 1 });
        }
        stops.push(Stop { place: end, rapid: false, continues: chords > 1 });
        self.reach(target);
        self.last = Some(end);
        Ok(Effect::Moves { form: Form::Arc, fresh: false })
    }

    fn drilled(&mut self, drill: Drill, numbers: &mut Numbers, stops: &mut Vec<Stop>) -> Result<Effect, Refusal> {
        let start = self.start("a cycle")?;
        if self.feed_mode == FeedMode::InverseTime {
            return Err(format!("{drill:?} in G93: a cycle's feed is a minute's (G94)"));
        }
        let Plane([a, b, along]) = self.plane;
        let unit = self.unit_mm;
        let words = &mut self.drill;
        let axis = ['X', 'Y', 'Z'][along];
        let levels = [numbers.take('R'), numbers.take(axis)].map(|v| v.map(|v| v * unit));
        let levels = words.levels_mm(levels, self.incremental, axis);
        let [r, z] = levels.map_err(|why| format!("{drill:?}: {why}"))?;
        words.q_mm = numbers.take('Q').map(|v| v * unit).or(words.q_mm);
        words.p = numbers.take('P').or(words.p);
        let words = *words;
        let repeats = numbers.take('L').or_else(|| numbers.take('K')).unwrap_or(1.0);
        if !(repeats.fract() == 0.0 && (0.0..=1e4).contains(&repeats)) {
            return Err(format!("{drill:?}: expected a whole number of repeats, found {repeats}"));
        }
        if repeats == 0.0 {
            return Err(format!(
                "{drill:?} with no repeats (L0, K0): controls differ in whether the tool goes there; leave the line out, or write G0"
            ));
        }
        let origin_mm = self.offsets.total_mm();
        let mut at_mm = start.tip_m.map(|m| m * 1e3);
        let initial_mm = *self.initial_mm.get_or_insert(at_mm[along]);
        let r_mm = r + if self.incremental { initial_mm } else { origin_mm[along] };
        let bottom_mm = z + if self.incremental { r_mm } else { origin_mm[along] };
        if words.p.is_some_and(|p| p < 0.0) {
            return Err(format!("{drill:?}: P, the dwell, is below 0"));
        }
        let hole =
            Hole::new(drill, &words, [r_mm, bottom_mm], (self.retracts_to_r != Some(true)).then_some(initial_mm))?;
        self.assumes_g98 |= self.retracts_to_r.is_none() && hole.clear_mm != hole.r_mm;
        if self.plane == Plane::XY && self.setup.axes.z_goes_out() && bottom_mm > r_mm {
            return Err(format!("{drill:?}: R lies deeper in the workpiece than the hole's bottom Z"));
        }
        let given = [a, b].map(|i| ['X', 'Y', 'Z'][i]).map(|letter| numbers.take(letter).map(|v| v * unit));
        let target = self.target(numbers, origin_mm, self.incremental, false)?;
        let toward = self.place(&target)?.toward;
        let mut go = |at_mm: [f64; 3], toward: Toward, rapid: bool| {
            let place = Place { tip_m: at_mm.map(|v| v / 1e3), toward };
            stops.push(Stop { place, rapid, continues: false });
        };
        if hole.is_below_r(at_mm[along]) {
            at_mm[along] = r_mm;
            go(at_mm, start.toward, true);
        }
        let heights = hole.heights(drill);
        if repeats * heights.len() as f64 > MAX_CYCLE_MOVES {
            return Err(format!("{drill:?}: more than {MAX_CYCLE_MOVES} moves in one line"));
        }
        let mut before = start.toward;
        for _ in 0..repeats as u32 {
            let from_mm = at_mm;
            for (i, given) in [a, b].into_iter().zip(given) {
                if let Some(given) = given {
                    at_mm[i] = given + if self.incremental { at_mm[i] } else { origin_mm[i] };
                }
            }
            if at_mm != from_mm || toward != before {
                go(at_mm, toward, true);
            }
            if at_mm[along] != r_mm {
                at_mm[along] = r_mm;
                go(at_mm, toward, true);
            }
            for &(height_mm, rapid) in &heights {
                at_mm[along] = height_mm;
                go(at_mm, toward, rapid);
            }
            before = toward;
        }
        self.reach(Target { tip_mm: at_mm.map(Some), ..target });
        self.last = Some(Place { tip_m: at_mm.map(|v| v / 1e3), toward: before });
        let dwell = words.p.filter(|_| drill == Drill::G82);
        Ok(Effect::Moves { form: Form::Drill { dwell }, fresh: false })
    }
}

//! G words: what they set, and why others are refused; why words of other letters are.

use super::Refusal;
use super::arcs::Plane;
use super::cycles::Drill;
use super::modal::{Modal, Motion};
use super::offsets::frame_of;
use super::words::{EXPONENT, Line, Word};
use crate::head::Head;
use crate::path::FeedMode;

/// What a line's G words ask for beyond what stays in force. Numbers are ten times those of the words.
#[derive(Default)]
pub(super) struct Codes {
    /// The motion that the line names.
    pub motion: Option<u16>,
    /// G4, G10, G28, G30, G52, G53, G92, G92.1.
    pub other: Option<u16>,
    /// Tool length: on (G43, G43.4, G234) or off (G49).
    pub length: Option<bool>,
}

/// Why taps and threads are refused.
pub(super) const COUPLED: &str =
    "the feed is coupled to the spindle, and moves that are divided would lose that: leave it to another program";

/// Why M67 and M68 are.
pub(super) const LOADS_GIVEN_TWICE: &str = "it gives LinuxCNC's component the load, which would be compensated twice";

/// What changes no coordinate: cancelled modes, path control, dwell and speed.
const PASSED: [u16; 13] = [50, 51, 80, 150, 400, 500, 610, 611, 640, 670, 690, 970, 1870];

/// Words of which a line has one: what the others say would depend on the control.
const GROUPS: [&[u16]; 10] = [
    &[170, 180, 190],
    &[200, 210],
    &[430, 434, 490, 2340],
    &[540, 550, 560, 570, 580, 590, 591, 592, 593],
    &[610, 611, 640],
    &[730, 800, 810, 820, 830],
    &[900, 910],
    &[901, 911],
    &[930, 940, 950],
    &[980, 990],
];

/// M words of which a line has those of one side: coolant on or off, a stop that is made or that a switch makes.
const SIDES: [[&[f64]; 2]; 2] = [[&[7.0, 8.0], &[9.0]], [&[0.0], &[1.0]]];

/// A second word of a group, and the first.
fn contradiction<'a>(line: &'a Line<'_>) -> Option<[&'a Word<'a>; 2]> {
    let group = |word: &Word<'_>| GROUPS.iter().position(|group| word.tenths().is_some_and(|t| group.contains(&t)));
    let is_spindle = |word: &&Word<'_>| word.is('M', &[3.0, 4.0, 5.0]);
    let mut spindle = line.words.iter().filter(is_spindle);
    if let (Some(first), Some(second)) = (spindle.next(), spindle.next()) {
        return Some([second, first]);
    }
    for sides in SIDES {
        let [one, other] = sides.map(|numbers| line.words.iter().position(|w| w.is('M', numbers)));
        if let (Some(one), Some(other)) = (one, other) {
            return Some([&line.words[one.max(other)], &line.words[one.min(other)]]);
        }
    }
    let mut seen: [Option<&Word<'_>>; GROUPS.len()] = [None; GROUPS.len()];
    for word in line.words.iter().filter(|w| w.letter == 'G') {
        if let Some(first) = group(word).and_then(|group| seen[group].replace(word)) {
            return Some([word, first]);
        }
    }
    None
}

impl Codes {
    /// Takes the G words of a line; what they set is in force at once.
    pub fn take(line: &Line<'_>, modal: &mut Modal<'_>) -> Result<Self, Refusal> {
        if let Some([second, first]) = contradiction(line) {
            return Err(format!(
                "`{}` and `{}` in one line: which is in force is not clear",
                first.shown(),
                second.shown()
            ));
        }
        let mut codes = Self::default();
        let mut cancels = false;
        let (plane, motion) = (modal.plane, modal.motion);
        for word in line.words.iter().filter(|w| w.letter == 'G') {
            let refused = |why: &str| Err(format!("`{}`: {why}", word.shown()));
            let Some(tenths) = word.tenths() else { return refused(advice(word.value)) };
            match tenths {
                0 | 10 | 20 | 30 | 730 | 810 | 820 | 830 => {
                    if codes.motion.replace(tenths).is_some() {
                        return refused("a second motion in the line");
                    }
                }
                800 => cancels = true,
                170 => modal.plane = Plane::XY,
                180 => modal.plane = Plane::ZX,
                190 => modal.plane = Plane::YZ,
                200 => modal.unit_mm = 25.4,
                210 => modal.unit_mm = 1.0,
                900 => modal.incremental = false,
                910 => modal.incremental = true,
                901 => modal.center_is_absolute = true,
                911 => modal.center_is_absolute = false,
                980 => modal.retracts_to_r = Some(false),
                990 => modal.retracts_to_r = Some(true),
                430 | 434 | 2340 => codes.length = Some(true),
                490 => codes.length = Some(false),
                930 => modal.set_feed_mode(FeedMode::InverseTime),
                940 => modal.set_feed_mode(FeedMode::OfAMinute),
                950 => modal.set_feed_mode(FeedMode::OfATurn),
                40 | 100 | 280 | 300 | 520 | 530 | 920 | 921 => {
                    if codes.other.replace(tenths).is_some() {
                        return refused("a second word in the line that takes its coordinates");
                    }
                }
                50 if !line.has('P') => return refused(advice(word.value)),
                50 | 51 if line.has('X') || line.has('Y') || line.has('I') || line.has('J') => {
                    return refused("splines are not supported: write short moves (G1)");
                }
                _ => match frame_of(tenths) {
                    Some(frame) => {
                        modal.offsets.select(frame, modal.setup).map_err(|why| format!("`{}`: {why}", word.shown()))?
                    }
                    None if PASSED.contains(&tenths) => {}
                    None => return refused(advice(word.value)),
                },
            }
        }
        match codes.motion {
            Some(motion) => modal.set_motion(motion_of(motion)),
            None if cancels => modal.set_motion(None),
            None => {}
        }
        let drills = |motion| matches!(motion, Some(Motion::Drill(_)));
        if plane != modal.plane && drills(motion) && drills(modal.motion) {
            return Err("another plane between the holes of a cycle: end the cycle with G80 first".into());
        }
        Ok(codes)
    }
}

fn motion_of(tenths: u16) -> Option<Motion> {
    match tenths {
        0 => Some(Motion::Rapid),
        10 => Some(Motion::Cut),
        20 => Some(Motion::Arc { clockwise: true }),
        30 => Some(Motion::Arc { clockwise: false }),
        _ => Drill::of(tenths).map(Motion::Drill),
    }
}

/// Why a G word is not supported, and what to do.
fn advice(g: f64) -> &'static str {
    match g {
        5.0..=6.9 => "splines are not supported: let the CAM system write short straight lines (G1)",
        7.0 => "diameters are not supported: write radii (G8)",
        12.1 | 13.1 => "polar interpolation is not supported: let the CAM system write X Y Z and the rotary axes (G1)",
        12.0..=13.9 => "circular pockets are not supported: let the CAM system write the moves (G1, G2, G3)",
        60.0 | 641.0..=645.9 => "Siemens' path control: write G64, or G61 for an exact stop",
        70.0 | 71.0 | 700.0 | 710.0 => "units are G20 (inch) and G21 (mm)",
        16.0 => "polar coordinates are not supported: write X and Y",
        31.0 | 38.0..=38.9 => "where a probe stops is not known before: run this part of the program by itself",
        76.0..=76.9 => {
            "fine boring on mills of the Fanuc family, and threading elsewhere: neither is supported; bore with G81 or G82, or leave it to \
             another program"
        }
        33.0..=33.9 | 74.0 | 84.0 => COUPLED,
        41.0..=42.9 => {
            "compensation of the tool's radius is not supported, since moves are divided: let the CAM system write the path of the tool's centre (G40), or have \
             LinuxCNC's interpreter compute it (--interpreter rs274)"
        }
        43.0..=44.9 => "of tool lengths G43 H, G43.4 H and G49 are supported",
        50.1 | 51.0 | 51.1 => "scaling and mirroring are not supported: write the moves out",
        54.0..=54.9 | 110.0..=129.9 | 154.0 | 500.0..=599.9 => "of work frames G54 to G59.3 are supported",
        65.0..=66.9 => "macros are not supported: write the moves out, or call subprograms with M98",
        68.0..=68.9 | 53.0..=53.9 | 254.0 => {
            "turned work frames are not supported: let the CAM system write the coordinates"
        }
        73.0..=89.9 => {
            "of cycles G73, G81, G82 and G83 are supported: let the CAM system write the moves of others (G0, G1), or LinuxCNC's \
             interpreter (--interpreter rs274)"
        }
        92.0..=92.9 => "of these G92 and G92.1 are supported",
        96.0 => "a constant surface speed is for lathes: write the speed a minute (G97)",
        _ => {
            "not supported; known are G0 G1 G2 G3 G4 G10 G17-G21 G28 G30 G40 G43 G43.4 G49 G52 G53 G54-G59.3 G61 G64 G73 G80-G83 \
             G90-G95 G98 G99"
        }
    }
}

impl Modal<'_> {
    /// Why nothing uses a word with such a letter.
    pub(super) fn why_not(&self, letter: char) -> String {
        match (letter, self.setup.head) {
            ('A' | 'B' | 'C' | 'I' | 'J' | 'K', Some(Head::Fixed(_))) if self.gives_direction(letter) => {
                "the job says the tool's direction for all of the program with `tool_axis`: remove it there, or A B C and I J K \
                 here"
                .into()
            }
            ('A' | 'B' | 'C', Some(head)) => {
                format!("this program's rotary axes are {:?}, as the job's `head` says", head.letters())
            }
            ('I' | 'J' | 'K', Some(head)) if self.gives_direction(letter) => format!(
                "the tool's direction is given by {:?}, as the job's `head` says: remove it there, or I J K here",
                head.letters()
            ),
            ('C', None) => {
                let todo = "for a head of A and C or B and C give a --job with `head = \"AC\"` or \"BC\"";
                format!("the wrist has A and B: {}", self.setup.todo(todo))
            }
            ('E', _) => format!("no axis is E, and {EXPONENT}"),
            ('D', _) => "D is a tool's radius (Fanuc) or its edge (Siemens), and neither is read: remove it".to_owned(),
            ('H', _) => "H is for G43".to_owned(),
            ('U' | 'V' | 'W', _) => "the machine has no such axis".to_owned(),
            _ => "known are G M, X Y Z, I J K, A B, F S T, N first, H with G43, R P Q L where a cycle, an arc or a dwell \
                  takes them"
                .to_owned(),
        }
    }

    /// Whether a letter that nothing uses was meant for the tool's direction: I J K are that on straight moves alone.
    fn gives_direction(&self, letter: char) -> bool {
        "ABC".contains(letter) || matches!(self.motion, Some(Motion::Rapid | Motion::Cut))
    }
}

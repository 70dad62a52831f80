//! What a path of the tool is made of.

use pkm_core::Wrench;

use crate::cutting::Cut;
use crate::head::Head;

/// A way of the tip shorter than this is none, m.
pub(crate) const NO_WAY_M: f64 = 1e-9;

/// A straight move.
#[derive(Clone, Copy, Debug)]
pub struct Move {
    /// Line in the file, from 1.
    pub line: u64,
    /// Where it ends; it begins where the one before ended.
    pub to: Place,
    /// On the tool.
    pub load: Load,
    /// By how much the tool is longer than the flange of the machine file says, m.
    pub longer_m: f64,
    /// Where it begins is not known: only its end counts.
    pub is_fresh: bool,
    /// It goes on along the arc that the move before is a part of.
    pub continues: bool,
    /// A rapid move of a program.
    pub is_rapid: bool,
    /// Feed of a cut: mm/min where the tip moves, °/min where only the tool turns; `None` where no F of G94 says it, nor one of G95 with S.
    pub feed_per_min: Option<[f64; 2]>,
    /// What the program's F is in force as.
    pub feed_mode: FeedMode,
}

/// What F of a program counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FeedMode {
    /// `G94`: mm or ° a minute.
    OfAMinute,
    /// `G93`: 1 over the minutes of a move.
    InverseTime,
    /// `G95`: mm a turn of the spindle.
    OfATurn,
}

/// What loads the tool on a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// At its tip in the axes of T_h, at the beginning and at the end; linear between.
    Given([Wrench<f64>; 2]),
    /// To be estimated.
    Cut(Cut),
}

impl Load {
    /// Nothing.
    pub const NONE: Self = Self::Given([Wrench::ZERO; 2]);

    /// A given load at a share of the move.
    pub fn given(&self, share: f64) -> Option<Wrench<f64>> {
        match self {
            Self::Given(wrenches) => Some(part_of(wrenches, share)),
            Self::Cut(_) => None,
        }
    }
}

/// A share of the way from one wrench to another.
pub fn part_of([a, b]: &[Wrench<f64>; 2], share: f64) -> Wrench<f64> {
    let (a, b) = (a.to_vector(), b.to_vector());
    Wrench::from_vector(a + (b - a) * share)
}

impl Move {
    /// Whether a load acts somewhere on it.
    pub fn is_loaded(&self) -> bool {
        self.load != Load::NONE
    }
}

/// Where a path asks the tool to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// The tip in B, m.
    pub tip_m: [f64; 3],
    /// What says where its axis points.
    pub toward: Toward,
}

/// What says where a tool points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Toward {
    /// Its axis in B, of any length above 0.
    Axis([f64; 3]),
    /// β1 and β2 of the wrist, rad.
    Wrist([f64; 2]),
    /// Angles of a head that a program speaks of, rad.
    Head(Head, [f64; 2]),
}

impl Toward {
    /// The tool's axis, where that is what is given.
    pub fn axis(&self) -> Option<[f64; 3]> {
        match *self {
            Self::Axis(axis) => Some(axis),
            Self::Head(head, angles) => Some(head.axis(angles)),
            Self::Wrist(_) => None,
        }
    }
}

impl Place {
    /// The place on the straight way to another, given in the same manner: the tip goes straight, the axis turns evenly in the
    /// plane of both, the wrist's joints turn evenly.
    pub fn between(&self, to: &Self, share: f64) -> Self {
        let part = |a: f64, b: f64| a + share * (b - a);
        let toward = match (self.toward, to.toward) {
            (Toward::Axis(a), Toward::Axis(b)) => Toward::Axis(turned(a, b, share)),
            (Toward::Wrist(a), Toward::Wrist(b)) => Toward::Wrist([part(a[0], b[0]), part(a[1], b[1])]),
            (Toward::Head(head, a), Toward::Head(_, b)) => Toward::Head(head, [part(a[0], b[0]), part(a[1], b[1])]),
            (_, toward) => toward,
        };
        Self { tip_m: std::array::from_fn(|i| part(self.tip_m[i], to.tip_m[i])), toward }
    }

    /// How far another is: of the tip in m, and of the axis or the joint that turns furthest in rad.
    pub fn apart(&self, to: &Self) -> [f64; 2] {
        let way = (0..3).map(|i| (to.tip_m[i] - self.tip_m[i]).powi(2)).sum::<f64>().sqrt();
        let turn = match (self.toward, to.toward) {
            (Toward::Axis(a), Toward::Axis(b)) => angle(a, b),
            (Toward::Wrist(a), Toward::Wrist(b)) | (Toward::Head(_, a), Toward::Head(_, b)) => {
                (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
            }
            _ => 0.0,
        };
        [way, turn]
    }

    /// How far the tool turns to another, as a control counts it where the tip stays: the root of the sum of both rotary axes' squares, rad.
    pub fn turned_rad(&self, to: &Self) -> f64 {
        match (self.toward, to.toward) {
            (Toward::Wrist(a), Toward::Wrist(b)) | (Toward::Head(_, a), Toward::Head(_, b)) => {
                (a[0] - b[0]).hypot(a[1] - b[1])
            }
            _ => self.apart(to)[1],
        }
    }

    /// The same in degrees, where the tool does no more than turn.
    pub fn turned_alone_deg(&self, to: &Self) -> Option<f64> {
        let turn_deg = self.turned_rad(to).to_degrees();
        (self.apart(to)[0] < NO_WAY_M && turn_deg > 0.0).then_some(turn_deg)
    }
}

/// A place as a file holds it. A program has mm to six decimals, axes to nine, degrees to eight; a CSV three more.
pub fn rounded(place: &Place, in_program: bool) -> Place {
    let finer = if in_program { 1.0 } else { 1e3 };
    let to = |v: f64, unit: f64| (v * unit * finer).round() / (unit * finer);
    let degrees = |v: f64| to(v.to_degrees(), 1e8).to_radians();
    let toward = match place.toward {
        Toward::Axis(axis) => Toward::Axis(axis.map(|v| to(v, 1e9))),
        Toward::Wrist(beta) => Toward::Wrist(beta.map(degrees)),
        Toward::Head(head, angles) => Toward::Head(head, angles.map(degrees)),
    };
    Place { tip_m: place.tip_m.map(|v| to(v * 1e3, 1e6) / 1e3), toward }
}

/// The same direction with length 1.
pub fn unit(v: [f64; 3]) -> [f64; 3] {
    let longest = v.iter().fold(0.0_f64, |longest, v| longest.max(v.abs()));
    let v = v.map(|v| v / longest);
    let size = v.iter().map(|v| v * v).sum::<f64>().sqrt();
    v.map(|v| v / size)
}

/// Angle between two axes, rad.
fn angle(a: [f64; 3], b: [f64; 3]) -> f64 {
    let [a, b] = [unit(a), unit(b)];
    let size = |sign: f64| (0..3).map(|i| (a[i] + sign * b[i]).powi(2)).sum::<f64>().sqrt();
    2.0 * size(-1.0).atan2(size(1.0))
}

/// A share of the turn from one axis to another, in the plane of both.
fn turned(from: [f64; 3], to: [f64; 3], share: f64) -> [f64; 3] {
    let angle = angle(from, to);
    let part = |share: f64| if angle.sin() > 1e-6 { (share * angle).sin() / angle.sin() } else { share };
    let [from, to] = [unit(from), unit(to)];
    std::array::from_fn(|i| part(1.0 - share) * from[i] + part(share) * to[i])
}

//! Arcs and helices as short straight moves.

use super::Refusal;
use super::modal::Axes;

/// By how much the radii at both ends of an arc may differ, mm.
const RADII_AGREE_MM: f64 = 0.05;
/// The least and the greatest by which an arc with R may miss its ends, as they are rounded, mm; between them a share of R.
const MISSES_MM: [f64; 2] = [0.003, RADII_AGREE_MM];
const MISSED_SHARE: f64 = 0.01;
/// An arc of less than this is a full circle, rad.
const FULL_CIRCLE_RAD: f64 = 1e-6;
/// Most straight moves of one arc.
const MAX_CHORDS: f64 = 1e6;
/// Most turns of one arc.
const MAX_TURNS: f64 = 1e4;

/// `G17`, `G18`, `G19`: the two axes of the plane, right-handed, and the third.
#[derive(Clone, Copy, PartialEq)]
pub(super) struct Plane(pub [usize; 3]);

impl Plane {
    pub const XY: Self = Self([0, 1, 2]);
    pub const ZX: Self = Self([2, 0, 1]);
    pub const YZ: Self = Self([1, 2, 0]);
}

/// What an arc's line says; lengths in mm.
pub(super) struct ArcWords {
    pub clockwise: bool,
    pub plane: Plane,
    /// I J K: from the start to the centre, or in B where `center_is_absolute`.
    pub center_mm: Axes,
    pub center_is_absolute: bool,
    pub radius_mm: Option<f64>,
    /// P: how many times around.
    pub turns: Option<f64>,
}

/// An arc in its plane; the third axis goes evenly.
pub(super) struct Arc {
    plane: Plane,
    center_mm: [f64; 2],
    radii_mm: [f64; 2],
    begin_rad: f64,
    sweep_rad: f64,
}

impl Arc {
    /// The arc between two points, mm in B.
    pub fn new(words: &ArcWords, start_mm: [f64; 3], end_mm: [f64; 3]) -> Result<Self, Refusal> {
        let Plane([a, b, third]) = words.plane;
        let (start, end) = ([start_mm[a], start_mm[b]], [end_mm[a], end_mm[b]]);
        if words.center_mm[third].is_some() {
            let (letter, plane) = (["I", "J", "K"][third], ["G19", "G18", "G17"][third]);
            return Err(format!("{letter} is not in the arc's plane ({plane})"));
        }
        let center = match (words.radius_mm, [words.center_mm[a], words.center_mm[b]]) {
            (Some(_), [None, None]) => by_radius(words, start, end)?,
            (Some(_), _) => return Err("an arc with a radius R and a centre: give one of them".into()),
            (None, [None, None]) => return Err("an arc without centre (I J K) or radius (R)".into()),
            (None, [i, j]) if words.center_is_absolute => {
                let missing = "G90.1: both coordinates of the arc's centre have to be given";
                [i.ok_or(missing)?, j.ok_or(missing)?]
            }
            (None, [i, j]) => [start[0] + i.unwrap_or(0.0), start[1] + j.unwrap_or(0.0)],
        };
        let polar = |p: [f64; 2]| {
            let [x, y] = [p[0] - center[0], p[1] - center[1]];
            (x.hypot(y), y.atan2(x))
        };
        let ((r0, begin_rad), (r1, end_rad)) = (polar(start), polar(end));
        if !(r0.min(r1) > 1e-6 && (r0 - r1).abs() <= RADII_AGREE_MM) {
            return Err(format!(
                "the arc's radius is {r0:.4} mm at its start and {r1:.4} mm at its end: both have to agree to \
                 {RADII_AGREE_MM} mm; is the centre given as this control takes it (G90.1, G91.1)?"
            ));
        }
        let turns = words.turns.unwrap_or(1.0);
        if !(turns.fract() == 0.0 && (1.0..=MAX_TURNS).contains(&turns)) {
            return Err(format!("P{turns}: expected a whole number of turns from 1 to {MAX_TURNS}"));
        }
        let full = std::f64::consts::TAU;
        let sign = if words.clockwise { -1.0 } else { 1.0 };
        let mut sweep = (sign * (end_rad - begin_rad)).rem_euclid(full);
        if sweep < FULL_CIRCLE_RAD {
            sweep += full;
        }
        let sweep_rad = sign * (sweep + full * (turns - 1.0));
        Ok(Self { plane: words.plane, center_mm: center, radii_mm: [r0, r1], begin_rad, sweep_rad })
    }

    /// Into how many straight moves the arc is divided, so that none is farther from it than this.
    pub fn chords(&self, error_mm: f64) -> Result<u32, Refusal> {
        let radius = self.radii_mm[0].max(self.radii_mm[1]);
        let step = 2.0 * (1.0 - error_mm / radius).max(0.5).acos();
        let chords = (self.sweep_rad.abs() / step).ceil().max(1.0);
        if !(chords <= MAX_CHORDS) {
            return Err(format!("{chords:.0} straight moves in one arc: give a greater --chord-mm"));
        }
        Ok(chords as u32)
    }

    /// The point after a share of the arc, below 1; the third coordinate goes from start to end.
    pub fn point_mm(&self, share: f64, start_mm: [f64; 3], end_mm: [f64; 3]) -> [f64; 3] {
        let Plane([a, b, third]) = self.plane;
        let radius = self.radii_mm[0] + share * (self.radii_mm[1] - self.radii_mm[0]);
        let (sin, cos) = (self.begin_rad + share * self.sweep_rad).sin_cos();
        let mut point = [0.0; 3];
        point[a] = self.center_mm[0] + radius * cos;
        point[b] = self.center_mm[1] + radius * sin;
        point[third] = start_mm[third] + share * (end_mm[third] - start_mm[third]);
        point
    }
}

/// The centre of the arc with a radius: of no more than half a circle if it is positive, else of more.
fn by_radius(words: &ArcWords, start: [f64; 2], end: [f64; 2]) -> Result<[f64; 2], Refusal> {
    let radius = words.radius_mm.unwrap_or_default();
    if radius.abs() < 1e-6 {
        return Err("an arc with R0: give its radius".into());
    }
    let chord = [end[0] - start[0], end[1] - start[1]];
    let half = 0.5 * chord[0].hypot(chord[1]);
    if half < 1e-6 {
        return Err("an arc with R that ends where it begins: give the centre with I J K".into());
    }
    // half a circle may miss by what both ends are rounded
    let [least, most] = MISSES_MM;
    if half > radius.abs() + (MISSED_SHARE * radius.abs()).clamp(least, most) {
        return Err(format!(
            "the arc's ends are {:.4} mm apart, and its radius is only {:.4} mm",
            2.0 * half,
            radius.abs()
        ));
    }
    let height = (radius * radius - half * half).max(0.0).sqrt();
    // the centre lies to the right of the chord in a clockwise arc of less than half a circle
    let side = if words.clockwise == (radius > 0.0) { -1.0 } else { 1.0 };
    let normal = [-chord[1] / (2.0 * half), chord[0] / (2.0 * half)];
    Ok(std::array::from_fn(|i| 0.5 * (start[i] + end[i]) + side * height * normal[i]))
}

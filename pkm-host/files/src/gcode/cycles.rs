//! Drilling cycles as the moves that they stand for, in the order of LinuxCNC's interpreter.

use super::Refusal;

/// How far above the last depth a drill goes back to feed, mm: LinuxCNC's 0.010 inch. On other controls a parameter says it.
pub(super) const PECK_CLEARANCE_MM: f64 = 0.254;
/// Most pecks in one hole.
const MAX_PECKS: f64 = 10_000.0;

/// Which cycle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Drill {
    /// Down and out.
    G81,
    /// With a dwell at the bottom.
    G82,
    /// With pecks, out to R after each.
    G83,
    /// With pecks, back a little after each.
    G73,
}

impl Drill {
    pub fn of(tenths: u16) -> Option<Self> {
        match tenths {
            730 => Some(Self::G73),
            810 => Some(Self::G81),
            820 => Some(Self::G82),
            830 => Some(Self::G83),
            _ => None,
        }
    }

    fn pecks(self) -> bool {
        matches!(self, Self::G83 | Self::G73)
    }
}

/// What stays in force from hole to hole, as it was written, lengths in mm.
#[derive(Clone, Copy, Default)]
pub(super) struct DrillWords {
    /// R and Z, or what else is along the drill, and whether they were given in G91.
    levels: [Option<(f64, bool)>; 2],
    pub q_mm: Option<f64>,
    pub p: Option<f64>,
}

impl DrillWords {
    /// R and Z, as a line gives them or as they stay in force. What stays from another mode, G90 or G91, is refused: controls differ.
    pub fn levels_mm(
        &mut self,
        given_mm: [Option<f64>; 2],
        incremental: bool,
        axis: char,
    ) -> Result<[f64; 2], Refusal> {
        for (level, given) in self.levels.iter_mut().zip(given_mm) {
            *level = given.map(|mm| (mm, incremental)).or(*level);
        }
        let [Some(r), Some(z)] = self.levels else { return Err(format!("expected R and {axis}, the depth")) };
        let [is, was] = if incremental { ["G91", "G90"] } else { ["G90", "G91"] };
        let carried = match [r, z].map(|(_, in_g91)| in_g91 != incremental) {
            [true, true] => format!("R and {axis} were"),
            [true, false] => "R was".to_owned(),
            [false, true] => format!("{axis} was"),
            [false, false] => return Ok([r.0, z.0]),
        };
        Err(format!(
            "{carried} given in {was}, and this line is in {is}: which heights are in force would depend on the control (Fanuc and Haas keep \
             them, LinuxCNC reads the numbers anew): write R and {axis} again in this line, or end the cycle with G80 first"
        ))
    }
}

/// A hole along the drilling axis, mm in B.
pub(super) struct Hole {
    pub r_mm: f64,
    pub bottom_mm: f64,
    /// Where the tool stands after it.
    pub clear_mm: f64,
    peck_mm: Option<f64>,
}

impl Hole {
    /// `from_mm` is where the tool stands before it; `initial_mm` where it stood before the cycle.
    pub fn new(
        drill: Drill,
        words: &DrillWords,
        [r_mm, bottom_mm]: [f64; 2],
        initial_mm: Option<f64>,
    ) -> Result<Self, Refusal> {
        let peck_mm = match words.q_mm.filter(|_| drill.pecks()) {
            None if drill.pecks() => return Err(format!("{drill:?}: Q, the depth of a peck, is missing")),
            Some(q) if !(q > 0.0) => return Err(format!("{drill:?}: expected Q, the depth of a peck, above 0")),
            Some(q) if !((r_mm - bottom_mm).abs() / q <= MAX_PECKS) => {
                return Err(format!("{drill:?}: more than {MAX_PECKS} pecks in one hole: is Q in the program's unit?"));
            }
            peck => peck,
        };
        if r_mm == bottom_mm {
            return Err(format!("{drill:?}: R and Z are the same height"));
        }
        // of B's frame, whose z points into the workpiece, as of one that points out of it
        let out = |a: f64, b: f64| if r_mm > bottom_mm { a.max(b) } else { a.min(b) };
        Ok(Self { r_mm, bottom_mm, clear_mm: initial_mm.map_or(r_mm, |z| out(z, r_mm)), peck_mm })
    }

    /// Whether a height is nearer to the bottom than R is.
    pub fn is_below_r(&self, z_mm: f64) -> bool {
        (z_mm - self.r_mm) * (self.bottom_mm - self.r_mm) > 0.0
    }

    /// Heights of the moves from R on, and whether they are rapid.
    pub fn heights(&self, drill: Drill) -> Vec<(f64, bool)> {
        let mut moves = Vec::new();
        if let Some(peck) = self.peck_mm {
            let down = (self.bottom_mm - self.r_mm).signum();
            let reached = |depth: f64| (self.bottom_mm - depth) * down > 0.0;
            let mut depth = self.r_mm + down * peck;
            while reached(depth) {
                moves.push((depth, false));
                if drill == Drill::G83 {
                    moves.push((self.r_mm, true));
                }
                moves.push((depth - down * PECK_CLEARANCE_MM, true));
                depth += down * peck;
            }
        }
        moves.push((self.bottom_mm, false));
        moves.push((self.clear_mm, true));
        moves
    }
}

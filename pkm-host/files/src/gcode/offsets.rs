//! Where a program's coordinates lie in the machine's, B: work frames, G92 and G52, and the length of the tool.

use super::modal::Axes;
use super::{Refusal, Setup};

/// G54 to G59.3, in the order of G10's P.
const FRAMES: [u16; 9] = [540, 550, 560, 570, 580, 590, 591, 592, 593];

/// Number of a work frame, from 0.
pub(super) fn frame_of(tenths: u16) -> Option<usize> {
    FRAMES.iter().position(|f| *f == tenths)
}

/// The name of a work frame.
pub(super) fn name(frame: usize) -> String {
    match (FRAMES[frame] / 10, FRAMES[frame] % 10) {
        (whole, 0) => format!("G{whole}"),
        (whole, tenth) => format!("G{whole}.{tenth}"),
    }
}

/// Why a work frame is refused that nothing has set.
pub(super) fn unknown(frame: usize, setup: &Setup) -> Refusal {
    let name = name(frame);
    let todo = setup.todo(&format!(
        "give a --job with `{name} = [x, y, z]` under [offsets], in mm from the origin of B along the program's axes"
    ));
    format!("where {name} lies in the machine is not known: {todo}; or set it in the program with G10 L2")
}

/// Which of the two shifts on top of a work frame is in force: they are one register in LinuxCNC and two in Fanuc.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Shift {
    G52,
    G92,
}

/// Offsets in force, mm.
pub(super) struct Offsets {
    frames: [Option<[f64; 3]>; 9],
    /// `None` until a program names one and where the job gives none: then coordinates are those of B.
    frame: Option<usize>,
    shift: Option<Shift>,
    shift_mm: [f64; 3],
}

impl Offsets {
    pub fn new(setup: &Setup) -> Self {
        let frames = setup.offsets.frames_mm;
        Self { frames, frame: frames[0].map(|_| 0), shift: None, shift_mm: [0.0; 3] }
    }

    /// G54 to G59.3.
    pub fn select(&mut self, frame: usize, setup: &Setup) -> Result<(), Refusal> {
        if self.frames[frame].is_none() {
            return Err(unknown(frame, setup));
        }
        self.frame = Some(frame);
        Ok(())
    }

    fn frame_mm(&self) -> [f64; 3] {
        self.frame.and_then(|f| self.frames[f]).unwrap_or_default()
    }

    /// The program's origin in B.
    pub fn total_mm(&self) -> [f64; 3] {
        let frame = self.frame_mm();
        std::array::from_fn(|i| frame[i] + self.shift_mm[i])
    }

    fn take_shift(&mut self, shift: Shift) -> Result<(), Refusal> {
        match self.shift.replace(shift) {
            Some(other) if other != shift && self.shift_mm != [0.0; 3] => Err(format!(
                "{shift:?} while {other:?} is in force: controls differ in what this does; cancel {other:?} first"
            )),
            _ => Ok(()),
        }
    }

    /// `G52`: shifts the work frame; in program coordinates, mm.
    pub fn g52(&mut self, given: Axes) -> Result<(), Refusal> {
        self.take_shift(Shift::G52)?;
        for (shift, given) in self.shift_mm.iter_mut().zip(given) {
            *shift = given.unwrap_or(*shift);
        }
        Ok(())
    }

    /// `G92`: here the tool has these coordinates.
    pub fn g92(&mut self, given: Axes, tip_mm: Axes) -> Result<(), Refusal> {
        self.take_shift(Shift::G92)?;
        let frame = self.frame_mm();
        for (i, given) in given.into_iter().enumerate() {
            if let Some(given) = given {
                let at = tip_mm[i].ok_or("G92: where the tool stands is not known here: move to X Y Z first")?;
                self.shift_mm[i] = at - frame[i] - given;
            }
        }
        Ok(())
    }

    /// `G92.1`: no shift.
    pub fn cancel_g92(&mut self) -> Result<(), Refusal> {
        self.take_shift(Shift::G92)?;
        self.shift_mm = [0.0; 3];
        Ok(())
    }

    /// `G10 L2 P`: a work frame's origin. `G10 L20 P`: the origin with which the tool stands at these coordinates.
    pub fn g10(&mut self, l: Option<f64>, p: Option<f64>, given: Axes, tip_mm: Axes) -> Result<(), Refusal> {
        let frame = match p {
            Some(0.0) | None => self.frame.ok_or("G10: no work frame is in force: give P1 for G54 … P9 for G59.3")?,
            Some(p) if p.fract() == 0.0 && (1.0..=9.0).contains(&p) => p as usize - 1,
            Some(p) => return Err(format!("G10: expected P1 for G54 … P9 for G59.3, found P{p}")),
        };
        let before = self.frames[frame];
        let mut origin = before.unwrap_or_default();
        for (i, given) in given.into_iter().enumerate() {
            match (l, given) {
                (Some(2.0), Some(given)) => origin[i] = given,
                (Some(20.0), Some(given)) => {
                    let at = tip_mm[i].ok_or("G10 L20: where the tool stands is not known here")?;
                    origin[i] = at - self.shift_mm[i] - given;
                }
                (Some(2.0 | 20.0), None) if before.is_none() => {
                    return Err(format!("G10: expected all of X Y Z: where {} lies is not known yet", name(frame)));
                }
                (Some(2.0 | 20.0), None) => {}
                _ => return Err("G10: only L2 and L20, work frames, are supported: give tools with --tools".into()),
            }
        }
        self.frames[frame] = Some(origin);
        Ok(())
    }
}

//! Cells of positions, and boxes of the wrist's angles that may reach a hole from one.

use nalgebra::Vector2;

use crate::files::job::{PerAxis, Position};

/// Where a box is not divided any more, rad.
pub(super) const SMALLEST: f64 = 1e-6;

/// A cell of positions of the table: dx, dy, rotary axis.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell {
    pub middle: [f64; 3],
    pub half: [f64; 3],
}

impl Cell {
    pub fn position(&self) -> Position {
        let [dx_m, dy_m, rotary_rad] = self.middle;
        PerAxis { dx_m, dy_m, rotary_rad }
    }
}

/// A box of β1 and β2 with solutions of a hole in it, perhaps.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box2 {
    pub middle: [f64; 2],
    pub half: [f64; 2],
    /// Sign of the tool axis along n.
    pub side: f64,
}

impl Box2 {
    /// Whether β1 and β2 are in it.
    pub fn holds(&self, beta: &Vector2<f64>) -> bool {
        (0..2).all(|i| (beta[i] - self.middle[i]).abs() <= self.half[i] + SMALLEST)
    }

    pub fn halves(self) -> [Self; 2] {
        let i = usize::from(self.half[1] > self.half[0]);
        [-1.0, 1.0].map(|sign| {
            let mut part = self;
            part.half[i] *= 0.5;
            part.middle[i] += sign * part.half[i];
            part
        })
    }
}

//! Cells of positions, and boxes of the wrist's angles that may reach a hole from one.

use nalgebra::Vector2;

use crate::files::job::{PerAxis, Position};

/// Where a box is not divided any more, rad.
pub(super) const MIN_BOX_RAD: f64 = 1e-6;
/// How much narrower than it was a box is when its cost is bounded once more.
const NARROWING: f64 = 0.7;

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

/// A box of β1 and β2 with solutions of a hole in it, perhaps, and what is known of it from the cells that its cell is a part of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Box2 {
    pub middle: [f64; 2],
    pub half: [f64; 2],
    /// Sign of the tool axis along n.
    pub side: f64,
    /// Of the objective that is to be small, and of the one that may not be too great.
    pub known: [Known; 2],
    /// Where its configurations put the cross slide: middle and greatest distance from that, along x and y.
    pub slide: [[f64; 2]; 2],
    /// Where they put the joints.
    pub joints: Joints,
}

/// What is known of the joints in a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joints {
    /// Middle and greatest distance from that, screws first.
    pub ranges: [[f64; 2]; 5],
    /// Half widths of the box and of the cell's angle when that was found.
    pub bounded: [f64; 3],
}

/// What is known of a box's cost.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    /// No solution in it costs less.
    pub low: f64,
    /// Half widths of the box and of the cell's angle when that was found.
    pub bounded: [f64; 3],
}

/// Where the cross slide is for the configurations of a box.
pub(super) enum Beside {
    Outside,
    Partly,
    Inside,
}

impl Box2 {
    pub fn unknown(middle: [f64; 2], half: [f64; 2], side: f64) -> Self {
        let slide = [[0.0, f64::INFINITY]; 2];
        let bounded = [f64::INFINITY; 3];
        let joints = Joints { ranges: [[0.0, f64::INFINITY]; 5], bounded };
        Self { middle, half, side, known: [Known { low: 0.0, bounded }; 2], slide, joints }
    }

    pub fn beside(&self, cell: &Cell) -> Beside {
        let off = |i: usize| (self.slide[i][0] - cell.middle[i]).abs();
        if (0..2).any(|i| off(i) > self.slide[i][1] + cell.half[i] + 1e-12) {
            Beside::Outside
        } else if (0..2).all(|i| off(i) + self.slide[i][1] <= cell.half[i]) {
            Beside::Inside
        } else {
            Beside::Partly
        }
    }

    /// Half widths that a bound of its cost depends on.
    pub fn widths(&self, cell: &Cell) -> [f64; 3] {
        [self.half[0], self.half[1], cell.half[2]]
    }

    /// Whether what was bounded for some half widths is hardly any narrower now.
    pub fn is_as_wide(&self, cell: &Cell, bounded: &[f64; 3]) -> bool {
        self.widths(cell).iter().zip(bounded).all(|(now, then)| *now >= NARROWING * then)
    }

    /// Whether β1 and β2 are in it.
    pub fn holds(&self, beta: &Vector2<f64>) -> bool {
        (0..2).all(|i| (beta[i] - self.middle[i]).abs() <= self.half[i] + MIN_BOX_RAD)
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

//! Newton's method for where β1 and β2 of a cell's solutions are in a box: it loses none of them.

use nalgebra::{Matrix2, Vector2};
use pkm_core::Scalar;

use super::boxes::{Box2, Cell};
use super::taylor::{THREE, Taylor};

/// How often what is bent is put into the solutions over a cell: a degree more is right each time.
const BENDINGS: usize = 3;

/// What a step tells of a box.
pub(super) enum Narrowed<const N: usize> {
    Empty,
    /// Not much.
    No,
    To {
        middle: [f64; 2],
        half: [f64; 2],
    },
    /// β1 and β2 over the cell, unless the box is small beside it.
    Solved(Option<[Taylor<N>; 2]>),
}

/// A step of Newton's method on s, the symbols of a box, over which the cross slide is as given:
/// J s = target − middle − (rotary) − what is bent.
pub(super) fn narrowed<const N: usize>(within: &Box2, [fx, fy]: &[Taylor<N>; 2], cell: &Cell) -> Narrowed<N> {
    for (f, i) in [(fx, 0), (fy, 1)] {
        let reach = f.spread() + cell.half[i] + 1e-12;
        if (f.middle() - cell.middle[i]).abs() > reach {
            return Narrowed::Empty;
        }
    }
    let jacobian = Matrix2::new(fx.linear(0), fx.linear(1), fy.linear(0), fy.linear(1));
    let Some(inverse) = jacobian.try_inverse().filter(|m| m.iter().all(|v| v.is_finite())) else {
        return Narrowed::No;
    };
    let beyond = inverse.abs() * Vector2::new(fx.bent(), fy.bent());
    // s to first order in the symbols of the cell
    let straight: [Taylor<N>; 2] = [0, 1].map(|i: usize| {
        let mut s = Taylor::ZERO;
        for (k, f) in [fx, fy].into_iter().enumerate() {
            s = s.plus(inverse[(i, k)], &(Taylor::range(cell.middle[k] - f.middle(), cell.half[k], k)));
            if N == THREE {
                s = s.plus(-inverse[(i, k)] * f.linear(2), &Taylor::range(0.0, 1.0, 2));
            }
        }
        s
    });
    let image = straight.map(|s| s.spread());
    let (Box2 { mut middle, mut half, .. }, mut shrinks) = (*within, false);
    for i in 0..2 {
        let (offset, reach) = (straight[i].middle(), image[i] + beyond[i] + 1e-12);
        let (low, high) = ((offset - reach).max(-1.0), (offset + reach).min(1.0));
        // NaN is not empty
        if low > high {
            return Narrowed::Empty;
        }
        if !(high - low).is_finite() {
            return Narrowed::No;
        }
        shrinks |= high - low < 1.4;
        middle[i] += 0.5 * (low + high) * within.half[i];
        half[i] = 0.5 * (high - low) * within.half[i] * (1.0 + 1e-9) + 1e-12;
    }
    if shrinks {
        return Narrowed::To { middle, half };
    }
    if !(0..2).all(|i| beyond[i] <= 0.5 * image[i] || beyond[i] * within.half[i] < 1e-5) {
        return Narrowed::No;
    }
    let fills = image.iter().all(|image| *image < 1.5);
    Narrowed::Solved(fills.then(|| over_cell(within, [fx, fy], &inverse, straight, &beyond)))
}

/// β1 and β2 of all solutions in a box over a cell: s is straight up to what is bent, and each time that s is put into that, what
/// is left open shrinks.
fn over_cell<const N: usize>(
    within: &Box2,
    slide: [&Taylor<N>; 2],
    inverse: &Matrix2<f64>,
    straight: [Taylor<N>; 2],
    beyond: &Vector2<f64>,
) -> [Taylor<N>; 2] {
    let mut s = [0, 1].map(|i| Taylor { rest: beyond[i], ..straight[i] });
    for _ in 0..BENDINGS {
        let symbols = [s[0], s[1], Taylor::range(0.0, 1.0, Taylor::<N>::SYMBOLS - 1)];
        let bent = slide.map(|f| f.bent_of(&symbols[..Taylor::<N>::SYMBOLS]));
        s = [0, 1].map(|i| straight[i].plus(-inverse[(i, 0)], &bent[0]).plus(-inverse[(i, 1)], &bent[1]));
    }
    [0, 1].map(|i: usize| Taylor::constant(within.middle[i]).plus(within.half[i], &s[i]))
}

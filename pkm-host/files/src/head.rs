//! How the axes of a program lie in B, and heads by whose angles a program gives the tool's direction.

use crate::path::unit;

/// Where the X, Y and Z of a program point in B: axes of B from 1, negative where they point the other way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgramAxes([i8; 3]);

impl Default for ProgramAxes {
    fn default() -> Self {
        Self([1, 2, 3])
    }
}

impl ProgramAxes {
    /// From names such as `["x", "-y", "-z"]`. `None` where they are not right-handed, or where Z is not along z of B.
    pub fn of(names: &[String; 3]) -> Option<Self> {
        let axis = |name: &String| {
            let (sign, name) = name.strip_prefix('-').map_or((1, name.as_str()), |name| (-1, name));
            Some(sign * (1 + ["x", "y", "z"].iter().position(|n| *n == name)? as i8))
        };
        let [Some(x), Some(y), Some(z)] = names.each_ref().map(axis) else { return None };
        let axes = Self([x, y, z]);
        let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|v| axes.to_base(v));
        let handed = c[0] * (a[1] * b[2] - a[2] * b[1])
            + c[1] * (a[2] * b[0] - a[0] * b[2])
            + c[2] * (a[0] * b[1] - a[1] * b[0]);
        (z.abs() == 3 && handed == 1.0).then_some(axes)
    }

    /// A vector of the program in B.
    pub fn to_base(self, v: [f64; 3]) -> [f64; 3] {
        let mut in_base = [0.0; 3];
        for (axis, v) in self.0.into_iter().zip(v) {
            in_base[usize::from(axis.unsigned_abs()) - 1] = if axis < 0 { -v } else { v };
        }
        in_base
    }

    /// A vector of B in the program.
    pub fn of_base(self, v: [f64; 3]) -> [f64; 3] {
        self.0.map(|axis| {
            let v = v[usize::from(axis.unsigned_abs()) - 1];
            if axis < 0 { -v } else { v }
        })
    }

    /// Whether Z points from the tool to the base, as in a program whose holes get deeper with -Z.
    fn is_z_up(self) -> bool {
        self.0[2] < 0
    }

    /// Whether Z is said to grow out of the workpiece, which lies along z of B from the tool.
    pub fn z_goes_out(self) -> bool {
        self.0[2] == -3
    }
}

/// A head by whose angles a program gives the tool's axis; at 0 the tool points along z of B, whatever the program's axes are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Head {
    /// A about X, carried by C about Z.
    Ac(ProgramAxes),
    /// B about Y, carried by C about Z.
    Bc(ProgramAxes),
    /// The same direction in B all the time, of any length above 0.
    Fixed([f64; 3]),
}

/// Of a tilt below this the turn about z says next to nothing: the axis is held by the tilt alone, rad.
const TILT_WITHOUT_TURN_RAD: f64 = 1e-3;

impl Head {
    /// Letters of its angles.
    pub fn letters(self) -> &'static str {
        match self {
            Self::Ac(_) => "AC",
            Self::Bc(_) => "BC",
            Self::Fixed(_) => "",
        }
    }

    /// Where a tilt leans that is carried by a turn, as x and y of the program.
    fn lean(self, turn: f64) -> [f64; 2] {
        let (s, c) = turn.sin_cos();
        if let Self::Bc(_) = self { [c, s] } else { [s, -c] }
    }

    /// The tool's axis in B.
    pub fn axis(self, [tilt, turn]: [f64; 2]) -> [f64; 3] {
        let (axes, (s, c), lean) = match self {
            Self::Ac(axes) | Self::Bc(axes) => (axes, tilt.sin_cos(), self.lean(turn)),
            Self::Fixed(axis) => return axis,
        };
        let up = [s * lean[0], s * lean[1], c];
        axes.to_base(if axes.is_z_up() { up.map(|v| -v) } else { up })
    }

    /// The angles of an axis next to given ones, between which the head does not turn over.
    pub fn angles(self, axis: [f64; 3], [tilt, turn]: [f64; 2]) -> [f64; 2] {
        let axes = match self {
            Self::Ac(axes) | Self::Bc(axes) => axes,
            Self::Fixed(_) => return [tilt, turn],
        };
        let [x, y, z] = axes.of_base(unit(axis)).map(|v| if axes.is_z_up() { -v } else { v });
        let along = |lean: [f64; 2]| x * lean[0] + y * lean[1];
        let mut turn = turn;
        if tilt.sin().abs() >= TILT_WITHOUT_TURN_RAD {
            // the angle between where it leaned and where it leans now
            let (lean, sign) = (self.lean(turn), tilt.sin().signum());
            turn += (sign * (y * lean[0] - x * lean[1])).atan2(sign * along(lean));
        }
        let new = along(self.lean(turn)).atan2(z);
        let full = std::f64::consts::TAU;
        [new + full * ((tilt - new) / full).round(), turn]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_their_axis() {
        let up = ProgramAxes::of(&["x", "-y", "-z"].map(str::to_owned)).unwrap();
        let turned = ProgramAxes::of(&["y", "-x", "z"].map(str::to_owned)).unwrap();
        for axes in [ProgramAxes::default(), up, turned] {
            for head in [Head::Ac(axes), Head::Bc(axes)] {
                assert_eq!(head.axis([0.0, 1.0])[2], 1.0, "along z of B at 0");
                for angles in [[0.3, 0.2], [-0.3, 7.0], [0.01, -3.1], [2.0, 1.0], [-0.2, -9.0]] {
                    let near = [angles[0] + 0.004, angles[1] - 0.02];
                    let found = head.angles(head.axis(angles).map(|v| 3.0 * v), near);
                    assert!((0..2).all(|i| (found[i] - angles[i]).abs() < 1e-12), "{head:?} {angles:?} {found:?}");
                }
                // hardly tilted: the turn stays, and the tilt follows
                let found = head.angles(head.axis([2e-5, 1.0]), [0.0, 0.0]);
                assert!(found[1] == 0.0 && (found[0] - 2e-5 * 1.0_f64.cos()).abs() < 1e-12, "{found:?}");
            }
        }
    }

    #[test]
    fn axes_are_right_handed_with_z_along_z() {
        let of = |names: [&str; 3]| ProgramAxes::of(&names.map(str::to_owned));
        for names in
            [["x", "y", "-z"], ["x", "x", "z"], ["z", "x", "y"], ["x", "y", "w"], ["-x", "y", "z"], ["", "y", "z"]]
        {
            assert!(of(names).is_none(), "{names:?}");
        }
        let up = of(["x", "-y", "-z"]).unwrap();
        assert_eq!(up.to_base([1.0, 2.0, 3.0]), [1.0, -2.0, -3.0]);
        let turned = of(["y", "-x", "z"]).unwrap();
        assert_eq!(turned.to_base([1.0, 2.0, 3.0]), [-2.0, 1.0, 3.0]);
        assert_eq!(turned.of_base([-2.0, 1.0, 3.0]), [1.0, 2.0, 3.0]);
    }
}

//! Geometry and statics of the machine. Lengths are in metres.

use nalgebra::{Matrix2, Matrix4x2, Vector2, Vector4};

/// Belts in the order of the files: bottom left, bottom right, top right, top left.
pub const BELTS: [&str; 4] = ["bl", "br", "tr", "tl"];

/// Distance of each anchor from the plane of the sled, m: from the description of the machine.
pub const OFFSETS_M: Vector4<f64> = Vector4::new(0.034, 0.078, 0.056, 0.100);

/// Number of anchor coordinates that are not fixed by the choice of the frame.
pub const COORDINATES: usize = 5;

/// Names of these coordinates.
pub const COORDINATE_NAMES: [&str; COORDINATES] = ["br x", "tr x", "tr y", "tl x", "tl y"];

/// Gauss-Newton steps to the place of the sled at most: each gains three digits, as effects change directions by 0.1 %.
const MAX_STEPS: usize = 20;
/// Step at which the place of the sled counts as found, m: the next one would be below 1e-12.
const MAX_LAST_STEP_M: f64 = 1e-9;

/// The four anchors in the plane of the sled: bl is the origin, and br lies on the x axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchors {
    /// In the order of [`COORDINATE_NAMES`], m.
    pub coordinates_m: [f64; COORDINATES],
}

impl Anchors {
    /// Places in the order of [`BELTS`], m.
    pub fn places_m(&self) -> [Vector2<f64>; 4] {
        let [br_x, tr_x, tr_y, tl_x, tl_y] = self.coordinates_m;
        [Vector2::zeros(), Vector2::new(br_x, 0.0), Vector2::new(tr_x, tr_y), Vector2::new(tl_x, tl_y)]
    }

    /// The sled at a place, m.
    pub fn sled(&self, place_m: Vector2<f64>) -> Sled {
        let toward = self.places_m().map(|a| a - place_m);
        let in_plane_m = toward.map(|v| v.norm());
        Sled {
            place_m,
            length_m: Vector4::from_fn(|k, _| (toward[k].norm_squared() + OFFSETS_M[k].powi(2)).sqrt()),
            toward: std::array::from_fn(|k| toward[k] / in_plane_m[k]),
            in_plane_m: in_plane_m.into(),
        }
    }

    /// Where two upper belts without stretch put the sled, m: below the line between their anchors. `None` where they do
    /// not reach one another.
    pub fn below_upper_belts(&self, lengths_m: &Vector4<f64>) -> Option<Vector2<f64>> {
        let [_, _, right, left] = self.places_m();
        let [r, l] = [2, 3].map(|k| (lengths_m[k].powi(2) - OFFSETS_M[k].powi(2)).max(0.0).sqrt());
        let (between, along) = ((right - left).norm(), (right - left).normalize());
        let x = (l * l - r * r + between * between) / (2.0 * between);
        let depth = (l * l - x * x).sqrt();
        depth.is_finite().then(|| left + along * x + Vector2::new(along.y, -along.x) * depth)
    }
}

/// The sled at a place.
pub struct Sled {
    /// Where it is, m.
    pub place_m: Vector2<f64>,
    /// Distance from each anchor, m.
    pub length_m: Vector4<f64>,
    /// The same in the plane of the sled, m.
    pub in_plane_m: Vector4<f64>,
    /// Unit vectors toward the anchors, in the plane.
    toward: [Vector2<f64>; 4],
}

impl Sled {
    /// Derivatives of the lengths by the place of the sled.
    pub fn jacobian(&self) -> Matrix4x2<f64> {
        Matrix4x2::from_fn(|k, i| -self.toward[k][i] * self.in_plane_m[k] / self.length_m[k])
    }

    /// Forces in the belts under a load of 1, statics of the sled without friction.
    pub fn forces(&self, load: Load) -> Vector4<f64> {
        let [bl, br, tr, tl] = self.toward;
        let (lower, on_sled) = match load {
            Load::Pull => (1.0, bl + br),
            Load::Weight => (0.0, Vector2::new(0.0, -1.0)),
        };
        let balance = Matrix2::from_columns(&[tr, tl]).try_inverse();
        let upper = balance.map_or(Vector2::repeat(f64::NAN), |inverse| -(inverse * on_sled));
        Vector4::new(lower, lower, upper.x, upper.y)
    }
}

/// What loads the belts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Load {
    /// Both lower belts pulled with the same force while a length is read; the upper belts carry it too.
    Pull,
    /// Weight of the sled, which hangs on the upper belts.
    Weight,
}

/// Belts that something acts on, alike.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// bl and br.
    Lower,
    /// tr and tl.
    Upper,
    /// All four.
    All,
    /// One, by its place in [`BELTS`].
    One(usize),
}

impl Group {
    fn has(self, belt: usize) -> bool {
        match self {
            Self::Lower => belt < 2,
            Self::Upper => belt >= 2,
            Self::All => true,
            Self::One(one) => one == belt,
        }
    }
}

/// Something that makes a length as read differ from the distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// A belt stretches by a share of its length under a load of 1, so that the length as read is too short.
    Stretch(Group, Load),
    /// An anchor gives way along its belt under a load of 1, m.
    Yielding(Group, Load),
    /// A belt hangs through between its ends under its own weight: squared weight per length over the pull, 1/m².
    Sag(Group),
    /// The length as read is too long by a constant, m.
    Zero(Group),
    /// The length as read is too long by a share of it.
    Scale(Group),
}

impl Effect {
    /// Whether it is gone when the lower belts are slack.
    pub fn needs_pull(self) -> bool {
        matches!(self, Self::Stretch(_, Load::Pull) | Self::Yielding(_, Load::Pull))
    }

    /// Lengths as read less distances for an amplitude of 1, m.
    pub fn deviation_m(self, sled: &Sled) -> Vector4<f64> {
        let length = &sled.length_m;
        let (group, each) = match self {
            Self::Stretch(group, load) => (group, -sled.forces(load).component_mul(length)),
            Self::Yielding(group, load) => (group, -sled.forces(load)),
            // a parabola: arc less chord is w² l³ cos² / (24 N²)
            Self::Sag(group) => {
                let force = sled.forces(Load::Pull);
                let across = |k: usize| sled.toward[k].x * length[k] / force[k];
                (group, Vector4::from_fn(|k, _| length[k] * across(k).powi(2) / 24.0))
            }
            Self::Zero(group) => (group, Vector4::repeat(1.0)),
            Self::Scale(group) => (group, *length),
        };
        Vector4::from_fn(|k, _| if group.has(k) { each[k] } else { 0.0 })
    }
}

/// Anchors, and what acts with its amplitude.
#[derive(Clone, Debug)]
pub struct Machine {
    /// The anchors.
    pub anchors: Anchors,
    /// What acts.
    pub effects: Vec<(Effect, f64)>,
}

impl Machine {
    /// Lengths that would be read with the sled at a place, m.
    pub fn read_m(&self, sled: &Sled) -> Vector4<f64> {
        self.effects.iter().fold(sled.length_m, |sum, (effect, a)| sum + effect.deviation_m(sled) * *a)
    }

    /// The same machine with slack lower belts.
    pub fn slack(&self) -> Self {
        let effects = self.effects.iter().copied().filter(|e| !e.0.needs_pull()).collect();
        Self { anchors: self.anchors, effects }
    }

    /// Place of the sled that fits four lengths best, each weighted, by Gauss-Newton steps from a start; m. `None` where
    /// the steps do not converge.
    pub fn place_m(
        &self,
        lengths_m: &Vector4<f64>,
        weights: &Vector4<f64>,
        start_m: Vector2<f64>,
    ) -> Option<Vector2<f64>> {
        let mut place = start_m;
        for _ in 0..MAX_STEPS {
            let sled = self.anchors.sled(place);
            let mut jacobian = sled.jacobian();
            for mut column in jacobian.column_iter_mut() {
                column.component_mul_assign(weights);
            }
            let residual = (lengths_m - self.read_m(&sled)).component_mul(weights);
            let step = (jacobian.transpose() * jacobian).try_inverse()? * (jacobian.transpose() * residual);
            place += step;
            if step.norm() < MAX_LAST_STEP_M {
                return Some(place);
            }
        }
        None
    }
}

//! Where the tracker stands: the rigid transformation from B to its frame, and the reflectors whose coordinates nobody gave.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6, Rotation3, Vector3};

use super::rigid::{Motion, Pair};

/// Gauss-Newton steps: two or three are needed where the poses are near the commanded ones.
const MAX_STEPS: usize = 50;
/// Step, in standard deviations, below which nothing changes any more.
const MAX_LAST_STEP_SD: f64 = 1e-3;
/// Standard deviation of the rotation, rad, from which the points are taken to determine none.
const MAX_ROTATION_SD: f64 = 0.02;
/// Numbers of a rigid transformation.
const RIGID: usize = 6;

/// Where a point is that the tracker has measured.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    /// In B.
    Known(Vector3<f64>),
    /// On the platform, at an unknown place `reflector` in A-uvw, by index among those.
    Carried { a_m: Vector3<f64>, axes: Matrix3<f64>, reflector: usize },
}

/// A point of which place and measurement are known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sighting {
    pub(crate) place: Place,
    pub(crate) measured_m: Vector3<f64>,
    pub(crate) sd_m: f64,
}

/// The transformation from B to the tracker's frame.
#[derive(Clone, Debug)]
pub struct Registration {
    pub(crate) motion: Motion,
    /// Points that it follows from.
    pub points: usize,
    /// Root mean square residual of a coordinate, m.
    pub rms_m: f64,
    /// Reduced χ² of the registration; 1 without degrees of freedom.
    pub chi2_per_dof: f64,
    /// Of B's origin and of the rotation vector in the tracker's frame, m and rad; with more left than the points' own errors, by
    /// as much more.
    pub covariance: Matrix6<f64>,
}

impl Registration {
    /// Rows of the rotation from B to the tracker's frame, and the place of B's origin there, m.
    pub fn transformation(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        (self.motion.rotation.matrix().transpose().into(), self.motion.translation_m.into())
    }

    /// Standard deviations of origin, m, and rotation, rad, of the least known direction.
    pub fn deviations(&self) -> [f64; 2] {
        deviations(&self.covariance)
    }

    /// Root mean square of the coordinates by which points of known places are off, m; 0 without any.
    pub(crate) fn rms_of(&self, sightings: &[Sighting]) -> f64 {
        let off = |s: &Sighting| match s.place {
            Place::Known(at_m) => Some((s.measured_m - self.motion.of(&at_m)).norm_squared()),
            Place::Carried { .. } => None,
        };
        let squares: Vec<f64> = sightings.iter().filter_map(off).collect();
        (squares.iter().sum::<f64>() / (3 * squares.len()).max(1) as f64).sqrt()
    }
}

/// Of a translation and of a rotation, in the least known directions.
fn deviations(covariance: &Matrix6<f64>) -> [f64; 2] {
    [0, 3].map(|first| {
        let part: Matrix3<f64> = covariance.fixed_view::<3, 3>(first, first).into_owned();
        part.symmetric_eigenvalues().max().max(0.0).sqrt()
    })
}

impl Sighting {
    fn at_m(&self, reflectors_m: &[Vector3<f64>]) -> Vector3<f64> {
        match self.place {
            Place::Known(at_m) => at_m,
            Place::Carried { a_m, axes, reflector } => a_m + axes * reflectors_m[reflector],
        }
    }
}

/// Registers the tracker, and finds `unknown` reflectors in A-uvw. `None` where the points do not determine that.
pub(crate) fn register(sightings: &[Sighting], unknown: usize) -> Option<(Registration, Vec<Vector3<f64>>)> {
    let mut reflectors = vec![Vector3::zeros(); unknown];
    let is_known = |s: &&Sighting| matches!(s.place, Place::Known(_));
    let known = sightings.iter().filter(is_known).count() >= 3;
    let pairs: Vec<Pair> = (sightings.iter().filter(|s| !known || is_known(s)))
        .map(|s| Pair { before_m: s.at_m(&reflectors), after_m: s.measured_m, sd_m: [0.0, s.sd_m] })
        .collect();
    let mut motion = Motion::fit(&pairs);
    for _ in 0..MAX_STEPS {
        let (information, gradient, _) = normal_equations(sightings, &motion, &reflectors);
        let cholesky = information.cholesky()?;
        let step = cholesky.solve(&gradient);
        let turn = Rotation3::new(Vector3::new(step[3], step[4], step[5]));
        motion.rotation = turn * motion.rotation;
        motion.translation_m += Vector3::new(step[0], step[1], step[2]);
        for (n, r) in reflectors.iter_mut().enumerate() {
            *r += step.fixed_rows::<3>(RIGID + 3 * n);
        }
        if step.dot(&gradient).sqrt() > MAX_LAST_STEP_SD {
            continue;
        }
        let (_, _, [weighed, squares]) = normal_equations(sightings, &motion, &reflectors);
        let (numbers, dof) = (3 * sightings.len(), (3 * sightings.len()).saturating_sub(RIGID + 3 * unknown));
        let chi2_per_dof = if dof == 0 { 1.0 } else { weighed / dof as f64 };
        let of_points: Matrix6<f64> = cholesky.inverse().fixed_view::<RIGID, RIGID>(0, 0).into_owned();
        let is_known = deviations(&of_points)[1] < MAX_ROTATION_SD;
        let registration = Registration {
            motion,
            points: sightings.len(),
            rms_m: (squares / numbers as f64).sqrt(),
            chi2_per_dof,
            covariance: of_points * chi2_per_dof.max(1.0),
        };
        return is_known.then_some((registration, reflectors));
    }
    None
}

/// Information, gradient, and squares of the residuals, weighed and plain, of translation, rotation, and unknown reflectors.
fn normal_equations(
    sightings: &[Sighting],
    motion: &Motion,
    reflectors_m: &[Vector3<f64>],
) -> (DMatrix<f64>, DVector<f64>, [f64; 2]) {
    let count = RIGID + 3 * reflectors_m.len();
    let (mut information, mut gradient) = (DMatrix::zeros(count, count), DVector::zeros(count));
    let mut squares = [0.0; 2];
    for s in sightings {
        let turned = motion.rotation * s.at_m(reflectors_m);
        let residual = s.measured_m - turned - motion.translation_m;
        let weight = 1.0 / (s.sd_m * s.sd_m);
        // a point depends on the transformation, and on one reflector at the most
        let mut rows: Vec<(usize, Matrix3<f64>)> = vec![(0, Matrix3::identity()), (3, -turned.cross_matrix())];
        if let Place::Carried { axes, reflector, .. } = s.place {
            rows.push((RIGID + 3 * reflector, motion.rotation.matrix() * axes));
        }
        for (i, a) in &rows {
            let mut part = gradient.fixed_rows_mut::<3>(*i);
            part += a.transpose() * residual * weight;
            for (j, b) in &rows {
                let mut part = information.fixed_view_mut::<3, 3>(*i, *j);
                part += a.transpose() * b * weight;
            }
        }
        squares[0] += weight * residual.norm_squared();
        squares[1] += residual.norm_squared();
    }
    (information, gradient, squares)
}

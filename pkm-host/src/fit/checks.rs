//! What is doubtful about stiffness data: poses that contradict the others, other axes or another point, another unit.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DVector, Matrix3, Matrix6, Rotation3, SVector, Vector3, Vector6};
use pkm_core::correction::{EQ_11, FACTOR_ENTRIES};
use pkm_core::kinematics::platform_axes;
use pkm_core::{Basis, Domain, Machine, Pose, Stiffness, Wrench};
use pkm_diagnosis::robust::{deviation_by_median, upper_median};

use super::regression::Regression;
use super::{Fit, Sample, design, some_of};
use crate::error::printable;
use crate::files::dataset::Target;
use crate::pose::{PoseBox, core_units};

/// By how much less, squared, the correction has to vary, or to be, under another reading of the data for that to be said.
const MIN_RATIO: f64 = 4.0;
/// Poses that tell whether the data were meant in another way.
const MAX_POSES_READ_OTHERWISE: usize = 50;
/// How far from A the stiffness may have been taken.
const MAX_OFFSET_MM: i32 = 1000;
/// How far, in robust standard deviations of what the other poses leave, a pose is off that contradicts them. The farthest good pose of the
/// fixtures is 9 off.
const STRAY: f64 = 20.0;
/// So far off, relatively, that it is worth a warning.
const MIN_STRAY: f64 = 0.02;
/// Poses that are named at the most.
const MAX_STRAY: usize = 5;
/// Least share of the errors that an expanded uncertainty of 95 % may hold before that is said, and of how many.
const MIN_COVERED: f64 = 0.8;
/// See `MIN_COVERED`.
const MIN_COMPARED: usize = 30;

/// Another way in which a file may have been meant.
struct Reading {
    name: String,
    read: Box<dyn Fn(&Sample) -> Sample>,
    /// Whether it would change the corrections from pose to pose above all, such as the sign of an angle, and not all of them alike.
    varies: bool,
}

impl Reading {
    fn of_pose(name: &str, varies: bool, change: fn(Pose<f64>) -> Pose<f64>) -> Self {
        let read = move |s: &Sample| {
            let mut sample = s.clone();
            sample.pose.pose = change(s.pose.pose);
            sample
        };
        Self { name: name.to_owned(), read: Box::new(read), varies }
    }

    /// With the stiffness Tᵀ K T.
    fn of_stiffness(name: String, t: impl Fn(&Pose<f64>) -> Matrix6<f64> + 'static) -> Self {
        let read = move |s: &Sample| {
            let t = t(&s.pose.pose);
            let full = s.target.full.map(|k| Stiffness::from_lower(&(t.transpose() * k.matrix() * t)));
            Sample { target: Target { full, ..s.target.clone() }, ..s.clone() }
        };
        Self { name, read: Box::new(read), varies: false }
    }

    /// Signs, angles, axes and points that are taken for each other.
    fn all() -> Vec<Self> {
        // forces and moments alike
        let turn = |r: Matrix3<f64>| {
            let mut both = Matrix6::zeros();
            both.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
            both.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
            both
        };
        let negative = |p: Pose<f64>| Pose { theta_rad: -p.theta_rad, sigma_rad: -p.sigma_rad, ..p };
        let mut all = vec![
            Self::of_pose("the other sign of theta_deg", true, |p| Pose { theta_rad: -p.theta_rad, ..p }),
            Self::of_pose("the other sign of sigma_deg", true, |p| Pose { sigma_rad: -p.sigma_rad, ..p }),
            Self::of_pose("the other sign of theta_deg and sigma_deg", true, negative),
            Self::of_pose("theta_deg and sigma_deg exchanged", false, |p| Pose {
                theta_rad: p.sigma_rad,
                sigma_rad: p.theta_rad,
                ..p
            }),
            Self::of_stiffness("K in the axes x, y, z of B".into(), move |p| {
                turn(platform_axes(p.theta_rad.sin_cos(), p.sigma_rad.sin_cos()))
            }),
            Self::of_stiffness("u and v exchanged".into(), move |_| {
                turn(Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
            }),
        ];
        for (quarters, name) in [(1, "90°"), (2, "180°"), (3, "-90°")] {
            let turned = Rotation3::from_axis_angle(&Vector3::z_axis(), f64::from(quarters) * FRAC_PI_2).into_inner();
            all.push(Self::of_stiffness(format!("the axes u and v turned by {name} about w"), move |_| turn(turned)));
        }
        for mm in (-MAX_OFFSET_MM..=MAX_OFFSET_MM).step_by(10).filter(|mm| mm.abs() > 20) {
            let to_point = Vector3::new(0.0, 0.0, f64::from(mm) / 1e3);
            // the point moves by what A does and by what the platform turns
            let mut t = Matrix6::identity();
            t.fixed_view_mut::<3, 3>(0, 3).copy_from(&-to_point.cross_matrix());
            all.push(Self::of_stiffness(format!("K at a point about {mm} mm along w from A"), move |_| t));
        }
        all
    }

    /// How much has to be corrected, squared, and how much of that varies from pose to pose.
    fn corrections(&self, machine: &Machine<f64>, samples: &[&Sample]) -> Option<[f64; 2]> {
        corrections(machine, samples.iter().map(|s| (self.read)(s)))
    }
}

fn corrections(machine: &Machine<f64>, samples: impl Iterator<Item = Sample>) -> Option<[f64; 2]> {
    let entries = |s: Sample| {
        let basic = machine.stiffness(&s.pose.pose).ok()?;
        Sample { basic, ..s }.factor_entries().map(SVector::from)
    };
    let all: Vec<SVector<f64, FACTOR_ENTRIES>> = samples.map(entries).collect::<Option<_>>()?;
    let mean = all.iter().sum::<SVector<f64, FACTOR_ENTRIES>>() / all.len() as f64;
    let diagonal = (0..6).flat_map(|i| (0..=i).map(move |j| f64::from(u8::from(i == j))));
    let none = SVector::<f64, FACTOR_ENTRIES>::from_iterator(diagonal);
    let about = |centre: &SVector<f64, FACTOR_ENTRIES>| all.iter().map(|e| (e - centre).norm_squared()).sum::<f64>();
    Some([about(&none), about(&mean)])
}

/// A warning where the data follow the machine much better if they are read in another way. Whole matrices alone tell.
pub fn read_otherwise(machine: &Machine<f64>, samples: &[Sample], file: &str) -> Option<String> {
    let some = some_of(samples, MAX_POSES_READ_OTHERWISE);
    let said = corrections(machine, some.iter().map(|s| (*s).clone()))?;
    let gain = |reading: Reading| {
        let found = reading.corrections(machine, &some)?;
        let by = usize::from(reading.varies);
        // what is better in one respect and worse in the other is no better
        (found[1 - by] <= said[1 - by]).then(|| (said[by] / found[by], reading))
    };
    let best = Reading::all().into_iter().filter_map(gain).max_by(|a, b| a.0.total_cmp(&b.0));
    let (ratio, reading) = best.filter(|(ratio, _)| *ratio > MIN_RATIO)?;
    let less = if reading.varies { "varies {} times less from pose to pose" } else { "is {} times less" };
    Some(format!(
        "{}: the data follow the machine much better with {}: what has to be corrected then {}: are they as the machine file and \
         docs/formats.md have them?",
        printable(file),
        reading.name,
        less.replace("{}", &format!("{:.1}", ratio.sqrt()))
    ))
}

/// Warnings of poses that the others contradict: each is left out of a fit of Eq. 11's terms to the rest, the farthest first.
pub fn stray_poses(samples: &[Sample], file: &str) -> Vec<String> {
    let mut kept: Vec<&Sample> = samples.iter().collect();
    let mut warnings = Vec::new();
    while let Some((at, what)) = farthest(&kept) {
        if warnings.len() == MAX_STRAY {
            warnings.push(format!("{}: more poses contradict the others", printable(file)));
            break;
        }
        let pose = &kept.remove(at).pose;
        warnings.push(format!(
            "{}:{}: pose `{}` contradicts the others: {what}: is the row right?",
            printable(file),
            pose.line,
            printable(&pose.id)
        ));
    }
    warnings
}

/// What each pose is off in a stiffness from a fit of Eq. 11's terms to the others.
struct Off {
    name: String,
    by_pose: Vec<f64>,
}

/// The same by stiffness: the logarithms of the principal ones, then the couplings. `None` where poses are too few.
fn left_out(samples: &[&Sample]) -> Option<Vec<Off>> {
    if samples.len() <= 2 * EQ_11.len() {
        return None;
    }
    let extent = PoseBox::of(samples.iter().map(|s| &s.pose.pose));
    let basis = Basis::<f64>::new(core_units(extent.middle()), core_units(extent.half_widths()), &EQ_11).ok()?;
    let design = design(&basis, EQ_11.len(), samples.iter().copied());
    let off = |name: String, values: Vec<f64>| {
        let fit = Regression::new(&design, &[true; EQ_11.len()], &DVector::from_vec(values)).ok()?;
        Some(Off { name, by_pose: fit.left_out })
    };
    let principal =
        (0..6).map(|i| off(format!("k{0}{0}", i + 1), samples.iter().map(|s| s.ratios()[i].ln()).collect()));
    let entries: Option<Vec<_>> = samples.iter().map(|s| s.factor_entries()).collect();
    let below = (0..6).flat_map(|i| (0..=i).map(move |j| (i, j))).enumerate().filter(|(_, (i, j))| i != j);
    let couplings = below.filter_map(|(n, (i, j))| {
        Some(off(format!("k{}{}", j + 1, i + 1), entries.as_ref()?.iter().map(|e| e[n]).collect()))
    });
    principal.chain(couplings).collect()
}

/// Standard deviation of most of some numbers about 0, whatever the others are.
fn robust_deviation(off: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = off.iter().map(|r| r.abs()).collect();
    upper_median(&mut sizes).map_or(f64::NAN, deviation_by_median)
}

/// How far a pose is off in each stiffness, by what most poses are off in `all`.
fn far(off: &[Off], at: usize, all: &[Off]) -> Vec<f64> {
    let of = |(off, all): (&Off, &Off)| {
        let size = off.by_pose[at].abs();
        if size > MIN_STRAY { size / robust_deviation(&all.by_pose) } else { 0.0 }
    };
    off.iter().zip(all).map(of).collect()
}

/// The pose that is farthest from what the others say, if it contradicts them, and in what.
fn farthest(samples: &[&Sample]) -> Option<(usize, String)> {
    let off = left_out(samples)?;
    let most = |far: &[f64]| far.iter().copied().fold(0.0, f64::max);
    let rank = |at: &usize| most(&far(&off, *at, &off));
    let at = (0..samples.len()).max_by(|a, b| rank(a).total_cmp(&rank(b)))?;
    // it draws the fits of all others towards itself
    let others: Vec<&Sample> = samples.iter().enumerate().filter(|(n, _)| *n != at).map(|(_, s)| *s).collect();
    let far = far(&off, at, &left_out(&others)?);
    let greatest = (0..far.len()).max_by(|a, b| far[*a].total_cmp(&far[*b])).filter(|n| far[*n] > STRAY)?;
    // a principal stiffness says more than the couplings that are wrong with it
    let size = |n: &usize| off[*n].by_pose[at].abs();
    let principal = (0..6).filter(|n| far[*n] > STRAY).max_by(|a, b| size(a).total_cmp(&size(b)));
    let what = match principal {
        Some(n) => format!("{} is {:.3} times what they say", off[n].name, off[n].by_pose[at].exp()),
        None => format!("its coupling {} is not what they say", off[greatest].name),
    };
    Some((at, what))
}

/// Columns in which the data are so far from the model that the units are in doubt, and how far: geometric means.
pub fn suspicious_ratios(samples: &[Sample]) -> Vec<(String, f64)> {
    let mean = |i: usize| (samples.iter().map(|s| s.ratios()[i].ln()).sum::<f64>() / samples.len() as f64).exp();
    let means = (0..6).map(|i| (format!("k{0}{0}", i + 1), mean(i)));
    means.filter(|(_, ratio)| !(1.0 / 30.0..=30.0).contains(ratio)).collect()
}

/// A warning where the uncertainty of a table holds far less of the errors at other poses than it says.
pub fn too_sure(fit: &Fit, machine: &Machine<f64>, tip_m: Vector3<f64>) -> Option<String> {
    let table = fit.numbers.table().ok()?;
    let uncertainty = fit.uncertainty.as_ref()?.core().ok()?;
    let mut ratios = Vec::new();
    for sample in fit.verification.iter().flat_map(|v| &v.samples) {
        let found = sample.target.full?.factor().ok()?;
        let said = table.factor_form(machine, &sample.pose.pose).ok()?;
        if said.domain == Domain::Outside {
            continue;
        }
        for n in 0..3 {
            let push = Wrench::from_vector(Vector6::ith(n, 1.0));
            let moved = |k: &pkm_core::StiffnessFactor<f64>| {
                Some(k.deflection(&push.moved_to_a(tip_m)).ok()?.seen_at(tip_m).translation_m)
            };
            let off = moved(&found)? - moved(&said.factor)?;
            let u95 = table.tip_uncertainty(&uncertainty, &said.factor, &sample.pose.pose, &push, tip_m).ok()?.u95_m();
            ratios.extend(off.iter().zip(&u95).map(|(off, u95)| off.abs() / u95));
        }
    }
    let covered = ratios.iter().filter(|r| **r <= 1.0).count() as f64 / ratios.len() as f64;
    ratios.sort_by(f64::total_cmp);
    (ratios.len() >= MIN_COMPARED && covered < MIN_COVERED).then(|| {
        format!(
            "the table's uncertainty is too small: at the verification poses it holds {:.0} % of the tip's deflections, not 95 %, and \
             would have to be {:.1} times as large: fit on more poses, or on more steps of each variable",
            100.0 * covered,
            ratios[ratios.len() * 95 / 100]
        )
    })
}

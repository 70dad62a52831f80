//! From a tracker's points to deflections: what a metrologist has instead of six numbers at A.
//!
//! `table`: rows of readings before and after. `survey`: which points belong to a reading, and whether they tell a motion.
//! `registration`: where the tracker stands, from unloaded points. `rigid`: motions of points with their covariance. Here: the motion
//! of the platform under each load, with that of the base taken out. `gross`: single points that are wrong.
//!
//! Unloaded points serve all readings of their series. Their errors are the zero error that the series has in common: each reading
//! tells which share of its variance that is.

mod gross;
pub(crate) mod registration;
pub(crate) mod rigid;
mod survey;
mod table;

use std::collections::{BTreeSet, HashMap};

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use pkm_core::kinematics::platform_axes;

pub use self::registration::Registration;
use self::registration::{Place, Sighting, register};
use self::rigid::{Motion, Pair};
use self::survey::{MIN_REFLECTORS, Pairs, Survey};
pub use self::table::{tasks, with_deflections};
use crate::error::{Failure, Result};
use crate::files::points::{Point, PointList};
use crate::files::reflectors::{On, Reflectors};
use crate::pose::NamedPose;

/// Mean squared misfit of reflectors over their variances from which their uncertainty is doubted.
const MAX_MISFIT: f64 = 4.0;
/// Root mean square that registration may leave: a machine is never off by so much; and from which it is doubted.
const MAX_REGISTRATION_RMS_M: f64 = 0.01;
const DOUBTFUL_REGISTRATION_RMS_M: f64 = 1e-3;

/// A reading to be made from points: a row of the readings' file.
pub struct Task<'a> {
    /// Line of the readings' file, from 1.
    pub line: u64,
    /// Id of the reading.
    pub reading: String,
    /// Its series; empty for a reading with a zero of its own.
    pub series: String,
    /// Commanded pose.
    pub pose: &'a NamedPose,
}

/// What the points of a reading say.
pub enum Deflection {
    /// Of A, in A-uvw: components in m and rad, their covariance, and the share of it that unloaded points have.
    Whole(Vector6<f64>, Box<Matrix6<f64>>, f64),
    /// Of one or two reflectors: too few to tell a rotation.
    Points(Vec<Displacement>),
}

/// Displacement of one reflector, in A-uvw.
pub struct Displacement {
    /// Its name.
    pub reflector: String,
    /// Where it sits, in A-uvw.
    pub point_m: [f64; 3],
    /// Components, m.
    pub components_m: Vector3<f64>,
    /// Their covariance.
    pub covariance: Matrix3<f64>,
    /// Share of it that unloaded points have.
    pub zero_share: f64,
}

/// How far the base had moved under a load, in the tracker's frame.
#[derive(Clone, Debug)]
pub struct BaseMotion {
    /// Reading.
    pub reading: String,
    /// Translation of B's origin, m.
    pub translation_m: f64,
    /// Angle, rad.
    pub rotation_rad: f64,
}

/// Reflectors that the tracker found: names, and coordinates in A-uvw, m.
pub type Located = Vec<(String, [f64; 3])>;

/// All that the points of a campaign say.
pub struct Campaign {
    /// Where the tracker stands.
    pub registration: Registration,
    /// Deflections in the order of the tasks.
    pub deflections: Vec<Deflection>,
    /// Of readings with reflectors on the base.
    pub base: Vec<BaseMotion>,
    /// Mean squared misfit of reflectors to a rigid platform over their variances; `None` where no reading has three reflectors.
    pub misfit: Option<f64>,
    /// Platform reflectors whose coordinates the tracker told, in A-uvw, m.
    pub located: Located,
    /// What is doubtful.
    pub warnings: Vec<String>,
}

/// A pose: A in B, and u, v, w as columns in B.
fn frame(pose: &NamedPose) -> (Vector3<f64>, Matrix3<f64>) {
    let p = &pose.pose;
    (p.a_in_b_m(), platform_axes(p.theta_rad.sin_cos(), p.sigma_rad.sin_cos()))
}

/// Deflections from points.
///
/// # Errors
/// One message with file and line: a reading without points, a point that was measured in one state alone, too few reflectors or such as
/// lie in one line, one that left the others, points that do not tell where the tracker stands.
pub fn deflections(
    tasks: &[Task<'_>],
    reflectors: &Reflectors,
    points: &PointList,
    readings_file: &str,
) -> Result<Campaign> {
    let on_platform_m =
        reflectors.all.iter().map(|r| r.at_m.filter(|_| r.on == On::Platform).map(Vector3::from)).collect();
    let mut survey = Survey { reflectors, points, readings_file, on_platform_m };
    survey.require_known_names(tasks)?;
    let (registration, located, doubt) = survey.register(tasks)?;
    let mut campaign = Campaign {
        registration,
        deflections: Vec::new(),
        base: Vec::new(),
        misfit: None,
        located,
        warnings: points.warnings.iter().cloned().chain(doubt).collect(),
    };
    let (mut misfit, mut freedom, mut without_base) = (0.0, 0_usize, 0_usize);
    for task in tasks {
        let [before, after] = survey.points_of(task)?;
        let base = survey.base_motion(task, &campaign.registration, before, after)?;
        let pairs = survey.pairs(task, before, after)?;
        without_base += usize::from(base.is_none() && survey.has_base());
        let (deflection, own) = survey.deflection(task, &campaign.registration, base.as_ref(), &pairs)?;
        if let Some((squares, dof)) = own {
            (misfit, freedom) = (misfit + squares, freedom + dof);
        }
        campaign.deflections.push(deflection);
        campaign.base.extend(base.map(|b| b.reported));
    }
    if without_base > 0 {
        campaign.warnings.push(format!(
            "{}: no reflectors of the base under load in {without_base} of {} readings: its motion is not taken out there",
            points.source.name,
            tasks.len()
        ));
    }
    campaign.warnings.extend(gross::warnings(&survey));
    campaign.misfit = (freedom > 0).then(|| misfit / freedom as f64);
    if let Some(times) = campaign.misfit.filter(|m| *m > MAX_MISFIT) {
        campaign.warnings.push(format!(
            "{}: reflectors leave a rigid platform by {:.1} times their uncertainty: is u95_um too small, a reflector loose, or does what \
             carries them bend?",
            points.source.name,
            times.sqrt()
        ));
    }
    Ok(campaign)
}

/// The motion of the base in the tracker's frame, about the mean of its reflectors.
struct Base {
    motion: Motion,
    centre_m: Vector3<f64>,
    /// By the errors of unloaded and of loaded points, about that centre.
    covariances: [Matrix6<f64>; 2],
    reported: BaseMotion,
}

impl Survey<'_> {
    /// Where the tracker stands; platform reflectors without coordinates, which get them here; and what is to be doubted of it.
    fn register(&mut self, tasks: &[Task<'_>]) -> Result<(Registration, Located, Option<String>)> {
        let is_unknown = |n: &usize| self.reflectors.all[*n].on == On::Platform && self.on_platform_m[*n].is_none();
        let unknown: Vec<usize> = (0..self.reflectors.all.len()).filter(is_unknown).collect();
        let (mut on_base, mut on_platform): (Vec<Sighting>, Vec<Sighting>) = (Vec::new(), Vec::new());
        let mut poses: HashMap<u64, &NamedPose> = HashMap::new();
        for task in tasks {
            let [before, _] = self.points_of(task)?;
            let Some(first) = before.first() else { continue };
            if let Some(other) = poses.insert(first.line, task.pose) {
                if other.pose != task.pose.pose {
                    let message = format!("series {} stands at two poses: unloaded points belong to one", task.series);
                    return Err(self.fail_reading(task, message).at_column("series"));
                }
                continue;
            }
            let (a_m, axes) = frame(task.pose);
            for p in before {
                let sighting = |place| Sighting { place, measured_m: p.at_m.into(), sd_m: p.sd_m };
                match (self.is_on(p, On::Base), self.reflectors.all[p.reflector].at_m) {
                    (true, Some(at_m)) => on_base.push(sighting(Place::Known(at_m.into()))),
                    // it tells the motion of the base alone
                    (true, None) => {}
                    (false, Some(at_m)) => on_platform.push(sighting(Place::Known(a_m + axes * Vector3::from(at_m)))),
                    (false, None) => {
                        let reflector = unknown.iter().position(|n| *n == p.reflector).unwrap_or(0);
                        on_platform.push(sighting(Place::Carried { a_m, axes, reflector }));
                    }
                }
            }
        }
        let base: BTreeSet<[u64; 3]> = on_base.iter().filter_map(place_bits).collect();
        let has_base = base.len() >= MIN_REFLECTORS;
        // reflectors of the base stand where they stand, poses are as good as the machine
        let is_used = |s: &&Sighting| !has_base || matches!(s.place, Place::Carried { .. });
        on_base.extend(on_platform.iter().filter(is_used));
        let failed = |message: &str| Failure::input(message).in_file(&self.points.source.name);
        let (registration, found) = register(&on_base, unknown.len()).ok_or_else(|| {
            failed(
                "the unloaded points do not tell where the tracker stands: three reflectors with coordinates that are not in one line \
                 are needed, on the base or on the platform, or readings at several poses",
            )
        })?;
        let rms_m = registration.rms_m.max(registration.rms_of(&on_platform));
        if rms_m > MAX_REGISTRATION_RMS_M {
            return Err(failed(&format!(
                "unloaded points are {:.1} mm (rms) off where poses and reflectors say: are they in mm, in right-handed axes, and \
                 reflectors named as in {}?",
                rms_m * 1e3,
                self.reflectors.source.name
            )));
        }
        for (n, at_m) in unknown.iter().zip(&found) {
            self.on_platform_m[*n] = Some(*at_m);
        }
        let located = unknown.iter().zip(found).map(|(n, at_m)| (self.name(*n).to_owned(), at_m.into()));
        // of the platform's reflectors the machine's own error is the greater part, of the base's there is none
        let times = registration.chi2_per_dof.sqrt();
        let of_base = (has_base && registration.chi2_per_dof > MAX_MISFIT).then(|| {
            let um = registration.rms_m * 1e6;
            format!("reflectors of the base are {um:.1} µm (rms) off, {times:.1} times their uncertainty")
        });
        let of_platform = (rms_m > DOUBTFUL_REGISTRATION_RMS_M)
            .then(|| format!("unloaded points are {:.1} mm (rms) off where poses and reflectors say", rms_m * 1e3));
        let doubt = of_base.or(of_platform).map(|what| {
            format!(
                "{}: {what}: is a coordinate mistyped in {}, or was the tracker moved between series?",
                self.points.source.name, self.reflectors.source.name
            )
        });
        Ok((registration, located.collect(), doubt))
    }

    /// How the base has moved in the tracker's frame between the states.
    fn base_motion(
        &self,
        task: &Task<'_>,
        registration: &Registration,
        before: &[Point],
        after: &[Point],
    ) -> Result<Option<Base>> {
        if !after.iter().any(|p| self.is_on(p, On::Base)) {
            return Ok(None);
        }
        let both = self.both(task, On::Base, before, after)?;
        let line = both.first().map_or(0, |(_, [_, loaded])| loaded.line);
        let places: Vec<Vector3<f64>> = both.iter().map(|(_, [b, _])| b.at_m.into()).collect();
        self.require_body(line, &task.reading, &places)?;
        let centre_m = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        let pair = |(_, [b, a]): &(usize, [Point; 2])| Pair {
            before_m: Vector3::from(b.at_m) - centre_m,
            after_m: Vector3::from(a.at_m) - centre_m,
            sd_m: [b.sd_m, a.sd_m],
        };
        let pairs: Vec<Pair> = both.iter().map(pair).collect();
        let motion = Motion::fit(&pairs);
        self.require_together(&task.reading, &both, &pairs)?;
        let undetermined = || self.fail(line, "the base's reflectors determine no motion".into());
        let covariances = motion.covariances(&pairs).ok_or_else(undetermined)?;
        let origin_m = registration.motion.translation_m - centre_m;
        let reported = BaseMotion {
            reading: task.reading.clone(),
            translation_m: (motion.of(&origin_m) - origin_m).norm(),
            rotation_rad: motion.rotation.angle(),
        };
        Ok(Some(Base { motion, centre_m, covariances, reported }))
    }

    /// What the points of a reading say, and squares of what a rigid body leaves of them with their degrees of freedom.
    fn deflection(
        &self,
        task: &Task<'_>,
        registration: &Registration,
        base: Option<&Base>,
        points: &Pairs,
    ) -> Result<(Deflection, Option<(f64, usize)>)> {
        let (a_m, axes) = frame(task.pose);
        // from the tracker's axes to u, v, w
        let turn: Matrix3<f64> = axes.transpose() * registration.motion.rotation.inverse().matrix();
        let displaced = |[before, after]: &[Point; 2]| {
            let after: Vector3<f64> = after.at_m.into();
            let after = base.map_or(after, |b| b.motion.back(&(after - b.centre_m)) + b.centre_m);
            turn * (after - Vector3::from(before.at_m))
        };
        let place = |reflector: usize| self.on_platform_m[reflector].unwrap_or_default();
        let pair = |(reflector, both): &(usize, [Point; 2])| {
            let before_m = place(*reflector);
            Pair { before_m, after_m: before_m + displaced(both), sd_m: both.map(|p| p.sd_m) }
        };
        let pairs: Vec<Pair> = points.iter().map(pair).collect();
        // what errors of the base's motion do to a point of the platform
        let by_base = |at_m: Vector3<f64>| -> [Matrix6<f64>; 2] {
            base.map_or([Matrix6::zeros(); 2], |b| {
                let lever = registration.motion.of(&(a_m + axes * at_m)) - b.centre_m;
                let mut to_a = SMatrix::<f64, 6, 6>::zeros();
                to_a.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
                to_a.fixed_view_mut::<3, 3>(0, 3).copy_from(&(turn * lever.cross_matrix()));
                to_a.fixed_view_mut::<3, 3>(3, 3).copy_from(&-turn);
                b.covariances.map(|c| to_a * c * to_a.transpose())
            })
        };
        if points.len() < MIN_REFLECTORS {
            let of = |((reflector, _), pair): (&(usize, [Point; 2]), &Pair)| {
                let of_base = by_base(pair.before_m).map(|c| c.fixed_view::<3, 3>(0, 0).into_owned());
                let [zero, load] = [0, 1].map(|i| of_base[i] + Matrix3::from_diagonal_element(pair.sd_m[i].powi(2)));
                Displacement {
                    reflector: self.name(*reflector).to_owned(),
                    point_m: pair.before_m.into(),
                    components_m: pair.after_m - pair.before_m,
                    covariance: zero + load,
                    zero_share: zero.trace() / (zero + load).trace(),
                }
            };
            return Ok((Deflection::Points(points.iter().zip(&pairs).map(of).collect()), None));
        }
        let line = points[0].1[1].line;
        self.require_body(line, &task.reading, &pairs.iter().map(|p| p.before_m).collect::<Vec<_>>())?;
        self.require_together(&task.reading, points, &pairs)?;
        let motion = Motion::fit(&pairs);
        let undetermined = || self.fail(line, "the platform's reflectors determine no motion".into());
        let covariances = motion.covariances(&pairs).ok_or_else(undetermined)?;
        let of_base = by_base(Vector3::zeros());
        let [zero, load] = [0, 1].map(|i| covariances[i] + of_base[i]);
        let all = zero + load;
        let share = (0..6).map(|c| zero[(c, c)] / all[(c, c)]).sum::<f64>() / 6.0;
        let misfit = pairs.iter().map(|p| (p.after_m - motion.of(&p.before_m)).norm_squared() / p.variance()).sum();
        Ok((Deflection::Whole(motion.components(), Box::new(all), share), Some((misfit, 3 * pairs.len() - 6))))
    }
}

/// A place in B, to be told from others.
fn place_bits(sighting: &Sighting) -> Option<[u64; 3]> {
    match sighting.place {
        Place::Known(at_m) => Some([at_m.x, at_m.y, at_m.z].map(f64::to_bits)),
        Place::Carried { .. } => None,
    }
}

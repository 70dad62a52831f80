//! Where the fit begins: the measuring frame, targets and balls by the declared machine; and whether the readings are what they
//! are taken for.

use nalgebra::{Matrix4, Rotation3, Vector3, Vector4};
use pkm_core::Pose;

use super::model::{Experiment, Model, Placed, Start};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::files::unloaded::{AT_COLUMNS, DISTANCE_COLUMN, Unloaded, UnloadedReading};
use crate::pose::file_units;
use crate::tracker::registration::{Place, Sighting, register};
use crate::tracker::rigid::Motion;

/// Least different poses: their numbers are then more than the unknowns.
const MIN_POSES: usize = 12;
/// Least extent of commanded poses in θ and σ, °, and in Z0, mm: below it sizes can't be told from zeros.
const MIN_EXTENT: [f64; 3] = [2.0, 2.0, 5.0];
/// Least ratio of extents, measured over commanded, either way, that is a matter of units.
const OTHER_UNIT: f64 = 5.0;
/// Misfit of the declared machine, in declared standard deviations of a length, from which the readings are doubted.
const DOUBTFUL_SD: f64 = 3.0;
/// The same from which they are refused.
const REFUSED_SD: f64 = 30.0;
/// What another way to read them must leave of the misfit at most.
const MAX_MISFIT_RATIO: f64 = 0.25;
/// Of a point where no deviation is declared, m: what a tracker has.
const USUAL_SD_M: f64 = 1e-5;

fn fail(unloaded: &Unloaded, message: String) -> Failure {
    Failure::input(message).in_file(&unloaded.source.name)
}

/// Where the declared machine takes its parts at the commands of readings.
fn placed(file: &MachineFile, unloaded: &Unloaded) -> Option<Vec<Placed>> {
    let nowhere = Start {
        frame: Motion { rotation: Rotation3::identity(), translation_m: Vector3::zeros() },
        targets_m: vec![Vector3::zeros(); unloaded.targets.len()],
        balls_m: vec![Vector3::zeros(); unloaded.balls.len()],
    };
    let model = Model::new(file, unloaded, nowhere)?;
    Experiment::new(&model, unloaded)?.placed(&model.values(&[], &[]))
}

/// Measured places as the tracker's registration takes them, and the number of targets without a place.
fn sightings(unloaded: &Unloaded, placed: &[Placed]) -> (Vec<Sighting>, usize) {
    let mut unknown = vec![None; unloaded.targets.len()];
    let mut count = 0;
    for (_, unknown) in unloaded.targets.iter().zip(&mut unknown).filter(|(t, _)| t.at_m.is_none()) {
        *unknown = Some(count);
        count += 1;
    }
    let sighting = |r: &UnloadedReading| {
        let [Some(x), Some(y), Some(z), _] = r.observed else { return None };
        let sight = unloaded.sights[r.sight];
        let there = &placed[sight.pose];
        let place = match (unloaded.targets[sight.target].at_m, unknown[sight.target]) {
            (Some(at), _) => Place::Known(there.point_m(&at.into(), 0.0)),
            (None, reflector) => {
                let (a_m, axes) = there.platform();
                Place::Carried { a_m, axes, reflector: reflector? }
            }
        };
        Some(Sighting { place, measured_m: Vector3::new(x, y, z), sd_m: r.sigma_m.unwrap_or(USUAL_SD_M) })
    };
    (unloaded.readings.iter().filter_map(sighting).collect(), count)
}

/// Refuses poses that can't tell sizes from zeros.
fn check_poses(unloaded: &Unloaded) -> Result<()> {
    let count = unloaded.poses.len();
    if count < MIN_POSES {
        let message = format!(
            "{count} poses cannot determine the geometry: at least {MIN_POSES} different ones are needed, 60 spread over the \
             whole travel are good"
        );
        return Err(fail(unloaded, message));
    }
    let all: Vec<[f64; 3]> = unloaded.poses.iter().map(|p| file_units(&p.named.pose)).collect();
    for (i, (name, unit)) in [("θ", "°"), ("σ", "°"), ("Z0", "mm")].into_iter().enumerate() {
        let (low, high) = all.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[i]), h.max(p[i])));
        if high - low < MIN_EXTENT[i] {
            let message = format!(
                "the commanded poses are nearly alike: {name} goes from {low:.3} to {high:.3} {unit}, at least {} {unit} are needed, \
                 better the whole travel: is it in {}?",
                MIN_EXTENT[i],
                if i == 2 { "mm" } else { "degrees" }
            );
            return Err(fail(unloaded, message));
        }
    }
    Ok(())
}

/// Root mean square distance of points from their mean.
fn extent(points: impl Iterator<Item = Vector3<f64>> + Clone) -> f64 {
    let n = points.clone().count().max(1) as f64;
    let mean = points.clone().sum::<Vector3<f64>>() / n;
    (points.map(|p| (p - mean).norm_squared()).sum::<f64>() / n).sqrt()
}

/// Refuses places that are in another unit than the commands.
fn check_unit(unloaded: &Unloaded, sightings: &[Sighting]) -> Result<()> {
    let at = |s: &Sighting| match s.place {
        Place::Known(at) => at,
        Place::Carried { a_m, .. } => a_m,
    };
    let (said, read) = (extent(sightings.iter().map(at)), extent(sightings.iter().map(|s| s.measured_m)));
    if said > OTHER_UNIT * read || read > OTHER_UNIT * said {
        let message = format!(
            "the measured places are spread over {:.4} mm, the commanded ones over {:.4} mm: are x_mm, y_mm, z_mm in mm?",
            1e3 * read,
            1e3 * said
        );
        return Err(fail(unloaded, message).at_column(AT_COLUMNS[0]));
    }
    Ok(())
}

/// Root mean square misfit after registration, m.
fn misfit_m(sightings: &[Sighting], unknown: usize) -> Option<f64> {
    register(sightings, unknown).map(|(registration, _)| registration.rms_m)
}

/// The same commands with θ and σ swapped.
fn swapped(file: &MachineFile, unloaded: &Unloaded) -> Option<Unloaded> {
    let (mut other, free) = (unloaded.clone(), file.without_travel()?);
    for p in &mut other.poses {
        let pose = p.named.pose;
        p.named.pose = Pose { theta_rad: pose.sigma_rad, sigma_rad: pose.theta_rad, ..pose };
        p.lengths = free.inverse(&p.named.pose).ok()?;
    }
    Some(other)
}

/// Refuses readings that another way to take them explains much better, or that no machine like the declared one gives.
fn check_meaning(
    file: &MachineFile,
    unloaded: &Unloaded,
    sightings: &[Sighting],
    unknown: usize,
    rms_m: f64,
) -> Result<()> {
    let sd_m = file.uncertainty.geometry_m;
    if rms_m < DOUBTFUL_SD * sd_m {
        return Ok(());
    }
    let off =
        format!("the measured places are {:.1} mm (rms) from those that the declared machine goes to", 1e3 * rms_m);
    let better = |rms: Option<f64>| rms.is_some_and(|rms| rms < MAX_MISFIT_RATIO * rms_m);
    let mirrored: Vec<Sighting> = (sightings.iter())
        .map(|s| Sighting { measured_m: Vector3::new(-s.measured_m.x, s.measured_m.y, s.measured_m.z), ..*s })
        .collect();
    if better(misfit_m(&mirrored, unknown)) {
        let message = format!(
            "{off}, and agree with their mirror image: two of the columns x_mm, y_mm, z_mm are swapped, or one of them, θ or σ has \
             the wrong sign"
        );
        return Err(fail(unloaded, message).at_column(AT_COLUMNS[0]));
    }
    let turned = swapped(file, unloaded).and_then(|other| {
        let (sightings, unknown) = self::sightings(&other, &placed(file, &other)?);
        misfit_m(&sightings, unknown)
    });
    if better(turned) {
        let message =
            format!("{off}, and agree much better if θ and σ are swapped, or the platform's frame is turned by 90°");
        return Err(fail(unloaded, message).at_column("theta_deg"));
    }
    if rms_m > REFUSED_SD * sd_m {
        let message = format!(
            "{off}: is --machine the machine that was measured, and are places of targets and commanded poses in its axes, no \
             two targets exchanged, and no angle in another unit? A machine that is so far from its declaration needs a larger uncertainty.geometry_mm"
        );
        return Err(fail(unloaded, message));
    }
    Ok(())
}

/// A ball's place in B from distances to known points: |p − c|² = d² is linear in c and |c|².
fn ball_m(unloaded: &Unloaded, placed: &[Placed], targets_m: &[Vector3<f64>], ball: usize) -> Option<Vector3<f64>> {
    let (mut square, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for r in &unloaded.readings {
        let sight = unloaded.sights[r.sight];
        let Some(d) = r.observed[3].filter(|_| sight.ball == Some(ball)) else { continue };
        let p = placed[sight.pose].point_m(&targets_m[sight.target], 0.0);
        let row = Vector4::new(2.0 * p.x, 2.0 * p.y, 2.0 * p.z, -1.0);
        square += row * row.transpose();
        right += row * (p.norm_squared() - d * d);
    }
    let found = square.try_inverse()? * right;
    Some(found.xyz()).filter(|c| c.iter().all(|v| v.is_finite()))
}

/// Where the fit begins.
///
/// # Errors
/// Poses that are too few or alike, places in another unit, mirrored or far from what the machine goes to; points that do not
/// determine the measuring frame or a ball.
pub fn start(file: &MachineFile, unloaded: &Unloaded) -> Result<Start> {
    check_poses(unloaded)?;
    let placed =
        placed(file, unloaded).ok_or_else(|| fail(unloaded, "the declared machine has no such posture".into()))?;
    let (sightings, unknown) = sightings(unloaded, &placed);
    let mut frame = Motion { rotation: Rotation3::identity(), translation_m: Vector3::zeros() };
    let mut targets_m: Vec<Vector3<f64>> =
        unloaded.targets.iter().map(|t| t.at_m.map_or(Vector3::zeros(), Vector3::from)).collect();
    if !sightings.is_empty() {
        check_unit(unloaded, &sightings)?;
        let (registration, found) = register(&sightings, unknown).ok_or_else(|| {
            let message =
                "the places do not tell where the measuring frame stands: measure poses that differ in θ, σ and Z0";
            fail(unloaded, message.into()).at_column(AT_COLUMNS[0])
        })?;
        check_meaning(file, unloaded, &sightings, unknown, registration.rms_m)?;
        frame = registration.motion;
        let open = (unloaded.targets.iter().zip(&mut targets_m)).filter(|(t, _)| t.at_m.is_none());
        open.zip(found).for_each(|((_, at), found)| *at = found);
    }
    let ball = |ball| {
        ball_m(unloaded, &placed, &targets_m, ball).ok_or_else(|| {
            let message =
                format!("the distances to ball `{}` do not tell where it is: give the places of the targets, and measure more poses", unloaded.balls[ball]);
            fail(unloaded, message).at_column(DISTANCE_COLUMN)
        })
    };
    let balls_m = (0..unloaded.balls.len()).map(ball).collect::<Result<Vec<_>>>()?;
    Ok(Start { frame, targets_m, balls_m })
}

/// Held-out readings with the targets and balls of the others.
///
/// # Errors
/// Other targets, other balls, another kind of readings.
pub fn matched(unloaded: &Unloaded, held_out: &Unloaded) -> Result<Unloaded> {
    let need = |what: String| Err(fail(held_out, format!("held-out readings need {what} as {}", unloaded.source.name)));
    if held_out.has_wrist() != unloaded.has_wrist() {
        return need("the same columns of the wrist".into());
    }
    let has_places = |u: &Unloaded| u.sights.iter().any(|s| s.ball.is_none());
    if has_places(held_out) && !has_places(unloaded) {
        return need("distances".into());
    }
    let mut other = held_out.clone();
    for sight in &mut other.sights {
        let own = &held_out.targets[sight.target];
        let Some(target) = unloaded.targets.iter().position(|t| (&t.name, t.at_m) == (&own.name, own.at_m)) else {
            return need(format!("the target `{}` at the same place", own.name));
        };
        sight.target = target;
        if let Some(ball) = &mut sight.ball {
            let own = &held_out.balls[*ball];
            let Some(there) = unloaded.balls.iter().position(|b| b == own) else {
                return need(format!("the ball `{own}`"));
            };
            *ball = there;
        }
    }
    (other.targets, other.balls) = (unloaded.targets.clone(), unloaded.balls.clone());
    Ok(other)
}

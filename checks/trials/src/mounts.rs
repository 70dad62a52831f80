//! What the mechanism stands on and what it carries where these do not yield in proportion: a tool's holder that rocks on its seat or is
//! drawn out of it, a foot of the base that lifts.

use nalgebra::{Matrix3, Vector3, Vector6};

use crate::effects::Effect;
use crate::machine::Pose;

/// What a mount with an opening contact gives under the sum `s` of the load that it carries: more where it opens, nothing unloaded.
fn opened(c: f64, s: f64, s0: f64) -> f64 {
    0.5 * c * (s + (s * s + s0 * s0).sqrt() - s0)
}

/// The same where it opens to both sides.
fn rocked(c: f64, s: f64, s0: f64) -> f64 {
    c * (s - s0 * (s / s0).atan())
}

/// Displacement of A under a wrench at A, both in A-uvw, beyond what the holder was declared to yield.
pub fn of_holder(e: &Effect, w: &Vector6<f64>) -> Vector6<f64> {
    let mut seen = Vector6::zeros();
    if e.variant == 0 {
        // about an axis across the tool, on a seat before A
        let about = Vector3::new(e.shape[0], e.shape[1], 0.0).normalize();
        let seat = Vector3::z() * (0.10 * e.share(2));
        seen.fixed_rows_mut::<3>(0).copy_from(&-about.cross(&seat));
        seen.fixed_rows_mut::<3>(3).copy_from(&about);
        seen * rocked(16.0 * e.amplitude * 1e-9, seen.dot(w), 25.0 * e.share(3))
    } else {
        seen[2] = e.sign(0);
        seen * opened(e.amplitude * 1e-9, seen.dot(w), 120.0 * e.share(3))
    }
}

/// The same of the base, on three feet about B of which one lifts.
pub fn of_foot(e: &Effect, pose: &Pose, w: &Vector6<f64>) -> Vector6<f64> {
    let feet = [(0.45, -0.4), (0.45, 0.4), (-0.35, 0.0)].map(|(x, y)| (x * e.share(0), y * e.share(1)));
    // three feet carry what presses on the base along z and tilts it about x and y
    let carried =
        Matrix3::from_fn(|i, k| [1.0, feet[k].1, -feet[k].0][i]).try_inverse().expect("feet are not in a row");
    let foot = crate::forms::limb(e);
    let at_b = Vector6::new(0.0, 0.0, carried[(foot, 0)], carried[(foot, 1)], carried[(foot, 2)], 0.0);
    let (shift, turn) = (Vector3::new(0.0, 0.0, at_b[2]), Vector3::new(at_b[3], at_b[4], 0.0));
    let back = pose.rotation().transpose();
    let (moved, turned) = (back * (shift + turn.cross(&pose.origin())), back * turn);
    let seen = Vector6::new(moved.x, moved.y, moved.z, turned.x, turned.y, turned.z);
    seen * opened(e.amplitude * 1e-9, seen.dot(w), 120.0 * e.share(3))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Random;
    use crate::effects::find;

    #[test]
    fn one_foot_carries_what_presses_above_it_and_nothing_of_what_presses_above_another() {
        let mut e = Effect::random(&find("foot-that-lifts").unwrap(), &mut Random::new(1));
        e.shape = [0.0; 8];
        let own = crate::forms::limb(&e);
        let feet = [(0.45, -0.4), (0.45, 0.4), (-0.35, 0.0)];
        let pose = Pose([0.0, 0.0, 0.5]);
        for (k, (x, y)) in feet.into_iter().enumerate() {
            // a pull along z at the foot's place, as a wrench at A above B
            let w = Vector6::new(0.0, 0.0, 1000.0, y * 1000.0, -x * 1000.0, 0.0);
            let d = of_foot(&e, &pose, &w);
            assert_eq!(d.norm() > 1e-9, k == own, "{d}");
            // it lifts where it is, and turns about the other two
            if k == own {
                let lifted = d[2] + d[3] * y - d[4] * x;
                assert!((lifted / opened(e.amplitude * 1e-9, 1000.0, 120.0) - 1.0).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_holder_gives_more_where_it_opens() {
        let mut e = Effect::random(&find("loose-tool-holder").unwrap(), &mut Random::new(2));
        e.shape = [0.5; 8];
        let pull = Vector6::z() * 800.0;
        e.variant = 1;
        assert!(of_holder(&e, &pull).norm() > 5.0 * of_holder(&e, &-pull).norm());
        e.variant = 0;
        let side = Vector6::new(500.0, -300.0, 0.0, 0.0, 0.0, 0.0);
        let [one, two, back] = [1.0, 2.0, -1.0].map(|share| of_holder(&e, &(side * share)));
        assert!(two.norm() > 2.5 * one.norm() && (one + back).norm() < 1e-12);
    }
}

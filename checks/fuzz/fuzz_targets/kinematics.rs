//! Inverse and forward kinematics of any machine, in both arithmetics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_core::{Machine, MachineParameters, Pose, Scalar, ScrewLengths};
use pkm_fuzz::{Numbers, Rounded, assert_finite};

/// Whether the stated accuracy holds: sizes of one order, and a posture away from the singularities.
fn is_ordinary<T: Scalar>(machine: &Machine<T>, p: &MachineParameters, pose: &Pose<T>) -> bool {
    let g = p.geometry;
    let sizes = [g.a1_m, g.a2_m, g.b1_m, g.b2_m];
    let l = (pose.z0_m / pose.theta_rad.cos()).to_f64();
    sizes.iter().all(|size| (0.05..20.0).contains(&(size / l)))
        && machine.singularity_distance(pose).is_ok_and(|d| d.limbs_1_2.to_f64() >= 0.05 && d.limb_3.to_f64() >= 0.05)
}

fn walk<T: Scalar>(machine: &Machine<T>, p: &MachineParameters, pose: Pose<T>, lengths: ScrewLengths<T>) {
    if let Ok(there) = machine.inverse(&pose) {
        assert_finite(there.q_m.iter().copied());
        assert_finite(machine.jacobian(&pose).expect("the pose has a posture").iter().copied());
        let distance = machine.singularity_distance(&pose).expect("the pose has a posture");
        assert_finite([
            distance.limbs_1_2,
            distance.limb_3,
            machine.travel_margin_m(&there).expect("finite lengths").0,
        ]);
        if is_ordinary(machine, p, &pose) {
            let back = machine.forward(&there).expect("lengths of a pose");
            let l = pose.z0_m / pose.theta_rad.cos();
            let off = [back.theta_rad - pose.theta_rad, back.sigma_rad - pose.sigma_rad, (back.z0_m - pose.z0_m) / l];
            let tolerance = 1e4 * T::EPSILON.to_f64();
            assert!(off.iter().all(|d| d.to_f64().abs() <= tolerance), "{pose:?} {back:?}");
        }
    }
    if let Ok(pose) = machine.forward(&lengths) {
        assert_finite([pose.theta_rad, pose.sigma_rad, pose.z0_m]);
        if is_ordinary(machine, p, &pose) {
            let back = machine.inverse(&pose).expect("a pose of lengths");
            let tolerance = 1e4 * T::EPSILON.to_f64();
            for (q, back) in lengths.q_m.iter().zip(&back.q_m) {
                assert!((*q - *back).to_f64().abs() <= tolerance * q.to_f64(), "{lengths:?} {back:?}");
            }
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut numbers = Numbers(bytes);
    let parameters = numbers.machine();
    let (pose, q_m) = (numbers.pose(), numbers.numbers([0.57, 0.55, 0.52]));
    if let Ok(machine) = Machine::<f64>::new(&parameters) {
        walk(&machine, &parameters, pose, ScrewLengths { q_m: q_m.into() });
    }
    if let Ok(machine) = Machine::<f32>::new(&parameters) {
        walk(&machine, &parameters, pose.rounded(), ScrewLengths { q_m: q_m.rounded().into() });
    }
});

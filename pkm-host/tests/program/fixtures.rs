//! The machines of `fixtures/` against published facts.

use std::path::Path;

use pkm_core::machine::Joint;
use pkm_core::tables::reference;
use pkm_core::{CorrectionTable, Domain, Machine, Pose, Scalar};
use pkm_host::files::dataset::read_poses;
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::pose::NamedPose;

fn fixture(path: &str) -> Source {
    Source::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures").join(path)).unwrap()
}

fn machine(name: &str) -> MachineFile {
    MachineFile::parse(fixture(&format!("machines/{name}"))).unwrap()
}

#[test]
fn x150_reaches_its_published_check_points() {
    let x150 = machine("x150.toml").machine;
    // L = 259.5 mm upright; the tool 90.5 mm beyond A at (100, 330) mm
    let tilt = (100.0_f64 / 330.0).atan();
    let l = 100.0_f64.hypot(330.0) - 90.5;
    for (theta_rad, l_mm, expected_mm) in [(0.0, 259.5, [259.5, 259.5, 276.0]), (tilt, l, [254.319, 254.319, 219.757])]
    {
        let pose = Pose { theta_rad, sigma_rad: 0.0, z0_m: l_mm / 1e3 * theta_rad.cos() };
        let q_mm = x150.inverse(&pose).unwrap().q_m.map(|q| q * 1e3);
        for i in 0..3 {
            let digits = if theta_rad == 0.0 { 0.05 } else { 0.0005 };
            assert!((q_mm[i] - expected_mm[i]).abs() <= digits, "{q_mm:?} instead of {expected_mm:?}");
        }
    }
}

#[test]
fn boxes_lie_within_travel() {
    for name in ["reference.toml", "x150.toml"] {
        let file = machine(name);
        let [theta, sigma, z0] = file.pose_box.ranges();
        for corner in 0..8 {
            let pick = |range: [f64; 2], bit: usize| range[corner >> bit & 1];
            let pose = pkm_host::pose::pose_of(pick(theta, 0), pick(sigma, 1), pick(z0, 2));
            assert!(file.machine.inverse(&pose).is_ok(), "{name}: {pose:?}");
        }
    }
}

#[test]
fn the_core_reports_table_5_outside_the_box() {
    fn check<T: Scalar>(machine: &Machine<T>, table: &CorrectionTable<'_, T>, pose: &Pose<f64>) {
        let pose = Pose {
            theta_rad: T::from_f64(pose.theta_rad),
            sigma_rad: T::from_f64(pose.sigma_rad),
            z0_m: T::from_f64(pose.z0_m),
        };
        assert_eq!(table.domain(&pose), Domain::Outside);
        let corrected = table.diagonal_form(machine, &pose).unwrap();
        assert_eq!(corrected.domain, Domain::Outside, "the value must carry the status");
    }
    let (poses, _) = read_poses(fixture("poses/table5.csv"), &machine("reference.toml")).unwrap();
    assert_eq!(poses.len(), 7);
    for NamedPose { pose, .. } in &poses {
        check(&reference::MACHINE_F64, &reference::TABLE_F64, pose);
        check(&reference::MACHINE_F32, &reference::TABLE_F32, pose);
    }
}

/// Eq. 1 counts one freedom; the rank of what the limbs transmit says three.
#[test]
fn mobility_is_one_by_formula_and_three_by_rank() {
    let file = machine("reference.toml");
    // two platforms, two bodies a limb; two joints and a screw a limb; what a joint releases has stiffness 0
    let (bodies, joints) = (2 + 2 * 3, 3 * 3);
    let released = |joint: &Joint| joint.angular_nm_per_rad.iter().filter(|k| **k == 0.0).count() as i32;
    let freedoms: i32 =
        file.parameters.limbs.iter().map(|l| released(&l.base_joint) + 1 + released(&l.platform_joint)).sum();
    assert_eq!(6 * (bodies - joints - 1) + freedoms, 1);

    // Wrenches that a limb with a free screw transmits are reciprocal to the twists of all its joints.
    let pose = pkm_host::pose::pose_of(7.0, -4.0, 530.0);
    let (locked, free) =
        (pkm_tests::transmitted(&file.parameters, &pose, true), pkm_tests::transmitted(&file.parameters, &pose, false));
    let rank = |m: &nalgebra::DMatrix<f64>| m.rank(1e-9);
    // with the screws held: 8 wrenches, 6 independent; with the screws free 5 remain, of which 3 are independent
    assert_eq!((locked.ncols(), rank(&locked)), (8, 6));
    assert_eq!((free.ncols(), rank(&free)), (5, 3));
    assert_eq!(6 - rank(&free), 3);
}

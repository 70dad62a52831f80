//! CSV files: poses, stiffness, measured readings, tool paths. Every reader gets every file.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pkm_files::dataset::{read_poses, read_stiffness};
use pkm_files::machine::MachineFile;
use pkm_files::path::Load;
use pkm_files::pose::NamedPose;
use pkm_files::readings::Readings;
use pkm_files::source::Source;
use pkm_files::tool_path;
use pkm_fuzz::{assert_finite, file, read};

static MACHINE: LazyLock<MachineFile> =
    LazyLock::new(|| MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).expect("the reference machine"));

/// The machine takes what was read.
fn assert_possible(poses: &[NamedPose]) {
    for NamedPose { pose, .. } in poses {
        assert!(MACHINE.machine.inverse(pose).is_ok());
    }
}

fuzz_target!(|bytes: &[u8]| {
    let source = file(bytes);
    if let Some((poses, _)) = read(read_poses(source.clone(), &MACHINE)) {
        assert_possible(&poses);
    }
    if let Some(data) = read(read_stiffness(source.clone(), &MACHINE)) {
        assert_possible(&data.poses);
        assert_eq!(data.poses.len(), data.targets.len());
        for target in &data.targets {
            assert!(target.principal.iter().all(|k| *k > 0.0));
            assert!(target.full.is_none_or(|k| k.factor().is_ok()));
        }
    }
    if let Some(readings) = read(Readings::read(source.clone(), &MACHINE)) {
        assert_possible(&readings.poses);
        for condition in &readings.conditions {
            assert_finite(condition.wrench.to_vector().iter().copied());
            assert_finite(condition.point_m.into_iter().chain([condition.temperature_c, condition.rise_k]));
        }
        for reading in &readings.readings {
            assert_finite(reading.observed.into_iter().chain(reading.sigma).flatten());
        }
    }
    if let Some((_, moves)) = read(tool_path::read_csv(source)) {
        for to in moves {
            assert_finite(to.to.tip_m);
            if let Load::Given(wrenches) = to.load {
                assert_finite(wrenches[1].to_vector().iter().copied());
            }
        }
    }
});

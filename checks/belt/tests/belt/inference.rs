//! What is found in simulated readings, where the truth is known.

use std::path::Path;

use pkm_belt::diagnosis::{Diagnosis, DiagnosisError, diagnose};
use pkm_belt::files::{Published, parse_runs, parse_tension};
use pkm_belt::model::{COMMON_SCALE, amplitude};
use pkm_belt::report;
use pkm_belt::study::{Study, named};

use crate::simulated::{Truth, runs, tension};

fn diagnosed(truth: &Truth, seed: u64) -> Diagnosis {
    // a file has two runs at least
    diagnose(&parse_runs(&runs(truth, 2, seed)).unwrap()[0]).unwrap()
}

fn names(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.inferred.findings.iter().filter_map(named).collect()
}

#[test]
fn nothing_is_found_in_belts_that_do_not_stretch() {
    for seed in 0..10 {
        let diagnosis = diagnosed(&Truth::STIFF, seed);
        assert!(diagnosis.inferred.findings.is_empty(), "seed {seed}: {:?}", diagnosis.inferred.findings);
        assert!((0.4e-3..1.2e-3).contains(&diagnosis.after.between_visits_m));
    }
}

/// 0.2 % under the pull, and a little more in the upper belts that carry the sled too.
const ELASTIC: Truth = Truth { stiffness: 100e3, ..Truth::STIFF };

#[test]
fn stretch_under_the_pull_is_named_and_measured() {
    let (mut right, mut off, mut wrong) = (0, Vec::new(), Vec::new());
    for seed in 100..120 {
        let diagnosis = diagnosed(&ELASTIC, seed);
        for name in names(&diagnosis) {
            if name == "lower belts" { right += 1 } else { wrong.push((seed, name.to_owned())) }
        }
        if let Some((value, error)) = diagnosis.after.value(&diagnosis.model, amplitude(0)) {
            off.push((value - 2e-3) / error);
        }
    }
    println!("{right} of 20 named rightly, wrongly: {wrong:?}; errors over standard errors {off:.1?}");
    assert!(right >= 18, "{right}");
    assert!(wrong.len() <= 1, "{wrong:?}");
    assert!(off.iter().all(|o| o.abs() < 4.0), "{off:?}");
}

#[test]
fn one_encoder_that_errs_is_named() {
    let diagnosis = diagnosed(&Truth { scale: [1.0, 1.006, 1.0, 1.0], ..Truth::STIFF }, 40);
    assert_eq!(names(&diagnosis), ["encoder of belt br"]);
}

/// A factor on all lengths scales the anchors and nothing else.
#[test]
fn a_common_scale_is_neither_found_nor_identifiable() {
    let diagnosis = diagnosed(&Truth { scale: [1.01; 4], ..Truth::STIFF }, 41);
    assert!(diagnosis.inferred.findings.is_empty(), "{:?}", diagnosis.inferred.findings);
    assert!(!diagnosis.identifiable[COMMON_SCALE]);
    assert!(diagnosis.identifiable[0]);
    assert!(diagnosis.common_scale_left < 1e-3, "{}", diagnosis.common_scale_left);
}

#[test]
fn a_study_predicts_other_runs_and_the_tension_test() {
    let published = Published {
        runs: parse_runs(&runs(&ELASTIC, 3, 50)).unwrap(),
        runs_path: "runs".into(),
        tension: parse_tension(&tension(&ELASTIC)).unwrap(),
        tension_path: "tension".into(),
    };
    let study = Study::new(&published).unwrap();
    let [before, after] = study.median_rms_m();
    assert!(after < 0.7 * before, "{before} {after}");
    // the sled of the simulation follows without friction
    for (read, [low, high]) in study.tension[0].read_m.iter().zip(study.tension[0].interval_m) {
        assert!((low..high).contains(read), "{:?}", study.tension[0]);
    }
    let off = study.tension[0].free_m[0] - study.tension[0].read_m[0];
    assert!(off.abs() < 1e-3, "{:?}", study.tension[0]);
    assert_eq!(study.tension[1].free_m, [0.0, 0.0]);
    let json = report::json(&study);
    assert_eq!(json["runs"].as_array().unwrap().len(), 3);
    assert_eq!(json["together"]["findings"][0]["named"], "lower belts");
    assert_eq!(json["together"]["common_scale_identifiable"], false);
    let text = report::text(&study);
    assert!(text.contains("All runs together:\n  named: lower belts"), "{text}");
    assert!(pkm_belt::picture::svg(&study).unwrap().contains("<title>"));
}

#[test]
fn lengths_of_no_place_are_refused_with_their_line() {
    let text = runs(&Truth::STIFF, 2, 60);
    let mut read = parse_runs(&text).unwrap();
    // upper belts too short to reach one another
    for r in &mut read[0].points[3] {
        r.at_m[2] = 0.5;
        r.at_m[3] = 0.5;
    }
    match diagnose(&read[0]) {
        Err(e @ DiagnosisError::NoPlace(_)) => {
            let line = read[0].points[3][0].line;
            let message = e.at(Path::new("runs.txt")).to_string();
            assert_eq!(message, format!("runs.txt:{line}: these lengths fit no place of the sled"));
        }
        other => panic!("{:?}", other.map(|d| d.after.x)),
    }
}

//! The published readings, which are no part of this project: checked where they are.

use std::io::Write;
use std::path::Path;

use pkm_belt::files;
use pkm_belt::study::{Study, TL_Y, named};

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/belt");

/// The figures of docs/measured-machine.md.
#[test]
fn the_published_readings_give_the_stated_figures() {
    let folder = Path::new(FOLDER);
    if !folder.exists() {
        // to the stream itself: what the macros print is shown for failures alone
        let message = format!("SKIPPED: the readings of BarbourSmith/Calibration-Simulation are not in {FOLDER}\n");
        std::io::stderr().write_all(message.as_bytes()).unwrap();
        return;
    }
    let published = files::read(folder).unwrap();
    assert_eq!((published.runs.len(), published.tension.len()), (10, 4));
    assert!(published.runs.iter().all(|r| r.points.len() == 25));
    let study = Study::new(&published).unwrap();

    let [before, after] = study.median_rms_m().map(|v| 1e3 * v);
    assert!((1.70..1.80).contains(&before), "{before}");
    assert!(after <= 0.78, "{after}");
    assert!(study.runs.iter().all(|r| r.after.rms_m < 0.55 * r.before.rms_m));

    let found: Vec<Option<&str>> = study.runs.iter().map(|r| named(&r.diagnosis.inferred.findings[0])).collect();
    assert_eq!(found.iter().filter(|n| **n == Some("lower belts")).count(), 8, "{found:?}");
    assert_eq!(found.iter().filter(|n| n.is_none()).count(), 2, "{found:?}");
    assert!(study.runs.iter().all(|r| r.diagnosis.inferred.findings.len() == 1));
    assert_eq!(named(&study.together.inferred.findings[0]), Some("lower belts"));
    assert!(!study.together.identifiable.last().unwrap());

    let [tool, _, found] = study.scatter_m(TL_Y).map(|v| 1e3 * v);
    assert!((17.7..17.8).contains(&tool), "{tool}");
    assert!(found <= 4.2, "{found}");

    // one by one: as good as all runs before at once, and better than the first run alone
    for (n, step) in study.steps.iter().enumerate().skip(1) {
        let [own, batch, first] = step.predicted_m.unwrap();
        assert!(own < 1.06 * batch && (n < 2 || own < first), "run {}: {own} {batch} {first}", n + 1);
        assert!((step.stretch[0] - step.stretch[1]).abs() < 1e-4, "{:?}", step.stretch);
    }

    for slack in &study.tension {
        for (read, [low, high]) in slack.read_m.iter().zip(slack.interval_m) {
            assert!((low..high).contains(read), "{slack:?}");
        }
    }
}

//! `demo`: one folder with all reports.

use std::fs;
use std::path::Path;

use crate::common::{Folder, json, refused};

#[test]
fn every_page_of_the_demonstration_is_there() {
    let folder = Folder::new();
    let document = json(&["demo", "--out", &folder.path("out")]);
    let calls = document["calls"].as_array().unwrap();
    assert_eq!(calls.len(), 9);
    let index = folder.read("out/index.html");
    for call in calls {
        let (page, command) = (call["page"].as_str().unwrap(), call["command"].as_str().unwrap());
        assert!(index.contains(&format!("href=\"{page}\"")) && index.contains(command), "{page}");
        assert!(folder.read(&format!("out/{page}")).trim_end().ends_with("</html>"), "{page}");
        for input in command.split(' ').filter(|argument| argument.starts_with("data/")) {
            assert!(fs::metadata(folder.path(&format!("out/{input}"))).is_ok(), "{input}");
        }
    }
    let reports = calls.len() - 2;
    assert_eq!(index.matches("<strong>").count(), reports, "each report, not the live pages, says what it found");
    assert_eq!(index.matches("<svg").count(), reports, "and shows its first picture");
    // the README's picture is what a reader gets
    let picture = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/finding.svg")).unwrap();
    assert!(folder.read("out/diagnosis/report.html").contains(picture.trim_end()));
}

#[test]
fn a_demonstration_has_machines_of_its_own() {
    let folder = Folder::new();
    let error = refused(&["demo", "--machine", "mine.toml", "--out", &folder.path("out")]);
    assert!(error["message"].as_str().unwrap().contains("leave --machine out"), "{error}");
    assert!(fs::metadata(folder.path("out")).is_err());
}

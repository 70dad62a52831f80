//! What all reports share: names that are none of HTML, one order, one script, nothing from elsewhere.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt;

use crate::common::{Folder, fixture, json, reference_machine};

/// Would be markup if it were not escaped, in text and in an attribute.
const NAME: &str = "<script>x&y\"</script>";
/// The same where it is a file's.
const FILE: &str = "<script>x&y\".csv";

/// A machine, and files of the fixtures, of such names.
struct Named {
    folder: Folder,
    machine: String,
}

impl Named {
    fn new() -> Self {
        let folder = Folder::new();
        let text = reference_machine();
        let line = text.lines().find(|l| l.starts_with("name = ")).expect("a name").to_owned();
        let machine = folder.write("<script>machine&\".toml", &text.replacen(&line, &format!("name = '{NAME}'"), 1));
        Self { folder, machine }
    }

    fn copy(&self, of: &str) -> String {
        self.folder.write(FILE, &fs::read_to_string(fixture(of)).unwrap())
    }

    /// Runs a command and takes its report apart.
    fn check(&self, args: &[&str], report: &str, names: &[&str]) {
        json(&[args, &["--machine", &self.machine]].concat());
        let html = self.folder.read(report);
        let escaped =
            |name: &str| name.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;");
        for name in [&[NAME, "<script>machine&\".toml"], names].concat() {
            assert!(html.contains(&escaped(name)), "{report} does not name {name}");
        }
        let script = concat!("<script>", include_str!("../../src/page/page.js"), "</script>");
        assert_eq!(html.matches(script).count(), 1, "{report} has the script of all pages, once");
        // links lead within the page
        let rest = html.replace(script, "").replace("href=\"#section-", "");
        for word in ["<script", "<link", "<img", "<iframe", "javascript:", "url(", "@import", "src=", "href="] {
            assert!(!rest.contains(word), "{report} has {word}");
        }
        for (n, link) in html.split("href=\"#").skip(1).enumerate() {
            let id = link.split('"').next().unwrap();
            assert_eq!(id, format!("section-{}", n + 1), "{report}");
            assert!(html.contains(&format!("<h2 id=\"{id}\">")), "{report}: {id} leads nowhere");
        }
        let order = [
            "<h1>",
            "<section class=\"verdict",
            "class=\"headline\"",
            "<h2 id=",
            "<svg",
            "<figcaption>",
            "Where this comes from",
        ];
        let mut from = 0;
        for part in order {
            from += html[from..].find(part).unwrap_or_else(|| panic!("{report}: {part} is not in its place"));
        }
        for words in ["How sure", "What to do"] {
            assert_eq!(html.matches(&format!("<strong>{words}: </strong>")).count(), 1, "{report}: {words}");
        }
        assert_eq!(html.matches("role=\"img\"").count(), html.matches("<svg").count(), "{report}");
        assert!(html[from..].contains(env!("CARGO_PKG_VERSION")), "{report}");
    }
}

#[test]
fn fit_escapes_names() {
    let named = Named::new();
    let (data, out) = (named.copy("stiffness/fe-l49.csv"), named.folder.path("out"));
    named.check(&["fit", "--data", &data, "--verify", &data, "--out", &out], "out/report.html", &[FILE]);
}

#[test]
fn diagnose_escapes_names() {
    let named = Named::new();
    let (data, out) = (named.copy("measured/p01/measured.csv"), named.folder.path("out"));
    named.check(&["diagnose", "--data", &data, "--holdout", &data, "--out", &out], "out/report.html", &[FILE]);
}

#[test]
fn place_escapes_names() {
    let named = Named::new();
    let job = fs::read_to_string(fixture("jobs/plate.toml")).unwrap();
    let job = job.replacen("name = \"A\"", &format!("name = '{NAME}'"), 1);
    assert!(job.contains(NAME));
    let (job, out) = (named.folder.write(FILE, &job), named.folder.path("out"));
    named.check(&["place", "--job", &job, "--step-mm", "20", "--out", &out], "out/report.html", &[FILE]);
}

#[test]
fn map_escapes_names() {
    let named = Named::new();
    let table = named.folder.write(FILE, &fs::read_to_string(fixture("jobs/wide-table.json")).unwrap());
    let out = named.folder.path("out");
    named.check(&["map", "--table", &table, "--out", &out], "out/report.html", &[FILE]);
    let first = named.folder.read("out/report.html");
    assert_eq!(first.matches("over X0 and Z0").count(), 6, "all maps");
    let values: Vec<&str> = first.split("data-values=\"").skip(1).map(|v| v.split('"').next().unwrap()).collect();
    assert_eq!(values.len(), 6, "values of all maps");
    assert!(
        values.iter().all(|v| v.contains("* ") && v.contains("- ")),
        "values that are extrapolated, and places without any"
    );
    assert_eq!(first.matches("holds</td>").count() + first.matches("does not</td>").count(), 14, "all statements");
    named.check(&["map", "--table", &table, "--out", &out], "out/report.html", &[FILE]);
    assert!(first == named.folder.read("out/report.html"), "the same bytes again");
}

#[test]
fn compensate_escapes_names() {
    let named = Named::new();
    let (path, out) = (named.copy("jobs/path.csv"), named.folder.path("out/p.csv"));
    named.check(&["compensate", "--path", &path, "--out", &out], "out/report.html", &[FILE]);
}

#[test]
fn date_is_written_where_it_is_asked_for() {
    let folder = Folder::new();
    let (path, out) = (fixture("jobs/path.csv"), folder.path("p.csv"));
    let call = ["compensate", "--path", &path, "--out", &out];
    json(&call);
    let plain = folder.read("report.html");
    json(&[&call[..], &["--date"]].concat());
    let dated = folder.read("report.html");
    let (before, rest) = dated.split_once("<dt>Made</dt><dd>").expect("a date");
    let (date, after) = rest.split_once(" UTC</dd>").expect("its end");
    assert!(date.len() == "2026-01-01 00:00".len() && date.starts_with("20"), "{date}");
    assert!(before.to_owned() + after == plain, "nothing else differs");
}

#[test]
fn fem_escapes_names() {
    let named = Named::new();
    let id = NAME.replace('"', "\"\"");
    let poses = named.folder.write(FILE, &format!("pose,theta_deg,sigma_deg,z0_mm\n\"{id}\",0,0,530\n"));
    let out = named.folder.path("k.csv");
    let call = ["fem", "--poses", &poses, "--out", &out, "--mesh", "3"];
    named.check(&[&call[..], &["--dry-run"]].concat(), "k.drawing.html", &[FILE]);
    // a stand-in that prints a compliance of the right order
    let units = ["1e-8 0 0", "0 0 0", "0 1e-8 0", "0 0 0", "0 0 1e-8", "0 0 0"].into_iter();
    let turns = ["0 0 0", "1e-6 0 0", "0 0 0", "0 1e-6 0", "0 0 0", "0 0 1e-6"];
    let printed: String = units.chain(turns).map(|c| format!("  17 {c}\n")).collect();
    let script = format!(
        "#!/bin/sh\nif [ \"$1\" = -v ]; then echo 'This is Version 0.0'; exit; fi\ncat >case.dat <<END\n{printed}END\n"
    );
    let ccx = named.folder.write("ccx", &script);
    fs::set_permissions(&ccx, fs::Permissions::from_mode(0o755)).unwrap();
    named.check(&[&call[..], &["--ccx", &ccx]].concat(), "k.html", &[FILE]);
}

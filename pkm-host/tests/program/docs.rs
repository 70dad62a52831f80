//! The documents stay true: links lead somewhere, commands run and print what is shown, named code exists.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// Every Markdown file of the repository.
fn documents(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() && !name.starts_with('.') && !["target", "out"].contains(&name) {
            documents(&path, found);
        } else if name.ends_with(".md") {
            found.push(path);
        }
    }
}

/// Prose with blank lines in place of fenced blocks, and the blocks: the word behind the fence, the line it stands in, the text.
fn split(text: &str) -> (String, Vec<(String, usize, String)>) {
    let (mut prose, mut blocks, mut inside) = (String::new(), Vec::<(String, usize, String)>::new(), false);
    for (n, line) in text.lines().enumerate() {
        if let Some(kind) = line.trim_start().strip_prefix("```") {
            if !inside {
                blocks.push((kind.to_owned(), n + 1, String::new()));
            }
            inside = !inside;
        } else if inside {
            blocks.last_mut().unwrap().2 += &format!("{line}\n");
        } else {
            prose += line;
        }
        prose.push('\n');
    }
    (prose, blocks)
}

/// Targets of the links in a text.
fn links(text: &str) -> impl Iterator<Item = &str> {
    text.split("](").skip(1).filter_map(|rest| rest.split_once(')').map(|(target, _)| target))
}

/// What a heading is called in a link, as forges have it.
fn anchors(text: &str) -> BTreeSet<String> {
    let plain = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let slug = |heading: &str| heading.to_lowercase().chars().filter(plain).collect::<String>().replace(' ', "-");
    let prose = split(text).0;
    prose.lines().filter(|l| l.starts_with('#')).map(|l| slug(l.trim_start_matches('#').trim())).collect()
}

#[test]
fn every_link_leads_somewhere() {
    let mut files = Vec::new();
    documents(&root(), &mut files);
    let mut broken = Vec::new();
    for file in &files {
        let text = fs::read_to_string(file).unwrap();
        for link in links(&split(&text).0).filter(|l| !l.starts_with("http")) {
            let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
            let target = if path.is_empty() { file.clone() } else { file.parent().unwrap().join(path) };
            let known = || anchors(&fs::read_to_string(&target).unwrap_or_default()).contains(anchor);
            if !target.exists() || (!anchor.is_empty() && !known()) {
                broken.push(format!("{}: {link}", file.display()));
            }
        }
    }
    assert!(files.len() > 10 && broken.is_empty(), "{broken:#?}");
}

/// How lines of a `sh` block begin that are left out: other programs, and what needs them or takes minutes.
const NOT_HERE: [&str; 6] = ["cargo ", "alias ", "pkm-host demo ", "pkm-host fem ", "pkm-host hil ", "pkm-host place "];

/// What the README's commands call the engineer's own files.
const OWN_FILES: [(&str, &str); 6] = [
    ("my.toml", "machines/reference.toml"),
    ("k.csv", "stiffness/fe-l49.csv"),
    ("v.csv", "stiffness/fe-verify.csv"),
    ("readings.csv", "measured/own-moving-platform-compliance-easy/measured.csv"),
    ("others.csv", "measured/own-moving-platform-compliance-easy/heldout.csv"),
    ("part.ngc", "jobs/path.ngc"),
];

#[test]
#[cfg(unix)]
fn commands_run_and_print_what_is_shown() {
    let mut files = vec![root().join("README.md")];
    documents(&root().join("docs"), &mut files);
    files.retain(|f| f.ends_with("README.md") || f.to_str().unwrap().contains("tutorial-"));
    let program = Path::new(env!("CARGO_BIN_EXE_pkm-host")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut count = 0;
    for file in &files {
        // a repository's root as far as the commands see it
        let here = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink(root().join("fixtures"), here.path().join("fixtures")).unwrap();
        fs::create_dir(here.path().join("out")).unwrap();
        for (name, fixture) in OWN_FILES {
            fs::copy(root().join("fixtures").join(fixture), here.path().join(name)).unwrap();
        }
        // what the last commands printed, and where a block that shows it begins
        let mut printed = (0, String::new());
        for (kind, line, text) in split(&fs::read_to_string(file).unwrap()).1 {
            let place = format!("{}:{line}", file.display());
            if kind == "text" && line == printed.0 {
                for shown in text.lines() {
                    assert!(printed.1.lines().any(|l| l == shown), "{place}: not printed: {shown}\n{}", printed.1);
                }
            }
            if kind == "sh" {
                let lines = text.replace("\\\n", "");
                let here_too = lines.lines().filter(|l| !NOT_HERE.iter().any(|s| l.starts_with(s)));
                let script = format!("exec 2>&1\n{}", here_too.collect::<Vec<_>>().join("\n"));
                count += script.matches("pkm-host ").count();
                let mut shell = Command::new("sh");
                let output = shell.args(["-ec", &script]).current_dir(here.path()).env("PATH", &path).output().unwrap();
                printed = (line + text.lines().count() + 3, String::from_utf8_lossy(&output.stdout).into_owned());
                assert!(output.status.success(), "{place}: {script}\n{}", printed.1);
            }
        }
    }
    assert!(count > 20, "only {count} commands were found");
}

/// A row that links source files names, as `code`, what is defined there.
#[test]
fn code_that_the_theory_names_exists() {
    let theory = fs::read_to_string(root().join("docs/theory.md")).unwrap();
    let mut count = 0;
    for row in theory.lines().filter(|l| l.starts_with('|') && l.contains(".rs)")) {
        let files = links(row).filter(|l| l.ends_with(".rs"));
        let source: String = files.map(|f| fs::read_to_string(root().join("docs").join(f)).unwrap()).collect();
        let linked = |name: &str| row.contains(&format!("[`{name}`]"));
        for name in row.split('`').skip(1).step_by(2).filter(|name| !linked(name)) {
            let last = name.rsplit("::").next().unwrap();
            let mut begins =
                ["fn", "struct", "enum", "const", "static", "trait"].map(|kind| format!("{kind} {last}")).into_iter();
            let ends = |rest: &str| rest.starts_with([' ', '(', '<', ':', ';']);
            let defined = begins.any(|begin| source.split(&begin).skip(1).any(ends));
            assert!(defined, "theory.md: `{name}` is in none of the files of its row: {row}");
            count += 1;
        }
    }
    assert!(count > 40, "only {count} names were found");
}

/// The table of effects has every effect with its parameters, and no other.
#[test]
fn the_table_of_effects_is_the_register() {
    let theory = fs::read_to_string(root().join("docs/theory.md")).unwrap();
    let coded = |cell: &str| cell.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    let section = theory.split("\n## Effects\n").nth(1).unwrap().split("\n## ").next().unwrap();
    let rows = section.lines().filter(|l| l.starts_with("| `")).map(|l| l.split('|').collect::<Vec<_>>());
    let mut listed: Vec<_> =
        rows.flat_map(|cells| coded(cells[1]).into_iter().map(move |id| (id, coded(cells[2])))).collect();
    let own = |e: &pkm_core::effects::EffectInfo| (e.id.to_owned(), e.names().map(str::to_owned).collect::<Vec<_>>());
    let mut known: Vec<_> = pkm_core::effects::EFFECTS.iter().map(own).collect();
    listed.sort();
    known.sort();
    assert_eq!(listed, known);
}

/// Names in code font that begin the rows of a section's table.
fn first_cells(document: &str, section: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(document)).unwrap();
    let section = text.split(&format!("\n## {section}\n")).nth(1).unwrap().split("\n## ").next().unwrap();
    let cells = section.lines().filter_map(|line| line.strip_prefix("| `")?.split(" |").next());
    cells.flat_map(|cell| cell.split('`').step_by(2).map(str::to_owned).collect::<Vec<_>>()).collect()
}

#[test]
fn every_command_is_in_formats_md() {
    let help = crate::common::run(&["--help"]).stdout;
    let help = String::from_utf8(help).unwrap();
    let commands = help.split("\nCommands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let known = first_cells("docs/formats.md", "Calls");
    for command in commands.lines().filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help") {
        assert!(known.iter().any(|name| name == command), "`{command}` has no row in docs/formats.md, Calls");
    }
}

#[test]
fn a_room_of_the_program_uses_rooms_above_it_alone() {
    let rooms = first_cells("docs/architecture.md", "Rooms of the program");
    let place = |name: &str| rooms.iter().position(|room| room == name);
    let mut files = vec![root().join("pkm-host/src")];
    let source = files[0].clone();
    let mut crossings = 0;
    while let Some(path) = files.pop() {
        if path.is_dir() {
            files.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let name = path.strip_prefix(&source).unwrap().to_str().unwrap();
        let own = name.split('/').next().unwrap().trim_end_matches(".rs");
        if !name.ends_with(".rs") || ["lib", "main"].contains(&own) {
            continue;
        }
        let own = place(own).unwrap_or_else(|| panic!("{name}: its room is not in the table of docs/architecture.md"));
        for other in fs::read_to_string(&path).unwrap().split("crate::").skip(1) {
            let other = other.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap();
            assert!(!other.is_empty(), "{name}: `crate::{{…}}` hides rooms from this test: a line for each");
            if let Some(other) = place(other) {
                assert!(
                    other <= own,
                    "{name} uses `{}`, which is below its room in docs/architecture.md",
                    rooms[other]
                );
                crossings += usize::from(other < own);
            }
        }
    }
    assert!(crossings > 100, "{crossings}");
}

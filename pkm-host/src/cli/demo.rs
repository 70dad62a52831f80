//! `demo`: what all commands make, in one folder, from data that come with the program.

use std::path::{Path, PathBuf};

use pkm_fixtures as fixtures;
use serde_json::json;

use super::say;
use super::session::{Output, Session};
use crate::error::{Failure, Result};
use crate::files::source::{self, Source};
use crate::page::{first_picture, headline};
use crate::report::demo::{self as report, Exhibit};

/// Runs the main commands on data that come with the program, and writes a page that leads to all their reports: what each is for, how it was
/// called, what it said. It takes half a minute; the data go to the folder, too, so that every call can be made again and changed.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder for index.html, the reports, and the data.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Folder of the data within that of the demonstration, and the files in it.
const DATA: &str = "data";
const FILES: [(&str, fixtures::Fixture); 8] = [
    ("machine.toml", fixtures::DEMO_MACHINE),
    ("measured.csv", fixtures::DEMO_MEASURED),
    ("heldout.csv", fixtures::DEMO_HELD_OUT),
    ("unloaded.csv", fixtures::DEMO_UNLOADED),
    ("unloaded-heldout.csv", fixtures::DEMO_UNLOADED_HELD_OUT),
    ("table.json", fixtures::DEMO_TABLE),
    ("part.ngc", fixtures::DEMO_PROGRAM),
    ("log.csv", fixtures::DEMO_LOG),
];

/// A call: files in it begin with `@`, which stands for the folder.
struct Call {
    title: &'static str,
    about: &'static str,
    arguments: &'static str,
    page: &'static str,
}

const CALLS: [Call; 9] = [
    Call {
        title: "A correction table from finite elements",
        about: "What the simple model misses of the machine's stiffness is fitted to finite-element results at 49 poses and judged at 25 others. The table goes into the controller as Rust source.",
        arguments: "fit --out @fit",
        page: "fit/report.html",
    },
    Call {
        title: "A diagnosis of readings under load",
        about: "Deflections under known loads, on a machine with an effect that its file lacks. The effect is found, located and added; the error on poses that had no part in it is stated before and after.",
        arguments: "diagnose --machine @data/machine.toml --data @data/measured.csv --holdout @data/heldout.csv --out @diagnosis",
        page: "diagnosis/report.html",
    },
    Call {
        title: "The same readings on the machine, live",
        about: "Each reading as an arrow on the machine in 3D, beside what the declared and the identified model say of it; where something was found the machine is coloured.",
        arguments: "view --machine @data/machine.toml --diagnosis @diagnosis/diagnosis.json --out @diagnosed.html",
        page: "diagnosed.html",
    },
    Call {
        title: "The true geometry of an unloaded machine",
        about: "Places of two balls on the spindle, measured by a tracker at commanded poses: sizes, zeros of the joints and the wrist, with what the readings cannot tell.",
        arguments: "diagnose --unloaded --data @data/unloaded.csv --holdout @data/unloaded-heldout.csv --out @geometry",
        page: "geometry/report.html",
    },
    Call {
        title: "Stiffness over the workspace",
        about: "The six principal stiffnesses in maps, and what the paper says of them put to the test.",
        arguments: "map --table @data/table.json --out @map",
        page: "map/report.html",
    },
    Call {
        title: "Where to put the workpiece",
        about: "Holes of a plate, drilled where the machine is stiffest against their loads.",
        arguments: "place --table @data/table.json --out @place",
        page: "place/report.html",
    },
    Call {
        title: "A program without the deflection",
        about: "Each point of a milling program is moved so that the loaded tip goes where it should.",
        arguments: "compensate --table @data/table.json --path @data/part.ngc --out @compensate/part.ngc",
        page: "compensate/report.html",
    },
    Call {
        title: "What a controller learns",
        about: "A log of readings under known loads, over months: the controller's own estimator follows what changes, and says when it should be inspected.",
        arguments: "replay --log @data/log.csv --out @replay",
        page: "replay/report.html",
    },
    Call {
        title: "The machine, live",
        about: "Turn it, drive it by pose, tip or screws, load it, play the program: all numbers come from the controller's own code, compiled for the browser.",
        arguments: "view --table @data/table.json --placement @place/placement.json --path @compensate/part.ngc --out @machine.html",
        page: "machine.html",
    },
];

impl Call {
    /// Makes it, and returns what it printed.
    fn run(&self, folder: &Path) -> Result<String> {
        let argument = |a: &str| match a.strip_prefix('@') {
            Some(path) => folder.join(path).into_os_string(),
            None => a.into(),
        };
        super::run(self.arguments.split(' ').map(argument)).map(|output| output.text)
    }

    /// As it is typed in the folder.
    fn typed(&self) -> String {
        format!("pkm-host {}", self.arguments.replace('@', ""))
    }
}

pub(crate) fn run(args: &Args, session: &mut Session) -> Result<Output> {
    if session.machine_path().is_some() {
        return Err(Failure::usage("demo has machines of its own: leave --machine out"));
    }
    let files = FILES.map(|(name, fixture)| (name, fixture.text));
    source::write_all(&args.out.join(DATA), &files, &[])?;
    let mut exhibits = Vec::new();
    for (n, call) in CALLS.iter().enumerate() {
        say(&format!("{} of {}: {}\n", n + 1, CALLS.len(), call.title));
        let Call { title, about, page, .. } = *call;
        let said = call.run(&args.out)?;
        let made = Source::read(&args.out.join(page))?;
        let html = made.text()?;
        let (headline, picture) = (headline(html).map(str::to_owned), first_picture(html));
        exhibits.push(Exhibit { title, about, page, command: call.typed(), said, headline, picture });
    }
    source::write_all(&args.out, &[("index.html", report::page(&exhibits))], &[])?;
    let index = args.out.join("index.html").display().to_string();
    let calls: Vec<_> = exhibits.iter().map(|e| json!({ "command": e.command, "page": e.page })).collect();
    session.output(format!("wrote {index}: open it in a browser\n"), &json!({ "out": index, "calls": calls }))
}

//! What came out beside the stiffness file: how far the basic model is off, and a page with a picture of what was computed.

use maud::html;
use serde_json::{Value, json};

use crate::error::{Failure, Result, printable};
use crate::fem::deck::{Deck, Plates};
use crate::fem::{Case, Settings, Solved};
use crate::files::dataset::{self, stiffness_columns};
use crate::files::machine::MachineFile;
use crate::files::solid::Solid;
use crate::page::plot::{Mark, Panel, Series};
use crate::page::{Finding, Page, charts, fold, of_file, picture, table};
use crate::pose::file_units;
use crate::report::drawing;
use crate::report::fit::findings::USABLE_PERCENT;
use crate::report::stiffness::header as stiffness_header;

const STIFFNESSES: [&str; 6] = ["k11", "k22", "k33", "k44", "k55", "k66"];

/// All that the page tells of.
pub struct Facts<'a> {
    /// As changed by `--set`.
    pub file: &'a MachineFile,
    /// Of the file.
    pub solid: &'a Solid,
    /// How it was computed.
    pub settings: &'a Settings<'a>,
    /// In the order of the poses.
    pub cases: &'a [Case],
    /// `None`: nothing was computed.
    pub solved: Option<&'a [(&'a Case, Solved)]>,
    /// File of the poses, with its checksum.
    pub poses_from: &'a str,
    /// What computed them.
    pub version: &'a str,
}

/// k11…k66 by finite elements and by the core's basic model.
struct Pair {
    fem: [f64; 6],
    core: [f64; 6],
}

impl Facts<'_> {
    fn pairs(&self) -> Vec<Pair> {
        let pair = |(case, solved): &(&Case, Solved)| {
            let core = self.file.machine.stiffness(&case.pose.pose).ok()?.principal();
            Some(Pair { fem: solved.stiffness().principal().into(), core: core.into() })
        };
        self.solved.into_iter().flatten().filter_map(pair).collect()
    }

    /// Mean and greatest error of the basic model in %, by k11…k66.
    fn errors(&self) -> Option<[[f64; 6]; 2]> {
        let pairs = self.pairs();
        let error = |p: &Pair, i: usize| 100.0 * (p.core[i] / p.fem[i] - 1.0).abs();
        let all = |i: usize| pairs.iter().map(move |p| error(p, i));
        (!pairs.is_empty()).then(|| {
            [
                std::array::from_fn(|i| all(i).sum::<f64>() / pairs.len() as f64),
                std::array::from_fn(|i| all(i).fold(0.0, f64::max)),
            ]
        })
    }

    /// For `--json`.
    pub fn against_core(&self) -> Value {
        self.errors().map_or(Value::Null, |[mean, max]| json!({ "re_percent": { "mean": mean, "max": max } }))
    }

    /// For people.
    pub fn summary(&self) -> String {
        let Some([mean, max]) = self.errors() else { return String::new() };
        let list = |v: [f64; 6]| v.map(|v| format!("{v:.2}")).join(" ");
        format!("the basic model is off by {} % in k11…k66 in the mean, {} % at most\n", list(mean), list(max))
    }
}

fn findings(facts: &Facts<'_>) -> Vec<Finding> {
    let count = facts.cases.len();
    let nodes = facts.cases.iter().map(|c| c.size.0).max().unwrap_or(0);
    let Some(solved) = facts.solved else {
        return vec![
            Finding::warning("Drawn only: nothing has been computed yet."),
            Finding::good(format!("Limbs and platforms fit together without collision at all {count} poses.")),
            Finding::good(format!("To be computed: up to {nodes} nodes a pose.")),
        ];
    };
    let skew = solved.iter().map(|(_, s)| s.skew).fold(0.0, f64::max);
    let mut all = vec![
        Finding::good(format!("The stiffness of {count} poses is computed.")),
        Finding::good(format!(
            "Every compliance is symmetric, as it must be, within {:.0e} of √(c_ii c_jj); up to {nodes} nodes a pose.",
            skew.max(f64::EPSILON)
        )),
    ];
    if let Some([mean, max]) = facts.errors() {
        let worst = (0..6).max_by(|a, b| mean[*a].total_cmp(&mean[*b])).unwrap_or(0);
        let off = format!(
            "The basic model of the core is off by {:.2} % in {} in the mean, up to {:.2} %; less in the others.",
            mean[worst], STIFFNESSES[worst], max[worst]
        );
        all.push(if mean[worst] > USABLE_PERCENT {
            Finding::warning(format!("{off} It needs a table: fit one to this file."))
        } else {
            Finding::good(off)
        });
    }
    all
}

/// How sure the verdict is, and what to do: for the page, which has more room than a terminal.
fn advice(facts: &Facts<'_>) -> [Finding; 2] {
    let (sure, todo) = if facts.solved.is_some() {
        (
            "solids built from the machine file's dimensions, not the machine: as right as these, and as the mesh is fine (--mesh).",
            "fit a table to the file of stiffnesses: pkm-host fit --data.",
        )
    } else {
        (
            "a collision would have been said; stiffness is not known yet.",
            "look at the drawing, then leave out --dry-run.",
        )
    };
    [Finding::good(sure).sure(), Finding::good(todo).todo()]
}

/// k11…k66 of the basic model over those of the solids.
fn against(pairs: &[Pair]) -> [Panel; 6] {
    std::array::from_fn(|i| {
        let (unit, per) = if i < 3 { ("N/µm", 1e-6) } else { ("kN·m/rad", 1e-3) };
        let series = |name: &str, value: fn(&Pair, usize) -> f64, mark| Series {
            name: name.into(),
            points: pairs.iter().map(|p| (p.fem[i] * per, value(p, i) * per)).collect(),
            mark,
        };
        Panel {
            title: STIFFNESSES[i].into(),
            x_label: format!("finite elements, {unit}"),
            y_label: format!("basic model, {unit}"),
            series: vec![series("poses", |p, i| p.core[i], Mark::Dot), series("equal", |p, i| p.fem[i], Mark::Cross)],
        }
    })
}

/// The stiffness file. Eight digits: `ccx` prints seven.
pub fn stiffness_csv(facts: &Facts<'_>, solved: &[(&Case, Solved)]) -> String {
    let (file, version, settings) = (facts.file, facts.version, facts.settings);
    let rows = solved.iter().map(|(case, s)| {
        let mut row = vec![case.pose.id.clone()];
        row.extend(dataset::pose_cells(&case.pose.pose));
        row.extend(stiffness_columns().map(|(i, j, _)| format!("{:.7e}", s.k[(i, j)])));
        row
    });
    let mut set = settings.set.join(", ");
    if !set.is_empty() {
        set = format!(", with {}", printable(&set));
    }
    format!(
        "# terminal stiffness of machine `{}`{set} by finite elements ({version}, pkm-host {}, mesh {}); simulated\n\
         # K at A in A-uvw, SI; inverse of the compliance from six unit wrenches at A\n{}",
        file.name,
        env!("CARGO_PKG_VERSION"),
        settings.size,
        dataset::to_csv(b',', &stiffness_header(), rows)
    )
}

/// How the data came about, without what differs from run to run.
pub fn manifest(facts: &Facts<'_>) -> Value {
    let (file, solid, settings, version, cases) = (facts.file, facts.solid, facts.settings, facts.version, facts.cases);
    let poses: Vec<Value> = cases
        .iter()
        .map(|c| json!({ "pose": c.pose.id, "deck_sha256": c.sha256, "nodes": c.size.0, "elements": c.size.1 }))
        .collect();
    json!({
        "format": 1,
        "tool": format!("pkm-host {}", env!("CARGO_PKG_VERSION")),
        "solver": version,
        "machine": file.name,
        "machine_sha256": file.source.sha256(),
        "set": settings.set,
        "mesh": settings.size,
        "solid": solid.toml(),
        "poses": poses,
    })
}

/// The page.
///
/// # Errors
/// What the drawing library says.
pub fn page(facts: &Facts<'_>, warnings: &[String]) -> Result<String> {
    let first = &facts.cases[0].pose;
    let [theta, sigma, z0] = file_units(&first.pose);
    let plates = Plates::new(facts.solid, &facts.file.parameters, 1.0).map_err(Failure::input)?;
    let deck = Deck::new(facts.solid, &facts.file.parameters, &first.pose, &plates).map_err(Failure::other)?;
    let cells = |v: [f64; 6]| v.map(|v| format!("{v:.3}")).to_vec();
    let body = html! {
        h2 { "What is computed" }
        (picture(
            &format!(
                "At pose {}: θ {theta:.3}°, σ {sigma:.3}°, Z0 {z0:.2} mm. Rigid platforms have no solid. Joints, bearings, \
                 nuts and guides are springs between rigid rings; they are not drawn.",
                first.id
            ),
            &drawing::svg(&deck),
        ))
        @if let Some([mean, max]) = facts.errors() {
            h2 { "Against the basic model" }
            (charts(
                "Each pose by both: what lies on the crosses is the same in both.",
                &against(&facts.pairs()),
            )?)
            (table(
                "Error of the basic model (with the machine file's effects) in %",
                &STIFFNESSES,
                &[("mean".to_owned(), cells(mean)), ("greatest".to_owned(), cells(max))],
            ))
        }
        h2 { "Dimensions" }
        (fold("All of them, as a section of the machine file", &html! { pre tabindex="0" { (facts.solid.toml()) } }))
    };
    let set = if facts.settings.set.is_empty() { "nothing".to_owned() } else { facts.settings.set.join(", ") };
    let facts_of = vec![
        ("Machine file", of_file(&facts.file.source)),
        ("Changed by --set", set),
        ("Poses", format!("{}, {} poses", facts.poses_from, facts.cases.len())),
        ("Size of the elements, relative to the usual", facts.settings.size.to_string()),
        ("Computed by", facts.version.to_owned()),
    ];
    let title = format!("Stiffness of {} by finite elements", facts.file.name);
    let mut findings = findings(facts);
    findings.extend(advice(facts));
    Ok(Page { title, findings: &findings, warnings, body, facts: facts_of }.html())
}

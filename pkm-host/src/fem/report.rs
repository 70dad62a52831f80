//! What came out beside the stiffness file: how far the basic model is off, and a page with a picture of what was computed.

use serde_json::{Value, json};

use super::deck::{Deck, Plates};
use super::solid::Solid;
use super::{Case, Request, Solved, drawing};
use crate::dataset::file_units;
use crate::error::{Failure, Result};
use crate::machine_file::MachineFile;
use crate::plot::{self, Mark, Panel, Series};
use crate::report::{STIFFNESSES, escape, table};

/// All that the page tells of.
pub struct Facts<'a> {
    /// As changed by `--set`.
    pub file: &'a MachineFile,
    /// Of the file.
    pub solid: &'a Solid,
    /// The call.
    pub request: &'a Request<'a>,
    /// In the order of the poses.
    pub cases: &'a [Case],
    /// `None`: nothing was computed.
    pub solved: Option<&'a [(&'a Case, Solved)]>,
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
            Some(Pair { fem: solved.stiffness().principal(), core })
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

/// The page.
///
/// # Errors
/// What the drawing library says.
pub fn page(facts: &Facts<'_>) -> Result<String> {
    let name = escape(&facts.file.name);
    let title = format!("Stiffness of {name} by finite elements");
    let mut body = format!("<h1>{title}</h1>\n<ul>");
    let count = facts.cases.len();
    let nodes = facts.cases.iter().map(|c| c.size.0).max().unwrap_or(0);
    let done = if facts.solved.is_some() { "computed" } else { "checked, none computed" };
    body.push_str(&format!("<li>{count} poses {done}, up to {nodes} nodes each</li>"));
    if let Some([mean, max]) = facts.errors() {
        let worst = (0..6).max_by(|a, b| mean[*a].total_cmp(&mean[*b])).unwrap_or(0);
        body.push_str(&format!(
            "<li>The basic model of the core is off by {:.2} % in k{} in the mean, up to {:.2} %; less in the others</li>",
            mean[worst],
            STIFFNESSES[worst],
            max[worst]
        ));
    }
    body.push_str("</ul>\n<h2>What is computed</h2>\n");
    let first = &facts.cases[0].pose;
    let [theta, sigma, z0] = file_units(&first.pose);
    let plates = Plates::new(facts.solid, &facts.file.parameters, 1.0).map_err(Failure::input)?;
    let deck = Deck::new(facts.solid, &facts.file.parameters, &first.pose, &plates).map_err(Failure::other)?;
    body.push_str(&drawing::svg(&deck));
    body.push_str(&format!(
        "<p>At pose {}: θ {theta:.3}°, σ {sigma:.3}°, Z0 {z0:.2} mm. Rigid platforms have no solid. Joints, bearings, nuts and \
         guides are springs between rigid rings; they are not drawn.</p>\n",
        escape(&first.id)
    ));
    body.push_str("<p>All its dimensions, as a section of the machine file:</p>\n");
    body.push_str(&format!("<pre>{}</pre>\n", escape(&facts.solid.toml())));
    if let Some([mean, max]) = facts.errors() {
        body.push_str("<h2>Against the basic model</h2>\n");
        let cells = |v: [f64; 6]| v.map(|v| format!("{v:.3}")).to_vec();
        let heads = STIFFNESSES.map(|i| format!("k{i}"));
        body.push_str(&table(
            "Error of the basic model (with the machine file's effects) in %",
            &heads.each_ref().map(String::as_str),
            &[("mean".to_owned(), cells(mean)), ("greatest".to_owned(), cells(max))],
        ));
        let pairs = facts.pairs();
        for three in [[0, 1, 2], [3, 4, 5]] {
            let panels = three.map(|i| {
                let (unit, per) = if i < 3 { ("N/µm", 1e-6) } else { ("kN·m/rad", 1e-3) };
                let series = |name: &str, value: fn(&Pair, usize) -> f64, mark| Series {
                    name: name.into(),
                    points: pairs.iter().map(|p| (p.fem[i] * per, value(p, i) * per)).collect(),
                    mark,
                };
                Panel {
                    title: format!("k{}", STIFFNESSES[i]),
                    x_label: format!("finite elements, {unit}"),
                    y_label: format!("basic model, {unit}"),
                    series: vec![
                        series("poses", |p, i| p.core[i], Mark::Dot),
                        series("equal", |p, i| p.fem[i], Mark::Cross),
                    ],
                }
            });
            body.push_str(&plot::panels(&panels)?);
        }
    }
    body.push_str("<h2>Where this comes from</h2><dl>");
    let set = if facts.request.set.is_empty() { "nothing".to_owned() } else { facts.request.set.join(", ") };
    let entries = [
        ("Tool", format!("pkm-host {}", env!("CARGO_PKG_VERSION"))),
        ("Machine file, SHA-256", facts.file.source.sha256()),
        ("Changed by --set", set),
        ("Size of the elements, relative to the usual", facts.request.size.to_string()),
    ];
    for (what, value) in entries {
        body.push_str(&format!("<dt>{}</dt><dd>{}</dd>", escape(what), escape(&value)));
    }
    body.push_str("</dl>");
    Ok(crate::report::page(&title, &body))
}

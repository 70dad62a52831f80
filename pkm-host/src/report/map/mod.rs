//! `report.html` of a map.

mod contour;
pub mod picture;
mod region;

use maud::{Markup, PreEscaped, html};
use serde_json::{Value, json};

use self::picture::Picture;
use crate::files::dataset::stiffness_column;
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::page::{Finding, Page, fold, map_pictures, of_file, table};
use crate::plan::map::claims::Claim;
use crate::plan::map::{Map, Point};

/// Of A-uvw, along which k11, k22 and k33 are.
const AXES: [&str; 3] = ["u", "v", "w"];

/// All that there is of one σ.
pub struct Sheet {
    /// Its values.
    pub map: Map,
    /// The same drawn.
    pub picture: Picture,
    /// The paper's claims about them: over what, and which.
    pub claims: [(&'static str, Vec<Claim>); 2],
}

fn value(p: &Point, k: usize) -> f64 {
    p.value.map_or(f64::NAN, |v| v.principal[k])
}

/// Where the machine is softest and stiffest along an axis, and how much of that a table backs.
fn findings(sheets: &[Sheet], has_table: bool) -> Vec<Finding> {
    // stiffness, axis and place of all least (0) or greatest (1) values
    let ends = |end: usize| {
        sheets.iter().flat_map(move |s| {
            let extremes = s.map.extremes();
            (0..3).map(move |k| (value(extremes[k][end], k), k, extremes[k][end], s.map.sigma_deg))
        })
    };
    let words = |(k, axis, p, sigma): (f64, usize, &Point, f64)| {
        let (x0, z0) = (p.x0_mm, p.z0_mm);
        format!("{:.2} N/µm along {} (X0 = {x0} mm, Z0 = {z0} mm, σ = {sigma}°)", k / 1e6, AXES[axis])
    };
    let softest = ends(0).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(String::new(), words);
    let stiffest = ends(1).max_by(|a, b| a.0.total_cmp(&b.0)).map_or(String::new(), words);
    let count = |status: &str| sheets.iter().flat_map(|s| &s.map.points).filter(|p| p.status() == status).count();
    let (inside, outside, without) = (count("ok"), count("outside_box"), count("no_stiffness"));

    let between = format!("softest {softest}, stiffest {stiffest}.");
    let mut all = vec![match (has_table, inside, outside) {
        (false, ..) => Finding::warning(format!("Uncorrected: the basic model, which no data back, says: {between}")),
        (true, 0, _) => Finding::bad(format!("No point lies inside the table's box: all is extrapolated: {between}")),
        (true, _, 0) => Finding::good(format!("All of the map lies inside the table's box: {between}")),
        (true, ..) => Finding::good(format!("Inside the table's box: {between}")),
    }];
    if outside > 0 {
        all.push(Finding::warning(format!(
            "{:.0} % of what the machine reaches here lies outside the table's box: striped in the maps, extrapolated, \
             not to be relied on.",
            100.0 * outside as f64 / (inside + outside) as f64
        )));
    }
    let sure = if has_table && inside > 0 {
        let known = sheets.iter().filter_map(|s| s.map.u95_extremes()?[1].u95_um_per_kn()).reduce(f64::max);
        let known = known.map_or("".to_owned(), |um| {
            format!(": it knows the tip under a force to {um:.3} µm/kN or better (U95, coverage 95 %)")
        });
        format!(
            "inside its box as sure as the table{known}; its report says how far off it is at poses that it was not fitted to."
        )
    } else {
        "no data back these values: take the pattern for a hint, and the numbers for a guess.".to_owned()
    };
    all.push(Finding::good(sure).sure());
    all.push(Finding::good(match (has_table, inside) {
        (false, _) => "fit a table first (pkm-host fit), and draw the map with --table.",
        (true, 0) => "choose poses in this window (pkm-host plan), compute or measure them, and fit a table to them.",
        (true, _) => "keep work, and forces along the soft axis above all, in bright places inside the box; for given holes pkm-host place finds the best.",
    }).todo());
    if without > 0 {
        all.push(Finding::warning(format!("At {without} points the table gives no stiffness: too far from its box.")));
    }
    for sheet in sheets {
        for (over, claims) in sheet.claims.iter().filter(|(_, claims)| !claims.is_empty()) {
            let held = claims.iter().filter(|c| c.holds).count();
            all.push(Finding::good(format!(
                "{held} of {} statements of the paper about its own machine (Section 5.2) hold{} over the {over} at σ = {}°.",
                claims.len(),
                if held == 1 { "s" } else { "" },
                sheet.map.sigma_deg
            )));
        }
    }
    all
}

fn extremes(map: &Map) -> Markup {
    let mut rows: Vec<_> = (map.extremes().iter().enumerate())
        .map(|(k, ends)| {
            let unit = if k < 3 { "N/m" } else { "N·m/rad" };
            let end = |p: &Point| [format!("{:.4e}", value(p, k)), p.x0_mm.to_string(), p.z0_mm.to_string()];
            (format!("{} {unit}", stiffness_column(k, k)), ends.iter().flat_map(|p| end(p)).collect())
        })
        .collect();
    if let Some(ends) = map.u95_extremes() {
        let end = |p: &Point| {
            [format!("{:.4}", p.u95_um_per_kn().unwrap_or(f64::NAN)), p.x0_mm.to_string(), p.z0_mm.to_string()]
        };
        rows.push(("U95 of the tip, µm/kN".to_owned(), ends.iter().flat_map(|p| end(p)).collect()));
    }
    let heads = ["least", "at X0 mm", "Z0 mm", "greatest", "at X0 mm", "Z0 mm"];
    table("Least and greatest values, inside the table's box if there is any", &heads, &rows)
}

fn claims(over: &str, claims: &[Claim]) -> Markup {
    let row = |c: &Claim| {
        let holds = if c.holds { "✓ holds" } else { "✗ does not" };
        (c.claim.clone(), vec![holds.to_owned(), c.text.clone()])
    };
    let rows: Vec<_> = claims.iter().map(row).collect();
    table(&format!("What the paper's Section 5.2 says of its machine, over the {over}"), &["here", "figures"], &rows)
}

fn sheet(sheet: &Sheet) -> Markup {
    let map = &sheet.map;
    let [[x0, x1], [z0, z1]] = map.grid.extent_mm();
    html! {
        h2 { "σ = " (map.sigma_deg) "°" }
        ul.signs { @for (svg, name) in &sheet.picture.signs { li { (PreEscaped(svg)) (name) } } }
        (map_pictures(
            if map.u95_extremes().is_some() {
                "Stiffness at A in A-uvw, where A stands in the plane of X0 and Z0: bright is stiff. At the end how far the table may be \
                 off: the expanded uncertainty (coverage 95 %) of what a force of 1 kN along u, v or w moves the tip by, the greatest of the three."
            } else {
                "Stiffness at A in A-uvw, where A stands in the plane of X0 and Z0. Bright is stiff."
            },
            &sheet.picture.panels
        ))
        (extremes(map))
        @for (over, of) in sheet.claims.iter().filter(|(_, of)| !of.is_empty()) {
            (fold(&format!("The paper's statements, over the {over}"), &claims(over, of)))
        }
        p { "X0 " (x0) " to " (x1) " mm, Z0 " (z0) " to " (z1) " mm, every " (map.grid.step_mm) " mm: "
            (crate::plan::map::counted(&map.points).replace('_', " ")) "." }
    }
}

/// For the terminal.
pub fn text(sheet: &Sheet) -> String {
    let mut text = sheet.map.summary();
    for (over, claims) in &sheet.claims {
        if !claims.is_empty() {
            text.push_str(&format!("the paper's Section 5.2, over the {over}:\n"));
        }
        for c in claims {
            text.push_str(&format!("  {:<5}  {}\n         {}\n", c.holds, c.claim, c.text));
        }
    }
    text
}

/// The paper's claims for `--json`.
pub fn claims_json(sheet: &Sheet) -> Vec<Value> {
    let claim = |over: &str, c: &Claim| {
        json!({
            "sigma_deg": sheet.map.sigma_deg, "over": over, "claim": c.claim, "holds": c.holds, "figures": c.figures,
        })
    };
    sheet.claims.iter().flat_map(|(over, claims)| claims.iter().map(move |c| claim(over, c))).collect()
}

/// The page; `described` is the model in words.
pub fn html(
    file: &MachineFile,
    correction: Option<&Source>,
    described: &str,
    sheets: &[Sheet],
    warnings: &[String],
) -> String {
    let body = html! { @for s in sheets { (sheet(s)) } };
    let facts = vec![
        ("Model", described.to_owned()),
        ("Machine file", of_file(&file.source)),
        ("Correction table", correction.map_or("none".into(), of_file)),
    ];
    let findings = findings(sheets, correction.is_some());
    Page { title: format!("Stiffness map of {}", file.name), findings: &findings, warnings, body, facts }.html()
}

#[cfg(test)]
mod tests {
    use plotters::prelude::*;

    /// By WCAG's formula.
    fn light(rgb: [u8; 3]) -> f64 {
        let [r, g, b] = rgb.map(|v| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        });
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }

    /// Black and white become the page's ink and card.
    #[test]
    fn stripes_are_seen_on_every_colour_light_and_dark() {
        let style = include_str!("../../page/style.css");
        for scheme in style.lines().take(2) {
            let colour = |name: &str| {
                let start = scheme.find(name).unwrap() + name.len();
                let hex = scheme[start..].split([';', '}']).next().unwrap();
                let hex = if hex.len() == 3 { hex.repeat(2) } else { hex.to_owned() };
                light([0, 2, 4].map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()))
            };
            let lines = [colour("--ink:#"), colour("--card:#")];
            for n in 0..=100 {
                let RGBColor(r, g, b) = ViridisRGB.get_color(f64::from(n) / 100.0);
                let ground = light([r, g, b]);
                let contrast = lines.map(|l| (l.max(ground) + 0.05) / (l.min(ground) + 0.05));
                assert!(contrast[0].max(contrast[1]) >= 3.0, "{n} %: {contrast:?} in {scheme}");
            }
        }
    }
}

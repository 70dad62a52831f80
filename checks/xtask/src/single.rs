//! A controller's cycle in `f32` against `f64`, as tables and as `docs/f32.svg`.

use std::collections::BTreeMap;

use pkm_host::page::plot::{self, Mark, Panel, Series};
use pkm_tests::seeded;
use pkm_tests::single::{Case, Errors, Region};

use crate::{Outcome, root};

const CASES: usize = 20_000;
const REGIONS: [(Region, &str); 4] = [
    (Region::Box, "reference, box"),
    (Region::Machines, "random machines"),
    (Region::Wide, "reference, anywhere"),
    (Region::Edge, "random, anywhere"),
];
const QUANTITIES: [&str; 4] = ["screw lengths", "K_m", "deflection", "compensated lengths"];

struct Answered {
    case: Case,
    errors: Errors,
    relative: [f64; 4],
}

/// Value at a share of the way through, from the least.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Share of the cases that are worse, down to the worst.
fn exceeded(errors: impl Iterator<Item = f64>) -> Vec<(f64, f64)> {
    let errors = sorted(errors);
    let least = (1.0 / errors.len() as f64).log10();
    (1..=16)
        .map(|n| 10_f64.powf(least * f64::from(n) / 16.0))
        .map(|share| (quantile(&errors, 1.0 - share), share))
        .collect()
}

/// The point with the greatest y in each third of a decade of x.
fn worst(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let mut bins = BTreeMap::new();
    for (x, y) in points {
        let worst = bins.entry((3.0 * x.log10()).floor() as i32).or_insert((x, y));
        if y > worst.1 {
            *worst = (x, y);
        }
    }
    bins.into_values().collect()
}

pub fn run() -> Outcome {
    let mut rng = seeded();
    let mut of_region = Vec::new();
    println!("| region | quantity | median | 99 % | 99.9 % | worst | worst, absolute |\n|---|---|---|---|---|---|---|");
    let mut rest = String::new();
    for (region, name) in REGIONS {
        let cases: Vec<Case> = (0..CASES).map(|_| region.draw(&mut rng)).collect();
        let answered: Vec<Answered> = cases
            .iter()
            .filter_map(|case| {
                let errors = case.errors?;
                Some(Answered { case: *case, errors, relative: errors.relative_to(case.longest_screw_m) })
            })
            .collect();
        for (i, quantity) in QUANTITIES.iter().enumerate() {
            let errors = sorted(answered.iter().map(|a| a.relative[i]));
            let [median, most, nearly_all, all] = [0.5, 0.99, 0.999, 1.0].map(|share| quantile(&errors, share));
            let absolute = answered.iter().map(|a| a.errors.relative_to(1.0)[i]).fold(0.0, f64::max);
            let absolute = if i % 3 == 0 { format!("{:.2} µm", 1e6 * absolute) } else { String::new() };
            println!("| {name} | {quantity} | {median:.1e} | {most:.1e} | {nearly_all:.1e} | {all:.1e} | {absolute} |");
        }
        let conditions = sorted(cases.iter().map(|c| c.condition));
        let [median, most, all] = [0.5, 0.99, 1.0].map(|share| quantile(&conditions, share));
        let in_units = |i: usize| {
            let bounded = answered.iter().filter(|a| Region::bound(a.case.condition) < 1.0);
            let errors =
                sorted(bounded.map(|a| Region::OF_CONDITION * a.relative[i] / Region::bound(a.case.condition)));
            format!("{:.2} to {:.1}", quantile(&errors, 0.5), quantile(&errors, 1.0))
        };
        let refused = sorted(cases.iter().filter(|c| c.errors.is_none()).map(|c| c.condition));
        let first = refused.first().map_or("-".into(), |c| format!("{c:.1e}"));
        rest += &format!(
            "| {name} | {median:.1e} | {most:.1e} | {all:.1e} | {} | {} | {} of {CASES} | {first} |\n",
            in_units(1),
            in_units(2),
            refused.len(),
        );
        of_region.push((name, answered));
    }
    println!(
        "\n| region | κ, median | 99 % | worst | K_m, in κ 2^-24, median to worst | deflection, in κ 2^-24 | refused \
         by f32 alone | from κ |\n|---|---|---|---|---|---|---|---|\n{rest}"
    );
    let path = root().join("docs/f32.svg");
    std::fs::write(&path, picture(&of_region)?).map_err(|e| format!("docs/f32.svg: {e}"))?;
    println!("wrote docs/f32.svg");
    Ok(())
}

fn picture(of_region: &[(&str, Vec<Answered>)]) -> Result<String, String> {
    let line = |name: &str, points| Series { name: name.into(), points, mark: Mark::Line };
    let units = ["of the longest screw", "of √(k_ii k_jj)", "of itself", "of the longest screw"];
    let mut panels: Vec<Panel> = (0..4)
        .map(|i| Panel {
            title: format!("{}: how often f32 is worse", QUANTITIES[i]),
            x_label: format!("error, part {}", units[i]),
            y_label: "share of demands".into(),
            series: of_region.iter().map(|(name, a)| line(name, exceeded(a.iter().map(|a| a.relative[i])))).collect(),
        })
        .collect();

    let mut series: Vec<Series> = of_region
        .iter()
        .map(|(name, a)| line(name, worst(a.iter().map(|a| (a.case.condition, a.relative[2])))))
        .collect();
    let bound =
        sorted(of_region.iter().flat_map(|(_, a)| a).map(|a| a.case.condition).filter(|k| Region::bound(*k) < 1.0));
    let ends = [bound[0], bound[bound.len() - 1]].map(|condition| (condition, Region::bound(condition)));
    series.push(line(&format!("bound, {} κ / 2^24", Region::OF_CONDITION), ends.into()));
    panels.push(Panel {
        title: "deflection: worst error over κ".into(),
        x_label: "κ, condition number of K scaled to ones".into(),
        y_label: "error, part of itself".into(),
        series,
    });

    let (_, reference) = of_region.iter().find(|(name, _)| *name == REGIONS[2].1).ok_or("no such region")?;
    let angles = [(0.0, 15.0), (15.0, 45.0), (45.0, 85.0)].map(|(from, to)| {
        let inside = reference.iter().filter(move |a| {
            let angle = a.case.pose.theta_rad.abs().max(a.case.pose.sigma_rad.abs()).to_degrees();
            angle > from && angle <= to
        });
        line(&format!("{from}° to {to}°"), worst(inside.map(|a| (a.case.pose.z0_m, a.relative[2]))))
    });
    panels.push(Panel {
        title: "deflection, reference: worst by θ or σ, the greater".into(),
        x_label: "Z0 in m".into(),
        y_label: "error, part of itself".into(),
        series: angles.into(),
    });
    plot::logarithmic_panels(&panels, 2).map_err(|e| e.to_string())
}

//! What a report says of placements by their worst case.

use maud::{Markup, html};

use super::{mm, series_name};
use crate::page::{Finding, table};
use crate::plan::place::search::Placed;
use crate::plan::place::{PlacementModel, Robust};

fn um(m: f64) -> String {
    format!("{:.3} µm", m * 1e6)
}

/// The worst case where there is no uncertainty in the choice.
fn there(robust: &Robust) -> String {
    robust.worst_of_optimum_m.map_or("a hole may be out of reach".into(), um)
}

/// What the robust choice gains, and what it costs.
pub(super) fn findings(model: &PlacementModel<'_>, placed: &Placed) -> Vec<Finding> {
    let finding = |robust: &Robust| {
        let p = &robust.placement;
        let mut text = format!(
            "Series {} against the worst case: table at dx = {:.3} mm, dy = {:.3} mm, ",
            series_name(model, p),
            mm(p.position.dx_m),
            mm(p.position.dy_m)
        );
        if model.job.rotary.is_some() {
            text.push_str(&format!("turned to {:.3}°, ", p.position.rotary_rad.to_degrees()));
        }
        let (_, optimum) = robust.optimum;
        let moves = if robust.proved.is_some() { "moves at most" } else { "was seen to move" };
        text.push_str(&format!(
            "the tip {moves} {}, without uncertainty {} ({:+.2} % beside the optimum without). The optimum without uncertainty, in its worst case: {}.",
            um(p.value),
            um(robust.nominal_m),
            100.0 * (robust.nominal_m / optimum - 1.0),
            there(robust)
        ));
        if let Some(c) = p.certificate {
            text.push_str(&format!(" Proved: no position has a worst case below {}.", um(c.bound)));
        }
        match robust.proved {
            Some(worst) if worst.reached => Finding::good(text),
            Some(_) => {
                Finding::good(text + " That holes are in reach wherever they may be was seen at nine places of each.")
            }
            None => Finding::warning(text + " The worst case is the greatest that was tried, and not proved."),
        }
    };
    placed.robust.iter().map(finding).collect()
}

/// What the verdict, which is on placements without uncertainty, has to add where another place is to be set.
pub(super) fn of_the_verdict(model: &PlacementModel<'_>, placed: &Placed) -> String {
    let worst: Vec<String> = (placed.robust.iter())
        .map(|robust| {
            format!("{:.1} µm (series {})", robust.placement.value * 1e6, series_name(model, &robust.placement))
        })
        .collect();
    if worst.is_empty() {
        return String::new();
    }
    format!(" That is without uncertainty; placed against the worst case, the tip moves in it by {}.", worst.join(", "))
}

/// All of them in figures.
pub(super) fn section(model: &PlacementModel<'_>, placed: &Placed) -> Markup {
    let Some(uncertain) = model.job.robust.as_ref().filter(|_| !placed.robust.is_empty()) else { return html! {} };
    let rows: Vec<_> = (placed.robust.iter())
        .map(|robust| {
            let p = &robust.placement;
            let certificate =
                p.certificate.map_or("–".into(), |c| format!("{} ({:.3} %)", um(c.bound), 100.0 * c.gap));
            let cells = vec![
                format!("{:.3}", mm(p.position.dx_m)),
                format!("{:.3}", mm(p.position.dy_m)),
                format!("{:.3}", p.position.rotary_rad.to_degrees()),
                um(p.value),
                um(robust.nominal_m),
                certificate,
                um(robust.optimum.1),
                there(robust),
            ];
            (series_name(model, p), cells)
        })
        .collect();
    let heads = [
        "dx mm",
        "dy mm",
        "rotary °",
        "worst case",
        "without uncertainty",
        "worst case of no position below (gap)",
        "optimum without uncertainty",
        "its worst case",
    ];
    let caption = format!(
        "Tip deflection in the worst case: stiffness ±{} %, force within {}° of its direction, holes within {} mm of their place",
        100.0 * uncertain.stiffness,
        uncertain.load_cone_rad.to_degrees(),
        mm(uncertain.hole_radius_m)
    );
    html! {
        h2 { "Against what is not sure" }
        (table(&caption, &heads, &rows))
    }
}

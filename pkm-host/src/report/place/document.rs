//! `placement.json`.

use serde_json::{Value, json};

use super::{compared, is_random, mm, names, series_name, um};
use crate::files::job::Series;
use crate::plan::place::search::{Options, Placed, Placement};
use crate::plan::place::{Front, Objective, PlacementModel, Posture};
use crate::pose::file_units;

fn holes(placement: &Placement) -> Vec<Value> {
    let hole = |p: &Posture| {
        let c = &p.solution.configuration;
        let [theta_deg, sigma_deg, z0_mm] = file_units(&c.pose);
        let q_mm: [f64; 3] = p.solution.joints.lengths.q_m.map(mm).into();
        json!({
            "q_mm": q_mm,
            "theta_deg": theta_deg, "sigma_deg": sigma_deg, "z0_mm": z0_mm,
            "beta1_deg": c.beta_rad[0].to_degrees(), "beta2_deg": c.beta_rad[1].to_degrees(),
            "normalised_determinant": p.solution.normalised_determinant,
            "k": p.k,
            "deflection_um": um(p),
            "status": if p.outside_box { "outside_box" } else { "ok" },
        })
    };
    placement.holes.iter().map(hole).collect()
}

/// What `placement.json` says of a position.
fn entry(model: &PlacementModel<'_>, options: &Options, placed: &Placed, p: &Placement) -> Value {
    let unit = |value: f64| p.objective.value_in_unit(value);
    let (at, value) = p.grid_best;
    let step = placed.grids[p.grid].spacing();
    json!({
        "name": series_name(model, p),
        "objective": p.objective.name(),
        "dx_mm": mm(p.position.dx_m), "dy_mm": mm(p.position.dy_m), "rotary_deg": p.position.rotary_rad.to_degrees(),
        "cross_slide_mm": model.job.in_cross_slide_m(&p.position).map(mm),
        "value": unit(p.value), "unit": p.objective.unit(),
        "q_ratio": p.q_ratio,
        "grid_certified": {
            "step_mm": mm(step.dx_m.max(step.dy_m)), "step_deg": step.rotary_rad.to_degrees(),
            "dx_mm": mm(at.dx_m), "dy_mm": mm(at.dy_m), "rotary_deg": at.rotary_rad.to_degrees(),
            "value": unit(value),
        },
        "feasible_share": p.feasible_share,
        "holes": holes(p),
        "before": p.before.as_ref().map(|(value, postures)| json!({
            "value": unit(*value),
            "deflection_um": postures.iter().map(um).collect::<Vec<_>>(),
            "k": postures.iter().map(|p| p.k).collect::<Vec<_>>(),
        })),
        "certificate": p.certificate.map(|c| json!({
            "lower_bound": unit(c.bound), "gap": c.gap, "asked_gap": options.limits.gap, "cells": c.cells,
        })),
        "convergence": p.convergence.iter().map(|(n, v)| (*n, unit(*v))).collect::<Vec<_>>(),
    })
}

/// The same of a position for several series, with what each of them gets there and what it would get alone.
fn entry_together(model: &PlacementModel<'_>, options: &Options, placed: &Placed, p: &Placement) -> Value {
    let unit = |value: f64| p.objective.value_in_unit(value);
    let mut entry = entry(model, options, placed, p);
    let shares = compared(model, placed, p).map(|(series, here, alone)| {
        let Series { name, weight, holes, .. } = series;
        json!({ "name": name, "weight": weight, "holes": holes.len(), "value": unit(here), "alone": unit(alone) })
    });
    entry["shares"] = shares.collect();
    entry
}

/// Placements by their worst case, and what counts as uncertain.
fn robust(model: &PlacementModel<'_>, options: &Options, placed: &Placed) -> Option<Value> {
    let uncertain = model.job.robust.as_ref()?;
    let um = |m: f64| m * 1e6;
    let entries = placed.robust.iter().map(|robust| {
        let mut entry = entry(model, options, placed, &robust.placement);
        let keys = entry.as_object_mut()?;
        // those of the placement without uncertainty
        for key in ["q_ratio", "grid_certified", "feasible_share", "before", "convergence"] {
            keys.remove(key);
        }
        let (position, value) = robust.optimum;
        entry["nominal_value"] = json!(um(robust.nominal_m));
        entry["proved"] = json!(robust.proved.is_some());
        entry["reach_proved"] = json!(robust.proved.is_some_and(|worst| worst.reached));
        entry["optimum"] = json!({
            "dx_mm": mm(position.dx_m), "dy_mm": mm(position.dy_m), "rotary_deg": position.rotary_rad.to_degrees(),
            "value": um(value), "robust_value": robust.worst_of_optimum_m.map(um),
        });
        entry["nominal_cost_percent"] = json!(100.0 * (robust.nominal_m / value - 1.0));
        Some(entry)
    });
    Some(json!({
        "stiffness": uncertain.stiffness, "load_cone_deg": uncertain.load_cone_rad.to_degrees(),
        "hole_radius_mm": mm(uncertain.hole_radius_m),
        "series": entries.collect::<Option<Vec<_>>>()?,
    }))
}

/// Pareto fronts of tip-worst, one a series and one of all that are placed together.
fn pareto(model: &PlacementModel<'_>, options: &Options, placed: &Placed) -> Option<Value> {
    let (objective, points, limits) = options.front?;
    let (unit, um) = (|value: f64| objective.value_in_unit(value), |m: f64| Objective::TipWorst.value_in_unit(m));
    let entry = |front: &Front| {
        let points = front.points.iter().map(|point| {
            let (position, c) = (&point.position, point.certificate);
            json!({
                "dx_mm": mm(position.dx_m), "dy_mm": mm(position.dy_m), "rotary_deg": position.rotary_rad.to_degrees(),
                "cross_slide_mm": model.job.in_cross_slide_m(position).map(mm),
                "tip_um": um(point.tip_m), "value": unit(point.other),
                "certificate": {
                    "lower_bound_um": um(c.bound), "gap": c.gap, "asked_gap": limits.gap, "cells": c.cells,
                },
            })
        });
        let proved = front
            .proved
            .iter()
            .map(|step| json!({ "value_at_most": step.other_at_most.map(unit), "tip_um_at_least": um(step.bound_m) }));
        json!({
            "name": names(model, &front.series), "conflict": front.conflicts(),
            "points": points.collect::<Vec<_>>(), "value_at_least": unit(front.other_bound),
            "proved": proved.collect::<Vec<_>>(),
        })
    };
    let series: Vec<Value> = placed.fronts.iter().map(entry).collect();
    Some(json!({ "objective": objective.name(), "unit": objective.unit(), "asked_points": points, "series": series }))
}

/// `placement.json`.
pub fn document(model: &PlacementModel<'_>, options: &Options, placed: &Placed) -> Value {
    let (together, alone): (Vec<_>, Vec<_>) = placed.placements.iter().partition(|p| p.series.len() > 1);
    let entries: Vec<Value> = alone.into_iter().map(|p| entry(model, options, placed, p)).collect();
    let together: Vec<Value> = together.into_iter().map(|p| entry_together(model, options, placed, p)).collect();
    let mut document = json!({
        "machine": model.reach.file.name, "machine_sha256": model.reach.file.source.sha256(),
        "job_sha256": model.job.source.sha256(), "method": options.method.name(), "allow_extrapolation": model.extrapolate,
        "seed": is_random(options).then_some(options.seed),
        "series": entries,
        "together": model.job.together.then_some(together),
        "robust": robust(model, options, placed),
    });
    if let Some(pareto) = pareto(model, options, placed) {
        document["pareto"] = pareto;
    }
    document
}

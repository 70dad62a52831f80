//! What is left of the readings, drawn over pose, load and limb force.

use maud::{Markup, html};
use pkm_core::{Machine, Pose, ScrewLengths};

use super::Diagnosis;
use super::compare::Rival;
use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::readings::{CHANNELS, Condition, Readings};
use crate::page::keyed_charts;
use crate::page::plot::{Mark, Panel, Series};
use crate::pose::file_units;

/// Most points of a series: more would only blacken the picture.
const POINTS: usize = 1500;

/// Tension in each limb under a load, by virtual work: how the platform moves when one screw alone grows.
fn tensions(machine: &Machine<f64>, c: &Condition, pose: &Pose<f64>) -> Option<[f64; 3]> {
    const STEP: f64 = 1e-6;
    let q = machine.inverse(pose).ok()?.q_m;
    let place = |limb: usize, step: f64| {
        let mut q = q;
        q[limb] += step;
        machine.forward(&ScrewLengths { q_m: q }).ok()
    };
    let w = c.wrench.moved_to_a(c.point_m.into());
    let mut tension = [0.0; 3];
    for (limb, tension) in tension.iter_mut().enumerate() {
        let (a, b) = (place(limb, STEP)?, place(limb, -STEP)?);
        let rate = |a: f64, b: f64| (a - b) / (2.0 * STEP);
        let [x, _, z] = ((a.a_in_b_m() - b.a_in_b_m()) / (2.0 * STEP)).into();
        let (turn, tilt) = (rate(a.theta_rad, b.theta_rad), rate(a.sigma_rad, b.sigma_rad));
        // from B-xyz to A-uvw: R = R_y(θ) R_x(σ)
        let ((st, ct), (ss, cs)) = (pose.theta_rad.sin_cos(), pose.sigma_rad.sin_cos());
        let moved = [ct * x - st * z, ss * (st * x + ct * z), cs * (st * x + ct * z)];
        let turned = [tilt, turn * cs, -turn * ss];
        *tension = (0..3).map(|i| w.force_n[i] * moved[i] + w.moment_nm[i] * turned[i]).sum();
    }
    Some(tension)
}

/// Residuals along the load, over pose, load and limb force.
pub fn charts(file: &MachineFile, readings: &Readings, d: &Diagnosis) -> Result<Markup> {
    let step = readings.readings.len().div_ceil(POINTS);
    // translation error along the force, µm, of the re-identified stiffnesses and of the identified model
    let along = |predictions: &[[f64; CHANNELS]], n: usize| -> Option<f64> {
        let r = &readings.readings[n];
        let c = &readings.conditions[r.condition];
        let size = c.wrench.force_n.iter().map(|f| f * f).sum::<f64>().sqrt();
        let mut sum = 0.0;
        for i in 0..3 {
            if c.wrench.force_n[i] != 0.0 {
                sum += (r.observed[i]? - predictions[r.condition][i]) * c.wrench.force_n[i] / size;
            }
        }
        (size > 0.0).then_some(sum * 1e6)
    };
    let rivals = [(Rival::Reidentified, "stiffnesses re-identified"), (Rival::After, "identified model")];
    let shown = if d.search.found.is_empty() { &rivals[..1] } else { &rivals[..] };
    type Axis<'a> = (&'a str, Box<dyn Fn(&Condition) -> Option<f64> + 'a>);
    let pose = |i: usize| move |c: &Condition| Some(file_units(&readings.poses[c.pose].pose)[i]);
    let force = |c: &Condition| Some(c.wrench.force_n.iter().map(|f| f * f).sum::<f64>().sqrt());
    let limb = |i: usize| move |c: &Condition| tensions(&file.machine, c, &readings.poses[c.pose].pose).map(|n| n[i]);
    let axes: [Axis<'_>; 6] = [
        ("θ in °", Box::new(pose(0))),
        ("σ in °", Box::new(pose(1))),
        ("Z0 in mm", Box::new(pose(2))),
        ("force in N", Box::new(force)),
        ("tension in limb 1 in N", Box::new(limb(0))),
        ("tension in limb 3 in N", Box::new(limb(2))),
    ];
    // with the readings that the points are of
    let panels = axes.map(|(label, x)| {
        let (series, keys) = (shown.iter())
            .map(|(rival, name)| {
                let predictions = d.own.of(*rival);
                let found = (0..readings.readings.len()).step_by(step).filter_map(|n| {
                    let c = &readings.conditions[readings.readings[n].condition];
                    Some(((x(c)?, along(predictions, n)?), n))
                });
                let (points, keys) = found.unzip();
                (Series { name: (*name).into(), points, mark: Mark::Dot }, keys)
            })
            .unzip();
        let title = format!("Residual over {}", label.rsplit_once(" in ").map_or(label, |(name, _)| name));
        (Panel { title, x_label: label.into(), y_label: "residual along the force, µm".into(), series }, keys)
    });
    let panels: Vec<_> = panels.into_iter().filter(|(p, _)| p.series.iter().any(|s| !s.points.is_empty())).collect();
    if panels.is_empty() {
        return Ok(html! { p { "There are no readings of translation along a force to show." } });
    }
    keyed_charts("Residuals: reading minus model, along the force. Noise shows no pattern.", &panels)
}

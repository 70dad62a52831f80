//! The truth against what is known of it without solving: limits, closed forms, energy.

use nalgebra::{Matrix3, Vector3};
use pkm_frame::Frame;

use super::assembly::{STROKE, telescope};
use super::{Effect, Machine, Pose, Reduced, Row, World, Wrench, forms};

const POSE: Pose = Pose([0.12, -0.08, 0.54]);

fn effect(id: &'static str, variant: usize, amplitude: f64) -> Effect {
    Effect { id, variant, amplitude, shape: [0.0; 8] }
}

fn world(effects: Vec<Effect>) -> World {
    World::new(Machine::reference(), Machine::reference(), effects)
}

/// A load up to its top and down again in equal steps along one axis.
fn ramp(axis: usize, top: f64, steps: usize) -> Vec<Row> {
    let up = (1..=steps).map(|i| (i, false));
    let down = (1..steps).rev().map(|i| (i, true));
    let row = |(i, unload): (usize, bool)| {
        let wrench = Wrench::ith(axis, top * i as f64 / steps as f64);
        Row { pose: 0, wrench, applied: wrench, series: 1, repeat: 1, unload, temperature: 20.0 }
    };
    up.chain(down).map(row).collect()
}

#[test]
fn without_effects_it_is_linear_and_symmetric() {
    let w = world(Vec::new());
    let c = w.reduced(&POSE, 20.0).c;
    assert!((c - c.transpose()).norm() < 1e-9 * c.norm() && c.symmetric_eigenvalues().min() > 0.0);
    let d = w.deflections(&[POSE], &ramp(1, 1000.0, 2), true);
    assert!((d[1] - d[0] * 2.0).norm() < 1e-12 * d[1].norm() && (d[2] - d[0]).norm() < 1e-15);
}

#[test]
fn a_longer_limb_moves_the_tool_by_what_its_tension_says() {
    // a spring in a row with limb 1, solved as a frame and by the reduction: C + bᵀb c/(1 + m c). The tensions of
    // the plain machine follow from balance alone, and m is 0; ground springs have a part in them
    let others = effect("preload", 0, 10.0);
    for others in [vec![], vec![others]] {
        let nothing = [others, vec![effect("clearance", 0, 0.0)]].concat();
        let Reduced { c, b, m, .. } = world(nothing.clone()).reduced(&POSE, 20.0);
        assert_eq!(m.norm() > 1.0, nothing.len() > 1, "{m}");
        assert!((m - m.transpose()).norm() < 1e-4 * m.norm() + 1e-3, "{m}");
        let softer = world([nothing, vec![effect("limb-1-axial", 0, 5.0)]].concat()).reduced(&POSE, 20.0).c;
        let row = b.row(0);
        let expected = c + row.transpose() * row * (5e-9 / (1.0 + m[(0, 0)] * 5e-9));
        let miss = (softer - expected).norm() / (softer - c).norm();
        assert!(miss < 1e-5, "{miss:e}");
    }
}

#[test]
fn a_gap_costs_its_width_and_no_more() {
    let rows = ramp(0, 1000.0, 20);
    let (with, without) = (world(vec![effect("clearance", 0, 10.0)]), world(Vec::new()));
    let (d, linear) = (with.deflections(&[POSE], &rows, true), without.deflections(&[POSE], &rows, true));
    let extra: Vec<f64> = (0..20).map(|i| d[i][0] - linear[i][0]).collect();
    // closed from a few newtons on, then constant
    assert!(extra[0] > 1e-6 && (extra[19] - extra[9]).abs() < 0.05 * extra[19], "{extra:?}");
    let b = with.reduced(&POSE, 20.0).b;
    let most: f64 = (0..3).map(|i| b[(i, 0)].abs() * 5e-6).sum();
    assert!(extra.iter().all(|e| *e <= most * 1.0001), "{} > {most}", extra[19]);
}

#[test]
fn hertz_is_softer_at_small_loads() {
    let d = |w: &World| w.deflections(&[POSE], &ramp(2, 1000.0, 10), true);
    let (with, without) = (d(&world(vec![effect("contact-stiffening", 0, 2.0)])), d(&world(Vec::new())));
    let extra = |i: usize| (with[i][2] - without[i][2]) / (i + 1) as f64;
    // N^(2/3): ten times the load, 10^(-1/3) of the extra compliance, as far as the limbs' forces stay in proportion
    let ratio = extra(9) / extra(0);
    assert!((ratio / 10_f64.powf(-1.0 / 3.0) - 1.0).abs() < 0.05, "{ratio}");
}

#[test]
fn friction_opens_a_loop_that_takes_energy_and_closes_without_it() {
    for variant in 0..2 {
        let rows = ramp(0, 1000.0, 10);
        let d =
            |limit: f64| world(vec![effect("friction-hysteresis", variant, limit)]).deflections(&[POSE], &rows, true);
        let (loop_, none, stuck) = (d(60.0), d(1e-9), d(1e9));
        let linear = world(Vec::new()).deflections(&[POSE], &rows, true);
        for i in 0..9 {
            let unload = rows.len() - 1 - i;
            assert!(loop_[unload][0] > loop_[i][0], "form {variant}: at the same load it stays behind");
            assert!((none[unload] - linear[i]).norm() < 1e-6 * linear[i].norm());
            assert!((stuck[unload] - stuck[i]).norm() < 1e-6 * linear[i].norm());
        }
        assert!(stuck[9][0] < loop_[9][0] && loop_[9][0] < linear[9][0]);
    }
}

#[test]
fn weak_effects_vanish() {
    let bare = world(Vec::new()).deflections(&[POSE], &ramp(1, 1000.0, 2), true);
    for spec in crate::effects::LISTED
        .iter()
        .chain([&crate::effects::COUPLING])
        .chain(&crate::effects::OUTSIDE)
        .chain(&forms::FORMS)
    {
        for variant in 0..spec.variants {
            // a telescope has no such limit
            if spec.id == "telescopic-limb" {
                continue;
            }
            let mut e = effect(spec.id, variant, 1e-5 * spec.range.1);
            e.shape = [0.3, -0.4, 0.5, -0.6, 0.7, -0.2, 0.1, 0.9];
            let d = world(vec![e]).deflections(&[POSE], &ramp(1, 1000.0, 2), true);
            let change = (d[1] - bare[1]).norm() / bare[1].norm();
            assert!(change < 2e-3, "{} form {variant}: {change:e}", spec.id);
        }
    }
}

#[test]
fn a_telescope_is_the_declared_rod_at_mid_stroke_and_softer_when_long() {
    let e = effect("telescopic-limb", 0, 1.0);
    let w = world(vec![e.clone()]);
    let limb = &w.machine.limbs[0];
    let tip = |q: f64| {
        let mut frame = Frame::new();
        let tip = frame.node(Vector3::z() * q);
        let line = (Vector3::zeros(), Vector3::z(), q);
        telescope(&mut frame, (Frame::GROUND, tip), line, &Matrix3::identity(), limb, &e, w.telescope[0], STROKE);
        let c = frame.compliance(tip).unwrap();
        assert!((c[(2, 2)] / (q / limb.section().0) - 1.0).abs() < 1e-9, "the screw carries along the limb");
        c[(0, 0)] / (q.powi(3) / (3.0 * limb.section().1))
    };
    assert!((tip(0.58) - 1.0).abs() < 1e-9 && tip(0.70) > 1.02 && tip(0.46) < 0.98);
}

#[test]
fn a_carrier_between_telescopes_takes_compliance_away() {
    let telescopes = effect("telescopic-limb", 0, 1.0);
    let c = |effects: Vec<Effect>| world(effects).reduced(&POSE, 20.0).c;
    let tied = c(vec![telescopes.clone(), effect("cable-carrier-between-limbs", 0, 1.0)]);
    // no direction becomes softer, and some stiffer
    let taken = (c(vec![telescopes]) - tied).symmetric_eigenvalues();
    assert!(taken.max() > 1e-12 && taken.min() > -1e-9 * taken.max(), "{taken}");
}

#[test]
fn a_hot_machine_is_softer_and_longer() {
    let mut rows = ramp(0, 1000.0, 1);
    rows[0].temperature = 26.0;
    let d = |e: Vec<Effect>| world(e).deflections(&[POSE], &rows, true)[0];
    let bare = d(Vec::new());
    assert!(d(vec![effect("thermal-modulus", 0, 0.1)])[0] > bare[0]);
    // all lengths by the same share: nearly along the line from B to A, by more than that share of it
    let grown = d(vec![effect("thermal-expansion", 0, 1.0)]) - bare;
    let far = Vector3::new(grown[0], grown[1], grown[2]).norm();
    assert!((3e-6..2e-5).contains(&far), "{far}");
}

//! Blocks of a stretch of a screw that is worn: a limb is softer along its axis about one of its lengths.

use std::sync::Arc;

use pkm_core::effects::Element;
use pkm_diagnosis::{Prior, Role};

use super::elastic::{Frame, M8};
use super::limbs::{AXIAL, part};
use super::terms::Term;
use super::{Blocks, Says};
use crate::diagnose::elements::{ElementParameter, LOCAL};

/// Half lengths of the stretch, in parts of the lengths over which the limb was read.
const HALVES: [f64; 3] = [1.0 / 6.0, 1.0 / 3.0, 2.0 / 3.0];
/// How far middles are from each other, in half lengths.
const STEP: f64 = 0.5;
/// How far a fit may move a middle, and change a half length, in half lengths.
const FREEDOM: f64 = 0.25;

/// A worn stretch of a limb.
#[derive(Clone)]
pub struct Stretch {
    limb: usize,
    at_m: f64,
    half_m: f64,
    /// Compliance of an amplitude of 1, m/N.
    unit: f64,
}

impl Stretch {
    /// Share of the wear at a length, and what it changes by where the middle moves, and the half length grows, by the freedom that a fit has.
    fn shares(&self, q: f64) -> [f64; 3] {
        let off = (q - self.at_m) / self.half_m;
        let left = (1.0 - off * off).max(0.0);
        let slope = 4.0 * FREEDOM * off * left;
        [left * left, slope, slope * off]
    }

    /// How much, where and how long: as parameters of an element, and where a fit of them begins.
    pub fn parameters(&self, amplitudes: &[f64]) -> Option<(Vec<ElementParameter>, Vec<f64>)> {
        let [amplitude, moved, grown] = *amplitudes else { return None };
        let shape = |change: f64| (change / amplitude).clamp(-1.0, 1.0);
        let start = vec![amplitude.signum(), shape(moved), shape(grown)];
        let mut template = Element::from_names(&part(self.limb, "body"), "axial", "extension", [])?;
        template.parameters[LOCAL + 1] = self.at_m;
        template.parameters[LOCAL + 2] = self.half_m;
        let freedom = (FREEDOM * self.half_m, Role::Shape);
        let all = [((self.unit * amplitude).abs(), Role::Amplitude { one_sided: false }), freedom, freedom];
        let of = |(n, (scale, role)): (usize, (f64, Role))| ElementParameter {
            elements: vec![template],
            index: LOCAL + n,
            prior: Prior::Normal { scale },
            role,
        };
        Some((all.into_iter().enumerate().map(of).collect(), start))
    }
}

/// Adds all of them.
pub fn add(blocks: &mut Blocks<'_>) {
    for limb in 0..3 {
        let stretches = stretches(blocks, limb);
        let ln_prior = -(stretches.len() as f64).ln();
        for stretch in stretches {
            let of = |share: usize| {
                let of = |f: &Frame| {
                    let mut e = M8::zeros();
                    let k = AXIAL[limb];
                    e[(k, k)] = stretch.unit * stretch.shares(f.q[limb])[share];
                    e
                };
                Term::Elastic(Arc::new(blocks.frames.iter().map(of).collect()))
            };
            let terms = (0..3).map(of).collect();
            blocks.add_with(&[part(limb, "body")], "axial", "extension", terms, 0, ln_prior);
            blocks.write_last(Says::Stretch(stretch));
        }
    }
}

/// All that are tried of a limb.
fn stretches(blocks: &Blocks<'_>, limb: usize) -> Vec<Stretch> {
    let lengths = || blocks.frames.iter().map(|f| f.q[limb]);
    let (least, most) = (lengths().fold(f64::INFINITY, f64::min), lengths().fold(0.0, f64::max));
    let unit = blocks.usual.0[(AXIAL[limb], AXIAL[limb])];
    let of = |share: f64| {
        let half_m = share * (most - least);
        let steps = (1.0 / (share * STEP)).round() as usize;
        let at = move |n: usize| least + (most - least) * n as f64 / steps as f64;
        (0..=steps).map(move |n| Stretch { limb, at_m: at(n), half_m, unit })
    };
    // of a single length there is no stretch
    if most > least { HALVES.into_iter().flat_map(of).collect() } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the middle and the half length change is what the shares of a stretch change that is elsewhere, or longer.
    #[test]
    fn columns_of_the_shape_are_derivatives() {
        let stretch = Stretch { limb: 1, at_m: 0.5, half_m: 0.08, unit: 1.0 };
        let step = 1e-6;
        for n in 0..40 {
            let q = 0.4 + 0.005 * f64::from(n);
            let slope = |change: &dyn Fn(&mut Stretch, f64)| {
                let at = |size: f64| {
                    let mut changed = stretch.clone();
                    change(&mut changed, size * step * FREEDOM * stretch.half_m);
                    changed.shares(q)[0]
                };
                (at(1.0) - at(-1.0)) / (2.0 * step)
            };
            let [_, moved, grown] = stretch.shares(q);
            assert!((slope(&|s, by| s.at_m += by) - moved).abs() < 1e-6, "{q}");
            assert!((slope(&|s, by| s.half_m += by) - grown).abs() < 1e-6, "{q}");
        }
    }
}

//! Blocks of what stands beside the mechanism: a cable carrier between two limbs, a pack of hoses from the base to the platform. A spring
//! there adds to the stiffness, so that it is no compliance that the transmitted wrenches meet.

use std::sync::Arc;

use nalgebra::{Vector3, Vector6};
use pkm_core::LimbFrame;
use pkm_core::effects::{Motion, Place};

use super::coupled::Written;
use super::elastic::{Frame, M6};
use super::limbs::part;
use super::measurement::LN_PRIOR_OF_ODDITIES;
use super::terms::Term;
use super::{Blocks, Says};

/// Motion of a tie: both ends against each other.
pub const TIED: &str = "tied";
/// Stiffness of a tie in units of that of the mechanism.
const SHARE: f64 = 0.05;
/// Pairs of limbs.
const PAIRS: [[usize; 2]; 3] = [[0, 2], [1, 2], [0, 1]];

/// Adds a tie for each pair of limbs, and one from the base to the moving platform.
pub fn add(blocks: &mut Blocks<'_>) {
    let usual: Vec<f64> = (0..6).map(|i| blocks.usual.1[(i, i)]).collect();
    let unit = SHARE * 3.0 / usual.iter().take(3).sum::<f64>();
    for limbs in PAIRS {
        let places = limbs.map(|limb| part(limb, "body"));
        let motion = if limbs[1] == 2 { Motion::TiedToLimb3 } else { Motion::TiedToLimb2 };
        let written = Written::tie(Place::Body { limb: limbs[0] as u8 + 1 }, motion, &[unit; 3]);
        let pull = |f: &Frame, axis| LimbFrame::tied(limbs.map(|limb| &f.limbs[limb]), &Vector3::ith(axis, 1.0));
        add_tie(blocks, &places, &pull, written);
    }
    let units: Vec<f64> = usual.iter().map(|c| SHARE / c).collect();
    let places = [Place::MovingPlatform, Place::Base].map(|place| place.name().unwrap_or_default().to_owned());
    let written = Written::tie(Place::MovingPlatform, Motion::TiedToBase, &units);
    add_tie(blocks, &places, &|_, axis| Vector6::ith(axis, 1.0), written);
}

/// Adds springs along axes, by the wrench that each does at A per unit of its force.
fn add_tie(blocks: &mut Blocks<'_>, places: &[String], pull: &dyn Fn(&Frame, usize) -> Vector6<f64>, written: Written) {
    let count = written.units.len();
    let mut terms = Vec::new();
    for i in 0..count {
        for j in 0..=i {
            let unit = 0.5 * (written.units[i] * written.units[j]).sqrt();
            let of = |f: &Frame| {
                let (a, b) = (pull(f, i), pull(f, j));
                (a * b.transpose() + b * a.transpose()) * unit
            };
            let all: Vec<M6> = blocks.frames.iter().map(of).collect();
            terms.push(Term::Beside(Arc::new(all)));
        }
    }
    blocks.add_with(places, TIED, "constant", terms, count, LN_PRIOR_OF_ODDITIES);
    blocks.write_last(Says::Directions(written));
}

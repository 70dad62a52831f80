//! Blocks of what ties two limbs together: a cable carrier, a pack of hoses. A spring beside the mechanism adds to its stiffness, so
//! that it is no compliance that the transmitted wrenches meet.

use std::sync::Arc;

use nalgebra::Vector3;
use pkm_core::LimbFrame;
use pkm_core::effects::Motion;

use super::Blocks;
use super::coupled::Written;
use super::elastic::{Frame, M6};
use super::limbs::part;
use super::measurement::LN_PRIOR_OF_ODDITIES;
use super::terms::Term;

/// Motion of a tie: both ends against each other.
pub const TIED: &str = "tied";
/// Stiffness of a tie in units of that of the mechanism.
const SHARE: f64 = 0.05;
/// Pairs of limbs.
const PAIRS: [[usize; 2]; 3] = [[0, 2], [1, 2], [0, 1]];

/// Adds a tie for each pair of limbs.
pub fn add(blocks: &mut Blocks<'_>) {
    let usual = blocks.usual.1;
    let unit = SHARE * 3.0 / (0..3).map(|i| usual[(i, i)]).sum::<f64>();
    for limbs in PAIRS {
        let mut terms = Vec::new();
        for i in 0..3 {
            for j in 0..=i {
                let of = |f: &Frame| {
                    let pull = |axis| LimbFrame::tied(limbs.map(|limb| &f.limbs[limb]), &Vector3::ith(axis, 1.0));
                    let (a, b) = (pull(i), pull(j));
                    (a * b.transpose() + b * a.transpose()) * (0.5 * unit)
                };
                let all: Vec<M6> = blocks.frames.iter().map(of).collect();
                terms.push(Term::Beside(Arc::new(all)));
            }
        }
        let places = limbs.map(|limb| part(limb, "body"));
        blocks.add_with(&places, TIED, "constant", terms, 3, LN_PRIOR_OF_ODDITIES);
        let motion = if limbs[1] == 2 { Motion::TiedToLimb3 } else { Motion::TiedToLimb2 };
        blocks.write_last(Written::tie(limbs[0], motion, unit));
    }
}

//! Cutting forces, estimated: Kienzle's law over the edges of a tool, as the mean over a turn.
//!
//! An edge that takes a chip of thickness h and width b is pushed against its cutting velocity by kc1.1·b·h^(1−mc), and toward the
//! tool's axis by a fixed share of that. A mill's chip has h = f_z·cos ψ·sin κ at the angle ψ from the feed: integrated over the angles of
//! engagement. A drill has thrust and torque as in Sandvik Coromant's formulas. Sources and limits: docs/cutting.md.

use std::f64::consts::{FRAC_PI_2, PI};

use pkm_core::Wrench;
use pkm_core::nalgebra::Vector3;

use crate::files::cutting::{Cut, Engagement, Side};

/// Intervals of Simpson's rule: 1e-4 of the force with an exponent of 0.3, far below what the law is worth.
const INTERVALS: u32 = 64;
/// A mill that feeds more steeply than this share across its axis bores.
const MIN_ACROSS: f64 = 0.1;

/// Mean force on a mill that feeds across its axis, the spindle turning clockwise.
#[derive(Clone, Copy, Default, Debug, PartialEq)]
pub struct MeanForce {
    /// Along the feed, N.
    pub feed_n: f64,
    /// Along axis × feed, where the axis points from flange to tip: to the right of the feed as seen from the spindle, N.
    pub right_n: f64,
    /// Along the axis, N.
    pub axial_n: f64,
    /// About the axis, N·m.
    pub torque_nm: f64,
}

/// The first and the last angle of engagement from the feed, rad.
fn engaged(engagement: &Engagement, diameter_mm: f64) -> [f64; 2] {
    let share = engagement.width_mm / diameter_mm;
    match engagement.side {
        Side::Climb => [(1.0 - 2.0 * share).asin(), FRAC_PI_2],
        Side::Conventional => [-FRAC_PI_2, -(1.0 - 2.0 * share).asin()],
        Side::Centre => [-share.asin(), share.asin()],
    }
}

/// Of a mill that feeds across its axis; none of a drill.
pub fn milling(cut: &Cut) -> MeanForce {
    let Some(engagement) = &cut.cutter.engagement else { return MeanForce::default() };
    let lead = cut.cutter.lead_deg.to_radians().sin();
    let [from, to] = engaged(engagement, cut.cutter.diameter_mm);
    let width_mm = engagement.depth_mm / lead;
    let tangential = |angle: f64| {
        let thickness_mm = (cut.feed_per_tooth_mm * angle.cos() * lead).max(0.0);
        cut.material.kc1_1_n_per_mm2 * width_mm * thickness_mm.powf(1.0 - cut.material.mc)
    };
    // of tangential force, and of its parts along the feed and to the right
    let mut sums = [0.0; 3];
    let step = (to - from) / f64::from(INTERVALS);
    for n in 0..=INTERVALS {
        let weight = if n == 0 || n == INTERVALS { 1.0 } else { f64::from(2 + 2 * (n % 2)) };
        let angle = from + f64::from(n) * step;
        let force = weight * step / 3.0 * tangential(angle);
        for (sum, part) in sums.iter_mut().zip([1.0, angle.cos(), angle.sin()]) {
            *sum += force * part;
        }
    }
    let [all, along, right] = sums.map(|sum| sum * f64::from(cut.cutter.teeth) / (2.0 * PI));
    let radial = cut.material.radial_ratio;
    MeanForce {
        feed_n: right - radial * along,
        right_n: -along - radial * right,
        axial_n: -cut.material.axial_ratio * all,
        torque_nm: -all * cut.cutter.diameter_mm / 2e3,
    }
}

/// Thrust in N and torque in N·m of a drill.
fn drilling(cut: &Cut, feed_per_tooth_mm: f64) -> [f64; 2] {
    let (lead, diameter_mm) = (cut.cutter.lead_deg.to_radians().sin(), cut.cutter.diameter_mm);
    let specific = cut.material.kc1_1_n_per_mm2 * (feed_per_tooth_mm * lead).powf(-cut.material.mc);
    let feed_per_turn_mm = feed_per_tooth_mm * f64::from(cut.cutter.teeth);
    let thrust_n = 0.5 * specific * diameter_mm / 2.0 * feed_per_turn_mm * lead;
    [thrust_n, specific * feed_per_turn_mm * diameter_mm.powi(2) / 8e3]
}

/// The load on a tool at its tip in the axes of T_h, whose tip moves along `direction` in these axes. `mean` is what [`milling`] says of the cut.
pub fn wrench(cut: &Cut, mean: &MeanForce, direction: &Vector3<f64>) -> Wrench<f64> {
    let (across, all) = (direction.x.hypot(direction.y), direction.norm());
    if across >= MIN_ACROSS * all && all > 0.0 && cut.cutter.engagement.is_some() {
        let feed = Vector3::new(direction.x, direction.y, 0.0) / across;
        let right = Vector3::z().cross(&feed);
        let share = (across / all).powf(1.0 - cut.material.mc);
        let force_n = (feed * mean.feed_n + right * mean.right_n + Vector3::z() * mean.axial_n) * share;
        return Wrench { force_n, moment_nm: Vector3::z() * (mean.torque_nm * share) };
    }
    if direction.z <= 0.0 {
        return Wrench::ZERO;
    }
    let [thrust_n, torque_nm] = drilling(cut, cut.feed_per_tooth_mm * direction.z / all);
    Wrench { force_n: Vector3::new(0.0, 0.0, -thrust_n), moment_nm: Vector3::new(0.0, 0.0, -torque_nm) }
}

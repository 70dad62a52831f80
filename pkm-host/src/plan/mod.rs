//! Where to measure, where to put the workpiece, how stiff the machine is where, and how to move the tool.

pub mod compensate;
pub mod cutting;
pub mod feed;
pub mod inverse_all;
pub mod map;
pub mod model;
pub mod place;
pub mod play;
pub mod poses;
pub mod reach;
pub mod track;

/// Farther than a machine tool yields, m: loads in other units.
const IMPLAUSIBLE_M: f64 = 1e-3;

/// What is said of the greatest displacement of a tip where it is hardly one; `moves` says what does what to it.
pub(crate) fn implausible_load(moves: &str, most_m: f64) -> Option<String> {
    (most_m > IMPLAUSIBLE_M).then(|| {
        format!(
            "{moves} {:.2} mm, farther than a machine tool yields: are forces in N and moments in N·m?",
            most_m * 1e3
        )
    })
}

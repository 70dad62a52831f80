//! A compensated path as configurations, to be played.

use pkm_core::{Configuration, Wrench};

use crate::error::Result;
use crate::files::machine::MachineFile;
use crate::files::path::Move;
use crate::plan::reach::Reach;

/// Between two points: of the tip in m, of the axis or a wrist's joint in rad. Finer than a page can show.
const STEP: [f64; 2] = [2e-3, 0.02];
/// Most points.
const MAX_POINTS: f64 = 5000.0;

/// A point of a path.
pub struct PlayedPoint {
    /// Line of the file that leads to it.
    pub line: u64,
    /// Where the five axes stand.
    pub configuration: Configuration<f64>,
    /// On the tool at its tip in its own axes.
    pub wrench: Wrench<f64>,
    /// Whether it ends a rapid move, or one that begins nobody knows where.
    pub is_rapid: bool,
}

/// Goes along a path from home, as `compensate` does, after a rapid move that begins nobody knows where by the nearest configuration again, in at most 5000 points.
///
/// # Errors
/// The line at which the machine cannot take the tool.
pub fn played(file: &MachineFile, name: &str, moves: &[Move]) -> Result<Vec<PlayedPoint>> {
    let reach = Reach::new(file)?;
    let steps = |a: &Move, b: &Move, longer: f64| {
        let [way, turn] = a.to.apart(&b.to);
        if b.is_fresh { 1.0 } else { (way / STEP[0]).max(turn / STEP[1]) / longer }
    };
    let all: f64 = moves.windows(2).map(|w| steps(&w[0], &w[1], 1.0)).sum();
    let longer = (all / MAX_POINTS).max(1.0);
    let every = (moves.len() as f64 / MAX_POINTS).ceil().max(1.0) as usize;
    let mut near = reach.home();
    let mut points = Vec::new();
    for (index, mv) in moves.iter().enumerate() {
        let before = index.checked_sub(1).map(|i| &moves[i]);
        let from = before.filter(|_| !mv.is_fresh);
        let n = from.map_or(1, |from| steps(from, mv, longer).ceil().max(1.0) as usize);
        for k in 1..=n {
            let share = k as f64 / n as f64;
            let place = from.map_or(mv.to, |from| from.to.between(&mv.to, share));
            let stood = reach.along_path(&place, &near, from.is_none());
            near = stood.map_err(|f| f.in_file(name).at_line(mv.line))?.configuration;
            // the last always, of many short moves some
            if index + 1 == moves.len() || index % every == 0 {
                let is_rapid = mv.is_rapid || mv.is_fresh;
                let wrench = mv.load.given(share).unwrap_or(Wrench::ZERO);
                points.push(PlayedPoint { line: mv.line, configuration: near, wrench, is_rapid });
            }
        }
    }
    Ok(points)
}

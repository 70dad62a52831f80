//! Why no position reaches every hole.

use rayon::prelude::*;

use super::Miss;
use super::search::{Options, Searcher, lattice};
use super::targets::Target;
use crate::error::Failure;
use crate::files::job::Position;

impl Searcher<'_> {
    /// How far a hole is from being reached, as which status, and in words.
    fn shortfall(
        &self,
        reached: &std::result::Result<(), Miss>,
        hole: usize,
        position: &Position,
    ) -> Option<(f64, &'static str, String)> {
        let model = self.model;
        Some(match reached {
            Err(Miss::Table) => {
                (0.0, "outside_box", "outside of the table's box (see --allow-extrapolation)".to_owned())
            }
            Err(Miss::Stiffness) => (0.0, "unreachable", "without a stiffness of the model".to_owned()),
            _ => {
                let (far, words) = model.reach.shortfall(&model.tool(&self.targets[hole], position))?;
                if words.is_empty() {
                    (far, "singular", "too near a singularity of the five axes".to_owned())
                } else {
                    (far, "out_of_travel", words)
                }
            }
        })
    }

    /// Why no position reaches every hole: which hole, and by how much.
    pub(super) fn unreachable(&self, options: &Options) -> Failure {
        let (model, targets) = (self.model, &self.targets);
        let lattice = lattice(model.job);
        let at = |position: &Position| {
            let turned = if model.job.rotary.is_some() {
                format!(", {:.1}°", position.rotary_rad.to_degrees())
            } else {
                String::new()
            };
            format!("dx = {:.1} mm, dy = {:.1} mm{turned}", position.dx_m * 1e3, position.dy_m * 1e3)
        };
        let fail = |status, message: String| Failure::refused(status, message).in_file(&model.job.source.name);
        let reached = |position: &Position| -> Vec<std::result::Result<(), Miss>> {
            let each = |target: &Target<'_>| model.postures(target, position).map(drop);
            targets.iter().map(each).collect()
        };
        let all: Vec<_> = lattice.par_iter().map(|position| (*position, reached(position))).collect();
        let count = |hole: usize| all.iter().filter(|(_, reached)| reached[hole].is_ok()).count();
        let hole = (0..targets.len()).min_by_key(|hole| count(*hole)).unwrap_or(0);
        let named = format!("hole {} of {}", hole + 1, self.name);
        // where most holes are in reach, and this one is nearest to it
        let most = all.iter().map(|(_, reached)| reached.iter().filter(|r| r.is_ok()).count()).max().unwrap_or(0);
        if let Some((position, _)) = all.iter().find(|(_, reached)| reached.iter().all(|r| r.is_ok())) {
            let step = options.step_m * 1e3;
            return Failure::usage(format!(
                "{}: the grid of --step-mm {step} is too coarse: no position of it reaches every hole, {} does",
                self.name,
                at(position)
            ));
        }
        let alone = count(hole) == 0;
        let candidates =
            all.iter().filter(|(_, reached)| alone || reached.iter().filter(|r| r.is_ok()).count() == most);
        let nearest = candidates
            .flat_map(|(position, reached)| {
                let missing = (0..targets.len()).filter(|h| reached[*h].is_err() && (!alone || *h == hole));
                missing.map(move |h| (position, h, &reached[h])).collect::<Vec<_>>()
            })
            .filter_map(|(position, h, reached)| {
                let (far, status, words) = self.shortfall(reached, h, position)?;
                Some((far, h, status, format!("{words} at {}", at(position))))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        match (alone, nearest) {
            (true, Some((_, _, status, words))) => {
                fail(status, format!("{named} is out of reach from every position tried; nearest is: {words}"))
            }
            (true, None) => fail(
                "unreachable",
                format!(
                    "{named} is out of reach from every position tried, whatever travel and limits are: is its axis towards the machine's back, or its tip beside or behind the base?"
                ),
            ),
            (false, nearest) => {
                let (h, status, words) = nearest
                    .map_or((hole, "unreachable", String::new()), |(_, h, status, words)| {
                        (h, status, format!(": {words}"))
                    });
                let message = format!(
                    "{1}: the best position reaches {most} of {0} holes; hole {2} is out of reach{words}",
                    targets.len(),
                    self.name,
                    h + 1
                );
                fail(status, message)
            }
        }
    }
}

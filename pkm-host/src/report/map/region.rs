//! What the machine reaches, in convex pieces with their borders.

use std::ops::Range;

use super::contour::{self, Corner};
use crate::error::{Failure, Result};
use crate::files::machine::MachineFile;
use crate::plan::map::{Map, Model, theta_deg};
use crate::pose::pose_of;

/// Cells along the longer side of the picture's own grid: it is smooth whatever the step of the map.
const CELLS: f64 = 160.0;
/// Of a screw's length, m: nearer is on the border.
const ON_BORDER: f64 = 1e-9;
/// Bisections on the way to a border that has no formula: to 1e-6 of a cell.
const BISECTIONS: usize = 20;

/// What is known at a corner: k11…k66; how far each screw is above its least and below its greatest length, m; and
/// two that are 0 on the border of a singularity, of limbs 1 and 2 or of limb 3; and how far the table may be off, m/N.
pub(super) const KNOWN: usize = U95 + 1;
/// Where the last one of these stands.
pub(super) const U95: usize = 6 + LIMITS + 2;
pub(super) const LIMITS: usize = 6;

pub(super) type Place = Corner<KNOWN>;

/// What the machine reaches and the model has a value for, in convex pieces, and its borders.
pub(super) struct Region {
    pub(super) pieces: Vec<Vec<Place>>,
    /// At the six ends of travel as far as they end the region, and at the two singularities wherever they are.
    pub(super) borders: [Vec<[[f64; 2]; 2]>; LIMITS + 2],
}

impl Region {
    pub(super) fn new(file: &MachineFile, model: &Model<'_>, map: &Map) -> Result<Self> {
        // values beyond the ends of travel put the border where it is, not at the next corner of the grid
        let free = file.without_travel().ok_or_else(|| Failure::other("no machine without travel"))?;
        let travel = &file.parameters.travel;
        // what is no singularity is no border worth a line
        let place = |at: [f64; 2]| -> std::result::Result<Place, bool> {
            let pose = pose_of(theta_deg(at), map.sigma_deg, at[1]);
            let lengths = free.inverse(&pose).map_err(|_| at[1] > 0.0)?;
            let value = model(&free, &pose).map_err(|status| ["singular", "unreachable"].contains(&status))?;
            let mut values = [1.0; KNOWN];
            values[..6].copy_from_slice(&value.principal);
            values[U95] = value.u95_m_per_n.unwrap_or(0.0);
            for (i, q_m) in lengths.q_m.iter().enumerate() {
                values[6 + 2 * i] = q_m - travel.min_m[i];
                values[7 + 2 * i] = travel.max_m[i] - q_m;
            }
            Ok(Place { at, values })
        };
        let border = |from: &Place, to: [f64; 2], singular: bool| {
            let (mut last, mut beyond) = (*from, to);
            for _ in 0..BISECTIONS {
                let middle = [0, 1].map(|i| (last.at[i] + beyond[i]) / 2.0);
                match place(middle) {
                    Ok(found) => last = found,
                    Err(_) => beyond = middle,
                }
            }
            let distance = free.singularity_distance(&pose_of(theta_deg(last.at), map.sigma_deg, last.at[1]));
            if let Some(distance) = distance.ok().filter(|_| singular) {
                last.values[6 + LIMITS + usize::from(distance.limb_3 < distance.limbs_1_2)] = 0.0;
            }
            last
        };

        let extent = map.grid.extent_mm();
        let longest = extent.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
        let cells = extent.map(|[low, high]| ((high - low) / longest * CELLS).ceil().max(8.0) as usize);
        let along = |axis: usize, n: usize| {
            let [low, high] = extent[axis];
            low + (high - low) * n as f64 / cells[axis] as f64
        };
        let corner = |column: usize, row: usize| {
            let at = [along(0, column), along(1, row)];
            (at, place(at))
        };
        let row = |row: usize| (0..=cells[0]).map(|column| corner(column, row)).collect::<Vec<_>>();
        let mut region = Self { pieces: Vec::new(), borders: Default::default() };
        let mut below = row(0);
        for n in 1..=cells[1] {
            let above = row(n);
            for c in 0..cells[0] {
                let square = [&below[c], &below[c + 1], &above[c + 1], &above[c]];
                for triangle in [[0, 1, 2], [0, 2, 3]] {
                    let mut polygon = Vec::new();
                    for i in 0..3 {
                        let ((a_at, a), (b_at, b)) = (square[triangle[i]], square[triangle[(i + 1) % 3]]);
                        polygon.extend(a.ok());
                        match (a, b) {
                            (Ok(a), Err(singular)) => polygon.push(border(a, *b_at, *singular)),
                            (Err(singular), Ok(b)) => polygon.push(border(b, *a_at, *singular)),
                            _ => {}
                        }
                    }
                    region.add_borders(&polygon, LIMITS..LIMITS + 2);
                    let polygon = (6..6 + LIMITS).fold(polygon, |p, limit| contour::above(&p, limit, 0.0));
                    region.add_borders(&polygon, 0..LIMITS);
                    if polygon.len() > 2 {
                        region.pieces.push(polygon);
                    }
                }
            }
            below = above;
        }
        Ok(region)
    }

    fn add_borders(&mut self, polygon: &[Place], which: Range<usize>) {
        for border in which {
            let on = |c: &Place| c.values[6 + border].abs() <= ON_BORDER;
            let edges = contour::edges(polygon).filter(|[a, b]| on(a) && on(b) && a.at != b.at);
            self.borders[border].extend(edges.map(|e| e.map(|c| c.at)));
        }
    }

    /// The screws that a border is drawn for; at σ = 0 those of limbs 1 and 2 may be the same.
    pub(super) fn limbs(&self, limit: usize) -> &'static [usize] {
        let same = self.borders[limit % 2] == self.borders[2 + limit % 2];
        match limit / 2 {
            _ if self.borders[limit].is_empty() => &[],
            0 if same => &[1, 2],
            1 if same => &[],
            limb => [&[1], &[2], &[3]][limb],
        }
    }
}

//! Second-order meshes of round bars and of plates with bores: hexahedra and wedges, in the part's own axes.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

use spade::handles::FixedFaceHandle;
use spade::{
    AngleLimit, ConstrainedDelaunayTriangulation, DelaunayTriangulation, Point2, RefinementParameters, Triangulation,
};

use crate::files::solid::{Bar, Plate};

/// Nodes and elements of one material, numbered from 0.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// m.
    pub nodes: Vec<[f64; 3]>,
    /// Twenty nodes each, in CalculiX's order.
    pub hexahedra: Vec<[usize; 20]>,
    /// Fifteen nodes each.
    pub wedges: Vec<[usize; 15]>,
}

/// A bar along z, and the nodes of its cross-sections at the stations that were asked for.
#[derive(Clone, Debug)]
pub struct BarMesh {
    /// Of the bar.
    pub mesh: Mesh,
    /// Nodes of each station's plane.
    pub sections: Vec<Vec<usize>>,
}

/// A plate in the plane z = 0, and the nodes on its bores and on its outer edge.
#[derive(Clone, Debug)]
pub struct PlateMesh {
    /// Of the plate.
    pub mesh: Mesh,
    /// Nodes on the wall of each bore.
    pub bores: Vec<Vec<usize>>,
    /// Nodes on the edge.
    pub edge: Vec<usize>,
}

/// Nodes by whole-number coordinates.
struct Numbered<K> {
    known: BTreeMap<K, usize>,
    nodes: Vec<[f64; 3]>,
}

impl<K: Ord> Numbered<K> {
    fn new() -> Self {
        Self { known: BTreeMap::new(), nodes: Vec::new() }
    }

    fn at(&mut self, key: K, place: impl FnOnce() -> [f64; 3]) -> usize {
        *self.known.entry(key).or_insert_with(|| {
            self.nodes.push(place());
            self.nodes.len() - 1
        })
    }
}

/// How often something is divided: at least `least` times, more for a smaller `size` of elements.
fn divisions(length: f64, element: f64, least: usize) -> usize {
    // a hair less, so that rounding decides nothing
    ((length / element - 1e-9).ceil() as usize).max(least)
}

/// Nodes of an element of second order: corners below and above, middles of sides below and above, midpoints of the vertical edges.
fn element<const SIDES: usize, const NODES: usize>(
    corners: [(usize, usize); SIDES],
    middles: [(usize, usize); SIDES],
    mut node: impl FnMut((usize, usize), usize) -> usize,
) -> [usize; NODES] {
    let layers = [(corners, 0), (corners, 2), (middles, 0), (middles, 2), (corners, 1)];
    let mut all = layers.into_iter().flat_map(|(places, up)| places.map(|place| (place, up)));
    std::array::from_fn(|_| {
        let (place, up) = all.next().expect("five layers");
        node(place, up)
    })
}

/// A bar with cross-sections at the stations, in ascending order; `size` 1 is the usual fineness, 0.5 twice as fine.
pub fn bar(bar: &Bar, stations: &[f64], size: f64) -> BarMesh {
    let around = divisions(12.0, size, 4);
    let (outer, inner) = (0.5 * bar.outer_m, 0.5 * bar.inner_m);
    let mut heights = vec![stations[0]];
    let mut planes = vec![0];
    for pair in stations.windows(2) {
        let n = divisions(pair[1] - pair[0], 0.75 * bar.outer_m * size, 1);
        heights.extend((1..=n).map(|i| pair[0] + (pair[1] - pair[0]) * i as f64 / n as f64));
        planes.push(2 * (heights.len() - 1));
    }

    // all by half steps: around, across the wall (0 inside, 2 outside), along
    let mut numbered = Numbered::new();
    let mut node = |i: usize, j: usize, k: usize| {
        let i = i % (2 * around);
        // on the axis of a solid bar all directions are one
        let i = if inner == 0.0 && j == 0 { 0 } else { i };
        numbered.at((k, j, i), || {
            let radius = inner + (outer - inner) * j as f64 / 2.0;
            let angle = PI * i as f64 / around as f64;
            let z = 0.5 * (heights[k / 2] + heights[k.div_ceil(2)]);
            [radius * angle.cos(), radius * angle.sin(), z]
        })
    };
    let (mut hexahedra, mut wedges) = (Vec::new(), Vec::new());
    for k in (0..2 * (heights.len() - 1)).step_by(2) {
        for i in (0..2 * around).step_by(2) {
            let at = |(turn, j), up| node(i + turn, j, k + up);
            if inner > 0.0 {
                hexahedra.push(element([(0, 0), (0, 2), (2, 2), (2, 0)], [(0, 1), (1, 2), (2, 1), (1, 0)], at));
            } else {
                wedges.push(element([(0, 0), (0, 2), (2, 2)], [(0, 1), (1, 2), (2, 1)], at));
            }
        }
    }
    let sections = planes
        .iter()
        .map(|plane| numbered.known.iter().filter(|((k, ..), _)| k == plane).map(|(_, n)| *n).collect())
        .collect();
    BarMesh { mesh: Mesh { nodes: numbered.nodes, hexahedra, wedges }, sections }
}

/// Most points of a plate's plane.
const MAX_POINTS: usize = 30_000;

/// A plate's plane as triangles, and those of them that are outside.
type Plane = (ConstrainedDelaunayTriangulation<Point2<f64>>, BTreeSet<usize>);

fn on_circle([x, y]: [f64; 2], radius: f64, n: usize, of: usize) -> Point2<f64> {
    let angle = 2.0 * PI * n as f64 / of as f64;
    Point2::new(x + radius * angle.cos(), y + radius * angle.sin())
}

/// The outline of a plate: hull of the rims, its long sides divided.
fn outline(plate: &Plate, bores: &[([f64; 2], f64)], element: f64) -> Vec<Point2<f64>> {
    let mut rims = DelaunayTriangulation::<Point2<f64>>::new();
    for (at, diameter) in bores {
        for n in 0..32 {
            rims.insert(on_circle(*at, 0.5 * diameter + plate.rim_m, n, 32)).expect("a finite point");
        }
    }
    let mut outline = Vec::new();
    for side in rims.convex_hull() {
        let [from, to] = side.positions();
        let n = divisions((to.x - from.x).hypot(to.y - from.y), element, 1);
        outline.extend((0..n).map(|i| {
            let share = i as f64 / n as f64;
            Point2::new(from.x + share * (to.x - from.x), from.y + share * (to.y - from.y))
        }));
    }
    outline
}

/// The plane within an outline, without the bores; `None` when it takes too many elements.
fn plane(outline: Vec<Point2<f64>>, bores: &[([f64; 2], f64)], element: f64, size: f64) -> Option<Plane> {
    let triangle = 3.0_f64.sqrt() / 4.0 * element * element;
    let next = outline.iter().cycle().skip(1);
    let area: f64 = outline.iter().zip(next).map(|(a, b)| 0.5 * (a.x * b.y - a.y * b.x)).sum();
    // two triangles a point
    if area.abs() > 2.0 * triangle * MAX_POINTS as f64 {
        return None;
    }
    let mut flat = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    flat.add_constraint_edges(outline, true).expect("finite points");
    for (at, diameter) in bores {
        let around = divisions(16.0, size, 12).max(divisions(PI * diameter, element, 1));
        let wall = (0..around).map(|n| on_circle(*at, 0.5 * diameter, n, around));
        flat.add_constraint_edges(wall, true).expect("finite points");
    }
    let parameters = RefinementParameters::new()
        .exclude_outer_faces(true)
        .keep_constraint_edges()
        .with_angle_limit(AngleLimit::from_deg(25.0))
        .with_max_allowed_area(triangle)
        .with_max_additional_vertices(MAX_POINTS);
    let refined = flat.refine(parameters);
    if !refined.refinement_complete {
        return None;
    }
    let outside: BTreeSet<usize> = refined.excluded_faces.iter().map(FixedFaceHandle::index).collect();
    Some((flat, outside))
}

/// A plate with its bores, each with its centre and its diameter; `None` when it takes too many elements.
pub fn plate(plate: &Plate, bores: &[([f64; 2], f64)], size: f64) -> Option<PlateMesh> {
    let widest = bores.iter().map(|(_, diameter)| *diameter).fold(0.0, f64::max);
    // a thin plate bends within a few thicknesses of what holds it
    let element = size * (0.5 * widest).min(2.5 * plate.thickness_m);
    let (flat, outside) = plane(outline(plate, bores, element), bores, element, size)?;

    // where a point lies: on the wall of a bore, on the edge, or inside
    let on_bore = |p: [f64; 2]| {
        bores.iter().position(|([x, y], d)| ((p[0] - x).hypot(p[1] - y) - 0.5 * d).abs() < 1e-9 * (1.0 + d))
    };
    let layers = divisions(2.0, size, 1);
    let height = |k: usize| plate.thickness_m * (k as f64 / (2 * layers) as f64 - 0.5);
    let mut numbered = Numbered::new();
    let mut wedges = Vec::new();
    let (mut walls, mut edge) = (vec![BTreeSet::new(); bores.len()], BTreeSet::new());
    for face in flat.inner_faces().filter(|f| !outside.contains(&f.fix().index())) {
        let corners = face.vertices().map(|v| (v.fix().index(), v.position()));
        let middle_of = |i: usize| {
            let ((a, p), (b, q)) = (corners[i], corners[(i + 1) % 3]);
            let straight = [0.5 * (p.x + q.x), 0.5 * (p.y + q.y)];
            let side = face.adjacent_edges()[i];
            let bore = on_bore([p.x, p.y]).filter(|n| on_bore([q.x, q.y]) == Some(*n) && side.is_constraint_edge());
            let is_edge = bore.is_none() && side.is_constraint_edge();
            // the wall is round, but for a corner that its bulge would turn inside out
            let [angle_p, angle_q] = [[q, p], [p, q]].map(|[from, to]| {
                let opposite = corners[(i + 2) % 3].1;
                let (a, b) = ([from.x - to.x, from.y - to.y], [opposite.x - to.x, opposite.y - to.y]);
                (a[0] * b[1] - a[1] * b[0]).abs().atan2(a[0] * b[0] + a[1] * b[1]).to_degrees()
            });
            let place = bore.filter(|_| angle_p.min(angle_q) > 20.0).map_or(straight, |n| {
                let ([x, y], d) = bores[n];
                let out = 0.5 * d / (straight[0] - x).hypot(straight[1] - y);
                [x + out * (straight[0] - x), y + out * (straight[1] - y)]
            });
            ((a.min(b), a.max(b)), place, bore, is_edge)
        };
        let middles = [0, 1, 2].map(middle_of);
        let sides_of = |i: usize| [&middles[i], &middles[(i + 2) % 3]];
        for layer in (0..2 * layers).step_by(2) {
            let mut corner = |i: usize, k: usize| {
                let (index, p) = corners[i];
                let n = numbered.at((k, index, index), || [p.x, p.y, height(k)]);
                for (_, _, bore, is_edge) in sides_of(i) {
                    bore.map(|b| walls[b].insert(n));
                    if *is_edge {
                        edge.insert(n);
                    }
                }
                n
            };
            let low = [0, 1, 2].map(|i| corner(i, layer));
            let high = [0, 1, 2].map(|i| corner(i, layer + 2));
            let up = [0, 1, 2].map(|i| corner(i, layer + 1));
            let mut middle = |i: usize, k: usize| {
                let ((a, b), [x, y], bore, is_edge) = middles[i];
                let n = numbered.at((k, a, b), || [x, y, height(k)]);
                bore.map(|b| walls[b].insert(n));
                if is_edge {
                    edge.insert(n);
                }
                n
            };
            let low_middle = [0, 1, 2].map(|i| middle(i, layer));
            let high_middle = [0, 1, 2].map(|i| middle(i, layer + 2));
            let mut all = [low, high, low_middle, high_middle, up].into_iter().flatten();
            wedges.push(std::array::from_fn(|_| all.next().expect("five layers of three")));
        }
    }
    Some(PlateMesh {
        mesh: Mesh { nodes: numbered.nodes, hexahedra: Vec::new(), wedges },
        bores: walls.into_iter().map(|w| w.into_iter().collect()).collect(),
        edge: edge.into_iter().collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Least Jacobian of a wedge's lower face, a triangle of six nodes, at its nodes, relative to that of a regular one of
    /// its size.
    fn worst(mesh: &Mesh, e: &[usize; 15]) -> f64 {
        let at = |n: usize| [mesh.nodes[e[n]][0], mesh.nodes[e[n]][1]];
        let p = [at(0), at(1), at(2), at(6), at(7), at(8)];
        let longest =
            (0..3).map(|i| (p[i][0] - p[(i + 1) % 3][0]).hypot(p[i][1] - p[(i + 1) % 3][1])).fold(0.0, f64::max);
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]
            .map(|[r, s]| {
                let t = 1.0 - r - s;
                let by_r = [1.0 - 4.0 * t, 4.0 * r - 1.0, 0.0, 4.0 * (t - r), 4.0 * s, -4.0 * s];
                let by_s = [1.0 - 4.0 * t, 0.0, 4.0 * s - 1.0, -4.0 * r, 4.0 * r, 4.0 * (t - s)];
                let sum = |weights: &[f64; 6], i: usize| weights.iter().zip(&p).map(|(w, p)| w * p[i]).sum::<f64>();
                let j = sum(&by_r, 0) * sum(&by_s, 1) - sum(&by_r, 1) * sum(&by_s, 0);
                j / (0.75_f64.sqrt() * longest * longest)
            })
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn no_element_of_a_plate_is_inside_out() {
        for (scale, hub, rim) in [(1.0, 0.12, 0.025), (1.0, 0.12, 0.07), (1.0, 0.0, 0.07), (0.3, 0.4, 0.05)] {
            let mut bores = vec![
                ([0.0, -0.35 * scale], 0.09 * scale),
                ([0.0, 0.35 * scale], 0.09 * scale),
                ([0.38 * scale, 0.0], 0.09 * scale),
            ];
            if hub > 0.0 {
                bores.push(([0.0, 0.0], hub * scale));
            }
            let p = Plate {
                thickness_m: 0.08 * scale,
                bore_m: 0.09 * scale,
                hub_m: hub * scale,
                rim_m: rim * scale,
                young_pa: 1.0,
                poisson: 0.3,
            };
            for size in [0.4, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0] {
                let plate = plate(&p, &bores, size).unwrap();
                let least = plate.mesh.wedges.iter().map(|e| worst(&plate.mesh, e)).fold(f64::INFINITY, f64::min);
                assert!(least > 0.03, "size {size}: {least}");
            }
        }
    }
}

//! Regions and border lines of quantities that are known at corners and linear between them.

use std::collections::BTreeMap;

/// A place and what is known there.
#[derive(Clone, Copy, Debug)]
pub struct Corner<const N: usize> {
    pub at: [f64; 2],
    pub values: [f64; N],
}

/// A place of a picture.
pub type Pixel = (i32, i32);

/// The part of a convex polygon where a value is at least `level`. It is exactly `level` at the corners of the cut.
pub fn above<const N: usize>(polygon: &[Corner<N>], value: usize, level: f64) -> Vec<Corner<N>> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (a_in, b_in) = (a.values[value] >= level, b.values[value] >= level);
        if a_in {
            kept.push(*a);
        }
        if a_in != b_in {
            kept.push(cut(a, b, value, level));
        }
    }
    kept
}

/// The corner between two at which a value is `level`: the same bits from either side, so that neighbours meet.
fn cut<const N: usize>(a: &Corner<N>, b: &Corner<N>, value: usize, level: f64) -> Corner<N> {
    let (a, b) = if a.at < b.at { (a, b) } else { (b, a) };
    let part = (level - a.values[value]) / (b.values[value] - a.values[value]);
    let between = |a: f64, b: f64| a + part * (b - a);
    let mut values: [f64; N] = std::array::from_fn(|i| between(a.values[i], b.values[i]));
    values[value] = level;
    Corner { at: [between(a.at[0], b.at[0]), between(a.at[1], b.at[1])], values }
}

/// Edges of a polygon, in its direction.
pub fn edges<const N: usize>(polygon: &[Corner<N>]) -> impl Iterator<Item = [&Corner<N>; 2]> {
    (0..polygon.len()).map(|i| [&polygon[i], &polygon[(i + 1) % polygon.len()]])
}

/// Joins directed edges to lines, open ones first. An edge and its opposite cancel, so that of polygons that share
/// borders the outline is left, holes in the other direction.
pub fn join(edges: impl Iterator<Item = [Pixel; 2]>) -> Vec<Vec<Pixel>> {
    let mut sorted: Vec<(Pixel, Pixel, i32)> =
        edges.filter(|[a, b]| a != b).map(|[a, b]| if a < b { (a, b, 1) } else { (b, a, -1) }).collect();
    sorted.sort_unstable();
    let mut next: BTreeMap<Pixel, Vec<Pixel>> = BTreeMap::new();
    let mut surplus: BTreeMap<Pixel, i32> = BTreeMap::new();
    for same in sorted.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let (a, b, _) = same[0];
        let net: i32 = same.iter().map(|edge| edge.2).sum();
        let (from, to) = if net > 0 { (a, b) } else { (b, a) };
        for _ in 0..net.abs() {
            next.entry(from).or_default().push(to);
            *surplus.entry(from).or_default() += 1;
            *surplus.entry(to).or_default() -= 1;
        }
    }
    let open = surplus.iter().flat_map(|(at, n)| std::iter::repeat_n(*at, (*n).max(0) as usize));
    let starts: Vec<Pixel> = open.chain(next.iter().flat_map(|(at, to)| vec![*at; to.len()])).collect();
    let mut lines = Vec::new();
    for start in starts {
        let mut line = vec![start];
        let mut at = start;
        while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
            line.push(to);
            at = to;
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

/// The part of the line p + t·d, t in `range`, where a·x + b·z ≥ c for all `planes` [a, b, c].
pub fn chord(planes: &[[f64; 3]], p: [f64; 2], d: [f64; 2], range: [f64; 2]) -> Option<[f64; 2]> {
    let mut part = range;
    for [a, b, c] in planes {
        let (at_p, along) = (a * p[0] + b * p[1] - c, a * d[0] + b * d[1]);
        if along > 0.0 {
            part[0] = part[0].max(-at_p / along);
        } else if along < 0.0 {
            part[1] = part[1].min(-at_p / along);
        } else if at_p < 0.0 {
            return None;
        }
    }
    (part[0] < part[1]).then_some(part)
}

/// Where the line p + t·d is inside of polygons that cover nothing twice: stretches of t, in order.
pub fn within<const N: usize>(polygons: &[Vec<Corner<N>>], p: [f64; 2], d: [f64; 2]) -> Vec<[f64; 2]> {
    let from_p = |c: &Corner<N>| [c.at[0] - p[0], c.at[1] - p[1]];
    let side = |[x, z]: [f64; 2]| x * d[1] - z * d[0];
    let along = |[x, z]: [f64; 2]| (x * d[0] + z * d[1]) / (d[0] * d[0] + d[1] * d[1]);
    let crossing = |[a, b]: [&Corner<N>; 2]| {
        let (a, b) = (from_p(a), from_p(b));
        let (at_a, at_b) = (side(a), side(b));
        ((at_a >= 0.0) != (at_b >= 0.0)).then(|| along(a) + (along(b) - along(a)) * at_a / (at_a - at_b))
    };
    let mut crossings: Vec<f64> = polygons.iter().flat_map(|polygon| edges(polygon).filter_map(crossing)).collect();
    crossings.sort_unstable_by(f64::total_cmp);
    let mut stretches: Vec<[f64; 2]> = Vec::new();
    for pair in crossings.chunks_exact(2) {
        match stretches.last_mut() {
            // where two of them meet
            Some(last) if pair[0] - last[1] < 1e-6 => last[1] = pair[1],
            _ => stretches.push([pair[0], pair[1]]),
        }
    }
    stretches
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the area, with sign.
    fn area(line: &[Pixel]) -> i64 {
        line.windows(2).map(|w| i64::from(w[0].0) * i64::from(w[1].1) - i64::from(w[1].0) * i64::from(w[0].1)).sum()
    }

    #[test]
    fn a_ring_has_its_area_and_two_outlines() {
        let n = 200_usize;
        let corner = |i: usize, j: usize| {
            let at = [i as f64 / 100.0 - 1.0, j as f64 / 100.0 - 1.0];
            let r = at[0].hypot(at[1]);
            Corner { at, values: [0.9 - r, r - 0.4] }
        };
        let mut outline = Vec::new();
        for i in 0..n {
            for j in 0..n {
                let square = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                for triangle in [[0, 1, 2], [0, 2, 3]] {
                    let triangle = triangle.map(|k| square[k]);
                    let ring = above(&above(&triangle, 0, 0.0), 1, 0.0);
                    let pixel = |c: &Corner<2>| ((c.at[0] * 1e4).round() as i32, (c.at[1] * 1e4).round() as i32);
                    outline.extend(edges(&ring).map(|[a, b]| [pixel(a), pixel(b)]));
                }
            }
        }
        let lines = join(outline.into_iter());
        let areas: Vec<f64> = lines.iter().map(|l| area(l) as f64 / 2e8).collect();
        assert_eq!(areas.len(), 2, "{areas:?}");
        let pi = std::f64::consts::PI;
        assert!((areas.iter().sum::<f64>() - pi * (0.81 - 0.16)).abs() < 1e-3, "{areas:?}");
        assert!(areas.iter().any(|a| (a + pi * 0.16).abs() < 1e-3), "the hole: {areas:?}");
    }

    #[test]
    fn edges_that_do_not_close_make_open_lines() {
        let lines = join([[(0, 0), (1, 0)], [(5, 5), (6, 6)], [(1, 0), (2, 0)], [(7, 7), (7, 7)]].into_iter());
        assert_eq!(lines, [vec![(0, 0), (1, 0), (2, 0)], vec![(5, 5), (6, 6)]]);
    }

    #[test]
    fn a_chord_of_a_square() {
        let square = [[1.0, 0.0, 0.0], [-1.0, 0.0, -1.0], [0.0, 1.0, 0.0], [0.0, -1.0, -1.0]];
        assert_eq!(chord(&square, [-1.0, 0.5], [1.0, 0.0], [0.0, 9.0]), Some([1.0, 2.0]));
        assert_eq!(chord(&square, [-1.0, 0.5], [1.0, 0.0], [0.0, 1.5]), Some([1.0, 1.5]));
        assert_eq!(chord(&square, [-1.0, 1.5], [1.0, 0.0], [0.0, 9.0]), None);
    }

    #[test]
    fn a_line_is_inside_of_a_row_of_squares_but_for_the_gap() {
        let square = |x: f64| {
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]
                .map(|[a, b]| Corner { at: [x + a, b], values: [0.0] })
                .to_vec()
        };
        let row = [square(0.0), square(3.0), square(1.0)];
        assert_eq!(within(&row, [-1.0, 0.25], [0.5, 0.0]), [[2.0, 6.0], [8.0, 10.0]]);
        assert!(within(&row, [-1.0, 1.5], [1.0, 0.0]).is_empty());
    }
}

//! The solids as a picture: their outer faces, farthest first.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::{Rotation3, Vector3};

use crate::fem::deck::Deck;

/// Corners of the faces of a hexahedron and of a wedge, counter-clockwise as seen from outside.
const HEXAHEDRON: [&[usize]; 6] =
    [&[0, 3, 2, 1], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];
const WEDGE: [&[usize]; 5] = [&[0, 2, 1], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];

fn colour(part: &str) -> [f64; 3] {
    let name = part.trim_end_matches(|c: char| c.is_ascii_digit());
    match name {
        "BASE" => [120.0, 130.0, 145.0],
        "PLATFORM" => [230.0, 150.0, 60.0],
        "TUBE" | "ROD" => [90.0, 150.0, 200.0],
        "RAM" => [190.0, 210.0, 225.0],
        _ => [150.0, 110.0, 80.0],
    }
}

/// Outer faces with their corners, by part.
fn faces(deck: &Deck) -> Vec<(&str, Vec<Vector3<f64>>)> {
    let mut all = Vec::new();
    for part in deck.parts() {
        let mut outer: BTreeMap<Vec<usize>, Option<Vec<usize>>> = BTreeMap::new();
        let hexahedra =
            part.mesh.hexahedra.iter().flat_map(|e| HEXAHEDRON.map(|f| f.iter().map(|i| e[*i]).collect::<Vec<_>>()));
        let wedges = part.mesh.wedges.iter().flat_map(|e| WEDGE.map(|f| f.iter().map(|i| e[*i]).collect::<Vec<_>>()));
        for face in hexahedra.chain(wedges) {
            let mut key = face.clone();
            key.sort_unstable();
            // what two elements share is inside
            outer.entry(key).and_modify(|f| *f = None).or_insert(Some(face));
        }
        for face in outer.into_values().flatten() {
            all.push((part.name.as_str(), face.iter().map(|n| part.mesh.nodes[*n].into()).collect()));
        }
    }
    all
}

/// A face as it is lit, if it is turned toward the eye.
fn face(part: &str, corners: &[Vector3<f64>], place: impl Fn(&Vector3<f64>) -> [f64; 2]) -> Option<String> {
    const LIGHT: Vector3<f64> = Vector3::new(-0.4, 0.5, 0.77);
    let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0])).normalize();
    if normal.z <= 0.0 {
        return None;
    }
    let lit = 0.55 + 0.45 * normal.dot(&LIGHT).max(0.0);
    let [r, g, b] = colour(part).map(|c| (c * lit) as u8);
    let fill = format!("#{r:02x}{g:02x}{b:02x}");
    let points: Vec<String> = corners.iter().map(place).map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    Some(format!("<path d=\"M{}z\" fill=\"{fill}\" stroke=\"{fill}\"/>", points.join("L")))
}

/// The machine from the front, from the side and isometric, the base platform upright, with a bar of 100 mm.
pub fn svg(deck: &Deck) -> String {
    const HEIGHT: f64 = 420.0;
    let faces = faces(deck);
    let views = [
        ("along y of B", Rotation3::identity()),
        ("along x of B", Rotation3::from_axis_angle(&Vector3::z_axis(), -90_f64.to_radians())),
        (
            "isometric",
            Rotation3::from_axis_angle(&Vector3::x_axis(), 25_f64.to_radians())
                * Rotation3::from_axis_angle(&Vector3::z_axis(), -125_f64.to_radians()),
        ),
    ];
    let upright = deck.base_axes();
    // to the right, upward, toward the eye
    let seen = |turn: &Rotation3<f64>, p: &Vector3<f64>| {
        let p = turn * (upright * p);
        Vector3::new(p.x, p.z, -p.y)
    };
    let boxes = views.each_ref().map(|(_, turn)| {
        faces
            .iter()
            .flat_map(|(_, f)| f)
            .map(|p| seen(turn, p))
            .fold([f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY], |[a, b, c, d], p| {
                [a.min(p.x), b.max(p.x), c.min(p.y), d.max(p.y)]
            })
    });
    let tallest = boxes.iter().map(|[_, _, low, high]| high - low).fold(0.0, f64::max);
    let scale = HEIGHT / tallest;
    let gap = 40.0;
    let width: f64 = boxes.iter().map(|[left, right, ..]| (right - left) * scale + gap).sum();
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" viewBox=\"0 0 {:.0} {:.0}\" font-family=\"sans-serif\" \
         font-size=\"16\">\n<title>The machine in solids, from three sides</title>\n",
        width,
        HEIGHT + 70.0
    );
    let mut x0 = gap / 2.0;
    for ((name, turn), [left, right, low, _]) in views.iter().zip(boxes) {
        let mut drawn: Vec<(f64, String)> = faces
            .iter()
            .filter_map(|(part, corners)| {
                let p: Vec<Vector3<f64>> = corners.iter().map(|p| seen(turn, p)).collect();
                // faces are sorted by their middles: long ones of a ram would come before the tube about it
                let outside = if part.starts_with("TUBE") { 0.05 * tallest } else { 0.0 };
                let depth = p.iter().map(|p| p.z).sum::<f64>() / p.len() as f64 + outside;
                let place = |p: &Vector3<f64>| [x0 + (p.x - left) * scale, 10.0 + HEIGHT - (p.y - low) * scale];
                Some((depth, face(part, &p, place)?))
            })
            .collect();
        drawn.sort_by(|a, b| a.0.total_cmp(&b.0));
        s.push_str("<g stroke-width=\".4\">");
        drawn.iter().for_each(|(_, path)| s.push_str(path));
        s.push_str("</g>\n");
        let wide = (right - left) * scale;
        _ = writeln!(
            s,
            "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{name}</text>",
            x0 + wide / 2.0,
            HEIGHT + 34.0
        );
        x0 += wide + gap;
    }
    let (y, long) = (HEIGHT + 54.0, 0.1 * scale);
    _ = writeln!(
        s,
        "<path d=\"M20,{y}h{long:.1}\" stroke=\"#000000\" stroke-width=\"3\"/><text x=\"{:.0}\" y=\"{:.0}\">100 mm</text>\n</svg>",
        28.0 + long,
        y + 5.0
    );
    s
}

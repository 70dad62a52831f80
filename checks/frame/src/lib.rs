//! A dense frame solver: nodes of six degrees of freedom, Euler–Bernoulli beams, joints as springs, rigid bodies.
//!
//! It is the tests' truth and shares nothing with `pkm-core`: no formula, no type, no dependency. Positions,
//! forces and stiffnesses are SI in one fixed frame; six-vectors are [x, y, z, about x, about y, about z].

use nalgebra::{DMatrix, Matrix3, Matrix6, SMatrix, Vector3};

/// A rigid body, or a point where beams meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node(usize);

/// Section of a beam. The second axis given to [`Frame::beam`] is the one that `ei_nm2.0` bends about.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// Young's modulus times area, N.
    pub ea_n: f64,
    /// Bending stiffness about the second and the third axis, N·m².
    pub ei_nm2: (f64, f64),
    /// Torsional stiffness, N·m².
    pub gj_nm2: f64,
}

/// A structure under assembly. The ground is where [`Frame::GROUND`] is.
#[derive(Clone, Debug)]
pub struct Frame {
    positions: Vec<Vector3<f64>>,
    /// Of all nodes, the ground first.
    stiffness: DMatrix<f64>,
    /// Nodes that are part of another's body: (follower, leader).
    welds: Vec<(Node, Node)>,
    /// Nodes of which the translation along a direction follows another's: (follower, leader, direction).
    ties: Vec<(Node, Node, Vector3<f64>)>,
    /// Groups of nodes that a body carries on springs of their own.
    modes: Vec<Modes>,
}

/// See [`Frame::modes`].
#[derive(Clone, Debug)]
struct Modes {
    body: Node,
    nodes: Vec<Node>,
    shapes: Vec<(Vec<Vector3<f64>>, f64)>,
}

/// Displacement of the point `r` beyond the node that moves with it.
fn carried(r: Vector3<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::identity();
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&-r.cross_matrix());
    m
}

fn both(axes: &Matrix3<f64>) -> Matrix6<f64> {
    let mut m = Matrix6::zeros();
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(axes);
    m
}

impl Frame {
    /// The node that never moves, at the origin.
    pub const GROUND: Node = Node(0);

    /// Only the ground.
    #[allow(clippy::new_without_default)] // a frame without ground is no default of anything
    pub fn new() -> Self {
        Self {
            positions: vec![Vector3::zeros()],
            stiffness: DMatrix::zeros(6, 6),
            ties: Vec::new(),
            welds: Vec::new(),
            modes: Vec::new(),
        }
    }

    /// A node, free until something holds it.
    pub fn node(&mut self, position: Vector3<f64>) -> Node {
        self.positions.push(position);
        let size = 6 * self.positions.len();
        self.stiffness.resize_mut(size, size, 0.0);
        Node(self.positions.len() - 1)
    }

    fn add(&mut self, a: Node, b: Node, matrix: &SMatrix<f64, 12, 12>) {
        for (row, i) in [(0, a), (6, b)] {
            for (column, j) in [(0, a), (6, b)] {
                let block = matrix.fixed_view::<6, 6>(row, column);
                let mut place = self.stiffness.fixed_view_mut::<6, 6>(6 * i.0, 6 * j.0);
                place += block;
            }
        }
    }

    /// A joint at a point between two bodies: stiffnesses along and about three axes (columns), 0 where it is free.
    pub fn joint(&mut self, a: Node, b: Node, at: Vector3<f64>, axes: &Matrix3<f64>, stiffness: [f64; 6]) {
        let k = both(axes) * Matrix6::from_diagonal(&stiffness.into()) * both(axes).transpose();
        self.spring(a, b, at, &k);
    }

    /// A spring at a point between two bodies.
    pub fn spring(&mut self, a: Node, b: Node, at: Vector3<f64>, k: &Matrix6<f64>) {
        let mut relative = SMatrix::<f64, 6, 12>::zeros();
        relative.fixed_view_mut::<6, 6>(0, 0).copy_from(&-carried(at - self.positions[a.0]));
        relative.fixed_view_mut::<6, 6>(0, 6).copy_from(&carried(at - self.positions[b.0]));
        self.add(a, b, &(relative.transpose() * k * relative));
    }

    /// Ties the translation of one node along a direction to the same of another: something rigid in that direction
    /// alone.
    pub fn tie(&mut self, follower: Node, leader: Node, direction: Vector3<f64>) {
        self.ties.push((follower, leader, direction));
    }

    /// Makes a node part of the same body as another.
    pub fn weld(&mut self, follower: Node, leader: Node) {
        self.welds.push((follower, leader));
    }

    /// Nodes that a body carries elastically: they move with it, and by shapes of their own, each a direction for
    /// every node and the stiffness of its spring. Neither they nor the body may follow anything else, by a tie or a weld.
    pub fn modes(&mut self, body: Node, nodes: &[Node], shapes: &[(Vec<Vector3<f64>>, f64)]) {
        self.modes.push(Modes { body, nodes: nodes.to_vec(), shapes: shapes.to_vec() });
    }

    /// A beam between two nodes. `second` is any direction off its axis; it is made square to it.
    pub fn beam(&mut self, a: Node, b: Node, second: Vector3<f64>, section: &Section) {
        let along = self.positions[b.0] - self.positions[a.0];
        let length = along.norm();
        let x = along / length;
        let y = (second - x * x.dot(&second)).normalize();
        let axes = Matrix3::from_columns(&[x, y, x.cross(&y)]);
        let mut k = SMatrix::<f64, 12, 12>::zeros();
        let mut pair = |i: usize, j: usize, v: f64| {
            k[(i, j)] = v;
            k[(j, i)] = v;
        };
        for (dof, s) in [(0, section.ea_n / length), (3, section.gj_nm2 / length)] {
            pair(dof, dof, s);
            pair(dof + 6, dof + 6, s);
            pair(dof, dof + 6, -s);
        }
        // deflection along y with rotation about z, and along z with rotation about y
        let (about_y, about_z) = section.ei_nm2;
        for (w, r, sign, ei) in [(1, 5, 1.0, about_z), (2, 4, -1.0, about_y)] {
            let (k3, k2, k1) = (12.0 * ei / length.powi(3), sign * 6.0 * ei / length.powi(2), 2.0 * ei / length);
            pair(w, w, k3);
            pair(w + 6, w + 6, k3);
            pair(w, w + 6, -k3);
            pair(r, r, 2.0 * k1);
            pair(r + 6, r + 6, 2.0 * k1);
            pair(r, r + 6, k1);
            pair(w, r, k2);
            pair(w, r + 6, k2);
            pair(w + 6, r, -k2);
            pair(w + 6, r + 6, -k2);
        }
        let mut turn = SMatrix::<f64, 12, 12>::zeros();
        turn.fixed_view_mut::<6, 6>(0, 0).copy_from(&both(&axes));
        turn.fixed_view_mut::<6, 6>(6, 6).copy_from(&both(&axes));
        self.add(a, b, &(turn * k * turn.transpose()));
    }

    /// 6×6 compliance at a node: its displacement under unit loads. `None` when the structure can move freely.
    pub fn compliance(&self, node: Node) -> Option<Matrix6<f64>> {
        let mut loads = DMatrix::zeros(6 * self.positions.len(), 6);
        loads.rows_mut(6 * node.0, 6).fill_with_identity();
        let all = self.solve(&loads)?;
        Some(all.fixed_view::<6, 6>(6 * node.0, 0).into())
    }

    /// Displacement of every node under loads: ask with [`of`](Self::of). `None` when it can move freely.
    pub fn displacements(&self, loads: &[(Node, [f64; 6])]) -> Option<DMatrix<f64>> {
        let mut all = DMatrix::zeros(6 * self.positions.len(), 1);
        for (node, load) in loads {
            (0..6).for_each(|i| all[6 * node.0 + i] += load[i]);
        }
        self.solve(&all)
    }

    /// A node's translation in the result of [`displacements`](Self::displacements).
    pub fn of(displacements: &DMatrix<f64>, node: Node) -> Vector3<f64> {
        displacements.fixed_view::<3, 1>(6 * node.0, 0).into()
    }

    fn solve(&self, loads: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        // degrees of freedom in terms of independent ones
        let mut expand = DMatrix::<f64>::identity(self.stiffness.nrows(), self.stiffness.nrows());
        let mut dependent: Vec<usize> = (0..6).collect();
        let mut stiffness = self.stiffness.clone();
        let followers = || self.welds.iter().map(|w| w.0).chain(self.ties.iter().map(|t| t.0));
        let of_modes = self.modes.iter().flat_map(|m| m.nodes.iter().chain([&m.body]));
        assert!(of_modes.into_iter().all(|n| followers().all(|f| f != *n)), "a node of modes follows another node");
        for Modes { body, nodes, shapes } in &self.modes {
            // the shapes' amounts are kept in the first node's first degrees of freedom
            let amount = |shape: usize| 6 * nodes[0].0 + shape;
            let carrier = expand.rows(6 * body.0, 6).clone_owned();
            for (n, node) in nodes.iter().enumerate() {
                let mut rows = carried(self.positions[node.0] - self.positions[body.0]) * &carrier;
                for (shape, (directions, _)) in shapes.iter().enumerate() {
                    (0..3).for_each(|i| rows[(i, amount(shape))] += directions[n][i]);
                }
                expand.rows_mut(6 * node.0, 6).copy_from(&rows);
                let kept = amount(0)..amount(shapes.len());
                dependent.extend((6 * node.0..6 * node.0 + 6).filter(|i| !kept.contains(i)));
            }
            for (shape, (_, spring)) in shapes.iter().enumerate() {
                let row = expand.nrows();
                expand = expand.insert_row(row, 0.0);
                expand[(row, amount(shape))] = 1.0;
                stiffness = stiffness.resize(row + 1, row + 1, 0.0);
                stiffness[(row, row)] = *spring;
            }
        }
        for (follower, leader) in &self.welds {
            let lever = self.positions[follower.0] - self.positions[leader.0];
            let rows = carried(lever) * expand.rows(6 * leader.0, 6);
            expand.rows_mut(6 * follower.0, 6).copy_from(&rows);
            dependent.extend(6 * follower.0..6 * follower.0 + 6);
        }
        for (follower, leader, d) in &self.ties {
            // the greatest component gives way to the other two
            let kept = d.iamax();
            let mut row = expand.rows(6 * leader.0, 3).tr_mul(d).transpose();
            for i in (0..3).filter(|i| *i != kept) {
                row -= expand.row(6 * follower.0 + i) * d[i];
            }
            expand.set_row(6 * follower.0 + kept, &(row / d[kept]));
            dependent.push(6 * follower.0 + kept);
        }
        dependent.sort_unstable();
        let expand = expand.remove_columns_at(&dependent);
        let k = expand.tr_mul(&stiffness) * &expand;
        // unit diagonal: newtons and newton metres side by side cost digits
        let scale = DMatrix::from_diagonal(&k.diagonal().map(|v| 1.0 / v.sqrt()));
        let factor = (&scale * k * &scale).cholesky()?;
        let loads = &scale * expand.rows(0, loads.nrows()).tr_mul(loads);
        Some(expand * (&scale * factor.solve(&loads)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECTION: Section = Section { ea_n: 3e8, ei_nm2: (2e5, 5e5), gj_nm2: 1e5 };

    #[test]
    fn a_cantilever_bends_by_the_textbook() {
        let length = 0.7;
        let mut frame = Frame::new();
        let tip = frame.node(Vector3::new(0.0, 0.0, length));
        frame.beam(Frame::GROUND, tip, Vector3::x(), &SECTION);
        // x of the beam is z here, its second axis x, its third y
        let c = frame.compliance(tip).unwrap();
        let expected = [
            ((0, 0), length.powi(3) / (3.0 * 5e5)),
            ((1, 1), length.powi(3) / (3.0 * 2e5)),
            ((2, 2), length / 3e8),
            ((0, 4), length.powi(2) / (2.0 * 5e5)),
            ((1, 3), -length.powi(2) / (2.0 * 2e5)),
            ((5, 5), length / 1e5),
        ];
        for ((i, j), value) in expected {
            assert!((c[(i, j)] / value - 1.0).abs() < 1e-12, "{i}{j}: {} instead of {value}", c[(i, j)]);
        }
    }

    #[test]
    fn springs_in_a_row_add_their_compliance() {
        let mut frame = Frame::new();
        let (middle, end) = (frame.node(Vector3::new(0.1, 0.2, 0.3)), frame.node(Vector3::new(-0.1, 0.4, 0.2)));
        let at = Vector3::new(0.3, 0.3, 0.3);
        frame.joint(Frame::GROUND, middle, at, &Matrix3::identity(), [1e6, 2e6, 3e6, 4e4, 5e4, 6e4]);
        frame.joint(middle, end, at, &Matrix3::identity(), [1e6, 2e6, 3e6, 4e4, 5e4, 6e4]);
        let to_end = carried(Vector3::new(-0.1, 0.4, 0.2) - at);
        let one = Matrix6::from_diagonal(&[1e-6, 0.5e-6, 1e-6 / 3.0, 0.25e-4, 0.2e-4, 1e-4 / 6.0].into());
        let expected = to_end * (one * 2.0) * to_end.transpose();
        assert!((frame.compliance(end).unwrap() - expected).norm() < 1e-12 * expected.norm());
    }

    #[test]
    fn a_mechanism_is_refused() {
        let mut frame = Frame::new();
        let end = frame.node(Vector3::x());
        frame.joint(Frame::GROUND, end, Vector3::zeros(), &Matrix3::identity(), [1e6, 1e6, 1e6, 0.0, 1e4, 1e4]);
        assert!(frame.compliance(end).is_none());
    }

    #[test]
    #[should_panic(expected = "a node of modes follows another node")]
    fn a_body_with_modes_follows_nothing() {
        let mut frame = Frame::new();
        let [body, carried] = [0.1, 0.2].map(|z| frame.node(Vector3::new(0.0, 0.0, z)));
        frame.beam(Frame::GROUND, body, Vector3::x(), &SECTION);
        frame.tie(body, Frame::GROUND, Vector3::x());
        frame.modes(body, &[carried], &[(vec![Vector3::z()], 1e6)]);
        frame.compliance(carried);
    }
}

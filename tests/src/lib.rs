//! References that share no formula with `pkm-core`, and random machines to hold it against.

pub mod single;

use fastrand::Rng;
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, SVector, Vector3};
use pkm_core::effects::Effects;
use pkm_core::machine::{Body, BodyKind, Geometry, Joint, LimbParameters, MachineParameters, Travel, Tube};
use pkm_core::{Machine, Pose};
use twofloat::TwoFloat;

/// A seeded generator that prints its seed, so that a failure can be repeated: `PKM_SEED=n cargo test`.
pub fn seeded() -> Rng {
    let seed = std::env::var("PKM_SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(20_200_513);
    println!("PKM_SEED={seed}");
    Rng::with_seed(seed)
}

/// How many random cases a test takes: `all`, or the share of them that `PKM_SHARE` says, such as 0.01.
pub fn cases(all: usize) -> usize {
    let share = std::env::var("PKM_SHARE").ok().and_then(|s| s.parse::<f64>().ok()).unwrap_or(1.0);
    ((all as f64 * share) as usize).max(2)
}

/// The first that a draw gives. Draws end, so that a core that gives nothing fails a test instead of holding it up.
pub fn first<T>(draw: impl FnMut() -> Option<T>) -> T {
    std::iter::repeat_with(draw).take(10_000).flatten().next().expect("one of 10,000 draws")
}

/// Uniform.
pub fn between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.f64()
}

fn log_between(rng: &mut Rng, low: f64, high: f64) -> f64 {
    between(rng, low.ln(), high.ln()).exp()
}

/// A machine of any proportions between a small head and a large one; travel excludes nothing.
pub fn random_parameters(rng: &mut Rng, kind: BodyKind) -> MachineParameters {
    let size = log_between(rng, 0.1, 1.0);
    let mut part = |low: f64, high: f64| size * between(rng, low, high);
    let geometry = Geometry { a1_m: part(0.1, 0.8), a2_m: part(0.1, 0.8), b1_m: part(0.2, 1.0), b2_m: part(0.2, 1.0) };
    let mut tube = |bore: f64| {
        let outer_m = size * between(rng, 0.05, 0.15);
        Tube {
            young_pa: between(rng, 60e9, 220e9),
            shear_pa: between(rng, 25e9, 85e9),
            outer_m,
            inner_m: bore * outer_m * rng.f64(),
        }
    };
    let bodies: [Body; 3] = std::array::from_fn(|_| Body { kind, rod: tube(0.8), screw: tube(0.0) });
    let mut joint = |released: [bool; 3]| Joint {
        linear_n_per_m: std::array::from_fn(|_| log_between(rng, 1e7, 1e9)),
        angular_nm_per_rad: released.map(|free| if free { 0.0 } else { log_between(rng, 1e4, 1e6) }),
    };
    let limbs = std::array::from_fn(|i| LimbParameters {
        base_joint: joint(if i == 2 { [true, false, false] } else { [true, true, false] }),
        platform_joint: joint(if i == 2 { [true; 3] } else { [true, false, false] }),
        body: bodies[i],
    });
    let travel = Travel { min_m: [1e-6; 3], max_m: [1e3; 3] };
    MachineParameters { geometry, travel, limbs, effects: Effects::NONE }
}

/// A pose of the machine in its working mode, at least `margin` away from the singularities.
pub fn random_pose(rng: &mut Rng, machine: &Machine<f64>, size: f64, margin: f64) -> Pose<f64> {
    first(|| {
        let pose = Pose {
            theta_rad: between(rng, -1.2, 1.2),
            sigma_rad: between(rng, -1.2, 1.2),
            z0_m: size * between(rng, 0.1, 3.0),
        };
        let d = machine.singularity_distance(&pose).ok()?;
        (d.limbs_1_2 >= margin && d.limb_3 >= margin).then_some(pose)
    })
}

/// Double-double: the dense way loses six digits and more to the stiff directions of slender limbs.
type Real = TwoFloat;
type Vec3 = SVector<Real, 3>;
type Mat3 = SMatrix<Real, 3, 3>;
type Mat6 = SMatrix<Real, 6, 6>;
type Mat12 = SMatrix<Real, 12, 12>;
type Mat24 = SMatrix<Real, 24, 24>;

fn real(x: f64) -> Real {
    Real::from(x)
}

/// a/b. The crate's own quotient (0.8.4) is good to 1e-16 only: one more step mends it.
fn over(a: Real, b: Real) -> Real {
    let rough = a / b;
    rough + (a - rough * b) / b
}

/// Points and frames of a pose by rotation matrices, in B-xyz.
pub struct Space {
    /// Origin of A-uvw.
    pub a: Vec3,
    /// Columns u, v, w.
    pub rotation: Mat3,
    /// A1, A2, A3.
    pub platform: [Vec3; 3],
    /// B1, B2, B3.
    pub base: [Vec3; 3],
}

/// Where everything is at a pose, from rotation matrices and vectors.
pub fn space(g: &Geometry, pose: &Pose<f64>) -> Space {
    let o = real(0.0);
    let one = real(1.0);
    let sin_cos = |angle: f64| {
        let sin = real(angle.sin());
        (sin, (one - sin * sin).sqrt())
    };
    let (st, ct) = sin_cos(pose.theta_rad);
    let (ss, cs) = sin_cos(pose.sigma_rad);
    let about_y = Mat3::new(ct, o, st, o, one, o, -st, o, ct);
    let about_x = Mat3::new(one, o, o, o, cs, -ss, o, ss, cs);
    let rotation = about_y * about_x;
    let z0 = real(pose.z0_m);
    let a = Vec3::new(over(z0 * st, ct), o, z0);
    let triangle =
        |half: f64, far: f64| [Vec3::new(o, real(-half), o), Vec3::new(o, real(half), o), Vec3::new(real(far), o, o)];
    let platform = triangle(g.a1_m, g.a2_m).map(|p| a + rotation * p);
    Space { a, rotation, platform, base: triangle(g.b1_m, g.b2_m) }
}

/// Distance between two points.
pub fn distance(a: &Vec3, b: &Vec3) -> Real {
    let d = a - b;
    (d.x * d.x + d.y * d.y + d.z * d.z).sqrt()
}

fn cross(a: &Vec3, b: &Vec3) -> Vec3 {
    Vec3::new(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)
}

fn both(r: &Mat3) -> Mat6 {
    let mut m = Mat6::from_element(real(0.0));
    m.fixed_view_mut::<3, 3>(0, 0).copy_from(r);
    m.fixed_view_mut::<3, 3>(3, 3).copy_from(r);
    m
}

fn joint_stiffness(joint: &Joint, axes: &Mat3) -> Mat6 {
    let diagonal = [joint.linear_n_per_m, joint.angular_nm_per_rad].concat();
    let local = Mat6::from_fn(|i, j| real(if i == j { diagonal[i] } else { 0.0 }));
    both(axes) * local * both(axes).transpose()
}

/// Displacement at a point `r` further on, from the displacement of a rigid body.
fn rigid(r: &Vec3) -> Mat6 {
    let o = real(0.0);
    let mut m = Mat6::from_fn(|i, j| real(if i == j { 1.0 } else { 0.0 }));
    m.fixed_view_mut::<3, 3>(0, 3).copy_from(&Mat3::new(o, r.z, -r.y, -r.z, o, r.x, r.y, -r.x, o));
    m
}

/// Stiffness of the body between its ends, in its own axes, z along it: base first, then tip.
fn body_stiffness(body: &Body, q: Real) -> Mat12 {
    let (mut ea, mut ei, mut gj) = (0.0, 0.0, 0.0);
    for t in [&body.rod, &body.screw] {
        let pi = std::f64::consts::PI;
        ea += t.young_pa * pi * (t.outer_m.powi(2) - t.inner_m.powi(2)) / 4.0;
        ei += t.young_pa * pi * (t.outer_m.powi(4) - t.inner_m.powi(4)) / 64.0;
        gj += t.shear_pa * pi * (t.outer_m.powi(4) - t.inner_m.powi(4)) / 32.0;
    }
    let (ea, ei, gj) = (real(ea), real(ei), real(gj));
    let times = |n: f64, p: i32| over(real(n) * ei, (0..p).fold(real(1.0), |a, _| a * q));
    let mut k = Mat12::from_element(real(0.0));
    match body.kind {
        BodyKind::Diagonal => {
            let d = [times(3.0, 3), times(3.0, 3), over(ea, q), times(1.0, 1), times(1.0, 1), over(gj, q)];
            let tip = Mat6::from_fn(|i, j| if i == j { d[i] } else { real(0.0) });
            let t = rigid(&Vec3::new(real(0.0), real(0.0), q));
            k.fixed_view_mut::<6, 6>(0, 0).copy_from(&(t.transpose() * tip * t));
            k.fixed_view_mut::<6, 6>(0, 6).copy_from(&-(t.transpose() * tip));
            k.fixed_view_mut::<6, 6>(6, 0).copy_from(&-(tip * t));
            k.fixed_view_mut::<6, 6>(6, 6).copy_from(&tip);
        }
        BodyKind::Beam => {
            // the textbook's beam element, written for z along the beam
            let mut pair = |i: usize, j: usize, v: Real| {
                k[(i, j)] = v;
                k[(j, i)] = v;
            };
            for (dof, s) in [(2, over(ea, q)), (5, over(gj, q))] {
                pair(dof, dof, s);
                pair(dof + 6, dof + 6, s);
                pair(dof, dof + 6, -s);
            }
            // x with rotation about y; y with rotation about x, of the other sign
            for (x, r, s) in [(0, 4, real(1.0)), (1, 3, real(-1.0))] {
                pair(x, x, times(12.0, 3));
                pair(x + 6, x + 6, times(12.0, 3));
                pair(x, x + 6, -times(12.0, 3));
                pair(r, r, times(4.0, 1));
                pair(r + 6, r + 6, times(4.0, 1));
                pair(r, r + 6, times(2.0, 1));
                pair(x, r, s * times(6.0, 2));
                pair(x, r + 6, s * times(6.0, 2));
                pair(x + 6, r, -s * times(6.0, 2));
                pair(x + 6, r + 6, -s * times(6.0, 2));
            }
        }
    }
    k
}

/// Inverse by Gauss and Jordan; the diagonal of a positive definite matrix needs no pivoting.
fn inverted<const N: usize>(matrix: &SMatrix<Real, N, N>) -> SMatrix<Real, N, N> {
    let mut a = *matrix;
    let mut inverse = SMatrix::from_fn(|i, j| real(if i == j { 1.0 } else { 0.0 }));
    for p in 0..N {
        let pivot = over(real(1.0), a[(p, p)]);
        for c in 0..N {
            a[(p, c)] *= pivot;
            inverse[(p, c)] *= pivot;
        }
        for r in (0..N).filter(|r| *r != p) {
            let factor = a[(r, p)];
            for c in 0..N {
                let (above, above_inverse) = (a[(p, c)], inverse[(p, c)]);
                a[(r, c)] -= factor * above;
                inverse[(r, c)] -= factor * above_inverse;
            }
        }
    }
    inverse
}

/// K_p at A in A-uvw by the paper's way: the 24×24 structural matrix of Eq. 8, inverted whole, and Eq. 9.
pub fn structural_stiffness(parameters: &MachineParameters, pose: &Pose<f64>) -> Matrix6<f64> {
    let g = space(&parameters.geometry, pose);
    let u: Vec3 = g.rotation.column(0).into();
    let y = Vec3::new(real(0.0), real(1.0), real(0.0));
    let mut k = Mat24::from_element(real(0.0));
    for (i, limb) in parameters.limbs.iter().enumerate() {
        let q = distance(&g.platform[i], &g.base[i]);
        let z = (g.platform[i] - g.base[i]).map(|c| over(c, q));
        let x = if i == 2 { y } else { u };
        let axes = Mat3::from_columns(&[x, cross(&z, &x), z]);
        let base_axes = if i == 2 { axes } else { Mat3::from_columns(&[u, y, cross(&u, &y)]) };

        let mut turn = Mat12::from_element(real(0.0));
        turn.fixed_view_mut::<6, 6>(0, 0).copy_from(&both(&axes));
        turn.fixed_view_mut::<6, 6>(6, 6).copy_from(&both(&axes));
        let body = turn * body_stiffness(&limb.body, q) * turn.transpose();
        let block = |r: usize, c: usize| -> Mat6 { body.fixed_view::<6, 6>(6 * r, 6 * c).into() };
        let held = block(0, 0) + joint_stiffness(&limb.base_joint, &base_axes);
        let link = block(1, 1) - block(1, 0) * inverted(&held) * block(0, 1);

        let joint = joint_stiffness(&limb.platform_joint, &axes);
        let x_i = rigid(&(g.platform[i] - g.a));
        let mut add = |r: usize, c: usize, m: Mat6| {
            let mut view = k.fixed_view_mut::<6, 6>(6 * r, 6 * c);
            view += m;
        };
        add(i, i, link + joint);
        add(i, 3, -(joint * x_i));
        add(3, i, -(x_i.transpose() * joint));
        add(3, 3, x_i.transpose() * joint * x_i);
    }
    let compliance: Mat6 = inverted(&k).fixed_view::<6, 6>(18, 18).into();
    let turn = both(&g.rotation);
    let terminal = turn.transpose() * inverted(&compliance) * turn;
    Matrix6::from_fn(|i, j| f64::from(terminal[(i, j)]))
}

/// Keeps the greater of two errors, and a NaN for good: `f64::max` would drop it.
pub fn keep_worst(worst: &mut f64, error: f64) {
    if error > *worst || error.is_nan() {
        *worst = error;
    }
}

/// Greatest |a_ij − b_ij| / √(b_ii b_jj).
pub fn scaled_difference(a: &Matrix6<f64>, b: &Matrix6<f64>) -> f64 {
    let mut worst = 0.0_f64;
    for i in 0..6 {
        for j in 0..6 {
            keep_worst(&mut worst, (a[(i, j)] - b[(i, j)]).abs() / (b[(i, i)] * b[(j, j)]).sqrt());
        }
    }
    worst
}

/// The wrenches on the platform, at A in B-xyz, that the limbs transmit with their screws held or free: for each
/// limb the null space of the twists of its joints. A column a wrench, lengths scaled by a1 + b1.
pub fn transmitted(parameters: &MachineParameters, pose: &Pose<f64>, screws_held: bool) -> DMatrix<f64> {
    let g = space(&parameters.geometry, pose);
    let vector = |v: &Vec3| Vector3::new(f64::from(v.x), f64::from(v.y), f64::from(v.z));
    let size = parameters.geometry.a1_m + parameters.geometry.b1_m;
    let a = vector(&g.a);
    let u = vector(&g.rotation.column(0).into());
    let y = Vector3::y();
    let mut columns: Vec<DVector<f64>> = Vec::new();
    for i in 0..3 {
        let (platform, base) = (vector(&g.platform[i]), vector(&g.base[i]));
        let revolute =
            |axis: Vector3<f64>, at: Vector3<f64>| -> [Vector3<f64>; 2] { [axis.cross(&((a - at) / size)), axis] };
        let mut twists = if i == 2 {
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            let mut twists = axes.map(|axis| revolute(axis, platform)).to_vec();
            twists.push(revolute(y, base));
            twists
        } else {
            vec![revolute(u, base), revolute(y, base), revolute(u, platform)]
        };
        if !screws_held {
            twists.push([(platform - base).normalize(), Vector3::zeros()]);
        }
        // virtual work of [F, M/size] on [v, ω]
        let rows = DMatrix::from_fn(6, 6, |r, c| twists.get(r).map_or(0.0, |t| t[c / 3][c % 3]));
        let svd = rows.svd(false, true);
        let v_t = svd.v_t.expect("asked for");
        let null = (0..6).filter(|k| svd.singular_values[*k] < 1e-9);
        columns.extend(null.map(|k| v_t.row(k).transpose()));
    }
    DMatrix::from_columns(&columns)
}

/// The README's example is a test.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
pub struct Readme;

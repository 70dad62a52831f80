//! The limbs of a machine at a posture: transmitted wrenches, and the compliance of joints, bodies and effects.

use nalgebra::Vector3;

use crate::elastic::{Chain, Limb, LimbFrame, stiffen};
use crate::kinematics::Posture;
use crate::linalg::{Lower, axes, frame, join};
use crate::machine::{LimbCompliance, Machine};
use crate::scalar::Scalar;

/// On which side of the plane of limb 3 limb 1 (`LIMB` = 0) and limb 2 are.
fn side<const LIMB: usize, T: Scalar>() -> T {
    if LIMB == 0 { -T::ONE } else { T::ONE }
}

impl<T: Scalar> Machine<T> {
    #[inline(never)]
    pub(super) fn put_limb_with_effects<const LIMB: usize, const FIRST: usize>(
        &self,
        p: &Posture<T>,
        h: T,
        limbs: &mut Chain<T, 8>,
        beside: &mut Lower<T>,
    ) {
        let mut chain = Chain::zero();
        self.turn_into_limb_1_2::<LIMB>(p, h, &mut chain);
        let mut limb = self.limb_1_2::<LIMB>(p, h, &mut chain);
        self.add_effects(&mut limb, beside);
        limbs.put::<FIRST, 3>(&chain);
    }

    #[inline(never)]
    pub(super) fn put_limb_3_with_effects(&self, p: &Posture<T>, h: T, limbs: &mut Chain<T, 8>, beside: &mut Lower<T>) {
        let mut chain = Chain::zero();
        self.turn_into_limb_3(p, h, &mut chain);
        self.add_effects(&mut self.limb_3(p, h, &mut chain), beside);
        limbs.put::<6, 2>(&chain);
    }

    // what these three work with takes no stack while effects are added

    #[inline(never)]
    fn turn_into_limb_1_2<const LIMB: usize>(&self, p: &Posture<T>, h: T, chain: &mut Chain<T, 3>) {
        *chain = self.chain_1_2::<LIMB, true>(p, h);
    }

    #[inline(never)]
    fn turn_into_limb_3(&self, p: &Posture<T>, h: T, chain: &mut Chain<T, 2>) {
        *chain = self.chain_3::<true>(p, h);
    }

    #[inline(never)]
    fn limb_1_2<'c, const LIMB: usize>(&self, p: &Posture<T>, h: T, chain: &'c mut Chain<T, 3>) -> Limb<'c, T, 3> {
        self.limb((LIMB, &self.limbs[LIMB]), self.frame_1_2::<LIMB>(p, h), chain)
    }

    #[inline(never)]
    fn limb_3<'c>(&self, p: &Posture<T>, h: T, chain: &'c mut Chain<T, 2>) -> Limb<'c, T, 2> {
        self.limb((2, &self.limbs[2]), self.frame_3(p, h), chain)
    }

    #[inline(always)]
    fn limb<'c, const N: usize>(
        &self,
        (index, declared): (usize, &LimbCompliance<T>),
        frame: LimbFrame<T>,
        chain: &'c mut Chain<T, N>,
    ) -> Limb<'c, T, N> {
        let [body, _] = self.softness;
        let [axial, bending, torsion] = [declared.axial, declared.bending, declared.torsion].map(|c| c * body);
        let LimbFrame { length_m: q, joints_m: [base, platform], axes: [base_axes, axes] } = frame;
        Limb { index, q, base, platform, axes, base_axes, axial, bending, torsion, chain }
    }

    /// Of limb 1 (`LIMB` = 0) or 2, with A_i `h` out of its plane.
    #[inline(always)]
    pub(super) fn frame_1_2<const LIMB: usize>(&self, p: &Posture<T>, h: T) -> LimbFrame<T> {
        let (y, n, u) = (p.y(), p.n(), Vector3::x());
        let (side, q) = (side::<LIMB, T>(), p.length::<LIMB>());
        let z = y * (p.along_y[LIMB] / q) + n * (p.along_n[LIMB] / q);
        LimbFrame {
            length_m: q,
            joints_m: [y * (side * self.actual.b1) + n * -p.l, Vector3::new(T::ZERO, side * self.actual.a1, h)],
            axes: [frame(u, y, u.cross(&y)), frame(u, z.cross(&u), z)],
        }
    }

    /// Of limb 3, with A3 `h` out of its plane.
    #[inline(always)]
    pub(super) fn frame_3(&self, p: &Posture<T>, h: T) -> LimbFrame<T> {
        let (x, z) = Self::leaning_3(p, h);
        let axes = frame(x, z.cross(&x), z);
        let platform = Vector3::new(self.actual.a2, T::ZERO, h);
        LimbFrame { length_m: p.q.z, joints_m: [platform - z * p.q.z, platform], axes: [axes, axes] }
    }

    /// Adds what effects have inside a limb to it, and what its tension adds to K beside it.
    #[inline(never)]
    fn add_effects<const N: usize>(&self, limb: &mut Limb<'_, T, N>, beside: &mut Lower<T>) {
        self.effects.in_limb(limb);
        self.effects.elements_in_limb(limb);
        self.add_tension(limb, beside);
    }

    #[inline(never)]
    fn add_tension<const N: usize>(&self, limb: &Limb<'_, T, N>, beside: &mut Lower<T>) {
        let tension = self.effects.tension(limb.index);
        if tension != T::ZERO {
            let [_, across, _] = axes(&limb.axes);
            stiffen(beside, &join(across, limb.platform.cross(&across)), tension / limb.q);
        }
    }

    /// Limb 1 (`LIMB` = 0) or 2. All of it lies in the plane of y of B and n = BA/|BA|, square to u. The wrenches are the
    /// axial force, the force along u through B_i, and the couple about n. With `OFFSET` A_i is `h` out of its plane.
    pub(super) fn chain_1_2<const LIMB: usize, const OFFSET: bool>(&self, p: &Posture<T>, h: T) -> Chain<T, 3> {
        let side = side::<LIMB, T>();
        // without effects no temperature changes anything
        let softened;
        let c = if OFFSET {
            softened = self.limbs[LIMB].softened(self.softness);
            &softened
        } else {
            &self.limbs[LIMB]
        };
        let (q, sin, cos) = (p.length::<LIMB>(), p.sin_sigma, p.cos_sigma);
        // limb axis in (y, n), and in A-uvw, where y = (0, cos σ, −sin σ) and n = (0, sin σ, cos σ)
        let (zy, zn) = (p.along_y[LIMB] / q, p.along_n[LIMB] / q);
        let (zv, zw) = (zy * cos + zn * sin, zn * cos - zy * sin);
        let o = T::ZERO;
        let b = side * self.actual.b1;
        let lever = side * self.actual.a1 * zw;
        let wrenches = [
            [o, zv, zw, if OFFSET { lever - h * zv } else { lever }, o, o],
            [T::ONE, o, o, o, -p.l * cos - b * sin, p.l * sin - b * cos],
            [o, o, o, o, sin, cos],
        ];

        // The force through B_i meets the cantilever like a load on its tip that leaves no moment at B_i; the
        // uncoupled one (diagonal) takes the tip's moment −q as a second load.
        let (force_share, mixed_share) = if c.coupled { (1.0 / 3.0, 0.5) } else { (4.0 / 3.0, 1.0) };
        let bend = q * c.bending;
        let tilt = c.platform_angular[1];
        let (zy2, zn2) = (zy * zy, zn * zn);
        let axial = zy2 * c.base_linear[1] + zn2 * c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let force = c.base_linear[0] + c.platform_linear[0] + q * q * (T::from_f64(force_share) * bend + tilt);
        let mixed = zy * q * (T::from_f64(mixed_share) * bend + tilt);
        let couple = c.base_angular[2] + zy2 * (bend + tilt) + zn2 * (q * c.torsion + c.platform_angular[2]);
        Chain { wrenches, compliance: [[axial, o, o], [o, force, o], [o, mixed, couple]] }
    }

    /// x and z of limb 3 in A-uvw when A3 is `h` along w out of its plane: then it leans out of the plane across y of B.
    fn leaning_3(p: &Posture<T>, h: T) -> (Vector3<T>, Vector3<T>) {
        let (y, n, q) = (p.y(), p.n(), p.q.z);
        let [zu, zn, zy] = [p.limb_3[0] / q, p.limb_3[1] / q, -p.sin_sigma * h / q];
        let z = Vector3::new(zu, zn * n.y + zy * y.y, zn * n.z + zy * y.z);
        let size = (T::ONE - zy * zy).sqrt();
        (Vector3::new(-zy * z.x / size, (y.y - zy * z.y) / size, (y.z - zy * z.z) / size), z)
    }

    /// Limb 3: the axial force and the force along y of B, both through A3. With `OFFSET` A3 is `h` along w out of its plane.
    pub(super) fn chain_3<const OFFSET: bool>(&self, p: &Posture<T>, h: T) -> Chain<T, 2> {
        let softened;
        let c = if OFFSET {
            softened = self.limbs[2].softened(self.softness);
            &softened
        } else {
            &self.limbs[2]
        };
        let q = p.q.z;
        let a2 = self.actual.a2;
        let wrenches = if OFFSET {
            let (x, z) = Self::leaning_3(p, h);
            [z, x].map(|f| join(f, Vector3::new(a2, T::ZERO, h).cross(&f)).into())
        } else {
            let (zu, zn) = (p.limb_3[0] / q, p.limb_3[1] / q);
            let through_a3 = |u: T, v: T, w: T| [u, v, w, T::ZERO, -a2 * w, a2 * v];
            [through_a3(zu, zn * p.sin_sigma, zn * p.cos_sigma), through_a3(T::ZERO, p.cos_sigma, -p.sin_sigma)]
        };
        let axial = c.base_linear[2] + q * c.axial + c.platform_linear[2];
        let sideways = c.base_linear[0]
            + c.platform_linear[0]
            + q * q * (c.base_angular[1] + q * c.bending * T::from_f64(1.0 / 3.0));
        Chain { wrenches, compliance: [[axial, T::ZERO], [T::ZERO, sideways]] }
    }
}

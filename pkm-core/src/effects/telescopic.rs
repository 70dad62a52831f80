use super::{Effect, EffectInfo, MAX_PARAMETERS};
use crate::elastic::Limb;
use crate::linalg::axes;
use crate::scalar::Scalar;

/// A ram slides in a tube. The tube ends at a fixed distance from B_i, the ram at a fixed distance from A_i; guides at both
/// ends of the overlap, at least 10 mm apart, carry the bending moment as a pair of forces. Where they overlap neither
/// bends with the whole moment; beyond the tube the ram bends and twists alone. All of it changes with the length.
pub(super) struct TelescopicLimb;

impl Effect for TelescopicLimb {
    const INFO: EffectInfo = EffectInfo {
        id: "telescopic-limb",
        // lengths of tube and ram; 1/EI of the ram less 1/EI of the declared body; a guide; the same of 1/GJ; of 1/EA,
        // since the screw carries the axial load alone
        parameters: &[
            "tube_m",
            "ram_m",
            "ram_bending_per_nm2",
            "guide_m_per_n",
            "ram_torsion_per_nm2",
            "screw_axial_per_n",
        ],
        signed: false,
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let (o, [tube, ram, bending, guide, torsion, axial]) = (T::ZERO, *p);
        limb.chain.add_joint(&limb.platform, &limb.axes, [o, o, axial * limb.q, o, o, o]);
        if !(tube > o && tube < limb.q) {
            return;
        }
        let least = T::from_f64(0.01);
        let mut overlap = tube + ram - limb.q;
        if !(overlap > least) {
            overlap = least;
        }
        if overlap > tube {
            overlap = tube;
        }
        let [x, _, z] = axes(&limb.axes);
        let at = |s: T| limb.base + z * s;
        let (inner, outer) = (at(tube - overlap), at(tube));
        limb.chain.add_beam(&outer, &limb.platform, &x, [o, bending, bending, torsion]);
        // in the overlap the ram's moment falls to 0 at the inner guide, the tube's at the outer one
        limb.chain.add_beam(&inner, &outer, &x, [o, -limb.bending, -limb.bending, o]);
        let (third, pair) = (overlap * T::from_f64(1.0 / 3.0), guide / (overlap * overlap));
        let (at_inner, at_outer) = (pair + third * limb.bending, pair + third * (limb.bending + bending));
        limb.chain.add_joint(&inner, &limb.axes, [o, o, o, at_inner, at_inner, o]);
        limb.chain.add_joint(&outer, &limb.axes, [o, o, o, at_outer, at_outer, o]);
    }
}

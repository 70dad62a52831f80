use super::{Effect, EffectInfo, Expected, MAX_PARAMETERS, ParameterInfo, Plausible, ToldBy};
use crate::elastic::Limb;
use crate::linalg::axes;
use crate::scalar::Scalar;

/// A ram that moves at its end by some of what a limb does.
const RAM: Plausible = Plausible::Within(|m| 3.0 * m.across_m_per_n / (m.shortest_m * m.shortest_m * m.shortest_m));

/// A ram slides in a tube. The tube ends at a fixed distance from B_i, the ram at a fixed distance from A_i; guides at both
/// ends of the overlap, at least 10 mm apart, carry the bending moment as a pair of forces. Where they overlap neither
/// bends with the whole moment; beyond the tube the ram bends and twists alone. All of it changes with the length.
pub(super) struct TelescopicLimb;

impl Effect for TelescopicLimb {
    const INFO: EffectInfo = EffectInfo {
        id: "telescopic-limb",
        parameters: &[
            // the tube ends before the shortest limb does
            ParameterInfo::new("tube_m", 1e6, Plausible::Below(|m| m.shortest_m)),
            // and overlaps the ram at the longest
            ParameterInfo::new(
                "ram_m",
                1e6,
                Plausible::Around { median: |m| m.longest_m - 0.75 * m.shortest_m + 0.12, ln_sd: 0.15 },
            ),
            // 1/EI of the ram less 1/EI of the declared body; a guide; the same of 1/GJ
            ParameterInfo::new("ram_bending_per_nm2", 1e3, RAM),
            ParameterInfo::new("guide_m_per_n", 1e-3, Plausible::Within(|m| m.axial_m_per_n)),
            ParameterInfo::new("ram_torsion_per_nm2", 1e3, RAM),
            // of 1/EA, since the screw carries the axial load alone
            ParameterInfo::new("screw_axial_per_n", 1e-3, Plausible::Within(|m| 2.0 * m.axial_m_per_n / m.shortest_m)),
        ],
        signed: false,
        expected: Expected {
            places: &["limb.1.body", "limb.2.body", "limb.3.body"],
            motion: "lateral",
            law: "extension",
            ln_prior: 0.0,
            class: None,
            told_by: ToldBy::Loading,
            inspect: "the limbs: tube, ram and guides",
        },
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

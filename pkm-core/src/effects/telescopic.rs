use super::{Effect, EffectInfo, Limb, MAX_PARAMETERS};
use crate::scalar::Scalar;

/// Beyond the tube, which ends at a fixed distance from B_i, the ram alone bends and twists; and the guides where it leaves
/// the tube give way to its tilting. Both get less as the limb gets shorter.
pub(super) struct TelescopicLimb;

impl Effect for TelescopicLimb {
    const INFO: EffectInfo = EffectInfo {
        id: "telescopic-limb",
        // where the tube ends; 1/EI of the ram less 1/EI of the declared body; tilting of the guides; the same of 1/GJ
        parameters: &["tube_m", "ram_bending_per_nm2", "guide_rad_per_nm", "ram_torsion_per_nm2"], signed: false
    };

    fn in_limb<T: Scalar, const N: usize>(p: &[T; MAX_PARAMETERS], limb: &mut Limb<'_, T, N>) {
        let (o, [tube, ram, guide, torsion, ..]) = (T::ZERO, *p);
        if tube >= limb.q {
            return;
        }
        let [_, _, z] = limb.axes;
        let end = [limb.base[0] + tube * z[0], limb.base[1] + tube * z[1], limb.base[2] + tube * z[2]];
        limb.chain.add_beam(end, limb.platform, limb.axes[0], [o, ram, ram, torsion]);
        limb.chain.add_joint(end, &limb.axes, [o, o, o, guide, guide, o]);
    }
}

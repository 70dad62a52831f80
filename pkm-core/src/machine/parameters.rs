//! The numbers of one machine as plain data that a generated table can hold as a `const`.

use crate::checksum::{START, over_byte, over_numbers, over_text};
use crate::effects::{self, Effects, Size};

/// The numbers of one machine, SI, unchecked. The limbs are in the order of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MachineParameters {
    /// Sizes of the two platforms.
    pub geometry: Geometry,
    /// Limits of the screws.
    pub travel: Travel,
    /// Joints and body of each limb.
    pub limbs: [LimbParameters; 3],
    /// Physics beyond the basic model.
    pub effects: Effects,
}

/// Platform sizes (paper, Section 2): a1 = |A A2|, a2 = |A A3|, b1 = |B B2|, b2 = |B B3|, in m, all above 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Half distance of A1 and A2.
    pub a1_m: f64,
    /// Distance of A3 from A.
    pub a2_m: f64,
    /// Half distance of B1 and B2.
    pub b1_m: f64,
    /// Distance of B3 from B.
    pub b2_m: f64,
}

/// Least and greatest screw lengths of limbs 1, 2, 3 in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Least lengths, above 0.
    pub min_m: [f64; 3],
    /// Greatest lengths.
    pub max_m: [f64; 3],
}

/// One limb as a chain: base joint, body, platform joint (paper, Eq. 7).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimbParameters {
    /// U joint of limbs 1 and 2, R joint of limb 3.
    pub base_joint: Joint,
    /// R joint of limbs 1 and 2, S joint of limb 3.
    pub platform_joint: Joint,
    /// Rod and lead screw.
    pub body: Body,
}

/// Stiffness of a joint along and about the axes of its frame. Released directions are 0.
///
/// | joint | axes | released |
/// |---|---|---|
/// | U, limbs 1, 2 at B_i | u, y of B, u × y | about 1st and 2nd |
/// | R, limbs 1, 2 at A_i | u, z × u, z along B_i→A_i | about 1st |
/// | R, limb 3 at B3 | y of B, z × y, z along B_3→A_3 | about 1st |
/// | S, limb 3 at A3 | the same | about all |
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Along the axes, N/m.
    pub linear_n_per_m: [f64; 3],
    /// About the axes, N·m/rad.
    pub angular_nm_per_rad: [f64; 3],
}

/// Rod and lead screw side by side, clamped at B_i, of the length of the limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// How the cantilever's stiffness is written down.
    pub kind: BodyKind,
    /// The tube that guides.
    pub rod: Tube,
    /// The screw that drives.
    pub screw: Tube,
}

/// The two readings of the paper's Eq. 7.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BodyKind {
    /// Euler–Bernoulli cantilever with its coupling of translation and rotation.
    Beam,
    /// The paper's diagonal taken literally: 3EI/q³, EI/q, EA/q, GJ/q, no coupling.
    Diagonal,
}

/// A round bar or tube.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Young's modulus, Pa.
    pub young_pa: f64,
    /// Shear modulus, Pa.
    pub shear_pa: f64,
    /// Outer diameter, m.
    pub outer_m: f64,
    /// Inner diameter, m; 0 for a bar.
    pub inner_m: f64,
}

impl Tube {
    pub(super) const fn area_m2(&self) -> f64 {
        let (d, i) = (self.outer_m, self.inner_m);
        core::f64::consts::PI / 4.0 * (d - i) * (d + i)
    }

    /// About a diameter; twice this about the axis.
    pub(super) const fn second_moment_m4(&self) -> f64 {
        let (d, i) = (self.outer_m, self.inner_m);
        core::f64::consts::PI / 64.0 * (d * d - i * i) * (d * d + i * i)
    }
}

impl Geometry {
    pub(super) const fn size(&self, size: Size) -> f64 {
        match size {
            Size::A1 => self.a1_m,
            Size::A2 => self.a2_m,
            Size::B1 => self.b1_m,
            Size::B2 => self.b2_m,
        }
    }
}

impl MachineParameters {
    /// The sizes of the platforms as they stand there: the declared ones and the errors that effects give them.
    pub const fn actual_geometry(&self) -> Geometry {
        let mut g = self.geometry;
        let mut i = 0;
        while i < effects::COUNT {
            let [error, ..] = self.effects.parameters[i];
            match effects::SIZES[i] {
                Some(Size::A1) => g.a1_m += error,
                Some(Size::A2) => g.a2_m += error,
                Some(Size::B1) => g.b1_m += error,
                Some(Size::B2) => g.b2_m += error,
                None => {}
            }
            i += 1;
        }
        g
    }

    /// Checksum (FNV-1a, 64 bit) over the bits of all numbers: a generated machine checks itself with it when it is
    /// compiled.
    pub const fn checksum(&self) -> u64 {
        const fn over_tube(hash: u64, t: &Tube) -> u64 {
            over_numbers(hash, &[t.young_pa, t.shear_pa, t.outer_m, t.inner_m])
        }
        const fn over_joint(hash: u64, j: &Joint) -> u64 {
            over_numbers(over_numbers(hash, &j.linear_n_per_m), &j.angular_nm_per_rad)
        }
        let g = &self.geometry;
        let mut hash = over_numbers(START, &[g.a1_m, g.a2_m, g.b1_m, g.b2_m]);
        hash = over_numbers(over_numbers(hash, &self.travel.min_m), &self.travel.max_m);
        let mut i = 0;
        while i < 3 {
            let limb = &self.limbs[i];
            hash = over_joint(over_joint(hash, &limb.base_joint), &limb.platform_joint);
            hash = over_byte(hash, limb.body.kind as u8);
            hash = over_tube(over_tube(hash, &limb.body.rod), &limb.body.screw);
            i += 1;
        }
        let mut i = 0;
        while i < effects::COUNT {
            let values = &self.effects.parameters[i];
            let mut n = 0;
            while n < effects::MAX_PARAMETERS {
                // what is off leaves no trace, so that a later version with more effects gives the same sum
                if values[n] != 0.0 {
                    hash = over_text(hash, effects::IDS[i]);
                    hash = over_numbers(over_byte(hash, n as u8), &[values[n]]);
                }
                n += 1;
            }
            i += 1;
        }
        let mut i = 0;
        while i < effects::MAX_ELEMENTS {
            if let Some(element) = &self.effects.elements[i] {
                let place = match element.place.name() {
                    Some(name) => name,
                    None => "",
                };
                hash = over_text(over_text(over_text(hash, place), element.motion.name()), element.law.name());
                let (first, others) = element.parameters.split_at(effects::MAX_PARAMETERS);
                hash = over_numbers(hash, first);
                // few elements have more parameters than effects; what they do not use leaves no trace
                if matches!(element.motion, effects::Motion::Coupled) {
                    hash = over_numbers(hash, others);
                } else if others[0] != 0.0 {
                    hash = over_numbers(hash, &[others[0]]);
                }
            }
            i += 1;
        }
        hash
    }
}

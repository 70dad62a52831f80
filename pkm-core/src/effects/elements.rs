//! Elements: compliances that are on no list, each a place, a motion and a law (`[[element]]` of a machine file). Long: lists of names.
//!
//! An element sees one component of the forces and moments that pass at its place, or a sum of several, a linear function
//! s = aᵀλ of the transmitted wrenches λ, and yields by c·s in the direction that does work with it: it adds c a aᵀ to the
//! compliance there. A law says how c changes with the limb's length and the temperature. Under the laws that depend on the load
//! the elongation of a limb is no multiple of its force; they add to the deflection, not to the stiffness.

use super::same;

/// Most elements that a machine has.
pub const MAX_ELEMENTS: usize = 8;

/// Most parameters that an element has.
pub const MAX_ELEMENT_PARAMETERS: usize = 16;

/// Weights of a coupled element are kept as multiples of 1/4096: 2⁻¹⁶ of the greatest that is allowed, 8.
pub const WEIGHT_STEPS: f64 = 4096.0;

/// Where an element sits. Limbs count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Place {
    /// At B_i.
    BaseJoint {
        /// 1, 2, 3.
        limb: u8,
    },
    /// From B_i to A_i.
    Body {
        /// 1, 2, 3.
        limb: u8,
    },
    /// At A_i.
    PlatformJoint {
        /// 1, 2, 3.
        limb: u8,
    },
    /// Between the limbs and A, at A.
    MovingPlatform,
    /// Between the ground and the mechanism, at B.
    Base,
    /// Between A and the tool, at A: after a correction table.
    Tool,
}

/// In which direction an element yields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Motion {
    /// Of a limb: along the line from B_i to A_i.
    Axial,
    /// Of a limb: across that line.
    Lateral,
    /// Of a limb: about any axis across that line. A body bends evenly: under a constant moment its ends turn against
    /// each other by the compliance times the moment.
    Tilting,
    /// Of a limb: about that line.
    Torsion,
    /// Of the moving platform and the tool: along u.
    U,
    /// Along v.
    V,
    /// Along w.
    W,
    /// About u.
    Ru,
    /// About v.
    Rv,
    /// About w.
    Rw,
    /// Of the base: along x of B.
    X,
    /// Along y.
    Y,
    /// Along z.
    Z,
    /// About x.
    Rx,
    /// About y.
    Ry,
    /// About z.
    Rz,
    /// Of any place: by a sum s of all forces (weights without unit) and moments (weights in 1/m) that pass there, each weight
    /// below 8 and rounded to 1/4096. Several such elements are any compliance of a place.
    ///
    /// Of joints the forces and moments along and about their axes x, y, z; of a body the wrenches that the limb
    /// transmits (axial force, force across, couple; limb 3 has no couple); of the moving platform the forces on it at A₁, A₂,
    /// A₃ along u, v, w, and the moments at A₁ and A₂; of the base the forces at B₁, B₂, B₃ along x, y, z of B, and the
    /// moments there about x and z; of the tool force and moment at A along and about u, v, w.
    Coupled,
    /// Of the body of limb 1: a spring to the body of limb 2, such as a cable carrier or a pack of hoses. It is beside the mechanism,
    /// not in a row with what the limbs transmit: it adds a stiffness. See [`LimbFrame::tied`](crate::LimbFrame::tied).
    TiedToLimb2,
    /// Of the bodies of limbs 1 and 2: the same to the body of limb 3.
    TiedToLimb3,
    /// Of the moving platform: a spring to the base, such as a pack of hoses, a cover or a counterbalance. It too adds a stiffness: it
    /// pulls by a sum of what A moves by along and about u, v, w (weights of turns in m), with a force that does work with that.
    TiedToBase,
}

/// What an element's compliance depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Law {
    /// c.
    Constant,
    /// c + c₁ x + c₂ x², x = q − `length_m` the limb's extension; and d (1 − y²)², y = (q − `local_at_m`)/`local_half_m`, where
    /// |y| < 1: a stretch of the screw that is worn. Without it `local_half_m` is 0. Places of a limb.
    Extension,
    /// c + a sin(2π q/p + φ), q the limb's length. Places of a limb.
    Periodic,
    /// Elongation under the limb's tension N: a |N| + (b N² + d N|N|)/r + e N³/r² + (p/2) N/√(N² + w²), w at least 1 N. With
    /// r = √(1 + (N/s)²) it goes over to straight lines above a tension s (at least 1 N); without one (s = 0) r is 1. Axial.
    Load,
    /// Elongation that lags behind the limb's tension, as that of the effect `friction-hysteresis`. Axial.
    Direction,
    /// c₁ (T − 20 °C); see [`Machine::at_temperature`](crate::Machine::at_temperature).
    Temperature,
}

/// A compliance at a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    /// Where.
    pub place: Place,
    /// In which direction.
    pub motion: Motion,
    /// By what law.
    pub law: Law,
    /// SI, in the order of [`parameter_names`](Self::parameter_names), then zeros. Any sign.
    pub parameters: [f64; MAX_ELEMENT_PARAMETERS],
}

/// Why an element is none. Its parameters are checked apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Misfit {
    Limb,
    Motion,
    Law,
}

impl Place {
    /// Every place.
    pub const ALL: [Self; 12] = [
        Self::BaseJoint { limb: 1 },
        Self::Body { limb: 1 },
        Self::PlatformJoint { limb: 1 },
        Self::BaseJoint { limb: 2 },
        Self::Body { limb: 2 },
        Self::PlatformJoint { limb: 2 },
        Self::BaseJoint { limb: 3 },
        Self::Body { limb: 3 },
        Self::PlatformJoint { limb: 3 },
        Self::MovingPlatform,
        Self::Base,
        Self::Tool,
    ];

    /// As in files; `None` for a limb other than 1, 2, 3.
    pub const fn name(self) -> Option<&'static str> {
        Some(match self {
            Self::BaseJoint { limb: 1 } => "limb.1.base_joint",
            Self::Body { limb: 1 } => "limb.1.body",
            Self::PlatformJoint { limb: 1 } => "limb.1.platform_joint",
            Self::BaseJoint { limb: 2 } => "limb.2.base_joint",
            Self::Body { limb: 2 } => "limb.2.body",
            Self::PlatformJoint { limb: 2 } => "limb.2.platform_joint",
            Self::BaseJoint { limb: 3 } => "limb.3.base_joint",
            Self::Body { limb: 3 } => "limb.3.body",
            Self::PlatformJoint { limb: 3 } => "limb.3.platform_joint",
            Self::MovingPlatform => "moving_platform",
            Self::Base => "base",
            Self::Tool => "tool",
            Self::BaseJoint { .. } | Self::Body { .. } | Self::PlatformJoint { .. } => return None,
        })
    }

    /// The place of a name.
    pub const fn from_name(name: &str) -> Option<Self> {
        let mut i = 0;
        while i < Self::ALL.len() {
            if let Some(own) = Self::ALL[i].name()
                && same(own.as_bytes(), name.as_bytes())
            {
                return Some(Self::ALL[i]);
            }
            i += 1;
        }
        None
    }

    /// The limb that it belongs to, from 1.
    pub const fn limb(self) -> Option<u8> {
        match self {
            Self::BaseJoint { limb } | Self::Body { limb } | Self::PlatformJoint { limb } => Some(limb),
            Self::MovingPlatform | Self::Base | Self::Tool => None,
        }
    }

    /// The motions that it may have; of a limb its four, of anything else three translations and then three rotations; then
    /// [`Motion::Coupled`]; last what the body of a limb, or the moving platform, may be tied to.
    pub const fn motions(self) -> &'static [Motion] {
        use Motion::{
            Axial, Coupled, Lateral, Ru, Rv, Rw, Rx, Ry, Rz, TiedToBase, TiedToLimb2, TiedToLimb3, Tilting, Torsion, U,
            V, W, X, Y, Z,
        };
        match self {
            Self::Body { limb: 1 } => &[Axial, Lateral, Tilting, Torsion, Coupled, TiedToLimb2, TiedToLimb3],
            Self::Body { limb: 2 } => &[Axial, Lateral, Tilting, Torsion, Coupled, TiedToLimb3],
            Self::BaseJoint { .. } | Self::Body { .. } | Self::PlatformJoint { .. } => {
                &[Axial, Lateral, Tilting, Torsion, Coupled]
            }
            Self::MovingPlatform => &[U, V, W, Ru, Rv, Rw, Coupled, TiedToBase],
            Self::Tool => &[U, V, W, Ru, Rv, Rw, Coupled],
            Self::Base => &[X, Y, Z, Rx, Ry, Rz, Coupled],
        }
    }

    /// Names of the parameters of a coupled element.
    const fn coupled_names(self) -> &'static [&'static str] {
        match self {
            Self::BaseJoint { .. } | Self::PlatformJoint { .. } => {
                &["compliance_m_per_n", "x", "y", "z", "rx_per_m", "ry_per_m", "rz_per_m"]
            }
            Self::Body { limb: 3 } => &["compliance_m_per_n", "axial", "across"],
            Self::Body { .. } => &["compliance_m_per_n", "axial", "across", "couple_per_m"],
            Self::MovingPlatform => &[
                "compliance_m_per_n",
                "a1_u",
                "a1_v",
                "a1_w",
                "a2_u",
                "a2_v",
                "a2_w",
                "a3_u",
                "a3_v",
                "a3_w",
                "a1_ru_per_m",
                "a1_rv_per_m",
                "a1_rw_per_m",
                "a2_ru_per_m",
                "a2_rv_per_m",
                "a2_rw_per_m",
            ],
            Self::Base => &[
                "compliance_m_per_n",
                "b1_x",
                "b1_y",
                "b1_z",
                "b2_x",
                "b2_y",
                "b2_z",
                "b3_x",
                "b3_y",
                "b3_z",
                "b1_rx_per_m",
                "b1_rz_per_m",
                "b2_rx_per_m",
                "b2_rz_per_m",
                "b3_rx_per_m",
                "b3_rz_per_m",
            ],
            Self::Tool => &["compliance_m_per_n", "u", "v", "w", "ru_per_m", "rv_per_m", "rw_per_m"],
        }
    }
}

impl Motion {
    /// As in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Axial => "axial",
            Self::Lateral => "lateral",
            Self::Tilting => "tilting",
            Self::Torsion => "torsion",
            Self::U => "u",
            Self::V => "v",
            Self::W => "w",
            Self::Ru => "ru",
            Self::Rv => "rv",
            Self::Rw => "rw",
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
            Self::Rx => "rx",
            Self::Ry => "ry",
            Self::Rz => "rz",
            Self::Coupled => "coupled",
            Self::TiedToLimb2 => "tied_to_limb_2",
            Self::TiedToLimb3 => "tied_to_limb_3",
            Self::TiedToBase => "tied_to_base",
        }
    }

    /// The limb (0, 1, 2) that a body is tied to.
    pub const fn tied_to(self) -> Option<usize> {
        match self {
            Self::TiedToLimb2 => Some(1),
            Self::TiedToLimb3 => Some(2),
            _ => None,
        }
    }

    /// Whether it is a spring beside the mechanism, which adds a stiffness and no compliance.
    pub const fn is_tie(self) -> bool {
        matches!(self, Self::TiedToLimb2 | Self::TiedToLimb3 | Self::TiedToBase)
    }

    /// Whether it is a rotation: its compliance is in rad/(N·m) instead of m/N.
    pub const fn is_rotation(self) -> bool {
        matches!(self, Self::Tilting | Self::Torsion | Self::Ru | Self::Rv | Self::Rw | Self::Rx | Self::Ry | Self::Rz)
    }
}

impl Law {
    /// Every law.
    pub const ALL: [Self; 6] =
        [Self::Constant, Self::Extension, Self::Periodic, Self::Load, Self::Direction, Self::Temperature];

    /// As in files.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::Extension => "extension",
            Self::Periodic => "periodic",
            Self::Load => "load",
            Self::Direction => "direction",
            Self::Temperature => "temperature",
        }
    }

    /// The law of a name.
    pub const fn from_name(name: &str) -> Option<Self> {
        let mut i = 0;
        while i < Self::ALL.len() {
            if same(Self::ALL[i].name().as_bytes(), name.as_bytes()) {
                return Some(Self::ALL[i]);
            }
            i += 1;
        }
        None
    }

    /// Whether it says an elongation under load instead of a compliance.
    pub const fn depends_on_load(self) -> bool {
        matches!(self, Self::Load | Self::Direction)
    }
}

impl Element {
    /// Names of its parameters with units, as in files.
    pub const fn parameter_names(&self) -> &'static [&'static str] {
        if matches!(self.motion, Motion::Coupled) {
            return self.place.coupled_names();
        }
        if matches!(self.motion, Motion::TiedToBase) {
            return &["stiffness_n_per_m", "u", "v", "w", "ru_m", "rv_m", "rw_m"];
        }
        if self.motion.is_tie() {
            return &["stiffness_n_per_m", "u", "v", "w"];
        }
        match (self.law, self.motion.is_rotation()) {
            (Law::Constant, false) => &["compliance_m_per_n"],
            (Law::Constant, true) => &["compliance_rad_per_nm"],
            (Law::Extension, false) => &[
                "compliance_m_per_n",
                "slope_per_n",
                "curvature_per_nm",
                "length_m",
                "local_m_per_n",
                "local_at_m",
                "local_half_m",
            ],
            (Law::Extension, true) => &[
                "compliance_rad_per_nm",
                "slope_rad_per_nm2",
                "curvature_rad_per_nm3",
                "length_m",
                "local_rad_per_nm",
                "local_at_m",
                "local_half_m",
            ],
            (Law::Periodic, false) => &["compliance_m_per_n", "amplitude_m_per_n", "pitch_m", "phase_rad"],
            (Law::Periodic, true) => &["compliance_rad_per_nm", "amplitude_rad_per_nm", "pitch_m", "phase_rad"],
            (Law::Load, _) => &[
                "asymmetric_m_per_n",
                "even_m_per_n2",
                "odd_m_per_n2",
                "cubic_m_per_n3",
                "play_m",
                "taken_up_n",
                "straight_above_n",
            ],
            (Law::Direction, _) => &["lag_m", "lag_m_per_n", "reversal_n"],
            (Law::Temperature, false) => &["compliance_m_per_n_per_k"],
            (Law::Temperature, true) => &["compliance_rad_per_nm_per_k"],
        }
    }

    /// An element by its names in files; parameters that are not given are 0. `None` for names that are unknown or do not
    /// fit together, or for more parameters than the law has.
    pub const fn from_names<const N: usize>(
        place: &str,
        motion: &str,
        law: &str,
        parameters: [f64; N],
    ) -> Option<Self> {
        let (Some(place), Some(law)) = (Place::from_name(place), Law::from_name(law)) else { return None };
        let motions = place.motions();
        let mut i = 0;
        while i < motions.len() {
            if same(motions[i].name().as_bytes(), motion.as_bytes()) {
                let mut element = Self { place, motion: motions[i], law, parameters: [0.0; MAX_ELEMENT_PARAMETERS] };
                if element.misfit().is_some() {
                    return None;
                }
                let known = element.parameter_names().len();
                let mut n = 0;
                while n < N {
                    if n < known {
                        element.parameters[n] = parameters[n];
                    } else if parameters[n] != 0.0 {
                        return None;
                    }
                    n += 1;
                }
                return Some(element);
            }
            i += 1;
        }
        None
    }

    /// Whether it is one compliance by its motion: neither a sum of what passes nor a tie.
    const fn is_one_compliance(&self) -> bool {
        !matches!(self.motion, Motion::Coupled) && !self.motion.is_tie()
    }

    /// What does not fit together.
    pub(crate) const fn misfit(&self) -> Option<Misfit> {
        if self.place.name().is_none() {
            return Some(Misfit::Limb);
        }
        let motions = self.place.motions();
        let mut known = false;
        let mut i = 0;
        while i < motions.len() {
            known |= motions[i] as u8 == self.motion as u8;
            i += 1;
        }
        let of_limb = self.place.limb().is_some();
        if !known {
            Some(Misfit::Motion)
        } else if match self.law {
            Law::Constant => true,
            Law::Temperature => self.is_one_compliance(),
            Law::Extension | Law::Periodic => of_limb && self.is_one_compliance(),
            Law::Load | Law::Direction => of_limb && matches!(self.motion, Motion::Axial),
        } {
            None
        } else {
            Some(Misfit::Law)
        }
    }

    /// Least size of a parameter that is refused, by the unit in its name; 0 for one that the law does not have.
    pub(crate) const fn limit(&self, parameter: usize) -> f64 {
        let names = self.parameter_names();
        if parameter >= names.len() {
            return 0.0;
        }
        if parameter > 0 && matches!(self.motion, Motion::Coupled) {
            return 8.0 - 0.5 / WEIGHT_STEPS;
        }
        let name = names[parameter].as_bytes();
        // a compliance, or what it changes by
        if contains(name, b"per_n") {
            1e-3
        } else if same(name, b"stiffness_n_per_m") {
            1e9
        } else if is_play_or_lag(name) {
            1e-2
        } else {
            1e6
        }
    }
}

const fn contains(mut text: &[u8], part: &[u8]) -> bool {
    while text.len() >= part.len() {
        if same(text.split_at(part.len()).0, part) {
            return true;
        }
        text = text.split_at(1).1;
    }
    false
}

/// Names of lengths that are small beside a machine: 10 mm are far beyond any.
const fn is_play_or_lag(name: &[u8]) -> bool {
    same(name, b"play_m") || same(name, b"lag_m")
}

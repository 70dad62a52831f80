//! Elements: compliances that are on no list, each a place, a motion and a law (`[[element]]` of a machine file).
//!
//! An element sees one component of the forces and moments that pass at its place, a linear function s = aᵀλ of the
//! transmitted wrenches λ, and yields by c·s in the direction that does work with it: it adds c a aᵀ to the compliance
//! there. A law says how c changes with the limb's length and the temperature. Under the laws that depend on the load
//! the elongation of a limb is no multiple of its force; they add to the deflection, not to the stiffness.

use super::{MAX_PARAMETERS, ends_with, load_dependent, same};
use crate::checksum::{over_byte, over_numbers, over_numbers_f32, over_text};
use crate::elastic::Limb;
use crate::linalg::axes;
use crate::scalar::Scalar;

/// Most elements that a machine has.
pub const MAX_ELEMENTS: usize = 8;

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
}

/// What an element's compliance depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Law {
    /// c.
    Constant,
    /// c + c₁ x + c₂ x², x = q − `length_m` the limb's extension. Places of a limb.
    Extension,
    /// c + a sin(2π q/p + φ), q the limb's length. Places of a limb.
    Periodic,
    /// Elongation under the limb's tension N: a |N| + b N² + d N|N| + e N³ + (p/2) N/√(N² + w²), w at least 1 N. Axial.
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
    pub parameters: [f64; MAX_PARAMETERS],
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

    /// The motions that it may have; of a limb all four, of anything else three translations and then three rotations.
    pub const fn motions(self) -> &'static [Motion] {
        use Motion::{Axial, Lateral, Ru, Rv, Rw, Rx, Ry, Rz, Tilting, Torsion, U, V, W, X, Y, Z};
        match self {
            Self::BaseJoint { .. } | Self::Body { .. } | Self::PlatformJoint { .. } => {
                &[Axial, Lateral, Tilting, Torsion]
            }
            Self::MovingPlatform | Self::Tool => &[U, V, W, Ru, Rv, Rw],
            Self::Base => &[X, Y, Z, Rx, Ry, Rz],
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
        }
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
    pub(crate) const fn depends_on_load(self) -> bool {
        matches!(self, Self::Load | Self::Direction)
    }
}

impl Element {
    /// Names of its parameters with units, as in files.
    pub const fn parameter_names(&self) -> &'static [&'static str] {
        match (self.law, self.motion.is_rotation()) {
            (Law::Constant, false) => &["compliance_m_per_n"],
            (Law::Constant, true) => &["compliance_rad_per_nm"],
            (Law::Extension, false) => &["compliance_m_per_n", "slope_per_n", "curvature_per_nm", "length_m"],
            (Law::Extension, true) => {
                &["compliance_rad_per_nm", "slope_rad_per_nm2", "curvature_rad_per_nm3", "length_m"]
            }
            (Law::Periodic, false) => &["compliance_m_per_n", "amplitude_m_per_n", "pitch_m", "phase_rad"],
            (Law::Periodic, true) => &["compliance_rad_per_nm", "amplitude_rad_per_nm", "pitch_m", "phase_rad"],
            (Law::Load, _) => {
                &["asymmetric_m_per_n", "even_m_per_n2", "odd_m_per_n2", "cubic_m_per_n3", "play_m", "taken_up_n"]
            }
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
                let mut element = Self { place, motion: motions[i], law, parameters: [0.0; MAX_PARAMETERS] };
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
            Law::Constant | Law::Temperature => true,
            Law::Extension | Law::Periodic => of_limb,
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
        let name = names[parameter].as_bytes();
        let compliance = ends_with(name, b"per_n")
            || ends_with(name, b"per_nm")
            || ends_with(name, b"per_n2")
            || ends_with(name, b"per_n3")
            || ends_with(name, b"per_k");
        if compliance { 1e-3 } else { 1e6 }
    }
}

/// The elements of one machine, ready to be applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ActiveElements<T> {
    list: [Option<Active<T>>; MAX_ELEMENTS],
    /// Above 20 °C.
    warmer_k: T,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Active<T> {
    place: Place,
    motion: Motion,
    law: Law,
    parameters: [T; MAX_PARAMETERS],
}

macro_rules! active_elements {
    ($t:ty, $over:path) => {
        impl ActiveElements<$t> {
            pub const fn new(elements: &[Option<Element>; MAX_ELEMENTS]) -> Self {
                let mut list = [None; MAX_ELEMENTS];
                let mut i = 0;
                while i < MAX_ELEMENTS {
                    if let Some(Element { place, motion, law, parameters: [a, b, c, d, e, f] }) = elements[i] {
                        let parameters = [a as $t, b as $t, c as $t, d as $t, e as $t, f as $t];
                        list[i] = Some(Active { place, motion, law, parameters });
                    }
                    i += 1;
                }
                Self { list, warmer_k: 0.0 }
            }

            /// Takes its numbers as they are in memory into a checksum.
            pub const fn checksum(&self, hash: u64) -> u64 {
                let mut hash = $over(hash, &[self.warmer_k]);
                let mut i = 0;
                while i < MAX_ELEMENTS {
                    if let Some(Active { place, motion, law, parameters }) = &self.list[i] {
                        let place = match place.name() {
                            Some(name) => name,
                            None => "",
                        };
                        hash = over_text(over_byte(hash, i as u8), place);
                        hash = $over(over_byte(over_byte(hash, *motion as u8), *law as u8), parameters);
                    }
                    i += 1;
                }
                hash
            }
        }
    };
}

active_elements!(f32, over_numbers_f32);
active_elements!(f64, over_numbers);

/// sin 2πt by its series up to the 17th power on a quarter turn, within 1e-13 in `f64` and 3e-7 in `f32` for few turns. Not
/// `libm`'s: that takes 1 KB of stack where the stack is deepest, to reduce angles of any size.
fn sine_of_turns<T: Scalar>(turns: T) -> T {
    /// 1/n!, with alternating signs, from n = 17 down to 1.
    const SERIES: [f64; 9] = [
        1.0 / 355_687_428_096_000.0,
        -1.0 / 1_307_674_368_000.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        -1.0 / 5_040.0,
        1.0 / 120.0,
        -1.0 / 6.0,
        1.0,
    ];
    let (half, quarter) = (T::from_f64(0.5), T::from_f64(0.25));
    let within = turns - (turns + half).floor();
    let folded = if within > quarter {
        half - within
    } else if within < -quarter {
        -half - within
    } else {
        within
    };
    let x = T::from_f64(core::f64::consts::TAU) * folded;
    let square = x * x;
    SERIES.iter().fold(T::ZERO, |sum, c| sum * square + T::from_f64(*c)) * x
}

impl<T: Scalar> Active<T> {
    /// At a length of the limb, m, and a temperature, K above 20 °C; 0 under a law of the load.
    fn compliance(&self, q: T, warmer_k: T) -> T {
        let [c, first, second, third, ..] = self.parameters;
        match self.law {
            Law::Constant => c,
            Law::Extension => {
                let x = q - third;
                c + x * (first + x * second)
            }
            Law::Periodic => c + first * sine_of_turns(q / second + third * T::from_f64(0.5 / core::f64::consts::PI)),
            Law::Temperature => c * warmer_k,
            Law::Load | Law::Direction => T::ZERO,
        }
    }

    fn is_in_limb(&self, index: usize) -> bool {
        self.place.limb().is_some_and(|limb| usize::from(limb) == index + 1)
    }
}

impl<T: Scalar> ActiveElements<T> {
    fn iter(&self) -> impl Iterator<Item = &Active<T>> {
        self.list.iter().flatten()
    }

    /// Whether any depends on the load.
    pub fn depend_on_load(&self) -> bool {
        self.iter().any(|element| element.law.depends_on_load())
    }

    /// Whether any depends on the temperature.
    pub fn depend_on_temperature(&self) -> bool {
        self.iter().any(|element| element.law == Law::Temperature)
    }

    /// Sets the temperature, K above 20 °C.
    pub fn set_temperature(&mut self, warmer_k: T) {
        self.warmer_k = warmer_k;
    }

    /// Adds the compliances inside a limb.
    pub fn in_limb<const N: usize>(&self, limb: &mut Limb<'_, T, N>) {
        let o = T::ZERO;
        for element in self.iter().filter(|element| element.is_in_limb(limb.index)) {
            let c = element.compliance(limb.q, self.warmer_k);
            let at = if let Place::PlatformJoint { .. } = element.place { &limb.platform } else { &limb.base };
            match (element.motion, element.place) {
                (Motion::Tilting, Place::Body { .. }) => {
                    let bending = c / limb.q;
                    let [x, ..] = axes(&limb.axes);
                    limb.chain.add_beam(&limb.base, &limb.platform, &x, [o, bending, bending, o]);
                }
                (motion, _) => {
                    let along = |of: Motion| if motion == of { c } else { o };
                    let (across, tilting) = (along(Motion::Lateral), along(Motion::Tilting));
                    let compliance = [across, across, along(Motion::Axial), tilting, tilting, along(Motion::Torsion)];
                    limb.chain.add_joint(at, &limb.axes, compliance);
                }
            }
        }
    }

    /// Calls `add` with the compliances at a place outside the limbs, along and about its axes, if there are any.
    pub fn at(&self, place: Place, add: impl FnOnce([T; 6])) {
        let mut sum = [T::ZERO; 6];
        let mut any = false;
        for element in self.iter().filter(|element| element.place == place) {
            for (sum, motion) in sum.iter_mut().zip(place.motions()) {
                if element.motion == *motion {
                    *sum += element.compliance(T::ZERO, self.warmer_k);
                    any = true;
                }
            }
        }
        if any {
            add(sum);
        }
    }

    /// Elongation of a limb (0, 1, 2) under tension.
    pub fn elongation(&self, limb: usize, tension: T) -> T {
        let mut sum = T::ZERO;
        for element in self.iter().filter(|element| element.law == Law::Load && element.is_in_limb(limb)) {
            let [asymmetric, even, odd, cubic, play, taken_up] = element.parameters;
            let size = tension.abs();
            sum += asymmetric * size + tension * (even * tension + odd * size + cubic * tension * tension);
            sum += load_dependent::taken_up(play, taken_up, tension);
        }
        sum
    }

    /// What lags behind the load in a limb's elongation.
    pub fn lag(&self, limb: usize, tension: T, turned_at: T) -> T {
        let mut sum = T::ZERO;
        for element in self.iter().filter(|element| element.law == Law::Direction && element.is_in_limb(limb)) {
            let [fixed, growing, reversal, ..] = element.parameters;
            sum += load_dependent::lagging([fixed, growing, reversal], tension, turned_at);
        }
        sum
    }
}

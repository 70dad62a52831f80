//! What the model knows of one machine: geometry, travel, and the stiffness of joints and bodies.
//!
//! [`MachineParameters`] is plain data that a generated table can hold as a `const`.
//! [`Machine::new`] checks it and turns it into what the formulas need; both work at compile time.

use core::fmt;

use crate::checksum::{START, over_byte, over_numbers, over_text};
use crate::effects::{self, ActiveEffects, Effects, Misfit, Size};
use crate::scalar::Scalar;

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
    const fn area_m2(&self) -> f64 {
        let (d, i) = (self.outer_m, self.inner_m);
        core::f64::consts::PI / 4.0 * (d - i) * (d + i)
    }

    /// About a diameter; twice this about the axis.
    const fn second_moment_m4(&self) -> f64 {
        let (d, i) = (self.outer_m, self.inner_m);
        core::f64::consts::PI / 64.0 * (d * d - i * i) * (d * d + i * i)
    }
}

/// Which number of [`MachineParameters`] an error is about. Limbs count from 1; axes, effects, elements and their parameters
/// from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[allow(missing_docs)] // the variants are the fields' own names
pub enum Parameter {
    A1,
    A2,
    B1,
    B2,
    TravelMin { limb: u8 },
    TravelMax { limb: u8 },
    JointLinear { limb: u8, end: End, axis: u8 },
    JointAngular { limb: u8, end: End, axis: u8 },
    Young { limb: u8, member: Member },
    Shear { limb: u8, member: Member },
    Outer { limb: u8, member: Member },
    Inner { limb: u8, member: Member },
    Effect { effect: u8, parameter: u8 },
    ElementPlace { element: u8 },
    ElementMotion { element: u8 },
    ElementLaw { element: u8 },
    Element { element: u8, parameter: u8 },
}

/// An end of a limb.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum End {
    /// At B_i.
    Base,
    /// At A_i.
    Platform,
}

/// A part of a limb's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Member {
    /// The tube that guides.
    Rod,
    /// The screw that drives.
    Screw,
}

/// What is wrong with a number of [`MachineParameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Problem {
    /// NaN or infinite.
    NotFinite,
    /// Zero or negative where only a positive number has a meaning, or too large or small to compute with.
    NotPositive,
    /// A released direction of a joint must have stiffness 0.
    NotReleased,
    /// The greatest screw length is not above the least.
    Reversed,
    /// Negative where only a number of at least 0 has a meaning.
    Negative,
    /// An effect's parameter far beyond what any machine has, either way: 1e-3 m/N or rad/(N·m), 1e3 /(N·m²), 0.1 m of
    /// offset, half of a platform's size, a stiffness of 5 % or a length of 1e-3 per kelvin, 1e6 otherwise.
    TooLarge,
    /// The bore is negative or not smaller than the outer diameter.
    Bore,
    /// An element's place has no such limb, motion or law: only a limb has a length, and only its axial motion may depend
    /// on the load.
    NotOfPlace,
}

/// Why [`Machine::new`] refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MachineError {
    /// The number.
    pub parameter: Parameter,
    /// What is wrong with it.
    pub problem: Problem,
}

impl fmt::Display for Parameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut size = |size| write!(f, "the platform size {size}");
        match *self {
            Self::A1 => size("a1"),
            Self::A2 => size("a2"),
            Self::B1 => size("b1"),
            Self::B2 => size("b2"),
            Self::TravelMin { limb } => write!(f, "the least length of screw {limb}"),
            Self::TravelMax { limb } => write!(f, "the greatest length of screw {limb}"),
            Self::JointLinear { limb, end, axis } => {
                write!(f, "limb {limb}, {end} joint: the stiffness along axis {axis}")
            }
            Self::JointAngular { limb, end, axis } => {
                write!(f, "limb {limb}, {end} joint: the stiffness about axis {axis}")
            }
            Self::Young { limb, member } => write!(f, "limb {limb}, {member}: Young's modulus"),
            Self::Shear { limb, member } => write!(f, "limb {limb}, {member}: the shear modulus"),
            Self::Outer { limb, member } => write!(f, "limb {limb}, {member}: the outer diameter"),
            Self::Inner { limb, member } => write!(f, "limb {limb}, {member}: the inner diameter"),
            Self::Effect { effect, parameter } => {
                let info = effects::EFFECTS.get(usize::from(effect));
                let name = info.and_then(|info| info.parameters.get(usize::from(parameter)));
                write!(f, "effect {}: {}", info.map_or("?", |info| info.id), name.unwrap_or(&"?"))
            }
            Self::ElementPlace { element } => write!(f, "element {element}: the limb"),
            Self::ElementMotion { element } => write!(f, "element {element}: the motion"),
            Self::ElementLaw { element } => write!(f, "element {element}: the law"),
            Self::Element { element, parameter } => write!(f, "element {element}: parameter {parameter}"),
        }
    }
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Base => "base",
            Self::Platform => "platform",
        })
    }
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rod => "rod",
            Self::Screw => "screw",
        })
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "is not a finite number",
            Self::NotPositive => "is not above 0, or far beyond any machine",
            Self::NotReleased => "must be 0, since the joint is free there",
            Self::Reversed => "is not above the least",
            Self::Negative => "is negative",
            Self::TooLarge => "is far beyond any machine",
            Self::Bore => "is negative or not below the outer one",
            Self::NotOfPlace => "is none that this place has",
        })
    }
}

impl fmt::Display for MachineError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.parameter, self.problem)
    }
}

impl core::error::Error for MachineError {}

/// A checked machine, ready for kinematics and stiffness in `f32` or `f64`.
///
/// Every division by a stiffness is done here, once.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Machine<T> {
    /// What the controller computes with.
    pub(crate) declared: Sizes<T>,
    /// What stands there: another thing only under an effect on geometry.
    pub(crate) actual: Sizes<T>,
    pub(crate) q_min: [T; 3],
    pub(crate) q_max: [T; 3],
    pub(crate) limbs: [LimbCompliance<T>; 3],
    /// `limbs` at [`DECLARED_TEMPERATURE_C`]: every other temperature starts from them, so that updates do not add up
    /// their rounding.
    declared_limbs: [LimbCompliance<T>; 3],
    pub(crate) effects: ActiveEffects<T>,
}

/// [`Geometry`] in a machine's number type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sizes<T> {
    pub a1: T,
    pub a2: T,
    pub b1: T,
    pub b2: T,
}

/// Compliances of one limb. An entry of a released direction is 0 and never asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LimbCompliance<T> {
    pub base_linear: [T; 3],
    pub base_angular: [T; 3],
    pub platform_linear: [T; 3],
    pub platform_angular: [T; 3],
    /// 1/EA.
    pub axial: T,
    /// 1/EI.
    pub bending: T,
    /// 1/GJ.
    pub torsion: T,
    /// Whether the cantilever couples translation and rotation ([`BodyKind::Beam`]).
    pub coupled: bool,
}

/// Directions that a joint releases, as a mask over its three angular axes.
const fn released(limb: usize, end: End) -> [bool; 3] {
    match (limb, end) {
        (2, End::Base) => [true, false, false],
        (2, End::Platform) => [true, true, true],
        (_, End::Base) => [true, true, false],
        (_, End::Platform) => [true, false, false],
    }
}

const fn check_positive(value: f64, parameter: Parameter) -> Result<(), MachineError> {
    let problem = if !value.is_finite() {
        Problem::NotFinite
    } else if value <= 1e-30 || value >= 1e30 {
        // f32 overflows beyond, and no length, modulus or stiffness of a machine is there
        Problem::NotPositive
    } else {
        return Ok(());
    };
    Err(MachineError { parameter, problem })
}

/// `?` does not work in a `const fn`.
macro_rules! check {
    ($e:expr) => {
        if let Err(error) = $e {
            return Err(error);
        }
    };
}

const fn check_joint(joint: &Joint, limb: usize, end: End) -> Result<(), MachineError> {
    let free = released(limb, end);
    let limb = limb as u8 + 1;
    let mut i = 0;
    while i < 3 {
        let axis = i as u8;
        check!(check_positive(joint.linear_n_per_m[i], Parameter::JointLinear { limb, end, axis }));
        let angular = Parameter::JointAngular { limb, end, axis };
        if !free[i] {
            check!(check_positive(joint.angular_nm_per_rad[i], angular));
        } else if joint.angular_nm_per_rad[i] != 0.0 {
            return Err(MachineError { parameter: angular, problem: Problem::NotReleased });
        }
        i += 1;
    }
    Ok(())
}

const fn check_tube(tube: &Tube, limb: usize, member: Member) -> Result<(), MachineError> {
    let limb = limb as u8 + 1;
    check!(check_positive(tube.young_pa, Parameter::Young { limb, member }));
    check!(check_positive(tube.shear_pa, Parameter::Shear { limb, member }));
    check!(check_positive(tube.outer_m, Parameter::Outer { limb, member }));
    let parameter = Parameter::Inner { limb, member };
    if !tube.inner_m.is_finite() {
        return Err(MachineError { parameter, problem: Problem::NotFinite });
    }
    if tube.inner_m < 0.0 || tube.inner_m >= tube.outer_m {
        return Err(MachineError { parameter, problem: Problem::Bore });
    }
    Ok(())
}

const fn check_element(found: &effects::Element, element: u8) -> Result<(), MachineError> {
    let parameter = match found.misfit() {
        None => {
            let mut i = 0;
            while i < effects::MAX_PARAMETERS {
                let (value, limit) = (found.parameters[i], found.limit(i));
                let parameter = Parameter::Element { element, parameter: i as u8 };
                if !value.is_finite() {
                    return Err(MachineError { parameter, problem: Problem::NotFinite });
                }
                if value != 0.0 && value.abs() >= limit {
                    return Err(MachineError { parameter, problem: Problem::TooLarge });
                }
                // the pitch
                if matches!(found.law, effects::Law::Periodic) && i == 2 {
                    check!(check_positive(value, parameter));
                }
                i += 1;
            }
            return Ok(());
        }
        Some(Misfit::Limb) => Parameter::ElementPlace { element },
        Some(Misfit::Motion) => Parameter::ElementMotion { element },
        Some(Misfit::Law) => Parameter::ElementLaw { element },
    };
    Err(MachineError { parameter, problem: Problem::NotOfPlace })
}

/// Temperature that stiffnesses are declared for, °C.
pub const DECLARED_TEMPERATURE_C: f64 = 20.0;

impl Geometry {
    const fn size(&self, size: Size) -> f64 {
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

    /// Checks every number: finite, positive where it must be, released directions 0, travel not reversed.
    ///
    /// # Errors
    /// The first number that fails, and why.
    pub const fn check(&self) -> Result<(), MachineError> {
        let g = &self.geometry;
        check!(check_positive(g.a1_m, Parameter::A1));
        check!(check_positive(g.a2_m, Parameter::A2));
        check!(check_positive(g.b1_m, Parameter::B1));
        check!(check_positive(g.b2_m, Parameter::B2));
        let mut i = 0;
        while i < 3 {
            let limb = i as u8 + 1;
            check!(check_positive(self.travel.min_m[i], Parameter::TravelMin { limb }));
            check!(check_positive(self.travel.max_m[i], Parameter::TravelMax { limb }));
            if self.travel.max_m[i] <= self.travel.min_m[i] {
                return Err(MachineError { parameter: Parameter::TravelMax { limb }, problem: Problem::Reversed });
            }
            let l = &self.limbs[i];
            check!(check_joint(&l.base_joint, i, End::Base));
            check!(check_joint(&l.platform_joint, i, End::Platform));
            check!(check_tube(&l.body.rod, i, Member::Rod));
            check!(check_tube(&l.body.screw, i, Member::Screw));
            i += 1;
        }
        let mut i = 0;
        while i < effects::COUNT * effects::MAX_PARAMETERS {
            let (effect, parameter) = (i / effects::MAX_PARAMETERS, i % effects::MAX_PARAMETERS);
            let value = self.effects.parameters[effect][parameter];
            let limit = match effects::SIZES[effect] {
                Some(size) => 0.5 * g.size(size),
                None => effects::LIMITS[effect][parameter],
            };
            let signed = effects::EFFECTS[effect].signed;
            let parameter = Parameter::Effect { effect: effect as u8, parameter: parameter as u8 };
            if !value.is_finite() {
                return Err(MachineError { parameter, problem: Problem::NotFinite });
            }
            if value < 0.0 && !signed {
                return Err(MachineError { parameter, problem: Problem::Negative });
            }
            if value.abs() >= limit {
                return Err(MachineError { parameter, problem: Problem::TooLarge });
            }
            i += 1;
        }
        let mut i = 0;
        while i < effects::MAX_ELEMENTS {
            if let Some(element) = &self.effects.elements[i] {
                check!(check_element(element, i as u8));
            }
            i += 1;
        }
        Ok(())
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
                    hash = over_text(hash, effects::EFFECTS[i].id);
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
                hash = over_numbers(hash, &element.parameters);
            }
            i += 1;
        }
        hash
    }
}

macro_rules! machine {
    ($t:ty) => {
        impl Machine<$t> {
            /// Checks the parameters and prepares them. Works in a `const`, so that a generated table
            /// with a bad number does not compile.
            ///
            /// # Errors
            /// The first number that [`MachineParameters::check`] refuses.
            ///
            /// ```
            /// use pkm_core::{Machine, machine::Geometry, tables::reference::PARAMETERS};
            /// let mut mine = PARAMETERS;
            /// mine.geometry = Geometry { a1_m: 0.17, ..mine.geometry };
            /// assert!(Machine::<f32>::new(&mine).is_ok());
            /// mine.geometry.b2_m = 0.0;
            /// let refused = Machine::<f64>::new(&mine).unwrap_err();
            /// assert_eq!(refused.to_string(), "the platform size b2 is not above 0, or far beyond any machine");
            /// ```
            pub const fn new(parameters: &MachineParameters) -> Result<Self, MachineError> {
                /// 1/k, and 0 for a released direction.
                const fn inverted(k: [f64; 3]) -> [$t; 3] {
                    let mut c = [0.0; 3];
                    let mut i = 0;
                    while i < 3 {
                        if k[i] != 0.0 {
                            c[i] = (1.0 / k[i]) as $t;
                        }
                        i += 1;
                    }
                    c
                }
                const fn compliance(limb: &LimbParameters) -> LimbCompliance<$t> {
                    let (rod, screw) = (&limb.body.rod, &limb.body.screw);
                    let ea = rod.young_pa * rod.area_m2() + screw.young_pa * screw.area_m2();
                    let ei = rod.young_pa * rod.second_moment_m4() + screw.young_pa * screw.second_moment_m4();
                    let gj = 2.0 * (rod.shear_pa * rod.second_moment_m4() + screw.shear_pa * screw.second_moment_m4());
                    LimbCompliance {
                        base_linear: inverted(limb.base_joint.linear_n_per_m),
                        base_angular: inverted(limb.base_joint.angular_nm_per_rad),
                        platform_linear: inverted(limb.platform_joint.linear_n_per_m),
                        platform_angular: inverted(limb.platform_joint.angular_nm_per_rad),
                        axial: (1.0 / ea) as $t,
                        bending: (1.0 / ei) as $t,
                        torsion: (1.0 / gj) as $t,
                        coupled: matches!(limb.body.kind, BodyKind::Beam),
                    }
                }
                const fn narrow(v: [f64; 3]) -> [$t; 3] {
                    [v[0] as $t, v[1] as $t, v[2] as $t]
                }
                check!(parameters.check());
                const fn sizes(g: &Geometry) -> Sizes<$t> {
                    Sizes { a1: g.a1_m as $t, a2: g.a2_m as $t, b1: g.b1_m as $t, b2: g.b2_m as $t }
                }
                let l = &parameters.limbs;
                let limbs = [compliance(&l[0]), compliance(&l[1]), compliance(&l[2])];
                Ok(Self {
                    declared: sizes(&parameters.geometry),
                    actual: sizes(&parameters.actual_geometry()),
                    q_min: narrow(parameters.travel.min_m),
                    q_max: narrow(parameters.travel.max_m),
                    limbs,
                    declared_limbs: limbs,
                    effects: ActiveEffects::<$t>::new(&parameters.effects),
                })
            }
        }
    };
}

machine!(f32);
machine!(f64);

/// Why there is no machine at a temperature.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TemperatureError {
    /// NaN or infinite.
    NotFinite,
    /// The `thermal-modulus` effect would leave no stiffness.
    NoStiffness,
}

impl fmt::Display for TemperatureError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "the temperature is not finite",
            Self::NoStiffness => "no stiffness would be left at this temperature",
        })
    }
}

impl core::error::Error for TemperatureError {}

impl<T: Scalar> LimbCompliance<T> {
    /// Compliances of body and joints times a factor each.
    fn softened(mut self, body: T, joints: T) -> Self {
        for c in [&mut self.axial, &mut self.bending, &mut self.torsion] {
            *c *= body;
        }
        let ends =
            [&mut self.base_linear, &mut self.base_angular, &mut self.platform_linear, &mut self.platform_angular];
        for c in ends.into_iter().flatten() {
            *c *= joints;
        }
        self
    }
}

impl<T: Scalar> Machine<T> {
    /// The machine at a temperature in °C, by its `thermal-modulus` effect: of every declared stiffness of a limb body
    /// (of a joint) the share 1 − rate × (T − 20 °C) is left. Stiffnesses that other effects bring stay. Elements whose law
    /// is the temperature get theirs. Without either it is the same machine. The temperature is that of the result,
    /// whatever that of `self` was.
    ///
    /// # Errors
    /// The temperature is not finite, or the share would not be above 0.
    ///
    /// ```
    /// use pkm_core::machine::TemperatureError;
    /// use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS};
    /// use pkm_core::{Machine, MachineParameters};
    /// assert_eq!(MACHINE_F64.at_temperature(35.0), Ok(MACHINE_F64));
    /// let effects = PARAMETERS.effects.with("thermal-modulus", [4e-4, 4e-4, 0.0]).unwrap();
    /// let steel = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).unwrap();
    /// assert_ne!(steel.at_temperature(35.0), Ok(steel));
    /// assert_eq!(steel.at_temperature(20.0), Ok(steel));
    /// assert_eq!(steel.at_temperature(1e4), Err(TemperatureError::NoStiffness));
    /// ```
    pub fn at_temperature(&self, temperature_c: T) -> Result<Self, TemperatureError> {
        if !temperature_c.is_finite() {
            return Err(TemperatureError::NotFinite);
        }
        let mut machine = *self;
        let rates = self.effects.softening();
        if rates == [T::ZERO; 2] && !self.effects.elements.depend_on_temperature() {
            return Ok(machine);
        }
        let warmer_k = temperature_c - T::from_f64(DECLARED_TEMPERATURE_C);
        let [body, joints] = rates.map(|rate| T::ONE - rate * warmer_k);
        if !(body > T::ZERO && joints > T::ZERO && body.is_finite() && joints.is_finite()) {
            return Err(TemperatureError::NoStiffness);
        }
        machine.effects.elements.set_temperature(warmer_k);
        machine.limbs = self.declared_limbs.map(|limb| limb.softened(T::ONE / body, T::ONE / joints));
        Ok(machine)
    }

    /// How far the lengths are from the nearest end of travel, in m; negative outside. With the limb, 0…2.
    pub fn travel_margin_m(&self, lengths: &crate::ScrewLengths<T>) -> (T, usize) {
        let mut least = (lengths.q_m[0] - self.q_min[0], 0);
        for (limb, ((q, lo), hi)) in lengths.q_m.into_iter().zip(self.q_min).zip(self.q_max).enumerate() {
            for margin in [q - lo, hi - q] {
                if margin < least.0 {
                    least = (margin, limb);
                }
            }
        }
        least
    }
}

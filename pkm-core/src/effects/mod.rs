//! Physics beyond the basic model: [`EFFECTS`] lists it, `docs/theory.md` has its formulas.
//!
//! An effect is a file here and a line in the register at the end. Its parameters are amplitudes, mostly
//! compliances: all zero is the basic model. What is elastic inside a limb adds to the limb's compliance, what is in
//! series with the whole adds at an end. A machine file's `[[effect]]` and a `diagnose` of `pkm-host` name them by
//! [`id`](EffectInfo::id). What is on no list is an [`Element`]: a place, a motion and a law.

use crate::linalg::Lower;
use crate::scalar::Scalar;
use crate::stiffness::Chain;
use crate::vector::cross;

mod elements;

use elements::ActiveElements;
pub(crate) use elements::Misfit;
pub use elements::{Element, Law, MAX_ELEMENTS, Motion, Place};

/// Most parameters that an effect has.
pub const MAX_PARAMETERS: usize = 6;

/// What is known of an effect without a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EffectInfo {
    /// As in files.
    pub id: &'static str,
    /// Names with units, as in files.
    pub parameters: &'static [&'static str],
    /// Whether the parameters may be negative.
    pub signed: bool,
}

/// Least sizes of parameters that are refused: far beyond any machine, and near where `f32` fails. By the unit in the
/// name.
const fn limits_by_unit(names: &[&str]) -> [f64; MAX_PARAMETERS] {
    let mut limits = [f64::INFINITY; MAX_PARAMETERS];
    let mut i = 0;
    while i < names.len() {
        let name = names[i].as_bytes();
        limits[i] = if ends_with(name, b"per_nm2") {
            1e3
        } else if ends_with(name, b"per_n") || ends_with(name, b"per_nm") {
            1e-3
        } else {
            1e6
        };
        i += 1;
    }
    limits
}

/// The four sizes of the platforms.
#[derive(Clone, Copy)]
pub(crate) enum Size {
    A1,
    A2,
    B1,
    B2,
}

const fn ends_with(text: &[u8], end: &[u8]) -> bool {
    if text.len() < end.len() {
        return false;
    }
    let (_, tail) = text.split_at(text.len() - end.len());
    same(tail, end)
}

/// A limb as effects see it. Points and axes are in A-uvw, with A as the origin.
pub(crate) struct Limb<'a, T, const N: usize> {
    /// 0, 1, 2.
    pub index: usize,
    /// Length, m.
    pub q: T,
    /// B_i and A_i, m.
    pub base: [T; 3],
    /// See `base`.
    pub platform: [T; 3],
    /// Axes of body and platform joint: x, y, z along the limb.
    pub axes: [[T; 3]; 3],
    /// Axes of the base joint.
    pub base_axes: [[T; 3]; 3],
    /// 1/EA, 1/EI and 1/GJ of the declared body.
    pub axial: T,
    /// See `axial`.
    pub bending: T,
    /// See `axial`.
    pub torsion: T,
    /// Where compliance is added.
    pub chain: &'a mut Chain<T, N>,
}

/// Compliance between ground or tool and the whole mechanism, at a point with axes, both in A-uvw.
pub(crate) struct Series<T> {
    /// m.
    pub at: [T; 3],
    /// Three unit vectors.
    pub axes: [[T; 3]; 3],
    /// Along and about the axes, m/N and rad/(N·m).
    pub compliance: [T; 6],
}

impl<T: Scalar> Series<T> {
    /// At A, along and about u, v, w.
    pub fn at_a(compliance: [T; 6]) -> Self {
        let (o, i) = (T::ZERO, T::ONE);
        Self { at: [o; 3], axes: [[i, o, o], [o, i, o], [o, o, i]], compliance }
    }

    /// K := (K⁻¹ + C)⁻¹, a direction at a time (Sherman and Morrison). Lower triangle. False when a negative compliance
    /// leaves it not positive definite.
    #[must_use]
    pub fn soften(&self, k: &mut Lower<T>) -> bool {
        let o = T::ZERO;
        let mut definite = true;
        for (axis, (linear, angular)) in
            self.axes.iter().zip(self.compliance.iter().zip(self.compliance.iter().skip(3)))
        {
            let [x, y, z] = *axis;
            let [rx, ry, rz] = cross(self.at, *axis);
            // displacement of A when the spring gives by one unit
            for (compliance, motion) in [(*linear, [x, y, z, o, o, o]), (*angular, [rx, ry, rz, x, y, z])] {
                if compliance == o {
                    continue;
                }
                let mut force = [o; 6];
                for i in 0..6 {
                    for j in 0..6 {
                        force[i] += if j <= i { k[i][j] } else { k[j][i] } * motion[j];
                    }
                }
                let mut work = o;
                for i in 0..6 {
                    work += force[i] * motion[i];
                }
                let share = T::ONE / (T::ONE / compliance + work);
                // det K changes by the factor 1 + compliance × work, which must stay positive
                definite &= compliance > o || !(share > o);
                for i in 0..6 {
                    for j in 0..=i {
                        k[i][j] -= share * force[i] * force[j];
                    }
                }
            }
        }
        definite
    }
}

/// How an effect changes the model. Every method has a default that changes nothing.
pub(crate) trait Effect {
    const INFO: EffectInfo;

    /// Least sizes of its parameters that are refused.
    const LIMITS: [f64; MAX_PARAMETERS] = limits_by_unit(Self::INFO.parameters);

    /// The size of a platform that differs from the declared one by the first parameter.
    const SIZE: Option<Size> = None;

    /// Adds compliance inside a limb.
    fn in_limb<T: Scalar, const N: usize>(_parameters: &[T; MAX_PARAMETERS], _limb: &mut Limb<'_, T, N>) {}

    /// Whether [`elongation`](Self::elongation) does anything.
    const DEPENDS_ON_LOAD: bool = false;

    /// How much longer a limb gets under a tension in N than its linear compliance says, in m.
    fn elongation<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _tension: T) -> T {
        T::ZERO
    }

    /// The part of a limb's elongation that depends on where the loading last turned, in m: from the tensions of the
    /// linear model under the load and under the load there. Asked for when [`DEPENDS_ON_LOAD`](Self::DEPENDS_ON_LOAD).
    fn lag<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _tension: T, _turned_at: T) -> T {
        T::ZERO
    }

    /// Tension in a limb (0, 1, 2) before any load, N.
    fn tension<T: Scalar>(_parameters: &[T; MAX_PARAMETERS], _limb: usize) -> T {
        T::ZERO
    }

    /// How far A_1 and A_2, and A_3, lie out of the platform's plane, along w, m.
    fn offset<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Relative loss of stiffness of limb bodies and of joints per kelvin.
    fn softening<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Relative growth of the limbs and of the platforms per kelvin.
    fn growth<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> [T; 2] {
        [T::ZERO; 2]
    }

    /// Compliances c, m/N, by which B_1 and B_2 both move along z of B by c (F_1 + F_2) of the forces there, and by
    /// ± c (F_1 − F_2).
    fn between_bases_1_2<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 2]> {
        None
    }

    /// Compliance, m/N, by which A_1 and A_2 both move along w by c (F_1 + F_2) of the forces there.
    fn between_arms_1_2<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<T> {
        None
    }

    /// Compliance between the ground and the mechanism: at B with the axes of B, both given in A-uvw.
    fn at_base<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }

    /// Compliance between the limbs and A, along and about u, v, w.
    fn at_hub<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }

    /// Whether it lies between A and the tool, and so comes after the correction table.
    const AT_TOOL: bool = false;

    /// Compliance between A and the tool, along and about u, v, w.
    fn at_tool<T: Scalar>(_parameters: &[T; MAX_PARAMETERS]) -> Option<[T; 6]> {
        None
    }
}

/// The effects of one machine, ready to be applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ActiveEffects<T> {
    /// A bit an effect that has a parameter other than 0, and one for elements.
    active: u32,
    parameters: [[T; MAX_PARAMETERS]; COUNT],
    pub(crate) elements: ActiveElements<T>,
}

/// The bit of [`ActiveEffects::active`] for elements.
const ELEMENTS: u32 = 1 << 31;
const _: () = assert!(COUNT < 31, "a bit for each effect");

impl<T: Scalar> ActiveEffects<T> {
    /// True when any effect is on or any element there.
    #[inline]
    pub fn any(&self) -> bool {
        self.active != 0
    }

    fn has_elements(&self) -> bool {
        self.active & ELEMENTS != 0
    }
}

macro_rules! active_effects {
    ($t:ty) => {
        impl ActiveEffects<$t> {
            pub const fn new(effects: &Effects) -> Self {
                let mut new = Self {
                    active: 0,
                    parameters: [[0.0; MAX_PARAMETERS]; COUNT],
                    elements: ActiveElements::<$t>::new(&effects.elements),
                };
                let mut i = 0;
                while i < MAX_ELEMENTS {
                    if effects.elements[i].is_some() {
                        new.active |= ELEMENTS;
                    }
                    i += 1;
                }
                let mut i = 0;
                while i < COUNT * MAX_PARAMETERS {
                    let (effect, parameter) = (i / MAX_PARAMETERS, i % MAX_PARAMETERS);
                    let value = effects.parameters[effect][parameter];
                    new.parameters[effect][parameter] = value as $t;
                    if value != 0.0 {
                        new.active |= 1 << effect;
                    }
                    i += 1;
                }
                new
            }
        }
    };
}

active_effects!(f32);
active_effects!(f64);

/// Physics beyond the basic model of one machine: parameters of every effect, and elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effects {
    /// Amplitudes, SI, by effect in the order of [`EFFECTS`], then in the order of its parameters; at least 0 unless the
    /// effect is [`signed`](EffectInfo::signed). An effect with all parameters 0 is off and costs one comparison for all
    /// together.
    pub parameters: [[f64; MAX_PARAMETERS]; COUNT],
    /// Compliances that are no effect's.
    pub elements: [Option<Element>; MAX_ELEMENTS],
}

impl Effects {
    /// The basic model.
    pub const NONE: Self = Self { parameters: [[0.0; MAX_PARAMETERS]; COUNT], elements: [None; MAX_ELEMENTS] };

    /// The same with an effect, by its id, whatever the order of the effects in this version; parameters that are not
    /// given are 0. `None` for an unknown id, or for more parameters than the effect has.
    ///
    /// ```
    /// use pkm_core::effects::Effects;
    /// use pkm_core::{Machine, MachineParameters, Pose, tables::reference::PARAMETERS};
    /// let effects = Effects::NONE.with("base-compliance", [2e-9, 1e-8]).expect("an effect of that name");
    /// let soft = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS })?;
    /// let stiff = Machine::<f64>::new(&PARAMETERS)?;
    /// let pose = Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 };
    /// let k33 = |machine: &Machine<f64>| machine.stiffness(&pose).map(|k| k.principal()[2]);
    /// assert!(k33(&soft)? < k33(&stiff)?);
    /// assert_eq!(Effects::NONE.with("no-such-effect", [1.0]), None);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub const fn with<const N: usize>(mut self, id: &str, parameters: [f64; N]) -> Option<Self> {
        let mut i = 0;
        while i < COUNT {
            if same(EFFECTS[i].id.as_bytes(), id.as_bytes()) {
                self.parameters[i] = [0.0; MAX_PARAMETERS];
                let mut n = 0;
                while n < N {
                    if n < EFFECTS[i].parameters.len() {
                        self.parameters[i][n] = parameters[n];
                    } else if parameters[n] != 0.0 {
                        return None;
                    }
                    n += 1;
                }
                return Some(self);
            }
            i += 1;
        }
        None
    }

    /// The same without what lies between A and the tool: what correction tables are fitted with, since they
    /// apply before it.
    pub const fn below_tool(mut self) -> Self {
        let mut i = 0;
        while i < COUNT {
            if AT_TOOL[i] {
                self.parameters[i] = [0.0; MAX_PARAMETERS];
            }
            i += 1;
        }
        let mut i = 0;
        while i < MAX_ELEMENTS {
            if let Some(Element { place: Place::Tool, .. }) = self.elements[i] {
                self.elements[i] = None;
            }
            i += 1;
        }
        self
    }

    /// The same with one more element, by its names in files. `None` for names that are unknown or do not fit together,
    /// for more parameters than the law has, or beyond [`MAX_ELEMENTS`].
    ///
    /// ```
    /// use pkm_core::effects::Effects;
    /// use pkm_core::{Machine, MachineParameters, Pose, tables::reference::PARAMETERS};
    /// let soft_screw = Effects::NONE.with_element("limb.2.body", "axial", "extension", [2e-9, 1e-8]).expect("an element");
    /// let machine = Machine::<f64>::new(&MachineParameters { effects: soft_screw, ..PARAMETERS })?;
    /// let pose = Pose { theta_rad: 0.0, sigma_rad: 0.0, z0_m: 0.53 };
    /// // one limb that is softer than its twin couples a push along w with a turn about u
    /// assert!(machine.stiffness(&pose)?.matrix()[3][2] < -1e5);
    /// assert_eq!(Effects::NONE.with_element("base", "axial", "constant", [1e-9]), None);
    /// # Ok::<(), Box<dyn core::error::Error>>(())
    /// ```
    pub const fn with_element<const N: usize>(
        mut self,
        place: &str,
        motion: &str,
        law: &str,
        parameters: [f64; N],
    ) -> Option<Self> {
        let mut i = 0;
        while i < MAX_ELEMENTS {
            if self.elements[i].is_none() {
                self.elements[i] = Element::from_names(place, motion, law, parameters);
                return if self.elements[i].is_some() { Some(self) } else { None };
            }
            i += 1;
        }
        None
    }
}

/// `==` of slices does not work in a `const fn`.
const fn same(a: &[u8], b: &[u8]) -> bool {
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

macro_rules! effects {
    ($($module:ident :: { $($name:ident),+ }),+ $(,)?) => {
        $(mod $module;)+

        /// Position of each effect in [`EFFECTS`].
        enum Index { $($($name,)+)+ Count }

        /// Number of effects.
        pub const COUNT: usize = Index::Count as usize;

        /// Every effect.
        pub const EFFECTS: [EffectInfo; COUNT] = [$($(<$module::$name as Effect>::INFO),+),+];

        const AT_TOOL: [bool; COUNT] = [$($(<$module::$name as Effect>::AT_TOOL),+),+];

        pub(crate) const LIMITS: [[f64; MAX_PARAMETERS]; COUNT] = [$($(<$module::$name as Effect>::LIMITS),+),+];

        pub(crate) const SIZES: [Option<Size>; COUNT] = [$($(<$module::$name as Effect>::SIZE),+),+];

        impl<T: Scalar> ActiveEffects<T> {
            /// Adds what every active effect has inside a limb.
            pub(crate) fn in_limb<const N: usize>(&self, limb: &mut Limb<'_, T, N>) {
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    $module::$name::in_limb(&self.parameters[Index::$name as usize], limb);
                })+)+
                if self.has_elements() {
                    self.elements.in_limb(limb);
                }
            }

            /// Whether anything active depends on the load.
            pub(crate) fn depend_on_load(&self) -> bool {
                const MASK: u32 =
                    0 $($(| if <$module::$name as Effect>::DEPENDS_ON_LOAD { 1 << Index::$name as u32 } else { 0 })+)+;
                self.active & MASK != 0 || self.has_elements() && self.elements.depend_on_load()
            }

            /// Elongation of a limb (0, 1, 2) under tension beyond the linear one.
            pub(crate) fn elongation(&self, limb: usize, tension: T) -> T {
                let mut sum = T::ZERO;
                $($(if <$module::$name as Effect>::DEPENDS_ON_LOAD && self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::elongation(&self.parameters[Index::$name as usize], tension);
                })+)+
                if self.has_elements() { sum + self.elements.elongation(limb, tension) } else { sum }
            }

            /// What lags behind the load in a limb's elongation.
            pub(crate) fn lag(&self, limb: usize, tension: T, turned_at: T) -> T {
                let mut sum = T::ZERO;
                $($(if <$module::$name as Effect>::DEPENDS_ON_LOAD && self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::lag(&self.parameters[Index::$name as usize], tension, turned_at);
                })+)+
                if self.has_elements() { sum + self.elements.lag(limb, tension, turned_at) } else { sum }
            }

            /// Tension in a limb before any load.
            pub(crate) fn tension(&self, limb: usize) -> T {
                let mut sum = T::ZERO;
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    sum += $module::$name::tension(&self.parameters[Index::$name as usize], limb);
                })+)+
                sum
            }

            /// How far A_1 and A_2, and A_3, are out of their plane.
            pub(crate) fn offset(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::offset(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Loss of stiffness per kelvin: limb bodies, joints.
            pub(crate) fn softening(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::softening(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Growth per kelvin: limbs, platforms.
            pub(crate) fn growth(&self) -> [T; 2] {
                let mut sum = [T::ZERO; 2];
                $($(if self.active & (1 << Index::$name as u32) != 0 {
                    let [a, b] = $module::$name::growth(&self.parameters[Index::$name as usize]);
                    sum = [sum[0] + a, sum[1] + b];
                })+)+
                sum
            }

            /// Calls `add` with the coupling of B_1 and B_2 of every active effect that has one.
            pub(crate) fn between_bases_1_2(&self, mut add: impl FnMut([T; 2])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::between_bases_1_2(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
            }

            /// Calls `add` with the compliance shared by arms 1 and 2 of every active effect that has one.
            pub(crate) fn between_arms_1_2(&self, mut add: impl FnMut(T)) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::between_arms_1_2(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
            }

            /// Calls `add` with the compliance at B of every active effect that has one, and of the elements there.
            pub(crate) fn at_base(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_base(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::Base, add);
                }
            }

            /// Calls `add` with the compliance between limbs and A of every active effect that has one, and of the elements there.
            pub(crate) fn at_hub(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_hub(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::MovingPlatform, add);
                }
            }

            /// Calls `add` with the compliance at A of every active effect that has one, and of the elements there.
            pub(crate) fn at_tool(&self, mut add: impl FnMut([T; 6])) {
                $($(if self.active & (1 << Index::$name as u32) != 0
                    && let Some(c) = $module::$name::at_tool(&self.parameters[Index::$name as usize]) {
                    add(c);
                })+)+
                if self.has_elements() {
                    self.elements.at(Place::Tool, add);
                }
            }
        }
    };
}

// The register: module and types. Their order is that of [`EFFECTS`] and of the parameters in [`Effects`].
effects! {
    moving_platform::{MovingPlatformCompliance},
    base::{BaseCompliance},
    telescopic::{TelescopicLimb},
    drive::{ScrewPosition, Limb1Axial, Limb2Axial, Limb3Axial},
    joints::{UniversalJoint, RevoluteJoint, SphericalJoint, Revolute3Joint},
    wrist::{WristCompliance},
    coupling::{LimbCoupling},
    load_dependent::{Clearance, ContactStiffening, FrictionHysteresis},
    preload::{Preload},
    geometry::{PlatformOffset, GeometryA1, GeometryA2, GeometryB1, GeometryB2},
    thermal::{ThermalModulus, ThermalExpansion},
}

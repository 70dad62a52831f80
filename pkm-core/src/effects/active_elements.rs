//! The elements of one machine in its number type.

use nalgebra::{Matrix3, Vector3, Vector6};

use super::elements::{Element, Law, MAX_ELEMENT_PARAMETERS, MAX_ELEMENTS, Motion, Place, WEIGHT_STEPS};
use super::load_dependent;
use crate::checksum::{over_byte, over_numbers, over_numbers_f32, over_text};
use crate::conversion::converted;
use crate::elastic::{Chain, Limb, LimbFrame};
use crate::linalg::{axes, join};
use crate::scalar::Scalar;

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
    numbers: Numbers<T>,
}

/// Parameters, as small as they are kept: a machine is copied where stack is dear.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Numbers<T> {
    Law([T; LAW_NUMBERS]),
    /// Compliance, and weights in units of 1/[`WEIGHT_STEPS`].
    Coupled(T, [i16; MAX_WEIGHTS]),
}

const MAX_WEIGHTS: usize = MAX_ELEMENT_PARAMETERS - 1;
/// Most parameters of a law.
const MAX_LAW_PARAMETERS: usize = 7;
/// One more than a law has: so a machine is as many numbers long in `f32` as in `f64`, as the C library's structures are.
const LAW_NUMBERS: usize = MAX_LAW_PARAMETERS + 1;

impl ActiveElements<f64> {
    /// In another number type.
    pub fn converted<U: Scalar>(&self) -> ActiveElements<U> {
        let element = |element: &Active<f64>| Active {
            place: element.place,
            motion: element.motion,
            law: element.law,
            numbers: match &element.numbers {
                Numbers::Law(parameters) => Numbers::Law(converted(parameters)),
                Numbers::Coupled(compliance, weights) => Numbers::Coupled(U::from_f64(*compliance), *weights),
            },
        };
        let list = self.list.each_ref().map(|listed| listed.as_ref().map(element));
        ActiveElements { list, warmer_k: U::from_f64(self.warmer_k) }
    }
}

macro_rules! active_elements {
    ($t:ty, $over:path) => {
        impl ActiveElements<$t> {
            /// No element.
            pub const NONE: Self = Self { list: [None; MAX_ELEMENTS], warmer_k: 0.0 };

            /// Puts an element at a place in the list.
            pub const fn set(&mut self, at: usize, element: &Element) {
                let mut parameters = [0.0; LAW_NUMBERS];
                let mut weights = [0; MAX_WEIGHTS];
                let mut n = 0;
                while n < MAX_LAW_PARAMETERS {
                    parameters[n] = element.parameters[n] as $t;
                    n += 1;
                }
                let mut n = 0;
                while n < MAX_WEIGHTS {
                    let steps = element.parameters[n + 1] * WEIGHT_STEPS;
                    weights[n] = (steps + if steps < 0.0 { -0.5 } else { 0.5 }) as i16;
                    n += 1;
                }
                let coupled = matches!(element.motion, Motion::Coupled);
                let numbers = if coupled { Numbers::Coupled(parameters[0], weights) } else { Numbers::Law(parameters) };
                let own = Active { place: element.place, motion: element.motion, law: element.law, numbers };
                self.list[at] = Some(own);
            }

            /// Takes its numbers as they are in memory into a checksum.
            pub const fn checksum(&self, hash: u64) -> u64 {
                let mut hash = $over(hash, &[self.warmer_k]);
                let mut i = 0;
                while i < MAX_ELEMENTS {
                    if let Some(Active { place, motion, law, numbers }) = &self.list[i] {
                        let place = match place.name() {
                            Some(name) => name,
                            None => "",
                        };
                        hash = over_text(over_byte(hash, i as u8), place);
                        hash = over_byte(over_byte(hash, *motion as u8), *law as u8);
                        hash = match numbers {
                            Numbers::Law(parameters) => $over(hash, parameters),
                            Numbers::Coupled(compliance, weights) => {
                                let mut hash = $over(hash, &[*compliance]);
                                let mut n = 0;
                                while n < MAX_WEIGHTS {
                                    hash = $over(hash, &[weights[n] as $t]);
                                    n += 1;
                                }
                                hash
                            }
                        };
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
        let [c, first, second, third, local, at, half] = self.parameters();
        match self.law {
            Law::Constant => c,
            Law::Extension => {
                let x = q - third;
                let bent = c + x * (first + x * second);
                let off = (q - at).abs();
                if off < half {
                    let share = off / half;
                    let left = T::ONE - share * share;
                    bent + local * left * left
                } else {
                    bent
                }
            }
            Law::Periodic => c + first * sine_of_turns(q / second + third * T::from_f64(0.5 / core::f64::consts::PI)),
            Law::Temperature => c * warmer_k,
            Law::Load | Law::Direction => T::ZERO,
        }
    }

    fn is_coupled(&self) -> bool {
        self.motion == Motion::Coupled
    }

    /// Weight of a component of what passes there, of a coupled one.
    fn weight(&self, component: usize) -> T {
        let Numbers::Coupled(_, weights) = &self.numbers else { return T::ZERO };
        let steps = weights.get(component).copied().unwrap_or(0);
        T::from_f64(f64::from(steps) * (1.0 / WEIGHT_STEPS))
    }

    /// Those of its law.
    fn parameters(&self) -> [T; MAX_LAW_PARAMETERS] {
        let o = T::ZERO;
        match self.numbers {
            Numbers::Law([a, b, c, d, e, f, g, _]) => [a, b, c, d, e, f, g],
            Numbers::Coupled(c, _) => [c, o, o, o, o, o, o],
        }
    }

    /// Three components from one on.
    fn weights(&self, first: usize) -> Vector3<T> {
        Vector3::new(self.weight(first), self.weight(first + 1), self.weight(first + 2))
    }

    /// Whether it sees what passes at the limb's joint at the base, or else at the platform, and the weights of the forces and
    /// moments; none of a body, and of limbs that it does not see.
    fn seen_of(&self, limb: usize) -> Option<(bool, Vector3<T>, Vector3<T>)> {
        let own = self.is_in_limb(limb);
        match self.place {
            Place::BaseJoint { .. } if own => Some((true, self.weights(0), self.weights(3))),
            Place::PlatformJoint { .. } if own => Some((false, self.weights(0), self.weights(3))),
            Place::MovingPlatform => {
                let moments = if limb < 2 { self.weights(9 + 3 * limb) } else { Vector3::zeros() };
                Some((false, self.weights(3 * limb), moments))
            }
            Place::Base => {
                let moments = Vector3::new(self.weight(9 + 2 * limb), T::ZERO, self.weight(10 + 2 * limb));
                Some((true, self.weights(3 * limb), moments))
            }
            Place::BaseJoint { .. } | Place::PlatformJoint { .. } | Place::Body { .. } | Place::Tool => None,
        }
    }

    /// What A moves by when it gives by a unit and the other limbs are held: s is the work of the limb's wrenches on that motion.
    fn motion_of(&self, limb: usize, frame: &impl Fn(usize) -> LimbFrame<T>, base: &Matrix3<T>) -> Option<[T; 6]> {
        let (at_base, linear, angular) = self.seen_of(limb)?;
        let LimbFrame { joints_m: [b, a], axes: [base_joint, platform_joint], .. } = frame(limb);
        let turned = |v: Vector3<T>| match self.place {
            Place::MovingPlatform => v,
            Place::Base => base * v,
            _ => (if at_base { base_joint } else { platform_joint }) * v,
        };
        let (at, shift, turn) = (if at_base { b } else { a }, turned(linear), turned(angular));
        Some(join(shift + at.cross(&turn), turn).into())
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
        let is_of_limb = |e: &&Active<T>| e.is_in_limb(limb.index) && !e.is_coupled() && !e.motion.is_tie();
        for element in self.iter().filter(is_of_limb) {
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

    /// Adds the coupled ones but for the tool's. `frame` and `length` are those of a limb.
    pub fn coupled(
        &self,
        frame: impl Fn(usize) -> LimbFrame<T>,
        length: impl Fn(usize) -> T,
        base: &Matrix3<T>,
        limbs: &mut Chain<T, 8>,
    ) {
        /// First of each limb's wrenches, and how many there are.
        const OWN: [(usize, usize); 3] = [(0, 3), (3, 3), (6, 2)];
        for element in self.iter().filter(|element| element.is_coupled() && element.place != Place::Tool) {
            let mut seen = [T::ZERO; 8];
            let mut q = T::ZERO;
            for (limb, (first, count)) in OWN.into_iter().enumerate() {
                let own = limbs.wrenches.iter().zip(&mut seen).skip(first).take(count);
                if let Some(motion) = element.motion_of(limb, &frame, base) {
                    own.for_each(|(wrench, seen)| {
                        *seen = motion.iter().zip(wrench).fold(T::ZERO, |sum, (m, w)| sum + *m * *w);
                    });
                } else if element.is_in_limb(limb) {
                    own.enumerate().for_each(|(n, (_, seen))| *seen = element.weight(n));
                }
                if element.is_in_limb(limb) {
                    q = length(limb);
                }
            }
            limbs.add_seen(&seen, element.compliance(q, self.warmer_k));
        }
    }

    /// Whether any of the limbs, the platform or the base is coupled.
    pub fn are_coupled(&self) -> bool {
        self.iter().any(|element| element.is_coupled() && element.place != Place::Tool)
    }

    /// Whether any is a tie.
    pub fn are_ties(&self) -> bool {
        self.iter().any(|element| element.motion.is_tie())
    }

    /// Calls `add` with what each tie does at A per unit of its force, and its stiffness. `frame` is that of a limb.
    pub fn ties(&self, frame: impl Fn(usize) -> LimbFrame<T>, mut add: impl FnMut(Vector6<T>, T)) {
        for element in self.iter() {
            let [stiffness, u, v, w, ru, rv, rw] = element.parameters();
            let pull = Vector3::new(u, v, w);
            if let (Some(to), Some(from)) = (element.motion.tied_to(), element.place.limb()) {
                let limbs = [frame(usize::from(from) - 1), frame(to)];
                add(LimbFrame::tied(limbs.each_ref(), &pull), stiffness);
            } else if element.motion == Motion::TiedToBase {
                add(join(pull, Vector3::new(ru, rv, rw)), stiffness);
            }
        }
    }

    /// Calls `add` with what A moves by, and the compliance, of each coupled element at the tool.
    pub fn coupled_at_tool(&self, mut add: impl FnMut([T; 6], T)) {
        for element in self.iter().filter(|element| element.is_coupled() && element.place == Place::Tool) {
            let motion = join(element.weights(0), element.weights(3));
            add(motion.into(), element.compliance(T::ZERO, self.warmer_k));
        }
    }

    /// Calls `add` with the compliances at a place outside the limbs, along and about its axes, if there are any.
    pub fn at(&self, place: Place, add: impl FnOnce([T; 6])) {
        let mut sum = [T::ZERO; 6];
        let mut any = false;
        for element in self.iter().filter(|element| element.place == place && !element.is_coupled()) {
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
            let [asymmetric, even, odd, cubic, play, taken_up, straight_above] = element.parameters();
            let size = tension.abs();
            let grown = if straight_above > T::ZERO {
                let x = tension / if straight_above > T::ONE { straight_above } else { T::ONE };
                (T::ONE + x * x).sqrt()
            } else {
                T::ONE
            };
            sum += asymmetric * size;
            sum += tension / grown * (even * tension + odd * size + cubic * tension * tension / grown);
            sum += load_dependent::taken_up(play, taken_up, tension);
        }
        sum
    }

    /// What lags behind the load in a limb's elongation.
    pub fn lag(&self, limb: usize, tension: T, turns: &[T]) -> T {
        let mut sum = T::ZERO;
        for element in self.iter().filter(|element| element.law == Law::Direction && element.is_in_limb(limb)) {
            let [fixed, growing, reversal, ..] = element.parameters();
            sum += load_dependent::lagging([fixed, growing, reversal], tension, turns);
        }
        sum
    }
}

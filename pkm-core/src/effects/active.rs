//! The effects of one machine in its number type.

use super::active_elements::ActiveElements;
use super::{COUNT, Effects, MAX_ELEMENTS, MAX_PARAMETERS};
use crate::checksum::{over_numbers, over_numbers_f32};
use crate::conversion::converted;
use crate::scalar::Scalar;

/// The effects of one machine, ready to be applied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ActiveEffects<T> {
    /// A bit an effect that has a parameter other than 0, and one for elements.
    pub(super) active: u32,
    pub(super) parameters: [[T; MAX_PARAMETERS]; COUNT],
    pub(crate) elements: ActiveElements<T>,
}

/// The bit of [`ActiveEffects::active`] for elements.
const ELEMENTS: u32 = 1 << 31;
const _: () = assert!(COUNT <= 31, "a bit for each effect");

impl<T: Scalar> ActiveEffects<T> {
    /// True when any effect is on or any element there.
    #[inline]
    pub fn any(&self) -> bool {
        self.active != 0
    }

    pub(super) fn has_elements(&self) -> bool {
        self.active & ELEMENTS != 0
    }
}

impl ActiveEffects<f64> {
    /// In another number type.
    pub fn converted<U: Scalar>(&self) -> ActiveEffects<U> {
        let parameters = self.parameters.each_ref().map(converted);
        ActiveEffects { active: self.active, parameters, elements: self.elements.converted() }
    }
}

macro_rules! active_effects {
    ($t:ty, $over:path) => {
        impl ActiveEffects<$t> {
            /// The basic model.
            pub const NONE: Self =
                Self { active: 0, parameters: [[0.0; MAX_PARAMETERS]; COUNT], elements: ActiveElements::<$t>::NONE };

            /// Turns the basic model into one with effects and elements.
            pub const fn set(&mut self, effects: &Effects) {
                let mut i = 0;
                while i < MAX_ELEMENTS {
                    if let Some(element) = &effects.elements[i] {
                        self.elements.set(i, element);
                        self.active |= ELEMENTS;
                    }
                    i += 1;
                }
                let mut i = 0;
                while i < COUNT * MAX_PARAMETERS {
                    let (effect, parameter) = (i / MAX_PARAMETERS, i % MAX_PARAMETERS);
                    let value = effects.parameters[effect][parameter];
                    self.parameters[effect][parameter] = value as $t;
                    if value != 0.0 {
                        self.active |= 1 << effect;
                    }
                    i += 1;
                }
            }

            /// Takes its numbers as they are in memory into a checksum.
            pub const fn checksum(&self, hash: u64) -> u64 {
                let Self { active, parameters, elements } = self;
                let mut hash = over_numbers(hash, &[*active as f64]);
                let mut i = 0;
                while i < COUNT {
                    hash = $over(hash, &parameters[i]);
                    i += 1;
                }
                elements.checksum(hash)
            }
        }
    };
}

active_effects!(f32, over_numbers_f32);
active_effects!(f64, over_numbers);

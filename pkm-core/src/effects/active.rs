//! The effects of one machine in its number type.

use super::elements::ActiveElements;
use super::{COUNT, Effects, MAX_ELEMENTS, MAX_PARAMETERS};
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
const _: () = assert!(COUNT < 31, "a bit for each effect");

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

//! Parameters of effects and elements as plain data.

use super::{AT_TOOL, COUNT, EFFECTS, Element, MAX_ELEMENTS, MAX_PARAMETERS, Place, same};

/// Physics beyond the basic model of one machine: parameters of every effect, and elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effects {
    /// Amplitudes, SI, by effect in the order of [`EFFECTS`], then in the order of its parameters; at least 0 unless the
    /// effect is [`signed`](super::EffectInfo::signed). An effect with all parameters 0 is off and costs one comparison for all
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
    /// assert!(machine.stiffness(&pose)?.matrix()[(3, 2)] < -1e5);
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

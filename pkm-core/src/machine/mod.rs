//! What the model knows of one machine: geometry, travel, and the stiffness of joints and bodies.
//!
//! [`MachineParameters`] is plain data that a generated table can hold as a `const`.
//! [`Machine::new`] checks it and turns it into what the formulas need; both work at compile time.

mod check;
mod error;
mod parameters;

pub use error::{End, MachineError, Member, Parameter, Problem};
pub use parameters::{Body, BodyKind, Geometry, Joint, LimbParameters, MachineParameters, Travel, Tube};

use crate::checksum::{START, over_byte, over_numbers, over_numbers_f32};
use crate::effects::ActiveEffects;

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
    /// By what the compliances of bodies and joints are multiplied: 1 at the declared temperature. Applied where they are
    /// used, so that updates do not add up their rounding.
    pub(crate) softness: [T; 2],
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

macro_rules! machine {
    ($t:ty, $over:path) => {
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
                if let Err(error) = parameters.check() {
                    return Err(error);
                }
                // set where it stays: copies of effects would take stack
                let mut made = Ok(Self::BASIC);
                if let Ok(machine) = &mut made {
                    machine.set(parameters);
                }
                made
            }

            /// Without sizes and stiffnesses.
            const BASIC: Self = {
                let sizes = Sizes { a1: 0.0, a2: 0.0, b1: 0.0, b2: 0.0 };
                let limb = LimbCompliance {
                    base_linear: [0.0; 3],
                    base_angular: [0.0; 3],
                    platform_linear: [0.0; 3],
                    platform_angular: [0.0; 3],
                    axial: 0.0,
                    bending: 0.0,
                    torsion: 0.0,
                    coupled: false,
                };
                Self {
                    declared: sizes,
                    actual: sizes,
                    q_min: [0.0; 3],
                    q_max: [0.0; 3],
                    limbs: [limb; 3],
                    softness: [1.0; 2],
                    effects: ActiveEffects::<$t>::NONE,
                }
            };

            const fn set(&mut self, parameters: &MachineParameters) {
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
                const fn sizes(g: &Geometry) -> Sizes<$t> {
                    Sizes { a1: g.a1_m as $t, a2: g.a2_m as $t, b1: g.b1_m as $t, b2: g.b2_m as $t }
                }
                let l = &parameters.limbs;
                self.declared = sizes(&parameters.geometry);
                self.actual = sizes(&parameters.actual_geometry());
                self.q_min = narrow(parameters.travel.min_m);
                self.q_max = narrow(parameters.travel.max_m);
                self.limbs = [compliance(&l[0]), compliance(&l[1]), compliance(&l[2])];
                self.effects.set(&parameters.effects);
            }

            /// Checksum of its numbers as they are in memory. [`MachineParameters::checksum`] is another one, of what it was
            /// made from.
            pub const fn checksum(&self) -> u64 {
                const fn over_sizes(hash: u64, s: &Sizes<$t>) -> u64 {
                    let Sizes { a1, a2, b1, b2 } = s;
                    $over(hash, &[*a1, *a2, *b1, *b2])
                }
                const fn over_limb(hash: u64, limb: &LimbCompliance<$t>) -> u64 {
                    let LimbCompliance {
                        base_linear,
                        base_angular,
                        platform_linear,
                        platform_angular,
                        axial,
                        bending,
                        torsion,
                        coupled,
                    } = limb;
                    let hash = $over($over(hash, base_linear), base_angular);
                    let hash = $over($over(hash, platform_linear), platform_angular);
                    over_byte($over(hash, &[*axial, *bending, *torsion]), *coupled as u8)
                }
                let Self { declared, actual, q_min, q_max, limbs: [one, two, three], softness, effects } = self;
                let hash = over_sizes(over_sizes(START, declared), actual);
                let hash = $over($over(hash, q_min), q_max);
                let hash = over_limb(over_limb(over_limb(hash, one), two), three);
                effects.checksum($over(hash, softness))
            }
        }
    };
}

machine!(f32, over_numbers_f32);
machine!(f64, over_numbers);

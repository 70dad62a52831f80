//! What may change in a machine while it runs, and how a change of it moves the tool.

use nalgebra::{Vector3, Vector6};

use crate::effects::{Motion, Place};
use crate::elastic::motions;
use crate::kinematics::Posture;
use crate::linalg::axes;
use crate::machine::Machine;
use crate::scalar::Scalar;
use crate::stiffness::StiffnessError;
use crate::types::{Deflection, Pose, Wrench};

/// Something that an [`Estimator`](super::Estimator) learns the size of.
///
/// Compliances that all of the load passes by way of: of a limb's drive, nut, bearings and screw along its axis, and of what
/// is in series with the whole mechanism, under the base or behind A. Statics alone says what load meets them, so that the
/// deflection is linear in their sizes, exactly, and an error of the declared stiffnesses does not matter. What yields across
/// a limb shares its load with other parts; it is a matter for `pkm-host diagnose`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Amplitude(Kind);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
enum Kind {
    Compliance { place: Place, motion: Motion },
    Rise,
    Gain,
}

impl Amplitude {
    /// How much warmer the machine is than at its zero reading, K, beyond what its temperature sensors say; it moves the tool as the
    /// effect `thermal-expansion` says.
    pub const RISE: Self = Self(Kind::Rise);

    /// By how much more than its tip moves the machine's sensor reads, as a share: no matter of the machine, and never compensated. List
    /// it where a sensor may be replaced, or drift: else what its gain has changed by passes for a change of the machine. One of all
    /// readings; what softens all of the machine alike looks the same, and is taken for it.
    pub const GAIN: Self = Self(Kind::Gain);

    /// A compliance beyond the machine's own, m/N or rad/(N·m): axial in a limb (its base joint, body and platform joint are
    /// the same here), or along or about an axis of the base or at the tool. `None` for any other.
    ///
    /// ```
    /// use pkm_core::effects::{Motion, Place};
    /// use pkm_core::estimation::Amplitude;
    /// assert!(Amplitude::compliance(Place::Body { limb: 2 }, Motion::Axial).is_some());
    /// assert!(Amplitude::compliance(Place::Base, Motion::Rx).is_some());
    /// assert_eq!(Amplitude::compliance(Place::Body { limb: 2 }, Motion::Lateral), None);
    /// assert_eq!(Amplitude::compliance(Place::Base, Motion::U), None);
    /// ```
    pub const fn compliance(place: Place, motion: Motion) -> Option<Self> {
        use Motion::{Axial, Ru, Rv, Rw, Rx, Ry, Rz, U, V, W, X, Y, Z};
        let fits = match place {
            Place::BaseJoint { .. } | Place::Body { .. } | Place::PlatformJoint { .. } => {
                place.name().is_some() && matches!(motion, Axial)
            }
            Place::Base => matches!(motion, X | Y | Z | Rx | Ry | Rz),
            Place::Tool => matches!(motion, U | V | W | Ru | Rv | Rw),
            Place::MovingPlatform => false,
        };
        if fits { Some(Self(Kind::Compliance { place, motion })) } else { None }
    }

    /// Where it is, and in which direction it yields; `None` of a temperature and of a gain.
    pub const fn place(self) -> Option<(Place, Motion)> {
        match self.0 {
            Kind::Compliance { place, motion } => Some((place, motion)),
            Kind::Rise | Kind::Gain => None,
        }
    }

    /// What a unit of it adds to a reading: what it moves there, and of the gain what machine and table predict. Displacements of A, or what
    /// a reading says of them.
    pub fn shown<D>(self, moved: D, predicted: D) -> D {
        if self == Self::GAIN { predicted } else { moved }
    }

    /// Whether no reading can tell it from another.
    pub(super) fn is_same(self, other: Self) -> bool {
        // of a limb only what yields along its axis is an amplitude
        let limb = |own: Self| own.place().and_then(|(place, _)| place.limb());
        self == other || limb(self).is_some_and(|own| limb(other) == Some(own))
    }

    /// What it is in bytes that are saved: place and motion.
    pub(super) fn code(self) -> [u8; 2] {
        match self.0 {
            Kind::Rise => [u8::MAX; 2],
            Kind::Gain => [u8::MAX, 0],
            Kind::Compliance { place, motion } => {
                let place = Place::ALL.iter().position(|other| *other == place).unwrap_or(0);
                [place as u8, motion as u8]
            }
        }
    }
}

impl<T: Scalar> Machine<T> {
    /// Displacement of A per unit of each amplitude under a wrench at A, both in A-uvw: m and rad per m/N, per rad/(N·m) or per K;
    /// of a gain none, which moves nothing.
    ///
    /// It is what the same compliance as an element does to the deflection of K_p: to 1e-9 of it in f64, for machines without
    /// preload and of which the limbs' ends are in their planes. In f32 within 1e-4 of f64.
    ///
    /// # Errors
    /// Those of [`inverse`](Self::inverse); a wrench that is not finite.
    pub fn sensitivities<const N: usize>(
        &self,
        pose: &Pose<T>,
        wrench: &Wrench<T>,
        amplitudes: &[Amplitude; N],
    ) -> Result<[Deflection<T>; N], StiffnessError> {
        let mut all = [Deflection::ZERO; N];
        self.put_sensitivities(&self.posture(pose)?, wrench, amplitudes.iter().copied(), &mut all)?;
        Ok(all)
    }

    #[inline(never)] // takes no stack while the stiffness is worked out
    pub(crate) fn put_sensitivities(
        &self,
        posture: &Posture<T>,
        wrench: &Wrench<T>,
        amplitudes: impl Iterator<Item = Amplitude>,
        all: &mut [Deflection<T>],
    ) -> Result<(), StiffnessError> {
        // a machine as declared stands where it is commanded; a copy of its posture would take time in every period
        let elsewhere = if self.actual == self.declared { None } else { Some(self.actual(posture)?) };
        let p = elsewhere.as_ref().map_or(posture, |actual| &actual.posture);
        let load = wrench.to_vector();
        let load = elsewhere.as_ref().map_or(load, |actual| actual.seen(load));
        let base = (p.n() * -p.l, axes(&p.base()));
        let tool = (Vector3::zeros(), [Vector3::x(), Vector3::y(), Vector3::z()]);
        let [q1, q2, q3] = p.q.into();
        let o = T::ZERO;
        for (amplitude, moved) in amplitudes.zip(all) {
            *moved = match amplitude.0 {
                Kind::Gain => Deflection::ZERO,
                Kind::Rise => self.thermal_deflection_at(posture, &T::ONE.into())?,
                Kind::Compliance { place, motion } => {
                    let yields = match place.limb() {
                        Some(1) => self.actual.moved(p, [q1, o, o]),
                        Some(2) => self.actual.moved(p, [o, q2, o]),
                        Some(_) => self.actual.moved(p, [o, o, q3]),
                        None => at_end(if place == Place::Base { &base } else { &tool }, motion),
                    };
                    let given = yields * yields.dot(&load);
                    Deflection::from_vector(elsewhere.as_ref().map_or(given, |actual| actual.given_back(given)))
                }
            };
        }
        Ok(())
    }
}

/// What A moves by when an end of the mechanism, with its axes in A-uvw, gives by one unit.
fn at_end<T: Scalar>((at, [x, y, z]): &(Vector3<T>, [Vector3<T>; 3]), motion: Motion) -> Vector6<T> {
    let axis = match motion {
        Motion::X | Motion::U | Motion::Rx | Motion::Ru => x,
        Motion::Y | Motion::V | Motion::Ry | Motion::Rv => y,
        _ => z,
    };
    let [along, turning] = motions(at, axis);
    if motion.is_rotation() { turning.into() } else { along.into() }
}

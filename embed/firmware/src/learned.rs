//! What the images' estimators learn: the drives of the three limbs, and the base along its axes.

use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{Amplitude, AmplitudeSettings, EstimatorSettings};

const fn of(place: Place, motion: Motion) -> AmplitudeSettings {
    let Some(amplitude) = Amplitude::compliance(place, motion) else { panic!("no amplitude") };
    AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation: 1e-9,
        drift_per_day: 1e-11,
        least: -4e-9,
        most: 4e-8,
        rate_per_s: 1e-11,
        alarm: 2e-10,
    }
}

pub const SETTINGS: EstimatorSettings<6> = EstimatorSettings {
    amplitudes: [
        of(Place::Body { limb: 1 }, Motion::Axial),
        of(Place::Body { limb: 2 }, Motion::Axial),
        of(Place::Body { limb: 3 }, Motion::Axial),
        of(Place::Base, Motion::X),
        of(Place::Base, Motion::Y),
        of(Place::Base, Motion::Z),
    ],
    model_share: 0.02,
};

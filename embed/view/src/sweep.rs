//! A checksum over the answers at many poses: equal on two machines if they compute the same bits.

use pkm_core::Configuration;
use pkm_core::checksum::{over_byte, over_numbers};
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::{Pose, Wrench};

use crate::{Form, Request, View};

/// What a checksum begins with.
pub const START: u64 = pkm_core::checksum::START;

/// Powers of 1/1.1347241384015194, the root of x⁶ = x + 1: multiples of them fill a box of five dimensions evenly.
const STEPS: [f64; 5] = [
    0.881_271_461_633_569_6,
    0.776_639_389_089_768_8,
    0.684_430_129_585_342_7,
    0.603_168_740_685_728_2,
    0.531_555_397_715_791_4,
];

/// Of the wrist's range, about its middle, that is used.
const WRIST_SHARE: f64 = 0.5;

impl View {
    /// The request of a number in the sequence: a pose in the machine's box, an angle of each wrist joint, a load.
    pub fn sample(&self, number: u32) -> Request {
        let [u0, u1, u2, u3, u4] = STEPS.map(|step| {
            let value = 0.5 + f64::from(number) * step;
            value - (value as u64) as f64
        });
        let [theta, sigma, z0] = self.ranges.pose;
        let at = |[low, high]: [f64; 2], share: f64| low + (high - low) * share;
        let [first, second] = self.ranges.wrist;
        let wrist = |[low, high]: [f64; 2], share: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
            middle + WRIST_SHARE * half * (2.0 * share - 1.0)
        };
        let pose = Pose { theta_rad: at(theta, u0), sigma_rad: at(sigma, u1), z0_m: at(z0, u2) };
        let force_n = Vector3::new(200.0 * u1 - 100.0, 200.0 * u2 - 100.0, -400.0 * u3);
        Request {
            configuration: Configuration { pose, beta_rad: Vector2::new(wrist(first, u3), wrist(second, u4)) },
            wrench: Wrench { force_n, moment_nm: Vector3::new(0.0, 0.0, 5.0 * u4) },
            temperature_c: 20.0,
            form: Form::Basic,
        }
    }

    /// Takes the answers of the numbers `from` to `to` (not included) into a checksum (FNV-1a, 64 bit, over the bits of all their
    /// numbers); a pose that is refused counts as one byte.
    pub fn sweep(&mut self, mut hash: u64, from: u32, to: u32) -> u64 {
        for number in from..to {
            let request = self.sample(number);
            hash = if self.solve(&request) { over_numbers(hash, self.answer()) } else { over_byte(hash, 1) };
        }
        hash
    }
}

//! What is sent: drawn commands, and lines that no firmware may accept.

use fastrand::Rng;
use pkm_core::{Pose, Wrench};
use pkm_protocol::{ABORT, Arithmetic, Code, Command, Demand, Lines, MAX_COMMAND, Request, Sweep, opened, sealed};

use super::Campaign;
use super::link::written;
use crate::pose::{PoseBox, core_units};

/// One line in so many is bad.
const LINES_PER_FAULT: u8 = 50;

/// A line to the firmware, and what it must answer.
pub(super) struct Sent {
    pub(super) line: Vec<u8>,
    pub(super) expected: Expected,
}

/// What a line must be answered with.
pub(super) enum Expected {
    Cycle { id: u32, demand: Demand },
    Sweep { id: u32, sweep: Sweep },
    Error { id: Option<u32>, code: Code },
}

impl Expected {
    /// Poses that are computed for it.
    pub(super) fn poses(&self) -> u64 {
        match self {
            Self::Cycle { .. } => 1,
            Self::Sweep { sweep, .. } => sweep.steps.into(),
            Self::Error { .. } => 0,
        }
    }
}

/// The lines of one arithmetic after another.
pub(super) struct Drawn<'a> {
    rng: Rng,
    campaign: &'a Campaign,
    id: u32,
}

impl<'a> Drawn<'a> {
    pub(super) fn new(campaign: &'a Campaign) -> Self {
        Self { rng: Rng::with_seed(campaign.seed), campaign, id: 0 }
    }

    /// The next line; poses that are `left` go down by those that it asks for.
    pub(super) fn next(&mut self, arithmetic: Arithmetic, left: &mut u64) -> Sent {
        self.id = self.id.wrapping_add(1);
        let id = self.id;
        let mut demand = || demand(&mut self.rng, &self.campaign.pose_box, arithmetic);
        let from = demand();
        let steps = (*left).min(self.campaign.steps.into()) as u32;
        let (expected, command) = if steps > 1 {
            let sweep = Sweep { from, to: demand().pose, steps };
            (Expected::Sweep { id, sweep }, Command::Sweep(sweep))
        } else {
            (Expected::Cycle { id, demand: from }, Command::Cycle(from))
        };
        let line = written(&Request { id, command });
        let bad = (self.rng.u8(0..LINES_PER_FAULT) == 0).then(|| bad_line(&mut self.rng, &line)).flatten();
        bad.unwrap_or_else(|| {
            *left -= u64::from(steps);
            Sent { line, expected }
        })
    }
}

fn demand(rng: &mut Rng, pose_box: &PoseBox, arithmetic: Arithmetic) -> Demand {
    let kind = rng.u8(0..100);
    let [theta, sigma, z0] = pose_box.ranges();
    let mut within = |[low, high]: [f64; 2], by: f64| {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        middle + by * half * (2.0 * rng.f64() - 1.0)
    };
    // in the box; around it; anywhere
    let [theta_rad, sigma_rad, z0_m] = match kind {
        0..90 => core_units([within(theta, 1.0), within(sigma, 1.0), within(z0, 1.0)]),
        90..97 => core_units([within(theta, 2.0), within(sigma, 2.0), within(z0, 2.0)]),
        _ => [within([-2.0, 2.0], 1.0), within([-2.0, 2.0], 1.0), within([-1.0, 2.0], 1.0)],
    };
    // few digits keep the lines short
    let mut three = |size: f64, digit: f64| [0; 3].map(|_| (within([-size, size], 1.0) / digit).round() * digit);
    let (force_n, moment_nm, [u, v, w]) = (three(2000.0, 1.0), three(200.0, 1.0), three(0.125, 0.0078125));
    let tip_m = [u, v, 0.375 + w];
    // now and then there is no reading
    let rises_k = [0; 4].map(|_| (rng.u8(0..8) > 0).then(|| (40.0 * (rng.f64() - 0.5)).round() / 4.0));
    Demand {
        arithmetic,
        pose: Pose { theta_rad, sigma_rad, z0_m },
        wrench_at_tip: Wrench { force_n: force_n.into(), moment_nm: moment_nm.into() },
        tip_m: tip_m.into(),
        rises_k,
    }
}

/// A line that no firmware may accept.
fn bad_line(rng: &mut Rng, good: &[u8]) -> Option<Sent> {
    let text = String::from_utf8_lossy(opened(good)?).into_owned();
    let json: Vec<u8> = match rng.u8(0..10) {
        0 => text[..rng.usize(1..text.len())].to_owned().into_bytes(),
        1 => (0..rng.usize(1..300)).map(|_| rng.u8(..)).filter(|b| ![b'\n', ABORT].contains(b)).collect(),
        2 => vec![b'['; rng.usize(1..2 * MAX_COMMAND)],
        9 => return damaged(rng, good),
        3 => text.replacen(",\"force_n\"", "e999,\"force_n\"", 1).into(),
        4 => text.replacen("\"v\":2", "\"v\":1", 1).into(),
        5 => text.replacen("cycle", "reboot", 1).into(),
        6 => text.replacen("\"v\":2", "\"v\":2,\"v\":2", 1).into(),
        7 => text.replacen("[", "[,", 1).into(),
        _ => text.replacen("\"z0_m\":", "\"z0_m\":NaN", 1).into(),
    };
    let mut buffer = [&json[..], &[0; 10]].concat();
    refused(sealed(&mut buffer, json.len())?.to_vec())
}

/// A digit that has flipped on the way.
fn damaged(rng: &mut Rng, good: &[u8]) -> Option<Sent> {
    let mut line = good.to_vec();
    let digits: Vec<usize> = (0..line.len()).filter(|at| line[*at].is_ascii_digit()).collect();
    line[digits[rng.usize(..digits.len())]] ^= 1;
    refused(line)
}

fn refused(line: Vec<u8>) -> Option<Sent> {
    let mut lines = Lines::new();
    match line.iter().filter_map(|b| lines.push(*b)).next() {
        Some(Err(refused)) => Some(Sent { line, expected: Expected::Error { id: refused.id, code: refused.code } }),
        _ => None,
    }
}

//! Replies of the firmware against the host's.

use pkm_core::{CorrectionTable, Machine, Scalar};
use pkm_protocol::{Answer, Arithmetic, CycleReply, Demand, Numbers, Reply, Status, Sweep, SweepReply};
use serde::Deserialize;

use super::HostModel;
use super::lines::{Expected, Sent};
use super::link::{Link, shown};
use crate::error::Result;
use crate::pose::ROTATION_ARM_M;

/// What was found so far.
#[derive(Default)]
pub struct Findings {
    /// Replies that differ from the host's.
    pub differing: u64,
    /// The first of them.
    pub first: Option<String>,
    /// Greatest relative difference of a number.
    pub worst_deviation: f64,
    /// Lines sent that no firmware may accept.
    pub bad_lines: u64,
    /// f32, f64.
    pub of: [CycleCounts; 2],
    /// f32 against f64, see [`F32_BOUNDS`](super::F32_BOUNDS).
    pub precision: [f64; 3],
}

/// The cycles of one arithmetic.
#[derive(Default)]
pub struct CycleCounts {
    /// All.
    pub cycles: u64,
    /// Of each cycle, or the greatest of each sweep.
    pub ticks: Vec<u32>,
    /// Outside the table's box.
    pub outside_box: u64,
    /// Without numbers.
    pub refused: u64,
    /// Longer than the firmware's period.
    pub overruns: u32,
}

impl Findings {
    /// Compares a reply with the host's.
    pub(super) fn check(&mut self, link: &Link, host: &HostModel<'_>, sent: &Sent, reply: &[u8]) -> Result<()> {
        match &sent.expected {
            Expected::Error { id, code } => {
                self.bad_lines += 1;
                let expected = Reply { v: pkm_protocol::VERSION, id: *id, answer: Answer::Error(*code) };
                if link.parsed::<f64>(reply)? != expected {
                    self.differs(&sent.line, reply, &format!("{expected:?}"));
                }
            }
            Expected::Cycle { id, demand } => match demand.arithmetic {
                Arithmetic::F32 => {
                    if let Some(single) = self.cycle(link, &host.single, (*id, demand), sent, reply)? {
                        self.keep_precision(&single, demand, &host.double);
                    }
                }
                Arithmetic::F64 => drop(self.cycle(link, &host.double, (*id, demand), sent, reply)?),
            },
            Expected::Sweep { id, sweep } => self.sweep(link, host, (*id, sweep), sent, reply)?,
        }
        Ok(())
    }

    fn sweep(
        &mut self,
        link: &Link,
        host: &HostModel<'_>,
        (id, sweep): (u32, &Sweep),
        sent: &Sent,
        reply: &[u8],
    ) -> Result<()> {
        let parsed = link.parsed::<f64>(reply)?;
        let mut expected = SweepReply::default();
        for demand in sweep.demands() {
            match demand.arithmetic {
                Arithmetic::F32 => {
                    let single = CycleReply::new(&demand.cycle(&host.single.0, &host.single.1), 0, false);
                    if let Some(numbers) = &single.numbers {
                        self.keep_precision(numbers, &demand, &host.double);
                    }
                    expected.add(&single);
                }
                Arithmetic::F64 => {
                    expected.add(&CycleReply::new(&demand.cycle(&host.double.0, &host.double.1), 0, false));
                }
            }
        }
        if let Answer::Sweep(found) = parsed.answer {
            (expected.overruns, expected.worst_ticks) = (found.overruns, found.worst_ticks);
        }
        if parsed != (Reply { v: pkm_protocol::VERSION, id: Some(id), answer: Answer::Sweep(expected) }) {
            self.differs(&sent.line, reply, &format!("{expected:?}"));
        }
        let of = &mut self.of[usize::from(sweep.from.arithmetic == Arithmetic::F64)];
        of.cycles += u64::from(sweep.steps);
        of.ticks.push(expected.worst_ticks);
        of.refused += u64::from(expected.refused);
        of.outside_box += u64::from(expected.outside_box);
        Ok(())
    }

    fn cycle<T: Scalar + for<'a> Deserialize<'a>>(
        &mut self,
        link: &Link,
        (machine, table): &(Machine<T>, CorrectionTable<'_, T>),
        (id, demand): (u32, &Demand),
        sent: &Sent,
        reply: &[u8],
    ) -> Result<Option<Numbers<T>>> {
        let parsed = link.parsed::<T>(reply)?;
        let Answer::Cycle(found) = parsed.answer else {
            self.differs(&sent.line, reply, "a cycle");
            return Ok(None);
        };
        let expected = CycleReply::new(&demand.cycle(machine, table), found.ticks, found.overrun);
        let bits = |v: &T| v.to_f64().to_bits();
        let same = match (&found.numbers, &expected.numbers) {
            (Some(f), Some(e)) => {
                for (f, e) in f.all().zip(e.all()) {
                    let (f, e) = (f.to_f64(), e.to_f64());
                    if f != e {
                        self.worst_deviation = self.worst_deviation.max((f - e).abs() / e.abs());
                    }
                }
                f.all().map(|v| bits(&v)).eq(e.all().map(|v| bits(&v)))
            }
            (None, None) => true,
            _ => false,
        };
        if !same || found.status != expected.status || parsed.id != Some(id) {
            self.differs(&sent.line, reply, &format!("{expected:?}"));
        }
        let of = &mut self.of[usize::from(demand.arithmetic == Arithmetic::F64)];
        of.cycles += 1;
        of.ticks.push(found.ticks);
        of.refused += u64::from(expected.numbers.is_none());
        of.outside_box += u64::from(expected.status == Status::OutsideBox);
        Ok(found.numbers)
    }

    fn differs(&mut self, sent: &[u8], reply: &[u8], expected: &str) {
        self.differing += 1;
        self.first.get_or_insert_with(|| format!("to {} came {}, expected {expected}", shown(sent), shown(reply)));
    }

    /// In the box only.
    fn keep_precision(
        &mut self,
        single: &Numbers<f32>,
        demand: &Demand,
        (machine, table): &(Machine<f64>, CorrectionTable<'_, f64>),
    ) {
        let double = CycleReply::new(&demand.cycle(machine, table), 0, false);
        let (Status::Ok, Some(double)) = (double.status, double.numbers) else { return };
        let lengths = |a: [f32; 3], b: [f64; 3]| (0..3).map(|i| (f64::from(a[i]) - b[i]).abs()).fold(0.0, f64::max);
        let turned = |v: [f64; 3]| v.map(|v| ROTATION_ARM_M * v);
        let six = |t: [f64; 3], r: [f64; 3]| t.into_iter().chain(turned(r));
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|v| v * v).sum::<f64>().sqrt();
        let mut deflection = six(double.translation_m, double.rotation_rad);
        let narrow = six(single.translation_m.map(f64::from), single.rotation_rad.map(f64::from));
        let mut off = narrow.zip(deflection.clone()).map(|(a, b)| a - b);
        let diagonal = [0, 6, 11, 15, 18, 20].map(|i| double.k[i]);
        let pairs = (0..6).flat_map(|i| (i..6).map(move |j| (i, j)));
        let k = pairs
            .zip(single.k.iter().zip(&double.k))
            .map(|((i, j), (a, b))| (f64::from(*a) - b).abs() / (diagonal[i] * diagonal[j]).sqrt());
        let found = [
            lengths(single.q_m, double.q_m).max(lengths(single.compensated.q_m, double.compensated.q_m)),
            k.fold(0.0, f64::max),
            norm(&mut off) / norm(&mut deflection),
        ];
        for (worst, found) in self.precision.iter_mut().zip(found) {
            *worst = worst.max(found);
        }
    }
}

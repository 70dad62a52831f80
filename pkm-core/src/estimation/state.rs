//! What an estimator knows, as bytes that survive a power cut.
//!
//! A controller keeps two slots in memory that stays. It writes a state over the older one and reads back the newer one that is
//! whole: a cut at any byte of a save leaves the other slot.

use core::fmt;

use super::Estimator;
use super::filter::Filter;
use crate::checksum::{START, over_byte};
use crate::scalar::Scalar;

/// Fingerprint, sequence number, time, readings, refused readings, time of the first; and at the end the checksum.
const HEAD: usize = 8 + 5 * 4;
const END: usize = 8;
const NUMBER: usize = 8;

/// Length of a saved state of so many amplitudes.
pub const fn state_bytes(amplitudes: usize) -> usize {
    let triangle = amplitudes * amplitudes.saturating_sub(1) / 2;
    HEAD + NUMBER * (7 * amplitudes + triangle) + END
}

/// One of two places for a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Slot {
    /// The first.
    A,
    /// The second.
    B,
}

/// Why there is no state to go on from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StateError {
    /// Neither slot is whole: nothing was saved, or both are damaged.
    NotWhole,
    /// It is of another machine or table, or of other amplitudes or units of them.
    Other,
    /// The place for it is shorter than [`state_bytes`].
    TooShort,
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotWhole => "no state is whole",
            Self::Other => "the state is that of another machine or table, or of other amplitudes",
            Self::TooShort => "the place for the state is too short",
        })
    }
}

impl core::error::Error for StateError {}

/// Bytes that are written or read one number after the other.
struct Bytes<'a, I: Iterator<Item = &'a mut u8>>(I);

impl<'a, I: Iterator<Item = &'a mut u8>> Bytes<'a, I> {
    fn put(&mut self, bytes: &[u8]) {
        for byte in bytes {
            if let Some(place) = self.0.next() {
                *place = *byte;
            }
        }
    }
}

/// The next bytes of a state; zeros behind its end, which the checksum has ruled out.
fn take<const N: usize>(bytes: &mut impl Iterator<Item = u8>) -> [u8; N] {
    let mut taken = [0; N];
    for place in &mut taken {
        *place = bytes.next().unwrap_or(0);
    }
    taken
}

fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(START, |hash, byte| over_byte(hash, *byte))
}

/// Sequence number of a slot that is whole.
fn sequence(slot: &[u8], length: usize) -> Option<u32> {
    let (body, end) = slot.get(..length)?.split_at_checked(length.checked_sub(END)?)?;
    let is_whole = take(&mut end.iter().copied()) == checksum(body).to_le_bytes();
    let number = take(&mut body.iter().copied().skip(8));
    is_whole.then_some(u32::from_le_bytes(number))
}

/// Which of two slots holds the newest whole state of so many amplitudes, with its sequence number. The other one is to be written
/// next, with the number that follows.
pub fn newest(amplitudes: usize, a: &[u8], b: &[u8]) -> Option<(Slot, u32)> {
    let length = state_bytes(amplitudes);
    match (sequence(a, length), sequence(b, length)) {
        // numbers may have gone round
        (Some(a), Some(b)) if b.wrapping_sub(a) as i32 > 0 => Some((Slot::B, b)),
        (Some(a), _) => Some((Slot::A, a)),
        (None, Some(b)) => Some((Slot::B, b)),
        (None, None) => None,
    }
}

impl<T: Scalar, const N: usize> Estimator<T, N> {
    /// Writes what it knows, for [`restore`](Self::restore). What it writes is the same for the same state, also in `f32` on a controller
    /// and on a host.
    ///
    /// # Arguments
    /// * `model`: checksums of machine and table beyond which it has learned,
    ///   [`MachineParameters::checksum`](crate::MachineParameters::checksum)` ^ `[`CorrectionTable::checksum`](crate::CorrectionTable::checksum): what is
    ///   known beyond one table is none of another's business, which may have it already.
    /// * `sequence`: one more than that of the last save.
    /// * `slot`: at least [`state_bytes`] long.
    ///
    /// # Errors
    /// [`StateError::TooShort`].
    pub fn save(&self, model: u64, sequence: u32, slot: &mut [u8]) -> Result<(), StateError> {
        let place = slot.get_mut(..state_bytes(N)).ok_or(StateError::TooShort)?;
        let (body, end) = place.split_at_mut_checked(state_bytes(N) - END).ok_or(StateError::TooShort)?;
        let mut bytes = Bytes(body.iter_mut());
        bytes.put(&self.settings.fingerprint(model).to_le_bytes());
        for number in [sequence, self.time_s, self.readings, self.refused, self.began_s] {
            bytes.put(&number.to_le_bytes());
        }
        let Filter { mean, upper, diagonal, .. } = &self.filter;
        for numbers in [mean, diagonal, &self.applied, &self.sums[0], &self.sums[1]] {
            for number in numbers {
                bytes.put(&number.to_f64().to_le_bytes());
            }
        }
        for number in self.changed_at.into_iter().chain(self.drifted_at) {
            bytes.put(&f64::from(number).to_le_bytes());
        }
        for (j, column) in upper.iter().enumerate() {
            for number in column.iter().take(j) {
                bytes.put(&number.to_f64().to_le_bytes());
            }
        }
        let sum = checksum(body).to_le_bytes();
        Bytes(end.iter_mut()).put(&sum);
        Ok(())
    }

    /// Goes on from what was saved. A slot that is refused changes nothing.
    ///
    /// # Arguments
    /// * `model`: as of [`save`](Self::save).
    /// * `slot`: the newest, see [`newest`].
    ///
    /// # Errors
    /// A slot that is too short or not whole, or that of another machine, of another table or of other amplitudes.
    pub fn restore(&mut self, model: u64, slot: &[u8]) -> Result<(), StateError> {
        if slot.len() < state_bytes(N) {
            return Err(StateError::TooShort);
        }
        if sequence(slot, state_bytes(N)).is_none() {
            return Err(StateError::NotWhole);
        }
        let mut bytes = slot.iter().copied();
        if u64::from_le_bytes(take(&mut bytes)) != self.settings.fingerprint(model) {
            return Err(StateError::Other);
        }
        let _sequence: [u8; 4] = take(&mut bytes);
        for number in [&mut self.time_s, &mut self.readings, &mut self.refused, &mut self.began_s] {
            *number = u32::from_le_bytes(take(&mut bytes));
        }
        let mut next = || f64::from_le_bytes(take(&mut bytes));
        let Filter { mean, upper, diagonal, .. } = &mut self.filter;
        let [sums, variances] = &mut self.sums;
        for numbers in [mean, diagonal, &mut self.applied, sums, variances] {
            numbers.iter_mut().for_each(|number| *number = T::from_f64(next()));
        }
        self.changed_at.iter_mut().chain(&mut self.drifted_at).for_each(|number| *number = next() as u32);
        for (j, column) in upper.iter_mut().enumerate() {
            column.iter_mut().take(j).for_each(|number| *number = T::from_f64(next()));
        }
        // it may have been saved under wider bounds
        self.keep_possible();
        self.targets = self.applied;
        self.set_targets();
        Ok(())
    }
}

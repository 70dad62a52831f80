//! Where a firmware keeps what it has learned: two slots of memory that stays, written in turn. Knows no hardware.

use pkm_core::estimation::{Estimator, MAX_AMPLITUDES, Slot, StateError, newest, state_bytes};

/// Memory that stays: two slots, each erased as a whole and then written word by word.
pub trait Flash {
    /// Sets every bit of a slot.
    ///
    /// # Errors
    /// The memory's own, here and below.
    fn erase(&mut self, slot: Slot) -> Result<(), NotSaved>;

    /// Writes a word of an erased slot.
    ///
    /// # Arguments
    /// * `at`: bytes from the beginning of the slot, a multiple of four.
    fn write(&mut self, slot: Slot, at: usize, word: u32) -> Result<(), NotSaved>;

    /// The word there.
    fn word(&self, slot: Slot, at: usize) -> u32;
}

/// What was to be saved does not stand there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotSaved;

/// Bytes that every slot has room for.
pub const SLOT_BYTES: usize = state_bytes(MAX_AMPLITUDES);
const WORD: usize = size_of::<u32>();

/// A copy of a slot.
fn copy(flash: &impl Flash, slot: Slot) -> [u8; SLOT_BYTES] {
    let mut bytes = [0; SLOT_BYTES];
    for (place, at) in bytes.chunks_mut(WORD).zip((0..).step_by(WORD)) {
        for (byte, read) in place.iter_mut().zip(flash.word(slot, at).to_le_bytes()) {
            *byte = read;
        }
    }
    bytes
}

/// Goes on from the newest state that is whole, and gives its sequence number.
///
/// # Errors
/// None is whole, or it is that of another machine or table, or of other amplitudes: the estimator stays as it is.
pub fn restore<const N: usize>(
    flash: &impl Flash,
    model: u64,
    estimator: &mut Estimator<f64, N>,
) -> Result<u32, StateError> {
    let (a, b) = (copy(flash, Slot::A), copy(flash, Slot::B));
    let (slot, sequence) = newest(N, &a, &b).ok_or(StateError::NotWhole)?;
    estimator.restore(model, if slot == Slot::A { &a } else { &b })?;
    Ok(sequence)
}

/// Writes a state over the older of the two, and gives its sequence number. A cut at any moment leaves the newer one.
///
/// # Errors
/// What was written does not read back.
pub fn save<const N: usize>(
    flash: &mut impl Flash,
    model: u64,
    estimator: &Estimator<f64, N>,
) -> Result<u32, NotSaved> {
    let (slot, sequence) = match newest(N, &copy(flash, Slot::A), &copy(flash, Slot::B)) {
        Some((Slot::A, last)) => (Slot::B, last.wrapping_add(1)),
        Some((Slot::B, last)) => (Slot::A, last.wrapping_add(1)),
        None => (Slot::A, 1),
    };
    let mut bytes = [0; SLOT_BYTES];
    estimator.save(model, sequence, &mut bytes).map_err(|_| NotSaved)?;
    let state = bytes.get(..state_bytes(N)).ok_or(NotSaved)?;
    flash.erase(slot)?;
    for (bytes, at) in state.chunks(WORD).zip((0..).step_by(WORD)) {
        let word = bytes.iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte));
        flash.write(slot, at, word)?;
    }
    if copy(flash, slot).starts_with(state) { Ok(sequence) } else { Err(NotSaved) }
}

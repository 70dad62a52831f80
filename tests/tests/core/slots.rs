//! The firmware's two slots over a flash whose power is cut.

use pkm_core::estimation::{Estimator, Slot, StateError, state_bytes};
use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS};

use crate::estimation::{at_work, drives};

#[path = "../../../embed/firmware/src/slots.rs"]
mod firmware;

use firmware::{Flash, NotSaved, SLOT_BYTES, restore, save};

/// A flash of bytes that loses its power after so many of them were changed.
#[derive(Clone)]
struct Cut {
    slots: [[u8; SLOT_BYTES]; 2],
    left: usize,
}

impl Cut {
    fn change(&mut self, slot: Slot, at: usize, change: impl FnOnce(&mut u8)) -> Result<(), NotSaved> {
        self.left = self.left.checked_sub(1).ok_or(NotSaved)?;
        change(&mut self.slots[slot as usize][at]);
        Ok(())
    }
}

impl Flash for Cut {
    fn erase(&mut self, slot: Slot) -> Result<(), NotSaved> {
        (0..SLOT_BYTES).try_for_each(|at| self.change(slot, at, |byte| *byte = 0xff))
    }

    fn write(&mut self, slot: Slot, at: usize, word: u32) -> Result<(), NotSaved> {
        // bits are cleared alone
        (at..).zip(word.to_le_bytes()).try_for_each(|(at, new)| self.change(slot, at, |byte| *byte &= new))
    }

    fn word(&self, slot: Slot, at: usize) -> u32 {
        u32::from_le_bytes(self.slots[slot as usize][at..at + 4].try_into().unwrap())
    }
}

#[test]
fn a_power_cut_at_any_byte_of_a_save_leaves_the_last_whole_state_in_the_slots() {
    let machine = PARAMETERS.checksum();
    let (first, mut touch, readings) = at_work();
    let fresh = Estimator::new(&drives()).unwrap();
    let read = |flash: &Cut| {
        let mut estimator = fresh;
        let found = restore(flash, machine, &mut estimator);
        (found, estimator)
    };
    let mut flash = Cut { slots: [[0xa5; SLOT_BYTES]; 2], left: usize::MAX };
    assert_eq!(read(&flash), (Err(StateError::NotWhole), fresh));
    let mut state = first;
    let (mut before, mut cuts) = (read(&flash), 0);
    // over garbage in either slot, then over the older state
    for sequence in 1..=3 {
        let all = SLOT_BYTES + state_bytes(6);
        for left in 0..all {
            let mut torn = Cut { left, ..flash.clone() };
            assert_eq!(save(&mut torn, machine, &state), Err(NotSaved));
            assert_eq!(read(&torn), before, "save {sequence} cut after {left} bytes");
            cuts += 1;
            if left % 16 != 0 {
                continue;
            }
            // with power again the next save goes through
            torn.left = usize::MAX;
            assert_eq!(save(&mut torn, machine, &state), Ok(sequence));
            assert_eq!(read(&torn).0, Ok(sequence));
        }
        flash.left = all;
        assert_eq!(save(&mut flash, machine, &state), Ok(sequence));
        before = read(&flash);
        assert_eq!(before.0, Ok(sequence));
        assert_eq!((before.1.values(), before.1.readings()), (state.values(), state.readings()));
        // the state of another machine is none
        assert_eq!(restore(&flash, machine ^ 1, &mut { fresh }), Err(StateError::Other));
        touch.time_s += 600;
        let readings = readings.map(|mut reading| {
            reading.read *= 1.0 + 1e-3 * f64::from(sequence);
            reading
        });
        state.learn(&MACHINE_F64, None, &touch, &readings).expect("taken in");
    }
    assert_eq!(cuts, 3600);
}

#[test]
fn a_slot_that_does_not_take_what_is_written_is_no_save() {
    struct Stuck(Cut);
    impl Flash for Stuck {
        fn erase(&mut self, _: Slot) -> Result<(), NotSaved> {
            Ok(())
        }
        fn write(&mut self, slot: Slot, at: usize, word: u32) -> Result<(), NotSaved> {
            self.0.write(slot, at, word)
        }
        fn word(&self, slot: Slot, at: usize) -> u32 {
            self.0.word(slot, at)
        }
    }
    let (estimator, ..) = at_work();
    let mut flash = Stuck(Cut { slots: [[0xa5; SLOT_BYTES]; 2], left: usize::MAX });
    assert_eq!(save(&mut flash, 1, &estimator), Err(NotSaved));
}

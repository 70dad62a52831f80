//! Whether the table in service is still in memory as it was, a few numbers each period.

use core::hint::black_box;

use super::buffer::BOX;
use super::{Basis, CorrectionTable};
use crate::checksum::{Damaged, START, over_byte, over_numbers};
use crate::scalar::Scalar;

/// Numbers that [`TableWatch::look`] takes in.
pub const WATCHED_NUMBERS: usize = 8;

/// Computes the checksum of the table in service over and over, [`WATCHED_NUMBERS`] numbers a period.
///
/// A bit that flips in a table of n numbers ([`TableHeader::numbers`](super::TableHeader::numbers)) is found within 2 (n / 8 + 1) periods:
/// at the end of the next round where this one has passed it. Compensate no more then: a [`Compensator`](crate::Compensator) whose
/// reading is not enabled takes its offset back at its rate.
///
/// ```
/// use pkm_core::correction::TableWatch;
/// use pkm_core::tables::reference::TABLE_F64;
/// // built in; of a table that has come, `TableBuffer::watch`
/// let mut watch = const { TableWatch::new(TABLE_F64.checksum()) };
/// for _period in 0..1000 {
///     assert!(watch.look(&TABLE_F64).is_ok());
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TableWatch {
    /// What the table has to sum up to: its `checksum`, as it was verified at the start.
    pub expected: u64,
    /// Of the numbers of this round.
    pub sum: u64,
    /// How many they are.
    pub next: u32,
    /// Found to be damaged, which stays so.
    pub is_damaged: bool,
}

impl TableWatch {
    /// Begins.
    pub const fn new(expected: u64) -> Self {
        Self { expected, sum: START, next: 0, is_damaged: false }
    }

    /// Takes in the next numbers. To be called each period, with the table that it uses.
    ///
    /// # Errors
    /// [`Damaged::Table`] from when a round has another sum, for good.
    pub fn look<T: Scalar>(&mut self, table: &CorrectionTable<'_, T>) -> Result<(), Damaged> {
        // or the compiler would take a constant for what is in memory
        let table = black_box(table);
        for _ in 0..WATCHED_NUMBERS {
            let Some(sum) = over(self.sum, table, self.next as usize) else {
                self.is_damaged |= self.sum != self.expected;
                (self.sum, self.next) = (START, 0);
                break;
            };
            (self.sum, self.next) = (sum, self.next.wrapping_add(1));
        }
        if self.is_damaged { Err(Damaged::Table) } else { Ok(()) }
    }
}

/// Takes the number at a place into a sum, in the order of [`CorrectionTable::numbers`]; `None` behind the last.
fn over<T: Scalar>(sum: u64, table: &CorrectionTable<'_, T>, place: usize) -> Option<u64> {
    let Basis { centre, half_width, terms } = &table.basis;
    let in_box = centre.get(place).or_else(|| half_width.get(place.checked_sub(centre.len())?));
    let number = match in_box {
        Some(number) => number,
        None => {
            let (place, exponents) = (place.checked_sub(BOX)?, terms.as_flattened());
            if let Some(exponent) = exponents.get(place) {
                return Some(over_byte(sum, *exponent));
            }
            let place = place.checked_sub(exponents.len())?;
            table.diagonal.get(place).or_else(|| table.factor?.get(place.checked_sub(table.diagonal.len())?))?
        }
    };
    Some(over_numbers(sum, &[number.to_f64()]))
}

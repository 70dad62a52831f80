//! FNV-1a, 64 bit: generated files check themselves with it when they are compiled, controllers their memory when they start.
//!
//! A step of FNV-1a is a bijection of its state, so that a change within one byte is always found.

use core::fmt;
use core::hint::black_box;

use crate::correction::CorrectionTable;
use crate::five_axis::FiveAxis;

/// What to begin with.
pub const START: u64 = 0xcbf2_9ce4_8422_2325;

/// Takes in a byte.
pub const fn over_byte(hash: u64, byte: u8) -> u64 {
    (hash ^ byte as u64).wrapping_mul(0x0000_0100_0000_01b3)
}

/// Takes in the bytes of a text.
pub const fn over_text(mut hash: u64, text: &str) -> u64 {
    let bytes = text.as_bytes();
    let mut i = 0;
    while i < bytes.len() {
        hash = over_byte(hash, bytes[i]);
        i += 1;
    }
    hash
}

/// Takes in the bytes of numbers, each from its lowest.
pub const fn over_numbers(mut hash: u64, values: &[f64]) -> u64 {
    let mut i = 0;
    while i < values.len() {
        let bytes = values[i].to_bits().to_le_bytes();
        let mut b = 0;
        while b < 8 {
            hash = over_byte(hash, bytes[b]);
            b += 1;
        }
        i += 1;
    }
    hash
}

/// Takes in the bytes of numbers as those of their `f64` values.
pub const fn over_numbers_f32(mut hash: u64, values: &[f32]) -> u64 {
    let mut i = 0;
    while i < values.len() {
        hash = over_numbers(hash, &[values[i] as f64]);
        i += 1;
    }
    hash
}

/// What machine, wrist and table sum up to as they are in memory; see [`FiveAxis::checksums`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryChecksums {
    /// Of the machine, as it was made: not of the one at another temperature.
    pub machine: u64,
    /// Of the wrist.
    pub wrist: u64,
    /// Of the table.
    pub table: u64,
}

/// What is not as it was when the program was built: damaged, or another one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Damaged {
    /// The machine.
    Machine,
    /// The wrist.
    Wrist,
    /// The table.
    Table,
    /// How far the table may be off.
    Uncertainty,
}

impl fmt::Display for Damaged {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Machine => "the machine in memory is damaged or another one",
            Self::Wrist => "the wrist in memory is damaged or another one",
            Self::Table => "the table in memory is damaged or another one",
            Self::Uncertainty => "the table's uncertainty in memory is damaged or another one",
        })
    }
}

impl core::error::Error for Damaged {}

macro_rules! memory {
    ($t:ty) => {
        impl FiveAxis<'_, $t> {
            /// Checksums of machine, wrist and table. In a `const` they are those of the program as it was built:
            ///
            /// ```
            /// use pkm_core::checksum::{Damaged, MemoryChecksums};
            /// use pkm_core::{FiveAxis, tables::reference::{MACHINE_F64, TABLE_F64, WRIST_F64}};
            /// static FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };
            /// const BUILT: MemoryChecksums = FIVE.checksums(&TABLE_F64);
            /// // when the controller starts, and before it takes another table
            /// FIVE.verify(&TABLE_F64, &BUILT)?;
            /// let another = MemoryChecksums { machine: 1, ..BUILT };
            /// assert_eq!(FIVE.verify(&TABLE_F64, &another), Err(Damaged::Machine));
            /// # Ok::<(), Damaged>(())
            /// ```
            pub const fn checksums(&self, table: &CorrectionTable<'_, $t>) -> MemoryChecksums {
                MemoryChecksums {
                    machine: self.machine.checksum(),
                    wrist: self.wrist.checksum(),
                    table: table.checksum(),
                }
            }

            /// Computes the checksums again from what is in memory now, and compares them. A table that comes with the checksums
            /// of its own machine is refused with another.
            ///
            /// # Errors
            /// The first that differs.
            pub fn verify(&self, table: &CorrectionTable<'_, $t>, built: &MemoryChecksums) -> Result<(), Damaged> {
                // or the compiler would compare two constants
                let found = black_box(self).checksums(black_box(table));
                if found.machine != built.machine {
                    Err(Damaged::Machine)
                } else if found.wrist != built.wrist {
                    Err(Damaged::Wrist)
                } else if found.table != built.table {
                    Err(Damaged::Table)
                } else {
                    Ok(())
                }
            }
        }
    };
}

memory!(f32);
memory!(f64);

//! A line's worth of the numbers of a table.

use core::fmt;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Most numbers in a line.
pub const MAX_NUMBERS: usize = 24;

/// Up to [`MAX_NUMBERS`] numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableNumbers {
    all: [f64; MAX_NUMBERS],
    count: usize,
}

/// Some of the numbers of a table, in the order of `CorrectionTable::numbers`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Which of the table's numbers is the first here, from 0.
    pub first: u32,
    /// The numbers.
    pub numbers: TableNumbers,
}

impl TableNumbers {
    /// `None` for more than [`MAX_NUMBERS`].
    pub fn new(numbers: &[f64]) -> Option<Self> {
        let mut all = [0.0; MAX_NUMBERS];
        all.get_mut(..numbers.len())?.copy_from_slice(numbers);
        Some(Self { all, count: numbers.len() })
    }

    /// All of them.
    pub fn as_slice(&self) -> &[f64] {
        self.all.get(..self.count).unwrap_or_default()
    }

    pub(crate) fn are_finite(&self) -> bool {
        self.all.iter().all(|number| number.is_finite())
    }
}

impl Serialize for TableNumbers {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.as_slice())
    }
}

impl<'de> Deserialize<'de> for TableNumbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct List;

        impl<'de> Visitor<'de> for List {
            type Value = TableNumbers;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, "up to {MAX_NUMBERS} numbers")
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<TableNumbers, A::Error> {
                let mut numbers = TableNumbers { all: [0.0; MAX_NUMBERS], count: 0 };
                while let Some(number) = list.next_element()? {
                    let room = numbers.all.get_mut(numbers.count).ok_or_else(|| A::Error::custom("too many"))?;
                    *room = number;
                    numbers.count += 1;
                }
                Ok(numbers)
            }
        }

        deserializer.deserialize_seq(List)
    }
}

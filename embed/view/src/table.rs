//! A correction table as a row of numbers.

use pkm_core::correction::{FACTOR_ENTRIES, MAX_TERMS};
use pkm_core::{Basis, CorrectionTable, TableError};

use crate::text::Text;

/// Numbers of a table, of as many terms as may be: middle and half widths of its box, how many terms, exponents, six rows of the
/// diagonal form, 1 if there is a factor form, its 21 rows. Rows follow each other without gaps; numbers after the last row are not read.
pub const TABLE_NUMBERS: usize = 3 + 3 + 1 + 3 * MAX_TERMS + 6 * MAX_TERMS + 1 + FACTOR_ENTRIES * MAX_TERMS;

/// The numbers of a table, for the core to borrow.
#[derive(Debug)]
pub(crate) struct Table {
    centre: [f64; 3],
    half_width: [f64; 3],
    terms: usize,
    exponents: [[u8; 3]; MAX_TERMS],
    diagonal: [f64; 6 * MAX_TERMS],
    factor: Option<[f64; FACTOR_ENTRIES * MAX_TERMS]>,
}

impl Table {
    /// Reads a table and lets the core check it.
    pub(crate) fn read(numbers: &[f64; TABLE_NUMBERS]) -> Result<Self, Text> {
        let mut numbers = numbers.iter().copied();
        let mut next = || numbers.next().unwrap_or_default();
        let mut table = Self {
            centre: core::array::from_fn(|_| next()),
            half_width: core::array::from_fn(|_| next()),
            terms: (next() as usize).min(MAX_TERMS),
            exponents: [[0; 3]; MAX_TERMS],
            diagonal: [0.0; 6 * MAX_TERMS],
            factor: None,
        };
        let terms = table.terms;
        for exponents in table.exponents.iter_mut().take(terms) {
            *exponents = core::array::from_fn(|_| next() as u8);
        }
        table.diagonal.iter_mut().take(6 * terms).for_each(|value| *value = next());
        if next() != 0.0 {
            let mut factor = [0.0; FACTOR_ENTRIES * MAX_TERMS];
            factor.iter_mut().take(FACTOR_ENTRIES * terms).for_each(|value| *value = next());
            table.factor = Some(factor);
        }
        table.core().map_err(|e| Text::of(&e))?;
        Ok(table)
    }

    /// The core's view of it.
    pub(crate) fn core(&self) -> Result<CorrectionTable<'_, f64>, TableError> {
        let part = |values: &'_ [f64], rows: usize| -> usize { (rows * self.terms).min(values.len()) };
        let exponents = self.exponents.get(..self.terms).unwrap_or_default();
        let basis = Basis::<f64>::new(self.centre, self.half_width, exponents)?;
        let diagonal = self.diagonal.get(..part(&self.diagonal, 6)).unwrap_or_default();
        let factor = self.factor.as_ref().map(|f| f.get(..part(f, FACTOR_ENTRIES)).unwrap_or_default());
        CorrectionTable::<f64>::new(basis, diagonal, factor)
    }
}

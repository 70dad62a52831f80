//! A table that comes while the controller runs, number by number, for a change between two periods.

use core::fmt;
use core::hint::black_box;

use super::{Basis, CorrectionTable, FACTOR_ENTRIES, MAX_EXPONENT, MAX_TERMS, TableError, TableWatch};
use crate::checksum::{START, over_byte, over_numbers};
use crate::scalar::Scalar;

/// Numbers of the box: centre and half width.
pub(super) const BOX: usize = 6;
/// Exponents of a term.
const EXPONENTS: usize = 3;
/// Rows of the diagonal form.
const DIAGONAL_ROWS: usize = 6;
/// Rows of both forms.
const ROWS: usize = DIAGONAL_ROWS + FACTOR_ENTRIES;

/// What is said of a table before its numbers come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TableHeader {
    /// Checksum of the machine that the table was fitted for, of [`MachineParameters`](crate::MachineParameters::checksum).
    pub machine: u64,
    /// [`CorrectionTable::checksum`] of the table in `f64`.
    pub table: u64,
    /// 1 to [`MAX_TERMS`].
    pub terms: u8,
    /// Whether it has the factor form as well.
    pub factor_form: bool,
}

impl TableHeader {
    /// How many numbers follow: centre and half width of the box (θ, σ in rad, Z0 in m), three exponents a term, six rows of
    /// the diagonal form of one coefficient a term and, if it has it, 21 of the factor form.
    pub const fn numbers(&self) -> usize {
        let rows = if self.factor_form { ROWS } else { DIAGONAL_ROWS };
        BOX + (EXPONENTS + rows) * self.terms as usize
    }
}

impl CorrectionTable<'_, f64> {
    /// What a [`TableBuffer`] is told before the numbers.
    ///
    /// # Arguments
    /// * `machine`: checksum of the machine that the table was fitted for.
    pub fn header(&self, machine: u64) -> TableHeader {
        let terms = self.basis.terms.len() as u8; // no more than `MAX_TERMS`
        TableHeader { machine, table: self.checksum(), terms, factor_form: self.has_factor_form() }
    }

    /// The numbers in the order in which a [`TableBuffer`] takes them.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Basis { centre, half_width, terms } = self.basis;
        let coefficients = self.diagonal.iter().chain(self.factor.unwrap_or_default());
        let exponents = terms.iter().flatten().map(|exponent| f64::from(*exponent));
        centre.into_iter().chain(half_width).chain(exponents).chain(coefficients.copied())
    }
}

/// Why a table that comes is refused. The buffer takes no more of it then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TransferError {
    /// The table was fitted for another machine.
    OtherMachine,
    /// No terms, or more than there is room for.
    TermCount,
    /// No table was begun, or more numbers come than were announced, or fewer have come.
    NumberCount,
    /// The numbers are no table.
    Table(TableError),
    /// The numbers are not those that were announced.
    Checksum,
    /// The memory does not hold what was written to it.
    Memory,
}

impl fmt::Display for TransferError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::OtherMachine => f.write_str("the table was fitted for another machine"),
            Self::TermCount => f.write_str("the table has no terms, or more than there is room for"),
            Self::NumberCount => f.write_str("there are other numbers of the table than were announced"),
            Self::Table(e) => e.fmt(f),
            Self::Checksum => f.write_str("the table has another checksum than was announced"),
            Self::Memory => f.write_str("the memory does not hold the table that was written to it"),
        }
    }
}

impl core::error::Error for TransferError {}

/// Room for a table of up to `TERMS` terms that comes while the controller runs.
///
/// Two of them and an exchange of references at the edge of a period change tables without a copy and without a lock on the
/// period: the one that is in service is borrowed and cannot be written, the other is filled and checked at leisure. With a
/// [`Compensator`](crate::Compensator) the offset moves to the new table at its rate limit; without one the command steps.
///
/// ```
/// use pkm_core::correction::TableBuffer;
/// use pkm_core::tables::reference::{PARAMETERS, TABLE_F64};
///
/// let (mut in_service, mut spare) = (TableBuffer::<f64, 9>::new(), TableBuffer::<f64, 9>::new());
/// let table = in_service.table().unwrap_or(TABLE_F64); // nothing has come yet
/// // from the sender, in pieces
/// let header = TABLE_F64.header(PARAMETERS.checksum());
/// spare.begin(&header, PARAMETERS.checksum())?;
/// for number in TABLE_F64.numbers() {
///     spare.push(number)?;
/// }
/// spare.finish()?;
/// // between two periods
/// core::mem::swap(&mut in_service, &mut spare); // a controller exchanges references
/// assert_eq!(in_service.table().map(|table| table.checksum()), Some(header.table));
/// # Ok::<(), pkm_core::correction::TransferError>(())
/// ```
#[derive(Clone, Debug)]
pub struct TableBuffer<T, const TERMS: usize> {
    header: TableHeader,
    state: State,
    received: usize,
    /// Checksums of the numbers as they came, and as they were rounded and kept.
    came: u64,
    kept: u64,
    limits: [T; BOX],
    terms: [[u8; EXPONENTS]; TERMS],
    /// Packed: the rows of a table with fewer terms follow one another.
    coefficients: [[T; ROWS]; TERMS],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Empty,
    Filling,
    Whole,
}

impl<T: Scalar, const TERMS: usize> Default for TableBuffer<T, TERMS> {
    fn default() -> Self {
        Self::new()
    }
}

impl<T: Scalar, const TERMS: usize> TableBuffer<T, TERMS> {
    /// Without a table.
    pub const fn new() -> Self {
        const { assert!(TERMS <= MAX_TERMS) };
        Self {
            header: TableHeader { machine: 0, table: 0, terms: 0, factor_form: false },
            state: State::Empty,
            received: 0,
            came: START,
            kept: START,
            limits: [T::ZERO; BOX],
            terms: [[0; EXPONENTS]; TERMS],
            coefficients: [[T::ZERO; ROWS]; TERMS],
        }
    }

    /// Forgets what it holds and expects a table.
    ///
    /// # Arguments
    /// * `machine`: checksum of the controller's own machine, from memory.
    ///
    /// # Errors
    /// Another machine; more terms than there is room for. The buffer is empty then.
    pub fn begin(&mut self, header: &TableHeader, machine: u64) -> Result<(), TransferError> {
        self.state = State::Empty;
        if header.machine != machine {
            return Err(TransferError::OtherMachine);
        }
        if header.terms == 0 || usize::from(header.terms) > TERMS {
            return Err(TransferError::TermCount);
        }
        (self.header, self.state, self.received) = (*header, State::Filling, 0);
        (self.came, self.kept) = (START, START);
        Ok(())
    }

    /// The next number, in the order of [`CorrectionTable::numbers`].
    ///
    /// # Errors
    /// One too many, not finite, an exponent that is none. The buffer is empty then.
    pub fn push(&mut self, number: f64) -> Result<(), TransferError> {
        if self.state != State::Filling {
            return Err(TransferError::NumberCount);
        }
        let pushed = self.place(number);
        match pushed {
            Ok(()) => self.received += 1,
            Err(_) => self.state = State::Empty,
        }
        pushed
    }

    fn place(&mut self, number: f64) -> Result<(), TransferError> {
        if self.received >= self.header.numbers() {
            return Err(TransferError::NumberCount);
        }
        if !number.is_finite() {
            return Err(TransferError::Table(TableError::NotFinite));
        }
        let behind_box = self.received.checked_sub(BOX);
        let exponents = self.terms.as_flattened_mut();
        let exponents = exponents.get_mut(..EXPONENTS * usize::from(self.header.terms)).unwrap_or_default();
        let behind_exponents = behind_box.and_then(|place| place.checked_sub(exponents.len()));
        let room = match (behind_box, behind_exponents) {
            (Some(place), None) => {
                let exponent = number as u8;
                if f64::from(exponent).to_bits() != number.to_bits() || exponent > MAX_EXPONENT {
                    return Err(TransferError::Table(TableError::Exponent));
                }
                (self.came, self.kept) = (over_byte(self.came, exponent), over_byte(self.kept, exponent));
                if let Some(room) = exponents.get_mut(place) {
                    *room = exponent;
                }
                return Ok(());
            }
            (_, Some(place)) => self.coefficients.as_flattened_mut().get_mut(place),
            (None, None) => self.limits.get_mut(self.received),
        };
        let rounded = T::from_f64(number);
        self.came = over_numbers(self.came, &[number]);
        self.kept = over_numbers(self.kept, &[rounded.to_f64()]);
        if let Some(room) = room {
            *room = rounded;
        }
        Ok(())
    }

    /// Of the table that is expected or has come; without one that of an empty table.
    pub fn header(&self) -> &TableHeader {
        &self.header
    }

    /// How many numbers have come of it.
    pub fn received(&self) -> usize {
        self.received
    }

    /// Checks what has come: all of it, what was announced, a table, and in memory as it came. It may be put into service then.
    ///
    /// # Errors
    /// What is wrong. The buffer is empty then.
    pub fn finish(&mut self) -> Result<(), TransferError> {
        let finished = self.check();
        self.state = if finished.is_ok() { State::Whole } else { State::Empty };
        finished
    }

    fn check(&self) -> Result<(), TransferError> {
        if self.state != State::Filling || self.received != self.header.numbers() {
            return Err(TransferError::NumberCount);
        }
        if self.came != self.header.table {
            return Err(TransferError::Checksum);
        }
        let CorrectionTable { basis, diagonal, factor } = self.laid_out();
        let coefficients = diagonal.iter().chain(factor.unwrap_or_default());
        // in `f32` what came finite may be infinite, and a width that was above 0 may not be
        if !self.limits.iter().chain(coefficients).all(|number| number.is_finite()) {
            return Err(TransferError::Table(TableError::NotFinite));
        }
        if !basis.half_width.iter().all(|half_width| *half_width > T::ZERO) {
            return Err(TransferError::Table(TableError::EmptyBox));
        }
        if self.in_memory() == self.kept { Ok(()) } else { Err(TransferError::Memory) }
    }

    /// The table that has come whole.
    #[inline]
    pub fn table(&self) -> Option<CorrectionTable<'_, T>> {
        (self.state == State::Whole).then(|| self.laid_out())
    }

    /// What looks through the table each period while it is in service.
    pub fn watch(&self) -> Option<TableWatch> {
        (self.state == State::Whole).then(|| TableWatch::new(self.kept))
    }

    /// Whether there is a table and the memory still holds it as it came: computes its checksum again. For a controller that asks from
    /// time to time, outside of its periods.
    pub fn is_intact(&self) -> bool {
        self.state == State::Whole && self.in_memory() == self.kept
    }

    fn in_memory(&self) -> u64 {
        let CorrectionTable { basis: Basis { centre, half_width, terms }, diagonal, factor } =
            black_box(self).laid_out();
        let numbers = |hash, numbers: &[T]| numbers.iter().fold(hash, |hash, n| over_numbers(hash, &[n.to_f64()]));
        let hash = numbers(numbers(START, &centre), &half_width);
        let hash = terms.iter().flatten().fold(hash, |hash, exponent| over_byte(hash, *exponent));
        numbers(numbers(hash, diagonal), factor.unwrap_or_default())
    }

    fn laid_out(&self) -> CorrectionTable<'_, T> {
        let count = usize::from(self.header.terms);
        let [a, b, c, d, e, f] = self.limits;
        let terms = self.terms.get(..count).unwrap_or_default();
        let all = self.coefficients.as_flattened();
        let (diagonal, rest) = all.split_at_checked(DIAGONAL_ROWS * count).unwrap_or_default();
        let factor = rest.get(..FACTOR_ENTRIES * count).filter(|_| self.header.factor_form);
        let basis = Basis { centre: [a, b, c], half_width: [d, e, f], terms };
        CorrectionTable { basis, diagonal, factor }
    }
}

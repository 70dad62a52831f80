//! Tables that come while the program runs.

use core::mem::MaybeUninit;
use core::slice;

use pkm_core::correction::{TableBuffer, TableHeader, TableWatch, TransferError};

use crate::pointers::{answer, given, taken};
use crate::{PkmError, PkmTable, pkm_machine_checksum};

/// Most terms of a table that comes while the program runs: all up to the fourth degree.
pub const PKM_TABLE_TERMS: usize = 35;

/// What is said of a table before its numbers.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PkmTableHeader {
    /// Checksum of the machine that it was fitted for, as `pkm_machine_checksum`.
    pub machine: u64,
    /// Its own checksum, as the third assertion of its `coefficients.rs` states it.
    pub table: u64,
    /// Number of terms, 1 to `PKM_TABLE_TERMS`.
    pub terms: u32,
    /// Not 0: it has the factor form as well, which `pkm_table_receive` asks for.
    pub factor_form: i32,
}

/// Room for a table that comes while the program runs.
pub struct PkmTableBuffer<T: 'static> {
    buffer: TableBuffer<T, PKM_TABLE_TERMS>,
    /// Of the buffer, once it is whole.
    table: MaybeUninit<PkmTable<T>>,
}

impl From<TransferError> for PkmError {
    fn from(e: TransferError) -> Self {
        match e {
            TransferError::OtherMachine => Self::OtherMachine,
            TransferError::Checksum | TransferError::Memory => Self::DamagedTable,
            _ => Self::NotATable,
        }
    }
}

/// Looks through the table in service while the program runs, some numbers each period.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PkmTableWatch {
    /// What the table has to sum up to.
    pub expected: u64,
    /// Of the numbers of this round.
    pub sum: u64,
    /// How many they are.
    pub next: u32,
    /// Not 0: found to be damaged, which stays so.
    pub is_damaged: u32,
}

impl PkmTableWatch {
    fn core(self) -> TableWatch {
        let Self { expected, sum, next, is_damaged } = self;
        TableWatch { expected, sum, next, is_damaged: is_damaged != 0 }
    }
}

impl From<TableWatch> for PkmTableWatch {
    fn from(TableWatch { expected, sum, next, is_damaged }: TableWatch) -> Self {
        Self { expected, sum, next, is_damaged: is_damaged.into() }
    }
}

macro_rules! table {
    (
        $t:ident, size $size:ident, align $align:ident, receive $receive:ident,
        watch_begin $watch_begin:ident, watch $watch:ident
    ) => {
        /// Bytes that a buffer for a table takes.
        #[unsafe(no_mangle)]
        pub extern "C" fn $size() -> usize {
            size_of::<PkmTableBuffer<$t>>()
        }

        /// A buffer's address is a multiple of this.
        #[unsafe(no_mangle)]
        pub extern "C" fn $align() -> usize {
            align_of::<PkmTableBuffer<$t>>()
        }

        /// Makes a table of `count` numbers in memory of the caller, of at least as many bytes, `size`, and of the alignment that the
        /// functions above say, and gives its address, which is within that memory. The numbers, in double for float as well:
        /// centre and half width of the box (theta, sigma in rad, z0 in m), three exponents a term, six rows of the diagonal
        /// form of one coefficient a term and 21 of the factor form, as they stand in `coefficients.rs`. They are copied, so that
        /// their memory, which is apart from the buffer, may go.
        ///
        /// The table lasts until its buffer is written, moved or freed. To change tables while a machine runs take two buffers: fill
        /// the one that is not in use, in any thread, and let the controller take the new address between two periods. The other
        /// buffer may be filled when the first period with the new address has begun and no other thread uses the old one: nothing
        /// in the library keeps it. A compensator goes to the new table at its rate limit; without one the command steps.
        ///
        /// Errors: WRONG_SIZE, OTHER_MACHINE, DAMAGED_TABLE (the numbers have another checksum, or the memory does not keep
        /// them), NOT_A_TABLE, NO_FACTOR_FORM (the library needs it). The table that was in the buffer must not be used any more then.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $receive(
            buffer: *mut PkmTableBuffer<$t>,
            size: usize,
            header: *const PkmTableHeader,
            numbers: *const f64,
            count: usize,
            table: *mut *const PkmTable<$t>,
        ) -> PkmError {
            if size < size_of::<PkmTableBuffer<$t>>() {
                return PkmError::WrongSize;
            }
            // SAFETY: the caller's promise; memory that was not written yet is not read
            unsafe {
                answer(table, || {
                    given(buffer.cast::<MaybeUninit<PkmTableBuffer<$t>>>())?;
                    let (header, _) = (given(header)?, given(numbers)?);
                    let terms = u8::try_from(header.terms).map_err(|_| PkmError::NotATable)?;
                    let (machine, checksum) = (header.machine, header.table);
                    let header = TableHeader { machine, table: checksum, terms, factor_form: header.factor_form != 0 };
                    if count != header.numbers() {
                        return Err(PkmError::NotATable);
                    }
                    // most functions could only fail with it, as with one that is compiled in
                    if !header.factor_form {
                        return Err(PkmError::NoFactorForm);
                    }
                    let room = &raw mut (*buffer).buffer;
                    room.write(const { TableBuffer::new() });
                    (*room).begin(&header, pkm_machine_checksum())?;
                    slice::from_raw_parts(numbers, count).iter().try_for_each(|number| (*room).push(*number))?;
                    (*room).finish()?;
                    // for as long as the caller leaves the buffer alone
                    let room: &'static TableBuffer<$t, PKM_TABLE_TERMS> = &*room;
                    let whole = room.table().ok_or(PkmError::NotATable)?;
                    (&raw mut (*buffer).table).cast::<PkmTable<$t>>().write(PkmTable { core: whole, checksum });
                    Ok((&raw const (*buffer).table).cast::<PkmTable<$t>>())
                })
            }
        }

        /// Begins to watch a table, as it is in memory now: after `pkm_verify`, or when it has come. Outside of the periods; it goes
        /// through all of the table.
        ///
        /// Errors: NULL_POINTER, MISALIGNED, no others.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $watch_begin(watch: *mut PkmTableWatch, table: *const PkmTable<$t>) -> PkmError {
            // SAFETY: the caller's promise
            unsafe { answer(watch, || Ok(TableWatch::new(given(table)?.core.checksum()).into())) }
        }

        /// Looks at the next eight numbers of the table that the period uses. A bit that flips in a table of n numbers, 6 + 30 for each
        /// term, is found within 2 (n / 8 + 1) periods, n / 8 rounded down: at the end of the next round where this one has passed it.
        /// Compensate no more then: a compensator whose reading is not `enabled` takes its offset back at its rate.
        ///
        /// Errors: DAMAGED_TABLE, from then on.
        #[must_use]
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $watch(watch: *mut PkmTableWatch, table: *const PkmTable<$t>) -> PkmError {
            // SAFETY: the caller's promise
            let looked = unsafe { taken(watch).and_then(|watch| Ok((watch, given(table)?))) };
            looked.map_or_else(PkmError::from, |(watch, table)| {
                let mut core = watch.core();
                let found = core.look(&table.core);
                *watch = core.into();
                found.map_or_else(PkmError::from, |()| PkmError::Ok)
            })
        }
    };
}

table! {
    f64, size pkm_table_buffer_size_f64, align pkm_table_buffer_align_f64, receive pkm_table_receive_f64,
    watch_begin pkm_table_watch_begin_f64, watch pkm_table_watch_f64
}
table! {
    f32, size pkm_table_buffer_size_f32, align pkm_table_buffer_align_f32, receive pkm_table_receive_f32,
    watch_begin pkm_table_watch_begin_f32, watch pkm_table_watch_f32
}

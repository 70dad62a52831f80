//! Tables and weights that come over the line: checked by `main`, put into service between two runs of the task.
//!
//! References to the tables change hands in [`NEXT`] and [`BEFORE`]. The reference of a weight is that of a table, so that a table brings it along. `main` works it out, outside of the task's
//! periods; for that it has a copy of the table in service.

use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::asm::wfi;
use critical_section::Mutex;
use pkm_core::correction::{TableBuffer, TableHeader, TransferError};
use pkm_core::{CorrectionTable, TableError};
use pkm_protocol::{Answer, Carried, Checksum, Code, Fault, Piece, Received as Numbers};

use crate::compensation::Weighed;
use crate::learning::{self, Learning};
use crate::{MAIN_SILENT, coefficients, stop};

/// Most terms of a table that comes over the line: all up to the fourth degree.
const TERMS: usize = 35;

/// A table that came over the line, in either arithmetic.
pub struct Tables {
    pub f32: TableBuffer<f32, TERMS>,
    pub f64: TableBuffer<f64, TERMS>,
}

impl Tables {
    pub const fn new() -> Self {
        Self { f32: TableBuffer::new(), f64: TableBuffer::new() }
    }

    pub fn begin(&mut self, header: &TableHeader) -> Result<(), TransferError> {
        // every pose would be refused with it
        if !header.factor_form {
            return Err(TransferError::Table(TableError::CoefficientCount));
        }
        self.f32.begin(header, coefficients::PARAMETERS.checksum())?;
        self.f64.begin(header, coefficients::PARAMETERS.checksum())
    }

    pub fn take(&mut self, piece: &Piece) -> Result<(), TransferError> {
        if piece.first as usize != self.f64.received() {
            return Err(TransferError::NumberCount);
        }
        for number in piece.numbers.as_slice() {
            self.f32.push(*number)?;
            self.f64.push(*number)?;
        }
        Ok(())
    }

    fn finish(&mut self) -> Result<(), TransferError> {
        self.f32.finish()?;
        self.f64.finish()
    }

    /// Becomes the table that has come whole into another one.
    fn copy(&mut self, from: &Self) -> Result<(), TransferError> {
        self.begin(from.f64.header())?;
        for number in from.f64.table().iter().flat_map(CorrectionTable::numbers) {
            self.f32.push(number)?;
            self.f64.push(number)?;
        }
        self.finish()
    }

    fn is_damaged(&self) -> bool {
        self.f64.table().is_some() && !(self.f32.is_intact() && self.f64.is_intact())
    }

    /// That of the image as long as none has come whole.
    pub fn in_service(tables: Option<&Self>) -> learning::Tables<'_> {
        learning::Tables {
            single: tables.and_then(|tables| tables.f32.table()).unwrap_or(coefficients::TABLE_F32),
            double: tables.and_then(|tables| tables.f64.table()).unwrap_or(coefficients::TABLE_F64),
        }
    }
}

/// To be put into service at the beginning of a run: a table, a weight, or both.
#[derive(Default)]
pub struct Next {
    pub tables: Option<&'static mut Tables>,
    pub weighed: Option<Weighed>,
}

pub static NEXT: Mutex<Cell<Next>> = Mutex::new(Cell::new(Next { tables: None, weighed: None }));
/// It is in service; with what was before it, unless that was the image's.
pub static BEFORE: Mutex<Cell<Option<Option<&'static mut Tables>>>> = Mutex::new(Cell::new(None));

/// Tables and what is learned, of `main`'s side.
pub struct Service {
    /// Checksum of the table in service.
    pub table: u64,
    /// To be filled. Both while the image's table is in service.
    pub spare: [Option<&'static mut Tables>; 2],
    /// A copy of the table in service; without a table while that is the image's.
    pub copy: Option<&'static mut Tables>,
    /// The weight that was taken last.
    pub carried: Option<Carried>,
    pub learning: Learning,
}

impl Service {
    /// Lets a table begin or go on, and tells what there is of it.
    pub fn fill(&mut self, with: impl FnOnce(&mut Tables) -> Result<(), TransferError>) -> Answer<'static, f64> {
        let Some(spare) = &mut self.spare[0] else { return Answer::Error(Code::Table) };
        if let Err(e) = with(spare) {
            return Answer::Error(e.into());
        }
        let (numbers, of) = (spare.f64.received(), spare.f64.header().numbers());
        Answer::Received(Numbers { numbers: numbers as u32, of: of as u32 })
    }

    /// Has a weight compensated, from the beginning of the next run on.
    pub fn carry(&mut self, carried: &Carried) -> Answer<'static, f64> {
        if self.copy.as_ref().is_none_or(|copy| copy.is_damaged()) {
            stop(Fault::SelfTest);
        }
        match Weighed::new(&Tables::in_service(self.copy.as_deref()).models(), carried) {
            Ok(weighed) => {
                self.carried = Some(*carried);
                critical_section::with(|cs| NEXT.borrow(cs).set(Next { tables: None, weighed: Some(weighed) }));
                Answer::Carried(Checksum(self.table))
            }
            Err(e) => Answer::Error(e.into()),
        }
    }

    /// Puts the table that has come into service, from the beginning of the next run on, with the reference of the weight by this table.
    pub fn swap(&mut self) -> Answer<'static, f64> {
        let weighed = match self.finish() {
            Ok(weighed) => weighed,
            Err(code) => return Answer::Error(code),
        };
        self.table = self.spare[0].as_ref().map_or(0, |spare| spare.f64.header().table);
        let tables = self.spare[0].take();
        critical_section::with(|cs| NEXT.borrow(cs).set(Next { tables, weighed }));
        let before = loop {
            if let Some(before) = critical_section::with(|cs| BEFORE.borrow(cs).take()) {
                break before;
            }
            MAIN_SILENT.store(0, Relaxed);
            wfi();
        };
        self.spare[0] = before.or_else(|| self.spare[1].take());
        Answer::Swapped(Checksum(self.table))
    }

    /// Checks the table that has come, and gives the weight with its reference by this table.
    fn finish(&mut self) -> Result<Option<Weighed>, Code> {
        let spare = self.spare[0].as_mut().ok_or(Code::Order)?;
        spare.finish()?;
        let tables = Tables::in_service(Some(spare));
        let weighed = self.carried.map(|carried| Weighed::new(&tables.models(), &carried)).transpose()?;
        // what was whole just now is not any more
        if self.copy.as_mut().is_none_or(|copy| copy.copy(spare).is_err()) {
            stop(Fault::SelfTest);
        }
        Ok(weighed)
    }
}

//! Tables that come over the line: filled and checked by `main`, put into service between two runs of the task.

use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::asm::wfi;
use critical_section::Mutex;
use pkm_core::correction::{TableBuffer, TableHeader, TransferError};
use pkm_protocol::{Answer, Checksum, Code, Piece, Received as Numbers};

use crate::learning::Learning;
use crate::{MAIN_SILENT, coefficients};

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
}

/// To be put into service at the beginning of a run.
pub static NEXT: Mutex<Cell<Option<&'static mut Tables>>> = Mutex::new(Cell::new(None));
/// It is in service; with what was before it, unless that was the image's.
pub static BEFORE: Mutex<Cell<Option<Option<&'static mut Tables>>>> = Mutex::new(Cell::new(None));

/// Tables and what is learned, of `main`'s side.
pub struct Service {
    /// Checksum of the table in service.
    pub table: u64,
    /// To be filled. Both while the image's table is in service.
    pub spare: [Option<&'static mut Tables>; 2],
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

    /// Puts the table that has come into service, from the beginning of the next run on.
    pub fn swap(&mut self) -> Answer<'static, f64> {
        let done = self.spare[0].as_mut().map_or(Err(TransferError::NumberCount), |spare| spare.finish());
        if let Err(e) = done {
            return Answer::Error(e.into());
        }
        self.table = self.spare[0].as_ref().map_or(0, |spare| spare.f64.header().table);
        critical_section::with(|cs| NEXT.borrow(cs).set(self.spare[0].take()));
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
}

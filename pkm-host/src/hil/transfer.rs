//! A table to the firmware, which puts it into service while its task runs.

use pkm_core::CorrectionTable;
use pkm_protocol::{Answer, Code, Command, MAX_NUMBERS, Piece, Request, TableNumbers};

use super::link::{Link, shown, written};
use crate::error::{Failure, Result};

/// Sends the table of a machine.
pub(super) fn send(link: &mut Link, machine: u64, table: &CorrectionTable<'_, f64>) -> Result<()> {
    let header = table.header(machine);
    ask(link, Command::Table(header))?;
    let numbers: Vec<f64> = table.numbers().collect();
    for (piece, first) in numbers.chunks(MAX_NUMBERS).zip((0..).step_by(MAX_NUMBERS)) {
        if let Some(numbers) = TableNumbers::new(piece) {
            ask(link, Command::Numbers(Piece { first, numbers }))?;
        }
    }
    ask(link, Command::Swap)
}

fn ask(link: &mut Link, command: Command) -> Result<()> {
    let line = written(&Request { id: 0, command });
    link.send(&line)?;
    let reply = link.reply(&line)?;
    let refused = |why: &str| Err(Failure::input(format!("the firmware refuses the table: {why}")).in_file(&link.name));
    match link.parsed::<f64>(&reply)?.answer {
        Answer::Received(_) | Answer::Swapped(_) => Ok(()),
        Answer::Error(Code::OtherMachine) => {
            refused("it was built for another machine than --machine; build it with the coefficients.rs of this one")
        }
        Answer::Error(Code::Table) => refused(
            "the table has no factor form, the firmware no room for so many terms, or numbers came to harm on their way",
        ),
        Answer::Error(Code::Order) => refused("a part of it is missing, or another program speaks to the firmware"),
        _ => Err(link.failed(format!("not what a table is answered with: {}", shown(&reply)))),
    }
}

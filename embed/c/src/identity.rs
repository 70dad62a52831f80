//! Which library this is, and of which machine.

use core::ffi::c_char;

use crate::coefficients;

/// Version of the library. A library goes with the header of its version, `PKM_VERSION`: compare them when the program starts.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

/// Checksum of the compiled-in machine, as its `coefficients.rs` states it (`checksum() == 0x...`). Compare it, the
/// wrist's and the table's when the program starts: a library that was built without PKM_COEFFICIENTS has the reference
/// machine.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_machine_checksum() -> u64 {
    const { coefficients::PARAMETERS.checksum() }
}

/// Checksum of the compiled-in wrist, as its `coefficients.rs` states it: the machine's does not cover it.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_wrist_checksum() -> u64 {
    const { coefficients::WRIST.checksum() }
}

/// Checksum of the compiled-in table, as its `coefficients.rs` and `coefficients.json` state it.
#[unsafe(no_mangle)]
pub extern "C" fn pkm_table_checksum() -> u64 {
    const { coefficients::TABLE_F64.checksum() }
}

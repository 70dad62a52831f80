//! The core for a page: [`pkm_view`] over numbers in the module's memory.
//!
//! The page writes its numbers to [`input`], calls a function, and reads from [`output`], or the text at [`text`] where the function
//! returns 0. What the numbers are is said in `pkm-view`; nothing is computed here.

#![cfg_attr(target_arch = "wasm32", no_std)]

use core::cell::UnsafeCell;

use pkm_view::{ANSWER_NUMBERS, MACHINE_NUMBERS, REQUEST_NUMBERS, Request, START, TABLE_NUMBERS, TEXTS, Text, View};

/// A page has no room for more than its longest input.
const INPUT: usize = if MACHINE_NUMBERS > TABLE_NUMBERS { MACHINE_NUMBERS } else { TABLE_NUMBERS };

struct Memory {
    view: Option<View>,
    input: [f64; INPUT],
    output: [f64; ANSWER_NUMBERS],
    texts: [Text; TEXTS],
    checksum: u64,
}

struct Shared(UnsafeCell<Memory>);

// SAFETY: a WebAssembly module without shared memory has one thread
unsafe impl Sync for Shared {}

static MEMORY: Shared = Shared(UnsafeCell::new(Memory {
    view: None,
    input: [0.0; INPUT],
    output: [0.0; ANSWER_NUMBERS],
    texts: [Text::EMPTY; TEXTS],
    checksum: START,
}));

fn memory() -> &'static mut Memory {
    // SAFETY: one thread, and no function here calls another that asks for it again
    unsafe { &mut *MEMORY.0.get() }
}

#[cfg(target_arch = "wasm32")]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}

impl Memory {
    fn taken<const N: usize>(&self, from: usize) -> [f64; N] {
        let mut numbers = [0.0; N];
        for (to, value) in numbers.iter_mut().zip(self.input.iter().skip(from)) {
            *to = *value;
        }
        numbers
    }

    fn said<const N: usize>(&mut self, result: Result<[f64; N], Text>) -> u32 {
        self.texts = [Text::EMPTY; TEXTS];
        match result {
            Ok(numbers) => {
                for (to, value) in self.output.iter_mut().zip(numbers) {
                    *to = value;
                }
                1
            }
            Err(text) => {
                self.texts[0] = text;
                0
            }
        }
    }
}

/// Where the page writes numbers.
#[unsafe(no_mangle)]
pub extern "C" fn input() -> *const f64 {
    memory().input.as_ptr()
}

/// Where the page reads numbers.
#[unsafe(no_mangle)]
pub extern "C" fn output() -> *const f64 {
    memory().output.as_ptr()
}

/// Where a text of the last call is, from 0: see `View::texts`.
#[unsafe(no_mangle)]
pub extern "C" fn text(number: usize) -> *const u8 {
    memory().texts.get(number).map_or(core::ptr::null(), |text| text.bytes().as_ptr())
}

/// How many bytes it has.
#[unsafe(no_mangle)]
pub extern "C" fn text_length(number: usize) -> usize {
    memory().texts.get(number).map_or(0, |text| text.bytes().len())
}

/// Takes a machine in; a table that was taken in before stays.
#[unsafe(no_mangle)]
pub extern "C" fn machine() -> u32 {
    let memory = memory();
    let numbers = memory.taken::<MACHINE_NUMBERS>(0);
    let result = match &mut memory.view {
        Some(view) => view.set_machine(&numbers),
        none => View::new(&numbers).map(|view| *none = Some(view)),
    };
    memory.said(result.map(|()| []))
}

/// Takes a table in.
#[unsafe(no_mangle)]
pub extern "C" fn table() -> u32 {
    let memory = memory();
    let numbers = memory.taken::<TABLE_NUMBERS>(0);
    let result = memory.view.as_mut().map_or(Err(Text::EMPTY), |view| view.set_table(&numbers));
    memory.said(result.map(|()| []))
}

/// Answers a request.
#[unsafe(no_mangle)]
pub extern "C" fn solve() -> u32 {
    let memory = memory();
    let request = Request::of(&memory.taken::<REQUEST_NUMBERS>(0));
    let Some(view) = &mut memory.view else { return 0 };
    let solved = view.solve(&request);
    memory.output = *view.answer();
    memory.texts = *view.texts();
    solved.into()
}

/// The configuration of three screw lengths and two angles of the wrist.
#[unsafe(no_mangle)]
pub extern "C" fn forward() -> u32 {
    let memory = memory();
    let (q, beta) = (memory.taken(0), memory.taken(3));
    let result = memory.view.as_ref().map_or(Err(Text::EMPTY), |view| view.forward(q, beta));
    memory.said(result)
}

/// The configuration of a tip and two angles of the wrist.
#[unsafe(no_mangle)]
pub extern "C" fn tip() -> u32 {
    let memory = memory();
    let (tip, beta) = (memory.taken(0), memory.taken(3));
    let result = memory.view.as_ref().map_or(Err(Text::EMPTY), |view| view.tip(tip, beta));
    memory.said(result)
}

/// The configuration with A in a place, all else as in another configuration.
#[unsafe(no_mangle)]
pub extern "C" fn platform() -> u32 {
    let memory = memory();
    let (place, near) = (memory.taken(0), memory.taken(3));
    let result = memory.view.as_ref().map_or(Err(Text::EMPTY), |view| view.platform(place, near));
    memory.said(result)
}

/// The configuration of a tip and an axis near another configuration.
#[unsafe(no_mangle)]
pub extern "C" fn tool() -> u32 {
    let memory = memory();
    let (tip, axis, near) = (memory.taken(0), memory.taken(3), memory.taken(6));
    let result = memory.view.as_ref().map_or(Err(Text::EMPTY), |view| view.tool(tip, axis, near));
    memory.said(result)
}

/// Takes the answers to requests of the fixed sequence, from one number up to another, into the checksum, which number 0 begins
/// anew; the checksum.
#[unsafe(no_mangle)]
pub extern "C" fn sweep(from: u32, to: u32) -> u64 {
    let memory = memory();
    let Some(view) = &mut memory.view else { return 0 };
    let before = if from == 0 { START } else { memory.checksum };
    memory.checksum = view.sweep(before, from, to);
    memory.checksum
}

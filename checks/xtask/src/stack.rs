//! How much stack the core takes: a bound from the call graph of an image, and what a run of it takes.
//!
//! The bound is read from the disassembly, so that it covers the compiler's own routines too: of every function, the sum
//! of all that it takes from the stack pointer; of every chain of calls, the sum of its functions. A call through
//! a pointer, a recursion, or an unknown use of the stack pointer is an error.

use std::collections::BTreeMap;
use std::path::Path;

use crate::image::llvm;
use crate::proofs::{budget, image};
use crate::qemu::boot;
use crate::{Outcome, output};

/// Machine of QEMU, processor, `target-cpu`.
const PROCESSORS: [(&str, &str, Option<&str>); 2] =
    [("mps2-an386", "Cortex-M4F", None), ("mps2-an500", "Cortex-M7", Some("cortex-m7"))];

/// Every public function: bound, measured, and the limit for the deepest.
pub fn run() -> Outcome {
    let mut within = true;
    for (board, processor, cpu) in PROCESSORS {
        let image = image("stack", cpu)?;
        let mut graph = CallGraph::read(&image)?;
        let mut deepest: BTreeMap<String, (u64, String)> = BTreeMap::new();
        println!("{processor:36}   bound  measured  bytes of stack");
        for line in boot(board, &image, &[])?.lines() {
            let [width, name, measured] = line.split(' ').collect::<Vec<_>>()[..] else {
                return Err(format!("not a line of the firmware: {line}"));
            };
            let root = format!("stack::{width}::{name}::h");
            let bound = graph.deepest_from(&root)?;
            println!("{width:5} {name:28} {bound:9} {measured:>9}");
            if measured.parse().map_or(true, |m: u64| m == 0 || m > bound) {
                return Err(format!("{name} took {measured} bytes, more than its bound of {bound}"));
            }
            let most = deepest.entry(width.to_owned()).or_default();
            *most = std::mem::take(most).max((bound, root));
        }
        for width in ["f64", "f32"] {
            let (bound, root) = deepest.remove(width).ok_or(format!("no function in {width}"))?;
            within &= budget(&format!("stack_{width}_bytes"), bound, &format!("{processor}, deepest in {width}"))?;
            for (bytes, function) in graph.chain(&root) {
                println!("{bytes:8} {function}");
            }
        }
    }
    if within { Ok(()) } else { Err("a function takes more stack than its limit".into()) }
}

/// What the linker fills the space between functions with; it reads as a jump.
const PADDING: &str = "d4d4";

/// A function of the image.
#[derive(Default)]
struct Function {
    name: String,
    frame: u64,
    /// Addresses inside functions that it calls or jumps to.
    calls: Vec<u64>,
    /// Why no bound can be given.
    unknown: Option<String>,
    /// Bound of the deepest chain from here, and the function that it goes on with, once known.
    deepest: Option<(u64, Option<u64>)>,
}

/// The functions of an image by their first address.
pub struct CallGraph(BTreeMap<u64, Function>);

impl CallGraph {
    pub fn read(image: &Path) -> Result<Self, String> {
        let text = output(llvm("llvm-objdump")?.args(["-d", "--demangle", "--mcpu=cortex-m7"]).arg(image))?;
        let mut functions = BTreeMap::new();
        let mut current = None;
        for line in text.lines() {
            if let Some((address, name)) = line.strip_suffix(">:").and_then(|l| l.split_once(" <")) {
                let address = u64::from_str_radix(address, 16).map_err(|e| format!("{line}: {e}"))?;
                functions.insert(address, Function { name: name.to_owned(), ..Function::default() });
                current = Some(address);
            } else if let Some(function) = current.and_then(|address| functions.get_mut(&address))
                && let Some((bytes, instruction)) = line.split_once(':').and_then(|(_, l)| l.split_once('\t'))
                && bytes.trim() != PADDING
            {
                function.add(instruction);
            }
        }
        Ok(Self(functions))
    }

    /// Bound of the deepest chain of calls from the function whose name begins so.
    pub fn deepest_from(&mut self, name: &str) -> Result<u64, String> {
        let found = self.0.iter().find(|(_, f)| f.name.starts_with(name)).map(|(address, _)| *address);
        self.deepest(found.ok_or(format!("no function {name} in the image"))?, &mut Vec::new())
    }

    fn deepest(&mut self, address: u64, path: &mut Vec<u64>) -> Result<u64, String> {
        let outside = || format!("a call to {address:#x}, where no function is");
        let (start, function) = self.0.range(..=address).next_back().ok_or_else(outside)?;
        let start = *start;
        if let Some((known, _)) = function.deepest {
            return Ok(known);
        }
        if let Some(instruction) = &function.unknown {
            return Err(format!("{}: no bound with `{instruction}`", function.name));
        }
        if path.contains(&start) {
            return Err(format!("{} calls itself", function.name));
        }
        let (frame, calls) = (function.frame, function.calls.clone());
        path.push(start);
        let mut below = (0, None);
        for call in calls {
            let callee = self.0.range(..=call).next_back().map(|(callee, _)| *callee);
            // unless it is a jump within the function
            if callee != Some(start) || call == start {
                below = below.max((self.deepest(call, path)?, callee));
            }
        }
        path.pop();
        self.0.entry(start).and_modify(|f| f.deepest = Some((frame + below.0, below.1)));
        Ok(frame + below.0)
    }

    /// Frames and names along the deepest chain from a function.
    fn chain(&self, name: &str) -> impl Iterator<Item = (u64, &str)> {
        let first = self.0.values().find(|f| f.name.starts_with(name));
        let next = |f: &&Function| f.deepest.and_then(|(_, callee)| self.0.get(&callee?));
        std::iter::successors(first, next).map(|f| (f.frame, f.name.as_str()))
    }
}

impl Function {
    fn add(&mut self, instruction: &str) {
        let (mnemonic, operands) = instruction.split_once(['\t', ' ']).unwrap_or((instruction, ""));
        let operands = operands.trim();
        let (base, first) = (mnemonic.trim_end_matches(".w"), operands.split(',').next().unwrap_or("").trim());
        let registers = operands.split(',').count() as u64;
        let size = if operands.contains("{d") { 8 } else { 4 };
        let number = operands.rsplit_once('#').and_then(|(_, n)| {
            let n = n.trim_end_matches(['!', ']']).trim_start_matches('-');
            n.strip_prefix("0x").map_or_else(|| n.parse().ok(), |hex| u64::from_str_radix(hex, 16).ok())
        });
        let takes = match base {
            "push" | "vpush" => Some(registers * size),
            "sub" | "subw" if first == "sp" => number,
            "str" | "strd" if operands.contains("[sp, #-") && operands.ends_with('!') => number,
            _ => Some(0),
        };
        match takes {
            Some(bytes) => self.frame += bytes,
            None => self.unknown = Some(instruction.to_owned()),
        }
        match base {
            "push" | "vpush" | "pop" | "vpop" => {}
            "add" | "addw" | "sub" | "subw" | "cmp" if first == "sp" && operands.contains('#') => {}
            "stm" | "ldm" | "vstmia" | "vldmia" if first == "sp" => {}
            "<unknown>" => self.unknown = Some(instruction.to_owned()),
            _ if first.starts_with("sp") || operands.contains("sp!") => self.unknown = Some(instruction.to_owned()),
            // to wherever a register points
            _ if (base.starts_with("blx") || base.starts_with("bx")) && first.starts_with('r') => {
                self.unknown = Some(instruction.to_owned());
            }
            _ if mnemonic.starts_with('b') || mnemonic.starts_with("cb") => {
                let target = operands.split(" <").next().and_then(|o| o.rsplit([' ', ',']).next());
                if let Some(address) = target.and_then(|t| t.strip_prefix("0x"))
                    && let Ok(address) = u64::from_str_radix(address, 16)
                {
                    self.calls.push(address);
                }
            }
            _ => {}
        }
    }
}

//! A bit of what is compiled in is another one: where a module is loaded, and while it runs.

use std::fmt::Write as _;
use std::path::Path;

use super::learning::{Session, place, probing};
use super::replay::Host;
use super::{among_modules, template};
use crate::{Outcome, output};

/// `PKM_ERROR_DAMAGED_TABLE`.
const DAMAGED_TABLE: f64 = 62.0;

/// Checksums of two parts of the self-test in f64, in `pkm-core/src/self_test.rs`: operands of instructions.
const SELF_TEST_KINEMATICS: u64 = 0x21a7_af54_61c6_0ca9;
const SELF_TEST_COMPENSATOR: u64 = 0x89f9_4f46_1920_d43e;

/// Kinematics and feed do not load with a bit of the machine, or of what the self-test knows, flipped in their files.
pub fn refuse_damaged(out: &Path, host: &Host) -> Outcome {
    let (parameters, wrist) = (&host.machine.parameters, &host.machine.wrist_parameters);
    let travel: Vec<u8> = parameters.travel.min_m.iter().flat_map(|number| number.to_le_bytes()).collect();
    let [kinematics, compensator] = [SELF_TEST_KINEMATICS, SELF_TEST_COMPENSATOR].map(u64::to_le_bytes);
    let sums = format!("machine={:016x} wrist={:016x}", parameters.checksum(), wrist.checksum());
    for (component, units) in [("pkmkins", " linear=mm angular=degree"), ("pkmfeed", "")] {
        let module = out.join(format!("modules/{component}.so"));
        let whole = std::fs::read(&module).map_err(|e| e.to_string())?;
        let line = format!("loadrt {component} {sums}{units}\n");
        std::fs::write(out.join("damaged.hal"), line).map_err(|e| e.to_string())?;
        let load = |bytes: &[u8]| {
            std::fs::write(&module, bytes).map_err(|e| e.to_string())?;
            let mut halrun = among_modules(&out.join("modules"), out)?;
            output(halrun.args(["timeout", "60", "halrun", "-f", "damaged.hal"]))
        };
        for (what, says) in [
            (travel.as_slice(), "the machine in memory is damaged"),
            (&kinematics, "the self-test of the kinematics has other bits"),
            (&compensator, "the self-test of the compensator has other bits"),
        ] {
            let mut damaged = whole.clone();
            let places: Vec<usize> =
                whole.windows(what.len()).enumerate().filter(|(_, there)| *there == what).map(|(at, _)| at).collect();
            if places.is_empty() {
                return Err(format!("{component} does not have what this check damages"));
            }
            places.iter().for_each(|at| damaged[at + what.len() / 2] ^= 1);
            match load(&damaged) {
                Err(said) if said.contains(&format!("{component}: {says}")) => {}
                other => return Err(format!("{component} was not refused, {says}: {other:?}")),
            }
        }
        load(&whole)?;
    }
    println!("  a bit of the machine, or of the self-test: pkmkins and pkmfeed are refused where they are loaded");
    Ok(())
}

pub fn flip_bits(out: &Path, host: &Host) -> Outcome {
    let (five, table) = (host.five()?, host.table()?);
    let numbers: Vec<f64> = table.numbers().collect();
    let terms = usize::from(table.header(0).terms);
    // rows of the diagonal form, behind box and exponents
    let row: Vec<u8> = numbers[6 + 3 * terms..][..6 * terms].iter().flat_map(|number| number.to_le_bytes()).collect();
    let session = Session { out, host };
    let lines = place(&five, &probing(host, &five, 1)?)? + "setp pkmcompensator.enable 1\nloadusr -w sleep 2\n";
    let pins: Vec<String> =
        ["fault-code".to_owned()].into_iter().chain((0..5).map(|n| format!("offset-{n}"))).collect();

    let module = out.join("modules/pkmcompensator.so");
    let whole = std::fs::read(&module).map_err(|e| e.to_string())?;
    let at = whole.windows(row.len()).position(|there| there == row).ok_or("the module has no such table")?;
    let mut damaged = whole.clone();
    damaged[at + row.len() / 2] ^= 1;
    let write = |bytes: &[u8]| std::fs::write(&module, bytes).map_err(|e| e.to_string());
    write(&damaged)?;
    let loaded = session.run("", &[]);
    write(&whole)?;
    match loaded {
        Err(said) if said.contains("the table in memory is damaged") => {}
        other => return Err(format!("a module with a flipped bit of its table was not refused: {other:?}")),
    }

    let before = session.run(&lines, &pins)?;
    if !(before[0] == 0.0 && before[1..].iter().any(|offset| offset.abs() > 1e-3)) {
        return Err(format!("expected offsets and no fault: {before:?}"));
    }
    std::fs::write(out.join("flip.py"), template("tests/flip.py")?).map_err(|e| e.to_string())?;
    let hex = row[..32].iter().fold(String::new(), |mut text, byte| {
        write!(text, "{byte:02x}").ok();
        text
    });
    let flip = format!("{lines}loadusr -w python3 flip.py {hex}\nloadusr -w sleep 2\n");
    let after = session.run(&flip, &pins)?;
    if !(after[0] == DAMAGED_TABLE && after[1..].iter().all(|offset| *offset == 0.0)) {
        return Err(format!("expected fault {DAMAGED_TABLE} and no offsets once a bit has flipped: {after:?}"));
    }
    println!("  a bit of the table: refused where the module is loaded; while it runs fault 62, and no offset");
    Ok(())
}

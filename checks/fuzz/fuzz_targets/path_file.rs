//! G-code of `compensate`. A program written with its own places has the same moves.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_core::Wrench;
use pkm_files::gcode::Program;
use pkm_files::path::Toward;
use pkm_fuzz::{assert_finite, file, read};

fuzz_target!(|bytes: &[u8]| {
    let source = file(bytes);
    let Some(program) = read(Program::parse(&source, Some(Wrench::ZERO))) else { return };
    for to in &program.moves {
        assert_finite(to.to.tip_m);
        match to.to.toward {
            Toward::Axis(axis) => assert_finite(axis),
            Toward::Wrist(angles_rad) | Toward::Head(_, angles_rad) => assert_finite(angles_rad),
        }
    }
    // numbers that the six decimals of a program hold
    let plain = |v: f64| v == 0.0 || (1e-3..1e6).contains(&v.abs());
    let holds = program.moves.iter().all(|m| {
        m.to.tip_m.iter().all(|v| plain(v * 1e3))
            && match m.to.toward {
                Toward::Axis(axis) => axis.iter().copied().all(plain),
                Toward::Wrist(angles_rad) | Toward::Head(_, angles_rad) => angles_rad.iter().copied().all(plain),
            }
    });
    if !holds {
        return;
    }
    let mut writer = program.writer();
    program.moves.iter().for_each(|m| writer.push(vec![m.to], false));
    let written = writer.finish(&["note".to_owned()]);
    let again = read(Program::parse(&file(written.as_bytes()), Some(Wrench::ZERO))).expect("what was written");
    assert_eq!(program.moves.len(), again.moves.len());
    for (one, other) in program.moves.iter().zip(&again.moves) {
        let [way, turn] = one.to.apart(&other.to);
        assert!(way < 1e-8 && turn < 1e-5, "{:?} {:?}", one.to, other.to);
        assert_eq!(one.load, other.load);
    }
});

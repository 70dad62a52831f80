//! `pkm-host hil` against stand-ins for a controller, honest and otherwise, behind a pseudo terminal.

#![cfg(unix)]

use std::io::{Read, Write};
use std::sync::Mutex;
use std::thread;
use std::time::Duration;

use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, PARAMETERS, TABLE_F32, TABLE_F64};
use pkm_protocol::{
    Answer, Arithmetic, Checksum, Code, Command, Counters, CycleReply, Hello, Lines, MAX_REPLY, Received, Reply,
    Request, SweepReply, VERSION,
};
use serde_json::Value;
use serialport::{SerialPort, TTYPort};

use crate::common::{refused, run};

/// What is wrong with the controller.
#[derive(Clone, Copy, PartialEq)]
enum Fault {
    None,
    /// The last bit of the first screw length of one cycle, or of a stiffness of each sweep in f64.
    OneBit,
    /// Another table, until it is sent this one.
    Table,
    /// Another table, and no other is taken.
    Fixed,
    /// Takes one bad line for good.
    Lenient,
    /// Its input holds no line of a cycle.
    Small,
    /// Never says anything.
    Silent,
    /// Says something else.
    Noise,
    /// Goes away during the run.
    Unplugged,
}

fn reply(fault: Fault, cycles: u32, bad_lines: u32, request: &Request) -> Vec<u8> {
    let id = Some(request.id);
    let mut buffer = [0; MAX_REPLY];
    let double = |answer| Reply::<f64> { v: VERSION, id, answer }.write(&mut [0; MAX_REPLY]).map(<[u8]>::to_vec);
    let line = match request.command {
        Command::Hello => double(Answer::Hello(Hello {
            firmware: "stand-in",
            board: "none",
            machine: Checksum(PARAMETERS.checksum()),
            table: Checksum(TABLE_F64.checksum() ^ u64::from(matches!(fault, Fault::Table | Fault::Fixed))),
            period_s: 1e-3,
            ticks_hz: 1_000_000,
            travel_min_m: PARAMETERS.travel.min_m,
            travel_max_m: PARAMETERS.travel.max_m,
            max_command_bytes: 512,
            input_bytes: if fault == Fault::Small { 100 } else { 2048 },
            stack_bytes: 4096,
        })),
        Command::Status => double(Answer::Status(Counters { cycles, bad_lines, ..Counters::default() })),
        Command::Cycle(demand) => match demand.arithmetic {
            Arithmetic::F64 => {
                double(Answer::Cycle(CycleReply::new(&demand.cycle(&MACHINE_F64, &TABLE_F64), 40, false)))
            }
            Arithmetic::F32 => {
                let mut cycle = CycleReply::new(&demand.cycle(&MACHINE_F32, &TABLE_F32), 30, false);
                if let Some(numbers) = cycle.numbers.as_mut().filter(|_| fault == Fault::OneBit && cycles == 10) {
                    numbers.q_m[0] = f32::from_bits(numbers.q_m[0].to_bits() ^ 1);
                }
                let reply = Reply { v: VERSION, id, answer: Answer::Cycle(cycle) };
                reply.write(&mut buffer).map(<[u8]>::to_vec)
            }
        },
        Command::Sweep(sweep) => {
            let mut reply = SweepReply::default();
            let mut flips = fault == Fault::OneBit;
            for (step, demand) in sweep.demands().enumerate() {
                let mut cycle = CycleReply::new(&demand.cycle(&MACHINE_F64, &TABLE_F64), 40, step == 3);
                if let Some(numbers) = cycle.numbers.as_mut().filter(|_| flips) {
                    numbers.k[20] = f64::from_bits(numbers.k[20].to_bits() ^ 1);
                    flips = false;
                }
                if demand.arithmetic == Arithmetic::F64 {
                    reply.add(&cycle);
                } else {
                    reply.add(&CycleReply::new(&demand.cycle(&MACHINE_F32, &TABLE_F32), 30, false));
                }
            }
            double(Answer::Sweep(reply))
        }
        Command::Table(_) | Command::Numbers(_) | Command::Swap if fault == Fault::Fixed => {
            double(Answer::Error(Code::OtherMachine))
        }
        Command::Table(header) => double(Answer::Received(Received { numbers: 0, of: header.numbers() as u32 })),
        Command::Numbers(piece) => double(Answer::Received(Received { numbers: piece.first, of: 276 })),
        Command::Swap => double(Answer::Swapped(Checksum(TABLE_F64.checksum()))),
        // it does not learn, and carries nothing
        Command::Weight(_) | Command::Probe(_) | Command::Learned | Command::Save => {
            double(Answer::Error(Code::Command))
        }
    };
    line.expect("fits")
}

fn controller(mut port: TTYPort, mut fault: Fault) {
    let mut lines = Lines::new();
    let (mut cycles, mut bad_lines) = (0, 0);
    let mut bytes = [0; 1024];
    loop {
        let Ok(count) = port.read(&mut bytes) else {
            thread::sleep(Duration::from_millis(1));
            continue;
        };
        for byte in &bytes[..count] {
            let said = match lines.push(*byte) {
                None => continue,
                Some(Ok(request)) => {
                    cycles += u32::from(matches!(request.command, Command::Cycle(_)));
                    let said = reply(fault, cycles, bad_lines, &request);
                    if request.command == Command::Swap {
                        fault = Fault::None;
                    }
                    said
                }
                Some(Err(refused)) => {
                    bad_lines += 1;
                    let answer = if fault == Fault::Lenient {
                        Answer::Status(Counters::default())
                    } else {
                        Answer::Error(refused.code)
                    };
                    let reply = Reply::<f64> { v: VERSION, id: refused.id, answer };
                    reply.write(&mut [0; MAX_REPLY]).expect("fits").to_vec()
                }
            };
            match fault {
                Fault::Silent => continue,
                Fault::Noise => drop(port.write_all(b"\xff\x00 boot: something else\n")),
                Fault::Unplugged if cycles > 20 => return,
                _ => drop(port.write_all(&said)),
            }
        }
    }
}

/// No program may be started while another's terminal is made: it would inherit it.
static ALONE: Mutex<()> = Mutex::new(());

/// Exit code, document on stdout, stderr.
fn hil(fault: Fault, steps: &str) -> (i32, Value, String) {
    hil_with(fault, &["--steps", steps])
}

fn hil_with(fault: Fault, options: &[&str]) -> (i32, Value, String) {
    let _alone = ALONE.lock();
    let (master, slave) = TTYPort::pair().expect("a pseudo terminal");
    let name = slave.name().expect("its name");
    // for the program alone; and an end that it does not inherit, or it would never see it go
    drop(slave);
    let not_inherited = master.try_clone_native().expect("a copy");
    drop(master);
    thread::spawn(move || controller(not_inherited, fault));
    let output = run(&[&["hil", "--port", &name, "--poses", "400", "--seed", "4", "--json"], options].concat());
    let document = serde_json::from_slice(&output.stdout).expect("one document");
    (output.status.code().expect("a code"), document, String::from_utf8_lossy(&output.stderr).into_owned())
}

#[test]
fn an_honest_controller_passes() {
    let (code, document, stderr) = hil(Fault::None, "1");
    assert_eq!(code, 0, "{stderr}");
    assert_eq!(document["differing"], 0);
    assert_eq!((&document["f32"]["cycles"], &document["f64"]["cycles"]), (&200.into(), &200.into()));
    for key in ["f32", "f64"] {
        assert!(document[key]["outside_box"].as_u64() > Some(5) && document[key]["refused"].as_u64() > Some(2));
    }
    assert!(document["bad_lines"].as_u64() > Some(2));
    assert_eq!(document["f64"]["ticks"]["worst"], 40);
}

#[test]
fn sweeps_are_compared_to_the_bit() {
    let (code, document, stderr) = hil(Fault::None, "30");
    assert_eq!(code, 0, "{stderr}");
    // 400 poses are 200 of each kind, in sweeps of 30
    assert_eq!((&document["f32"]["cycles"], &document["f64"]["cycles"]), (&200.into(), &200.into()));
    assert_eq!(document["f64"]["ticks"]["worst"], 40);
    let (code, _, stderr) = hil(Fault::OneBit, "30");
    // all seven sweeps have numbers at that step
    assert!(code == 1 && stderr.contains("7 replies differ"), "{stderr}");
}

#[test]
fn a_table_is_sent_to_firmware_that_has_another() {
    let (code, document, stderr) = hil_with(Fault::Table, &["--send-table"]);
    assert!(code == 0 && document["table_sent"] == true, "{stderr}");
    let (code, document, _) = hil_with(Fault::None, &["--send-table"]);
    assert!(code == 0 && document["table_sent"] == false);
    let (code, document, _) = hil_with(Fault::Fixed, &["--send-table"]);
    let message = document["error"]["message"].as_str().unwrap();
    assert!(code == 2 && message.contains("refuses the table: it was built for another machine"), "{message}");
}

#[test]
fn faults_are_found_and_named() {
    for (fault, code, words) in [
        (Fault::OneBit, 1, "1 replies differ"),
        (Fault::Lenient, 1, "replies differ"),
        (Fault::Table, 2, "PKM_COEFFICIENTS"),
        (Fault::Small, 1, "its input of 100 bytes does not hold a line of"),
        (Fault::Silent, 1, "no answer to hello, heard nothing"),
        (Fault::Noise, 1, "something else"),
        (Fault::Unplugged, 1, "the port is gone"),
    ] {
        let (found, document, stderr) = hil(fault, "1");
        assert!(found == code && stderr.contains(words), "{words}: {found}: {stderr}");
        assert!(document["error"]["message"].as_str().is_some_and(|m| m.contains(words)), "{document}");
    }
}

#[test]
fn missing_things_are_bad_usage_or_input() {
    let _alone = ALONE.lock();
    for (args, words) in [
        (&["--port", "/dev/no-such-port"][..], "cannot open the port"),
        (&["--qemu", "--elf", "no-such.elf"], "no firmware there"),
        (&["--qemu", "--port", "x"], "cannot be used with"),
        (&[], "required"),
    ] {
        let error = refused(&[&["hil"], args].concat());
        assert!(error["message"].as_str().is_some_and(|m| m.contains(words)), "{args:?}: {error}");
    }
}

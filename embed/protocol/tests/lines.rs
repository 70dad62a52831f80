//! Lines there and back, and what is refused: few and quick, so that Miri can run them (`cargo xtask miri`).

use pkm_core::compensator::{self, CarriedWeight, Weight, WeightError};
use pkm_core::correction::{TableHeader, TransferError};
use pkm_core::effects::{Motion, Place};
use pkm_core::estimation::{self, AmplitudeSettings, Estimator, EstimatorSettings, Touch, state_bytes};
use pkm_core::nalgebra::Vector3;
use pkm_core::tables::reference::{MACHINE_F64, TABLE_F64};
use pkm_core::thermal::TemperatureRise;
use pkm_core::{Pose, Wrench};
use pkm_protocol::{
    Alarm, Answer, Arithmetic, Carried, Checksum, Code, Command, Counters, CycleReply, Demand, Fault, Hello, Learned,
    Lines, MAX_COMMAND, MAX_NUMBERS, MAX_REPLY, OffsetFault, Piece, Probe, Received, Refusal, Refused, Reply, Request,
    Status, Sweep, SweepReply, TableNumbers, VERSION, crc32, opened, sealed,
};

const DEMAND: Demand = Demand {
    arithmetic: Arithmetic::F64,
    pose: Pose { theta_rad: 0.1, sigma_rad: -0.05, z0_m: 0.53 },
    wrench_at_tip: Wrench { force_n: Vector3::new(0.0, 0.0, -400.0), moment_nm: Vector3::new(0.0, 0.0, 5.0) },
    tip_m: Vector3::new(0.0, 0.0, 0.3),
    rises_k: [Some(1.5), None, Some(-2.0), Some(0.0)],
};

fn line_of(json: &[u8]) -> Vec<u8> {
    let mut buffer = [json, &[0; 10]].concat();
    sealed(&mut buffer, json.len()).unwrap().to_vec()
}

#[test]
fn a_line_ends_with_its_crc() {
    // the check value of CRC-32 in every catalogue
    assert_eq!(crc32(b"123456789"), 0xcbf4_3926);
    assert_eq!(line_of(b"123456789"), b"123456789*cbf43926\n");
    assert_eq!(opened(b"123456789*cbf43926\r\n"), Some(&b"123456789"[..]));
    assert_eq!(opened(b"123456789*cbf43926"), Some(&b"123456789"[..]));
    for bad in [&b"123456789"[..], b"123456789*CBF43926", b"123456789*cbf4392", b"123456788*cbf43926", b"", b"*"] {
        assert_eq!(opened(bad), None);
    }
    assert_eq!(sealed(&mut [b'1'; 18], 9), None);
    assert_eq!(sealed(&mut [b'1'; 18], 19), None);
}

#[test]
fn commands_come_back() {
    let to = Pose { theta_rad: 0.2, sigma_rad: 0.1, z0_m: 0.55 };
    let sweep = Sweep { from: Demand { arithmetic: Arithmetic::F32, ..DEMAND }, to, steps: 3 };
    assert_eq!(sweep.demands().map(|d| d.pose).next(), Some(DEMAND.pose));
    let header = TableHeader { machine: u64::MAX, table: 1, terms: 64, factor_form: true };
    // the longest there is
    let numbers = TableNumbers::new(&[-1.234_567_890_123_456_7e-300; MAX_NUMBERS]).unwrap();
    assert_eq!(TableNumbers::new(&[0.0; MAX_NUMBERS + 1]), None);
    let refusals = [TransferError::OtherMachine, TransferError::NumberCount, TransferError::Checksum].map(Code::from);
    assert_eq!(refusals, [Code::OtherMachine, Code::Order, Code::Table]);
    let refusals = [
        (WeightError::NotFinite, Code::Range),
        (WeightError::TooHeavy, Code::TooHeavy),
        (WeightError::TooFar, Code::TooFar),
        (WeightError::NoReference(compensator::Fault::OutsideBox), Code::NoReference),
    ];
    assert!(refusals.into_iter().all(|(error, code)| Code::from(error) == code));
    let piece = Piece { first: u32::MAX, numbers };
    let few = Piece { first: 0, numbers: TableNumbers::new(&[]).unwrap() };
    const LONG: f64 = -1.234_567_890_123_456_7e-300;
    let long = Vector3::repeat(LONG);
    let touch = Touch {
        time_s: u32::MAX,
        pose: Pose { theta_rad: LONG, sigma_rad: LONG, z0_m: LONG },
        tip_m: long,
        wrench: Wrench { force_n: long, moment_nm: long },
        rise_k: LONG,
    };
    // the longest demand there is
    let demand = Demand {
        arithmetic: Arithmetic::F64,
        pose: touch.pose,
        wrench_at_tip: touch.wrench,
        tip_m: long,
        rises_k: [Some(LONG); 4],
    };
    let weight = Weight { force_n: long, centre_m: long };
    for command in [
        Command::Cycle(demand),
        Command::Sweep(Sweep { from: demand, to: touch.pose, steps: 10_000 }),
        Command::Weight(Carried { weight, zeroed_at: touch.pose, tip_m: long }),
        Command::Probe(Probe { touch, read_m: [LONG; 3], deviation_m: [LONG; 3] }),
        Command::Learned,
        Command::Save,
        Command::Hello,
        Command::Status,
        Command::Cycle(DEMAND),
        Command::Sweep(sweep),
        Command::Table(header),
        Command::Numbers(piece),
        Command::Numbers(few),
        Command::Swap,
    ] {
        let request = Request { id: u32::MAX, command };
        let mut buffer = [0; MAX_COMMAND + 1];
        let line = request.write(&mut buffer).unwrap();
        assert_eq!(request.write(&mut [0; 20]), None);
        let mut lines = Lines::new();
        let found: Vec<_> = line.iter().filter_map(|byte| lines.push(*byte)).collect();
        assert_eq!(found, [Ok(request)]);
    }
}

#[test]
fn bad_lines_are_refused_and_forgotten() {
    let long = vec![b' '; MAX_COMMAND + 1];
    let bad: [(&[u8], Option<u32>, Code); 20] = [
        (b"{", None, Code::Syntax),
        (b"\xff\"", None, Code::Syntax),
        (br#"{"v":2,"id":01,"cmd":"hello"}"#, None, Code::Syntax),
        (br#"{"v":2,"id":[,1],"cmd":"hello"}"#, None, Code::Syntax),
        (br#"{"v":2,"id":1,"cmd":"hel\u006co"}"#, None, Code::Syntax),
        (br#"{"v":2,"id":1,"cmd":"hello","more":1}"#, None, Code::Field),
        (br#"{"v":2,"id":4294967296,"cmd":"hello"}"#, None, Code::Range),
        (br#"{"v":9,"id":1,"cmd":"hello"}"#, Some(1), Code::Version),
        (br#"{"v":2,"id":1,"cmd":"dance"}"#, Some(1), Code::Command),
        (br#"{"v":2,"id":1,"cmd":"hello","z0_m":1}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"cycle"}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"swap","terms":9}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"table","terms":9}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"numbers","first":0,"numbers":[1e999]}"#, Some(1), Code::Range),
        (br#"{"v":2,"id":1,"cmd":"numbers","first":true,"numbers":[1]}"#, None, Code::Field),
        (br#"{"v":2,"id":1,"cmd":"save","time_s":1}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"probe","time_s":1,"rise_k":0,"theta_rad":0,"sigma_rad":0,"z0_m":1,"force_n":[0,0,0],"moment_nm":[0,0,0],"tip_m":[0,0,0],"read_m":[0,0,0]}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"probe","arithmetic":"f64","time_s":1,"rise_k":0,"theta_rad":0,"sigma_rad":0,"z0_m":1,"force_n":[0,0,0],"moment_nm":[0,0,0],"tip_m":[0,0,0],"read_m":[0,0,0],"deviation_m":[1,1,1]}"#, Some(1), Code::Field),
        (br#"{"v":2,"id":1,"cmd":"probe","time_s":1,"rise_k":0,"theta_rad":0,"sigma_rad":0,"z0_m":1,"force_n":[0,0,0],"moment_nm":[0,0,0],"tip_m":[0,0,0],"read_m":[0,0,1e999],"deviation_m":[1,1,1]}"#, Some(1), Code::Range),
        (
            br#"{"v":2,"id":1,"cmd":"numbers","first":0,"numbers":[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]}"#,
            None,
            Code::Field,
        ),
    ];
    let unsealed: [(&[u8], Code); 4] = [
        (&long, Code::TooLong),
        (br#"{"v":2,"id":1,"cmd":"hello"}"#, Code::Checksum),
        (br#"{"v":2,"id":1,"cmd":"hello"}*00000000"#, Code::Checksum),
        (b"*", Code::Checksum),
    ];
    let bad = bad.map(|(json, id, code)| (line_of(json), id, code)).into_iter();
    let bad = bad.chain(unsealed.map(|(line, code)| ([line, b"\n"].concat(), None, code)));
    let mut lines = Lines::new();
    for (line, id, code) in bad {
        let found: Vec<_> = line.iter().filter_map(|byte| lines.push(*byte)).collect();
        assert_eq!(found, [Err(Refused { id, code })], "{}", String::from_utf8_lossy(&line));
        let next = [b"\r\n".to_vec(), line_of(br#"{"v":2,"id":5,"cmd":"status"}"#)].concat();
        let next: Vec<_> = next.iter().filter_map(|b| lines.push(*b)).collect();
        assert_eq!(next, [Ok(Request { id: 5, command: Command::Status })]);
    }
}

#[test]
fn replies_come_back() {
    let cycle = CycleReply::new(&DEMAND.cycle(&MACHINE_F64, &TABLE_F64), 7312, false);
    assert_eq!(cycle.status, Status::Ok);
    let far = Demand { pose: Pose { z0_m: 9.0, ..DEMAND.pose }, ..DEMAND };
    let refused = CycleReply::new(&far.cycle(&MACHINE_F64, &TABLE_F64), 1, true);
    assert_eq!((refused.status, refused.numbers), (Status::OutOfTravel, None));
    let mut sweep = SweepReply::default();
    sweep.add(&cycle);
    sweep.add(&refused);
    assert_eq!((sweep.ok, sweep.refused, sweep.overruns, sweep.worst_ticks), (1, 1, 1, 7312));
    let hello = Hello {
        firmware: "f 1",
        board: "b",
        machine: Checksum(u64::MAX),
        table: Checksum(1),
        period_s: 1e-3,
        ticks_hz: u32::MAX,
        travel_min_m: [0.1; 3],
        travel_max_m: [1.0; 3],
        max_command_bytes: 1,
        input_bytes: 2,
        stack_bytes: 3,
    };
    let answers = [
        Answer::Hello(hello),
        Answer::Status(Counters { last_fault: Some(Fault::Stack), ..Counters::default() }),
        Answer::Cycle(cycle),
        Answer::Cycle(refused),
        Answer::Sweep(sweep),
        Answer::Received(Received { numbers: 24, of: 276 }),
        Answer::Swapped(Checksum(u64::MAX)),
        Answer::Carried(Checksum(1)),
        Answer::Learned(learned()),
        Answer::Learned(Learned {
            refused: Some(Refusal::WrongSign),
            // the longest there is
            values: TableNumbers::new(&[-1.234_567_890_123_456_7e-300; 8]).unwrap(),
            deviations: TableNumbers::new(&[1.234_567_890_123_456_7e-300; 8]).unwrap(),
            alarms: [Some(Alarm {
                change: -1.234_567_890_123_456_7e-300,
                probability: 0.999_999_999_999_999_9,
                readings: u32::MAX,
            }); 8],
            began_s: u32::MAX,
            time_s: u32::MAX,
            saved: Some(u32::MAX),
            offset_m: [-1.234_567_890_123_456_7e-300; 3],
            fault: Some(OffsetFault::WrenchNotFinite),
            compensated: u32::MAX,
            ..learned()
        }),
        Answer::Error(Code::NotSaved),
    ];
    for answer in answers {
        let reply = Reply { v: VERSION, id: Some(3), answer };
        let mut buffer = [0; MAX_REPLY];
        let line = reply.write(&mut buffer).unwrap();
        assert_eq!(Reply::<f64>::parse(line), Some(reply));
        assert_eq!(Reply::<f64>::parse(&line[1..]), None);
        let later = String::from_utf8(opened(line).unwrap().to_vec()).unwrap().replacen("\"v\":2", "\"v\":9", 1);
        assert_eq!(Reply::<f64>::parse(&line_of(later.as_bytes())), None);
    }
}

/// What the core is given of a line.
#[test]
fn temperatures_and_weights_are_the_cores() {
    let TemperatureRise { limbs_k: [first, second, third], platforms_k } = DEMAND.rise::<f32>();
    assert!(second.is_nan());
    assert_eq!([first, third, platforms_k], [1.5, -2.0, 0.0]);
    let weight = Weight { force_n: Vector3::new(785.1, 1.0, 2.0), centre_m: Vector3::new(0.01, 0.02, 0.1) };
    let zeroed_at = Pose { theta_rad: -0.2, sigma_rad: 0.1, z0_m: 0.52 };
    let carried = Carried { weight, zeroed_at, tip_m: DEMAND.tip_m };
    let own = CarriedWeight::<f64, 3>::new(
        &pkm_core::Model::new(&MACHINE_F64, &TABLE_F64),
        &weight,
        &zeroed_at,
        DEMAND.tip_m,
    );
    assert!(own.is_ok());
    assert_eq!(carried.carried(&MACHINE_F64, &TABLE_F64), own);
    let away = Carried { zeroed_at: Pose { theta_rad: 1.0, ..zeroed_at }, ..carried };
    let outside = WeightError::NoReference(compensator::Fault::OutsideBox);
    assert_eq!(away.carried(&MACHINE_F64, &TABLE_F64), Err(outside));

    use OffsetFault::{Model, Other, OutsideBox, TemperatureLost, WrenchNotFinite, WrenchStuck, WrenchTooLarge};
    let singular = pkm_core::CompensationError::Singular;
    let faults = [
        (compensator::Fault::WrenchNotFinite, WrenchNotFinite),
        (compensator::Fault::WrenchTooLarge, WrenchTooLarge),
        (compensator::Fault::WrenchStuck, WrenchStuck),
        (compensator::Fault::TemperatureLost, TemperatureLost),
        (compensator::Fault::OutsideBox, OutsideBox),
        (compensator::Fault::Correction(pkm_core::CorrectionError::NoFactorForm), Model),
        (compensator::Fault::Compensation(singular), Model),
        (compensator::Fault::Tool(pkm_core::ToolError::Singular), Other),
    ];
    assert!(faults.into_iter().all(|(fault, told)| OffsetFault::from(fault) == told));
}

/// What an estimator knows that has taken in a reading, and refused one.
fn learned() -> Learned {
    let amplitude = estimation::Amplitude::compliance(Place::Body { limb: 2 }, Motion::Axial).unwrap();
    let own = AmplitudeSettings {
        amplitude,
        accepted: 0.0,
        deviation: 1e-9,
        drift_per_day: 0.0,
        least: -1e-9,
        most: 1e-8,
        rate_per_s: 1e-12,
        alarm: 1e-10,
    };
    let mut estimator = Estimator::new(&EstimatorSettings { amplitudes: [own], model_share: 0.0 }).unwrap();
    let Demand { pose, wrench_at_tip: wrench, tip_m, .. } = DEMAND;
    let touch = Touch { time_s: 9, pose, tip_m, wrench, rise_k: 0.0 };
    let seen = DEMAND.cycle(&MACHINE_F64, &TABLE_F64).unwrap().deflection.seen_at(tip_m).translation_m;
    let probe = Probe { touch, read_m: (seen * 1.1).into(), deviation_m: [1e-6; 3] };
    let readings = probe.readings();
    assert_eq!(readings.map(|reading| reading.read), probe.read_m);
    assert_eq!(readings.map(|reading| reading.direction.imax()), [0, 1, 2]);
    estimator.learn(&MACHINE_F64, Some(&TABLE_F64), &touch, &readings).unwrap();
    let old = Touch { time_s: 8, ..touch };
    let refused = estimator.learn(&MACHINE_F64, Some(&TABLE_F64), &old, &readings).unwrap_err();
    let mut state = [0; state_bytes(1)];
    estimator.save(1, 0, &mut state).unwrap();
    let learned = Learned::new(&estimator, &state, Some(refused), None).unwrap();
    let [(value, deviation)] = estimator.values();
    assert_eq!((learned.values.as_slice(), learned.deviations.as_slice()), (&[value][..], &[deviation][..]));
    assert_eq!((learned.began_s, learned.time_s), (9, 9));
    assert_eq!((learned.refused, learned.readings, learned.saved), (Some(Refusal::Backwards), 1, None));
    assert!(deviation < 1e-9 && value != 0.0);
    // FNV-1a over the bytes of `a`
    assert_eq!(Checksum::over(b"a"), Checksum(0xaf63_dc4c_8601_ec8c));
    learned
}

/// What serde-json-core takes for JSON, and what it reads null as.
#[test]
fn replies_are_json() {
    let good = br#"{"v":2,"id":null,"answer":{"hello":{"firmware":"f","board":"b","machine":"0000000000000001","table":"0000000000000002","period_s":0.5,"ticks_hz":1,"travel_min_m":[1,2,3],"travel_max_m":[4,5,6],"max_command_bytes":1,"input_bytes":2,"stack_bytes":3}}}"#;
    assert!(Reply::<f64>::parse(&line_of(good)).is_some());
    let good = std::str::from_utf8(good).unwrap();
    for (from, to) in [
        ("\"f\"", "\"f\0\""),
        ("\"f\"", "\"f\\n\""),
        ("0.5", "null"),
        ("0.5", "1e400"),
        ("[1,2,3]", "[,1,2,3]"),
        ("[1,2,3]", "[01,2,3]"),
        ("[4,5,6]", "[+4,5,6]"),
    ] {
        let bad = good.replacen(from, to, 1);
        assert_eq!(Reply::<f64>::parse(&line_of(bad.as_bytes())), None, "{bad}");
    }
}

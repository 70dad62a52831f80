//! The line protocol: what it refuses, that numbers keep their bits, and that no line is read otherwise than JSON says.

use std::collections::BTreeMap;
use std::fmt::{self, Write};

use fastrand::Rng;
use nalgebra::Vector3;
use pkm_core::compensator::Weight;
use pkm_core::tables::reference::{MACHINE_F32, MACHINE_F64, TABLE_F32, TABLE_F64};
use pkm_core::{Pose, Scalar, Wrench};
use pkm_protocol::{
    Answer, Arithmetic, Carried, Code, Command, Compensated, CycleReply, Demand, Fault, Lines, MAX_COMMAND, MAX_REPLY,
    Numbers, OffsetFault, Refused, Reply, Request, Status, Sweep, VERSION, opened, sealed,
};
use pkm_tests::seeded;
use serde::de::{Deserialize, Deserializer, MapAccess, Visitor};
use serde_json::Value;

/// Of limbs 1, 2, 3 and the platforms.
const RISES: [&str; 4] = ["limb_1_rise_k", "limb_2_rise_k", "limb_3_rise_k", "platforms_rise_k"];
const CYCLE: &str = r#"{"v":2,"id":7,"cmd":"cycle","arithmetic":"f64","theta_rad":0.1,"sigma_rad":-5e-2,"z0_m":0.53,"force_n":[0,-0.0,-4e2],"moment_nm":[1,2,3.5],"tip_m":[0.0,0,0.3]}"#;
const WEIGHT: &str = r#"{"v":2,"id":8,"cmd":"weight","force_n":[785,0,0],"centre_m":[0,0,0.1],"theta_rad":0,"sigma_rad":0,"z0_m":0.53,"tip_m":[0,0,0.3]}"#;

/// An object's pairs in their order, so that doubled names show.
struct Pairs(Vec<(String, Value)>);

impl<'de> Deserialize<'de> for Pairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Collect;
        impl<'de> Visitor<'de> for Collect {
            type Value = Pairs;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }
            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Pairs, M::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(Collect)
    }
}

/// The command of a line as serde_json reads it.
fn judged(line: &[u8]) -> Option<Request> {
    let Pairs(pairs) = serde_json::from_slice(line).ok()?;
    let count = pairs.len();
    let fields: BTreeMap<String, Value> = pairs.into_iter().collect();
    let whole = |name: &str| fields.get(name)?.as_u64();
    let id = u32::try_from(whole("id")?).ok()?;
    let cmd = fields.get("cmd")?.as_str()?;
    let rises = RISES.iter().filter(|name| fields.contains_key(**name)).count();
    let wanted = match cmd {
        "cycle" => 10 + rises,
        "sweep" => 12 + rises,
        "weight" => 9,
        _ => 3,
    };
    if whole("v")? != 2 || fields.len() != count || count != wanted {
        return None;
    }
    let number = |v: &Value| v.as_f64().filter(|v| v.is_finite());
    let one = |name: &str| number(fields.get(name)?);
    let three = |name: &str| -> Option<[f64; 3]> {
        let values: Vec<f64> = fields.get(name)?.as_array()?.iter().map(number).collect::<Option<_>>()?;
        values.try_into().ok()
    };
    let pose = || Some(Pose { theta_rad: one("theta_rad")?, sigma_rad: one("sigma_rad")?, z0_m: one("z0_m")? });
    let command = match cmd {
        "weight" => Command::Weight(Carried {
            weight: Weight { force_n: three("force_n")?.into(), centre_m: three("centre_m")?.into() },
            zeroed_at: pose()?,
            tip_m: three("tip_m")?.into(),
        }),
        "hello" => Command::Hello,
        "status" => Command::Status,
        "cycle" | "sweep" => {
            let mut rises_k = [None; 4];
            for (rise_k, name) in rises_k.iter_mut().zip(RISES) {
                *rise_k = fields.get(name).map(|rise_k| number(rise_k).ok_or(())).transpose().ok()?;
            }
            let demand = Demand {
                arithmetic: match fields.get("arithmetic")?.as_str()? {
                    "f32" => Arithmetic::F32,
                    "f64" => Arithmetic::F64,
                    _ => return None,
                },
                pose: pose()?,
                wrench_at_tip: Wrench { force_n: three("force_n")?.into(), moment_nm: three("moment_nm")?.into() },
                tip_m: three("tip_m")?.into(),
                rises_k,
            };
            if cmd == "cycle" {
                Command::Cycle(demand)
            } else {
                let [theta_rad, sigma_rad, z0_m] = three("to")?;
                let steps = u32::try_from(whole("steps")?).ok().filter(|n| (1..=10_000).contains(n))?;
                Command::Sweep(Sweep { from: demand, to: Pose { theta_rad, sigma_rad, z0_m }, steps })
            }
        }
        _ => return None,
    };
    Some(Request { id, command })
}

/// Equal to the last bit, signs of zeros included.
fn bits(request: &Request) -> (u32, Vec<u64>, String) {
    let (d, to, steps) = match request.command {
        Command::Cycle(demand) => (demand, demand.pose, 1),
        Command::Weight(Carried { weight: Weight { force_n, centre_m }, zeroed_at: at, tip_m }) => {
            let pose = [at.theta_rad, at.sigma_rad, at.z0_m];
            let numbers = [&pose, force_n.as_slice(), centre_m.as_slice(), tip_m.as_slice()].concat();
            return (request.id, numbers.into_iter().map(f64::to_bits).collect(), "weight".into());
        }
        Command::Sweep(Sweep { from, to, steps }) => (from, to, steps),
        _ => return (request.id, Vec::new(), format!("{:?}", request.command)),
    };
    let [from, to] = [d.pose, to].map(|p| [p.theta_rad, p.sigma_rad, p.z0_m]);
    let load = d.wrench_at_tip.to_vector();
    let numbers = [&from, &to, load.as_slice(), d.tip_m.as_slice()].concat();
    let rises = d.rises_k.map(|rise_k| rise_k.map(f64::to_bits));
    (request.id, numbers.into_iter().map(f64::to_bits).collect(), format!("{:?} {steps} {rises:?}", d.arithmetic))
}

/// The JSON of a command's line.
fn written(request: &Request) -> Vec<u8> {
    let mut buffer = [0; MAX_COMMAND + 1];
    opened(request.write(&mut buffer).expect("fits")).expect("sealed").to_vec()
}

fn line_of(json: &[u8]) -> Vec<u8> {
    let mut buffer = [json, &[0; 10]].concat();
    sealed(&mut buffer, json.len()).expect("room").to_vec()
}

/// Any finite number: half of them of any bits, the others as a controller sees them.
fn number(rng: &mut Rng) -> f64 {
    loop {
        let v = match rng.u8(0..6) {
            0..3 => f64::from_bits(rng.u64(..)),
            3 => rng.f64() - 0.5,
            4 => (2000.0 * (rng.f64() - 0.5)).round(),
            _ => [0.0, -0.0, f64::MAX, f64::MIN_POSITIVE, 5e-324, 1e22, 1.7976931348623157e308][rng.usize(..7)],
        };
        if v.is_finite() {
            return v;
        }
    }
}

fn request(rng: &mut Rng) -> Request {
    let mut three = || [number(rng), number(rng), number(rng)];
    let ([theta_rad, sigma_rad, z0_m], force_n, moment_nm, tip_m) = (three(), three(), three(), three());
    let demand = Demand {
        arithmetic: if rng.bool() { Arithmetic::F64 } else { Arithmetic::F32 },
        pose: Pose { theta_rad, sigma_rad, z0_m },
        wrench_at_tip: Wrench { force_n: force_n.into(), moment_nm: moment_nm.into() },
        tip_m: tip_m.into(),
        rises_k: [0; 4].map(|_| rng.bool().then(|| number(rng))),
    };
    let command = match rng.u8(0..9) {
        8 => {
            let weight = Weight { force_n: force_n.into(), centre_m: moment_nm.into() };
            Command::Weight(Carried { weight, zeroed_at: demand.pose, tip_m: demand.tip_m })
        }
        0 => Command::Hello,
        1 => Command::Status,
        2..4 => {
            let to = Pose { theta_rad: number(rng), sigma_rad: number(rng), z0_m: number(rng) };
            Command::Sweep(Sweep { from: demand, to, steps: rng.u32(1..=10_000) })
        }
        _ => Command::Cycle(demand),
    };
    Request { id: rng.u32(..), command }
}

#[test]
fn every_bad_line_gets_its_code() {
    let with = |from: &str, to: &str| {
        assert!(CYCLE.contains(from), "{from}");
        CYCLE.replacen(from, to, 1)
    };
    let sweep = |steps: &str| with("}", &format!(r#","to":[0,0,0.5],"steps":{steps}}}"#)).replace("cycle", "sweep");
    let nested = format!(r#"{{"v":2,"id":1,"cmd":{}"#, "[".repeat(400));
    let warm = with("}", r#","limb_2_rise_k":-1.5,"platforms_rise_k":0}"#);
    for good in [CYCLE, WEIGHT, &warm] {
        assert!(judged(good.as_bytes()).is_some(), "{good}");
        assert_eq!(Request::parse(good.as_bytes()).ok(), judged(good.as_bytes()));
    }
    let cases: Vec<(String, Code, Option<u32>)> = [
        ("hello", Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello"} x"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello"}{"v":2}"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello",}"#, Code::Syntax),
        (r#"{,"v":2,"id":1,"cmd":"hello"}"#, Code::Syntax),
        (r#"{"v":2 "id":1,"cmd":"hello"}"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hel\u006co"}"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":{"hello":null}}"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello","theta_rad":null}"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello"#, Code::Syntax),
        (r#"{"v":02,"id":1,"cmd":"hello"}"#, Code::Syntax),
        (r#"[1,1,"hello"]"#, Code::Syntax),
        (r#"{"v":2,"id":1,"cmd":"hello"}}"#, Code::Syntax),
        (r#"{'v':2,"id":1,"cmd":"hello"}"#, Code::Syntax),
        (r#"{v:2,"id":1,"cmd":"hello"}"#, Code::Syntax),
        (&nested, Code::Field),
        ("{}", Code::Field),
        (r#"{"v":2,"id":1}"#, Code::Field),
        (r#"{"v":2,"id":1,"cmd":3}"#, Code::Field),
        (r#"{"v":"2","id":1,"cmd":"hello"}"#, Code::Field),
        (r#"{"v":2,"id":1,"cmd":"hello","more":1}"#, Code::Field),
        (r#"{"v":2,"v":2,"id":1,"cmd":"hello"}"#, Code::Field),
        (r#"{"v":2,"id":4294967296,"cmd":"hello"}"#, Code::Range),
        (r#"{"v":2,"id":-1,"cmd":"hello"}"#, Code::Range),
    ]
    .map(|(line, code)| (line.to_owned(), code, None))
    .into_iter()
    .chain([
        (r#"{"v":9,"id":9,"cmd":"hello"}"#.into(), Code::Version, Some(9)),
        (r#"{"v":2,"id":9,"cmd":"reboot"}"#.into(), Code::Command, Some(9)),
        (r#"{"v":2,"id":9,"cmd":"hello","z0_m":0.5}"#.into(), Code::Field, Some(9)),
        (r#"{"v":2,"id":9,"cmd":"cycle"}"#.into(), Code::Field, Some(9)),
        (with("}", r#","to":[0,0,0.5]}"#), Code::Field, Some(7)),
        (with("}", r#","centre_m":[0,0,0.5]}"#), Code::Field, Some(7)),
        (with("}", r#","limb_4_rise_k":1}"#), Code::Field, None),
        (with("}", r#","limb_1_rise_k":1,"limb_1_rise_k":1}"#), Code::Field, None),
        (with("}", r#","platforms_rise_k":null}"#), Code::Syntax, None),
        (with("}", r#","platforms_rise_k":1e999}"#), Code::Range, Some(7)),
        (WEIGHT.replacen(r#""centre_m":[0,0,0.1],"#, "", 1), Code::Field, Some(8)),
        (WEIGHT.replacen('}', r#","moment_nm":[0,0,0.1]}"#, 1), Code::Field, Some(8)),
        (WEIGHT.replacen('}', r#","limb_1_rise_k":1}"#, 1), Code::Field, Some(8)),
        (WEIGHT.replacen("785", "1e999", 1), Code::Range, Some(8)),
        (WEIGHT.replacen("0.53", "-1e999", 1), Code::Range, Some(8)),
        (with("cycle", "sweep"), Code::Field, Some(7)),
        (sweep("0"), Code::Range, Some(7)),
        (sweep("10001"), Code::Range, Some(7)),
        (sweep("2.0"), Code::Syntax, None),
        (with("0.53", "1e999"), Code::Range, Some(7)),
        (with("3.5", "-1e999"), Code::Range, Some(7)),
        (with("0.53", "NaN"), Code::Syntax, None),
        (with("0.53", "Infinity"), Code::Syntax, None),
        (with("0.53", "null"), Code::Syntax, None),
        (with("0.53", "+0.53"), Code::Syntax, None),
        (with("0.53", "00.53"), Code::Syntax, None),
        (with("0.53", ".53"), Code::Syntax, None),
        (with("0.53", "53."), Code::Syntax, None),
        (with("0.53", "5e"), Code::Syntax, None),
        (with("0.53", "-"), Code::Syntax, None),
        (with("0.53", "--0.53"), Code::Syntax, None),
        (with("0.53", "0,53"), Code::Syntax, None),
        (with("0.53", "1_000"), Code::Syntax, None),
        (with("0.53", "530 mm"), Code::Syntax, None),
        (with("0.53", "true"), Code::Range, None),
        (with("[1,2,3.5]", "3.5"), Code::Field, None),
        (with("0.53", "0x1p-1"), Code::Syntax, None),
        (with("0.53", "\"0.53\""), Code::Range, None),
        (with("0.53", "[0.53]"), Code::Range, None),
        (with("[1,2,3.5]", "[,1,2,3.5]"), Code::Syntax, None),
        (with("[1,2,3.5]", "[ ,1 2,3.5]"), Code::Syntax, None),
        (with("[1,2,3.5]", "[1,2,3.5,]"), Code::Syntax, None),
        (with("[1,2,3.5]", "[1,2,3.5,4]"), Code::Syntax, None),
        (with("[1,2,3.5]", "[1,2]"), Code::Field, None),
        (with("[1,2,3.5]", "[1,,2]"), Code::Range, None),
        (with("f64", "f16"), Code::Field, None),
        (with("\"f64\"", "{\"f64\":null}"), Code::Syntax, None),
        (with("\"z0_m\":0.53,", ""), Code::Field, Some(7)),
        (with("\"z0_m\"", "\"theta_rad\""), Code::Field, None),
    ])
    .collect();
    assert!(cases.len() >= 60, "{} kinds", cases.len());
    for (line, code, id) in cases {
        assert_eq!(Request::parse(line.as_bytes()), Err(Refused { id, code }), "{line}");
        assert_eq!(judged(line.as_bytes()).filter(|_| !line.contains('\\')), None, "{line}");
    }
}

#[test]
fn lines_are_found_again_after_anything() {
    let mut lines = Lines::new();
    let mut feed = |bytes: &[u8]| bytes.iter().filter_map(|b| lines.push(*b)).collect::<Vec<_>>();
    let good = line_of(CYCLE.as_bytes());
    let code = |code| vec![Err(Refused { id: None, code })];
    assert_eq!(feed(b"\n \r\n"), []);
    assert_eq!(feed(&CYCLE.as_bytes()[..40]), []);
    assert_eq!(feed(b"\n"), code(Code::Checksum));
    assert_eq!(feed(&[b'x'; MAX_COMMAND]), []);
    assert_eq!(feed(b"\n"), code(Code::Checksum));
    assert_eq!(feed(&line_of(&CYCLE.as_bytes()[..40])), code(Code::Syntax));
    assert_eq!(feed(&[b' '; MAX_COMMAND + 1]), []);
    assert_eq!(feed(b"\n"), code(Code::TooLong));
    assert_eq!(feed(&[b'x'; 100_000]), []);
    assert_eq!(feed(b"\n"), code(Code::TooLong));
    assert_eq!(feed(&[0xff, 0, b'\n']), code(Code::Checksum));
    assert_eq!(feed(&good), [Ok(judged(CYCLE.as_bytes()).expect("good"))]);
}

/// Every flipped bit of a line, and of its CRC.
#[test]
fn a_flipped_bit_is_no_other_command() {
    let line = line_of(CYCLE.as_bytes());
    for bit in 0..8 * (line.len() - 1) {
        let mut damaged = line.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        let mut lines = Lines::new();
        let found: Vec<_> = damaged.iter().filter_map(|b| lines.push(*b)).collect();
        assert!(
            found.iter().all(|found| *found == Err(Refused { id: None, code: Code::Checksum })),
            "{bit}: {found:?}"
        );
        assert!(!found.is_empty());
    }
}

fn cycle_reply<T: Scalar>(numbers: [T; 36]) -> CycleReply<T> {
    let three = |i: usize| [numbers[i], numbers[i + 1], numbers[i + 2]];
    let numbers = Numbers {
        q_m: three(0),
        k: std::array::from_fn(|i| numbers[3 + i]),
        translation_m: three(24),
        rotation_rad: three(27),
        compensated: Compensated { theta_rad: numbers[30], sigma_rad: numbers[31], z0_m: numbers[32], q_m: three(33) },
    };
    CycleReply { status: Status::OutsideBox, ticks: u32::MAX, overrun: false, numbers: Some(numbers) }
}

#[test]
fn numbers_keep_their_bits_both_ways() {
    let mut rng = seeded();
    let mut buffer = [0; MAX_REPLY];
    for n in 0..20_000 {
        let sent = request(&mut rng);
        let line = written(&sent);
        assert_eq!(Request::parse(&line).as_ref().map(bits), Ok(bits(&sent)));

        // the longest that there are at first
        let any = |rng: &mut Rng| if n == 0 { -2.2250738585072014e-308 } else { number(rng) };
        let numbers: [f64; 36] = std::array::from_fn(|_| any(&mut rng));
        let reply = Reply { v: VERSION, id: Some(u32::MAX), answer: Answer::Cycle(cycle_reply(numbers)) };
        let line = reply.write(&mut buffer).expect("fits");
        let Some(Reply { answer: Answer::Cycle(CycleReply { numbers: Some(read), .. }), .. }) =
            Reply::<f64>::parse(line)
        else {
            panic!("{}", String::from_utf8_lossy(line))
        };
        assert!(read.all().map(f64::to_bits).eq(numbers.map(f64::to_bits)));
        let value: Value = serde_json::from_slice(opened(line).expect("sealed")).expect("JSON");
        let k66 = value["answer"]["cycle"]["numbers"]["k"][20].as_f64().expect("a number");
        assert_eq!(k66.to_bits(), numbers[23].to_bits());

        let single: [f32; 36] = std::array::from_fn(|_| {
            loop {
                let v = f32::from_bits(rng.u32(..));
                if v.is_finite() {
                    return v;
                }
            }
        });
        let reply = Reply { v: VERSION, id: None, answer: Answer::Cycle(cycle_reply(single)) };
        let line = reply.write(&mut buffer).expect("fits");
        let Some(Reply { answer: Answer::Cycle(CycleReply { numbers: Some(read), .. }), .. }) =
            Reply::<f32>::parse(line)
        else {
            panic!("{}", String::from_utf8_lossy(line))
        };
        assert!(read.all().map(f32::to_bits).eq(single.map(f32::to_bits)));
    }
}

#[test]
fn a_cycle_that_overflows_has_no_numbers() {
    let pose = Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 };
    let huge = Wrench { force_n: Vector3::repeat(1e300), moment_nm: Vector3::zeros() };
    let single = TABLE_F32.cycle(
        &MACHINE_F32,
        &Pose { theta_rad: 0.1, sigma_rad: 0.0, z0_m: 0.53 },
        &Wrench { force_n: huge.force_n.cast(), moment_nm: Vector3::zeros() },
        Vector3::new(0.0, 0.0, 0.3),
    );
    let reply = CycleReply::new(&single, 1, false);
    assert_eq!((reply.status, reply.numbers), (Status::NotFinite, None));
    let high = Pose { z0_m: 0.9, ..pose };
    let reply = CycleReply::new(&TABLE_F64.cycle(&MACHINE_F64, &high, &huge, Vector3::new(0.0, 0.0, 0.3)), 1, false);
    assert_eq!((reply.status, reply.numbers), (Status::OutOfTravel, None));
}

/// A line that may be anything from good to noise.
fn fuzzed(rng: &mut Rng) -> Vec<u8> {
    let sent = request(rng);
    let mut line = written(&sent);
    if rng.u8(0..4) == 0 {
        line = rebuilt(rng, &line);
    }
    for _ in 0..[0, 0, 1, 1, 2, 8][rng.usize(..6)] {
        let at = rng.usize(..=line.len());
        let to = (at + rng.usize(..20)).min(line.len());
        let token: &[u8] = TOKENS[rng.usize(..TOKENS.len())].as_bytes();
        match rng.u8(0..8) {
            0 => line.truncate(at),
            1 => drop(line.drain(at..to)),
            2 => drop(line.splice(at..at, line[at..to].to_vec())),
            3 => drop(line.splice(at..at, token.iter().copied())),
            4 => drop(line.splice(at..to, token.iter().copied())),
            5 if at < line.len() => line[at] ^= 1 << rng.u8(0..8),
            6 if at < line.len() => line[at] = rng.u8(..),
            _ => {
                let other = written(&request(rng));
                drop(line.splice(at.., other[rng.usize(..other.len())..].to_vec()));
            }
        }
    }
    if rng.u8(0..64) == 0 {
        line = (0..rng.usize(..700)).map(|_| rng.u8(..)).collect();
    }
    line
}

const TOKENS: [&str; 47] = [
    "{",
    "}",
    "[",
    "]",
    ",",
    ":",
    "\"",
    "\\",
    " ",
    "\t",
    "\r",
    "\n",
    "-",
    "+",
    ".",
    "e",
    "E9",
    "0",
    "1e999",
    "-0",
    "00",
    "1.",
    ".5",
    "1e",
    "null",
    "true",
    "NaN",
    "Infinity",
    "\"v\":2",
    "\"id\":1,",
    "\"cmd\":\"hello\"",
    ",\"z0_m\":1",
    "\"f32\"",
    "hello",
    "status",
    "cycle",
    "sweep",
    ",\"to\":[0,0,0.5]",
    ",\"steps\":100",
    "\\u0068",
    "[,1,2,3]",
    "{\"f32\":null}",
    "\u{feff}",
    "/*x*/",
    "1e-400",
    "18446744073709551616",
    "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
];

/// The same fields in another order and dress; some doubled, lost, renamed or of another type.
fn rebuilt(rng: &mut Rng, line: &[u8]) -> Vec<u8> {
    let Pairs(mut pairs) = serde_json::from_slice(line).expect("JSON");
    rng.shuffle(&mut pairs);
    match rng.u8(0..12) {
        0 => drop(pairs.pop()),
        1 => pairs.push(pairs[0].clone()),
        2 => pairs[0].0.push('x'),
        3 => pairs[0].1 = Value::from(rng.u32(..)),
        4 => pairs[0].1 = Value::from("1"),
        5 => pairs[0].1 = Value::Null,
        6 => {
            let value = pairs[0].1.clone();
            pairs[0].1 = Value::from(vec![value.clone(), value]);
        }
        _ => {}
    }
    let mut text = String::from("{");
    for (n, (name, value)) in pairs.iter().enumerate() {
        let mut space = || [" ", "", "", "\t", "\r"][rng.usize(..5)];
        let (a, b, c) = (space(), space(), space());
        let value = match value.as_f64().filter(|v| v.abs() < 1e15 && v.fract() == 0.0) {
            Some(v) if rng.u8(0..4) == 0 => format!("{v:e}"),
            Some(v) if rng.u8(0..4) == 0 => format!("{v:.1}"),
            _ => value.to_string(),
        };
        let _ = write!(text, "{}{a}\"{name}\"{b}:{c}{value}", if n == 0 { "" } else { "," });
    }
    text.push('}');
    text.into_bytes()
}

/// `PKM_LINES` lines, 200,000 if not set.
#[test]
fn no_line_is_read_otherwise_than_json_says() {
    let mut rng = seeded();
    let count = std::env::var("PKM_LINES").map_or(200_000, |n| n.parse::<f64>().expect("a number") as u64);
    let mut lines = Lines::new();
    let mut figures: BTreeMap<String, u64> = BTreeMap::new();
    let mut fed = 0;
    while fed < count {
        let stream = fuzzed(&mut rng);
        for line in stream.split(|b| *b == b'\n') {
            fed += 1;
            let shown = || String::from_utf8_lossy(line).into_owned();
            // one in so many comes as it is, most with their CRC: what is damaged after that is found by it
            let whole = if rng.u8(0..16) == 0 { [line, b"\n"].concat() } else { line_of(line) };
            let (line_feed, bytes) = whole.split_last().expect("a line");
            assert!(bytes.iter().all(|b| lines.push(*b).is_none()), "{}", shown());
            let found = lines.push(*line_feed);
            // names need no escapes, so none are read
            let readable = opened(bytes).is_some() && !line.contains(&b'\\') && bytes.len() <= MAX_COMMAND;
            let expected = judged(line).filter(|_| readable);
            let accepted = found.and_then(Result::ok);
            assert_eq!(accepted.as_ref().map(bits), expected.as_ref().map(bits), "{}", shown());
            if let Some(request) = accepted {
                let again = written(&request);
                assert_eq!(judged(&again).as_ref().map(bits), Some(bits(&request)), "{}", shown());
            }
            let name = match found {
                None => "blank".to_owned(),
                Some(Ok(_)) => "accepted".to_owned(),
                Some(Err(refused)) => format!("{:?}", refused.code),
            };
            *figures.entry(name).or_default() += 1;
        }
    }
    println!("{fed} lines: {figures:?}");
    assert!(figures.len() == 9 && figures.values().all(|n| *n > fed / 100_000), "{figures:?}");
}

/// What the front page of the protocol shows is what it reads, and the words that it lists are all there are.
#[test]
fn the_front_page_is_the_protocol() {
    let page: Vec<&str> =
        include_str!("../../embed/protocol/src/lib.rs").lines().filter_map(|line| line.strip_prefix("//! ")).collect();
    let (replies, commands): (Vec<&str>, Vec<&str>) =
        page.iter().filter(|line| line.starts_with('{')).partition(|line| line.contains("\"answer\""));
    for line in &commands {
        assert!(Request::parse(line.as_bytes()).is_ok(), "{line}");
    }
    let hello = page.iter().find_map(|line| line.split('`').find(|text| text.contains("}*"))).expect("a whole line");
    assert_eq!(opened(hello.as_bytes()), Some(commands[0].as_bytes()));
    for line in &replies {
        assert!(Reply::<f64>::parse(&line_of(line.as_bytes())).is_some(), "{line}");
    }
    assert_eq!((commands.len(), replies.len()), (11, 10));

    // serde's message for a word that is none names all that are
    fn words<T: serde::de::DeserializeOwned>() -> String {
        let message = serde_json::from_str::<T>("\"?\"").err().expect("no such word").to_string();
        message.split('`').skip(3).step_by(2).collect::<Vec<_>>().join(" ")
    }
    for words in [words::<Status>(), words::<Code>(), words::<Fault>(), words::<OffsetFault>()] {
        assert!(page.contains(&words.as_str()), "{words}");
    }
}

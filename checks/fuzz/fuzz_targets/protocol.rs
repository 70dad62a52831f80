//! Lines in both directions. What is taken reads back from what it writes; what is refused does not stick to the next line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_protocol::{Code, Lines, MAX_COMMAND, MAX_REPLY, Reply, Request, opened, sealed};

fn request(line: &[u8]) {
    let Ok(request) = Request::parse(line) else { return };
    let mut buffer = [0; MAX_COMMAND + 1];
    let written = request.write(&mut buffer).expect("every command fits");
    assert_eq!(opened(written).map(Request::parse), Some(Ok(request)));
}

macro_rules! reply {
    ($t:ty, $line:expr) => {
        if let Some(reply) = Reply::<$t>::parse($line) {
            let mut buffer = [0; 4 * MAX_REPLY];
            if let Some(written) = reply.write(&mut buffer) {
                assert_eq!(Reply::<$t>::parse(written), Some(reply));
            }
        }
    };
}

fuzz_target!(|bytes: &[u8]| {
    request(bytes);
    let mut line = [bytes, &[0; 10]].concat();
    let line = sealed(&mut line, bytes.len()).expect("room");
    assert_eq!(opened(line), Some(bytes));
    reply!(f64, line);
    reply!(f32, line);

    let mut lines = Lines::new();
    let found: Vec<_> = bytes.iter().chain(b"\n").filter_map(|byte| lines.push(*byte)).collect();
    let expected = bytes.split(|byte| *byte == b'\n').filter_map(|line| {
        if line.len() > MAX_COMMAND {
            Some(Err(Code::TooLong))
        } else if line.trim_ascii().is_empty() {
            None
        } else {
            Some(opened(line).map_or(Err(Code::Checksum), |json| Request::parse(json).map_err(|refused| refused.code)))
        }
    });
    assert!(found.into_iter().map(|line| line.map_err(|refused| refused.code)).eq(expected));
});

//! A load cell's log, and what readings with times take from it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_files::import::{self, Renames};
use pkm_files::load_log::LoadLog;
use pkm_files::loads::{Options, join};
use pkm_fuzz::{assert_finite, file, read};

/// Times of the seeds, of a day and from the start of a log; a direction each, or a load for a log of components.
const READINGS: [&str; 3] = [
    "pose,theta_deg,sigma_deg,z0_mm,time,force_u,force_v,force_w,dx_um\n\
     P1,0,0,530,2026-03-14 09:26:53,0,0,0,0\n\
     P1,0,0,530,2026-03-14 09:26:59,1,0,0,9\n",
    "pose,theta_deg,sigma_deg,z0_mm,time_s,force_u,force_v,force_w,dx_um\nP1,0,0,530,3,0,0,0,0\nP1,0,0,530,9,1,0,0,9\n",
    "pose,theta_deg,sigma_deg,z0_mm,time_s,fx_n,fy_n,fz_n,dx_um\nP1,0,0,530,3,0,0,0,0\nP1,0,0,530,9,100,0,0,9\n",
];

fuzz_target!(|bytes: &[u8]| {
    let Some(log) = read(LoadLog::parse(file(bytes), &Renames::default(), None)) else { return };
    assert!(!log.samples.is_empty() && log.samples.is_sorted_by_key(|sample| sample.time_s));
    for sample in &log.samples {
        assert_finite(sample.load.into_iter().chain([sample.time_s]));
    }
    let options = Options { window_s: [-1.0, 1.0], clock_s: 0.0, zero_s: None };
    for readings in READINGS {
        let mut timed =
            import::read_timed(file(readings.as_bytes()), &Renames::default()).expect("readings with times");
        if let Some(joined) = read(join(&mut timed.sheet, &log, &options)) {
            assert_finite(joined.zero.into_iter().chain(joined.random));
            assert!(joined.samples[0] > 0 && joined.samples[0] <= joined.samples[1]);
        }
    }
});

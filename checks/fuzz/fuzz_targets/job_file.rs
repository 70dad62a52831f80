//! Job files of `place`. One that is taken is the same job however TOML writes it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_files::job::Job;
use pkm_fuzz::{file, read};

fuzz_target!(|bytes: &[u8]| {
    let source = file(bytes);
    let Some(job) = read(Job::parse(&source)) else { return };
    let table: toml::Table = toml::from_str(source.text().expect("it was read")).expect("it was read");
    let again = read(Job::parse(&file(table.to_string().as_bytes()))).expect("the same keys and values");
    assert_eq!(job.limits, again.limits);
    assert_eq!(job.series.len(), again.series.len());
});

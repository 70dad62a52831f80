//! Machine files. One that is taken is the same machine however TOML writes it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_files::machine::MachineFile;
use pkm_fuzz::{file, read};

fuzz_target!(|bytes: &[u8]| {
    let source = file(bytes);
    let Some(machine) = read(MachineFile::parse(source.clone())) else { return };
    assert!(machine.parameters.check().is_ok());
    let table: toml::Table = toml::from_str(source.text().expect("it was read")).expect("it was read");
    let again = read(MachineFile::parse(file(table.to_string().as_bytes()))).expect("the same keys and values");
    assert_eq!(machine.parameters, again.parameters);
    assert_eq!(machine.wrist_parameters, again.wrist_parameters);
    assert_eq!((machine.name, machine.pose_box, machine.uncertainty), (again.name, again.pose_box, again.uncertainty));
});

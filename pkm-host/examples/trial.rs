//! Scratch.
fn main() {
    for dir in std::env::args().skip(1) {
        let dir = std::path::Path::new(&dir);
        let read = |n: &str| pkm_host::source::Source::read(&dir.join(n)).unwrap();
        let machine = pkm_host::machine_file::MachineFile::parse(read("machine.toml")).unwrap();
        println!("=== {}", dir.display());
        match pkm_host::diagnose::trial(read("measured.csv"), &machine) { Ok(t) => println!("{t}"), Err(e) => println!("{e}") }
    }
}

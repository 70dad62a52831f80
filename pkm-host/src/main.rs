//! The program `pkm-host`. See `--help`.

fn main() -> std::process::ExitCode {
    pkm_host::cli::main()
}

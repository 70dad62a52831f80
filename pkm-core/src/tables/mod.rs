//! Tables written by `pkm-host fit`. Don't edit: run `cargo xtask regenerate`.


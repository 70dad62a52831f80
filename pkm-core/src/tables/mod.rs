//! Tables written by `pkm-host fit`. Don't edit: `cargo xtask regenerate` makes them from the fixtures.

/// The reference machine (`fixtures/machines/reference.toml`), fitted to finite elements at 49 poses
/// (`fixtures/stiffness/fe-l49.csv`) with the paper's terms.
#[rustfmt::skip]
pub mod reference;

//! How far a long computation is. Libraries tell it, the command line draws it.

/// Is told what is being done, how much of it is done, and how much there is: at first that nothing is done, at last that all is.
pub type Progress<'a> = dyn Fn(&str, u64, u64) + Sync + 'a;

/// For callers that show nothing.
pub fn silent(_: &str, _: u64, _: u64) {}

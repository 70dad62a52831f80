//! From a finished result to what people read and controllers compile: pages, charts, generated source.

mod chart;
pub mod compensate;
pub(crate) mod demo;
pub mod drawing;
pub mod export;
pub mod fem;
pub mod fit;
pub mod hil;
pub mod map;
pub(crate) mod page;
mod paper;
mod path3d;
pub mod place;
pub mod plot;
pub mod replay;
pub mod stiffness;
pub(crate) mod verify;
pub mod view;

/// Smallest probability that is written as a number: smaller ones are no longer exact, or 0.
const LEAST_P: f64 = 1e-300;

/// A probability that a test gives, for a cell.
pub(crate) fn p_value(p: f64) -> String {
    if p < LEAST_P { format!("< {LEAST_P:e}") } else { format!("{p:.1e}") }
}

/// The same in a sentence, as `p = 1.2e-5`.
pub(crate) fn p_in_words(p: f64) -> String {
    if p < LEAST_P { format!("p {}", p_value(p)) } else { format!("p = {}", p_value(p)) }
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_probability_that_underflows_is_no_zero() {
        assert_eq!((super::p_value(1.24e-5), super::p_value(0.0)), ("1.2e-5".into(), "< 1e-300".into()));
        assert_eq!((super::p_in_words(0.03), super::p_in_words(1e-310)), ("p = 3.0e-2".into(), "p < 1e-300".into()));
    }
}

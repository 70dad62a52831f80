//! Uncertainties from noise that is itself known from few degrees of freedom: Student's distribution; normal where it counts as known.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT, StudentsTError};

/// From so many degrees of freedom on the distribution is taken as normal: its quantile at 95 % is within 2e-5 of it there, and what
/// computes Student's does not end where they are far more.
const NORMAL_DOF: f64 = 1e5;

/// Student's distribution; none where it is as good as normal.
fn student(dof: Option<f64>) -> Option<Result<StudentsT, StudentsTError>> {
    dof.filter(|dof| *dof < NORMAL_DOF).map(|dof| StudentsT::new(0.0, 1.0, dof))
}

/// By what a standard uncertainty is multiplied so that the truth lies within with a probability, below 1. Infinite where nothing is
/// known of the noise: with no degree of freedom.
pub fn coverage_factor(probability: f64, dof: Option<f64>) -> f64 {
    let upper = 0.5 * (1.0 + probability);
    let Some(student) = student(dof) else { return Normal::standard().inverse_cdf(upper) };
    student.map_or(f64::INFINITY, |student| student.inverse_cdf(upper))
}

/// Probability that a value as many standard uncertainties from 0 as this one, on either side, is nothing but noise: 1 with no degree
/// of freedom.
pub fn two_sided_p(t: f64, dof: Option<f64>) -> f64 {
    let Some(student) = student(dof) else { return 2.0 * Normal::standard().sf(t.abs()) };
    student.map_or(1.0, |student| 2.0 * student.sf(t.abs()))
}

/// Degrees of freedom of a sum of variances, each with its own (Welch and Satterthwaite; GUM, G.4.1). None is known.
pub fn effective_dof(parts: &[(f64, Option<f64>)]) -> Option<f64> {
    let sum: f64 = parts.iter().map(|p| p.0).sum();
    let loss: f64 = parts.iter().filter_map(|(variance, dof)| Some(variance * variance / (*dof)?)).sum();
    (loss > 0.0).then(|| sum * sum / loss)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `verify` weighs a noise of repeats with a declared one, and gets millions of degrees of freedom.
    #[test]
    fn many_degrees_of_freedom_are_as_good_as_normal() {
        for dof in [9.9e4, 1e5, 1e6, 1e8, 1e12, f64::INFINITY] {
            let factor = coverage_factor(0.95, Some(dof));
            assert!((factor / coverage_factor(0.95, None) - 1.0).abs() < 2e-5, "{dof}: {factor}");
            let p = two_sided_p(2.0, Some(dof));
            assert!((p / two_sided_p(2.0, None) - 1.0).abs() < 1e-4, "{dof}: {p}");
        }
    }

    #[test]
    fn factors_are_those_of_the_tables() {
        // GUM, table G.2
        for (dof, k) in [(1.0, 12.706), (3.0, 3.182), (10.0, 2.228), (50.0, 2.009)] {
            assert!((coverage_factor(0.95, Some(dof)) - k).abs() < 2e-3, "{dof}");
            assert!((two_sided_p(k, Some(dof)) - 0.05).abs() < 1e-4, "{dof}");
        }
        assert!((coverage_factor(0.95, None) - 1.96).abs() < 1e-3);
        assert!((two_sided_p(-1.96, None) - 0.05).abs() < 1e-4);
        // nothing known of the noise is not all known of it
        let nothing = effective_dof(&[(1.0, Some(0.0))]);
        assert_eq!((coverage_factor(0.95, nothing), two_sided_p(9.0, nothing)), (f64::INFINITY, 1.0));
    }

    #[test]
    fn degrees_of_freedom_add_up() {
        let both = effective_dof(&[(2.0, Some(8.0)), (2.0, Some(8.0))]).unwrap();
        assert!((both - 16.0).abs() < 1e-12);
        assert_eq!(effective_dof(&[(2.0, Some(8.0)), (0.0, None)]), Some(8.0));
        assert_eq!(effective_dof(&[(1.0, None), (3.0, None)]), None);
    }
}

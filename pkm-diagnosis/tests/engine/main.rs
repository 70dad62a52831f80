//! The statistics against what they are by definition: dense covariance matrices, textbook analysis of variance, models that are
//! really fitted without a reading, simulation; and another machine than the one that the engine was written for.

mod campaign;
mod drift;
mod fits;
mod noise;
mod places;
mod rounding;
mod screening;
mod spring_chain;
mod support;
mod validation;

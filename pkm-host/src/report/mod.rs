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

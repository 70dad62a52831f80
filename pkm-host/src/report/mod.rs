//! From a finished result to what people read: pages, pictures, text, JSON.

pub mod compensate;
pub(crate) mod demo;
pub mod drawing;
pub mod fem;
pub mod fit;
pub mod hil;
pub mod map;
mod paper;
mod path3d;
pub mod place;
pub mod replay;
pub mod stiffness;
pub(crate) mod verify;
pub mod view;

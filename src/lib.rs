//! skylit: triangle meshes and quadrics under skies, traced fast and accurately on the CPU.

// The files of the open-house test say `skylit`, as any program does; its tests of families use them too.
#[cfg(test)]
extern crate self as skylit;

pub mod accel;
pub mod base;
pub mod bench;
pub mod cameras;
pub mod check;
pub mod cli;
pub mod color;
pub mod compare;
pub mod crosscheck;
pub mod error;
pub mod formats;
pub mod image;
pub mod integrators;
pub mod lights;
pub mod materials;
pub mod math;
pub mod memory;
pub mod render;
pub mod report;
pub mod sampler;
pub mod sampling;
pub mod scene;
pub mod shapes;
pub mod skyboxes;
#[cfg(test)]
pub mod testing;
pub mod textures;

pub use error::{Error, Result};

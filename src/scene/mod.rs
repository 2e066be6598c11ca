//! L3: the scene, as plain data and as built.

pub mod desc;

//! L1: the nouns and traits of the house, without implementations. Imports only L0.

pub mod image_data;
pub mod mesh_data;

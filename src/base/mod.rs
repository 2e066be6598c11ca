//! L1: the nouns and traits of the house, without implementations. Imports only L0.

pub mod camera;
pub mod deferred;
pub mod directions;
pub mod geometry;
pub mod hit;
pub mod image_data;
pub mod intersectable;
pub mod lanes;
pub mod light;
pub mod material;
pub mod mesh;
pub mod mesh_data;
pub mod pixel_rect;
pub mod ray;
pub mod registry;
pub mod shape;
pub mod skybox;
pub mod space;
pub mod texture;
pub mod vertex;
pub mod vertices;

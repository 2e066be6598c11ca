//! The one integration-test binary: a module a subject.

mod cli;
mod common;
mod geometry;
mod layers;
mod light;
mod reference;
mod source;

//! The one integration-test binary: a module a subject.

mod cli;
mod layers;
mod source;

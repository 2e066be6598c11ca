//! The one integration-test binary: a module a subject.

mod adaptive;
mod bad_geometry;
mod bad_scenes;
mod classic;
mod cli;
mod common;
mod convert;
mod corpus;
mod crosscheck;
mod each_light;
mod geometry;
mod glass;
mod kernels;
mod layers;
mod light;
mod matches;
mod open_house;
mod outlines;
mod pictures;
mod points;
mod product;
mod reference;
mod seeds;
mod source;
mod unneeded;
mod vertices;

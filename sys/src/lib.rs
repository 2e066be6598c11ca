//! Bindings to Embree; under construction.

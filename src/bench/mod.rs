//! L4: measurements. [`rays`] asks how fast kernels answer rays, and whether they answer alike.

pub mod rays;

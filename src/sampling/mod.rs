//! L0: warps and distributions.

//! L2: lights, one file a kind.

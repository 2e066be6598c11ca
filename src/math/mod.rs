//! L0: geometry and exact arithmetic helpers.

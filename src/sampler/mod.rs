//! L0: stateless sample points.

//! L4: pictures in and out.

//! L4: files to plain scene data, one file a format.

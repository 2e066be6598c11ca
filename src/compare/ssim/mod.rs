//! Structural similarity: Wang et al. 2004, and at several scales 2003.

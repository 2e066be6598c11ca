//! Is one of two pictures biased? Tests over tiles, objects and the whole, from what replicates say of the noise.

//! Judges pictures and schedulers: metrics, the virtual grid and the paper's experiments.

//! Embree 4 by bindgen, and the one safe wrapper over it.

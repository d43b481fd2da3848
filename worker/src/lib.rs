//! Renders tasks for a master on the cores that are free.

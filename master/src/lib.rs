//! Plans a frame, hands out its tasks and delivers the picture by the deadline.

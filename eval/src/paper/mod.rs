//! The paper's results: its [`published`] numbers, and the [`arithmetic`] that they follow.

pub mod arithmetic;
pub mod published;

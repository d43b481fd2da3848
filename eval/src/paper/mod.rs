//! The paper's results, reproduced on the virtual grid.
//!
//! The [`published`] numbers and their [`arithmetic`] stand on one side; on the other an [`experiment`]
//! renders every row and [`judge`]s its pictures. [`claims`] are weighed, and a [`report`] of tables,
//! [`figures`] and [`plot`]s becomes a [`document`], as a page and as Markdown. [`realtime`] runs both
//! algorithms by the clock instead.

pub mod arithmetic;
pub mod claims;
pub mod command;
pub mod document;
pub mod experiment;
pub mod figures;
pub mod judge;
pub mod plot;
pub mod published;
pub mod realtime;
pub mod report;

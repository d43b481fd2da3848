//! What master and workers say to each other: `MessagePack` in length-limited envelopes.
//!
//! [`message`] has the two enums, one per direction; [`bundle`] is how a scene travels; [`envelope`] turns them into bytes and back
//! without any I/O; [`limits`] names every bound, which is checked before memory is taken;
//! [`version`] is the handshake's rule. With the feature `tokio`, [`connection`] carries envelopes
//! over a stream. `docs/protocol.md` says the same for other languages.
//!
//! The types here are the wire's own: master and worker convert them to and from those of
//! `render`, so that neither a renamed field there changes the protocol nor the other way round.

pub mod bundle;
pub mod digest;
pub mod envelope;
pub mod ids;
pub mod limits;
pub mod message;
pub mod radiance;
pub mod settings;
pub mod task;
pub mod version;

mod bounded;

#[cfg(feature = "tokio")]
pub mod connection;

pub use digest::Digest;
pub use ids::{FrameId, WorkerId};
pub use message::{ToMaster, ToWorker};
pub use radiance::Radiance;
pub use task::{Component, Task};

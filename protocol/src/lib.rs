//! What master and workers say to each other: `MessagePack` in length-limited envelopes.
//!
//! [`message`] has the two enums, one per direction; [`bundle`] is how a scene travels; [`envelope`] turns them into bytes and back
//! without any I/O; [`limits`] names every bound, which is checked before memory is taken;
//! [`version`] is the handshake's rule. [`secure`] seals those bytes for who has the same [`key`]. With
//! the feature `tokio`, [`opening`] begins a connection and [`connection`] carries envelopes over it;
//! with `key-file`, [`key_file`] reads and makes the files of keys. `docs/protocol.md` says the same for
//! other languages, `docs/security.md` what all this keeps out.
//!
//! The types here are the wire's own: master and worker convert them to and from those of
//! `render`, so that neither a renamed field there changes the protocol nor the other way round.

pub mod bundle;
pub mod digest;
pub mod envelope;
pub mod ids;
pub mod key;
pub mod limits;
pub mod message;
pub mod radiance;
pub mod secure;
pub mod settings;
pub mod task;
pub mod version;

mod bounded;

#[cfg(feature = "key-file")]
pub mod key_file;

#[cfg(feature = "tokio")]
pub mod connection;
#[cfg(feature = "tokio")]
pub mod opening;

pub use digest::Digest;
pub use ids::{FrameId, WorkerId};
pub use key::{Key, Keys};
pub use message::{ToMaster, ToWorker};
pub use radiance::Radiance;
pub use task::{Component, Task};

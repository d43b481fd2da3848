//! Every bound on what comes from outside, by name. Whoever reads checks them before taking memory.

use std::time::Duration;

use thiserror::Error;

/// Bytes of the length that precedes each payload.
pub const LENGTH_BYTES: usize = 4;

/// What a side says to open a secure channel: four bytes of magic and a Noise message.
pub const OPENING_BYTES: usize = 52;

/// Plain bytes of a record in a secure channel.
pub const RECORD_BYTES: usize = 16 << 10;

/// Keys that are valid at once.
pub const KEYS: usize = 2;

/// A key file.
pub const KEY_FILE_BYTES: usize = 4 << 10;

/// Payload of an envelope before the handshake is done: a `hello`, `welcome` or `refused`.
pub const HANDSHAKE_ENVELOPE_BYTES: u32 = 4 << 10;

/// Payload of any envelope after the handshake.
pub const ENVELOPE_BYTES: u32 = 64 << 20;

/// Nesting of maps and arrays in a payload; the deepest message of today has four.
pub const NESTING: usize = 16;

/// A worker's name, in bytes of UTF-8.
pub const NAME_BYTES: usize = 64;

/// A version text such as `0.1.0 (1234abcd)`.
pub const VERSION_BYTES: usize = 64;

/// The token by which a master knows the worker that it started itself.
pub const TOKEN_BYTES: usize = 128;

/// A reason or an error text; longer ones are shortened by the sender.
pub const TEXT_BYTES: usize = 1024;

/// A whole scene: 40 million triangles or so.
pub const SCENE_BYTES: u64 = 1 << 30;

/// A chunk of a scene, unpacked: 2 ms on a network of 1 Gbit/s, so that control messages never wait for
/// long.
pub const SCENE_CHUNK_BYTES: usize = 256 << 10;

/// Chunks of a scene.
pub const SCENE_CHUNKS: usize = (SCENE_BYTES as usize).div_ceil(SCENE_CHUNK_BYTES);

/// A digest: BLAKE3.
pub const DIGEST_BYTES: usize = 32;

/// Threads of one worker.
pub const SLOTS: u32 = 1024;

/// Workers that one master admits.
pub const WORKERS: usize = 4096;

/// Peers that have connected to a master and not yet been admitted. One more, and the oldest of them
/// has to go.
pub const STRANGERS: usize = 4096;

/// Those of one address, for IPv6 of one network of 2⁶⁴ addresses.
pub const STRANGERS_PER_ADDRESS: usize = 1024;

/// Tasks that a worker may hold or have asked for at once: see [`leases`].
pub const LEASES_PER_SLOT: u32 = 8;

/// Tasks in one `assign`.
pub const TASKS_PER_ASSIGN: usize = 1024;

/// Width or height of the image, in pixels.
pub const IMAGE_SIDE: u32 = 16_384;

/// Pixels of the image.
pub const IMAGE_PIXELS: u64 = 1 << 26;

/// Pixel groups of a frame.
pub const GROUPS: u32 = 1 << 16;

/// Pixels of one group, hence of one result: at 24 bytes each they fit an envelope.
pub const GROUP_PIXELS: u32 = 1 << 21;

/// Light samples per pixel.
pub const SPP: u32 = 1 << 16;

/// VPLs of a frame.
pub const VPLS: u32 = 1 << 20;

/// VPL sets of a frame.
pub const VPL_SETS: u32 = 4096;

/// Bytes of a VPL: position, normal and intensity, three little-endian f32 each.
pub const VPL_BYTES: usize = 36;

/// A `hello` must be there this long after the connection, a `welcome` this long after the `hello`.
pub const HANDSHAKE_WITHIN: Duration = Duration::from_secs(2);

/// The master sends something at least this often: a `ping` if nothing else.
pub const PING_EVERY: Duration = Duration::from_millis(250);

/// A worker that has heard nothing of its master for so long closes the connection and tries again: soon,
/// because a broken link is better replaced than waited for.
pub const MASTER_SILENCE: Duration = Duration::from_millis(1500);

/// A master that has heard nothing of a worker for so long closes the connection.
pub const SILENCE: Duration = Duration::from_secs(3);

/// Tasks that a worker with so many slots may hold or have asked for at once.
pub fn leases(slots: u32) -> u32 {
    slots.saturating_mul(LEASES_PER_SLOT)
}

/// Something was beyond its limit.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{what} is {value}, allowed is {allowed}")]
pub struct LimitError {
    /// The field, as `message.field`.
    pub what: &'static str,
    /// What was sent.
    pub value: String,
    /// What may be sent.
    pub allowed: String,
}

/// Checks a text or byte string that may have up to `limit_bytes`.
pub(crate) fn at_most(what: &'static str, bytes: usize, limit_bytes: usize) -> Result<(), LimitError> {
    if bytes <= limit_bytes {
        return Ok(());
    }
    let (value, allowed) = (format!("{bytes} bytes long"), format!("{limit_bytes} bytes"));
    Err(LimitError { what, value, allowed })
}

/// Checks a count of `1..=limit`.
pub(crate) fn one_to(what: &'static str, value: u32, limit: u32) -> Result<(), LimitError> {
    if (1..=limit).contains(&value) {
        return Ok(());
    }
    Err(LimitError {
        what,
        value: value.to_string(),
        allowed: format!("1 to {limit}"),
    })
}

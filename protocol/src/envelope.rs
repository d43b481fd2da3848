//! Bytes ⇄ messages, without any I/O: a big-endian length of four bytes, then the `MessagePack`.

use std::sync::Arc;

use rmp_serde::decode::Error as MessagePackError;
use serde::Deserialize;
use thiserror::Error;

use crate::limits::{self, HANDSHAKE_ENVELOPE_BYTES, LENGTH_BYTES, LimitError};
use crate::message::Message;

/// Room for the names and numbers of a message, besides its bulk.
const FIELDS_BYTES: usize = 256;

/// Smallest piece that [`Decoder::space`] offers.
const PIECE_BYTES: usize = 16 << 10;

/// What an idle decoder keeps; a larger buffer is given back.
const KEEP_BYTES: usize = 256 << 10;

/// A peer's bytes are no message of this protocol. The connection cannot go on.
#[derive(Debug, Error)]
pub enum EnvelopeError {
    /// The stated length is beyond the limit of this phase.
    #[error("an envelope of {length_bytes} bytes was announced, allowed are {limit_bytes}")]
    TooLong {
        /// The stated length.
        length_bytes: u32,
        /// The limit.
        limit_bytes: u32,
    },
    /// The payload is not `MessagePack` of a known message.
    #[error("not a message of this protocol: {0}")]
    Malformed(String),
    /// A field is beyond its limit.
    #[error(transparent)]
    Limit(#[from] LimitError),
}

/// A message of our own cannot be sent.
#[derive(Debug, Error)]
pub enum EncodeError {
    /// A field is beyond its limit.
    #[error("cannot send a `{name}`: {source}")]
    Limit {
        /// The message.
        name: &'static str,
        /// The field.
        source: LimitError,
    },
    /// All fields are within their limits but not their sum.
    #[error("cannot send a `{name}` of {bytes} bytes, allowed are {limit_bytes}")]
    TooLong {
        /// The message.
        name: &'static str,
        /// Its payload.
        bytes: usize,
        /// The limit.
        limit_bytes: u32,
    },
    /// `MessagePack` has no form for it.
    #[error("cannot write a `{name}` as MessagePack: {reason}")]
    Unwritable {
        /// The message.
        name: &'static str,
        /// Why.
        reason: String,
    },
}

/// A message in its envelope, ready to be written.
pub fn encode<M: Message>(message: &M) -> Result<Vec<u8>, EncodeError> {
    let name = message.name();
    message
        .check()
        .map_err(|source| EncodeError::Limit { name, source })?;
    let mut envelope = Vec::with_capacity(LENGTH_BYTES + FIELDS_BYTES + message.bulk_bytes());
    envelope.extend([0; LENGTH_BYTES]);
    let mut serializer = rmp_serde::Serializer::new(&mut envelope).with_struct_map();
    let written = message.serialize(&mut serializer);
    written.map_err(|error| EncodeError::Unwritable {
        name,
        reason: error.to_string(),
    })?;

    let bytes = envelope.len() - LENGTH_BYTES;
    match u32::try_from(bytes) {
        Ok(length) if length <= limits::ENVELOPE_BYTES => {
            envelope[..LENGTH_BYTES].copy_from_slice(&length.to_be_bytes());
            Ok(envelope)
        }
        _ => Err(EncodeError::TooLong {
            name,
            bytes,
            limit_bytes: limits::ENVELOPE_BYTES,
        }),
    }
}

/// A message in its envelope, encoded once for however many peers it goes to.
#[derive(Clone, Debug)]
pub struct Sealed {
    bytes: Arc<Vec<u8>>,
    is_urgent: bool,
}

impl Sealed {
    /// Encodes a message.
    pub fn new<M: Message>(message: &M) -> Result<Self, EncodeError> {
        Ok(Self {
            bytes: Arc::new(encode(message)?),
            is_urgent: message.is_urgent(),
        })
    }

    /// What goes on the wire.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// See [`Message::is_urgent`].
    pub fn is_urgent(&self) -> bool {
        self.is_urgent
    }
}

/// What a [`Decoder`] makes of the bytes it has.
#[derive(Debug, PartialEq)]
pub enum Decoded<M> {
    /// The next message.
    Message(M),
    /// More bytes are needed, at least so many.
    Incomplete {
        /// Until the length is complete, or the payload.
        missing_bytes: usize,
    },
}

/// Turns bytes as they arrive into messages. Starts with the limit of the handshake.
///
/// ```
/// use protocol::envelope::{Decoded, Decoder, encode};
/// use protocol::message::{Pong, ToMaster};
///
/// let bytes = encode(&ToMaster::Pong(Pong { nonce: 7 }))?;
/// let (first, second) = bytes.split_at(6);
/// let mut decoder = Decoder::new();
/// decoder.push(first);
/// assert!(matches!(decoder.decode::<ToMaster>()?, Decoded::Incomplete { .. }));
/// decoder.push(second);
/// assert_eq!(decoder.decode()?, Decoded::Message(ToMaster::Pong(Pong { nonce: 7 })));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Decoder {
    /// Bytes that arrived are `buffer[start..end]`; what follows is room.
    buffer: Vec<u8>,
    start: usize,
    end: usize,
    limit_bytes: u32,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder for a peer of which nothing is known.
    pub fn new() -> Self {
        Self {
            buffer: Vec::new(),
            start: 0,
            end: 0,
            limit_bytes: HANDSHAKE_ENVELOPE_BYTES,
        }
    }

    /// From now on the peer may send large envelopes.
    pub fn handshake_done(&mut self) {
        self.limit_bytes = limits::ENVELOPE_BYTES;
    }

    /// Whether the peer stopped between two envelopes.
    pub fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Memory held for the peer's bytes. Never more than twice what it sent of an envelope, plus a
    /// constant: who announces much and sends little costs little.
    pub fn held_bytes(&self) -> usize {
        self.buffer.capacity()
    }

    /// Takes bytes that arrived.
    pub fn push(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let space = self.space();
            let (now, later) = bytes.split_at(bytes.len().min(space.len()));
            space[..now.len()].copy_from_slice(now);
            self.filled(now.len());
            bytes = later;
        }
    }

    /// Where the next bytes belong, for reading straight from a socket; never empty.
    ///
    /// While a large envelope is incomplete, only its own bytes are asked for: the next envelope
    /// then begins at the front of the buffer and nothing has to be moved.
    pub fn space(&mut self) -> &mut [u8] {
        let arrived = self.end - self.start;
        if arrived == 0 && self.buffer.len() > KEEP_BYTES {
            self.buffer = Vec::new();
        }
        // Of a peer of which nothing is known, no more than it may say.
        let piece = PIECE_BYTES.min(LENGTH_BYTES + self.limit_bytes as usize);
        let room = self.missing_bytes().min(arrived).max(piece);
        if self.end + room > self.buffer.len() {
            self.buffer.copy_within(self.start..self.end, 0);
            (self.start, self.end) = (0, arrived);
            let grown = (arrived + room).saturating_sub(self.buffer.len());
            self.buffer.reserve_exact(grown);
            self.buffer.resize(self.buffer.len() + grown, 0);
        }
        &mut self.buffer[self.end..self.end + room]
    }

    /// Says that the first `count` bytes of [`Self::space`] now hold what arrived.
    pub fn filled(&mut self, count: usize) {
        debug_assert!(
            count <= self.buffer.len() - self.end,
            "{count} bytes were not offered"
        );
        self.end += count;
    }

    /// The next message, if all of it is there. After an error the stream is of no more use.
    pub fn decode<M: Message>(&mut self) -> Result<Decoded<M>, EnvelopeError> {
        let missing_bytes = self.missing_bytes();
        let Some(length_bytes) = self.announced() else {
            return Ok(Decoded::Incomplete { missing_bytes });
        };
        if length_bytes > self.limit_bytes {
            return Err(EnvelopeError::TooLong {
                length_bytes,
                limit_bytes: self.limit_bytes,
            });
        }
        if missing_bytes > 0 {
            return Ok(Decoded::Incomplete { missing_bytes });
        }
        let payload_start = self.start + LENGTH_BYTES;
        let payload_end = payload_start + length_bytes as usize;
        let message = from_payload(&self.buffer[payload_start..payload_end])?;
        self.start = payload_end;
        if self.is_empty() {
            (self.start, self.end) = (0, 0);
        }
        Ok(Decoded::Message(message))
    }

    /// The length of the payload that is arriving, once it is known.
    fn announced(&self) -> Option<u32> {
        let length = self.buffer[self.start..self.end].first_chunk::<LENGTH_BYTES>()?;
        Some(u32::from_be_bytes(*length))
    }

    /// Bytes until the length is complete, or else the payload.
    fn missing_bytes(&self) -> usize {
        let payload_bytes = self.announced().map_or(0, |length| length as usize);
        (LENGTH_BYTES + payload_bytes).saturating_sub(self.end - self.start)
    }
}

/// Reads one message, which must be the whole payload.
fn from_payload<M: Message>(payload: &[u8]) -> Result<M, EnvelopeError> {
    let mut deserializer = rmp_serde::Deserializer::from_read_ref(payload);
    deserializer.set_max_depth(limits::NESTING);
    let message =
        M::deserialize(&mut deserializer).map_err(|error| EnvelopeError::Malformed(error.to_string()))?;
    message.check()?;
    // Whatever follows the message would be read here; only at the very end is there no marker.
    match bool::deserialize(&mut deserializer) {
        Err(MessagePackError::InvalidMarkerRead(_)) => Ok(message),
        _ => Err(EnvelopeError::Malformed("bytes follow the message".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::{Ping, Pong, ToMaster, ToWorker};

    fn decoded(bytes: &[u8]) -> Result<Decoded<ToMaster>, EnvelopeError> {
        let mut decoder = Decoder::new();
        decoder.push(bytes);
        decoder.decode()
    }

    fn enveloped(payload: &[u8]) -> Vec<u8> {
        let length = u32::try_from(payload.len()).unwrap();
        [&length.to_be_bytes(), payload].concat()
    }

    fn malformed(payload: &[u8]) -> bool {
        matches!(decoded(&enveloped(payload)), Err(EnvelopeError::Malformed(_)))
    }

    const PONG_7: &[u8] = b"\x81\xa4pong\x81\xa5nonce\x07";

    #[test]
    fn a_message_is_a_map_from_its_name_to_its_fields() {
        let bytes = encode(&ToMaster::Pong(Pong { nonce: 7 })).unwrap();
        assert_eq!(bytes, enveloped(PONG_7));
    }

    #[test]
    fn unknown_fields_are_ignored() {
        let payload = b"\x81\xa4pong\x82\xa5nonce\x07\xa3new\x93\x01\x02\x03";
        let expected = Decoded::Message(ToMaster::Pong(Pong { nonce: 7 }));
        assert_eq!(decoded(&enveloped(payload)).unwrap(), expected);
    }

    #[test]
    fn a_length_of_4_gb_is_refused_before_a_byte_of_it_is_stored() {
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        decoder.push(&[0xff; 4]);
        let error = decoder.decode::<ToMaster>().unwrap_err();
        assert!(matches!(
            error,
            EnvelopeError::TooLong {
                length_bytes: u32::MAX,
                ..
            }
        ));
        assert!(
            decoder.held_bytes() <= PIECE_BYTES,
            "{} bytes",
            decoder.held_bytes()
        );
    }

    #[test]
    fn before_the_handshake_only_small_envelopes_are_taken() {
        let large = enveloped(&vec![0xc0; HANDSHAKE_ENVELOPE_BYTES as usize + 1]);
        assert!(matches!(decoded(&large), Err(EnvelopeError::TooLong { .. })));
    }

    #[test]
    fn a_peer_of_which_nothing_is_known_costs_4_kb() {
        let mut decoder = Decoder::new();
        decoder.push(&vec![0; HANDSHAKE_ENVELOPE_BYTES as usize]);
        let held_bytes = decoder.held_bytes();
        assert!(
            held_bytes <= 2 * HANDSHAKE_ENVELOPE_BYTES as usize + LENGTH_BYTES,
            "{held_bytes} bytes"
        );
    }

    #[test]
    fn who_announces_much_and_sends_little_costs_little() {
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        decoder.push(&limits::ENVELOPE_BYTES.to_be_bytes());
        for _ in 0..100 {
            decoder.push(&[0xc0; 1000]);
            assert!(matches!(
                decoder.decode::<ToMaster>(),
                Ok(Decoded::Incomplete { .. })
            ));
        }
        assert!(
            decoder.held_bytes() <= 2 * 100_004 + PIECE_BYTES,
            "{} bytes",
            decoder.held_bytes()
        );
    }

    #[test]
    fn a_large_buffer_is_given_back() {
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        let padding = vec![0; 4 << 20];
        let field = [
            b"\x81\xa4pong\x82\xa5nonce\x07\xa3new\xc6",
            &(4_u32 << 20).to_be_bytes()[..],
        ];
        decoder.push(&enveloped(&[&field.concat()[..], &padding].concat()));
        assert!(matches!(decoder.decode::<ToMaster>(), Ok(Decoded::Message(_))));
        decoder.space();
        assert!(
            decoder.held_bytes() <= PIECE_BYTES,
            "{} bytes",
            decoder.held_bytes()
        );
    }

    #[test]
    fn payloads_that_are_no_message_are_refused() {
        assert!(malformed(b""), "nothing");
        assert!(malformed(b"\xa4pong"), "a name without fields");
        assert!(malformed(b"\x81\xa4pang\x80"), "an unknown name");
        assert!(malformed(b"\x81\xa4pong\x80"), "a missing field");
        assert!(malformed(b"\x81\xa4pong\x81\xa5nonce\xff"), "a negative number");
        assert!(malformed(&[PONG_7, b"\xc0"].concat()), "bytes after the message");
        assert!(
            malformed(&[PONG_7, b"\xc6\xff"].concat()),
            "broken bytes after the message"
        );
        assert!(
            malformed(&[&b"\x81\xa4pong\x82\xa5nonce\x07\xa1x"[..], &[0x91; 100], b"\xc0"].concat()),
            "deep"
        );
    }

    #[test]
    fn a_list_that_claims_four_billion_elements_is_refused() {
        let payload = b"\x81\xa6assign\x82\xa5frame\x01\xa5tasks\xdd\xff\xff\xff\xff";
        let mut decoder = Decoder::new();
        decoder.push(&enveloped(payload));
        assert!(matches!(
            decoder.decode::<ToWorker>(),
            Err(EnvelopeError::Malformed(_))
        ));
    }

    #[test]
    fn many_empty_vpl_sets_do_not_become_much_memory() {
        let empty_sets = vec![[0xc4, 0x00]; limits::VPL_SETS as usize + 1].concat();
        let count = limits::VPL_SETS + 1;
        let start = [b"\x81\xa5frame\x81\xa8vpl_sets\xdd", &count.to_be_bytes()[..]].concat();
        let mut decoder = Decoder::new();
        decoder.handshake_done();
        decoder.push(&enveloped(&[start, empty_sets].concat()));
        let error = decoder.decode::<ToWorker>().unwrap_err().to_string();
        assert!(error.contains("more than"), "{error}");
    }

    #[test]
    fn several_envelopes_in_one_read_come_out_in_order() {
        let mut decoder = Decoder::new();
        for nonce in 0..3 {
            decoder.push(&encode(&ToWorker::Ping(Ping { nonce })).unwrap());
        }
        for nonce in 0..3 {
            assert_eq!(
                decoder.decode().unwrap(),
                Decoded::Message(ToWorker::Ping(Ping { nonce }))
            );
        }
        assert!(decoder.is_empty());
        let missing_bytes = LENGTH_BYTES;
        assert_eq!(
            decoder.decode::<ToWorker>().unwrap(),
            Decoded::Incomplete { missing_bytes }
        );
    }
}

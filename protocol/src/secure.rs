//! The secure channel: Noise with a key that both sides have. Bytes in, bytes out, no I/O.
//!
//! The worker calls, the master answers, with one message each; after that both know that the other
//! has the key, and both have secrets that nobody will ever have who records this and finds the key
//! later. What follows are records: a length and a sealed piece of the stream of envelopes.
//!
//! Source: *The Noise Protocol Framework*, revision 34; the pattern is `NNpsk0`.

use std::fmt;
use std::sync::Arc;

use snow::{Builder, HandshakeState, StatelessTransportState};
use thiserror::Error;

use crate::key::{Key, Keys};
use crate::limits::{OPENING_BYTES, RECORD_BYTES};

/// `NN`: no key but the common one; `psk0`: even the first message needs it. AES is several times as
/// fast as the alternative, `ChaCha20`, on every processor that runs Embree.
const PATTERN: &str = "Noise_NNpsk0_25519_AESGCM_SHA256";

/// What each side begins with; the last byte is the channel's version. As the length of a plain
/// envelope it would be beyond all limits, so that both kinds can be told apart.
pub const MAGIC: [u8; 4] = *b"GLN\x01";

/// A Noise message of the handshake: a public key and the seal of nothing.
const HANDSHAKE_BYTES: usize = OPENING_BYTES - MAGIC.len();

/// The length before a record.
const LENGTH_BYTES: usize = 2;

/// By how much sealing lengthens.
const SEAL_BYTES: usize = 16;

/// The longest record, with its length.
const SEALED_RECORD_BYTES: usize = LENGTH_BYTES + RECORD_BYTES + SEAL_BYTES;

/// Sealed bytes that are read in one call.
const INCOMING_BYTES: usize = 4 * SEALED_RECORD_BYTES;

/// What each side says to open a channel.
pub type Opening = [u8; OPENING_BYTES];

/// A channel cannot be opened, or cannot go on.
#[derive(Debug, Error)]
pub enum SecureError {
    /// What was said is not sealed with any of the keys here.
    #[error("the other side does not have the key")]
    OtherKey,
    /// A record is not sealed with the secret of this connection.
    #[error("something was not sealed for this connection: it is damaged, forged or a repetition")]
    Forged,
    /// A length beyond the limit.
    #[error("a record of {length_bytes} bytes was announced, allowed are {SEAL_BYTES} to {}", RECORD_BYTES + SEAL_BYTES)]
    Length {
        /// The announced length.
        length_bytes: usize,
    },
    /// A mistake of this program, or no random numbers.
    #[error("cannot encrypt: {0}")]
    Broken(snow::Error),
}

/// A worker that has called and waits for the answer.
#[derive(Debug)]
pub struct Caller(HandshakeState);

impl Caller {
    /// Calls a master that has the same key: what to send, in 52 bytes.
    pub fn call(key: &Key) -> Result<(Self, Opening), SecureError> {
        Self::call_by(builder(key)?)
    }

    fn call_by(builder: Builder<'_>) -> Result<(Self, Opening), SecureError> {
        let mut noise = builder.build_initiator().map_err(SecureError::Broken)?;
        let call = said(&mut noise)?;
        Ok((Self(noise), call))
    }

    /// Takes the master's answer. The master has the key if this is no error.
    pub fn answered(mut self, answer: &Opening) -> Result<Channel, SecureError> {
        heard(&mut self.0, answer)?;
        Channel::new(self.0)
    }
}

/// Answers a worker that has one of the keys: what to send. Whether the worker has the key *now*, and
/// has not recorded a call of another, shows in the first record that can be opened.
pub fn answer(call: &Opening, keys: &Keys) -> Result<(Channel, Opening), SecureError> {
    for key in keys.iter() {
        match answer_by(builder(key)?, call) {
            Err(SecureError::OtherKey) => {}
            answered => return answered,
        }
    }
    Err(SecureError::OtherKey)
}

fn answer_by(builder: Builder<'_>, call: &Opening) -> Result<(Channel, Opening), SecureError> {
    let mut noise = builder.build_responder().map_err(SecureError::Broken)?;
    heard(&mut noise, call)?;
    let answer = said(&mut noise)?;
    Ok((Channel::new(noise)?, answer))
}

fn builder(key: &Key) -> Result<Builder<'_>, SecureError> {
    let builder = || {
        Builder::new(PATTERN.parse()?)
            .psk(0, key.secret())?
            .prologue(&MAGIC)
    };
    builder().map_err(SecureError::Broken)
}

/// The next message of the handshake, behind the magic.
fn said(noise: &mut HandshakeState) -> Result<Opening, SecureError> {
    let mut opening = [0; OPENING_BYTES];
    let (magic, message) = opening.split_at_mut(MAGIC.len());
    magic.copy_from_slice(&MAGIC);
    let bytes = noise.write_message(&[], message).map_err(SecureError::Broken)?;
    debug_assert_eq!(bytes, HANDSHAKE_BYTES);
    Ok(opening)
}

/// Takes the other side's message.
fn heard(noise: &mut HandshakeState, opening: &Opening) -> Result<(), SecureError> {
    // The magic is part of what both sides must agree on, and so needs no comparison here.
    let mut nothing = [0; HANDSHAKE_BYTES];
    match noise.read_message(&opening[MAGIC.len()..], &mut nothing) {
        Ok(_) => Ok(()),
        Err(_) => Err(SecureError::OtherKey),
    }
}

/// Both directions of an open channel.
#[derive(Debug)]
pub struct Channel {
    /// For what goes out.
    pub sealer: Sealer,
    /// For what comes in.
    pub opener: Opener,
}

impl Channel {
    fn new(noise: HandshakeState) -> Result<Self, SecureError> {
        let noise = noise.into_stateless_transport_mode();
        let noise = Arc::new(noise.map_err(SecureError::Broken)?);
        let sealer = Sealer {
            noise: Arc::clone(&noise),
            next: 0,
        };
        let opener = Opener {
            noise,
            next: 0,
            incoming: Vec::new(),
            start: 0,
            end: 0,
            record: Vec::new(),
        };
        Ok(Self { sealer, opener })
    }
}

/// Seals what goes out.
pub struct Sealer {
    noise: Arc<StatelessTransportState>,
    /// Number of the next record.
    next: u64,
}

impl Sealer {
    /// Seals bytes of the stream, in as many records as it takes, and puts them behind what is sealed.
    pub fn seal(&mut self, bytes: &[u8], sealed: &mut Vec<u8>) -> Result<(), SecureError> {
        for piece in bytes.chunks(RECORD_BYTES) {
            let length = piece.len() + SEAL_BYTES;
            sealed.extend((length as u16).to_be_bytes());
            let start = sealed.len();
            sealed.resize(start + length, 0);
            let written = self.noise.write_message(self.next, piece, &mut sealed[start..]);
            written.map_err(SecureError::Broken)?;
            self.next += 1;
        }
        Ok(())
    }
}

/// Opens what comes in.
pub struct Opener {
    noise: Arc<StatelessTransportState>,
    /// Number of the next record.
    next: u64,
    /// Sealed bytes that arrived are `incoming[start..end]`; what follows is room.
    incoming: Vec<u8>,
    start: usize,
    end: usize,
    /// The record that was opened last.
    record: Vec<u8>,
}

impl Opener {
    /// Whether the other side stopped between two records.
    pub fn is_empty(&self) -> bool {
        self.start == self.end
    }

    /// Where the next sealed bytes belong; never empty once [`Self::open`] has said that more are needed.
    pub fn space(&mut self) -> &mut [u8] {
        self.incoming.resize(INCOMING_BYTES, 0);
        self.incoming.copy_within(self.start..self.end, 0);
        (self.start, self.end) = (0, self.end - self.start);
        &mut self.incoming[self.end..]
    }

    /// Says that the first `count` bytes of [`Self::space`] now hold what arrived.
    pub fn filled(&mut self, count: usize) {
        debug_assert!(count <= self.incoming.len() - self.end, "{count} bytes");
        self.end += count;
    }

    /// The next piece of the stream; `None` if more bytes are needed. After an error the channel is of
    /// no more use.
    pub fn open(&mut self) -> Result<Option<&[u8]>, SecureError> {
        let arrived = &self.incoming[self.start..self.end];
        let Some((length, rest)) = arrived.split_first_chunk::<LENGTH_BYTES>() else {
            return Ok(None);
        };
        let length_bytes = usize::from(u16::from_be_bytes(*length));
        if !(SEAL_BYTES..=RECORD_BYTES + SEAL_BYTES).contains(&length_bytes) {
            return Err(SecureError::Length { length_bytes });
        }
        let Some(sealed) = rest.get(..length_bytes) else {
            return Ok(None);
        };
        self.record.resize(RECORD_BYTES + SEAL_BYTES, 0);
        let opened = self.noise.read_message(self.next, sealed, &mut self.record);
        let Ok(bytes) = opened else {
            return Err(SecureError::Forged);
        };
        self.next += 1;
        self.start += LENGTH_BYTES + length_bytes;
        Ok(Some(&self.record[..bytes]))
    }
}

impl fmt::Debug for Sealer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Sealer({} records)", self.next)
    }
}

impl fmt::Debug for Opener {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Opener({} records)", self.next)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::key::of_digits::{key, keys};

    /// A worker and a master with the same key.
    fn channels() -> (Channel, Channel) {
        let (caller, call) = Caller::call(&key('1')).unwrap();
        let (master, reply) = answer(&call, &keys(&['1'])).unwrap();
        (caller.answered(&reply).unwrap(), master)
    }

    fn sealed(sealer: &mut Sealer, bytes: &[u8]) -> Vec<u8> {
        let mut sealed = Vec::new();
        sealer.seal(bytes, &mut sealed).unwrap();
        sealed
    }

    /// Gives an opener bytes, as many as it has room for at a time.
    fn opened(opener: &mut Opener, mut bytes: &[u8]) -> Result<Vec<u8>, SecureError> {
        let mut all = Vec::new();
        loop {
            while let Some(piece) = opener.open()? {
                all.extend_from_slice(piece);
            }
            if bytes.is_empty() {
                return Ok(all);
            }
            let count = opener.space().len().min(bytes.len());
            opener.space()[..count].copy_from_slice(&bytes[..count]);
            opener.filled(count);
            bytes = &bytes[count..];
        }
    }

    #[test]
    fn what_one_side_seals_the_other_opens_in_both_directions() {
        let (mut worker, mut master) = channels();
        let long: Vec<u8> = (0..1_000_000_u32).map(|number| number as u8).collect();
        for bytes in [&b"hello"[..], &long, b""] {
            let there = sealed(&mut worker.sealer, bytes);
            assert_eq!(opened(&mut master.opener, &there).unwrap(), bytes);
            let back = sealed(&mut master.sealer, bytes);
            assert_eq!(opened(&mut worker.opener, &back).unwrap(), bytes);
        }
        assert!(worker.opener.is_empty() && master.opener.is_empty());
    }

    #[test]
    fn a_stream_may_come_in_any_pieces() {
        let (mut worker, mut master) = channels();
        let bytes = vec![7; 40_000];
        let stream = sealed(&mut worker.sealer, &bytes);
        let mut all = Vec::new();
        for piece in stream.chunks(13) {
            all.extend(opened(&mut master.opener, piece).unwrap());
        }
        assert_eq!(all, bytes);
    }

    #[test]
    fn nothing_of_what_is_said_can_be_read_on_the_way() {
        let (mut worker, _) = channels();
        let secret = b"a room with a view";
        let stream = sealed(&mut worker.sealer, secret);
        assert!(
            stream
                .windows(4)
                .all(|window| !secret.windows(4).any(|part| part == window))
        );
    }

    #[test]
    fn who_has_another_key_gets_no_answer() {
        let (_, call) = Caller::call(&key('1')).unwrap();
        assert!(matches!(answer(&call, &keys(&['2'])), Err(SecureError::OtherKey)));
        assert!(matches!(
            answer(&[0x55; OPENING_BYTES], &keys(&['1'])),
            Err(SecureError::OtherKey)
        ));
    }

    #[test]
    fn while_keys_are_changed_over_both_are_answered() {
        for digit in ['1', '2'] {
            let (caller, call) = Caller::call(&key(digit)).unwrap();
            let (_, reply) = answer(&call, &keys(&['1', '2'])).unwrap();
            assert!(caller.answered(&reply).is_ok());
        }
    }

    #[test]
    fn a_master_without_the_key_is_not_believed() {
        let (caller, call) = Caller::call(&key('1')).unwrap();
        assert!(
            matches!(caller.answered(&call), Err(SecureError::OtherKey)),
            "an echo"
        );
        let (caller, _) = Caller::call(&key('1')).unwrap();
        let (_, old_call) = Caller::call(&key('1')).unwrap();
        let (_, old_reply) = answer(&old_call, &keys(&['1'])).unwrap();
        assert!(
            matches!(caller.answered(&old_reply), Err(SecureError::OtherKey)),
            "a recording"
        );
    }

    #[test]
    fn a_recorded_conversation_cannot_be_repeated() {
        let (caller, call) = Caller::call(&key('1')).unwrap();
        let (_, reply) = answer(&call, &keys(&['1'])).unwrap();
        let mut worker = caller.answered(&reply).unwrap();
        let hello = sealed(&mut worker.sealer, b"hello");

        // The call itself is as good as ever; what follows it is not.
        let (mut again, _) = answer(&call, &keys(&['1'])).unwrap();
        assert!(matches!(
            opened(&mut again.opener, &hello),
            Err(SecureError::Forged)
        ));
    }

    #[test]
    fn records_that_are_changed_repeated_or_out_of_order_are_refused() {
        let forged = |change: fn(&mut Vec<u8>, usize)| {
            let (mut worker, mut master) = channels();
            let mut stream = sealed(&mut worker.sealer, b"first");
            let first_bytes = stream.len();
            worker.sealer.seal(b"second", &mut stream).unwrap();
            change(&mut stream, first_bytes);
            matches!(opened(&mut master.opener, &stream), Err(SecureError::Forged))
        };
        assert!(!forged(|_, _| {}), "unchanged");
        assert!(forged(|stream, _| stream[5] ^= 1), "a bit");
        assert!(
            forged(|stream, first| drop(stream.drain(..first))),
            "the first is missing"
        );
        assert!(
            forged(|stream, first| stream.rotate_left(first)),
            "the second comes first"
        );
        assert!(
            forged(|stream, first| stream.extend_from_within(..first)),
            "the first comes again"
        );
    }

    /// The example of docs/protocol.md, where each line has a name, a tab, and bytes in hexadecimal.
    #[test]
    fn the_documented_conversation_is_ours() {
        use crate::envelope::encode;
        use crate::key::hex;
        use crate::message::{Ping, Request, ToMaster, ToWorker};

        let key = key('1');
        let key_of =
            |keys: &'static [u8; 32]| builder(&key).unwrap().fixed_ephemeral_key_for_testing_only(keys);
        let (caller, call) = Caller::call_by(key_of(&[0x22; 32])).unwrap();
        let (mut master, answer) = answer_by(key_of(&[0x33; 32]), &call).unwrap();
        let mut worker = caller.answered(&answer).unwrap();
        let request = ToMaster::Request(Request {
            frame: crate::FrameId(1),
            tasks: 2,
        });
        let ping = ToWorker::Ping(Ping { nonce: 7 });
        let conversation = [
            ("key", key.secret().to_vec()),
            ("worker's secret", vec![0x22; 32]),
            ("master's secret", vec![0x33; 32]),
            ("call", call.to_vec()),
            ("answer", answer.to_vec()),
            ("request", sealed(&mut worker.sealer, &encode(&request).unwrap())),
            ("ping", sealed(&mut master.sealer, &encode(&ping).unwrap())),
        ];
        let page = include_str!("../../docs/protocol.md");
        for (name, bytes) in conversation {
            let line = format!("{name}\t{}\n", hex(&bytes));
            assert!(page.contains(&line), "docs/protocol.md should have: {line}");
        }
    }

    #[test]
    fn a_length_beyond_a_record_is_refused_before_it_has_come() {
        for length_bytes in [0, SEAL_BYTES - 1, RECORD_BYTES + SEAL_BYTES + 1, 65_535] {
            let (_, mut master) = channels();
            let announced = (length_bytes as u16).to_be_bytes();
            let error = opened(&mut master.opener, &announced).unwrap_err();
            assert!(matches!(error, SecureError::Length { length_bytes: said } if said == length_bytes));
        }
    }
}

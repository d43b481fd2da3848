//! Carries envelopes over a byte stream: one reader, one writer, no decisions.

use std::collections::VecDeque;
use std::io::{self, IoSlice};
use std::marker::PhantomData;

use socket2::SockRef;
use thiserror::Error;
use tokio::io::{AsyncRead, AsyncReadExt, AsyncWrite, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};

use crate::envelope::{Decoded, Decoder, EncodeError, EnvelopeError, Sealed};
use crate::limits::RECORD_BYTES;
use crate::message::Message;
use crate::secure::{Opener, Sealer, SecureError};

/// Envelopes that go to the system in one call.
const ENVELOPES_PER_CALL: usize = 16;

/// Bytes that the system may hold before the first of them is on the wire: enough to keep the network
/// busy, and no more, since an urgent message cannot overtake them.
const UNSENT_BYTES: u32 = 128 << 10;
/// Bytes that are encrypted at a time: enough for a call to the system to be worth its cost.
const ENCRYPTED_PER_CALL: usize = 4 * RECORD_BYTES;

/// Why nothing more can be read.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The peer sent something that is no message, or too much.
    #[error(transparent)]
    Envelope(#[from] EnvelopeError),
    /// The peer sent something that the one who has the key did not send.
    #[error(transparent)]
    Secure(#[from] SecureError),
    /// The peer closed in mid-envelope.
    #[error("the connection was closed in the middle of a message")]
    CutShort,
    /// The network failed.
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
}

/// Why a message could not be sent.
#[derive(Debug, Error)]
pub enum WriteError {
    /// It is not within the limits: a mistake of this program.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The network failed.
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
}

/// Reads the messages of one direction.
#[derive(Debug)]
pub struct Reader<M, S = OwnedReadHalf> {
    stream: S,
    decoder: Decoder,
    /// Of a secure connection.
    opener: Option<Opener>,
    direction: PhantomData<fn() -> M>,
}

/// Writes the messages of the other direction.
#[derive(Debug)]
pub struct Writer<M, S = OwnedWriteHalf> {
    stream: S,
    queue: VecDeque<Sealed>,
    /// Bytes of the first envelope that are written, or encrypted, already.
    written: usize,
    /// Of a secure connection.
    encryption: Option<Encryption>,
    direction: PhantomData<fn(M)>,
}

/// Encrypted bytes on their way from the queue to the stream.
#[derive(Debug)]
struct Encryption {
    sealer: Sealer,
    encrypted: Vec<u8>,
    /// Bytes of `encrypted` that are written already.
    written: usize,
}

/// Both ends of a plain connection, for `In` to be read and `Out` to be written.
pub fn open<In: Message, Out: Message>(stream: TcpStream) -> io::Result<(Reader<In>, Writer<Out>)> {
    tune(&stream)?;
    let (read_half, write_half) = stream.into_split();
    Ok((Reader::new(read_half), Writer::new(write_half)))
}

/// Sets a connection up for short messages between long ones.
pub fn tune(stream: &TcpStream) -> io::Result<()> {
    // A request of 30 bytes must not wait for company.
    stream.set_nodelay(true)?;
    SockRef::from(stream).set_tcp_notsent_lowat(UNSENT_BYTES)
}

impl<M: Message, S: AsyncRead + Unpin> Reader<M, S> {
    /// Reads from a peer of which nothing is known.
    pub fn new(stream: S) -> Self {
        Self {
            stream,
            decoder: Decoder::new(),
            opener: None,
            direction: PhantomData,
        }
    }

    /// Reads from a peer whose first bytes are here already.
    pub(crate) fn continued(first_bytes: &[u8], stream: S) -> Self {
        let mut reader = Self::new(stream);
        reader.decoder.push(first_bytes);
        reader
    }

    /// Reads from a peer that has the key.
    pub(crate) fn secure(opener: Opener, stream: S) -> Self {
        Self {
            opener: Some(opener),
            ..Self::new(stream)
        }
    }

    /// Whether the peer has the key.
    pub fn is_secure(&self) -> bool {
        self.opener.is_some()
    }

    /// From now on the peer may send large envelopes.
    pub fn handshake_done(&mut self) {
        self.decoder.handshake_done();
    }

    /// The next message; `None` when the peer closed after a whole one.
    ///
    /// Cancel safe: what has arrived stays.
    pub async fn read(&mut self) -> Result<Option<M>, ReadError> {
        loop {
            if let Decoded::Message(message) = self.decoder.decode()? {
                return Ok(Some(message));
            }
            if self.receive().await? == 0 {
                return if self.is_between_messages() {
                    Ok(None)
                } else {
                    Err(ReadError::CutShort)
                };
            }
        }
    }

    /// Waits for bytes and gives them to the decoder; how many came from the stream.
    async fn receive(&mut self) -> Result<usize, ReadError> {
        let Some(opener) = &mut self.opener else {
            let count = self.stream.read(self.decoder.space()).await?;
            self.decoder.filled(count);
            return Ok(count);
        };
        let count = self.stream.read(opener.space()).await?;
        opener.filled(count);
        while let Some(bytes) = opener.open()? {
            self.decoder.push(bytes);
        }
        Ok(count)
    }

    fn is_between_messages(&self) -> bool {
        self.decoder.is_empty() && self.opener.as_ref().is_none_or(Opener::is_empty)
    }
}

impl<M: Message, S: AsyncWrite + Unpin> Writer<M, S> {
    /// Writes to a stream.
    pub fn new(stream: S) -> Self {
        Self {
            stream,
            queue: VecDeque::new(),
            written: 0,
            encryption: None,
            direction: PhantomData,
        }
    }

    /// Writes to a peer that has the key.
    pub(crate) fn secure(sealer: Sealer, stream: S) -> Self {
        Self {
            encryption: Some(Encryption {
                sealer,
                encrypted: Vec::new(),
                written: 0,
            }),
            ..Self::new(stream)
        }
    }

    /// Puts a message into the queue; [`Self::flush`] carries it away.
    pub fn push(&mut self, message: &M) -> Result<(), EncodeError> {
        self.push_sealed(Sealed::new(message)?);
        Ok(())
    }

    /// Puts an envelope at the end of the queue, or before all that is less urgent and not begun.
    pub fn push_sealed(&mut self, envelope: Sealed) {
        let begun = usize::from(self.written > 0);
        let place = if envelope.is_urgent() {
            let waiting = self.queue.iter().skip(begun);
            begun + waiting.take_while(|waiting| waiting.is_urgent()).count()
        } else {
            self.queue.len()
        };
        self.queue.insert(place, envelope);
    }

    /// Whether everything pushed was written.
    pub fn is_empty(&self) -> bool {
        self.queue.is_empty() && self.encryption.as_ref().is_none_or(Encryption::is_empty)
    }

    /// Bytes that wait.
    pub fn queued_bytes(&self) -> usize {
        let bytes = self.queue.iter().map(|envelope| envelope.bytes().len());
        let encrypted_bytes = self
            .encryption
            .as_ref()
            .map_or(0, |encryption| encryption.rest().len());
        bytes.sum::<usize>() - self.written + encrypted_bytes
    }

    /// Writes until the queue is empty.
    ///
    /// Cancel safe: goes on where it stopped, so that it can be one arm of a `select!`.
    pub async fn flush(&mut self) -> io::Result<()> {
        while !self.is_empty() {
            let count = if self.encryption.is_some() {
                self.write_encrypted().await?
            } else {
                self.write_plain().await?
            };
            if count == 0 {
                return Err(io::ErrorKind::WriteZero.into());
            }
        }
        self.stream.flush().await
    }

    async fn write_plain(&mut self) -> io::Result<usize> {
        let mut slices = [IoSlice::new(&[]); ENVELOPES_PER_CALL];
        let mut skipped = self.written;
        for (slice, envelope) in slices.iter_mut().zip(&self.queue) {
            *slice = IoSlice::new(&envelope.bytes()[std::mem::take(&mut skipped)..]);
        }
        let count = self.stream.write_vectored(&slices).await?;
        self.forget(count);
        Ok(count)
    }

    async fn write_encrypted(&mut self) -> io::Result<usize> {
        self.encrypt_next().map_err(io::Error::other)?;
        let Some(encryption) = &mut self.encryption else {
            return Ok(0);
        };
        let count = self.stream.write(encryption.rest()).await?;
        encryption.written += count;
        Ok(count)
    }

    /// Encrypts some of the queue, once all that was encrypted before is written.
    fn encrypt_next(&mut self) -> Result<(), SecureError> {
        let Some(encryption) = self
            .encryption
            .as_mut()
            .filter(|encryption| encryption.is_empty())
        else {
            return Ok(());
        };
        encryption.encrypted.clear();
        encryption.written = 0;
        while let Some(envelope) = self.queue.front() {
            let room = ENCRYPTED_PER_CALL.saturating_sub(encryption.encrypted.len());
            let rest = &envelope.bytes()[self.written..];
            let piece = &rest[..rest.len().min(room)];
            if piece.is_empty() {
                break;
            }
            encryption.sealer.seal(piece, &mut encryption.encrypted)?;
            self.written += piece.len();
            if rest.len() == piece.len() {
                self.queue.pop_front();
                self.written = 0;
            }
        }
        Ok(())
    }

    /// Pushes and flushes.
    pub async fn send(&mut self, message: &M) -> Result<(), WriteError> {
        self.push(message)?;
        Ok(self.flush().await?)
    }

    /// Flushes, and tells the peer that nothing more comes.
    pub async fn shutdown(&mut self) -> io::Result<()> {
        self.flush().await?;
        self.stream.shutdown().await
    }

    /// Drops the envelopes of which the last byte is written.
    fn forget(&mut self, count: usize) {
        self.written += count;
        while let Some(first) = self.queue.front()
            && self.written >= first.bytes().len()
        {
            self.written -= first.bytes().len();
            self.queue.pop_front();
        }
    }
}

impl Encryption {
    fn rest(&self) -> &[u8] {
        &self.encrypted[self.written..]
    }

    fn is_empty(&self) -> bool {
        self.rest().is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ids::FrameId;
    use crate::message::{Pong, Request, TaskResult, ToMaster};
    use crate::radiance::Encoding;
    use crate::{Component, Radiance, Task};

    fn conversation() -> Vec<ToMaster> {
        let task = Task {
            component: Component::Direct,
            group: 1,
            index: 2,
            passes: 1,
        };
        let result = |pixels: u32| {
            ToMaster::Result(TaskResult {
                frame: FrameId(1),
                task,
                pixels,
                radiance: Radiance::pack(&vec![0.25; 3 * pixels as usize], Encoding::Exact),
                primary_rays: 1,
                shadow_rays: 2,
                busy_us: 3,
            })
        };
        let request = ToMaster::Request(Request {
            frame: FrameId(1),
            tasks: 2,
        });
        let pong = ToMaster::Pong(Pong { nonce: 9 });
        vec![pong, request, result(12_288), result(0), result(50_000)]
    }

    #[tokio::test]
    async fn messages_arrive_as_they_were_sent_through_a_narrow_pipe() {
        let (one, other) = tokio::io::duplex(1000);
        let mut writer = Writer::new(one);
        let mut reader = Reader::<ToMaster, _>::new(other);
        reader.handshake_done();
        for message in conversation() {
            writer.push(&message).unwrap();
        }
        let write = async {
            writer.flush().await.unwrap();
            drop(writer);
        };
        let read = async {
            for expected in conversation() {
                assert_eq!(reader.read().await.unwrap(), Some(expected));
            }
            assert!(matches!(reader.read().await, Ok(None)));
        };
        tokio::join!(write, read);
    }

    /// A `select!` drops the future of `flush` whenever another arm is ready.
    #[tokio::test]
    async fn a_flush_that_is_dropped_loses_and_repeats_nothing() {
        let (one, other) = tokio::io::duplex(1000);
        let mut writer = Writer::new(one);
        let mut reader = Reader::<ToMaster, _>::new(other);
        reader.handshake_done();
        for message in conversation() {
            writer.push(&message).unwrap();
        }
        let mut arrived = Vec::new();
        while arrived.len() < conversation().len() {
            tokio::select! {
                biased;
                message = reader.read() => arrived.push(message.unwrap().unwrap()),
                flushed = writer.flush(), if !writer.is_empty() => flushed.unwrap(),
                () = tokio::task::yield_now() => {}
            }
        }
        assert_eq!(arrived, conversation());
        assert_eq!(writer.queued_bytes(), 0);
    }

    /// The pixels that have begun go on; those that have not wait.
    #[tokio::test]
    async fn an_urgent_message_overtakes_all_pixels_but_those_that_are_on_their_way() {
        let (one, other) = tokio::io::duplex(1000);
        let mut writer = Writer::new(one);
        let mut reader = Reader::<ToMaster, _>::new(other);
        reader.handshake_done();
        let [first_pong, request, first, second, third] = conversation().try_into().unwrap();
        for message in [&request, &first, &second] {
            writer.push(message).unwrap();
        }
        tokio::select! {
            biased;
            flushed = writer.flush() => panic!("the pipe is too narrow for {flushed:?}"),
            () = tokio::task::yield_now() => {}
        }
        let second_pong = ToMaster::Pong(Pong { nonce: 10 });
        for message in [&first_pong, &third, &second_pong] {
            writer.push(message).unwrap();
        }
        let write = async {
            writer.flush().await.unwrap();
            drop(writer);
        };
        let read = async {
            for expected in [request, first, first_pong, second_pong, second, third] {
                assert_eq!(reader.read().await.unwrap(), Some(expected));
            }
        };
        tokio::join!(write, read);
    }

    #[tokio::test]
    async fn a_peer_that_closes_in_mid_envelope_is_noticed() {
        let bytes = crate::envelope::encode(&ToMaster::Pong(Pong { nonce: 9 })).unwrap();
        let mut reader = Reader::<ToMaster, _>::new(&bytes[..bytes.len() - 1]);
        assert!(matches!(reader.read().await, Err(ReadError::CutShort)));
    }
}

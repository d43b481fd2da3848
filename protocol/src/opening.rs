//! How a connection begins: by the key if there is one, else plainly. A refusal is always plain, so
//! that whoever has no key, or another version, can read it.

use std::io;

use thiserror::Error;
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _};
use tokio::net::TcpStream;

use crate::connection::{self, ReadError, Reader, WriteError, Writer};
use crate::key::{Key, Keys};
use crate::limits::OPENING_BYTES;
use crate::message::{Message as _, Refused};
use crate::secure::{self, Caller, MAGIC, Opening, SecureError};
use crate::{ToMaster, ToWorker};

/// Said to a worker whose key is not the master's.
const OTHER_KEY: &str = "this worker's key is not the master's: copy the master's key file to this machine, and name \
                         it with --key";

/// Said to a worker that has a key, by a master that has none.
const NO_KEY_HERE: &str =
    "this master has no key: start it with --key FILE, or this worker without --key if the network is safe";

/// Said to a worker whose secure channel has another version.
const OTHER_VERSION: &str =
    "this master opens secure channels of another version: install the same version on both sides";

/// A worker gets no secure channel to its master.
#[derive(Debug, Error)]
pub enum CallError {
    /// The master says why. Nobody knows yet whether it is the master.
    #[error("it refuses this worker: {0}")]
    Refused(String),
    /// It closed.
    #[error("it hung up on a worker that has a key: is it of an older version, or has it too many visitors?")]
    HungUp,
    /// It answered as somebody who does not have the key.
    #[error(
        "it does not have this worker's key, or somebody is in the way: copy the key file of the master to \
         this machine, and name it with --key"
    )]
    Impostor,
    /// It answered as no master does.
    #[error("it does not answer as a Gridlight master: {0}")]
    Nonsense(String),
    /// The network failed, or this machine has no random numbers.
    #[error("the connection failed: {0}")]
    Failed(#[from] io::Error),
}

/// A worker's end of a secure channel to a master that has the same key.
pub async fn call(
    mut stream: TcpStream,
    key: &Key,
) -> Result<(Reader<ToWorker>, Writer<ToMaster>), CallError> {
    connection::tune(&stream)?;
    let (caller, call) = Caller::call(key).map_err(io::Error::other)?;
    stream.write_all(&call).await?;

    let mut reply: Opening = [0; OPENING_BYTES];
    let (start, rest) = reply.split_at_mut(MAGIC.len());
    stream.read_exact(start).await.map_err(hung_up)?;
    if *start != MAGIC {
        return Err(refusal(start, stream).await);
    }
    stream.read_exact(rest).await.map_err(hung_up)?;
    let channel = caller.answered(&reply).map_err(|error| match error {
        SecureError::OtherKey => CallError::Impostor,
        other => CallError::Failed(io::Error::other(other)),
    })?;
    let (incoming, outgoing) = stream.into_split();
    let reader = Reader::secure(channel.opener, incoming);
    Ok((reader, Writer::secure(channel.sealer, outgoing)))
}

/// What a plain answer says.
async fn refusal(start: &[u8], stream: TcpStream) -> CallError {
    match Reader::<ToWorker, _>::continued(start, stream).read().await {
        Ok(Some(ToWorker::Refused(refused))) => CallError::Refused(refused.reason),
        Ok(Some(other)) => CallError::Nonsense(format!("it says `{}`", other.name())),
        Ok(None) => CallError::HungUp,
        Err(ReadError::Io(error)) => hung_up(error),
        Err(error) => CallError::Nonsense(error.to_string()),
    }
}

fn hung_up(error: io::Error) -> CallError {
    match error.kind() {
        io::ErrorKind::UnexpectedEof | io::ErrorKind::ConnectionReset => CallError::HungUp,
        _ => CallError::Failed(error),
    }
}

/// A peer may not come in.
#[derive(Debug, Error)]
pub enum AnswerError {
    /// It was told why.
    #[error("refused: {0}")]
    Refused(&'static str),
    /// The channel could not be opened.
    #[error(transparent)]
    Secure(SecureError),
    /// It could not be told.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The network failed, or the peer closed in the middle.
    #[error("the connection failed: {0}")]
    Failed(#[from] io::Error),
}

/// A master's end of a connection.
pub type Answered<R, W> = (Reader<ToMaster, R>, Writer<ToWorker, W>);

/// Answers whoever has connected: with a secure channel if it asks for one and has one of the keys,
/// plainly if it speaks plainly, which [`Reader::is_secure`] tells. `None` if it closed without a word.
///
/// Holds 52 bytes of it, and reads no more before it has shown that it has a key.
pub async fn answer<R, W>(
    mut incoming: R,
    mut outgoing: W,
    keys: Option<&Keys>,
) -> Result<Option<Answered<R, W>>, AnswerError>
where
    R: AsyncRead + Unpin,
    W: AsyncWrite + Unpin,
{
    let mut call: Opening = [0; OPENING_BYTES];
    let (start, rest) = call.split_at_mut(MAGIC.len());
    if incoming.read(&mut start[..1]).await? == 0 {
        return Ok(None);
    }
    incoming.read_exact(&mut start[1..]).await?;
    let [name @ .., _version] = MAGIC;
    if !start.starts_with(&name) {
        let reader = Reader::continued(start, incoming);
        return Ok(Some((reader, Writer::new(outgoing))));
    }
    let has_our_version = *start == MAGIC;

    // Read before anything is said: to close with something unread would take back what was said.
    incoming.read_exact(rest).await?;
    let refused = match keys {
        _ if !has_our_version => OTHER_VERSION,
        None => NO_KEY_HERE,
        Some(keys) => match secure::answer(&call, keys) {
            Ok((channel, reply)) => {
                outgoing.write_all(&reply).await?;
                let reader = Reader::secure(channel.opener, incoming);
                return Ok(Some((reader, Writer::secure(channel.sealer, outgoing))));
            }
            Err(SecureError::OtherKey) => OTHER_KEY,
            Err(error) => return Err(AnswerError::Secure(error)),
        },
    };
    let reason = refused.to_owned();
    let mut writer = Writer::new(outgoing);
    writer.send(&ToWorker::Refused(Refused { reason })).await?;
    Err(AnswerError::Refused(refused))
}

#[cfg(test)]
mod tests {
    use tokio::net::TcpListener;
    use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};

    use super::*;
    use crate::key::of_digits::{key, keys};
    use crate::message::{Hello, Leaving, Ping};

    async fn streams() -> (TcpStream, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let worker = TcpStream::connect(listener.local_addr().unwrap()).await.unwrap();
        (worker, listener.accept().await.unwrap().0)
    }

    type Called = Result<(Reader<ToWorker>, Writer<ToMaster>), CallError>;
    type Heard = Result<Option<Answered<OwnedReadHalf, OwnedWriteHalf>>, AnswerError>;

    /// What comes of a call, for the worker and for the master.
    async fn met(worker_key: &Key, master_keys: Option<&Keys>) -> (Called, Heard) {
        let (worker, master) = streams().await;
        let (incoming, outgoing) = master.into_split();
        tokio::join!(call(worker, worker_key), answer(incoming, outgoing, master_keys))
    }

    fn leaving(bytes: usize) -> ToMaster {
        let reason = "x".repeat(bytes);
        ToMaster::Leaving(Leaving { reason })
    }

    #[tokio::test]
    async fn with_the_same_key_messages_go_both_ways() {
        let (worker, master) = met(&key('2'), Some(&keys(&['1', '2']))).await;
        let (mut worker_reads, mut worker_writes) = worker.unwrap();
        let (mut master_reads, mut master_writes) = master.unwrap().unwrap();
        assert!(worker_reads.is_secure() && master_reads.is_secure());

        for bytes in [0, 10, 1000] {
            worker_writes.push(&leaving(bytes)).unwrap();
        }
        assert!(worker_writes.queued_bytes() > 1000);
        worker_writes.flush().await.unwrap();
        assert_eq!(worker_writes.queued_bytes(), 0);
        for bytes in [0, 10, 1000] {
            assert_eq!(master_reads.read().await.unwrap(), Some(leaving(bytes)));
        }
        let ping = ToWorker::Ping(Ping { nonce: 3 });
        master_writes.send(&ping).await.unwrap();
        assert_eq!(worker_reads.read().await.unwrap(), Some(ping));
        drop((worker_reads, worker_writes));
        assert!(matches!(master_reads.read().await, Ok(None)));
    }

    #[tokio::test]
    async fn a_worker_is_told_what_is_wrong_with_its_key() {
        for (master_keys, words) in [
            (Some(keys(&['1'])), "key is not the master's"),
            (None, "this master has no key"),
        ] {
            let (worker, master) = met(&key('2'), master_keys.as_ref()).await;
            assert!(worker.unwrap_err().to_string().contains(words));
            assert!(master.err().unwrap().to_string().contains(words));
        }
    }

    #[tokio::test]
    async fn a_channel_of_another_version_is_refused_in_words() {
        let (mut worker, master) = streams().await;
        let (incoming, outgoing) = master.into_split();
        let mut call = [7; OPENING_BYTES];
        call[..4].copy_from_slice(b"GLN\x02");
        worker.write_all(&call).await.unwrap();
        let keys = keys(&['1']);
        assert!(answer(incoming, outgoing, Some(&keys)).await.is_err());
        let mut reader = Reader::<ToWorker, _>::new(worker);
        let Some(ToWorker::Refused(refused)) = reader.read().await.unwrap() else {
            panic!("no refusal");
        };
        assert!(refused.reason.contains("version"), "{}", refused.reason);
    }

    #[tokio::test]
    async fn who_speaks_plainly_is_heard_from_the_first_byte() {
        let (worker, master) = streams().await;
        let (_, mut writer) = crate::connection::open::<ToWorker, ToMaster>(worker).unwrap();
        let hello = ToMaster::Hello(Hello {
            magic: "gridlight".to_owned(),
            protocol: 1,
            version: "0.0.9".to_owned(),
            name: "lab-7".to_owned(),
            slots: 1,
            token: None,
        });
        writer.send(&hello).await.unwrap();
        let (incoming, outgoing) = master.into_split();
        let keys = keys(&['1']);
        let (mut reader, _) = answer(incoming, outgoing, Some(&keys)).await.unwrap().unwrap();
        assert!(!reader.is_secure());
        assert_eq!(reader.read().await.unwrap(), Some(hello));
    }

    #[tokio::test]
    async fn a_master_that_hangs_up_or_talks_nonsense_is_no_master() {
        for (says, words) in [
            (&b""[..], "hung up"),
            (
                b"SSH-2.0-OpenSSH_9.2\r\n",
                "does not answer as a Gridlight master",
            ),
            (&[0, 0, 0, 1, 0xc0], "does not answer as a Gridlight master"),
            (
                &[b"GLN\x01", &[9; 48][..]].concat(),
                "does not have this worker's key",
            ),
        ] {
            let (worker, mut master) = streams().await;
            let answered = async {
                let mut call = [0; OPENING_BYTES];
                master.read_exact(&mut call).await.unwrap();
                master.write_all(says).await.unwrap();
                drop(master);
            };
            let key = key('1');
            let (called, ()) = tokio::join!(call(worker, &key), answered);
            let said = called.unwrap_err().to_string();
            assert!(said.contains(words), "{said}");
        }
    }
}

//! One worker's connection: the handshake, then messages in and out. Decides nothing about the frame.

use std::{io, net::SocketAddr, sync::Arc};

use protocol::{
    ToMaster, ToWorker, WorkerId,
    connection::{ReadError, Reader, WriteError, Writer},
    envelope::Sealed,
    limits,
    message::{Hello, Refused, Welcome},
    opening::{self, AnswerError},
};
use tokio::{
    net::{TcpStream, tcp::OwnedReadHalf, tcp::OwnedWriteHalf},
    sync::{Semaphore, SemaphorePermit, mpsc},
    time::timeout,
};

use crate::{
    admission::{Admission, Standing, Way},
    cli::VERSION,
    clock::Clock,
    meter::{Metered, Throughput},
};

/// Bytes of a worker, counted.
type IncomingBytes = Metered<OwnedReadHalf>;
/// Messages of a worker.
type Incoming = Reader<ToMaster, IncomingBytes>;

/// Messages that may wait for a worker to read them. One that lets more pile up is closed.
const OUTBOX_MESSAGES_MAX: usize = 1_024;
/// Encoded bytes that may wait besides; one message more is always taken.
const WRITER_BYTES_MAX: usize = 1 << 20;

/// What a connection tells the frame.
#[derive(Debug)]
pub enum Arrival {
    /// The handshake is done.
    Joined(Joined),
    /// A message arrived.
    Said {
        /// From whom.
        worker: WorkerId,
        /// What.
        message: ToMaster,
    },
    /// A worker that had joined is gone. Its last word.
    Left {
        /// Who.
        worker: WorkerId,
        /// Why, for people; `None` if it closed in good order.
        fault: Option<String>,
    },
}

/// A worker that has just joined.
#[derive(Debug)]
pub struct Joined {
    /// Its number.
    pub worker: WorkerId,
    /// Who it says it is.
    pub hello: Hello,
    /// Where it is.
    pub address: SocketAddr,
    /// Whether this process started it.
    pub is_local: bool,
    /// How fast its bytes come in.
    pub throughput: Throughput,
    /// Where to put messages for it. Dropping it closes the connection.
    pub outbox: mpsc::Sender<Sealed>,
}

/// What all connections of a server share.
#[derive(Debug)]
pub struct Shared {
    /// Where arrivals go.
    pub arrivals: mpsc::Sender<Arrival>,
    /// Who may join.
    pub admission: Admission,
    /// As many as may be here at a time.
    pub places: Semaphore,
    /// Time since the start of the process.
    pub clock: Clock,
}

/// Why a connection ended.
#[derive(Debug, thiserror::Error)]
enum Fault {
    #[error("it did not introduce itself within {} s", limits::HANDSHAKE_WITHIN.as_secs())]
    HandshakeTooSlow,
    #[error("its first message was a `{0}`, not a `hello`")]
    NoHello(&'static str),
    #[error("refused: {0}")]
    Refused(String),
    #[error(transparent)]
    Opening(#[from] AnswerError),
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
    #[error("it said nothing for {} s", limits::SILENCE.as_secs())]
    Silence,
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// A worker that was admitted.
struct Admitted<'a> {
    reader: Incoming,
    writer: Writer<ToWorker>,
    throughput: Throughput,
    hello: Hello,
    standing: Standing,
    _place: SemaphorePermit<'a>,
}

/// Serves one connection to its end; `admitted` is called once its peer is no stranger any more.
pub async fn serve(
    stream: TcpStream,
    address: SocketAddr,
    worker: WorkerId,
    shared: Arc<Shared>,
    admitted: impl FnOnce(),
) {
    let met = timeout(limits::HANDSHAKE_WITHIN, meet(stream, address, worker, &shared)).await;
    let met = match met.unwrap_or(Err(Fault::HandshakeTooSlow)) {
        Ok(Some(met)) => met,
        Ok(None) => return tracing::debug!(%address, "a peer left without a word"),
        Err(fault) => return tracing::warn!(%address, %fault, "a peer was sent away"),
    };
    admitted();
    let Admitted {
        mut reader,
        mut writer,
        throughput,
        hello,
        standing,
        _place,
    } = met;
    let (outbox, messages) = mpsc::channel(OUTBOX_MESSAGES_MAX);
    let joined = Arrival::Joined(Joined {
        worker,
        hello,
        address,
        is_local: standing == Standing::Local,
        throughput,
        outbox,
    });
    if shared.arrivals.send(joined).await.is_err() {
        return;
    }
    let ended = converse(&mut reader, &mut writer, messages, worker, &shared.arrivals).await;
    let fault = ended.err().map(|fault| fault.to_string());
    // If nobody listens any more the program is ending.
    let _ = shared.arrivals.send(Arrival::Left { worker, fault }).await;
}

/// Finds out who has connected, and admits or refuses it. `None` if it closed before it said anything.
async fn meet(
    stream: TcpStream,
    address: SocketAddr,
    worker: WorkerId,
    shared: &Shared,
) -> Result<Option<Admitted<'_>>, Fault> {
    protocol::connection::tune(&stream)?;
    let here = stream.local_addr()?;
    let (incoming, outgoing) = stream.into_split();
    let throughput = Throughput::default();
    let incoming = Metered::new(incoming, shared.clock, throughput.clone());
    let Some((mut reader, mut writer)) = opening::answer(incoming, outgoing, shared.admission.keys()).await?
    else {
        return Ok(None);
    };
    let Some(hello) = hear_hello(&mut reader).await? else {
        return Ok(None);
    };
    let way = Way::between(address, here, reader.is_secure());
    let decided = shared.admission.decide(&hello, way);
    let admitted = decided.and_then(|standing| {
        let place = shared.places.try_acquire();
        let place = place.map_err(|_full| format!("there are {} workers already", limits::WORKERS))?;
        Ok((standing, place))
    });
    let (standing, place) = match admitted {
        Ok(admitted) => admitted,
        Err(reason) => return Err(refuse(&mut writer, reason).await),
    };
    reader.handshake_done();
    let welcome = Welcome {
        worker,
        version: VERSION.to_owned(),
    };
    writer.send(&ToWorker::Welcome(welcome)).await?;
    Ok(Some(Admitted {
        reader,
        writer,
        throughput,
        hello,
        standing,
        _place: place,
    }))
}

/// The first message, which must be a hello.
async fn hear_hello(reader: &mut Incoming) -> Result<Option<Hello>, Fault> {
    match reader.read().await? {
        None => Ok(None),
        Some(ToMaster::Hello(hello)) => Ok(Some(hello)),
        Some(other) => Err(Fault::NoHello(protocol::message::Message::name(&other))),
    }
}

/// Tells a worker why it may not join.
async fn refuse(writer: &mut Writer<ToWorker, OwnedWriteHalf>, reason: String) -> Fault {
    let refused = Refused {
        reason: reason.clone(),
    };
    match writer.send(&ToWorker::Refused(refused)).await {
        Ok(()) => Fault::Refused(reason),
        Err(error) => error.into(),
    }
}

/// Carries messages until one side ends it.
async fn converse(
    reader: &mut Incoming,
    writer: &mut Writer<ToWorker>,
    mut messages: mpsc::Receiver<Sealed>,
    worker: WorkerId,
    arrivals: &mpsc::Sender<Arrival>,
) -> Result<(), Fault> {
    loop {
        // What is written meanwhile is no sign of life.
        let heard = timeout(limits::SILENCE, write_until_heard(reader, writer, &mut messages));
        let Some(message) = heard.await.unwrap_or(Err(Fault::Silence))? else {
            return Ok(());
        };
        if arrivals.send(Arrival::Said { worker, message }).await.is_err() {
            return Ok(());
        }
    }
}

/// The next message of the worker; `None` when either side closes in good order.
async fn write_until_heard(
    reader: &mut Incoming,
    writer: &mut Writer<ToWorker>,
    messages: &mut mpsc::Receiver<Sealed>,
) -> Result<Option<ToMaster>, Fault> {
    loop {
        let may_queue = writer.queued_bytes() < WRITER_BYTES_MAX;
        tokio::select! {
            message = reader.read() => return Ok(message?),
            message = messages.recv(), if may_queue => {
                let Some(message) = message else {
                    writer.flush().await.map_err(WriteError::Io)?;
                    return Ok(None);
                };
                writer.push_sealed(message);
            }
            flushed = writer.flush(), if !writer.is_empty() => flushed.map_err(WriteError::Io)?,
        }
    }
}

//! Finds the master and opens a connection to it: a secure one if there is a key.

use std::io;
use std::time::Duration;

use anyhow::{Context as _, bail};
use protocol::connection::{self, Reader, Writer};
use protocol::opening::{self, CallError};
use protocol::{Key, ToMaster, ToWorker, limits};
use tokio::net::{TcpStream, lookup_host};
use tokio::time::timeout;

use crate::options::WorkerOptions;

/// How long one attempt to connect may take. A machine that is switched off does not answer at all, and
/// a link that is back shall not have to wait for what was sent before.
const CONNECT_WITHIN: Duration = Duration::from_millis(500);

/// How long the look-up of a name may take.
const LOOK_UP_WITHIN: Duration = Duration::from_secs(1);

/// An open connection to a master.
pub(super) type Connection = (Reader<ToWorker>, Writer<ToMaster>);

/// Connects. With two keys the second is tried if the master does not take the first.
pub(super) async fn master(options: &WorkerOptions) -> anyhow::Result<Connection> {
    let master = &options.connect;
    let Some(keys) = &options.keys else {
        return connection::open(connect(master).await?).context("cannot use the connection");
    };
    let mut refused = None;
    for key in keys.iter() {
        match call(master, key).await? {
            Ok(connection) => return Ok(connection),
            Err(error @ (CallError::Refused(_) | CallError::Impostor)) => refused = Some(error),
            Err(error) => return Err(error).with_context(|| format!("at {master}")),
        }
    }
    let refused = refused.context("there is no key")?;
    Err(refused).with_context(|| format!("at {master}, called with key {}", keys.fingerprints()))
}

async fn call(master: &str, key: &Key) -> anyhow::Result<Result<Connection, CallError>> {
    let stream = connect(master).await?;
    let called = timeout(limits::HANDSHAKE_WITHIN, opening::call(stream, key)).await;
    called.with_context(|| {
        let within = limits::HANDSHAKE_WITHIN.as_secs();
        format!("whoever is at {master} did not answer within {within} s")
    })
}

async fn connect(master: &str) -> anyhow::Result<TcpStream> {
    let addresses = in_time(LOOK_UP_WITHIN, lookup_host(master)).await;
    let addresses: Vec<_> = addresses
        .with_context(|| format!("cannot resolve {master}"))?
        .collect();
    if addresses.is_empty() {
        bail!("cannot resolve {master}: the name has no address");
    }
    let connected = in_time(CONNECT_WITHIN, TcpStream::connect(&addresses[..])).await;
    connected.with_context(|| format!("no master at {master}"))
}

async fn in_time<T>(limit: Duration, attempt: impl Future<Output = io::Result<T>>) -> anyhow::Result<T> {
    match timeout(limit, attempt).await {
        Ok(result) => Ok(result?),
        Err(_) => bail!("no answer within {} s", limit.as_secs_f32()),
    }
}

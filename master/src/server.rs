//! Accepts workers, as many as there may be.

use std::{
    io,
    net::{SocketAddr, TcpListener},
    sync::Arc,
    time::Duration,
};

use protocol::{WorkerId, limits};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::{sync::Semaphore, time::sleep};

use crate::connection::{self, Shared};

/// Cannot listen for workers.
#[derive(Debug, thiserror::Error)]
#[error("cannot listen on {address}: {source}; choose another --listen address, or port 0 for any free one")]
pub struct ListenError {
    address: SocketAddr,
    source: io::Error,
}

/// Takes the address.
pub fn bind(address: SocketAddr) -> Result<TcpListener, ListenError> {
    let bound = TcpListener::bind(address).and_then(|listener| {
        listener.set_nonblocking(true)?;
        // A second `listen` only lengthens the queue, in which the machines of a lab may all be at once.
        rustix::net::listen(&listener, limits::WORKERS as i32)?;
        Ok(listener)
    });
    bound.map_err(|source| ListenError { address, source })
}

/// Lets this process have as many connections as the system allows it, not as many as it would have without
/// asking.
pub fn raise_connections_max() {
    let limit = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: limit.maximum,
        ..limit
    };
    if let Err(error) = setrlimit(Resource::Nofile, raised) {
        tracing::debug!(%error, ?limit, "the number of connections stays as it is");
    }
}

/// Pause after the system refused a connection, as it does when file descriptors run out.
const ACCEPT_PAUSE: Duration = Duration::from_millis(10);

/// Accepts connections for ever; each is served by a task of its own.
pub async fn accept(listener: TcpListener, shared: Arc<Shared>) -> io::Result<()> {
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let places = Arc::new(Semaphore::new(limits::WORKERS));
    let mut next = 0;
    loop {
        let (stream, address) = match listener.accept().await {
            Ok(connection) => connection,
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                sleep(ACCEPT_PAUSE).await;
                continue;
            }
        };
        let Ok(place) = Arc::clone(&places).try_acquire_owned() else {
            tracing::warn!(%address, limit = limits::WORKERS, "a connection beyond the limit was closed");
            continue;
        };
        let worker = WorkerId(next);
        next += 1;
        let shared = Arc::clone(&shared);
        tokio::spawn(async move {
            connection::serve(stream, address, worker, shared).await;
            drop(place);
        });
    }
}

//! Accepts connections, and sees that strangers do not stand in each other's way.

use std::{
    io,
    net::{SocketAddr, TcpListener},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

use protocol::{WorkerId, limits};
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use tokio::{net::TcpStream, task::AbortHandle, time::sleep};

use crate::{
    connection::{self, Shared},
    doorway::{Doorway, Ticket},
};

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
    let strangers = Strangers::default();
    let mut next = 0;
    loop {
        match listener.accept().await {
            Ok((stream, address)) => strangers.receive(stream, address, WorkerId(next), &shared),
            Err(error) => {
                tracing::warn!(%error, "a connection could not be accepted");
                sleep(ACCEPT_PAUSE).await;
            }
        }
        next += 1;
    }
}

/// Connections whose peers are not admitted yet.
#[derive(Debug, Clone, Default)]
struct Strangers(Arc<Mutex<Doorway<AbortHandle>>>);

impl Strangers {
    /// Serves a connection; ends that of another stranger if there are too many.
    fn receive(&self, stream: TcpStream, address: SocketAddr, worker: WorkerId, shared: &Arc<Shared>) {
        // Held until the stranger is in, so that it cannot have left before it came.
        let mut doorway = self.lock();
        let ticket = doorway.next_ticket();
        let place = Place {
            strangers: self.clone(),
            ticket,
        };
        let served = connection::serve(stream, address, worker, Arc::clone(shared), || drop(place));
        let handle = tokio::spawn(served).abort_handle();
        let evicted = doorway.enter(ticket, address.ip(), handle);
        drop(doorway);
        if let Some(evicted) = evicted {
            let (address, limit) = (evicted.address, evicted.limit);
            tracing::warn!(%address, limit, "too many peers are at the door; the oldest was sent away");
            evicted.handle.abort();
        }
    }

    fn lock(&self) -> MutexGuard<'_, Doorway<AbortHandle>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A stranger's place in the doorway; left when dropped.
#[derive(Debug)]
struct Place {
    strangers: Strangers,
    ticket: Ticket,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.strangers.lock().leave(self.ticket);
    }
}

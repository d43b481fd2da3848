//! Listens for people on this machine.

use std::fs::{self, Permissions};
use std::io;
use std::os::unix::fs::PermissionsExt as _;
use std::os::unix::net::UnixStream as BlockingStream;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context as _, bail};
use tokio::io::{AsyncBufReadExt as _, AsyncReadExt as _, AsyncWriteExt as _, BufReader};
use tokio::net::{UnixListener, UnixStream};
use tokio::sync::Semaphore;
use tokio::time::timeout;

use super::{LINE_BYTES, Order, Reply};
use crate::manners::Event;
use crate::overseer::Overseer;
use crate::status::StatusBoard;

/// People who are served at a time; others wait.
const CONNECTIONS: usize = 8;

/// Within this time a connection has said and heard all.
const SERVED_WITHIN: Duration = Duration::from_secs(2);

/// The socket; its file is removed when this is dropped.
#[derive(Debug)]
pub struct ControlSocket {
    listener: UnixListener,
    path: PathBuf,
}

impl ControlSocket {
    /// Begins to listen. Whoever may enter the folder may give orders: a user's own folder is closed to
    /// all others, and to a worker of the whole machine anyone who works at the machine may speak.
    pub fn bind(path: &Path) -> anyhow::Result<Self> {
        let shown = path.display();
        if BlockingStream::connect(path).is_ok() {
            bail!("another worker listens at {shown}");
        }
        // Left behind by a worker that was killed.
        let _ = fs::remove_file(path);
        let listener = UnixListener::bind(path).with_context(|| format!("cannot listen at {shown}"))?;
        fs::set_permissions(path, Permissions::from_mode(0o666))
            .with_context(|| format!("cannot open {shown} to others"))?;
        let path = path.to_owned();
        Ok(Self { listener, path })
    }

    /// Serves whoever comes, for ever.
    pub async fn serve(self, overseer: Arc<Overseer>, board: StatusBoard) {
        let places = Arc::new(Semaphore::new(CONNECTIONS));
        loop {
            let Ok(place) = Arc::clone(&places).acquire_owned().await else {
                return;
            };
            let stream = match self.listener.accept().await {
                Ok((stream, _)) => stream,
                Err(error) => {
                    tracing::warn!(%error, "cannot take orders for the moment");
                    tokio::time::sleep(SERVED_WITHIN).await;
                    continue;
                }
            };
            let (overseer, board) = (Arc::clone(&overseer), board.clone());
            tokio::spawn(async move {
                // Who is too slow or goes away gets nothing.
                let _ = timeout(SERVED_WITHIN, answer(stream, &overseer, &board)).await;
                drop(place);
            });
        }
    }
}

impl Drop for ControlSocket {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
    }
}

async fn answer(stream: UnixStream, overseer: &Overseer, board: &StatusBoard) -> io::Result<()> {
    let (reader, mut writer) = stream.into_split();
    let mut line = String::new();
    BufReader::new(reader.take(LINE_BYTES))
        .read_line(&mut line)
        .await?;
    let reply = match serde_json::from_str(&line) {
        Ok(order) => {
            carry_out(order, overseer).await;
            Reply::Status(Box::new(board.status(&overseer.allowance().borrow())))
        }
        Err(error) => Reply::Refused(format!("not an order: {error}")),
    };
    let mut line = serde_json::to_string(&reply)?;
    line.push('\n');
    writer.write_all(line.as_bytes()).await
}

async fn carry_out(order: Order, overseer: &Overseer) {
    match order {
        Order::Status => {}
        Order::Pause { seconds } => {
            tracing::info!(seconds, "told to pause");
            overseer.order(Event::Pause(Duration::from_secs(seconds))).await;
        }
        Order::Resume => {
            tracing::info!("told to go on");
            overseer.order(Event::Resume).await;
        }
    }
}

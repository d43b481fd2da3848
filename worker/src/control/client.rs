//! Finds the worker of this machine and gives it an order.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, bail};

use super::{LINE_BYTES, Order, Reply, SYSTEM_SOCKET, own_socket, user_socket};
use crate::status::Status;

/// A worker answers at once, if it is alive.
const ANSWER_WITHIN: Duration = Duration::from_secs(3);

/// Gives an order to the worker at a socket, or to the one that is found.
pub fn give(order: Order, socket: Option<PathBuf>) -> anyhow::Result<Status> {
    let (stream, socket) = match socket {
        Some(socket) => (connect(&socket)?, socket),
        None => find()?,
    };
    let shown = socket.display();
    let reply = ask(stream, order).with_context(|| format!("the worker at {shown} does not answer"))?;
    match reply {
        Reply::Status(status) => Ok(*status),
        Reply::Refused(reason) => bail!("the worker at {shown} refuses: {reason}"),
    }
}

/// The worker that this user has started, or else that of the system.
fn find() -> anyhow::Result<(UnixStream, PathBuf)> {
    let mut sockets: Vec<PathBuf> = [own_socket(), user_socket()].into_iter().flatten().collect();
    sockets.push(SYSTEM_SOCKET.into());
    let found = sockets
        .iter()
        .find_map(|socket| Some((UnixStream::connect(socket).ok()?, socket.clone())));
    found.with_context(|| {
        let sockets: Vec<_> = sockets
            .iter()
            .map(|socket| socket.display().to_string())
            .collect();
        format!(
            "no worker runs here: nobody listens at {}; --socket names another place",
            sockets.join(" or ")
        )
    })
}

fn connect(socket: &Path) -> anyhow::Result<UnixStream> {
    UnixStream::connect(socket).with_context(|| format!("no worker listens at {}", socket.display()))
}

fn ask(mut stream: UnixStream, order: Order) -> anyhow::Result<Reply> {
    stream.set_read_timeout(Some(ANSWER_WITHIN))?;
    stream.set_write_timeout(Some(ANSWER_WITHIN))?;
    let mut line = serde_json::to_string(&order)?;
    line.push('\n');
    stream.write_all(line.as_bytes())?;
    let mut answer = String::new();
    BufReader::new(stream.take(LINE_BYTES)).read_line(&mut answer)?;
    Ok(serde_json::from_str(&answer)?)
}

//! What the login manager says of the people who are logged in: `org.freedesktop.login1` on the system's
//! D-Bus, which graphical desktops tell when their user goes away.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use tokio::time::{sleep, timeout};

/// How often to ask. That somebody comes back is seen sooner, by interrupts and terminals.
const ASK_EVERY: Duration = Duration::from_secs(1);

/// How long to wait for an answer, and how long to leave a machine alone that has no login manager.
const ANSWER_WITHIN: Duration = Duration::from_secs(2);
const LOOK_AGAIN_AFTER: Duration = Duration::from_secs(30);

#[zbus::proxy(
    interface = "org.freedesktop.login1.Manager",
    default_service = "org.freedesktop.login1",
    default_path = "/org/freedesktop/login1",
    gen_blocking = false
)]
trait Manager {
    /// Whether all sessions are idle.
    #[zbus(property(emits_changed_signal = "false"))]
    fn idle_hint(&self) -> zbus::Result<bool>;

    /// Since when, in microseconds since 1970.
    #[zbus(property(emits_changed_signal = "false"))]
    fn idle_since_hint(&self) -> zbus::Result<u64>;
}

/// What was answered last. Clones are the same.
#[derive(Clone, Debug, Default)]
pub struct Sessions(Arc<Mutex<Option<Idle>>>);

#[derive(Clone, Copy, Debug)]
enum Idle {
    /// At least one session is not.
    No,
    /// All are, since so long after 1970.
    Since(Duration),
}

impl Sessions {
    /// How long all sessions have been idle at this time after 1970; zero if one is not, `None` if
    /// there is no login manager.
    pub fn idle_for(&self, now: Duration) -> Option<Duration> {
        match *self.0.lock().unwrap_or_else(PoisonError::into_inner) {
            None => None,
            Some(Idle::No) => Some(Duration::ZERO),
            Some(Idle::Since(since)) => Some(now.saturating_sub(since)),
        }
    }

    /// Asks the login manager again and again, for ever.
    pub async fn ask(self) {
        loop {
            if let Err(error) = self.ask_while_it_answers().await {
                tracing::debug!("the login manager tells nothing: {error}");
            }
            self.set(None);
            sleep(LOOK_AGAIN_AFTER).await;
        }
    }

    async fn ask_while_it_answers(&self) -> zbus::Result<()> {
        let manager = in_time(async { ManagerProxy::new(&zbus::Connection::system().await?).await }).await?;
        loop {
            self.set(Some(in_time(idle(&manager)).await?));
            sleep(ASK_EVERY).await;
        }
    }

    fn set(&self, idle: Option<Idle>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = idle;
    }
}

async fn idle(manager: &ManagerProxy<'_>) -> zbus::Result<Idle> {
    if !manager.idle_hint().await? {
        return Ok(Idle::No);
    }
    Ok(Idle::Since(Duration::from_micros(
        manager.idle_since_hint().await?,
    )))
}

async fn in_time<T>(answer: impl Future<Output = zbus::Result<T>>) -> zbus::Result<T> {
    let late = |_| zbus::Error::Failure(format!("no answer within {} s", ANSWER_WITHIN.as_secs()));
    timeout(ANSWER_WITHIN, answer).await.map_err(late)?
}

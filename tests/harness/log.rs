//! The lines that a process writes to standard error, as they come.

use std::{
    io::{BufRead as _, BufReader, Read},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::Duration,
};

/// Nothing that a test waits for takes so long, however busy the machine is.
const PATIENCE: Duration = Duration::from_secs(300);

/// Lines that a thread collects until their source ends.
#[derive(Debug, Clone, Default)]
pub struct Log(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    lines: Mutex<Lines>,
    news: Condvar,
}

#[derive(Debug, Default)]
struct Lines {
    lines: Vec<String>,
    ended: bool,
}

impl Log {
    /// Reads on a thread of its own.
    pub fn follow(source: impl Read + Send + 'static) -> Self {
        let log = Self::default();
        let reader = log.clone();
        thread::spawn(move || reader.fill(source));
        log
    }

    /// Waits for the first line with all these words; fails if the source ends without it.
    #[track_caller]
    pub fn wait_for(&self, words: &[&str]) -> String {
        let found = |lines: &Lines| {
            let line = lines
                .lines
                .iter()
                .find(|line| words.iter().all(|word| line.contains(word)));
            line.cloned()
        };
        let lines = self.wait(|lines| lines.ended || found(lines).is_some());
        found(&lines).unwrap_or_else(|| panic!("no line has {words:?}:\n{}", lines.lines.join("\n")))
    }

    /// All lines, once their source has ended.
    pub fn whole(&self) -> String {
        self.wait(|lines| lines.ended).lines.join("\n")
    }

    fn fill(&self, source: impl Read) {
        let mut source = BufReader::new(source);
        let mut line = Vec::new();
        while source.read_until(b'\n', &mut line).is_ok_and(|bytes| bytes > 0) {
            let text = String::from_utf8_lossy(&line).trim_end().to_owned();
            self.lock().lines.push(text);
            self.0.news.notify_all();
            line.clear();
        }
        self.lock().ended = true;
        self.0.news.notify_all();
    }

    fn lock(&self) -> MutexGuard<'_, Lines> {
        self.0.lines.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait(&self, done: impl Fn(&Lines) -> bool) -> MutexGuard<'_, Lines> {
        let waited = self
            .0
            .news
            .wait_timeout_while(self.lock(), PATIENCE, |lines| !done(lines));
        waited.unwrap_or_else(PoisonError::into_inner).0
    }
}

//! Exit codes: which kind of thing went wrong, for scripts.

/// Shown by `--help`.
pub const TABLE: &str = "\
Exit codes:
  0    the picture was delivered in time
  1    something unforeseen
  2    the command line makes no sense
  3    the scene cannot be loaded
  4    the picture or the report cannot be written
  5    cannot listen on the address
  6    the deadline was missed
  7    the full workload cannot be completed: the local worker dies again and again;
       warm: fewer workers have the scene than were expected
  8    the key file cannot be used, or not be made
  130  interrupted by Ctrl-C; what was finished was delivered
  143  ended by SIGTERM; what was finished was delivered

Environment:
  GRIDLIGHT_KEY     key file, in place of --key
  GRIDLIGHT_SCENES  folder that `$GRIDLIGHT_SCENES` in scene files stands for
                    [default: ../shared/scenes beside the project's folder]
  RUST_LOG          what is logged, in place of -q and -v";

/// How the process ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Exit {
    /// The picture was delivered in time.
    Delivered = 0,
    /// Something unforeseen.
    Unforeseen = 1,
    /// The command line makes no sense. Also clap's own code.
    Usage = 2,
    /// The scene cannot be loaded.
    Scene = 3,
    /// The picture or the report cannot be written.
    Output = 4,
    /// Cannot listen on the address.
    Listen = 5,
    /// The deadline was missed.
    DeadlineMissed = 6,
    /// The full workload cannot be completed.
    Incomplete = 7,
    /// The key file cannot be used, or not be made.
    Key = 8,
    /// Interrupted; what was finished was delivered.
    Interrupted = 130,
    /// Ended by a signal; what was finished was delivered.
    Terminated = 143,
}

/// Why there is no picture, and the code that says so.
#[derive(Debug)]
pub struct Failure {
    /// The exit code.
    pub exit: Exit,
    /// For people.
    pub error: anyhow::Error,
}

impl Failure {
    /// A failure of this kind.
    pub fn new(exit: Exit, error: impl Into<anyhow::Error>) -> Self {
        Self {
            exit,
            error: error.into(),
        }
    }
}

/// For results that fail in one way only.
pub trait OrExit<T> {
    /// Names the exit code of the failure.
    fn or_exit(self, exit: Exit) -> Result<T, Failure>;
}

impl<T, E: Into<anyhow::Error>> OrExit<T> for Result<T, E> {
    fn or_exit(self, exit: Exit) -> Result<T, Failure> {
        self.map_err(|error| Failure::new(exit, error))
    }
}

//! What a call came to: a number for programs and a text for people.

use std::{
    any::Any,
    cell::RefCell,
    ffi::{CString, c_char},
    sync::LazyLock,
};

/// What a call came to. A number, once given, never means anything else.
#[repr(i32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It did what it says, and wrote its outputs.
    Ok = 0,
    /// A pointer is NULL that must not be.
    NullParameter = 1,
    /// A number or a string makes no sense.
    InvalidParameter = 2,
    /// The memory for an output is too small.
    TooLittleRoom = 3,
    /// The scene cannot be read, or Embree refuses it.
    Scene = 4,
    /// No frame can have these settings.
    Settings = 5,
    /// The frame has no such task.
    Task = 6,
    /// The worker was started, or stopped, before.
    WorkerStarted = 7,
    /// The worker cannot work.
    Worker = 8,
    /// A fault of this library. Objects that the call was given may be freed, no more.
    Panic = 9,
}

/// Why a call fails.
#[derive(Debug)]
pub(crate) struct Failure {
    outcome: Outcome,
    text: String,
}

impl Failure {
    pub(crate) fn new(outcome: Outcome, text: impl Into<String>) -> Self {
        Self {
            outcome,
            text: text.into(),
        }
    }

    pub(crate) fn invalid(text: impl Into<String>) -> Self {
        Self::new(Outcome::InvalidParameter, text)
    }

    pub(crate) fn of_panic(panic: &(dyn Any + Send)) -> Self {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        Self::new(
            Outcome::Panic,
            format!("a fault of Gridlight: {}", text.unwrap_or("no text")),
        )
    }

    /// Keeps the text for [`gridlight_error_text`].
    pub(crate) fn report(self) -> Outcome {
        let text = c_string(&self.text);
        LAST_TEXT.with_borrow_mut(|last| *last = text);
        self.outcome
    }
}

thread_local! {
    static LAST_TEXT: RefCell<CString> = RefCell::default();
}

/// A text for C, which ends at the first NUL.
pub(crate) fn c_string(text: &str) -> CString {
    let text = text.split('\0').next().unwrap_or_default();
    CString::new(text).unwrap_or_default()
}

/// Why the last call of this thread that failed did so, as a sentence for people: what, where, and what
/// to do. Empty if none has failed. Lives until the next call of this thread fails, or the thread ends.
#[unsafe(no_mangle)]
pub extern "C" fn gridlight_error_text() -> *const c_char {
    LAST_TEXT.with_borrow(|text| text.as_ptr())
}

/// The version of this library and the revision it was built from, as `0.1.0 (1234abcd)`. Lives for ever.
#[unsafe(no_mangle)]
pub extern "C" fn gridlight_version() -> *const c_char {
    static VERSION: LazyLock<CString> = LazyLock::new(|| c_string(::worker::cli::VERSION));
    VERSION.as_ptr()
}

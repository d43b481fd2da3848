//! What can go wrong between a scene's triangles and a scene that can be traced.

use std::fmt;

use crate::raw::RTCError;

/// A scene could not be built, or Embree not started.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Embree refused to start with these settings.
    #[error("Embree did not start with the settings \"{config}\": {code}")]
    Start {
        /// The settings in Embree's own notation.
        config: String,
        /// Embree's reason.
        code: ErrorCode,
    },
    /// The library that was loaded is not the one this program was built for.
    #[error(
        "the Embree library that was loaded is version {found}, and version 4 is needed; run ./setup and build again"
    )]
    Version {
        /// The loaded library's version, as `40303` for 4.3.3.
        found: isize,
    },
    /// Embree reported an error while building a scene.
    #[error("Embree failed while {doing}: {code}{}{message}", if message.is_empty() { "" } else { ": " })]
    Embree {
        /// What was being done.
        doing: &'static str,
        /// Embree's reason.
        code: ErrorCode,
        /// Embree's own words; may be empty.
        message: String,
    },
    /// A vertex is infinite, not a number, or too far out for Embree.
    #[error(
        "vertex {vertex} is at ({}, {}, {}); coordinates must be numbers within ±{:e}",
        position[0], position[1], position[2], crate::COORDINATE_MAX
    )]
    Position {
        /// Index of the vertex in its mesh.
        vertex: usize,
        /// Where it is said to be.
        position: [f32; 3],
    },
    /// A triangle names a vertex that its mesh does not have.
    #[error(
        "triangle {triangle} names vertex {index}, but its mesh has {vertices} vertices (counted from 0)"
    )]
    Index {
        /// Index of the triangle in its mesh.
        triangle: usize,
        /// The vertex it names.
        index: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// More vertices, triangles or meshes than Embree can number.
    #[error("{count} {what} are too many; Embree takes up to {count_max}")]
    TooLarge {
        /// Vertices, triangles or meshes.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        count_max: usize,
    },
}

/// Embree's reason for an error (`RTCError` in `rtcGetDeviceError`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ErrorCode {
    /// An argument was not valid.
    InvalidArgument,
    /// The operation is not allowed in this state.
    InvalidOperation,
    /// There was not enough memory.
    OutOfMemory,
    /// The processor lacks the instructions asked for.
    UnsupportedCpu,
    /// The operation was cancelled by a callback.
    Cancelled,
    /// A reason without a name here.
    Unknown(u32),
}

impl ErrorCode {
    /// `None` if `code` says that there was no error.
    pub(crate) fn from_raw(code: RTCError) -> Option<Self> {
        match code {
            RTCError::RTC_ERROR_NONE => None,
            RTCError::RTC_ERROR_INVALID_ARGUMENT => Some(Self::InvalidArgument),
            RTCError::RTC_ERROR_INVALID_OPERATION => Some(Self::InvalidOperation),
            RTCError::RTC_ERROR_OUT_OF_MEMORY => Some(Self::OutOfMemory),
            RTCError::RTC_ERROR_UNSUPPORTED_CPU => Some(Self::UnsupportedCpu),
            RTCError::RTC_ERROR_CANCELLED => Some(Self::Cancelled),
            RTCError(other) => Some(Self::Unknown(other)),
        }
    }
}

impl fmt::Display for ErrorCode {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::InvalidArgument => formatter.write_str("invalid argument"),
            Self::InvalidOperation => formatter.write_str("invalid operation"),
            Self::OutOfMemory => formatter.write_str("out of memory"),
            Self::UnsupportedCpu => formatter.write_str("this processor lacks the instructions for it"),
            Self::Cancelled => formatter.write_str("cancelled"),
            Self::Unknown(code) => write!(formatter, "unknown error {code}"),
        }
    }
}

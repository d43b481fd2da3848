//! The end of a process that may have threads inside Embree.

use std::io::{Write as _, stderr, stdout};

/// Ends the process at once, as `exit` does but without the destructors of C++ libraries.
///
/// A thread may be in the middle of a BVH, and nobody may wait for it. Embree and TBB take their
/// global tables down when a process ends in the ordinary way, whoever is using them: one end in
/// twenty was then a crash. What this program writes to files is closed or flushed before.
pub fn at_once(code: u8) -> ! {
    let _ = stdout().flush();
    let _ = stderr().flush();
    signal_hook::low_level::exit(code.into())
}

//! Signs of hands on this machine: terminals that were read, interrupts of keyboards and mice. Neither
//! shows what was typed, and neither needs a right that a program to spy with would need.

use std::fs;
use std::os::unix::fs::MetadataExt as _;
use std::path::Path;
use std::time::Duration;

/// How long ago something was last typed on a terminal of this machine, or by a connection to it; `now`
/// is the time since 1970. `None` if there is no terminal.
///
/// The system notes when a terminal was read (to eight seconds), and a program that only prints changes
/// another time, so that a long compilation is nobody's presence.
pub(super) fn terminal_used(dev: &Path, now: Duration) -> Option<Duration> {
    let entries = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten();
    let consoles = entries(dev).filter(|entry| is_console(&entry.file_name().to_string_lossy()));
    let pseudo = entries(&dev.join("pts")).filter(|entry| entry.file_name() != "ptmx");
    let read_at = consoles.chain(pseudo).filter_map(|entry| {
        let read = entry.metadata().ok()?;
        Some(Duration::new(
            u64::try_from(read.atime()).ok()?,
            read.atime_nsec() as u32,
        ))
    });
    read_at.max().map(|read_at| now.saturating_sub(read_at))
}

/// `tty1`, `ttyS0` and the like; not `tty`, which is whoever asks, and not `tty0`, which is one of them.
fn is_console(name: &str) -> bool {
    let rest = name.strip_prefix("tty");
    rest.is_some_and(|rest| !rest.is_empty() && rest != "0")
}

/// Interrupts of input devices so far; `None` if the machine has none that are known as such.
pub(super) fn interrupts(text: &str) -> Option<u64> {
    text.lines()
        .filter_map(input_interrupts)
        .reduce(|sum, count| sum + count)
}

/// Controllers at which keyboards, mice and touchpads are. A disk or a camera at the same USB controller
/// counts as well: rather a worker that rests too often than one that disturbs.
const CONTROLLERS: [&str; 9] = [
    "i8042", "i2c_hid", "i2c-hid", "xhci", "ehci", "uhci", "ohci", "touchpad", "keyboard",
];

/// The interrupts on all cores of a line that belongs to an input device.
fn input_interrupts(line: &str) -> Option<u64> {
    let (_, rest) = line.split_once(':')?;
    let mut counts = rest.split_whitespace().peekable();
    let mut sum: u64 = 0;
    while let Some(count) = counts.next_if(|field| field.parse::<u64>().is_ok()) {
        sum = sum.wrapping_add(count.parse().ok()?);
    }
    let name = counts.collect::<Vec<_>>().join(" ").to_lowercase();
    CONTROLLERS
        .iter()
        .any(|controller| name.contains(controller))
        .then_some(sum)
}

#[cfg(test)]
mod tests {
    use std::fs::{File, FileTimes};
    use std::time::UNIX_EPOCH;

    use super::*;

    const INTERRUPTS: &str = "\
           CPU0       CPU1
  1:          0      12345   IO-APIC    1-edge      i8042
 12:          5          6   IO-APIC   12-edge      i8042
 24:    9999999          1   PCI-MSI 524288-edge      nvme0q0
 27:        100        200   PCI-MSI 327680-edge      xhci_hcd
NMI:          1          2   Non-maskable interrupts
ERR:          7
";

    #[test]
    fn interrupts_of_input_devices_are_added_up_over_devices_and_cores() {
        assert_eq!(interrupts(INTERRUPTS), Some(12345 + 11 + 300));
    }

    #[test]
    fn a_machine_without_input_devices_tells_nothing() {
        let server =
            " 26:  0  13  IO-APIC   4-edge  ttyS0\n 28:  1  1  PCI-MSIX-0000:00:01.0  0-edge  virtio0\n";
        assert_eq!(interrupts(server), None);
        assert_eq!(interrupts(""), None);
    }

    #[test]
    fn the_terminal_that_was_read_last_counts_and_what_is_no_terminal_does_not() {
        let dev = tempfile::tempdir().unwrap();
        fs::create_dir(dev.path().join("pts")).unwrap();
        let at = |seconds| UNIX_EPOCH + Duration::from_secs(seconds);
        for (name, read) in [
            ("tty1", 500),
            ("pts/3", 700),
            ("pts/ptmx", 990),
            ("tty", 991),
            ("tty0", 992),
            ("sda", 993),
        ] {
            let file = File::create(dev.path().join(name)).unwrap();
            file.set_times(FileTimes::new().set_accessed(at(read)).set_modified(at(999)))
                .unwrap();
        }
        let ago = terminal_used(dev.path(), Duration::from_secs(1000));
        assert_eq!(ago, Some(Duration::from_secs(300)));
        assert_eq!(terminal_used(Path::new("/no/such/folder"), Duration::ZERO), None);
    }
}

//! Whether the machine is on mains power, from `/sys/class/power_supply`.

use std::fs;
use std::path::Path;

/// `None` if the folder names neither an adapter nor a battery of the machine itself.
pub(super) fn on_mains(folder: &Path) -> Option<bool> {
    let supplies = fs::read_dir(folder).ok()?.flatten();
    let supplies: Vec<Supply> = supplies.filter_map(|entry| Supply::read(&entry.path())).collect();
    if supplies.contains(&Supply::Adapter { online: true }) {
        return Some(true);
    }
    if supplies.contains(&Supply::Battery { discharging: true }) {
        return Some(false);
    }
    let only_batteries = supplies.contains(&Supply::Battery { discharging: false });
    let adapters = supplies.contains(&Supply::Adapter { online: false });
    match (adapters, only_batteries) {
        (false, false) => None,
        // An adapter that is off beside a battery that does not discharge: a full one on its way, or
        // power by another socket; the battery knows.
        (_, is_battery) => Some(is_battery),
    }
}

#[derive(Debug, PartialEq)]
enum Supply {
    Adapter { online: bool },
    Battery { discharging: bool },
}

impl Supply {
    fn read(folder: &Path) -> Option<Self> {
        let text = |name: &str| fs::read_to_string(folder.join(name)).ok();
        let is = |name: &str, value: &str| text(name).is_some_and(|text| text.trim() == value);
        // Batteries of mice and headsets say nothing about the machine.
        if is("scope", "Device") {
            return None;
        }
        match text("type")?.trim() {
            "Mains" | "USB" => Some(Self::Adapter {
                online: is("online", "1"),
            }),
            "Battery" => Some(Self::Battery {
                discharging: is("status", "Discharging"),
            }),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a machine with these supplies says; each is a list of files and their contents.
    fn check(supplies: &[&[(&str, &str)]], expected: Option<bool>) {
        let folder = tempfile::tempdir().unwrap();
        for (index, files) in supplies.iter().enumerate() {
            let supply = folder.path().join(index.to_string());
            fs::create_dir(&supply).unwrap();
            for (name, text) in *files {
                fs::write(supply.join(name), format!("{text}\n")).unwrap();
            }
        }
        assert_eq!(on_mains(folder.path()), expected, "{supplies:?}");
    }

    const PLUGGED: &[(&str, &str)] = &[("type", "Mains"), ("online", "1")];
    const UNPLUGGED: &[(&str, &str)] = &[("type", "Mains"), ("online", "0")];
    const DISCHARGING: &[(&str, &str)] = &[("type", "Battery"), ("status", "Discharging")];
    const FULL: &[(&str, &str)] = &[("type", "Battery"), ("status", "Full")];
    const MOUSE: &[(&str, &str)] = &[
        ("type", "Battery"),
        ("scope", "Device"),
        ("status", "Discharging"),
    ];

    #[test]
    fn a_plugged_adapter_is_mains_and_a_battery_that_discharges_is_not() {
        check(&[PLUGGED, FULL], Some(true));
        check(&[UNPLUGGED, DISCHARGING], Some(false));
        check(&[PLUGGED, DISCHARGING], Some(true));
        check(&[DISCHARGING], Some(false));
        check(&[UNPLUGGED], Some(false));
        check(&[FULL], Some(true));
    }

    #[test]
    fn a_desktop_tells_nothing_and_its_mouse_does_not_count() {
        check(&[], None);
        check(&[MOUSE], None);
        check(&[MOUSE, PLUGGED], Some(true));
        assert_eq!(on_mains(Path::new("/no/such/folder")), None);
    }
}

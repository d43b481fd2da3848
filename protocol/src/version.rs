//! Who may talk to whom: the rule of the handshake.

use crate::message::Hello;

/// The first field of a `hello`; anything else is no Gridlight worker.
pub const MAGIC: &str = "gridlight";

/// The protocol's version. It rises when one side would misunderstand the other; a new field that
/// has a default does not raise it. The layouts of `hello` and `refused` never change.
pub const PROTOCOL: u32 = 4;

/// Whether this worker may join, or the text of the refusal. `version` is the master's own
/// program version; people need both to know which side to update.
pub fn check(hello: &Hello, version: &str) -> Result<(), String> {
    if hello.magic != MAGIC {
        return Err("not a Gridlight worker: wrong magic".to_owned());
    }
    if hello.protocol != PROTOCOL {
        return Err(format!(
            "the worker is version {} (protocol {}), the master is version {version} (protocol {PROTOCOL}): \
             install the same version on both sides",
            hello.version, hello.protocol,
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hello(magic: &str, protocol: u32) -> Hello {
        Hello {
            magic: magic.to_owned(),
            protocol,
            version: "0.0.9".to_owned(),
            name: "lab-7".to_owned(),
            slots: 4,
            token: None,
        }
    }

    #[test]
    fn the_same_protocol_may_join() {
        assert_eq!(check(&hello(MAGIC, PROTOCOL), "0.1.0"), Ok(()));
    }

    #[test]
    fn a_refusal_names_both_versions() {
        let refusal = check(&hello(MAGIC, 99), "0.1.0").unwrap_err();
        for part in ["0.0.9", "protocol 99", "0.1.0", "(protocol 4)"] {
            assert!(refusal.contains(part), "{part} is missing in: {refusal}");
        }
    }

    #[test]
    fn another_programs_hello_is_refused() {
        assert!(check(&hello("torrent", PROTOCOL), "0.1.0").is_err());
    }
}

//! Decides who may join. Knows no sockets.

use std::net::{IpAddr, SocketAddr};

use anyhow::anyhow;
use protocol::{Keys, key_file, message::Hello, version};

use crate::{
    cli::{KeyArgs, VERSION},
    exit::{Exit, Failure, OrExit},
};

/// Said to a worker without a key by a master that has one.
const KEY_NEEDED: &str = "only workers with this master's key may join: copy its key file to this machine, and name it \
                          with --key";

/// Who belongs to this master.
#[derive(Debug)]
pub struct Admission {
    keys: Option<Keys>,
    /// A digest, because digests are compared in the same time whatever they are.
    local_token: Option<blake3::Hash>,
}

/// The keys of the grid. An address that other machines can reach needs one, or a word that it does not.
pub fn keys(args: &KeyArgs, listen: SocketAddr) -> Result<Option<Keys>, Failure> {
    let usage = |text| Err(Failure::new(Exit::Usage, anyhow!("{text}")));
    match &args.key {
        Some(_) if args.insecure => usage("--key and --insecure contradict each other: give one of them"),
        Some(path) => key_file::read(path).or_exit(Exit::Key).map(Some),
        None if args.insecure || listen.ip().is_loopback() => Ok(None),
        None => usage(
            "--listen: other machines can reach this address, so workers need a key: make one with `master \
             keygen` and name it with --key FILE; or say --insecure to let anybody join",
        ),
    }
}

/// How a worker came in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Standing {
    /// This process started it.
    Local,
    /// From elsewhere, with the key if there is one.
    Remote,
}

/// What is known of a connection besides what its peer says.
#[derive(Debug, Clone, Copy)]
pub struct Way {
    /// Whether it is sealed with the key of the grid.
    pub is_secure: bool,
    /// Whether it begins and ends on this machine.
    pub is_on_this_machine: bool,
}

impl Way {
    /// From the ends of a connection.
    pub fn between(peer: SocketAddr, here: SocketAddr, is_secure: bool) -> Self {
        let (peer, here): (IpAddr, IpAddr) = (peer.ip().to_canonical(), here.ip().to_canonical());
        Self {
            is_secure,
            is_on_this_machine: peer == here || peer.is_loopback(),
        }
    }
}

impl Admission {
    /// Lets in who has one of the keys, or anybody if there are none; and always the worker that knows
    /// the token, if there is one.
    pub fn new(keys: Option<Keys>, local_token: Option<&str>) -> Self {
        Self {
            keys,
            local_token: local_token.map(|token| blake3::hash(token.as_bytes())),
        }
    }

    /// What a secure connection must be opened with.
    pub fn keys(&self) -> Option<&Keys> {
        self.keys.as_ref()
    }

    /// Whether a worker may join, or the text of the refusal.
    pub fn decide(&self, hello: &Hello, way: Way) -> Result<Standing, String> {
        version::check(hello, VERSION)?;
        // The token is sent plainly, which is no loss where nobody else can hear it.
        if way.is_on_this_machine && self.is_token(hello.token.as_deref()) {
            return Ok(Standing::Local);
        }
        if self.keys.is_some() && !way.is_secure {
            return Err(KEY_NEEDED.to_owned());
        }
        Ok(Standing::Remote)
    }

    fn is_token(&self, token: Option<&str>) -> bool {
        let token = token.map(|token| blake3::hash(token.as_bytes()));
        token.is_some() && token == self.local_token
    }
}

#[cfg(test)]
mod tests {
    use protocol::version::{MAGIC, PROTOCOL};

    use super::*;

    const FROM_AFAR: Way = Way {
        is_secure: false,
        is_on_this_machine: false,
    };
    const SEALED: Way = Way {
        is_secure: true,
        ..FROM_AFAR
    };
    const HERE: Way = Way {
        is_on_this_machine: true,
        ..FROM_AFAR
    };

    fn hello(token: Option<&str>) -> Hello {
        Hello {
            magic: MAGIC.to_owned(),
            protocol: PROTOCOL,
            version: "0.1.0".to_owned(),
            name: "lab-7".to_owned(),
            slots: 4,
            token: token.map(str::to_owned),
        }
    }

    fn admission(has_key: bool) -> Admission {
        let key = protocol::Key::generate().unwrap();
        let keys = has_key.then(|| Keys::parse(&key.to_line()).unwrap());
        Admission::new(keys, Some("token"))
    }

    #[test]
    fn without_a_key_anybody_may_join() {
        for way in [FROM_AFAR, HERE] {
            assert_eq!(admission(false).decide(&hello(None), way), Ok(Standing::Remote));
        }
    }

    #[test]
    fn with_a_key_only_a_sealed_connection_may_join() {
        let admission = admission(true);
        assert_eq!(admission.decide(&hello(None), SEALED), Ok(Standing::Remote));
        for way in [FROM_AFAR, HERE] {
            let refusal = admission.decide(&hello(None), way).unwrap_err();
            assert!(refusal.contains("--key"), "{refusal}");
        }
    }

    #[test]
    fn the_local_worker_is_known_by_its_token_on_this_machine_alone() {
        let admission = admission(true);
        assert_eq!(admission.decide(&hello(Some("token")), HERE), Ok(Standing::Local));
        assert!(admission.decide(&hello(Some("token")), FROM_AFAR).is_err());
        assert!(admission.decide(&hello(Some("another")), HERE).is_err());
    }

    #[test]
    fn another_version_is_told_so_rather_than_that_it_needs_a_key() {
        let old = Hello {
            protocol: 1,
            ..hello(None)
        };
        let refusal = admission(true).decide(&old, FROM_AFAR).unwrap_err();
        assert!(refusal.contains("protocol 1"), "{refusal}");
    }

    #[test]
    fn a_connection_is_on_this_machine_if_both_ends_are() {
        let way = |peer: &str, here: &str| {
            Way::between(peer.parse().unwrap(), here.parse().unwrap(), false).is_on_this_machine
        };
        assert!(way("127.0.0.1:1", "127.0.0.1:7420"));
        assert!(way("192.0.2.7:1", "192.0.2.7:7420"));
        assert!(way("[::ffff:192.0.2.7]:1", "192.0.2.7:7420"));
        assert!(!way("192.0.2.8:1", "192.0.2.7:7420"));
    }
}

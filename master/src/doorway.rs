//! Those who have connected and are not admitted yet. However many come, they cost little, and who is
//! quick gets in: one too many, and the oldest has to go. Knows no sockets.

use std::{
    collections::VecDeque,
    net::{IpAddr, Ipv6Addr},
};

use protocol::limits::{STRANGERS, STRANGERS_PER_ADDRESS};

/// Bits of an IPv6 address that name a network; its machines choose the others as they like.
const NETWORK_BITS: u32 = 64;

/// The strangers, oldest first. `H` is what ends one's connection.
#[derive(Debug)]
pub struct Doorway<H> {
    strangers: VecDeque<Stranger<H>>,
    next: u64,
}

/// A stranger's number, by which it leaves the doorway.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ticket(u64);

#[derive(Debug)]
struct Stranger<H> {
    ticket: Ticket,
    origin: IpAddr,
    address: IpAddr,
    handle: H,
}

/// A stranger who has to go.
#[derive(Debug, PartialEq, Eq)]
pub struct Evicted<H> {
    /// Where it is.
    pub address: IpAddr,
    /// So many may come from there.
    pub limit: usize,
    /// What ends its connection.
    pub handle: H,
}

impl<H> Default for Doorway<H> {
    fn default() -> Self {
        Self {
            strangers: VecDeque::new(),
            next: 0,
        }
    }
}

impl<H> Doorway<H> {
    /// The number of whoever comes next.
    pub fn next_ticket(&mut self) -> Ticket {
        self.next += 1;
        Ticket(self.next)
    }

    /// Somebody comes, and somebody may have to go for it.
    pub fn enter(&mut self, ticket: Ticket, address: IpAddr, handle: H) -> Option<Evicted<H>> {
        let origin = origin(address);
        let (mut from_there, mut oldest_from_there) = (0, 0);
        for (place, stranger) in self.strangers.iter().enumerate().rev() {
            if stranger.origin == origin {
                from_there += 1;
                oldest_from_there = place;
            }
        }
        let evicted = if from_there >= STRANGERS_PER_ADDRESS {
            self.evict(oldest_from_there, STRANGERS_PER_ADDRESS)
        } else if self.strangers.len() >= STRANGERS {
            self.evict(0, STRANGERS)
        } else {
            None
        };
        self.strangers.push_back(Stranger {
            ticket,
            origin,
            address,
            handle,
        });
        evicted
    }

    /// Somebody was admitted or is gone.
    pub fn leave(&mut self, ticket: Ticket) {
        self.strangers.retain(|stranger| stranger.ticket != ticket);
    }

    fn evict(&mut self, place: usize, limit: usize) -> Option<Evicted<H>> {
        let Stranger { address, handle, .. } = self.strangers.remove(place)?;
        Some(Evicted {
            address,
            limit,
            handle,
        })
    }
}

/// What counts as one address.
fn origin(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => {
            let network = address.to_bits() >> (128 - NETWORK_BITS) << (128 - NETWORK_BITS);
            Ipv6Addr::from_bits(network).into()
        }
        address @ IpAddr::V4(_) => address,
    }
}

#[cfg(test)]
mod tests {
    use std::net::Ipv4Addr;

    use super::*;

    /// Lets somebody in who is known by a number.
    fn enter(doorway: &mut Doorway<usize>, address: IpAddr, number: usize) -> Option<usize> {
        let ticket = doorway.next_ticket();
        doorway
            .enter(ticket, address, number)
            .map(|evicted| evicted.handle)
    }

    fn v4(number: usize) -> IpAddr {
        Ipv4Addr::from_bits(0x0a00_0000 + number as u32).into()
    }

    #[test]
    fn one_too_many_from_an_address_ends_the_oldest_from_there() {
        let mut doorway = Doorway::default();
        enter(&mut doorway, v4(9), 1000);
        for number in 0..STRANGERS_PER_ADDRESS {
            assert_eq!(enter(&mut doorway, v4(7), number), None);
        }
        assert_eq!(enter(&mut doorway, v4(7), 500), Some(0));
        assert_eq!(enter(&mut doorway, v4(7), 501), Some(1));
        assert_eq!(enter(&mut doorway, v4(8), 502), None);
    }

    #[test]
    fn one_too_many_in_all_ends_the_oldest_of_all() {
        let mut doorway = Doorway::default();
        for number in 0..STRANGERS {
            assert_eq!(enter(&mut doorway, v4(number), number), None);
        }
        assert_eq!(enter(&mut doorway, v4(STRANGERS), 5000), Some(0));
    }

    #[test]
    fn who_was_admitted_counts_no_more_and_is_never_ended() {
        let mut doorway = Doorway::default();
        for number in 0..10 * STRANGERS_PER_ADDRESS {
            let ticket = doorway.next_ticket();
            assert_eq!(doorway.enter(ticket, v4(7), number), None);
            doorway.leave(ticket);
        }
    }

    #[test]
    fn all_addresses_of_an_ipv6_network_are_one() {
        let address = |text: &str| text.parse::<IpAddr>().unwrap();
        assert_eq!(
            origin(address("2001:db8:1:2:3::4")),
            origin(address("2001:db8:1:2::9"))
        );
        assert_ne!(
            origin(address("2001:db8:1:2::9")),
            origin(address("2001:db8:1:3::9"))
        );
        assert_eq!(origin(address("::ffff:10.0.0.7")), v4(7));
        assert_ne!(origin(v4(7)), origin(v4(8)));
    }
}

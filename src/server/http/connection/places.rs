//! Limits on the number of open connections: of all clients together, and of one address (of IPv6,
//! a network of 64 bits). A few more are kept for requests about health (such as `/healthz`), one
//! request each. These are answered although all other connections are taken, so that a full server
//! is not taken for a dead one.

use std::collections::HashMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

/// Places for questions about health.
const RESERVED: usize = 16;

/// Places that each client has.
type Counts = Mutex<HashMap<IpAddr, usize>>;

/// The places of a server.
#[derive(Clone)]
pub struct Places {
    all: Arc<Semaphore>,
    reserved: Arc<Semaphore>,
    by_client: Arc<Counts>,
    per_client: usize,
}

/// A place, given back when it is dropped.
pub struct ConnectionPlace {
    _permit: OwnedSemaphorePermit,
    client: Option<(IpAddr, Arc<Counts>)>,
}

/// The reason why a connection gets no place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoPlace {
    /// All places are taken.
    Full,
    /// The address has as many as one may have.
    Client,
}

impl Places {
    /// So many places, of which one client may have `per_client`; 0: three quarters.
    pub fn new(all: usize, per_client: usize) -> Self {
        let per_client = if per_client == 0 { all.saturating_sub(all / 4) } else { per_client };
        Self {
            all: Arc::new(Semaphore::new(all)),
            reserved: Arc::new(Semaphore::new(RESERVED)),
            by_client: Arc::default(),
            per_client,
        }
    }

    /// A place for a client.
    pub fn take(&self, address: IpAddr) -> Result<ConnectionPlace, NoPlace> {
        let permit = self.all.clone().try_acquire_owned().map_err(|_| NoPlace::Full)?;
        let client = network(address);
        let mut counts = lock(&self.by_client);
        let count = counts.entry(client).or_default();
        if *count >= self.per_client {
            return Err(NoPlace::Client);
        }
        *count += 1;
        drop(counts);
        Ok(ConnectionPlace { _permit: permit, client: Some((client, self.by_client.clone())) })
    }

    /// A place for a question about health. None if these are taken, too.
    pub fn take_reserved(&self) -> Option<ConnectionPlace> {
        let permit = self.reserved.clone().try_acquire_owned().ok()?;
        Some(ConnectionPlace { _permit: permit, client: None })
    }
}

impl Drop for ConnectionPlace {
    fn drop(&mut self) {
        let Some((client, counts)) = &self.client else { return };
        let mut counts = lock(counts);
        if let Some(count) = counts.get_mut(client) {
            *count -= 1;
            if *count == 0 {
                counts.remove(client);
            }
        }
    }
}

fn lock(counts: &Mutex<HashMap<IpAddr, usize>>) -> MutexGuard<'_, HashMap<IpAddr, usize>> {
    counts.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The client behind an address: of IPv6, the network of 64 bits, all of whose addresses one machine may use.
pub fn network(address: IpAddr) -> IpAddr {
    match address.to_canonical() {
        IpAddr::V6(address) => IpAddr::V6((address.to_bits() >> 64 << 64).into()),
        v4 @ IpAddr::V4(_) => v4,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(text: &str) -> IpAddr {
        text.parse().unwrap()
    }

    #[test]
    fn an_ipv6_network_is_one_client() {
        let of = |text: &str| network(address(text));
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff:1"));
        assert_ne!(of("2001:db8::1"), of("2001:db8:0:1::1"));
        assert_eq!(of("::ffff:10.0.0.1"), of("10.0.0.1"));
        assert_ne!(of("10.0.0.1"), of("10.0.0.2"));
    }

    #[test]
    fn a_client_leaves_places_to_others() {
        let places = Places::new(8, 0);
        let (one, other) = (address("2001:db8::1"), address("10.0.0.1"));
        let taken: Vec<ConnectionPlace> = (0..6).map(|_| places.take(one).ok().unwrap()).collect();
        // Another address of its network.
        assert_eq!(places.take(address("2001:db8::ffff:2")).err(), Some(NoPlace::Client));
        let others = [places.take(other).ok().unwrap(), places.take(other).ok().unwrap()];
        assert_eq!(places.take(other).err(), Some(NoPlace::Full));
        let reserved: Vec<ConnectionPlace> = std::iter::from_fn(|| places.take_reserved()).collect();
        assert_eq!(reserved.len(), RESERVED);
        drop((taken, others, reserved));
        assert!(lock(&places.by_client).is_empty());
        assert!((0..6).all(|_| places.take(one).is_ok()) && places.take_reserved().is_some());
    }
}

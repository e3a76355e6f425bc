//! Who gets a connection. One client may hold a part of them; when all are taken, a few more are kept for those who ask
//! how the server is.

use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use axum::extract::Request;
use axum::http::{HeaderValue, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use tokio_util::sync::CancellationToken;

use super::client::address_name;
use super::problem::{self, Problem};
use super::serve::Peer;
use super::shares::{Share, Shares};

/// Connections beyond the limit, which serve health and metrics alone. Whoever comes when these are taken too takes the
/// place of the oldest of whichever address has most of them, so that idle connections cannot keep a probe out.
const RESERVE: usize = 32;

/// All places for connections.
#[derive(Debug, Clone)]
pub struct Seats {
    places: Shares,
    reserve: Arc<Mutex<Reserve>>,
}

#[derive(Debug, Default)]
struct Reserve {
    next: u64,
    seated: Vec<Seated>,
}

#[derive(Debug)]
struct Seated {
    number: u64,
    address: IpAddr,
    leave: CancellationToken,
}

/// A place, held until it is dropped.
#[derive(Debug)]
pub enum Seat {
    /// One of the ordinary places.
    Ordinary {
        /// Gives it back.
        _share: Share,
    },
    /// One of the reserve.
    Reserve(ReserveSeat),
}

/// A place of the reserve, which may be taken away.
#[derive(Debug)]
pub struct ReserveSeat {
    number: u64,
    reserve: Arc<Mutex<Reserve>>,
    /// Is cancelled when the place is taken away.
    pub leave: CancellationToken,
}

impl Seats {
    /// Places for so many connections, and the reserve.
    pub fn new(connections: usize) -> Self {
        Self { places: Shares::new(connections as u64), reserve: Arc::default() }
    }

    /// A place for a connection from an address: an ordinary one where there is one for this client.
    pub fn take(&self, address: SocketAddr) -> Seat {
        match self.places.take(&address_name(address), 1) {
            Ok(share) => Seat::Ordinary { _share: share },
            Err(_) => Seat::Reserve(self.reserved(address.ip().to_canonical())),
        }
    }

    fn reserved(&self, address: IpAddr) -> ReserveSeat {
        let mut reserve = lock(&self.reserve);
        if reserve.seated.len() >= RESERVE {
            let mut counts: HashMap<IpAddr, usize> = HashMap::new();
            reserve.seated.iter().for_each(|seated| *counts.entry(seated.address).or_default() += 1);
            let most = counts.into_iter().max_by_key(|(_, count)| *count).map(|(address, _)| address);
            if let Some(oldest) = reserve.seated.iter().position(|seated| Some(seated.address) == most) {
                reserve.seated.remove(oldest).leave.cancel();
            }
        }
        let number = reserve.next;
        reserve.next += 1;
        let leave = CancellationToken::new();
        reserve.seated.push(Seated { number, address, leave: leave.clone() });
        drop(reserve);
        ReserveSeat { number, reserve: self.reserve.clone(), leave }
    }
}

fn lock(reserve: &Mutex<Reserve>) -> MutexGuard<'_, Reserve> {
    reserve.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Drop for ReserveSeat {
    fn drop(&mut self) {
        lock(&self.reserve).seated.retain(|seated| seated.number != self.number);
    }
}

/// Refuses what the reserve is not for.
pub async fn guard(request: Request, next: Next) -> Response {
    let reserve = request.extensions().get::<Peer>().is_some_and(|peer| peer.reserve);
    if !reserve || matches!(request.uri().path(), "/healthz" | "/readyz" | "/metrics") {
        return next.run(request).await;
    }
    let refused = Problem::new(&problem::BUSY, "Too many connections are open; this one is closed.").retry_after(1);
    refused.header(header::CONNECTION, HeaderValue::from_static("close")).into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn from(text: &str) -> SocketAddr {
        SocketAddr::new(text.parse().unwrap(), 4000)
    }

    #[test]
    fn beyond_the_limit_there_is_the_reserve_and_the_greediest_gives_way() {
        let seats = Seats::new(4);
        let ordinary: Vec<Seat> = (0..3).map(|_| seats.take(from("10.0.0.1"))).collect();
        assert!(ordinary.iter().all(|seat| matches!(seat, Seat::Ordinary { .. })));
        let reserved: Vec<Seat> = (0..RESERVE).map(|_| seats.take(from("10.0.0.1"))).collect();
        let left = |seat: &Seat| match seat {
            Seat::Reserve(seat) => seat.leave.is_cancelled(),
            Seat::Ordinary { .. } => panic!("an ordinary place"),
        };
        assert!(!reserved.iter().any(left));
        assert!(matches!(seats.take(from("10.0.0.2")), Seat::Ordinary { .. }), "another client has a place left");
        let all = seats.take(from("10.0.0.3"));
        let probe = seats.take(from("10.0.0.2"));
        assert!(left(&reserved[0]) && !left(&reserved[1]) && !left(&probe));
        drop((all, reserved, probe, ordinary));
        assert_eq!(lock(&seats.reserve).seated.len(), 0);
        assert!(matches!(seats.take(from("10.0.0.1")), Seat::Ordinary { .. }));
    }
}

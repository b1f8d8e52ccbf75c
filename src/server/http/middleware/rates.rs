//! Refuses a client that asks for too much.

use std::net::IpAddr;
use std::sync::Arc;

use axum::extract::connect_info::ConnectInfo;
use axum::extract::{Request, State};
use axum::http::Method;
use axum::middleware::Next;
use axum::response::Response;

use crate::http::connection::activity::Client;
use crate::http::error::ApiError;
use crate::http::receive;
use crate::http::state::AppState;
use crate::jobs::Owner;

/// Counts a request of a key, or of an address where there are no keys.
pub async fn check(State(state): State<Arc<AppState>>, request: Request, next: Next) -> Result<Response, ApiError> {
    let access = receive::access_of(&request);
    let client = request.extensions().get::<ConnectInfo<Client>>().filter(|_| access.is_open());
    let party = client.map_or(access.owner, |ConnectInfo(client)| by_network(client.address.ip()));
    let is_work = [Method::POST, Method::PUT].contains(request.method());
    state.rates.check(&party, is_work)?;
    Ok(next.run(request).await)
}

/// Of IPv6, the network of 64 bits: whoever has one has all its addresses.
fn by_network(address: IpAddr) -> Owner {
    match address.to_canonical() {
        IpAddr::V4(address) => Owner::new(&address.to_string()),
        IpAddr::V6(address) => Owner::new(&format!("{:x}", address.to_bits() >> 64)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ipv6_network_is_one_client() {
        let of = |text: &str| by_network(text.parse().unwrap());
        assert_eq!(of("2001:db8::1"), of("2001:db8::ffff:1"));
        assert_ne!(of("2001:db8::1"), of("2001:db8:0:1::1"));
        assert_eq!(of("::ffff:10.0.0.1"), of("10.0.0.1"));
        assert_ne!(of("10.0.0.1"), of("10.0.0.2"));
    }
}

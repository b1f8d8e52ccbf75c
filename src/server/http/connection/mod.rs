//! Connections of clients: `accept` takes or refuses them, `places` limits their number, and
//! `activity` and `io` (a client's socket) limit how long a client may be silent.

pub mod accept;
pub mod activity;
mod io;
pub mod places;

//! Connections of clients: `accept` takes or refuses them, `places` limits their number, `activity` finds those that
//! are idle for too long, and `io` (a client's socket) ends those whose client reads too slowly.

pub mod accept;
pub mod activity;
mod io;
pub mod places;

//! Connections: the accept loop and the client's socket, both with limits on a client's silence.

pub mod accept;
pub mod activity;
mod io;
mod places;

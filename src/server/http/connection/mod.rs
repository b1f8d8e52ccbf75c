//! Connections: the accept loop and the client's socket, both with limits on how long a client may be silent.

pub mod accept;
pub mod activity;
mod io;
pub mod places;

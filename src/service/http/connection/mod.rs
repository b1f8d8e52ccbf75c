//! TODO room.

pub(crate) mod accept;
pub(crate) mod io;

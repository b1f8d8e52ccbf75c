//! The owner of a job and its class, by which the queue decides what is next. The owner is an API key, or the
//! client's address (of IPv6, its network) where there are no keys. The class is interactive (a client waits for the
//! answer) or batch (it is fetched later).

use std::fmt;
use std::sync::Arc;

/// A class of jobs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// A client waits for it.
    Interactive,
    /// It is fetched later.
    Batch,
}

impl Class {
    /// Both classes.
    pub const ALL: [Self; 2] = [Self::Interactive, Self::Batch];

    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Interactive => "interactive",
            Self::Batch => "batch",
        }
    }
}

/// The party whose job it is: an API key, or an address where there are none.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Owner(Arc<str>);

impl Owner {
    /// The owner of this name.
    pub fn new(name: &str) -> Self {
        Self(name.into())
    }
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

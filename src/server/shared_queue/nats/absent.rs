//! The stand-in for `nats` in builds without the feature `cluster`: a queue that cannot be opened.

use super::{AddressError, Kind, Note, OpenError, QueueError, QueueLoad, QueueSettings};
use crate::durable::JobKey;
use bytes::Bytes;
use std::collections::HashSet;
use std::convert::Infallible;
use std::time::Duration;

/// No queue.
pub struct SharedQueue(Infallible);

/// No message.
pub struct Delivery(Infallible);

/// No notes.
pub struct Following(Infallible);

/// No news.
pub struct News(Infallible);

/// Nothing is heard.
pub enum Heard {
    /// Never.
    Told(Bytes),
    /// Never.
    Asked(Question),
}

/// No question.
pub struct Question {
    /// Nobody.
    pub server: String,
    nothing: Infallible,
}

/// An error: there is no NATS.
pub async fn list_live(_: &QueueSettings) -> Result<Vec<(JobKey, Option<Note>)>, OpenError> {
    Err(AddressError::Absent.into())
}

/// An error: there is no NATS.
pub async fn list_dead(_: &QueueSettings) -> Result<Vec<(JobKey, Bytes)>, OpenError> {
    Err(AddressError::Absent.into())
}

impl SharedQueue {
    /// An error: there is no NATS.
    pub async fn open(_: QueueSettings) -> Result<Self, OpenError> {
        Err(AddressError::Absent.into())
    }

    /// Unreachable, as all that follows.
    pub fn is_connected(&self) -> bool {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn send(&self, _: Kind, _: JobKey, _: &str) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn take(&self, _: Kind) -> Result<Option<Delivery>, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn live(&self, _: Kind) -> Result<HashSet<JobKey>, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn remove(&self, _: Kind, _: JobKey) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn note(&self, _: JobKey) -> Result<Option<(Note, Duration)>, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn set_note(&self, _: JobKey, _: &Note) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn follow(&self, _: JobKey) -> Result<Following, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn lease(&self, _: &str, _: &str, _: Duration) -> Result<bool, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn release(&self, _: &str) {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn load(&self) -> Result<QueueLoad, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn bury(&self, _: JobKey, _: Vec<u8>) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn tell(&self, _: Vec<u8>) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn hear(&self) -> Result<News, QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn hear_questions(&self, _: &mut News) -> Result<(), QueueError> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn ask(&self, _: &str) -> Option<Bytes> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn answer(&self, question: Question, _: Vec<u8>) {
        match question.nothing {}
    }
}

impl News {
    /// Unreachable.
    pub fn told_by_now(&mut self) -> Option<Bytes> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn next(&mut self) -> Option<Heard> {
        match self.0 {}
    }
}

impl Following {
    /// Unreachable.
    pub async fn next(&mut self) -> Option<Note> {
        match self.0 {}
    }
}

impl Delivery {
    /// Unreachable.
    pub fn key(&self) -> Option<JobKey> {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn sign_of_life(&self) {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn give_back(&self, _: Duration) {
        match self.0 {}
    }

    /// Unreachable.
    pub async fn end(&self) {
        match self.0 {}
    }
}

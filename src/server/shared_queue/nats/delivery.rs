//! A message about a job, which a daemon gets from the queue, and the notes on a job as they change.

use std::time::Duration;

use async_nats::Subscriber;
use async_nats::jetstream::{AckKind, Message};
use futures_util::StreamExt as _;

use super::{ANSWER_TIME, key_of};
use crate::durable::JobKey;
use crate::shared_queue::Note;

/// A message that this daemon has.
pub struct Delivery {
    pub(super) message: Message,
}

/// The notes on a job, as they change.
pub struct Following {
    pub(super) notes: Subscriber,
}

impl Following {
    /// The next note. None if there will be no more.
    pub async fn next(&mut self) -> Option<Note> {
        loop {
            let message = self.notes.next().await?;
            // What is no note is the end of one.
            if let Ok(note) = serde_json::from_slice(&message.payload) {
                return Some(note);
            }
        }
    }
}

impl Delivery {
    /// The job that it is about. None if the message was sent by somebody else.
    pub fn key(&self) -> Option<JobKey> {
        key_of(&self.message.subject)
    }

    /// Keeps the message for longer.
    pub async fn sign_of_life(&self) {
        let _ = tokio::time::timeout(ANSWER_TIME, self.message.ack_with(AckKind::Progress)).await;
    }

    /// Lets another daemon have it, after a while.
    pub async fn give_back(&self, after: Duration) {
        let _ = tokio::time::timeout(ANSWER_TIME, self.message.ack_with(AckKind::Nak(Some(after)))).await;
    }

    /// Ends the message. Returns once JetStream has said that it has. If it does not, the message comes again.
    pub async fn end(&self) {
        if let Ok(Err(error)) = tokio::time::timeout(ANSWER_TIME, self.message.double_ack()).await {
            tracing::info!(%error, "a message of the shared queue may come again");
        }
    }
}

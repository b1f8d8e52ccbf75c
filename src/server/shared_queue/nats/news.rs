//! What daemons of a service tell each other without JetStream: it is not kept, and who is away misses it.

use std::time::Duration;

use async_nats::Subscriber;
use bytes::Bytes;
use futures_util::StreamExt as _;

use super::{ANSWER_TIME, SharedQueue};
use crate::shared_queue::QueueError;

/// The group of those that answer questions: each is answered by one of them.
const GROUP: &str = "servers";

/// The longest time for which an answer of another daemon is waited for.
const ASK_TIME: Duration = Duration::from_secs(2);

/// What the daemons say, and what they ask.
pub struct News {
    told: Subscriber,
    asked: Subscriber,
}

/// Something that another daemon has sent.
pub enum Heard {
    /// It tells all.
    Told(Bytes),
    /// It asks one, and waits for the answer.
    Asked(Question),
}

/// A question of another daemon.
pub struct Question {
    reply: async_nats::Subject,
}

impl SharedQueue {
    /// Tells all daemons something, this one too.
    pub async fn tell(&self, news: Vec<u8>) -> Result<(), QueueError> {
        self.check_connection()?;
        let told = self.client.publish(self.subject_of("news"), news.into()).await;
        told.map_err(|error| self.unavailable(&error))
    }

    /// Hears what all tell and ask from now on. Returns what one of the others knows, too, if there is one.
    pub async fn hear(&self) -> Result<(News, Option<Bytes>), QueueError> {
        self.check_connection()?;
        let hearing = async {
            let told = self.client.subscribe(self.subject_of("news")).await?;
            // This daemon does not answer questions yet, and so not its own. Others tell nothing that it does not hear.
            let known = self.ask().await;
            let asked = self.client.queue_subscribe(self.subject_of("questions"), GROUP.to_owned()).await?;
            Ok::<_, async_nats::SubscribeError>((News { told, asked }, known))
        };
        match tokio::time::timeout(ANSWER_TIME, hearing).await {
            Ok(heard) => heard.map_err(|error| self.unavailable(&error)),
            Err(_) => Err(self.error("no answer".to_owned())),
        }
    }

    async fn ask(&self) -> Option<Bytes> {
        let asking = self.client.request(self.subject_of("questions"), Bytes::new());
        let answer = tokio::time::timeout(ASK_TIME, asking).await.ok()?.ok()?;
        Some(answer.payload)
    }

    /// Answers a question.
    pub async fn answer(&self, question: Question, answer: Vec<u8>) {
        if let Err(error) = self.client.publish(question.reply, answer.into()).await {
            tracing::warn!(%error, "a question of another server was not answered");
        }
    }

    fn subject_of(&self, word: &str) -> String {
        format!("{}.{word}", self.settings.address.name)
    }
}

impl News {
    /// The next thing that is heard. None if there will be no more.
    pub async fn next(&mut self) -> Option<Heard> {
        loop {
            tokio::select! {
                told = self.told.next() => return Some(Heard::Told(told?.payload)),
                asked = self.asked.next() => {
                    if let Some(reply) = asked?.reply {
                        return Some(Heard::Asked(Question { reply }));
                    }
                }
            }
        }
    }
}

//! News and questions of the daemons of a service, without JetStream: they are not kept, and a daemon that is away misses
//! them.

use std::time::Duration;

use async_nats::Subscriber;
use bytes::Bytes;
use futures_util::{FutureExt as _, StreamExt as _};

use super::{ANSWER_TIME, SharedQueue};
use crate::shared_queue::QueueError;

/// The group of those that answer questions: each is answered by one of them.
const GROUP: &str = "servers";

/// The longest time for which an answer of another daemon is waited for.
const ASK_TIME: Duration = Duration::from_secs(2);

/// The news and the questions of the daemons.
pub struct News {
    told: Subscriber,
    asked: Option<Subscriber>,
}

/// Something that another daemon has sent.
pub enum Heard {
    /// It tells all.
    Told(Bytes),
    /// It asks one, and waits for the answer.
    Asked(Question),
}

/// A question of a daemon.
pub struct Question {
    /// The daemon that asks.
    pub server: String,
    reply: async_nats::Subject,
}

impl SharedQueue {
    /// Tells all daemons something, this one too.
    pub async fn tell(&self, news: Vec<u8>) -> Result<(), QueueError> {
        self.check_connection()?;
        let told = self.client.publish(self.subject_of("news"), news.into()).await;
        told.map_err(|error| self.unavailable(&error))
    }

    /// Hears what all tell from now on, and, once [`SharedQueue::hear_questions`] was called, what they ask.
    pub async fn hear(&self) -> Result<News, QueueError> {
        self.check_connection()?;
        let told = self.subscribed(self.client.subscribe(self.subject_of("news"))).await?;
        Ok(News { told, asked: None })
    }

    /// Hears some of the questions from now on: each is heard by one daemon.
    pub async fn hear_questions(&self, news: &mut News) -> Result<(), QueueError> {
        let asking = self.client.queue_subscribe(self.subject_of("questions"), GROUP.to_owned());
        news.asked = Some(self.subscribed(asking).await?);
        Ok(())
    }

    async fn subscribed(
        &self,
        subscribing: impl Future<Output = Result<Subscriber, async_nats::SubscribeError>>,
    ) -> Result<Subscriber, QueueError> {
        match tokio::time::timeout(ANSWER_TIME, subscribing).await {
            Ok(subscribed) => subscribed.map_err(|error| self.unavailable(&error)),
            Err(_) => Err(self.error("no answer".to_owned())),
        }
    }

    /// Asks a daemon what it knows: any one, this one too if it hears questions. None if nobody answers.
    pub async fn ask(&self, server: &str) -> Option<Bytes> {
        self.check_connection().ok()?;
        let asking = self.client.request(self.subject_of("questions"), Bytes::copy_from_slice(server.as_bytes()));
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
            let question = async {
                match &mut self.asked {
                    Some(asked) => asked.next().await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                // An answer contains all news that came before the question.
                biased;
                told = self.told.next() => return Some(Heard::Told(told?.payload)),
                asked = question => {
                    let async_nats::Message { payload, reply, .. } = asked?;
                    if let Some(reply) = reply {
                        let server = String::from_utf8_lossy(&payload).into_owned();
                        return Some(Heard::Asked(Question { server, reply }));
                    }
                }
            }
        }
    }

    /// The next news that has arrived already. None if there is none.
    pub fn told_by_now(&mut self) -> Option<Bytes> {
        Some(self.told.next().now_or_never()??.payload)
    }
}

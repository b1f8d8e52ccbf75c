//! The news that the daemons of a service tell each other: that they are there, and whether they have a GPU; what they
//! have admitted of each client's share (`crate::rates`); and which meshes have kept their workers busy. A daemon that
//! starts, or that was cut off, asks one of the others what it knows.
//!
//! Nothing of it is kept anywhere but in the daemons. What is missed makes a limit less exact, and nothing else.

use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use serde::{Deserialize, Serialize};

use super::others::announce_every;
use super::service::SharedJobs;
use crate::digest::Digest;
use crate::http::state::AppState;
use crate::jobs::{Owner, Strikes};
use crate::rates::Spent;
use crate::shared_queue::{Heard, News, Question};

/// Time between two messages of a daemon that has something to tell, where there are few daemons. Where there are more than
/// [`FEW_TELLERS`], it is as many times longer, because each of them hears all.
const TELL_EVERY: Duration = Duration::from_millis(200);

/// The number of daemons that are few.
const FEW_TELLERS: u32 = 20;

/// Characters of the name of a daemon: those of a UUID.
const NAME_CHARS: usize = 36;

/// Time after which another daemon is asked again what it knows.
const ASK_EVERY: Duration = Duration::from_secs(60);

/// Clients in a message, and in an answer. NATS takes messages of 1 MB.
const TOLD_MAX: usize = 2000;

/// Pause after a failure of the queue.
const PAUSE: Duration = Duration::from_secs(1);

/// A message to all. One of a later version may have more, and one of an earlier version less.
#[derive(Serialize, Deserialize)]
struct Told {
    /// The name of the daemon.
    server: String,
    /// It has a GPU, or has not tried to draw with one.
    #[serde(default = "yes")]
    has_gpu: bool,
    /// Clients, with the requests and the works that were admitted since the last message.
    #[serde(default)]
    spent: Vec<(String, u32, u32)>,
    /// Meshes that have kept workers busy since the last message.
    #[serde(default)]
    strikes: Vec<Struck>,
}

fn yes() -> bool {
    true
}

/// An answer to a daemon that asks.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct Known {
    /// Clients, with what they have used of their share of the day.
    of_day: Vec<(String, f64)>,
    /// All meshes that have kept workers busy.
    strikes: Vec<Struck>,
}

#[derive(Serialize, Deserialize)]
struct Struck {
    mesh: String,
    bytes: u64,
    alone: u32,
    compared: u32,
}

/// Tells the others until the process ends.
pub async fn tell(shared: Arc<SharedJobs>, state: Arc<AppState>) {
    let mut told = None;
    loop {
        let count = shared.others.count();
        tokio::time::sleep(TELL_EVERY * (count / FEW_TELLERS).max(1)).await;
        if !shared.queue.is_connected() {
            state.rates.hold_spent();
            continue;
        }
        let (spent, strikes) = (state.rates.take_spent(), state.jobs.quarantine().take_untold());
        let is_due = told.is_none_or(|told: Instant| told.elapsed() >= announce_every(count));
        if !is_due && spent.is_empty() && strikes.is_empty() {
            continue;
        }
        told = Some(Instant::now());
        let mut strikes: Vec<Struck> = strikes.into_iter().map(Struck::from).collect();
        let mut parts = spent.chunks(TOLD_MAX);
        loop {
            let part = parts.next().unwrap_or_default();
            let spent = part.iter().map(|(owner, spent)| (owner.to_string(), spent.requests, spent.works)).collect();
            let (server, has_gpu) = (shared.server.clone(), !shared.others.lacks_gpu());
            let told = Told { server, has_gpu, spent, strikes: std::mem::take(&mut strikes) };
            if let Err(error) = shared.queue.tell(bytes_of(&told)).await {
                tracing::warn!(%error, "the other servers were not told");
            }
            if parts.len() == 0 {
                break;
            }
        }
    }
}

/// Hears the others until the process ends. `news` is what was heard at the start.
pub async fn hear(shared: Arc<SharedJobs>, state: Arc<AppState>, mut news: Option<News>) {
    loop {
        match &mut news {
            Some(news) => shared.hear_of(&state, news).await,
            None => tokio::time::sleep(PAUSE).await,
        }
        news = shared.begin_to_hear(&state).await;
    }
}

impl SharedJobs {
    /// Hears all from now on, and learns what another daemon knows. None if the queue cannot be reached.
    pub(super) async fn begin_to_hear(&self, state: &AppState) -> Option<News> {
        let mut news = self.queue.hear().await.ok()?;
        // It does not hear questions yet, and so not its own.
        if let Some(known) = self.queue.ask(&self.server).await {
            self.learn(state, &mut news, &known);
        }
        self.queue.hear_questions(&mut news).await.ok()?;
        self.others.listens();
        Some(news)
    }

    async fn hear_of(&self, state: &AppState, news: &mut News) {
        // What is missed while NATS is away is learnt with the next question.
        let mut question = Box::pin(self.ask_later());
        loop {
            tokio::select! {
                known = &mut question => {
                    if let Some(known) = known {
                        self.learn(state, news, &known);
                    }
                    question.set(self.ask_later());
                }
                heard = news.next() => match heard {
                    Some(Heard::Told(bytes)) => self.take_over(state, &bytes),
                    Some(Heard::Asked(question)) => self.answer(state, question).await,
                    None => return,
                },
            }
        }
    }

    /// The answer of another daemon that is asked a while from now what it knows.
    async fn ask_later(&self) -> Option<Bytes> {
        tokio::time::sleep(ASK_EVERY).await;
        self.queue.ask(&self.server).await
    }

    /// Counts what another daemon tells.
    fn take_over(&self, state: &AppState, told: &[u8]) {
        let Ok(told) = serde_json::from_slice::<Told>(told) else { return };
        if told.server == self.server || told.server.len() != NAME_CHARS {
            return;
        }
        self.others.heard(&told.server, told.has_gpu);
        for (owner, requests, works) in told.spent {
            state.rates.add(&Owner::new(&owner), Spent { requests, works });
        }
        for strikes in told.strikes.iter().filter_map(Struck::strikes) {
            state.jobs.quarantine().add(strikes);
        }
    }

    /// Answers what this daemon knows and has told: the daemon that asks hears the rest like all others.
    async fn answer(&self, state: &AppState, question: Question) {
        let known = if question.server == self.server {
            Known::default()
        } else {
            let of_day = state.rates.of_day(TOLD_MAX).into_iter().map(|(owner, used)| (owner.to_string(), used));
            Known {
                of_day: of_day.collect(),
                strikes: state.jobs.quarantine().told().into_iter().map(Struck::from).collect(),
            }
        };
        self.queue.answer(question, bytes_of(&known)).await;
    }

    /// Learns an answer. What was told before it comes first: it is counted on top of what was known, and the answer, which
    /// contains it, is not.
    fn learn(&self, state: &AppState, news: &mut News, known: &[u8]) {
        while let Some(told) = news.told_by_now() {
            self.take_over(state, &told);
        }
        let Ok(known) = serde_json::from_slice::<Known>(known) else { return };
        let of_day = known.of_day.into_iter().filter(|(_, used)| used.is_finite());
        state.rates.learn_of_day(of_day.map(|(owner, used)| (Owner::new(&owner), used)));
        for strikes in known.strikes.iter().filter_map(Struck::strikes) {
            state.jobs.quarantine().learn(strikes);
        }
    }
}

impl From<Strikes> for Struck {
    fn from(strikes: Strikes) -> Self {
        let Strikes { mesh, bytes, alone, compared } = strikes;
        Self { mesh: mesh.to_string(), bytes, alone, compared }
    }
}

impl Struck {
    fn strikes(&self) -> Option<Strikes> {
        let &Self { bytes, alone, compared, .. } = self;
        Some(Strikes { mesh: Digest::parse(&self.mesh)?, bytes, alone, compared })
    }
}

fn bytes_of(message: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(message).unwrap_or_default()
}

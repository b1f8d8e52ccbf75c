//! What the daemons of a service tell each other: that they are there, and whether they have a GPU; what they have admitted
//! of each client's share (`crate::rates`); and which meshes have kept their workers busy. A daemon that starts, or that was
//! cut off, asks one of the others what it knows.
//!
//! Nothing of it is kept anywhere but in the daemons. What is missed makes a limit less exact, and nothing else.

use std::sync::Arc;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::others::announce_every;
use super::service::SharedJobs;
use crate::digest::Digest;
use crate::http::state::AppState;
use crate::jobs::{Owner, Strikes};
use crate::rates::Spent;
use crate::shared_queue::{Heard, News};

/// Time between two messages of a daemon that has something to tell, of few daemons. Of more than [`FEW_TELLERS`] it is
/// as many times longer, because each of them hears all.
const TELL_EVERY: Duration = Duration::from_millis(200);

const FEW_TELLERS: u32 = 20;

/// Time after which another daemon is asked again what it knows.
const ASK_EVERY: Duration = Duration::from_secs(60);

/// Clients in a message, and in an answer. NATS takes messages of 1 MB.
const TOLD_MAX: usize = 2000;

/// Pause after a failure of the queue.
const PAUSE: Duration = Duration::from_secs(1);

/// A message to all.
#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct Told {
    /// The name of the daemon.
    server: String,
    /// It has a GPU, or has not tried to draw with one.
    has_gpu: bool,
    /// Clients, with the requests and the works that were admitted since the last message.
    spent: Vec<(String, u32, u32)>,
    /// Meshes that have kept workers busy since the last message.
    strikes: Vec<Struck>,
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
        // What is to be told is kept until somebody may hear it.
        if !shared.queue.is_connected() {
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
        if let Some(news) = &mut news {
            // What was missed while NATS was away is learnt with the next question.
            let _ = tokio::time::timeout(ASK_EVERY, shared.hear_of(&state, news)).await;
        } else {
            tokio::time::sleep(PAUSE).await;
        }
        news = shared.begin_to_hear(&state).await;
    }
}

impl SharedJobs {
    /// Asks another daemon what it knows, and hears all from now on. None if the queue cannot be reached.
    pub(super) async fn begin_to_hear(&self, state: &AppState) -> Option<News> {
        let (news, known) = self.queue.hear().await.ok()?;
        if let Some(known) = known.and_then(|bytes| serde_json::from_slice(&bytes).ok()) {
            learn(state, known);
        }
        self.others.listens();
        Some(news)
    }

    async fn hear_of(&self, state: &AppState, news: &mut News) {
        while let Some(heard) = news.next().await {
            match heard {
                Heard::Told(bytes) => {
                    if let Ok(told) = serde_json::from_slice::<Told>(&bytes)
                        && told.server != self.server
                    {
                        self.others.heard(&told.server, told.has_gpu);
                        take_over(state, told);
                    }
                }
                Heard::Asked(question) => self.queue.answer(question, bytes_of(&known(state))).await,
            }
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

fn take_over(state: &AppState, told: Told) {
    for (owner, requests, works) in told.spent {
        state.rates.add(&Owner::new(&owner), Spent { requests, works });
    }
    for strikes in told.strikes.iter().filter_map(Struck::strikes) {
        state.jobs.quarantine().add(strikes);
    }
}

/// What another daemon is told that asks.
fn known(state: &AppState) -> Known {
    let of_day = state.rates.of_day(TOLD_MAX).into_iter().map(|(owner, used)| (owner.to_string(), used)).collect();
    Known { of_day, strikes: state.jobs.quarantine().all().into_iter().map(Struck::from).collect() }
}

fn learn(state: &AppState, known: Known) {
    let of_day = known.of_day.into_iter().filter(|(_, used)| used.is_finite());
    state.rates.learn_of_day(of_day.map(|(owner, used)| (Owner::new(&owner), used)), Duration::ZERO);
    for strikes in known.strikes.iter().filter_map(Struck::strikes) {
        state.jobs.quarantine().learn(strikes);
    }
}

fn bytes_of(message: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(message).unwrap_or_default()
}

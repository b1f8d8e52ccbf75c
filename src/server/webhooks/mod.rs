//! Webhooks: when a job ends, its state is sent to the address that its request named. Deliveries are signed by the rules
//! of Standard Webhooks (standardwebhooks.com), and tried again with growing pauses until they are taken or given up.
//!
//! Invariants: a receiver that is slow or silent delays nobody else for long. No address of a private network is
//! connected to unless that is allowed ([`target`]); no redirect is followed. Nothing here knows what a job is.

mod client;
mod target;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use client::{Client, Outcome};
pub use client::{Secret, roots};
pub use target::{BadTarget, Target};

pub use ureq::tls::RootCerts;

use super::metrics::Metrics;

/// Threads that deliver.
const THREADS: usize = 4;

/// Deliveries to one host at the same time, so that a slow one leaves threads to others.
const PER_HOST: usize = 2;

/// Most deliveries that wait.
const WAITING_MAX: usize = 10_000;

/// Attempts for one delivery.
const ATTEMPTS: u32 = 8;

/// Growth of the pause from attempt to attempt.
const BACK_OFF: u32 = 4;

/// Time at the end of the process for deliveries that are due.
const CLOSING_TIME: Duration = Duration::from_secs(2);

/// A message about the end of a job, and its receiver.
#[derive(Clone, Debug)]
pub struct Delivery {
    /// Its id, the same in each attempt: receivers know by it what they have already.
    pub id: String,
    /// Its address.
    pub target: Target,
    /// The JSON that is sent.
    pub payload: String,
}

/// Makes a delivery of what has ended, on a thread that has time.
pub type Make = Box<dyn FnOnce() -> Option<Delivery> + Send>;

/// Hears that nothing more is sent of this id.
pub type Settled = Box<dyn Fn(&str) + Send + Sync>;

/// The settings of webhooks.
pub struct WebhookSettings {
    /// The key of signatures.
    pub secret: Secret,
    /// Addresses of private networks are allowed.
    pub to_private: bool,
    /// The certificates by which receivers are trusted.
    pub roots: RootCerts,
    /// The pause after the first attempt that fails.
    pub retry: Duration,
    /// Counts attempts and ends.
    pub metrics: Option<Arc<Metrics>>,
}

/// The deliveries. Clones share them.
#[derive(Clone)]
pub struct Webhooks(Arc<Inner>);

struct Inner {
    settings: WebhookSettings,
    settled: Settled,
    client: Client,
    state: Mutex<State>,
    /// There is more to do, or something has ended.
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// Ended jobs whose messages are not written yet.
    incoming: VecDeque<Make>,
    /// Deliveries that wait, by the time of their next attempt, each with the number of attempts so far.
    waiting: BTreeMap<(Instant, u64), (Delivery, u32)>,
    /// Deliveries on their way, by host.
    on_way: HashMap<String, usize>,
    serial: u64,
    is_closing: bool,
}

enum Next {
    Make(Make),
    Send(Delivery, u32),
    End,
}

impl std::fmt::Debug for Webhooks {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Webhooks").finish_non_exhaustive()
    }
}

impl Webhooks {
    /// Starts the threads.
    pub fn start(settings: WebhookSettings, settled: Settled) -> std::io::Result<Self> {
        let client = Client::new(settings.to_private, settings.roots.clone());
        let (state, changed) = (Mutex::default(), Condvar::new());
        let webhooks = Self(Arc::new(Inner { settings, settled, client, state, changed }));
        for number in 0..THREADS {
            let inner = webhooks.0.clone();
            std::thread::Builder::new().name(format!("webhook-{number}")).spawn(move || inner.run())?;
        }
        Ok(webhooks)
    }

    /// Reads the address of a webhook.
    pub fn target(&self, address: &str) -> Result<Target, BadTarget> {
        Target::read(address, self.0.settings.to_private)
    }

    /// True if as many deliveries wait as may.
    pub fn is_full(&self) -> bool {
        let state = self.0.lock();
        state.waiting.len() + state.incoming.len() >= WAITING_MAX
    }

    /// Number of deliveries that wait or are on their way.
    pub fn count(&self) -> usize {
        let state = self.0.lock();
        state.waiting.len() + state.incoming.len() + state.on_way.values().sum::<usize>()
    }

    /// Sends what `make` makes. It returns at once.
    pub fn send(&self, make: Make) {
        self.0.lock().incoming.push_back(make);
        self.0.changed.notify_one();
    }

    /// Ends the threads. What is due now gets a moment.
    pub fn close(&self) {
        let until = Instant::now() + CLOSING_TIME;
        let mut state = self.0.lock();
        state.is_closing = true;
        self.0.changed.notify_all();
        loop {
            let now = Instant::now();
            let is_due = state.waiting.first_key_value().is_some_and(|((at, _), _)| *at <= now);
            let left = until.saturating_duration_since(now);
            if left.is_zero() || !is_due && state.incoming.is_empty() && state.on_way.is_empty() {
                return;
            }
            state = self.0.changed.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Inner {
    fn run(&self) {
        loop {
            match self.next() {
                Next::End => return,
                Next::Make(make) => {
                    if let Some(delivery) = make() {
                        self.wait(delivery, 0, Duration::ZERO);
                    }
                }
                Next::Send(delivery, attempts) => self.attempt(delivery, attempts + 1),
            }
        }
    }

    fn next(&self) -> Next {
        let mut state = self.lock();
        loop {
            if let Some(make) = state.incoming.pop_front() {
                return Next::Make(make);
            }
            let now = Instant::now();
            let is_free = |(delivery, _): &(Delivery, u32)| {
                state.on_way.get(delivery.target.host()).is_none_or(|count| *count < PER_HOST)
            };
            let mut due = state.waiting.iter().take_while(|((at, _), _)| *at <= now);
            if let Some(place) = due.find(|(_, waiting)| is_free(waiting)).map(|(place, _)| *place)
                && let Some((delivery, attempts)) = state.waiting.remove(&place)
            {
                *state.on_way.entry(delivery.target.host().to_owned()).or_default() += 1;
                return Next::Send(delivery, attempts);
            }
            if state.is_closing {
                return Next::End;
            }
            // Those that are due wait for a host, and the end of what is on its way to it wakes.
            let next = state.waiting.keys().map(|(at, _)| *at).find(|at| *at > now);
            state = match next {
                Some(at) => {
                    let time = at.saturating_duration_since(now);
                    self.changed.wait_timeout(state, time).unwrap_or_else(PoisonError::into_inner).0
                }
                None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
            };
        }
    }

    fn attempt(&self, delivery: Delivery, attempts: u32) {
        let outcome = self.client.send(&delivery, &self.settings.secret);
        let (id, host) = (delivery.id.clone(), delivery.target.host().to_owned());
        match outcome {
            Outcome::Taken => {
                tracing::info!(%id, %host, attempts, "a webhook was delivered");
                self.end(&id, "delivered");
            }
            Outcome::Refused(reason) => {
                tracing::warn!(%id, %host, attempts, reason, "a webhook is not delivered");
                self.end(&id, "refused");
            }
            Outcome::Failed(reason) if attempts >= ATTEMPTS => {
                tracing::warn!(%id, %host, attempts, reason, "a webhook is given up");
                self.end(&id, "given_up");
            }
            Outcome::Failed(reason) => {
                let pause = pause(self.settings.retry, attempts);
                let again_ms = pause.as_millis();
                tracing::info!(%id, %host, attempts, reason, again_ms, "a webhook is tried again");
                if let Some(metrics) = &self.settings.metrics {
                    metrics.webhook("failed_attempt");
                }
                self.wait(delivery, attempts, pause);
            }
        }
        let mut state = self.lock();
        if let Some(count) = state.on_way.get_mut(&host) {
            *count -= 1;
            if *count == 0 {
                state.on_way.remove(&host);
            }
        }
        self.changed.notify_all();
    }

    fn end(&self, id: &str, end: &str) {
        if let Some(metrics) = &self.settings.metrics {
            metrics.webhook(end);
        }
        (self.settled)(id);
    }

    fn wait(&self, delivery: Delivery, attempts: u32, pause: Duration) {
        let mut state = self.lock();
        state.serial += 1;
        let place = (Instant::now() + pause, state.serial);
        state.waiting.insert(place, (delivery, attempts));
        self.changed.notify_one();
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The pause after so many attempts, up to a quarter longer by chance, so that what failed together does not come again
/// together.
fn pause(first: Duration, attempts: u32) -> Duration {
    let pause = first.saturating_mul(BACK_OFF.saturating_pow(attempts.saturating_sub(1)));
    let chance = f64::from(uuid::Uuid::now_v7().as_u128() as u32) / f64::from(u32::MAX);
    pause.saturating_add(pause.mul_f64(0.25 * chance)).min(Duration::from_secs(86_400))
}

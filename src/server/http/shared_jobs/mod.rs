//! Jobs of a service of several daemons: any of them accepts a job, any does it, and any tells of it.
//!
//! An accepted job is an object of the shared store and a message of the shared queue. `accept` writes both.
//! `worker` takes messages, and lets this daemon's workers do the jobs. `end` writes their ends. `find` makes mirrors:
//! jobs that show what the store and the queue know of a job, so that handlers treat all jobs alike. `webhooks` tells
//! receivers, one daemon at a time. `sweep` puts jobs that the queue has lost back into it, and forgets old ends. `news` is
//! what daemons tell each other of clients' shares, bad meshes and GPUs; `others` is
//! what each knows of the others.
//!
//! The store is the truth. Whatever the queue loses or gives out twice, a job ends once: its end is created by a
//! conditional write.

mod accept;
mod end;
mod find;
mod news;
mod others;
pub mod service;
mod sweep;
mod webhooks;
mod worker;

pub use accept::{accept, accept_all, sent_before};
pub use find::{delete, find, follow, unknown};

use std::sync::Arc;

use super::state::AppState;
use crate::shared_queue::Kind;
use service::SharedJobs;

/// Starts to take jobs, to tell webhooks, and to look after the queue. Returns once this daemon knows what the others
/// know of clients' shares and bad meshes.
pub async fn start(shared: &Arc<SharedJobs>, state: &Arc<AppState>) {
    let news = shared.begin_to_hear(state).await;
    tokio::spawn(worker::run(shared.clone(), state.clone(), Kind::Job));
    tokio::spawn(worker::run(shared.clone(), state.clone(), Kind::GpuJob));
    tokio::spawn(webhooks::run(shared.clone(), state.clone()));
    tokio::spawn(sweep::run(shared.clone()));
    tokio::spawn(news::tell(shared.clone(), state.clone()));
    tokio::spawn(news::hear(shared.clone(), state.clone(), news));
}

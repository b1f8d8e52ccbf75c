//! The daemon: [`http`] in front of [`jobs`] (the queue, the workers and their results) and [`store`] (meshes that stay).
//!
//! [`durable`] is the data folder, where both outlive the process. [`memory`] is the budget that
//! all of them share. [`shared_store`] and [`shared_queue`] are for several daemons that are one service. [`residents`] and [`pictures`] remember what was read and drawn, and
//! [`metrics`] what happened. [`keys`] says who may do what, [`rates`] how much, and [`signature`]
//! lets addresses be used without a key. [`warm_up`] makes the first picture come sooner,
//! [`priority`] lets answers go before pictures, [`webhooks`] tell receivers of the ends of jobs.
//! `config` has the settings, `telemetry` the log and traces.
//!
//! Architecture invariant: [`http`] alone knows the requests and answers of clients.

mod cache;
pub mod config;
pub mod digest;
pub mod durable;
pub mod http;
pub mod jobs;
pub mod keys;
pub mod memory;
pub mod metrics;
pub mod pictures;
pub mod priority;
pub mod rates;
pub mod residents;
pub mod shared_queue;
pub mod shared_store;
pub mod signature;
pub mod store;
pub mod telemetry;
pub mod warm_up;
pub mod webhooks;

//! Rules for the repository itself: the source tree, documents, the library's interface, and
//! `deploy/`.

mod deploy;
mod documents;
mod library;
pub mod structure;
mod systems;

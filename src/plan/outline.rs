//! What a hull needs.

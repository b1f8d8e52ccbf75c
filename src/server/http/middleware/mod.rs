//! Steps around every request, whatever its handler is.

pub mod auth;
pub mod cors;
mod drainable_body;
pub mod observe;
pub mod rates;
pub mod site;

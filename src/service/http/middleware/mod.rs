//! Steps around every request, whatever its handler is.

pub mod auth;
mod drainable_body;
pub mod observe;
pub mod site;

//! What happens around every request, whichever handler it has.

pub mod auth;
mod drainable_body;
pub mod observe;

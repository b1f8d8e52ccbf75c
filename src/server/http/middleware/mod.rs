//! Steps before and after the handlers. `observe` is around the whole router, and so is `cors` where origins are
//! configured. `site`, `auth` and `rates`, in this order, may refuse requests for `/metrics` and for the routes under
//! `/v1`.

pub mod auth;
pub mod cors;
mod drainable_body;
pub mod observe;
pub mod rates;
pub mod site;

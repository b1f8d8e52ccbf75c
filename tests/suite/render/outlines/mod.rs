//! What outlines leave out: crumbs, and what closed surfaces hide.

mod closed;
mod specks;

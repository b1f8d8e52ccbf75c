//! What outlines leave out: specks, and what closed surfaces hide.

mod closed;
mod specks;

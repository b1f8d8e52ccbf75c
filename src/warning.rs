//! Warnings: what a picture or a report was made in spite of.

/// Something in the file that was read around rather than refused.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Stable, snake case: `lines_ignored`.
    pub code: &'static str,
    /// One sentence.
    pub detail: String,
}

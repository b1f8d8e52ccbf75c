//! Warnings: faults of an input that do not prevent a picture or a report.

/// A fault in the file or the request that was tolerated rather than refused.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "isolate", derive(serde::Serialize, serde::Deserialize))]
pub struct Warning {
    /// A stable name in snake case: `lines_ignored`.
    #[cfg_attr(feature = "isolate", serde(skip))]
    pub code: &'static str,
    /// One sentence for the user.
    pub detail: String,
}

impl Warning {
    /// Memory that it takes, bytes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.detail.len()
    }
}

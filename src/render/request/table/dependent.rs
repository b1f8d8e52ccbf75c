//! A value of a request whose default depends on other keys. Until all keys are read, it only says
//! whether the request gives it.

/// A value that is given, or else settled when all keys are known.
#[derive(Clone, Copy, Debug)]
pub struct Dependent<T>(Option<T>);

impl<T> Dependent<T> {
    /// A value that is given.
    pub fn given(value: T) -> Self {
        Self(Some(value))
    }

    /// True if the request gives it.
    pub fn is_given(&self) -> bool {
        self.0.is_some()
    }

    /// The value, or its default.
    pub fn or(self, default: T) -> T {
        self.0.unwrap_or(default)
    }
}

impl<T> Default for Dependent<T> {
    fn default() -> Self {
        Self(None)
    }
}

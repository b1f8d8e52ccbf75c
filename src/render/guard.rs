//! A guard around calls of decoders from other crates: a panic in a decoder becomes an error.
//!
//! Decoders read files of unknown origin, which may be made to break them. A panic that is caught here
//! costs one job at most, and the error says which decoder failed. The panic hook has logged where.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// A decoder that panicked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the {0} decoder failed in a way that it should not, on data that is most likely broken; please report the file"
)]
pub struct Panicked(pub &'static str);

/// Runs `decode`. `decoder` names it in the error and for tests. What the decoder was changing when it
/// panicked must not be used any more.
pub fn guarded<T>(decoder: &'static str, decode: impl FnOnce() -> T) -> Result<T, Panicked> {
    let decode = || {
        hook::panic_if_asked(decoder);
        decode()
    };
    catch_unwind(AssertUnwindSafe(decode)).map_err(|_| Panicked(decoder))
}

/// Makes decoders panic, for tests.
#[cfg(debug_assertions)]
pub mod hook {
    use std::sync::OnceLock;

    static PANICS_IN: OnceLock<String> = OnceLock::new();

    /// From now on the decoder of this name panics, in this process.
    pub fn panic_in(decoder: String) {
        let _ = PANICS_IN.set(decoder);
    }

    #[allow(clippy::panic)]
    pub(super) fn panic_if_asked(decoder: &str) {
        if PANICS_IN.get().is_some_and(|asked| asked == decoder) {
            panic!("a test asked for it");
        }
    }
}

/// There is no hook in what is released.
#[cfg(not(debug_assertions))]
mod hook {
    pub(super) fn panic_if_asked(_: &str) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_that_names_the_decoder() {
        assert_eq!(guarded("Draco", || 3), Ok(3));
        let none: [u8; 0] = std::hint::black_box([]);
        let error = guarded("Draco", || none[none.len()]).unwrap_err();
        assert!(error == Panicked("Draco") && error.to_string().contains("the Draco decoder failed"), "{error}");
    }
}

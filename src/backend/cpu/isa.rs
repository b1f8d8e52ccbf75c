//! One source, several instruction sets.
//!
//! The hot loops are written once, over arrays of [`LANES`] values, and compiled twice: for the baseline and for AVX2.
//! Rust never fuses or reorders floating-point operations, so both give the same bytes; only the speed differs.

/// Values handled side by side: one AVX2 register of 32-bit numbers.
pub const LANES: usize = 8;

/// An instruction set to run on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    /// What every machine of this architecture has.
    Baseline,
    /// 256-bit integer and float vectors.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Isa {
    /// The widest that this machine has.
    pub fn detect() -> Self {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Self::Avx2;
        }
        Self::Baseline
    }
}

/// Defines `$name(isa, args...)`, which runs `$kernel(args...)` compiled for `isa`. The kernel and what it calls in its
/// loops must be `#[inline(always)]`, or they stay compiled for the baseline.
macro_rules! dispatch {
    ($(#[$doc:meta])* pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $kernel:path) => {
        $(#[$doc])*
        #[allow(unsafe_code)]
        pub fn $name(isa: $crate::backend::cpu::isa::Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
                fn avx2($($arg: $ty),*) {
                    $kernel($($arg),*)
                }
                if isa == $crate::backend::cpu::isa::Isa::Avx2 {
                    // SAFETY: `Isa::Avx2` is only made where the processor reports AVX2; every such processor has the
                    // bit-manipulation extensions named beside it.
                    return unsafe { avx2($($arg),*) };
                }
            }
            let _ = isa;
            $kernel($($arg),*)
        }
    };
}
pub(super) use dispatch;

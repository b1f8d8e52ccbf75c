//! One source, several instruction sets.
//!
//! The hot loops of every stage are written once, over arrays of [`LANES`] values, and compiled
//! once per instruction set. Rust neither fuses nor reorders floating-point operations, so all give
//! the same bytes; only the speed differs.
//!
//! The innermost steps of triangles and of lines are an exception: they have a second version in AVX2
//! instructions, in files called `avx2.rs` or `*_avx2.rs`, and the innermost of all a third one in AVX-512,
//! `geometry/batch_avx512.rs` and `mixed/triangle/avx512.rs`.
//!
//! To add an instruction set (NEON): a variant of `Level` under its `cfg`, a list of
//! features beside [`for_avx2_features`], a constructor that detects all of them, and an arm in
//! [`dispatch`].

/// Values handled side by side: one AVX2 register of 32-bit numbers.
pub const LANES: usize = 8;

/// An instruction set that this processor is known to have.
///
/// The type is opaque and its constructors detect what they return, so safe code cannot choose an
/// instruction set that the processor lacks:
///
/// ```compile_fail
/// let isa = crate::backend::cpu::Isa::Avx2;
/// ```
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Isa(Level);

/// Never made outside of [`Isa`]'s constructors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Level {
    Baseline,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX2, and the first part of AVX-512.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

/// Calls a macro with the features of the AVX2 level, followed by its own input: detection and
/// compilation cannot name different ones. Those that AVX2 implies are named as well, because
/// enabling it enables them.
macro_rules! for_avx2_features {
    ($($callback:ident)::+ ! { $($input:tt)* }) => {
        $($callback)::+! {
            ["sse3" "ssse3" "sse4.1" "sse4.2" "avx" "avx2" "f16c" "bmi1" "bmi2" "lzcnt" "popcnt"]
            $($input)*
        }
    };
}

/// True if the processor reports every feature of a list.
#[cfg(target_arch = "x86_64")]
macro_rules! are_detected {
    ([$($feature:tt)+]) => {
        $(std::arch::is_x86_feature_detected!($feature))&&+
    };
}

impl Isa {
    /// The instructions that every processor of this architecture has.
    pub fn baseline() -> Self {
        Self(Level::Baseline)
    }

    /// The widest that this processor has.
    pub fn detect() -> Self {
        Self::avx512().or_else(Self::avx2).unwrap_or_else(Self::baseline)
    }

    /// All that this processor has, the baseline first: for tests that compare them.
    pub fn available() -> Vec<Self> {
        [Some(Self::baseline()), Self::avx2(), Self::avx512()].into_iter().flatten().collect()
    }

    /// The name used in reports.
    pub fn name(self) -> &'static str {
        match self.0 {
            Level::Baseline => "baseline",
            #[cfg(target_arch = "x86_64")]
            Level::Avx2 => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512 => "avx512",
        }
    }

    /// True if code compiled for the AVX2 level may run.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(in crate::backend::cpu) fn has_avx2(self) -> bool {
        matches!(self.0, Level::Avx2 | Level::Avx512)
    }

    /// True if code compiled for the AVX-512 level may run.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(in crate::backend::cpu) fn has_avx512(self) -> bool {
        self.0 == Level::Avx512
    }

    /// True if the steps of `geometry::batch` are written in this level's own instructions.
    #[inline(always)]
    pub(in crate::backend::cpu) fn has_own_batch(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        return self.has_avx2();
        #[cfg(not(target_arch = "x86_64"))]
        return false;
    }

    #[cfg(target_arch = "x86_64")]
    fn avx2() -> Option<Self> {
        for_avx2_features!(are_detected! {}).then_some(Self(Level::Avx2))
    }

    #[cfg(target_arch = "x86_64")]
    fn avx512() -> Option<Self> {
        // Those that AVX-512 implies are named as well.
        let are_there = are_detected!(["fma" "f16c" "avx512f"]);
        (Self::avx2().is_some() && are_there).then_some(Self(Level::Avx512))
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn avx2() -> Option<Self> {
        None
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn avx512() -> Option<Self> {
        None
    }
}

impl std::fmt::Debug for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// Defines `$name(isa, args...)`, which runs `$kernel(args...)` compiled for `isa`. The kernel and
/// what it calls in its loops must be `#[inline(always)]`, or they stay compiled for the baseline.
macro_rules! dispatch {
    ($($function:tt)*) => {
        $crate::backend::cpu::isa::for_avx2_features! { $crate::backend::cpu::isa::dispatch_to! { $($function)* } }
    };
}

/// [`dispatch`], given the features.
macro_rules! dispatch_to {
    (
        [$($feature:tt)+]
        $(#[$doc:meta])* pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $kernel:path
    ) => {
        $(#[$doc])*
        #[allow(unsafe_code)]
        pub fn $name(isa: $crate::backend::cpu::isa::Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[inline(never)]
                $(#[target_feature(enable = $feature)])+
                fn avx2($($arg: $ty),*) {
                    $kernel($($arg),*)
                }
                if isa.has_avx2() {
                    // SAFETY: `has_avx2` is true only of a value that `Isa::avx2` has made, or `Isa::avx512` after
                    // asking it. It makes one where the processor reports every feature that `avx2` above
                    // enables: both lists are `for_avx2_features`'s.
                    return unsafe { avx2($($arg),*) };
                }
            }
            let _ = isa;
            $kernel($($arg),*)
        }
    };
}

pub(super) use {dispatch, dispatch_to, for_avx2_features};

#[cfg(test)]
mod tests {
    use super::*;

    dispatch! {
        /// Counts the bits of each value.
        pub fn count_bits(values: &[u32], counts: &mut [u32]) = count_bits_kernel
    }

    #[inline(always)]
    fn count_bits_kernel(values: &[u32], counts: &mut [u32]) {
        for (value, count) in values.iter().zip(counts) {
            *count = value.count_ones() + value.leading_zeros();
        }
    }

    #[test]
    fn each_available_instruction_set_gives_the_same() {
        let all = Isa::available();
        assert_eq!((all.first(), all.last()), (Some(&Isa::baseline()), Some(&Isa::detect())));
        let values: Vec<u32> = (0..1000).map(|i: u32| i.wrapping_mul(0x9E37_79B9)).collect();
        let want: Vec<u32> = values.iter().map(|v| v.count_ones() + v.leading_zeros()).collect();
        for isa in all {
            let mut counts = vec![0; values.len()];
            count_bits(isa, &values, &mut counts);
            assert_eq!(counts, want, "{isa:?}");
        }
    }

    /// AVX2 without the bit-manipulation extensions, as some hypervisors present it, is the
    /// baseline.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn every_enabled_feature_is_detected() {
        macro_rules! missing {
            ([$($feature:tt)+]) => {
                [$((!std::arch::is_x86_feature_detected!($feature)).then_some($feature)),+]
            };
        }
        let missing: Vec<&str> = for_avx2_features!(missing! {}).into_iter().flatten().collect();
        assert_eq!(missing.is_empty(), Isa::detect().has_avx2(), "{missing:?}");
    }
}

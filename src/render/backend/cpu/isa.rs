//! The instruction sets of the processor (the baseline, AVX2, AVX-512), and macros that compile one
//! source for several of them.
//!
//! Most hot loops are written once and compiled for the baseline and for AVX2, a few of the
//! innermost also for AVX-512. Most of these are plain loops, often over arrays of [`LANES`]
//! values, which [`dispatch`] compiles. Some innermost steps are written in the vectors of the
//! crate `fearless_simd`, and [`with_simd`] and [`with_widest_simd`] compile them. Files called
//! `avx2.rs` and `avx512.rs` hold second versions of other steps, each written for one instruction
//! set. Rust neither fuses nor reorders floating-point operations, so all give the same bytes; only
//! the speed differs.
//!
//! Code in the vectors of `fearless_simd` calls no closure that takes or makes vectors. The
//! compiler may keep a closure as a function of its own, and that one would be compiled for the
//! baseline alone.
//!
//! To add an instruction set: a variant of [`Level`] that holds its token, a constructor that
//! `detect` and `available` call, and arms in the macros.

#[cfg(target_arch = "x86_64")]
use fearless_simd::x86::{Avx2, Avx512};

/// Values handled side by side: one AVX2 register of 32-bit numbers.
pub const LANES: usize = 8;

/// An instruction set that this processor is known to have.
#[derive(Clone, Copy)]
pub struct Isa(Level);

/// An instruction set, with the token of `fearless_simd` that proves that the processor has it.
#[derive(Clone, Copy)]
pub(in crate::backend::cpu) enum Level {
    /// The instructions that every processor of this architecture has.
    Baseline,
    /// AVX2, and what processors have that have it (x86-64-v3).
    #[cfg(target_arch = "x86_64")]
    Avx2(Avx2),
    /// AVX-512 as of Ice Lake and Zen 4.
    #[cfg(target_arch = "x86_64")]
    Avx512(Avx512),
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
            Level::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Level::Avx512(_) => "avx512",
        }
    }

    /// With its token.
    #[inline(always)]
    pub(in crate::backend::cpu) fn level(self) -> Level {
        self.0
    }

    /// The token of AVX2, where the processor may run code compiled for it.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(in crate::backend::cpu) fn as_avx2(self) -> Option<Avx2> {
        match self.0 {
            Level::Baseline => None,
            Level::Avx2(simd) => Some(simd),
            Level::Avx512(simd) => fearless_simd::Simd::level(simd).as_avx2(),
        }
    }

    /// True if code compiled for AVX2 may run.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(in crate::backend::cpu) fn has_avx2(self) -> bool {
        !matches!(self.0, Level::Baseline)
    }

    /// True if code compiled for AVX-512 may run.
    #[cfg(target_arch = "x86_64")]
    #[inline(always)]
    pub(in crate::backend::cpu) fn has_avx512(self) -> bool {
        matches!(self.0, Level::Avx512(_))
    }

    #[cfg(target_arch = "x86_64")]
    fn avx2() -> Option<Self> {
        fearless_simd::Level::new().as_avx2().map(|simd| Self(Level::Avx2(simd)))
    }

    #[cfg(target_arch = "x86_64")]
    fn avx512() -> Option<Self> {
        fearless_simd::Level::new().as_avx512().map(|simd| Self(Level::Avx512(simd)))
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

impl PartialEq for Isa {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl std::fmt::Debug for Isa {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// The token of the baseline.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
#[allow(unsafe_code)]
pub(in crate::backend::cpu) fn baseline() -> fearless_simd::x86::Sse2 {
    // SAFETY: every processor of this architecture has SSE2.
    unsafe { fearless_simd::x86::Sse2::assume_supported() }
}

/// Defines `$name(isa, args...)`, which runs `$kernel(args...)` compiled for the baseline or AVX2. The kernel and
/// what it calls in its loops must be `#[inline(always)]`, or they stay compiled for the baseline.
macro_rules! dispatch {
    ($(#[$doc:meta])* pub fn $name:ident($($arg:ident: $ty:ty),* $(,)?) = $kernel:path) => {
        $(#[$doc])*
        pub fn $name(isa: $crate::backend::cpu::isa::Isa, $($arg: $ty),*) {
            #[cfg(target_arch = "x86_64")]
            if let Some(simd) = isa.as_avx2() {
                return fearless_simd::Simd::vectorize(
                    simd,
                    #[inline(always)]
                    move || $kernel($($arg),*),
                );
            }
            let _ = isa;
            $kernel($($arg),*)
        }
    };
}

/// Evaluates an expression in vectors of [`LANES`] values, given the token by which they are made: that of AVX2 or of
/// the baseline. What it calls must be `#[inline(always)]`.
macro_rules! with_simd {
    ($isa:expr, $simd:ident => $body:expr) => {{
        #[cfg(target_arch = "x86_64")]
        {
            if let Some($simd) = $isa.as_avx2() {
                fearless_simd::Simd::vectorize(
                    $simd,
                    #[inline(always)]
                    || $body,
                )
            } else {
                let $simd = $crate::backend::cpu::isa::baseline();
                $body
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let _ = $isa;
            fearless_simd::dispatch!(fearless_simd::Level::baseline(), $simd => $body)
        }
    }};
}

/// As [`with_simd`], in vectors of the processor's own width: also those of AVX-512.
macro_rules! with_widest_simd {
    ($isa:expr, $simd:ident => $body:expr) => {{
        #[cfg(target_arch = "x86_64")]
        {
            if let $crate::backend::cpu::isa::Level::Avx512($simd) = $isa.level() {
                fearless_simd::Simd::vectorize(
                    $simd,
                    #[inline(always)]
                    || $body,
                )
            } else {
                $crate::backend::cpu::isa::with_simd!($isa, $simd => $body)
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            $crate::backend::cpu::isa::with_simd!($isa, $simd => $body)
        }
    }};
}

pub(super) use {dispatch, with_simd, with_widest_simd};

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

    /// Each instruction set runs its own code, in vectors of its own width.
    #[cfg(target_arch = "x86_64")]
    #[test]
    fn each_instruction_set_has_its_width() {
        #[inline(always)]
        fn width<V: fearless_simd::Simd>(_: V) -> usize {
            size_of::<V::f32s>() / size_of::<f32>()
        }
        for isa in Isa::available() {
            let (eight, widest) = (with_simd!(isa, simd => width(simd)), with_widest_simd!(isa, simd => width(simd)));
            let want = match isa.name() {
                "baseline" => [4, 4],
                "avx2" => [8, 8],
                _ => [8, 16],
            };
            assert_eq!([eight, widest], want, "{isa:?}");
        }
    }
}

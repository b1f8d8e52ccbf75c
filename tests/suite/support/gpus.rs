//! The GPU that all tests share, opened with 64-bit atomics and without, and others for tests that
//! count what their own draws.

use std::sync::{Arc, OnceLock};

use meshsnap_render::backend::DrawError;
use meshsnap_render::backend::gpu::{AtomicsChoice, Gpu, GpuKind};

use super::skip::{Need, skip};
use super::truth::is_long;

/// The GPU with 64-bit atomics (where it has them) and without. None, and the test counts as
/// skipped, where there is no Vulkan.
#[track_caller]
pub fn gpus() -> Option<&'static [Arc<Gpu>; 2]> {
    static GPUS: OnceLock<Option<[Arc<Gpu>; 2]>> = OnceLock::new();
    let opened = GPUS.get_or_init(open);
    if opened.is_none() {
        skip(Need::Gpu, "Vulkan");
    }
    opened.as_ref()
}

/// The GPUs that draw a test's case of this number: one in turn, or both in a long run.
#[track_caller]
pub fn gpus_of_case(number: usize) -> &'static [Arc<Gpu>] {
    match gpus() {
        None => &[],
        Some(both) if is_long() => both,
        Some(both) => std::slice::from_ref(&both[number % 2]),
    }
}

/// As [`gpus`], and no other test draws on them.
#[track_caller]
pub fn own_gpus() -> Option<[Arc<Gpu>; 2]> {
    let opened = open();
    if opened.is_none() {
        skip(Need::Gpu, "Vulkan");
    }
    opened
}

fn open() -> Option<[Arc<Gpu>; 2]> {
    let open = |atomics| Gpu::open(GpuKind::Any, atomics, None).map(Arc::new);
    match (open(AtomicsChoice::Best), open(AtomicsChoice::Force32)) {
        (Ok(best), Ok(force32)) => {
            println!("GPU: {:?}", best.info());
            Some([best, force32])
        }
        (Err(DrawError::NoGpu(reason)), _) => {
            println!("no Vulkan here: {reason}");
            None
        }
        (a, b) => panic!("{:?} {:?}", a.err(), b.err()),
    }
}

//! The GPU that all tests share.

use std::sync::{Arc, OnceLock};

use meshsnap::backend::DrawError;
use meshsnap::backend::gpu::{AtomicsChoice, Gpu, GpuKind};

use super::skip::{Need, skip};

/// The GPU with 64-bit atomics (where it has them) and without. None, and the test counts as
/// skipped, where there is no Vulkan.
#[track_caller]
pub fn gpus() -> Option<&'static [Arc<Gpu>; 2]> {
    static GPUS: OnceLock<Option<[Arc<Gpu>; 2]>> = OnceLock::new();
    let opened = GPUS.get_or_init(|| {
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
    });
    if opened.is_none() {
        skip(Need::Gpu, "Vulkan");
    }
    opened.as_ref()
}

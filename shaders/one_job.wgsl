// The uniforms of kernels that draw for a single job (one picture) per dispatch: `frame`, those of the picture, and
// `batch`, those of the dispatch. Kernels that several jobs share have gang.wgsl instead, with the same names.
//
// Uses: common.wgsl (Batch, Frame).

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<uniform> batch: Batch;

// To be called first, with the third coordinate of the workgroup.
fn begin_job(number: u32) {
}

// The job's number among those that share the dispatch.
fn job() -> u32 {
    return 0u;
}

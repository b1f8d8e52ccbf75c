// The uniforms of kernels that draw for one job.
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

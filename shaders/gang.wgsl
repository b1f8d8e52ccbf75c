// The uniforms of kernels that draw for a gang: up to JOBS_MAX jobs (one picture each) that share one dispatch. The
// third coordinate of a workgroup is the number of its job. Kernels that draw for a single job have one_job.wgsl
// instead. src/render/backend/gpu/gang/ explains gangs.
//
// Uses: common.wgsl (Batch, Frame, JOBS_MAX).

@group(0) @binding(0) var<uniform> frames: array<Frame, JOBS_MAX>;
@group(0) @binding(1) var<uniform> batches: array<Batch, JOBS_MAX>;

// Those of the job.
var<private> frame: Frame;
var<private> batch: Batch;
var<private> job_number: u32;

// To be called first, with the third coordinate of the workgroup.
fn begin_job(number: u32) {
    frame = frames[number];
    batch = batches[number];
    job_number = number;
}

// The job's number among those that share the dispatch.
fn job() -> u32 {
    return job_number;
}

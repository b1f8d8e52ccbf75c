// The test whether depth peeling is done: whether the previous round, which looked for the next layer of
// transparent triangles, has left nothing to find (stage peeling). The commands of a round are recorded without
// waiting for the round before it, so the kernels of a needless round end at once by this test. No twin: the CPU
// ends its loop over the rounds.
//
// Uses: common.wgsl (has, PEELING), one_job.wgsl (batch).

// Per layer: 1 if there may be another behind it.
@group(1) @binding(28) var<storage, read> peel_rounds: array<u32>;

// True if the previous round of depth peeling has left nothing to find.
fn is_peeling_done() -> bool {
    return has(PEELING) && batch.layer > 0u && peel_rounds[batch.layer - 1u] == 0u;
}

// The index of a sample in the visibility buffer or in a layer of depth peeling (stage visibility): pixels lie row
// by row, the samples of a pixel together.
//
// Uses: common.wgsl (sample_count), one_job.wgsl or gang.wgsl (batch).

fn sample_index(x: i32, y: i32, n: i32) -> u32 {
    let pixel = (y - batch.row_first) * (batch.column_end - batch.column_first) + (x - batch.column_first);
    return u32(pixel * sample_count() + n);
}

// Where a sample's word is: row by row, a pixel's samples together.
fn sample_index(x: i32, y: i32, n: i32) -> u32 {
    return u32(((y - batch.row_first) * frame.width + x) * sample_count() + n);
}

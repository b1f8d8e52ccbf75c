// Stage mixed, per pixel of a band and one more on each side: where colours break off from sample to sample. Twin of
// find_breaks in src/backend/cpu/mixed/find/mod.rs.

@group(1) @binding(22) var<storage, read_write> mixed: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn breaks(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    if i == 0u {
        // Nothing of the band is counted yet.
        for (var w = 0u; w < HEAD_WORDS; w++) {
            mixed[w] = 0u;
        }
    }
    let columns = frame.width + 2;
    let pixel = vec2(i32(i) % columns - 1, batch.row_first - 1 + i32(i) / columns);
    let first = id_at(pixel, 0);
    var found = 0u;
    if is_seen(pixel) {
        var before = first;
        for (var s = 1; s < sample_count(); s++) {
            let id = id_at(pixel, s);
            found |= breaks_of(step_between(before, id), BREAKS_OWN);
            before = id;
        }
    }
    found |= breaks_of(step_between(id_at(pixel - vec2(1, 0), 0), first), BREAKS_LEFT);
    found |= breaks_of(step_between(id_at(pixel - vec2(0, 1), 0), first), BREAKS_UPPER);
    mixed[breaks_at(pixel)] = found;
}

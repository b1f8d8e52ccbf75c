// The list of mixed pixels, which are drawn again from more points (stage mixed). breaks.wgsl and thin.wgsl have
// marked colour breaks, places where the colour differs clearly. A pixel is mixed if it has a break between its
// own samples, at a thin triangle in it, or across one of its four sides, or if a neighbour on one of these sides
// has a strong break among its own samples. It gets 256 points if any of these breaks is strong, else 64. Pixels
// in which a transparent layer is visible are left out, because layers are composited per sample. Twin of join and
// leave_layers in src/render/backend/cpu/mixed/find/mod.rs.
//
// Each mixed pixel gets a number from an atomic counter. The order varies from run to run, but nothing depends on
// it.
//
// Uses: common.wgsl (has, PEELING, sample_count, WORKGROUP), one_job.wgsl (batch, frame),
// mixed/place.wgsl (breaks_at, FEW, list_at, LIST_END, number_at, pixel_at), peeling/state.wgsl
// (ALPHA_MIN, PeelState).

@group(1) @binding(22) var<storage, read_write> mixed: array<atomic<u32>>;
// Peeled layers per sample.
@group(1) @binding(27) var<storage, read> peel_state: array<PeelState>;

// Bits of a neighbour that make a pixel mixed. Of every neighbour: breaks among its own samples that are more than
// slight. Of the one on the right, also breaks across the side between both pixels; likewise of the one below.
const OWN_PLACES: u32 = 0x10u;
const LEFT_PLACES: u32 = 0x32u;
const UPPER_PLACES: u32 = 0x54u;
const HARD_PLACES: u32 = 0xF0u;

@compute @workgroup_size(WORKGROUP)
fn mixed_pixels(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    let found = breaks_in(pixel)
        | (breaks_in(pixel - vec2(1, 0)) & OWN_PLACES)
        | (breaks_in(pixel + vec2(1, 0)) & LEFT_PLACES)
        | (breaks_in(pixel - vec2(0, 1)) & OWN_PLACES)
        | (breaks_in(pixel + vec2(0, 1)) & UPPER_PLACES);
    if found == 0u || (has(PEELING) && has_layer(i)) {
        atomicStore(&mixed[number_at(i)], 0u);
        return;
    }
    let few = select(FEW, 0u, (found & HARD_PLACES) != 0u);
    let number = atomicAdd(&mixed[0], 1u);
    atomicStore(&mixed[number_at(i)], (number + 1u) | few);
    atomicStore(&mixed[pixel_at(number)], i | few);
    atomicStore(&mixed[list_at(number)], LIST_END);
}

// True if a layer is seen at some sample of the i-th pixel.
fn has_layer(i: u32) -> bool {
    let samples_px = u32(sample_count());
    for (var s = 0u; s < samples_px; s++) {
        if peel_state[i * samples_px + s].color.w > ALPHA_MIN {
            return true;
        }
    }
    return false;
}

fn breaks_in(pixel: vec2<i32>) -> u32 {
    return atomicLoad(&mixed[breaks_at(pixel)]);
}

// The coverage of a pixel by lines, found from 256 points of the pixel (stage lines). Used in pixels in which the
// surface ends or a face is partly hidden, because there the quicker way of holes.wgsl, a sum of areas, is not right.
// In some of these (in all, with one sample per pixel) points are not right either, and edge.wgsl draws the lines
// instead. Each point belongs to one of the pixel's samples. A point is free of lines if its sample shows a face and
// the point lies at least half a line's width inside that face, or if its sample shows nothing. The strokes of
// silhouette edges are added to the points. Twin of src/render/backend/cpu/lines/holes/free_points.rs. coverage.wgsl
// declares the buffers.
//
// Uses: common.wgsl (pixel_corner, rn, sample_count), one_job.wgsl (batch, frame),
// lines/coverage.wgsl (sample_masks, strokes, triangles, vertices), lines/holes/inset.wgsl
// (inset_of, InsetSide), lines/lattice.wgsl (lattice_points, product, units), lines/seen.wgsl
// (seen_at), lines/stroke_words.wgsl (AREA_UNIT, AREA_WORD, CARRY_WORD, COUNT_WORD, MASK_WORD,
// MASK_WORDS, STROKE_WORDS).

// A side of an inset: the points at least `least` along the normal lie inside. Both in 1/16384 px.
struct HalfPlane {
    normal: vec2<i32>,
    least: i32,
};

// Adds what lines cover of a marked pixel to its strokes, by points.
fn add_points(i: u32) {
    let pixel = vec2(i32(i) % frame.width, batch.row_first + i32(i) / frame.width);
    let count = u32(sample_count());
    let at = STROKE_WORDS * i;
    var mask: array<u32, MASK_WORDS>;
    for (var s = 0u; s < count; s++) {
        let id = seen_at(pixel, s).x;
        // A marked pixel shows no hull, and no face that is clipped.
        if id >= frame.triangle_count {
            continue;
        }
        let a = vertices[triangles[3u * id]];
        let b = vertices[triangles[3u * id + 1u]];
        let c = vertices[triangles[3u * id + 2u]];
        let inset = inset_of(vec2(a.x, a.y), vec2(b.x, b.y), vec2(c.x, c.y));
        let sides = array<HalfPlane, 3>(
            half_plane(inset.sides[0], pixel),
            half_plane(inset.sides[1], pixel),
            half_plane(inset.sides[2], pixel),
        );
        // frame.zero keeps compilers from unrolling the loop, as in stroke.wgsl.
        for (var w = 0u; w < MASK_WORDS + frame.zero; w++) {
            var cell = sample_masks[MASK_WORDS * s + w];
            if inset.is_open && cell != 0u {
                cell &= ~(points_within(sides, 2u * w) | points_within(sides, 2u * w + 1u) << 16u);
            }
            mask[w] |= cell;
        }
    }
    var points = 0u;
    for (var w = 0u; w < MASK_WORDS; w++) {
        points += countOneBits(mask[w]);
        strokes[at + MASK_WORD + w] |= mask[w];
    }
    // Each point's area is that of one of 256; sums that have gone round are smaller than before.
    let area = strokes[at + AREA_WORD] + points * u32(AREA_UNIT / 256.0);
    let all = strokes[at + COUNT_WORD] + points;
    strokes[at + CARRY_WORD] += select(0u, 1u, area < strokes[at + AREA_WORD])
        + select(0u, 0x10000u, all < strokes[at + COUNT_WORD]);
    strokes[at + AREA_WORD] = area;
    strokes[at + COUNT_WORD] = all;
}

fn half_plane(side: InsetSide, pixel: vec2<i32>) -> HalfPlane {
    let from_corner = vec2<f32>(pixel_corner(pixel) + 128) - side.corner;
    let distance = rn(side.unit.x * from_corner.y) - rn(side.unit.y * from_corner.x);
    let least = rn((batch.line_width * 128.0 - distance) * (1.0 / 256.0));
    return HalfPlane(vec2(units(-side.unit.y), units(side.unit.x)), units(least));
}

// The sixteen points of a word of the mask that lie in three half planes.
fn points_within(sides: array<HalfPlane, 3>, word: u32) -> u32 {
    return four_within(sides, word, 0u) | four_within(sides, word, 4u) | four_within(sides, word, 8u)
        | four_within(sides, word, 12u);
}

// Those of the points from bit `first` on.
fn four_within(sides: array<HalfPlane, 3>, word: u32, first: u32) -> u32 {
    let points = lattice_points(word, first);
    var inside = vec4(true);
    for (var k = 0u; k < 3u; k++) {
        let place = product(sides[k].normal, points.x, points.y);
        inside = inside & (place >= vec4(sides[k].least));
    }
    let bits = select(vec4(0u), vec4(1u, 2u, 4u, 8u), inside);
    return ((bits.x | bits.y) | (bits.z | bits.w)) << first;
}

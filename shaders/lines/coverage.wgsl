// The coverage of each pixel by the lines of a pass (lines of one width and colour), and the compositing of their
// colour over the pixel, weighted by the coverage (stage lines). A stroke is the area that the line of one part of
// an edge covers. The coverage is that of the union of all strokes in the pixel, or follows from the area that
// lines leave free (holes/holes.wgsl). Where hidden parts fade, what whole edges cover beyond the visible parts counts
// a quarter: the kernel runs after the strokes of whole edges, and again after those of visible parts. Twin of
// src/render/backend/cpu/lines/coverage.rs.
//
// Uses: common.wgsl (ADAPTIVE, FADES_HIDDEN, FIRST_PASS, first_visibility_sample, has, HOLED,
// HOLES, HULL, LIT_PASS, PEELING, recip, rn, rn3, rn4, rolled_off, sample_count, SHOWN_VISIBLE,
// SURFACE, TINTED_PASS, Vertex, wide_to_f32, WORKGROUP), one_job.wgsl (batch, frame),
// geometry/steepness.wgsl (NEARER_RATIO), lines/holes/free_points.wgsl (add_points),
// lines/stroke_words.wgsl (AREA_UNIT, AREA_WORD, CARRY_WORD, COUNT_WORD, HOLE_UNIT, HOLE_WORD,
// MARKED, MASK_WORD, MASK_WORDS, POINTS, SLACK_WORD, STROKE_WORDS, STROKED, WHOLE_WORD),
// mixed/place.wgsl (border_at, FEW, number_at), over.wgsl (background_at, flip_alpha_sign,
// is_composited, over_background), peeling/state.wgsl (ALPHA_MIN, PeelState), peeling/tints.wgsl
// (tint_at, tint_depths_at, tint_steepness_at, TINTS).

@group(1) @binding(2) var<storage, read> triangles: array<u32>;
@group(1) @binding(3) var<storage, read> vertices: array<Vertex>;
// Visibility buffer; 0 where a sample shows nothing.
@group(1) @binding(4) var<storage, read> samples: array<vec2<u32>>;
// Peeled layers per sample.
@group(1) @binding(27) var<storage, read> peel_state: array<PeelState>;
// Per pixel, the surface over nothing or, where a line is, the finished colour so far; over.wgsl
// tells them apart. Then, per pixel, the light on the pass's lines, and the layers that tint them,
// laid out as in tints.wgsl.
@group(1) @binding(9) var<storage, read_write> colors: array<vec4<f32>>;
// Per pixel, a face; then, per pixel, the depth of the pass's nearest line, where layers tint it.
@group(1) @binding(11) var<storage, read_write> owners: array<u32>;
// Strokes per pixel, as stroke_words.wgsl lays them out.
@group(1) @binding(12) var<storage, read_write> strokes: array<u32>;
// The colour of each pass. Then, for each pass whose lines fade from place to place, a head and the opacities at the
// points of a grid over the picture, four per vector. The head is the share of the distance between two points that
// a pixel takes, and the number of points per row. See LineFade in src/render/plan/lines/fade.rs.
@group(1) @binding(17) var<storage, read> line_colors: array<vec4<f32>>;
// The band's mixed pixels, as place.wgsl lays them out.
@group(1) @binding(22) var<storage, read> mixed: array<u32>;
// Per sample, the points assigned to it, as stroke.wgsl numbers them.
@group(1) @binding(29) var<storage, read> sample_masks: array<u32>;

// A union of strokes is taken to differ from its points by at most this many times the largest
// difference between a stroke and its points. Of more strokes in one pixel, some overlap.
const STROKES_SIDE_BY_SIDE: f32 = 4.0;

// The share of their colour that fading hidden parts keep.
const FADE: f32 = 0.25;

@compute @workgroup_size(WORKGROUP)
fn coverage(@builtin(global_invocation_id) gid: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = gid.x + gid.y * groups.x * WORKGROUP;
    if i >= batch.count {
        return;
    }
    // Without a surface nothing has written the colours yet.
    if (batch.line_flags & FIRST_PASS) != 0u && !has(SURFACE | HULL) {
        colors[i] = flip_alpha_sign(background_at(i));
    }
    let at = STROKE_WORDS * i;
    if (batch.line_flags & (FADES_HIDDEN | SHOWN_VISIBLE)) == FADES_HIDDEN {
        keep_whole_share(i);
        return;
    }
    var depth = 0.0;
    if (batch.line_flags & TINTED_PASS) != 0u {
        depth = bitcast<f32>(owners[batch.count + i]);
        owners[batch.count + i] = 0u;
    }
    var by_holes = false;
    if has(HOLED) && (batch.line_flags & HOLES) != 0u {
        let marks = strokes[at + HOLE_WORD] & (MARKED | STROKED);
        by_holes = marks == 0u;
        if marks == MARKED {
            add_points(i);
        }
    }
    let sum = area_sum(at);
    let all = point_sum(at);
    let whole = bitcast<f32>(strokes[at + WHOLE_WORD]);
    if !by_holes && (sum.x | sum.y | all.x | all.y) == 0u && whole == 0.0 {
        if has(HOLED) {
            strokes[at + HOLE_WORD] = 0u;
        }
        return;
    }
    var points = 0u;
    var cover = 0.0;
    if by_holes {
        let covered = u32(HOLE_UNIT) - min(strokes[at + HOLE_WORD] & (STROKED - 1u), u32(HOLE_UNIT));
        cover = f32(covered) * (1.0 / HOLE_UNIT);
    } else {
        points = covered_points(at);
        cover = covered_share(sum, all, points, slack_of(at));
    }
    // What hidden parts cover beside visible ones, times the share of the colour that they keep. Less than 0 where
    // points miss some of the area that visible parts cover: no more is lost of it than that share.
    var hidden = 0.0;
    if (batch.line_flags & FADES_HIDDEN) != 0u {
        hidden = rn(FADE * (whole - cover));
    }
    let all_lines = cover + hidden;
    if all_lines > 0.0 {
        var color = line_colors[batch.line_pass];
        if batch.line_fade != 0u {
            color = rn4(color * fade_at(i));
        }
        var under = colors[i];
        if is_composited(under) {
            under = flip_alpha_sign(under);
        } else {
            under = over_background(uncovered(i, under, points, rn(color.w * batch.line_peak)), background_at(i));
        }
        if (batch.line_flags & LIT_PASS) != 0u {
            color = lit_color(color, colors[batch.count + i].xy);
        }
        let hidden_color = color;
        if (batch.line_flags & TINTED_PASS) != 0u {
            color = tinted(i, depth, color);
        }
        let lines = rn4(cover * color) + rn4(hidden * hidden_color);
        colors[i] = flip_alpha_sign(lines + rn4(under * (1.0 - rn(all_lines * color.w))));
    }
    clear_strokes(at);
}

// For the next pass.
fn clear_strokes(at: u32) {
    for (var w = 0u; w < STROKE_WORDS; w++) {
        strokes[at + w] = 0u;
    }
}

// Keeps the share of points that whole edges cover, for the visible parts, which follow. The light on both is that of
// the pixel's samples; where there are none, that of the face with the highest id whose edge is drawn here, hidden or
// not.
fn keep_whole_share(i: u32) {
    let at = STROKE_WORDS * i;
    let sum = area_sum(at);
    let points = covered_points(at);
    if (sum.x | sum.y | points) != 0u {
        clear_strokes(at);
        strokes[at + WHOLE_WORD] = bitcast<u32>(rn(f32(points) * (batch.line_peak * (1.0 / 256.0))));
        if (batch.line_flags & LIT_PASS) != 0u {
            owners[i] = max(owners[i], 1u);
        }
    }
}

// The opacity of the pass's lines in pixel i, between the four points of the grid around it.
fn fade_at(i: u32) -> f32 {
    let head = line_colors[batch.line_fade];
    let width = u32(frame.width);
    let row = u32(batch.row_first) + i / width;
    let place = (vec2(f32(i % width), f32(row)) + 0.5) * head.x;
    let first = floor(place);
    let share = place - first;
    let columns = u32(head.y);
    let at = u32(first.y) * columns + u32(first.x);
    let left = between(fade_point(at), fade_point(at + columns), share.y);
    let right = between(fade_point(at + 1u), fade_point(at + columns + 1u), share.y);
    return between(left, right, share.x);
}

// The opacity at a point of the grid.
fn fade_point(point: u32) -> f32 {
    return line_colors[batch.line_fade + 1u + point / 4u][point % 4u];
}

fn between(a: f32, b: f32, share: f32) -> f32 {
    return a + rn(share * (b - a));
}

// The colour (premultiplied) of a line in pixel i at this depth, with what lies in front of it. Its alpha is what it
// hides: the layers in front of it are in the picture already.
fn tinted(i: u32, depth: f32, color: vec4<f32>) -> vec4<f32> {
    let least = rn(depth * NEARER_RATIO);
    let depths = colors[tint_depths_at(i)];
    let steepness = colors[tint_steepness_at(i)];
    var front = vec4(0.0);
    for (var layer = 0u; layer < TINTS; layer++) {
        if depths[layer] != 0.0 && depths[layer] - rn(steepness[layer] * batch.tint_reach) > least {
            front += colors[tint_at(i, layer)];
        }
    }
    return vec4(rn3((1.0 - front.w) * color.xyz) + rn3(color.w * front.xyz), color.w);
}

// Sum of the areas of the strokes at `at`, two words.
fn area_sum(at: u32) -> vec2<u32> {
    return vec2(strokes[at + AREA_WORD], strokes[at + CARRY_WORD] & 0xFFFFu);
}

// The sum of their points.
fn point_sum(at: u32) -> vec2<u32> {
    return vec2(strokes[at + COUNT_WORD], strokes[at + CARRY_WORD] >> 16u);
}

// Most that the area of one of them differs from its points'.
fn slack_of(at: u32) -> u32 {
    return strokes[at + SLACK_WORD];
}

// A word of the points that any of them covers.
fn mask_word(at: u32, w: u32) -> u32 {
    return strokes[at + MASK_WORD + w];
}

fn covered_points(at: u32) -> u32 {
    var points = 0u;
    for (var w = 0u; w < MASK_WORDS; w++) {
        points += countOneBits(mask_word(at, w));
    }
    return points;
}

// Covered share of a pixel, 0 to the lines' peak.
fn covered_share(sum: vec2<u32>, all: vec2<u32>, points: u32, slack: u32) -> f32 {
    if (sum.x | sum.y) == 0u {
        return 0.0;
    }
    if points == POINTS && (all.x > POINTS || all.y > 0u) {
        return batch.line_peak;
    }
    var covered = wide_to_f32(sum) * (1.0 / AREA_UNIT);
    if all.x > points || all.y > 0u {
        covered = rn(covered * (f32(points) / wide_to_f32(all)));
    }
    let of_points = rn(f32(points) * (batch.line_peak * (1.0 / 256.0)));
    let beyond = rn(f32(slack) * (STROKES_SIDE_BY_SIDE / AREA_UNIT));
    return min(min(max(covered, of_points - beyond), of_points + beyond), batch.line_peak);
}

// The surface's colour, weighted by its share of what lines leave uncovered. At the surface's
// border this differs from its share of the pixel, because a line along the border covers both
// sides alike.
fn uncovered(i: u32, surface: vec4<f32>, points: u32, opacity: f32) -> vec4<f32> {
    if !has(SURFACE | HULL) || !(surface.w > ALPHA_MIN && surface.w < 1.0) {
        return surface;
    }
    let color = rn4(surface * weight(i, points, opacity));
    return vec4(color.xyz, min(color.w, 1.0));
}

// Ratio of the surface's share beside and through a line to its share of the pixel. A point counts
// 1, or 1 - opacity where the line covers it.
fn weight(i: u32, points: u32, opacity: f32) -> f32 {
    if points == 0u || points == POINTS {
        return 1.0;
    }
    let count = u32(sample_count());
    let at = STROKE_WORDS * i;
    if has(ADAPTIVE) {
        let number = mixed[number_at(i)];
        if number != 0u {
            let seen = seen_points(border_at((number & ~FEW) - 1u), at);
            if seen.x != 0u {
                return ratio(f32(seen.x), f32(seen.y), points, opacity);
            }
        }
    }
    // In points.
    var surface = 0.0;
    var surface_covered = 0.0;
    let in_base = first_visibility_sample(i);
    for (var s = 0u; s < count; s++) {
        let alpha = shown(in_base + s, i * count + s);
        if alpha > 0.0 {
            var covered = 0u;
            for (var w = 0u; w < MASK_WORDS; w++) {
                covered += countOneBits(mask_word(at, w) & sample_masks[MASK_WORDS * s + w]);
            }
            surface += rn(alpha * f32(POINTS / count));
            surface_covered += rn(alpha * f32(covered));
        }
    }
    return ratio(surface, surface_covered, points, opacity);
}

// The points of a mixed pixel that see something, and those of them that lines cover.
fn seen_points(border: u32, at: u32) -> vec2<u32> {
    var seen = vec2(0u);
    for (var w = 0u; w < MASK_WORDS; w++) {
        let word = mixed[border + w];
        seen += vec2(countOneBits(word), countOneBits(word & mask_word(at, w)));
    }
    return seen;
}

// The ratio, given how many points the surface has, how many of these lines cover, and how many they cover in all.
fn ratio(surface: f32, surface_covered: f32, points: u32, opacity: f32) -> f32 {
    if surface < ALPHA_MIN || surface == f32(POINTS) {
        return 1.0;
    }
    let left = surface - rn(opacity * surface_covered);
    let of_pixel = f32(POINTS) - rn(opacity * f32(points));
    return rn(rn(f32(POINTS) * left) * recip(rn(of_pixel * surface)));
}

// Alpha of the surface at a sample, given its index in the visibility buffer and in the batch.
fn shown(in_base: u32, sample: u32) -> f32 {
    if samples[in_base].y != 0u {
        return 1.0;
    }
    if has(PEELING) {
        return peel_state[sample].color.w;
    }
    return 0.0;
}

// A premultiplied colour under light (A, B).
fn lit_color(c: vec4<f32>, light: vec2<f32>) -> vec4<f32> {
    return vec4(rolled_off(rn3(c.xyz * light.x) + rn(light.y * c.w), c.w), c.w);
}

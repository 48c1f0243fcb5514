// Borders that are blurred by noise: see the CPU form, `trim/blurred.rs`. The including pass binds `held` and `cover`,
// and defines `SPLAT_WINDOW_PX`, `of_pixel_at`, `SILENT`, `YES` and `NO`. "Marked" sixteenths of pixels hold points.
// See docs/decisions/0003-borders-of-noise.md.

#import frame
#import blocks
#import layers
#import noise
#import picture

// Noise in pixels at a pixel with this normal and depth, covered by a splat of this reach.
fn noise_px(noise: Noise, pixel: vec2u, shown: vec4f, reach_px: f32) -> f32 {
    let eye = to_eye(unproject(vec2f(pixel) + 0.5, shown.w));
    let facing = dot(shown.xyz, eye) / length(eye);
    let aside = min(sqrt(max(1.0 - facing * facing, 0.0)) / FULL_NOISE_SINE, 1.0);
    let size = pixel_size(shown.w);
    // Inverse of the splat radius's formula.
    let k_radius = reach_px / SUPPORT * size * (0.5 * sqrt(f32(frame.k)) / frame.splat_scale);
    return BLURRING_NOISE_SHARE * aside * noise_at(noise, k_radius) / size;
}

// Width of a fringe in pixels.
fn fringe_px(reach_px: f32, noise: f32) -> f32 {
    return min(reach_px + FRINGE_NOISES * noise, f32(BLOCK_PX * FRINGE_BLOCKS));
}

// Whether a pixel lies beside a surface whose border is blurred by `noise` pixels, with the certainty `sure`; `SILENT`
// if the points do not suffice.
fn is_beside_blurred(pixel: vec2u, reach_px: f32, noise: f32, sure: f32) -> u32 {
    // Points beyond the screen are unknown.
    let to_edge = min(pixel, frame.size - 1u - pixel);
    let widest = min(MAX_WINDOW_PX, f32(min(to_edge.x, to_edge.y)));
    let window = min(sqrt(MIN_WINDOW_PX * MIN_WINDOW_PX + WINDOW_PER_NOISE_VARIANCE * noise * noise), widest);
    // In windows narrower than splats, points reflect only their distances from each other, or scan lines.
    if window < max(SPLAT_WINDOW_PX, reach_px / SUPPORT) {
        return SILENT;
    }
    let here = moments(pixel, window);
    if here.count < f32(MIN_WINDOW_SIXTEENTHS) {
        return SILENT;
    }
    let blur = vec2f(window * window / WINDOW_PER_KERNEL_VARIANCE, noise * noise);
    let apart = window * sqrt(3.14159265 / here.count);
    let sure_px = SURE_NOISE_PX + sure * (min(SURE_NOISE_DISTANCES * apart, SURE_NOISE_PX) - SURE_NOISE_PX);
    let may_be = MAX_BLURRED_OFFSET[1] + (MAX_BLURRED_OFFSET[0] - MAX_BLURRED_OFFSET[1]) * max(1.0 - noise / sure_px, 0.0);
    // The length of the offset bounds its part in any direction.
    if length(here.offset) / blur_unit(blur) <= may_be {
        return NO;
    }
    let fringe = fringe_px(reach_px, noise);
    let empty = to_empty(pixel, fringe + BLOCKS_BEYOND_FRINGE * f32(BLOCK_PX));
    if all(empty == vec2f(0.0)) {
        return SILENT;
    }
    let ahead = empty / length(empty);
    if off(here, ahead, blur) <= may_be {
        return NO;
    }
    let met = steps_to_empty(pixel, ahead, u32(fringe) + 1u);
    if met == 0u {
        return NO;
    }
    let half_way = vec2u(floor(vec2f(pixel) + 0.5 + ahead * f32(met / 2u)));
    let room = min(half_way, frame.size - 1u - half_way);
    if f32(min(room.x, room.y)) < window {
        return YES;
    }
    let there = moments(half_way, window);
    let goes_on = there.count >= f32(MIN_WINDOW_SIXTEENTHS) && off(there, ahead, blur) <= HALF_WAY_OFFSET_SHARE * may_be;
    return select(YES, NO, goes_on);
}

// Number of steps from a pixel to an empty one, up to `most`; 0 if there is none. A function of its own, because Mesa's
// llvmpipe 22.3 miscompiles a returning loop in a function that calls another loop.
fn steps_to_empty(pixel: vec2u, ahead: vec2f, most: u32) -> u32 {
    for (var step = 1u; step <= most; step++) {
        let at = floor(vec2f(pixel) + 0.5 + ahead * f32(step));
        if any(at < vec2f(0.0)) || any(at >= vec2f(frame.size)) {
            // Beyond the screen the surface is assumed to continue.
            return 0u;
        }
        let there = vec2u(at);
        let is_known = beside_picture(there) == 0u || is_empty_block(there / BLOCK_PX);
        if is_known && cover[there.y * frame.size.x + there.x].rim == EMPTY_RIM {
            return step;
        }
    }
    return 0u;
}

// Whether no pixel of a block is covered.
fn is_empty_block(block: vec2u) -> bool {
    let first = BLOCK_PX * block;
    let side = min(first + BLOCK_PX, frame.size) - first;
    if countOneBits(cover[block_mark(block)].point & 0xffffu) < side.x * side.y {
        return false;
    }
    // Most of the margin has no splats, although it may hold a surface.
    let is_aside = beside_picture(first) > 0u && beside_picture(first + BLOCK_PX - 1u) > 0u;
    return !(is_aside && held[block_index(block)] > 0u);
}

// Sum of the offsets of the empty blocks within `radius` pixels of a pixel's middle; near blocks weigh most. 0 if there
// are none, or as many on all sides.
fn to_empty(pixel: vec2u, radius: f32) -> vec2f {
    let reach = u32(radius);
    let first = (max(pixel, vec2u(reach)) - reach) / BLOCK_PX;
    let last = min((pixel + reach) / BLOCK_PX, block_counts() - 1u);
    var sum = vec2f(0.0);
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            if is_empty_block(vec2u(x, y)) {
                let offset = vec2f(BLOCK_PX * vec2u(x, y)) - vec2f(pixel) + 0.5 * f32(BLOCK_PX) - 0.5;
                let near = max(1.0 - dot(offset, offset) / (radius * radius), 0.0);
                sum += near * near * near * offset;
            }
        }
    }
    return sum;
}

// Moments of the marked sixteenths around a pixel.
struct Moments {
    // Mean offset from the pixel's middle, in pixels.
    offset: vec2f,
    count: f32,
    // Means of the products xx, xy and yy.
    squares: vec3f,
}

// Unit of offsets, w²/√(w² + σ²), in pixels, from the variances of the window and the noise.
fn blur_unit(blur: vec2f) -> f32 {
    return blur.x / sqrt(blur.x + blur.y);
}

// Offset of the mean away from `ahead`, less a fraction of the mean square along `ahead`.
fn off(points: Moments, ahead: vec2f, blur: vec2f) -> f32 {
    let unit = blur_unit(blur);
    let mean = -dot(points.offset, ahead) / unit;
    let square = dot(points.squares, vec3f(ahead.x * ahead.x, 2.0 * ahead.x * ahead.y, ahead.y * ahead.y));
    let of_noise = blur.x * blur.y / (blur.x + blur.y);
    return mean - SPREAD_WEIGHT * clamp((square - of_noise) / (unit * unit), 0.0, 1.0);
}

// Number of marked sixteenths in a square of a grid; `side` is 1, 2 or 4 pixels.
fn held_by(square: vec2u, side: u32) -> f32 {
    var sum = 0u;
    if side == BLOCK_PX {
        sum = held[block_index(square)];
    } else {
        let first = side * square;
        let more = min(first + side, frame.size) - first > vec2u(1u);
        let at = first.y * frame.size.x + first.x;
        sum = countOneBits(of_pixel_at(at));
        if more.x {
            sum += countOneBits(of_pixel_at(at + 1u));
        }
        if more.y {
            sum += countOneBits(of_pixel_at(at + frame.size.x));
        }
        if all(more) {
            sum += countOneBits(of_pixel_at(at + frame.size.x + 1u));
        }
    }
    return f32(sum);
}

// Moments and number of the marked sixteenths in a window of this radius around the middle of a pixel. The window lies
// within the screen.
fn moments(pixel: vec2u, window: f32) -> Moments {
    var sums = vec3f(0.0);
    var squares = vec3f(0.0);
    var count = 0.0;
    let side = select(select(BLOCK_PX, 2u, window <= 2.0 * MAX_PIXEL_WINDOW_PX), 1u, window <= MAX_PIXEL_WINDOW_PX);
    let reach = u32(window);
    let first = (pixel - reach) / side;
    let last = min((pixel + reach) / side, (frame.size + side - 1u) / side - 1u);
    for (var y = first.y; y <= last.y; y++) {
        for (var x = first.x; x <= last.x; x++) {
            let offset = vec2f(side * vec2u(x, y)) - vec2f(pixel) + 0.5 * f32(side) - 0.5;
            let near = 1.0 - dot(offset, offset) / (window * window);
            if near > 0.0 {
                let marked = held_by(vec2u(x, y), side);
                let weight = marked * (near * near * near);
                sums += weight * vec3f(1.0, offset);
                squares += weight * vec3f(offset.x * offset.x, offset.x * offset.y, offset.y * offset.y);
                count += marked;
            }
        }
    }
    return Moments(sums.yz / sums.x, count, squares / sums.x);
}

// Asks for sheets where surfels are noisy: an invocation per surfel.
//
// Reads: counters, levels, statistics, surfels, depth_noise. Writes: asked, for each cell.

#import frame
#import calls
#import depth_noise
#import divide
#import groups
#import levels
#import noise
#import screen
#import surfel

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read> levels: array<Level>;
@group(0) @binding(3) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(4) var<storage, read> surfels: array<Surfel>;
@group(0) @binding(5) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(6) var<storage, read_write> asked: array<Asked>;

// As in `sheet`, with atomics.
struct Asked {
    count: atomic<u32>,
    k_radii: atomic<u32>,
    point: atomic<u32>,
}

@compute @workgroup_size(SMALL_GROUP)
fn ask(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let level = levels[statistics.sheet_level];
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= counters[ROUND_LEN] || level.side_px == 0u {
        return;
    }
    let surfel = surfels[counters[ROUND_FIRST] + index];
    let measured_noise = noise_at(statistics.noise, surfel.k_radius);
    let known = known_beyond(measured_noise, surfel.center, surfel.source);
    let noise = max(measured_noise, known.noise);
    if !is_row(surfel, known.noise) && calls(surfel, noise, good_enough(noise, surfel.k_radius, surfel.center.z)) {
        let at = pixel_xy(surfel.pixel);
        let cell = divide(at.y, level.side_px).x * level.columns + divide(at.x, level.side_px).x;
        let k_radius_px = surfel.k_radius / pixel_size(surfel.center.z);
        atomicAdd(&asked[cell].count, 1u);
        atomicAdd(&asked[cell].k_radii, u32(min(k_radius_px, MAX_SUMMED_K_RADIUS_PX) * K_RADIUS_PARTS_PER_PX));
        atomicMin(&asked[cell].point, surfel.source);
    }
}

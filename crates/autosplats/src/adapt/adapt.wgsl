// Moves each noisy surfel onto the sheets beside it, and shrinks surfels that are no surface: an invocation per surfel.
// Surfels that need balls of their own are listed in `left` for `fit_balls`, whose workgroups are counted. See the CPU
// form.
//
// Reads: density, levels, statistics, sheets, depth_noise. Reads and writes: counters, surfels, arguments.
// Writes: left.

#import frame
#import adapted
#import calls
#import density
#import depth_noise
#import groups
#import later
#import levels
#import noise
#import sheet
#import surfel

@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>>;
@group(0) @binding(2) var<storage, read> density: array<DensityCell>;
// A uniform, because many devices bind no more than eight storage buffers.
@group(0) @binding(3) var<uniform> levels: array<Level, MOST_LEVELS>;
@group(0) @binding(4) var<storage, read> statistics: FrameStatistics;
@group(0) @binding(5) var<storage, read> sheets: array<Sheet>;
@group(0) @binding(6) var<storage, read> depth_noise: array<DepthRun>;
@group(0) @binding(7) var<storage, read_write> surfels: array<Surfel>;
@group(0) @binding(8) var<storage, read_write> left: array<u32>;
@group(0) @binding(9) var<storage, read_write> arguments: array<atomic<u32>>;

// Surfels of a workgroup that fits balls.
override SURFELS_PER_GROUP: u32;

// Leaves a surfel to `fit_balls`. The order does not matter, as each is fitted by itself.
fn leave(place: u32) {
    let at = atomicAdd(&counters[BALLS_ACTIVE + atomicLoad(&counters[ROUND])], 1u);
    left[at] = place;
    if at % SURFELS_PER_GROUP == 0u && at / SURFELS_PER_GROUP < GROUPS_PER_ROW {
        atomicAdd(&arguments[3u * (1u + atomicLoad(&counters[ROUND]))], 1u);
    }
}

@compute @workgroup_size(SMALL_GROUP)
fn adapt(@builtin(workgroup_id) workgroup: vec3u, @builtin(local_invocation_index) local: u32) {
    let first_of_round = atomicLoad(&counters[ROUND_FIRST]);
    let len = atomicLoad(&counters[ROUND_LEN]);
    let index = group_index(workgroup) * SMALL_GROUP + local;
    if index >= len {
        return;
    }
    let place = first_of_round + index;
    let surfel = surfels[place];
    let known = known_of(surfel);
    var out = surfel;
    lacks_ball = is_row(surfel, known.noise);
    if !lacks_ball {
        let own_radius = own_radius_of(surfel, atomicLoad(&counters[CELL_PX]), atomicLoad(&counters[CELL_COLUMNS]));
        out = ended(moved_to_surface(surfel, known, own_radius), own_radius);
    }
    if lacks_ball {
        leave(place);
        return;
    }
    keep_adapted(place, surfel, out);
}

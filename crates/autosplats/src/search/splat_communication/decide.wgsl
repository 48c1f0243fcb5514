// Decides after an iteration whether another follows: passes without work cost next to nothing. One invocation.
//
// Reads: counters. Writes: arguments, convergence.

#import frame
#import communication

@group(0) @binding(1) var<storage, read> counters: array<u32>;
@group(0) @binding(2) var<storage, read_write> arguments: Arguments;
@group(0) @binding(3) var<storage, read_write> convergence: array<u32>;

@compute @workgroup_size(1)
fn decide() {
    let at = counters[ROUND] * (arrayLength(&convergence) / 2u) + arguments.iterations;
    if arguments.boxes.instances == 0u {
        convergence[at + 1u] = convergence[at];
    }
    arguments.iterations += 1u;
    let queries = counters[ROUND_LEN];
    if f32(convergence[at + 1u]) <= UNCONVERGED * f32(queries) {
        arguments.clear.instances = 0u;
        arguments.boxes.instances = 0u;
        arguments.queries_groups = vec3u(0u);
        arguments.points_groups = vec3u(0u);
    }
}

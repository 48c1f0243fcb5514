// A chunk of a large node of the kd-tree: the work of one workgroup. The pass binds `large`.

#import kd_build

struct KdTask {
    // Run of points; empty if there is no such chunk.
    first: u32,
    end: u32,
    large: u32,
    axis: u32,
    plane: f32,
}

var<workgroup> task: KdTask;

fn kd_task(chunk: u32, state: KdState) -> KdTask {
    if chunk >= state.chunks {
        return KdTask(0u, 0u, 0u, KD_UNSPLIT, 0.0);
    }
    // The last large node whose first chunk is at most this one.
    var low = 0u;
    var high = state.large;
    while high - low > 1u {
        let middle = (low + high) / 2u;
        if large[middle].first_chunk <= chunk {
            low = middle;
        } else {
            high = middle;
        }
    }
    let first = (chunk - large[low].first_chunk) * CHUNK_POINTS;
    let end = min(first + CHUNK_POINTS, large[low].len);
    let offset = large[low].first;
    return KdTask(offset + first, offset + end, low, large[low].axis, large[low].plane);
}

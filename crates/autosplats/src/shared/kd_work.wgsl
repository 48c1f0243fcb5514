// Indices of the dispatches that build and search the kd-tree.

const WORK_LARGE = 0u;
const WORK_CHUNKS = 1u;
const WORK_SMALL = 2u;
const WORK_POINTS = 3u;

// Which dispatch is which of the passes that build the kd-tree and search it.

const WORK_LARGE = 0u;
const WORK_CHUNKS = 1u;
const WORK_SMALL = 2u;
const WORK_POINTS = 3u;

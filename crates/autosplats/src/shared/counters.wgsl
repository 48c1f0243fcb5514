// Counts and choices of the device, as indices into one buffer, so that some passes can bind it as atomics.

const NOT_FINITE = 0u;
const BEHIND = 1u;
const OUTSIDE = 2u;
// Screen points, and blocks of the screen that hold any.
const VISIBLE = 3u;
const BLOCKS = 4u;
// Height of a strip of cells in pixels, side of a density cell in pixels, and density cells per row.
const STRIP_PX = 5u;
const CELL_PX = 6u;
const CELL_COLUMNS = 7u;
const ACTIVE = 8u;
const PASSIVE = 9u;
const RECOVERED = 10u;
// Points with fewer than k neighbours because of a gap or the bound on work, points that reached the bound, and
// dropped surfels.
const CLAMPED = 11u;
const BOUNDED = 12u;
const OUTLIERS = 13u;
// Ends of the colour map, as bits of f32.
const RANGE_LOW = 14u;
const RANGE_HIGH = 15u;
// Pixels that show a surface.
const COVERED = 16u;
// Splats that are too large for one invocation.
const LARGE = 17u;
// Queries of each round that `search_four` leaves to `search`.
const LEFT_ACTIVE = 18u;
const LEFT_RECOVERED = 19u;

// Large splats, which one invocation would draw for too long: the first LARGE_SPLAT_GROUPS workgroups of a dispatch
// take them from their list, a team of SMALL_GROUP invocations a splat. The including pass binds `counters` and
// `large`.

const TEAMS = LARGE_GROUP / SMALL_GROUP;
// Places in the list from a team's splat to its next.
const NEXT_LARGE = LARGE_SPLAT_GROUPS * TEAMS;

// Place in the list of the first splat of an invocation's team.
fn first_large(group: u32, local: u32) -> u32 {
    return group * TEAMS + local / SMALL_GROUP;
}

// Column and row of an invocation in its team, eight to a row.
fn place_in_team(local: u32) -> vec2u {
    return vec2u(local % 8u, (local % SMALL_GROUP) / 8u);
}

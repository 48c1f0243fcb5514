// Large splats, whose rows a single workgroup would draw for too long: all workgroups of a dispatch take them from
// their list, a team of SMALL_GROUP invocations a splat. The including pass binds `counters` and `large`.

#import drawing_groups

const TEAMS = LARGE_GROUP / SMALL_GROUP;

// Place in the list of the first splat of an invocation's team.
fn first_large(group: u32, local: u32) -> u32 {
    return group * TEAMS + local / SMALL_GROUP;
}

// Places in the list from a team's splat to its next, in a dispatch that draws `len` splats.
fn next_large(len: u32) -> u32 {
    return drawing_groups(len) * TEAMS;
}

// Column and row of an invocation in its team, eight to a row.
fn place_in_team(local: u32) -> vec2u {
    return vec2u(local % 8u, (local % SMALL_GROUP) / 8u);
}

// Numbers of workgroups of the dispatches that take queries. The including pass binds `arguments`.

#import drawing_groups
#import put_work

// Of the queries of the first round.
fn put_active(len: u32) {
    put_work(ACTIVE64, len, SMALL_GROUP);
    put_work(ACTIVE256, len, LARGE_GROUP);
    put_groups(ACTIVE_DRAWN, drawing_groups(len));
}

// Of the queries of the second round, and of both rounds.
fn put_recovered(len: u32, active_len: u32) {
    put_work(RECOVERED64, len, SMALL_GROUP);
    put_work(RECOVERED256, len, LARGE_GROUP);
    put_groups(RECOVERED_DRAWN, drawing_groups(len));
    put_work(QUERIES256, active_len + len, LARGE_GROUP);
    put_groups(QUERIES_DRAWN, drawing_groups(active_len + len));
}

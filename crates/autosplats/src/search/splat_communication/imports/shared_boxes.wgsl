// The boxes of a workgroup, an invocation each, whose rows all of its invocations share (`lines`).

#import lines
#import points_in_box

var<workgroup> boxes: array<Box, LARGE_GROUP>;

// Tells an invocation's box.
fn tell_box(box: Box, local: u32) {
    if box.rows.x <= box.rows.y {
        boxes[local] = box;
        tell_lines(box.rows.y - box.rows.x + 1u, local);
    }
}

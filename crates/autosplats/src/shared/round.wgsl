// The rounds of a frame: which queries a pass processes.

// 0: the active points; 1: the recovered points, which follow them.
override ROUND: u32;

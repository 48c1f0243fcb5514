// Whether the depth map hides a point. The including pass binds `depth_map`.

#import frame
#import depth_map
#import screen

fn is_hidden(pixel: u32, depth_view: f32) -> bool {
    let at = pixel_xy(pixel);
    return depth_view > key_depth(depth_map[at.y * frame.size.x + at.x]);
}

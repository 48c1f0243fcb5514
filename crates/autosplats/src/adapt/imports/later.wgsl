// Balls that are left to another pass. Alternative: `balls`.

#import surface
#import surfel

// Whether the result lacks a ball.
var<private> lacks_ball: bool;

fn surface_around(surfel: Surfel, own_radius: f32, first: vec4f, noise: f32, enough: f32, scatter: f32) -> Surface {
    lacks_ball = true;
    return Surface();
}

fn stray_around(surfel: Surfel, stray: f32, ratio: f32) -> f32 {
    lacks_ball = true;
    return stray;
}

fn opened_to(surfel: Surfel, least: f32, noise: f32) -> f32 {
    lacks_ball = true;
    return surfel.radius;
}

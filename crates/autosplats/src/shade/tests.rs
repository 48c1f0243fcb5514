//! Tests on pictures small enough to write down.

mod truth;

use autosplats_cloud::{ValueOrigin, glam::DVec3};

use super::*;
use crate::camera::{Camera, Projection, View};
use crate::splat::GBuffer;

#[test]
fn srgb_round_trip() {
    for (step, value) in linear_steps().into_iter().enumerate() {
        assert_eq!((srgb(value) * 255.0).round() as usize, step, "step {step} does not come back");
    }
}

fn view(size: [u32; 2]) -> View {
    let projection = Projection::PerspectiveFovDeg(40.0);
    let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
    camera.view(DVec3::ZERO, size).expect("a view")
}

/// A wall at depth 2 that faces the eye and covers the left half of the picture.
fn half_a_wall(size: [u32; 2]) -> GBuffer {
    let [width, height] = size;
    let mut layers = GBuffer::new(width, height);
    for pixel in 0..(width / 2 * height) as usize {
        let index = layers.index(pixel % (width / 2) as usize, pixel / (width / 2) as usize);
        layers.weight[index] = 1.0;
        layers.depth[index] = 2.0;
        layers.normal[index] = [0.0, 0.0, -1.0];
    }
    layers
}

fn shaded(layers: &GBuffer, shading: &Shading) -> Image {
    exposed(layers, shading, 1.0)
}

fn exposed(layers: &GBuffer, shading: &Shading, exposure: f32) -> Image {
    let view = view([layers.width, layers.height]);
    let mut image = Image::default();
    let scene =
        Scene { view: &view, up: DVec3::Y, origin: DVec3::ZERO, unit: 1.0, exposure, values: ValueOrigin::default() };
    let _ = shade(layers, &scene, shading, true, None, &mut image, &crate::cancel::NEVER);
    assert_eq!(image.pixels.len(), (layers.width * layers.height) as usize, "size of the image");
    image
}

/// Settings without light, so that colours are shown unchanged.
fn flat(color: ColorMode) -> Shading {
    Shading { color, lighting: false, occlusion: 0.0, background: Background::Transparent, ..Shading::default() }
}

#[test]
fn backgrounds_show_where_no_surface_is() {
    let layers = half_a_wall([8, 4]);
    let with = |background| shaded(&layers, &Shading { background, ..Shading::default() }).pixels;
    let right = |pixels: &[[u8; 4]], y: usize| pixels[y * 8 + 4..y * 8 + 8].to_vec();
    let (transparent, color) = (with(Background::Transparent), with(Background::Color([1, 2, 3])));
    let gradient = with(Background::Gradient([0, 100, 40], [80, 100, 0]));
    for y in 0..4 {
        assert_eq!(right(&transparent, y), [[0; 4]; 4], "transparent in row {y}");
        assert_eq!(right(&color, y), [[1, 2, 3, 255]; 4], "one colour in row {y}");
        let step = 10 + 20 * y as u8;
        assert_eq!(right(&gradient, y), [[step, 100, 40 - step / 2, 255]; 4], "gradient in row {y}");
        for x in 0..4 {
            assert_eq!(transparent[y * 8 + x][3], 255, "the surface is opaque");
            assert_eq!(transparent[y * 8 + x], gradient[y * 8 + x], "the surface hides the background");
        }
    }
}

#[test]
fn point_colors_are_reproduced() {
    let mut layers = half_a_wall([8, 4]);
    let steps = linear_steps();
    layers.color = vec![[steps[7], steps[200], steps[255]]; layers.weight.len()];
    for color in [ColorMode::Auto, ColorMode::Rgb, ColorMode::Classification] {
        let image = shaded(&layers, &flat(color.clone()));
        assert_eq!(image.pixels[0], [7, 200, 255, 255], "{color:?}");
        assert_eq!(image.linear[0], layers.color[0], "{color:?}: linear light");
        assert_eq!(image.linear[4], [0.0; 3], "{color:?}: nothing in linear light");
    }
}

#[test]
fn values_take_the_colors_of_their_map() {
    let mut layers = half_a_wall([8, 4]);
    layers.scalar = vec![f32::NAN; layers.weight.len()];
    let values = [0.0, 5.0, 10.0, -3.0, 99.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    for (pixel, value) in values.into_iter().enumerate() {
        let index = layers.index(pixel % 4, pixel / 4);
        layers.scalar[index] = value;
    }
    let field = ColorMode::Field("intensity".into());
    let shading = Shading { range: Some([0.0, 10.0]), color_map: Some(ColorMap::Gray), ..flat(field.clone()) };
    let image = shaded(&layers, &shading);
    for (pixel, expected) in [0u8, 128, 255, 0, 255, 0, 255, 0].into_iter().enumerate() {
        let [r, g, b, a] = image.pixels[pixel / 4 * 8 + pixel % 4];
        assert!(r == g && g == b && a == 255, "value {}: gray", values[pixel]);
        // Half of the range lies between two of the 1024 steps.
        assert!(r.abs_diff(expected) <= 1, "value {}: {r}, not {expected}", values[pixel]);
    }
    // The usual range excludes values that are not finite. A picture without any finite value must not fail.
    for scalar in [f32::NAN, f32::INFINITY, 3.0] {
        layers.scalar.fill(scalar);
        shaded(&layers, &flat(field.clone()));
    }
}

#[test]
fn normals_and_depth_are_shown_as_documented() {
    let layers = half_a_wall([8, 4]);
    let normal = shaded(&layers, &flat(ColorMode::Normal)).pixels[0];
    // View z is world z here: -1 becomes 0. Half of the range lies between two of the 256 steps.
    let near = [128u8, 128, 0, 255].iter().zip(normal).all(|(expected, value)| value.abs_diff(*expected) <= 1);
    assert!(near, "a normal of (0, 0, -1) is shown as {normal:?}");
    let depth = Shading { range: Some([1.0, 3.0]), color_map: Some(ColorMap::Gray), ..flat(ColorMode::Depth) };
    assert!(shaded(&layers, &depth).pixels[0][0].abs_diff(128) <= 1, "the middle of the range");
}

#[test]
fn the_range_that_was_shown_is_told() {
    let layers = half_a_wall([8, 4]);
    let view = view([8, 4]);
    let range = |shading: &Shading, origin: DVec3| {
        shade(
            &layers,
            &Scene { view: &view, up: DVec3::Y, origin, unit: 1.0, exposure: 1.0, values: ValueOrigin::default() },
            shading,
            false,
            None,
            &mut Image::default(),
            &crate::cancel::NEVER,
        )
    };
    let given = |color| Shading { range: Some([1.0, 3.0]), ..flat(color) };
    assert_eq!(range(&given(ColorMode::Depth), DVec3::ZERO), Some([1.0, 3.0]), "as it was given");
    assert_eq!(range(&given(ColorMode::Plain), DVec3::ZERO), None, "one tone has none");
    let far = DVec3::Y * 4096.0;
    assert_eq!(range(&given(ColorMode::Height), far), Some([1.0, 3.0]), "heights are those of the world");
    let [low, high] = range(&flat(ColorMode::Depth), far).expect("depth is a value");
    assert!(low <= high && layers.depth.contains(&(low as f32)), "as it was found: {low} to {high}");
    let [near, above] =
        [DVec3::ZERO, far].map(|origin| range(&flat(ColorMode::Height), origin).expect("height is a value"));
    assert_eq!(above, near.map(|end| end + 4096.0), "found heights are those of the world, too");
}

#[test]
fn light_shows_shape_and_keeps_within_range() {
    let mut layers = half_a_wall([8, 4]);
    let mut brightness = |normal: [f32; 3]| {
        layers.normal[0] = normal;
        shaded(&layers, &Shading { occlusion: 0.0, ..Shading::default() }).linear[0].iter().sum::<f32>() / 3.0
    };
    let [towards, up_left, down_right] =
        [[0.0, 0.0, -1.0], [-0.6, -0.6, -0.529], [0.6, 0.6, -0.529]].map(&mut brightness);
    assert!(up_left > 1.5 * down_right, "lit from above left: {up_left}, {down_right}");
    assert!(towards > 0.1 && towards < 1.0, "a surface seen straight on is neither dark nor burnt out: {towards}");
    assert!(down_right > 0.0, "nothing is black");
}

#[test]
fn backs_are_darker_and_greyer_if_asked_for_and_known() {
    let mut layers = half_a_wall([8, 4]);
    layers.color = vec![[0.6, 0.3, 0.1]; layers.weight.len()];
    let lit = Shading { occlusion: 0.0, background: Background::Transparent, ..Shading::default() };
    let front = shaded(&layers, &lit).linear[0];
    layers.back = vec![0.0; layers.weight.len()];
    let [whole, half] = [layers.index(1, 0), layers.index(2, 0)];
    (layers.back[whole], layers.back[half]) = (1.0, 0.5);
    let toned = shaded(&layers, &lit);
    let ratio = |[r, _, b]: [f32; 3]| r / b;
    assert_eq!(toned.linear[0], front, "a front stays");
    let [back, both] = [toned.linear[1], toned.linear[2]];
    assert!(back[0] < 0.6 * front[0] && back[0] > 0.2 * front[0], "darker, not black: {back:?} of {front:?}");
    assert!(ratio(back) < 0.8 * ratio(front) && ratio(back) > 1.2, "greyer, not grey: {back:?} of {front:?}");
    assert!((both[1] - 0.5 * (front[1] + back[1])).abs() < 1e-3, "in between: {both:?}");
    let same = shaded(&layers, &Shading { backs: Backs::Same, ..lit.clone() });
    assert_eq!(same.linear[1], front, "not asked for");
    let dark = Shading { lighting: false, ..lit };
    assert_eq!(shaded(&layers, &dark).linear[1], [0.6, 0.3, 0.1], "no light, no shading");
}

#[test]
fn occlusion_darkens_behind_a_step_only() {
    let mut layers = half_a_wall([8, 4]);
    for y in 0..4 {
        // The two leftmost columns stand well in front of the others.
        for x in 0..2 {
            let index = layers.index(x, y);
            layers.depth[index] = 1.0;
        }
    }
    let image = shaded(&layers, &Shading { occlusion: 1.0, ..flat(ColorMode::Plain) });
    let without = shaded(&layers, &flat(ColorMode::Plain));
    assert_eq!(image.pixels[0], without.pixels[0], "before the step");
    assert!(image.pixels[2][0] < without.pixels[2][0], "behind the step");
}

#[test]
fn legend_fits_or_is_left_out() {
    let mut drawn = 0;
    for size in [[1, 1], [64, 64], [130, 500], [300, 90], [300, 200], [400, 300], [1760, 900]] {
        let mut layers = half_a_wall(size);
        layers.scalar = vec![1.0; layers.weight.len()];
        for name in ["intensity", "größe", "a name that is longer than any legend has room for, and then some"] {
            for background in [Background::Transparent, Background::Color([90; 3])] {
                let plain = Shading { background, ..flat(ColorMode::Field(name.into())) };
                let with = shaded(&layers, &Shading { legend: true, ..plain.clone() });
                let without = shaded(&layers, &plain);
                let changed = (0..with.pixels.len()).filter(|&i| with.pixels[i] != without.pixels[i]);
                let columns: Vec<usize> = changed.map(|i| i % size[0] as usize).collect();
                drawn += usize::from(!columns.is_empty());
                let border = columns.iter().any(|&x| x == 0 || x + 1 == size[0] as usize);
                assert!(!border, "{name} in {size:?}: the legend touches the border");
                assert_eq!(with.linear, without.linear, "{name} in {size:?}: no legend in linear light");
            }
        }
    }
    assert!(drawn >= 8, "large pictures have legends: {drawn}");
}

/// A surface at depth 2 that faces the eye, at pixels whose middle is `inside`.
fn wall(size: [u32; 2], inside: impl Fn(f32, f32) -> bool) -> GBuffer {
    let mut layers = half_a_wall(size);
    for pixel in 0..(size[0] * size[1]) as usize {
        let [x, y] = [pixel % size[0] as usize, pixel / size[0] as usize];
        let index = layers.index(x, y);
        let covered = inside(x as f32 + 0.5, y as f32 + 0.5);
        layers.weight[index] = f32::from(u8::from(covered));
        layers.depth[index] = if covered { 2.0 } else { f32::INFINITY };
        layers.normal[index] = if covered { [0.0, 0.0, -1.0] } else { [0.0; 3] };
    }
    layers
}

#[test]
fn silhouettes_are_smooth_and_data_is_not() {
    let size = [48, 24];
    let inside = |x: f32, y: f32| y > 4.0 + 0.25 * x;
    let layers = wall(size, inside);
    let clear = shaded(&layers, &flat(ColorMode::Plain));
    let mut soft = 0;
    for (at, pixel) in clear.pixels.iter().enumerate() {
        let [x, y] = [at % 48, at / 48];
        let covered = inside(x as f32 + 0.5, y as f32 + 0.5);
        soft += usize::from((1..255).contains(&pixel[3]));
        assert_eq!(pixel[3] >= 128, covered, "pixel ({x}, {y}) is covered for the larger part, or not: {pixel:?}");
        assert_eq!(clear.linear[at] != [0.0; 3], covered, "linear light at ({x}, {y}) is not mixed");
    }
    assert!(soft > 24, "{soft} pixels are covered in part");
    // The same picture over a colour, blended in linear light.
    let over = shaded(&layers, &Shading { background: Background::Color([200, 20, 90]), ..flat(ColorMode::Plain) });
    for (over, clear) in over.pixels.iter().zip(&clear.pixels) {
        for (i, behind) in [200, 20, 90].into_iter().enumerate() {
            let part = f32::from(clear[3]) / 255.0;
            let [surface, behind] =
                [if part > 0.0 { clear[i] } else { 0 }, behind].map(|step| linear(f32::from(step) / 255.0));
            let expected = srgb(behind + (surface - behind) * part) * 255.0;
            assert!((f32::from(over[i]) - expected).abs() < 1.5, "{over:?} is not {clear:?} over the background");
        }
    }
}

#[test]
fn borders_do_not_catch_the_light_of_the_other_side() {
    // An upright cylinder whose right border is turned slightly away from the key light.
    let size = [40, 9];
    let mut layers = wall(size, |x, _| (10.0..30.0).contains(&x));
    let unit = view(size).pixel_size(2.0);
    for (x, y) in (10..30).flat_map(|x| (0..9).map(move |y| (x, y))) {
        let across: f32 = (x as f32 + 0.5 - 20.0) / 10.0;
        let index = layers.index(x, y);
        layers.depth[index] = 2.0 - 10.0 * unit * (1.0 - across * across).sqrt();
        layers.normal[index] = [across, 0.0, -(1.0 - across * across).sqrt()];
    }
    let border = layers.index(29, 4);
    let right = shaded(&layers, &Shading::default());
    let at = 4 * 40 + 29;
    let brightness = |image: &Image| image.linear[at].iter().sum::<f32>();
    // A normal tilted a little less than one three pixels further in may be right.
    let [inner, ..] = layers.normal[layers.index(26, 4)];
    let tilted = |component: f32| [component, 0.0, -(1.0 - component * component).sqrt()];
    layers.normal[border] = tilted(inner - 0.2);
    let kept = brightness(&shaded(&layers, &Shading::default()));
    layers.normal[border] = tilted(inner);
    let as_inside = brightness(&shaded(&layers, &Shading::default()));
    assert!(kept > 1.1 * as_inside, "{kept} and {as_inside}");
    // Normals of a surface that looks away point to the other side when turned to the eye. Averaged with right ones
    // they face the eye.
    for wrong in [[-0.98, 0.0, -0.2], [-0.2, 0.0, -0.98]] {
        layers.normal[border] = wrong;
        let turned = brightness(&shaded(&layers, &Shading::default()));
        assert!(turned < 1.3 * brightness(&right), "{wrong:?}: {turned} and {}", brightness(&right));
    }
    // A surface that rises towards its border, as a sheet may, keeps its normals.
    for x in 10..30 {
        let index = layers.index(x, 4);
        layers.depth[index] = 2.0 + unit * (30 - x) as f32;
    }
    assert!(brightness(&shaded(&layers, &Shading::default())) > 1.5 * brightness(&right), "a sheet's border is lit");
}

#[test]
fn legends_go_where_nothing_is() {
    let size = [600, 400];
    for name in ["the right", "all but the lower left", "nothing"] {
        let inside = |x: f32, y: f32| match name {
            "the right" => x > 300.0,
            "nothing" => false,
            _ => x > 300.0 || y < 90.0,
        };
        let mut layers = wall(size, inside);
        layers.scalar = vec![1.0; layers.weight.len()];
        let plain = flat(ColorMode::Field("intensity".into()));
        let with = shaded(&layers, &Shading { legend: true, ..plain.clone() });
        let without = shaded(&layers, &plain);
        let drawn: Vec<usize> = (0..with.pixels.len()).filter(|&i| with.pixels[i] != without.pixels[i]).collect();
        assert!(!drawn.is_empty(), "{name} is covered: there is a legend");
        let hidden = drawn.iter().filter(|&&at| inside((at % 600) as f32, (at / 600) as f32)).count();
        assert!(hidden < drawn.len() / 20, "{name} is covered: the legend hides {hidden} pixels");
        let left = drawn.iter().all(|at| at % 600 < 300);
        assert_eq!(left, name != "nothing", "{name} is covered: the right is its usual place");
    }
}

#[test]
fn exposure_is_of_lit_colours_alone() {
    let clay = half_a_wall([8, 4]);
    let mut colored = clay.clone();
    colored.color = vec![[0.1; 3]; colored.weight.len()];
    let ratio = |layers: &GBuffer, lighting, color| {
        let shading = Shading { color, lighting, occlusion: 0.0, ..Shading::default() };
        let [once, thrice] = [1.0, 3.0].map(|exposure| exposed(layers, &shading, exposure).linear[0][1]);
        thrice / once
    };
    let own = ratio(&colored, true, ColorMode::Auto);
    assert!((own - 3.0).abs() < 1e-3, "{own}");
    assert_eq!(ratio(&colored, false, ColorMode::Auto), 1.0, "without light they are as they are");
    assert_eq!(ratio(&colored, true, ColorMode::Classification), 1.0, "colours of classes mean something");
    assert_eq!(ratio(&clay, true, ColorMode::Auto), 1.0, "clay");
}

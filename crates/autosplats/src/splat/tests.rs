//! Splatting against an oracle: the intersection of each pixel's line of sight with each disc, in `f64`.

use autosplats_cloud::glam::DVec3;
use autosplats_cloud::{FieldValues, RelativeValues};
use glam::Vec3;

use super::setup::{DOT_RADIUS_PX, EPSILON_RADII, MIN_FACING_COSINE};
use super::{Attributes, GBuffer, PointColors, Splatter, TILE, TILE_AREA};
use crate::camera::{Camera, Projection, View};
use crate::fit::{SUPPORT, Surfel};
use crate::project::{ScreenPoint, Sixteenths};
use crate::test_clouds::Random;

/// Pictures smaller than a tile, of several tiles, and with tiles that are cut off.
const SIZES: [[u32; 2]; 4] = [[1, 1], [70, 50], [64, 65], [130, 70]];

pub(super) fn views(size: [u32; 2]) -> [View; 2] {
    [Projection::PerspectiveFovDeg(50.0), Projection::OrthographicHeight(4.0)].map(|projection| {
        let camera = Camera { eye: DVec3::ZERO, look_at: DVec3::Z, up: DVec3::NEG_Y, projection };
        camera.view(DVec3::ZERO, size).expect("a view")
    })
}

fn vector(v: [f32; 3]) -> DVec3 {
    DVec3::from(v.map(f64::from))
}

/// Intersection of a line of sight with a disc.
struct Hit {
    /// Squared distance from the centre, in supports or dot radii, whichever is less; covered up to 1.
    squared: f64,
    depth: f64,
}

fn hit(surfel: &Surfel, x: usize, y: usize, view: &View) -> Hit {
    let [center, normal, a] = [surfel.center, surfel.normal, surfel.major_axis].map(vector);
    let b = normal.cross(a);
    let minor = f64::from(SUPPORT * surfel.radius);
    let major = minor * f64::from(surfel.major_ratio);
    let focal = f64::from(view.focal_px);
    let [dx, dy] = [x as f64 + 0.5 - 0.5 * f64::from(view.width), y as f64 + 0.5 - 0.5 * f64::from(view.height)];
    let (origin, direction) = if view.perspective {
        (DVec3::ZERO, DVec3::new(dx / focal, dy / focal, 1.0))
    } else {
        (DVec3::new(dx / focal, dy / focal, 0.0), DVec3::Z)
    };
    let to_center = if view.perspective { center.normalize() } else { DVec3::Z };
    let reach = ((a.z * major).powi(2) + (b.z * minor).powi(2)).sqrt();
    let mut depth = center.z;
    let mut squared = f64::INFINITY;
    let opposite = [[center.x, f64::from(view.width)], [center.y, f64::from(view.height)]]
        .iter()
        .all(|[at, side]| (focal * at / center.z).abs() < 0.5 * side + 1.0);
    let is_opposite = view.perspective && center.z <= 0.0 && opposite;
    if normal.dot(to_center).abs() > f64::from(MIN_FACING_COSINE) && !is_opposite {
        let along = normal.dot(center - origin) / normal.dot(direction);
        let offset = origin + direction * along - center;
        if !view.perspective || along > 0.0 {
            squared = (offset.dot(a) / major).powi(2) + (offset.dot(b) / minor).powi(2);
        }
        depth = along.clamp(center.z - reach, center.z + reach);
    }
    // Every splat in front of the eye is drawn at least as a dot.
    let scale = if view.perspective { focal / center.z.max(0.0) } else { focal };
    let from_dot = (dx - center.x * scale).hypot(dy - center.y * scale) / f64::from(DOT_RADIUS_PX);
    Hit { squared: squared.min(from_dot * from_dot), depth }
}

fn kernel(squared: f64) -> f64 {
    (1.0 - 0.52 * squared).powi(8)
}

fn epsilon(surfel: &Surfel) -> f64 {
    f64::from(EPSILON_RADII * surfel.radius)
}

/// Weighted sums of a pixel.
#[derive(Clone, Debug, Default)]
struct Means {
    weight: f64,
    depth: f64,
    /// Not normalised.
    normal: DVec3,
    color: DVec3,
    scalar: f64,
    scalar_weight: f64,
    measures: DVec3,
    back: f64,
    /// Source of the heaviest splat, if it is heavier than the next by more than rounding.
    heaviest: Option<u32>,
}

/// The picture of all surfels, with the depth map redrawn `refinements` times. `None` for pixels that rounding decides:
/// f32 gradients are accurate to about 1e-5 of the disc, or of the depth.
fn oracle(surfels: &[Surfel], view: &View, refinements: usize, data: &Data) -> Vec<Option<Means>> {
    let [width, height] = [view.width as usize, view.height as usize];
    let hits: Vec<Vec<(usize, Hit)>> = (0..width * height)
        .map(|pixel| {
            let drawn = surfels.iter().enumerate().filter(|(_, surfel)| surfel.radius > 0.0);
            let all = drawn.map(|(index, surfel)| (index, hit(surfel, pixel % width, pixel / width, view)));
            all.filter(|(_, hit)| hit.squared <= 1.0 + 1e-3).collect()
        })
        .collect();
    let pushed = |&(index, ref hit): &(usize, Hit)| hit.depth + epsilon(&surfels[index]);
    let mut alive = vec![true; surfels.len()];
    let mut depth_map = vec![f64::INFINITY; width * height];
    for redraw in 0..=refinements {
        if redraw > 0 {
            for (alive, surfel) in alive.iter_mut().zip(surfels) {
                let [x, y] = surfel.pixel_xy();
                let limit = depth_map[y * width + x];
                let depth = f64::from(surfel.center[2]);
                assert!(
                    (depth - limit).abs() > 1e-6 * depth,
                    "another seed: rounding decides whether a point is hidden"
                );
                *alive = depth <= limit;
            }
        }
        for (limit, hits) in depth_map.iter_mut().zip(&hits) {
            let living = hits.iter().filter(|(index, hit)| alive[*index] && hit.squared <= 1.0);
            *limit = living.map(pushed).fold(f64::INFINITY, f64::min);
        }
    }
    let means = |(limit, hits): (f64, &Vec<(usize, Hit)>)| {
        let mut means = Means::default();
        let mut heaviest = [0.0; 2];
        for (index, hit) in hits.iter().filter(|(index, _)| alive[*index]) {
            let surfel = &surfels[*index];
            let front = hit.depth + epsilon(surfel) <= limit + 1e-4 * hit.depth;
            if (hit.depth - limit).abs() < 2e-5 * hit.depth || ((hit.squared - 1.0).abs() < 1e-3 && front) {
                return None;
            }
            if hit.depth > limit || hit.squared > 1.0 {
                continue;
            }
            let w = kernel(hit.squared);
            let source = surfel.source as usize;
            means.weight += w;
            means.depth += w * hit.depth;
            means.normal += w * vector(surfel.normal);
            means.color += w * DVec3::from(data.colors[source].map(|c| f64::from(data.linear[c as usize])));
            let scalar = f64::from(data.scalars[source]);
            if scalar.is_finite() {
                means.scalar += w * scalar;
                means.scalar_weight += w;
            }
            means.measures += w * vector([surfel.radius, surfel.k_radius, surfel.curvature]);
            means.back += if shows_back(source) { w } else { 0.0 };
            if w > heaviest[0] {
                heaviest = [w, heaviest[0]];
                means.heaviest = Some(surfel.source);
            } else {
                heaviest[1] = heaviest[1].max(w);
            }
        }
        // Among equal weights the first wins; among nearly equal ones either may.
        means.heaviest = means.heaviest.filter(|_| heaviest[1] < 0.999 * heaviest[0]);
        Some(means)
    };
    depth_map.into_iter().zip(&hits).map(means).collect()
}

/// Whether the surfel of a point shows its back.
fn shows_back(source: usize) -> bool {
    source % 5 == 2
}

/// Attributes by point.
pub(super) struct Data {
    pub(super) colors: Vec<[u8; 3]>,
    pub(super) scalars: Vec<f32>,
    pub(super) linear: [f32; 256],
}

impl Data {
    pub(super) fn new(points: usize) -> Self {
        let mut random = Random::new(31);
        let colors = (0..points).map(|_| [0; 3].map(|_: u8| random.below(256) as u8)).collect();
        let scalars = (0..points).map(|i| if i % 7 == 0 { f32::NAN } else { 100.0 * random.signed() }).collect();
        Self { colors, scalars, linear: std::array::from_fn(|step| (step as f32 / 255.0).powi(2)) }
    }
}

/// The marked sixteenths if the surfels' centres are the only points.
pub(super) fn sixteenths(surfels: &[Surfel], view: &View) -> Sixteenths {
    let places = surfels.iter().map(|surfel| view.to_pixel(surfel.center.into()));
    let size = [view.width as usize, view.height as usize];
    let is_seen = |[x, y]: &[f32; 2]| *x >= 0.0 && *y >= 0.0 && *x < size[0] as f32 && *y < size[1] as f32;
    Sixteenths::with(size, places.filter(is_seen))
}

fn draw(surfels: &[Surfel], view: &View, refinements: usize, data: &Data) -> GBuffer {
    let scalars = FieldValues::F32(data.scalars.clone());
    let color = PointColors { srgb: &data.colors, linear: &data.linear };
    let attributes =
        Attributes { color: Some(color), scalar: Some(RelativeValues::new(&scalars)), measures: true, backs: true };
    draw_with(&mut Splatter::default(), surfels, view, refinements, &attributes)
}

fn draw_with(
    splatter: &mut Splatter,
    surfels: &[Surfel],
    view: &View,
    refinements: usize,
    attributes: &Attributes<'_>,
) -> GBuffer {
    splatter.begin(view);
    // Two parts, as the renderer adds recovered points.
    let first = surfels.len() * 2 / 3;
    splatter.add(&surfels[..first], 0, view, &crate::cancel::NEVER);
    splatter.add(surfels, first, view, &crate::cancel::NEVER);
    (0..refinements).for_each(|_| splatter.refine(surfels, view, &crate::cancel::NEVER));
    splatter.attributes(surfels, view, attributes, &crate::cancel::NEVER).clone()
}

/// Bits of all layers.
fn bits(layers: &GBuffer) -> (Vec<u32>, Vec<u32>) {
    let floats = [&layers.weight, &layers.depth, &layers.scalar, &layers.radius, &layers.k_radius, &layers.back];
    let vectors = layers.normal.iter().chain(&layers.color).flatten();
    let bits =
        floats.into_iter().flatten().chain(&layers.curvature).chain(vectors).map(|value| value.to_bits()).collect();
    (bits, layers.point.clone())
}

/// Compares all layers. Returns the number of pixels compared.
fn compare(layers: &GBuffer, oracle: &[Option<Means>]) -> Result<usize, String> {
    let width = layers.width as usize;
    for (pixel, means) in oracle.iter().enumerate() {
        let Some(means) = means else { continue };
        let [x, y] = [pixel % width, pixel / width];
        let i = layers.index(x, y);
        let near = |name: &str, value: f32, expected: f64, scale: f64| {
            // The tolerance covers f32 rounding of gradients, of the kernel's eighth power and of sums; absolute for
            // sums that cancel.
            let ok = (f64::from(value) - expected).abs() <= 1e-3 * expected.abs() + 1e-3 * scale;
            if ok { Ok(()) } else { Err(format!("{name} at {x}, {y} is {value}, not {expected}: {means:?}")) }
        };
        near("weight", layers.weight[i], means.weight, 0.01)?;
        if means.weight == 0.0 {
            let empty = layers.weight[i] == 0.0
                && layers.depth[i] == f32::INFINITY
                && layers.normal[i] == [0.0; 3]
                && layers.point[i] == u32::MAX
                && layers.scalar[i].is_nan();
            if !empty {
                return Err(format!("{x}, {y} is not empty"));
            }
            continue;
        }
        near("depth", layers.depth[i], means.depth / means.weight, 0.02)?;
        let length = means.normal.length();
        // The direction of a sum that nearly cancels is rounding.
        if length > 0.1 * means.weight {
            let normal = means.normal / length;
            (0..3).try_for_each(|axis| near("normal", layers.normal[i][axis], normal[axis], 1.0))?;
        }
        let color = means.color / means.weight;
        (0..3).try_for_each(|channel| near("colour", layers.color[i][channel], color[channel], 1.0))?;
        if means.scalar_weight > 0.0 {
            near("scalar", layers.scalar[i], means.scalar / means.scalar_weight, 100.0)?;
        } else if !layers.scalar[i].is_nan() {
            return Err(format!("scalar at {x}, {y} is not unknown"));
        }
        let measures = means.measures / means.weight;
        near("radius", layers.radius[i], measures.x, 0.0)?;
        near("k-radius", layers.k_radius[i], measures.y, 0.0)?;
        near("curvature", layers.curvature[i], measures.z, 0.0)?;
        near("back", layers.back[i], means.back / means.weight, 1.0)?;
        if means.heaviest.is_some_and(|source| source != layers.point[i]) {
            return Err(format!("point at {x}, {y} is {}, not {:?}", layers.point[i], means.heaviest));
        }
    }
    Ok(oracle.iter().flatten().count())
}

/// Kind of discs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Discs {
    Circles,
    Ellipses,
    /// Seen nearly from their edges.
    Grazing,
    /// About a pixel wide.
    Small,
    /// Large and near the eye; many meet the plane of the eye.
    Near,
    /// Large, around the eye, and mostly beside the screen or behind the eye; in parallel projection merely large.
    Around,
    /// A smooth wavy surface.
    Surface,
}

/// Surfels with their centres scattered over the picture.
pub(super) fn surfels(seed: u64, count: usize, discs: Discs, view: &View) -> Vec<Surfel> {
    let mut random = Random::new(seed);
    let mut one = |source: usize| {
        let px = [random.unit() * view.width as f32, random.unit() * view.height as f32];
        let depth = match discs {
            Discs::Near => 0.05 + 0.2 * random.unit(),
            // Beyond the least share of the distance.
            Discs::Around if view.perspective => {
                let far = 0.02 + 0.28 * random.unit();
                far.copysign(random.signed())
            }
            Discs::Surface => 4.0 + 0.1 * (0.2 * px[0]).sin(),
            _ => 2.0 + 3.0 * random.unit(),
        };
        let center = match discs {
            Discs::Around if view.perspective => Vec3::new(random.signed(), random.signed(), depth),
            _ => view.unproject(px, depth),
        };
        let to_eye = if view.perspective { -vector(center.to_array()).normalize() } else { DVec3::NEG_Z };
        let turn = vector(random.direction());
        let sideways = turn.reject_from_normalized(to_eye).normalize();
        let normal = match discs {
            Discs::Grazing => (sideways + to_eye * 10f64.powf(-3.0 * f64::from(random.unit()))).normalize(),
            Discs::Surface => (to_eye + 0.3 * sideways).normalize(),
            _ => {
                if turn.dot(to_eye) < 0.0 {
                    -turn
                } else {
                    turn
                }
            }
        };
        let pixel_size = view.pixel_size(depth.abs());
        let radius = match discs {
            Discs::Small => pixel_size * (0.1 + 2.0 * random.unit()),
            Discs::Near => 0.4 * random.unit(),
            Discs::Around => 0.9 * random.unit(),
            _ => pixel_size * (1.0 + 12.0 * random.unit() * random.unit()),
        };
        let major_axis = vector(random.direction()).reject_from(normal).normalize();
        Surfel {
            center: center.to_array(),
            radius: if source % 17 == 3 { 0.0 } else { radius },
            normal: normal.as_vec3().to_array(),
            k_radius: 1.5 * radius,
            major_axis: major_axis.as_vec3().to_array(),
            major_ratio: if discs == Discs::Ellipses { 1.0 + 3.0 * random.unit() } else { 1.0 },
            curvature: 0.3 * random.unit(),
            pixel: (px[1] as u32) << 16 | px[0] as u32 | if discs == Discs::Around { ScreenPoint::NEAR } else { 0 },
            source: source as u32,
            screen_and_flags: source as u32 | if shows_back(source) { Surfel::BACK } else { 0 },
        }
    };
    (0..count).map(&mut one).collect()
}

pub(super) const ALL_DISCS: [Discs; 7] =
    [Discs::Circles, Discs::Ellipses, Discs::Grazing, Discs::Small, Discs::Near, Discs::Around, Discs::Surface];

#[test]
fn every_kind_of_disc_at_every_size() {
    let data = Data::new(1000);
    for size in SIZES {
        let pixels = (size[0] * size[1]) as usize;
        for view in views(size) {
            for discs in ALL_DISCS {
                for refinements in [0, 2] {
                    let surfels = surfels(32, 5 + pixels / 40, discs, &view);
                    let layers = draw(&surfels, &view, refinements, &data);
                    let outcome = compare(&layers, &oracle(&surfels, &view, refinements, &data));
                    let label = format!("{discs:?}, {size:?}, perspective {}", view.perspective);
                    assert!(outcome.is_ok(), "{label}: {outcome:?}");
                    let compared = outcome.unwrap_or_default();
                    assert!(compared * 10 >= pixels * 9, "{label}: only {compared} of {pixels} pixels are decided");
                }
            }
        }
    }
}

#[test]
fn comparison_sees_each_kind_of_error() {
    let view = views([70, 50])[0];
    let data = Data::new(1000);
    let surfels = surfels(33, 200, Discs::Circles, &view);
    let oracle = oracle(&surfels, &view, 2, &data);
    let right = draw(&surfels, &view, 2, &data);
    assert!(compare(&right, &oracle).is_ok(), "nothing is wrong yet");
    assert!(compare(&draw(&surfels, &view, 0, &data), &oracle).is_err(), "not noticed: no refinement");
    assert!(compare(&draw(&surfels[1..], &view, 2, &data), &oracle).is_err(), "not noticed: a missing splat");
    let covered = (0..70 * 50).map(|p| (p, right.index(p % 70, p / 70)));
    let covered = covered.filter(|&(p, i)| right.weight[i] > 0.0 && oracle[p].is_some());
    let (pixel, at) = covered.max_by(|a, b| right.weight[a.1].total_cmp(&right.weight[b.1])).expect("a covered pixel");
    assert!(oracle[pixel].as_ref().is_some_and(|means| means.heaviest.is_some()), "one splat is the heaviest");
    type Spoil = fn(&mut GBuffer, usize);
    let spoils: [(&str, Spoil); 8] = [
        ("weight", |l, i| l.weight[i] *= 1.01),
        ("depth", |l, i| l.depth[i] *= 1.01),
        ("normal", |l, i| l.normal[i][0] += 0.01),
        ("colour", |l, i| l.color[i][1] += 0.01),
        ("scalar", |l, i| l.scalar[i] += 1.0),
        ("radius", |l, i| l.radius[i] *= 1.01),
        ("back", |l, i| l.back[i] = 1.01 - l.back[i]),
        ("point", |l, i| l.point[i] += 1),
    ];
    for (name, spoil) in spoils {
        let mut wrong = right.clone();
        spoil(&mut wrong, at);
        assert!(compare(&wrong, &oracle).is_err(), "not noticed: {name}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let view = views([150, 130])[0];
    let data = Data::new(40_000);
    // More than two runs of surfels.
    let surfels = surfels(34, 36_000, Discs::Surface, &view);
    let drawn = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a thread pool");
        bits(&pool.install(|| draw(&surfels, &view, 2, &data)))
    };
    let one = drawn(1);
    for threads in [2, 5] {
        assert!(drawn(threads) == one, "{threads} threads give another picture than one");
    }
}

#[test]
fn layers_are_as_large_as_what_is_drawn() {
    let view = views([1000, 700])[0];
    let mut surfels = surfels(37, 3000, Discs::Circles, &view);
    surfels.retain(|surfel| surfel.pixel_xy().iter().all(|&at| at < 2 * TILE));
    let layers = draw(&surfels, &view, 1, &Data::new(3000));
    let covered = (0..1000 * 700).filter(|at| layers.weight[layers.index(at % 1000, at / 1000)] > 0.0).count();
    let stored = layers.weight.len();
    assert!((1000..20 * TILE_AREA).contains(&stored), "{covered} pixels are covered, {stored} stored");
    assert!(covered > 1000 && covered < stored, "{covered} pixels are covered, {stored} stored");
    let far = layers.index(999, 699);
    assert_eq!((layers.weight[far], layers.depth[far], layers.point[far]), (0.0, f32::INFINITY, u32::MAX), "empty");
}

#[test]
fn nothing_is_left_of_frames_before() {
    let data = Data::new(2000);
    let color = PointColors { srgb: &data.colors, linear: &data.linear };
    let bare = Attributes { color: Some(color), ..Attributes::default() };
    let scalars = FieldValues::F32(data.scalars.clone());
    let all = Attributes { scalar: Some(RelativeValues::new(&scalars)), measures: true, backs: true, ..bare };
    let mut splatter = Splatter::default();
    // Tiles become empty, stay so while layers are added, are filled again, and are replaced by those of another
    // picture.
    let frames = [(150, 0..75, bare), (150, 75..150, bare), (150, 75..150, all), (150, 0..0, all), (150, 0..75, all)];
    for (frame, (side, columns, attributes)) in frames.into_iter().chain([(200, 0..75, all)]).enumerate() {
        let view = views([side, side])[0];
        let mut surfels = surfels(36, 1500, Discs::Surface, &view);
        surfels.retain(|surfel| columns.contains(&(surfel.pixel & 0xffff)));
        let [again, alone] = [&mut splatter, &mut Splatter::default()]
            .map(|splatter| bits(&draw_with(splatter, &surfels, &view, 1, &attributes)));
        assert!(again == alone, "frame {frame} shows what is left of others");
    }
}

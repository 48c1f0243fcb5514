//! Bodies and scenes with Z up, of which everyone knows the right way up.

use autosplats::cloud::glam::{DVec2, DVec3};

/// Points of a body or a scene with Z up.
pub(super) struct Body {
    pub(super) name: &'static str,
    pub(super) points: Vec<DVec3>,
    /// Number of points, from the first on, that a view of the whole has to show.
    pub(super) main: usize,
    /// Whether the view stands among the points and shows a part of them.
    pub(super) among: bool,
    /// Whether the body upside down looks the same.
    pub(super) symmetric: bool,
}

/// Two numbers from 0 to 1, spread evenly over all `i`.
fn even(i: usize) -> [f64; 2] {
    [0.754_877_666_246_692_7, 0.569_840_290_998_053_3].map(|step| ((i as f64 + 0.5) * step).fract())
}

/// A number from 0 to 1, as if random.
pub(super) fn random(i: usize) -> f64 {
    let mut bits = (i as u64).wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((bits ^ (bits >> 31)) >> 11) as f64 / (1u64 << 53) as f64
}

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn ball(middle: DVec3, radii: DVec3, count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let [turn, height] = even(i);
        let z = 2.0 * height - 1.0;
        let around = DVec2::from_angle(turn * std::f64::consts::TAU) * (1.0 - z * z).sqrt();
        middle + radii * around.extend(z)
    })
}

fn rod(from: DVec3, to: DVec3, radius: f64, count: usize) -> impl Iterator<Item = DVec3> {
    let way = to - from;
    let (a, b) = way.normalize().any_orthonormal_pair();
    (0..count).map(move |i| {
        let [turn, along] = even(i);
        let (sin, cos) = (turn * std::f64::consts::TAU).sin_cos();
        from + way * along + (a * cos + b * sin) * radius
    })
}

fn disc(middle: DVec3, radius: f64, count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let [turn, share] = even(i);
        middle + (DVec2::from_angle(turn * std::f64::consts::TAU) * radius * share.sqrt()).extend(0.0)
    })
}

fn ground(
    low: [f64; 2],
    high: [f64; 2],
    count: usize,
    height: impl Fn(f64, f64) -> f64,
) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let [x, y] = even(i);
        let [x, y] = [low[0] + (high[0] - low[0]) * x, low[1] + (high[1] - low[1]) * y];
        at(x, y, height(x, y))
    })
}

/// Sides of a box, `open` without the lower one.
fn block(low: DVec3, high: DVec3, open: bool, count: usize) -> Vec<DVec3> {
    let size = high - low;
    let areas = [size.y * size.z, size.x * size.z, size.x * size.y];
    let total = 2.0 * areas.iter().sum::<f64>();
    let sides = (0..3).flat_map(|axis| [(axis, 0.0), (axis, 1.0)]).filter(|&side| !(open && side == (2, 0.0)));
    let side = |(axis, end): (usize, f64)| {
        (0..(count as f64 * areas[axis] / total) as usize).map(move |i| {
            let [a, b] = even(i);
            let share = [DVec3::new(end, a, b), DVec3::new(a, end, b), DVec3::new(a, b, end)][axis];
            low + size * share
        })
    };
    sides.flat_map(side).collect()
}

/// A surface of revolution about Z through places of radius and height.
fn turned(outline: &[[f64; 2]], count: usize) -> Vec<DVec3> {
    let outline: Vec<DVec2> = outline.iter().map(|&place| place.into()).collect();
    let weights: Vec<f64> = outline.windows(2).map(|w| w[0].distance(w[1]) * (w[0].x + w[1].x + 1e-9)).collect();
    let total: f64 = weights.iter().sum();
    let part = |(pair, weight): (&[DVec2], &f64)| {
        let (a, b) = (pair[0], pair[1]);
        (0..(count as f64 * weight / total) as usize).map(move |i| {
            let [turn, along] = even(i);
            let place = a.lerp(b, along);
            (DVec2::from_angle(turn * std::f64::consts::TAU) * place.x).extend(place.y)
        })
    };
    outline.windows(2).zip(&weights).flat_map(part).collect()
}

fn joined(parts: impl IntoIterator<Item = Vec<DVec3>>) -> Vec<DVec3> {
    parts.into_iter().flatten().collect()
}

fn figure(foot: DVec3) -> Vec<DVec3> {
    let body =
        ball(at(0.0, 0.0, 1.15), at(0.22, 0.14, 0.36), 3000).chain(ball(at(0.0, 0.0, 1.66), at(0.1, 0.12, 0.15), 1000));
    let arms = rod(at(0.2, 0.0, 1.4), at(0.42, -0.25, 1.1), 0.05, 600).chain(rod(
        at(-0.2, 0.0, 1.4),
        at(-0.3, 0.1, 0.85),
        0.05,
        600,
    ));
    let legs = [-0.11, 0.11].into_iter().flat_map(|x| {
        let shoe = block(at(x - 0.05, -0.2, 0.0), at(x + 0.05, 0.08, 0.08), false, 500);
        rod(at(x, 0.0, 0.05), at(x, 0.0, 0.9), 0.08, 1200).chain(shoe)
    });
    body.chain(arms).chain(legs).map(|p| p + foot).collect()
}

fn animal() -> Vec<DVec3> {
    let legs = [[0.4, 0.12], [0.4, -0.12], [-0.4, 0.12], [-0.45, -0.12]];
    let legs = legs
        .into_iter()
        .flat_map(|[x, y]| rod(at(x, y, 0.0), at(x, y, 0.7), 0.06, 700).chain(disc(at(x, y, 0.0), 0.06, 60)));
    let rest = rod(at(0.5, 0.0, 1.0), at(0.8, 0.02, 1.4), 0.1, 800)
        .chain(ball(at(0.92, 0.02, 1.42), at(0.22, 0.09, 0.1), 800))
        .chain(rod(at(-0.55, 0.0, 1.0), at(-0.75, 0.05, 0.6), 0.03, 300));
    legs.chain(rest).chain(ball(at(0.0, 0.0, 0.9), at(0.65, 0.2, 0.28), 4000)).collect()
}

fn plinth(half: f64, height: f64) -> Vec<DVec3> {
    block(at(-half, -half, 0.0), at(half, half, height), true, 3000)
}

fn statue() -> Vec<DVec3> {
    joined([plinth(0.4, 0.6), figure(DVec3::Z * 0.6)])
}

fn bust() -> Vec<DVec3> {
    let head = ball(at(0.0, -0.02, 0.62), at(0.11, 0.13, 0.17), 4000).chain(ball(
        at(0.0, -0.15, 0.6),
        at(0.02, 0.04, 0.04),
        200,
    ));
    let shoulders = ball(at(0.0, 0.02, 0.18), at(0.3, 0.16, 0.22), 6000).chain(rod(
        at(0.0, 0.0, 0.3),
        at(0.0, 0.0, 0.52),
        0.08,
        1000,
    ));
    head.chain(shoulders).filter(|p| p.z > 0.0).collect()
}

fn house() -> Vec<DVec3> {
    let walls = block(at(-5.0, -4.0, 0.0), at(5.0, 4.0, 5.0), true, 6000).into_iter().filter(|p| p.z < 5.0 - 1e-9);
    let roof = ground([-5.3, -4.3], [5.3, 4.3], 4000, |_, y| 5.0 + (4.3 - y.abs()) * 0.8);
    walls.chain(roof).chain(block(at(1.0, 1.0, 6.0), at(1.8, 1.8, 9.5), true, 300)).collect()
}

fn tree(foot: DVec3, size: f64, count: usize) -> Vec<DVec3> {
    let crown = (0..count).map(move |i| {
        let way = at(random(7 * i), random(7 * i + 1), random(7 * i + 2)) * 2.0 - 1.0;
        at(0.0, 0.0, 0.7) + way.normalize_or_zero() * 0.3 * random(7 * i + 3).cbrt()
    });
    rod(DVec3::ZERO, at(0.0, 0.0, 0.5), 0.03, count / 5).chain(crown).map(|p| foot + p * size).collect()
}

/// Trees at random places of a square.
fn forest(half: f64, trees: usize, size: f64, height: impl Fn(f64, f64) -> f64) -> Vec<DVec3> {
    let place = |i: usize| [2, 3].map(|k| (2.0 * random(100 * k + i) - 1.0) * half);
    joined((0..trees).map(|i| {
        let [x, y] = place(i);
        tree(at(x, y, height(x, y)), size * (0.6 + 0.8 * random(i)), 150)
    }))
}

fn hill(x: f64, y: f64) -> f64 {
    9.0 * (0.031 * x).sin() * (0.023 * y + 1.0).cos() + 3.0 * (0.11 * x + 0.07 * y).sin() + 0.05 * x
}

fn town() -> Vec<DVec3> {
    let houses = (0..60).map(|i| {
        let [x, y] = [2, 3].map(|k| (2.0 * random(1000 * k + i) - 1.0) * 190.0);
        let [wide, long, high] = [5, 6, 7].map(|k| 6.0 + 9.0 * random(1000 * k + i));
        block(at(x, y, 0.0), at(x + wide, y + long, high), true, 300)
    });
    joined(
        houses
            .chain([ground([-200.0; 2], [200.0; 2], 14_000, |_, _| 0.0).collect(), forest(190.0, 30, 9.0, |_, _| 0.0)]),
    )
}

/// A sweep of a spinning lidar `high` above the ground: beams end on the ground, on what `wall` says, or nowhere.
fn sweep(lines: usize, elevations: [f64; 2], high: f64, wall: impl Fn(f64) -> (f64, f64)) -> Vec<DVec3> {
    let beam = move |i: usize| {
        let (line, step) = (i % lines, i / lines);
        let elevation = elevations[0] + (elevations[1] - elevations[0]) * line as f64 / (lines - 1) as f64;
        let azimuth = std::f64::consts::TAU * step as f64 / 900.0;
        let (distance, top) = wall(azimuth);
        let slope = elevation.to_radians().tan();
        let on_ground = if slope < 0.0 { -high / slope } else { f64::INFINITY };
        let range = if distance < on_ground && distance * slope < top - high { distance } else { on_ground };
        (range < 90.0).then(|| (DVec2::from_angle(azimuth) * range).extend(range * slope))
    };
    (0..lines * 900).filter_map(beam).collect()
}

/// Distance and height of the houses along a street, with gaps, and of cars.
fn street_at(azimuth: f64) -> (f64, f64) {
    let side = azimuth.sin().abs().max(1e-3);
    let number = (azimuth * 11.0) as usize;
    if number % 9 == 4 {
        (6.0 / side.max(0.4), 1.5)
    } else if number.is_multiple_of(5) {
        (60.0, 12.0)
    } else {
        (9.0 / side, 8.0)
    }
}

fn room(ceiling: bool) -> Vec<DVec3> {
    let walls = block(DVec3::ZERO, at(6.0, 4.5, 2.6), false, 14_000);
    let kept = walls.into_iter().filter(move |p| ceiling || p.z < 2.6 - 1e-9);
    let things = joined([
        block(at(0.3, 0.3, 0.0), at(2.3, 1.2, 0.8), true, 2500),
        block(at(4.0, 3.0, 0.0), at(5.6, 4.2, 0.5), true, 2500),
        block(at(5.2, 0.1, 0.0), at(5.9, 0.9, 1.9), true, 2000),
        table(at(3.0, 1.8, 0.0)),
    ]);
    kept.chain(things).collect()
}

fn table(foot: DVec3) -> Vec<DVec3> {
    let leg = |x: f64, y: f64| block(at(x, y, 0.0), at(x + 0.07, y + 0.07, 0.7), false, 500);
    let parts = [leg(0.0, 0.0), leg(1.13, 0.0), leg(0.0, 0.73), leg(1.13, 0.73)];
    let top = block(at(-0.05, -0.05, 0.7), at(1.25, 0.85, 0.75), false, 5000);
    joined(parts.into_iter().chain([top])).into_iter().map(|p| p + foot).collect()
}

fn chair() -> Vec<DVec3> {
    let leg = |x: f64, y: f64| rod(at(1.2 * x, 1.2 * y, 0.0), at(x, y, 0.47), 0.025, 400);
    let legs = [[-0.2, -0.2], [0.2, -0.2], [-0.2, 0.2], [0.2, 0.2]].into_iter().flat_map(|[x, y]| leg(x, y));
    let seat = block(at(-0.22, -0.22, 0.45), at(0.22, 0.22, 0.49), false, 2000);
    legs.chain(seat)
        .chain((0..1600).map(|i| at(0.44 * even(i)[0] - 0.22, 0.18 + 0.1 * even(i)[1], 0.49 + 0.46 * even(i)[1])))
        .collect()
}

fn car() -> Vec<DVec3> {
    let wheels = [[-1.3, -0.8], [-1.3, 0.65], [1.3, -0.8], [1.3, 0.65]]
        .into_iter()
        .flat_map(|[x, y]| rod(at(x, y, 0.32), at(x, y + 0.15, 0.32), 0.32, 900));
    let cabin = ground([-1.1, -0.7], [1.0, 0.7], 3000, |x, y| {
        0.95 + 0.5 * (1.0 - (x / 1.1).powi(4)) * (1.0 - (y / 0.75).powi(6))
    });
    wheels.chain(cabin).chain(block(at(-2.1, -0.8, 0.3), at(2.1, 0.8, 0.95), true, 6000)).collect()
}

/// Points about `middle` in all directions, from `near` to `far`, as many per doubling of the distance.
fn strays(middle: DVec3, near: f64, far: f64, count: usize) -> impl Iterator<Item = DVec3> {
    (0..count).map(move |i| {
        let way = at(random(5 * i), random(5 * i + 1), random(5 * i + 2)) * 2.0 - 1.0;
        middle + way.normalize_or_zero() * near * (far / near).powf(random(5 * i + 3))
    })
}

pub(super) fn all() -> Vec<Body> {
    let mut bodies = Vec::new();
    let mut add = |name, points: Vec<DVec3>, extra: Vec<DVec3>, among| {
        let main = points.len();
        let symmetric = name == "book";
        bodies.push(Body { name, points: points.into_iter().chain(extra).collect(), main, among, symmetric });
    };
    let patch = |half: f64, count: usize| ground([-half; 2], [half; 2], count, |_, _| 0.0).collect::<Vec<_>>();
    let noisy = |points: Vec<DVec3>, noise: f64| {
        let moved =
            |(i, p): (usize, DVec3)| p + noise * (at(random(3 * i), random(3 * i + 1), random(3 * i + 2)) - 0.5);
        points.into_iter().enumerate().map(moved).collect::<Vec<_>>()
    };
    let every = |points: Vec<DVec3>, step: usize| points.into_iter().step_by(step).collect::<Vec<_>>();
    let none = Vec::new;
    for (name, points) in [
        ("statue", statue()),
        ("noisy statue", noisy(statue(), 0.02)),
        ("statue of 700 points", every(statue(), 18)),
        (
            "front of a statue",
            statue().into_iter().filter(|p| p.y < 0.04 * (9.0 * p.z).sin() + 0.1 * p.x + 0.05 * p.z).collect(),
        ),
        ("bust", bust()),
        ("noisy bust", noisy(bust(), 0.008)),
        ("person", figure(DVec3::ZERO)),
        ("animal", animal()),
        ("animal on a board", joined([animal(), block(at(-0.9, -0.3, -0.05), at(1.0, 0.3, 0.0), false, 2000)])),
        ("chair", chair()),
        ("car", car()),
        ("house", house()),
        ("house and garden", joined([house(), patch(14.0, 5000), tree(at(9.0, -7.0, 0.0), 7.0, 800)])),
        ("tree on a lawn", joined([tree(DVec3::ZERO, 8.0, 6000), patch(5.0, 3000)])),
        ("bottle", turned(&[[0.0, 0.0], [0.04, 0.0], [0.04, 0.18], [0.013, 0.24], [0.013, 0.3]], 8000)),
        ("cup", turned(&[[0.0, 0.0], [0.03, 0.0], [0.04, 0.09]], 8000)),
        (
            "pawn",
            turned(&[[0.0, 0.0], [0.2, 0.0], [0.2, 0.08], [0.08, 0.2], [0.06, 0.5]], 6000)
                .into_iter()
                .chain(ball(at(0.0, 0.0, 0.6), DVec3::splat(0.12), 2000))
                .collect(),
        ),
        ("cone", turned(&[[0.5, 0.0], [0.0, 1.0]], 6000)),
        ("dome", ball(DVec3::ZERO, DVec3::splat(2.0), 12_000).filter(|p| p.z > 0.0).collect()),
        (
            "heap of gravel",
            ground([-4.0; 2], [4.0; 2], 12_000, |x, y| 2.0 - 0.6 * x.hypot(y) + 0.1 * random((x * 1e6) as usize))
                .filter(|p| p.z > 0.0)
                .collect(),
        ),
        (
            "lamp",
            joined([
                turned(&[[0.0, 0.0], [0.12, 0.0], [0.12, 0.02]], 2000),
                rod(at(0.0, 0.0, 0.0), at(0.1, 0.0, 0.45), 0.01, 600).collect(),
                ball(at(0.2, 0.0, 0.45), at(0.1, 0.06, 0.05), 1500).collect(),
            ]),
        ),
        (
            "tower with a spire",
            joined([
                block(at(-3.0, -3.0, 0.0), at(3.0, 3.0, 18.0), true, 8000),
                turned(&[[3.2, 18.0], [0.0, 29.0]], 3000),
            ]),
        ),
        ("book", block(DVec3::ZERO, at(0.2, 0.28, 0.03), false, 6000)),
        (
            "hills with trees",
            joined([ground([-150.0; 2], [150.0; 2], 16_000, hill).collect(), forest(145.0, 60, 9.0, hill)]),
        ),
        ("town from the air", town()),
        (
            "fields with a few trees",
            joined([
                ground([-300.0, -60.0], [300.0, 60.0], 15_000, |x, _| 0.01 * x).collect(),
                forest(55.0, 12, 8.0, |x, _| 0.01 * x),
            ]),
        ),
        (
            "street",
            joined([
                ground([-60.0, -8.0], [60.0, 8.0], 9000, |_, _| 0.0).collect(),
                (0..9000)
                    .map(|i| {
                        let [x, z] = even(i);
                        at(120.0 * x - 60.0, if i % 2 == 0 { -8.0 } else { 8.0 }, 9.0 * z)
                    })
                    .collect(),
                forest(7.0, 6, 5.0, |_, _| 0.0),
            ]),
        ),
        (
            "facade and pavement",
            joined([
                ground([-12.0, -5.0], [12.0, 0.0], 5000, |_, _| 0.0).collect(),
                (0..9000)
                    .map(|i| {
                        let [x, z] = even(i);
                        at(24.0 * x - 12.0, 0.3 * random(i / 50), 11.0 * z)
                    })
                    .collect(),
            ]),
        ),
        ("room with a ceiling", room(true)),
        ("room without a ceiling", room(false)),
    ] {
        add(name, points, none(), false);
    }
    add("sweep of 64 lines", sweep(64, [-24.0, 2.0], 1.7, street_at), none(), true);
    add("sweep of 32 lines", sweep(32, [-30.0, 10.0], 1.8, street_at), none(), true);
    add(
        "sweep in a hall",
        sweep(16, [-15.0, 15.0], 1.2, |azimuth| (20.0 / azimuth.cos().abs().max(azimuth.sin().abs()), 7.0)),
        none(),
        true,
    );
    let square = || joined([statue(), patch(2.0, 5000)]);
    add("statue by structure from motion", square(), strays(DVec3::ZERO, 6.0, 2000.0, 700).collect(), false);
    add("seed of Gaussian splats", square(), strays(DVec3::ZERO, 4.0, 100.0, 4000).collect(), false);
    add("bust with one stray", bust(), vec![at(-3e4, 1e3, 40.0)], false);
    add("town with birds", town(), strays(DVec3::ZERO, 400.0, 3000.0, 150).collect(), false);
    bodies
}

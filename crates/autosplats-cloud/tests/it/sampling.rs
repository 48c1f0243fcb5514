//! Tests of sampling on surfaces: number, position and evenness of points.

use autosplats_cloud::{
    Axes, Contents, Crs, Error, FieldValues, PointCloud, Progress, Random, Unit,
    glam::{DVec3, Vec3},
    sample_surface,
};

fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Contents {
    Contents { cloud: PointCloud::new(DVec3::ZERO, positions), triangles }
}

fn sample(mesh: &Contents, count: usize) -> PointCloud {
    sample_surface(mesh, count, 1, &()).unwrap()
}

fn square() -> Contents {
    let corners = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    mesh(corners, vec![[0, 1, 2], [0, 2, 3]])
}

/// A unit square of `size`² small squares with two triangles each, in random order.
fn grid(size: u32) -> Contents {
    let at = |i: u32| [(i % (size + 1)) as f32 / size as f32, (i / (size + 1)) as f32 / size as f32, 0.0];
    let mut triangles: Vec<[u32; 3]> = (0..size * size)
        .flat_map(|i| {
            let a = i / size * (size + 1) + i % size;
            let [b, c, d] = [a + 1, a + size + 2, a + size + 1];
            [[a, b, c], [c, d, a]]
        })
        .collect();
    let mut random = Random::from_state(8);
    for i in (1..triangles.len()).rev() {
        triangles.swap(i, random.modulo(i + 1));
        triangles[i].rotate_left(random.modulo(3));
    }
    mesh((0..(size + 1) * (size + 1)).map(at).collect(), triangles)
}

/// An octahedron subdivided to a unit sphere, with `4^levels` triangles per face.
fn sphere(levels: usize) -> Contents {
    let mut triangles = Vec::new();
    for signs in 0..8 {
        let axis = |i: usize| DVec3::AXES[i] * if signs >> i & 1 == 0 { 1.0 } else { -1.0 };
        triangles.push([axis(0), axis(1), axis(2)]);
    }
    for _ in 0..levels {
        let split = |[a, b, c]: [DVec3; 3]| {
            let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        triangles = triangles.into_iter().flat_map(split).collect();
    }
    let positions = triangles.iter().flatten().map(|corner| corner.normalize().as_vec3().to_array()).collect();
    mesh(positions, (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

/// Triangles of all sizes and shapes, anywhere.
fn soup(count: u32) -> Contents {
    let mut random = Random::from_state(6);
    let mut positions = Vec::new();
    for _ in 0..count {
        let size = 10_f64.powf(-2.0 * random.unit());
        let mut vector = |size: f64| DVec3::new(random.unit(), random.unit(), random.unit()) * size;
        let middle = vector(10.0);
        positions.extend([0; 3].map(|_| (middle + vector(size)).as_vec3().to_array()));
    }
    mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}

fn corners(mesh: &Contents, triangle: usize) -> [DVec3; 3] {
    mesh.triangles[triangle].map(|corner| mesh.cloud.world_position(corner as usize))
}

fn area(mesh: &Contents, triangle: usize) -> f64 {
    let [a, b, c] = corners(mesh, triangle);
    0.5 * (b - a).cross(c - a).length()
}

/// Distance to a triangle; infinite beyond its borders.
fn distance([a, b, c]: [DVec3; 3], point: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let slack = 1e-5 * (b - a).length().max((c - a).length());
    let inside = [[a, b], [b, c], [c, a]]
        .into_iter()
        .all(|[from, to]| normal.normalize().cross((to - from).normalize()).dot(point - from) >= -slack);
    if inside { normal.normalize().dot(point - a).abs() } else { f64::INFINITY }
}

/// Sorted distances to the nearest other point, relative to the mean distance of random points of the same density.
fn spacings(cloud: &PointCloud, area: f64) -> Vec<f64> {
    let points: Vec<Vec3> = cloud.positions().iter().map(|&point| Vec3::from(point)).collect();
    let unit = 0.5 * (area / points.len() as f64).sqrt();
    let nearest = |i: usize| {
        let others = points.iter().enumerate().filter(|(j, _)| *j != i);
        others.map(|(_, other)| other.distance_squared(points[i])).fold(f32::INFINITY, f32::min).sqrt()
    };
    let mut spacings: Vec<f64> = (0..points.len()).map(|i| f64::from(nearest(i)) / unit).collect();
    spacings.sort_by(f64::total_cmp);
    spacings
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

#[test]
fn exactly_as_many_as_asked_for() {
    for mesh in [square(), grid(20), soup(100)] {
        for count in [0, 1, 2, 3, 1000, 5003] {
            assert_eq!(sample(&mesh, count).len(), count, "on {} triangles", mesh.triangles.len());
        }
    }
}

#[test]
fn as_many_points_on_a_triangle_as_its_area_says() {
    let mesh = soup(300);
    let count = 30_000;
    let cloud = sample(&mesh, count);
    let areas: Vec<f64> = (0..300).map(|triangle| area(&mesh, triangle)).collect();
    let total: f64 = areas.iter().sum();
    let mut found = vec![0.0; 300];
    for i in 0..count {
        let point = cloud.world_position(i);
        let nearest = (0..300).map(|triangle| (distance(corners(&mesh, triangle), point), triangle));
        let (distance, triangle) = nearest.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        // Some f32 steps at 10.
        assert!(distance < 5e-6, "point {i} is {distance} off the surface");
        found[triangle] += 1.0;
    }
    let mut chi_square = 0.0;
    for (found, area) in found.iter().zip(areas) {
        let expected = count as f64 * area / total;
        // One patch more or less at either end of the triangle's part of the curve.
        assert!((found - expected).abs() <= 2.0, "{found} points where {expected} are due");
        chi_square += (found - expected) * (found - expected) / expected.max(1.0);
    }
    // Random points would give 300 ± 25, with 300 degrees of freedom.
    assert!(chi_square < 100.0, "chi-square is {chi_square}");
}

#[test]
fn large_regions_of_small_triangles_get_their_share() {
    let cloud = sample(&grid(300), 10_000);
    for cell in 0..16 {
        let (x, y) = ((cell % 4) as f32 / 4.0, (cell / 4) as f32 / 4.0);
        let inside = |&&[px, py, _]: &&[f32; 3]| px >= x && px < x + 0.25 && py >= y && py < y + 0.25;
        let found = cloud.positions().iter().filter(inside).count();
        // Random points would be off by 24, these only by those at the border.
        assert!((found as i32 - 625).abs() <= 20, "{found} of 625 points in cell {cell}");
    }
}

#[test]
fn points_keep_more_distance_than_random_ones() {
    let mut random = Random::from_state(9);
    let scatter = (0..4000).map(|_| [random.unit() as f32, random.unit() as f32, 0.0]).collect();
    let scatter = spacings(&PointCloud::new(DVec3::ZERO, scatter), 1.0);
    assert!((mean(&scatter) - 1.0).abs() < 0.05, "the measure: {}", mean(&scatter));
    assert!(scatter[40] < 0.2, "the measure: every hundredth has a neighbour at {}", scatter[40]);
    let surfaces = [
        ("two triangles", square(), 1.0),
        ("triangles smaller than a patch", grid(200), 1.0),
        ("triangles as large as a patch", grid(45), 1.0),
        ("a sphere", sphere(5), 4.0 * std::f64::consts::PI),
    ];
    for (what, mesh, area) in surfaces {
        let spacings = spacings(&sample(&mesh, 4000), area);
        assert!(mean(&spacings) > 1.33, "{what}: mean distance {}", mean(&spacings));
        assert!(spacings[40] > 0.65, "{what}: every hundredth has a neighbour at {}", spacings[40]);
    }
}

#[test]
fn threads_change_nothing_and_seeds_do() {
    let mesh = soup(50);
    let threads = |count| rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
    let one = threads(1).install(|| sample(&mesh, 20_000));
    let four = threads(4).install(|| sample(&mesh, 20_000));
    assert!(one == four, "the same points");
    let other = sample_surface(&mesh, 20_000, 2, &()).unwrap();
    assert!(one != other, "another seed gives other points");
}

#[test]
fn attributes_go_with_the_points() {
    let mut mesh = grid(10);
    let positions = mesh.cloud.positions().to_vec();
    let along = |axis: usize| positions.iter().map(move |position| position[axis]);
    let normals = along(0).map(|x| if x < 0.5 { 0.0 } else { 1.0 }).collect::<Vec<f32>>();
    let origin = DVec3::new(5e5, 4e6, 100.0);
    mesh.cloud = PointCloud::new(origin, positions.clone())
        .with_axes(Axes::YUp)
        .with_crs(Crs { unit: Some(Unit::Foot), ..Crs::default() })
        .with_colors(along(0).map(|x| [(x * 200.0) as u8, 0, 255]).collect())
        .unwrap()
        .with_field("y", FieldValues::F32(along(1).collect()))
        .unwrap()
        .with_field("x", FieldValues::F64(along(0).map(f64::from).collect()))
        .unwrap()
        .with_field("Classification", FieldValues::U8(along(0).map(|x| (x * 10.0).round() as u8).collect()))
        .unwrap()
        .with_field("NormalX", FieldValues::F32(normals.clone()))
        .unwrap()
        .with_field("NormalY", FieldValues::F32(normals.iter().map(|x| 1.0 - x).collect()))
        .unwrap()
        .with_field("NormalZ", FieldValues::F32(vec![0.0; positions.len()]))
        .unwrap();
    let cloud = sample(&mesh, 3000);
    assert_eq!((cloud.origin(), cloud.axes()), (origin, Some(Axes::YUp)), "where and which way up");
    assert_eq!(cloud.crs().unit, Some(Unit::Foot), "in which unit");
    let value = |name: &str, i: usize| cloud.field(name).unwrap().values.get(i);
    for (i, [x, y, _]) in cloud.positions().iter().enumerate() {
        assert!((value("x", i) - f64::from(*x)).abs() < 1e-5, "point {i}: x is {x}");
        assert!((value("y", i) - f64::from(*y)).abs() < 1e-5, "point {i}: y is {y}");
        let [red, green, blue] = cloud.colors().unwrap()[i];
        assert!((f32::from(red) - x * 200.0).abs() <= 1.5 && (green, blue) == (0, 255), "point {i}: {red} at {x}");
        // The corner with the largest weight is within two thirds of a triangle.
        assert!((value("Classification", i) / 10.0 - f64::from(*x)).abs() < 0.067, "point {i}: the class at {x}");
        let length = value("NormalX", i).hypot(value("NormalY", i));
        assert!((length - 1.0).abs() < 1e-5, "point {i}: a normal of length {length}");
    }
}

#[test]
fn triangles_that_are_none_get_no_points() {
    let mut mesh = square();
    let mut positions = mesh.cloud.positions().to_vec();
    positions.extend([[f32::NAN, 0.0, 0.0], [f32::INFINITY, 0.0, 0.0], [9.0, 9.0, 9.0]]);
    mesh.cloud = PointCloud::new(DVec3::ZERO, positions);
    let faults = [[0, 1, 4], [0, 1, 5], [6, 6, 0], [0, 0, 0], [0, 1, 99], [u32::MAX, 0, 1]];
    let with_faults = Contents { cloud: mesh.cloud.clone(), triangles: [&faults[..], &mesh.triangles].concat() };
    assert!(sample(&with_faults, 500) == sample(&mesh, 500), "as if they were not there");
    for triangles in [vec![], faults.to_vec()] {
        let result = sample_surface(&Contents { triangles, ..mesh.clone() }, 5, 1, &());
        assert!(matches!(result, Err(Error::NoSurface)), "no area: {result:?}");
    }
    assert!(Error::NoSurface.to_string().contains("use the points"), "the remedy is told");
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _fraction: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    assert!(matches!(sample_surface(&mesh, 5, 1, &Stop), Err(Error::Cancelled)), "cancelled");
    let result = sample_surface(&mesh, usize::MAX, 1, &());
    assert!(
        matches!(result, Err(Error::OutOfMemory { .. })),
        "more than there is memory: {:?}",
        result.map(|c| c.len())
    );
}

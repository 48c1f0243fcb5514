//! Ranges of values: of constant fields there is none, and of values far from zero no digit is lost.

use autosplats::cloud::glam::DVec3;
use autosplats::cloud::{FieldValues, PointCloud};
use autosplats::{Background, Camera, ColorMode, Projection, Renderer, Settings, Shading};

use crate::renderers;

const SIZE: [u32; 2] = [96, 96];
const SIDE: usize = 150;

/// A tilted square, whose points have the values `value` of their place along x, 0 to 1.
fn square(values: impl FnOnce(Vec<f64>) -> FieldValues) -> (PointCloud, Camera) {
    let place = |i: usize| [i % SIDE, i / SIDE].map(|at| at as f32 / (SIDE - 1) as f32);
    let position = |i: usize| {
        let [x, y] = place(i);
        [x, y, 0.1 * y]
    };
    let along = (0..SIDE * SIDE).map(|i| place(i)[0].into()).collect();
    let cloud = PointCloud::new(DVec3::ZERO, (0..SIDE * SIDE).map(position).collect());
    let cloud = cloud.with_field("value", values(along)).expect("a value each");
    let middle = DVec3::new(0.5, 0.5, 0.05);
    let projection = Projection::PerspectiveFovDeg(60.0);
    let camera = Camera { eye: middle + DVec3::new(0.1, -0.2, 1.1), look_at: middle, up: DVec3::Y, projection };
    (cloud, camera)
}

fn settings(color: ColorMode) -> Settings {
    let background = Background::Transparent;
    let shading = Shading { color, background, lighting: false, occlusion: 0.0, ..Shading::default() };
    Settings { shading, ..Settings::default() }
}

fn by_value() -> Settings {
    settings(ColorMode::Field("value".into()))
}

/// The opaque colours of the middle row, from left to right.
fn middle_row(renderer: &mut Renderer, cloud: &PointCloud, camera: &Camera, settings: &Settings) -> Vec<[u8; 4]> {
    let frame = renderer.render(cloud, camera, SIZE, settings).expect("a frame");
    let row = &frame.image.pixels[(SIZE[1] / 2 * SIZE[0]) as usize..][..SIZE[0] as usize];
    row.iter().copied().filter(|pixel| pixel[3] == 255).collect()
}

#[test]
fn a_constant_field_has_one_color() {
    let count = SIDE * SIDE;
    for mut renderer in renderers() {
        for (what, values) in [
            ("a tenth in f32", FieldValues::F32(vec![0.1; count])),
            (
                "a tenth in f32, but for its last bits",
                FieldValues::F32((0..count).map(|i| [0.1, 0.100_000_01][i % 2]).collect()),
            ),
            ("a tenth in f64", FieldValues::F64(vec![0.1; count])),
            ("a time", FieldValues::F64(vec![312_345_678.123_456_7; count])),
            ("a time, but for its last bits", FieldValues::F64((0..count).map(|i| [3e8, 3e8 + 6e-8][i % 2]).collect())),
            ("intensity", FieldValues::U16(vec![1234; count])),
            ("a class", FieldValues::U8(vec![7; count])),
            ("a large number", FieldValues::U32(vec![4_000_000_001; count])),
            ("nanoseconds", FieldValues::I64(vec![1_700_000_000_123_456_789; count])),
            ("next to nothing", FieldValues::F32(vec![1e-30; count])),
            ("below zero", FieldValues::F64(vec![-9.87e20; count])),
        ] {
            let (cloud, camera) = square(|_| values);
            let frame = renderer.render(&cloud, &camera, SIZE, &by_value()).expect("a frame");
            let [low, high] = frame.counts.value_range.expect("values");
            assert!(low == high && frame.counts.range().is_none(), "{what}: {low} to {high}");
            let opaque: Vec<_> = frame.image.pixels.iter().filter(|pixel| pixel[3] == 255).collect();
            assert!(opaque.len() > 1000 && opaque.iter().all(|pixel| *pixel == opaque[0]), "{what}: one colour");
        }
        let flat: Vec<_> = (0..count).map(|i| [(i % SIDE) as f32 + 900.0, (i / SIDE) as f32, 0.1]).collect();
        let middle = DVec3::new(975.0, 75.0, 0.1);
        let projection = Projection::PerspectiveFovDeg(40.0);
        let camera = Camera { eye: middle + DVec3::new(9.0, -30.0, 160.0), look_at: middle, up: DVec3::Z, projection };
        let cloud = PointCloud::new(DVec3::ZERO, flat);
        let frame = renderer.render(&cloud, &camera, SIZE, &settings(ColorMode::Height)).expect("a frame");
        let [low, high] = frame.counts.value_range.expect("heights");
        assert!(low == high && (low - 0.1).abs() < 1e-3, "a floor has one height: {low} to {high}");
    }
}

#[test]
fn values_far_from_zero_run_smoothly() {
    type Make = fn(Vec<f64>) -> FieldValues;
    let cases: [(&str, f64, f64, Make); 6] = [
        ("seconds of GPS", 3.1e8, 3.1e8 + 40.0, |at| FieldValues::F64(at.iter().map(|at| 3.1e8 + 40.0 * at).collect())),
        ("a thousandth of a second", 1.7e9, 1.7e9 + 1e-3, |at| {
            FieldValues::F64(at.iter().map(|at| 1.7e9 + 1e-3 * at).collect())
        }),
        ("nanoseconds", 1.7e18, 1.7e18 + 1e9, |at| {
            FieldValues::I64(at.iter().map(|at| 1_700_000_000_000_000_000 + (1e9 * at) as i64).collect())
        }),
        ("numbers of points", 4e9, 4e9 + 1e3, |at| {
            FieldValues::U32(at.iter().map(|at| 4_000_000_000 + (1e3 * at) as u32).collect())
        }),
        ("intensities", 0.0, 500.0, |at| FieldValues::U16(at.iter().map(|at| (500.0 * at) as u16).collect())),
        ("some unknown", 3e8, 3e8 + 40.0, |at| {
            FieldValues::F64(
                at.iter().enumerate().map(|(i, at)| if i % 9 == 0 { f64::NAN } else { 3e8 + 40.0 * at }).collect(),
            )
        }),
    ];
    for mut renderer in renderers() {
        for (what, low, high, make) in cases {
            let (cloud, camera) = square(make);
            let range = renderer.render(&cloud, &camera, SIZE, &by_value()).expect("a frame").counts.range();
            let found = range.expect("a range");
            let off = [found[0] - low, high - found[1]].map(|off| off / (high - low));
            assert!(off.iter().all(|off| (-0.01..0.05).contains(off)), "{what}: {found:?}");
            for given in [None, range] {
                let mut settings = by_value();
                settings.shading.range = given;
                let row = middle_row(&mut renderer, &cloud, &camera, &settings);
                // Viridis rises from dark to light; each step is small.
                let light = |pixel: &[u8; 4]| pixel[..3].iter().map(|&channel| i32::from(channel)).sum::<i32>();
                let steps: Vec<i32> = row.windows(2).map(|pair| light(&pair[1]) - light(&pair[0])).collect();
                assert!(row.len() > 60 && steps.iter().all(|step| step.abs() < 30), "{what}, {given:?}: {steps:?}");
                assert!(light(&row[row.len() - 1]) - light(&row[0]) > 150, "{what}, {given:?}: from end to end");
            }
        }
    }
}

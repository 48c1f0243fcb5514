//! Tests of depth images of every file format, byte order and unit, and of the cameras beside them.

use std::{io::Cursor, path::Path, sync::Mutex};

use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
use autosplats_formats::{DepthCamera, ReadOptions, describe_bytes, read_bytes, read_with};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, IntegerBounds, Layer, LayerAttributes, Vec2,
    WritableImage as _, f16,
};
use tiff::{
    encoder::{Compression, TiffEncoder, colortype},
    tags::Tag,
};

const WIDTH: usize = 40;
const HEIGHT: usize = 30;

#[derive(Default)]
struct Ear(Mutex<Vec<String>>);

impl Progress for Ear {
    fn report(&self, _fraction: f32) {}

    fn note(&self, note: &str) {
        assert!(!note.contains(char::is_control), "one line: {note:?}");
        self.0.lock().unwrap().push(note.into());
    }
}

fn noted(name: &str, bytes: &[u8]) -> Result<(PointCloud, Vec<String>), Error> {
    let camera = DepthCamera { fx: 40.0, fy: 40.0, cx: 19.5, cy: 14.5, scale: None };
    let options = ReadOptions { depth_camera: Some(camera), ..ReadOptions::default() };
    let ear = Ear::default();
    let cloud = read_bytes(Path::new(name), bytes, &options, &ear)?;
    Ok((cloud, ear.0.into_inner().unwrap()))
}

fn refusal(name: &str, bytes: &[u8]) -> String {
    let error = noted(name, bytes).unwrap_err().to_string();
    assert!(error.starts_with(name) && !error.contains(char::is_control), "{error}");
    error
}

/// Depths in metres of a tilted, curved surface; the first pixel has none.
fn depths() -> Vec<f32> {
    let depth = |i: usize| {
        let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
        1.5 + 0.0107 * x + 0.02 * y + 0.0007 * (x - 20.0) * (x - 20.0)
    };
    (0..WIDTH * HEIGHT).map(|i| if i == 0 { 0.0 } else { depth(i) }).collect()
}

fn millimetres() -> Vec<u16> {
    depths().iter().map(|depth| (1000.0 * depth).round() as u16).collect()
}

fn pfm(big_endian: bool) -> Vec<u8> {
    let scale = if big_endian { "1.0" } else { "-1.0" };
    let mut bytes = format!("Pf\n{WIDTH} {HEIGHT}\n{scale}\n").into_bytes();
    for row in depths().chunks(WIDTH).rev() {
        bytes.extend(row.iter().flat_map(|value| if big_endian { value.to_be_bytes() } else { value.to_le_bytes() }));
    }
    bytes
}

fn tiff<C: colortype::ColorType>(values: &[C::Inner], compression: Compression, map: bool) -> Vec<u8>
where
    [C::Inner]: tiff::encoder::TiffValue,
{
    let mut bytes = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut bytes).unwrap().with_compression(compression);
    let mut image = encoder.new_image::<C>(WIDTH as u32, HEIGHT as u32).unwrap();
    if map {
        image.encoder().write_tag(Tag::ModelPixelScaleTag, &[1.0, 1.0, 0.0][..]).unwrap();
    }
    image.write_data(values).unwrap();
    bytes.into_inner()
}

fn exr(channels: Vec<(&str, FlatSamples)>, part: bool) -> Vec<u8> {
    let list = channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let mut layer =
        Layer::new((WIDTH, HEIGHT), LayerAttributes::default(), Encoding::SMALL_LOSSLESS, AnyChannels::sort(list));
    if part {
        layer.attributes.layer_position = Vec2(3, 2);
    }
    let mut image = Image::from_layer(layer);
    if part {
        image.attributes.display_window = IntegerBounds::new((0, 0), (WIDTH + 5, HEIGHT + 4));
    }
    let mut bytes = Cursor::new(Vec::new());
    image.write().non_parallel().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

fn floats(by: f32) -> FlatSamples {
    FlatSamples::F32(depths().iter().map(|depth| depth * by).collect())
}

/// The distance of the worst point from where it belongs.
fn worst(cloud: &PointCloud) -> f64 {
    assert_eq!(cloud.len(), WIDTH * HEIGHT - 1, "all pixels but the first");
    let expected = depths().into_iter().enumerate().skip(1).map(|(i, depth)| {
        let [x, y] = [(i % WIDTH) as f64 - 19.5, (i / WIDTH) as f64 - 14.5];
        DVec3::new(x / 40.0, y / 40.0, 1.0) * f64::from(depth)
    });
    expected.enumerate().map(|(i, place)| cloud.world_position(i).distance(place)).fold(0.0, f64::max)
}

#[test]
fn floats_are_metres_and_whole_numbers_millimetres() {
    let whole: Vec<f32> = millimetres().into_iter().map(f32::from).collect();
    let doubles: Vec<f64> = depths().into_iter().map(f64::from).collect();
    let halves = FlatSamples::F16(depths().into_iter().map(f16::from_f32).collect());
    let plain = Compression::Uncompressed;
    let deflate = Compression::Deflate(tiff::encoder::DeflateLevel::Fast);
    let (gray, zero) = (|| FlatSamples::F32(vec![0.5; WIDTH * HEIGHT]), || FlatSamples::F32(vec![9.0; WIDTH * HEIGHT]));
    for (name, bytes, unit, error) in [
        ("a.pfm", pfm(false), "metres", 1e-6),
        ("b.pfm", pfm(true), "metres", 1e-6),
        ("a.tif", tiff::<colortype::Gray32Float>(&depths(), plain, false), "metres", 1e-6),
        ("b.tiff", tiff::<colortype::Gray32Float>(&depths(), deflate, false), "metres", 1e-6),
        ("c.tif", tiff::<colortype::Gray32Float>(&depths(), Compression::Lzw, false), "metres", 1e-6),
        ("d.tif", tiff::<colortype::Gray64Float>(&doubles, plain, false), "metres", 1e-6),
        ("e.tif", tiff::<colortype::Gray32Float>(&whole, plain, false), "millimetres", 1e-3),
        ("f.tif", tiff::<colortype::Gray16>(&millimetres(), plain, false), "", 1e-3),
        ("a.exr", exr(vec![("Z", floats(1.0))], false), "metres", 1e-6),
        ("b.exr", exr(vec![("Y", floats(1.0))], false), "metres", 1e-6),
        (
            "c.exr",
            exr(vec![("ViewLayer.Depth.Z", floats(1.0)), ("ViewLayer.Combined.R", gray())], false),
            "metres",
            1e-6,
        ),
        (
            "d.exr",
            exr(vec![("R", gray()), ("G", gray()), ("B", gray()), ("N.Z", zero()), ("Z", floats(1.0))], false),
            "metres",
            1e-6,
        ),
        ("e.exr", exr(vec![("depth", halves)], false), "metres", 3e-3),
        ("f.exr", exr(vec![("Z", floats(1000.0).clone())], false), "", 9e9),
    ] {
        let (cloud, notes) = noted(name, &bytes).unwrap_or_else(|error| panic!("{error}"));
        let told = notes.iter().find_map(|note| note.split(" are taken as ").nth(1)).unwrap_or_default();
        if error < 1.0 {
            assert!(worst(&cloud) < error, "{name}: {} off", worst(&cloud));
            assert_eq!(told.split(';').next(), Some(unit), "{name}: {notes:?}");
        } else {
            assert!(told.starts_with("metres"), "{name}: large, and not whole; told: {notes:?}");
        }
        assert!(notes.iter().any(|note| note.contains("1 of 1200 pixels have no depth")), "{name}: {notes:?}");
        let described = describe_bytes(Path::new(name), &bytes, &ReadOptions::default()).unwrap();
        assert_eq!(described.details[0].1, "40 × 30", "{name}");
        assert!(described.format.starts_with("depth image, "), "{name}: {}", described.format);
        // By content as well.
        assert_eq!(noted("unnamed", &bytes).unwrap().0.len(), cloud.len(), "{name} without its extension");
    }
}

#[test]
fn what_floats_say_of_no_depth() {
    let mut values = depths();
    for (value, none) in values.iter_mut().zip([f32::NAN, f32::INFINITY, -1.0, 0.0, 1e10, f32::MAX, 65504.0, 65535.0]) {
        *value = none;
    }
    let bytes = tiff::<colortype::Gray32Float>(&values, Compression::Uncompressed, false);
    let (cloud, notes) = noted("a.tif", &bytes).unwrap();
    assert_eq!(cloud.len(), WIDTH * HEIGHT - 8, "{notes:?}");
    let nothing = tiff::<colortype::Gray32Float>(&[f32::NAN; WIDTH * HEIGHT], Compression::Uncompressed, false);
    assert!(noted("a.tif", &nothing).unwrap().0.is_empty(), "an image that saw nothing");
}

#[test]
fn parts_of_pictures_are_at_their_place() {
    let (cloud, _) = noted("a.exr", &exr(vec![("Z", floats(1.0))], true)).unwrap();
    let depth = f64::from(depths()[1]);
    let expected = DVec3::new((4.0 - 19.5) / 40.0, (2.0 - 14.5) / 40.0, 1.0) * depth;
    assert!(cloud.world_position(0).distance(expected) < 1e-6, "{}", cloud.world_position(0));
    assert_eq!(cloud.len(), WIDTH * HEIGHT - 1, "and no more");
}

#[test]
fn swapped_bytes_are_told_and_mended() {
    let right = millimetres();
    let swapped: Vec<u16> = right.iter().map(|value| value.swap_bytes()).collect();
    let png = |values: &[u16]| {
        let image = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(WIDTH as u32, HEIGHT as u32, values.to_vec());
        let mut bytes = Cursor::new(Vec::new());
        image.unwrap().write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let pgm = |values: &[u16]| {
        let head = format!("P5 {WIDTH} {HEIGHT} 65535\n").into_bytes();
        [head, values.iter().flat_map(|value| value.to_be_bytes()).collect()].concat()
    };
    let tif = |values: &[u16]| tiff::<colortype::Gray16>(values, Compression::Uncompressed, false);
    for (name, write) in [("a.png", &png as &dyn Fn(&[u16]) -> Vec<u8>), ("a.pgm", &pgm), ("a.tif", &tif)] {
        let mut told = [&right, &swapped].map(|values| noted(name, &write(values)).unwrap());
        assert!(worst(&told[1].0) < 1e-3, "{name}: {} off", worst(&told[1].0));
        assert_eq!(told[0].0.positions(), told[1].0.positions(), "{name}");
        let is_about_bytes = |note: &String| note.contains("bytes of each value are swapped");
        assert_eq!(told.each_mut().map(|(_, notes)| notes.iter().any(is_about_bytes)), [false, true], "{name}");
    }
}

#[test]
fn pictures_maps_and_disparities_are_refused() {
    let plain = Compression::Uncompressed;
    let map = tiff::<colortype::Gray32Float>(&depths(), plain, true);
    assert!(refusal("a.tif", &map).contains("gdal_translate"), "heights of a map");
    let float = tiff::<colortype::Gray32Float>(&depths(), plain, false);
    for name in ["disp_0.tif", "0_disparity.tif", "Disparity.tif"] {
        assert!(refusal(name, &float).contains("disparities"), "{name}");
    }
    assert!(noted("display_dispatch.tif", &float).is_ok(), "other words");
    let gray = tiff::<colortype::Gray8>(&[7; WIDTH * HEIGHT], plain, false);
    assert!(refusal("a.tif", &gray).contains("8-bit grey TIFF"), "a grey picture");
    let color = tiff::<colortype::RGB8>(&[7; 3 * WIDTH * HEIGHT], plain, false);
    assert!(refusal("a.tif", &color).contains("several channels"), "a picture in colours");
    let picture = exr(["R", "G", "B"].map(|name| (name, floats(1.0))).to_vec(), false);
    assert!(refusal("a.exr", &picture).contains("channel Z or depth"), "a picture in linear light");
    assert!(refusal("a.pfm", &[b"PF".to_vec(), pfm(false)[2..].to_vec()].concat()).contains("colours"), "colours");
}

#[test]
fn images_cut_or_changed_anywhere_do_no_harm() {
    let tiffs = [Compression::Uncompressed, Compression::Lzw];
    let tiffs = tiffs.map(|compression| tiff::<colortype::Gray32Float>(&depths(), compression, false));
    let exr = exr(vec![("Z", floats(1.0))], false);
    let mut random = autosplats_cloud::Random::from_state(3);
    for bytes in [pfm(false), exr].into_iter().chain(tiffs) {
        for len in (0..bytes.len()).step_by(1 + bytes.len() / 300) {
            let _ = noted("unnamed", &bytes[..len]);
        }
        for _ in 0..500 {
            let mut bytes = bytes.clone();
            let within = if random.modulo(2) == 0 { bytes.len().min(400) } else { bytes.len() };
            let at = random.modulo(within);
            bytes[at] = if random.modulo(2) == 0 { 255 } else { random.bits() as u8 };
            if let Ok((cloud, _)) = noted("unnamed", &bytes) {
                assert!(cloud.byte_len() <= 1 << 26, "memory in proportion to the file");
            }
        }
    }
    let mut wide = pfm(false);
    wide.splice(3..8, *b"9999 9999");
    assert!(refusal("a.pfm", &wide).contains("the file ends after"), "a claim in a header");
}

#[test]
fn cameras_beside_an_image() {
    let yaml = "image_width: 80\nimage_height: 60\ncamera_name: depth\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
                data: [80, 0, 39, 0, 80, 29, 0, 0, 1]\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [DDD, 0, 0, 0, 0]\n";
    let json = r#"{"intrinsic": {"width": 80, "height": 60, "intrinsic_matrix": [80,0,0, 0,80,0, 39,29,1]}}"#;
    for (name, camera, text, distorted) in [
        ("depth_1.pfm", "camera_info.yaml", yaml.replace("DDD", "0"), false),
        ("depth_1.pfm", "camera_info.yaml", yaml.replace("DDD", "-0.2"), true),
        ("depth_1.pfm", "camera.json", json.into(), false),
        ("depth_1.pfm", "depth_1.json", json.into(), false),
        ("DepthCapture_2026.pfm", "DepthCamera_2026.json", json.into(), false),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(camera), text).unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, pfm(false)).unwrap();
        let ear = Ear::default();
        let cloud = read_with(&path, &ReadOptions::default(), &ear).unwrap();
        let notes = ear.0.into_inner().unwrap();
        assert_eq!(notes.iter().filter(|note| note.contains(&format!("read from {camera}"))).count(), 1, "{notes:?}");
        assert_eq!(notes.iter().any(|note| note.contains("distortion")), distorted, "{notes:?}");
        let depth = f64::from(depths()[1]);
        let expected = DVec3::new((1.0 - 19.5) / 40.0, (0.0 - 14.5) / 40.0, 1.0) * depth;
        assert!(cloud.world_position(0).distance(expected) < 1e-6, "{camera}: {}", cloud.world_position(0));
    }
}

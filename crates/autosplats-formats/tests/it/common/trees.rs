//! Makers of small trees, and the values of their points.

use std::{collections::BTreeMap, path::Path};

use autosplats_cloud::{
    Key, Node, PointCloud, Random, Tree, Wanted,
    glam::{DVec3, IVec3},
};

/// The root's cube, and the number of cells along it at the root.
pub(crate) const CUBE: [DVec3; 2] = [DVec3::new(5e5, 5e6, 0.0), DVec3::new(5e5 + 64.0, 5e6 + 64.0, 64.0)];
const SPAN: f64 = 16.0;
/// The deepest level.
const DEEPEST: u32 = 3;
const SCALE: f64 = 0.001;

/// A point of a tree.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub(crate) at: DVec3,
    pub(crate) color: [u16; 3],
    pub(crate) intensity: u16,
    pub(crate) class: u8,
}

pub(crate) type Nodes = BTreeMap<Key, Vec<Sample>>;

/// Points on a wavy surface, each the child of the first point that its cell has at a level.
pub(crate) fn nodes(count: usize) -> Nodes {
    let mut random = Random::from_state(7);
    let mut nodes = Nodes::new();
    let mut taken = std::collections::HashSet::new();
    for _ in 0..count {
        let (x, y) = (64.0 * random.unit(), 64.0 * random.unit());
        let z = 20.0 + 8.0 * (0.2 * x).sin() + 8.0 * (0.15 * y).cos();
        let at = (DVec3::new(x, y, z) / SCALE).round() * SCALE;
        let sample = Sample {
            at: CUBE[0] + at,
            color: [x, y, z].map(|along| ((4.0 * along) as u16) << 8),
            intensity: random.bits() as u16,
            class: random.modulo(4) as u8,
        };
        let place = |level: u32, cells: f64| {
            let fraction = at / 64.0 * f64::from(1_u32 << level) * cells;
            fraction.floor().as_ivec3().min(IVec3::splat((f64::from(1_u32 << level) * cells) as i32 - 1))
        };
        let level = (0..DEEPEST).find(|&level| taken.insert((level, place(level, SPAN)))).unwrap_or(DEEPEST);
        let key = |level| Key::new(level, place(level, 1.0).to_array().map(i32::cast_unsigned)).unwrap();
        (0..level).for_each(|above| _ = nodes.entry(key(above)).or_default());
        nodes.entry(key(level)).or_default().push(sample);
    }
    nodes
}

/// A LAZ file of points.
pub(crate) fn laz(points: &[Sample]) -> Vec<u8> {
    let mut builder = las::Builder::from((1, 4));
    builder.point_format = las::point::Format::new(7).unwrap();
    builder.point_format.is_compressed = true;
    let transform = |offset| las::Transform { scale: SCALE, offset };
    builder.transforms = las::Vector { x: transform(CUBE[0].x), y: transform(CUBE[0].y), z: transform(CUBE[0].z) };
    let mut writer = las::Writer::new(std::io::Cursor::new(Vec::new()), builder.into_header().unwrap()).unwrap();
    for Sample { at, color: [red, green, blue], intensity, class } in points {
        let point = las::Point {
            x: at.x,
            y: at.y,
            z: at.z,
            intensity: *intensity,
            return_number: 1,
            number_of_returns: 1,
            classification: las::point::Classification::new(*class).unwrap(),
            gps_time: Some(f64::from(*intensity)),
            color: Some(las::Color::new(*red, *green, *blue)),
            ..Default::default()
        };
        writer.write_point(point).unwrap();
    }
    writer.close().unwrap();
    writer.into_inner().unwrap().into_inner()
}

fn word(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// What an entry of the hierarchy of a COPC file states.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Entry {
    pub(crate) key: [i32; 4],
    pub(crate) offset: u64,
    pub(crate) bytes: i32,
    pub(crate) points: i32,
}

impl Entry {
    pub(crate) fn bytes(self) -> [u8; 32] {
        let mut raw = [0; 32];
        raw[..16].copy_from_slice(self.key.map(i32::to_le_bytes).as_flattened());
        raw[16..24].copy_from_slice(&self.offset.to_le_bytes());
        raw[24..28].copy_from_slice(&self.bytes.to_le_bytes());
        raw[28..].copy_from_slice(&self.points.to_le_bytes());
        raw
    }
}

/// A COPC file of nodes, and the entries of its only page.
pub(crate) fn copc(nodes: &Nodes) -> (Vec<u8>, Vec<Entry>) {
    let all: Vec<Sample> = nodes.values().flatten().cloned().collect();
    let whole = laz(&all);
    let start = word(&whole, 96) + 54 + 160;
    let mut info = vec![0; 54];
    info[2..6].copy_from_slice(b"copc");
    info[18] = 1;
    info[20] = 160;
    let middle = CUBE[0].midpoint(CUBE[1]);
    info.extend([middle.x, middle.y, middle.z, 32.0, 64.0 / SPAN].map(f64::to_le_bytes).as_flattened());
    info.resize(54 + 160, 0);
    let mut bytes = [&whole[..375], &info, &whole[375..word(&whole, 96)], &(-1_i64).to_le_bytes()].concat();
    let mut entries = Vec::new();
    for (key, points) in nodes {
        let mut entry =
            Entry { key: [key.level, key.x, key.y, key.z].map(u32::cast_signed), offset: 0, bytes: 0, points: 0 };
        if !points.is_empty() {
            let file = laz(points);
            let first = word(&file, 96);
            let table = u64::from_le_bytes(file[first..first + 8].try_into().unwrap()) as usize;
            let chunk = &file[first + 8..table];
            entry.offset = bytes.len() as u64;
            (entry.bytes, entry.points) = (chunk.len() as i32, points.len() as i32);
            bytes.extend(chunk);
        }
        entries.push(entry);
    }
    let record = bytes.len() as u64;
    let mut put = |at: usize, value: &[u8]| bytes[at..at + value.len()].copy_from_slice(value);
    put(96, &(start as u32).to_le_bytes());
    put(100, &(word(&whole, 100) as u32 + 1).to_le_bytes());
    put(235, &record.to_le_bytes());
    put(243, &1_u32.to_le_bytes());
    let mut header = [0; 60];
    header[2..6].copy_from_slice(b"copc");
    header[18..20].copy_from_slice(&1000_u16.to_le_bytes());
    header[20..28].copy_from_slice(&(32 * entries.len() as u64).to_le_bytes());
    bytes.extend(header);
    with_page(&mut bytes, &entries);
    (bytes, entries)
}

/// Appends a page to a COPC file, and makes it the page of the root. Returns its place.
pub(crate) fn with_page(bytes: &mut Vec<u8>, entries: &[Entry]) -> (u64, i32) {
    let (at, len) = (bytes.len() as u64, 32 * entries.len());
    bytes.extend(entries.iter().flat_map(|entry| entry.bytes()));
    bytes[469..477].copy_from_slice(&at.to_le_bytes());
    bytes[477..485].copy_from_slice(&(len as u64).to_le_bytes());
    (at, len as i32)
}

/// Writes an octree of Potree, whose nodes are of this encoding. The children of the root have pages of their own.
pub(crate) fn write_potree(folder: &Path, nodes: &Nodes, encoding: &str) {
    let attribute = |name: &str, kind: &str, size: usize, count: usize| {
        format!(
            r#"{{"name":"{name}","type":"{kind}","size":{},"elementSize":{size},"numElements":{count}}}"#,
            size * count
        )
    };
    let attributes = [
        attribute("position", "int32", 4, 3),
        attribute("intensity", "uint16", 2, 1),
        attribute("classification", "uint8", 1, 1),
        attribute("rgb", "uint16", 2, 3),
    ]
    .join(",");
    let octant = |key: &Key| (key.x & 1) << 2 | (key.y & 1) << 1 | key.z & 1;
    let (mut pages, mut data) = (BTreeMap::new(), Vec::new());
    for page in nodes.keys().filter(|key| key.level <= 1) {
        let (mut level, mut list) = (vec![*page], Vec::new());
        while !level.is_empty() {
            let mut next = Vec::new();
            for key in level {
                let is_proxy = *page == Key::ROOT && key.level == 1;
                let mut children: Vec<Key> = key.children().filter(|child| nodes.contains_key(child)).collect();
                children.sort_by_key(octant);
                let mask = children.iter().fold(0, |mask, child| mask | 1_u8 << octant(child));
                list.push((key, is_proxy, mask));
                next.extend(children.into_iter().filter(|_| !is_proxy));
            }
            level = next;
        }
        pages.insert(*page, list);
    }
    let mut places = BTreeMap::new();
    for (key, points) in nodes {
        let stored = if encoding == "BROTLI" { packed(points) } else { points.iter().flat_map(record).collect() };
        let stored = if points.is_empty() { Vec::new() } else { stored };
        places.insert(*key, [data.len(), stored.len()]);
        data.extend(stored);
    }
    let mut at = 0;
    let starts: BTreeMap<Key, [usize; 2]> = pages
        .iter()
        .map(|(key, list)| {
            at += 22 * list.len();
            (*key, [at - 22 * list.len(), 22 * list.len()])
        })
        .collect();
    let mut hierarchy: Vec<u8> = Vec::new();
    for (key, is_proxy, mask) in pages.values().flatten() {
        let kind = if *is_proxy { 2 } else { u8::from(*mask == 0) };
        hierarchy.extend([kind, *mask]);
        hierarchy.extend((nodes[key].len() as u32).to_le_bytes());
        let place = if *is_proxy { starts[key] } else { places[key] };
        hierarchy.extend(place.map(|number| (number as u64).to_le_bytes()).as_flattened());
    }
    let [low, high] = CUBE.map(|corner| corner.to_array());
    let points: usize = nodes.values().map(Vec::len).sum();
    let meta = format!(
        r#"{{"version":"2.0","name":"a","points":{points},"projection":"EPSG:32632","encoding":"{encoding}",
            "hierarchy":{{"firstChunkSize":{},"stepSize":1,"depth":{DEEPEST}}},"offset":{low:?},
            "scale":[{SCALE},{SCALE},{SCALE}],"spacing":{},"boundingBox":{{"min":{low:?},"max":{high:?}}},
            "attributes":[{attributes}]}}"#,
        starts[&Key::ROOT][1],
        64.0 / SPAN
    );
    for (name, bytes) in [("metadata.json", meta.as_bytes()), ("hierarchy.bin", &hierarchy), ("octree.bin", &data)] {
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

/// A compressed node of Potree, in blocks that Brotli stores as they are.
fn packed(points: &[Sample]) -> Vec<u8> {
    let woven = |numbers: [u32; 3], from: u32| {
        let bit = |index: u32| u64::from(numbers[index as usize % 3] >> (from + index / 3) & 1) << index;
        (0..48).map(bit).sum::<u64>().to_le_bytes()
    };
    let records: Vec<Vec<u8>> = points.iter().map(record).collect();
    let whole = |record: &[u8], axis: usize| u32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().unwrap());
    let places = records.iter().flat_map(|record| {
        let numbers = [0, 1, 2].map(|axis| whole(record, axis));
        [woven(numbers, 16), woven(numbers, 0)].concat()
    });
    let intensities = records.iter().flat_map(|record| record[12..14].to_vec());
    let classes = records.iter().map(|record| record[14]);
    let colors = points.iter().flat_map(|point| woven(point.color.map(u32::from), 0));
    let plain: Vec<u8> = places.chain(intensities).chain(classes).chain(colors).collect();
    let mut bytes = Vec::new();
    for (index, block) in plain.chunks(1 << 16).enumerate() {
        // A window of 16 bits, then: not the last block, four digits of length, stored.
        let len = block.len() as u32 - 1;
        let header = if index == 0 { len << 4 | 1 << 20 } else { len << 3 | 1 << 19 };
        bytes.extend(&header.to_le_bytes()[..3]);
        bytes.extend(block);
    }
    bytes.push(3);
    bytes
}

/// Writes an EPT, whose nodes are of this type. The children of the root have pages of their own.
pub(crate) fn write_ept(folder: &Path, nodes: &Nodes, kind: &str) {
    for name in ["ept-hierarchy", "ept-data"] {
        std::fs::create_dir_all(folder.join(name)).unwrap();
    }
    let axis = |name: &str, offset: f64| {
        format!(r#"{{"name":"{name}","type":"signed","size":4,"scale":{SCALE},"offset":{offset}}},"#)
    };
    let value = |name: &str, size: u32| format!(r#"{{"name":"{name}","type":"unsigned","size":{size}}}"#);
    let schema = [
        [axis("X", CUBE[0].x), axis("Y", CUBE[0].y), axis("Z", CUBE[0].z)].concat(),
        [value("Intensity", 2), value("Classification", 1), value("Red", 2), value("Green", 2), value("Blue", 2)]
            .join(","),
    ]
    .concat();
    let corners = CUBE.map(|corner| corner.to_array()).concat();
    let points: usize = nodes.values().map(Vec::len).sum();
    let meta = format!(
        r#"{{"bounds":{corners:?},"boundsConforming":{corners:?},"dataType":"{kind}","hierarchyType":"json",
            "points":{points},"schema":[{schema}],"span":{SPAN},"version":"1.1.0",
            "srs":{{"authority":"EPSG","horizontal":"32632","wkt":""}}}}"#
    );
    std::fs::write(folder.join("ept.json"), meta).unwrap();
    let mut pages: BTreeMap<Key, Vec<String>> = BTreeMap::new();
    for (&key, points) in nodes {
        let above = std::iter::successors(Some(key), |key| key.parent()).find(|key| key.level <= 1).unwrap();
        pages.entry(above).or_default().push(format!("\"{key}\": {}", points.len()));
        if key.level == 1 {
            pages.entry(Key::ROOT).or_default().push(format!("\"{key}\": -1"));
        }
        if !points.is_empty() {
            let extension = match kind {
                "laszip" => "laz",
                "binary" => "bin",
                _ => "zst",
            };
            let records = || points.iter().flat_map(record).collect::<Vec<u8>>();
            let stored = match kind {
                "laszip" => laz(points),
                "binary" => records(),
                _ => ruzstd::encoding::compress_to_vec(&*records(), ruzstd::encoding::CompressionLevel::Fastest),
            };
            std::fs::write(folder.join(format!("ept-data/{key}.{extension}")), stored).unwrap();
        }
    }
    for (key, entries) in pages {
        std::fs::write(folder.join(format!("ept-hierarchy/{key}.json")), format!("{{{}}}", entries.join(", ")))
            .unwrap();
    }
}

fn record(Sample { at, color, intensity, class }: &Sample) -> Vec<u8> {
    let grid = ((*at - CUBE[0]) / SCALE).round().as_ivec3();
    let mut bytes = grid.to_array().map(i32::to_le_bytes).concat();
    bytes.extend(intensity.to_le_bytes());
    bytes.push(*class);
    bytes.extend(color.map(u16::to_le_bytes).as_flattened());
    bytes
}

/// Everything of the points.
pub(crate) fn everything(exact: bool) -> Wanted {
    Wanted { colors: true, exact, ..Wanted::default() }
}

/// Keys of all nodes, whose pages are loaded.
pub(crate) fn keys(tree: &dyn Tree) -> Vec<Key> {
    let (mut all, mut level) = (Vec::new(), vec![Key::ROOT]);
    while !level.is_empty() {
        tree.load_pages(&level, &()).unwrap();
        level.retain(|&key| tree.node(key) != Node::Absent);
        all.extend(&level);
        level = level.iter().flat_map(|key| key.children()).collect();
    }
    all.sort_unstable();
    all
}

pub(crate) fn decoded(tree: &dyn Tree, key: Key, wanted: &Wanted) -> PointCloud {
    let bytes = tree.fetch(&[key], &()).unwrap().concat();
    tree.decode(key, &bytes, wanted).unwrap_or_else(|error| panic!("{error}"))
}

/// All values of each point, in the order of their coordinates.
pub(crate) fn rows(clouds: &[PointCloud], fields: &[String]) -> Vec<Vec<i64>> {
    let mut rows = Vec::new();
    for cloud in clouds {
        let fields: Vec<_> = fields.iter().map(|name| cloud.field(name)).collect();
        for i in 0..cloud.len() {
            let grid = cloud.world_position(i) / cloud.resolution().unwrap_or(DVec3::splat(SCALE));
            let mut row: Vec<i64> = grid.to_array().map(|value| value.round() as i64).into();
            row.extend(cloud.colors().map_or([0; 3], |colors| colors[i]).map(i64::from));
            row.extend(fields.iter().map(|field| field.map_or(0, |field| field.values.get(i).to_bits() as i64)));
            rows.push(row);
        }
    }
    rows.sort_unstable();
    rows
}

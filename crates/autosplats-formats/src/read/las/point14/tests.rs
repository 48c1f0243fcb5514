//! Compares the project's decoders with those of the `laz` crate, bit for bit, and tests damaged data.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

use std::{
    cell::RefCell,
    io::Cursor,
    panic::{AssertUnwindSafe, catch_unwind},
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use autosplats_cloud::Random;
use laz::{
    LazItem, LazItemRecordBuilder as Items, LazItemType, LazVlr, las,
    laszip::ChunkTable,
    models::ArithmeticModelBuilder,
    record::{
        LayeredPointRecordCompressor, LayeredPointRecordDecompressor, RecordCompressor, RecordDecompressor,
        SequentialPointRecordCompressor, SequentialPointRecordDecompressor,
    },
};

use super::{super::decompressor::decompressor, LAYERS, LEN};

/// A number of any size, small sizes as often as large ones.
fn any_size(random: &mut Random) -> i64 {
    let bits = random.modulo(64);
    random.bits() as i64 >> bits
}

/// Times of alternating scanners, of repeated pulses, and arbitrary ones.
struct Times {
    sequences: [(i64, i64); 6],
    current: usize,
    rarely: usize,
}

impl Times {
    fn new(random: &mut Random) -> Self {
        let begin = |i: usize| ((1e5 * (i * i * i + 1) as f64).to_bits() as i64, 1 + (i as i64) * 977);
        Self { sequences: std::array::from_fn(begin), current: 0, rarely: 2 + random.modulo(40) }
    }

    fn next(&mut self, random: &mut Random) -> i64 {
        if random.modulo(self.rarely) == 0 {
            self.current = random.modulo(6);
        }
        let (time, step) = &mut self.sequences[self.current];
        let multiple = [1, 1, 1, 0, 2, 9, 10, 77, 499, 500, 501, 5000, -1, -2, -9, -10, -11, -300][random.modulo(18)];
        let near = [0, 0, 1, -1, any_size(random) % 1000][random.modulo(5)];
        *time = time.wrapping_add(step.wrapping_mul(multiple)).wrapping_add(near);
        if random.modulo(self.rarely) == 0 {
            match random.modulo(4) {
                0 => *step = any_size(random) >> 33,
                1 => *time = random.bits() as i64,
                2 => *time = time.wrapping_add(any_size(random)),
                _ => {}
            }
        }
        *time
    }
}

/// Records that a scanner could make, and some that none would; each seed gives another mixture.
fn records(len: usize, count: usize, random: &mut Random) -> Vec<Vec<u8>> {
    // How rarely each kind of value changes; the last entry means never.
    let mut rarity = || [1, 2, 5, 20, 300, usize::MAX][random.modulo(6)];
    let [channel_rarity, wild, returns, flags, class, user, intensity, angle, source, time, rest] =
        std::array::from_fn(|_| rarity());
    let single_channel = random.modulo(3) == 0;
    let mut times = Times::new(random);
    let mut channels: [Vec<u8>; 4] = std::array::from_fn(|_| (0..len).map(|_| random.bits() as u8).collect());
    let mut channel = random.modulo(4);
    let mut last_time = times.next(random);
    let step_bits = random.modulo(31);
    let mut records = Vec::new();
    for _ in 0..count {
        if !single_channel && random.modulo(channel_rarity) == 0 {
            channel = random.modulo(4);
        }
        let record = &mut channels[channel];
        for at in [0, 4, 8] {
            let before = i32::from_le_bytes(record[at..at + 4].try_into().unwrap());
            let step = random.bits() as i32 >> step_bits;
            let value = match random.modulo(wild) == 0 {
                true => [i32::MIN, i32::MAX, 0, -1, random.bits() as i32][random.modulo(5)],
                false => before.wrapping_add(step),
            };
            record[at..at + 4].copy_from_slice(&value.to_le_bytes());
        }
        let bytes: [(usize, usize); 9] = [
            (12, intensity),
            (13, intensity),
            (14, returns),
            (16, class),
            (17, user),
            (18, angle),
            (19, angle),
            (20, source),
            (21, source),
        ];
        for (at, rarity) in bytes.into_iter().chain((LEN..len).map(|at| (at, rest))) {
            if random.modulo(rarity) == 0 {
                let small = record[at].wrapping_add(random.modulo(3) as u8);
                record[at] = [random.bits() as u8, small][random.modulo(2)];
            }
        }
        if random.modulo(flags) == 0 {
            record[15] = random.bits() as u8;
        }
        record[15] = record[15] & 0xcf | (channel as u8) << 4;
        if random.modulo(time) == 0 {
            last_time = times.next(random);
        }
        record[22..30].copy_from_slice(&last_time.to_le_bytes());
        records.push(record.clone());
    }
    records
}

fn is_layered(items: &[LazItem]) -> bool {
    items[0].version() >= 3
}

fn compress(items: &Vec<LazItem>, records: &[Vec<u8>]) -> Vec<u8> {
    let mut compressor: Box<dyn RecordCompressor<Cursor<Vec<u8>>>> = match is_layered(items) {
        true => Box::new(LayeredPointRecordCompressor::new(Cursor::new(Vec::new()))),
        false => Box::new(SequentialPointRecordCompressor::new(Cursor::new(Vec::new()))),
    };
    compressor.set_fields_from(items).unwrap();
    records.iter().for_each(|record| compressor.compress_next(record).unwrap());
    compressor.done().unwrap();
    compressor.box_into_inner().into_inner()
}

fn theirs<'a>(items: &Vec<LazItem>, chunk: &'a [u8]) -> Box<dyn RecordDecompressor<Cursor<&'a [u8]>> + 'a> {
    let mut decompressor: Box<dyn RecordDecompressor<Cursor<&'a [u8]>>> = match is_layered(items) {
        true => Box::new(LayeredPointRecordDecompressor::new(Cursor::new(chunk))),
        false => Box::new(SequentialPointRecordDecompressor::new(Cursor::new(chunk))),
    };
    decompressor.set_fields_from(items).unwrap();
    decompressor
}

fn layouts() -> Vec<Vec<LazItem>> {
    vec![
        Items::version_3_of::<las::Point6>(0),
        Items::version_3_of::<las::Point6>(3),
        Items::version_3_of::<las::Point7>(0),
        Items::version_3_of::<las::Point8>(5),
        Items::version_4_of::<las::Point6>(0),
        Items::version_4_of::<las::Point7>(2),
        Items::version_4_of::<las::Point8>(0),
        Items::version_2_of::<las::Point1>(0),
        Items::version_2_of::<las::Point3>(4),
    ]
}

fn record_len(items: &[LazItem]) -> usize {
    items.iter().map(|item| usize::from(item.size())).sum()
}

#[test]
fn generated_records_are_what_was_compressed() {
    let mut compared = 0;
    for seed in 0..1500 {
        let mut random = Random::from_state(seed);
        let layouts = layouts();
        let items = &layouts[seed as usize % layouts.len()];
        let len = record_len(items);
        let count = [1, 2, 50, 600][random.modulo(4)];
        for chunk in 0..2 {
            let mut records = records(len.max(LEN), count, &mut random);
            if !is_layered(items) {
                // The time is stored elsewhere in these formats.
                let time = |record: &mut Vec<u8>| record.copy_within(22..30, 20);
                records.iter_mut().for_each(time);
                records.iter_mut().for_each(|record| record.truncate(len));
            }
            // The crate adds without wrapping, which may panic.
            let Ok(compressed) = catch_unwind(|| compress(items, &records)) else { continue };
            let mut ours = decompressor(items, &compressed).unwrap();
            let mut theirs = theirs(items, &compressed);
            let [mut found, mut expected] = [(); 2].map(|()| vec![0; len]);
            for (index, record) in records.iter().enumerate() {
                let what = format!("seed {seed}, chunk {chunk}, record {index} of {items:?}");
                ours.decompress_next(&mut found).unwrap_or_else(|error| panic!("{what}: {error}"));
                assert_eq!(&found, record, "{what}");
                if catch_unwind(AssertUnwindSafe(|| theirs.decompress_next(&mut expected).unwrap())).is_ok() {
                    assert_eq!(found, expected, "{what}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 300_000, "{compared} records were compared");
}

fn data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("AUTOSPLATS_DATA").map_or_else(beside, PathBuf::from);
    if folder.join("README.md").exists() {
        return Some(folder);
    }
    assert!(std::env::var_os("CI").is_none(), "the shared files are not at {}", folder.display());
    None
}

/// The compression of a file, and the points and bytes of each of its chunks.
fn chunks(bytes: &[u8]) -> (Vec<LazItem>, Vec<(usize, &[u8])>) {
    let number = |at: usize, len: usize| {
        bytes[at..at + len].iter().rev().fold(0, |number, &byte| number << 8 | usize::from(byte))
    };
    let mut at = number(94, 2);
    while !bytes[at + 2..].starts_with(b"laszip encoded") {
        at += 54 + number(at + 20, 2);
    }
    let vlr = LazVlr::from_buffer(&bytes[at + 54..]).unwrap();
    let mut left = if bytes[25] >= 4 { number(247, 8) } else { number(107, 4) };
    let points = number(96, 4);
    let table = number(points, 8);
    let table = ChunkTable::read(&mut Cursor::new(&bytes[table..]), vlr.uses_variable_size_chunks()).unwrap();
    let mut chunks = Vec::new();
    let mut at = points + 8;
    for entry in table.as_ref() {
        let held = if vlr.uses_variable_size_chunks() { entry.point_count } else { vlr.chunk_size().into() };
        let held = left.min(held as usize);
        chunks.push((held, &bytes[at..at + entry.byte_count as usize]));
        at += entry.byte_count as usize;
        left -= held;
    }
    (vlr.items().clone(), chunks)
}

const REAL: [&str; 5] = [
    "lion_takanawa.copc.laz",
    "lone_star.copc.laz",
    "ign_lambert93_extrabytes.laz",
    "autzen_trim.laz",
    "courtyard_1p46M.laz",
];

#[test]
fn real_records_are_those_of_the_crate() {
    let Some(folder) = data() else { return };
    for name in REAL {
        let bytes = std::fs::read(folder.join("scans").join(name)).unwrap();
        let (items, chunks) = chunks(&bytes);
        for (points, chunk) in chunks {
            let [mut found, mut expected] = [(); 2].map(|()| vec![0; record_len(&items) * points]);
            decompressor(&items, chunk).unwrap().decompress_many(&mut found).unwrap();
            theirs(&items, chunk).decompress_many(&mut expected).unwrap();
            assert!(found == expected, "{name}: a chunk of {points} points");
        }
    }
}

/// `cargo test --release -p autosplats-formats --lib -- --ignored --nocapture as_fast`.
#[test]
#[ignore = "measures"]
fn as_fast_as_the_crate() {
    let folder = data().unwrap();
    for name in REAL {
        let bytes = std::fs::read(folder.join("scans").join(name)).unwrap();
        let (items, chunks) = chunks(&bytes);
        let mut best = [Duration::MAX; 2];
        for round in 0..14 {
            let start = Instant::now();
            for (points, chunk) in &chunks {
                let mut records = vec![0; record_len(&items) * points];
                match round % 2 {
                    0 => decompressor(&items, chunk).unwrap().decompress_many(&mut records).unwrap(),
                    _ => theirs(&items, chunk).decompress_many(&mut records).unwrap(),
                }
            }
            best[round % 2] = best[round % 2].min(start.elapsed());
        }
        let [ours, theirs] = best;
        println!("{name}: ours {ours:?}, the crate's {theirs:?}, {:.3}", ours.as_secs_f64() / theirs.as_secs_f64());
    }
}

/// Places of the panics on this thread during `work`.
fn panics(work: impl FnOnce()) -> Vec<String> {
    thread_local! {
        static PLACES: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
    }
    static HOOK: std::sync::Once = std::sync::Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            let place = panic.location().map_or_else(String::new, ToString::to_string);
            let kept = PLACES.with_borrow_mut(|places| places.as_mut().map(|places| places.push(place)));
            if kept.is_none() {
                before(panic);
            }
        }));
    });
    PLACES.set(Some(Vec::new()));
    let _ = catch_unwind(AssertUnwindSafe(work));
    PLACES.take().unwrap()
}

#[test]
fn damage_is_an_error_or_other_values() {
    let mut random = Random::from_state(11);
    let [mut errors, mut points] = [0; 2];
    for seed in 0..60 {
        let layouts = layouts();
        let items = &layouts[seed as usize % layouts.len()];
        let len = record_len(items);
        let mut records = records(len.max(LEN), 200, &mut Random::from_state(seed));
        records.iter_mut().for_each(|record| record.truncate(len));
        let Ok(whole) = catch_unwind(|| compress(items, &records)) else { continue };
        for round in 0..100 {
            let mut chunk = whole.clone();
            let begin = if round % 10 == 0 { 0 } else { len + 4 };
            for _ in 0..=random.modulo(6) {
                let at = begin + random.modulo(chunk.len() - begin);
                chunk[at] = [random.bits() as u8, 0, 0xff, chunk[at] ^ 1 << random.modulo(8)][random.modulo(4)];
            }
            match random.modulo(8) {
                0 => chunk.truncate(random.modulo(chunk.len())),
                1 => {
                    let from = begin + random.modulo(chunk.len() - begin);
                    let byte = random.bits() as u8;
                    chunk[from..].fill(byte);
                }
                _ => {}
            }
            if is_layered(items) && super::super::chunks::layers(&chunk, items, len).is_none() {
                continue;
            }
            let places = panics(|| {
                let mut decompressor = decompressor(items, &chunk).unwrap();
                let mut record = vec![0; len];
                for _ in 0..2000 {
                    match decompressor.decompress_next(&mut record) {
                        Ok(()) => points += 1,
                        Err(_) => {
                            errors += 1;
                            break;
                        }
                    }
                }
            });
            let ours = places.iter().any(|place| place.contains("autosplats"));
            assert!(!ours, "seed {seed}, round {round}: {places:?}");
        }
    }
    assert!(errors > 500 && points > 50_000, "{errors} errors, {points} points");
}

/// A layer of a few bytes whose codes all switch to another sequence.
fn switches(symbols: u32, switch: u32) -> Vec<u8> {
    let mut encoder = laz::encoders::ArithmeticEncoder::new(Cursor::new(Vec::new()));
    let mut model = ArithmeticModelBuilder::new(symbols).with_compression(true).build();
    (0..3_000_000).for_each(|_| encoder.encode_symbol(&mut model, switch).unwrap());
    encoder.done().unwrap();
    let layer = encoder.into_inner().into_inner();
    assert!(layer.len() < 1000, "{} bytes", layer.len());
    layer
}

#[test]
fn times_that_switch_for_ever_are_an_error() {
    for items in [Items::version_3_of::<las::Point6>(0), Items::version_4_of::<las::Point6>(0)] {
        let mut records = vec![vec![1; LEN]; 9];
        (0..9).for_each(|i| records[i][25] = i as u8);
        let mut chunk = compress(&items, &records);
        let layer = switches(5, 2);
        let sizes = LEN + 4;
        let size = &mut chunk[sizes + 4 * (LAYERS - 1)..][..4];
        let old = u32::from_le_bytes(size.try_into().unwrap());
        assert!(old > 0, "the times are the last layer");
        size.copy_from_slice(&(layer.len() as u32).to_le_bytes());
        chunk.truncate(chunk.len() - old as usize);
        chunk.extend(layer);
        switching_is_an_error(&items, &chunk);
    }
    let time: Vec<_> = Items::version_2_of::<las::Point1>(0)
        .into_iter()
        .filter(|item| item.item_type() == LazItemType::GpsTime)
        .collect();
    switching_is_an_error(&time, &[vec![0; 8], switches(6, 3)].concat());
}

fn switching_is_an_error(items: &[LazItem], chunk: &[u8]) {
    let start = Instant::now();
    let mut decompressor = decompressor(items, chunk).unwrap();
    let mut record = vec![0; record_len(items)];
    decompressor.decompress_next(&mut record).unwrap();
    let error = decompressor.decompress_next(&mut record).unwrap_err();
    assert!(error.to_string().contains("no sequence"), "{error}");
    assert!(start.elapsed() < Duration::from_secs(1), "it took {:?}", start.elapsed());
}

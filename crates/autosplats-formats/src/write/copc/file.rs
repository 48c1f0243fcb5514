//! The file: header and records, nodes as they come, and at the end the tables of chunks and of nodes.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufWriter, Seek as _, SeekFrom, Write as _},
    path::Path,
};

use autosplats_cloud::Error;
use laz::{
    LazVlr, LazVlrBuilder,
    laszip::{ChunkTable, ChunkTableEntry},
};

use super::{
    compress::{Compressor, Node, Packed},
    frame::{CELL_BITS, Frame},
    hierarchy::{self, Entry, RootPage},
    key::Place,
    schema::Schema,
};
use crate::{
    las::EVLR_HEADER,
    write::las::{Head, Record, Totals, compression_record, crs_records, extra_records},
};

/// Nodes up to this level stand next to each other at the end of the points, so that a viewer gets all of them at once.
const HELD_LEVELS: u32 = 2;

/// User id of the records of COPC, and the ids of the information and of the hierarchy.
const COPC: &str = "copc";
const INFO: u16 = 1;
const HIERARCHY: u16 = 1000;
const INFO_LEN: usize = 160;

/// A file that is being written.
pub(super) struct TreeFile<'a, 'f> {
    path: &'a Path,
    out: &'a mut BufWriter<&'f mut File>,
    schema: &'a Schema,
    frame: &'a Frame,
    vlr: LazVlr,
    /// Where the points begin, and where the next node is written.
    start: u64,
    at: u64,
    table: ChunkTable,
    entries: Vec<Entry>,
    totals: Totals,
    held: BTreeMap<(u32, u64), Packed>,
    /// Least and greatest time of a point.
    times: [f64; 2],
}

impl<'a, 'f> TreeFile<'a, 'f> {
    pub(super) fn new(
        path: &'a Path,
        out: &'a mut BufWriter<&'f mut File>,
        schema: &'a Schema,
        frame: &'a Frame,
        compressor: &Compressor,
    ) -> Result<Self, Error> {
        let vlr = LazVlrBuilder::new(compressor.items.clone()).with_variable_chunk_size().build();
        let (table, entries, totals) = (ChunkTable::default(), Vec::new(), Totals::new());
        let times = [f64::INFINITY, f64::NEG_INFINITY];
        let mut file = Self {
            path,
            out,
            schema,
            frame,
            vlr,
            start: 0,
            at: 0,
            table,
            entries,
            totals,
            held: BTreeMap::new(),
            times,
        };
        let (head, start) = file.head(RootPage::default(), (0, 0));
        file.write(&head)?;
        // The place of the chunk table comes first.
        file.write(&[0; ChunkTable::OFFSET_SIZE])?;
        (file.start, file.at) = (start as u64, (start + ChunkTable::OFFSET_SIZE) as u64);
        Ok(file)
    }

    fn io(&self, source: std::io::Error) -> Error {
        Error::Io { path: self.path.into(), source }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.out.write_all(bytes).map_err(|source| Error::Io { path: self.path.into(), source })
    }

    /// Adds a node.
    pub(super) fn put(&mut self, Node { place, packed }: Node) -> Result<(), Error> {
        if place.level <= HELD_LEVELS {
            self.held.insert((place.level, place.code), packed);
            return Ok(());
        }
        self.append(place, &packed)
    }

    fn append(&mut self, place: Place, packed: &Packed) -> Result<(), Error> {
        let Packed { bytes, totals, times } = packed;
        self.totals.add(totals);
        self.times = [self.times[0].min(times[0]), self.times[1].max(times[1])];
        let points = totals.points;
        let too_large = || self.io(std::io::Error::other("a node is larger than COPC allows"));
        let (Ok(short_points), Ok(short_bytes)) = (i32::try_from(points), i32::try_from(bytes.len())) else {
            return Err(too_large());
        };
        let offset = if points > 0 { self.at } else { 0 };
        self.entries.push(Entry { place, points: short_points, offset, bytes: short_bytes });
        if points > 0 {
            self.table.push(ChunkTableEntry { point_count: points, byte_count: bytes.len() as u64 });
            self.write(bytes)?;
            self.at += bytes.len() as u64;
        }
        Ok(())
    }

    /// Writes what is left: the coarse nodes, the tables and the header again. Returns the number of points and nodes.
    pub(super) fn finish(mut self) -> Result<(u64, usize), Error> {
        for ((level, code), packed) in std::mem::take(&mut self.held) {
            self.append(Place { level, code }, &packed)?;
        }
        let table_at = self.at;
        let mut table = Vec::new();
        self.table.write_to(&mut table, &self.vlr).map_err(|source| self.io(source))?;
        self.write(&table)?;
        let extended_at = table_at + table.len() as u64;
        let pages_at = extended_at + EVLR_HEADER as u64;
        let (pages, root) = hierarchy::pages(&mut self.entries, pages_at);
        let mut extended = vec![0; 2];
        extended.extend(COPC.bytes().chain(std::iter::repeat(0)).take(16));
        extended.extend(HIERARCHY.to_le_bytes());
        extended.extend((pages.len() as u64).to_le_bytes());
        extended.extend("EPT hierarchy".bytes().chain(std::iter::repeat(0)).take(32));
        self.write(&extended)?;
        self.write(&pages)?;
        let (head, start) = self.head(root, (extended_at, 1));
        debug_assert_eq!(start as u64, self.start, "the header keeps its length");
        self.out.seek(SeekFrom::Start(0)).map_err(|source| self.io(source))?;
        self.write(&head)?;
        self.write(&table_at.to_le_bytes())?;
        Ok((self.totals.points, self.entries.len()))
    }

    fn head(&self, root: RootPage, extended: (u64, u32)) -> (Vec<u8>, usize) {
        let Schema { format, record_len, lattice, extras, crs, standard_time, created, .. } = self.schema;
        let mut records = vec![
            Record { user: COPC, id: INFO, description: "COPC info VLR", data: self.info(root) },
            compression_record(&self.vlr),
        ];
        records.extend(crs_records(crs, true));
        records.extend(extra_records(extras));
        let head = Head {
            format: *format,
            record_len: *record_len,
            scale: lattice.scale,
            offset: lattice.offset,
            standard_time: *standard_time,
            created: *created,
            totals: &self.totals,
            records: &records,
            extended,
        };
        head.bytes()
    }

    fn info(&self, root: RootPage) -> Vec<u8> {
        let half = self.frame.side() / 2.0;
        let spacing = self.frame.side() / f64::from(1 << CELL_BITS);
        let times = if self.times[0] > self.times[1] { [0.0; 2] } else { self.times };
        let mut data: Vec<u8> = Vec::with_capacity(INFO_LEN);
        let center = self.frame.center().to_array();
        data.extend(center.into_iter().chain([half, spacing]).flat_map(f64::to_le_bytes));
        data.extend([root.offset, root.bytes].into_iter().flat_map(u64::to_le_bytes));
        data.extend(times.into_iter().flat_map(f64::to_le_bytes));
        data.resize(INFO_LEN, 0);
        data
    }
}

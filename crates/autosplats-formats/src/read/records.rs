//! Points as records of equal length, either in the file or as rows of text: read at once or in pieces.

use autosplats_cloud::{Error, PointCloud, sample_step};

use super::{
    Job,
    cuts::Text,
    opened::Reader,
    pieces::Seen,
    table::{Column, Look, Plan, ProgressRange, Settled, Table},
    text::{Rows, Token},
};

/// Share of the work that parsing text takes.
const PARSING: ProgressRange = ProgressRange { start: 0.0, len: 0.8 };

/// Share of settling that sampling the rows of a text takes.
const SAMPLING: f32 = 0.5;

/// Most points of a piece.
const MAX_PIECE: usize = 1 << 20;

/// The place in errors about the columns.
const PLACE: &str = "header";

/// Gets the bytes of consecutive records, and their number.
type Take<'a> = dyn FnMut(&[u8], usize) -> Result<(), Error> + 'a;

/// Records, whose columns are told by a header.
pub(super) struct Records {
    /// The values of a record, with offsets in it.
    pub(super) columns: Vec<Column>,
    /// First byte of the first record or row.
    pub(super) start: usize,
    /// Number of records; of text, the number that the header states.
    pub(super) count: usize,
    /// Bytes of a record.
    pub(super) stride: usize,
    pub(super) big_endian: bool,
    /// The values of a row; `None` if records are not text.
    pub(super) tokens: Option<Vec<Token>>,
}

impl Records {
    /// Columns over records in memory.
    fn table<'a>(&self, bytes: &'a [u8], count: usize) -> Table<'a> {
        let columns = self.columns.iter().map(|column| Column { stride: self.stride, ..column.clone() }).collect();
        let done = if self.tokens.is_some() { PARSING.len } else { 0.0 };
        Table { bytes, count, big_endian: self.big_endian, columns, packed_rgb: true, done }
    }

    fn rows<'a>(&self, tokens: &'a [Token]) -> Rows<'a> {
        Rows { tokens, count: Some(self.count), may_be_cut: true }
    }

    /// Makes the cloud of all points.
    pub(super) fn into_cloud(self, job: &Job<'_>) -> Result<PointCloud, Error> {
        let Some(tokens) = &self.tokens else {
            let table = self.table(&job.bytes[self.start..], self.count);
            table.preview(job, PLACE)?;
            return table.into_cloud(job, PLACE);
        };
        let show = |records: &[u8], count| self.table(records, count).preview(job, PLACE);
        let (records, count) = self.rows(tokens).parse_and_show(job, self.start, PARSING, show)?;
        self.table(&records, count).into_cloud(job, PLACE)
    }

    /// Passes on the records in pieces, in order; an empty one if there are none. Returns their number. The last row of
    /// a text does not count if the text ends within it.
    fn each(&self, job: &Job<'_>, file: &Reader<'_>, part: ProgressRange, take: &mut Take<'_>) -> Result<usize, Error> {
        let most = (file.piece() / self.stride.max(1)).clamp(1, MAX_PIECE);
        let mut records = Vec::new();
        let Some(tokens) = &self.tokens else {
            for first in (0..self.count.max(1)).step_by(most) {
                job.tick(part.start + part.len * first as f32 / self.count.max(1) as f32)?;
                let count = most.min(self.count - first);
                let start = self.start + first * self.stride;
                records.clear();
                file.read(start..start + count * self.stride, &mut records)?;
                take(&records, count)?;
            }
            return Ok(self.count);
        };
        let mut held = 0;
        let count =
            self.rows(tokens).each(job, Text::File(file, file.len()), self.start, part, None, |more, count| {
                records.extend_from_slice(more);
                held += count;
                if held >= most {
                    take(&records, held)?;
                    records.clear();
                    held = 0;
                }
                Ok(())
            })?;
        if held > 0 || count == 0 {
            take(&records, held)?;
        }
        Ok(count)
    }

    /// A sample of the rows of a text that tells what a sample of all tells, and its number. The number of all rows is
    /// found out, too.
    fn sample(&mut self, job: &Job<'_>, file: &Reader<'_>) -> Result<(Vec<u8>, usize), Error> {
        let mut part = ProgressRange { start: 0.0, len: SAMPLING };
        loop {
            let (step, stride) = (sample_step(self.count), self.stride);
            let (mut sample, mut at) = (Vec::new(), 0_usize);
            let found = self.each(job, file, part, &mut |records, count| {
                let first = at.next_multiple_of(step);
                for index in (first..at + count).step_by(step) {
                    sample.extend_from_slice(&records[(index - at) * stride..][..stride]);
                }
                at += count;
                Ok(())
            })?;
            if found == self.count {
                return Ok((sample, found.div_ceil(step)));
            }
            // The text is cut off, so its rows are not those that were counted on.
            (self.count, part) = (found, ProgressRange { start: SAMPLING, len: 0.0 });
        }
    }

    /// Finds out what the columns are, from a sample of the points.
    pub(super) fn planned(mut self, job: &Job<'_>, file: &Reader<'_>) -> Result<PlannedRecords, Error> {
        let (plan, start) = if self.tokens.is_some() {
            let (sample, count) = self.sample(job, file)?;
            (Plan::of(&self.table(&sample, count), job, PLACE, true)?, SAMPLING)
        } else {
            (Plan::of(&self.table(&job.bytes[self.start..], self.count), job, PLACE, true)?, 0.0)
        };
        Ok(PlannedRecords { records: self, plan, rest: ProgressRange { start, len: 1.0 - start } })
    }
}

/// Records of which is known what the columns are, and how many there are.
pub(super) struct PlannedRecords {
    records: Records,
    plan: Plan,
    /// The work that is left.
    rest: ProgressRange,
}

impl PlannedRecords {
    /// Number of points.
    pub(super) fn count(&self) -> usize {
        self.records.count
    }

    /// Settles what all points tell. `see` gets their positions in pieces.
    pub(super) fn settled(
        self,
        job: &Job<'_>,
        file: &Reader<'_>,
        see: &mut dyn FnMut(&PointCloud) -> Result<(), Error>,
    ) -> Result<(SettledRecords, Seen), Error> {
        let Self { records, plan, rest } = self;
        let quiet = Job { progress: &(), ..*job };
        let (mut look, mut at_zero) = (Look::default(), 0);
        records.each(job, file, rest, &mut |bytes, count| {
            let table = records.table(bytes, count);
            plan.look(&table, &quiet, &mut look)?;
            let placed = plan.placed(&table, &quiet)?;
            at_zero += placed.no_returns();
            see(&placed)
        })?;
        let settled = plan.settle(&look, job);
        Ok((SettledRecords { records, settled }, Seen { points: look.points, at_zero }))
    }
}

/// Records of which all is settled.
pub(super) struct SettledRecords {
    records: Records,
    pub(super) settled: Settled,
}

impl SettledRecords {
    /// Passes on all points in pieces.
    pub(super) fn each(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let quiet = Job { progress: &(), ..*job };
        let whole = ProgressRange { start: 0.0, len: 1.0 };
        let build = |records: &[u8], count| self.settled.build(&self.records.table(records, count), &quiet);
        self.records.each(job, file, whole, &mut |records, count| take(build(records, count)?)).map(drop)
    }
}

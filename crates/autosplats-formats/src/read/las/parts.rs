//! The points of a file in parts, for whoever works on more points than memory holds.
//!
//! # How it works
//!
//! Opening reads all points once: which fields are zero at every point, whether colours have 8 or 16 bits, and whether
//! positions need residuals is known only then. So the parts are those of the cloud that reading the whole file gives.
//! Points may be kept [decompressed](super::unpacked) meanwhile.

use std::{ops::Range, sync::Mutex};

use autosplats_cloud::{Crs, Error, PointCloud, Progress, lock};
use glam::DVec3;

use super::{
    Job, Opened, Shape,
    columns::{Colors, Columns, ValueFacts},
    dimension::Dimension,
    header::Header,
    stream::{Space, Stream},
    tell_lost,
};
use crate::read::{
    opened::Reader,
    pieces::{Opening, Pieces, Seen},
};

/// Most points of a part, unless a chunk has more, of which pieces are parts.
const PART: usize = 1 << 20;

/// A LAS or LAZ file.
struct LasParts {
    stream: Stream,
    header: Header,
    dimensions: Vec<Dimension>,
    crs: Crs,
    origin: DVec3,
    exact: bool,
    facts: ValueFacts,
}

/// Opens a file, and reads all points for what they show.
pub(in super::super) fn open(job: &Job<'_>, file: &Reader<'_>) -> Result<Option<Opening>, Error> {
    let Some(mut stream) = Stream::open(job.path)? else { return Ok(None) };
    if let Some(unpacking) = file.unpacking() {
        stream.unpack_to(unpacking)?;
    }
    let Opened { header, dimensions, lost, crs, origin, notes: [notes, after], .. } =
        super::open(job, &Shape::default())?;
    let (claimed, points) = (header.points, stream.facts.points);
    if job.options.whole {
        tell_lost(job, lost, 0, claimed)?;
    }
    let parts = LasParts {
        stream,
        header,
        dimensions,
        crs: crs.clone(),
        origin,
        exact: job.options.exact,
        facts: ValueFacts::default(),
    };
    let (mut facts, mut seen, mut why) = (ValueFacts::default(), Seen::default(), String::new());
    parts.each(Colors::Settled { wide: false }, job.progress, &mut |columns, count, fault| {
        let (own, at_zero) = columns.into_facts()?;
        facts.add(&own);
        seen.points += count;
        seen.at_zero += at_zero;
        if why.is_empty() {
            why = fault;
        }
        Ok(())
    })?;
    if seen.points == 0 && points > 0 {
        return Err(job.malformed("point 1", why));
    }
    let damaged = points - seen.points as u64;
    notes.iter().chain(&facts.narrow_note()).for_each(|note| job.note(note));
    tell_lost(job, lost, damaged, claimed)?;
    after.iter().for_each(|note| job.note(note));
    let pieces = Box::new(LasParts { facts, ..parts });
    Ok(Some(Opening { pieces, seen, scans: Vec::new(), crs }))
}

impl LasParts {
    /// Passes on columns of all points, with the number of their points, and why others are missing.
    fn each(
        &self,
        colors: Colors,
        progress: &dyn Progress,
        take: &mut dyn FnMut(Columns<'_>, usize, String) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let columns =
            |count: usize| Columns::new(&self.header, self.origin, self.exact, self.dimensions.clone(), count, colors);
        let spaces: Mutex<Vec<Space>> = Mutex::default();
        let (mut run, mut done) = (0, 0);
        while run < self.stream.runs() {
            progress.tick(done as f32 / self.stream.facts.points.max(1) as f32)?;
            let group = self.group(run);
            let counts: Vec<usize> = group.clone().map(|run| self.stream.points(run)).collect();
            let total: usize = counts.iter().sum();
            if total > PART {
                // A chunk that is too long: its pieces are passed on as they come.
                let lost = self.stream.read(run, &mut Space::default(), &mut |records| {
                    progress.tick(done as f32 / self.stream.facts.points as f32)?;
                    let count = records.len() / self.header.record_len;
                    let mut columns = columns(count)?;
                    columns.fill(0, &[count], |_, piece| {
                        piece.take(records);
                        Ok(())
                    });
                    done += count as u64;
                    take(columns, count, String::new())
                })?;
                if lost.points > 0 {
                    take(columns(0)?, 0, lost.why)?;
                }
                run += 1;
                continue;
            }
            let mut columns = columns(total)?;
            let failed: Mutex<Option<Error>> = Mutex::default();
            let lost: Mutex<Vec<(usize, u64, String)>> = Mutex::default();
            columns.fill(0, &counts, |index, piece| {
                let mut space = lock(&spaces).pop().unwrap_or_default();
                let outcome = self.stream.read(group.start + index, &mut space, &mut |records| {
                    piece.take(records);
                    Ok(())
                });
                lock(&spaces).push(space);
                match outcome {
                    Ok(none) if none.points == 0 => {}
                    Ok(some) => lock(&lost).push((index, some.points, some.why)),
                    Err(error) => *lock(&failed) = Some(error),
                }
                Ok(())
            });
            if let Some(error) = lock(&failed).take() {
                return Err(error);
            }
            let mut lost = std::mem::take(&mut *lock(&lost));
            lost.sort_by_key(|(index, ..)| *index);
            let ranges: Vec<Range<usize>> = lost
                .iter()
                .map(|&(index, points, _)| {
                    let end: usize = counts[..=index].iter().sum();
                    end - points as usize..end
                })
                .collect();
            columns.remove(&ranges);
            let held = total - ranges.iter().map(Range::len).sum::<usize>();
            take(columns, held, lost.into_iter().next().map_or_else(String::new, |(.., why)| why))?;
            done += total as u64;
            run = group.end;
        }
        Ok(())
    }

    /// The runs from `first` on that make a part.
    fn group(&self, first: usize) -> Range<usize> {
        let mut points = 0;
        let fits = |run: &usize| {
            points += self.stream.points(*run);
            *run == first || points <= PART
        };
        first..first + (first..self.stream.runs()).take_while(fits).count()
    }
}

impl Pieces for LasParts {
    fn read(
        &self,
        job: &Job<'_>,
        _file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.each(self.facts.colors(), job.progress, &mut |columns, count, _| {
            if count == 0 {
                return Ok(());
            }
            let cloud = columns.into_part(&self.facts)?;
            take(cloud.with_crs(self.crs.clone()).with_resolution(self.header.scale.abs()), None)
        })
    }
}

//! E57 in pieces, scan by scan.

use std::{ops::Range, ptr};

use autosplats_cloud::{Axes, Error, PointCloud, residual};

use super::{
    super::{
        Job,
        opened::Reader,
        pieces::{Opening, Pieces, Seen},
        units,
    },
    cloud::{Kept, Run, Settled},
    packets::Packets,
    pages::Pages,
    scans,
    source::{Counts, Source},
    xml::{Root, ScanHeader, open as open_xml},
};

/// Most points of a piece.
const MAX_PIECE: usize = 1 << 20;

/// Share of settling that counting takes, and each of two more looks at the points.
const COUNTING: f32 = 0.4;
const LOOKING: f32 = 0.3;

/// The points of a file.
struct E57Pieces {
    scans: Scans,
    settled: Settled,
    axes: Option<Axes>,
}

/// The scans that can be read.
struct Scans {
    pages: Pages<'static>,
    root: Root,
    found: Vec<FoundScan>,
}

/// Where the points of a scan are.
struct FoundScan {
    /// Index of the header.
    header: usize,
    packets: Packets,
    counts: Counts,
}

/// Settles what all points tell.
pub(in super::super) fn open(job: &Job<'_>, file: &Reader<'_>) -> Result<Option<Opening>, Error> {
    let (pages, root) = open_xml(job)?;
    let in_file = pages.in_file(file);
    let found = scans(job, &in_file, &root, COUNTING, |header, packets, part| {
        let mut counts = Counts::default();
        for points in windows(header, packets.count, file) {
            let now = part.start + (part.end - part.start) * points.start as f32 / packets.count.max(1) as f32;
            let values = packets.values(job, &in_file, header, points, now..now)?;
            counts.add(Source::new(job, header, values)?.counts());
        }
        let header = root.scans.iter().position(|other| ptr::eq(other, header)).unwrap_or_default();
        Ok((FoundScan { header, packets, counts }, counts))
    })?;
    let scans = Scans { pages: pages.without_bytes(), root, found };
    let (crs, trusted) = (scans.root.crs.clone(), scans.root.is_ours());
    let kept: Vec<Kept<'_>> = scans
        .found
        .iter()
        .map(|scan| Kept { header: &scans.root.scans[scan.header], points: scan.counts.kept() })
        .collect();
    let mut seen: Vec<Seen> = kept.iter().map(|scan| Seen { points: scan.points, at_zero: 0 }).collect();
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    let mut start = COUNTING;
    let mut each = |see: &mut dyn FnMut(&Run<'_>) -> Result<(), Error>| {
        scans.each(job, file, start..start + LOOKING, see)?;
        start += LOOKING;
        Ok(())
    };
    let settled = Settled::of(
        job,
        &kept,
        trusted,
        &mut each,
        Some(&mut |run, origin| {
            let world = |i| run.source.world(i) - origin;
            let points = 0..run.source.len();
            let positions: Vec<[f32; 3]> = points.clone().map(|i| world(i).as_vec3().to_array()).collect();
            for position in &positions {
                for axis in 0..3 {
                    (low[axis], high[axis]) = (low[axis].min(position[axis]), high[axis].max(position[axis]));
                }
            }
            let mut placed = PointCloud::new(origin, positions).with_crs(crs.clone());
            if job.options.exact {
                placed = placed.with_residuals(points.map(|i| residual(world(i))).collect())?;
            }
            units::settle(&Job { progress: &(), ..*job }, &mut placed)?;
            seen[run.scan].at_zero += placed.no_returns();
            Ok(())
        }),
    )?;
    let axes = settled.axes(|| PointCloud::new(glam::DVec3::ZERO, vec![low, high]).is_small());
    let all = seen.iter().fold(Seen::default(), |all, scan| Seen {
        points: all.points + scan.points,
        at_zero: all.at_zero + scan.at_zero,
    });
    let of_scanners = if settled.scanners.contains(&true) { seen } else { Vec::new() };
    let pieces = Box::new(E57Pieces { scans, settled, axes });
    Ok(Some(Opening { pieces, seen: all, scans: of_scanners, crs }))
}

/// Ranges of points of a scan that are read at a time.
fn windows(header: &ScanHeader, count: usize, file: &Reader<'_>) -> impl Iterator<Item = Range<usize>> + use<> {
    let bits: u64 = header.elements.iter().map(|element| u64::from(element.stored.bits())).sum();
    let most = (file.piece() / (bits as usize / 8).max(1)).clamp(1, MAX_PIECE);
    // A scan without points is looked at too, since it may be broken.
    (0..count.max(1)).step_by(most).map(move |start| start..count.min(start + most))
}

impl Scans {
    /// Passes on all points that are kept.
    fn each(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        part: Range<f32>,
        take: &mut dyn FnMut(&Run<'_>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let pages = self.pages.in_file(file);
        let total: usize = self.found.iter().map(|scan| scan.counts.values).sum();
        let mut done = 0;
        for (scan, FoundScan { header, packets, counts }) in self.found.iter().enumerate() {
            let header = &self.root.scans[*header];
            let mut first = 0;
            for points in windows(header, packets.count, file) {
                let now = part.start + (part.end - part.start) * done as f32 / total.max(1) as f32;
                done += points.len();
                let values = packets.values(job, &pages, header, points, now..now)?;
                let mut source = Source::new(job, header, values)?;
                source.keep_measured(counts);
                take(&Run { scan, source: &source, first })?;
                first += source.len();
            }
        }
        Ok(())
    }
}

impl Pieces for E57Pieces {
    fn read(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { scans, settled, axes } = self;
        let quiet = Job { progress: &(), ..*job };
        scans.each(job, file, 0.0..1.0, &mut |run| {
            let mut cloud = settled.build(&quiet, std::slice::from_ref(run), 0.0)?;
            if let Some(axes) = *axes {
                cloud = cloud.with_axes(axes);
            }
            take(cloud.with_crs(scans.root.crs.clone()), settled.scanners[run.scan].then_some(run.scan))
        })
    }
}

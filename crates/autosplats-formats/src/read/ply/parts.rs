//! PLY whose points have no lists, in pieces.

use autosplats_cloud::{Axes, Crs, Error, PointCloud};

use super::{
    super::{
        Job,
        opened::Reader,
        pieces::{Opening, Pieces},
        records::SettledRecords,
    },
    check,
    header::{Encoding, Header},
    is_mesh, records, vertices,
};

/// The points of a file.
struct PlyPieces {
    records: SettledRecords,
    axes: Option<Axes>,
}

/// Settles what all points tell. `None` for meshes, whose triangles need all points, and for lists in binary records.
pub(in super::super) fn open(job: &Job<'_>, file: &Reader<'_>) -> Result<Option<Opening>, Error> {
    let header = Header::parse(job)?;
    let index = vertices(job, &header)?;
    let (before, vertex) = (&header.elements[..index], &header.elements[index]);
    if is_mesh(job) || header.encoding != Encoding::Ascii && vertex.stride().is_none() {
        return Ok(None);
    }
    check(job, &header, vertex)?;
    let Some(records) = records(job, &header, before, vertex)? else { return Ok(None) };
    let (records, seen) = records.planned(job, file)?.settled(job, file, &mut |_| Ok(()))?;
    let pieces = Box::new(PlyPieces { records, axes: header.axes });
    Ok(Some(Opening { pieces, seen, scans: Vec::new(), crs: Crs::default() }))
}

impl Pieces for PlyPieces {
    fn read(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        self.records.each(job, file, &mut |cloud| {
            let cloud = if let Some(axes) = self.axes { cloud.with_axes(axes) } else { cloud };
            take(cloud, None)
        })
    }
}

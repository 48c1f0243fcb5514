//! Text in pieces.

use std::ops::Range;

use autosplats_cloud::{Crs, Error, PointCloud};
use glam::DVec3;

use super::{
    super::{
        Job,
        cuts::Text,
        opened::Reader,
        pieces::{Opening, Pieces, Seen},
        table::ProgressRange,
        units,
    },
    check_is_text,
    columns::Columns,
    layout::Layout,
    preamble::Preamble,
    rows::Parser,
    settle::{Look, Settled},
    survey::{Survey, survey},
};

/// The points of a text.
struct TextPieces {
    layout: Layout,
    /// The bytes of the rows.
    rows: Range<usize>,
    counts_between: bool,
    origin: DVec3,
    crs: Crs,
    settled: Settled,
}

/// The range of the progress of all rows.
const WHOLE: ProgressRange = ProgressRange { start: 0.0, len: 1.0 };

/// Settles what all rows tell. `None` if there are none.
pub(in super::super) fn open(job: &Job<'_>, file: &Reader<'_>) -> Result<Option<Opening>, Error> {
    check_is_text(job)?;
    let preamble = Preamble::parse(job)?;
    let Some(layout) = Layout::of(job, &preamble)? else { return Ok(None) };
    layout.notes.iter().for_each(|note| job.note(note));
    let (text, start, exact) = (Text::File(file, file.len()), preamble.start, job.options.exact);
    let Survey { origin, crs, .. } = survey(job, &layout, start);
    let counts_between = preamble.promised.is_some();
    let parser = Parser { layout: &layout, origin, exact, counts_between };
    let (mut look, mut at_zero) = (Look::default(), 0);
    let end = parser.each(job, text, start, WHOLE, |pieces| {
        for piece in pieces {
            look.add(piece.look);
            let Columns { positions, residuals, .. } = piece.columns;
            let mut placed = PointCloud::new(origin, positions).with_crs(crs.clone());
            if exact {
                placed = placed.with_residuals(residuals)?;
            }
            units::settle(&Job { progress: &(), ..*job }, &mut placed)?;
            at_zero += placed.no_returns();
        }
        Ok(())
    })?;
    look.check(job, &text, preamble.promised)?;
    let settled = look.settle(job, layout.has_color, origin, exact);
    let seen = Seen { points: look.points - settled.without_height, at_zero };
    let pieces = Box::new(TextPieces { layout, rows: start..end, counts_between, origin, crs: crs.clone(), settled });
    Ok(Some(Opening { pieces, seen, scans: Vec::new(), crs }))
}

impl Pieces for TextPieces {
    fn read(
        &self,
        job: &Job<'_>,
        file: &Reader<'_>,
        take: &mut dyn FnMut(PointCloud, Option<usize>) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let Self { layout, rows, counts_between, origin, crs, settled } = self;
        let (origin, exact, counts_between) = (*origin, job.options.exact, *counts_between);
        let parser = Parser { layout, origin, exact, counts_between };
        let text = Text::File(file, rows.end);
        let each = parser.each(job, text, rows.start, WHOLE, |pieces| {
            let mut columns = Columns::new(layout);
            pieces.into_iter().try_for_each(|piece| columns.append(&piece.columns))?;
            let mut cloud = settled.build(columns, layout, origin)?.with_crs(crs.clone());
            settled.drop_no_heights(&mut cloud);
            take(cloud, None)
        });
        each.map(drop)
    }
}

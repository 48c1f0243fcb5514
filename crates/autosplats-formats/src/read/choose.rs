//! Leaves out the points that the caller does not want, in every format alike.

use std::{collections::BTreeSet, fmt};

use autosplats_cloud::{Contents, Error, LeftOut, PointCloud, PointFilter, Progress, class_name};

use super::{
    job::{Format, Job},
    las,
    names::plain,
};

/// Most classes and fields that a message names.
const MAX_LISTED: usize = 10;

/// The points that the options leave out, which is noted. Fails if the points lack a field that the filter needs, or if
/// it keeps none of them.
pub(super) fn left_out(job: &Job<'_>, format: &Format, cloud: &PointCloud) -> Result<LeftOut, Error> {
    let Some(filter) = filter(job, format, cloud)? else { return Ok(LeftOut::default()) };
    let left = filter.left_out(cloud);
    let classes = || {
        let mut classes = Classes::default();
        classes.add(cloud);
        classes
    };
    Ok(if decide(job, filter, &left, cloud.len(), classes)? { left } else { LeftOut::default() })
}

/// The filter, if it leaves out points of clouds with such fields. Fails if the points lack a field that it needs.
pub(super) fn filter<'a>(job: &Job<'a>, format: &Format, cloud: &PointCloud) -> Result<Option<&'a PointFilter>, Error> {
    let Some(filter) = job.options.keep.as_ref().filter(|filter| !filter.is_all()) else { return Ok(None) };
    let las = format.name == las::FORMAT.name;
    if filter.is_usual() && !las && cloud.field("Classification").is_some() && !has_standard_classes(job, format) {
        return Ok(None);
    }
    // The reader of LAS leaves out fields that are 0 at every point.
    if !las && let Some(missing) = filter.missing_field(cloud) {
        let names: Vec<_> = cloud.fields().iter().take(MAX_LISTED).map(|field| &*field.name).collect();
        let there = if names.is_empty() { "they have none".into() } else { format!("there are {}", names.join(", ")) };
        return Err(job.unsupported(format!("--keep {filter}: its points have no field {missing}; {there}")));
    }
    Ok(Some(filter))
}

/// Decides whether `left` of all points are left out, and tells the user. Fails if the filter keeps none.
pub(super) fn decide(
    job: &Job<'_>,
    filter: &PointFilter,
    left: &LeftOut,
    points: usize,
    classes: impl FnOnce() -> Classes,
) -> Result<bool, Error> {
    if left.count() == 0 {
        return Ok(false);
    }
    if left.count() < points {
        job.note(if filter.is_usual() {
            format!("left out {left}; --keep all keeps them")
        } else {
            format!("--keep {filter} left out {} of {points} points", left.count())
        });
        return Ok(true);
    }
    if filter.is_usual() {
        job.note(format!("all {points} points are noise or withheld, so they are kept"));
        return Ok(false);
    }
    let (path, filter, there) = (job.path.into(), filter.to_string(), classes().to_string());
    Err(Error::NothingKept { path, filter, points, there })
}

/// Whether classes of a format that has none of its own are those of LAS. A label 7 of other data may be anything, so
/// this takes the name that LAS, PDAL and CloudCompare use: `Classification`, not `class` or `label`.
fn has_standard_classes(job: &Job<'_>, format: &Format) -> bool {
    let described = (format.describe)(&Job { progress: &(), ..*job });
    // E57 writes the name of an extension before the names of its fields.
    let own = |name: &str| plain(name.rsplit(':').next().unwrap_or_default());
    let standard = |name: &str| ["classification", "scalarclassification"].contains(&&*own(name));
    described.is_ok_and(|facts| facts.attributes.iter().any(|attribute| standard(&attribute.name)))
}

/// The lowest classes of points. The text is the end of a sentence.
#[derive(Default)]
pub(super) struct Classes(BTreeSet<i64>);

impl Classes {
    /// Adds those of a cloud.
    pub(super) fn add(&mut self, cloud: &PointCloud) {
        let Some(values) = cloud.class_values() else { return };
        for value in (0..cloud.len()).map(|i| values.get(i)).filter(|value| value.fract() == 0.0) {
            self.0.insert(value as i64);
            if self.0.len() > MAX_LISTED + 1 {
                self.0.pop_last();
            }
        }
    }
}

impl fmt::Display for Classes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = |class: &i64| class_name(*class as f64).map_or(class.to_string(), |name| format!("{class} {name}"));
        let names: Vec<_> = self.0.iter().take(MAX_LISTED).map(name).collect();
        let more = if self.0.len() > MAX_LISTED { " …" } else { "" };
        if names.is_empty() { Ok(()) } else { write!(f, "; its classes: {}{more}", names.join(", ")) }
    }
}

/// Removes points, and the triangles that have one of them as a corner.
pub(super) fn remove(contents: &mut Contents, left: &LeftOut) {
    if left.count() == 0 {
        return;
    }
    let Contents { cloud, triangles } = contents;
    let mut kept = 0;
    let places: Vec<Option<u32>> = (0..if triangles.is_empty() { 0 } else { cloud.len() })
        .map(|index| {
            kept += u32::from(!left.has(index));
            (!left.has(index)).then(|| kept - 1)
        })
        .collect();
    let moved = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| places[corner as usize]);
        Some([a?, b?, c?])
    };
    *triangles = triangles.iter().filter_map(moved).collect();
    cloud.retain(|index| !left.has(index));
}

/// Passes on everything, and of previews what the options keep.
pub(super) struct ChosenPreviews<'a> {
    progress: &'a dyn Progress,
    filter: &'a PointFilter,
}

impl<'a> ChosenPreviews<'a> {
    /// `None` if there are no previews, or if they show all points.
    pub(super) fn new(job: &Job<'a>, format: &Format) -> Option<Self> {
        let filter = job.options.keep.as_ref().filter(|filter| !filter.is_all() && job.progress.wants_chunks())?;
        let applies = !filter.is_usual() || format.name == las::FORMAT.name || has_standard_classes(job, format);
        applies.then_some(Self { progress: job.progress, filter })
    }
}

impl Progress for ChosenPreviews<'_> {
    fn report(&self, fraction: f32) {
        self.progress.report(fraction);
    }

    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }

    fn note(&self, note: &str) {
        self.progress.note(note);
    }

    fn loss(&self, loss: &str) {
        self.progress.loss(loss);
    }

    fn wants_chunks(&self) -> bool {
        true
    }

    fn chunk(&self, mut points: PointCloud) {
        points.keep(self.filter);
        if !points.is_empty() {
            self.progress.chunk(points);
        }
    }
}

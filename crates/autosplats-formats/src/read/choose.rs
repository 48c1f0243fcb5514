//! Leaves out the points that the caller does not want, in every format alike.

use std::collections::BTreeSet;

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
    let Some(filter) = job.options.keep.as_ref().filter(|filter| !filter.is_all()) else {
        return Ok(LeftOut::default());
    };
    let las = format.name == las::FORMAT.name;
    if filter.is_usual() && !las && cloud.field("Classification").is_some() && !has_standard_classes(job, format) {
        return Ok(LeftOut::default());
    }
    // The reader of LAS leaves out fields that are 0 at every point.
    if !las && let Some(missing) = filter.missing_field(cloud) {
        let names: Vec<_> = cloud.fields().iter().take(MAX_LISTED).map(|field| &*field.name).collect();
        let there = if names.is_empty() { "they have none".into() } else { format!("there are {}", names.join(", ")) };
        return Err(job.unsupported(format!("--keep {filter}: its points have no field {missing}; {there}")));
    }
    let left = filter.left_out(cloud);
    if left.count() == 0 {
        return Ok(left);
    }
    if left.count() < cloud.len() {
        job.note(if filter.is_usual() {
            format!("left out {left}; --keep all keeps them")
        } else {
            format!("--keep {filter} left out {} of {} points", left.count(), cloud.len())
        });
        return Ok(left);
    }
    if filter.is_usual() {
        job.note(format!("all {} points are noise or withheld, so they are kept", cloud.len()));
        return Ok(LeftOut::default());
    }
    let (path, filter, points) = (job.path.into(), filter.to_string(), cloud.len());
    Err(Error::NothingKept { path, filter, points, there: classes(cloud) })
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

/// The classes of the points, as the end of a sentence.
fn classes(cloud: &PointCloud) -> String {
    let Some(values) = cloud.class_values() else { return String::new() };
    let whole = (0..cloud.len()).map(|i| values.get(i)).filter(|value| value.fract() == 0.0);
    let found: BTreeSet<i64> = whole.map(|value| value as i64).collect();
    let name = |class: &i64| class_name(*class as f64).map_or(class.to_string(), |name| format!("{class} {name}"));
    let names: Vec<_> = found.iter().take(MAX_LISTED).map(name).collect();
    let more = if found.len() > MAX_LISTED { " …" } else { "" };
    if names.is_empty() { String::new() } else { format!("; its classes: {}{more}", names.join(", ")) }
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

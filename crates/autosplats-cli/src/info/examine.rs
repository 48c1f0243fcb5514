//! Examines an input: from its name to a report.

use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};

use autosplats::guess_axes;
use autosplats_cloud::{Bytes, Clouds, Crs, Error, Held, Part, PointCloud, Progress, Unit, check_memory};
use autosplats_formats::{Attribute, Description, ReadOptions, describe, describe_bytes, describe_tree, read_bytes};
use autosplats_sources::{PlayOptions, RecordingSummary, Source, describe_recording};

use super::notes::NoteCollector;
use super::report::{AttributeFound, AxesFound, Bounds, CrsFound, Detail, Report, ScanFound};
use super::room::Room;
use super::spacing;
use super::statistics::Statistics;
use super::values::{Meaning, Surveyed, meaning, survey, values_of};
use crate::args::InputArgs;
use crate::console::Console;
use crate::exit::Failure;
use crate::input::{Inputs, which_frame};
use crate::progress::Bar;

/// Size in bytes from which files are read one at a time. Reading one uses all cores, and two might not fit into
/// memory.
const LARGE_FILE_BYTES: u64 = 64 << 20;

/// Examines inputs, several at a time.
pub(super) struct Examiner {
    options: ReadOptions,
    scan: bool,
    room: Room,
    console: Console,
    /// Held while a large input is read.
    large: Mutex<()>,
}

/// The report of an input, and the failure to read it.
pub(super) struct Examination {
    pub(super) report: Report,
    pub(super) failure: Option<Failure>,
}

impl Examiner {
    pub(super) fn new(options: ReadOptions, scan: bool, room: Room, console: Console) -> Self {
        Self { options, scan, room, console, large: Mutex::new(()) }
    }

    pub(super) fn examine(&self, name: &str) -> Examination {
        let mut report = Report { input: name.into(), ..Report::default() };
        let outcome = Inputs::new(&[name.into()], &InputArgs::default()).and_then(|inputs| {
            match inputs.only() {
                Source::File(path) => self.file(inputs.only(), path, &mut report),
                address @ Source::Address(_) => self.address(name, address, &mut report),
                scene @ Source::Scene(..) => self.scene(name, scene, &mut report),
                moving => self.moving(name, moving, &mut report),
            }
            .map_err(Failure::from)
        });
        report.error = outcome.as_ref().err().map(|failure| failure.message.clone());
        Examination { report, failure: outcome.err() }
    }

    fn file(&self, source: &Source, path: &Path, report: &mut Report) -> Result<(), Error> {
        if !path.is_file() {
            return self.pipe(path, report);
        }
        let bytes = path.metadata().map_or(0, |metadata| metadata.len());
        report.file_bytes = Some(bytes);
        let bar = Bar::on_file("opening", path, &self.console);
        let header = match source.open_tree(&self.options, &bar)? {
            Some(tree) => describe_tree(&*tree),
            None => describe(path, &self.options)?,
        };
        drop(bar);
        report.describe(&header);
        if !self.scan && header.points.is_some() && header.bounds.is_some() {
            return Ok(());
        }
        let _alone = (bytes >= LARGE_FILE_BYTES).then(|| self.large.lock().unwrap_or_else(PoisonError::into_inner));
        let bar = Bar::on_file("reading", path, &self.console);
        let listener = NoteCollector::new(&bar);
        // Text states no number; no row is shorter than three digits, each with a byte behind it.
        let points = header.points.unwrap_or(bytes / 6);
        if self.room.holds(points) {
            let cloud = source.read(&self.options, &listener);
            listener.notes().into_iter().for_each(|note| report.warn(note));
            drop(bar);
            let bar = Bar::spinner("measuring", &self.console);
            report.scan(&cloud?, &header.attributes)?;
            drop(bar);
            return Ok(());
        }
        let parts = self.room.spool(path, points, &self.options, &listener);
        listener.notes().into_iter().for_each(|note| report.warn(note));
        drop(bar);
        let bar = Bar::new("measuring", &self.console);
        match parts? {
            Some(parts) => report.scan_all(&parts, &header.attributes, Some(&self.room), &bar),
            None => report.scan(&source.read(&self.options, &())?, &header.attributes),
        }
    }

    /// Describes what comes through a pipe, which can be read only once.
    fn pipe(&self, path: &Path, report: &mut Report) -> Result<(), Error> {
        let bar = Bar::on_file("reading", path, &self.console);
        let listener = NoteCollector::new(&bar);
        let bytes = Bytes::open(path)?;
        let header = describe_bytes(path, &bytes, &self.options)?;
        report.describe(&header);
        let cloud = read_bytes(path, &bytes, &self.options, &listener);
        listener.notes().into_iter().for_each(|note| report.warn(note));
        drop(bar);
        report.scan(&cloud?, &header.attributes)
    }

    /// Describes what is behind an address: an octree by its header and hierarchy, all else by its points.
    fn address(&self, name: &str, source: &Source, report: &mut Report) -> Result<(), Error> {
        let bar = Bar::new(&format!("fetching {name}"), &self.console);
        let listener = NoteCollector::new(&bar);
        let tree = source.open_tree(&self.options, &listener)?;
        if let Some(tree) = &tree {
            report.describe(&describe_tree(&**tree));
        }
        if self.scan || tree.is_none() {
            let cloud = source.read(&self.options, &listener)?;
            report.format.get_or_insert_with(|| "remote file".into());
            report.scan(&cloud, &[])?;
        }
        listener.notes().into_iter().for_each(|note| report.warn(note));
        Ok(())
    }

    /// Describes a moving input by its container's summary and its first points.
    fn moving(&self, name: &str, source: &Source, report: &mut Report) -> Result<(), Error> {
        let bar = Bar::new(&format!("reading {name}"), &self.console);
        let listener = NoteCollector::new(&bar);
        if let Source::Recording(path) = source {
            let summary = describe_recording(path, &listener)?;
            report.file_bytes = path.metadata().ok().filter(|data| data.is_file()).map(|data| data.len());
            report.describe_recording(&summary);
        }
        let play = PlayOptions::default();
        let mut player = source.play(&play, &self.options, &listener)?;
        if let Some(timeline) = player.stream().timeline() {
            let seconds = timeline.duration().as_secs_f64();
            report.details.insert(0, detail("frames", format!("{} in {seconds:.2} s", timeline.len())));
        }
        let cloud = match player.first(Source::FIRST_POINTS_TIMEOUT, &listener) {
            // What a recording without points holds is worth a report.
            Err(Error::NoFrames { .. }) if player.stream().timeline().is_some() => Arc::default(),
            cloud => cloud?,
        };
        listener.notes().into_iter().for_each(|note| report.warn(note));
        drop(bar);
        report.format.get_or_insert_with(|| "sequence of files".into());
        if !cloud.is_empty() {
            let which = which_frame(&player).unwrap_or_else(|| "the first frame".into());
            report.warn(format!("points, bounds and attributes are those of {which}"));
        }
        report.scan(&cloud, &[])
    }

    fn scene(&self, name: &str, scene: &Source, report: &mut Report) -> Result<(), Error> {
        let large = scene.least_bytes() >= LARGE_FILE_BYTES;
        let _alone = large.then(|| self.large.lock().unwrap_or_else(PoisonError::into_inner));
        let cloud = scene.read(&self.options, &Bar::new(&format!("generating {name}"), &self.console))?;
        report.format = Some("generated scene".into());
        report.scan(&cloud, &[])
    }
}

fn detail(name: impl Into<String>, value: impl Into<String>) -> Detail {
    Detail { name: name.into(), value: value.into() }
}

impl Report {
    /// Adds the summary of a recording.
    fn describe_recording(&mut self, summary: &RecordingSummary) {
        let RecordingSummary { format, topics, frames, frame, notes, .. } = summary;
        self.format = Some(format.clone());
        self.details.extend(topics.iter().map(|topic| {
            let played = if topic.points { ", played" } else { "" };
            detail(&topic.name, format!("{} × {}{played}", topic.messages, topic.type_name))
        }));
        if !frames.is_empty() {
            self.details.push(detail("coordinate frames", frames.join(", ")));
        }
        self.details.extend(frame.iter().map(|frame| detail("points are transformed to", frame)));
        notes.iter().for_each(|note| self.warn(note.clone()));
    }

    fn warn(&mut self, warning: String) {
        if !self.warnings.contains(&warning) {
            self.warnings.push(warning);
        }
    }

    fn describe(&mut self, header: &Description) {
        let Description { format, points, faces, bounds, attributes, crs, scans, resolution, details, notes } = header;
        self.format = Some(format.clone());
        self.points = *points;
        self.points_in_header = *points;
        self.faces = *faces;
        self.bounds = bounds.and_then(Bounds::new);
        self.crs = CrsFound::from(crs);
        self.resolution = resolution.map(Into::into);
        self.scans = scans.iter().map(ScanFound::from).collect();
        // Facts that have a field of their own are not repeated.
        let told = |name: &str| name == "element face" && faces.is_some();
        self.details = details
            .iter()
            .filter(|(name, _)| !told(name))
            .map(|(name, value)| Detail { name: name.clone(), value: value.clone() })
            .collect();
        notes.iter().for_each(|note| self.warn(note.clone()));
        self.attributes = attributes
            .iter()
            .map(|Attribute { name, stored }| {
                let mut statistics = Statistics::default();
                if let (Some(Meaning::Axis(axis)), Some(bounds)) = (meaning(name), &self.bounds) {
                    (statistics.min, statistics.max) = (Some(bounds.min[axis]), Some(bounds.max[axis]));
                }
                AttributeFound { name: name.clone(), stored: stored.clone(), statistics }
            })
            .collect();
    }

    /// Adds what all points show; this overrides the header.
    fn scan(&mut self, cloud: &PointCloud, attributes: &[Attribute]) -> Result<(), Error> {
        self.scan_all(&Held { name: Path::new(""), cloud }, attributes, None, &())
    }

    /// Like [`scan`](Self::scan), of points that may come in parts. `room` is for work on their neighbourhoods, if
    /// memory does not hold them all.
    fn scan_all(
        &mut self,
        clouds: &dyn Clouds,
        attributes: &[Attribute],
        room: Option<&Room>,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        self.scanned = true;
        let header_bounds = self.bounds.take();
        let part = |start: f32, len: f32| Part { whole: progress, start, len };
        let Surveyed { points, finite, bounds, like, crs, scans, summaries } =
            survey(clouds, attributes, &part(0.0, 0.2))?;
        self.points = Some(points);
        self.not_finite = Some(points - finite);
        self.bounds = Bounds::new(bounds);
        if finite > 0 {
            self.axes = Some(AxesFound::new(guess_axes(&like), like.axes().is_none()));
        }
        if crs != Crs::default() {
            self.crs = CrsFound::from(&crs);
        }
        self.resolution = like.resolution().map(Into::into).or(self.resolution);
        // The reader has already dropped invalid scans.
        self.scans = scans.iter().map(ScanFound::from).collect();
        self.attributes = values_of(clouds, &like, attributes, summaries, &part(0.2, 0.2))?;
        self.tidy();
        self.compare(header_bounds);
        if finite == 0 {
            self.warn(if points == 0 { "there are no points in it" } else { "no position is finite" }.into());
            return Ok(());
        }
        if room.is_none() && check_memory("", points * spacing::BYTES_PER_POINT).is_err() {
            self.warn("not enough memory to measure spacing and count duplicates; thin the cloud".into());
            return Ok(());
        }
        let duplicates = match (clouds.whole(), room) {
            (Some(cloud), _) => spacing::duplicates(cloud),
            (None, room) => spacing::duplicates_in_parts(clouds, points, room, &part(0.4, 0.1))?,
        };
        self.duplicates = Some(duplicates);
        if crs.unit == Some(Unit::Degree) {
            self.warn("x and y are in degrees, z is not: no spacing or density; project the points to metres".into());
        } else {
            (self.spacing, self.density) = match (clouds.whole(), room) {
                (Some(cloud), _) => spacing::measure(cloud, duplicates),
                (None, room) => spacing::measure_in_parts(clouds, room, &part(0.5, 0.5))?,
            };
        }
        self.check_digits();
        Ok(())
    }

    /// Rounds coordinates to 15 significant digits. They are sums of an origin and an offset, whose further digits are
    /// rounding noise.
    fn tidy(&mut self) {
        let Some(bounds) = &mut self.bounds else { return };
        let largest = bounds.min.iter().chain(&bounds.max).fold(0.0_f64, |most, value| most.max(value.abs()));
        let tidy = |value: &mut f64| *value = tidy(*value, largest);
        for axis in 0..3 {
            [&mut bounds.min, &mut bounds.max, &mut bounds.size].into_iter().for_each(|ends| tidy(&mut ends[axis]));
        }
        for AttributeFound { name, statistics, .. } in &mut self.attributes {
            if let Some(Meaning::Axis(_)) = meaning(name) {
                let Statistics { min, max, mean, histogram, .. } = statistics;
                [min, max, mean].into_iter().flatten().for_each(tidy);
                histogram.iter_mut().flat_map(|histogram| &mut histogram.edges).for_each(tidy);
            }
        }
    }

    /// Warns where the header's bounds contradict the points.
    fn compare(&mut self, header: Option<Bounds>) {
        let (Some(header), Some(bounds)) = (header, self.bounds) else { return };
        // Dropped points may have changed the bounds.
        if self.points != self.points_in_header {
            return;
        }
        let mut off = Vec::new();
        let largest = |values: [f64; 3]| values.into_iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        // Programs round the bounds that they write.
        let rounding = 1e-5 * largest(bounds.size).max(0.01 * largest(bounds.max).max(largest(bounds.min)));
        for (axis, name) in ["x", "y", "z"].iter().enumerate() {
            let allowed = rounding.max(self.resolution.map_or(0.0, |step| 1.5 * step[axis]));
            let ends = [(header.min, bounds.min), (header.max, bounds.max)];
            if ends.iter().any(|(claimed, found)| (claimed[axis] - found[axis]).abs() > allowed) {
                let [low, high] = [header.min, header.max].map(|end| tidy(end[axis], largest(header.max)));
                off.push(format!("{name} {low} to {high}"));
            }
        }
        if !off.is_empty() {
            self.warn(format!("the header states other bounds than the points have: {}", off.join(", ")));
        }
    }

    /// Warns where coordinates are coarser than the spacing of the points.
    fn check_digits(&mut self) {
        let (Some(spacing), Some(bounds)) = (self.spacing, self.bounds) else { return };
        let mut coarse = Vec::new();
        for attribute in &self.attributes {
            let Some(Meaning::Axis(axis)) = meaning(&attribute.name) else { continue };
            let step = match (self.resolution, &*attribute.stored) {
                (Some(step), _) if step[axis] >= 0.5 * spacing.median => step[axis],
                (None, "float32") => {
                    let largest = bounds.max[axis].abs().max(bounds.min[axis].abs()) as f32;
                    let step = f64::from(largest.next_up() - largest);
                    if step < 0.1 * spacing.median || step == 0.0 {
                        continue;
                    }
                    step
                }
                _ => continue,
            };
            coarse.push((attribute.name.as_str(), step));
        }
        let steps = match coarse.as_slice() {
            [] => return,
            [(_, step), (_, y), (_, z)] if step == y && step == z => format!("steps of {step}"),
            some => some.iter().map(|(name, step)| format!("{name} in steps of {step}")).collect::<Vec<_>>().join(", "),
        };
        let apart = super::text::short(spacing.median);
        self.warn(format!("coordinates are coarse for points {apart} apart: {steps}; surfaces will look stepped"));
    }
}

/// Rounds `value` to the decimals that numbers up to `largest` have in 15 digits.
fn tidy(value: f64, largest: f64) -> f64 {
    let decimals = if largest > 0.0 { 14 - largest.log10().floor() as i32 } else { 0 };
    let shift = 10_f64.powi(decimals.abs());
    let tidy = if decimals >= 0 { (value * shift).round() / shift } else { value };
    // An infinite shift keeps `value`. Adding 0 turns -0 into 0.
    if tidy.is_finite() { tidy + 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;

    /// Header of a survey in feet.
    fn header() -> Description {
        let attribute = |name: &str, stored: &str| Attribute { name: name.into(), stored: stored.into() };
        Description {
            format: "LAS 1.2, point format 3".into(),
            points: Some(4),
            bounds: Some([DVec3::new(635_619.85, 848_899.7, 406.59), DVec3::new(635_720.85, 848_999.7, 506.59)]),
            attributes: vec![
                attribute("X", "int32 × 0.01"),
                attribute("Y", "int32 × 0.01"),
                attribute("Z", "int32 × 0.01"),
                attribute("Classification", "uint8"),
            ],
            crs: Crs { epsg: Some(2992), unit: Some(Unit::UsSurveyFoot), ..Crs::default() },
            resolution: Some(DVec3::splat(0.01)),
            notes: vec!["from the header".into()],
            ..Description::default()
        }
    }

    fn cloud(last: [f32; 3]) -> PointCloud {
        let positions = vec![[-0.15, -0.3, -3.41], [0.0, 0.0, 0.0], [50.0, 50.0, 50.0], last];
        let cloud = PointCloud::new(DVec3::new(635_620.0, 848_900.0, 410.0), positions);
        cloud.with_crs(header().crs).with_resolution(DVec3::splat(0.01))
    }

    #[test]
    fn a_header_alone_has_bounds_units_and_types() {
        let mut report = Report { file_bytes: Some(1000), ..Report::default() };
        report.describe(&header());
        let text = report.to_text(false);
        for said in
            ["101.00 × 100.00 × 100.00 ft (30.8 × 30.5 × 30.5 m)", "US survey foot", "EPSG:2992", "635720.85", "--scan"]
        {
            assert!(text.contains(said), "'{said}' is not in\n{text}");
        }
        assert!(text.contains("warning: from the header"), "notes are warnings:\n{text}");
        assert!(!text.contains("distribution"), "there are no values:\n{text}");
    }

    #[test]
    fn headers_that_contradict_the_points() {
        let warnings = |last| {
            let mut report = Report::default();
            report.describe(&header());
            report.scan(&cloud(last), &header().attributes).expect("memory is read");
            report.warnings.join("; ")
        };
        assert_eq!(warnings([100.85, 99.7, 96.59]), "from the header", "as it says");
        let off = warnings([100.85, 99.7, 196.59]);
        assert!(off.contains("other bounds") && off.contains("z 406.59 to 506.59") && !off.contains("x "), "{off}");
    }

    #[test]
    fn degrees_have_no_spacing() {
        let mut report = Report::default();
        let cloud = cloud([1.0; 3]).with_crs(Crs { unit: Some(Unit::Degree), ..Crs::default() });
        report.scan(&cloud, &[]).expect("memory is read");
        assert_eq!(report.spacing, None, "a degree is no height");
        assert!(report.warnings.iter().any(|warning| warning.contains("degrees")), "{:?}", report.warnings);
    }

    #[test]
    fn digits_beyond_the_fifteenth_are_noise() {
        assert_eq!(tidy(-2.000_961_000_000_003_8, 25.0), -2.000_961, "of a sum");
        assert_eq!(tidy(5_400_009.75, 6e6), 5_400_009.75, "coordinates stay");
        assert_eq!([tidy(1e300, 1e300), tidy(0.0, 0.0), tidy(1e-310, 1e-310)], [1e300, 0.0, 1e-310], "extremes too");
    }
}

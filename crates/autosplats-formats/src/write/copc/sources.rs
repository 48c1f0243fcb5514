//! The inputs as records of the tree.

use std::{
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use autosplats_cloud::{Clouds, Crs, Error, Outline, PointCloud, Progress, lock, tell_loss};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    TreeOptions,
    choose::Chosen,
    distribute::Bounds,
    extras::Extras,
    frame::{Lattice, steps_of},
    recode::Recoder,
    schema::{Holds, Schema},
};
use crate::{
    las,
    read::las::{DAMAGED, Facts, Space, Stream, damage},
    write::{
        job::Quiet,
        las::{Plan, Shape, Survey, finite},
    },
};

/// Points of a cloud that one thread encodes at a time.
const PIECE: usize = 1 << 16;

/// What a tree is made of.
pub enum TreeInput<'a> {
    /// A LAS or LAZ file.
    Las(PathBuf),
    /// Other points.
    Clouds(Box<dyn Clouds + 'a>),
}

/// An open input.
pub(super) enum Source<'a> {
    Las(Box<Stream>),
    Clouds { clouds: Box<dyn Clouds + 'a>, survey: Box<Mutex<Option<Survey>>> },
}

/// A source with what makes its records those of the tree.
pub(super) struct Prepared<'a> {
    source: Source<'a>,
    shape: Option<Shape>,
    lattice: Lattice,
    recoder: Recoder,
    /// Number of points that cannot be read, and why.
    lost: Mutex<(u64, String)>,
    chosen: Chosen,
}

impl<'a> Source<'a> {
    pub(super) fn open(input: TreeInput<'a>) -> Result<Self, Error> {
        match input {
            TreeInput::Las(path) => match Stream::open(&path)? {
                Some(stream) => Ok(Self::Las(Box::new(stream))),
                None => Err(Error::malformed(&path, "byte 0", "a LAS file begins with 'LASF'; this one does not")),
            },
            TreeInput::Clouds(clouds) => Ok(Self::Clouds { clouds, survey: Box::default() }),
        }
    }

    /// What the input holds. Unless its header states possible bounds, all points are read for it.
    pub(super) fn holds(&self, progress: &dyn Progress) -> Result<Holds, Error> {
        match self {
            Self::Las(stream) => holds_of(stream, progress),
            Self::Clouds { clouds, survey } => {
                let found = match clouds.outline(progress)? {
                    Some(outline) => Some(outlined(&outline)),
                    None => survey_of(&**clouds, progress)?,
                };
                let (holds, found) = holds_of_clouds(clouds.name(), found, progress)?;
                *lock(survey) = found;
                Ok(holds)
            }
        }
    }

    /// Tells what is odd about the input, and what it has lost.
    pub(super) fn tell(&self, several: bool, whole: bool, progress: &dyn Progress) -> Result<(), Error> {
        let Self::Las(stream) = self else { return Ok(()) };
        stream.facts.notes.iter().for_each(|note| progress.note(&about(&stream.path, several, note)));
        let Some(loss) = &stream.facts.cut else { return Ok(()) };
        let loss = if whole { loss.clone() } else { about(&stream.path, several, loss) };
        tell_loss(&stream.path, "end of the file", &loss, whole, progress)
    }

    pub(super) fn prepare(
        self,
        schema: &Schema,
        options: &TreeOptions,
        progress: &dyn Progress,
    ) -> Result<Prepared<'a>, Error> {
        let (name, shape, format, record_len, descriptors, lattice) = match &self {
            Self::Las(stream) => {
                let Facts { format, record_len, ref extras, .. } = stream.facts;
                (stream.path.clone(), None, format, record_len, extras.clone(), lattice_of(&stream.facts))
            }
            Self::Clouds { clouds, survey } => {
                let name = clouds.name();
                let survey = lock(survey);
                let shape = survey.as_ref().map(|survey| Shape::of(survey, survey.tree_format(), name, progress));
                let shape = shape.transpose()?;
                let (format, len, descriptors) = shape
                    .as_ref()
                    .map_or((6, las::RECORD_LEN[6], Vec::new()), |s| (s.format, s.record_len, s.descriptors.clone()));
                (name.to_owned(), shape, format, len, descriptors, schema.lattice)
            }
        };
        let extras = Extras::of(record_len - las::RECORD_LEN[format], &descriptors);
        let recoder = Recoder::new(name, format, record_len, &lattice, &extras, schema);
        let keep = options.keep.clone().filter(|_| matches!(self, Self::Las(_)));
        let drops_nowhere = matches!(self, Self::Las(_)) && !options.keep_no_returns;
        let chosen = Chosen::new(options.bounds, keep, drops_nowhere, schema);
        Ok(Prepared { source: self, shape, lattice, recoder, lost: Mutex::default(), chosen })
    }
}

fn lattice_of(facts: &Facts) -> Lattice {
    Lattice { scale: facts.scale, offset: facts.offset }
}

fn holds_of(stream: &Stream, progress: &dyn Progress) -> Result<Holds, Error> {
    let Facts { format, record_len, points, standard_time, created, ref crs, ref extras, .. } = stream.facts;
    let lattice = lattice_of(&stream.facts);
    let bounds = match stream.facts.bounds {
        Some(bounds) => bounds,
        None => read_bounds(stream, progress)?.corners().map(|corner| lattice.world(corner)),
    };
    // A negative step turns lowest and highest around.
    let bounds = [bounds[0].min(bounds[1]), bounds[0].max(bounds[1])];
    Ok(Holds {
        name: stream.path.clone(),
        points,
        colors: las::colors(format).is_some(),
        infrared: matches!(format, 8 | 10),
        lattice: Some(lattice),
        bounds,
        extras: Extras::of(record_len - las::RECORD_LEN[format], extras),
        crs: crs.clone(),
        standard_time: las::time(format).is_some().then_some(standard_time),
        created: Some(created),
    })
}

fn read_bounds(stream: &Stream, progress: &dyn Progress) -> Result<Bounds, Error> {
    let bounds = Mutex::new(Bounds::NONE);
    (0..stream.runs()).into_par_iter().try_for_each(|run| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let mut own = Bounds::NONE;
        stream.read(run, &mut Space::default(), &mut |records| {
            records.chunks_exact(stream.facts.record_len).for_each(|record| own.add(steps_of(record)));
            Ok(())
        })?;
        lock(&bounds).join(&own);
        Ok(())
    })?;
    Ok(bounds.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// What the points hold by their outline.
fn outlined(Outline { points, bounds, some }: &Outline) -> Survey {
    let mut survey = Survey::of(some);
    (survey.points, survey.bounds) = (*points as usize, *bounds);
    survey
}

/// Reads all points for what they hold; `None` if there are none.
fn survey_of(clouds: &dyn Clouds, progress: &dyn Progress) -> Result<Option<Survey>, Error> {
    let mut found: Option<Survey> = None;
    clouds.read(progress, &mut |cloud| {
        if cloud.is_empty() {
            return Ok(());
        }
        let own = Survey::of(cloud);
        match &mut found {
            Some(all) => all.add(own).map_err(|what| Error::unsupported(clouds.name(), what))?,
            None => found = Some(own),
        }
        Ok(())
    })?;
    Ok(found)
}

fn holds_of_clouds(
    name: &Path,
    found: Option<Survey>,
    progress: &dyn Progress,
) -> Result<(Holds, Option<Survey>), Error> {
    let mut holds = Holds {
        name: name.to_owned(),
        points: 0,
        colors: false,
        infrared: false,
        lattice: None,
        bounds: [DVec3::ZERO; 2],
        extras: Extras::default(),
        crs: Crs::default(),
        standard_time: None,
        created: None,
    };
    let Some(survey) = found else { return Ok((holds, None)) };
    survey.note_losses(progress);
    let shape = Shape::of(&survey, survey.tree_format(), name, &())?;
    holds.points = survey.points as u64;
    (holds.colors, holds.infrared) = (survey.is_colored(), shape.format == 8);
    holds.bounds = survey.bounds;
    holds.lattice = survey.steps.map(|scale| Lattice { scale, offset: DVec3::ZERO });
    holds.extras = Extras::of(shape.record_len - las::RECORD_LEN[shape.format], &shape.descriptors);
    (holds.crs, holds.standard_time) = (survey.crs.clone(), survey.standard_time());
    Ok((holds, Some(survey)))
}

/// A note about one of several inputs.
fn about(path: &Path, several: bool, note: &str) -> String {
    if several { format!("{}: {note}", path.display()) } else { note.into() }
}

impl Prepared<'_> {
    /// Whether the points come as clouds.
    pub(super) fn is_clouds(&self) -> bool {
        matches!(self.source, Source::Clouds { .. })
    }

    /// Passes on all points as records of the tree, from several threads.
    pub(super) fn read(
        &self,
        progress: &dyn Progress,
        take: &(dyn Fn(&[u8]) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        // Points may be read a second time.
        self.chosen.forget();
        match (&self.source, &self.shape) {
            (Source::Las(stream), _) => {
                self.records(stream, progress, &|records| self.chosen.retain(records), take)?;
                let nowhere = self.chosen.nowhere();
                if nowhere > 1 && nowhere == stream.facts.points - lock(&self.lost).0 {
                    // All points are there, so something was measured.
                    let chosen = |records: &mut Vec<u8>| self.chosen.retain_chosen(records);
                    self.chosen.forget();
                    return self.records(stream, progress, &chosen, take);
                }
                self.chosen.only_nowhere().map_or(Ok(()), |one| take(&one))
            }
            (Source::Clouds { clouds, .. }, Some(shape)) => {
                clouds.read(&Quiet(progress), &mut |cloud| self.encode(cloud, shape, progress, take))
            }
            (Source::Clouds { .. }, None) => Ok(()),
        }
    }

    /// Passes on the records of a file that `retain` leaves.
    fn records(
        &self,
        stream: &Stream,
        progress: &dyn Progress,
        retain: &(dyn Fn(&mut Vec<u8>) + Sync),
        take: &(dyn Fn(&[u8]) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        *lock(&self.lost) = (0, String::new());
        let spaces: Mutex<Vec<(Space, Vec<u8>)>> = Mutex::default();
        (0..stream.runs()).into_par_iter().try_for_each(|run| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let (mut space, mut records) = lock(&spaces).pop().unwrap_or_default();
            let lost = stream.read(run, &mut space, &mut |piece| {
                records.clear();
                self.recoder.recode(piece, &mut records)?;
                retain(&mut records);
                take(&records)
            })?;
            lock(&spaces).push((space, records));
            if lost.points > 0 {
                let mut all = lock(&self.lost);
                all.0 += lost.points;
                // The order of the threads does not matter.
                if all.1.is_empty() || lost.why < all.1 {
                    all.1 = lost.why;
                }
            }
            Ok(())
        })
    }

    fn encode(
        &self,
        cloud: &PointCloud,
        shape: &Shape,
        progress: &dyn Progress,
        take: &(dyn Fn(&[u8]) -> Result<(), Error> + Sync),
    ) -> Result<(), Error> {
        let plan = Plan::bind(cloud, shape, self.lattice.scale, self.lattice.offset, finite(cloud));
        (0..plan.points().div_ceil(PIECE)).into_par_iter().try_for_each(|piece| {
            if progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let first = piece * PIECE;
            let mut records = vec![0; PIECE.min(plan.points() - first) * shape.record_len];
            plan.encode(&mut records, |index| plan.point(first + index));
            let mut recoded = Vec::new();
            self.recoder.recode(&records, &mut recoded)?;
            self.chosen.retain(&mut recoded);
            take(&recoded)
        })
    }

    /// Tells which points could not be read, and which were left out.
    pub(super) fn tell_lost(&self, several: bool, whole: bool, progress: &dyn Progress) -> Result<(), Error> {
        let Source::Las(stream) = &self.source else { return Ok(()) };
        let (lost, why) = std::mem::take(&mut *lock(&self.lost));
        let all = stream.facts.points;
        if lost > 0 && lost == all {
            return Err(Error::malformed(&stream.path, "point 1", why));
        }
        if let Some(loss) = damage(lost, all) {
            let loss = if whole { loss } else { about(&stream.path, several, &loss) };
            tell_loss(&stream.path, DAMAGED, &loss, whole, progress)?;
        }
        let nowhere = self.chosen.nowhere();
        if nowhere > 0 {
            let note = format!("dropped {nowhere} of {all} points at (0, 0, 0), where nothing was measured");
            progress.note(&about(&stream.path, several, &note));
        }
        if let Some(note) = self.chosen.note() {
            progress.note(&about(&stream.path, several, &note));
        }
        Ok(())
    }
}

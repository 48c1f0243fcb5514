//! The transforms between coordinate frames that a recording holds.

use autosplats_cloud::{Error, Progress, one_line};
use rayon::prelude::*;

use super::{
    chunk::unpack,
    container::Container,
    files::File,
    records::{Kind, MessagePosition, Record},
};
use crate::transforms::{PoseSample, Transforms, parse};

/// Number of chunks read in parallel.
const CHUNKS_PER_BATCH: usize = 16;

/// Reads all transforms of a recording.
pub(super) fn read_transforms(files: &[File], progress: &dyn Progress) -> Result<Transforms, Error> {
    // Groups consecutive messages of one chunk, so that each chunk is unpacked once.
    let mut runs: Vec<Vec<MessagePosition>> = Vec::new();
    for (number, File { index, .. }) in files.iter().enumerate() {
        let own = index.messages.iter().filter(|place| index.topics[place.topic].kind != Kind::Points);
        for place in own.map(|place| MessagePosition { file: number, ..*place }) {
            match runs.last_mut() {
                Some(run) if run[0].file == number && run[0].chunk == place.chunk => run.push(place),
                _ => runs.push(vec![place]),
            }
        }
    }
    let mut transforms = Transforms::default();
    let mut lost: Option<String> = None;
    for (number, batch) in runs.chunks(CHUNKS_PER_BATCH).enumerate() {
        progress.tick((number * CHUNKS_PER_BATCH) as f32 / runs.len() as f32)?;
        let samples: Vec<_> = batch.par_iter().map(|run| samples(&files[run[0].file], run)).collect();
        for outcome in samples {
            match outcome {
                Ok(messages) => messages.into_iter().for_each(|(fixed, samples)| transforms.add(fixed, samples)),
                Err(what) => lost = lost.or(Some(what)),
            }
        }
    }
    if let Some(what) = lost {
        progress.note(&one_line(&format!("some transforms cannot be read: {what}")));
    }
    transforms.sort();
    Ok(transforms)
}

/// The transforms in the messages of one chunk, and whether each is fixed.
fn samples(file: &File, run: &[MessagePosition]) -> Result<Vec<(bool, Vec<PoseSample>)>, String> {
    let File { bytes, index, .. } = file;
    let content = run[0].chunk.map(|chunk| unpack(bytes, &index.chunks[chunk])).transpose()?;
    let records = content.as_deref().unwrap_or(bytes);
    let Some((mut container, _)) = Container::of(bytes) else { return Ok(Vec::new()) };
    let mut samples = Vec::new();
    for place in run {
        let topic = &index.topics[place.topic];
        let (record, _) = container.record(records, place.at).map_err(|fault| fault.what)?;
        let (Record::Message(_, _, message), Some(encoding)) = (record, topic.encoding) else { continue };
        let fixed = topic.kind == Kind::Transforms { fixed: true };
        samples.push((fixed, parse(message, encoding, place.time).map_err(|fault| fault.what)?));
    }
    Ok(samples)
}

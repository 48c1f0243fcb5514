//! Plays messages as the updates of a stream.

use std::time::Duration;

use super::{Recording, index::MessagePosition};
use crate::{
    Error, Progress,
    source::{
        point_cloud2,
        stream::{Next, Statistics, Stream, Timeline, Update},
    },
};

impl Stream for Recording {
    fn timeline(&self) -> Option<&Timeline> {
        Some(&self.timeline)
    }

    fn seen_at(&self, frame: usize) -> Vec<usize> {
        let before = &self.frames[..self.frames.len().min(frame.saturating_add(1))];
        let last = |channel| before.iter().rposition(|(_, of)| *of == channel);
        let mut seen: Vec<usize> = (0..self.channels.len()).filter_map(last).collect();
        seen.sort_unstable();
        seen
    }

    fn seek(&mut self, frame: usize) {
        self.position = frame;
    }

    fn next(&mut self, _patience: Duration, progress: &dyn Progress) -> Result<Next, Error> {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let Some(&(place, channel)) = self.frames.get(self.position) else { return Ok(Next::End) };
        self.position += 1;
        match self.update(&place, channel, progress) {
            Ok(update) => {
                self.statistics.taken += 1;
                Ok(Next::Update(update))
            }
            Err(error) => {
                self.statistics.refused += 1;
                self.statistics.last_refusal = Some(error.to_string());
                Err(error)
            }
        }
    }

    fn statistics(&self) -> Statistics {
        self.statistics.clone()
    }
}

impl Recording {
    fn update(&mut self, place: &MessagePosition, channel: usize, progress: &dyn Progress) -> Result<Update, Error> {
        let topic = &self.channels[channel];
        let file = &mut self.files[place.file];
        let encoding = file.index.topics[place.topic].encoding.unwrap_or(point_cloud2::Encoding::Cdr);
        let (path, at) = (file.path.clone(), file.offset(place));
        let message = file.message(place)?;
        let message =
            point_cloud2::decode(&path, message, encoding, &self.options.read).map_err(|error| match error {
                Error::Malformed { path, place, what } => {
                    Error::Malformed { path, place: format!("byte {at}, {place} of a message of {topic}"), what }
                }
                other => other,
            })?;
        let stamp = if message.stamp == 0 { place.time } else { message.stamp };
        let mut cloud = message.cloud;
        let noted = &mut self.noted[channel];
        if let Some(placement) = self.transforms.placement(&message.frame_id, stamp) {
            let missing;
            (cloud, missing) = placement.apply(cloud);
            if let Some(missing) = missing.filter(|_| !*noted) {
                *noted = true;
                progress.note(&crate::error::message(&format!("{topic}: {missing}; its points stay as they are")));
            }
        }
        if message.no_returns > 0 && !*noted {
            *noted = true;
            let (count, total) = (message.no_returns, message.no_returns + cloud.len());
            let note = format!("{topic}: dropped {count} of {total} points at (0, 0, 0), where nothing was measured");
            progress.note(&crate::error::message(&note));
        }
        Ok(Update { channel, stamp, cloud: cloud.into() })
    }
}

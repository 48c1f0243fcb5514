//! Recordings of robots: MCAP files, ROS 1 bags and folders of ROS 2 bags, played by their index.
//!
//! # How it works
//!
//! A file is mapped, and its records are walked from front to end without unpacking chunks. Index records after each
//! chunk tell which messages it contains, with their times. The result is an index, the same for all
//! containers. Chunks without index records, as in a file that is cut off, are unpacked to index them. Opening reads
//! all transforms between coordinate frames. Points are read only when they are played, one message at a time.

mod bag;
mod chunk;
mod container;
mod files;
mod index;
mod mcap;
mod records;
mod summary;
mod transforms;

use std::{collections::HashMap, path::Path, time::Duration};

use autosplats_cloud::{Error, Part, Progress, one_line, tell_loss};
use autosplats_formats::ReadOptions;

pub use self::{
    files::is_recording,
    summary::{RecordingSummary, RecordingTopic},
};
use self::{
    files::{File, OpenedFiles, open_files},
    records::{Kind, MessagePosition, Topic},
    transforms::read_transforms,
};
use crate::{
    point_cloud2::{self, Encoding, stamp_and_frame},
    stream::{Next, Statistics, Stream, Timeline, Update},
    transforms::Transforms,
    wire::frame_name,
};

/// Options of [`Recording::open`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingOptions {
    /// Topics of points to play, each as a channel in this order. Empty: all topics with points, sorted by name.
    pub topics: Vec<String>,
    /// Coordinate frame to transform all points into. Default `None`: the root of the tree of frames above the sensors.
    pub frame: Option<String>,
    /// How to read points.
    pub read: ReadOptions,
}

/// The points of a recording, one message after the other.
///
/// The [timeline](crate::Stream::timeline) has the times of recording. Each [update](crate::Update) has the time of
/// measurement if its message states one.
///
/// ```
/// use std::time::Duration;
///
/// use autosplats_sources::{Next, Recording, RecordingOptions, Stream as _};
///
/// # let bytes = |number: &u32| number.to_le_bytes();
/// # let numbers = |numbers: &[u32]| numbers.iter().flat_map(bytes).collect::<Vec<u8>>();
/// # let text = |text: &str| [numbers(&[text.len() as u32]), text.as_bytes().to_vec()].concat();
/// # let field = |name, offset| [text(name), numbers(&[offset]), vec![7], numbers(&[1])].concat();
/// # let message = [
/// #     [numbers(&[0, 1_700_000_000, 0]), text("lidar"), numbers(&[1, 1, 3])].concat(),
/// #     [field("x", 0), field("y", 4), field("z", 8), vec![0], numbers(&[12, 12, 12])].concat(),
/// #     [1_f32, 2.0, 3.0].map(f32::to_le_bytes).concat(),
/// #     vec![1],
/// # ];
/// # let options = mcap::WriteOptions::new().compression(None);
/// # let mut writer = options.create(std::io::Cursor::new(Vec::new()))?;
/// # let schema = writer.add_schema("sensor_msgs/PointCloud2", "ros1msg", b"")?;
/// # let channel_id = writer.add_channel(schema, "/lidar/points", "ros1", &Default::default())?;
/// # let time = 1_700_000_000_000_000_000;
/// # let (sequence, log_time, publish_time) = (0, time, time);
/// # let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time };
/// # writer.write_to_known_channel(&header, &message.concat())?;
/// # writer.finish()?;
/// # let bytes = writer.into_inner().into_inner();
/// let options = RecordingOptions::default();
/// // The bytes are those of a recording with one message, which has one point.
/// let mut recording = Recording::from_bytes("drive.mcap".as_ref(), bytes, &options, &())?;
/// assert_eq!(recording.channels(), ["/lidar/points"]);
/// while let Next::Update(update) = recording.next(Duration::ZERO, &())? {
///     assert_eq!(update.cloud.positions(), [[1.0, 2.0, 3.0]]);
/// }
/// assert_eq!(recording.statistics().taken, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Recording {
    files: Vec<File>,
    options: RecordingOptions,
    summary: RecordingSummary,
    /// Topics that are played, one per channel.
    channels: Vec<String>,
    /// Messages of points sorted by time, with their channels.
    frames: Vec<(MessagePosition, usize)>,
    timeline: Timeline,
    transforms: Transforms,
    position: usize,
    statistics: Statistics,
    /// Channels that have reported a note. Each channel reports only one.
    noted: Vec<bool>,
}

impl Recording {
    /// Opens an MCAP file, a ROS 1 bag or the folder of a ROS 2 bag. Reads all transforms, but no points yet.
    ///
    /// Data that cannot be played, such as the missing end of a file, are reported as [notes](Progress::note) and
    /// counted as [refused](Statistics::refused).
    ///
    /// # Errors
    /// [`Error::Io`], [`Error::Malformed`] if nothing can be played, [`Error::Unsupported`] if there are no points or
    /// topics asked for are missing, and [`Error::Cancelled`].
    pub fn open(path: &Path, options: &RecordingOptions, progress: &dyn Progress) -> Result<Self, Error> {
        Self::of(path, open_files(path, &indexing(progress))?, options, progress)
    }

    /// [Opens](Self::open) a recording from the bytes of a file. `name` is used in messages.
    ///
    /// # Errors
    /// Those of [`open`](Self::open).
    pub fn from_bytes(
        name: &Path,
        bytes: Vec<u8>,
        options: &RecordingOptions,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let files = vec![File::of_bytes(name, bytes, &indexing(progress))?];
        Self::of(name, OpenedFiles { files, missing: Vec::new() }, options, progress)
    }

    fn of(path: &Path, parts: OpenedFiles, options: &RecordingOptions, progress: &dyn Progress) -> Result<Self, Error> {
        let mut summary = RecordingSummary::of(&parts);
        let OpenedFiles { mut files, missing } = parts;
        let unsupported = |what: String| Error::unsupported(path, what);
        let mut channels: Vec<String> = summary.points().map(|topic| topic.name.clone()).collect();
        channels.dedup();
        if channels.is_empty() {
            return Err(unsupported(format!(
                "there are no PointCloud2 messages; its topics: {}",
                summary.topic_names()
            )));
        }
        if !options.topics.is_empty() {
            if let Some(missing) = options.topics.iter().find(|name| !channels.contains(name)) {
                let there = channels.join(", ");
                return Err(unsupported(format!(
                    "no topic with points is called '{missing}'; topics with points: {there}"
                )));
            }
            channels.clone_from(&options.topics);
        }

        let numbers: HashMap<&str, usize> = channels.iter().enumerate().map(|(at, name)| (&**name, at)).collect();
        let mut frames = Vec::new();
        for (number, File { index, .. }) in files.iter().enumerate() {
            let channel = |topic: &Topic| numbers.get(&*topic.name).copied().filter(|_| topic.kind == Kind::Points);
            let channels: Vec<Option<usize>> = index.topics.iter().map(channel).collect();
            let own = index.messages.iter().map(|place| MessagePosition { file: number, ..*place });
            frames.extend(own.filter_map(|place| Some((place, channels[place.topic]?))));
        }
        frames.sort_by_key(|(place, _)| place.time);
        let timeline = Timeline::new(frames.iter().map(|(place, _)| place.time).collect());

        let mut statistics = Statistics::default();
        let whole = options.read.whole;
        for noted in missing {
            if whole {
                tell_loss(path, "parts", &noted, whole, progress)?;
            }
            progress.loss(&noted);
            statistics.refused += 1;
            statistics.last_refusal = Some(noted);
        }
        for file in &files {
            for fault in &file.index.faults {
                let noted = format!("{}: {}", fault.place(), fault.what);
                if whole {
                    tell_loss(&file.path, &fault.place(), &fault.what, whole, progress)?;
                }
                progress.loss(&one_line(&noted));
                statistics.refused += 1;
                statistics.last_refusal = Some(one_line(&format!("{}: {noted}", file.path.display())));
            }
        }

        let mut transforms =
            read_transforms(&files, &Part { whole: progress, start: INDEXING_SHARE, len: 1.0 - INDEXING_SHARE })?;
        let sensors = sensors(&mut files, &frames, channels.len());
        transforms.choose(&sensors, options.frame.as_deref().map(frame_name)).map_err(&unsupported)?;
        summary.frames = transforms.frames(&sensors);
        summary.frame = transforms.target().map(str::to_owned);
        progress.tick(1.0)?;
        let noted = vec![false; channels.len()];
        let options = options.clone();
        Ok(Self { files, options, summary, channels, frames, timeline, transforms, position: 0, statistics, noted })
    }

    /// Summary of the recording.
    pub fn summary(&self) -> &RecordingSummary {
        &self.summary
    }

    /// The topic of each channel.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }
}

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
        let encoding = file.index.topics[place.topic].encoding.unwrap_or(Encoding::Cdr);
        let (path, at) = (file.path.clone(), file.offset(place));
        let message = match file.message(place) {
            Ok(message) => message,
            Err(error) => {
                file.bytes.check()?;
                return Err(error);
            }
        };
        let decoded = point_cloud2::decode(&path, message, encoding, &self.options.read);
        file.bytes.check()?;
        let message = decoded.map_err(|error| match error {
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
                progress.note(&one_line(&format!("{topic}: {missing}; its points stay as they are")));
            }
        }
        if message.no_returns > 0 && !*noted {
            *noted = true;
            let (count, total) = (message.no_returns, message.no_returns + cloud.len());
            let note = format!("{topic}: dropped {count} of {total} points at (0, 0, 0), where nothing was measured");
            progress.note(&one_line(&note));
        }
        Ok(Update { channel, stamp, cloud: cloud.into() })
    }
}

/// Coordinate frames of the channels' sensors, in order of channels, from the first readable message of each.
fn sensors(files: &mut [File], frames: &[(MessagePosition, usize)], channels: usize) -> Vec<String> {
    let mut found: Vec<Result<String, usize>> = vec![Err(0); channels];
    let mut open = channels;
    for (place, channel) in frames {
        let Err(tried) = &mut found[*channel] else { continue };
        *tried += 1;
        let tried = *tried;
        if tried > MAX_SENSOR_TRIALS {
            continue;
        }
        let file = &mut files[place.file];
        let encoding = file.index.topics[place.topic].encoding;
        let frame = encoding.and_then(|encoding| stamp_and_frame(file.message(place).ok()?, encoding));
        open -= usize::from(frame.is_some() || tried == MAX_SENSOR_TRIALS);
        if let Some((_, frame)) = frame {
            found[*channel] = Ok(frame);
        }
        if open == 0 {
            break;
        }
    }
    found.into_iter().flatten().collect()
}

/// Share of the progress of opening that indexing takes; reading transforms is the rest.
const INDEXING_SHARE: f32 = 0.5;

fn indexing(progress: &dyn Progress) -> Part<'_> {
    Part { whole: progress, start: 0.0, len: INDEXING_SHARE }
}

/// Maximum number of messages per topic that are tried to find the sensor's coordinate frame.
const MAX_SENSOR_TRIALS: usize = 8;

/// Summary of a recording, without reading points.
///
/// # Errors
/// Those of [`Recording::open`], except that a recording without points is no error.
pub fn describe_recording(path: &Path, progress: &dyn Progress) -> Result<RecordingSummary, Error> {
    match Recording::open(path, &RecordingOptions::default(), progress) {
        Ok(recording) => Ok(recording.summary),
        Err(Error::Unsupported { .. }) => Ok(RecordingSummary::of(&open_files(path, &())?)),
        Err(error) => Err(error),
    }
}

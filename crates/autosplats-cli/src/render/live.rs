//! Pictures of live input: one per update as it comes, until the input ends.

use std::sync::Arc;
use std::time::{Duration, Instant};

use autosplats::{Camera, Renderer};
use autosplats_cloud::{Error, PointCloud};
use autosplats_output::Target;
use autosplats_sources::{Player, Statistics};

use super::film::FilmJob;
use super::job::Job;
use super::pictures::{FrameReport, FrameTally, QueuedPicture, Writer};
use super::placement::{MIN_POINTS, SharedPlacement};
use super::report::MemoryReport;
use super::{camera, schedule};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::input::Playing;
use crate::interrupt::Interrupt;
use crate::progress::{Bar, Notes};

/// Time to listen to one stream before the next.
const STREAM_TIMEOUT: Duration = Duration::from_millis(20);

/// Renders updates until the streams end, the requested number of pictures is reached, or Ctrl-C is pressed.
pub(super) fn run(
    job: &mut Job,
    film: &FilmJob,
    playing: Vec<Playing>,
    renderer: &mut Renderer,
    device: &Device,
) -> Result<(), Failure> {
    if film.resume {
        let name = job.inputs.names();
        return Err(Failure::usage(format!("--resume: {name} is live, and its earlier frames do not come again")));
    }
    let bar = Bar::spinner("rendering live input", &job.console);
    let notes = Notes::new(&bar, &job.inputs.names());
    let interrupt = job.console.interrupt().clone();
    let mut streams = Streams::new(playing, &bar, interrupt.clone())?;
    // Pictures rendered so far are kept, also as a film.
    interrupt.end_gently();
    let rate = film.fps.unwrap_or(schedule::DEFAULT_FPS);
    // A pipe's frames come as fast as they are read, so arrival times may be meaningless.
    let evenly = film.fps.is_some() && job.inputs.come_by_pipe() && !film.watch;
    let begun = Instant::now();
    let mut tally = FrameTally::default();
    let mut place = SharedPlacement::default();
    let (mut first_frame, mut frame): (Option<First>, usize) = (None, 0);
    // Frames are counted from the first with points.
    let (mut has_begun, mut without_points) = (false, 0);
    let writer = Writer::start(job, film, rate);
    let is_film = matches!(film.target, Target::Film(_));
    // The film shows the last picture until the next one comes, at a time that is still unknown.
    let mut shown: Option<QueuedPicture> = None;
    let mut render_all = || {
        while !interrupt.ending() && film.frames.last.is_none_or(|last| frame <= last) {
            let waited = Instant::now();
            let Some(cloud) = streams.next(&mut place)? else { break };
            let placeable = first_frame.is_some() || cloud.has_finite(MIN_POINTS);
            has_begun |= placeable;
            if !has_begun {
                without_points += 1;
                continue;
            }
            if frame < film.frames.first || !placeable {
                // The frame is not requested, or there is nothing to place a camera for.
                frame += 1;
                continue;
            }
            let read_ms = super::milliseconds_since(waited);
            let first = match &first_frame {
                Some(first) => first,
                None => {
                    let camera = place.settle(job, renderer, &cloud, Arc::clone(&cloud))?;
                    if let Some(path) = &job.save_camera {
                        camera::save(path, &camera, &job.read_files, &job.console)?;
                    }
                    first_frame.insert(First { frame, came: Instant::now(), camera, rate: evenly.then_some(rate) })
                }
            };
            let seconds = first.seconds_until(frame);
            job.fewer_neighbors(&cloud).iter().for_each(|note| notes.tell(note));
            let rendered = job.render(renderer, &place.upright(cloud), &first.camera)?;
            tally.count(frame, &rendered);
            let (counts, timings_ms) = (rendered.counts, rendered.timings);
            let path = film.file(frame);
            let memory = MemoryReport::now();
            let report =
                FrameReport { frame, seconds, path, pictures: None, counts, tree: None, memory, read_ms, timings_ms };
            let mut shot = Some(QueuedPicture { image: writer.picture(job, &rendered), report });
            if is_film {
                std::mem::swap(&mut shot, &mut shown);
            }
            if let Some(shot) = shot
                && !hand_over(shot, is_film.then_some(seconds), rate, &mut tally, &writer)
            {
                // The writer has failed and reports why.
                return Ok(());
            }
            frame += 1;
        }
        Ok(())
    };
    let rendered = render_all();
    if let (Some(shot), Some(first)) = (shown.take(), &first_frame) {
        hand_over(shot, Some(first.seconds_until(frame)), rate, &mut tally, &writer);
    }
    // A later failure keeps the pictures written so far.
    let written = writer.finish(tally.written > 0);
    rendered.and(written)?;
    let Statistics { dropped, refused, last_refusal, waiting, .. } = streams.statistics();
    drop(streams);
    drop(notes);
    drop(bar);
    if tally.written == 0 {
        if interrupt.ending() {
            return Err(Failure::interrupted());
        }
        let why = waiting.or(last_refusal).map_or_else(String::new, |why| format!(": {why}"));
        return Err(Failure::new(Exit::Input, format!("{}: no points arrived{why}", job.inputs.names())));
    }
    let of = |count: u64, what: &str| if count > 0 { format!(", {count} {what}") } else { String::new() };
    let more = of(dropped, "updates skipped for newer ones")
        + &of(refused, "refused")
        + &of(without_points, "without points came first");
    tally.summarize(film, &more, begun, device, &job.console);
    Ok(())
}

/// The first rendered frame.
struct First {
    frame: usize,
    came: Instant,
    camera: Camera,
    /// Frames per second of evenly spaced frames; `None` takes arrival times.
    rate: Option<f64>,
}

impl First {
    /// Seconds from the first frame to this one, which comes now.
    fn seconds_until(&self, frame: usize) -> f64 {
        match self.rate {
            Some(rate) => (frame - self.frame) as f64 / rate,
            None => self.came.elapsed().as_secs_f64(),
        }
    }
}

/// Hands a picture to the writer and returns whether it will be written. A film shows the picture until `until` seconds
/// after the first, at least once.
fn hand_over(mut shot: QueuedPicture, until: Option<f64>, rate: f64, tally: &mut FrameTally, writer: &Writer) -> bool {
    if let Some(until) = until {
        let pictures = ((until * rate).round() as usize).saturating_sub(tally.written).max(1);
        shot.report.pictures = Some(pictures);
    }
    tally.written += shot.report.pictures.unwrap_or(1);
    writer.put(shot)
}

/// Inputs of which some are live; the others are static.
struct Streams<'a> {
    inputs: Vec<Stream<'a>>,
    interrupt: Interrupt,
}

struct Stream<'a> {
    input: Playing,
    notes: Notes<'a>,
    /// Points currently shown.
    cloud: Option<Arc<PointCloud>>,
    ended: bool,
    /// Last stated reason why nothing comes.
    waiting: Option<String>,
}

impl<'a> Streams<'a> {
    fn new(playing: Vec<Playing>, bar: &'a Bar, interrupt: Interrupt) -> Result<Self, Failure> {
        let open = |mut input: Playing| {
            let notes = Notes::new(bar, &input.name);
            let (mut cloud, mut ended) = (None, false);
            if input.player.stream().timeline().is_some() {
                if input.moves {
                    let why = "has its own timeline and cannot be shown together with live input";
                    return Err(Failure::usage(format!("{} {why}", input.name)));
                }
                (cloud, ended) = (Some(input.player.frame(0, &notes)?), true);
            }
            Ok(Stream { input, notes, cloud, ended, waiting: None })
        };
        Ok(Self { inputs: playing.into_iter().map(open).collect::<Result<_, _>>()?, interrupt })
    }

    /// Waits for an update and returns all current points; `None` if all streams ended or Ctrl-C was pressed.
    fn next(&mut self, place: &mut SharedPlacement) -> Result<Option<Arc<PointCloud>>, Failure> {
        while !self.interrupt.ending() && self.inputs.iter().any(|stream| !stream.ended) {
            let mut news = false;
            for stream in self.inputs.iter_mut().filter(|stream| !stream.ended) {
                news |= stream.listen()?;
            }
            if news {
                let parts = self.inputs.iter();
                let parts = parts.filter_map(|own| Some((own.cloud.clone()?, own.input.world_from_input)));
                return Ok(Some(place.merge(parts.collect())));
            }
        }
        Ok(None)
    }

    /// Sum over all streams.
    fn statistics(&self) -> Statistics {
        self.inputs.iter().map(|stream| stream.player().stream().statistics()).fold(
            Statistics::default(),
            |sum, own| Statistics {
                dropped: sum.dropped + own.dropped,
                refused: sum.refused + own.refused,
                last_refusal: own.last_refusal.or(sum.last_refusal),
                waiting: sum.waiting.or(own.waiting),
                ..sum
            },
        )
    }
}

impl Stream<'_> {
    fn player(&self) -> &Player {
        &self.input.player
    }

    /// Takes a new update and returns whether there was one.
    fn listen(&mut self) -> Result<bool, Failure> {
        match self.input.player.next(STREAM_TIMEOUT, &self.notes) {
            Ok(Some(cloud)) => {
                self.cloud = Some(cloud);
                return Ok(true);
            }
            Ok(None) => {}
            // This error means that no further frames will come.
            Err(Error::NoFrames { .. }) => self.ended = true,
            Err(error) => return Err(error.into()),
        }
        let waiting = self.player().stream().statistics().waiting;
        if waiting != self.waiting {
            if let Some(why) = &waiting {
                self.notes.tell(why);
            }
            self.waiting = waiting;
        }
        Ok(false)
    }
}

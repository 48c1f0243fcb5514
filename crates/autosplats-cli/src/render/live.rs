//! A picture for each update of what is live, as it comes, until it ends.

use std::sync::Arc;
use std::time::{Duration, Instant};

use autosplats::{Camera, Renderer};
use autosplats_cloud::{Error, Player, PointCloud, Statistics};
use autosplats_film::Target;

use super::film::{FilmJob, Tally, picture};
use super::job::Job;
use super::moving::Place;
use super::pictures::{FrameReport, Shot, Writer};
use super::{camera, schedule};
use crate::device::Device;
use crate::exit::{Exit, Failure};
use crate::input::{Playing, read_failure};
use crate::interrupt;
use crate::output::check_target;
use crate::progress::{Bar, Notes};

/// How long one of the streams is listened to before the next one is.
const TURN: Duration = Duration::from_millis(20);

/// Renders what comes until the streams have ended, there are as many pictures as are wanted, or Ctrl-C is pressed.
pub(super) fn run(
    job: &mut Job,
    film: &FilmJob,
    playing: Vec<Playing>,
    renderer: &mut Renderer,
    device: &Device,
) -> Result<(), Failure> {
    if film.resume {
        let name = job.inputs.names();
        return Err(Failure::usage(format!("--resume: {name} is live, so that no picture of it can be made again")));
    }
    let bar = Bar::spinner("rendering what comes", job.quiet);
    let mut streams = Streams::new(playing, &bar)?;
    // What is there by then is kept, a film as well.
    interrupt::end_gently();
    let rate = film.fps.unwrap_or(schedule::USUAL_RATE);
    // A pipe gives its frames as fast as they are taken, so that times of arrival may say nothing.
    let evenly = film.fps.is_some() && job.inputs.come_by_pipe() && !film.watch;
    let begun = Instant::now();
    let mut tally = Tally::default();
    let mut place = Place::default();
    let (mut first_frame, mut frame): (Option<First>, usize) = (None, 0);
    let writer = Writer::start(film.style(job, rate));
    let is_film = matches!(film.target, Target::Film(_));
    // The last picture of a film is shown until the next one comes, and nobody knows yet when that will be.
    let mut shown: Option<Shot> = None;
    let mut render_all = || {
        while !interrupt::ending() && film.frames.last.is_none_or(|last| frame <= last) {
            let waited = Instant::now();
            let Some(cloud) = streams.next(&mut place)? else { break };
            if cloud.len() < 2 && first_frame.is_none() || frame < film.frames.first {
                // Nothing to place a camera before, or not asked for.
                frame += usize::from(frame < film.frames.first && !cloud.is_empty());
                continue;
            }
            let read_ms = super::milliseconds_since(waited);
            let first = match &first_frame {
                Some(first) => first,
                None => {
                    let camera = place.settle(job, renderer, &cloud, Arc::clone(&cloud))?;
                    if let Some(path) = &job.save_camera {
                        check_target(path, &job.read_files)?;
                        camera::save(path, &camera)?;
                    }
                    first_frame.insert(First { frame, came: Instant::now(), camera, rate: evenly.then_some(rate) })
                }
            };
            let seconds = first.seconds_until(frame);
            let rendered = job.render(renderer, &place.upright(cloud), &first.camera)?;
            tally.count(frame, &rendered);
            let (counts, timings_ms) = (rendered.counts, rendered.timings);
            let path = film.file(frame);
            let report = FrameReport { frame, seconds, path, pictures: None, counts, read_ms, timings_ms };
            let mut shot = Some(Shot { image: picture(job, &rendered, &writer), report });
            if is_film {
                std::mem::swap(&mut shot, &mut shown);
            }
            if let Some(shot) = shot
                && !hand_over(shot, is_film.then_some(seconds), rate, &mut tally, &writer)
            {
                // The writer has given up and says why.
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
    // What cannot be shown of what comes later takes nothing from what was.
    let written = writer.finish(tally.written > 0);
    rendered.and(written)?;
    let Statistics { dropped, refused, last_refusal, waiting, .. } = streams.statistics();
    drop(streams);
    drop(bar);
    if tally.written == 0 {
        if interrupt::ending() {
            return Err(Failure::interrupted());
        }
        let why = waiting.or(last_refusal).map_or_else(String::new, |why| format!(": {why}"));
        return Err(Failure::new(Exit::Input, format!("{}: nothing came that has points{why}", job.inputs.names())));
    }
    if !job.quiet {
        let of = |count: u64, what: &str| if count > 0 { format!(", {count} {what}") } else { String::new() };
        let more = of(dropped, "updates dropped for newer ones") + &of(refused, "refused");
        tally.summarize(film, &more, begun, device);
    }
    Ok(())
}

/// The first frame that is rendered.
struct First {
    frame: usize,
    came: Instant,
    camera: Camera,
    /// Of frames that are evenly apart, by their number.
    rate: Option<f64>,
}

impl First {
    /// From the first frame to one that comes now.
    fn seconds_until(&self, frame: usize) -> f64 {
        match self.rate {
            Some(rate) => (frame - self.frame) as f64 / rate,
            None => self.came.elapsed().as_secs_f64(),
        }
    }
}

/// Has a picture written; a film shows it until so many seconds after its first one, and once at least. Says whether it will be
/// written.
fn hand_over(mut shot: Shot, until: Option<f64>, rate: f64, tally: &mut Tally, writer: &Writer) -> bool {
    if let Some(until) = until {
        let pictures = ((until * rate).round() as usize).saturating_sub(tally.written).max(1);
        shot.report.pictures = Some(pictures);
    }
    tally.written += shot.report.pictures.unwrap_or(1);
    writer.put(shot)
}

/// Inputs some of which are live; the others stand still.
struct Streams<'a> {
    inputs: Vec<Stream<'a>>,
}

struct Stream<'a> {
    input: Playing,
    notes: Notes<'a>,
    /// What it shows now.
    cloud: Option<Arc<PointCloud>>,
    ended: bool,
    /// What it said last of why nothing comes.
    waiting: Option<String>,
}

impl<'a> Streams<'a> {
    fn new(playing: Vec<Playing>, bar: &'a Bar) -> Result<Self, Failure> {
        let open = |mut input: Playing| {
            let notes = Notes::new(bar, &input.name);
            let (mut cloud, mut ended) = (None, false);
            if input.player.stream().timeline().is_some() {
                if input.moves {
                    let why = "plays by a timeline of its own, which cannot be shown beside what is live";
                    return Err(Failure::usage(format!("{} {why}", input.name)));
                }
                (cloud, ended) = (Some(input.player.frame(0, &notes).map_err(read_failure)?), true);
            }
            Ok(Stream { input, notes, cloud, ended, waiting: None })
        };
        Ok(Self { inputs: playing.into_iter().map(open).collect::<Result<_, _>>()? })
    }

    /// What is seen once something has come; `None` when all have ended or Ctrl-C was pressed.
    fn next(&mut self, place: &mut Place) -> Result<Option<Arc<PointCloud>>, Failure> {
        while !interrupt::ending() && self.inputs.iter().any(|stream| !stream.ended) {
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

    /// Of all of them together.
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

    /// Takes what has come; says whether anything has.
    fn listen(&mut self) -> Result<bool, Failure> {
        match self.input.player.next(TURN, &self.notes) {
            Ok(Some(cloud)) => {
                self.cloud = Some(cloud);
                return Ok(true);
            }
            Ok(None) => {}
            // That is how it says that there will be no more.
            Err(Error::NoFrames { .. }) => self.ended = true,
            Err(error) => return Err(read_failure(error)),
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

//! The compute form of splat communication: buffers and steps.

use super::gpu::{self as shared, CONSTANTS, ITERATIONS, Progress, ProgressPasses};
use crate::Error;
use crate::gpu::{Gpu, LARGE_GROUP, Library, Pass, Step, files, passes};
use crate::project::gpu::{Counter, Round};
use crate::search::engine::{EnginePasses, EngineSteps, IMPORTS, SearchBuffers};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[IMPORTS, shared::IMPORTS, files!["pixel_words", "point_search", "points_in_box", "shared_boxes", "told"]],
    constants: &[Counter::CONSTANTS, CONSTANTS],
};

passes! {
    "search/splat_communication", LIBRARY;
    CLEAR = "compute/clear",
    PLACE = "compute/place",
    ASK = "compute/ask",
    DISTRIBUTE = "compute/distribute",
    GATHER = "compute/gather",
    COUNT = "compute/count",
    SUM = "compute/sum",
}

/// `PointSearch` of `imports/point_search.wgsl`.
type PointSearch = [u32; 4];
/// `Told` of `imports/told.wgsl`.
type Told = [u32; 6];

/// Structs of WGSL with their sizes here.
#[cfg(test)]
pub(crate) const SIZES: &[(&str, usize)] = &[("PointSearch", size_of::<PointSearch>()), ("Told", size_of::<Told>())];

/// The compiled passes.
#[derive(Debug)]
pub(crate) struct CommunicationPasses {
    clear: Pass,
    place: Pass,
    gather: Pass,
    progress: ProgressPasses,
    ask: Pass,
    distribute: Pass,
    count: Pass,
    sum: Pass,
}

impl CommunicationPasses {
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu) -> Result<Self, Error> {
        let pass = |source| Pass::new(gpu, source, &[]);
        Ok(Self {
            clear: pass(&CLEAR)?,
            place: pass(&PLACE)?,
            gather: pass(&GATHER)?,
            progress: ProgressPasses::new(gpu)?,
            ask: pass(&ASK)?,
            distribute: pass(&DISTRIBUTE)?,
            count: pass(&COUNT)?,
            sum: pass(&SUM)?,
        })
    }
}

/// Words of the bits of pixels and of those of their words, as in `imports/pixel_words.wgsl`.
fn bit_words([width, height]: [u32; 2]) -> u32 {
    let words = width.div_ceil(32);
    height * (words + words.div_ceil(32))
}

impl EnginePasses for CommunicationPasses {
    fn steps(&self, gpu: &Gpu, buffers: SearchBuffers<'_>) -> Result<EngineSteps, Error> {
        let SearchBuffers { frame, screen, neighborhoods, .. } = buffers;
        let bit_words = bit_words(screen.size);
        let [width, height] = screen.size.map(|side| side as usize);
        let pixels = &gpu.storage::<u32>("points of pixels", width * height + bit_words as usize)?;
        let searches = &gpu.storage::<PointSearch>("searches of points", screen.capacity as usize)?;
        let told = &gpu.storage::<Told>("messages to points", screen.capacity as usize)?;
        let progress = Progress::new(gpu)?;
        let (points, queries, counters) = (&screen.points, &screen.queries, &screen.counters);

        let clear = self.clear.step(gpu, &[frame, pixels], bit_words.div_ceil(LARGE_GROUP));
        let place = [frame, points, &screen.density, counters, pixels, searches, told];
        let place = self.place.step(gpu, &place, progress.points_groups());
        let gather = [frame, points, pixels, counters, searches, told];
        let gather = self.gather.step(gpu, &gather, progress.points_groups());
        let steps = |round: Round| -> Vec<Step> {
            let mut steps = vec![self.progress.begin(gpu, buffers, &progress)];
            if round == Round::Active {
                // Both rounds share the points.
                steps.push(clear.clone());
            }
            steps.push(place.clone());
            let ask = [frame, queries, counters, searches];
            steps.push(self.ask.step(gpu, &ask, progress.queries_groups()));
            let distribute = [frame, points, pixels, queries, counters, searches, told];
            let count = [frame, queries, counters, &progress.arguments, &progress.convergence, searches, told];
            let iteration = [
                self.distribute.step(gpu, &distribute, progress.queries_groups()),
                gather.clone(),
                self.count.step(gpu, &count, progress.queries_groups()),
                self.progress.decide(gpu, buffers, &progress),
            ];
            for _ in 0..ITERATIONS {
                steps.extend(iteration.iter().cloned());
            }
            let sum = [frame, points, pixels, queries, counters, neighborhoods, searches, told];
            steps.push(self.sum.step(gpu, &sum, screen.groups(round.work_256())));
            steps
        };
        let rounds = [Round::Active, Round::Recovered].map(steps);
        Ok(EngineSteps { rounds, convergence: Some(progress.convergence) })
    }
}

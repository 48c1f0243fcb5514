//! Records the steps of a frame and times them.
//!
//! # How it works
//! Consecutive compute steps share a compute pass of wgpu, which makes command buffers and a barrier of every pass.
//! What draws or copies ends the pass. Timed is each run of steps of a stage, or each step where a caller asks for it.
//! See docs/decisions/0052-one-compute-pass.md.

use std::time::Instant;

use super::Gpu;
use super::buffers::map;
use super::link::GROUPS_PER_ROW;
use super::step::{Groups, Step, StepWork};
use crate::Error;

/// Bytes of the arguments of an indirect dispatch: `Dispatch` of `shared/put_work.wgsl`.
pub(crate) const DISPATCH_BYTES: u64 = size_of::<wgpu::util::DispatchIndirectArgs>() as u64;

/// Most times of a frame.
const MOST_TIMES: u32 = 512;

/// The time that successive passes of a stage took, or one pass where passes are timed one by one.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// The stage, `project`, or stage and pass, `project/compact`.
    pub pass: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// How a frame is timed.
#[derive(Debug)]
pub(crate) enum Clock {
    /// No timing.
    Off,
    /// By timestamps of the device.
    Timestamps {
        queries: wgpu::QuerySet,
        resolved: wgpu::Buffer,
        mapped: wgpu::Buffer,
        /// Whether timestamps can be written inside a pass. Otherwise the pass ends with what is timed.
        inside: bool,
    },
    /// What is timed is submitted and waited for. Timestamps of software devices are unreliable.
    Wall,
}

/// Commands of one frame.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    gpu: &'a Gpu,
    encoder: wgpu::CommandEncoder,
    /// The open compute pass, if there is one.
    pass: Option<wgpu::ComputePass<'static>>,
    clock: &'a Clock,
    /// Whether each step is timed by itself.
    each_step: bool,
    /// Whether others have turns on the device after each stage.
    takes_turns: bool,
    /// What is being timed.
    timed: Option<&'static str>,
    times: Vec<PassTime>,
    /// Number of compute passes begun.
    #[cfg(test)]
    pub(crate) begun: usize,
    /// Number of submissions before the last.
    #[cfg(test)]
    submitted: usize,
}

impl Clock {
    /// The clock that suits a device.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        if gpu.is_software() { Self::Wall } else { Self::timestamps(gpu).unwrap_or(Self::Off) }
    }

    /// Timestamps, if the device has them.
    fn timestamps(gpu: &Gpu) -> Option<Self> {
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let buffer = |label, usage| {
            let size = u64::from(2 * MOST_TIMES) * 8;
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Some(Self::Timestamps {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("autosplats.timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST_TIMES,
            }),
            resolved: buffer("autosplats.timestamps", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            mapped: buffer("autosplats.timestamps.mapped", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            inside: gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES),
        })
    }
}

impl Clock {
    /// Waits for a submitted frame and fills in its times. Returns begin and end of all that was timed, in
    /// milliseconds from the start of the first.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub(crate) fn read(&self, gpu: &Gpu, times: &mut [PassTime]) -> Result<Vec<[f64; 2]>, Error> {
        let timed = times.len().min(MOST_TIMES as usize);
        let Self::Timestamps { mapped, .. } = self else {
            // They ran one after the other.
            let one = |end: &mut f64, time: &PassTime| {
                let begin = *end;
                *end += time.ms;
                Some([begin, *end])
            };
            return Ok(times.iter().scan(0.0, one).collect());
        };
        if timed == 0 {
            return Ok(Vec::new());
        }
        let period_ms = f64::from(gpu.queue.get_timestamp_period()) * 1e-6;
        map(gpu, mapped, 16 * timed as u64, |bytes| {
            let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(bytes);
            let ms = |from: u64, to: u64| to.saturating_sub(from) as f64 * period_ms;
            for (time, ticks) in times.iter_mut().zip(ticks.chunks_exact(2)) {
                time.ms = ms(ticks[0], ticks[1]);
            }
            ticks.chunks_exact(2).map(|of_pass| [ms(ticks[0], of_pass[0]), ms(ticks[0], of_pass[1])]).collect()
        })
    }
}

/// Milliseconds that a stage took: for each run of its passes, from begin to end. Where passes are timed one by one,
/// gaps count, or a stage of many short passes would seem faster than it is.
pub(crate) fn stage_ms(stage: &str, times: &[PassTime], spans: &[[f64; 2]]) -> f64 {
    let stage_of = |time: &PassTime| time.pass.split('/').next();
    let passes: Vec<_> = times.iter().map(stage_of).zip(spans).collect();
    let runs = passes.chunk_by(|(before, _), (after, _)| before == after).filter(|run| run[0].0 == Some(stage));
    // `sum` of nothing would be -0.
    runs.fold(0.0, |ms, run| ms + run[run.len() - 1].1[1] - run[0].1[0])
}

impl<'a> Recorder<'a> {
    /// A recorder that times the runs of steps of each stage.
    pub(crate) fn new(gpu: &'a Gpu, clock: &'a Clock) -> Self {
        Self {
            gpu,
            encoder: encoder(gpu),
            pass: None,
            clock,
            each_step: false,
            takes_turns: false,
            timed: None,
            times: Vec::new(),
            #[cfg(test)]
            begun: 0,
            #[cfg(test)]
            submitted: 0,
        }
    }

    /// Times each step by itself if `each`, in a compute pass of its own.
    pub(crate) fn timing_each(self, each: bool) -> Self {
        Self { each_step: each, ..self }
    }

    /// Submits each stage by itself and waits for it, if `takes_turns`. What others submit runs between the stages.
    pub(crate) fn taking_turns(self, takes_turns: bool) -> Self {
        Self { takes_turns, ..self }
    }

    /// The encoder, for commands other than steps.
    pub(crate) fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.end();
        self.pass = None;
        &mut self.encoder
    }

    /// Runs a step.
    pub(crate) fn run(&mut self, step: &Step) {
        match &step.work {
            StepWork::Compute { groups: Groups::Number(0), .. } => {}
            StepWork::Compute { pipeline, bindings, groups } => {
                let name = if self.each_step { step.path } else { step.stage() };
                if self.each_step || self.timed != Some(name) {
                    self.begin(name);
                }
                let pass = self.compute_pass();
                pass.push_debug_group(&step.label);
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, bindings, &[]);
                match groups {
                    Groups::Number(groups) => {
                        pass.dispatch_workgroups(*groups.min(&GROUPS_PER_ROW), groups.div_ceil(GROUPS_PER_ROW), 1);
                    }
                    Groups::Counted(arguments, at) => pass.dispatch_workgroups_indirect(arguments, *at),
                }
                pass.pop_debug_group();
            }
            StepWork::Raster(raster) => {
                // A pass that draws is always timed by itself.
                self.encoder();
                self.add_time(step.path);
                let timestamp_writes = self.queries().map(|(query_set, at)| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: Some(at),
                    end_of_pass_write_index: Some(at + 1),
                });
                raster.record(&mut self.encoder, Some(&step.label), timestamp_writes);
                self.submit_if_waiting();
            }
        }
    }

    /// Begins to time steps under a name, after the end of those before.
    fn begin(&mut self, name: &'static str) {
        self.end();
        self.timed = Some(name);
        self.add_time(name);
        if let (Clock::Timestamps { inside: true, .. }, Some((queries, at))) = (self.clock, self.queries()) {
            self.compute_pass().write_timestamp(queries, at);
        }
    }

    /// Ends what is being timed.
    fn end(&mut self) {
        if self.timed.take().is_none() {
            return;
        }
        match self.clock {
            Clock::Off => {}
            Clock::Timestamps { inside, .. } => {
                if let (true, Some((queries, at))) = (inside, self.queries()) {
                    self.compute_pass().write_timestamp(queries, at + 1);
                }
                if self.each_step || !inside {
                    self.pass = None;
                }
            }
            Clock::Wall => {}
        }
        self.submit_if_waiting();
    }

    fn add_time(&mut self, name: &'static str) {
        if !matches!(self.clock, Clock::Off) {
            self.times.push(PassTime { pass: name, ms: 0.0 });
        }
    }

    /// The queries for begin and end of what is being timed: the set, and the index of the first.
    fn queries(&self) -> Option<(&'a wgpu::QuerySet, u32)> {
        match self.clock {
            Clock::Timestamps { queries, .. } if self.times.len() <= MOST_TIMES as usize => {
                Some((queries, 2 * (self.times.len() as u32 - 1)))
            }
            _ => None,
        }
    }

    /// The open compute pass, or a new one.
    fn compute_pass(&mut self) -> &mut wgpu::ComputePass<'static> {
        let queries = if matches!(self.clock, Clock::Timestamps { inside: false, .. }) { self.queries() } else { None };
        self.pass.get_or_insert_with(|| {
            #[cfg(test)]
            {
                self.begun += 1;
            }
            let timestamp_writes = queries.map(|(query_set, at)| wgpu::ComputePassTimestampWrites {
                query_set,
                beginning_of_pass_write_index: Some(at),
                end_of_pass_write_index: Some(at + 1),
            });
            let descriptor = wgpu::ComputePassDescriptor { label: Some("autosplats.steps"), timestamp_writes };
            self.encoder.begin_compute_pass(&descriptor).forget_lifetime()
        })
    }

    /// If times are those of waiting, or others have turns, submits the recorded commands and waits for them.
    fn submit_if_waiting(&mut self) {
        let is_timed = matches!(self.clock, Clock::Wall);
        if !(is_timed || self.takes_turns) {
            return;
        }
        self.pass = None;
        let commands = std::mem::replace(&mut self.encoder, encoder(self.gpu)).finish();
        let start = Instant::now();
        // Not for what others submit.
        let submission_index = Some(self.gpu.queue.submit([commands]));
        // A lost device is noticed at the end of the frame.
        let _ = self.gpu.device.poll(wgpu::PollType::Wait { submission_index, timeout: None });
        if let Some(time) = self.times.last_mut().filter(|_| is_timed) {
            time.ms = start.elapsed().as_secs_f64() * 1e3;
        }
        #[cfg(test)]
        {
            self.submitted += 1;
        }
    }

    /// Submits the rest of the frame. [`Clock::read`] completes the times once the device is done.
    pub(crate) fn finish(mut self) -> Vec<PassTime> {
        self.encoder();
        if let Clock::Timestamps { queries, resolved, mapped, .. } = self.clock {
            let count = (2 * self.times.len() as u32).min(2 * MOST_TIMES);
            self.encoder.resolve_query_set(queries, 0..count, resolved, 0);
            self.encoder.copy_buffer_to_buffer(resolved, 0, mapped, 0, u64::from(count) * 8);
        }
        self.gpu.queue.submit([self.encoder.finish()]);
        self.times
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("autosplats.frame") })
}

#[cfg(test)]
mod tests {
    use super::super::{Library, Pass, PassSource, read_back, test_gpu};
    use super::*;

    #[test]
    fn a_stages_time_has_the_gaps_between_its_passes() {
        let times = ["search/a", "search/b", "fit/fit", "search/a", "search/b"].map(|pass| PassTime { pass, ms: 1.0 });
        let spans = [[0.0, 1.0], [1.5, 2.5], [4.0, 5.0], [7.0, 8.0], [8.25, 9.25]];
        assert_eq!(stage_ms("search", &times, &spans), 2.5 + 2.25, "but not what lies between its runs");
        assert_eq!(stage_ms("fit", &times, &spans), 1.0);
        assert_eq!(stage_ms("splat", &times, &spans), 0.0, "there is none");
        assert_eq!(stage_ms("search", &times, &spans[..1]), 1.0, "those beyond the last span were not timed");
    }

    #[test]
    fn runs_of_a_stage_share_a_pass_and_a_time_unless_each_step_is_timed() {
        const LIBRARY: Library = Library { files: &[], constants: &[] };
        const CODE: &str = "@group(0) @binding(0) var<storage, read_write> x: array<u32>;\n\
                            @compute @workgroup_size(1) fn count() { x[0] += 1u; }";
        let Some(gpu) = test_gpu() else { return };
        let buffer = gpu.storage::<u32>("x", 1).expect("room");
        let paths = ["search/count", "search/count", "fit/count", "search/count"];
        let steps = paths.map(|path| {
            let source = PassSource { path, source: CODE, needs: wgpu::Features::empty(), library: &LIBRARY };
            Pass::new(&gpu, &source, &[]).expect("a pass").step(&gpu, &[&buffer], 1)
        });
        let mut clocks = vec![(Clock::Off, 1), (Clock::Wall, 3)];
        for wanted in [false, true] {
            let Some(mut clock) = Clock::timestamps(&gpu) else { continue };
            let Clock::Timestamps { inside, .. } = &mut clock else { panic!("another clock") };
            *inside &= wanted;
            let passes = if *inside { 1 } else { 3 };
            clocks.push((clock, passes));
        }
        let mut runs = 0;
        for (clock, passes) in &clocks {
            for (each, turns) in [(false, false), (true, false), (false, true), (true, true)] {
                let record = || {
                    let mut recorder = Recorder::new(&gpu, clock).timing_each(each).taking_turns(turns);
                    steps.iter().for_each(|step| recorder.run(step));
                    let begun = recorder.begun;
                    recorder.encoder();
                    let runs = if each { 4 } else { 3 };
                    let waits = turns || matches!(clock, Clock::Wall);
                    assert_eq!(recorder.submitted, if waits { runs } else { 0 }, "submissions with {clock:?}");
                    let mut times = recorder.finish();
                    let spans = clock.read(&gpu, &mut times);
                    (begun, times, spans)
                };
                let (begun, times, spans) = gpu.checked(record).expect("valid commands");
                let is_off = matches!(clock, Clock::Off);
                let passes = match (each, turns, is_off) {
                    (true, false, true) => 1,
                    (true, ..) => 4,
                    (false, true, _) => 3,
                    (false, false, _) => *passes,
                };
                assert_eq!(begun, passes, "passes with {clock:?}");
                let names: Vec<_> = times.iter().map(|time| time.pass).collect();
                let runs_of_stages = ["search", "fit", "search"];
                let expected = if each { &paths[..] } else { &runs_of_stages };
                assert_eq!(names, if is_off { &[] } else { expected }, "times with {clock:?}");
                assert_eq!(spans.expect("times").len(), names.len(), "each begins and ends");
                runs += 1;
                let ran: Vec<u32> = read_back(&gpu, &buffer, 1).expect("a count");
                assert_eq!(ran, [4 * runs], "every step runs once with {clock:?}");
            }
        }
    }
}

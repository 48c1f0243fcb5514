//! Records the passes of a frame, each labelled and timed.

use std::time::Instant;

use super::Gpu;
use super::buffers::map;
use super::link::GROUPS_PER_ROW;
use super::step::{Groups, Step, StepWork};
use crate::Error;

/// Bytes of the arguments of an indirect dispatch: `Dispatch` of `shared/put_work.wgsl`.
pub(crate) const DISPATCH_BYTES: u64 = size_of::<wgpu::util::DispatchIndirectArgs>() as u64;

/// Most passes of a frame that can be timed.
const MOST_PASSES: u32 = 512;

/// The time that one pass took.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PassTime {
    /// Stage and pass: `project/compact`.
    pub pass: &'static str,
    /// Milliseconds.
    pub ms: f64,
}

/// How passes are timed.
#[derive(Debug)]
pub(crate) enum Clock {
    /// No timing.
    Off,
    /// By timestamps of the device.
    Timestamps { queries: wgpu::QuerySet, resolved: wgpu::Buffer, mapped: wgpu::Buffer },
    /// Each pass is submitted and waited for. Timestamps of software devices are unreliable.
    Wall,
}

/// Commands of one frame.
#[derive(Debug)]
pub(crate) struct Recorder<'a> {
    pub(crate) gpu: &'a Gpu,
    pub(crate) encoder: wgpu::CommandEncoder,
    clock: &'a Clock,
    times: Vec<PassTime>,
    /// Number of compute passes begun.
    #[cfg(test)]
    pub(crate) begun: usize,
}

impl Clock {
    /// The clock that suits a device.
    pub(crate) fn new(gpu: &Gpu) -> Self {
        if gpu.is_software() {
            return Self::Wall;
        }
        if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Self::Off;
        }
        let buffer = |label, usage| {
            let size = u64::from(2 * MOST_PASSES) * 8;
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        Self::Timestamps {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("autosplats.timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * MOST_PASSES,
            }),
            resolved: buffer("autosplats.timestamps", wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            mapped: buffer("autosplats.timestamps.mapped", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
        }
    }
}

impl Clock {
    /// Waits for a submitted frame and fills in its times. Returns begin and end of each timed pass, in milliseconds
    /// from the start of the first.
    ///
    /// # Errors
    /// [`Error::DeviceLost`].
    pub(crate) fn read(&self, gpu: &Gpu, times: &mut [PassTime]) -> Result<Vec<[f64; 2]>, Error> {
        let timed = times.len().min(MOST_PASSES as usize);
        let Self::Timestamps { mapped, .. } = self else {
            // Passes ran one after the other.
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

/// Milliseconds that a stage took: for each run of its passes, from begin to end. Gaps count, or a stage of many short
/// passes would seem faster than it is.
pub(crate) fn stage_ms(stage: &str, times: &[PassTime], spans: &[[f64; 2]]) -> f64 {
    let stage_of = |time: &PassTime| time.pass.split('/').next();
    let passes: Vec<_> = times.iter().map(stage_of).zip(spans).collect();
    let runs = passes.chunk_by(|(before, _), (after, _)| before == after).filter(|run| run[0].0 == Some(stage));
    // `sum` of nothing would be -0.
    runs.fold(0.0, |ms, run| ms + run[run.len() - 1].1[1] - run[0].1[0])
}

impl<'a> Recorder<'a> {
    pub(crate) fn new(gpu: &'a Gpu, clock: &'a Clock) -> Self {
        Self {
            gpu,
            encoder: encoder(gpu),
            clock,
            times: Vec::new(),
            #[cfg(test)]
            begun: 0,
        }
    }

    /// Runs a step.
    pub(crate) fn run(&mut self, step: &Step) {
        if matches!(step.work, StepWork::Compute { groups: Groups::Number(0), .. }) {
            return;
        }
        let at = 2 * self.times.len() as u32;
        let timestamps = match self.clock {
            Clock::Timestamps { queries, .. } if at < 2 * MOST_PASSES => Some((queries, Some(at), Some(at + 1))),
            _ => None,
        };
        let label = Some(step.label.as_str());
        match &step.work {
            StepWork::Compute { pipeline, bindings, groups } => {
                let timestamp_writes = timestamps.map(|(query_set, begin, end)| wgpu::ComputePassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: begin,
                    end_of_pass_write_index: end,
                });
                let descriptor = wgpu::ComputePassDescriptor { label, timestamp_writes };
                #[cfg(test)]
                {
                    self.begun += 1;
                }
                let mut compute = self.encoder.begin_compute_pass(&descriptor);
                compute.set_pipeline(pipeline);
                compute.set_bind_group(0, bindings, &[]);
                match groups {
                    Groups::Number(groups) => {
                        compute.dispatch_workgroups(*groups.min(&GROUPS_PER_ROW), groups.div_ceil(GROUPS_PER_ROW), 1);
                    }
                    Groups::Counted(arguments, at) => compute.dispatch_workgroups_indirect(arguments, *at),
                }
            }
            StepWork::Raster(raster) => {
                let timestamp_writes = timestamps.map(|(query_set, begin, end)| wgpu::RenderPassTimestampWrites {
                    query_set,
                    beginning_of_pass_write_index: begin,
                    end_of_pass_write_index: end,
                });
                raster.record(&mut self.encoder, label, timestamp_writes);
            }
        }
        if matches!(self.clock, Clock::Off) {
            return;
        }
        let ms = if matches!(self.clock, Clock::Wall) { self.submit() } else { 0.0 };
        self.times.push(PassTime { pass: step.path, ms });
    }

    /// Submits the recorded commands and waits. Returns the milliseconds that they took.
    fn submit(&mut self) -> f64 {
        let commands = std::mem::replace(&mut self.encoder, encoder(self.gpu)).finish();
        let start = Instant::now();
        self.gpu.queue.submit([commands]);
        // A lost device is noticed at the end of the frame.
        let _ = self.gpu.device.poll(wgpu::PollType::wait_indefinitely());
        start.elapsed().as_secs_f64() * 1e3
    }

    /// Submits the rest of the frame. [`Clock::read`] completes the times once the device is done.
    pub(crate) fn finish(mut self) -> Vec<PassTime> {
        if let Clock::Timestamps { queries, resolved, mapped } = self.clock {
            let count = (2 * self.times.len() as u32).min(2 * MOST_PASSES);
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
    use super::{PassTime, stage_ms};

    #[test]
    fn a_stages_time_has_the_gaps_between_its_passes() {
        let times = ["search/a", "search/b", "fit/fit", "search/a", "search/b"].map(|pass| PassTime { pass, ms: 1.0 });
        let spans = [[0.0, 1.0], [1.5, 2.5], [4.0, 5.0], [7.0, 8.0], [8.25, 9.25]];
        assert_eq!(stage_ms("search", &times, &spans), 2.5 + 2.25, "but not what lies between its runs");
        assert_eq!(stage_ms("fit", &times, &spans), 1.0);
        assert_eq!(stage_ms("splat", &times, &spans), 0.0, "there is none");
        assert_eq!(stage_ms("search", &times, &spans[..1]), 1.0, "those beyond the last span were not timed");
    }
}

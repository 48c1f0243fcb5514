//! The screen-grid search on the GPU: an invocation per point, or per four points for larger k. Points whose search
//! reads much are left to workgroups.

use std::iter::once;

use super::cpu;
use crate::Error;
use crate::gpu::{Gpu, Library, Pass, Step, constants, files, passes};
use crate::project::gpu::{Counter, Round, ScreenBuffers, WorkPass};
use crate::search::engine::IMPORTS;
use crate::search::{self, past};

/// Imports and constants of the passes.
const LIBRARY: Library = Library {
    files: &[IMPORTS, files!["find", "nearest", "past", "search_task", "window_points"]],
    constants: &[
        Counter::CONSTANTS,
        constants!(in cpu: FIRST_WINDOW_SLACK, MIN_RADIUS_GROWTH),
        constants!(in past: PAST_FIRST_RADII_RANGE, PAST_RADIUS_SLACK),
        constants!(in search: BOUND_STEP, MARGIN_PX, MAX_CANDIDATES, MIN_CROWDED_CANDIDATES, OUTLIER_RADIUS_SLACK),
        constants![TOGETHER_GROUPS],
    ],
};

passes! {
    "search/screen_grid", LIBRARY;
    SEARCH = "search",
    SEARCH_FOUR = "search_four",
    SEARCH_TOGETHER = "search_together",
}

/// Least k for which four points are searched at a time. See docs/decisions/0015-search-engines.md.
const MIN_K_FOUR_AT_A_TIME: u32 = 11;

/// Workgroups that search together, a query at a time.
const TOGETHER_GROUPS: u32 = 1024;
/// Strips, and half the points, that an invocation reads for a query before it leaves the query to a workgroup.
const ROUNDS_ALONE: u32 = 128;

/// How the queries are divided among invocations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    /// An invocation a query.
    One,
    /// An invocation a query, and a workgroup for each of those that read many points.
    OneOrMany,
    /// An invocation four queries, then one for each that is left.
    Four,
}

impl Form {
    /// Software gains nothing from more invocations.
    fn best(gpu: &Gpu, k: u32) -> Self {
        match k {
            MIN_K_FOUR_AT_A_TIME.. => Self::Four,
            _ if gpu.is_software() => Self::One,
            _ => Self::OneOrMany,
        }
    }
}

/// `Neighborhood` of `shared/neighborhood.wgsl`.
type Neighborhood = [f32; 12];

/// Structs of WGSL with their sizes here.
#[cfg(test)]
pub(crate) const SIZES: &[(&str, usize)] = &[("Neighborhood", size_of::<Neighborhood>())];

/// Allocates the neighbourhoods of `capacity` queries.
///
/// # Errors
/// [`Error::DeviceLimit`] or [`Error::DeviceMemory`] if the device has too little.
pub(crate) fn neighborhood_buffer(gpu: &Gpu, capacity: u32) -> Result<wgpu::Buffer, Error> {
    gpu.storage::<Neighborhood>("neighbourhoods", capacity as usize)
}

/// The passes of the search.
#[derive(Debug)]
pub(crate) struct SearchPasses {
    /// Searches four queries at a time, if k is large enough, and leaves some queries to `one`, whose workgroups are
    /// counted between.
    four: Option<(Pass, WorkPass)>,
    one: Pass,
    /// Searches the queries that `one` leaves.
    together: Option<Pass>,
}

impl SearchPasses {
    /// Compiles the passes for one k, the length of the list that each invocation keeps in registers.
    ///
    /// # Errors
    /// [`Error::Device`].
    pub(crate) fn new(gpu: &Gpu, k: u32) -> Result<Self, Error> {
        Self::with_form(gpu, k, Form::best(gpu, k))
    }

    fn with_form(gpu: &Gpu, k: u32, form: Form) -> Result<Self, Error> {
        let common = ("K", k.into());
        let left_only = ("LEFT_ONLY", f64::from(u8::from(form == Form::Four)));
        let most_rounds = |rounds: u32| ("MOST_ROUNDS", rounds.into());
        let alone = most_rounds(if form == Form::OneOrMany { ROUNDS_ALONE } else { u32::MAX });
        let (mut four, mut together) = (None, None);
        match form {
            Form::Four => four = Some((Pass::new(gpu, &SEARCH_FOUR, &[common])?, WorkPass::new(gpu)?)),
            Form::One => {}
            Form::OneOrMany => {
                together = Some(Pass::new(gpu, &SEARCH_TOGETHER, &[common, most_rounds(u32::MAX)])?);
            }
        }
        Ok(Self { four, one: Pass::new(gpu, &SEARCH, &[common, alone, left_only])?, together })
    }

    /// Finds the neighbourhoods of the queries of `round`.
    pub(crate) fn steps(
        &self,
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        screen: &ScreenBuffers,
        neighborhoods: &wgpu::Buffer,
        round: Round,
    ) -> Vec<Step> {
        let ScreenBuffers { counters, density, cell_start, points, queries, left, past, .. } = screen;
        let buffers = [frame, counters, density, cell_start, points, queries, neighborhoods, left, past];
        let Self { four, one, together } = self;
        match four {
            Some((four, work)) => vec![
                four.step(gpu, &buffers, screen.groups(round.work_256())),
                work.step(gpu, frame, screen),
                one.step(gpu, &buffers, screen.groups(round.left_64())),
            ],
            None => {
                let together = together.iter().map(|pass| pass.step(gpu, &buffers, TOGETHER_GROUPS));
                once(one.step(gpu, &buffers, screen.groups(round.work_64()))).chain(together).collect()
            }
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;

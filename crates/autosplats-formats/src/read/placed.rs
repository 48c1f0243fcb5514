//! Clouds of several scans, each with its own sensor pose.

use autosplats_cloud::{Error, PointCloud, residual, storage_origin};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    Job,
    table::{ProgressRange, reserve},
};

/// Points processed between two checks for cancellation.
const BLOCK: usize = 1 << 18;

/// One value per point of all scans, whose lengths are `lens`. `run(scan)` returns the function of a point's index.
pub(super) fn fill<T, V>(
    job: &Job<'_>,
    what: &str,
    lens: &[usize],
    part: ProgressRange,
    run: impl Fn(usize) -> V,
) -> Result<Vec<T>, Error>
where
    T: Send,
    V: Fn(usize) -> T + Sync + Send,
{
    let total: usize = lens.iter().sum();
    let mut values = Vec::new();
    reserve(&mut values, total, what)?;
    for (index, &len) in lens.iter().enumerate() {
        let value = run(index);
        for start in (0..len).step_by(BLOCK) {
            job.tick(part.start + part.len * values.len() as f32 / total as f32)?;
            values.par_extend((start..len.min(start + BLOCK)).into_par_iter().map(&value));
        }
    }
    Ok(values)
}

/// The cloud of all scans' points. `run(scan)` returns the function from a point's index to its world coordinates.
pub(super) fn place<V: Fn(usize) -> DVec3 + Sync + Send>(
    job: &Job<'_>,
    lens: &[usize],
    part: ProgressRange,
    run: impl Fn(usize) -> V,
) -> Result<PointCloud, Error> {
    let mut starts = vec![0];
    starts.extend(lens.iter().scan(0, |sum, len| {
        *sum += len;
        Some(*sum)
    }));
    let total: usize = lens.iter().sum();
    let origin = storage_origin(total, |i| {
        let index = starts.partition_point(|&start| start <= i) - 1;
        run(index)(i - starts[index])
    });
    let positions = fill(job, "positions", lens, part, |index| {
        let world = run(index);
        move |i| (world(i) - origin).as_vec3().to_array()
    })?;
    let cloud = PointCloud::new(origin, positions);
    if !job.options.exact {
        return Ok(cloud);
    }
    let part = ProgressRange { start: part.start + part.len, len: 0.0 };
    let residuals: Vec<[f32; 3]> = fill(job, "residuals", lens, part, |index| {
        let world = run(index);
        move |i| residual(world(i) - origin)
    })?;
    if residuals.par_iter().all(|lost| *lost == [0.0; 3]) { Ok(cloud) } else { cloud.with_residuals(residuals) }
}

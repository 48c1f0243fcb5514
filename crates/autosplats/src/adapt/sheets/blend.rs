//! Blends the sheets around a surfel.

use glam::Vec3;
use pulp::Simd;

use super::{SHEETS, Sheet, Sheets};
use crate::adapt::cells::Cells;
use crate::adapt::rules::{AGREE_ERRORS, Goal, MAX_MOVE_NOISES};
use crate::camera::View;
use crate::search::{LANES, Lanes};
use crate::simd::F32s;

/// The surface beside a surfel.
#[derive(Clone, Copy, Debug)]
pub(in crate::adapt) struct Surface {
    /// From the surfel to the surface, world units.
    pub(in crate::adapt) offset: Vec3,
    /// Unit normal, of either sign.
    pub(in crate::adapt) normal: Vec3,
    pub(in crate::adapt) curvature: f32,
}

/// Result of blending the sheets around a surfel.
#[derive(Clone, Copy, Debug)]
pub(in crate::adapt) enum Blend {
    Surface(Surface),
    /// All sheets differ from the surfel's first normal or scatter too much. The surfel is at an edge, or shows detail
    /// finer than sheets.
    Disagrees,
    /// There are no sheets.
    Nothing,
}

/// Numbers that describe a sheet.
const FIELDS: usize = 19;

/// The sheets of a cell, one array per number for SIMD. All numbers are 0 where there is no sheet.
#[derive(Clone, Copy, Debug, Default, bytemuck::Zeroable)]
#[repr(transparent)]
pub(super) struct CellSheets(pub(super) [[f32; SHEETS]; FIELDS]);

impl CellSheets {
    pub(super) fn put(&mut self, at: usize, sheet: &Sheet) {
        let &Sheet { center, radius, axis, height, bend, error, curvature, scatter, trust } = sheet;
        let [xx, xy, xz, yy, yz, zz] = bend;
        #[rustfmt::skip]
        let fields: [f32; FIELDS] = [
            center.x, center.y, center.z, radius, 1.0 / radius, axis.x, axis.y, axis.z, height,
            xx, xy, xz, yy, yz, zz, error * error, curvature, scatter, trust,
        ];
        for (field, value) in self.0.iter_mut().zip(fields) {
            field[at] = value;
        }
    }
}

/// The sheets of four cells, one per lane. Successive surfels mostly share them, so the last ones are kept.
#[derive(Debug)]
pub(in crate::adapt) struct NearbySheets {
    /// First and last column, first and last row.
    cells: [usize; 4],
    fields: [Lanes; FIELDS],
    /// Column of each sheet's cell.
    column: Lanes,
    row: Lanes,
}

impl Default for NearbySheets {
    fn default() -> Self {
        let zero = Lanes::default();
        // Matches no cells.
        Self { cells: [usize::MAX; 4], fields: [zero; FIELDS], column: zero, row: zero }
    }
}

impl NearbySheets {
    #[inline(always)]
    fn gather(&mut self, sheets: &Sheets, cells: [usize; 4], columns: usize) {
        if self.cells == cells {
            return;
        }
        self.cells = cells;
        let [x0, x1, y0, y1] = cells;
        for (at, [column, row]) in [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].into_iter().enumerate() {
            let lanes = at * SHEETS..(at + 1) * SHEETS;
            self.column.0[lanes.clone()].fill(column as f32);
            self.row.0[lanes.clone()].fill(row as f32);
            let cell = row * columns + column;
            // At the picture's border a cell appears twice, which does not change the ratio of weights.
            let stack = if sheets.fitted[cell] { sheets.stacks[cell] } else { CellSheets::default() };
            for (field, values) in self.fields.iter_mut().zip(&stack.0) {
                field.0[lanes.clone()].copy_from_slice(values);
            }
        }
    }
}

impl Sheets {
    /// The surface beside `center`, from the sheets of the four cells around. Where `first` is given, a normal and its
    /// standard error, sheets have to agree with that normal.
    #[inline(always)]
    pub(in crate::adapt) fn blend<S: Simd>(
        &self,
        simd: S,
        center: [f32; 3],
        first: Option<(Vec3, f32)>,
        goal: &Goal,
        (cells, view): (&Cells, &View),
        around: &mut [NearbySheets; 2],
    ) -> Blend {
        let Some(level) = cells.levels.get(self.level) else { return Blend::Nothing };
        let per_side = 1.0 / level.side_px as f32;
        let [x, y] = view.to_pixel(center.into()).map(|at| at * per_side - 0.5);
        // Casts from float saturate at 0.
        let [x0, y0] = [x as usize, y as usize];
        let x1 = ((x + 1.0) as usize).min(level.columns - 1);
        let y1 = ((y + 1.0) as usize).min(level.rows.len() - 1);
        // Successive surfels of a strip alternate between rows of cells.
        let around = &mut around[y0 & 1];
        around.gather(self, [x0, x1, y0, y1], level.columns);
        let per_farthest = 1.0 / (MAX_MOVE_NOISES * goal.noise);
        // Closures within arrays' methods are not inlined.
        let splat = |value: f32| F32s::splat(simd, value);
        let (zero, one, two) = (splat(0.0), splat(1.0), splat(2.0));
        let (cx, cy, cz) = (splat(center[0]), splat(center[1]), splat(center[2]));
        // Weights, normals, heights.
        let mut told = [Lanes::default(); 5];
        let mut disagrees = false;
        // In the order of `CellSheets::put`.
        #[rustfmt::skip]
        let [
            x_lanes, y_lanes, z_lanes, radius, per_radius, axis_x, axis_y, axis_z, height_lanes,
            bend_xx, bend_xy, bend_xz, bend_yy, bend_yz, bend_zz, squared_error, curvature, scatter, trust,
        ] = &around.fields;
        for vector in 0..LANES / S::F32_LANES {
            let load = |lanes: &Lanes| F32s::load(simd, &lanes.0, vector);
            let per_radius = load(per_radius);
            let ox = (cx - load(x_lanes)) * per_radius;
            let oy = (cy - load(y_lanes)) * per_radius;
            let oz = (cz - load(z_lanes)) * per_radius;
            let (ax, ay, az) = (load(axis_x), load(axis_y), load(axis_z));
            let (xx, xy, xz) = (load(bend_xx), load(bend_xy), load(bend_xz));
            let (yy, yz, zz) = (load(bend_yy), load(bend_yz), load(bend_zz));
            let sx = xx * ox + xy * oy + xz * oz;
            let sy = xy * ox + yy * oy + yz * oz;
            let sz = xz * ox + yz * oy + zz * oz;
            let up = ax * ox + ay * oy + az * oz;
            let height = (load(height_lanes) + (sx * ox + sy * oy + sz * oz) - up) * load(radius);
            let near = one - (ox * ox + oy * oy + oz * oz - up * up);
            let away = height * splat(per_farthest);
            let likely = one - away * away;
            let trust = load(trust);
            let is_there = zero.less(near).and(zero.less(likely)).and(zero.less(trust));
            if !is_there.any() {
                continue;
            }
            let (nx, ny, nz) = (ax - two * sx, ay - two * sy, az - two * sz);
            // Avoids a division by 0 in lanes without a sheet.
            let per_length = one / is_there.select((nx * nx + ny * ny + nz * nz).sqrt(), one);
            let (nx, ny, nz) = (nx * per_length, ny * per_length, nz * per_length);
            let mut counts = is_there;
            if let Some((first, error)) = first {
                let (fx, fy, fz) = (splat(first.x), splat(first.y), splat(first.z));
                let (across_x, across_y, across_z) = (ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx);
                let across = across_x * across_x + across_y * across_y + across_z * across_z;
                // The smallest of a sheet's balls has not been held against any normal.
                let agrees =
                    across.at_most(splat(AGREE_ERRORS * AGREE_ERRORS) * (load(squared_error) + splat(error * error)));
                counts = is_there.and(agrees).and(load(scatter).at_most(splat(goal.scatter)));
                disagrees |= zero.less(is_there.keep(one) - counts.keep(one)).any();
            }
            // Falls to 0 where the next cells begin.
            let share_x = one - (splat(x) - F32s::load(simd, &around.column.0, vector)).abs();
            let share_y = one - (splat(y) - F32s::load(simd, &around.row.0, vector)).abs();
            // The eighth power is about the likelihood of such a distance under noise.
            let likely = likely * likely;
            let likely = likely * likely;
            let likely = likely * likely;
            let weight = share_x * share_y * (near * near) * likely * trust;
            counts.keep(weight).store(&mut told[0].0, vector);
            nx.store(&mut told[1].0, vector);
            ny.store(&mut told[2].0, vector);
            nz.store(&mut told[3].0, vector);
            height.store(&mut told[4].0, vector);
        }
        let mut sum = Surface { offset: Vec3::ZERO, normal: Vec3::ZERO, curvature: 0.0 };
        let mut total = 0.0;
        let [weights, nx, ny, nz, heights] = &told;
        // One bit per sheet that counts; a branch per lane would be unpredictable.
        let mut left = 0u32;
        for lane in 0..LANES {
            left |= u32::from(weights.0[lane] > 0.0) << lane;
        }
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let weight = weights.0[lane];
            let normal = Vec3::new(nx.0[lane], ny.0[lane], nz.0[lane]);
            let axis = Vec3::new(axis_x.0[lane], axis_y.0[lane], axis_z.0[lane]);
            sum.normal += normal * if normal.dot(sum.normal) < 0.0 { -weight } else { weight };
            sum.offset += axis * (heights.0[lane] * weight);
            sum.curvature += curvature.0[lane] * weight;
            total += weight;
        }
        if !(total > 0.0) {
            return if disagrees { Blend::Disagrees } else { Blend::Nothing };
        }
        let per_total = 1.0 / total;
        Blend::Surface(Surface {
            offset: sum.offset * per_total,
            // Weights may be so small that their squares are zero.
            normal: (sum.normal * per_total).normalize(),
            curvature: sum.curvature * per_total,
        })
    }
}

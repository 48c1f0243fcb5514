//! Animations of a glTF: moving nodes and morphing meshes.

use std::collections::HashMap;

use autosplats_cloud::Error;
use glam::DQuat;

use super::super::Job;
use super::{
    accessor::{Values, part},
    buffers::{Buffers, buffers_of},
    json::{Animation, Channel, Container, Interpolation, Mesh, NodePose, Root, Sampler},
};

/// The animated values of all nodes at one time.
pub(super) struct Pose {
    nodes: HashMap<usize, NodePose>,
}

/// Values of a sampler.
struct Curve {
    times: Vec<f64>,
    values: Vec<f64>,
    /// Numbers per value.
    width: usize,
    interpolation: Interpolation,
}

/// Duration of the first animation in seconds, and the number of animations; `None` if there are none.
pub(in super::super) fn animation(job: &Job<'_>) -> Result<Option<(f64, usize)>, Error> {
    let container = Container::open(job)?;
    let root = container.root(job)?;
    let Some(animation) = root.animations.first() else { return Ok(None) };
    let inputs = || animation.samplers.iter().map(|sampler| sampler.input);
    let buffers = load(job, &root, container.chunk, inputs())?;
    let (mut end, mut left) = (0.0_f64, most_numbers(job, &buffers));
    for input in inputs() {
        let times = Values::find(job, &root, &buffers, input, &[1])?.numbers(job, part(0.0))?;
        spend(job, &mut left, times.len())?;
        end = times.into_iter().fold(end, f64::max);
    }
    Ok(Some((end, root.animations.len())))
}

/// Most numbers per byte of the files; accessors that share bytes yield more numbers than bytes.
const MAX_NUMBERS_PER_BYTE: usize = 64;

/// Most numbers that an animation may use, whatever its file claims.
fn most_numbers(job: &Job<'_>, buffers: &Buffers<'_>) -> usize {
    job.bytes.len().saturating_add(buffers.len_beside()).saturating_mul(MAX_NUMBERS_PER_BYTE)
}

fn spend(job: &Job<'_>, left: &mut usize, numbers: usize) -> Result<(), Error> {
    let what = "it reuses its numbers too often for a file of this size; export it again";
    *left = left.checked_sub(numbers).ok_or_else(|| job.malformed("animation 0", what))?;
    Ok(())
}

fn load<'a>(
    job: &Job<'_>,
    root: &Root<'a>,
    chunk: Option<&'a [u8]>,
    accessors: impl Iterator<Item = usize>,
) -> Result<Buffers<'a>, Error> {
    let mut needed = vec![false; root.accessors.len()];
    accessors.for_each(|index| needed.get_mut(index).into_iter().for_each(|needed| *needed = true));
    Buffers::load(job, root, chunk, buffers_of(root, needed))
}

impl Pose {
    /// The state of the first animation at a time.
    pub(super) fn at(job: &Job<'_>, root: &Root<'_>, chunk: Option<&[u8]>, seconds: f64) -> Result<Self, Error> {
        let mut nodes: HashMap<usize, NodePose> = HashMap::new();
        let Some(Animation { channels, samplers }) = root.animations.first() else { return Ok(Self { nodes }) };
        let accessors = samplers.iter().flat_map(|sampler| [sampler.input, sampler.output]);
        let buffers = load(job, root, chunk, accessors)?;
        let mut left = most_numbers(job, &buffers);
        for (number, Channel { sampler, target }) in channels.iter().enumerate() {
            job.go_on()?;
            let Some(node) = target.node else { continue };
            let width = match &*target.path {
                "translation" | "scale" => Some(3),
                "rotation" => Some(4),
                "weights" => None,
                // Extensions may animate other things.
                _ => continue,
            };
            let Some(sampler) = samplers.get(*sampler) else {
                let place = format!("animation 0, channel {number}");
                return Err(job.malformed(place, "there is no such sampler; export the file again"));
            };
            let curve = Curve::of(job, root, &buffers, sampler, width)?;
            spend(job, &mut left, curve.times.len() + curve.values.len())?;
            let value = curve.at(seconds, &*target.path == "rotation");
            let pose = nodes.entry(node).or_default();
            match &*target.path {
                "translation" => pose.translation = value.try_into().ok(),
                "scale" => pose.scale = value.try_into().ok(),
                "rotation" => pose.rotation = value.try_into().ok(),
                _ => pose.weights = Some(value),
            }
        }
        Ok(Self { nodes })
    }

    pub(super) fn node(&self, index: usize) -> Option<&NodePose> {
        self.nodes.get(&index)
    }

    /// Weights of the morph targets of a mesh at a node.
    pub(super) fn weights(&self, root: &Root<'_>, node: Option<usize>, mesh: &Mesh) -> Vec<f64> {
        let animated = node.and_then(|node| self.node(node)?.weights.clone());
        let own = || node.and_then(|node| Some(root.nodes.get(node)?.weights.as_ref()?.to_vec()));
        animated.or_else(own).or_else(|| Some(mesh.weights.as_ref()?.to_vec())).unwrap_or_default()
    }
}

impl Curve {
    fn of(
        job: &Job<'_>,
        root: &Root<'_>,
        buffers: &Buffers<'_>,
        sampler: &Sampler,
        width: Option<usize>,
    ) -> Result<Self, Error> {
        let times = Values::find(job, root, buffers, sampler.input, &[1])?.numbers(job, part(0.0))?;
        let values = Values::find(job, root, buffers, sampler.output, &[width.unwrap_or(1)])?;
        let values = values.numbers(job, part(0.0))?;
        let interpolation = sampler.interpolation;
        let sets = times.len() * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let own = width.or_else(|| values.len().checked_div(sets)).unwrap_or(0);
        if times.is_empty() || sets.checked_mul(own) != Some(values.len()) {
            let what = format!("its {} numbers do not fit {} times; export the file again", values.len(), times.len());
            return Err(job.malformed(format!("accessor {}", sampler.output), what));
        }
        Ok(Self { times, values, width: own, interpolation })
    }

    /// The value at a time, constant before the first and after the last key. Rotations take the short way.
    fn at(&self, seconds: f64, rotation: bool) -> Vec<f64> {
        let cubic = self.interpolation == Interpolation::CubicSpline;
        // A spline has three values per key: the slope before, the value, and the slope after.
        let set = |key: usize, which: usize| {
            let start = if cubic { 3 * key + which } else { key } * self.width;
            &self.values[start..start + self.width]
        };
        let after = self.times.partition_point(|&time| time <= seconds);
        let key = after.saturating_sub(1);
        let next = (key + 1).min(self.times.len() - 1);
        let span = self.times[next] - self.times[key];
        let (from, to) = (set(key, 1), set(next, 1));
        if after == 0 || !(span > 0.0) || self.interpolation == Interpolation::Step {
            return from.to_vec();
        }
        let t = ((seconds - self.times[key]) / span).clamp(0.0, 1.0);
        if cubic {
            let (out, into) = (set(key, 2), set(next, 0));
            let (t2, t3) = (t * t, t * t * t);
            let value = |i: usize| {
                (2.0 * t3 - 3.0 * t2 + 1.0) * from[i]
                    + span * (t3 - 2.0 * t2 + t) * out[i]
                    + (3.0 * t2 - 2.0 * t3) * to[i]
                    + span * (t3 - t2) * into[i]
            };
            return (0..self.width).map(value).collect();
        }
        if let (true, &[a, b, c, d], &[e, f, g, h]) = (rotation, from, to) {
            let turn = DQuat::from_xyzw(a, b, c, d).normalize();
            return turn.slerp(DQuat::from_xyzw(e, f, g, h).normalize(), t).to_array().to_vec();
        }
        from.iter().zip(to).map(|(from, to)| from + (to - from) * t).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(interpolation: Interpolation, values: Vec<f64>) -> Curve {
        Curve { times: vec![1.0, 3.0], values, width: 1, interpolation }
    }

    #[test]
    fn values_between_keys() {
        let linear = curve(Interpolation::Linear, vec![10.0, 20.0]);
        let step = curve(Interpolation::Step, vec![10.0, 20.0]);
        // A spline with these slopes is the line.
        let spline = curve(Interpolation::CubicSpline, vec![0.0, 10.0, 5.0, 5.0, 20.0, 0.0]);
        let at = |curve: &Curve| [0.0, 1.0, 1.5, 2.0, 3.0, 9.0, f64::NAN].map(|time| curve.at(time, false)[0]);
        assert_eq!(at(&linear)[..6], [10.0, 10.0, 12.5, 15.0, 20.0, 20.0], "a line, and still beyond its ends");
        assert_eq!(at(&step)[..6], [10.0, 10.0, 10.0, 10.0, 20.0, 20.0], "steps");
        assert_eq!(at(&spline)[..6], [10.0, 10.0, 12.5, 15.0, 20.0, 20.0], "the same line");
    }

    #[test]
    fn rotations_take_the_short_way() {
        let (sin, cos) = std::f64::consts::FRAC_PI_4.sin_cos();
        let values = vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -sin, -cos];
        let curve = Curve { times: vec![0.0, 1.0], values, width: 4, interpolation: Interpolation::Linear };
        let half: [f64; 4] = curve.at(0.5, true).try_into().expect("four numbers");
        let turned = DQuat::from_array(half) * glam::DVec3::X;
        assert!(turned.abs_diff_eq(glam::DVec3::new(cos, sin, 0.0), 1e-12), "an eighth of a turn: {turned}");
    }
}

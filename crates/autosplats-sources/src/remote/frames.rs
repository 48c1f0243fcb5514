//! Coordinate frames of robots, and the common frame of their points.
//!
//! # How it works
//!
//! Each robot, which is a ROS domain and a namespace in it, has its own tree of frames from the `tf` and `tf_static`
//! published there. The common frame is chosen once, for the first points; a later change would make visible points
//! jump. Transforms arrive in any order, so the first points wait a moment for them if they are published at all.

use std::collections::BTreeMap;

use super::{address::TRANSFORM_TOPICS, graph::Topic};
use crate::transforms::{Placement, Transforms};

/// Maximum number of robots with transforms.
const MAX_ROBOTS: usize = 64;

/// The transforms of all robots.
#[derive(Debug, Default)]
pub(super) struct Frames {
    /// The frame asked for, if any.
    wanted: Option<String>,
    /// Transforms by domain and namespace. A namespace begins and ends with a slash.
    robots: BTreeMap<(Option<u32>, String), Transforms>,
}

impl Frames {
    pub(super) fn new(wanted: Option<String>) -> Self {
        Self { wanted, ..Self::default() }
    }

    /// Whether there are no transforms.
    pub(super) fn is_empty(&self) -> bool {
        self.robots.is_empty()
    }

    /// Takes a message of transforms. Returns the reason if it is refused.
    pub(super) fn receive(&mut self, topic: &Topic, message: &[u8], arrival: i64) -> Result<(), String> {
        let Topic { name, domain, .. } = topic;
        let [moving, fixed] = TRANSFORM_TOPICS.map(|own| name.strip_suffix(own));
        let (Some(namespace), fixed) = (moving.or(fixed), fixed.is_some()) else { return Ok(()) };
        let key = (*domain, namespace.to_owned());
        if self.robots.len() >= MAX_ROBOTS && !self.robots.contains_key(&key) {
            return Err(format!("there are transforms of {MAX_ROBOTS} other robots already; choose fewer topics"));
        }
        let known = self.robots.contains_key(&key);
        let heard = self.robots.entry(key.clone()).or_default().receive(message, fixed, arrival);
        if heard.is_err() && !known {
            // A message without valid transforms creates no robot.
            self.robots.remove(&key);
        }
        heard
    }

    /// Transform of a sensor's points at a time; `None` without transforms of it. Fails if the wanted frame is unknown.
    pub(super) fn placement(&mut self, topic: &Topic, frame: &str, stamp: i64) -> Result<Option<Placement>, String> {
        let Self { wanted, robots } = self;
        // The innermost namespace whose transforms know the sensor belongs to its robot.
        let own = robots.iter_mut().filter(|((domain, namespace), transforms)| {
            *domain == topic.domain && topic.name.starts_with(namespace.as_str()) && transforms.knows(frame)
        });
        let Some((_, transforms)) = own.max_by_key(|((_, namespace), _)| namespace.len()) else {
            return match wanted {
                Some(wanted) if wanted != frame => {
                    Err(format!("no transforms from '{frame}' to '{wanted}' have arrived"))
                }
                _ => Ok(None),
            };
        };
        if transforms.target().is_none() {
            transforms.choose(&[frame.to_owned()], wanted.clone())?;
        }
        Ok(transforms.placement(frame, stamp))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(name: &str, domain: Option<u32>) -> Topic {
        Topic { name: name.into(), domain, ..Topic::default() }
    }

    /// A message with `child` at a distance of `right` along x of `parent`.
    fn message(parent: &str, child: &str, right: f64) -> Vec<u8> {
        let mut bytes = vec![0, 1, 0, 0, 1, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0];
        for name in [parent, child] {
            bytes.resize(bytes.len().next_multiple_of(4), 0);
            bytes.extend((name.len() as u32 + 1).to_le_bytes());
            bytes.extend([name.as_bytes(), b"\0"].concat());
        }
        // Numbers are aligned relative to the end of the four header bytes.
        bytes.resize((bytes.len() - 4).next_multiple_of(8) + 4, 0);
        [right, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0].iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes
    }

    #[test]
    fn each_robot_has_frames_of_its_own() -> Result<(), String> {
        let mut frames = Frames::default();
        for (name, domain, right) in [
            ("/tf_static", Some(0), 1.0),
            ("/tf_static", Some(1), 2.0),
            ("/tf", None, 3.0),
            ("/robot/tf", Some(0), 4.0),
            ("/robot/front/tf", Some(0), 5.0),
        ] {
            let parent = if name.contains("front") { "elsewhere" } else { "base" };
            let child = if name.contains("front") { "unknown" } else { "lidar" };
            frames.receive(&topic(name, domain), &message(parent, child, right), 0)?;
        }
        let mut right = |name: &str, domain| {
            let placement = frames.placement(&topic(name, domain), "lidar", 7_000_000_000)?;
            let cloud = autosplats_cloud::PointCloud::new(glam::DVec3::ZERO, vec![[0.0; 3]]);
            Ok::<_, String>(placement.map(|placement| placement.apply(cloud).0.world_position(0).x))
        };
        assert_eq!(right("/points", Some(0))?, Some(1.0), "of its domain");
        assert_eq!(right("/points", Some(1))?, Some(2.0), "of another");
        assert_eq!(right("/points", None)?, Some(3.0), "behind a bridge");
        assert_eq!(right("/robot/front/points", Some(0))?, Some(4.0), "the innermost that knows the sensor");
        assert_eq!(right("/robot_2/points", Some(0))?, Some(1.0), "a namespace ends at a slash");
        assert_eq!(right("/points", Some(7))?, None, "nobody said anything");
        Ok(())
    }

    #[test]
    fn a_frame_that_was_asked_for_is_waited_for() -> Result<(), String> {
        let mut frames = Frames::new(Some("map".into()));
        let points = topic("/points", None);
        let place = |frames: &mut Frames| frames.placement(&points, "lidar", 0).map(|place| place.is_some());
        assert!(place(&mut frames).is_err_and(|why| why.contains("'map'")), "nothing is known");
        frames.receive(&topic("/tf", None), &message("base", "lidar", 1.0), 0)?;
        let why = place(&mut frames).err().unwrap_or_default();
        assert_eq!(why, "no frame is called 'map'; there are: base, lidar", "as yet");
        frames.receive(&topic("/tf", None), &message("map", "base", 1.0), 0)?;
        assert_eq!(place(&mut frames), Ok(true), "now it is");
        assert!(frames.receive(&topic("/tf", None), b"nonsense", 0).is_err(), "no message");
        Ok(())
    }

    #[test]
    fn made_up_robots_end_somewhere() {
        let mut frames = Frames::default();
        let heard = (0..100).map(|n| frames.receive(&topic(&format!("/{n}/tf"), None), &message("a", "b", 0.0), 0));
        assert_eq!(heard.filter(Result::is_ok).count(), MAX_ROBOTS, "no more of them");
    }
}

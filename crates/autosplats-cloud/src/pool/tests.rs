//! The pool against a map of clouds, over many insertions, removals and choices.

use super::*;
use crate::{Axes, Key, Random, Scan};

const SLOTS: usize = 9;

/// Keys of the third level.
fn key(number: u32) -> NodeKey {
    Key::new(3, [number % 8, number / 8 % 8, number / 64 % 8]).expect("a place").into()
}

/// A node of `len` points that all have a coordinate, a colour and a value of their own.
fn node(number: u32, len: usize) -> PointCloud {
    let origin = DVec3::new(1e6 + f64::from(number), 0.0, 0.0);
    let own = |index: usize| [number as f32, index as f32, 0.5];
    PointCloud::new(origin, (0..len).map(own).collect())
        .with_colors((0..len).map(|index| [number as u8, index as u8, (index >> 8) as u8]).collect())
        .and_then(|node| node.with_field("GpsTime", FieldValues::F64((0..len).map(|i| 3e8 + i as f64).collect())))
        .expect("one of each a point")
}

fn pool(capacity: usize) -> PointPool {
    PointPool::new(&node(0, 100), capacity).expect("a pool")
}

/// Asserts that the runs of the chosen nodes are exactly their points, in order, with all attributes.
fn assert_holds(pool: &PointPool, nodes: &BTreeMap<NodeKey, PointCloud>, chosen: &BTreeSet<NodeKey>) {
    let mut runs = pool.runs().into_iter();
    let times = pool.field("gpstime").expect("a field");
    for (key, node) in nodes.iter().filter(|(key, _)| chosen.contains(key)) {
        let mut points = 0..node.len();
        while !points.is_empty() {
            let run = runs.next().expect("a run");
            assert_eq!(run.origin, node.origin());
            assert!(run.first.is_multiple_of(SLOT_POINTS as u32) && run.len as usize <= SLOT_POINTS, "in one slot");
            for index in run.first..run.first + run.len {
                let (point, at) = (points.next().expect("a point"), index as usize);
                assert_eq!(pool.index_of(*key, point), Some(index));
                assert_eq!(pool.place_of(index), Some((*key, point)));
                assert_eq!(pool.world_position(index), Some(node.world_position(point)));
                assert_eq!(pool.positions()[at], node.positions()[point]);
                assert_eq!(pool.colors().map(|colors| colors[at]), node.colors().map(|colors| colors[point]));
                assert_eq!(times.absolute(at), 3e8 + point as f64);
            }
        }
    }
    assert_eq!(runs.next(), None);
    let len = |key: &NodeKey| nodes[key].len();
    assert_eq!(pool.chosen_points(), chosen.iter().map(len).sum::<usize>());
}

#[test]
fn nodes_come_and_go_and_points_stay() {
    let mut random = Random::from_state(51);
    let mut pool = pool(SLOTS * SLOT_POINTS + 17);
    assert_eq!(pool.capacity(), SLOTS * SLOT_POINTS, "whole slots");
    let mut nodes: BTreeMap<NodeKey, PointCloud> = BTreeMap::new();
    let mut chosen = BTreeSet::new();
    let mut refused = 0;
    for number in 0..200 {
        match random.modulo(8) {
            0 => {
                let removed = key(random.modulo(12) as u32);
                assert_eq!(pool.remove(removed), nodes.remove(&removed).is_some());
                chosen.remove(&removed);
            }
            1 | 2 => {
                let wanted: Vec<NodeKey> = (0..6).map(|_| key(random.modulo(12) as u32)).collect();
                let missing: BTreeSet<NodeKey> = pool.choose(&wanted).into_iter().collect();
                chosen = wanted.into_iter().collect();
                assert_eq!(missing, chosen.iter().filter(|key| !nodes.contains_key(key)).copied().collect());
                chosen.retain(|key| nodes.contains_key(key));
            }
            _ => {
                let (key, len) = (key(random.modulo(12) as u32), random.modulo(3 * SLOT_POINTS));
                let before: Vec<_> = nodes.keys().map(|&key| (key, pool.index_of(key, 0))).collect();
                let made = node(number, len);
                if pool.insert(key, &made) {
                    nodes.entry(key).or_insert(made);
                } else {
                    refused += 1;
                    let slots = |key: &NodeKey| nodes[key].len().div_ceil(SLOT_POINTS);
                    let pinned: usize = chosen.iter().map(slots).sum();
                    assert!(pinned + len.div_ceil(SLOT_POINTS) > SLOTS, "there was room");
                }
                nodes.retain(|key, _| pool.contains(*key));
                assert!(chosen.iter().all(|key| nodes.contains_key(key)), "chosen nodes stay");
                for (key, index) in before.into_iter().filter(|(key, _)| nodes.contains_key(key)) {
                    assert_eq!(pool.index_of(key, 0), index, "points stay where they are");
                }
            }
        }
        assert!(pool.positions().len() <= pool.capacity());
        assert_holds(&pool, &nodes, &chosen);
    }
    assert!(refused > 0, "the pool was never full");
}

#[test]
fn what_was_not_chosen_for_the_longest_time_leaves_first_and_the_finest_of_it() {
    let mut pool = pool(4 * SLOT_POINTS);
    let child = Key::new(1, [0; 3]).expect("a place").into();
    for (number, key) in [NodeKey::default(), child, key(0), key(1)].into_iter().enumerate() {
        assert!(pool.insert(key, &node(number as u32, 10)));
    }
    pool.choose(&[key(0)]);
    pool.choose(&[key(1)]);
    assert!(pool.insert(key(2), &node(2, 10)));
    assert!(!pool.contains(child), "never chosen, and finer than the root");
    assert!(pool.insert(key(3), &node(3, 10)));
    assert!(!pool.contains(NodeKey::default()), "never chosen");
    assert!(pool.insert(key(4), &node(4, 10)));
    assert!(!pool.contains(key(0)), "chosen before the others came");
    let all = [key(1), key(2), key(3), key(4)];
    assert_eq!(pool.choose(&all), []);
    assert!(!pool.insert(key(5), &node(5, 1)), "all are chosen");
    assert!(all.iter().all(|key| pool.contains(*key)));
    assert!(pool.insert(key(6), &node(6, 0)), "nothing needs no room");
    assert!(!pool.insert(key(7), &node(7, 5 * SLOT_POINTS)), "more than there is");
    pool.choose(&[]);
    assert_eq!((pool.runs(), pool.chosen_points()), (Vec::new(), 0));
    assert!(!pool.insert(key(7), &node(7, 5 * SLOT_POINTS)));
    assert!(all.iter().all(|key| pool.contains(*key)), "nobody left in vain");
}

#[test]
fn what_is_written_is_known() {
    let mut pool = pool(8 * SLOT_POINTS);
    assert_eq!(pool.written_since(None), []);
    pool.insert(key(0), &node(0, SLOT_POINTS + 1));
    pool.insert(key(1), &node(1, 1));
    let first = pool.generation();
    assert_eq!(pool.written_since(None), vec![0..3 * SLOT_POINTS]);
    assert_eq!(pool.written_since(Some(first)), []);
    pool.remove(key(0));
    assert_eq!((pool.generation(), pool.written_since(Some(first))), (first, Vec::new()), "nothing was written");
    pool.insert(key(1), &node(9, 7));
    assert_eq!(pool.world_position(2 * SLOT_POINTS as u32 + 1), None, "a node that is there stays as it is");
    pool.insert(key(2), &node(2, 10));
    pool.insert(key(3), &node(3, 2 * SLOT_POINTS));
    let written = pool.written_since(Some(first));
    assert_eq!(written, [0..2 * SLOT_POINTS, 3 * SLOT_POINTS..4 * SLOT_POINTS], "free slots first");
}

#[test]
fn a_node_that_lacks_a_column_gets_the_usual_one() {
    let mut pool = pool(SLOT_POINTS);
    pool.insert(key(0), &node(0, 10));
    pool.remove(key(0));
    pool.insert(key(1), &PointCloud::new(DVec3::ZERO, vec![[1.0; 3]; 5]));
    assert_eq!(pool.colors().map(|colors| colors[..5].to_vec()), Some(vec![GREY; 5]));
    let times = pool.field("GpsTime").expect("a field");
    assert!((0..5).all(|index| times.get(index).is_nan()));
    assert_eq!(pool.place_of(5), None, "the slot's other points are nobody's");
    assert_eq!(pool.place_of(SLOT_POINTS as u32), None);
    assert_eq!([pool.index_of(key(1), 5), pool.index_of(key(0), 0)], [None; 2]);
}

#[test]
fn the_scene_is_that_of_the_sample() {
    let scan = Scan { name: None, world_from_sensor: glam::DMat4::IDENTITY, points: 0..10 };
    let sample = node(0, 3 * SAMPLE_POINTS).with_axes(Axes::YUp).with_scans(vec![scan]);
    let mut pool = PointPool::new(&sample, SLOT_POINTS).expect("a pool");
    let identity = pool.identity();
    assert_eq!((pool.sample().len(), pool.sample().axes()), (SAMPLE_POINTS, Some(Axes::YUp)));
    assert!(pool.sample().scans().is_empty(), "nodes have no scans either");
    pool.insert(key(1), &node(1, 10));
    assert_eq!((pool.identity(), pool.sample().len()), (identity, SAMPLE_POINTS));
    assert_ne!(identity, sample.identity());
    assert_eq!(PointPool::bytes_per_point(&sample), 12 + 3 + 4);
}

#[test]
fn what_no_pool_can_hold_is_refused() {
    let refused = |sample: &PointCloud, capacity| PointPool::new(sample, capacity).expect_err("refused").to_string();
    assert!(refused(&node(0, 10), u32::MAX as usize).contains("4,294,967,295"));
    let tiny = PointCloud::new(DVec3::ZERO, vec![[0.0; 3], [1e-12; 3], [2e-12; 3]]);
    assert!(refused(&tiny, 10).contains("all points are read at once"));
    assert!(!PointPool::new(&node(0, 10), 10).expect("no slot").insert(key(0), &node(0, 1)));
}

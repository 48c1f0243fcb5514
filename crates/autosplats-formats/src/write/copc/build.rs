//! Builds the nodes of one part of the tree, whose records are in memory.
//!
//! # How it works
//!
//! The records are sorted along a Morton curve, and by their bytes where they share a place. So every node and every
//! cell is a range of the sorted records, and the result does not depend on the order in which they came. A node of
//! more than [`LEAF`] points has children. From the leaves up, the [`Sampler`] chooses which points move to the parent;
//! a point ends in the coarsest node that chose it. Points that the part's own root chose may move on above it.

use std::{cell::Cell, ops::Range};

use autosplats_cloud::{Error, Progress};
use rayon::prelude::*;

use super::{
    compress::{Compressor, Node},
    frame::{CELL_BITS, Frame, morton, steps_of, unmorton},
    key::Place,
    sample::{Candidate, Choice, Sampler},
    sort::sort,
};

/// Most points of a leaf.
pub(super) const LEAF: usize = 1 << 16;

/// Most bits of a place, relative to the part's root, that fit a Morton code.
const MAX_BITS: u32 = 21;

/// Home of a point that moves above the part.
const ABOVE: u8 = u8::MAX;

/// The points of a node that may move to its parent, with their records, in Morton order.
pub(super) struct Top {
    pub(super) place: Place,
    pub(super) candidates: Vec<Candidate>,
    pub(super) records: Vec<u8>,
}

/// A part of the tree: its finished nodes from coarse to fine, and the node at its root unless that is the whole
/// tree's.
pub(super) struct Part {
    pub(super) nodes: Vec<Node>,
    pub(super) top: Option<Top>,
}

/// A node as a range of the sorted records.
struct Span {
    level: u32,
    range: Range<usize>,
}

struct Builder<'a> {
    /// Bits of a place relative to the part's root, and the deepest level there.
    bits: u32,
    deepest: u32,
    codes: &'a [u64],
    /// Level at which each point is stored, relative to the part's root.
    homes: Vec<u8>,
    spans: Vec<Span>,
    sampler: Sampler,
}

/// Points of a node that may move to its parent.
enum Rising {
    /// All points of a leaf.
    All(Range<usize>),
    /// What a node chose, by index among the sorted records.
    Chosen(Vec<Choice>),
}

/// Builds the part with this root out of its records.
pub(super) fn build(
    frame: &Frame,
    root: Place,
    records: &[u8],
    compressor: &Compressor,
    progress: &dyn Progress,
) -> Result<Part, Error> {
    let len = compressor.record_len;
    let below = frame.bits - root.level;
    let bits = below.min(MAX_BITS);
    let mask = if below == 32 { u32::MAX } else { (1 << below) - 1 };
    let code = |record: &[u8]| {
        let place = frame.place(steps_of(record)).unwrap_or_default();
        morton(place.map(|place| (place & mask) >> (below - bits)))
    };
    let (codes, order) = sort(records, len, 3 * bits, code);
    let deepest = bits.min(Place::MAX_LEVEL - root.level);
    let (homes, sampler) = (vec![0; codes.len()], Sampler::new());
    let mut builder = Builder { bits, deepest, codes: &codes, homes, spans: Vec::new(), sampler };
    let rising = builder.node(0..codes.len(), 0);
    let record = |index: usize| &records[order[index] as usize * len..][..len];

    let top = (root.level > 0).then(|| {
        let corner = root.corner(frame.bits);
        let whole = |place: [u32; 3]| [0, 1, 2].map(|axis| corner[axis] + (place[axis] << (below - bits)));
        let one = |index: usize, choice: Option<&Choice>| {
            let place = whole(unmorton(codes[index]));
            choice.map_or(Candidate { place, mean: place, count: 1 }, |choice| Candidate {
                place,
                mean: whole(choice.mean),
                count: choice.count,
            })
        };
        let (indices, candidates): (Vec<usize>, Vec<Candidate>) = match &rising {
            Rising::All(range) => range.clone().map(|index| (index, one(index, None))).unzip(),
            Rising::Chosen(choices) => {
                choices.iter().map(|choice| (choice.index as usize, one(choice.index as usize, Some(choice)))).unzip()
            }
        };
        let mut gathered = Vec::with_capacity(indices.len() * len);
        for &index in &indices {
            builder.homes[index] = ABOVE;
            gathered.extend_from_slice(record(index));
        }
        Top { place: root, candidates, records: gathered }
    });

    let Builder { homes, mut spans, .. } = builder;
    spans.sort_by_key(|span| (span.level, span.range.start));
    if top.is_some() {
        // The root's own points are those that may move on.
        spans.remove(0);
    }
    let node = |Span { level, range }: Span| {
        if progress.cancelled() {
            return Err(Error::Cancelled);
        }
        let mut gathered = Vec::new();
        for index in range.clone().filter(|&index| u32::from(homes[index]) == level) {
            gathered.extend_from_slice(record(index));
        }
        let octant = codes[range.start] >> (3 * (bits - level));
        let place = Place { level: root.level + level, code: root.code << (3 * level) | octant };
        Ok(Node { place, packed: compressor.pack(&gathered)? })
    };
    let nodes = spans.into_par_iter().map(node).collect::<Result<_, Error>>()?;
    Ok(Part { nodes, top })
}

impl Builder<'_> {
    /// Builds the node of a range of points, and those below it.
    fn node(&mut self, range: Range<usize>, level: u32) -> Rising {
        self.spans.push(Span { level, range: range.clone() });
        // Points at one place cannot be taken apart.
        let apart = self.codes[range.start] != self.codes[range.end - 1];
        if range.len() <= LEAF || level >= self.deepest || !apart {
            self.homes[range.clone()].fill(level as u8);
            return Rising::All(range);
        }
        let shift = 3 * (self.bits - level - 1);
        let mut children = Vec::new();
        let mut start = range.start;
        while start < range.end {
            let octant = self.codes[start] >> shift;
            let end = start + self.codes[start..range.end].partition_point(|code| code >> shift == octant);
            children.push(self.node(start..end, level + 1));
            start = end;
        }
        let candidates = Candidates::of(children);
        let codes = self.codes;
        let cell_shift = (self.bits - level).saturating_sub(CELL_BITS);
        let mut choices = self.sampler.choose(candidates.count(), cell_shift, |index| candidates.get(index, codes));
        for choice in &mut choices {
            choice.index = candidates.index(choice.index as usize) as u32;
            if !choice.lone {
                self.homes[choice.index as usize] = level as u8;
            }
        }
        Rising::Chosen(choices)
    }
}

/// The candidates of a node's children, one after another.
struct Candidates {
    /// Index of the first candidate of each child, and what it is.
    children: Vec<(usize, Rising)>,
    count: usize,
    /// The child that was asked for last: most candidates follow each other.
    last: Cell<usize>,
}

impl Candidates {
    fn of(children: Vec<Rising>) -> Self {
        let mut count = 0;
        let mut first = |child: &Rising| {
            let first = count;
            count += match child {
                Rising::All(range) => range.len(),
                Rising::Chosen(choices) => choices.len(),
            };
            first
        };
        let children = children.into_iter().map(|child| (first(&child), child)).collect();
        Self { children, count, last: Cell::new(0) }
    }

    fn count(&self) -> usize {
        self.count
    }

    fn find(&self, index: usize) -> (usize, &Rising) {
        let mut child = self.last.get();
        let after = self.children.get(child + 1).map_or(self.count, |(first, _)| *first);
        if !(self.children[child].0..after).contains(&index) {
            child = self.children.partition_point(|(first, _)| *first <= index) - 1;
            self.last.set(child);
        }
        let (first, rising) = &self.children[child];
        (index - first, rising)
    }

    /// Index of a candidate among the sorted records.
    fn index(&self, index: usize) -> usize {
        match self.find(index) {
            (at, Rising::All(range)) => range.start + at,
            (at, Rising::Chosen(choices)) => choices[at].index as usize,
        }
    }

    fn get(&self, index: usize, codes: &[u64]) -> Candidate {
        match self.find(index) {
            (at, Rising::All(range)) => {
                let place = unmorton(codes[range.start + at]);
                Candidate { place, mean: place, count: 1 }
            }
            (at, Rising::Chosen(choices)) => {
                let Choice { index, mean, count, .. } = choices[at];
                Candidate { place: unmorton(codes[index as usize]), mean, count }
            }
        }
    }
}

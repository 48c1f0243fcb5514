//! Joins the parts of the tree: the nodes above them, from the bottom up.
//!
//! # How it works
//!
//! Parts come in the order of the Morton curve, so a node above them is complete once a part beyond it comes. Then the
//! [`Sampler`] chooses which points of its children move up, and the children are written with what is left.

use autosplats_cloud::Error;
use rayon::prelude::*;

use super::{
    build::Top,
    compress::{Compressor, Node},
    file::TreeFile,
    frame::CELL_BITS,
    key::Place,
    sample::{Candidate, Sampler},
};

/// The nodes that wait for further children.
pub(super) struct Tops<'a> {
    bits: u32,
    compressor: &'a Compressor,
    sampler: Sampler,
    /// From the root down.
    open: Vec<(Place, Vec<Top>)>,
}

impl<'a> Tops<'a> {
    pub(super) fn new(bits: u32, compressor: &'a Compressor) -> Self {
        Self { bits, compressor, sampler: Sampler::new(), open: Vec::new() }
    }

    /// Adds the root of a part, which is not the whole tree's.
    pub(super) fn add(&mut self, top: Top, file: &mut TreeFile<'_, '_>) -> Result<(), Error> {
        let parent = top.place.parent();
        while self.open.last().is_some_and(|(open, _)| !parent.is_in(*open)) {
            self.close(file)?;
        }
        let from = self.open.last().map_or(0, |(open, _)| open.level + 1);
        for level in from..=parent.level {
            let place = Place { level, code: parent.code >> (3 * (parent.level - level)) };
            self.open.push((place, Vec::new()));
        }
        if let Some((_, children)) = self.open.last_mut() {
            children.push(top);
        }
        Ok(())
    }

    /// Completes all nodes.
    pub(super) fn finish(mut self, file: &mut TreeFile<'_, '_>) -> Result<(), Error> {
        while !self.open.is_empty() {
            self.close(file)?;
        }
        Ok(())
    }

    /// Completes the lowest node that waits.
    fn close(&mut self, file: &mut TreeFile<'_, '_>) -> Result<(), Error> {
        let Some((place, children)) = self.open.pop() else { return Ok(()) };
        let all: Vec<Candidate> = children.iter().flat_map(|child| child.candidates.iter().copied()).collect();
        let shift = (self.bits - place.level).saturating_sub(CELL_BITS);
        let mut choices = self.sampler.choose(all.len(), shift, |index| all[index]);
        choices.retain(|choice| !choice.lone);
        let candidates = choices.iter().map(|choice| Candidate {
            place: all[choice.index as usize].place,
            mean: choice.mean,
            count: choice.count,
        });
        let mut top = Top { place, candidates: candidates.collect(), records: Vec::new() };
        let len = self.compressor.record_len;
        let mut chosen = choices.iter().map(|choice| choice.index as usize).peekable();
        let mut index = 0;
        let mut left = Vec::with_capacity(children.len());
        for child in children {
            let mut stays = Vec::with_capacity(child.records.len());
            for record in child.records.chunks_exact(len) {
                let to = if chosen.next_if_eq(&index).is_some() { &mut top.records } else { &mut stays };
                to.extend_from_slice(record);
                index += 1;
            }
            left.push((child.place, stays));
        }
        if place == Place::ROOT {
            left.push((place, std::mem::take(&mut top.records)));
        }
        let compressor = self.compressor;
        let pack = |(place, records): (Place, Vec<u8>)| Ok(Node { place, packed: compressor.pack(&records)? });
        let nodes = left.into_par_iter().map(pack).collect::<Result<Vec<_>, Error>>()?;
        nodes.into_iter().try_for_each(|node| file.put(node))?;
        match self.open.last_mut() {
            Some((_, siblings)) => siblings.push(top),
            None => debug_assert_eq!(place, Place::ROOT, "only the root has no parent"),
        }
        Ok(())
    }
}

//! Extra bytes: the values beyond those of the point format, joined over all inputs.

use std::path::Path;

use autosplats_cloud::{Error, Progress, printable};

use crate::las::{self, EXTRA_DESCRIPTOR};

/// Bits of the options that tell whether least and greatest values are stated, and where those are.
const LIMITS: u8 = 2 | 4;
const LIMIT_BYTES: std::ops::Range<usize> = 64..112;

/// Layout of extra bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Extras(Vec<Extra>);

/// Some of the extra bytes.
#[derive(Clone, Debug, PartialEq)]
struct Extra {
    /// `None` for bytes that nothing describes.
    descriptor: Option<[u8; EXTRA_DESCRIPTOR]>,
    len: usize,
}

impl Extra {
    /// The description without the least and the greatest value, which are of one file.
    fn plain(&self) -> Self {
        let plain = |mut raw: [u8; EXTRA_DESCRIPTOR]| {
            raw[3] &= !LIMITS;
            raw[LIMIT_BYTES].fill(0);
            raw
        };
        // The options of bytes without a type are their number.
        Self { descriptor: self.descriptor.map(|raw| if raw[2] == 0 { raw } else { plain(raw) }), len: self.len }
    }

    fn name(&self) -> Option<&[u8]> {
        self.descriptor.as_ref().map(|raw| raw[4..36].split(|&byte| byte == 0).next().unwrap_or_default())
    }
}

impl Extras {
    /// The layout of `len` extra bytes with these descriptions.
    pub(super) fn of(len: usize, descriptors: &[[u8; EXTRA_DESCRIPTOR]]) -> Self {
        let mut extras = Vec::new();
        let mut left = len;
        for raw in descriptors {
            // Of bytes without a type, the options are their number.
            let len = if raw[2] == 0 { Some(raw[3].into()) } else { las::extra_size(raw[2]) };
            let Some(len) = len.filter(|&len| len <= left) else { break };
            extras.push(Extra { descriptor: Some(*raw), len });
            left -= len;
        }
        if left > 0 {
            extras.push(Extra { descriptor: None, len: left });
        }
        Self(extras)
    }

    pub(super) fn len(&self) -> usize {
        self.0.iter().map(|extra| extra.len).sum()
    }

    pub(super) fn descriptors(&self) -> Vec<[u8; EXTRA_DESCRIPTOR]> {
        self.0.iter().filter_map(|extra| extra.descriptor).collect()
    }

    fn plain(&self) -> Self {
        Self(self.0.iter().map(Extra::plain).collect())
    }

    /// The layout that holds those of all inputs.
    pub(super) fn join<'a>(
        inputs: impl Iterator<Item = (&'a Path, &'a Self)> + Clone,
        progress: &dyn Progress,
    ) -> Result<Self, Error> {
        let Some((_, first)) = inputs.clone().next() else { return Ok(Self::default()) };
        if inputs.clone().all(|(_, extras)| extras == first) {
            return Ok(first.clone());
        }
        let plain = first.plain();
        if inputs.clone().all(|(_, extras)| extras.plain() == plain) {
            return Ok(plain);
        }
        let mut all: Vec<Extra> = Vec::new();
        for (input, extras) in inputs.clone() {
            for extra in extras.plain().0 {
                let Some(name) = extra.name() else {
                    let what = "some of its extra bytes are not described, so they cannot be joined with other files";
                    return Err(Error::unsupported(input, what));
                };
                match all.iter().find(|other| other.name() == Some(name)) {
                    Some(other) if *other == extra => {}
                    Some(_) => {
                        let name = printable(&String::from_utf8_lossy(name));
                        let what = format!("its extra value '{name}' is not described as in the other inputs");
                        return Err(Error::unsupported(input, what));
                    }
                    None => all.push(extra),
                }
            }
        }
        // The order of the inputs does not matter.
        all.sort_by(|a, b| a.name().cmp(&b.name()));
        let lacking = |extra: &&Extra| !inputs.clone().all(|(_, extras)| extras.plain().0.contains(extra));
        for extra in all.iter().filter(lacking) {
            let name = printable(&String::from_utf8_lossy(extra.name().unwrap_or_default()));
            progress.note(&format!("not all inputs have the extra value '{name}'; it is 0 in the others"));
        }
        Ok(Self(all))
    }

    /// What to copy from extra bytes of this layout to those of `other`: from, to, and length.
    pub(super) fn moves(&self, other: &Self) -> Vec<(usize, usize, usize)> {
        let mut from = 0;
        let mut moves = Vec::new();
        for extra in &self.0 {
            let mut to = 0;
            for own in &other.0 {
                if own.plain() == extra.plain() {
                    moves.push((from, to, extra.len));
                    break;
                }
                to += own.len;
            }
            from += extra.len;
        }
        moves
    }
}

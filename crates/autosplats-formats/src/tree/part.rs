//! Reading a part of a tree as one cloud.

use autosplats_cloud::{Error, Key, PointCloud, Progress, Tree, Unit, Wanted, check_memory, tell_loss};
use glam::DVec3;
use rayon::prelude::*;

use super::{
    walk::{Found, walk},
    watch::chosen,
};

/// Nodes that are in memory at once as they are stored, beside those that are fetched meanwhile.
const BATCH_BYTES: u64 = 8 << 20;
const BATCH_NODES: usize = 64;

/// Parts of a degree to which an origin in degrees is rounded.
const PARTS_PER_DEGREE: f64 = 1e6;

/// Which points of a tree to read. The default is all of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Lowest and highest corner of the box that the points are in, in world coordinates.
    pub bounds: Option<[DVec3; 2]>,
    /// Distance between neighbouring points that suffices, in world units: finer levels are left out.
    pub spacing: Option<f64>,
    /// Keep points at (0, 0, 0), which scanners write for missing returns.
    pub keep_no_returns: bool,
    /// Take only whole trees: damaged nodes are an error.
    pub whole: bool,
}

/// Reads a part of a tree into one cloud, whose points are those of reading the file whole. Only nodes that may have
/// points of the part are read, in parallel. [`Wanted::origin`] `None` takes the middle of the part.
///
/// Damaged nodes are left out, which is noted, and so is what the tree finds odd.
///
/// # Errors
/// Those of reading; [`Error::Malformed`] if no node can be decoded; [`Error::NothingKept`]; [`Error::OutOfMemory`];
/// and [`Error::Cancelled`] if `progress` says so.
pub fn read_part(tree: &dyn Tree, part: &Part, wanted: &Wanted, progress: &dyn Progress) -> Result<PointCloud, Error> {
    progress.tick(0.0)?;
    let info = tree.info();
    info.notes.iter().for_each(|note| progress.note(note));
    let (mut nodes, _) = walk(tree, |key| part.has(tree, key), Some(progress))?;
    let total: u64 = nodes.iter().map(|node| u64::from(node.points)).sum();
    if (part.bounds, part.spacing) == (None, None) && total != info.points {
        progress.note(&format!("{} points are stated, but the hierarchy has {total}", info.points));
    }
    nodes.retain(|node| node.points > 0);
    if let Some(filter) = wanted.keep.as_ref().filter(|filter| !filter.is_all() && !filter.is_usual())
        && !info.fields.iter().any(|field| filter.needs(field))
    {
        let there = info.fields.join(", ");
        let what = format!("--keep {filter}: its points have no such field; there are {there}");
        return Err(Error::unsupported(tree.name(), what));
    }
    // The filter acts here, so that it is known how many points it leaves out.
    let mut all = Wanted { keep: None, origin: Some(wanted.origin.unwrap_or(part.origin(tree))), ..wanted.clone() };
    if let Some(fields) = &mut all.fields {
        fields.extend(info.fields.iter().filter(|field| wanted.needs(field)).cloned());
    }
    let name = tree.name().file_name().unwrap_or_default().to_string_lossy().into_owned();
    check_memory(&format!("the {total} points of {name}"), total.saturating_mul(tree.point_bytes(&all) as u64))?;

    let mut reading =
        Reading { tree, part, wanted, all: &all, progress, total, done: 0, read: 0, lost: 0, fault: None };
    let mut cloud = reading.read(&nodes)?;
    if let Some(fault) = reading.fault.take() {
        if reading.lost == total {
            return Err(fault);
        }
        let lost = reading.lost;
        let loss = format!("damaged nodes: {lost} of {total} points are lost; copy it again");
        tell_loss(tree.name(), "nodes", &loss, part.whole, progress)?;
    }
    let (read, left) = (reading.read, reading.read - cloud.len() as u64);
    if let Some(filter) = wanted.keep.as_ref().filter(|_| left > 0) {
        if !cloud.is_empty() {
            progress.note(&filter.left_out_note(left, read));
        } else if filter.is_usual() {
            progress.note(&format!("all {read} points are noise or withheld, so they are kept"));
            return read_part(tree, part, &Wanted { keep: None, ..wanted.clone() }, progress);
        } else {
            let (path, filter, points) = (tree.name().into(), filter.to_string(), read as usize);
            return Err(Error::NothingKept { path, filter, points, there: String::new() });
        }
    }
    tree.take_notes().iter().for_each(|note| progress.note(note));
    settle(&mut cloud, part, progress);
    progress.tick(1.0)?;
    Ok(cloud)
}

/// Applies what depends on all points, as reading a file does.
fn settle(cloud: &mut PointCloud, part: &Part, progress: &dyn Progress) {
    let count = cloud.len();
    let dropped = if part.keep_no_returns { 0 } else { cloud.drop_no_returns(|found| (2..count).contains(&found)) };
    if dropped > 0 {
        progress.note(&format!("dropped {dropped} of {count} points at (0, 0, 0), where nothing was measured"));
    }
    // Colours that 8 bits keep need no fields.
    let names = ["Red", "Green", "Blue"];
    let kept = |value: f64| value == (value / 256.0).floor() * 257.0;
    let lossless = |name: &str| {
        cloud.field(name).is_none_or(|field| (0..cloud.len()).into_par_iter().all(|i| kept(field.values.get(i))))
    };
    if cloud.colors().is_some()
        && names.iter().any(|name| cloud.field(name).is_some())
        && names.into_iter().all(lossless)
    {
        cloud.retain_fields(|name| !names.contains(&name));
    }
}

impl Part {
    /// Whether a node and nodes below it may have points of the part.
    fn has(&self, tree: &dyn Tree, key: Key) -> bool {
        let info = tree.info();
        let parent = info.spacing / f64::from(1_u32 << key.level.saturating_sub(1));
        if key.level > 0 && self.spacing.is_some_and(|spacing| parent <= spacing) {
            return false;
        }
        let [low, high] = key.cube(info.cube);
        // Coordinates are rounded when they are stored.
        let slack = info.resolution.unwrap_or_default();
        self.bounds.is_none_or(|[min, max]| low.cmple(max + slack).all() && high.cmpge(min - slack).all())
    }

    /// The middle of the part, of whole numbers or millionths of a degree.
    fn origin(&self, tree: &dyn Tree) -> DVec3 {
        let info = tree.info();
        let [low, high] = info.bounds;
        let [low, high] = match self.bounds {
            Some([min, max]) if low.max(min).cmple(high.min(max)).all() => [low.max(min), high.min(max)],
            _ => [low, high],
        };
        let parts = if info.crs.unit == Some(Unit::Degree) { PARTS_PER_DEGREE } else { 1.0 };
        (low.midpoint(high) * parts).round() / parts
    }
}

/// State of the reading.
struct Reading<'a> {
    tree: &'a dyn Tree,
    part: &'a Part,
    wanted: &'a Wanted,
    /// What is decoded: what is wanted, and what tells which points to keep.
    all: &'a Wanted,
    progress: &'a dyn Progress,
    total: u64,
    /// Number of points decoded, of those inside the box, and of lost ones.
    done: u64,
    read: u64,
    lost: u64,
    /// The first fault of a node.
    fault: Option<Error>,
}

impl Reading<'_> {
    /// Reads nodes in order. The first is read alone, since it settles what holds of all.
    fn read(&mut self, nodes: &[Found]) -> Result<PointCloud, Error> {
        let mut cloud = PointCloud::new(self.all.origin.unwrap_or_default(), Vec::new());
        let fetch = |batch: &[Found]| {
            let keys: Vec<Key> = batch.iter().map(|node| node.key).collect();
            self.tree.fetch(&keys, self.progress)
        };
        let (mut batch, mut rest) = nodes.split_at(nodes.len().min(1));
        let mut stored = fetch(batch)?;
        while !batch.is_empty() {
            self.progress.tick(self.done as f32 / self.total as f32)?;
            let (next, after) = rest.split_at(batch_len(rest));
            let (decoded, fetched) = rayon::join(|| self.decoded(batch, &stored), || fetch(next));
            for (node, decoded) in batch.iter().zip(decoded) {
                self.done += u64::from(node.points);
                match decoded {
                    Ok((points, inside)) => {
                        self.read += inside;
                        cloud.append(points);
                    }
                    Err(error @ Error::Malformed { .. }) => {
                        self.lost += u64::from(node.points);
                        self.fault.get_or_insert(error);
                    }
                    Err(error) => return Err(error),
                }
            }
            (stored, batch, rest) = (fetched?, next, after);
        }
        if cloud.is_empty() {
            cloud = cloud.with_crs(self.tree.info().crs.clone());
        }
        Ok(cloud)
    }

    /// The points of nodes, and the number of those inside the box.
    fn decoded(&self, batch: &[Found], stored: &[Vec<u8>]) -> Vec<Result<(PointCloud, u64), Error>> {
        let one = |(node, bytes): (&Found, &Vec<u8>)| {
            if self.progress.cancelled() {
                return Err(Error::Cancelled);
            }
            let mut cloud = self.tree.decode(node.key, bytes, self.all)?;
            if let Some([min, max]) = self.part.bounds {
                cloud.crop(min, max);
            }
            let inside = cloud.len() as u64;
            Ok((chosen(cloud, self.wanted), inside))
        };
        batch.par_iter().zip(stored).map(one).collect()
    }
}

/// Number of nodes that are fetched together.
fn batch_len(nodes: &[Found]) -> usize {
    let mut bytes = 0;
    let fits = |node: &&Found| {
        bytes += node.bytes;
        bytes <= BATCH_BYTES
    };
    nodes.iter().take(BATCH_NODES).take_while(fits).count().max(1).min(nodes.len())
}

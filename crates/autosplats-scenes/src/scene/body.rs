//! A body: solids joined and cut in order, with smooth seams.

use glam::DVec3;

use super::paint::Paint;
use super::shape::{Shape, Similarity};

/// How a solid combines with earlier solids of its group, or a group with earlier groups.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Op {
    /// Union.
    Join,
    /// Subtraction.
    Cut,
}

/// Radius within which a seam is rounded; zero for a sharp seam. Beyond the radius the seam changes no bit of the
/// bound, so a cell of space can drop all solids but the near ones.
#[derive(Clone, Copy, Debug)]
struct Seam {
    radius: f64,
    quarter: f64,
}

impl Seam {
    fn new(radius: f64) -> Self {
        Self { radius, quarter: if radius > 0.0 { 0.25 / radius } else { 0.0 } }
    }

    #[inline]
    fn min(self, a: f64, b: f64) -> f64 {
        let near = (self.radius - (a - b).abs()).max(0.0);
        a.min(b) - near * near * self.quarter
    }

    #[inline]
    fn apply(self, op: Op, a: f64, b: f64) -> f64 {
        match op {
            Op::Join => self.min(a, b),
            Op::Cut => -self.min(-a, b),
        }
    }

    /// Whether `b` leaves `a` unchanged everywhere within `slack / 2` metres.
    fn spares(self, op: Op, a: f64, b: f64, slack: f64) -> bool {
        match op {
            Op::Join => b >= a + self.radius + slack,
            Op::Cut => -b + self.radius + slack <= a,
        }
    }

    /// Share of the second solid's paint where two solids meet.
    fn blend(self, op: Op, a: f64, b: f64) -> f32 {
        let (a, b) = match op {
            Op::Join => (a, b),
            Op::Cut => (-a, b),
        };
        let near = (self.radius - (a - b).abs()).max(0.0);
        let minor = 2.0 * near * near * self.quarter / self.radius.max(1e-30);
        (if b < a { 1.0 - minor } else { minor }) as f32
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    shape: Shape,
    op: Op,
    seam: Seam,
    paint: Paint,
    group: u16,
    /// Adjacent solids with the same number form a chain. A chain is joined without seams first, so that its seam to
    /// other solids does not swell at the links.
    chain: u16,
}

#[derive(Clone, Copy, Debug)]
struct Group {
    op: Op,
    seam: Seam,
    zone: usize,
}

/// Solids in order, in groups. A group is built first and then combined with the earlier groups.
#[derive(Clone, Debug)]
pub(super) struct Body {
    nodes: Vec<Node>,
    groups: Vec<Group>,
    /// Transform applied to every added solid.
    pub(super) frame: Similarity,
    /// Paint of every added solid.
    pub(super) paint: Paint,
    /// Zone of every new group.
    pub(super) zone: usize,
}

impl Body {
    pub(super) fn new(paint: Paint) -> Self {
        Self { nodes: Vec::new(), groups: Vec::new(), frame: Similarity::IDENTITY, paint, zone: 0 }
    }

    /// Starts a group that is combined with all earlier groups by `op`, with a seam of `radius`.
    pub(super) fn group(&mut self, op: Op, radius: f64) -> &mut Self {
        self.groups.push(Group { op, seam: Seam::new(radius * self.frame.scale), zone: self.zone });
        self
    }

    fn add(&mut self, op: Op, radius: f64, shape: Shape, linked: bool) -> &mut Self {
        let before = self.nodes.last().map_or(0, |node| node.chain);
        let chain = if linked { before } else { before.wrapping_add(1) };
        let group = u16::try_from(self.groups.len() - 1).expect("bodies have fewer than 65536 groups");
        let shape = shape.mapped(&self.frame);
        let seam = Seam::new(radius * self.frame.scale);
        self.nodes.push(Node { shape, op, seam, paint: self.paint, group, chain });
        self
    }

    /// Adds `shape` to the group.
    pub(super) fn join(&mut self, radius: f64, shape: Shape) -> &mut Self {
        self.add(Op::Join, radius, shape, false)
    }

    /// Subtracts `shape` from the group.
    pub(super) fn cut(&mut self, radius: f64, shape: Shape) -> &mut Self {
        self.add(Op::Cut, radius, shape, false)
    }

    /// Joins a chain of round cones through `points` (position, radius).
    pub(super) fn strand(&mut self, radius: f64, points: &[(DVec3, f64)]) -> &mut Self {
        for (i, pair) in points.windows(2).enumerate() {
            self.add(Op::Join, radius, Shape::cone(pair[0].0, pair[1].0, pair[0].1, pair[1].1), i > 0);
        }
        self
    }

    /// All solids, for the root cell.
    pub(super) fn all(&self) -> Vec<u16> {
        (0..u16::try_from(self.nodes.len()).expect("bodies have fewer than 65536 solids")).collect()
    }

    /// Number of zones.
    pub(super) fn zones(&self) -> usize {
        self.groups.iter().map(|group| group.zone + 1).max().unwrap_or(0)
    }

    /// Whether `list` has a solid of `zone`.
    pub(super) fn touches(&self, list: &[u16], zone: usize) -> bool {
        list.iter().any(|&id| self.groups[usize::from(self.nodes[usize::from(id)].group)].zone == zone)
    }

    /// Signed distance bound at `p`, where only the solids in `list` matter.
    #[inline]
    pub(super) fn distance(&self, p: DVec3, list: &[u16]) -> f64 {
        let Some((&first, rest)) = list.split_first() else { return f64::INFINITY };
        let (mut total, mut part) = (f64::INFINITY, f64::INFINITY);
        let mut last = &self.nodes[usize::from(first)];
        let mut link = last.shape.distance(p);
        for &id in rest {
            let node = &self.nodes[usize::from(id)];
            let d = node.shape.distance(p);
            if node.chain == last.chain {
                link = link.min(d);
                continue;
            }
            part = last.seam.apply(last.op, part, link);
            link = d;
            if node.group != last.group {
                let group = &self.groups[usize::from(last.group)];
                total = group.seam.apply(group.op, total, part);
                part = f64::INFINITY;
            }
            last = node;
        }
        part = last.seam.apply(last.op, part, link);
        let group = &self.groups[usize::from(last.group)];
        group.seam.apply(group.op, total, part)
    }

    /// Splits the list where the group or the chain changes.
    fn runs<'a>(&'a self, list: &'a [u16], key: impl Fn(&Node) -> u16 + 'a) -> impl Iterator<Item = &'a [u16]> {
        list.chunk_by(move |&a, &b| key(&self.nodes[usize::from(a)]) == key(&self.nodes[usize::from(b)]))
    }

    /// Colour and zone of the surface at `p`. `world` is the position of `p` before folding.
    pub(super) fn paint(&self, p: DVec3, world: DVec3, list: &[u16]) -> ([f32; 3], usize) {
        let mix = |a: [f32; 3], b: [f32; 3], t: f32| -> [f32; 3] { std::array::from_fn(|i| a[i] + (b[i] - a[i]) * t) };
        let (mut total, mut total_rgb, mut zone) = (f64::INFINITY, [0.5; 3], 0);
        for run in self.runs(list, |node| node.group) {
            let group = &self.groups[usize::from(self.nodes[usize::from(run[0])].group)];
            let (mut part, mut part_rgb) = (f64::INFINITY, [0.5; 3]);
            for chain in self.runs(run, |node| node.chain) {
                let distances = chain.iter().map(|&id| (self.nodes[usize::from(id)].shape.distance(p), id));
                let Some((d, id)) = distances.min_by(|a, b| a.0.total_cmp(&b.0)) else { continue };
                let node = &self.nodes[usize::from(id)];
                let share = node.seam.blend(node.op, part, d);
                if share > 0.0 {
                    part_rgb = mix(part_rgb, node.paint.rgb(world), share);
                }
                part = node.seam.apply(node.op, part, d);
            }
            let share = group.seam.blend(group.op, total, part);
            total_rgb = mix(total_rgb, part_rgb, share);
            if share > 0.5 {
                zone = group.zone;
            }
            total = group.seam.apply(group.op, total, part);
        }
        (total_rgb, zone)
    }

    /// Writes the solids of `list` that matter anywhere within `radius` of `center` to `kept`, and returns the distance
    /// bound at `center`. The kept solids give the same bound, bit by bit, everywhere in that ball.
    pub(super) fn prune(&self, list: &[u16], center: DVec3, radius: f64, kept: &mut Vec<u16>) -> f64 {
        kept.clear();
        let slack = 2.0 * radius;
        let mut total = f64::INFINITY;
        for run in self.runs(list, |node| node.group) {
            let start = kept.len();
            let mut part = f64::INFINITY;
            for chain in self.runs(run, |node| node.chain) {
                let node = &self.nodes[usize::from(chain[0])];
                let link = kept.len();
                let mut d = f64::INFINITY;
                for &id in chain {
                    let next = self.nodes[usize::from(id)].shape.distance(center);
                    if next < d + slack {
                        if d >= next + slack {
                            kept.truncate(link);
                        }
                        kept.push(id);
                        d = d.min(next);
                    }
                }
                if part < f64::INFINITY && node.seam.spares(node.op, part, d, slack) {
                    kept.truncate(link);
                    continue;
                }
                if node.op == Op::Join && node.seam.spares(Op::Join, d, part, slack) {
                    kept.drain(start..link);
                }
                part = node.seam.apply(node.op, part, d);
            }
            let Group { op, seam, .. } = self.groups[usize::from(self.nodes[usize::from(run[0])].group)];
            if total < f64::INFINITY && seam.spares(op, total, part, slack) {
                kept.truncate(start);
                continue;
            }
            if op == Op::Join && seam.spares(Op::Join, part, total, slack) {
                kept.drain(..start);
            }
            total = seam.apply(op, total, part);
        }
        total
    }
}

//! Chains of silhouette edges, which are edges where a surface ends on screen. A chain consists of
//! the visible parts of such edges that are joined at vertices or by short hidden edges. Chains that
//! are too short are not drawn, unless they border the background or leave the picture. Nor is a long
//! run of parts drawn if surfaces closely behind hide most of its outline: a dotted line would be
//! left.
//!
//! Scans and coarse meshes have a multitude of tiny folds. Each has a silhouette of a few pixels,
//! and an outline beside it would look like a speck of dirt.

use crate::limits::{Deadline, Stopped};
use crate::mesh::union_find::UnionFind;
use crate::plan::context::{CHECK_EVERY, PlanContext};
use crate::plan::outline::screen_edges::{OutlineView, ScreenEdge};
use crate::plan::outline::silhouette_edges::SilhouetteEdge;
use crate::plan::outline::visible_parts::VisiblePart;
use crate::plan::{PX, PlanError};

/// The least length of a chain, in multiples of its outline's width.
const LENGTH_MIN: f64 = 4.0;

/// Hidden edges between visible ones hold a chain together up to this length, in multiples of the
/// outline's width.
const BRIDGED: f64 = 1.0;

/// The least share of an outline's width that is more than a dotted line.
const SHOWN_MIN: f64 = 0.45;

/// Parts whose outline is hidden by what lies closely behind it are drawn where they are connected
/// and shorter in all than this, in multiples of the outline's width: a line has no gaps there.
const GAP_MAX: f64 = 2.0;

/// Lengths are whole numbers, whose sums do not depend on an order: so many are the least length.
const LEAST: f64 = 65_536.0;

/// The least length of chains.
#[derive(Clone, Debug)]
pub struct ChainLength {
    /// By material, in pixels; None: in proportion to the outline's width.
    pub min_px: Vec<Option<f32>>,
    /// The outline's whole width in multiples of its reach.
    pub width: f64,
}

impl ChainLength {
    /// The least length of a material's chains where its outline reaches so far, 1/256 px.
    fn least(&self, material: u32, reach: f64) -> f64 {
        match self.min_px.get(material as usize) {
            Some(Some(px)) => PX * f64::from(*px),
            _ => LENGTH_MIN * self.width * reach,
        }
    }
}

/// Removes the parts of short chains. Returns the number of chains that were removed.
pub fn remove_short(
    parts: &mut Vec<VisiblePart>,
    view: &OutlineView<'_>,
    edges: &[SilhouetteEdge],
    places: &[ScreenEdge],
    length: &ChainLength,
    cx: &mut PlanContext<'_>,
) -> Result<u32, PlanError> {
    if parts.is_empty() || length.min_px.iter().all(|px| *px == Some(0.0)) {
        return Ok(0);
    }
    let mut chains = Chains::new(view, edges, places, parts, length, cx)?;
    chains.bridge()?;
    chains.join()?;
    let sums = chains.sums();
    let roots: Vec<u32> = (0..parts.len()).map(|i| chains.sets.find(i as u32)).collect();
    let is_dotted = chains.dotted()?;
    let mut dropped = 0;
    let mut keeps = Vec::with_capacity(parts.len());
    for (i, root) in roots.into_iter().enumerate() {
        let is_long = sums[root as usize] >= LEAST as u64;
        dropped += u32::from(root == i as u32 && !is_long);
        keeps.push(is_long && !is_dotted[i]);
    }
    let mut keeps = keeps.into_iter();
    parts.retain(|_| keeps.next().unwrap_or(true));
    Ok(dropped)
}

/// Parts, and edges that are hidden wholly, joined at their vertices.
struct Chains<'a> {
    view: &'a OutlineView<'a>,
    length: &'a ChainLength,
    deadline: &'a Deadline,
    edges: &'a [SilhouetteEdge],
    places: &'a [ScreenEdge],
    parts: &'a [VisiblePart],
    /// Edges without a visible part.
    hidden: Vec<u32>,
    /// By part, then by hidden edge. Representatives of sets with parts are parts.
    sets: UnionFind,
    /// By vertex: the last member there, plus 1.
    last: Vec<u32>,
    /// By hidden edge: it holds what it touches together.
    is_bridge: Vec<bool>,
}

impl<'a> Chains<'a> {
    fn new<'c: 'a>(
        view: &'a OutlineView<'a>,
        edges: &'a [SilhouetteEdge],
        places: &'a [ScreenEdge],
        parts: &'a [VisiblePart],
        length: &'a ChainLength,
        cx: &mut PlanContext<'c>,
    ) -> Result<Self, PlanError> {
        let vertices = view.view.mesh.positions.len();
        // A hidden edge's number, set, sum and mark; a part's set, root, sum and mark,
        // and for dotted lines set, sum and mark; a vertex.
        cx.budget.spend("an outline's chains", edges.len() as u64, 4 + 4 + 8 + 1)?;
        cx.budget.spend("an outline's chains", parts.len() as u64, 4 + 4 + 8 + 1 + 4 + 8 + 1)?;
        cx.budget.spend("an outline's chains", vertices as u64, 4)?;
        let mut hidden = Vec::with_capacity(edges.len());
        let mut rest = parts;
        for i in 0..edges.len() as u32 {
            let count = rest.iter().take_while(|part| part.edge == i).count();
            if count == 0 && places[i as usize].may_show {
                hidden.push(i);
            }
            rest = &rest[count..];
        }
        let sets = UnionFind::new(parts.len() + hidden.len());
        let is_bridge = vec![false; hidden.len()];
        let (last, deadline) = (vec![0; vertices], cx.deadline);
        Ok(Self { view, length, deadline, edges, places, parts, hidden, sets, last, is_bridge })
    }

    /// The width of an edge's outline at its first end, 1/256 px.
    fn width(&self, edge: usize) -> f64 {
        self.length.width * self.view.reach(self.edges[edge].material, self.places[edge].ends[0][3])
    }

    /// Finds the hidden edges that hold chains together: connected ones that are short in all.
    fn bridge(&mut self) -> Result<(), Stopped> {
        let first = self.parts.len();
        for i in 0..self.hidden.len() {
            if i % CHECK_EVERY == 0 {
                self.deadline.check()?;
            }
            for end in 0..2 {
                self.touch(self.hidden[i], end, first + i);
            }
        }
        let mut lengths = vec![0_u64; self.hidden.len()];
        for i in 0..self.hidden.len() {
            let edge = self.hidden[i] as usize;
            let limit = BRIDGED * self.width(edge);
            let root = self.sets.find((first + i) as u32) as usize - first;
            lengths[root] += share(self.places[edge].way().length, limit);
        }
        for i in 0..self.hidden.len() {
            let root = self.sets.find((first + i) as u32) as usize - first;
            self.is_bridge[i] = lengths[root] <= LEAST as u64;
        }
        self.last.fill(0);
        Ok(())
    }

    /// Joins all parts.
    fn join(&mut self) -> Result<(), Stopped> {
        for (i, part) in self.parts.iter().enumerate() {
            if i % CHECK_EVERY == 0 {
                self.deadline.check()?;
            }
            for end in (0..2).filter(|&end| part.range[end] == [0.0, 1.0][end]) {
                self.touch(part.edge, end, i);
            }
        }
        for i in 0..self.hidden.len() {
            for end in if self.is_bridge[i] { 0..2 } else { 0..0 } {
                self.touch(self.hidden[i], end, self.parts.len() + i);
            }
        }
        Ok(())
    }

    /// Joins a member to what is at one of its edge's vertices.
    fn touch(&mut self, edge: u32, end: usize, member: usize) {
        if self.places[edge as usize].is_whole[end] {
            let last = &mut self.last[self.edges[edge as usize].vertices[end] as usize];
            if *last > 0 {
                self.sets.unite(*last - 1, member as u32);
            }
            *last = member as u32 + 1;
        }
    }

    /// By part, true if it belongs to a long run of parts whose outline is hidden by what lies closely
    /// behind it: what is left of it would be a dotted line. Hidden edges belong to such runs, too. Chains are
    /// forgotten.
    fn dotted(&mut self) -> Result<Vec<bool>, Stopped> {
        let parts = self.parts;
        self.sets = UnionFind::new(parts.len() + self.hidden.len());
        self.last.fill(0);
        let is_weak = |part: &VisiblePart| part.shown < SHOWN_MIN && !part.is_border;
        let is_single = |i: usize| {
            let same = |other: Option<&VisiblePart>| other.is_some_and(|other| other.edge == parts[i].edge);
            !(same(parts.get(i + 1)) || i > 0 && same(parts.get(i - 1)))
        };
        for (i, part) in parts.iter().enumerate().filter(|(_, part)| is_weak(part)) {
            if i % CHECK_EVERY == 0 {
                self.deadline.check()?;
            }
            // The rest of its edge is hidden.
            let is_whole = is_single(i);
            for end in (0..2).filter(|&end| is_whole || part.range[end] == [0.0, 1.0][end]) {
                self.touch(part.edge, end, i);
            }
        }
        for i in 0..self.hidden.len() {
            if i % CHECK_EVERY == 0 {
                self.deadline.check()?;
            }
            for end in 0..2 {
                self.touch(self.hidden[i], end, parts.len() + i);
            }
        }
        let mut lengths = vec![0_u64; parts.len() + self.hidden.len()];
        let mut add = |chains: &mut Self, member: usize, edge: u32, range: f64| {
            let length = chains.places[edge as usize].way().length * range;
            let limit = GAP_MAX * chains.width(edge as usize);
            lengths[chains.sets.find(member as u32) as usize] += share(length, limit);
        };
        for (i, part) in parts.iter().enumerate().filter(|(_, part)| is_weak(part)) {
            let range = if is_single(i) { 1.0 } else { part.range[1] - part.range[0] };
            add(self, i, part.edge, range);
        }
        for i in 0..self.hidden.len() {
            add(self, parts.len() + i, self.hidden[i], 1.0);
        }
        Ok((0..parts.len()).map(|i| lengths[self.sets.find(i as u32) as usize] >= LEAST as u64).collect())
    }

    /// The lengths of all chains, by the part that represents each. What borders the background is
    /// long enough.
    fn sums(&mut self) -> Vec<u64> {
        let mut sums = vec![0_u64; self.parts.len()];
        for (i, part) in self.parts.iter().enumerate() {
            let place = &self.places[part.edge as usize];
            let material = self.edges[part.edge as usize].material;
            let limit = self.length.least(material, self.view.reach(material, place.at(part.range[0])[3]));
            let own = place.way().length * (part.range[1] - part.range[0]) * part.shown;
            let own = if part.is_border { LEAST as u64 } else { share(own, limit) };
            let root = self.sets.find(i as u32) as usize;
            sums[root] += own;
        }
        sums
    }
}

/// A length as a share of a limit, as a whole number.
fn share(length: f64, limit: f64) -> u64 {
    (length / limit.max(1e-9) * LEAST).min(LEAST) as u64
}

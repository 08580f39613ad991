use dual_bvh::{Candidates, DualBvh, Part, Tile};
use glam::DVec3;

use super::front::distance_squared;

/// How the receivers of a tile get at their contours, group by group.
#[derive(Default)]
pub(super) struct Searches {
    /// For each group the last tile that came to it, and how it searches.
    sharing: Vec<(u32, Sharing)>,
    tile: u32,
    /// Number of receivers of the tile.
    receivers: usize,
}

/// How a tile's receivers get at their contours in a group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Sharing {
    /// All share one search.
    #[default]
    Shared,
    /// Each searches for itself: together there would be so many candidates.
    Alone(usize),
    /// So they did, but the next one searches for all.
    Due,
}

/// A group is searched for each receiver alone while for the tile together there would be more candidates than so many and this
/// many times those of one: the contours of the body on which they lie, above all, are others for each of them.
const MANY: usize = 400;
const EXCESS: usize = 20;
/// So many candidates one is expected to have before it is known.
const EXPECTED: usize = 20;

/// In tiles of fewer receivers, and in groups of more edges, nobody searches alone: it shows what sharing costs, but may be in vain.
const SOME: usize = 8;
const LARGE: usize = 1 << 15;

fn are_too_many(together: usize, alone: usize) -> bool {
    together > MANY + EXCESS * alone
}

/// Whose contours are wanted.
#[derive(Clone, Copy)]
pub(super) struct Wanted<'a> {
    pub(super) edges: &'a DualBvh,
    pub(super) position: DVec3,
    /// Normal of the horizon below which nothing is searched, if the receiver searches alone.
    pub(super) horizon: Option<DVec3>,
    pub(super) excluded: &'a [u32],
    pub(super) tile: Tile<'a>,
    /// Whether all groups have been searched for the whole tile.
    pub(super) is_searched: bool,
}

impl Searches {
    /// Begins with another tile of so many receivers.
    pub(super) fn begin(&mut self, edges: &DualBvh, receivers: usize) {
        self.receivers = receivers;
        self.sharing.resize(edges.groups(), Default::default());
        self.tile = self.tile.checked_add(1).unwrap_or_else(|| {
            self.sharing.fill(Default::default());
            1
        });
    }

    /// Number of receivers of the tile.
    pub(super) fn receivers(&self) -> usize {
        self.receivers
    }

    /// What a receiver's contours in a group are among, searching it if that has not been done.
    pub(super) fn part(&mut self, group: u32, wanted: Wanted, candidates: &mut Candidates) -> Part {
        self.search(group, wanted, candidates);
        let Some(part) = candidates.part(group) else { unreachable!("the group has been searched") };
        let (_, sharing) = &mut self.sharing[group as usize];
        let count = part.edges.len();
        if matches!(*sharing, Sharing::Alone(together) if !are_too_many(together, count)) {
            *sharing = Sharing::Due;
        }
        part.clone()
    }

    /// Searches a group unless that has been done.
    fn search(&mut self, group: u32, wanted: Wanted, candidates: &mut Candidates) {
        let Wanted { edges, position, horizon, excluded, tile: whole, is_searched } = wanted;
        if is_searched {
            return;
        }
        let (tile, sharing) = &mut self.sharing[group as usize];
        if *tile != self.tile {
            let Tile { center, radius, .. } = whole;
            let distance = distance_squared(edges.group_boxes()[0][group as usize], center.as_vec3());
            let is_large = edges.group_edges(group).len() > LARGE;
            let is_apart = f64::from(distance) > radius * radius;
            let is_shared = is_apart || self.receivers < SOME || is_large;
            let most = if is_shared { usize::MAX } else { MANY + EXCESS * EXPECTED };
            let together = edges.search_few(group, &whole, most, candidates);
            *tile = self.tile;
            *sharing = if together > most { Sharing::Alone(together) } else { Sharing::Shared };
        } else if *sharing == Sharing::Due {
            *sharing = Sharing::Shared;
            edges.search_group(group, &whole, candidates);
        }
        if *sharing != Sharing::Shared {
            let lone = Tile::lone(position, horizon).with_faces(excluded);
            edges.search_group(group, &lone, candidates);
        }
    }
}

//! The way of a vessel to its task, and the task from there on.

use hydroid_core::guidance::{Path, Piece, Pose, SpeedLimits, SpeedProfile, dubins};
use hydroid_core::memory::Memory;

use super::track::Track;

/// Places at which a way may join the task, and their distance in radii.
const PLACES: u8 = 33;
const SPACING: f64 = 0.125;

/// Where a way begins.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) from: Pose,
    /// Speed of the vessel \[m/s\].
    pub(super) speed_m_s: f64,
    /// Radius of the turns \[m\].
    pub(super) radius: f64,
    /// Arc length of the task at which the vessel left it, or its start \[m\].
    pub(super) from_m: f64,
}

impl Start {
    pub(super) const NONE: Self = Self {
        from: Pose { position: [0.0; 2], course: 0.0, curvature: 0.0 },
        speed_m_s: 0.0,
        radius: 1.0,
        from_m: 0.0,
    };

    pub(super) fn visit_state(&mut self, memory: &mut Memory<'_>) {
        let Self { from, speed_m_s, radius, from_m } = self;
        memory.numbers(&mut from.position);
        for number in [&mut from.course, speed_m_s, radius, from_m] {
            memory.number(number);
        }
    }
}

/// A way from a pose to a place of the task, and the task from there to its end or for a lap.
#[derive(Clone, Debug)]
pub(super) struct Way {
    pub(super) start: Start,
    pub(super) path: Path,
    pub(super) profile: SpeedProfile,
    /// Length of the way to the task \[m\], and its time \[s\].
    pub(super) approach_m: f64,
    pub(super) duration_s: f64,
    /// Arc length of the task at which the way joins it \[m\].
    pub(super) join_m: f64,
}

/// Why there is no way to the task.
#[derive(Clone, Copy, Debug)]
pub(super) enum NoWay {
    /// The task is done, or the pose is not finite.
    End,
    /// All ways leave the fence.
    Fence,
}

impl Way {
    /// The shortest way with turns of the radius ([`dubins`]) in the fence. It joins the task within four radii; the part of
    /// the task that is left out counts as way.
    pub(super) fn plan(track: &Track, start: Start) -> Result<Self, NoWay> {
        let Track { path, fence, .. } = track;
        let Start { from, radius, from_m, .. } = start;
        let most = if path.is_closed() { f64::INFINITY } else { path.length() };
        let places = (0..PLACES).map(|place| from_m + SPACING * f64::from(place) * radius);
        let ways = places.filter(|s| *s <= most.max(from_m)).flat_map(|join_m| {
            let of = move |pieces: Vec<Piece>| {
                let approach_m: f64 = pieces.iter().map(|piece| piece.length).sum();
                (approach_m + join_m - from_m, approach_m, join_m, pieces)
            };
            dubins(&from, &path.at(join_m), radius).into_iter().map(of)
        });
        let mut ways: Vec<_> = ways.collect();
        if ways.is_empty() {
            return Err(NoWay::End);
        }
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let inside = ways.into_iter().find(|(.., pieces)| fence.leaves(pieces).is_none());
        let (_, approach_m, join_m, pieces) = inside.ok_or(NoWay::Fence)?;
        Self::along(track, start, pieces, [approach_m, join_m]).ok_or(NoWay::End)
    }

    /// A way along pieces, and the task.
    fn along(
        Track { path, limits, .. }: &Track,
        start: Start,
        mut pieces: Vec<Piece>,
        [approach_m, join_m]: [f64; 2],
    ) -> Option<Self> {
        let Start { speed_m_s, .. } = start;
        let limits = SpeedLimits { start: speed_m_s, ..*limits };
        let profile = |path: &Path| SpeedProfile::new(path, &limits).ok();
        let duration_s = match Path::new(pieces.clone(), false) {
            Ok(approach) => profile(&approach)?.duration(),
            Err(_) => 0.0,
        };
        pieces.extend(path.pieces_from(join_m));
        let path = Path::new(pieces, false).ok()?;
        Some(Self { start, profile: profile(&path)?, path, approach_m, duration_s, join_m })
    }
}

//! Paths of consecutive pieces, by arc length.

use alloc::vec::Vec;

use num_traits::Float;

use super::error::{PathError, finite, positive};
use super::piece::{Piece, Pose};

/// Largest gap between pieces \[m\]: rounding over kilometres.
const GAP: f64 = 1e-6;

/// Lines and arcs in sequence, by arc length `s` from the start \[m\].
///
/// The course is continuous except for [`legs`](Self::legs); the curvature, and with it the yaw rate, jumps between
/// pieces. A *closed* path continues at its start. An open path is extended by its tangents, so that a lookahead point
/// always exists.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    pieces: Vec<Piece>,
    starts: Vec<f64>,
    length: f64,
    closed: bool,
}

/// The point of a path nearest to a position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Arc length \[m\]; continuous over the laps of a closed path.
    pub s: f64,
    /// Pose of the path at this point.
    pub pose: Pose,
    /// Cross-track error, positive to starboard of the path \[m\].
    pub cross_track: f64,
}

impl Path {
    /// A path of adjacent pieces.
    ///
    /// # Errors
    /// If there is no piece, a piece is invalid, or two pieces (on a closed path also end and start) do not meet.
    pub fn new(pieces: Vec<Piece>, closed: bool) -> Result<Self, PathError> {
        let Some(last) = pieces.last() else {
            return Err(PathError::TooFew { what: "pieces of a path", needed: 1 });
        };
        let mut starts = Vec::with_capacity(pieces.len());
        let mut length = 0.0;
        let mut end = closed.then(|| last.at(last.length).position);
        for (piece, index) in pieces.iter().zip(0..) {
            finite("a piece of the path", [piece.start[0], piece.start[1], piece.course, piece.curvature])?;
            positive("the length of a piece of the path", piece.length)?;
            if let Some([x, y]) = end {
                let distance = Float::hypot(piece.start[0] - x, piece.start[1] - y);
                if distance > GAP {
                    return Err(PathError::Gap { piece: index, distance });
                }
            }
            end = Some(piece.at(piece.length).position);
            starts.push(length);
            length += piece.length;
        }
        Ok(Self { pieces, starts, length, closed })
    }

    /// The pieces.
    pub fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    /// Length \[m\]; of one lap for a closed path.
    pub fn length(&self) -> f64 {
        self.length
    }

    /// Whether the path is closed.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Arc length within the path, and the length of the whole laps before it.
    pub(super) fn within(&self, s: f64) -> (f64, f64) {
        if !self.closed {
            return (s, 0.0);
        }
        let laps = Float::floor(s / self.length) * self.length;
        (s - laps, laps)
    }

    /// The piece at an arc length within the path; the first or the last beyond the ends.
    pub(super) fn piece_at(&self, s: f64) -> usize {
        self.starts.partition_point(|start| *start <= s).saturating_sub(1)
    }

    /// Pose at arc length `s`.
    pub fn at(&self, s: f64) -> Pose {
        let (s, _) = self.within(s);
        let index = self.piece_at(s);
        let piece = &self.pieces[index];
        let d = s - self.starts[index];
        if self.closed || (0.0..=piece.length).contains(&d) {
            return piece.at(d);
        }
        let end = piece.at(d.clamp(0.0, piece.length));
        let beyond = Piece { start: end.position, course: end.course, curvature: 0.0, length: 1.0 };
        beyond.at(d - d.clamp(0.0, piece.length))
    }

    /// The pieces from arc length `s` to the end, or of the lap that begins there on a closed path.
    pub fn pieces_from(&self, s: f64) -> Vec<Piece> {
        let (s, _) = self.within(s);
        let s = s.clamp(0.0, self.length);
        let index = self.piece_at(s);
        let cut = |piece: &Piece, from: f64, to: f64| {
            let Pose { position, course, .. } = piece.at(from);
            Piece { start: position, course, length: to - from, ..*piece }
        };
        let (piece, into) = (&self.pieces[index], s - self.starts[index]);
        let mut rest = Vec::with_capacity(self.pieces.len() + 1);
        rest.push(cut(piece, into, piece.length));
        rest.extend_from_slice(&self.pieces[index + 1..]);
        if self.closed {
            rest.extend_from_slice(&self.pieces[..index]);
            rest.push(cut(piece, 0.0, into));
        }
        rest.retain(|piece| piece.length > 0.0);
        rest
    }

    /// Projects a point onto the path within `reach` metres of arc length `near`. The search is local, because a path
    /// may pass a point more than once.
    pub fn project(&self, point: [f64; 2], near: f64, reach: f64) -> Projection {
        let reach = reach.max(0.0);
        // At most one lap, so that each point is searched once.
        let reach = if self.closed { reach.min(0.5 * self.length) } else { reach };
        let (from, to) = (near - reach, near + reach);
        let mut best: Option<(f64, f64)> = None;
        let mut try_place = |s: f64| {
            let [x, y] = self.at(s).position;
            let distance = Float::hypot(point[0] - x, point[1] - y);
            if best.is_none_or(|(_, least)| distance < least) {
                best = Some((s, distance));
            }
        };
        if self.closed {
            let (first, laps) = self.within(from);
            let mut index = self.piece_at(first);
            let mut start = laps + self.starts[index];
            while start <= to {
                let piece = &self.pieces[index];
                let (low, high) = ((from - start).max(0.0), (to - start).min(piece.length));
                try_place(start + piece.nearest(point, low, high.max(low)));
                start += piece.length;
                index = (index + 1) % self.pieces.len();
            }
        } else {
            for index in self.piece_at(from)..=self.piece_at(to) {
                let (piece, start) = (&self.pieces[index], self.starts[index]);
                let (low, high) = ((from - start).max(0.0), (to - start).min(piece.length));
                if low <= high {
                    try_place(start + piece.nearest(point, low, high));
                }
            }
            if to > self.length {
                let ahead = self.at(self.length).along_track(point);
                try_place(self.length + ahead.clamp((from - self.length).max(0.0), to - self.length));
            }
            if from < 0.0 {
                try_place(self.at(0.0).along_track(point).clamp(from, to.min(0.0)));
            }
        }
        let s = best.map_or(near, |(s, _)| s);
        let pose = self.at(s);
        Projection { s, pose, cross_track: pose.cross_track(point) }
    }
}

//! Clipping of lines to their panel, and dashes.

/// A rectangle on the page \[px\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

/// A position on the page \[px\].
pub type Point = (f64, f64);

/// The parts of a line within a frame. NaN is a gap; a part of one point is a sample between two gaps.
pub fn clip(points: &[Point], frame: Frame) -> Vec<Vec<Point>> {
    let mut parts: Vec<Vec<Point>> = Vec::new();
    let mut open = false;
    let mut last: Option<Point> = None;
    for (i, &point) in points.iter().enumerate() {
        if !(point.0.is_finite() && point.1.is_finite()) {
            (last, open) = (None, false);
            continue;
        }
        if let Some(before) = last {
            match within(before, point, frame) {
                Some((a, b)) => {
                    if !open {
                        parts.push(vec![a]);
                    }
                    if let Some(part) = parts.last_mut() {
                        part.push(b);
                    }
                    open = b == point;
                }
                None => open = false,
            }
        } else {
            let alone = points.get(i + 1).is_none_or(|next| !(next.0.is_finite() && next.1.is_finite()));
            if alone && within(point, point, frame).is_some() {
                parts.push(vec![point]);
            }
        }
        last = Some(point);
    }
    parts
}

/// The part of a segment within a frame (Liang and Barsky 1984).
fn within(a: Point, b: Point, frame: Frame) -> Option<(Point, Point)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut from, mut to) = (0.0f64, 1.0f64);
    for (step, room) in
        [(-dx, a.0 - frame.left), (dx, frame.right - a.0), (-dy, a.1 - frame.top), (dy, frame.bottom - a.1)]
    {
        if step == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if step < 0.0 {
            from = from.max(room / step);
        } else {
            to = to.min(room / step);
        }
    }
    let at = |t: f64| {
        if t == 0.0 {
            a
        } else if t == 1.0 {
            b
        } else {
            (a.0 + t * dx, a.1 + t * dy)
        }
    };
    (from <= to).then(|| (at(from), at(to)))
}

pub fn dashes(points: &[Point], on: f64, off: f64) -> Vec<Vec<Point>> {
    let mut parts = Vec::new();
    let Some(&first) = points.first() else { return parts };
    let (mut drawing, mut left) = (true, on);
    let mut part = vec![first];
    for pair in points.windows(2) {
        let (mut a, b) = (pair[0], pair[1]);
        loop {
            let length = (b.0 - a.0).hypot(b.1 - a.1);
            if length < left {
                left -= length;
                if drawing {
                    part.push(b);
                }
                break;
            }
            let share = left / length.max(f64::MIN_POSITIVE);
            a = (a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1));
            if drawing {
                part.push(a);
                parts.push(std::mem::take(&mut part));
            } else {
                part = vec![a];
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
        }
    }
    if drawing && part.len() > 1 {
        parts.push(part);
    }
    parts
}

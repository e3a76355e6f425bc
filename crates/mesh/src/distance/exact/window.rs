//! Windows in the plane of an edge: the edge lies on the first axis, from 0 on, and the face that is entered above it.

/// Lengths are near 1, so squares neither overflow nor vanish; `hypot`, which provides for that, takes several times as
/// long.
fn hypotenuse(a: f64, b: f64) -> f64 {
    (a * a + b * b).sqrt()
}

/// A way through a window to the corner of the face behind it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reached {
    /// Its length from the source.
    pub distance: f64,
    /// Where it crosses the edge.
    pub place: f64,
    /// Whether it is straight.
    pub seen: bool,
}

/// An interval of an edge that straight paths come through from one point below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Window {
    /// The half-edge of the face that is entered.
    pub edge: u32,
    /// Where it begins, along the edge.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Where the point that paths come from lies, along the edge.
    pub along: f64,
    /// How far it lies below the edge, at least 0.
    pub behind: f64,
    /// The distance of that point from the source.
    pub before: f64,
}

impl Window {
    /// The same, seen from the other end of the edge.
    pub fn mirrored(&self, length: f64) -> Self {
        Self { from: length - self.to, to: length - self.from, along: length - self.along, ..*self }
    }

    /// The distance of a place on the edge.
    fn at(&self, place: f64) -> f64 {
        self.before + hypotenuse(place - self.along, self.behind)
    }

    /// The least distance in the window.
    pub fn nearest(&self) -> f64 {
        self.at(self.along.clamp(self.from, self.to))
    }

    /// The part where this is shorter than the way through the begin of the edge, which lies at `distance`. Along the
    /// edge that way grows as the place does, and this no faster, so the part is what lies beyond some place.
    pub fn beyond(mut self, distance: f64) -> Option<Self> {
        if !(self.from < self.to) {
            return None;
        }
        if distance == f64::INFINITY || self.at(self.from) < distance + self.from {
            return Some(self);
        }
        if self.at(self.to) >= distance + self.to {
            return None;
        }
        // |x − p| = x + c
        let c = distance - self.before;
        let place = (self.along * self.along + self.behind * self.behind - c * c) / (2.0 * (c + self.along));
        if place > self.from {
            self.from = place.min(self.to);
        }
        (self.from < self.to).then_some(self)
    }

    /// Whether all of it is as far as the way through the corner of the face that it left, which lies on the side of
    /// its end. `distance` is that of the corner, which has its place along the edge and behind it.
    pub fn is_beaten_by(&self, distance: f64, (along, behind): (f64, f64)) -> bool {
        distance + hypotenuse(self.from - along, behind) <= self.at(self.from)
    }

    /// The shortest way through the window to the third corner of the face, and whether that is straight: where it is
    /// not, it turns at an end of the window. Either way a path of that length is there.
    pub fn reaches(&self, (along, above): (f64, f64)) -> Reached {
        let height = self.behind + above;
        let straight = if height > 0.0 { self.along + (along - self.along) * self.behind / height } else { along };
        if straight >= self.from && straight <= self.to {
            return Reached {
                distance: self.before + hypotenuse(along - self.along, height),
                place: straight,
                seen: true,
            };
        }
        let place = if straight < self.from { self.from } else { self.to };
        Reached { distance: self.at(place) + hypotenuse(along - place, above), place, seen: false }
    }

    /// What leaves the face by the side between the begin of the edge and the third corner, in the plane of that side
    /// and measured from the begin of the edge; `side` is its length.
    pub fn through(&self, (along, above): (f64, f64), side: f64) -> Option<Self> {
        let height = self.behind + above;
        // A source on the line of the edge sees nothing above it.
        if !(self.behind > 0.0 && height > 0.0 && side > 0.0) {
            return None;
        }
        let corner = self.along + (along - self.along) * self.behind / height;
        let last = self.to.min(corner);
        if !(self.from < last) {
            return None;
        }
        let (x, y) = (along / side, above / side);
        // Where the ray through a place of the edge meets the side.
        let intersection = |place: f64| {
            let slope = self.behind * x - (place - self.along) * y;
            if slope > 0.0 { (place * self.behind / slope).clamp(0.0, side) } else { side }
        };
        let to = if corner <= self.to { side } else { intersection(last) };
        let from = intersection(self.from);
        // The point that paths come from, along the side and away from it.
        let child = Self {
            from,
            to,
            along: self.along * x - self.behind * y,
            behind: (self.along * y + self.behind * x).max(0.0),
            ..*self
        };
        (child.from < child.to).then_some(child)
    }
}

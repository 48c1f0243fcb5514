//! Regions of a picture that select points.

/// Bands of a region along y, so that a test looks only at lines at the height of the place.
const BANDS: usize = 256;

/// A region of a picture, in pixels.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Region {
    shape: Shape,
    /// Bounds of the region, from `min` to `max`.
    min: [f32; 2],
    max: [f32; 2],
    /// The lines that touch each band.
    bands: Vec<Vec<Line>>,
}

/// A line segment.
type Line = [[f32; 2]; 2];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Rectangle,
    /// The lines form a closed polygon.
    Lasso,
    /// A round brush along the lines; the square of its radius.
    Brush(f32),
}

impl Region {
    /// The rectangle between two corners, edges included.
    pub(crate) fn rectangle(from: [f32; 2], to: [f32; 2]) -> Self {
        Self::new(Shape::Rectangle, &[[from, to]], 0.0)
    }

    /// The places that a closed polygon winds around an odd number of times.
    pub(crate) fn lasso(corners: &[[f32; 2]]) -> Self {
        let next = corners.iter().cycle().skip(1);
        let lines: Vec<Line> = corners.iter().zip(next).map(|(&from, &to)| [from, to]).collect();
        Self::new(Shape::Lasso, &lines, 0.0)
    }

    /// The places that a round brush touches on its way.
    pub(crate) fn brush(way: &[[f32; 2]], radius: f32) -> Self {
        let lines: Vec<Line> = match way {
            [only] => vec![[*only; 2]],
            way => way.windows(2).map(|ends| [ends[0], ends[1]]).collect(),
        };
        Self::new(Shape::Brush(radius * radius), &lines, radius)
    }

    fn new(shape: Shape, lines: &[Line], radius: f32) -> Self {
        let ends = |start: f32, least: fn(f32, f32) -> f32, margin: f32| {
            [0, 1].map(|axis| lines.iter().flatten().map(|end| end[axis]).fold(start, least) + margin)
        };
        let (min, max) = (ends(f32::INFINITY, f32::min, -radius), ends(f32::NEG_INFINITY, f32::max, radius));
        let mut region = Self { shape, min, max, bands: vec![Vec::new(); BANDS] };
        for line in lines {
            let [from, to] = line.map(|end| end[1]);
            for band in region.band(from.min(to) - radius)..=region.band(from.max(to) + radius) {
                region.bands[band].push(*line);
            }
        }
        region
    }

    /// The band of a height; monotonic in the height.
    fn band(&self, y: f32) -> usize {
        let [low, high] = [self.min[1], self.max[1]];
        (((y - low) / (high - low) * BANDS as f32) as usize).min(BANDS - 1)
    }

    /// Whether a place is in the region.
    pub(crate) fn contains(&self, place: [f32; 2]) -> bool {
        if !(0..2).all(|axis| place[axis] >= self.min[axis] && place[axis] <= self.max[axis]) {
            return false;
        }
        let lines = &self.bands[self.band(place[1])];
        match self.shape {
            Shape::Rectangle => true,
            Shape::Lasso => lines.iter().filter(|line| is_left_of(place, line)).count() % 2 == 1,
            Shape::Brush(radius_2) => lines.iter().any(|&[from, to]| distance_2(from, to, place) <= radius_2),
        }
    }
}

/// Whether a ray to the right of a place crosses a line segment.
fn is_left_of([x, y]: [f32; 2], &[from, to]: &Line) -> bool {
    // Each segment contains one of its ends only, so that a ray through a corner crosses one of the two segments there.
    (from[1] > y) != (to[1] > y) && x < from[0] + (y - from[1]) / (to[1] - from[1]) * (to[0] - from[0])
}

/// Squared distance from a place to a line segment.
fn distance_2(from: [f32; 2], to: [f32; 2], place: [f32; 2]) -> f32 {
    let [along, way] = [[to[0] - from[0], to[1] - from[1]], [place[0] - from[0], place[1] - from[1]]];
    let length_2 = along[0] * along[0] + along[1] * along[1];
    let part = (along[0] * way[0] + along[1] * way[1]) / length_2;
    // A segment of length zero is a point.
    let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 };
    let off = [way[0] - part * along[0], way[1] - part * along[1]];
    off[0] * off[0] + off[1] * off[1]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Test places of a picture, off all corners.
    fn places() -> impl Iterator<Item = [f32; 2]> {
        (0..120 * 120).map(|i| [(i % 120) as f32 + 0.37, (i / 120) as f32 + 0.61])
    }

    #[test]
    fn rectangles() {
        let region = Region::rectangle([50.0, 20.0], [10.0, 80.0]);
        for [x, y] in places() {
            let inside = x > 10.0 && x < 50.0 && y > 20.0 && y < 80.0;
            assert_eq!(region.contains([x, y]), inside, "{x}, {y}");
        }
        assert!(region.contains([10.0, 20.0]) && region.contains([50.0, 80.0]), "corners are inside");
        assert!(!region.contains([f32::NAN, 40.0]), "no place is in no region");
    }

    /// Winding number of the polygon around a place, by the sum of angles.
    fn turns(corners: &[[f32; 2]], place: [f32; 2]) -> i64 {
        let angle = |corner: [f32; 2]| f64::from(corner[1] - place[1]).atan2(f64::from(corner[0] - place[0]));
        let turned: f64 = (0..corners.len())
            .map(|i| {
                let way = angle(corners[(i + 1) % corners.len()]) - angle(corners[i]);
                (way + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI
            })
            .sum();
        (turned / std::f64::consts::TAU).round() as i64
    }

    #[test]
    fn lassos_hold_what_they_go_round() {
        let star: Vec<[f32; 2]> = (0..5)
            .map(|i| {
                let (sin, cos) = (i as f32 * 0.8 * std::f32::consts::PI + 0.1).sin_cos();
                [60.0 + 50.0 * cos, 60.0 + 50.0 * sin]
            })
            .collect();
        let mut state = 1_u32;
        let mut random = || {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 8) as f32 / (1 << 24) as f32 * 120.0
        };
        let scribble: Vec<[f32; 2]> = (0..40).map(|_| [random(), random()]).collect();
        // A polygon with corners at the height of test places, and an edge along them.
        let house = vec![[10.37, 30.61], [60.0, 5.61], [100.0, 30.61], [100.0, 90.0], [10.37, 90.0]];
        for corners in [star, scribble, house] {
            let region = Region::lasso(&corners);
            let wrong = places().filter(|&place| {
                let on_edge = corners.iter().any(|corner| corner[1] == place[1] || corner[0] == place[0]);
                !on_edge && region.contains(place) != (turns(&corners, place).rem_euclid(2) == 1)
            });
            assert_eq!(wrong.count(), 0, "of {} corners", corners.len());
            assert!(places().any(|place| region.contains(place)), "some are inside");
        }
        for corners in [vec![], vec![[50.0, 50.0]], vec![[0.0, 0.0], [100.0, 100.0]]] {
            let region = Region::lasso(&corners);
            assert!(!places().any(|place| region.contains(place)), "a line goes round nothing");
        }
    }

    #[test]
    fn brushes_touch_what_is_near() {
        let way = vec![[20.0, 20.0], [80.0, 30.0], [80.0, 30.0], [40.0, 90.0]];
        let region = Region::brush(&way, 7.0);
        for place in places() {
            // The brush set down at many places of its path.
            let nearest = way
                .windows(2)
                .flat_map(|ends| {
                    let (from, to) = (ends[0], ends[1]);
                    (0..=1000).map(move |i| [0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * i as f32 / 1000.0))
                })
                .map(|[x, y]| (x - place[0]).hypot(y - place[1]))
                .fold(f32::INFINITY, f32::min);
            assert!((nearest - 7.0).abs() < 0.01 || region.contains(place) == (nearest < 7.0), "{place:?}");
        }
        let dab = Region::brush(&[[50.0, 50.0]], 3.0);
        assert!(dab.contains([52.0, 52.0]) && !dab.contains([52.5, 52.5]), "one place is a disc");
        assert!(!Region::brush(&[], 3.0).contains([0.0, 0.0]), "no way");
    }
}

//! The values of a depth image: their byte order, unit, and which are no depths.

use super::Job;

/// Values, row by row from the top.
pub(super) enum Values {
    Whole(Vec<u16>),
    Floats(Vec<f32>),
}

/// Values per metre of whole numbers: most depth cameras count millimetres.
pub(super) const WHOLE_PER_METRE: f64 = 1000.0;

/// From here on, a value means sky: programs write 1e10 or the largest float.
const SKY: f32 = 1e9;

/// The largest half float, and the largest value of 16 bits in a float: what is beyond these is stored as these.
const SATURATED: [f32; 2] = [65504.0, 65535.0];

/// Smallest typical value of an image in millimetres, if all values are whole.
const LEAST_MILLIMETRES: f32 = 100.0;

impl Values {
    /// Whether a float is a depth. Whole numbers are, except 0.
    fn is_depth(value: f32) -> bool {
        value > 0.0 && value < SKY && !SATURATED.contains(&value)
    }

    /// The depth at an index, in the image's unit; `None` if there is none.
    pub(super) fn get(&self, index: usize) -> Option<f64> {
        match self {
            Self::Whole(values) => Some(values[index]).filter(|value| *value > 0).map(f64::from),
            Self::Floats(values) => Some(values[index]).filter(|value| Self::is_depth(*value)).map(f64::from),
        }
    }

    /// Number of values that are depths.
    pub(super) fn count(&self) -> usize {
        match self {
            Self::Whole(values) => values.iter().filter(|value| **value > 0).count(),
            Self::Floats(values) => values.iter().filter(|value| Self::is_depth(**value)).count(),
        }
    }

    /// Values per metre where no camera states them. Whole numbers are millimetres. Floats are metres by custom, unless
    /// all are whole and large; a note tells.
    pub(super) fn usual_scale(&self, job: &Job<'_>) -> f64 {
        let Self::Floats(values) = self else { return WHOLE_PER_METRE };
        let mut depths: Vec<f32> = values.iter().copied().filter(|value| Self::is_depth(*value)).collect();
        if depths.is_empty() {
            return 1.0;
        }
        let whole = depths.iter().all(|value| value.fract() == 0.0);
        let middle = depths.len() / 2;
        let typical = *depths.select_nth_unstable_by(middle, f32::total_cmp).1;
        let millimetres = whole && typical >= LEAST_MILLIMETRES;
        let unit = if millimetres { "millimetres" } else { "metres" };
        job.note(format!("depths around {typical} are taken as {unit}; a camera with values per metre states others"));
        if millimetres { 1000.0 } else { 1.0 }
    }
}

/// Swaps the bytes of 16-bit values if they were stored the wrong way round, with a note.
pub(super) fn mend_byte_order(job: &Job<'_>, values: &mut [u16], width: usize) {
    if is_swapped(values, width) {
        values.iter_mut().for_each(|value| *value = value.swap_bytes());
        job.note("the two bytes of each value are swapped, as neighbouring depths show; read the other way round");
    }
}

/// Most pairs of neighbours that are compared.
const MAX_PAIRS: usize = 1 << 17;

/// Fewest pairs of different neighbours that show the byte order.
const MIN_PAIRS: usize = 64;

/// Whether values are far smoother with their bytes swapped. Steps between neighbours are small; in the wrong order
/// they are multiples of 256, more or less.
///
/// Depths of which only the high byte varies are smooth in either order, and stay as they are.
fn is_swapped(values: &[u16], width: usize) -> bool {
    let step = (values.len() / MAX_PAIRS).max(1);
    let rows = values.chunks_exact(width).step_by(step);
    let pairs = rows.flat_map(|row| row.iter().zip(&row[1..])).filter(|&(&a, &b)| a > 0 && b > 0 && a != b);
    let (mut steps, mut swapped_steps, mut low_bytes) = (Vec::new(), Vec::new(), [false; 256]);
    for (&a, &b) in pairs {
        steps.push(a.abs_diff(b));
        swapped_steps.push(a.swap_bytes().abs_diff(b.swap_bytes()));
        low_bytes[usize::from(a & 0xff)] = true;
    }
    if steps.len() < MIN_PAIRS || low_bytes.iter().filter(|there| **there).count() < 2 {
        return false;
    }
    let middle = steps.len() / 2;
    let [stated, swapped] = [steps, swapped_steps].map(|mut steps| *steps.select_nth_unstable(middle).1);
    stated >= 256 && swapped <= stated / 8
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 48;

    fn image(depth: impl Fn(f64, f64) -> f64) -> Vec<u16> {
        (0..SIDE * SIDE).map(|i| depth((i % SIDE) as f64, (i / SIDE) as f64) as u16).collect()
    }

    #[test]
    fn swapped_bytes_are_told_by_smoothness() {
        let ball =
            |x: f64, y: f64| 2000.0 - 400.0 * (1.0 - ((x - 24.0).hypot(y - 24.0) / 24.0).powi(2)).max(0.0).sqrt();
        let noisy = |x: f64, y: f64| ball(x, y) + 9.0 * (x * 12.9 + y * 78.2).sin();
        let scaled = |x: f64, y: f64| 5.0 * noisy(x, y);
        let holes = |x: f64, y: f64| if ((x + y) as usize).is_multiple_of(3) { 0.0 } else { noisy(x, y) };
        let steps = |x: f64, _: f64| if x < 20.0 { 800.0 } else { 800.0 + 30.0 * (x - 20.0) };
        for (name, depths) in [
            ("a ball", image(ball)),
            ("with noise", image(noisy)),
            ("in fifths", image(scaled)),
            ("with holes", image(holes)),
            ("a wall and a slope", image(steps)),
        ] {
            assert!(!is_swapped(&depths, SIDE), "{name} is as it should be");
            let swapped: Vec<u16> = depths.iter().map(|depth| depth.swap_bytes()).collect();
            assert!(is_swapped(&swapped, SIDE), "{name} is swapped");
        }
    }

    #[test]
    fn what_cannot_be_told_stays() {
        let mut state = 1_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(state >> 16)
        };
        let noise: Vec<u16> = (0..SIDE * SIDE).map(|_| random() as u16).collect();
        assert!(!is_swapped(&noise, SIDE), "noise is rough in either order");
        assert!(!is_swapped(&image(|x, _| 256.0 * x), SIDE), "only the high byte varies");
        assert!(!is_swapped(&image(|x, _| x), SIDE), "only the low byte varies");
        assert!(!is_swapped(&[], SIDE) && !is_swapped(&[1, 256, 1], 3), "too few");
    }
}

//! FLIP: how different two pictures look to a viewer who alternates between them.
//!
//! Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator for Alternating
//! Images.* Proceedings of the ACM on Computer Graphics and Interactive Techniques 3(2), 2020. doi:10.1145/3406183.
//! This is the form for pictures of low dynamic range. Section numbers are those of the FLIP paper.

use rayon::prelude::*;

/// Pixels per degree of view: a 4K screen 70 cm wide at a distance of 70 cm, the authors' default.
const PIXELS_PER_DEGREE: f64 = 67.0;
/// §4.1: contrast sensitivity of the three opponent channels. Each is a sum of Gaussians of these weights and spreads.
const SENSITIVITY: [&[[f64; 2]]; 3] = [&[[1.0, 0.0047]], &[[1.0, 0.0053]], &[[34.1, 0.04], [13.5, 0.025]]];
/// Greatest spread in [`SENSITIVITY`].
const MAX_SPREAD: f64 = 0.04;
/// §4.1: exponent of differences in colour.
const EXPONENT: f64 = 0.7;
/// §4.1: difference in colour between the two linear parts of the error, as a share of the greatest difference.
const KNEE: f64 = 0.4;
/// §4.1: error at [`KNEE`].
const KNEE_ERROR: f64 = 0.95;
/// §4.2: width of features, degrees.
const FEATURE_WIDTH: f64 = 0.082;
/// §4.2: exponent of differences between features.
const FEATURE_EXPONENT: f64 = 0.5;
/// XYZ of the white of illuminant D65.
const WHITE: [f64; 3] = [0.950_428_545, 1.0, 1.088_900_371];

/// A truth, prepared for comparisons with pictures.
#[derive(Debug)]
pub struct Flip {
    width: usize,
    truth: Prepared,
    /// The greatest difference in colour: that of green and blue.
    most: f64,
}

impl Flip {
    /// Prepares a truth of rows of `width` pixels, sRGB, 0 to 1.
    pub fn new(truth: &[[f64; 3]], width: usize) -> Self {
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|color| hunt(lab(to_xyz(color))));
        Self { width, truth: Prepared::new(truth, width), most: hyab(green, blue).powf(EXPONENT) }
    }

    /// The error of a picture of the same size at each pixel, 0 to 1.
    pub fn errors(&self, picture: &[[f64; 3]]) -> Vec<f64> {
        let [ours, theirs] = [&Prepared::new(picture, self.width), &self.truth];
        let knee = KNEE * self.most;
        let error = |pixel: usize| {
            let difference = hyab(ours.colors[pixel], theirs.colors[pixel]).powf(EXPONENT);
            let color = if difference < knee {
                difference * KNEE_ERROR / knee
            } else {
                KNEE_ERROR + (difference - knee) / (self.most - knee) * (1.0 - KNEE_ERROR)
            };
            let features = [0, 1].map(|i| (ours.features[pixel][i] - theirs.features[pixel][i]).abs());
            let feature = (features[0].max(features[1]) / 2.0_f64.sqrt()).powf(FEATURE_EXPONENT).min(1.0);
            color.min(1.0).powf(1.0 - feature)
        };
        (0..picture.len()).into_par_iter().map(error).collect()
    }
}

/// A picture, prepared for comparisons.
#[derive(Debug)]
struct Prepared {
    /// L*a*b* colours, blurred as by the eye and adjusted by the Hunt effect.
    colors: Vec<[f64; 3]>,
    /// Strengths of edges and of points.
    features: Vec<[f64; 2]>,
}

impl Prepared {
    fn new(pixels: &[[f64; 3]], width: usize) -> Self {
        let opponents: Vec<_> =
            pixels.par_iter().map(|&srgb| opponent(to_xyz(srgb.map(crate::light::to_linear)))).collect();
        let channels: [Vec<f64>; 3] = [0, 1, 2].map(|i| blurred(&opponents, i, width));
        let color = |pixel: usize| {
            let xyz = from_opponent([0, 1, 2].map(|i| channels[i][pixel]));
            // Colours that no screen shows are clamped.
            let rgb = to_rgb(xyz).map(|channel| channel.clamp(0.0, 1.0));
            hunt(lab(to_xyz(rgb)))
        };
        let lightness: Vec<f64> = opponents.par_iter().map(|color| (color[0] + 16.0) / 116.0).collect();
        Self { colors: (0..pixels.len()).into_par_iter().map(color).collect(), features: features(&lightness, width) }
    }
}

/// §4.1: one opponent channel, blurred by the eye's contrast sensitivity.
fn blurred(opponents: &[[f64; 3]], channel: usize, width: usize) -> Vec<f64> {
    let values: Vec<f64> = opponents.par_iter().map(|color| color[channel]).collect();
    let radius = (3.0 * (MAX_SPREAD / (2.0 * std::f64::consts::PI.powi(2))).sqrt() * PIXELS_PER_DEGREE).ceil() as isize;
    // Each Gaussian is separable. Weights make the sum of the whole filter 1.
    let parts = SENSITIVITY[channel].iter().map(|&[weight, spread]| {
        let row: Vec<f64> = (-radius..=radius)
            .map(|x| (-std::f64::consts::PI.powi(2) * (x as f64 / PIXELS_PER_DEGREE).powi(2) / spread).exp())
            .collect();
        (weight * (std::f64::consts::PI / spread).sqrt(), row)
    });
    let parts: Vec<_> = parts.collect();
    let sum: f64 = parts.iter().map(|(weight, row)| weight * row.iter().sum::<f64>().powi(2)).sum();
    let mut blurred = vec![0.0; values.len()];
    for (weight, row) in parts {
        let part = convolved(&values, width, &row, &row);
        blurred.iter_mut().zip(part).for_each(|(sum_here, value)| *sum_here += weight / sum * value);
    }
    blurred
}

/// §4.2: strengths of edges and points at each pixel.
fn features(lightness: &[f64], width: usize) -> Vec<[f64; 2]> {
    let deviation = 0.5 * FEATURE_WIDTH * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as isize;
    let gauss = |x: f64| (-x * x / (2.0 * deviation * deviation)).exp();
    let places = || (-radius..=radius).map(|x| x as f64);
    let smooth: Vec<f64> = places().map(gauss).collect();
    let total: f64 = smooth.iter().sum();
    let smooth: Vec<f64> = smooth.into_iter().map(|value| value / total).collect();
    let edge: Vec<f64> = places().map(|x| -x * gauss(x)).collect();
    let point: Vec<f64> = places().map(|x| (x * x / (deviation * deviation) - 1.0) * gauss(x)).collect();
    let [edge, point] = [edge, point].map(|row| {
        // The positive values sum to 1, the negative ones to -1.
        let above: f64 = row.iter().filter(|value| **value > 0.0).sum();
        let below: f64 = -row.iter().filter(|value| **value < 0.0).sum::<f64>();
        row.into_iter().map(|value| if value > 0.0 { value / above } else { value / below }).collect::<Vec<_>>()
    });
    let strength = |row: &[f64]| {
        let [across, down] = [convolved(lightness, width, row, &smooth), convolved(lightness, width, &smooth, row)];
        across.into_iter().zip(down).map(|(x, y)| (x * x + y * y).sqrt()).collect::<Vec<f64>>()
    };
    strength(&edge).into_iter().zip(strength(&point)).map(|(edge, point)| [edge, point]).collect()
}

/// `values` convolved with `across` along rows and with `down` along columns. Values at the border continue beyond it.
fn convolved(values: &[f64], width: usize, across: &[f64], down: &[f64]) -> Vec<f64> {
    let height = values.len() / width;
    let mut rows = vec![0.0; values.len()];
    let radius = across.len() / 2;
    rows.par_chunks_mut(width).zip(values.par_chunks(width)).for_each(|(sums, row)| {
        let padded: Vec<f64> = (0..width + 2 * radius).map(|x| row[x.saturating_sub(radius).min(width - 1)]).collect();
        for (shifted, weight) in padded.windows(width).zip(across) {
            sums.iter_mut().zip(shifted).for_each(|(sum, value)| *sum += weight * value);
        }
    });
    let mut both = vec![0.0; values.len()];
    let radius = down.len() / 2;
    both.par_chunks_mut(width).enumerate().for_each(|(y, sums)| {
        for (i, weight) in down.iter().enumerate() {
            let from = (y + i).saturating_sub(radius).min(height - 1) * width;
            sums.iter_mut().zip(&rows[from..from + width]).for_each(|(sum, value)| *sum += weight * value);
        }
    });
    both
}

fn to_xyz([r, g, b]: [f64; 3]) -> [f64; 3] {
    [
        0.412_396_55 * r + 0.357_583_43 * g + 0.180_492_65 * b,
        0.212_636_78 * r + 0.715_166_86 * g + 0.072_196_36 * b,
        0.019_330_62 * r + 0.119_194_48 * g + 0.950_528_00 * b,
    ]
}

fn to_rgb([x, y, z]: [f64; 3]) -> [f64; 3] {
    [
        3.241_003_1 * x - 1.537_399_0 * y - 0.498_615_6 * z,
        -0.969_224_2 * x + 1.875_930_1 * y + 0.041_554_2 * z,
        0.055_639_4 * x - 0.204_011_2 * y + 1.057_149_0 * z,
    ]
}

/// Opponent colours: luminance, red to green, blue to yellow.
fn opponent(xyz: [f64; 3]) -> [f64; 3] {
    let [x, y, z] = [0, 1, 2].map(|i| xyz[i] / WHITE[i]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn from_opponent([l, a, b]: [f64; 3]) -> [f64; 3] {
    let y = (l + 16.0) / 116.0;
    [(y + a / 500.0) * WHITE[0], y * WHITE[1], (y - b / 200.0) * WHITE[2]]
}

/// CIE L*a*b* of XYZ.
fn lab(xyz: [f64; 3]) -> [f64; 3] {
    let delta: f64 = 6.0 / 29.0;
    let f = |t: f64| if t > delta.powi(3) { t.cbrt() } else { t / (3.0 * delta * delta) + 4.0 / 29.0 };
    let [x, y, z] = [0, 1, 2].map(|i| f(xyz[i] / WHITE[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Hunt effect: dark colours appear less saturated.
fn hunt([l, a, b]: [f64; 3]) -> [f64; 3] {
    [l, 0.01 * l * a, 0.01 * l * b]
}

fn hyab(one: [f64; 3], other: [f64; 3]) -> f64 {
    let [l, a, b] = [0, 1, 2].map(|i| one[i] - other[i]);
    l.abs() + (a * a + b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean(one: &[[f64; 3]], other: &[[f64; 3]]) -> f64 {
        let errors = Flip::new(other, 64).errors(one);
        errors.iter().sum::<f64>() / errors.len() as f64
    }

    fn gray(value: impl Fn(usize, usize) -> f64) -> Vec<[f64; 3]> {
        (0..64 * 48).map(|pixel| [value(pixel % 64, pixel / 64); 3]).collect()
    }

    #[test]
    fn equal_pictures_do_not_differ() {
        let waves = gray(|x, y| 0.5 + 0.4 * (x as f64 * 0.3).sin() * (y as f64 * 0.2).cos());
        assert!(mean(&waves, &waves) < 1e-9, "equal pictures have no error");
    }

    #[test]
    fn black_and_white_differ_as_published() {
        let [black, white] = [gray(|_, _| 0.0), gray(|_, _| 1.0)];
        let error = mean(&black, &white);
        assert!((error - 0.967).abs() < 0.001, "the authors' program gives 0.967, not {error}");
        // Saturated colours differ most.
        let [green, blue] = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|color| vec![color; 64 * 48]);
        let error = mean(&green, &blue);
        assert!((error - 1.0).abs() < 1e-6, "the error of green and blue is 1: {error}");
    }

    #[test]
    fn worse_is_worse() {
        let truth = gray(|x, y| if (x / 8 + y / 8) % 2 == 0 { 0.4 } else { 0.6 });
        let noisy = |strength: f64| {
            gray(|x, y| truth[y * 64 + x][0] + strength * (((x * 7919 + y * 104_729) % 101) as f64 / 50.0 - 1.0))
        };
        let errors = [0.0, 0.02, 0.05, 0.1, 0.3].map(|strength| mean(&noisy(strength), &truth));
        assert!(errors.is_sorted() && errors[1] > 0.0 && errors[4] > 0.1, "{errors:?}");
        assert!((errors[2] - 0.031_780_323).abs() < 1e-8, "the formula changed: {}", errors[2]);
    }
}

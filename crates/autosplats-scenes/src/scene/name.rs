//! Parses `NAME[:COUNT][@SECONDS]`, and describes the scenes.

use autosplats_cloud::Error;
use glam::DVec3;

/// Maximum number of points of a scene.
pub(super) const MAX_COUNT: usize = 1_000_000_000;

/// A view of a scene, in world coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Position of the eye.
    pub eye: DVec3,
    /// Point in the middle of the image.
    pub look_at: DVec3,
    /// Up direction of the image.
    pub up: DVec3,
    /// Vertical field of view, degrees.
    pub fov_degrees: f64,
}

/// The scenes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Figure,
    TwoScales,
    Statue,
    Herd,
    Cathedral,
}

impl Kind {
    pub(super) const ALL: [Self; 5] = [Self::Figure, Self::TwoScales, Self::Statue, Self::Herd, Self::Cathedral];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Figure => "figure",
            Self::TwoScales => "two-scales",
            Self::Statue => "statue",
            Self::Herd => "herd",
            Self::Cathedral => "cathedral",
        }
    }

    pub(super) fn about(self) -> &'static str {
        match self {
            Self::Figure => "a dancer, animated (200K points)",
            Self::TwoScales => "a small horse on the head of a large one, as many points on each (72K points)",
            Self::Statue => "a robed statue on its pedestal, finely carved (546K points)",
            Self::Herd => "galloping horses on a meadow, animated (1M points)",
            Self::Cathedral => "the inside of a cathedral, scanned from six places (10M points)",
        }
    }

    pub(super) fn is_animated(self) -> bool {
        matches!(self, Self::Figure | Self::Herd)
    }

    fn default_count(self) -> usize {
        match self {
            Self::Figure => 200_000,
            Self::TwoScales => 72_000,
            Self::Statue => 546_000,
            Self::Herd => 1_000_000,
            Self::Cathedral => 10_000_000,
        }
    }

    pub(super) fn view(self) -> View {
        let (eye, look_at, fov_degrees) = match self {
            Self::Figure => ([1.2, -3.4, 1.35], [-0.1, 0.0, 0.98], 36.0),
            Self::TwoScales => ([2.1, -4.9, 2.0], [0.12, 0.0, 1.2], 34.0),
            Self::Statue => ([1.6, -5.6, 2.1], [-0.05, 0.0, 1.56], 37.0),
            Self::Herd => ([7.4, -9.4, 3.0], [0.45, 0.0, 0.9], 34.0),
            Self::Cathedral => ([-19.0, -1.4, 2.2], [0.0, 0.5, 5.4], 62.0),
        };
        View { eye: DVec3::from(eye), look_at: DVec3::from(look_at), up: DVec3::Z, fov_degrees }
    }
}

/// Prefix of the name of a generated scene, where other names may stand too.
pub const SCENE_PREFIX: &str = "scene:";

/// Parses `[scene:]NAME[:COUNT][@SECONDS]`.
pub(super) fn parse(text: &str) -> Result<(Kind, usize, f64), Error> {
    let bad = |why: &str| Error::BadScene { given: text.into(), why: why.into() };
    let rest = text.strip_prefix(SCENE_PREFIX).unwrap_or(text);
    let (rest, seconds) = match rest.split_once('@') {
        Some((rest, seconds)) => {
            let seconds = seconds.trim().parse().ok().filter(|s: &f64| s.is_finite());
            (rest, seconds.ok_or_else(|| bad("@ needs a time in seconds, as in @0.25"))?)
        }
        None => (rest, 0.0),
    };
    let (name, count) = match rest.split_once(':') {
        Some((name, count)) => (name, Some(count)),
        None => (rest, None),
    };
    let kind = Kind::ALL.into_iter().find(|kind| kind.name().eq_ignore_ascii_case(name.trim()));
    let kind = kind.ok_or_else(|| Error::UnknownScene { given: name.into(), known: known() })?;
    let count = match count {
        Some(count) => {
            parse_count(count).ok_or_else(|| bad("the count must be a number from 1 to 1G, like 5000, 546K or 1.5M"))?
        }
        None => kind.default_count(),
    };
    Ok((kind, count, seconds))
}

/// One line per scene, for error messages.
fn known() -> String {
    Kind::ALL.map(|kind| format!("\n  {:<11} {}", kind.name(), kind.about())).concat()
}

/// Parses a number of points: `1000`, `546K`, `1.5M`, `1g`. `None` if the text is not a number from 1 to 1G.
///
/// ```
/// use autosplats_scenes::parse_count;
///
/// assert_eq!(parse_count("1.5M"), Some(1_500_000));
/// assert_eq!(parse_count("many"), None);
/// ```
pub fn parse_count(text: &str) -> Option<usize> {
    let text = text.trim();
    let (number, unit) = match text.char_indices().last()? {
        (at, 'k' | 'K') => (&text[..at], 1e3),
        (at, 'm' | 'M') => (&text[..at], 1e6),
        (at, 'g' | 'G') => (&text[..at], 1e9),
        _ => (text, 1.0),
    };
    if !number.bytes().all(|b| b.is_ascii_digit() || b == b'.') {
        return None;
    }
    let count = (number.parse::<f64>().ok()? * unit).round();
    (count >= 1.0 && count <= MAX_COUNT as f64).then_some(count as usize)
}

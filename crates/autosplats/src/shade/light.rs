//! Light on a surface by its normal, and the conversion of brightness to what a screen can show.

use glam::Vec3;

/// Linear colour of clay, the default tone.
pub(super) const CLAY: [f32; 3] = [0.56, 0.53, 0.49];
/// Direction to the key light in view space (x right, y down, z forward): over the left shoulder.
pub(super) const KEY: Vec3 = Vec3::new(-0.60, -0.63, -0.49);
/// Colours of lights are linear. The key light is a little warm and the sky a little cold, so shadows differ from lit
/// sides in more than brightness.
pub(super) const KEY_LIGHT: [f32; 3] = [0.95, 0.90, 0.83];
/// How far the key light reaches around to surfaces turned away from it, as a cosine.
pub(super) const KEY_WRAP: f32 = 0.08;
/// Direction to the fill light in view space.
pub(super) const FILL: Vec3 = Vec3::new(0.82, 0.10, -0.56);
pub(super) const FILL_LIGHT: [f32; 3] = [0.145, 0.16, 0.185];
/// Light of the ground on surfaces that face down, and of the sky on surfaces that face up.
pub(super) const GROUND: [f32; 3] = [0.050, 0.047, 0.042];
pub(super) const SKY: [f32; 3] = [0.125, 0.142, 0.165];
/// Constant light and factor on the lights for the points' own colours, which were lit once when scanned. A surface
/// seen straight on keeps its colour.
pub(super) const SCANNED_LIGHT: [f32; 2] = [0.42, 0.74];
/// Brightness above which lit colours are compressed, so that they near white but never reach it.
pub(super) const SHOULDER: f32 = 0.8;

/// The light on a surface with this normal in view space: `base` on every normal, plus `share` of the lights.
pub(super) fn light(normal: Vec3, [base, share]: [f32; 2]) -> [f32; 3] {
    let key = ((normal.dot(KEY) + KEY_WRAP) / (1.0 + KEY_WRAP)).max(0.0);
    let fill = normal.dot(FILL).max(0.0);
    let up = 0.5 - 0.5 * normal.y;
    std::array::from_fn(|i| {
        let around = GROUND[i] + (SKY[i] - GROUND[i]) * up;
        base + share * (KEY_LIGHT[i] * key + FILL_LIGHT[i] * fill + around)
    })
}

/// A lit channel as shown: unchanged up to [`SHOULDER`], then compressed towards 1.
pub(super) fn tone(channel: f32) -> f32 {
    let above = (channel - SHOULDER).max(0.0) / (1.0 - SHOULDER);
    channel.min(SHOULDER) + (1.0 - SHOULDER) * above / (1.0 + above)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brightness_stays_in_order_and_below_white() {
        let mut last = -1.0;
        for step in 0..400 {
            let channel = step as f32 * 0.01;
            let shown = tone(channel);
            assert!(shown > last && shown < 1.0, "{channel} is shown as {shown}, after {last}");
            assert!(channel > SHOULDER || shown == channel, "{channel} is below the shoulder, and shown as {shown}");
            last = shown;
        }
    }

    #[test]
    fn colours_seen_straight_on_stay() {
        let light = light(Vec3::NEG_Z, SCANNED_LIGHT);
        assert!(
            light.iter().all(|&channel| (0.85..1.05).contains(&channel)),
            "a scan's colours are shown by {light:?}"
        );
    }
}

//! Frames of clouds of extraordinary size, computed at an ordinary one.
//!
//! The stages compute with squares and higher powers of lengths in `f32`, which overflow for clouds in units of 1e10
//! and vanish in units of 1e-12. Such a cloud is copied and multiplied by a power of two, which rounds nothing. All
//! others are rendered as they are, and so are pools, which take no scans of extraordinary size.

use std::borrow::Cow;

use autosplats_cloud::{PointCloud, computing_scale_of};

use super::texture::Destination;
use super::{BackendRenderer, Frame, PointSurfel, Renderer, Settings};
use crate::Error;
use crate::camera::{Camera, Projection};
use crate::fit::GivenPlanes;
use crate::points::Points;
use crate::search::SearchEngine;
use crate::splat::GBuffer;

/// The copy of the last cloud, and results in world units.
#[derive(Debug)]
pub(super) struct Scaling {
    /// Identity and own factor of the last cloud.
    known: Option<(u64, f64)>,
    /// The last cloud times its factor, if a frame needed it.
    copy: Option<PointCloud>,
    /// The factor of the frame.
    factor: f64,
    /// Layers of the last frame, unless the factor is 1.
    layers: GBuffer,
}

impl Default for Scaling {
    fn default() -> Self {
        Self { known: None, copy: None, factor: 1.0, layers: GBuffer::default() }
    }
}

impl Scaling {
    /// Chooses the factor for a frame of `points`. A camera that looks at an ordinary part of the world leaves an
    /// extraordinary cloud as it is: points that are astronomically far away are many then.
    pub(super) fn choose(&mut self, points: Points<'_>, camera: Option<&Camera>) {
        let Points::Cloud(cloud) = points else {
            *self = Self::default();
            return;
        };
        let identity = cloud.identity();
        let own = match self.known {
            Some((known, factor)) if known == identity => factor,
            _ => {
                self.copy = None;
                cloud.computing_scale()
            }
        };
        self.known = Some((identity, own));
        let seen = camera.map(|camera| match camera.projection {
            Projection::OrthographicHeight(height) => height,
            _ => camera.eye.distance(camera.look_at),
        });
        self.factor = if seen.is_some_and(|length| computing_scale_of(length) == 1.0) { 1.0 } else { own };
        // Axes are not part of a cloud's identity.
        let is_current = self.copy.as_ref().is_some_and(|copy| copy.axes() == cloud.axes());
        if self.factor != 1.0 && !is_current {
            self.copy = Some(cloud.scaled(self.factor));
        }
    }

    /// The points to render in place of those chosen for.
    pub(super) fn points<'a>(&'a self, chosen: Points<'a>) -> Points<'a> {
        self.copy.as_ref().filter(|_| self.factor != 1.0).map_or(chosen, Points::Cloud)
    }

    /// World units per unit of the rendered cloud.
    pub(super) fn unit(&self) -> f64 {
        1.0 / self.factor
    }

    /// The camera for the rendered cloud.
    pub(super) fn camera(&self, camera: &Camera) -> Camera {
        let projection = match camera.projection {
            Projection::OrthographicHeight(height) => Projection::OrthographicHeight(height * self.factor),
            perspective => perspective,
        };
        Camera { eye: camera.eye * self.factor, look_at: camera.look_at * self.factor, projection, ..*camera }
    }

    /// The settings for the rendered cloud.
    pub(super) fn settings<'a>(&self, settings: &'a Settings) -> Cow<'a, Settings> {
        let mut settings = Cow::Borrowed(settings);
        if let (true, SearchEngine::KdTree { first_radius }) = (self.factor != 1.0, settings.reconstruction.engine) {
            let first_radius = (self.length(first_radius)).max(f32::MIN_POSITIVE);
            settings.to_mut().reconstruction.engine = SearchEngine::KdTree { first_radius };
        }
        settings
    }

    /// A length in world units in units of the rendered cloud.
    pub(super) fn length(&self, length: f32) -> f32 {
        (f64::from(length) * self.factor) as f32
    }

    /// The frame with its layers in world units.
    pub(super) fn frame<'a>(&'a mut self, frame: Frame<'a>) -> Frame<'a> {
        if self.factor == 1.0 {
            return frame;
        }
        let unit = self.unit();
        self.layers.clone_from(frame.layers);
        let GBuffer { depth, radius, k_radius, .. } = &mut self.layers;
        [depth, radius, k_radius].into_iter().flatten().for_each(|length| *length = (f64::from(*length) * unit) as f32);
        Frame { layers: &self.layers, ..frame }
    }

    /// The surfels in world units.
    pub(super) fn surfels(&self, mut surfels: Vec<PointSurfel>) -> Vec<PointSurfel> {
        let unit = self.unit();
        for PointSurfel { radius, k_radius, .. } in &mut surfels {
            [radius, k_radius].into_iter().for_each(|length| *length = (f64::from(*length) * unit) as f32);
        }
        surfels
    }
}

impl From<BackendRenderer> for Renderer {
    fn from(form: BackendRenderer) -> Self {
        Self { form, scaling: Scaling::default() }
    }
}

impl Renderer {
    /// Renders points at an ordinary size, with planes only on the CPU.
    pub(super) fn render_form(
        &mut self,
        points: Points<'_>,
        given: Option<GivenPlanes<'_>>,
        camera: &Camera,
        size: [u32; 2],
        settings: &Settings,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Frame<'_>, Error> {
        let Self { form, scaling } = self;
        scaling.choose(points, Some(camera));
        let (shown, camera, settings) = (scaling.points(points), scaling.camera(camera), scaling.settings(settings));
        let unit = scaling.unit();
        let frame = match (form, given) {
            (BackendRenderer::Cpu(renderer), Some(given)) => {
                let radius: Vec<f32> = given.radius.iter().map(|&radius| scaling.length(radius)).collect();
                let given = Some(GivenPlanes { radius: &radius, ..given });
                renderer.render((shown, unit), &camera, size, &settings, given, go_on)
            }
            (BackendRenderer::Cpu(renderer), None) => {
                renderer.render((shown, unit), &camera, size, &settings, None, go_on)
            }
            (BackendRenderer::Gpu(renderer), None) => {
                renderer.render(shown, &camera, Destination::Memory(size), &settings, unit, go_on)
            }
            (BackendRenderer::Gpu(_), Some(_)) => {
                Err(Error::Device("precomputed normals are rendered on the CPU only".into()))
            }
        }?;
        Ok(scaling.frame(frame))
    }
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;
    use crate::{ColorMode, test_clouds};

    /// A picture of a plane with a field of points before it, all lengths multiplied by `unit`.
    fn rendered(unit: f64, projection: Projection, color: ColorMode) -> (Vec<[u8; 4]>, GBuffer, Vec<PointSurfel>, f64) {
        let cloud = PointCloud::new(DVec3::ZERO, test_clouds::plane(3000)).scaled(unit);
        let projection = match projection {
            Projection::OrthographicHeight(height) => Projection::OrthographicHeight(height * unit),
            perspective => perspective,
        };
        let camera = Camera { eye: DVec3::new(0.3, 0.5, 3.0) * unit, look_at: DVec3::ZERO, up: DVec3::Y, projection };
        let mut settings = Settings { all_layers: true, ..Settings::default() };
        settings.shading.color = color;
        let mut renderer = Renderer::new();
        let frame = renderer.render(&cloud, &camera, [96, 64], &settings).expect("a picture");
        let high = frame.counts.value_range.map_or(0.0, |[_, high]| high);
        let (pixels, layers) = (frame.image.pixels.clone(), frame.layers.clone());
        (pixels, layers, renderer.surfels().expect("surfels"), high)
    }

    #[test]
    fn a_body_looks_the_same_in_any_unit() {
        for projection in [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(2.0)] {
            for color in [ColorMode::Plain, ColorMode::Depth, ColorMode::KRadius] {
                let (pixels, layers, surfels, high) = rendered(1.0, projection, color.clone());
                for exponent in [-100, -67, -40, -10, 10, 33, 50, 100] {
                    let unit = 2f64.powi(exponent);
                    let scaled = rendered(unit, projection, color.clone());
                    assert!(scaled.0 == pixels, "2^{exponent}: the picture of {color:?}, {projection:?}");
                    assert_eq!(scaled.3, high * unit, "2^{exponent}: the range of {color:?}");
                    let in_units = |lengths: &[f32]| -> Vec<f32> {
                        lengths.iter().map(|&length| (f64::from(length) * unit) as f32).collect()
                    };
                    assert!(scaled.1.depth == in_units(&layers.depth), "2^{exponent}: depth");
                    assert!(scaled.1.k_radius == in_units(&layers.k_radius), "2^{exponent}: k-radius");
                    let radii =
                        |surfels: &[PointSurfel]| surfels.iter().map(|surfel| surfel.radius).collect::<Vec<_>>();
                    assert!(radii(&scaled.2) == in_units(&radii(&surfels)), "2^{exponent}: surfels");
                }
            }
        }
    }
}

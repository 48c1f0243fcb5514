//! Attributes that splats carry for a picture.

use autosplats_cloud::{Field, PointCloud, RelativeValues};

use super::Settings;
use crate::Error;
use crate::fit::orient::has_sensors;
use crate::points::Points;
use crate::shade::{ColorMode, class_colors};
use crate::splat::Channels;

/// Source of the points' colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColorSource {
    /// The points' own colours.
    Points,
    /// Colours of the points' classes.
    Classes,
}

/// Attributes that splats carry besides their normals.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct SplatAttributes {
    pub(super) colors: Option<ColorSource>,
    /// Name of a scalar field.
    pub(super) scalar: Option<String>,
    /// Whether splats carry splat radius, k-radius and curvature.
    pub(super) measures: bool,
    /// Whether splats carry which side of the surface they show.
    pub(super) backs: bool,
}

impl SplatAttributes {
    /// Attributes that `settings` need.
    ///
    /// # Errors
    /// [`Error::MissingAttribute`] if the points lack an attribute.
    pub(super) fn new(points: Points<'_>, settings: &Settings) -> Result<Self, Error> {
        let cloud = points.scene();
        let mode = &settings.shading.color;
        let own = cloud.colors().map(|_| ColorSource::Points);
        let colors = match mode {
            ColorMode::Classification => field(cloud, "Classification").map(|_| Some(ColorSource::Classes))?,
            ColorMode::Rgb => Some(own.ok_or_else(|| missing(cloud, "colours"))?),
            ColorMode::Auto => own,
            _ if settings.all_layers => own,
            _ => None,
        };
        let scalar = match mode {
            ColorMode::Field(name) => Some(field(cloud, name)?.name.clone()),
            _ => None,
        };
        let measured = matches!(mode, ColorMode::Curvature | ColorMode::Radius | ColorMode::KRadius);
        let backs = (settings.all_layers || settings.shading.tones_backs()) && has_sensors(cloud);
        Ok(Self { colors, scalar, measures: settings.all_layers || measured, backs })
    }

    /// Channels of a pixel for these attributes.
    pub(super) fn channels(&self) -> Channels {
        let Self { colors, scalar, measures, backs } = self;
        Channels { color: colors.is_some(), scalar: scalar.is_some(), measures: *measures, backs: *backs }
    }

    /// Colours of the points: their own, or computed from their classes.
    pub(super) fn colors<'a>(&self, points: Points<'a>) -> Option<std::borrow::Cow<'a, [[u8; 3]]>> {
        match self.colors? {
            ColorSource::Points => points.colors().map(Into::into),
            ColorSource::Classes => points.field("Classification").map(|classes| class_colors(&classes).into()),
        }
    }

    /// Values of the scalar field.
    pub(super) fn scalar<'a>(&self, points: Points<'a>) -> Option<RelativeValues<'a>> {
        points.field(self.scalar.as_ref()?)
    }
}

fn field<'a>(cloud: &'a PointCloud, name: &str) -> Result<&'a Field, Error> {
    cloud.field(name).ok_or_else(|| missing(cloud, &format!("field {name}")))
}

fn missing(cloud: &PointCloud, name: &str) -> Error {
    let mut has: Vec<&str> = cloud.fields().iter().map(|field| field.name.as_str()).collect();
    if cloud.colors().is_some() {
        has.insert(0, "colours");
    }
    let has = if has.is_empty() { "positions only".into() } else { has.join(", ") };
    Error::MissingAttribute { name: name.into(), has }
}

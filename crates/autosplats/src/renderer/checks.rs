//! Checks of what is asked for, which both backends make first.

use super::Settings;
use crate::camera::{Camera, View};
use crate::points::Points;
use crate::{Error, MAX_SIDE};

/// Checks the request and prepares the camera.
///
/// # Errors
/// [`Error::Setting`], [`Error::ImageSize`], [`Error::TooManyPoints`] and [`Error::Camera`].
pub(super) fn check(
    points: Points<'_>,
    camera: &Camera,
    [width, height]: [u32; 2],
    settings: &Settings,
) -> Result<View, Error> {
    settings.check()?;
    let sides = 1..=MAX_SIDE;
    if !sides.contains(&width) || !sides.contains(&height) {
        return Err(Error::ImageSize { width, height });
    }
    check_count(points)?;
    camera.view(points.origin(), [width, height])
}

/// Checks that indices of points fit.
///
/// # Errors
/// [`Error::TooManyPoints`].
pub(super) fn check_count(points: Points<'_>) -> Result<(), Error> {
    // The last index marks empty pixels.
    if points.room() >= u32::MAX as usize { Err(Error::TooManyPoints(points.room())) } else { Ok(()) }
}

//! Points, and triangles between them.

use crate::PointCloud;

/// Contents of a file: points, and triangles between them if the file is a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Contents {
    /// The points.
    pub cloud: PointCloud,
    /// Corners of triangles, as indices of points; empty unless triangles were asked for. Polygons are cut into
    /// triangles. Faces with corners that do not exist are left out.
    pub triangles: Vec<[u32; 3]>,
}

impl From<PointCloud> for Contents {
    fn from(cloud: PointCloud) -> Self {
        Self { cloud, triangles: Vec::new() }
    }
}

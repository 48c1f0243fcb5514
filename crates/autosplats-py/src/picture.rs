//! Pictures: their pixels and layers as arrays, and as files.

use std::io::{BufWriter, Cursor, Write as _};
use std::path::PathBuf;

use autosplats::{Camera, Counts, GBuffer, Image, Timings};
use autosplats_cloud::write_whole;
use autosplats_output::{PictureFormat, write_exr, write_picture};
use numpy::ndarray::Dim;
use numpy::{Element, PyArray, PyArrayMethods as _, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::camera::{parsed, written};
use crate::errors::{self, Class, Failure};
use crate::read::output;
use crate::view::view;
use crate::wait::run;

/// A picture that was rendered.
#[pyclass(frozen, module = "autosplats._core")]
pub(crate) struct Frame {
    image: Image,
    /// The surface, if all layers were asked for.
    layers: Option<GBuffer>,
    camera: Camera,
    /// As JSON.
    counts: String,
    timings: String,
    is_transparent: bool,
}

/// Format of a file.
#[derive(Clone, Copy)]
enum Format {
    Picture(PictureFormat),
    Exr,
}

impl Frame {
    /// Keeps what a renderer lends, averaged down by `factor`.
    pub(crate) fn new(
        frame: &autosplats::Frame<'_>,
        factor: u32,
        camera: Camera,
        all_layers: bool,
        is_transparent: bool,
    ) -> Self {
        let image = if factor > 1 { frame.image.averaged(factor) } else { frame.image.clone() };
        let json = |value: Result<String, serde_json::Error>| value.unwrap_or_else(|_| "{}".into());
        Self {
            image,
            layers: all_layers.then(|| frame.layers.clone()),
            camera,
            counts: json(serde_json::to_string(&frame.counts)),
            timings: json(serde_json::to_string(&frame.timings)),
            is_transparent,
        }
    }

    fn layers(&self) -> PyResult<&GBuffer> {
        self.layers.as_ref().ok_or_else(|| {
            errors::raise(Class::Missing, "the picture has no layers; render it with layers=True".into())
        })
    }

    /// Values in the order of the picture, as an array of height, width and `depth` numbers.
    fn rows<'py, T: Element, const N: usize>(
        &self,
        py: Python<'py>,
        rows: impl FnOnce(&GBuffer) -> Result<Vec<[T; N]>, Failure> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let layers = self.layers()?;
        let rows = run(py, None, None, |_| rows(layers))?;
        let [height, width] = [self.image.height, self.image.width].map(|side| side as usize);
        let flat = numpy::PyArray1::from_vec(py, rows.into_flattened());
        Ok(if N == 1 {
            flat.reshape([height, width])?.into_any()
        } else {
            flat.reshape([height, width, N])?.into_any()
        })
    }

    fn write(&self, format: Format, writer: impl std::io::Write + std::io::Seek) -> std::io::Result<()> {
        match (format, &self.layers) {
            (Format::Picture(format), _) => write_picture(&self.image, format, self.is_transparent, writer),
            (Format::Exr, Some(layers)) => {
                let (counts, timings) = (Counts::default(), Timings::default());
                let frame = autosplats::Frame { image: &self.image, layers, counts, timings, passes: &[] };
                write_exr(&frame, &self.camera, writer)
            }
            (Format::Exr, None) => Err(std::io::Error::other("the picture has no layers")),
        }
    }

    /// The format of this extension, which the picture can have.
    fn format(&self, extension: &str) -> PyResult<Format> {
        let format = match PictureFormat::of(format!("a.{extension}").as_ref()) {
            Some(PictureFormat::Jpeg) if self.is_transparent => {
                let what = "a .jpg cannot be transparent; write a .png, or render with another background";
                return Err(errors::raise(Class::Argument, what.into()));
            }
            Some(format) => Format::Picture(format),
            None if extension.eq_ignore_ascii_case("exr") => {
                self.layers()?;
                Format::Exr
            }
            None => {
                let what = format!("unknown picture format '{extension}'; it must be png, jpg or exr");
                return Err(errors::raise(Class::Argument, what));
            }
        };
        Ok(format)
    }
}

/// Value of one layer, for [`Frame::rows`].
fn one<T: Copy + Send + Sync>(layers: &GBuffer, layer: &[T], empty: T) -> Result<Vec<[T; 1]>, Failure> {
    Ok(layers.rows(layer, empty).into_iter().map(|value| [value]).collect())
}

#[pymethods]
impl Frame {
    /// Pixels (height, width, 4), a view.
    #[getter]
    fn pixels<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray<u8, Dim<[usize; 3]>>>> {
        let image = &slf.get().image;
        view(image.pixels.as_flattened(), (image.height as usize, image.width as usize, 4), slf.as_any().clone())
    }

    #[getter]
    fn camera(&self) -> PyResult<String> {
        written(&self.camera)
    }

    #[getter]
    fn counts(&self) -> &str {
        &self.counts
    }

    #[getter]
    fn timings(&self) -> &str {
        &self.timings
    }

    #[getter]
    fn has_layers(&self) -> bool {
        self.layers.is_some()
    }

    /// Depth along the viewing axis; infinite where no surface is.
    fn depth<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| one(layers, &layers.depth, f32::INFINITY))
    }

    /// Normals in world space; zero where no surface is.
    fn normals<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| Ok(layers.world_normals(&self.camera)?))
    }

    /// Index of the point; -1 where no surface is.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| {
            let rows = layers.rows(&layers.point, u32::MAX);
            Ok(rows.into_iter().map(|point| [if point == u32::MAX { -1 } else { i64::from(point) }]).collect())
        })
    }

    /// Radius of the splats; 0 where no surface is.
    fn radius<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| one(layers, &layers.radius, 0.0))
    }

    /// Distance to the k-th neighbour; 0 where no surface is.
    fn k_radius<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| one(layers, &layers.k_radius, 0.0))
    }

    /// Surface variation; 0 where no surface is.
    fn curvature<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.rows(py, |layers| one(layers, &layers.curvature, 0.0))
    }

    /// The bytes of a file: png, jpg or exr.
    fn encode<'py>(&self, py: Python<'py>, format: &str) -> PyResult<Bound<'py, PyBytes>> {
        let format = self.format(format)?;
        let bytes = py.detach(|| {
            let mut bytes = Cursor::new(Vec::new());
            self.write(format, &mut bytes).map(|()| bytes.into_inner())
        });
        Ok(PyBytes::new(py, &bytes.map_err(|error| Failure::Io("picture".into(), error).raise())?))
    }

    /// Writes a file in the format of the path's extension. It appears whole or not at all.
    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().into_owned()).unwrap_or_default();
        let format = self.format(&extension)?;
        let output = output(&path, overwrite)?;
        run(py, None, None, |_| {
            let failed = |error| Failure::Io(path.clone(), error);
            let written = write_whole(output, failed, |file| {
                let mut writer = BufWriter::with_capacity(1 << 18, file.get_mut());
                self.write(format, &mut writer).and_then(|()| writer.flush()).map_err(failed)
            });
            written.map(|_bytes| ())
        })
    }

    /// All that the picture is, for pickling. Normals are in view space.
    fn state<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyDict>> {
        let (this, py) = (slf.get(), slf.py());
        let state = PyDict::new(py);
        state.set_item("pixels", Self::pixels(slf)?)?;
        state.set_item("camera", this.camera()?)?;
        state.set_item("counts", &this.counts)?;
        state.set_item("timings", &this.timings)?;
        state.set_item("is_transparent", this.is_transparent)?;
        let mut layers = Vec::new();
        if this.layers.is_some() {
            let linear = &this.image.linear;
            layers.push(view(linear.as_flattened(), linear.len() * 3, slf.as_any().clone())?.into_any());
            layers.push(this.rows(py, |layers| Ok(layers.rows(&layers.normal, [0.0; 3])))?);
            layers.push(this.rows(py, |layers| one(layers, &layers.point, u32::MAX))?);
            layers.extend([this.depth(py)?, this.radius(py)?, this.k_radius(py)?, this.curvature(py)?]);
        }
        state.set_item("layers", layers)?;
        Ok(state)
    }

    /// The picture of a [state](Self::state).
    #[staticmethod]
    fn of_state(
        pixels: PyReadonlyArray3<'_, u8>,
        camera: &str,
        counts: String,
        timings: String,
        is_transparent: bool,
        layers: Vec<Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let pixels = pixels.as_array();
        let &[height, width, 4] = pixels.shape() else {
            return Err(errors::raise(Class::Argument, "state of a picture: pixels must be (height, width, 4)".into()));
        };
        let values: Vec<u8> = pixels.iter().copied().collect();
        let mut image = Image {
            width: width as u32,
            height: height as u32,
            pixels: values.as_chunks::<4>().0.to_vec(),
            linear: Vec::new(),
        };
        let layers = match layers.as_slice() {
            [linear, normal, point, rest @ ..] => {
                let linear: PyReadonlyArray1<'_, f32> = linear.extract()?;
                image.linear = linear.as_array().to_vec().as_chunks::<3>().0.to_vec();
                Some(unpacked([width, height], normal, point, rest)?)
            }
            _ => None,
        };
        Ok(Self { image, layers, camera: parsed(camera)?, counts, timings, is_transparent })
    }
}

/// Layers of arrays in the order of the picture.
fn unpacked(
    [width, height]: [usize; 2],
    normal: &Bound<'_, PyAny>,
    point: &Bound<'_, PyAny>,
    rest: &[Bound<'_, PyAny>],
) -> PyResult<GBuffer> {
    let bad = || errors::raise(Class::Argument, "state of a picture: layers must be as large as the picture".into());
    let normal: PyReadonlyArray3<'_, f32> = normal.extract()?;
    let point: PyReadonlyArray2<'_, u32> = point.extract()?;
    let rest = rest.iter().map(PyAnyMethods::extract).collect::<Result<Vec<PyReadonlyArray2<'_, f32>>, _>>()?;
    let [depth, radius, k_radius, curvature] = rest.as_slice() else { return Err(bad()) };
    let [depth, radius, k_radius, curvature] = [depth, radius, k_radius, curvature].map(|layer| layer.as_array());
    let (normal, point) = (normal.as_array(), point.as_array());
    let shape = [height, width];
    if [depth, radius, k_radius, curvature].iter().any(|layer| layer.shape() != shape)
        || point.shape() != shape
        || normal.shape() != [height, width, 3]
    {
        return Err(bad());
    }
    let mut layers = GBuffer::new(width as u32, height as u32);
    let area = layers.depth.len();
    [layers.radius, layers.k_radius, layers.curvature] = [(); 3].map(|()| vec![0.0; area]);
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let index = layers.index(x, y);
        layers.depth[index] = depth[[y, x]];
        layers.weight[index] = f32::from(depth[[y, x]].is_finite());
        layers.normal[index] = [0, 1, 2].map(|axis| normal[[y, x, axis]]);
        layers.point[index] = point[[y, x]];
        layers.radius[index] = radius[[y, x]];
        layers.k_radius[index] = k_radius[[y, x]];
        layers.curvature[index] = curvature[[y, x]];
    }
    Ok(layers)
}

/// The bytes of a picture file of an array (height, width, 4): png or jpg.
#[pyfunction]
pub(crate) fn encode_picture<'py>(
    py: Python<'py>,
    pixels: PyReadonlyArray3<'py, u8>,
    format: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    let camera = r#"{"eye":[0,0,0],"look_at":[0,1,0],"up":[0,0,1],"projection":{"perspective_fov_deg":40}}"#;
    Frame::of_state(pixels, camera, String::new(), String::new(), false, Vec::new())?.encode(py, format)
}

//! The Python package `raykiln`: the library's functions, with options as on the command line.

use std::collections::BTreeMap;
use std::error::Error as StdError;
use std::path::{Path, PathBuf};

use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::create_exception;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyString};
use raykiln::scene::{self, Scene, TriangleRef};
use raykiln::verify::identity::Identity;
use raykiln::{BakeOptions, LoadOptions, MatchBy};

create_exception!(_raykiln, Error, PyValueError, "A file cannot be read, written or baked, or an option is wrong.");

/// An error of the library, for Python.
fn error(error: impl StdError) -> PyErr {
    Error::new_err(error.to_string())
}

/// What is baked or inspected.
#[derive(FromPyObject)]
enum Source {
    #[pyo3(transparent)]
    Bytes(Vec<u8>),
    #[pyo3(transparent)]
    Path(PathBuf),
}

impl Source {
    /// The name and the bytes of a file that refers to no other.
    fn read(self, name: Option<PathBuf>) -> PyResult<(PathBuf, Vec<u8>)> {
        match self {
            Source::Bytes(bytes) => Ok((name.unwrap_or_else(|| "scene.glb".into()), bytes)),
            Source::Path(path) => {
                let bytes = std::fs::read(&path);
                let bytes = bytes.map_err(|why| Error::new_err(format!("{}: {why}", path.display())))?;
                Ok((path, bytes))
            }
        }
    }
}

/// Reads keyword arguments as options of the program.
fn options(given: Option<&Bound<'_, PyDict>>) -> PyResult<BakeOptions> {
    let mut words = BTreeMap::new();
    for (option, value) in given.into_iter().flatten() {
        let option = option.extract::<String>()?.replace('_', "-");
        words.insert(option, values(&value)?);
    }
    raykiln::cli::bake_options(&words).map_err(Error::new_err)
}

/// The values of an option as they would be written on the command line.
fn values(value: &Bound<'_, PyAny>) -> PyResult<Vec<String>> {
    if let Ok(is_on) = value.extract::<bool>() {
        return Ok(vec![is_on.to_string()]);
    }
    if value.is_none() {
        return Err(PyTypeError::new_err("an option is a string, a number, a bool or a list of strings, not None"));
    }
    let is_list = value.hasattr("__iter__")? && !value.is_instance_of::<PyString>();
    if is_list {
        return value.try_iter()?.map(|one| one?.str()?.extract()).collect();
    }
    Ok(vec![value.str()?.extract()?])
}

/// The JSON of a report as a dictionary.
fn report<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}

/// The result of a bake.
#[pyclass(frozen, module = "raykiln")]
struct Baked {
    json: String,
    glb: Option<Py<PyBytes>>,
}

#[pymethods]
impl Baked {
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        report(py, &self.json)
    }

    #[getter]
    fn verdict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.report(py)?.get_item("verdict")
    }

    #[getter]
    fn glb(&self, py: Python<'_>) -> Option<Py<PyBytes>> {
        self.glb.as_ref().map(|glb| glb.clone_ref(py))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<raykiln.Baked: {}>", self.verdict(py)?))
    }
}

#[pyfunction]
#[pyo3(signature = (source, *, output=None, name=None, **options))]
fn bake(
    py: Python<'_>,
    source: Source,
    output: Option<PathBuf>,
    name: Option<PathBuf>,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<Baked> {
    let options = self::options(options)?;
    let (report, glb) = match (source, output) {
        (Source::Path(path), Some(output)) => {
            (py.detach(|| raykiln::bake(&path, &output, &options)).map_err(error)?, None)
        }
        (Source::Bytes(_), Some(_)) => {
            return Err(PyTypeError::new_err("output: bytes are baked to bytes; write `glb` to a file"));
        }
        (source, None) => {
            let (name, bytes) = source.read(name)?;
            let baked = py.detach(|| raykiln::bake_bytes(name, bytes, &options)).map_err(error)?;
            (baked.report, baked.glb.map(|glb| PyBytes::new(py, &glb).unbind()))
        }
    };
    let json = raykiln::report::json::to_json(&report);
    Ok(Baked { json, glb })
}

#[pyfunction]
#[pyo3(signature = (source, *, name=None, **options))]
fn inspect<'py>(
    py: Python<'py>,
    source: Source,
    name: Option<PathBuf>,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let load = self::options(options)?.load;
    let found = match source {
        Source::Path(path) => py.detach(|| raykiln::inspect(path, &load)),
        bytes => {
            let (name, bytes) = bytes.read(name)?;
            py.detach(|| raykiln::inspect_bytes(name, bytes, &load))
        }
    };
    report(py, &raykiln::report::json::to_json(&found.map_err(error)?))
}

#[pyfunction]
#[pyo3(signature = (before, after, **options))]
fn verify<'py>(
    py: Python<'py>,
    before: PathBuf,
    after: PathBuf,
    options: Option<&Bound<'py, PyDict>>,
) -> PyResult<Bound<'py, PyAny>> {
    let verify = self::options(options)?.verify;
    let found = py.detach(|| raykiln::verify(before, after, MatchBy::Auto, &verify)).map_err(error)?;
    report(py, &raykiln::report::json::to_json(&found))
}

fn load(path: &Path) -> Result<Scene, raykiln::FileError> {
    let doc = raykiln_formats::read(path)?;
    Ok(scene::load(&doc, &LoadOptions::default())?.0)
}

#[pyfunction]
fn groups<'py>(py: Python<'py>, source: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let scene = py.detach(|| load(&source)).map_err(error)?;
    let all = PyDict::new(py);
    all.set_item("names", scene.meshes.iter().map(|mesh| mesh.name.as_str()).collect::<Vec<_>>())?;
    all.set_item("mesh", PyArray1::from_iter(py, scene.meshes.iter().map(|mesh| mesh.source)))?;
    all.set_item("geometries", PyArray1::from_iter(py, scene.meshes.iter().map(|mesh| mesh.geometries.len() as u32)))?;
    all.set_item("triangles", PyArray1::from_iter(py, scene.meshes.iter().map(|mesh| mesh.triangle_count() as u64)))?;
    all.set_item("instance_group", PyArray1::from_iter(py, scene.instances.iter().map(|at| at.mesh.0)))?;
    all.set_item("instance_node", PyArray1::from_iter(py, scene.instances.iter().map(|at| at.node)))?;
    let transforms = scene.instances.iter().flat_map(|at| {
        let rows = at.transform.matrix3.transpose();
        let translation = at.transform.translation;
        [0, 1, 2].into_iter().flat_map(move |row| rows.col(row).to_array().into_iter().chain([translation[row]]))
    });
    let count = scene.instances.len();
    let transforms: Bound<'_, PyArray3<f64>> = PyArray1::from_iter(py, transforms).reshape([count, 3, 4])?;
    all.set_item("instance_transform", transforms)?;
    let bounds = scene.instance_boxes().iter().flat_map(|b| b.min.to_array().into_iter().chain(b.max.to_array()));
    let bounds: Bound<'_, PyArray3<f64>> = PyArray1::from_iter(py, bounds).reshape([count, 2, 3])?;
    all.set_item("instance_bounds", bounds)?;
    Ok(all)
}

/// The columns of `provenance`.
const COLUMNS: [&str; 7] =
    ["group", "instance", "source_node", "source_copy", "source_mesh", "source_primitive", "source_triangle"];

#[pyfunction]
fn provenance<'py>(py: Python<'py>, before: PathBuf, after: PathBuf) -> PyResult<Bound<'py, PyDict>> {
    let rows = py.detach(|| -> Result<Vec<[i64; 7]>, raykiln::FileError> {
        let (before, after) = (load(&before)?, load(&after)?);
        let identity = Identity::new(&before, &after);
        Ok(rows(&identity, &before, &after))
    });
    let rows = rows.map_err(error)?;
    let all = PyDict::new(py);
    for (column, name) in COLUMNS.into_iter().enumerate() {
        all.set_item(name, PyArray1::from_iter(py, rows.iter().map(|row| row[column])))?;
    }
    Ok(all)
}

/// One row per triangle that `after` places.
fn rows(identity: &Identity, before: &Scene, after: &Scene) -> Vec<[i64; 7]> {
    let mut rows = Vec::new();
    for (number, instance) in (0u32..).zip(&after.instances) {
        let mesh = &after.meshes[instance.mesh.0 as usize];
        for (g, geometry) in mesh.geometries.iter().enumerate() {
            let placed = [i64::from(instance.mesh.0), i64::from(number)];
            for source in identity.sources(number, g, 0..geometry.triangles.len()) {
                let [node, copy, mesh, primitive, triangle] = source.map_or([-1; 5], |at| in_file(before, at));
                rows.push([placed[0], placed[1], node, copy, mesh, primitive, triangle]);
            }
        }
    }
    rows
}

/// Node, copy, mesh, primitive and triangle of a placed triangle, as its file counts them.
fn in_file(scene: &Scene, at: TriangleRef) -> [i64; 5] {
    let instance = &scene.instances[at.instance as usize];
    let mesh = &scene.meshes[instance.mesh.0 as usize];
    let (g, triangle) = mesh.locate(at.triangle);
    let geometry = &mesh.geometries[g];
    let triangle = geometry.kept.as_ref().map_or(triangle as u32, |kept| kept[triangle]);
    [instance.node, instance.copy, mesh.source, geometry.primitive, triangle].map(i64::from)
}

/// The extension module.
#[pymodule]
fn _raykiln(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("Error", module.py().get_type::<Error>())?;
    module.add_class::<Baked>()?;
    module.add_function(wrap_pyfunction!(bake, module)?)?;
    module.add_function(wrap_pyfunction!(inspect, module)?)?;
    module.add_function(wrap_pyfunction!(verify, module)?)?;
    module.add_function(wrap_pyfunction!(groups, module)?)?;
    module.add_function(wrap_pyfunction!(provenance, module)?)
}

//! The library for Python. This crate holds no program logic: it turns numpy arrays and Python values into the arguments of the
//! library calls that the programs make, and their results, errors and warnings into Python's.
//!
//! `python/python/clothcombo` is what users import; it prepares arguments for the module here, `clothcombo._native`.

mod arrays;
mod body;
mod call;
mod drape;
mod measure;
mod model;
mod scene;

use pyo3::prelude::*;

/// Calls of `clothcombo`, whose arguments the package has prepared.
#[pymodule]
mod _native {
    #[pymodule_export]
    use crate::body::PyBody;
    #[pymodule_export]
    use crate::drape::PyDrape;
    #[pymodule_export]
    use crate::measure::{certificate, check, fit_garment, resolve, score};
    #[pymodule_export]
    use crate::model::{PyModel, PyOutfit};
    #[pymodule_export]
    use crate::scene::{PyScene, default_losses, evaluate_f32, evaluate_f64};
    use clothcombo_physics::energy::Term;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        crate::call::listen_for_warnings();
        module.add("TERMS", Term::ALL.map(Term::name))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}

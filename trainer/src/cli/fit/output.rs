//! What `clothcombo fit` writes.

use clothcombo_data::fit::{Fitted, SourceBody};
use clothcombo_data::format::obj::{MovedObj, RepairedForm, save_file_faces};
use clothcombo_data::format::{
    FileError, FileFace, MeshFormat, PolygonMesh, atomic, obj, parse_mesh, read_mesh_file,
};
use miette::{IntoDiagnostic, Report, miette};
use std::fs;
use std::path::{Path, PathBuf};

/// A garment file.
pub(super) struct Given {
    pub mesh: PolygonMesh,
    path: PathBuf,
    /// An OBJ file, whose statements can be repeated.
    obj: Option<Vec<u8>>,
}

/// Which faces are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum OutputForm {
    /// The file's, as far as they are still true.
    Repaired,
    /// Triangles.
    Triangles,
    /// The file's, all of them.
    Whole,
}

/// Nothing but an OBJ is written, and never over the garment as it was given, its materials or the body it was made on.
pub(super) fn check_output(
    output: &Path,
    garment: &Path,
    from_body: Option<&SourceBody>,
) -> Result<(), Report> {
    if !output.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj")) {
        let help = format!("for example -o {}", output.with_extension("obj").display());
        return Err(miette!(help = help, "{}: the fitted garment is written as .obj", output.display()));
    }
    let place = fs::canonicalize(output).ok();
    let is_same = |path: &Path| place.is_some() && fs::canonicalize(path).ok() == place;
    let what = match from_body {
        _ if is_same(garment) => "garment",
        Some(body) if is_same(body.path()) => "body of --from-body",
        _ => return Ok(()),
    };
    Err(miette!(help = "give -o another name", "{} is the {what} itself", output.display()))
}

/// Reads a garment file once, so that what is written is what was fitted.
pub(super) fn read(path: &Path) -> Result<Given, Report> {
    let bytes = read_mesh_file(path).into_diagnostic()?;
    let mesh = parse_mesh(&bytes, path).into_diagnostic()?;
    let is_obj = MeshFormat::detect(path, &bytes) == Some(MeshFormat::Obj);
    Ok(Given { mesh, path: path.into(), obj: is_obj.then_some(bytes) })
}

/// Writes a fitted garment in one of its forms, with leading `comments`.
pub(super) fn save(
    output: &Path,
    given: &Given,
    fitted: &Fitted,
    form: OutputForm,
    comments: &[String],
) -> Result<(), Report> {
    let rest = &fitted.garment.rest;
    // Materials are named in the file: by a name that can be written there.
    let name = output.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let (positions, faces) = match form {
        OutputForm::Triangles => {
            return obj::save(output, rest.positions(), rest.faces(), comments).into_diagnostic();
        }
        OutputForm::Repaired => (rest.positions().to_vec(), fitted.file_faces.clone()),
        OutputForm::Whole => {
            let whole = |(face, polygon): (usize, &[u32])| FileFace {
                face: face as u32,
                corners: polygon.iter().copied().zip(0..).map(<[u32; 2]>::from).collect(),
            };
            let faces = given.mesh.polygons().enumerate().map(whole).collect();
            (fitted.in_file_order(rest.positions()), faces)
        }
    };
    let Some(bytes) = &given.obj else {
        return save_file_faces(output, &positions, &faces, &given.mesh, comments).into_diagnostic();
    };
    let moved = match form {
        OutputForm::Whole => MovedObj::new(&given.path, bytes, &positions, &name).ok(),
        _ => {
            let form =
                RepairedForm { positions: &positions, vertex_origin: &fitted.vertex_origin, faces: &faces };
            MovedObj::repaired(&given.path, bytes, &form, &name).ok()
        }
    };
    let moved = moved.ok_or_else(|| {
        miette!(
            help = "--triangles writes the garment without texture coordinates, groups and materials",
            "{} cannot be repeated statement by statement",
            given.path.display()
        )
    })?;
    let lines = comments.iter().flat_map(|comment| comment.lines());
    let mut bytes: Vec<u8> = lines.flat_map(|line| format!("# {line}\n").into_bytes()).collect();
    bytes.extend_from_slice(b"# what follows is the file as it was given, fitted and without normals\n");
    bytes.extend_from_slice(&moved.obj);
    if let Some(mtl) = &moved.mtl {
        let materials = output.with_file_name(format!("{name}.mtl"));
        check_materials(&materials, output, &moved.libraries)?;
        atomic::write(&materials, mtl).map_err(FileError::io(&materials)).into_diagnostic()?;
    }
    atomic::write(output, &bytes).map_err(FileError::io(output)).into_diagnostic()
}

/// Refuses materials that would be written over those of the garment, or over some that belong to no garment written here before.
fn check_materials(materials: &Path, output: &Path, libraries: &[PathBuf]) -> Result<(), Report> {
    if materials.exists() && !output.exists() {
        return Err(miette!(
            help = "give -o another name or folder, or move that file",
            "{} is there already, and would be written over by the garment's materials",
            materials.display()
        ));
    }
    let place = fs::canonicalize(materials).ok();
    match place.is_some() && libraries.iter().any(|library| fs::canonicalize(library).ok() == place) {
        true => Err(miette!(
            help = "give -o another name or folder",
            "{} are the garment's own materials, and would be written over",
            materials.display()
        )),
        false => Ok(()),
    }
}

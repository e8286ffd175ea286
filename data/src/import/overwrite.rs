//! No importer writes over what it reads: the input may be the only copy.

use super::summary::ImportError;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Refuses outputs that are inputs, by whatever path they are named. Folders as inputs are compared with folders as outputs.
///
/// # Errors
/// [`ImportError`] naming the input and the output that are one file.
pub fn refuse_overwriting<I: AsRef<Path>, O: AsRef<Path>>(
    inputs: impl IntoIterator<Item = I>,
    outputs: impl IntoIterator<Item = O>,
) -> Result<(), ImportError> {
    // What is not there yet is no input.
    let outputs: HashMap<PathBuf, O> = (outputs.into_iter())
        .filter_map(|output| Some((fs::canonicalize(output.as_ref()).ok()?, output)))
        .collect();
    for input in inputs {
        let input = input.as_ref();
        if let Some(output) = fs::canonicalize(input).ok().and_then(|real| outputs.get(&real)) {
            return Err(ImportError::Refused(format!(
                "{} would be written over the input {}; choose another folder or file with -o",
                output.as_ref().display(),
                input.display()
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_output_is_refused_by_any_name_of_an_input() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        fs::write(at("a.npz"), b"a").unwrap();
        fs::write(at("b.npz"), b"b").unwrap();
        let inputs = [at("a.npz"), at("sub")];
        refuse_overwriting(&inputs, [at("b.npz"), at("new.npz"), at("nowhere/a.npz")]).unwrap();
        for output in ["a.npz", "sub/../a.npz", "sub/../sub"] {
            let message = refuse_overwriting(&inputs, [at("b.npz"), at(output)]).unwrap_err().to_string();
            assert!(message.contains(output) && message.contains("-o"), "{message}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(at("a.npz"), at("link.npz")).unwrap();
            assert!(refuse_overwriting(&inputs, [at("link.npz")]).is_err());
        }
    }
}

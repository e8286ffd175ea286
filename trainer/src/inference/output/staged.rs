//! A folder that appears whole or not at all.

use crate::system::paths::obstacle;
use clothcombo_data::format::atomic::Temporary;
use miette::{Report, miette};
use std::collections::HashSet;
use std::fs;
use std::hash::{BuildHasher, RandomState};
use std::io;
use std::path::{Path, PathBuf};

/// Lists the files of a folder that was written here, one relative path a line: `--replace` removes nothing else.
const LIST: &str = ".clothcombo-files";

/// A folder under a temporary name beside its target; removed again unless it is [committed](Self::commit).
#[derive(Debug)]
pub struct Staged {
    target: PathBuf,
    temporary: Temporary,
    replace: bool,
    inputs: Vec<PathBuf>,
}

impl Staged {
    /// Starts a folder that will become `target`, which must not exist or be empty, or hold what an earlier one held and
    /// none of `inputs` if `replace`.
    ///
    /// # Errors
    /// When something else is there, or the folder cannot be made.
    pub fn new(target: &Path, replace: bool, inputs: &[PathBuf]) -> Result<Self, Report> {
        let name = target.file_name().ok_or_else(|| {
            miette!(
                help = format!(
                    "give the folder to be made a name, for example -o {}",
                    target.join("drape").display()
                ),
                "{} names no new folder",
                target.display()
            )
        })?;
        // A link to a folder stays a link.
        let target = fs::canonicalize(target).unwrap_or_else(|_| target.to_owned());
        check_free(&target, replace, inputs)?;
        let number = RandomState::new().hash_one(0);
        let temporary = target.with_file_name(format!(".{}.{number:016x}.tmp", name.to_string_lossy()));
        let temporary = Temporary::new(temporary);
        let staged = Self { target, temporary, replace, inputs: inputs.to_vec() };
        fs::create_dir_all(staged.folder()).map_err(|e| cannot_write(staged.folder(), &e))?;
        Ok(staged)
    }

    /// Adds to what is read, for what is only known after the start.
    ///
    /// # Errors
    /// When one of `inputs` lies in the folder that is to be replaced.
    pub fn keep(&mut self, inputs: impl IntoIterator<Item = PathBuf>) -> Result<(), Report> {
        self.inputs.extend(inputs);
        check_free(&self.target, self.replace, &self.inputs)
    }

    /// Where to write.
    pub fn folder(&self) -> &Path {
        self.temporary.path()
    }

    /// Gives the folder its name. What was there before is removed only after that; what has come there since the start is
    /// not, and the folder gets another name.
    ///
    /// # Errors
    /// When it cannot be renamed, or not as was asked; what was there before is left as it was.
    pub fn commit(self) -> Result<(), Report> {
        let failed = |reason: io::Error| cannot_write(&self.target, &reason);
        let folder = self.folder();
        let list: String = files(folder).map_err(failed)?.iter().map(|f| format!("{f}\n")).collect();
        fs::write(folder.join(LIST), list).map_err(failed)?;
        if let Err(reason) = check_free(&self.target, self.replace, &self.inputs) {
            let instead = free_name(&self.target);
            fs::rename(folder, &instead).map_err(failed)?;
            self.temporary.keep();
            return Err(miette!(
                "while this ran, something else came: {reason}; the result is in {}",
                instead.display()
            ));
        }
        self.temporary.replace(&self.target).map_err(failed)
    }
}

/// Whether there is nothing at `target`, or what may be replaced.
fn check_free(target: &Path, replace: bool, inputs: &[PathBuf]) -> Result<(), Report> {
    if let Some(file) = obstacle(target) {
        return Err(miette!(
            help = "-o names the folder to be made: choose another name",
            "{} is a file, not a folder",
            file.display()
        ));
    }
    match fs::symlink_metadata(target).is_ok() && !is_empty_folder(target) {
        true if replace => check_own(target, inputs),
        true => Err(miette!(
            help = "choose another folder, or pass --replace if it holds earlier results",
            "{} is there and is not empty",
            target.display()
        )),
        false => Ok(()),
    }
}

/// The file system refused.
pub(super) fn cannot_write(path: &Path, reason: &io::Error) -> Report {
    miette!(
        help = "check that the folder is writable and the disk is not full; nothing was left behind",
        "cannot write {}: {reason}",
        path.display()
    )
}

/// `target` with the first number that is not taken.
fn free_name(target: &Path) -> PathBuf {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let numbered = |number: usize| target.with_file_name(format!("{name}-{number}"));
    (2..).map(numbered).find(|path| fs::symlink_metadata(path).is_err()).unwrap_or_else(|| numbered(2))
}

/// Whether all of `folder` was written here, and none of it is read now.
fn check_own(folder: &Path, inputs: &[PathBuf]) -> Result<(), Report> {
    let Ok(list) = fs::read_to_string(folder.join(LIST)) else {
        return Err(miette!(
            help = "--replace only takes folders that drape or resolve has written; choose another folder",
            "{} is there and was not written by this program",
            folder.display()
        ));
    };
    let own: HashSet<&str> = list.lines().chain([LIST]).collect();
    let found = files(folder).map_err(|e| cannot_write(folder, &e))?;
    if let Some(file) = found.into_iter().find(|file| !own.contains(file.as_str())) {
        return Err(miette!(
            help = "--replace removes the whole folder: move the file away, or choose another folder",
            "{} holds {file}, which was not written with the rest",
            folder.display()
        ));
    }
    let is_inside = |input: &&PathBuf| fs::canonicalize(input).is_ok_and(|input| input.starts_with(folder));
    match inputs.iter().find(is_inside) {
        Some(input) => Err(miette!(
            help = "choose another folder for the output",
            "{} would be replaced, and {} in it is read",
            folder.display(),
            input.display()
        )),
        None => Ok(()),
    }
}

/// Everything in `folder` that is no folder, relative to it, in order.
fn files(folder: &Path) -> io::Result<Vec<String>> {
    let mut found = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(inner) = folders.pop() {
        for entry in fs::read_dir(folder.join(&inner))? {
            let entry = entry?;
            let path = inner.join(entry.file_name());
            match entry.file_type()?.is_dir() {
                true => folders.push(path),
                false => found.push(path.to_string_lossy().into_owned()),
            }
        }
    }
    found.sort();
    Ok(found)
}

fn is_empty_folder(path: &Path) -> bool {
    fs::read_dir(path).is_ok_and(|mut entries| entries.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    fn refused<T>(result: Result<T, Report>) -> String {
        result.err().expect("it is refused").to_string()
    }

    fn written(target: &Path, replace: bool, text: &str) -> Result<(), Report> {
        let staged = Staged::new(target, replace, &[])?;
        fs::create_dir_all(staged.folder().join("frames")).unwrap();
        fs::write(staged.folder().join("frames/a.obj"), text).unwrap();
        staged.commit()
    }

    #[test]
    fn a_folder_appears_whole_and_an_abandoned_one_not_at_all() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        let staged = Staged::new(&target, false, &[]).unwrap();
        fs::write(staged.folder().join("a.obj"), "x").unwrap();
        assert!(!target.exists());
        drop(staged);
        assert!(names(place.path()).is_empty());
        written(&target, false, "1").unwrap();
        assert_eq!(names(place.path()), ["out"]);
        assert_eq!(names(&target), [LIST, "frames"]);
        assert!(refused(Staged::new(Path::new("/"), false, &[])).contains("names no new folder"));
    }

    #[test]
    fn folders_made_for_an_abandoned_one_are_gone_unless_something_came_into_them() {
        let place = tempfile::tempdir().unwrap();
        let staged = || Staged::new(&place.path().join("a/b/out"), false, &[]).unwrap();
        drop(staged());
        assert!(names(place.path()).is_empty());
        let begun = staged();
        fs::write(place.path().join("a/note"), "x").unwrap();
        drop(begun);
        assert_eq!(
            (names(place.path()), names(&place.path().join("a"))),
            (vec!["a".into()], vec!["note".into()])
        );
        // What was there before stays, empty or not.
        fs::create_dir(place.path().join("a/b")).unwrap();
        drop(staged());
        assert_eq!(names(&place.path().join("a")), ["b", "note"]);
        staged().commit().unwrap();
        assert_eq!(names(&place.path().join("a/b")), ["out"]);
        // A file obstructs it: what was made up to it is gone too.
        let obstructed = Staged::new(&place.path().join("a/note/c/out"), false, &[]);
        assert!(refused(obstructed).contains("note is a file, not a folder"));
        assert_eq!(names(&place.path().join("a")), ["b", "note"]);
    }

    #[test]
    fn what_turns_out_to_be_read_is_not_replaced() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        written(&target, false, "1").unwrap();
        let mut staged = Staged::new(&target, true, &[]).unwrap();
        staged.keep([place.path().join("elsewhere.obj")]).unwrap();
        for input in [target.join("frames/a.obj"), target.clone()] {
            assert!(refused(staged.keep([input])).contains("in it is read"));
        }
        drop(staged);
        assert_eq!(names(place.path()), ["out"]);
    }

    #[test]
    fn only_what_was_written_here_is_replaced_and_only_when_asked() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        fs::create_dir(&target).unwrap();
        written(&target, false, "1").unwrap();
        assert!(refused(written(&target, false, "2")).contains("not empty"));
        written(&target, true, "2").unwrap();
        let file = target.join("frames/a.obj");
        assert_eq!(fs::read_to_string(&file).unwrap(), "2");
        // Neither what is read now is lost, nor what someone else has put there.
        let reading = Staged::new(&target, true, std::slice::from_ref(&file));
        assert!(refused(reading).contains("in it is read"));
        fs::write(target.join("frames/thesis.tex"), "x").unwrap();
        let thesis = Path::new("frames/thesis.tex").display().to_string();
        assert!(refused(written(&target, true, "3")).contains(&thesis), "a thesis was thrown away");
        assert_eq!(names(&target.join("frames")), ["a.obj", "thesis.tex"]);
        fs::remove_file(target.join(LIST)).unwrap();
        assert!(refused(written(&target, true, "3")).contains("not written by this program"));
        assert_eq!(names(place.path()), ["out"]);
    }

    #[test]
    fn what_comes_meanwhile_is_kept_and_so_is_the_result() {
        let place = tempfile::tempdir().unwrap();
        let target = place.path().join("out");
        let begun = |replace| {
            let staged = Staged::new(&target, replace, &[]).unwrap();
            fs::write(staged.folder().join("a.obj"), "x").unwrap();
            staged
        };
        // A file, then a folder with something in it, then something more in a folder that is to be replaced.
        let staged = begun(false);
        fs::write(&target, "mine").unwrap();
        assert!(refused(staged.commit()).contains("out-2"), "a file is gone");
        assert_eq!(fs::read_to_string(&target).unwrap(), "mine");
        assert_eq!(names(&place.path().join("out-2")), [LIST, "a.obj"]);
        fs::remove_file(&target).unwrap();
        let staged = begun(false);
        fs::create_dir(&target).unwrap();
        fs::write(target.join("own.txt"), "mine").unwrap();
        assert!(refused(staged.commit()).contains("something else came"));
        assert_eq!(names(&target), ["own.txt"]);
        fs::remove_dir_all(&target).unwrap();
        begun(false).commit().unwrap();
        let staged = begun(true);
        fs::write(target.join("own.txt"), "mine").unwrap();
        assert!(refused(staged.commit()).contains("something else came"));
        assert_eq!(names(&target), [LIST, "a.obj", "own.txt"]);
        assert_eq!(names(place.path()), ["out", "out-2", "out-3", "out-4"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_folder_stays_a_link() {
        let place = tempfile::tempdir().unwrap();
        let [real, link] = ["real", "link"].map(|name| place.path().join(name));
        fs::create_dir(&real).unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        written(&link, false, "1").unwrap();
        written(&link, true, "2").unwrap();
        assert!(link.is_symlink());
        assert_eq!(fs::read_to_string(real.join("frames/a.obj")).unwrap(), "2");
    }
}

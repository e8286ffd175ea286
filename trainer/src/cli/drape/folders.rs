//! Where a drape keeps what it computes.

use crate::system::paths::destination;
use miette::{IntoDiagnostic, Report, miette};
use std::path::Path;

/// Refuses a cache in the folder that is to be made.
pub(super) fn check_cache(cache: Option<&Path>, output: &Path) -> Result<(), Report> {
    let Some(cache) = cache else { return Ok(()) };
    let [inner, outer] = [cache, output].map(destination);
    match inner.into_diagnostic()?.starts_with(outer.into_diagnostic()?) {
        true => Err(miette!(
            help = "choose another folder for one of them, for the cache with --cache",
            "the cache {} lies in the folder that is to be made, {}",
            cache.display(),
            output.display()
        )),
        false => Ok(()),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_cache_in_the_output_is_found_however_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        std::fs::create_dir_all(at("real/inner")).unwrap();
        std::os::unix::fs::symlink(at("real"), at("link")).unwrap();
        let is_refused = |cache: &str, output: &str| check_cache(Some(&at(cache)), &at(output)).is_err();
        assert!(is_refused("out/cache", "out") && is_refused("out", "out"));
        assert!(is_refused("other/../out/cache", "out") && is_refused("out/cache", "real/../out"));
        assert!(is_refused("link/out/cache", "real/out") && is_refused("real/out/cache", "link/out"));
        assert!(!is_refused("cache", "out") && !is_refused("out/../cache", "out"));
        assert!(!is_refused("out-cache", "out") && check_cache(None, &at("out")).is_ok());
    }
}

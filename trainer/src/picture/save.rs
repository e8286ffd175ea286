//! Writing a picture whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage};

use super::PictureError;

/// Distinguishes the temporary files of threads of one process.
static SAVES: AtomicU64 = AtomicU64::new(0);

/// Writes `picture` as PNG to `path`, which appears whole or not at all: the bytes go to a temporary name in the same
/// folder, are synced and then renamed, so that a viewer never reads half a picture and a crash leaves the old one.
///
/// # Errors
/// [`PictureError::NoFileName`], [`PictureError::Write`] (missing or read-only folder, full disk; the temporary file
/// is removed) and [`PictureError::Encode`] (a picture of zero pixels).
pub fn save_png(picture: &RgbImage, path: &Path) -> Result<(), PictureError> {
    let name = path.file_name().ok_or_else(|| PictureError::NoFileName { path: path.to_path_buf() })?;
    let number = SAVES.fetch_add(1, Ordering::Relaxed);
    let mut temporary_name = std::ffi::OsString::from(".");
    temporary_name.push(name);
    temporary_name.push(format!(".{}-{number}.tmp", std::process::id()));
    let temporary = path.with_file_name(temporary_name);

    let write_error = |source| PictureError::Write { path: path.to_path_buf(), source };
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary).map_err(write_error)?;
    let saved = encode(picture, path, file).and_then(|()| fs::rename(&temporary, path).map_err(write_error));
    if saved.is_err() {
        // The first error is the one to report; a temporary file that cannot be removed changes nothing about it.
        let _ = fs::remove_file(&temporary);
    }
    saved
}

fn encode(picture: &RgbImage, path: &Path, file: File) -> Result<(), PictureError> {
    let (width, height) = picture.dimensions();
    let write_error = |source| PictureError::Write { path: path.to_path_buf(), source };
    let mut buffer = BufWriter::new(file);
    PngEncoder::new(&mut buffer).write_image(picture, width, height, ExtendedColorType::Rgb8).map_err(
        |source| {
            match source {
                // The encoder also reports a picture without pixels as a system error.
                image::ImageError::IoError(source) if width > 0 && height > 0 => write_error(source),
                source => PictureError::Encode { path: path.to_path_buf(), width, height, source },
            }
        },
    )?;
    buffer.flush().map_err(write_error)?;
    buffer.get_ref().sync_all().map_err(write_error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;

    fn file_names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_saved_picture_reads_back_and_replaces_the_old_one_without_leftovers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        let picture = RgbImage::from_fn(7, 5, |x, y| Rgb([x as u8 * 30, y as u8 * 40, 9]));
        save_png(&RgbImage::new(3, 3), &path).unwrap();
        save_png(&picture, &path).unwrap();
        assert_eq!(image::open(&path).unwrap().to_rgb8(), picture);
        assert_eq!(file_names(folder.path()), ["a.png"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing").join("a.png");
        let error = save_png(&RgbImage::new(2, 2), &path).unwrap_err();
        assert!(matches!(error, PictureError::Write { .. }));
        assert!(error.to_string().contains("a.png"), "{error}");
        assert!(file_names(folder.path()).is_empty());
    }

    #[test]
    fn a_folder_in_the_place_of_the_file_keeps_the_folder_and_leaves_no_temporary_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        fs::create_dir(&path).unwrap();
        fs::write(path.join("kept"), b"x").unwrap();
        assert!(matches!(save_png(&RgbImage::new(2, 2), &path), Err(PictureError::Write { .. })));
        assert_eq!(file_names(folder.path()), ["a.png"]);
        assert_eq!(file_names(&path), ["kept"]);
    }

    #[test]
    fn a_picture_of_zero_pixels_and_a_path_without_a_name_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(matches!(save_png(&RgbImage::new(0, 4), &path), Err(PictureError::Encode { .. })));
        assert!(file_names(folder.path()).is_empty());
        assert!(matches!(
            save_png(&RgbImage::new(2, 2), Path::new("..")),
            Err(PictureError::NoFileName { .. })
        ));
    }
}

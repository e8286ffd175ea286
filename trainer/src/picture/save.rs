//! Pictures as PNG, in memory or as a file that appears whole or not at all.

use super::PictureError;
use clothcombo_data::format::atomic;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, RgbImage};
use std::path::Path;

/// `picture` as the bytes of a PNG file.
///
/// # Errors
/// [`PictureError::Encode`] for a picture of zero pixels.
pub fn png_bytes(picture: &RgbImage) -> Result<Vec<u8>, PictureError> {
    let (width, height) = picture.dimensions();
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes)
        .write_image(picture, width, height, ExtendedColorType::Rgb8)
        .map_err(|source| PictureError::Encode { width, height, source })?;
    Ok(bytes)
}

/// Writes `picture` as PNG to `path`, so that a viewer never reads half a picture and a crash leaves the old one. Missing
/// folders are made.
///
/// # Errors
/// [`PictureError::NoFileName`], [`PictureError::Write`] (no right to write, full disk) and [`PictureError::Encode`] (a
/// picture of zero pixels).
pub fn save_png(picture: &RgbImage, path: &Path) -> Result<(), PictureError> {
    if path.file_name().is_none() {
        return Err(PictureError::NoFileName { path: path.to_path_buf() });
    }
    let write_error = |source| PictureError::Write { path: path.to_path_buf(), source };
    atomic::write(path, &png_bytes(picture)?).map_err(write_error)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgb;
    use std::fs;

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
    fn a_missing_folder_is_made_and_a_file_in_its_place_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("missing").join("a.png");
        save_png(&RgbImage::new(2, 2), &path).unwrap();
        assert_eq!(file_names(path.parent().unwrap()), ["a.png"]);
        let error = save_png(&RgbImage::new(2, 2), &path.join("b.png")).unwrap_err();
        assert!(matches!(error, PictureError::Write { .. }));
        assert!(error.to_string().contains("b.png"), "{error}");
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

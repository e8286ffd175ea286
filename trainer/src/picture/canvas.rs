//! The surface `plotters` draws on: an [`RgbImage`] with the built-in bitmap font, because a system font may not exist.

use std::convert::Infallible;

use image::{Rgb, RgbImage};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingBackend, DrawingErrorKind,
};

use super::font::{CAPITAL_HEIGHT, text_pixels, text_size};

/// Draws into a borrowed picture. The size of a text style is the height of its capitals [pixels], rounded to whole
/// dots of the font; text is anchored by its capitals, so that numbers stand level with their ticks.
pub(super) struct Canvas<'a> {
    picture: &'a mut RgbImage,
}

impl<'a> Canvas<'a> {
    pub(super) fn new(picture: &'a mut RgbImage) -> Self {
        Self { picture }
    }
}

/// Pixels per dot for a text of `height` pixels.
fn scale_of(height: f64) -> u32 {
    (height / f64::from(CAPITAL_HEIGHT)).round().clamp(1.0, 64.0) as u32
}

impl DrawingBackend for Canvas<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        self.picture.dimensions()
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn draw_pixel(
        &mut self,
        (x, y): BackendCoord,
        color: BackendColor,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        if let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y))
            && let Some(Rgb(pixel)) = self.picture.get_pixel_mut_checked(x, y)
        {
            let (red, green, blue) = color.rgb;
            for (value, ink) in pixel.iter_mut().zip([red, green, blue]) {
                let mixed = f64::from(*value) + color.alpha * (f64::from(ink) - f64::from(*value));
                *value = mixed.round() as u8;
            }
        }
        Ok(())
    }

    /// Axis-parallel lines keep their stroke width (the default draws them one pixel wide).
    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let width = style.stroke_width() as i32;
        if width > 1 && (from.0 == to.0 || from.1 == to.1) {
            let (before, after) = ((width - 1) / 2, width / 2);
            let is_vertical = from.0 == to.0;
            let (dx, dy) = if is_vertical { (1, 0) } else { (0, 1) };
            let low = (from.0.min(to.0) - dx * before, from.1.min(to.1) - dy * before);
            let high = (from.0.max(to.0) + dx * after, from.1.max(to.1) + dy * after);
            for y in low.1..=high.1 {
                for x in low.0..=high.0 {
                    self.draw_pixel((x, y), style.color())?;
                }
            }
            return Ok(());
        }
        plotters_backend::rasterizer::draw_line(self, from, to, style)
    }

    fn draw_text<T: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &T,
        (x, y): BackendCoord,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        let scale = scale_of(style.size());
        let width = text_size(text, scale)[0] as i32;
        let height = (CAPITAL_HEIGHT * scale) as i32;
        let left = match style.anchor().h_pos {
            HPos::Left => x,
            HPos::Center => x - width / 2,
            HPos::Right => x - width,
        };
        let top = match style.anchor().v_pos {
            VPos::Top => y,
            VPos::Center => y - height / 2,
            VPos::Bottom => y - height,
        };
        let mut result = Ok(());
        text_pixels(text, scale, |dx, dy| {
            if result.is_ok() {
                result = self.draw_pixel((left + dx as i32, top + dy as i32), style.color());
            }
        });
        result
    }

    fn estimate_text_size<T: BackendTextStyle>(
        &self,
        text: &str,
        style: &T,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let [width, height] = text_size(text, scale_of(style.size()));
        Ok((width, height))
    }
}

//! What a picture shows.

/// A triangle mesh to draw.
#[derive(Clone, Copy, Debug)]
pub struct Figure<'a> {
    /// Vertex positions (m). A vertex that is not finite, or very far off, leaves its faces out of the picture.
    pub positions: &'a [[f64; 3]],
    /// Vertex indices per face, counter-clockwise seen from outside. A face that names no vertex is left out.
    pub faces: &'a [[u32; 3]],
    /// Surface colour (sRGB); the back of the surface is drawn darker and greyer.
    pub colour: [u8; 3],
}

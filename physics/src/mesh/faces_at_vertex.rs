//! Which faces meet at a vertex.

/// The faces at every vertex of a surface, ascending.
#[derive(Debug, Clone)]
pub(crate) struct FacesAtVertex {
    /// Where the faces of a vertex begin, and one entry more.
    first: Vec<u32>,
    faces: Vec<u32>,
}

impl FacesAtVertex {
    /// Of `faces` with every index below `vertices`. A face is listed once for each of its corners.
    pub fn new(vertices: usize, faces: &[[u32; 3]]) -> Self {
        Self::of_some(vertices, faces, 0..faces.len() as u32)
    }

    /// Those among `some` of the faces, ascending.
    pub fn of_some(vertices: usize, faces: &[[u32; 3]], some: impl Iterator<Item = u32> + Clone) -> Self {
        let mut first = vec![0; vertices + 1];
        for v in some.clone().flat_map(|f| faces[f as usize]) {
            first[v as usize + 1] += 1;
        }
        for v in 0..vertices {
            first[v + 1] += first[v];
        }
        let mut next = first.clone();
        let mut at_vertex = vec![0; first[vertices] as usize];
        for f in some {
            for v in faces[f as usize] {
                at_vertex[next[v as usize] as usize] = f;
                next[v as usize] += 1;
            }
        }
        Self { first, faces: at_vertex }
    }

    /// Those at vertex `v`.
    pub fn of(&self, v: u32) -> &[u32] {
        let v = v as usize;
        &self.faces[self.first[v] as usize..self.first[v + 1] as usize]
    }
}

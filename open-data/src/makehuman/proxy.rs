//! One clothing proxy: three.js JSON (format 3.1) whose metadata ties its vertices to the base mesh.

use clothcombo_data::mesh::smallest_sine;
use serde::Deserialize;

#[derive(Deserialize)]
struct ProxyFile {
    faces: Vec<u32>,
    metadata: Metadata,
}

#[derive(Deserialize)]
struct Metadata {
    name: String,
    license: Licence,
    #[serde(rename = "ref_vIdxs")]
    references: Vec<[u32; 3]>,
    weights: Vec<[f64; 3]>,
    offsets: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Licence {
    license: String,
    author: String,
}

/// A garment tied to the base mesh.
pub(super) struct Proxy {
    pub name: String,
    pub author: String,
    pub quads: Vec<[u32; 4]>,
    licence: String,
    references: Vec<[u32; 3]>,
    weights: Vec<[f64; 3]>,
    offsets: Vec<[f64; 3]>,
}

impl Proxy {
    pub fn parse(bytes: &[u8]) -> Result<Self, String> {
        let file: ProxyFile =
            serde_json::from_slice(bytes).map_err(|e| format!("not a clothing proxy: {e}"))?;
        let Metadata { name, license, references, weights, offsets } = file.metadata;
        let n = references.len();
        if weights.len() != n || offsets.len() != n {
            return Err(format!("{n} references, {} weights and {} offsets", weights.len(), offsets.len()));
        }
        if name.is_empty()
            || !name.chars().all(|c| c.is_ascii_alphanumeric() || "-_. ".contains(c))
            || name.starts_with('.')
        {
            return Err(format!("'{name}' cannot be a file name"));
        }
        let quads = quads(&file.faces)?;
        if let Some(v) = quads.iter().flatten().find(|v| **v as usize >= n) {
            return Err(format!("a face names vertex {v} of {n}"));
        }
        Ok(Self {
            name,
            author: license.author,
            licence: license.license,
            quads,
            references,
            weights,
            offsets,
        })
    }

    /// The faces as triangles: quads are cut by the diagonal that leaves the larger smallest angle.
    pub fn triangles(&self, positions: &[[f64; 3]]) -> Vec<[u32; 3]> {
        let sine = |f: &[u32; 3]| smallest_sine(f.map(|v| positions[v as usize]));
        let worst = |pair: &[[u32; 3]; 2]| sine(&pair[0]).min(sine(&pair[1]));
        let cut = |[a, b, c, d]: &[u32; 4]| {
            let (one, two) = ([[*a, *b, *c], [*a, *c, *d]], [[*a, *b, *d], [*b, *c, *d]]);
            if worst(&one) >= worst(&two) { one } else { two }
        };
        self.quads.iter().flat_map(cut).collect()
    }

    /// The SPDX-like name of an open licence, or why it is none.
    pub fn open_licence(&self) -> Result<&'static str, String> {
        let text = self.licence.to_ascii_uppercase();
        // A remark in brackets may follow, but nothing that changes the terms.
        let is = |name: &str| text == name || text.starts_with(&format!("{name} ("));
        if is("CC0") {
            Ok("CC0-1.0")
        } else if is("CC BY 3.0") {
            Ok("CC-BY-3.0")
        } else if is("CC BY 4.0") {
            Ok("CC-BY-4.0")
        } else if text == "CCBY" {
            Ok("CC-BY")
        } else {
            let shown =
                if text.is_empty() { "none stated" } else { self.licence.split(" (").next().unwrap_or("") };
            Err(format!("licence is {shown}, only CC0 and CC-BY are taken"))
        }
    }

    /// Vertex positions (m) on a given base mesh; the offsets are decimetres.
    pub fn positions(&self, base: &[[f64; 3]]) -> Result<Vec<[f64; 3]>, String> {
        let mut positions = Vec::with_capacity(self.references.len());
        for ((references, weights), offset) in self.references.iter().zip(&self.weights).zip(&self.offsets) {
            let mut p = offset.map(|x| 0.1 * x);
            for (r, w) in references.iter().zip(weights) {
                let b = base
                    .get(*r as usize)
                    .ok_or_else(|| format!("reference to base vertex {r} of {}", base.len()))?;
                for a in 0..3 {
                    p[a] += w * b[a];
                }
            }
            if p.iter().any(|x| !x.is_finite()) {
                return Err(format!("vertex {} is not finite", positions.len()));
            }
            positions.push(p);
        }
        Ok(positions)
    }
}

/// Face records of three.js JSON 3: a bit set, the corners, then what the bits announce. The package has quads (bit 0) with
/// material (1) and corner uvs (3) only, some with corner normals (5).
fn quads(records: &[u32]) -> Result<Vec<[u32; 4]>, String> {
    let mut quads = Vec::new();
    let mut rest = records;
    while let [kind, after @ ..] = rest {
        let attributes = match kind {
            0b001011 => 5,
            0b101011 => 9,
            _ => return Err(format!("a face of kind {kind}, known are 11 and 43")),
        };
        let (quad, after) = after.split_first_chunk().ok_or("the face list is cut off")?;
        quads.push(*quad);
        rest = after.get(attributes..).ok_or("the face list is cut off")?;
    }
    Ok(quads)
}

#[cfg(test)]
mod tests {
    use super::*;

    const JSON: &str = r#"{"faces":[11,0,1,2,3,0,0,1,2,3,43,3,2,1,0,0,3,2,1,0,0,0,0,0],"uvs":[[0.5,0.5]],"vertices":[],
        "metadata":{"name":"Shirt","license":{"license":"CC BY 3.0 (see also x)","author":"A"},
        "ref_vIdxs":[[0,1,2],[0,0,0],[1,1,1],[2,2,2]],"weights":[[0.5,0.25,0.25],[1,0,0],[1,0,0],[1,0,0]],
        "offsets":[[0,0,1],[0,0,0],[0,0,0],[0,0,0]]}}"#;

    #[test]
    fn positions_are_weighted_sums_plus_offsets_in_decimetres() {
        let proxy = Proxy::parse(JSON.as_bytes()).unwrap();
        assert_eq!(proxy.quads, [[0, 1, 2, 3], [3, 2, 1, 0]]);
        let base = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(proxy.positions(&base).unwrap()[0], [0.25, 0.25, 0.1]);
        assert!(proxy.positions(&base[..2]).unwrap_err().contains("base vertex 2"));
    }

    #[test]
    fn only_open_licences_pass() {
        let with = |licence: &str| {
            Proxy::parse(JSON.replace("CC BY 3.0 (see also x)", licence).as_bytes()).unwrap().open_licence()
        };
        assert_eq!(with("CC0 (see also x)"), Ok("CC0-1.0"));
        assert_eq!(with("CC BY 3.0"), Ok("CC-BY-3.0"));
        assert_eq!(with("CCBY"), Ok("CC-BY"));
        assert!(with("AGPL3 (see also x)").unwrap_err().contains("AGPL3"));
        assert!(with("CC BY-NC 4.0").is_err());
        assert!(with("CC BY 3.0-NC").is_err());
        assert!(with("").unwrap_err().contains("none stated"));
    }

    #[test]
    fn damaged_proxies_are_refused() {
        assert!(Proxy::parse(b"{").is_err());
        assert!(Proxy::parse(JSON.replace("[11,0,1,2,3,0", "[11,0,1,2,9,0").as_bytes()).is_err());
        assert!(Proxy::parse(JSON.replace(",0,0],\"uvs\"", ",0],\"uvs\"").as_bytes()).is_err());
        assert!(Proxy::parse(JSON.replace("[11,", "[10,").as_bytes()).is_err());
        assert!(Proxy::parse(JSON.replace("\"Shirt\"", "\"../x\"").as_bytes()).is_err());
    }
}

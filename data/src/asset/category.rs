//! The six garment categories of the paper, and a guess from the rest shape.

use super::body::Body;
use clothcombo_physics::mesh::TriMesh;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Garment category (the six of CLOTH3D used by the paper).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Category {
    /// One piece from the torso to below the hips, legs not separated.
    Dress,
    /// Sleeveless or strapped upper garment.
    Top,
    /// Closed upper garment with sleeves of any length.
    TShirt,
    /// Upper garment open in front.
    OpenShirt,
    /// From the waist down, legs not separated.
    Skirt,
    /// From the waist down (or a one-piece), legs separated.
    Trousers,
}

impl Category {
    /// All categories.
    pub const ALL: [Self; 6] =
        [Self::Dress, Self::Top, Self::TShirt, Self::OpenShirt, Self::Skirt, Self::Trousers];

    /// The name used in files: `dress`, `top`, `t_shirt`, `open_shirt`, `skirt`, `trousers`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Dress => "dress",
            Self::Top => "top",
            Self::TShirt => "t_shirt",
            Self::OpenShirt => "open_shirt",
            Self::Skirt => "skirt",
            Self::Trousers => "trousers",
        }
    }

    /// Skirts and dresses span the space between the legs, so that their weights need wider smoothing.
    pub fn hangs_between_legs(self) -> bool {
        matches!(self, Self::Skirt | Self::Dress)
    }

    /// A guess from the rest shape on the zero body: which heights are covered, whether there is cloth between the legs,
    /// around the arms, and in front of the breastbone.
    pub fn guess(rest: &TriMesh, body: &Body) -> Self {
        let joint = |name: &str| body.joint_place(name);
        let (Some(hip), Some(knee), Some(spine), Some(shoulder), Some(elbow)) = (
            joint("left_hip"),
            joint("left_knee"),
            joint("spine3"),
            joint("left_shoulder"),
            joint("left_elbow"),
        ) else {
            return Self::Top;
        };
        let points = rest.positions();
        let top = points.iter().map(|p| p[1]).fold(f64::MIN, f64::max);
        let bottom = points.iter().map(|p| p[1]).fold(f64::MAX, f64::min);
        let covers_chest = top > spine[1];
        let below_crotch = bottom < hip[1] - 0.15 * (hip[1] - knee[1]) - 0.07;
        if below_crotch {
            // Cloth crossing the plane between the legs well below the crotch means a skirt.
            let level = (hip[1] - 0.1).min(bottom + 0.5 * (hip[1] - bottom));
            let crossing = rest
                .faces()
                .iter()
                .filter(|f| {
                    let corner = f.map(|i| points[i as usize]);
                    corner.iter().all(|p| p[1] < level)
                        && corner.iter().any(|p| p[0] > 0.0)
                        && corner.iter().any(|p| p[0] < 0.0)
                })
                .count();
            // Legs that touch give a few such faces; a skirt has two columns of them, front and back.
            let low = points.iter().filter(|p| p[1] < level).count();
            let separated = (crossing as f64) < 0.25 * (low as f64).sqrt();
            return match (separated, covers_chest) {
                (true, _) => Self::Trousers,
                (false, true) => Self::Dress,
                (false, false) => Self::Skirt,
            };
        }
        // Briefs: from the waist to the crotch.
        if !covers_chest && bottom < hip[1] {
            return Self::Trousers;
        }
        let reach = points.iter().map(|p| p[0].abs()).fold(0.0, f64::max);
        // A bra ends at the chest; it has no front to be open.
        if covers_chest
            && bottom < spine[1] - 0.08
            && is_open_in_front(rest, spine[1], 0.5 * (spine[1] + bottom))
        {
            return Self::OpenShirt;
        }
        if reach > shoulder[0] + 0.3 * (elbow[0] - shoulder[0]) { Self::TShirt } else { Self::Top }
    }
}

/// No face crosses x = 0 in front at the chest and in the middle of its height.
fn is_open_in_front(rest: &TriMesh, chest: f64, belly: f64) -> bool {
    let points = rest.positions();
    let middle = points.iter().map(|p| p[2]).sum::<f64>() / points.len() as f64;
    [chest - 0.02, belly].iter().all(|level| {
        !rest.faces().iter().any(|f| {
            let corner = f.map(|i| points[i as usize]);
            corner.iter().all(|p| p[2] > middle)
                && corner.iter().any(|p| p[1] >= *level)
                && corner.iter().any(|p| p[1] <= *level)
                && corner.iter().any(|p| p[0] >= 0.0)
                && corner.iter().any(|p| p[0] <= 0.0)
        })
    })
}

impl fmt::Display for Category {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Category {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|c| c.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|c| c.name()).collect();
            format!("'{text}' is not a garment category; the categories are {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_shapes_are_told_apart() {
        use crate::generate::mannequin;
        use clothcombo_physics::mesh::shapes::{tube, union};
        let body = mannequin();
        let [hip, knee, ankle, chest] = [1, 4, 7, 9].map(|j| body.joint_template[j]);
        let tube_at = |x: f64, top: f64, bottom: f64, radius: f64| {
            let mesh = tube(radius, top - bottom, 32, 24);
            let highest = mesh.bounds().1[1];
            let moved = mesh.positions().iter().map(|p| [p[0] + x, p[1] - highest + top, p[2]]).collect();
            mesh.with_positions(moved).unwrap()
        };
        let guess = |mesh: &TriMesh| Category::guess(mesh, &body);
        let waist = hip[1] + 0.1;
        assert_eq!(guess(&tube_at(0.0, waist, knee[1], 0.25)), Category::Skirt);
        assert_eq!(guess(&tube_at(0.0, chest[1] + 0.1, knee[1], 0.25)), Category::Dress);
        assert_eq!(guess(&tube_at(0.0, chest[1] + 0.1, hip[1], 0.16)), Category::Top);
        let legs = [1.0, -1.0].map(|side| tube_at(side * knee[0], hip[1] - 0.05, ankle[1], 0.07));
        assert_eq!(guess(&union(&[&legs[0], &legs[1]])), Category::Trousers);
        let trunk = tube_at(0.0, chest[1] + 0.1, hip[1], 0.16);
        let reach = 0.5 * (body.joint_template[16][0] + body.joint_template[18][0]);
        let sleeved: Vec<[f64; 3]> = trunk
            .positions()
            .iter()
            .map(|p| if p[1] > chest[1] { [p[0] / 0.16 * reach, p[1], p[2]] } else { *p })
            .collect();
        assert_eq!(guess(&trunk.with_positions(sleeved).unwrap()), Category::TShirt);
        // The trunk without the faces that cross the middle in front.
        let open: Vec<[u32; 3]> = (trunk.faces().iter())
            .filter(|f| {
                let corners = f.map(|v| trunk.positions()[v as usize]);
                !(corners.iter().all(|p| p[2] > 0.0) && corners.iter().any(|p| p[0].abs() < 0.02))
            })
            .copied()
            .collect();
        assert_eq!(guess(&TriMesh::new(trunk.positions().to_vec(), open).unwrap()), Category::OpenShirt);
    }

    #[test]
    fn names_parse_back_and_match_serde() {
        for category in Category::ALL {
            assert_eq!(category.name().parse::<Category>(), Ok(category));
            assert_eq!(serde_json::to_string(&category).unwrap(), format!("\"{category}\""));
        }
        assert!("socks".parse::<Category>().unwrap_err().contains("t_shirt"));
    }
}

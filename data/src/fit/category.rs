//! The category of a garment whose openings are known: limbs that pass through them decide where its shape is ambiguous.

use super::openings::Limbs;
use crate::asset::{Body, Category};
use clothcombo_physics::TriMesh;

/// By shape and limbs.
pub(super) fn guessed(rest: &TriMesh, body: &Body, limbs: Limbs) -> Category {
    match (Category::guess(rest, body), limbs) {
        (_, Limbs { neck: false, arms: false, legs: true }) => Category::Trousers,
        (Category::Trousers | Category::Skirt, Limbs { neck: true, legs: false, .. }) => Category::Dress,
        (Category::Trousers, Limbs { neck: false, legs: false, .. }) => Category::Skirt,
        (guess, _) => guess,
    }
}

/// What speaks against a category, given or guessed.
pub(super) fn contradiction(category: Category, limbs: Limbs) -> Option<String> {
    let is_for_legs = matches!(category, Category::Trousers | Category::Skirt);
    let what = match limbs {
        Limbs { neck: true, legs: false, .. } if is_for_legs => {
            "the neck passes through an opening of its own"
        }
        Limbs { neck: false, arms: false, legs: true } if category != Category::Trousers => {
            "only legs pass through openings of their own"
        }
        _ => return None,
    };
    Some(format!("category {category} does not go with its openings: {what}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::generate::garment::generated;
    use crate::generate::mannequin;

    #[test]
    fn limbs_decide_and_contradict() {
        let body = mannequin();
        let limbs = |neck, arms, legs| Limbs { neck, arms, legs };
        let skirt = generated(&body, Category::Skirt, 3, 200).rest;
        assert_eq!(guessed(&skirt, &body, limbs(false, false, false)), Category::Skirt);
        assert_eq!(guessed(&skirt, &body, limbs(false, false, true)), Category::Trousers);
        let trousers = generated(&body, Category::Trousers, 3, 200).rest;
        assert_eq!(guessed(&trousers, &body, limbs(true, true, false)), Category::Dress);
        assert!(contradiction(Category::Trousers, limbs(true, true, false)).unwrap().contains("neck"));
        assert!(contradiction(Category::TShirt, limbs(false, false, true)).unwrap().contains("only legs"));
        assert_eq!(contradiction(Category::Trousers, limbs(true, true, true)), None, "overalls");
        assert_eq!(contradiction(Category::OpenShirt, limbs(false, true, false)), None);
    }
}

//! Motions of the library's `Draper`: what the networks make is averaged over frames.

use crate::drape::{SKIRT, TEE, run_folder};
use clothcombo_data::asset::Pose;
use clothcombo_data::fit::FitSettings;
use clothcombo_physics::transform::{into_frame, out_of_frame};
use clothcombo_physics::vec3::{add, distance_squared, scale, sub};
use clothcombo_trainer::inference::{BodyState, Drape, Draper, DraperSettings};

/// Frames of an arm that jerks.
fn bodies() -> Vec<BodyState> {
    let pose = |angle: f64| {
        let mut pose = Pose::t_pose(22);
        pose.rotations[16] = [0.0, 0.0, angle];
        // Small, so that skinning is under the skin and the few steps of training are accepted.
        BodyState::new(vec![-2.0], pose)
    };
    [0.0, -0.4, -0.1, -0.6, -0.5].map(pose).into()
}

fn draped(radius: usize) -> Vec<Drape> {
    let settings = DraperSettings { resolve: false, ..DraperSettings::default() };
    let draper = Draper::load(Some(run_folder()), &settings).unwrap();
    let catalog = draper.catalog(&[]).unwrap();
    let hints = FitSettings::default();
    let garments = [TEE, SKIRT].map(|name| catalog.find(name, draper.body(), None, &hints).unwrap());
    let outfit = draper.outfit(garments.into()).unwrap();
    draper.drape_motion(&outfit, &bodies(), radius, |_| ()).unwrap()
}

#[test]
fn offsets_from_skinning_are_binomial_means_and_the_ends_stay() {
    let (own, steady) = (draped(0), draped(1));
    let offset = |frame: usize, g: usize, v: usize| {
        let garment = &own[frame].garments[g];
        into_frame(&garment.transforms[v], sub(garment.network[v], garment.skinned[v]))
    };
    let mut changed = 0;
    for (frame, drape) in steady.iter().enumerate() {
        for (g, garment) in drape.garments.iter().enumerate() {
            for v in 0..garment.network.len() {
                let weights: &[(usize, f64)] = match frame {
                    0 | 4 => &[(frame, 1.0)],
                    _ => &[(frame - 1, 0.25), (frame, 0.5), (frame + 1, 0.25)],
                };
                let mean = weights.iter().fold([0.0; 3], |sum, (f, w)| add(sum, scale(offset(*f, g, v), *w)));
                let expected = add(garment.skinned[v], out_of_frame(&garment.transforms[v], mean));
                assert!(distance_squared(garment.network[v], expected).sqrt() < 1e-9, "{frame} {g} {v}");
                changed += usize::from(distance_squared(expected, own[frame].garments[g].network[v]) > 1e-12);
            }
        }
    }
    assert!(changed > 100, "{changed} vertices");
}

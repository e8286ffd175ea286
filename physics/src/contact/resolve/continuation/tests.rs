use super::super::RestGarment;
use super::*;
use crate::contact::TriangleTree;
use crate::mesh::TriMesh;
use crate::mesh::shapes;
use crate::transform::IDENTITY;
use crate::vec3::{add, norm};
use std::sync::Arc;
use std::time::Duration;

/// A knee that rises through a sheet that does not know of it: half a metre long at `size` 0.5, in the plane y = 0.
fn rising(size: f64) -> (TriMesh, impl Fn(f64) -> Result<PathSample, ResolveError>) {
    let grid = shapes::irregular_grid(size, size, 24, 24, 0.25, 4);
    let sheet = shapes::mapped(&grid, |[x, y, _]| [y - 0.5 * size, 0.0, x - 0.5 * size]);
    let (ball, draped) = (shapes::icosphere(0.08, 3), sheet.positions().to_vec());
    let sample_at = move |share: f64| {
        let knee = shapes::mapped(&ball, |p| add(p, [0.0, 0.18 * share - 0.1, 0.0]));
        Ok(PathSample {
            body: Arc::new(Surface::from_mesh(&knee)),
            draped: vec![draped.clone()],
            transforms: vec![IDENTITY; draped.len()],
        })
    };
    (sheet, sample_at)
}

/// The start of a path, without intersections.
fn untouched(sample: PathSample, positions: Vec<Vec<[f64; 3]>>) -> ContactState {
    let PathSample { draped, transforms, .. } = sample;
    ContactState { draped, positions, transforms, intersections: 0 }
}

fn end<E>(sample_at: &impl Fn(f64) -> Result<PathSample, E>) -> PathSample {
    sample_at(1.0).unwrap_or_else(|_| unreachable!("made without errors"))
}

#[test]
fn a_rising_knee_takes_the_sheet_along() {
    let (sheet, sample_at) = rising(0.6);
    let garment = RestGarment::new(&sheet);
    let sample = end(&sample_at);
    let layers = [Layer { garment: &garment, positions: &sample.draped[0] }];
    let settings = ResolveSettings::default();
    let task = Task { layers: &layers, settings: &settings, budget: &Budget::new(&settings, 1) };
    let drawn = BodyObstacle::near_layers(&sample.body, &layers);
    let yielded = YieldedBody::ample(&drawn, 1);
    let end = &SoftBody::new(drawn, 1, yielded.as_ref());
    let path = Path { task, end, step_lengths: StepLengths::FROM_T_POSE };
    let first = sample_at(0.0).unwrap();
    let positions = first.draped.clone();
    let (followed, steps) = path.continue_from(untouched(first, positions), &sample_at).unwrap();
    assert!(steps >= 8, "{steps}");
    let followed = followed.unwrap();
    is_over_the_knee(&followed.positions[0], &sheet, &sample.body);
}

/// The knee's top is at 0.16: nearer to the lower side of the ball, the sheet lies over its top all the same.
fn is_over_the_knee(over: &[[f64; 3]], sheet: &TriMesh, knee: &Surface<f64>) {
    let highest = over.iter().map(|p| p[1]).fold(0.0, f64::max);
    assert!(highest > 0.155, "{highest}");
    let tree = TriangleTree::new(over, sheet.faces());
    assert!(tree.pairs_with(&TriangleTree::new(&knee.positions, &knee.faces)).is_empty());
}

#[test]
fn the_next_frame_carries_on_from_the_one_before() {
    let (sheet, sample_at) = rising(0.6);
    let garment = RestGarment::new(&sheet);
    let (settings, sample) = (ResolveSettings::default(), end(&sample_at));
    let layers = [Layer { garment: &garment, positions: &sample.draped[0] }];
    // By itself the last frame goes wrong: the ball's lower side is nearer.
    let alone = super::super::resolve(&sample.body, &layers, &settings).unwrap();
    let highest = alone.positions[0].iter().map(|p| p[1]).fold(0.0, f64::max);
    assert!(highest < 0.1, "{highest}");

    let mut state = untouched(sample_at(0.0).unwrap(), sample.draped.clone());
    let mut was_moved = false;
    for frame in 1..=10 {
        let [before, now] = [0.1 * f64::from(frame - 1), 0.1 * f64::from(frame)];
        let body = sample_at(now).unwrap().body;
        let between = |share: f64| sample_at(before + (now - before) * share);
        let found = resolve_after(state, &body, &layers, &settings, between).unwrap().unwrap();
        assert!(found.certificate.is_clear() && found.steps >= 1, "frame {frame}");
        assert!(found.garments[0].time > Duration::ZERO, "frame {frame}");
        let moved = found.positions[0].iter().zip(layers[0].positions).filter(|(p, q)| p != q).count();
        assert_eq!(found.garments[0].moved, moved, "frame {frame}");
        was_moved |= moved > 0;
        state = untouched(sample_at(now).unwrap(), found.positions);
    }
    assert!(was_moved);
    is_over_the_knee(&state.positions[0], &sheet, &sample.body);
}

#[test]
fn what_can_be_mended_at_once_is_not_followed_and_what_is_late_is_given_up() {
    let (sheet, sample_at) = rising(0.6);
    let garment = RestGarment::new(&sheet);
    let settings = ResolveSettings::default();
    let shallow = sample_at(0.3).unwrap();
    let layers = [Layer { garment: &garment, positions: &shallow.draped[0] }];
    let resolved = resolve_along(&shallow.body, &layers, &settings, &sample_at).unwrap();
    assert!(resolved.certificate.is_clear() && resolved.steps == 0);
    let first = untouched(sample_at(0.0).unwrap(), shallow.draped.clone());
    let settings = ResolveSettings { time: Some(Duration::ZERO), ..settings };
    let late = resolve_after(first, &shallow.body, &layers, &settings, &sample_at).unwrap();
    assert!(late.is_none());
}

#[test]
fn what_its_budget_does_not_clear_says_so() {
    let (sheet, sample_at) = rising(0.6);
    let garment = RestGarment::new(&sheet);
    // The sheet goes through the middle of the knee.
    let sample = sample_at(0.6).unwrap();
    let layers = [Layer { garment: &garment, positions: &sample.draped[0] }];
    let resolved = |total_rounds| {
        let settings = ResolveSettings { total_rounds, ..ResolveSettings::default() };
        let on_the_way = |share| sample_at(0.6 * share);
        resolve_along(&sample.body, &layers, &settings, on_the_way).unwrap()
    };
    let stopped = resolved(1);
    assert!(stopped.certificate.is_stopped && !stopped.certificate.is_clear());
    assert_eq!((stopped.rounds, stopped.steps), (1, 0));
    let clear = resolved(1000);
    assert!(clear.certificate.is_clear() && !clear.certificate.is_stopped);
    assert!(clear.rounds > 1 && clear.steps > 0);
}

#[test]
fn what_cannot_be_mended_is_carried_on_all_the_same() {
    let (sheet, sample_at) = rising(0.6);
    let garment = RestGarment::new(&sheet);
    let sample = end(&sample_at);
    let layers = [Layer { garment: &garment, positions: &sample.draped[0] }];
    // A millimetre is too little for a whole knee.
    let settings = ResolveSettings { farthest: 1e-3, loosened: 1.0, ..ResolveSettings::default() };
    let lifted = || sample.draped[0].iter().map(|p| add(*p, [0.0, 0.03, 0.0])).collect::<Vec<_>>();
    let after = |intersections| {
        let mut before = untouched(sample_at(0.3).unwrap(), vec![lifted()]);
        before.intersections = intersections;
        let found =
            resolve_after(before, &sample.body, &layers, &settings, |share| sample_at(0.3 + 0.7 * share));
        found.unwrap().unwrap()
    };
    let clear = after(0);
    assert!(clear.certificate.between() > 0, "nothing is left to carry on");
    // Shorter and shorter steps, in the end the rest at once.
    assert!(clear.steps >= 8, "{}", clear.steps);
    // No more intersections than there were is good enough.
    let intersected = after(10_000);
    assert_eq!(intersected.steps, 1);
    // What lay higher before still does, where nothing was in its way.
    let far = (0..sheet.positions().len()).max_by(|&a, &b| {
        let from_knee = |v: usize| norm(sheet.positions()[v]);
        from_knee(a).total_cmp(&from_knee(b))
    });
    let height = intersected.positions[0][far.unwrap()][1];
    assert!((height - 0.95 * 0.03).abs() < 1e-9, "{height}");
}

#[test]
fn errors_of_a_sample_come_back() {
    let (sheet, sample_at) = rising(0.3);
    let garment = RestGarment::new(&sheet);
    let layers = [Layer { garment: &garment, positions: sheet.positions() }];
    let first = sample_at(0.0).unwrap();
    let body = first.body.clone();
    let start = untouched(first, vec![sheet.positions().to_vec()]);
    let broken = |_: f64| Err::<PathSample, _>(ResolveError::EmptyBody);
    assert!(resolve_after(start, &body, &layers, &ResolveSettings::default(), broken).is_err());
}

#[test]
fn what_does_not_fit_is_refused() {
    let (sheet, sample_at) = rising(0.3);
    let garment = RestGarment::new(&sheet);
    let layers = [Layer { garment: &garment, positions: sheet.positions() }];
    let after = |spoil: &dyn Fn(&mut ContactState)| {
        let first = sample_at(0.0).unwrap();
        let body = first.body.clone();
        let mut before = untouched(first, vec![sheet.positions().to_vec()]);
        spoil(&mut before);
        resolve_after(before, &body, &layers, &ResolveSettings::default(), &sample_at)
    };
    assert!(after(&|_| {}).is_ok());
    let nan = after(&|before| before.positions[0][7][1] = f64::NAN);
    assert!(matches!(nan, Err(ResolveError::Position { garment: 0, vertex: 7, .. })));
    let turned = after(&|before| before.transforms[3][0][0] = f64::NAN);
    assert!(turned.is_ok(), "what such a vertex was moved by stays as it stands");
    for spoil in [
        |before: &mut ContactState| before.positions.clear(),
        |before: &mut ContactState| before.draped[0].truncate(5),
    ] {
        assert!(matches!(after(&spoil), Err(ResolveError::Count { garment: 0, .. })));
    }
    let few = after(&|before| before.transforms.truncate(5));
    assert_eq!(few.err(), Some(ResolveError::Transforms { expected: sheet.vertex_count(), found: 5 }));
    let few_at = |share: f64| {
        let mut sample = sample_at(share)?;
        sample.transforms.pop();
        Ok(sample)
    };
    let first = sample_at(0.0).unwrap();
    let (body, before) = (first.body.clone(), untouched(first, vec![sheet.positions().to_vec()]));
    let few = resolve_after(before, &body, &layers, &ResolveSettings::default(), few_at);
    let expected = sheet.vertex_count();
    assert_eq!(few.err(), Some(ResolveError::Transforms { expected, found: expected - 1 }));
}

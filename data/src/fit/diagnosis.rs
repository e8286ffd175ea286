//! Why a mesh is not worn as it is, told by what would be: one of its pieces, or all of it at another size.

use super::cloth::Cloth;
use super::error::{FitError, Size};
use super::judge::Candidate;
use super::pieces::stray_pieces;
use super::placement::{FileOrigin, Unit, UpAxis};
use super::readings::believed;
use super::search::Search;
use super::settings::FitSettings;
use crate::mesh::compact;
use clothcombo_physics::vec3::{norm, scale, sub};
use clothcombo_physics::{Topology, TriMesh};

/// Ratio of one size tried to the next, and how many are tried on either side.
const SIZE_STEP: f64 = 1.2;
const SIZES_EACH_WAY: i32 = 8;
/// Another size explains that much more (log-posterior), or nothing is said.
const SIZE_EVIDENCE: f64 = 12.0;
/// Cloth farther from the body on average (m), or with a larger share inside it, may be of another size.
const LOOSE: f64 = 0.035;
const TIGHT: f64 = 0.05;
/// Pieces that are looked at by themselves.
const MOST_PIECES: usize = 3;
/// A border this near to a plane, as a share of the extent, and with this share of its length, is cut by it.
const ON_CUT: f64 = 1e-3;
const CUT_SHARES: [f64; 2] = [0.25, 0.95];
/// The rest of that border reaches this far from the plane, as a share of the extent: a hem does not.
const BEYOND_CUT: f64 = 0.1;

/// What is wrong with a mesh that looks worn nowhere, if that can be told.
pub(super) fn diagnosed(search: &Search, cloth: &Cloth, settings: &FitSettings) -> Option<FitError> {
    let told = upside_down(search, cloth, settings).or_else(|| half(cloth));
    told.or_else(|| beside(search, cloth, settings)).or_else(|| {
        let ups = settings.up.map_or(vec![UpAxis::Y, UpAxis::Z], |up| vec![up]);
        let units = settings.unit.map_or(vec![Unit::M, Unit::Cm, Unit::Mm], |unit| vec![unit]);
        let of = |unit: &Unit| {
            let sizes = ups.iter().filter_map(|up| {
                let known = FitSettings {
                    unit: Some(*unit),
                    up: Some(*up),
                    turn_degrees: Some(0.0),
                    legs_degrees: Some(0.0),
                    ..settings.clone()
                };
                other_size(search, cloth, &known)
            });
            sizes.max_by(|a, b| a.1.total_cmp(&b.1))
        };
        let (size, _) = units.iter().find_map(of)?;
        (size.ratio() >= SIZE_STEP).then_some(FitError::Size { size })
    })
}

/// A size at which a garment that lies loosely or tightly where it was found fits much better.
pub(super) fn size_doubt(
    search: &Search,
    cloth: &Cloth,
    settings: &FitSettings,
    taken: &Candidate,
) -> Option<Size> {
    if settings.offset.is_some() {
        return None;
    }
    let (sitting, _) = search.measured(cloth, &taken.placement);
    if sitting.mean_distance < LOOSE && sitting.inside < TIGHT {
        return None;
    }
    let p = &taken.placement;
    let known = FitSettings {
        unit: Some(p.unit),
        up: Some(p.up),
        turn_degrees: Some(p.turn_degrees),
        // Legs that are too wide are found apart.
        legs_degrees: settings.legs_degrees.or(Some(0.0)),
        ..settings.clone()
    };
    // What is known has no say there.
    let score = taken.score - settings.log_prior(p) + known.log_prior(p);
    let (size, found) = other_size(search, cloth, &known)?;
    (found - score > SIZE_EVIDENCE).then_some(size)
}

/// The size at which a file of known unit, axis and turn is worn best, other than its own, and how well (log-posterior). A tube
/// fits somewhere at any size: it must lie there as it stands.
fn other_size(search: &Search, cloth: &Cloth, known: &FitSettings) -> Option<(Size, f64)> {
    let unit = known.unit?;
    let extent = cloth.extent();
    let at = |factor: f64| {
        let positions: Vec<[f64; 3]> = cloth.positions.iter().map(|p| scale(*p, factor)).collect();
        let scaled = Cloth::new(&positions, cloth.faces, cloth.topology);
        let best = believed(&search.quick_candidates(&scaled, known), search, &scaled)?;
        let is_told = !best.is_tube || best.placement.origin != FileOrigin::Elsewhere;
        is_told.then_some((Size { extent: extent * unit.metres(), unit, factor }, best.score))
    };
    let better = |a: &(Size, f64), b: &(Size, f64)| a.1.total_cmp(&b.1);
    // One that is nearer to its own explains what the next one would be told for.
    let steps = (-SIZES_EACH_WAY..=SIZES_EACH_WAY).filter(|k| *k != 0).map(f64::from).chain([-0.75, 0.75]);
    steps.filter_map(|k| at(SIZE_STEP.powf(k))).max_by(better)
}

/// Whether a garment is cut in half by a plane of the file's axes: all of it lies on one side, and a border runs there and elsewhere.
fn half(cloth: &Cloth) -> Option<FitError> {
    let near = ON_CUT * cloth.extent();
    for (axis, name) in ['x', 'y', 'z'].into_iter().enumerate() {
        let along = || cloth.positions.iter().map(|p| p[axis]);
        for at in [along().fold(f64::MAX, f64::min), along().fold(f64::MIN, f64::max)] {
            for border in cloth.borders {
                let next = border.iter().cycle().skip(1);
                let (mut on, mut all, mut reach) = (0.0, 0.0, 0.0f64);
                for (a, b) in border.iter().zip(next) {
                    let [a, b] = [a, b].map(|v| cloth.positions[*v as usize]);
                    let length = norm(sub(b, a));
                    all += length;
                    reach = reach.max((a[axis] - at).abs());
                    if (a[axis] - at).abs() < near && (b[axis] - at).abs() < near {
                        on += length;
                    }
                }
                let share = on / f64::max(all, f64::MIN_POSITIVE);
                if (CUT_SHARES[0]..CUT_SHARES[1]).contains(&share) && reach > BEYOND_CUT * cloth.extent() {
                    return Some(FitError::Half { axis: name, at, share });
                }
            }
        }
    }
    None
}

/// The other end of an axis, if that must point up; tubes are worn either way round.
fn upside_down(search: &Search, cloth: &Cloth, settings: &FitSettings) -> Option<FitError> {
    if settings.up.is_some() {
        return None;
    }
    let believed = UpAxis::DOWN.into_iter().filter_map(|up| {
        let known = FitSettings { up: Some(up), ..settings.clone() };
        let best = believed(&search.candidates(cloth, &known), search, cloth)?;
        (!best.is_tube).then_some((up, best.score))
    });
    let (up, _) = believed.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(FitError::UpsideDown { up })
}

/// The piece that lies beside the body when one of the largest is worn.
fn beside(search: &Search, cloth: &Cloth, settings: &FitSettings) -> Option<FitError> {
    let piece = |face: &[u32; 3]| cloth.piece_of_vertex(face[0]);
    let mut counts = vec![0; cloth.topology.component_count];
    cloth.faces.iter().for_each(|face| counts[piece(face) as usize] += 1);
    let mut largest: Vec<u32> =
        (0..counts.len() as u32).filter(|piece| counts[*piece as usize] > 0).collect();
    if largest.len() < 2 {
        return None;
    }
    largest.sort_by_key(|piece| std::cmp::Reverse(counts[*piece as usize]));
    largest.into_iter().take(MOST_PIECES).find_map(|alone| {
        let of_piece = cloth.faces.iter().filter(|face| piece(face) == alone).copied();
        let (used, faces) = compact(of_piece, cloth.positions.len());
        let mesh = TriMesh::new(used.iter().map(|v| cloth.positions[*v as usize]).collect(), faces).ok()?;
        let topology = Topology::new(&mesh);
        let alone = Cloth::new(mesh.positions(), mesh.faces(), &topology);
        let placement = believed(&search.candidates(&alone, settings), search, &alone)?.placement;
        let worn = search.judge(cloth, settings).worn_pieces(&placement);
        let placed = placement.apply(cloth.positions);
        let stray = stray_pieces(&placed, cloth.topology, search.surface(), &worn);
        stray.into_iter().next().map(|piece| FitError::StrayPiece { piece })
    })
}

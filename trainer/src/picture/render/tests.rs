use image::Rgb;

use super::*;

const RED: [u8; 3] = [220, 40, 40];
const BLUE: [u8; 3] = [40, 60, 220];
const SIZE: [u32; 2] = [96, 96];
const QUAD: [[u32; 3]; 2] = [[0, 1, 2], [0, 2, 3]];

/// A square of side 2 at height z that faces +z.
fn square(z: f64) -> Vec<[f64; 3]> {
    vec![[-1.0, -1.0, z], [1.0, -1.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]]
}

fn figure<'a>(positions: &'a [[f64; 3]], faces: &'a [[u32; 3]], colour: [u8; 3]) -> Figure<'a> {
    Figure { positions, faces, colour }
}

fn middle(picture: &RgbImage) -> Rgb<u8> {
    *picture.get_pixel(picture.width() / 2, picture.height() / 2)
}

fn is_reddish(Rgb([red, _, blue]): Rgb<u8>) -> bool {
    i32::from(red) > i32::from(blue) + 40
}

fn brightness(Rgb(pixel): Rgb<u8>) -> u32 {
    pixel.iter().map(|&value| u32::from(value)).sum()
}

/// An icosahedron refined `rounds` times onto the unit sphere.
fn sphere(rounds: usize) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let mut positions: Vec<[f64; 3]> = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut faces =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..rounds {
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]: &[u32; 3]| {
                let mut middle = |i: u32, j: u32| {
                    let (p, q) = (positions[i as usize], positions[j as usize]);
                    let sum: [f64; 3] = std::array::from_fn(|axis| p[axis] + q[axis]);
                    let length = sum.iter().map(|x| x * x).sum::<f64>().sqrt();
                    positions.push(sum.map(|x| x / length));
                    positions.len() as u32 - 1
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    (positions, faces)
}

#[test]
fn the_nearer_surface_wins_in_any_order_and_from_both_sides() {
    let (near, far) = (square(0.002), square(0.0));
    let (red, blue) = (figure(&near, &QUAD, RED), figure(&far, &QUAD, BLUE));
    for figures in [[red, blue], [blue, red]] {
        assert!(is_reddish(middle(&render(&figures, View::Front, SIZE))), "two millimetres in front");
        assert!(!is_reddish(middle(&render(&figures, View::Back, SIZE))));
    }
}

#[test]
fn the_back_of_a_surface_is_drawn_darker() {
    let positions = square(0.0);
    let figures = [figure(&positions, &QUAD, RED)];
    let front = middle(&render(&figures, View::Front, SIZE));
    let back = middle(&render(&figures, View::Back, SIZE));
    assert!(is_reddish(front) && is_reddish(back));
    assert!(brightness(back) * 4 < brightness(front) * 3, "{front:?} {back:?}");
}

#[test]
fn front_and_back_views_mirror_a_symmetric_body() {
    let (mut positions, faces) = sphere(3);
    positions.iter_mut().for_each(|p| p[1] *= 2.0);
    // A second body that only the camera in front sees.
    let mark: Vec<[f64; 3]> = positions.iter().map(|p| [p[0] * 0.2, p[1] * 0.2, p[2] * 0.2 + 0.95]).collect();
    let figures = [figure(&positions, &faces, [190; 3]), figure(&mark, &faces, RED)];
    let front = render(&figures, View::Front, SIZE);
    let back = render(&figures, View::Back, SIZE);
    assert!(is_reddish(middle(&front)));
    assert!(!back.pixels().any(|&pixel| is_reddish(pixel)));
}

#[test]
fn a_sphere_covers_its_disc_without_a_hole() {
    let (positions, faces) = sphere(5);
    let figures = [figure(&positions, &faces, BLUE)];
    let background = render(&[], View::Front, SIZE);
    let picture = render(&figures, View::ThreeQuarter, SIZE);
    let radius = 0.9 * 48.0;
    for (x, y, pixel) in picture.enumerate_pixels() {
        let distance = (f64::from(x) + 0.5 - 48.0).hypot(f64::from(y) + 0.5 - 48.0);
        let is_background = pixel == background.get_pixel(x, y);
        if distance < radius - 1.5 {
            assert!(!is_background, "hole at {x} {y}");
        } else if distance > radius + 1.5 {
            assert!(is_background, "ink outside at {x} {y}");
        }
    }
}

#[test]
fn light_comes_from_above() {
    let (positions, faces) = sphere(4);
    let picture = render(&[figure(&positions, &faces, [180; 3])], View::Front, SIZE);
    let at = |y| brightness(*picture.get_pixel(48, y));
    assert!(at(20) > at(48) / 2 && at(20) > at(76) + 60);
}

#[test]
fn empty_scenes_show_the_background() {
    let background = render(&[], View::Front, SIZE);
    let positions = square(0.0);
    let empty = [figure(&[], &[], RED), figure(&positions, &[], RED), figure(&[], &QUAD, RED)];
    assert_eq!(render(&empty, View::Front, SIZE), background);
    assert_eq!(render(&[], View::Side, [0, 0]).dimensions(), (1, 1));
}

#[test]
fn what_cannot_be_drawn_is_left_out_and_the_rest_stays() {
    let mut positions = square(0.0);
    let bad = [
        [f64::NAN, 0.0, 0.0],
        [0.0, f64::INFINITY, 0.0],
        [1e300, -1e300, 1e300],
        [0.0, 0.0, 1e12],
        [0.0, 0.0, -1e12],
        [1e300, 0.0, 0.0],
        [1e12, -1e9, 0.1],
        [-1e5, 1e5, 0.1],
        [900.0, -2000.0, 0.1],
    ];
    positions.extend(bad);
    let mut faces = QUAD.to_vec();
    for vertex in 4..14_u32 {
        faces.extend([[0, 1, vertex], [vertex, vertex, vertex], [vertex, 2, u32::MAX]]);
    }
    faces.push([1, 1, 2]);
    let expected = render(&[figure(&square(0.0), &QUAD, RED)], View::Front, SIZE);
    // Framing looks at positions, so the clean square comes first.
    let clean = square(0.0);
    let figures = [figure(&clean, &QUAD, RED), figure(&positions, &faces, RED)];
    assert!(is_reddish(middle(&render(&figures, View::Front, SIZE))));
    let alone = render(&[figure(&positions[..6], &faces[..8], RED)], View::Front, SIZE);
    assert_eq!(alone, expected);
}

#[test]
fn cloth_that_has_blown_up_is_drawn_in_bounded_work() {
    let (mut positions, faces) = sphere(6);
    for (index, p) in positions.iter_mut().enumerate() {
        let stretch = if index % 2 == 0 { 30.0 } else { -30.0 };
        *p = p.map(|x| x * stretch);
    }
    let body = square(0.0);
    let camera = Camera::framing(&[figure(&body, &QUAD, RED)], View::Front, SIZE);
    let mesh = ProjectedMesh::new(&figure(&positions, &faces, BLUE), &camera, [96, 96]);
    let drawn: f64 = mesh
        .sides
        .iter()
        .flatten()
        .map(|face| picture_share(face.map(|vertex| mesh.vertices[vertex as usize].ndc), [96, 96]))
        .sum();
    assert!(faces.len() > 30_000 && drawn <= FILL_BUDGET, "{drawn}");
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let (positions, faces) = sphere(4);
    let figures = [figure(&positions, &faces, BLUE)];
    let pictures: Vec<RgbImage> = [1, 3]
        .map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| render(&figures, View::ThreeQuarter, [101, 67]))
        })
        .to_vec();
    assert_eq!(pictures[0], pictures[1]);
    assert_eq!(pictures[0].dimensions(), (101, 67));
}

//! Cloth that nobody sewed: sheets and pattern pieces, one border each.

use super::Kind;
use super::draw::Draw;
use super::shape::Shape;
use std::f64::consts::PI;

pub(super) const KINDS: [Kind; 8] = [
    Kind::new("flat sheet", flat_sheet),
    Kind::new("wavy sheet", wavy_sheet),
    Kind::new("crumpled sheet", crumpled_sheet),
    Kind::new("half cylinder", half_cylinder),
    Kind::new("towel", towel),
    Kind::new("front panel of a T-shirt", tee_panel),
    Kind::new("panels of trousers", trouser_panels),
    Kind::new("apron", apron),
];

/// In front of the person, behind, or through the middle (m).
fn depth(draw: &mut Draw) -> f64 {
    draw.any(&[0.2, 0.14, -0.2, 0.0])
}

fn flat_sheet(draw: &mut Draw) -> Shape {
    let (width, height, z) = (draw.between(0.3, 1.6), draw.between(0.3, 1.6), depth(draw));
    let lies = draw.chance(0.3);
    Shape::sheet(width, height, draw.triangles, |x, y| if lies { [x, 0.0, y] } else { [x, y, z] })
}

fn wavy_sheet(draw: &mut Draw) -> Shape {
    let (width, height, z) = (draw.between(0.4, 1.4), draw.between(0.4, 1.4), depth(draw));
    let (waves, wave, phase) =
        (draw.between(6.0, 25.0), draw.between(0.01, 0.06), draw.between(0.0, 2.0 * PI));
    Shape::sheet(width, height, draw.triangles, |x, y| [x, y, z + wave * (waves * x + 2.0 * y + phase).sin()])
}

fn crumpled_sheet(draw: &mut Draw) -> Shape {
    let (width, height) = (draw.between(0.5, 1.2), draw.between(0.5, 1.2));
    let mut wave = || {
        let direction = [draw.between(-20.0, 20.0), draw.between(-20.0, 20.0), draw.between(0.0, 6.0)];
        let push = [0; 3].map(|_| draw.between(-0.03, 0.03));
        (direction, push)
    };
    let waves: Vec<_> = (0..9).map(|_| wave()).collect();
    let shrink = 0.6;
    Shape::sheet(width, height, draw.triangles, |x, y| {
        let mut p = [shrink * x, shrink * y, 0.1];
        for ([a, b, phase], push) in &waves {
            let height = (a * x + b * y + phase).sin();
            (0..3).for_each(|k| p[k] += push[k] * height);
        }
        p
    })
}

fn half_cylinder(draw: &mut Draw) -> Shape {
    let (radius, height) = (draw.between(0.12, 0.5), draw.between(0.3, 1.2));
    let (angle, faces) = (draw.between(0.6, 1.1) * PI, draw.sign());
    let middle = draw.between(-0.3, 0.2);
    Shape::sheet(radius * angle, height, draw.triangles, |x, y| {
        let (s, c) = (x / radius).sin_cos();
        [radius * s, y + middle, faces * radius * c]
    })
}

fn towel(draw: &mut Draw) -> Shape {
    let (width, height, z) = (draw.between(0.7, 1.3), draw.between(1.6, 2.1), depth(draw));
    let fold = draw.between(0.0, 0.03);
    Shape::sheet(width, height, draw.triangles, |x, y| [x, y, z + fold * (9.0 * x).sin()])
}

fn tee_panel(draw: &mut Draw) -> Shape {
    let (half, shoulder) = (draw.between(0.23, 0.32), draw.between(0.17, 0.21));
    let (hem, armhole, neck, deep) = (
        draw.between(-0.15, 0.05),
        draw.between(0.27, 0.33),
        draw.between(0.07, 0.1),
        draw.between(0.06, 0.16),
    );
    let top = |x: f64| match x.abs() < neck {
        true => 0.49 - deep * (1.0 - (x / neck).powi(2)).sqrt(),
        false => 0.49 - 0.3 * (x.abs() - neck),
    };
    Shape::sheet(1.0, 1.0, draw.triangles, |u, v| {
        // The armhole takes a bite out of the upper half.
        let narrow = |y: f64| half - (half - shoulder) * ((y - armhole) / 0.08).clamp(0.0, 1.0);
        let level = |x: f64| hem + (v + 0.5) * (top(x) - hem);
        let x = 2.0 * u * narrow(level(2.0 * u * half));
        [x, level(x), 0.16]
    })
}

fn trouser_panels(draw: &mut Draw) -> Shape {
    let (waist, crotch, cuff) = (draw.between(0.2, 0.26), draw.between(0.3, 0.38), draw.between(0.17, 0.26));
    let (top, fork, hem) = (0.1, draw.between(-0.2, -0.15), draw.between(-0.88, -0.55));
    let gap = draw.between(0.02, 0.1);
    let panel = Shape::sheet(1.0, top - hem, draw.triangles / 2, |u, v| {
        let y = v + 0.5 * (top + hem);
        // From the waist out to the crotch, from there in to the cuff.
        let width = match y > fork {
            true => waist + (crotch - waist) * ((top - y) / (top - fork)).powi(3),
            false => crotch + (cuff - crotch) * (fork - y) / (fork - hem),
        };
        [gap + crotch - width * (u + 0.5), y, 0.15]
    });
    panel.and_mirrored()
}

fn apron(draw: &mut Draw) -> Shape {
    let (bib, skirt) = (draw.between(0.11, 0.15), draw.between(0.25, 0.38));
    let (top, hem) = (draw.between(0.3, 0.4), draw.between(-0.6, -0.2));
    Shape::sheet(1.0, top - hem, draw.triangles, |u, v| {
        let y = v + 0.5 * (top + hem);
        let half = bib + (skirt - bib) * ((0.2 - y) / 0.1).clamp(0.0, 1.0);
        [2.0 * u * half, y, 0.17]
    })
}

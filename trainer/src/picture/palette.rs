//! Colours of the body and of the layers.

/// The body: a warm neutral grey, so that skin showing through a garment is seen at once.
pub const BODY_COLOUR: [u8; 3] = [201, 192, 184];

/// Colours of the garments by layer, innermost first. Hues in the manner of Paul Tol's colour-blind-friendly
/// schemes, moved until neighbouring layers, and all pairs of the first four, differ clearly for protanopic and
/// deuteranopic eyes too (the tests hold the distances).
pub const LAYER_COLOURS: [[u8; 3]; 12] = [
    [68, 148, 172],  // teal
    [238, 209, 88],  // sand
    [81, 73, 164],   // indigo
    [220, 125, 99],  // coral
    [148, 60, 100],  // wine
    [170, 205, 235], // sky
    [187, 198, 94],  // pear
    [187, 149, 213], // lilac
    [48, 113, 79],   // green
    [230, 159, 194], // pink
    [84, 89, 150],   // slate
    [122, 110, 44],  // olive
];

/// Colour of layer `layer` (0 = innermost); the palette repeats after its twelve entries.
pub fn layer_colour(layer: usize) -> [u8; 3] {
    LAYER_COLOURS[layer % LAYER_COLOURS.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn linear([r, g, b]: [u8; 3]) -> [f64; 3] {
        [r, g, b].map(|value| {
            let v = f64::from(value) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        })
    }

    /// CIE L*a*b* under D65 of linear sRGB.
    fn lab(c: [f64; 3]) -> [f64; 3] {
        let row = |w: [f64; 3]| (w[0] * c[0] + w[1] * c[1] + w[2] * c[2]).max(0.0);
        let f = |t: f64| if t > 0.008856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let x = f(row([0.4124, 0.3576, 0.1805]) / 0.9505);
        let y = f(row([0.2126, 0.7152, 0.0722]));
        let z = f(row([0.0193, 0.1192, 0.9505]) / 1.089);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    /// Full-strength protanopia and deuteranopia in linear sRGB (Machado, Oliveira and Fernandes 2009, table 1).
    const SIMULATIONS: [[[f64; 3]; 3]; 3] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    ];

    fn seen_distance(a: [u8; 3], b: [u8; 3], simulation: &[[f64; 3]; 3]) -> f64 {
        let see = |colour| {
            let c = linear(colour);
            lab(simulation.map(|row| row[0] * c[0] + row[1] * c[1] + row[2] * c[2]))
        };
        let (a, b) = (see(a), see(b));
        (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
    }

    #[test]
    fn neighbouring_layers_differ_for_every_kind_of_sight() {
        for simulation in &SIMULATIONS {
            for layer in 0..LAYER_COLOURS.len() {
                let distance = seen_distance(layer_colour(layer), layer_colour(layer + 1), simulation);
                assert!(distance > 25.0, "layers {layer} and {}: {distance:.1}", layer + 1);
            }
        }
    }

    #[test]
    fn the_first_four_layers_and_the_body_differ_clearly_in_every_pair() {
        let colours = [BODY_COLOUR, layer_colour(0), layer_colour(1), layer_colour(2), layer_colour(3)];
        for simulation in &SIMULATIONS {
            for (i, &a) in colours.iter().enumerate() {
                for &b in &colours[..i] {
                    let distance = seen_distance(a, b, simulation);
                    assert!(distance > 25.0, "{a:?} and {b:?}: {distance:.1}");
                }
            }
        }
    }

    #[test]
    fn every_pair_of_layers_and_the_body_differ() {
        let mut colours = LAYER_COLOURS.to_vec();
        colours.push(BODY_COLOUR);
        for (i, &a) in colours.iter().enumerate() {
            for &b in &colours[..i] {
                assert!(seen_distance(a, b, &SIMULATIONS[0]) > 14.0, "{a:?} and {b:?}");
                for simulation in &SIMULATIONS[1..] {
                    assert!(seen_distance(a, b, simulation) > 7.0, "{a:?} and {b:?} to a colour-blind eye");
                }
            }
        }
    }
}

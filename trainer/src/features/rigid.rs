//! Rigid motions of a shape, to first order: what no error counts is taken out of displacements before they are compared.

/// A direction whose norm falls below this share of its length before projection was inside the span already.
const DEPENDENT: f64 = 1e-6;

/// Orthonormal displacements that translate and turn `positions`: a motion of the whole is no error, so no weight should
/// work against it. Up to six; fewer where the positions have no extent.
pub fn rigid_directions(positions: &[[f64; 3]]) -> Vec<Vec<[f64; 3]>> {
    let vertex_count = positions.len() as f64;
    let mut centre = [0.0; 3];
    for position in positions {
        for c in 0..3 {
            centre[c] += position[c] / vertex_count;
        }
    }
    let translation = |axis: usize| vec![core::array::from_fn(|c| if c == axis { 1.0 } else { 0.0 }); positions.len()];
    let rotation = |axis: usize| {
        let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
        let turned = positions.iter().map(|p| {
            let mut direction = [0.0; 3];
            direction[b] = centre[c] - p[c];
            direction[c] = p[b] - centre[b];
            direction
        });
        turned.collect::<Vec<[f64; 3]>>()
    };
    let mut directions: Vec<Vec<[f64; 3]>> = Vec::new();
    for mut direction in (0..3).map(translation).chain((0..3).map(rotation)) {
        let before = norm(&direction);
        for known in &directions {
            let share = product(known, &direction);
            for (x, known) in direction.as_flattened_mut().iter_mut().zip(known.as_flattened()) {
                *x -= share * known;
            }
        }
        let after = norm(&direction);
        if after > DEPENDENT * before {
            direction.as_flattened_mut().iter_mut().for_each(|x| *x /= after);
            directions.push(direction);
        }
    }
    directions
}

/// Takes the span of orthonormal `directions` out of `column`; `narrow` brings a number back to the column's kind.
pub fn remove_directions<T: Copy + Into<f64>>(
    directions: &[Vec<[f64; 3]>],
    column: &mut [[T; 3]],
    narrow: fn(f64) -> T,
) {
    for direction in directions {
        let pairs = column.as_flattened().iter().zip(direction.as_flattened());
        let share: f64 = pairs.map(|(&x, d)| x.into() * d).sum();
        for (x, d) in column.as_flattened_mut().iter_mut().zip(direction.as_flattened()) {
            *x = narrow((*x).into() - share * d);
        }
    }
}

fn product(a: &[[f64; 3]], b: &[[f64; 3]]) -> f64 {
    a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| a * b).sum()
}

fn norm(a: &[[f64; 3]]) -> f64 {
    product(a, a).sqrt()
}

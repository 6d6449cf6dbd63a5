//! Smallest ball around a set of points: the unit of length of E_rms (method section 4).
//!
//! The smallest ball is fixed by at most four points on its surface. So a set of at most four is kept; the point
//! farthest outside its ball is exchanged in, and the ball of those five is found by trying their subsets. The radius
//! grows with every exchange, so no set returns and the search ends; the result is exact up to rounding.

/// Share of the radius by which a point may lie outside and still count as inside: rounding of the circumcentre.
const INSIDE_TOLERANCE: f64 = 1e-10;

/// A triangle or tetrahedron whose squared determinant falls below this share of its edges' product counts as flat: its
/// circumcentre is noise, and a smaller subset carries the ball.
const FLAT_TOLERANCE: f64 = 1e-12;

/// Stops a search that rounding keeps alive; real sets need 10 to 30 exchanges.
const EXCHANGE_LIMIT: usize = 1000;

/// Centre and radius of a ball.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ball {
    /// Units of the points.
    pub centre: [f64; 3],
    /// Units of the points; not negative.
    pub radius: f64,
}

/// Smallest ball that holds all `points`; radius 0 at the origin for none.
pub fn smallest_ball(points: &[[f64; 3]]) -> Ball {
    let Some(&first) = points.first() else {
        return Ball {
            centre: [0.0; 3],
            radius: 0.0,
        };
    };
    let mut support = vec![first];
    let mut ball = Ball {
        centre: first,
        radius: 0.0,
    };
    for _ in 0..EXCHANGE_LIMIT {
        let (farthest, distance) = farthest_from(points, ball.centre);
        if distance <= ball.radius * (1.0 + INSIDE_TOLERANCE) {
            break;
        }
        support.push(farthest);
        let Some((next, next_support)) = smallest_ball_of_few(&support) else {
            break;
        };
        if next.radius <= ball.radius {
            break;
        }
        (ball, support) = (next, next_support);
    }
    // Whatever rounding did to the search, the ball returned holds every point.
    ball.radius = farthest_from(points, ball.centre).1;
    ball
}

/// The first of the points farthest from `centre`, and its distance.
fn farthest_from(points: &[[f64; 3]], centre: [f64; 3]) -> ([f64; 3], f64) {
    let mut farthest = (centre, 0.0);
    for &point in points {
        let distance_squared = squared_distance(point, centre);
        if distance_squared > farthest.1 {
            farthest = (point, distance_squared);
        }
    }
    (farthest.0, farthest.1.sqrt())
}

/// Smallest ball of at most five points and the points on its surface, by trying every subset of at most four.
fn smallest_ball_of_few(points: &[[f64; 3]]) -> Option<(Ball, Vec<[f64; 3]>)> {
    let mut best: Option<(Ball, Vec<[f64; 3]>)> = None;
    for subset_bits in 1_u32..1 << points.len() {
        if subset_bits.count_ones() > 4 {
            continue;
        }
        let subset: Vec<_> = (0..points.len())
            .filter(|i| subset_bits >> i & 1 == 1)
            .map(|i| points[i])
            .collect();
        let Some(ball) = circumscribed_ball(&subset) else {
            continue;
        };
        let reach = (ball.radius * (1.0 + INSIDE_TOLERANCE)).powi(2);
        let holds_all = points
            .iter()
            .all(|&point| squared_distance(point, ball.centre) <= reach);
        if holds_all && best.as_ref().is_none_or(|(best, _)| ball.radius < best.radius) {
            best = Some((ball, subset));
        }
    }
    best
}

/// Ball through one to four points with its centre in their affine hull; none if they are (nearly) dependent.
fn circumscribed_ball(points: &[[f64; 3]]) -> Option<Ball> {
    let origin = points[0];
    let edges: Vec<[f64; 3]> = points[1..].iter().map(|&p| subtract(p, origin)).collect();
    // centre = origin + sum_i s_i e_i with 2 e_j . (centre - origin) = |e_j|^2.
    let mut rows = [[0.0_f64; 4]; 3];
    let mut scale = 1.0;
    for (row, &edge_j) in rows.iter_mut().zip(&edges) {
        for (entry, &edge_i) in row.iter_mut().zip(&edges) {
            *entry = 2.0 * dot(edge_j, edge_i);
        }
        row[3] = dot(edge_j, edge_j);
        scale *= 2.0 * row[3];
    }
    let shares = solve_small(&mut rows, edges.len(), scale * FLAT_TOLERANCE)?;
    let mut centre = origin;
    for (share, edge) in shares.iter().zip(&edges) {
        for c in 0..3 {
            centre[c] += share * edge[c];
        }
    }
    Some(Ball {
        centre,
        radius: squared_distance(centre, origin).sqrt(),
    })
}

/// Gaussian elimination with row exchanges of an n x n system (n <= 3) whose right-hand side stands in column 3.
fn solve_small(rows: &mut [[f64; 4]; 3], n: usize, least_determinant: f64) -> Option<[f64; 3]> {
    let mut determinant = 1.0;
    for i in 0..n {
        let pivot = (i..n).max_by(|&a, &b| rows[a][i].abs().total_cmp(&rows[b][i].abs()))?;
        rows.swap(i, pivot);
        determinant *= rows[i][i].abs();
        if determinant == 0.0 {
            return None;
        }
        for j in i + 1..n {
            let factor = rows[j][i] / rows[i][i];
            for c in i..4 {
                rows[j][c] -= factor * rows[i][c];
            }
        }
    }
    if n > 0 && determinant <= least_determinant {
        return None;
    }
    let mut solution = [0.0; 3];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|c| rows[i][c] * solution[c]).sum();
        solution[i] = (rows[i][3] - known) / rows[i][i];
    }
    Some(solution)
}

fn subtract(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn squared_distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    let difference = subtract(a, b);
    dot(difference, difference)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Rounding of a few hundred operations in f64.
    const TOLERANCE: f64 = 1e-9;

    #[test]
    fn known_balls() {
        let cube: Vec<[f64; 3]> = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(f64::from)).collect();
        let ball = smallest_ball(&cube);
        assert!((ball.radius - 0.75_f64.sqrt()).abs() < TOLERANCE, "{ball:?}");
        assert!(ball.centre.iter().all(|c| (c - 0.5).abs() < TOLERANCE), "{ball:?}");
        // Obtuse triangle: the longest edge is the diameter.
        let ball = smallest_ball(&[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [1.0, 0.5, 0.0]]);
        assert!((ball.radius - 2.0).abs() < TOLERANCE, "{ball:?}");
        // Points in a row, twice.
        let row: Vec<[f64; 3]> = (0..10).map(|i| [f64::from(i % 5), 0.0, 0.0]).collect();
        assert!((smallest_ball(&row).radius - 2.0).abs() < TOLERANCE);
        assert_eq!(smallest_ball(&[[1.0, 2.0, 3.0]; 3]).radius, 0.0);
        assert_eq!(smallest_ball(&[]).radius, 0.0);
    }

    #[test]
    fn no_shifted_ball_is_smaller() {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        for _ in 0..20 {
            let points: Vec<[f64; 3]> = (0..200)
                .map(|_| core::array::from_fn(|_| random.random_range(-1.0..1.0)))
                .collect();
            let ball = smallest_ball(&points);
            for _ in 0..50 {
                let centre: [f64; 3] = core::array::from_fn(|c| ball.centre[c] + random.random_range(-1e-3..1e-3));
                assert!(farthest_from(&points, centre).1 >= ball.radius * (1.0 - TOLERANCE));
            }
        }
    }
}

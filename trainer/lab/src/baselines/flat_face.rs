//! A triangle laid flat by the lengths of its edges, and how it changes with them: for [`super::length_angle`].

use nalgebra::{Matrix3, Vector2, Vector3};

/// A flat face lower than this share of its base has no say in how its corner moves.
const SLIVER: f64 = 1e-6;

/// A face in its plane: first corner at the origin, second on the axis.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    second: Vector2<f64>,
    third: Vector2<f64>,
}

impl Layout {
    /// Of a face that takes no part.
    pub(super) const FLAT: Self = Self {
        second: Vector2::new(1.0, 0.0),
        third: Vector2::new(0.0, 1.0),
    };

    /// From the lengths of the edges that start at each corner. Lengths that make no triangle make a flat one.
    pub(super) fn new([base, opposite, side]: [f64; 3]) -> Self {
        let x = ((base * base + side * side - opposite * opposite) / (2.0 * base)).clamp(-side, side);
        Self {
            second: Vector2::new(base, 0.0),
            third: Vector2::new(x, (side * side - x * x).max(0.0).sqrt()),
        }
    }

    /// Edges from the first corner, and the normal.
    pub(super) fn edges(&self) -> Matrix3<f64> {
        Matrix3::from_columns(&[self.second.push(0.0), self.third.push(0.0), Vector3::z()])
    }

    /// The edge that starts at corner `n`.
    pub(super) fn edge(&self, n: usize) -> Vector2<f64> {
        [self.second, self.third - self.second, -self.third][n]
    }

    pub(super) fn direction(&self, n: usize) -> f64 {
        let edge = self.edge(n);
        edge.y.atan2(edge.x)
    }

    /// How second and third corner move with the lengths.
    pub(super) fn change(
        &self,
        [base, opposite, side]: [f64; 3],
        [d_base, d_opposite, d_side]: [f64; 3],
    ) -> [Vector2<f64>; 2] {
        let (x, y) = (self.third.x, self.third.y);
        if y <= SLIVER * base {
            let d_x = d_side * x.signum();
            return [Vector2::new(d_base, 0.0), Vector2::new(d_x, 0.0)];
        }
        let d_x = ((base - x) * d_base + side * d_side - opposite * d_opposite) / base;
        [
            Vector2::new(d_base, 0.0),
            Vector2::new(d_x, (side * d_side - x * d_x) / y),
        ]
    }

    /// How the direction of the edge at corner `n` turns with the corners.
    pub(super) fn direction_change(&self, n: usize, [second, third]: &[Vector2<f64>; 2]) -> f64 {
        let edge = self.edge(n);
        let change = [*second, third - second, -third][n];
        edge.perp(&change) / edge.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_come_back_and_changes_are_the_slopes() {
        let lengths = [2.0, 1.5, 1.2];
        let face = Layout::new(lengths);
        for (n, length) in lengths.iter().enumerate() {
            assert!((face.edge(n).norm() - length).abs() < 1e-12);
        }
        let (step, along) = (1e-6, [0.3, -0.7, 0.5]);
        let ahead = Layout::new([0, 1, 2].map(|n| lengths[n] + step * along[n]));
        let changes = face.change(lengths, along);
        assert!(((ahead.second - face.second) / step - changes[0]).norm() < 1e-5);
        assert!(((ahead.third - face.third) / step - changes[1]).norm() < 1e-5);
        for n in 0..3 {
            let turned = (ahead.direction(n) - face.direction(n)) / step;
            assert!((turned - face.direction_change(n, &changes)).abs() < 1e-5);
        }
        assert_eq!(Layout::new([1.0, 5.0, 1.0]).third, Vector2::new(-1.0, 0.0));
    }
}

//! Labels that say where a component acts and how: `left-front-low-swing`. Fields, rest surface and mirror plane -> one label a
//! component, unique in its package; the same package and axes give the same labels.
//!
//! Region: the side of the mirror that its energy lies on, if it is one, then where the centre of its energy lies in the box.
//! Motion: the kind that holds most of its energy, at the farther stop of its control. Labels are made to be read; nothing
//! depends on them.

use core::str::FromStr;

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use super::fields::Field;
use super::symmetry::MirrorPlane;

/// A component is of one side where the middle of its energy is this many standard deviations off the mirror: a leg is, a tail
/// that leans is not.
const ASIDE: f64 = 1.0;
/// Where the box is low (and back) below, and high (and front) above one less this.
const LOW: f64 = 0.35;
/// A box thinner than this share of its diagonal along an axis has no ends there.
const LEAST_EXTENT: f64 = 0.1;
/// Spread of a component, as a share of the mesh's own, from which it is of the whole.
const WHOLE: f64 = 0.75;
/// Share of the rotation's energy about one axis from which that is its axis.
const ONE_AXIS: f64 = 0.75;
/// A region is long where its variance along is this much greater than across.
const LONG: f64 = 2.0;
/// Cosine of axis and length from which a turn is a twist.
const ALONG: f64 = 0.8;
/// Share of a rotation that is left when its two senses cancel, from which it counts as one-way.
const ONE_WAY: f64 = 0.5;
/// Least over greatest stretch from which it counts as the same all around.
const ALL_AROUND: f64 = 0.4;

/// A coordinate axis with its sign: `+x`, `-y`, `z`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axis {
    /// 0 to 2.
    pub coordinate: usize,
    /// Whether it points down the coordinate.
    pub negative: bool,
}

/// A text that is no axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("expected x, y or z, with a sign if it points backwards: -z")]
pub struct AxisError;

impl FromStr for Axis {
    type Err = AxisError;

    fn from_str(text: &str) -> Result<Self, AxisError> {
        let (negative, letter) = match text.split_at_checked(1) {
            Some(("-", letter)) => (true, letter),
            Some(("+", letter)) => (false, letter),
            _ => (false, text),
        };
        let coordinate = ["x", "y", "z"]
            .iter()
            .position(|&axis| axis == letter)
            .ok_or(AxisError)?;
        Ok(Self { coordinate, negative })
    }
}

impl Axis {
    const fn along(coordinate: usize) -> Self {
        Self {
            coordinate,
            negative: false,
        }
    }

    fn vector(self) -> Vector3<f64> {
        let sign = if self.negative { -1.0 } else { 1.0 };
        Vector3::from_fn(|c, _| if c == self.coordinate { sign } else { 0.0 })
    }
}

/// Which way is up and which is front. The default is glTF's: y up, z to the front.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axes {
    up: Axis,
    front: Axis,
}

impl Default for Axes {
    fn default() -> Self {
        Self {
            up: Axis::along(1),
            front: Axis::along(2),
        }
    }
}

/// Up and front on one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("up and front lie on one axis: they must be across each other")]
pub struct AxesError;

impl Axes {
    /// Those that are given; else y is up (z where front is along y) and the front is along z (along y where z is up, and
    /// against it, as in Blender).
    /// Errors: both on one axis.
    pub fn new(up: Option<Axis>, front: Option<Axis>) -> Result<Self, AxesError> {
        let up = up.unwrap_or_else(|| {
            Axis::along(if front.is_some_and(|front| front.coordinate == 1) {
                2
            } else {
                1
            })
        });
        let front = front.unwrap_or(if up.coordinate == 2 {
            Axis {
                coordinate: 1,
                negative: true,
            }
        } else {
            Axis::along(2)
        });
        if up.coordinate == front.coordinate {
            return Err(AxesError);
        }
        Ok(Self { up, front })
    }

    fn left(self) -> Vector3<f64> {
        self.up.vector().cross(&self.front.vector())
    }
}

/// The rest shape as labels see it.
pub struct Body<'a> {
    /// Shape: `[V]`, units of the source.
    pub rest: &'a [[f64; 3]],
    /// Shape: `[V]`.
    pub areas: &'a [f64],
    /// Where there is one.
    pub plane: Option<&'a MirrorPlane>,
    /// Which way it stands.
    pub axes: Axes,
}

/// One label for each field, no two the same: later ones of the same words are numbered. Shape: `[K]`.
pub fn labels(fields: &[Field], body: &Body<'_>) -> Vec<String> {
    let whole = Spread::of(body.rest, body.areas.iter().copied().enumerate()).map_or(0.0, |spread| spread.radius());
    let mut found: Vec<String> = Vec::with_capacity(fields.len());
    let plain: Vec<String> = fields.iter().map(|field| label(field, body, whole)).collect();
    for (k, label) in plain.iter().enumerate() {
        let earlier = plain[..k].iter().filter(|other| *other == label).count();
        found.push(match earlier {
            0 => label.clone(),
            _ => format!("{label}-{}", earlier + 1),
        });
    }
    found
}

fn label(field: &Field, body: &Body<'_>, whole: f64) -> String {
    let energies = field
        .vertices
        .iter()
        .map(|&v| v as usize)
        .zip(field.energies(body.areas));
    let Some(spread) = Spread::of(body.rest, energies) else {
        return "still".to_owned();
    };
    let mut words = region(field, body, &spread, whole);
    words.push(motion(field, body.areas, &spread));
    words.join("-")
}

/// Mean and covariance of weighted positions.
struct Spread {
    centre: Vector3<f64>,
    axes: SymmetricEigen<f64, nalgebra::Const<3>>,
}

impl Spread {
    /// `None` where nothing weighs.
    fn of(rest: &[[f64; 3]], weights: impl Iterator<Item = (usize, f64)> + Clone) -> Option<Self> {
        let total: f64 = weights.clone().map(|(_, w)| w).sum();
        if total <= 0.0 {
            return None;
        }
        let point = |v: usize| Vector3::from(rest[v]);
        let centre: Vector3<f64> = weights.clone().map(|(v, w)| point(v) * (w / total)).sum();
        let covariance = weights.fold(Matrix3::zeros(), |sum, (v, w)| {
            sum + (point(v) - centre) * (point(v) - centre).transpose() * (w / total)
        });
        Some(Self {
            centre,
            axes: covariance.symmetric_eigen(),
        })
    }

    /// Root mean square distance from the centre.
    fn radius(&self) -> f64 {
        self.axes.eigenvalues.sum().max(0.0).sqrt()
    }

    /// The direction it is long in, where it is.
    fn length(&self) -> Option<Vector3<f64>> {
        let values = &self.axes.eigenvalues;
        let longest = values.imax();
        let next = (0..3).filter(|&i| i != longest).map(|i| values[i]).fold(0.0, f64::max);
        (values[longest] > LONG * next).then(|| self.axes.eigenvectors.column(longest).into_owned())
    }
}

fn region(field: &Field, body: &Body<'_>, spread: &Spread, whole: f64) -> Vec<&'static str> {
    if spread.radius() >= WHOLE * whole {
        return vec!["whole"];
    }
    let mut words = Vec::new();
    let (up, mut front) = (body.axes.up.vector(), body.axes.front.vector());
    if let Some(plane) = body.plane {
        let normal = Vector3::from(plane.normal);
        // A mirror that parts what is called front from back leaves the third axis for the front.
        if normal.dot(&front).abs() > normal.dot(&body.axes.left()).abs() {
            front = body.axes.left();
        }
        let left = up.cross(&front);
        // A mirror that parts high from low has no left.
        if normal.dot(&up).abs() < normal.dot(&left).abs() {
            let (mut mean, mut square, mut total) = (0.0, 0.0, 0.0);
            for (&v, energy) in field.vertices.iter().zip(field.energies(body.areas)) {
                let side = plane.side(body.rest[v as usize]);
                mean += energy * side;
                square += energy * side * side;
                total += energy;
            }
            mean /= total;
            let deviation = (square / total - mean * mean).max(0.0).sqrt();
            if mean.abs() >= ASIDE * deviation && mean != 0.0 {
                words.push(if (mean > 0.0) == (normal.dot(&left) > 0.0) {
                    "left"
                } else {
                    "right"
                });
            }
        }
    }
    words.extend(end(body.rest, front, spread.centre, ["back", "front"]));
    words.extend(end(body.rest, up, spread.centre, ["low", "high"]));
    if words.is_empty() {
        words.push("middle");
    }
    words
}

/// Which end of the box along `axis` the point is near, if any.
fn end(rest: &[[f64; 3]], axis: Vector3<f64>, point: Vector3<f64>, words: [&'static str; 2]) -> Option<&'static str> {
    let (mut low, mut high) = (Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN));
    for p in rest {
        low = low.inf(&Vector3::from(*p));
        high = high.sup(&Vector3::from(*p));
    }
    // The axis is a coordinate's, so its two ends are those of the box.
    let (a, b) = (axis.dot(&low), axis.dot(&high));
    let (from, extent) = (a.min(b), (b - a).abs());
    if extent < LEAST_EXTENT * (high - low).norm() {
        return None;
    }
    let place = (axis.dot(&point) - from) / extent;
    if place < LOW {
        Some(words[0])
    } else if place > 1.0 - LOW {
        Some(words[1])
    } else {
        None
    }
}

/// *Swing*: about one axis, one way; *bend*: about one axis, here one way and there the other; *twist*: about the length of the
/// region; *turn*: about several axes. *Swell*, *shrink*: all around; *stretch*, *squash*: by its greatest principal stretch.
fn motion(field: &Field, areas: &[f64], spread: &Spread) -> &'static str {
    let (mut turns, mut stretch) = (Matrix3::zeros(), Matrix3::zeros());
    let (mut turned, mut stretched) = (0.0, 0.0);
    for (&v, x) in field.vertices.iter().zip(&field.values) {
        let area = areas[v as usize];
        let r = Vector3::new(x[0], x[1], x[2]);
        let s = Matrix3::new(x[3], x[4], x[5], x[4], x[6], x[7], x[5], x[7], x[8]);
        turns += r * r.transpose() * area;
        stretch += s * area;
        turned += 2.0 * area * r.norm_squared();
        stretched += area * s.norm_squared();
    }
    if stretched > turned {
        let values = stretch.symmetric_eigenvalues();
        let strongest = values[values.iamax()];
        let all_around = values.iter().all(|value| value / strongest >= ALL_AROUND);
        return match (all_around, strongest > 0.0) {
            (true, true) => "swell",
            (true, false) => "shrink",
            (false, true) => "stretch",
            (false, false) => "squash",
        };
    }
    let eigen = turns.symmetric_eigen();
    let main = eigen.eigenvalues.imax();
    if eigen.eigenvalues[main] < ONE_AXIS * eigen.eigenvalues.sum() {
        return "turn";
    }
    let axis = eigen.eigenvectors.column(main).into_owned();
    if spread.length().is_some_and(|length| axis.dot(&length).abs() >= ALONG) {
        return "twist";
    }
    let (mut one_way, mut both) = (0.0, 0.0);
    for (&v, x) in field.vertices.iter().zip(&field.values) {
        let angle = areas[v as usize] * axis.dot(&Vector3::new(x[0], x[1], x[2]));
        one_way += angle;
        both += angle.abs();
    }
    if f64::abs(one_way) >= ONE_WAY * both {
        "swing"
    } else {
        "bend"
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::topology::Topology;

    /// A beam of square section, 1 x 1 x 6 along z, 13 rings of 4.
    fn beam() -> Vec<[f64; 3]> {
        (0..52)
            .map(|v| {
                let [x, y] = [[0.5, 0.5], [-0.5, 0.5], [-0.5, -0.5], [0.5, -0.5]][v % 4];
                [x, y, 0.5 * (v / 4) as f64 - 3.0]
            })
            .collect()
    }

    fn field(rest: &[[f64; 3]], at: impl Fn(&[f64; 3]) -> [f64; 9]) -> Field {
        let values: Vec<[f64; 9]> = rest.iter().map(at).collect();
        let acts: Vec<u32> = (0..rest.len() as u32)
            .filter(|&v| values[v as usize] != [0.0; 9])
            .collect();
        Field {
            level: 0,
            stop: 1.0,
            values: acts.iter().map(|&v| values[v as usize]).collect(),
            vertices: acts,
        }
    }

    fn label_of(axes: Axes, at: impl Fn(&[f64; 3]) -> [f64; 9]) -> String {
        let rest = beam();
        let faces: Vec<[u32; 3]> = (0..48).map(|v| [v, v - v % 4 + (v + 1) % 4, v + 4]).collect();
        let topology = Topology::new(&faces, &rest);
        let areas = vec![1.0; rest.len()];
        let plane = MirrorPlane::find(&rest, &areas, &topology);
        let fields = [field(&rest, at)];
        let body = Body {
            rest: &rest,
            areas: &areas,
            plane: plane.as_ref(),
            axes,
        };
        labels(&fields, &body).remove(0)
    }

    fn only(feature: usize, value: f64) -> [f64; 9] {
        core::array::from_fn(|c| if c == feature { value } else { 0.0 })
    }

    #[test]
    fn words_say_where_and_how() {
        let axes = Axes::default();
        let check = |expected: &str, at: &dyn Fn(&[f64; 3]) -> [f64; 9]| assert_eq!(label_of(axes, at), expected);
        let near = |inside: bool, x: [f64; 9]| if inside { x } else { [0.0; 9] };
        check("front-swing", &|p| near(p[2] > 1.2, only(0, 0.4)));
        check("back-twist", &|p| near(p[2] < 0.2, only(2, -0.4)));
        check("middle-bend", &|p| near(p[2].abs() < 1.2, only(0, 0.3 * p[2])));
        check("whole-turn", &|p| {
            core::array::from_fn(|c| if c < 3 { (p[2] * (c + 1) as f64).sin() } else { 0.0 })
        });
        check("left-front-high-swing", &|p| {
            near(p[2] > 1.2 && p[0] > 0.0 && p[1] > 0.0, only(1, 1.0))
        });
        check("right-back-low-stretch", &|p| {
            near(p[2] < -1.2 && p[0] < 0.0 && p[1] < 0.0, only(8, 0.1))
        });
        check("middle-squash", &|p| near(p[2].abs() < 1.2, only(3, -0.1)));
        check("front-swell", &|p| {
            near(p[2] > 1.2, [0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.2, 0.0, 0.2])
        });
        check("back-shrink", &|p| {
            near(p[2] < -1.2, [0.0, 0.0, 0.0, -0.2, 0.0, 0.0, -0.2, 0.0, -0.2])
        });
        check("still", &|_| [0.0; 9]);
    }

    #[test]
    fn axes_turn_the_words() {
        let axes = |up: &str, front: &str| Axes::new(Some(up.parse().unwrap()), Some(front.parse().unwrap()));
        let corner = |p: &[f64; 3]| {
            if p[2] > 1.2 && p[0] > 0.0 && p[1] > 0.0 {
                only(1, 1.0)
            } else {
                [0.0; 9]
            }
        };
        assert_eq!(label_of(axes("y", "-z").unwrap(), corner), "right-back-high-swing");
        assert_eq!(label_of(axes("-y", "+z").unwrap(), corner), "right-front-low-swing");
        assert_eq!(axes("y", "-y"), Err(AxesError));
        assert!(
            ["", "w", "--x", "xy", "é"]
                .iter()
                .all(|text| text.parse::<Axis>().is_err())
        );
        let up = Axes::new(Some("z".parse().unwrap()), None).unwrap();
        assert_eq!(up.front.vector(), Vector3::new(0.0, -1.0, 0.0));
        assert_eq!(Axes::new(None, None), Ok(Axes::default()));
    }

    #[test]
    fn the_same_words_twice_are_numbered() {
        let rest = beam();
        let swing = field(&rest, |p| if p[2] > 1.2 { only(0, 0.4) } else { [0.0; 9] });
        let body = Body {
            rest: &rest,
            areas: &vec![1.0; rest.len()],
            plane: None,
            axes: Axes::default(),
        };
        let found = labels(&[swing.clone(), swing.clone(), swing], &body);
        assert_eq!(found, ["front-swing", "front-swing-2", "front-swing-3"]);
    }
}

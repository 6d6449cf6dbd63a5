//! Where to look from: a guess of which way is up and which is the front, and a camera that fits all shapes of a sequence.
//!
//! Files do not say which axis is up. Clues, weighed against each other: a convention (y more often than z), a floor at zero, the
//! longer extent, and left-right symmetry, whose axis is never up. The front is where an open surface (a face) looks, or where the
//! top leans (a head). The view is from the front for what is wide, from the side for what is long, always turned and a bit above.

use nalgebra::Vector3;

type V3 = Vector3<f64>;

/// A direction frame of a subject: unit axes, right-handed with `side` x `up` = `front` up to sign.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Orientation {
    /// Away from the floor.
    pub up: V3,
    /// Where the subject looks.
    pub front: V3,
    /// Across, left to right or right to left.
    pub side: V3,
}

/// A camera with mild perspective.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it is, in units of the shapes.
    pub eye: V3,
    /// Unit axes of the picture: right, up, and towards the viewer.
    pub right: V3,
    /// See `right`.
    pub up: V3,
    /// See `right`.
    pub back: V3,
    /// Height of a picture plane at distance 1.
    pub height: f64,
    /// Centre of the picture on that plane.
    pub center: [f64; 2],
    /// Width over height of the picture.
    pub aspect: f64,
    /// The subject's up: the floor for shadows lies across it.
    pub floor_up: V3,
    /// Height of the floor along `floor_up`.
    pub floor: f64,
}

/// Angle above the horizon, radians.
const ELEVATION: f64 = 0.24;
/// Angle away from the front for wide subjects and for long ones, radians.
const TURN_WIDE: f64 = 0.5;
const TURN_LONG: f64 = 0.96;
/// Distance of the eye in diagonals of the bounding box: farther is flatter.
const EYE_DISTANCE: f64 = 3.2;
/// Empty border, as a share of the picture's height.
const MARGIN: f64 = 0.05;
/// Cells a side of the grid that symmetry is judged on.
const SYMMETRY_CELLS: usize = 14;

fn vector(p: &[f32; 3]) -> V3 {
    V3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

fn bounds<'a>(points: impl Iterator<Item = &'a [f32; 3]>) -> (V3, V3) {
    points.fold(
        (V3::repeat(f64::INFINITY), V3::repeat(f64::NEG_INFINITY)),
        |(low, high), p| {
            let p = vector(p);
            if p.iter().all(|x| x.is_finite()) {
                (low.inf(&p), high.sup(&p))
            } else {
                (low, high)
            }
        },
    )
}

/// Guesses which way the rest shape stands and looks. Shape: `rest` is `[V]`.
pub fn orient(rest: &[[f32; 3]], faces: &[[u32; 3]]) -> Orientation {
    let (low, high) = bounds(rest.iter());
    let extent = (high - low).map(|x| if x.is_finite() { x } else { 0.0 });
    let longest = extent.max().max(f64::MIN_POSITIVE);
    let symmetry: [f64; 3] = core::array::from_fn(|c| symmetry_across(rest, c, low, extent));
    // The most symmetric axis, if it clearly is, is never up.
    let clearly =
        |&c: &usize| symmetry[c] > 0.6 && (0..3).all(|other| other == c || symmetry[c] - symmetry[other] > 0.12);
    let mirror = (0..3).find(clearly);
    let score = |c: usize| {
        let convention = [-1.0, 0.5, 0.0][c];
        let on_floor = if low[c].abs() < 0.02 * extent[c] && extent[c] > 0.05 * longest {
            1.0
        } else {
            0.0
        };
        let flat = if extent[c] < 0.05 * longest { -3.0 } else { 0.0 };
        let mirrored = if mirror == Some(c) { -0.8 } else { 0.0 };
        convention + on_floor + flat + mirrored + 0.6 * extent[c] / longest
    };
    let up = (0..3).max_by(|&a, &b| score(a).total_cmp(&score(b))).unwrap_or(1);
    let (a, b) = ((up + 1) % 3, (up + 2) % 3);
    // Left and right are alike; where neither axis is clearly so, the wider one is across.
    let side = match mirror {
        Some(c) if c != up => c,
        _ if extent[a] >= extent[b] => a,
        _ => b,
    };
    let front = 3 - up - side;
    let axis = |c: usize| V3::from_fn(|i, _| if i == c { 1.0 } else { 0.0 });
    let sign = front_sign(rest, faces, up, front, low, extent);
    Orientation {
        up: axis(up),
        front: axis(front) * sign,
        side: axis(side),
    }
}

/// How alike the two halves across axis `c` are: cells filled on both sides over cells filled on either. Range: 0 to 1.
fn symmetry_across(rest: &[[f32; 3]], c: usize, low: V3, extent: V3) -> f64 {
    let size = extent.max().max(f64::MIN_POSITIVE) / SYMMETRY_CELLS as f64;
    if extent[c] < 2.0 * size {
        return 0.0;
    }
    let mut filled = [
        vec![false; 8 * SYMMETRY_CELLS.pow(3)],
        vec![false; 8 * SYMMETRY_CELLS.pow(3)],
    ];
    let n = 2 * SYMMETRY_CELLS;
    for p in rest.iter().map(vector) {
        let middle = low[c] + extent[c] / 2.0;
        let cell = |p: V3| {
            let i: [usize; 3] = core::array::from_fn(|j| ((p[j] - low[j]) / size).max(0.0) as usize);
            let distance = ((p[c] - middle).abs() / size) as usize;
            let i: [usize; 3] = core::array::from_fn(|j| if j == c { distance.min(n - 1) } else { i[j].min(n - 1) });
            (i[2] * n + i[1]) * n + i[0]
        };
        if p.iter().all(|x| x.is_finite()) {
            filled[usize::from(p[c] > middle)][cell(p)] = true;
        }
    }
    let both = filled[0].iter().zip(&filled[1]).filter(|(l, r)| **l && **r).count();
    let either = filled[0].iter().zip(&filled[1]).filter(|(l, r)| **l || **r).count();
    both as f64 / either.max(1) as f64
}

/// 1 where the subject looks along the axis, -1 against it.
fn front_sign(rest: &[[f32; 3]], faces: &[[u32; 3]], up: usize, front: usize, low: V3, extent: V3) -> f64 {
    let (mut facing, mut area) = (0.0, 0.0);
    for face in faces {
        let [a, b, c] = face.map(|v| rest.get(v as usize).map_or_else(V3::zeros, vector));
        let normal = (b - a).cross(&(c - a));
        if normal.iter().all(|x| x.is_finite()) {
            facing += normal[front];
            area += normal.norm();
        }
    }
    // The normals of a closed surface cancel; those of an open one, a face or a sheet, point where it looks.
    if facing.abs() > 0.12 * area {
        return facing.signum();
    }
    let mean = |from: f64, to: f64| {
        let slab = rest
            .iter()
            .map(vector)
            .filter(|p| (from..=to).contains(&((p[up] - low[up]) / extent[up].max(1e-30))));
        let (sum, count) = slab.fold((0.0, 0.0), |(sum, count), p| (sum + p[front], count + 1.0));
        (count > 0.0).then_some(sum / count)
    };
    // Heads stand before the body, toes before the shins.
    let clue = |from: (f64, f64), to: (f64, f64)| match (mean(from.0, from.1), mean(to.0, to.1)) {
        (Some(a), Some(b)) => (b - a) / extent[front].max(1e-30),
        _ => 0.0,
    };
    let head = clue((0.3, 0.7), (0.88, 1.0));
    let toes = clue((0.08, 0.3), (0.0, 0.05));
    let lean = if extent[front] > 0.5 * extent[up] {
        head
    } else {
        head + toes
    };
    if lean < 0.0 { -1.0 } else { 1.0 }
}

impl Camera {
    /// A pleasant three-quarter view in which all `shapes` fit. The rest shape says how the subject stands. `aspect` is width over height.
    pub fn fit(rest: &[[f32; 3]], faces: &[[u32; 3]], shapes: &[&[[f32; 3]]], aspect: f64) -> Self {
        let orientation = orient(rest, faces);
        let (low, high) = bounds(rest.iter());
        let extent = high - low;
        let (wide, long) = (
            extent.dot(&orientation.side.abs()),
            extent.dot(&orientation.front.abs()),
        );
        // From 0 for a sheet or a person, seen from the front, to 1 for a horse, seen from the side.
        let length = ((long / (long + wide).max(f64::MIN_POSITIVE) - 0.45) / 0.25).clamp(0.0, 1.0);
        let turn = TURN_WIDE + (TURN_LONG - TURN_WIDE) * length * length * (3.0 - 2.0 * length);
        Self::fit_from(&orientation, turn, shapes, aspect)
    }

    /// As [`Camera::fit`], from `turn` radians away from the front.
    pub fn fit_from(orientation: &Orientation, turn: f64, shapes: &[&[[f32; 3]]], aspect: f64) -> Self {
        let level = orientation.front * turn.cos() + orientation.side * turn.sin();
        let back = level * ELEVATION.cos() + orientation.up * ELEVATION.sin();
        let right = orientation.up.cross(&back).normalize();
        let up = back.cross(&right);
        let (low, high) = bounds(shapes.iter().flat_map(|shape| shape.iter()));
        let (low, high) = if low.x.is_finite() {
            (low, high)
        } else {
            (V3::zeros(), V3::repeat(1.0))
        };
        let diagonal = (high - low).norm().max(1e-12);
        let eye = (low + high) / 2.0 + back * (EYE_DISTANCE * diagonal);
        let mut camera = Self {
            eye,
            right,
            up,
            back,
            height: 1.0,
            center: [0.0; 2],
            aspect,
            floor_up: orientation.up,
            floor: 0.0,
        };
        let (mut least, mut most, mut floor) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], f64::INFINITY);
        for p in shapes
            .iter()
            .flat_map(|shape| shape.iter())
            .map(vector)
            .filter(|p| p.iter().all(|x| x.is_finite()))
        {
            let seen = camera.project(&p);
            for c in 0..2 {
                least[c] = least[c].min(seen[c]);
                most[c] = most[c].max(seen[c]);
            }
            floor = floor.min(p.dot(&orientation.up));
        }
        if floor.is_finite() {
            camera.center = [(least[0] + most[0]) / 2.0, (least[1] + most[1]) / 2.0];
            camera.height = (most[1] - least[1]).max((most[0] - least[0]) / aspect).max(1e-9) / (1.0 - 2.0 * MARGIN);
            camera.floor = floor;
        }
        camera
    }

    /// Place on the plane at distance 1, and the distance along the view.
    pub fn project(&self, p: &V3) -> [f64; 3] {
        let from_eye = p - self.eye;
        let depth = (-from_eye.dot(&self.back)).max(1e-9);
        [from_eye.dot(&self.right) / depth, from_eye.dot(&self.up) / depth, depth]
    }
}

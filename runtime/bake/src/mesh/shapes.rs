//! Small meshes for the tests of this crate.

/// Positions and faces.
pub type Mesh = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// A flat grid of `columns` x `rows` squares of side `side`, in the plane z = 0.
pub fn grid(columns: u32, rows: u32, side: f64) -> Mesh {
    let across = columns + 1;
    let positions = (0..across * (rows + 1))
        .map(|v| [f64::from(v % across) * side, f64::from(v / across) * side, 0.0])
        .collect();
    let faces = (0..rows)
        .flat_map(|row| (0..columns).map(move |column| row * across + column))
        .flat_map(|corner| {
            // Diagonals alternate, so that no direction is favoured.
            let [a, b, c, d] = [corner, corner + 1, corner + across + 1, corner + across];
            if (corner % across + corner / across).is_multiple_of(2) {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            }
        })
        .collect();
    (positions, faces)
}

/// A tube of radius 1 about the z axis, open at both ends: `around` vertices a ring, `rings` rings, `height` tall.
pub fn tube(around: u32, rings: u32, height: f64) -> Mesh {
    let positions = (0..around * rings)
        .map(|v| {
            let (ring, place) = (v / around, v % around);
            let angle = core::f64::consts::TAU * f64::from(place) / f64::from(around);
            [
                angle.cos(),
                angle.sin(),
                height * f64::from(ring) / f64::from(rings - 1),
            ]
        })
        .collect();
    let faces = (0..rings - 1)
        .flat_map(|ring| (0..around).map(move |place| (ring * around, place)))
        .flat_map(|(base, place)| {
            let next = (place + 1) % around;
            let [a, b, c, d] = [base + place, base + next, base + around + next, base + around + place];
            if (base / around + place).is_multiple_of(2) {
                [[a, b, c], [a, c, d]]
            } else {
                [[a, b, d], [b, c, d]]
            }
        })
        .collect();
    (positions, faces)
}

/// The unit sphere: an octahedron whose faces are split in four `splits` times. 6, 18, 66, 258, 1,026 ... vertices.
pub fn sphere(splits: u32) -> Mesh {
    let mut positions = vec![
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
    ];
    let mut faces = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    for _ in 0..splits {
        let mut middles = std::collections::BTreeMap::new();
        let mut middle = |a: u32, b: u32, positions: &mut Vec<[f64; 3]>| {
            *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let sum = [0, 1, 2].map(|c| positions[a as usize][c] + positions[b as usize][c]);
                let length = sum.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
                positions.push(sum.map(|x| x / length));
                positions.len() as u32 - 1
            })
        };
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                let [ab, bc, ca] = [
                    middle(a, b, &mut positions),
                    middle(b, c, &mut positions),
                    middle(c, a, &mut positions),
                ];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    (positions, faces)
}

/// The same mesh elsewhere.
pub fn moved((positions, faces): &Mesh, by: [f64; 3]) -> Mesh {
    (
        positions
            .iter()
            .map(|p| [p[0] + by[0], p[1] + by[1], p[2] + by[2]])
            .collect(),
        faces.clone(),
    )
}

/// Several meshes as one, in order.
pub fn merged(meshes: &[Mesh]) -> Mesh {
    let mut whole: Mesh = (Vec::new(), Vec::new());
    for (positions, faces) in meshes {
        let first = whole.0.len() as u32;
        whole.0.extend_from_slice(positions);
        whole.1.extend(faces.iter().map(|face| face.map(|v| v + first)));
    }
    whole
}

//! Four lanes have the bits of the reference: a whole frame, its features, and what is differentiated.

use std::vec;
use std::vec::Vec;

use crate::fixture::{Package, open};
use crate::{Controls, FEATURE_COUNT, Frame, Kernels, Tangent, Workspace, WorkspaceLayout};

/// Of everything that a pose gives.
#[derive(Debug, PartialEq)]
struct Bits(Vec<u32>);

impl Bits {
    fn of(package: &Package, kernels: Kernels, weights: &[f32]) -> Self {
        let basis = open(package);
        let mut memory = vec![0_u8; WorkspaceLayout::for_basis(&basis).unaligned_bytes()];
        let mut workspace = Workspace::with_kernels(&basis, &mut memory, kernels).unwrap();
        let mut held = vec![0.0; weights.len()];
        let mut controls = Controls::new(&basis, &mut held).unwrap();
        for (k, &weight) in weights.iter().enumerate() {
            controls.set_unclamped(k, weight).unwrap();
        }
        let mut points = [0, 1].map(|_| vec![[0.0; 3]; basis.vertex_count()]);
        let [positions, normals] = &mut points;
        let frame = Frame {
            basis: &basis,
            controls: &controls,
            positions,
            normals: Some(normals),
        };
        frame.run(&mut workspace).unwrap();
        let mut features = vec![[0.0; FEATURE_COUNT]; basis.vertex_count()];
        workspace.features(&basis, &mut features).unwrap();
        let mut numbers: Vec<f32> = points.iter().flatten().flatten().copied().collect();
        numbers.extend(features.iter().flatten());
        for component in 0..basis.component_count() {
            let tangent = Tangent {
                basis: &basis,
                component,
                displacement: &mut points[0],
            };
            tangent.run(&mut workspace).unwrap();
            numbers.extend(points[0].iter().flatten());
        }
        Self(numbers.iter().map(|x| x.to_bits()).collect())
    }
}

#[test]
fn four_lanes_have_the_bits_of_one() {
    if !Kernels::Portable.run_here() {
        return;
    }
    let poses: [[f32; Package::COMPONENTS]; 5] = [
        [0.0; Package::COMPONENTS],
        [0.8, -0.6, 0.5, -1.2, 0.3],
        [0.0, 1e-5, 0.0, 0.0, -1e-5],
        [9.0, -7.0, 30.0, 200.0, -5.0],
        [3e4, 3e4, -3e4, 1e5, 1e5],
    ];
    for seed in 1..4 {
        let package = Package::small_with_nothing_added(seed);
        for weights in &poses {
            let [one, four] = [Kernels::Scalar, Kernels::Portable].map(|kernels| Bits::of(&package, kernels, weights));
            assert_eq!(one, four, "{seed} {weights:?}");
        }
    }
}

//! Throw-away.
use sinew_bake::{BakeOptions, FastNodes, bake_bytes_with};
use sinew_formats::package::read_package;
use sinew_runtime::*;
use std::time::Instant;
fn cpu() -> f64 {
    let mut t = [0i64; 2];
    unsafe {
        unsafe extern "C" {
            fn clock_gettime(c: i32, t: *mut i64) -> i32;
        }
        clock_gettime(3, t.as_mut_ptr());
    }
    t[0] as f64 + t[1] as f64 * 1e-9
}
fn median(mut f: impl FnMut(), n: usize) -> (f64, f64) {
    let mut v: Vec<f64> = (0..n)
        .map(|_| {
            let t = cpu();
            f();
            (cpu() - t) * 1e6
        })
        .collect();
    v.sort_by(f64::total_cmp);
    (v[n / 2], v[0])
}
fn main() {
    let path = std::env::args().nth(1).unwrap();
    let compact = read_package(path.as_ref()).unwrap();
    for n in [4u32, 8, 16] {
        let t = Instant::now();
        let baked = bake_bytes_with(
            &compact,
            &BakeOptions {
                fast_nodes: FastNodes::OneIn(n),
            },
        )
        .unwrap();
        let basis = Basis::open(&baked).unwrap();
        println!(
            "V/{n}: N {:?} V {} {:?} bake {:.1}s bytes {}",
            basis.fast_node_count(),
            basis.vertex_count(),
            basis.fast_error().unwrap(),
            t.elapsed().as_secs_f64(),
            baked.len()
        );
        if n == 4 {
            println!("exact only bytes {}", sinew_bake::bake_bytes(&compact).unwrap().len());
            continue;
        }
        let v = basis.vertex_count();
        let k = basis.component_count();
        let mut pos = vec![[0.0f32; 3]; v];
        let mut nor = pos.clone();
        let targets: Vec<Vec<[f32; 3]>> = (0..60)
            .map(|t| {
                (0..v)
                    .map(|i| [(i * 7 + t) as f32 * 1e-4, (i + t) as f32 * 1e-4, 0.1])
                    .collect()
            })
            .collect();
        let mut flat = vec![0.0f32; 3 * v];
        let rest: Vec<f32> = basis.rest_positions().as_flattened().to_vec();
        let w: Vec<f32> = (0..60).map(|t| t as f32 * 0.01).collect();
        let morph = |flat: &mut Vec<f32>| {
            flat.copy_from_slice(&rest);
            for t in 0..60 {
                let ww = w[t];
                for (o, x) in flat.iter_mut().zip(targets[t].as_flattened()) {
                    *o += ww * x;
                }
            }
        };
        let morph2 = |flat: &mut Vec<f32>| {
            let tf: Vec<&[f32]> = targets.iter().map(|t| t.as_flattened()).collect();
            for start in (0..3 * v).step_by(512) {
                let end = (start + 512).min(3 * v);
                let o = &mut flat[start..end];
                o.copy_from_slice(&rest[start..end]);
                for q in (0..60).step_by(4) {
                    let (a, b, c, d) = (
                        &tf[q][start..end],
                        &tf[q + 1][start..end],
                        &tf[q + 2][start..end],
                        &tf[q + 3][start..end],
                    );
                    for i in 0..o.len() {
                        o[i] += w[q] * a[i] + w[q + 1] * b[i] + w[q + 2] * c[i] + w[q + 3] * d[i];
                    }
                }
            }
        };
        for tier in [TierChoice::Exact, TierChoice::Fast] {
            let layout = WorkspaceLayout::for_tier(&basis, tier).unwrap();
            let mut mem = vec![0u8; layout.unaligned_bytes()];
            let mut ws = Workspace::for_tier(&basis, tier, &mut mem, Kernels::detect()).unwrap();
            let mut cm = vec![0.0; k];
            let mut c = Controls::new(&basis, &mut cm).unwrap();
            let mut s = 1.0f32;
            let mut frame = |normals: bool| {
                s = -s;
                for i in 0..k {
                    let r = basis.component(i);
                    c.set(i, if s > 0.0 { 0.3 * r.maximum } else { 0.3 * r.minimum })
                        .unwrap();
                }
                Frame {
                    basis: &basis,
                    controls: &c,
                    positions: &mut pos,
                    normals: if normals { Some(&mut nor) } else { None },
                }
                .run(&mut ws)
                .unwrap();
            };
            let a = median(|| frame(false), 300);
            let b = median(|| frame(true), 300);
            let m = median(|| morph(&mut flat), 100);
            let m2 = median(|| morph2(&mut flat), 100);
            println!(
                "  {tier:?} {:?} ws {} B: no normals {:.0} ({:.0}) with {:.0} ({:.0}) us; morph {:.0} ({:.0}) blocked {:.0} ({:.0})",
                Kernels::detect(),
                layout.size_bytes,
                a.0,
                a.1,
                b.0,
                b.1,
                m.0,
                m.1,
                m2.0,
                m2.1
            );
        }
    }
}

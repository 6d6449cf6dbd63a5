//! One epoch of training in three ways, in one run: the fused kernel, burn's plain tensors, and PyTorch on the CPU
//! (`peers/epoch.py`) with the same network, the same numbers and the same algebra.
//! `cargo bench -p sinew-trainer --bench epoch`; words choose sizes by their names, `quick` takes fewer epochs,
//! `kernel` measures the fused kernel alone.
//!
//! An epoch is the loss and all gradients on the full batch and one step of Adam. The loss of the first epoch must be the
//! same in all three. `SINEW_PYTHON` names a python that has torch (else `python3`); without one that part is skipped,
//! and says so. PyTorch runs on one thread and on all, the better CPU time of both is what it is measured by.

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use cpu_time::ProcessTime;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_trainer::mesh::topology::Topology;
use sinew_trainer::network::loss::LossSettings;
use sinew_trainer::network::weights::StackWeights;
use sinew_trainer::training::data::FixedBatch;
use sinew_trainer::training::fit::{Engine, FitInput, FitProgress, FitSettings, Flow, fit};

/// Ten coarse components, five fine ones under each.
const COMPONENTS: [usize; 2] = [10, 5];
/// Sides of the torus, shapes, epochs that are timed.
const SIZES: [([u32; 2], usize, usize); 4] = [
    ([68, 124], 5, 20),
    ([68, 124], 49, 10),
    ([100, 125], 36, 10),
    ([65, 365], 39, 6),
];
/// Of losses, between engines in single precision.
const SAME: f64 = 1e-3;

/// Seconds an epoch, and the loss before the first.
struct Measured {
    wall: f64,
    cpu: f64,
    loss: f64,
}

/// One network on one mesh.
struct Subject {
    topology: Topology,
    weights: StackWeights,
    shapes: Vec<f32>,
    shape_count: usize,
}

impl Subject {
    fn new([around, along]: [u32; 2], shape_count: usize) -> Self {
        let place = |v: u32| {
            let turn = |n: u32, of: u32| core::f64::consts::TAU * f64::from(n) / f64::from(of);
            let (a, b) = (turn(v % around, around), turn(v / around, along));
            let radius = 3.0 + a.cos();
            [radius * b.cos(), radius * b.sin(), a.sin()]
        };
        let rest: Vec<[f64; 3]> = (0..around * along).map(place).collect();
        let faces: Vec<[u32; 3]> = (0..around * along)
            .flat_map(|v| {
                let (row, column) = (v / around, v % around);
                let at = |row: u32, column: u32| row % along * around + column % around;
                let [a, b] = [v, at(row, column + 1)];
                let [c, d] = [at(row + 1, column + 1), at(row + 1, column)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut numbers =
            |len: usize, reach: f32| -> Vec<f32> { (0..len).map(|_| random.random_range(-reach..reach)).collect() };
        let mut weights = StackWeights::zeros(rest.len(), &COMPONENTS);
        let components = numbers(weights.flat_components().len(), 0.01);
        weights.set_flat_components(&components);
        let convolutions = numbers(weights.flat_convolutions().len(), 0.4);
        weights.set_flat_convolutions(&convolutions);
        Self {
            topology: Topology::new(&faces, &rest),
            shapes: numbers(shape_count * rest.len() * 9, 0.5),
            shape_count,
            weights,
        }
    }

    fn vertex_weights(&self) -> Vec<f32> {
        (0..self.topology.vertex_count)
            .map(|v| 0.75 + 0.5 * (v % 2) as f32)
            .collect()
    }

    fn fit(&self, engine: Engine, epochs: usize) -> Measured {
        let last = (self.topology.vertex_count - 1) as f32;
        // The cost of distances is not what is measured: any will do.
        let distances = |centre: usize| -> Vec<f32> {
            let away = |v: usize| v.abs_diff(centre) as f32 / last;
            (0..self.topology.vertex_count).map(away).collect()
        };
        let input = FitInput {
            topology: &self.topology,
            vertex_weights: &self.vertex_weights(),
            position_modes: &[],
            kept_roots: 0..0,
            distances: &distances,
        };
        let settings = FitSettings {
            steps: epochs + 1,
            rate: Some(1e-3),
            convolution_rate_factor: 1.0,
            final_share: 1.0,
            warm_up: 1,
            keep_supports: false,
            validate_every: epochs + 1,
            patience: 0,
            checkpoint_every: epochs + 1,
            engine,
            loss: LossSettings::paper(),
            ..FitSettings::default()
        };
        let (mut walls, mut cpus, mut loss) = (Vec::new(), Vec::new(), 0.0);
        let mut last = (Instant::now(), ProcessTime::now());
        let mut observe = |progress: &FitProgress| {
            if progress.step == 1 {
                loss = f64::from(progress.loss.sum());
            } else {
                walls.push(last.0.elapsed().as_secs_f64());
                cpus.push(last.1.elapsed().as_secs_f64());
            }
            last = (Instant::now(), ProcessTime::now());
            Flow::Continue
        };
        let batches = &mut FixedBatch::new(self.shapes.clone());
        let start = self.weights.clone();
        fit(&input, start, &settings, batches, &mut |_| f32::NAN, &mut observe, None).expect("a fit of sound numbers");
        Measured {
            wall: median(walls),
            cpu: median(cpus),
            loss,
        }
    }

    /// Writes what the script reads.
    fn write(&self, folder: &Path) {
        let write = |name: &str, numbers: &[f32]| {
            let bytes: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
            std::fs::write(folder.join(name), bytes).expect("a temporary folder");
        };
        let edges = (0..self.topology.vertex_count).flat_map(|v| {
            let ring = self.topology.ring_of(v).iter();
            ring.flat_map(move |&j| [v as u32, j])
        });
        let edges: Vec<u8> = edges.flat_map(u32::to_le_bytes).collect();
        std::fs::write(folder.join("edges.u32"), edges).expect("a temporary folder");
        write("weights.f32", &self.vertex_weights());
        write("shapes.f32", &self.shapes);
        for (l, level) in self.weights.levels.iter().enumerate() {
            let one = StackWeights {
                vertex_count: self.weights.vertex_count,
                levels: vec![level.clone()],
            };
            write(&format!("components-{l}.f32"), &one.flat_components());
            write(&format!("convolutions-{l}.f32"), &one.flat_convolutions());
        }
    }

    /// PyTorch on so many threads, or why there is none.
    fn torch(&self, folder: &Path, epochs: usize, threads: usize) -> Result<Measured, String> {
        let python = std::env::var("SINEW_PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/epoch.py");
        let output = Command::new(&python)
            .arg(script)
            .arg(folder)
            .args([self.shape_count, epochs, threads].map(|n| n.to_string()))
            .output()
            .map_err(|error| format!("{python} does not run: {error}"))?;
        let text = String::from_utf8_lossy(&output.stdout);
        let figures = serde_json::from_str::<serde_json::Value>(&text);
        let number = |name: &str| figures.as_ref().ok().and_then(|figures| figures[name].as_f64());
        match (number("wall"), number("cpu"), number("loss")) {
            (Some(wall), Some(cpu), Some(loss)) => Ok(Measured { wall, cpu, loss }),
            _ => {
                let errors = String::from_utf8_lossy(&output.stderr);
                Err(errors.trim().lines().last().unwrap_or("it says nothing").to_owned())
            }
        }
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let said = |option: &str| words.iter().any(|word| word == option);
    let (quick, kernel_only) = (said("quick"), said("kernel"));
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get());
    println!(
        "seconds an epoch (median), {} + {} components, {threads} threads",
        COMPONENTS[0],
        COMPONENTS[0] * COMPONENTS[1]
    );
    println!(
        "{:<14} {:<26} {:>9} {:>9} {:>12} {:>12}",
        "V/N", "", "wall", "CPU", "wall, times", "CPU, times"
    );
    for (sides, shape_count, epochs) in SIZES {
        let subject = Subject::new(sides, shape_count);
        let name = format!("{}/{shape_count}", subject.topology.vertex_count);
        let is_option = |word: &str| word == "quick" || word == "kernel";
        if !words.iter().all(|word| is_option(word) || name.contains(word.as_str())) {
            continue;
        }
        let epochs = if quick { epochs.div_ceil(3) } else { epochs };
        let kernel = subject.fit(Engine::Kernel, epochs);
        let print = |what: &str, measured: &Measured| {
            println!(
                "{name:<14} {what:<26} {:>9.4} {:>9.4} {:>12.2} {:>12.2}",
                measured.wall,
                measured.cpu,
                measured.wall / kernel.wall,
                measured.cpu / kernel.cpu
            );
            let gap = (measured.loss - kernel.loss).abs() / kernel.loss;
            assert!(
                gap < SAME,
                "{what}: loss {}, the kernel's {}",
                measured.loss,
                kernel.loss
            );
        };
        print("fused kernel", &kernel);
        if kernel_only {
            continue;
        }
        print("burn, plain tensors", &subject.fit(Engine::Tensors, 2));
        let folder = tempfile::tempdir().expect("a temporary folder");
        subject.write(folder.path());
        for threads in [1, threads] {
            match subject.torch(folder.path(), epochs, threads) {
                Ok(measured) => print(&format!("PyTorch, {threads} threads"), &measured),
                Err(reason) => {
                    println!("{name:<14} PyTorch is skipped: {reason}");
                    break;
                }
            }
        }
    }
}

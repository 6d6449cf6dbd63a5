//! Measuring: rounds in which every contender takes its turn, CPU time of the thread, medians and tails.

use core::hint::black_box;
use std::time::Instant;

use cpu_time::ThreadTime;
use sinew_peers::subject::Subject;
use sinew_runtime::{Basis, Controls, Frame, Workspace, WorkspaceLayout};

/// How long to look.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Rounds with warm caches.
    pub warm_rounds: usize,
    /// Rounds with cold ones; none where zero.
    pub cold_rounds: usize,
    /// Whether every contender plays all its warm rounds in a row, as in a show, instead of taking turns.
    pub in_a_row: bool,
}

impl Settings {
    /// Tails need thousands.
    pub const FULL: Self = Self {
        warm_rounds: 2000,
        cold_rounds: 60,
        in_a_row: false,
    };
    /// A tail to be quoted: of frames that follow each other.
    pub const TAIL: Self = Self {
        warm_rounds: 10_000,
        cold_rounds: 0,
        in_a_row: true,
    };
    /// Medians need hundreds.
    pub const QUICK: Self = Self {
        warm_rounds: 200,
        cold_rounds: 20,
        in_a_row: false,
    };
}

/// Who takes part.
pub struct Contender<'c> {
    /// For the table.
    pub name: String,
    /// What its figure is for.
    pub role: Role,
    /// One frame or solve; the argument counts the rounds, so that no two frames are alike.
    pub run: Box<dyn FnMut(usize) + 'c>,
}

/// What the figure of a contender is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Role {
    /// To be read by itself.
    Measured,
    /// Ratios are to the fastest of these.
    Yardstick,
    /// The contender of this name, on inputs full of denormals: its ratio to that one is printed.
    FloodOf(String),
}

/// One table.
pub struct Contest<'a, 'c> {
    /// Who takes part.
    pub contenders: &'a mut [Contender<'c>],
    /// How long.
    pub settings: Settings,
    /// Whether caches are emptied before every turn.
    pub cold: bool,
}

impl Contest<'_, '_> {
    /// Measures and prints.
    pub fn run(self) {
        /// Larger than any cache.
        const FLUSH_WORDS: usize = 12 << 20;
        let rounds = if self.cold {
            self.settings.cold_rounds
        } else {
            self.settings.warm_rounds
        };
        let mut flush = vec![1_u64; if self.cold { FLUSH_WORDS } else { 0 }];
        let mut samples: Vec<Vec<f64>> = vec![Vec::with_capacity(rounds); self.contenders.len()];
        let timed = |contender: &mut Contender<'_>, round: usize| {
            let start = ThreadTime::now();
            (contender.run)(round);
            start.elapsed().as_secs_f64() * 1e6
        };
        let in_a_row = self.settings.in_a_row && !self.cold;
        let turns = if in_a_row {
            for (contender, samples) in self.contenders.iter_mut().zip(&mut samples) {
                samples.extend((0..rounds).map(|round| timed(contender, round)));
            }
            0
        } else {
            rounds
        };
        for round in 0..turns {
            for (contender, samples) in self.contenders.iter_mut().zip(&mut samples) {
                if self.cold {
                    flush.iter_mut().for_each(|word| *word = word.wrapping_mul(3));
                    black_box(&flush);
                } else {
                    // Its data in its caches again, after the others had them.
                    (contender.run)(round + rounds);
                }
                samples.push(timed(contender, round));
            }
        }
        samples
            .iter_mut()
            .for_each(|samples| samples.sort_unstable_by(f64::total_cmp));
        let yardstick = self
            .contenders
            .iter()
            .zip(&samples)
            .filter(|(contender, _)| contender.role == Role::Yardstick)
            .map(|(_, samples)| quantile(samples, 0.5))
            .fold(f64::INFINITY, f64::min);
        let caches = if self.cold { "cold" } else { "warm" };
        let order = if in_a_row { "rounds in a row each" } else { "rounds" };
        println!("{caches} caches, {rounds} {order}, microseconds of CPU");
        println!(
            "{:>44}  {:>8} {:>8} {:>8} {:>8} {:>8}",
            "", "p50", "p99", "max", "p99/p50", "ratio"
        );
        for (contender, samples) in self.contenders.iter().zip(&samples) {
            let [p50, p99, max] = [0.5, 0.99, 1.0].map(|q| quantile(samples, q));
            println!(
                "{:>44}  {p50:8.0} {p99:8.0} {max:8.0} {:8.2} {:8.2}",
                contender.name,
                p99 / p50,
                p50 / yardstick
            );
        }
        let median_of = |name: &str| {
            let place = self.contenders.iter().position(|contender| contender.name == name)?;
            Some(quantile(&samples[place], 0.5))
        };
        for (contender, samples) in self.contenders.iter().zip(&samples) {
            if let Role::FloodOf(name) = &contender.role
                && let Some(ordinary) = median_of(name)
            {
                let ratio = quantile(samples, 0.5) / ordinary;
                println!("{:>44}  x{ratio:.2} of {name}", contender.name);
            }
        }
    }
}

fn quantile(sorted: &[f64], q: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * q).round() as usize]
}

/// Prints how long opening takes.
pub fn opening(subject: &Subject) {
    const TIMES: usize = 9;
    let mut samples: Vec<f64> = (0..TIMES)
        .map(|_| {
            let start = ThreadTime::now();
            black_box(Basis::open(&subject.baked).expect("a sound package"));
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    samples.sort_unstable_by(f64::total_cmp);
    println!("opening: {:.2} ms (median)", quantile(&samples, 0.5));
}

/// Prints frames a second on one thread and on two, each with a workspace of its own on one basis.
pub fn two_threads(subject: &Subject, settings: Settings) {
    let basis = Basis::open(&subject.baked).expect("a sound package");
    let frame_count = settings.warm_rounds.min(500);
    let run = |thread_count: usize| {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 0..thread_count {
                scope.spawn(|| frames(&basis, frame_count));
            }
        });
        (thread_count * frame_count) as f64 / start.elapsed().as_secs_f64()
    };
    let (one, two) = (run(1), run(2));
    println!(
        "exact frames with normals a second: {one:.0} on one thread, {two:.0} on two (x{:.2})",
        two / one
    );
}

fn frames(basis: &Basis<'_>, frame_count: usize) {
    let mut memory = vec![0; WorkspaceLayout::for_basis(basis).unaligned_bytes()];
    let mut workspace = Workspace::new(basis, &mut memory).expect("enough memory");
    let mut weights = vec![0.0; basis.component_count()];
    let mut positions = vec![[0.0; 3]; basis.vertex_count()];
    let mut normals = positions.clone();
    for n in 0..frame_count {
        let pose = Subject::pose(basis.component_count(), basis.component_count(), n);
        let mut controls = Controls::new(basis, &mut weights).expect("a weight a component");
        for (k, &weight) in pose.iter().enumerate() {
            controls.set(k, weight).expect("finite");
        }
        let frame = Frame {
            basis,
            controls: &controls,
            positions: &mut positions,
            normals: Some(&mut normals),
        };
        frame.run(&mut workspace).expect("weights in range");
    }
    black_box(&positions);
}

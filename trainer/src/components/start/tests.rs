//! The closed-form start of a bar that bends and twists.

use super::*;
use crate::config::TrainConfig;
use crate::learn::Silent;
use crate::learn::prepare::Prepared;
use crate::synthesize::{Settings, Subject};

const COUNTS: [usize; 2] = [2, 2];

fn bar() -> (Prepared, Vec<f32>) {
    let settings = Settings {
        frames: 6,
        vertices: 150,
        seed: 5,
    };
    let sequence = Subject::Bar.synthesize(&settings).expect("a bar");
    let config = TrainConfig {
        components: COUNTS.to_vec(),
        ..TrainConfig::default()
    };
    let prepared = Prepared::new(&sequence, &[0, 1, 2, 3, 4, 5], &config, &[], &Silent).expect("a usable bar");
    let mixes = prepared.mixer(&[0, 1, 2, 3, 4], &config.mixes, 1).mixes(0, 60);
    (prepared, mixes)
}

fn rows_of(weights: &StackWeights) -> Vec<Vec<f32>> {
    let width = 9 * weights.vertex_count;
    weights
        .blocks()
        .flat_map(|block| block.components.chunks_exact(width))
        .map(<[f32]>::to_vec)
        .collect()
}

/// Share of the samples' energy in the metric that rows leave at their best weights.
fn missed(embedding: &Embedding<'_>, samples: &[f32], rows: &[Vec<f32>]) -> f64 {
    let energy = |fields: &[f32]| {
        let embedded = embedding.embed(fields);
        embedded
            .col_iter()
            .map(|column| column.iter().map(|x| f64::from(*x).powi(2)).sum::<f64>())
            .sum::<f64>()
    };
    let own = Samples::new(embedding, samples);
    let codes = Reader::new(embedding, rows).codes(&own);
    energy(&own.residuals(rows, codes.as_ref())) / energy(samples)
}

#[test]
fn a_start_misses_little_more_than_the_best_basis_of_its_size_and_keeps_to_its_budget() {
    let (prepared, mixes) = bar();
    let metric = prepared.metric();
    let embedding = Embedding::new(&metric, prepared.position_weight);
    let vertex_count = prepared.rest.len();
    let start = |entry_budget: usize, rounds: usize| {
        rows_of(&closed_form_start(&StartInput {
            embedding: &embedding,
            samples: &mixes,
            claims: &prepared.claims,
            kept: &[],
            component_counts: &COUNTS,
            attention: Attention::Components,
            entry_budget,
            rounds,
        }))
    };
    let best = missed(&embedding, &mixes, &leading_modes(&embedding, &mixes, 6).rows);
    let whole = missed(&embedding, &mixes, &start(usize::MAX, 0));
    assert!(
        whole < 1.02 * best + 1e-4,
        "localising and grouping keep the span: {whole} {best}"
    );
    let budget = 2 * vertex_count;
    let entries = |rows: &[Vec<f32>]| -> usize {
        rows.iter()
            .map(|row| row.chunks(9).filter(|x| x.iter().any(|&x| x != 0.0)).count())
            .sum()
    };
    let cut = start(budget, 0);
    assert!(entries(&cut) <= budget + 1 && entries(&start(budget, 3)) <= budget + 1);
    assert_eq!(cut.len(), 6);
    // At the weights that the cut rows give, fitted rows leave less of the features.
    let samples = Samples::new(&embedding, &mixes);
    let codes = Reader::new(&embedding, &cut).codes(&samples);
    let supports: Vec<Vec<bool>> = cut
        .iter()
        .map(|row| row.chunks(9).map(|x| x.iter().any(|&x| x != 0.0)).collect())
        .collect();
    let mut fitted = cut.clone();
    samples.fit_rows(&mut fitted, codes.as_ref(), &supports, &[false; 6]);
    let left = |rows: &[Vec<f32>]| -> f64 {
        samples
            .residuals(rows, codes.as_ref())
            .iter()
            .map(|x| f64::from(*x).powi(2))
            .sum()
    };
    assert!(left(&fitted) < 0.999 * left(&cut), "{} {}", left(&fitted), left(&cut));
    assert!(entries(&fitted) <= entries(&cut));
}

#[test]
fn a_claimed_part_has_the_first_component_to_itself_and_a_kept_row_stays() {
    let (prepared, mixes) = bar();
    let metric = prepared.metric();
    let embedding = Embedding::new(&metric, prepared.position_weight);
    let vertex_count = prepared.rest.len();
    let painted = |v: usize| v < vertex_count / 3;
    let kept: Vec<f32> = (0..9 * vertex_count)
        .map(|i| if i / 9 > vertex_count / 2 { 0.01 } else { 0.0 })
        .collect();
    let claims = Claims {
        labels: (0..vertex_count).map(|v| painted(v).then_some(0)).collect(),
        count: 2,
    };
    let rows = rows_of(&closed_form_start(&StartInput {
        embedding: &embedding,
        samples: &mixes,
        claims: &claims,
        kept: core::slice::from_ref(&kept),
        component_counts: &[3, 1],
        attention: Attention::Components,
        entry_budget: usize::MAX,
        rounds: 2,
    }));
    let reaches = |row: &[f32]| -> Vec<usize> {
        let places = row.chunks(9).enumerate().filter(|(_, x)| x.iter().any(|&x| x != 0.0));
        places.map(|(v, _)| v).collect()
    };
    assert!(!reaches(&rows[0]).is_empty() && reaches(&rows[0]).iter().all(|&v| painted(v)));
    assert_eq!(rows[1], kept, "not a bit of it changed");
    assert!(
        !reaches(&rows[2]).is_empty(),
        "the free component found something to do"
    );
    assert_eq!(rows.len(), 6);
}

//! Whole frames beside their peers, in one run: `cargo bench -p sinew-runtime --bench frame`, with
//! `--features cholmod,sinew-peers/cholmod` where libsuitesparse-dev is installed.
//!
//! Every contender of a subject takes its turn in every round, so that a slow moment of the machine hits all alike; what is
//! quoted is the median CPU time of one thread, and its ratio to the fastest dense loop over 60 morph targets. Arguments:
//! `quick` for fewer rounds, `tail` for ten thousand in a row, any other word for the subjects whose names hold it. `SINEW_DATA`
//! names a folder of sequences: its horse is then played instead of the creature; `SINEW_PACKAGE` names a trained compact package
//! to play besides.

mod contenders;
mod measure;

use contenders::Contenders;
use measure::{Contest, Settings};
use sinew_formats::package::read_package;
use sinew_interchange::{Choice, read_sequence};
use sinew_peers::subject::{COMPONENTS, Subject};
use sinew_runtime::Kernels;

fn main() {
    let words: Vec<String> = std::env::args().skip(1).filter(|word| !word.starts_with('-')).collect();
    let has = |name: &str| words.iter().any(|word| word == name);
    let settings = match (has("quick"), has("tail")) {
        (true, _) => Settings::QUICK,
        (_, true) => Settings::TAIL,
        _ => Settings::FULL,
    };
    let wanted = |subject: &str| {
        words
            .iter()
            .all(|word| word == "quick" || word == "tail" || subject.contains(word.as_str()))
    };
    println!("kernels of this machine: {:?}", Kernels::detect());
    for (name, make) in subjects() {
        if wanted(&name) {
            play(&make(), settings);
        }
    }
}

type Make = Box<dyn Fn() -> Subject>;

fn subjects() -> Vec<(String, Make)> {
    let mut subjects: Vec<(String, Make)> = Vec::new();
    if let Some(path) = std::env::var_os("SINEW_PACKAGE") {
        subjects.push((
            "trained".into(),
            Box::new(move || {
                let bytes = read_package(path.as_ref()).expect("SINEW_PACKAGE names a package");
                Subject::of_package("trained".into(), bytes)
            }),
        ));
    }
    match std::env::var_os("SINEW_DATA") {
        Some(folder) => subjects.push((
            "horse 8431".into(),
            Box::new(move || {
                let path = std::path::Path::new(&folder).join("horse");
                let read =
                    read_sequence(&path, &Choice::default(), &mut |_, _| {}).expect("SINEW_DATA holds the horse");
                let rest = read.sequence.shapes[0].to_vec();
                Subject::of_mesh("horse".into(), rest, read.sequence.faces)
            }),
        )),
        None => {
            println!("SINEW_DATA is not set: the creature stands in for the horse");
            subjects.push(("creature 8000".into(), Box::new(|| Subject::creature(8000))));
        }
    }
    for vertex_count in [12_500, 24_000, 50_000] {
        subjects.push((
            format!("torus {vertex_count}"),
            Box::new(move || Subject::torus(vertex_count)),
        ));
    }
    subjects
}

fn play(subject: &Subject, settings: Settings) {
    println!(
        "\n{}: {} vertices, {COMPONENTS} made-up components unless trained; compact {:.2} MB, baked {:.2} MB",
        subject.name,
        subject.rest.len(),
        subject.compact.len() as f64 * 1e-6,
        subject.baked.len() as f64 * 1e-6,
    );
    measure::opening(subject);
    Contenders::of(subject, |contenders| {
        for cold in [false, true] {
            if cold && settings.cold_rounds == 0 {
                continue;
            }
            Contest {
                contenders,
                settings,
                cold,
            }
            .run();
        }
    });
    measure::two_threads(subject, settings);
}

//! Which trainings an ablation consists of: groups of variants of one configuration, each with one choice changed.

use serde::{Deserialize, Serialize};

use sinew_trainer::config::{Recipe, TrainConfig};
use sinew_trainer::network::attention::Attention;
use sinew_trainer::training::schedule::Schedule;

/// Steps of every training of a quick ablation; the paper's recipe, whose steps see few shapes, takes ten times as many.
const QUICK_STEPS: usize = 100;
/// Most splits of the fine components.
const SPLITS_MAX: usize = 4;

/// One question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Group {
    /// Attention or equal shares, levels trained together or one after the other
    Attention,
    /// The same number of fine components under few or many coarse ones
    Counts,
    /// The distances d1 and d2 that coarse and fine components are to keep to
    Reach,
    /// λ1, the weight of reconstruction
    Lambda1,
    /// λ2, the weight of sparsity
    Lambda2,
    /// One, two or three levels with as many components
    Levels,
    /// This project's recipe and the paper's
    Recipe,
}

impl Group {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 7] = [
        Self::Attention,
        Self::Counts,
        Self::Reach,
        Self::Lambda1,
        Self::Lambda2,
        Self::Levels,
        Self::Recipe,
    ];

    /// Its headline.
    pub fn title(self) -> &'static str {
        match self {
            Self::Attention => "Attention and joint training",
            Self::Counts => "Coarse and fine components",
            Self::Reach => "Distances d1 and d2",
            Self::Lambda1 => "λ1, the weight of reconstruction",
            Self::Lambda2 => "λ2, the weight of sparsity",
            Self::Levels => "Levels",
            Self::Recipe => "Recipes",
        }
    }

    /// What its rows differ in.
    pub fn words(self) -> &'static str {
        match self {
            Self::Attention => {
                "Without attention every fine block sees an equal share of what the coarse level leaves, wherever that is. \
                 Trained separately, the coarse level learns first and is then frozen."
            }
            Self::Counts => "So many coarse components times so many fine ones under each.",
            Self::Reach => {
                "Shares of the longest distance on the mesh beyond which coarse (d1) and fine (d2) components cost. A closed-form \
                 start cuts coarse components at d1."
            }
            Self::Lambda1 => "Relative to sparsity and range; all reconstruction terms together.",
            Self::Lambda2 => "0 leaves sparsity to the start and to what is cut at the end.",
            Self::Levels => "As many components in one, two and three levels, as nearly as the tree allows.",
            Self::Recipe => {
                "local: closed-form start, mixes of the training shapes, a loss on what is finally seen. paper: random start, the \
                 shapes themselves, every block for itself."
            }
        }
    }
}

/// One training.
#[derive(Debug, Clone, PartialEq)]
pub struct Variant {
    /// The question it answers.
    pub group: Group,
    /// What is special about it.
    pub name: String,
    /// Where it stands: λ on its curve, (d1, d2) in the grid, nothing elsewhere.
    pub place: Vec<f64>,
    /// How it trains.
    pub config: TrainConfig,
}

/// What the variants of a plan are variants of: a quick plan trains shorter.
pub fn base(config: &TrainConfig, quick: bool) -> TrainConfig {
    let mut base = config.clone();
    if quick {
        shorten(&mut base, QUICK_STEPS);
    }
    base
}

/// The trainings of some groups around [`base`], in the order of the groups. A quick plan has fewer of them.
pub fn variants(groups: &[Group], base: &TrainConfig, quick: bool) -> Vec<Variant> {
    let mut plan = Vec::new();
    for &group in groups {
        let mut push = |name: String, place: Vec<f64>, config: TrainConfig| {
            plan.push(Variant {
                group,
                name,
                place,
                config,
            });
        };
        match group {
            Group::Attention => {
                for (attention, of_attention) in
                    [(Attention::Components, "attention"), (Attention::Equal, "equal shares")]
                {
                    for (schedule, of_schedule) in [(Schedule::Joint, "joint"), (Schedule::LevelByLevel, "separate")] {
                        let mut config = base.clone();
                        config.fit.attention = attention;
                        config.fit.schedule = schedule;
                        push(format!("{of_attention}, {of_schedule}"), Vec::new(), config);
                    }
                }
            }
            Group::Counts => {
                for counts in splits(&base.components, if quick { 2 } else { SPLITS_MAX }) {
                    let name = format!("{} × {}", counts[0], counts[1]);
                    push(name, Vec::new(), with_components(base, counts));
                }
            }
            Group::Reach => {
                let (coarse, fine): (&[f32], &[f32]) = if quick {
                    (&[0.2, 0.4], &[0.1, 0.2])
                } else {
                    (&[0.2, 0.4, 0.6], &[0.1, 0.2, 0.4])
                };
                for &d1 in coarse {
                    for &d2 in fine {
                        let mut config = base.clone();
                        config.fit.loss.sparsity_distances = vec![d1, d2];
                        push(format!("d1 {d1}, d2 {d2}"), vec![shortest(d1), shortest(d2)], config);
                    }
                }
            }
            Group::Lambda1 => {
                let factors: &[f64] = if quick {
                    &[0.1, 1.0, 10.0]
                } else {
                    &[0.1, 0.3, 1.0, 3.0, 10.0]
                };
                for factor in factors {
                    let mut config = base.clone();
                    let weight = scaled(base.fit.loss.reconstruction_weight, *factor);
                    config.fit.loss.reconstruction_weight = weight;
                    push(format!("λ1 {weight}"), vec![shortest(weight)], config);
                }
            }
            Group::Lambda2 => {
                let factors: &[f64] = if quick {
                    &[0.0, 1.0, 10.0]
                } else {
                    &[0.0, 0.1, 1.0, 10.0, 100.0]
                };
                // A base without sparsity is varied around the paper's weight.
                let middle = match base.fit.loss.sparsity_weight {
                    0.0 => 1.0,
                    weight => weight,
                };
                for factor in factors {
                    let mut config = base.clone();
                    let weight = scaled(middle, *factor);
                    config.fit.loss.sparsity_weight = weight;
                    push(format!("λ2 {weight}"), vec![shortest(weight)], config);
                }
            }
            Group::Levels => {
                for counts in [
                    vec![base.component_count()],
                    base.components.clone(),
                    three_levels(base.component_count()),
                ] {
                    let name = counts.iter().map(usize::to_string).collect::<Vec<_>>().join(" × ");
                    push(name, Vec::new(), with_components(base, counts));
                }
            }
            Group::Recipe => {
                for (recipe, name, times) in [(Recipe::Local, "local", 1), (Recipe::Paper, "paper", 10)] {
                    let mut config = recipe.config();
                    config.components.clone_from(&base.components);
                    config.seed = base.seed;
                    if quick {
                        shorten(&mut config, QUICK_STEPS * times);
                    }
                    push(name.to_owned(), Vec::new(), config);
                }
            }
        }
    }
    plan
}

fn shorten(config: &mut TrainConfig, steps: usize) {
    config.fit.steps = config.fit.steps.min(steps);
    config.validation.start_seeds = 1;
}

fn with_components(base: &TrainConfig, components: Vec<usize>) -> TrainConfig {
    TrainConfig {
        components,
        ..base.clone()
    }
}

/// The number that prints as `x` does: 0.2 and not 0.20000000298.
fn shortest(x: f32) -> f64 {
    format!("{x}").parse().unwrap_or_else(|_| f64::from(x))
}

/// `x` times a factor as people would multiply: ten times 0.02 is 0.2.
fn scaled(x: f32, factor: f64) -> f32 {
    let product = shortest(x) * factor;
    format!("{product:.6e}").parse().unwrap_or(product as f32)
}

/// Ways to write the fine components of two levels as a product, at least two of each: up to `most`, spread evenly. The paper's 50
/// gives its own 2 × 25, 5 × 10, 10 × 5 and 25 × 2.
fn splits(components: &[usize], most: usize) -> Vec<Vec<usize>> {
    let fine = match components {
        [one] => *one,
        [coarse, fine, ..] => coarse * fine,
        [] => 1,
    };
    let all: Vec<Vec<usize>> = (2..=fine / 2)
        .filter(|coarse| fine % coarse == 0)
        .map(|coarse| vec![coarse, fine / coarse])
        .collect();
    let count = most.min(all.len());
    (0..count)
        .map(|i| all[i * (all.len() - 1) / (count - 1).max(1)].clone())
        .collect()
}

/// The tree of three levels, as many branches everywhere as can be, that comes nearest to `budget` without passing it.
fn three_levels(budget: usize) -> Vec<usize> {
    let mut best = (usize::MAX, usize::MAX, vec![1, 1, 1]);
    for coarse in 1..=budget {
        for middle in 1..=budget / coarse {
            let above = coarse * (1 + middle);
            let fine = budget.saturating_sub(above) / (coarse * middle);
            if fine == 0 {
                continue;
            }
            let unused = budget - above - coarse * middle * fine;
            let narrowest = coarse.min(middle).min(fine);
            let spread = coarse.max(middle).max(fine) - narrowest;
            // A level with one branch is no level.
            let rank = (if narrowest < 2 { budget } else { 0 } + unused, spread);
            if rank < (best.0, best.1) {
                best = (rank.0, rank.1, vec![coarse, middle, fine]);
            }
        }
    }
    best.2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_plan_is_the_papers() {
        let base = base(&TrainConfig::default(), false);
        let plan = variants(&Group::ALL, &base, false);
        let names = |group| -> Vec<&str> {
            let of_group = plan.iter().filter(|variant| variant.group == group);
            of_group.map(|variant| variant.name.as_str()).collect()
        };
        assert_eq!(names(Group::Counts), ["2 × 25", "5 × 10", "10 × 5", "25 × 2"]);
        assert_eq!(names(Group::Levels), ["60", "10 × 5", "4 × 2 × 6"]);
        assert_eq!(names(Group::Reach).len(), 9);
        assert_eq!(names(Group::Lambda1), ["λ1 1", "λ1 3", "λ1 10", "λ1 30", "λ1 100"]);
        assert_eq!(names(Group::Lambda2), ["λ2 0", "λ2 0.002", "λ2 0.02", "λ2 0.2", "λ2 2"]);
        for group in Group::ALL {
            let bases = plan
                .iter()
                .filter(|variant| variant.group == group && variant.config == base);
            assert_eq!(bases.count(), 1, "{group:?}: one row is the base");
        }
        for variant in plan {
            assert!(variant.config.check().is_ok(), "{}", variant.name);
        }
    }

    #[test]
    fn small_budgets_have_plans_too() {
        for components in [vec![1], vec![3], vec![3, 2], vec![2, 2, 2]] {
            let base = TrainConfig {
                components,
                ..TrainConfig::default()
            };
            for variant in variants(&Group::ALL, &super::base(&base, true), true) {
                assert!(variant.config.check().is_ok(), "{:?}", variant.config.components);
            }
        }
        assert_eq!(three_levels(14), [2, 2, 2]);
    }
}

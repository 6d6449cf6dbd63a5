//! Configurations are read, refused and written as they say.

use super::*;

#[test]
fn recipes_are_configurations_and_files_change_only_what_they_name() {
    for recipe in [Recipe::Local, Recipe::Paper] {
        let config = recipe.config();
        assert_eq!(TrainConfig::from_toml(&config.to_toml()).ok(), Some(config.clone()));
        let changed = config
            .with_toml("seed = 4\n[fit.loss]\nsparsity_distances = [0.3]\n")
            .unwrap();
        let mut expected = config;
        expected.seed = 4;
        expected.fit.loss.sparsity_distances = vec![0.3];
        assert_eq!(changed, expected);
    }
    let error = Recipe::Paper.config().with_toml("[fit]\nspeed = 3\n").unwrap_err();
    assert!(error.to_string().contains("speed"), "{error}");
}

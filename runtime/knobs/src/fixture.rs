//! What the unit tests share: small baked packages with a tree of components, and repeatable noise.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sinew_formats::package::{AlignedBytes, fixture, write_baked};
use sinew_runtime::Basis;

/// A baked package in memory.
pub(crate) struct Package {
    bytes: AlignedBytes,
}

impl Package {
    /// Components of every small package.
    pub(crate) const COMPONENTS: usize = 5;

    /// Two coarse components; `c0` has the child `c2`, `c1` the children `c3` and `c4`. Another seed is another identity.
    pub(crate) fn small(seed: u8) -> Self {
        Self::named(seed, ["c0", "c1", "c2", "c3", "c4"])
    }

    /// What a second training might give: another identity, the names in another order, `c0` gone.
    pub(crate) fn retrained(seed: u8) -> Self {
        Self::named(seed, ["c3", "c4", "new", "c1", "c2"])
    }

    fn named(seed: u8, names: [&'static str; Self::COMPONENTS]) -> Self {
        let mut baked = fixture::tiny_baked();
        baked.compact_id = [seed; 16];
        // The last block gets a second component, which moves nothing: knobs turn weights, not vertices.
        baked.blocks[2].component_count = 2;
        baked.components.push(baked.components[3]);
        (baked.after, baked.prior) = Default::default();
        for (k, (component, name)) in baked.components.iter_mut().zip(names).enumerate() {
            component.name = name;
            (component.minimum, component.maximum) = (-1.0 - k as f32, 1.5);
        }
        let bytes = write_baked(&baked.basis()).expect("the fixture obeys the rules");
        Self { bytes }
    }
}

/// The fixture's bytes as the runtime sees them.
pub(crate) fn open(package: &Package) -> Basis<'_> {
    Basis::open(&package.bytes).expect("a baked package")
}

/// Repeatable numbers in [-1, 1).
pub(crate) struct Noise(ChaCha8Rng);

impl Noise {
    pub(crate) fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub(crate) fn next(&mut self) -> f32 {
        self.0.random_range(-1.0..1.0)
    }
}

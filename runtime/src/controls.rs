//! Controls: the K weights a performer moves, kept in the caller's memory, always finite.

use crate::basis::Basis;
use crate::error::ControlError;

/// One weight a component, 0 at rest. The weights live in the caller's slice.
#[derive(Debug)]
pub struct Controls<'c> {
    basis: &'c Basis<'c>,
    weights: &'c mut [f32],
}

impl<'c> Controls<'c> {
    /// Takes `weights` as memory and sets all to rest. Shape: `[K]`.
    ///
    /// # Errors
    /// [`ControlError::WrongLength`].
    pub fn new(basis: &'c Basis<'c>, weights: &'c mut [f32]) -> Result<Self, ControlError> {
        let expected = basis.component_count();
        if weights.len() != expected {
            return Err(ControlError::WrongLength {
                expected,
                actual: weights.len(),
            });
        }
        weights.fill(0.0);
        Ok(Self { basis, weights })
    }

    /// Takes `weights` as they stand, for memory that outlived the controls in it. Shape: `[K]`.
    ///
    /// # Errors
    /// [`ControlError::WrongLength`]; [`ControlError::NotFinite`] for the first weight that is no number, and then none is
    /// changed.
    pub fn resume(basis: &'c Basis<'c>, weights: &'c mut [f32]) -> Result<Self, ControlError> {
        let (expected, actual) = (basis.component_count(), weights.len());
        if actual != expected {
            return Err(ControlError::WrongLength { expected, actual });
        }
        match weights.iter().position(|w| !w.is_finite()) {
            Some(component) => Err(ControlError::NotFinite { component }),
            None => Ok(Self { basis, weights }),
        }
    }

    /// Sets a control, clamped into its component's range; returns the weight it took.
    ///
    /// # Errors
    /// [`ControlError::NoSuchComponent`]; [`ControlError::NotFinite`] for NaN and infinities (an infinite knob is a fault, not
    /// a wish for the stop). The weight then stays as it was.
    pub fn set(&mut self, component: usize, weight: f32) -> Result<f32, ControlError> {
        self.check(component, weight)?;
        let range = self.basis.component(component);
        let taken = weight.clamp(range.minimum, range.maximum);
        self.weights[component] = taken;
        Ok(taken)
    }

    /// Sets a control by the share of its way from the lower stop, 0, to the upper one, 1, clamped to them: what a knob or a
    /// slider says. Returns the weight it took.
    ///
    /// # Errors
    /// Those of [`Controls::set`].
    pub fn set_share(&mut self, component: usize, share: f32) -> Result<f32, ControlError> {
        self.check(component, share)?;
        let range = self.basis.component(component);
        self.set(component, at_share(range.minimum, range.maximum, share))
    }

    /// Sets a control beyond its stops: for fitting, which may leave the range seen in training.
    ///
    /// # Errors
    /// Those of [`Controls::set`].
    pub fn set_unclamped(&mut self, component: usize, weight: f32) -> Result<(), ControlError> {
        self.check(component, weight)?;
        self.weights[component] = weight;
        Ok(())
    }

    /// All controls to rest.
    pub fn reset(&mut self) {
        self.weights.fill(0.0);
    }

    /// The weights. Shape: `[K]`, finite.
    pub fn weights(&self) -> &[f32] {
        self.weights
    }

    /// The basis these controls belong to.
    pub fn basis(&self) -> &Basis<'c> {
        self.basis
    }

    fn check(&self, component: usize, weight: f32) -> Result<(), ControlError> {
        let component_count = self.weights.len();
        if component >= component_count {
            return Err(ControlError::NoSuchComponent {
                component,
                component_count,
            });
        }
        if !weight.is_finite() {
            return Err(ControlError::NotFinite { component });
        }
        Ok(())
    }
}

/// The weight at a share of the way between two stops; at 1 and beyond it is the upper one, which the sum may miss by a rounding.
fn at_share(minimum: f32, maximum: f32, share: f32) -> f32 {
    if share >= 1.0 {
        maximum
    } else {
        minimum + share * (maximum - minimum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{Package, open};

    #[test]
    fn controls_start_at_rest_and_return_there() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = [f32::NAN; Package::COMPONENTS];
        let mut controls = Controls::new(&basis, &mut memory).unwrap();
        assert_eq!(controls.weights(), [0.0; Package::COMPONENTS]);
        controls.set_unclamped(2, 7.0).unwrap();
        controls.reset();
        assert_eq!(controls.weights(), [0.0; Package::COMPONENTS]);
        assert_eq!(controls.basis().id(), basis.id());
    }

    #[test]
    fn resumed_controls_stand_where_they_were_left() {
        let package = Package::small(1);
        let basis = open(&package);
        let mut memory = [f32::NAN; Package::COMPONENTS];
        Controls::new(&basis, &mut memory)
            .unwrap()
            .set_unclamped(2, 7.0)
            .unwrap();
        assert_eq!(
            Controls::resume(&basis, &mut memory).unwrap().weights(),
            [0.0, 0.0, 7.0, 0.0, 0.0]
        );
        memory[3] = f32::INFINITY;
        assert_eq!(
            Controls::resume(&basis, &mut memory).unwrap_err(),
            ControlError::NotFinite { component: 3 }
        );
        let (expected, actual) = (Package::COMPONENTS, Package::COMPONENTS - 1);
        assert_eq!(
            Controls::resume(&basis, &mut memory[1..]).unwrap_err(),
            ControlError::WrongLength { expected, actual }
        );
    }

    #[test]
    fn set_clamps_and_says_what_it_took() {
        let package = Package::small(1);
        let basis = open(&package);
        let (minimum, maximum) = (basis.component(1).minimum, basis.component(1).maximum);
        let mut memory = [0.0; Package::COMPONENTS];
        let mut controls = Controls::new(&basis, &mut memory).unwrap();
        assert_eq!(controls.set(1, 1e9), Ok(maximum));
        assert_eq!(controls.set(1, -1e9), Ok(minimum));
        assert_eq!(controls.set(1, 0.5 * maximum), Ok(0.5 * maximum));
        assert_eq!(controls.set_unclamped(1, 2.0 * maximum), Ok(()));
        assert_eq!(controls.weights()[1], 2.0 * maximum);
        assert_eq!(controls.set_share(1, 0.0), Ok(minimum));
        assert_eq!(controls.set_share(1, 0.25), Ok(minimum + 0.25 * (maximum - minimum)));
        assert_eq!(controls.set_share(1, 1.5), Ok(maximum));
    }

    #[test]
    fn validity() {
        let package = Package::small(1);
        let basis = open(&package);
        let count = Package::COMPONENTS;
        let mut memory = [0.0; Package::COMPONENTS + 1];
        let refused = Controls::new(&basis, &mut memory).unwrap_err();
        assert_eq!(
            refused,
            ControlError::WrongLength {
                expected: count,
                actual: count + 1
            }
        );

        let mut controls = Controls::new(&basis, &mut memory[..count]).unwrap();
        controls.set(0, 0.25).unwrap();
        let missing = ControlError::NoSuchComponent {
            component: count,
            component_count: count,
        };
        assert_eq!(controls.set(count, 0.0), Err(missing));
        assert_eq!(controls.set_share(count, 0.0), Err(missing));
        assert_eq!(controls.set_unclamped(count, 0.0), Err(missing));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(controls.set(0, bad), Err(ControlError::NotFinite { component: 0 }));
            assert_eq!(
                controls.set_share(0, bad),
                Err(ControlError::NotFinite { component: 0 })
            );
            assert_eq!(
                controls.set_unclamped(0, bad),
                Err(ControlError::NotFinite { component: 0 })
            );
        }
        assert_eq!(controls.weights()[0], 0.25);
    }

    #[test]
    fn the_whole_way_ends_at_the_stop_where_the_sum_misses_it() {
        let (minimum, maximum) = (-1.49_f32, 1.35_f32);
        assert_ne!(minimum + (maximum - minimum), maximum);
        assert_eq!(at_share(minimum, maximum, 1.0), maximum);
        assert_eq!(at_share(minimum, maximum, 0.0), minimum);
    }
}

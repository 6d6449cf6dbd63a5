//! Weights that people ask for past the knobs, by a page or a typed line: the control goes there, quickly, but it goes, and no faster
//! than its slew limit. Whoever moves it meanwhile has it.

use sinew_knobs::FRAME_US_MAX;
use sinew_runtime::Controls;

/// Time from one end of a control to the other, s: a slider follows the hand, and a click beside its thumb is no jump.
const WHOLE_WAY_S: f32 = 0.2;

/// Where controls are on their way to.
#[derive(Debug)]
pub struct Follow {
    /// NaN for a control that nobody has asked for. Shape: `[K]`.
    goals: Vec<f32>,
    /// The weight that was left there; another one is somebody else's. Shape: `[K]`.
    left: Vec<f32>,
    now_us: Option<u64>,
}

impl Follow {
    /// Nothing asked for.
    pub fn new(component_count: usize) -> Self {
        Self {
            goals: vec![f32::NAN; component_count],
            left: vec![f32::NAN; component_count],
            now_us: None,
        }
    }

    /// Wants a control at a weight. One that the basis does not know, or that is no number, is left alone.
    pub fn ask(&mut self, control: u16, weight: f32, controls: &Controls<'_>) {
        let control = usize::from(control);
        if let (Some(goal), true) = (self.goals.get_mut(control), weight.is_finite()) {
            let component = controls.basis().component(control);
            *goal = weight.clamp(component.minimum, component.maximum);
            self.left[control] = controls.weights()[control];
        }
    }

    /// Forgets every wish, as when everything stops.
    pub fn forget(&mut self) {
        self.goals.fill(f32::NAN);
    }

    /// Moves the controls on to `now_us`; `slew` is the limit of a control, a second, and `moved` gets each weight that was set.
    pub fn advance(
        &mut self,
        now_us: u64,
        controls: &mut Controls<'_>,
        slew: impl Fn(usize) -> f32,
        mut moved: impl FnMut(u16, f32),
    ) {
        let before_us = self.now_us.replace(now_us).unwrap_or(now_us);
        let dt_s = now_us.saturating_sub(before_us).min(FRAME_US_MAX) as f32 * 1e-6;
        for control in 0..self.goals.len() {
            let goal = self.goals[control];
            let weight = controls.weights()[control];
            if goal.is_nan() {
                continue;
            }
            if weight != self.left[control] || weight == goal {
                self.goals[control] = f32::NAN;
                continue;
            }
            let component = controls.basis().component(control);
            let fastest = slew(control).min((component.maximum - component.minimum) / WHOLE_WAY_S);
            let step = (fastest * dt_s).min((goal - weight).abs());
            let next = if step == (goal - weight).abs() {
                goal
            } else {
                weight + step.copysign(goal - weight)
            };
            if step > 0.0
                && let Ok(taken) = controls.set(control, next)
            {
                self.left[control] = taken;
                moved(control as u16, taken);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use sinew_runtime::Basis;

    use super::*;
    use crate::demo;

    const FRAME_US: u64 = 16_667;

    #[test]
    fn a_click_beside_a_slider_is_no_jump_and_arrives() {
        let bytes = demo::package().unwrap();
        let basis = Basis::open(&bytes).unwrap();
        let mut weights = vec![0.0; basis.component_count()];
        let mut controls = Controls::new(&basis, &mut weights).unwrap();
        let mut follow = Follow::new(basis.component_count());
        let range = basis.component(0).maximum - basis.component(0).minimum;
        let mut now_us = 0;
        for (slew, frames) in [(f32::INFINITY, 14), (1.0, 400)] {
            let mut before = controls.weights()[0];
            let goal = if before == 0.0 { 9.0 } else { -9.0 };
            follow.ask(0, goal, &controls);
            let fastest = slew.min(range / WHOLE_WAY_S) * FRAME_US as f32 * 1e-6;
            for frame in 0..frames {
                let mut told = None;
                now_us += FRAME_US;
                follow.advance(now_us, &mut controls, |_| slew, |_, taken| told = Some(taken));
                let weight = controls.weights()[0];
                assert!(
                    (weight - before).abs() <= fastest * 1.001,
                    "frame {frame}: {before} to {weight}"
                );
                assert!(told.is_none_or(|told| told == weight));
                before = weight;
            }
            let end = if goal > 0.0 {
                basis.component(0).maximum
            } else {
                basis.component(0).minimum
            };
            assert_eq!(before, end, "clamped to its range");
        }
    }

    #[test]
    fn whoever_moves_a_control_meanwhile_has_it() {
        let bytes = demo::package().unwrap();
        let basis = Basis::open(&bytes).unwrap();
        let mut weights = vec![0.0; basis.component_count()];
        let mut controls = Controls::new(&basis, &mut weights).unwrap();
        let mut follow = Follow::new(basis.component_count());
        follow.ask(1, 1.0, &controls);
        follow.ask(999, 1.0, &controls);
        follow.ask(2, f32::NAN, &controls);
        for frame in 0..30 {
            if frame == 3 {
                controls.set(1, -0.5).unwrap();
            }
            follow.advance(frame * FRAME_US, &mut controls, |_| f32::INFINITY, |_, _| ());
        }
        assert_eq!(controls.weights()[1], -0.5);
        follow.ask(1, 1.0, &controls);
        follow.forget();
        follow.advance(31 * FRAME_US, &mut controls, |_| f32::INFINITY, |_, _| ());
        assert_eq!(controls.weights()[1], -0.5);
    }
}

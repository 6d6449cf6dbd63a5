//! From where a knob stands to a weight: detent, direction, curve, range. One strictly monotone function and its inverse;
//! the inverse tells takeover where a knob would have to stand for the weight that a control has.

use libm::{fabsf, logf, powf};

/// Shape of the way from one end to the other. Each runs through (0, 0) and (1, 1); about a centre, each half has it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Curve {
    /// Equal turns, equal moves.
    #[default]
    Linear,
    /// Fine at the start, coarse at the end: the slope grows by `ratio` from end to end. Range: `(1, 1000]`.
    Exponential {
        /// Slope at the end over slope at the start.
        ratio: f32,
    },
    /// Coarse at the start, fine at the end: the inverse of the exponential. Range: `(1, 1000]`.
    Logarithmic {
        /// Slope at the start over slope at the end.
        ratio: f32,
    },
    /// Fine at both ends; `steepness` is the slope in the middle. Range: `[1, 8]`.
    SCurve {
        /// Slope in the middle.
        steepness: f32,
    },
}

impl Curve {
    /// Whether its number is in range.
    pub fn is_valid(&self) -> bool {
        match *self {
            Self::Linear => true,
            Self::Exponential { ratio } | Self::Logarithmic { ratio } => ratio > 1.0 && ratio <= 1000.0,
            Self::SCurve { steepness } => (1.0..=8.0).contains(&steepness),
        }
    }

    /// Value at `x`. Range: both `[0, 1]`.
    pub fn value(&self, x: f32) -> f32 {
        let y = match *self {
            Self::Linear => x,
            Self::Exponential { ratio } => exponential(ratio, x),
            Self::Logarithmic { ratio } => logarithmic(ratio, x),
            Self::SCurve { steepness } => sigmoid(steepness, x),
        };
        y.clamp(0.0, 1.0)
    }

    /// The `x` whose value is `y`. Range: both `[0, 1]`.
    pub fn inverse(&self, y: f32) -> f32 {
        let x = match *self {
            Self::Linear => y,
            Self::Exponential { ratio } => logarithmic(ratio, y),
            Self::Logarithmic { ratio } => exponential(ratio, y),
            Self::SCurve { steepness } => sigmoid(1.0 / steepness, y),
        };
        x.clamp(0.0, 1.0)
    }
}

fn exponential(ratio: f32, x: f32) -> f32 {
    (powf(ratio, x) - 1.0) / (ratio - 1.0)
}

fn logarithmic(ratio: f32, y: f32) -> f32 {
    logf(1.0 + y * (ratio - 1.0)) / logf(ratio)
}

fn sigmoid(steepness: f32, x: f32) -> f32 {
    let (up, down) = (powf(x, steepness), powf(1.0 - x, steepness));
    up / (up + down)
}

/// How a control answers its knob. The default: the whole range of the component, linear, rest in the middle of the knob if
/// the component moves both ways.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Response {
    /// Weight at the lower end; `None`: the component's minimum. A number tighter than the component's, never wider.
    pub minimum: Option<f32>,
    /// Weight at the upper end; `None`: the component's maximum.
    pub maximum: Option<f32>,
    /// Clockwise lowers.
    pub inverted: bool,
    /// Where rest (weight 0) stands on the knob.
    pub centre: Centre,
    /// Shape.
    pub curve: Curve,
    /// Fastest change, weight a second; `None`: as fast as the hand. Range: greater than 0.
    pub slew: Option<f32>,
}

/// Where rest stands on the knob.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Centre {
    /// The range is spread evenly; rest stands where it falls.
    Even,
    /// Rest stands in the middle, and this share of the travel around it is rest exactly. A component that moves one way
    /// only is spread evenly all the same. Range: `[0, 0.5]`.
    Rest {
        /// Share of the travel that is rest.
        detent: f32,
    },
}

impl Default for Centre {
    fn default() -> Self {
        Self::Rest { detent: 0.03 }
    }
}

/// A response with the range of its component filled in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResolvedResponse {
    /// Weight at position 0.
    pub minimum: f32,
    /// Weight at position 1; greater than `minimum`.
    pub maximum: f32,
    inverted: bool,
    /// Detent's share of the travel; `None`: spread evenly.
    detent: Option<f32>,
    curve: Curve,
    /// Fastest change, weight a second; infinite if there is no limit.
    pub slew: f32,
}

/// What is wrong with a response.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ResponseFault {
    /// The limits are not finite, not in order, or wider than the component's.
    Limits,
    /// The number of the curve is out of range.
    Curve,
    /// The detent is out of range.
    Detent,
    /// The slew limit is not a number greater than 0.
    Slew,
}

impl core::fmt::Display for ResponseFault {
    fn fmt(&self, out: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        out.write_str(match self {
            Self::Limits => "the limits must be in order and within the component's",
            Self::Curve => "the curve's number is out of range (ratio over 1 to 1000, steepness 1 to 8)",
            Self::Detent => "the detent must be a share of the travel from 0 to 0.5",
            Self::Slew => "the slew limit must be greater than 0",
        })
    }
}

impl Response {
    /// Fills in the range of a component.
    ///
    /// # Errors
    /// The first [`ResponseFault`] found.
    pub fn resolve(&self, component_minimum: f32, component_maximum: f32) -> Result<ResolvedResponse, ResponseFault> {
        let minimum = self.minimum.unwrap_or(component_minimum);
        let maximum = self.maximum.unwrap_or(component_maximum);
        let inside = minimum >= component_minimum && maximum <= component_maximum;
        // A component without a range is legal in a package: its knob moves nothing.
        let ordered = minimum < maximum || (minimum == maximum && component_minimum == component_maximum);
        if !(inside && ordered) {
            return Err(ResponseFault::Limits);
        }
        if !self.curve.is_valid() {
            return Err(ResponseFault::Curve);
        }
        let detent = match self.centre {
            Centre::Even => None,
            Centre::Rest { detent } if !(0.0..=0.5).contains(&detent) => return Err(ResponseFault::Detent),
            Centre::Rest { detent } => (minimum < 0.0 && maximum > 0.0).then_some(detent),
        };
        let slew = self.slew.unwrap_or(f32::INFINITY);
        if slew.is_nan() || slew <= 0.0 {
            return Err(ResponseFault::Slew);
        }
        Ok(ResolvedResponse {
            minimum,
            maximum,
            inverted: self.inverted,
            detent,
            curve: self.curve,
            slew,
        })
    }
}

impl ResolvedResponse {
    /// Whether clockwise lowers.
    pub fn is_inverted(&self) -> bool {
        self.inverted
    }

    /// Where the control's own scale stands when its knob stands at `position`: direction and detent. Range: both `[0, 1]`.
    pub fn place(&self, position: f32) -> f32 {
        let x = if self.inverted { 1.0 - position } else { position };
        let Some(detent) = self.detent else { return x };
        let (half_zone, off) = (0.5 * detent, x - 0.5);
        if fabsf(off) <= half_zone {
            0.5
        } else {
            let way = (fabsf(off) - half_zone) / (0.5 - half_zone) * 0.5;
            (if off < 0.0 { 0.5 - way } else { 0.5 + way }).clamp(0.0, 1.0)
        }
    }

    /// Weight at a place. Within `[minimum, maximum]`, both reached exactly; exactly 0 in the centre.
    pub fn weight(&self, place: f32) -> f32 {
        if self.detent.is_none() {
            let y = self.curve.value(place);
            return if y >= 1.0 {
                self.maximum
            } else {
                (self.minimum + (self.maximum - self.minimum) * y).clamp(self.minimum, self.maximum)
            };
        }
        let way = self.curve.value(fabsf(2.0 * place - 1.0));
        if place < 0.5 {
            self.minimum * way
        } else {
            self.maximum * way
        }
    }

    /// The place whose weight is `weight`; the nearer end if none is.
    pub fn place_of(&self, weight: f32) -> f32 {
        let weight = weight.clamp(self.minimum, self.maximum);
        if self.detent.is_none() {
            let range = self.maximum - self.minimum;
            let y = if range > 0.0 {
                (weight - self.minimum) / range
            } else {
                0.0
            };
            return self.curve.inverse(y.clamp(0.0, 1.0));
        }
        if weight < 0.0 {
            0.5 - 0.5 * self.curve.inverse((weight / self.minimum).clamp(0.0, 1.0))
        } else {
            0.5 + 0.5 * self.curve.inverse((weight / self.maximum).clamp(0.0, 1.0))
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec::Vec;

    use super::*;

    const CURVES: [Curve; 8] = [
        Curve::Linear,
        Curve::Exponential { ratio: 1.01 },
        Curve::Exponential { ratio: 10.0 },
        Curve::Exponential { ratio: 1000.0 },
        Curve::Logarithmic { ratio: 10.0 },
        Curve::SCurve { steepness: 1.0 },
        Curve::SCurve { steepness: 3.0 },
        Curve::SCurve { steepness: 8.0 },
    ];

    fn responses() -> Vec<ResolvedResponse> {
        let mut all = Vec::new();
        for curve in CURVES {
            for centre in [Centre::Even, Centre::Rest { detent: 0.0 }, Centre::default()] {
                for inverted in [false, true] {
                    for (low, high) in [(-1.0, 1.5), (0.0, 2.0), (-0.3, 0.0)] {
                        let response = Response {
                            inverted,
                            centre,
                            curve,
                            ..Response::default()
                        };
                        all.push(response.resolve(low, high).unwrap());
                    }
                }
            }
        }
        all
    }

    #[test]
    fn the_ends_and_rest_are_exact_and_between_them_it_only_rises() {
        for response in responses() {
            assert_eq!(response.weight(0.0), response.minimum);
            assert_eq!(response.weight(1.0), response.maximum);
            if response.detent.is_some() {
                assert_eq!(response.weight(response.place(0.5)), 0.0);
            }
            let weights: Vec<f32> = (0..=1000).map(|n| response.weight(n as f32 / 1000.0)).collect();
            assert!(weights.is_sorted(), "{response:?}");
            let places = [0.0, 1.0].map(|p| response.place(p));
            assert_eq!(places, if response.inverted { [1.0, 0.0] } else { [0.0, 1.0] });
        }
    }

    #[test]
    fn place_of_undoes_weight() {
        for response in responses() {
            let span = response.maximum - response.minimum;
            for n in 0..=200 {
                let weight = response.minimum + span * n as f32 / 200.0;
                let back = response.weight(response.place_of(weight));
                assert!(
                    fabsf(back - weight) < 2e-5 * span,
                    "{response:?}: {weight} came back as {back}"
                );
            }
            assert_eq!(response.place_of(1e9), 1.0);
            assert_eq!(response.place_of(-1e9), 0.0);
        }
    }

    #[test]
    fn curves_are_what_their_numbers_say() {
        let slope = |curve: Curve, x: f32| (curve.value(x + 1e-3) - curve.value(x - 1e-3)) / 2e-3;
        let exponential = Curve::Exponential { ratio: 10.0 };
        let ratio = slope(exponential, 0.998) / slope(exponential, 0.002);
        assert!((9.8..10.2).contains(&ratio), "{ratio}");
        let middle = slope(Curve::SCurve { steepness: 3.0 }, 0.5);
        assert!((2.99..3.01).contains(&middle), "{middle}");
        assert!(Curve::Logarithmic { ratio: 10.0 }.value(0.3) > 0.5);
    }

    #[test]
    fn validity() {
        let good = Response::default();
        assert!(good.resolve(-1.0, 1.0).is_ok());
        assert!(good.resolve(0.0, 0.0).is_ok(), "a component without a range");
        let cases = [
            (
                Response {
                    minimum: Some(-2.0),
                    ..good
                },
                ResponseFault::Limits,
            ),
            (
                Response {
                    maximum: Some(1.1),
                    ..good
                },
                ResponseFault::Limits,
            ),
            (
                Response {
                    minimum: Some(f32::NAN),
                    ..good
                },
                ResponseFault::Limits,
            ),
            (
                Response {
                    minimum: Some(0.5),
                    maximum: Some(0.5),
                    ..good
                },
                ResponseFault::Limits,
            ),
            (
                Response {
                    curve: Curve::Exponential { ratio: 1.0 },
                    ..good
                },
                ResponseFault::Curve,
            ),
            (
                Response {
                    curve: Curve::Logarithmic { ratio: f32::NAN },
                    ..good
                },
                ResponseFault::Curve,
            ),
            (
                Response {
                    curve: Curve::SCurve { steepness: 9.0 },
                    ..good
                },
                ResponseFault::Curve,
            ),
            (
                Response {
                    centre: Centre::Rest { detent: 0.6 },
                    ..good
                },
                ResponseFault::Detent,
            ),
            (
                Response {
                    slew: Some(0.0),
                    ..good
                },
                ResponseFault::Slew,
            ),
            (
                Response {
                    slew: Some(f32::NAN),
                    ..good
                },
                ResponseFault::Slew,
            ),
        ];
        for (response, fault) in cases {
            assert_eq!(response.resolve(-1.0, 1.0), Err(fault), "{response:?}");
        }
    }
}

//! Cotangent edge weights of the rest shape.

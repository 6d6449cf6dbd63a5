//! From a compact package to a baked one: fold, order, factor.

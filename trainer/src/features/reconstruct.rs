//! From features back to positions, in f64: the trainer's oracle of the runtime's solve.

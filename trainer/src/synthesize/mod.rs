//! Built-in sequences: a flag in the wind, a bar that bends and twists, a creature that walks.

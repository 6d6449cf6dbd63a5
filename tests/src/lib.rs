//! Nothing to link: the tests of this crate are its files in `tests/`; what they share is `sinew-support`.

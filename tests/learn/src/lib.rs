//! Holds nothing: the tests beside it train, and stand apart from those of the frame path, which then build without burn.

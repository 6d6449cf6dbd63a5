//! What the programs on top of the trainer share: the console they speak through, the inputs they read, the pages they write.
//!
//! The commands of `sinew` themselves stand beside this library, in its program: [`console`] and [`inputs`] come before the
//! trainer on the path of data, [`report`] after it.

pub mod choice;
pub mod console;
pub mod inputs;
pub mod report;
pub mod weight_table;

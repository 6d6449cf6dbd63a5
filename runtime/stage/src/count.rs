//! Numbers of things in sentences: one frame, two frames.

/// So many of a thing whose plural takes an s: `1 frame`, `0 frames`.
pub fn count(number: u64, thing: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {thing}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_no_plural() {
        assert_eq!([0, 1, 2].map(|n| count(n, "time")), ["0 times", "1 time", "2 times"]);
    }
}

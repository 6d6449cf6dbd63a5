//! What can be asked of a simulated box, as text: one command a line, at its time. Read by the command line, run by
//! [`crate::KnobBox`].

use core::fmt;
use core::time::Duration;

/// What the box shall do or suffer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Command {
    /// `turn KNOB FROM TO TIME`: a hand turns a knob evenly. Positions in `[0, 1]`.
    Turn {
        /// Number of the knob, from 0.
        knob: u16,
        /// Where it begins; it leaps there.
        from: f32,
        /// Where it ends.
        to: f32,
        /// How long it takes.
        time: Duration,
    },
    /// `set KNOB POSITION`.
    Set {
        /// Number of the knob, from 0.
        knob: u16,
        /// Where it stands from now on.
        to: f32,
    },
    /// `wander on` or `wander off`: all knobs turn by themselves, smoothly, at random.
    Wander(bool),
    /// `noise STEPS`: standard deviation of the readings, in steps of a ten-bit converter.
    Noise(f32),
    /// `sag FACTOR`: the supply gives only this part of its voltage; 1 is healthy.
    Sag(f32),
    /// `rate HERTZ`: reports a second, 1 to 100000.
    Rate(u32),
    /// `burst COUNT`: so many reports at once, at most 100000.
    Burst(u32),
    /// `garbage BYTES`: random bytes before the next report, at most 1000000.
    Garbage(u32),
    /// `cut`: the next report loses its end, at a random place.
    Cut,
    /// `freeze TIME`: the readings stand still to the last bit, while reports go on.
    Freeze(Duration),
    /// `silent TIME`: no reports.
    Silent(Duration),
    /// `unplug TIME`: the cable is out for so long.
    Unplug(Duration),
}

/// Largest numbers of [`Command::Rate`], [`Command::Burst`] and [`Command::Garbage`]: no slip of a finger fills the memory.
const RATE_MAX: u32 = 100_000;
const BURST_MAX: u32 = 100_000;
const GARBAGE_MAX: u32 = 1_000_000;
/// Longest time that can be written.
const TIME_MAX_S: f64 = 1e6;

/// The commands with what they take, one a line, for a help text.
pub const COMMANDS: &str = "\
turn KNOB FROM TO TIME   a hand turns a knob: turn 0 0.2 0.9 1s
set KNOB POSITION        a knob stands elsewhere at once: set 0 0.5
wander on|off            all knobs turn by themselves
noise STEPS              standard deviation of readings, in steps of ten bits
sag FACTOR               part of its voltage that the supply gives; 1 is healthy
rate HERTZ               reports a second; thousands are a flood
burst COUNT              so many reports at once
garbage BYTES            random bytes
cut                      the next report loses its end
freeze TIME              readings stand still to the last bit
silent TIME              no reports
unplug TIME              the cable is out: unplug 2s";

/// What is wrong with a line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ScriptError {
    /// Line, from 1.
    pub line: usize,
    /// Column of the word, from 1, in characters.
    pub column: usize,
    /// What is wrong with it, and what would be right.
    pub message: String,
}

impl core::error::Error for ScriptError {}

impl fmt::Display for ScriptError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "line {}, column {}: {}", self.line, self.column, self.message)
    }
}

/// The words of a line, with their places.
struct Words<'a> {
    line: &'a str,
    number: usize,
    rest: &'a str,
}

impl<'a> Words<'a> {
    fn new(line: &'a str, number: usize) -> Self {
        let rest = line.split('#').next().unwrap_or("").trim();
        Self { line, number, rest }
    }

    fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    fn error(&self, at: &str, message: String) -> ScriptError {
        let offset = at.as_ptr() as usize - self.line.as_ptr() as usize;
        ScriptError {
            line: self.number,
            column: self.line[..offset].chars().count() + 1,
            message,
        }
    }

    fn peek(&self) -> &'a str {
        self.rest.split_whitespace().next().unwrap_or("")
    }

    fn next(&mut self, what: &str) -> Result<&'a str, ScriptError> {
        let word = self.peek();
        if word.is_empty() {
            let end = &self.rest[self.rest.len()..];
            return Err(self.error(end, format!("{what} is missing")));
        }
        self.rest = self.rest[word.len()..].trim_start();
        Ok(word)
    }

    /// A number in a range.
    fn number(&mut self, what: &str, least: f64, most: f64) -> Result<f64, ScriptError> {
        let word = self.next(what)?;
        let number = word
            .parse::<f64>()
            .ok()
            .filter(|number| (least..=most).contains(number));
        number.ok_or_else(|| {
            self.error(
                word,
                format!("{what} must be a number from {least} to {most}, not {word}"),
            )
        })
    }

    fn whole(&mut self, what: &str, least: u32, most: u32) -> Result<u32, ScriptError> {
        let word = self.next(what)?;
        let number = word
            .parse::<u32>()
            .ok()
            .filter(|number| (least..=most).contains(number));
        number.ok_or_else(|| {
            self.error(
                word,
                format!("{what} must be a whole number from {least} to {most}, not {word}"),
            )
        })
    }

    fn time(&mut self, what: &str) -> Result<Duration, ScriptError> {
        let word = self.next(what)?;
        parse_time(word)
            .ok_or_else(|| self.error(word, format!("{what} must be a time such as 2s or 250ms, not {word}")))
    }

    fn command(&mut self) -> Result<Command, ScriptError> {
        let word = self.next("a command")?;
        let command = match word {
            "turn" => Command::Turn {
                knob: self.whole("the number of a knob", 0, 63)? as u16,
                from: self.number("the beginning", 0.0, 1.0)? as f32,
                to: self.number("the end", 0.0, 1.0)? as f32,
                time: self.time("how long it takes")?,
            },
            "set" => Command::Set {
                knob: self.whole("the number of a knob", 0, 63)? as u16,
                to: self.number("the position", 0.0, 1.0)? as f32,
            },
            "wander" => match self.next("on or off")? {
                "on" => Command::Wander(true),
                "off" => Command::Wander(false),
                other => return Err(self.error(other, format!("wander is on or off, not {other}"))),
            },
            "noise" => Command::Noise(self.number("the noise", 0.0, 1023.0)? as f32),
            "sag" => Command::Sag(self.number("the supply", 0.0, 1.0)? as f32),
            "rate" => Command::Rate(self.whole("the rate", 1, RATE_MAX)?),
            "burst" => Command::Burst(self.whole("the count", 1, BURST_MAX)?),
            "garbage" => Command::Garbage(self.whole("the count of bytes", 1, GARBAGE_MAX)?),
            "cut" => Command::Cut,
            "freeze" => Command::Freeze(self.time("how long")?),
            "silent" => Command::Silent(self.time("how long")?),
            "unplug" => Command::Unplug(self.time("how long")?),
            other => return Err(self.error(other, format!("there is no command {other}; there are:\n{COMMANDS}"))),
        };
        match self.peek() {
            "" => Ok(command),
            extra => Err(self.error(extra, format!("{word} takes no more than it has; {extra} is too much"))),
        }
    }
}

/// `2s`, `0.5s`, `250ms`.
fn parse_time(word: &str) -> Option<Duration> {
    let (digits, scale) = match word.strip_suffix("ms") {
        Some(digits) => (digits, 1e-3),
        None => (word.strip_suffix('s')?, 1.0),
    };
    let seconds = digits.parse::<f64>().ok()? * scale;
    (0.0..=TIME_MAX_S)
        .contains(&seconds)
        .then(|| Duration::from_secs_f64(seconds))
}

impl Command {
    /// Reads one command; `Ok(None)` for an empty line or a comment.
    ///
    /// # Errors
    /// [`ScriptError`], in line 1.
    pub fn parse(line: &str) -> Result<Option<Self>, ScriptError> {
        let mut words = Words::new(line, 1);
        if words.is_empty() {
            Ok(None)
        } else {
            words.command().map(Some)
        }
    }
}

/// Commands and their times. A line is `[TIME] COMMAND`, `wait TIME`, or `repeat`; `#` begins a comment. A time in front is
/// counted from the beginning of the script; without one a command follows the one before at once, or after the waits
/// between. `repeat`, in the last line, begins anew.
///
/// ```
/// let script = sinew_simulator::Script::parse("noise 2\nwait 1s\nturn 0 0.2 0.9 1s # and meanwhile\n1.5s unplug 2s").unwrap();
/// assert_eq!(script.steps().len(), 3);
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Script {
    steps: Vec<(Duration, Command)>,
    length: Duration,
    repeats: bool,
}

impl Script {
    /// Reads a script.
    ///
    /// # Errors
    /// [`ScriptError`]: the first line that is wrong.
    pub fn parse(text: &str) -> Result<Self, ScriptError> {
        let mut script = Self::default();
        for (number, line) in text.lines().enumerate() {
            let mut words = Words::new(line, number + 1);
            if words.is_empty() {
                continue;
            }
            let first = words.peek();
            if script.repeats {
                return Err(words.error(first, "nothing can follow repeat".into()));
            }
            if let Some(time) = parse_time(first) {
                if time < script.length {
                    return Err(words.error(first, "this is before the line above".into()));
                }
                script.length = time;
                words.next("a time")?;
            } else if matches!(first, "wait" | "repeat") {
                words.next("")?;
                if first == "wait" {
                    script.length += words.time("how long")?;
                } else if script.length.is_zero() {
                    return Err(words.error(
                        first,
                        "a script that takes no time cannot repeat; put a wait before".into(),
                    ));
                } else {
                    script.repeats = true;
                }
                let extra = words.peek();
                if !extra.is_empty() {
                    return Err(words.error(extra, format!("{extra} is too much")));
                }
                continue;
            }
            script.steps.push((script.length, words.command()?));
        }
        Ok(script)
    }

    /// The commands with their times since the beginning, in order.
    pub fn steps(&self) -> &[(Duration, Command)] {
        &self.steps
    }

    /// How long it takes; a repeating script then begins anew.
    pub const fn length(&self) -> Duration {
        self.length
    }

    /// Whether it begins anew at its end.
    pub const fn repeats(&self) -> bool {
        self.repeats
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_counted_from_the_beginning_or_waited_for() {
        let text = "# a show\nnoise 3\n\nwait 250ms\nunplug 2s\n1.5s turn 1 0.25 1 0.5s\nwait 1s\nrepeat\n";
        let script = Script::parse(text).unwrap();
        let turn = Command::Turn {
            knob: 1,
            from: 0.25,
            to: 1.0,
            time: Duration::from_millis(500),
        };
        let ms = Duration::from_millis;
        let expected = [
            (ms(0), Command::Noise(3.0)),
            (ms(250), Command::Unplug(ms(2000))),
            (ms(1500), turn),
        ];
        assert_eq!(script.steps(), expected);
        assert_eq!((script.length(), script.repeats()), (ms(2500), true));
    }

    #[test]
    fn a_wrong_word_is_named_with_its_place() {
        for (text, line, column, part) in [
            ("noise 3\n  jump 4", 2, 3, "no command jump"),
            ("turn 0 0.2 1.5 1s", 1, 12, "from 0 to 1, not 1.5"),
            ("turn 0 0.2", 1, 11, "the end is missing"),
            ("unplug 2", 1, 8, "such as 2s"),
            ("unplug -2s", 1, 8, "such as 2s"),
            ("noise NaN", 1, 7, "a number"),
            ("cut cut", 1, 5, "too much"),
            ("2s cut\n1s cut", 2, 1, "before the line above"),
            ("cut\nrepeat", 2, 1, "put a wait"),
            ("wait 1s\nrepeat\ncut", 3, 1, "follow repeat"),
            ("burst 4000000000", 1, 7, "whole number"),
            ("1e300s cut", 1, 1, "no command"),
            ("2s", 1, 3, "a command is missing"),
        ] {
            let error = Script::parse(text).unwrap_err();
            assert_eq!((error.line, error.column), (line, column), "{text}: {error}");
            assert!(error.message.contains(part), "{text}: {error}");
        }
        assert_eq!(Command::parse("  # nothing"), Ok(None));
        assert_eq!(Command::parse("cut"), Ok(Some(Command::Cut)));
    }
}

//! Reading a TOML table key by key: every value keeps its place in the file, and a key that nobody asked for is refused with
//! the nearest that exists.

use core::ops::{Range, RangeInclusive};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// What is wrong at one place of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Fault {
    /// Bytes of the file it is about.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

impl Fault {
    /// A fault without advice.
    pub fn new(span: Range<usize>, message: impl Into<String>) -> Self {
        Self {
            span,
            message: message.into(),
            help: None,
        }
    }

    /// With advice.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

/// A value and where it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct Found<T> {
    /// The value.
    pub value: T,
    /// Bytes of the file that hold it.
    pub span: Range<usize>,
}

/// The known word nearest to `word`, if any is near enough to have been meant.
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let scored = known.into_iter().map(|candidate| {
        let score = strsim::jaro_winkler(&lower, &candidate.to_lowercase());
        (score, candidate)
    });
    scored
        .filter(|(score, _)| *score > 0.75)
        // The first of equals, so that the answer does not depend on the iterator's end.
        .fold(None, |best: Option<(f64, &str)>, next| match best {
            Some(best) if best.0 >= next.0 => Some(best),
            _ => Some(next),
        })
        .map(|(_, candidate)| candidate)
}

/// One table of a file, read key by key; [`Keys::finish`] refuses what is left.
pub struct Keys<'a> {
    entries: &'a DeTable<'a>,
    /// Where the table stands, for faults about what is missing.
    pub span: Range<usize>,
    /// As its heading is written, for messages.
    heading: &'static str,
    known: Vec<&'static str>,
}

impl<'a> Keys<'a> {
    /// Starts on a table.
    pub fn new(entries: &'a DeTable<'a>, span: Range<usize>, heading: &'static str) -> Self {
        Self {
            entries,
            span,
            heading,
            known: Vec::new(),
        }
    }

    fn get(&mut self, key: &'static str) -> Option<&'a Spanned<DeValue<'a>>> {
        self.known.push(key);
        self.entries
            .iter()
            .find(|(name, _)| name.get_ref().as_ref() == key)
            .map(|(_, value)| value)
    }

    fn wrong_type(key: &str, value: &Spanned<DeValue<'_>>, wanted: &str) -> Fault {
        let found = value.get_ref().type_str();
        Fault::new(value.span(), format!("`{key}` must be {wanted}, not {found}"))
    }

    /// A number, whole or not.
    ///
    /// # Errors
    /// Another type, or out of range.
    pub fn number(&mut self, key: &'static str, range: RangeInclusive<f64>) -> Result<Option<Found<f32>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let number = number_of(value.get_ref()).ok_or_else(|| Self::wrong_type(key, value, "a number"))?;
        if !range.contains(&number) {
            let (low, high) = range.into_inner();
            return Err(Fault::new(
                value.span(),
                format!("`{key}` must be from {low} to {high}, not {number}"),
            ));
        }
        Ok(Some(Found {
            value: number as f32,
            span: value.span(),
        }))
    }

    /// A number, or the word "never", which gives `Some(None)`.
    ///
    /// # Errors
    /// Another type, or out of range.
    pub fn seconds_or_never(&mut self, key: &'static str) -> Result<Option<Option<u64>>, Fault> {
        if self.get(key).and_then(|value| value.get_ref().as_str()) == Some("never") {
            return Ok(Some(None));
        }
        Ok(self.seconds(key)?.map(Some))
    }

    /// Seconds, as microseconds.
    ///
    /// # Errors
    /// Another type, or out of range.
    pub fn seconds(&mut self, key: &'static str) -> Result<Option<u64>, Fault> {
        let seconds = self.number(key, 0.0..=86_400.0)?;
        Ok(seconds.map(|found| (f64::from(found.value) * 1e6).round() as u64))
    }

    /// A whole number.
    ///
    /// # Errors
    /// Another type, or out of range.
    pub fn whole(&mut self, key: &'static str, range: RangeInclusive<u32>) -> Result<Option<Found<u32>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let number = whole_of(value.get_ref()).ok_or_else(|| Self::wrong_type(key, value, "a whole number"))?;
        match u32::try_from(number) {
            Ok(number) if range.contains(&number) => Ok(Some(Found {
                value: number,
                span: value.span(),
            })),
            _ => {
                let (low, high) = range.into_inner();
                let message = format!("`{key}` must be from {low} to {high}, not {number}");
                Err(Fault::new(value.span(), message))
            }
        }
    }

    /// A whole number that a u16 holds.
    ///
    /// # Errors
    /// Another type, or out of range.
    pub fn small(&mut self, key: &'static str, range: RangeInclusive<u16>) -> Result<Option<Found<u16>>, Fault> {
        let (low, high) = range.into_inner();
        let found = self.whole(key, low.into()..=high.into())?;
        Ok(found.map(|found| Found {
            value: found.value as u16,
            span: found.span,
        }))
    }

    /// true or false.
    ///
    /// # Errors
    /// Another type.
    pub fn flag(&mut self, key: &'static str) -> Result<Option<bool>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let flag = value.get_ref().as_bool();
        flag.map(Some)
            .ok_or_else(|| Self::wrong_type(key, value, "true or false"))
    }

    /// Text.
    ///
    /// # Errors
    /// Another type.
    pub fn text(&mut self, key: &'static str) -> Result<Option<Found<&'a str>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let text = value
            .get_ref()
            .as_str()
            .ok_or_else(|| Self::wrong_type(key, value, "text in quotes"))?;
        Ok(Some(Found {
            value: text,
            span: value.span(),
        }))
    }

    /// One of a few words.
    ///
    /// # Errors
    /// Another word, with the nearest of those allowed.
    pub fn word<T: Copy>(&mut self, key: &'static str, words: &[(&'static str, T)]) -> Result<Option<T>, Fault> {
        let Some(found) = self.text(key)? else { return Ok(None) };
        if let Some((_, value)) = words.iter().find(|(word, _)| *word == found.value) {
            return Ok(Some(*value));
        }
        let list: Vec<_> = words.iter().map(|(word, _)| format!("\"{word}\"")).collect();
        let fault = Fault::new(found.span, format!("`{key}` cannot be \"{}\"", found.value));
        let meant = nearest(found.value, words.iter().map(|(word, _)| *word));
        let meant = meant.map_or(String::new(), |word| format!("did you mean \"{word}\"? "));
        Err(fault.help(format!("{meant}it is one of {}", list.join(", "))))
    }

    /// A whole number or text, for the addresses of knobs.
    ///
    /// # Errors
    /// Another type.
    pub fn whole_or_text(&mut self, key: &'static str) -> Result<Option<Found<WholeOrText<'a>>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        whole_or_text(key, value).map(Some)
    }

    /// A list of those.
    ///
    /// # Errors
    /// Another type.
    pub fn whole_or_text_list(&mut self, key: &'static str) -> Result<Option<Vec<Found<WholeOrText<'a>>>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let array = value.get_ref().as_array();
        let array = array.ok_or_else(|| Self::wrong_type(key, value, "a list"))?;
        array
            .iter()
            .map(|entry| whole_or_text(key, entry))
            .collect::<Result<_, _>>()
            .map(Some)
    }

    /// A table within this one.
    ///
    /// # Errors
    /// Another type.
    pub fn table(&mut self, key: &'static str, heading: &'static str) -> Result<Option<Keys<'a>>, Fault> {
        let Some(value) = self.get(key) else { return Ok(None) };
        let table = value
            .get_ref()
            .as_table()
            .ok_or_else(|| Self::wrong_type(key, value, "a table"))?;
        Ok(Some(Keys::new(table, value.span(), heading)))
    }

    /// A list of tables within this one; empty if there is none.
    ///
    /// # Errors
    /// Another type.
    pub fn tables(&mut self, key: &'static str, heading: &'static str) -> Result<Vec<Keys<'a>>, Fault> {
        let Some(value) = self.get(key) else {
            return Ok(Vec::new());
        };
        let wrong = || Self::wrong_type(key, value, &format!("a list of tables, each headed {heading}"));
        let array = value.get_ref().as_array().ok_or_else(wrong)?;
        let tables = array.iter().map(|entry| {
            let table = entry.get_ref().as_table().ok_or_else(wrong)?;
            Ok(Keys::new(table, entry.span(), heading))
        });
        tables.collect()
    }

    /// Whether a key is there, without reading it.
    pub fn has(&self, key: &str) -> bool {
        self.entries.keys().any(|name| name.get_ref().as_ref() == key)
    }

    /// Refuses the first key that nobody asked for.
    ///
    /// # Errors
    /// That key, with the nearest known one.
    pub fn finish(self) -> Result<(), Fault> {
        let unknown = self
            .entries
            .keys()
            .filter(|name| !self.known.contains(&name.get_ref().as_ref()))
            .min_by_key(|name| name.span().start);
        let Some(unknown) = unknown else { return Ok(()) };
        let fault = Fault::new(
            unknown.span(),
            format!("{} has no key `{}`", self.heading, unknown.get_ref()),
        );
        let help = match nearest(unknown.get_ref(), self.known.iter().copied()) {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("it knows {}", self.known.join(", ")),
        };
        Err(fault.help(help))
    }
}

/// The two ways to name a knob.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WholeOrText<'a> {
    /// By number.
    Whole(i64),
    /// By text.
    Text(&'a str),
}

fn whole_or_text<'a>(key: &str, value: &'a Spanned<DeValue<'a>>) -> Result<Found<WholeOrText<'a>>, Fault> {
    let found = match value.get_ref() {
        DeValue::String(text) => WholeOrText::Text(text.as_ref()),
        other => WholeOrText::Whole(
            whole_of(other).ok_or_else(|| Keys::wrong_type(key, value, "a whole number, or text in quotes"))?,
        ),
    };
    Ok(Found {
        value: found,
        span: value.span(),
    })
}

fn whole_of(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}

/// Infinities and NaN, which TOML allows, are in no range.
fn number_of(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Float(float) => float.as_str().parse().ok(),
        other => whole_of(other).map(|whole| whole as f64),
    }
}

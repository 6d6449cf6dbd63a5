//! Lines on standard input instead of knobs, for scripts: `c0 0.5` moves a component, `stop` is a command.

use std::io::BufRead;
use std::thread;

use crossbeam::channel::Sender;
use sinew_knobs::Command;
use sinew_runtime::Basis;

use crate::config::COMMANDS;
use crate::config::keys::nearest;
use crate::snapshot::Request;

/// Reads one line; `None` for an empty one or a comment. `names` are the components in order.
///
/// # Errors
/// What is wrong with it, for a person.
pub fn parse_line(line: &str, names: &[String]) -> Result<Option<Request>, String> {
    let content = line.split('#').next().unwrap_or("").replace('=', " ");
    let words: Vec<&str> = content.split_whitespace().collect();
    let component = |name: &str| {
        let found = names.iter().position(|known| known == name);
        // The format of packages allows 4,096 components.
        found
            .map(|k| k as u16)
            .ok_or_else(|| match nearest(name, names.iter().map(String::as_str)) {
                Some(near) => format!("there is no component or command `{name}`; did you mean `{near}`?"),
                None => format!("there is no component or command `{name}`"),
            })
    };
    let request = match words.as_slice() {
        [] => return Ok(None),
        ["quit"] => Request::Quit,
        ["rest"] => Request::Rest,
        ["record"] => Request::Record,
        ["focus", name] => Request::Command(Command::Focus(component(name)?)),
        ["page", page] => match page.parse() {
            Ok(page @ 1..) => Request::Command(Command::Page(page - 1)),
            _ => return Err(format!("`{page}` is no page: they count from 1")),
        },
        [word] => match COMMANDS.iter().find(|(known, _)| known == word) {
            Some((_, command)) => Request::Command(*command),
            None => {
                component(word)?;
                return Err(format!("`{word}` needs a weight behind it: {word} 0.5"));
            }
        },
        [name, weight] => {
            let control = component(name)?;
            let weight: f32 = weight.parse().map_err(|_| format!("`{weight}` is not a number"))?;
            if !weight.is_finite() {
                return Err(format!("the weight of {name} must be a finite number"));
            }
            Request::Weight { control, weight }
        }
        _ => {
            return Err(format!(
                "`{}` has too many words; write NAME WEIGHT or a command",
                line.trim()
            ));
        }
    };
    Ok(Some(request))
}

/// Reads standard input on a thread of its own, which ends with it; what makes no sense is said on standard error.
///
/// # Errors
/// The system has no thread left.
pub fn start_typed_lines(basis: &Basis<'_>, requests: Sender<Request>) -> std::io::Result<()> {
    let names: Vec<String> = basis.components().map(|component| component.name.to_owned()).collect();
    let read = move || {
        for (number, line) in std::io::stdin().lock().lines().enumerate() {
            let Ok(line) = line else { return };
            match parse_line(&line, &names) {
                Ok(None) => {}
                Ok(Some(request)) => {
                    if requests.send(request).is_err() {
                        return;
                    }
                }
                Err(message) => eprintln!("standard input, line {}: {message}", number + 1),
            }
        }
    };
    thread::Builder::new()
        .name("sinew-typed".to_owned())
        .spawn(read)
        .map(drop)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_weights_or_commands() {
        let names = ["c0", "c0.1", "jaw"].map(str::to_owned);
        let parse = |line: &str| parse_line(line, &names);
        assert_eq!(
            parse(" c0.1 -0.5 # half"),
            Ok(Some(Request::Weight {
                control: 1,
                weight: -0.5
            }))
        );
        assert_eq!(
            parse("jaw=1e-3"),
            Ok(Some(Request::Weight {
                control: 2,
                weight: 1e-3
            }))
        );
        assert_eq!(parse("next-fine"), Ok(Some(Request::Command(Command::NextFine))));
        assert_eq!(parse("focus jaw"), Ok(Some(Request::Command(Command::Focus(2)))));
        assert_eq!(parse("page 2"), Ok(Some(Request::Command(Command::Page(1)))));
        assert_eq!(parse("# only this"), Ok(None));
        for (wrong, said) in [
            ("jam 1", "did you mean `jaw`?"),
            ("c0", "needs a weight"),
            ("c0 x", "not a number"),
            ("c0 inf", "finite"),
            ("c0 1 2", "too many words"),
            ("page 0", "count from 1"),
            ("zzzz", "no component or command"),
        ] {
            let message = parse(wrong).unwrap_err();
            assert!(message.contains(said), "{wrong}: {message}");
        }
    }
}

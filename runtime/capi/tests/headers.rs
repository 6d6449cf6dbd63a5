//! The headers are what cbindgen makes of the sources, they are plain C99 and C++, and the shared library exports exactly
//! their functions. `UPDATE_HEADERS=1` writes them.

mod common;

use core::ffi::CStr;
use core::fmt::Write;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::{HEADERS, compile, crate_folder, header_functions, libraries, run, tool};

/// One header: a room of the library.
struct Room {
    /// File in `include/`; its manual stands in `manual/`.
    name: &'static str,
    /// In the order in which the header is read.
    sources: &'static [&'static str],
}

const ROOMS: [Room; HEADERS.len()] = [
    Room {
        name: HEADERS[0],
        sources: &[
            "version",
            "status",
            "details",
            "memory",
            "basis",
            "controls",
            "workspace",
            "player",
            "frame",
            "vertices",
        ],
    },
    Room {
        name: HEADERS[1],
        sources: &["pins"],
    },
    Room {
        name: HEADERS[2],
        sources: &["batch"],
    },
    Room {
        name: HEADERS[3],
        sources: &["bones"],
    },
    Room {
        name: HEADERS[4],
        sources: &["device", "decoder", "surface_map", "surface_state", "surface"],
    },
];

/// The initialiser of every struct that may grow. Neither form warns under `-Wextra`.
const INITIALISER: &str = "
/// Begins a struct that may grow: `SinewDetails details = SINEW_INIT(SinewDetails);`
#ifdef __cplusplus
template <typename T> inline T sinew_init() { T value = T(); value.struct_bytes = sizeof(T); return value; }
#define SINEW_INIT(T) sinew_init<T>()
#else
#define SINEW_INIT(T) { .struct_bytes = sizeof(T) }
#endif
";

/// The statuses of the library's own table, which cbindgen cannot see through its macro.
fn statuses() -> String {
    let mut lines = String::from(
        "
/// What a call returns. Treat a code that is not listed as a fault: more may be added.
typedef int32_t SinewStatus;
enum {
",
    );
    let text = |pointer| {
        // SAFETY: the library's own texts.
        unsafe { CStr::from_ptr(pointer) }.to_str().expect("UTF-8")
    };
    for code in 0..1000 {
        let (name, sentence) = (
            text(sinew::sinew_status_name(code)),
            text(sinew::sinew_status_text(code)),
        );
        if name.starts_with("SINEW_STATUS_") {
            writeln!(lines, "  {name} = {code}, ///< {sentence}").expect("memory");
        }
    }
    lines + "};"
}

fn header_file(room: &Room) -> PathBuf {
    crate_folder().join("include").join(room.name)
}

fn generated(room: &Room) -> String {
    let mut config =
        cbindgen::Config::from_file(crate_folder().join("cbindgen.toml")).expect("the configuration is good");
    let manual = crate_folder().join("manual").join(room.name).with_extension("txt");
    config.header = Some(
        fs::read_to_string(manual)
            .expect("the manual is there")
            .trim_end()
            .to_owned(),
    );
    config.include_guard = Some(room.name.to_uppercase().replace('.', "_"));
    if room.name == HEADERS[0] {
        config.sys_includes = ["stddef.h", "stdint.h"].map(str::to_owned).to_vec();
        config.after_includes = Some(INITIALISER.to_owned() + &statuses());
    } else {
        config.includes = vec![HEADERS[0].to_owned()];
    }
    let mut builder = cbindgen::Builder::new().with_config(config);
    for source in room.sources {
        builder = builder.with_src(crate_folder().join("src").join(source).with_extension("rs"));
    }
    let mut header = Vec::new();
    builder.generate().expect("the sources are good").write(&mut header);
    plain(&String::from_utf8(header).expect("UTF-8"))
}

/// cbindgen's header for people: choices are numbers of 32 bits in every language, types have one name, declarations fill
/// their lines, and what only Rust promises is left out.
fn plain(header: &str) -> String {
    let mut lines: Vec<String> = Vec::new();
    let mut rest = header.lines();
    while let Some(line) = rest.next() {
        if line == "/// # Safety" {
            let declaration = rest
                .by_ref()
                .find(|line| !line.starts_with("///"))
                .expect("of something");
            // The line that set it apart.
            assert_eq!(lines.pop().as_deref(), Some("///"), "a promise follows a text");
            lines.extend(filled(declaration, &mut rest));
        } else if let Some(name) = line.strip_prefix("enum Sinew") {
            lines.push(format!("typedef int32_t Sinew{name};"));
            let opened = rest.by_ref().find(|line| *line == " {");
            assert!(opened.is_some(), "{name}: cbindgen writes its enums in another way");
            lines.push("enum {".into());
            lines.extend(rest.by_ref().take_while(|line| *line != "};").map(str::to_owned));
            lines.push("};".into());
            let closed = rest.by_ref().find(|line| *line == "#endif // __cplusplus");
            assert!(closed.is_some(), "{name}: cbindgen ends its enums in another way");
        } else if line.starts_with("typedef struct") {
            lines.push(line.to_owned());
        } else {
            lines.push(line.replace("struct Sinew", "Sinew"));
        }
    }
    lines.join("\n") + "\n"
}

/// A declaration, of which `first` is the first line, in as few lines as hold it.
fn filled<'h>(first: &'h str, rest: &mut impl Iterator<Item = &'h str>) -> Vec<String> {
    const WIDTH: usize = 120;
    let mut declaration = first.to_owned();
    while !declaration.ends_with(';') {
        let more = rest.next().expect("a declaration ends");
        declaration = declaration + " " + more.trim_start();
    }
    let declaration = declaration.replace("struct Sinew", "Sinew");
    let (name, parameters) = declaration.split_once('(').expect("a function");
    let indent = " ".repeat(name.len() + 1);
    let mut lines = vec![format!("{name}(")];
    for parameter in parameters.split_inclusive(", ") {
        let last = lines.last_mut().expect("one at least");
        if last.len() + parameter.trim_end().len() > WIDTH {
            last.truncate(last.trim_end().len());
            lines.push(indent.clone() + parameter);
        } else {
            *last += parameter;
        }
    }
    lines
}

#[test]
fn the_headers_are_those_of_the_sources() {
    let mut written = Vec::new();
    for room in &ROOMS {
        let (generated, file) = (generated(room), header_file(room));
        if std::env::var_os("UPDATE_HEADERS").is_some() {
            fs::write(&file, &generated).expect("the header can be written");
            written.push(room.name);
            continue;
        }
        let committed = fs::read_to_string(file).expect("the header is there");
        assert!(
            committed == generated,
            "{} is stale; run `UPDATE_HEADERS=1 cargo test -p sinew-capi --test headers`",
            room.name
        );
    }
    assert!(
        written.is_empty(),
        "{written:?} were written; run the test again without UPDATE_HEADERS"
    );
}

#[test]
fn every_function_of_the_sources_is_in_a_header() {
    let mut exported = BTreeSet::new();
    for entry in fs::read_dir(crate_folder().join("src")).expect("there are sources") {
        let text = fs::read_to_string(entry.expect("readable").path()).expect("readable");
        for (_, after) in text
            .split("#[unsafe(no_mangle)]\n")
            .skip(1)
            .filter_map(|item| item.split_once("fn "))
        {
            exported.insert(after.split('(').next().expect("a name").to_owned());
        }
    }
    assert!(exported.len() > 20, "{exported:?}");
    assert_eq!(header_functions(), exported);
}

#[test]
#[cfg(target_os = "linux")]
fn the_shared_library_exports_the_functions_of_the_headers_and_nothing_else() {
    let Some(nm) = tool("nm") else { return };
    let output = run(Command::new(nm)
        .args(["--dynamic", "--defined-only", "--format=just-symbols"])
        .arg(&libraries().shared));
    let symbols: BTreeSet<String> = output.stdout.lines().map(str::to_owned).collect();
    assert_eq!(symbols, header_functions());
}

/// A program that includes a header twice, and begins a struct.
fn includes(header: &str) -> String {
    format!(
        r#"
#include "{header}"
#include "{header}"
int main(void) {{
    SinewLayout layout;
    SinewDetails details = SINEW_INIT(SinewDetails);
    if (sinew_abi_version() != SINEW_ABI_VERSION) return 1;
    if (details.struct_bytes != sizeof details || details.text[0] != 0) return 2;
    return sinew_basis_layout(&layout) == SINEW_STATUS_OK && layout.size_bytes > 0 ? 0 : 3;
}}
"#
    )
}

#[test]
fn each_header_alone_is_c99_and_c11_and_cpp() {
    let folder = tempfile::tempdir().expect("a folder");
    for header in HEADERS {
        for (compiler, standard, suffix) in [
            ("gcc", "c99", "c"),
            ("gcc", "c11", "c"),
            ("gcc", "c2x", "c"),
            ("g++", "c++11", "cc"),
            ("g++", "c++20", "cc"),
        ] {
            let Some(compiler) = tool(compiler) else { continue };
            let source = folder.path().join("includes").with_extension(suffix);
            fs::write(&source, includes(header)).expect("written");
            let program = compile(
                &compiler,
                &[&format!("-std={standard}")],
                &source,
                &[Path::new(&libraries().archive)],
                folder.path(),
            );
            assert_eq!(run(&mut Command::new(program)).code, Some(0), "{header} {standard}");
        }
    }
}

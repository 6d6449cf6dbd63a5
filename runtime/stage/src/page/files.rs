//! The files of the page, inside the program: `runtime/web`, with its WebAssembly as `runtime/web/build` made it.

/// One file: its name in the address, its type, its bytes.
pub struct File {
    pub name: &'static str,
    pub kind: &'static str,
    pub bytes: &'static [u8],
}

macro_rules! files {
    ($($name:literal => $kind:expr),* $(,)?) => {
        &[$(File {
            name: $name,
            kind: $kind,
            bytes: include_bytes!(concat!("../../../web/", $name)),
        }),*]
    };
}

const SCRIPT: &str = "text/javascript; charset=utf-8";

/// All of them.
pub static FILES: &[File] = files![
    "index.html" => "text/html; charset=utf-8",
    "page.css" => "text/css; charset=utf-8",
    "sinew.js" => SCRIPT,
    "view.js" => SCRIPT,
    "grab.js" => SCRIPT,
    "tree.js" => SCRIPT,
    "link.js" => SCRIPT,
    "page.js" => SCRIPT,
    "sinew.wasm" => "application/wasm",
    "sinew-scalar.wasm" => "application/wasm",
];

/// The file of a path.
pub fn find(path: &str) -> Option<&'static File> {
    let name = match path {
        "/" => "index.html",
        _ => path.strip_prefix('/')?,
    };
    FILES.iter().find(|file| file.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_finds_every_file_that_it_names() {
        let page = core::str::from_utf8(find("/").unwrap().bytes).unwrap();
        let mut named = 0;
        for attribute in ["src=\"", "href=\""] {
            for part in page.split(attribute).skip(1) {
                let name = part.split('"').next().unwrap();
                if name.ends_with(".js") || name.ends_with(".css") {
                    assert!(find(&format!("/{name}")).is_some(), "{name}");
                    named += 1;
                }
            }
        }
        assert_eq!(
            named,
            FILES.iter().filter(|file| file.kind.starts_with("text/")).count() - 1
        );
        assert!(find("/../Cargo.toml").is_none() && find("").is_none() && find("//").is_none());
        assert_eq!(FILES.iter().filter(|file| file.kind == SCRIPT).count(), 6);
    }
}

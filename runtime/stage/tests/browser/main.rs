//! The page in a real browser: headless Chromium, driven over its debugging socket, beside a stage with a simulated box. Ignored
//! unless asked for; without Chromium it says so. `SINEW_SCREENSHOTS=FOLDER` keeps the pictures that it looks at.

mod chromium;
#[path = "../common/mod.rs"]
mod common;

use core::time::Duration;
use std::io::{BufRead, BufReader, Write};
use std::thread;
use std::time::Instant;

use chromium::{Chromium, Tab};
use common::Stage;

/// Asks a page until the answer is true.
fn wait_for(tab: &mut Tab, condition: &str) {
    let until = Instant::now() + Duration::from_secs(40);
    while Instant::now() < until {
        if tab.evaluate(condition) == serde_json::Value::Bool(true) {
            return;
        }
        thread::sleep(Duration::from_millis(50));
    }
    let message = tab.evaluate("document.getElementById('message').textContent");
    let weights = tab.evaluate("JSON.stringify([link.isOpen, tree.rows.map(({ weight }) => weight)])");
    panic!("never came true: {condition}\nthe page says: {message}; link and weights: {weights}");
}

/// Pixels of the mesh that differ between two pictures, as a share of the picture.
fn difference(before: &[u8], after: &[u8]) -> f64 {
    assert_eq!(before.len(), after.len());
    let changed = before.chunks(4).zip(after.chunks(4)).filter(|(a, b)| a != b).count();
    changed as f64 / (before.len() / 4) as f64
}

#[test]
#[ignore = "needs Chromium"]
fn hands_on_one_page_move_the_picture_of_another() {
    let Some(chromium) = Chromium::start() else {
        eprintln!("skipped: there is no Chromium in PATH or in SINEW_CHROMIUM");
        return;
    };
    let stage = Stage::new();
    let mut played = stage.start("play --demo --typed --headless --page 0");
    let mut lines = BufReader::new(played.stderr.take().unwrap()).lines();
    let url = lines
        .find_map(|line| line.unwrap().strip_prefix("page: ").map(str::to_owned))
        .expect("a page");
    thread::spawn(move || lines.for_each(drop));

    let mut desk = chromium.open(&url, 1280, 800);
    wait_for(&mut desk, "link.isOpen && sinew !== undefined && tree.rows.length > 0");
    let mut phone = chromium.open(&url, 390, 844);
    wait_for(&mut phone, "link.isOpen && sinew !== undefined");
    let mut obs = chromium.open(&format!("{url}?view=mesh&background=transparent"), 640, 480);
    wait_for(&mut obs, "link.isOpen && sinew !== undefined");
    let rest = obs.picture("obs-rest");
    let corner = &rest[..4];
    assert_eq!(corner, [0, 0, 0, 0], "the ground of a browser source is transparent");
    assert!(rest.chunks(4).any(|pixel| pixel[3] == 255), "and the mesh is not");

    // A slider in the hand on the telephone.
    let at = phone.evaluate(
        "(() => { const box = tree.rows[0].line.querySelector('input[type=range]').getBoundingClientRect(); \
         return [box.left + 0.5 * box.width, box.top + 0.5 * box.height, box.right + 20]; })()",
    );
    let number = |n: usize| at[n].as_f64().unwrap();
    phone.drag((number(0), number(1)), (number(2), number(1)));
    wait_for(&mut phone, "tree.rows[0].weight === tree.rows[0].component.maximum");
    wait_for(&mut desk, "tree.rows[0].weight === tree.rows[0].component.maximum");
    wait_for(&mut obs, "tree.rows[0].weight === tree.rows[0].component.maximum");
    let moved = obs.picture("obs-moved");
    assert!(
        difference(&rest, &moved) > 0.001,
        "the picture of the third page changed"
    );
    phone.picture("phone");

    // Undo on the desk knows only the desk's hands; rest takes all of them back.
    desk.evaluate("element('reset').click()");
    wait_for(&mut phone, "tree.rows.every(({ weight }) => weight === 0)");
    wait_for(&mut desk, "tree.rows.every(({ weight }) => weight === 0)");

    // A hand on the mesh.
    let (x, y) = desk.mesh_point();
    desk.drag((x, y), (x + 40.0, y - 60.0));
    wait_for(&mut phone, "tree.rows.some(({ weight }) => weight !== 0)");
    desk.picture("desk-dragged");
    assert_eq!(desk.evaluate("undo.length > 0"), true);
    desk.evaluate("element('undo').click()");
    wait_for(&mut phone, "tree.rows.every(({ weight }) => weight === 0)");

    // Keys, and what a screen reader is told.
    desk.evaluate("element('canvas').focus()");
    desk.key(" ", 32);
    wait_for(&mut phone, "element('stop').getAttribute('aria-pressed') === 'true'");
    desk.key(" ", 32);
    wait_for(&mut phone, "element('stop').getAttribute('aria-pressed') === 'false'");
    let unnamed = "[...document.querySelectorAll('button, input, canvas, meter')].filter((e) => !e.hidden && !e.textContent.trim() \
                   && !e.getAttribute('aria-label') && !e.closest('label')).length";
    assert_eq!(desk.evaluate(unnamed), 0, "every control has a name");
    desk.dark(true);
    desk.picture("desk-dark");
    assert_eq!(desk.evaluate("element('message').hidden"), true);
    played.stdin.take().unwrap().write_all(b"quit\n").unwrap();
    assert!(played.wait().unwrap().success());
    wait_for(
        &mut desk,
        "!link.isOpen && element('device').textContent.startsWith('The stage is gone')",
    );
}

//! What pictures and pages promise.

use super::color::{ColorMap, linear_from_hex};
use super::html::{Comparison, ComponentPicture, CurvePoint, ErrorRow, Picture, Report};
use super::image::Image;
use super::pictures::{Studio, distances, quantile};
use super::raster::Style;
use super::view::orient;
use sinew_interchange::MeshSequence;
use sinew_trainer::synthesize::{Settings, Subject};

fn creature() -> MeshSequence {
    Subject::Creature
        .synthesize(&Settings {
            frames: 12,
            vertices: 900,
            seed: 0,
        })
        .unwrap()
}

fn studio(sequence: &MeshSequence) -> Studio<'_> {
    let shapes: Vec<&[[f32; 3]]> = sequence.shapes.iter().collect();
    Studio::new(&sequence.shapes[0], &sequence.faces, &shapes, Style::new(160, 120))
}

#[test]
fn shapes_fill_the_picture_and_touch_no_border() {
    for subject in Subject::ALL {
        let sequence = subject
            .synthesize(&Settings {
                frames: 8,
                vertices: 900,
                seed: 0,
            })
            .unwrap();
        let image = studio(&sequence).shape(&sequence.shapes[7]);
        let coverage = image.coverage();
        assert!((0.05..0.8).contains(&coverage), "{}: {coverage}", subject.name());
        let opaque = |x: u32, y: u32| image.rgba[((y * image.width + x) * 4 + 3) as usize] > 127;
        assert!(!(0..image.width).any(|x| opaque(x, 0) || opaque(x, image.height - 1)));
        assert!(!(0..image.height).any(|y| opaque(0, y) || opaque(image.width - 1, y)));
        // Shaded, not flat.
        let mut greens: Vec<u8> = image
            .rgba
            .chunks_exact(4)
            .filter(|p| p[3] == 255)
            .map(|p| p[1])
            .collect();
        greens.sort_unstable();
        assert!(
            greens[greens.len() * 95 / 100] - greens[greens.len() / 20] > 15,
            "{}",
            subject.name()
        );
    }
}

#[test]
fn heat_shows_where_things_move_and_only_there() {
    let sequence = creature();
    let studio = studio(&sequence);
    let (rest, moved) = (&sequence.shapes[0], &sequence.shapes[11]);
    let values = distances(rest, moved);
    let saturated = |image: &Image| {
        let colourful = |p: &[u8]| p[3] == 255 && p[0].max(p[1]).max(p[2]) - p[0].min(p[1]).min(p[2]) > 70;
        image.rgba.chunks_exact(4).filter(|p| colourful(p)).count()
    };
    let heat = studio.component(rest, moved, quantile(&values, 0.95));
    assert!(saturated(&heat) > 200, "{} pixels in colour", saturated(&heat));
    assert_eq!(
        saturated(&studio.component(rest, rest, 1.0)),
        0,
        "what does not move is clay"
    );
    assert_eq!(saturated(&studio.shape(moved)), 0);
    let comparison = studio.comparison(moved, moved, 0.1);
    assert_eq!(comparison.truth, comparison.reconstruction);
    assert_eq!(saturated(&comparison.error), 0, "no error, no colour");
}

#[test]
fn same_input_same_bytes() {
    let sequence = creature();
    let draw = || {
        studio(&sequence)
            .component(&sequence.shapes[0], &sequence.shapes[5], 0.2)
            .png()
            .unwrap()
    };
    assert_eq!(draw(), draw());
}

#[test]
fn png_reads_back() {
    let sequence = creature();
    let image = studio(&sequence).shape(&sequence.shapes[3]);
    let bytes = image.png().unwrap();
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
    let mut rgba = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut rgba).unwrap();
    assert_eq!(rgba, image.rgba);
    assert!(image.data_uri().unwrap().starts_with("data:image/png;base64,iVBOR"));
}

#[test]
fn wrong_meshes_draw_without_panic() {
    let faces = [[0, 1, 2], [0, 1, 9], [2, 1, 0]];
    let positions = [[0.0, 0.0, 0.0], [1.0, f32::NAN, 0.0], [0.0, 1.0, f32::INFINITY]];
    for positions in [&positions[..], &[], &[[0.0; 3]; 3]] {
        let studio = Studio::new(positions, &faces, &[positions], Style::new(16, 12));
        assert_eq!(studio.shape(positions).coverage(), 0.0);
    }
}

#[test]
fn color_maps_darken_evenly_from_clay() {
    for map in [ColorMap::Warm, ColorMap::Cool] {
        let lightness = |value: f32| {
            let [r, g, b] = map.color(value);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        assert!(
            (0..20).all(|i| lightness(i as f32 / 20.0) > lightness((i + 1) as f32 / 20.0)),
            "{map:?}"
        );
        assert_eq!(map.color(f32::NAN), map.color(0.0));
        assert_eq!(map.color(7.0), map.color(1.0));
        for (anchor, value) in map.anchors().iter().zip([0.0, 0.2, 0.4, 0.6, 0.8, 1.0]) {
            let (expected, found) = (linear_from_hex(*anchor), map.color(value));
            // OKLab there and back in f32.
            assert!(
                (0..3).all(|c| (expected[c] - found[c]).abs() < 2e-3),
                "{map:?} at {value}"
            );
        }
    }
}

#[test]
fn subjects_stand_upright_and_look_ahead() {
    for subject in Subject::ALL {
        let sequence = subject
            .synthesize(&Settings {
                frames: 2,
                vertices: 900,
                seed: 0,
            })
            .unwrap();
        for turned in [false, true] {
            // The same subject with z up.
            let rest: Vec<[f32; 3]> = sequence.shapes[0]
                .iter()
                .map(|&[x, y, z]| if turned { [x, -z, y] } else { [x, y, z] })
                .collect();
            let orientation = orient(&rest, &sequence.faces);
            let up = if turned { orientation.up.z } else { orientation.up.y };
            assert_eq!(up, 1.0, "{} turned {turned}", subject.name());
            if subject == Subject::Creature {
                assert_eq!(
                    if turned {
                        -orientation.front.y
                    } else {
                        orientation.front.z
                    },
                    1.0
                );
            }
        }
    }
}

fn sample_report() -> Report {
    let sequence = creature();
    let studio = studio(&sequence);
    let image = || studio.shape(&sequence.shapes[4]);
    let component = |name: &str, level, parent, negative: bool| ComponentPicture {
        name: name.to_owned(),
        level,
        parent,
        positive: image(),
        negative: negative.then(image),
        strength: 0.4,
        locality: 0.93,
        range: [-1.5, 2.0],
        label: "left-front-swing".to_owned(),
        mirror: negative.then(|| "c07".to_owned()),
    };
    Report {
        title: "A <creature> & its \"parts\"".to_owned(),
        intro: "Walks.".to_owned(),
        facts: vec![("shapes".to_owned(), "12".to_owned())],
        sample_shapes: vec![Picture {
            image: image(),
            caption: "shape 4".to_owned(),
        }],
        tree: vec![
            component("c00", 0, None, true),
            component("c01", 0, None, false),
            component("c00.1", 1, Some(0), false),
            component("c00.1.1", 2, Some(2), false),
            component("c01.1", 1, Some(1), false),
        ],
        component_scale: "0.31 m".to_owned(),
        comparisons: vec![Comparison {
            shape_name: "creature[4]".to_owned(),
            truth: image(),
            reconstruction: image(),
            error: image(),
            e_rms: 3.25,
        }],
        error_scale: "12 mm".to_owned(),
        error_table: vec![ErrorRow {
            method: "sinew".to_owned(),
            e_rms: Some(3.3),
            is_main: true,
            ..ErrorRow::default()
        }],
        curve: (0..50)
            .map(|i| CurvePoint {
                step: 10 * i,
                loss: (-0.1 * i as f64).exp(),
                validation: (i % 5 == 0).then(|| 2.0 * (-0.05 * i as f64).exp()),
            })
            .collect(),
        provenance: "seed = 0\nlevels = [10, 5]".to_owned(),
        notes: vec!["Nothing <b>else</b>.".to_owned()],
    }
}

/// Opens and closes of every tag must nest; void tags and `/>` stand alone.
fn check_tags(page: &str) {
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page;
    while let Some(start) = rest.find('<') {
        let end = start + rest[start..].find('>').expect("a tag that ends");
        let tag = &rest[start + 1..end];
        rest = &rest[end + 1..];
        let name = tag.trim_start_matches('/').split([' ', '/']).next().unwrap_or("");
        if let Some(closed) = tag.strip_prefix('/') {
            assert_eq!(
                open.pop(),
                Some(closed),
                "before {}",
                rest.chars().take(60).collect::<String>()
            );
        } else if !(tag.ends_with('/') || tag.starts_with('!') || ["meta", "img", "br"].contains(&name)) {
            open.push(name);
        }
        assert_eq!(
            tag.matches('"').count() % 2,
            0,
            "quotes in {}",
            tag.chars().take(60).collect::<String>()
        );
    }
    assert!(open.is_empty(), "left open: {open:?}");
}

#[test]
fn page_is_well_formed_and_stands_alone() {
    let report = sample_report();
    let page = report.render().unwrap();
    check_tags(&page);
    assert!(page.contains("A &lt;creature&gt; &amp; its &quot;parts&quot;"));
    assert!(page.contains("Nothing &lt;b&gt;else&lt;/b&gt;."));
    assert_eq!(
        page.matches("<img ").count(),
        page.matches(" alt=\"").count(),
        "every picture says what it shows"
    );
    assert!(
        !page.contains("http://") && !page.contains("https://"),
        "nothing is loaded from elsewhere"
    );
    for component in &report.tree {
        assert_eq!(
            page.matches(&format!("<b>{}</b>", component.name)).count(),
            1,
            "{} once",
            component.name
        );
    }
    assert_eq!(page.matches("<polyline").count(), 2);
    assert_eq!(page, report.render().unwrap());
    check_tags(&Report::default().render().unwrap());
}

#[test]
fn page_is_written_whole_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("report.html");
    let report = Report {
        title: "t".to_owned(),
        ..Report::default()
    };
    report.write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), report.render().unwrap());
    assert_eq!(
        std::fs::read_dir(folder.path()).unwrap().count(),
        1,
        "no temporary file stays"
    );
    let missing = folder.path().join("no such folder").join("report.html");
    let refused = report.write(&missing).unwrap_err().to_string();
    assert!(refused.contains("no such folder"), "{refused}");
}

//! Regions that the user paints: which vertices a coarse component is to live on. They stand in the configuration, take the
//! place of found regions at the start of training, and name what comes of them.

use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Serialize};
use sinew_formats::package::{CompactView, NONE};

use super::rename::{is_name, is_place, places};

/// A named set of vertices.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PaintedRegion {
    /// Name of the coarse component that lives there, as `sinew rename` allows it.
    pub name: String,
    /// Where it lives, as text: `3 10-25 40`, numbers from 0.
    pub vertices: Vertices,
}

/// Vertex numbers from 0, ascending and each once. As text, runs are written with a dash: `3 10-25 40`.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Vertices(Vec<u32>);

/// A text that lists no vertices.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: `{word}` is no vertex number and no run of them such as 10-25")]
pub struct VerticesError {
    /// From 1.
    pub line: usize,
    /// As written.
    pub word: String,
}

/// Most bytes of a region's name: those of a component less what the deepest child adds.
pub(super) const NAME_LENGTH: usize = 40;

/// Why painted regions cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PaintError {
    /// Nothing is painted.
    #[error("region `{0}` has no vertex: list at least one")]
    Empty(String),
    /// The mesh is smaller.
    #[error("region `{name}` names vertex {vertex}, but the mesh has {vertex_count}, numbered from 0")]
    NoSuchVertex {
        /// The region.
        name: String,
        /// Its first vertex that is not there.
        vertex: u32,
        /// V.
        vertex_count: usize,
    },
    /// A vertex can follow one region.
    #[error("vertex {vertex} is painted twice, in `{first}` and in `{second}`: leave it to one of them")]
    Overlap {
        /// The first that both have.
        vertex: u32,
        /// A region.
        first: String,
        /// The other.
        second: String,
    },
    /// No component can be called so.
    #[error(
        "`{0}` cannot name a component: names are made of letters, digits, `-` and `_`, begin with a letter, have at most {NAME_LENGTH} \
         bytes, and are not those of places such as c0"
    )]
    Name(String),
    /// Two regions of one name.
    #[error("two painted regions are called `{0}`")]
    SameName(String),
    /// No component is left for the rest of the mesh.
    #[error(
        "painted regions: {painted}, coarse components: {coarse}; one of these at least must be left for the rest of the mesh"
    )]
    TooMany {
        /// Regions.
        painted: usize,
        /// Components of the coarsest level.
        coarse: usize,
    },
    /// A random start has no regions.
    #[error("painted regions need start.kind = \"closed-form\": a random start (--recipe paper) has no regions")]
    RandomStart,
}

impl Vertices {
    /// Of any numbers.
    pub fn new(mut vertices: Vec<u32>) -> Self {
        vertices.sort_unstable();
        vertices.dedup();
        Self(vertices)
    }

    /// Ascending.
    pub fn as_slice(&self) -> &[u32] {
        &self.0
    }
}

impl FromStr for Vertices {
    type Err = VerticesError;

    /// Numbers and runs, apart by spaces, commas or line ends; what follows a `#` is a remark.
    fn from_str(text: &str) -> Result<Self, VerticesError> {
        /// More than any mesh here has; more numbers, or greater ones, are a slip of the pen.
        const MOST: u32 = 1 << 24;
        let mut vertices = Vec::new();
        for (n, line) in text.lines().enumerate() {
            let line_text = line.split('#').next().unwrap_or_default();
            let words = line_text.split(|c: char| c.is_whitespace() || c == ',');
            for word in words.filter(|word| !word.is_empty()) {
                let fail = || VerticesError {
                    line: n + 1,
                    word: word.to_owned(),
                };
                let (first, last) = word.split_once('-').unwrap_or((word, word));
                let [first, last] = [first, last].map(|number| number.parse::<u32>().ok().filter(|&v| v < MOST));
                let (first, last) = first.zip(last).ok_or_else(fail)?;
                if first > last || vertices.len() + (last - first) as usize >= MOST as usize {
                    return Err(fail());
                }
                vertices.extend(first..=last);
            }
        }
        Ok(Self::new(vertices))
    }
}

impl TryFrom<String> for Vertices {
    type Error = VerticesError;

    fn try_from(text: String) -> Result<Self, VerticesError> {
        text.parse()
    }
}

impl From<Vertices> for String {
    fn from(vertices: Vertices) -> Self {
        vertices.to_string()
    }
}

impl fmt::Display for Vertices {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (n, run) in self.0.chunk_by(|a, b| a + 1 == *b).enumerate() {
            let space = if n == 0 { "" } else { " " };
            match run {
                [one] => write!(f, "{space}{one}")?,
                _ => write!(f, "{space}{}-{}", run[0], run[run.len() - 1])?,
            }
        }
        Ok(())
    }
}

/// The region of every vertex that is painted. Shape: `[V]`.
/// Errors: those of [`PaintError`] but the last; `coarse` is the number of components of the coarsest level.
pub fn painted_labels(
    regions: &[PaintedRegion],
    vertex_count: usize,
    coarse: usize,
) -> Result<Vec<Option<u32>>, PaintError> {
    if !regions.is_empty() && regions.len() >= coarse {
        return Err(PaintError::TooMany {
            painted: regions.len(),
            coarse,
        });
    }
    let mut labels: Vec<Option<u32>> = vec![None; vertex_count];
    for (r, region) in regions.iter().enumerate() {
        let name = &region.name;
        if !is_region_name(name) {
            return Err(PaintError::Name(name.clone()));
        }
        if regions[..r].iter().any(|other| other.name == *name) {
            return Err(PaintError::SameName(name.clone()));
        }
        if region.vertices.as_slice().is_empty() {
            return Err(PaintError::Empty(region.name.clone()));
        }
        for &vertex in region.vertices.as_slice() {
            let Some(label) = labels.get_mut(vertex as usize) else {
                return Err(PaintError::NoSuchVertex {
                    name: region.name.clone(),
                    vertex,
                    vertex_count,
                });
            };
            if let Some(other) = label.replace(r as u32) {
                return Err(PaintError::Overlap {
                    vertex,
                    first: regions[other as usize].name.clone(),
                    second: region.name.clone(),
                });
            }
        }
    }
    Ok(labels)
}

/// Whether a coarse component, and with a number behind a dot what lies below it, can be called so.
pub(super) fn is_region_name(name: &str) -> bool {
    is_name(name) && !is_place(name) && name.len() <= NAME_LENGTH && !name.contains('.')
}

/// Pairs for [`super::rename::new_names`]: component number `root` is called `name`, those below it `name.0` and so on.
/// `places`: those of all components, from [`places`].
pub fn with_those_below(places: &[String], root: usize, name: &str) -> Vec<(String, String)> {
    let below = format!("{}.", places[root]);
    let own = (places[root].clone(), name.to_owned());
    let others = places.iter().filter_map(|place| {
        let rest = place.strip_prefix(&below)?;
        Some((place.clone(), format!("{name}.{rest}")))
    });
    core::iter::once(own).chain(others).collect()
}

/// Places and new names of the coarse component that lives on each painted region alone, `ear`, and of what lies below it,
/// `ear.0`. Of several it is the one that moves most vertices, those not asked that are `taken`; a region where nothing lives gives no
/// name. The regions are those of [`painted_labels`], of the package's mesh.
pub fn painted_names(view: &CompactView<'_>, regions: &[PaintedRegion], taken: &[usize]) -> Vec<(String, String)> {
    let places = places(view);
    let roots: Vec<usize> = view
        .blocks()
        .filter(|block| block.parent_component == NONE)
        .flat_map(|block| (0..block.component_count).map(move |i| (block.first_component + i) as usize))
        .filter(|root| !taken.contains(root))
        .collect();
    let mut names = Vec::new();
    for region in regions {
        let mut inside = vec![false; view.vertex_count()];
        for &v in region.vertices.as_slice() {
            inside[v as usize] = true;
        }
        // Vertices that a component moves; none once it moves one outside.
        let mut moved = vec![Some(0_usize); view.component_count()];
        for entry in view.entries() {
            let count = &mut moved[entry.component];
            *count = count.filter(|_| inside[entry.vertex]).map(|count| count + 1);
        }
        let living = roots.iter().filter(|&&k| moved[k].is_some_and(|count| count > 0));
        let Some(&root) = living.max_by_key(|&&k| (moved[k], core::cmp::Reverse(k))) else {
            continue;
        };
        names.extend(with_those_below(&places, root, &region.name));
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    fn region(name: &str, vertices: &str) -> PaintedRegion {
        PaintedRegion {
            name: name.into(),
            vertices: vertices.parse().unwrap(),
        }
    }

    #[test]
    fn lists_of_vertices_are_read_and_written() {
        let read: Vertices = "7, 3 # the tip\n10-12\n\n11".parse().unwrap();
        assert_eq!(read.as_slice(), [3, 7, 10, 11, 12]);
        assert_eq!(read.to_string(), "3 7 10-12");
        assert_eq!(read.to_string().parse::<Vertices>().unwrap(), read);
        for (text, line, word) in [
            ("1\nx", 2, "x"),
            ("5-2", 1, "5-2"),
            ("-4", 1, "-4"),
            ("0-4000000000", 1, "0-4000000000"),
            ("0-9000000\n0-9000000", 2, "0-9000000"),
        ] {
            let expected = VerticesError {
                line,
                word: word.into(),
            };
            assert_eq!(text.parse::<Vertices>(), Err(expected));
        }
    }

    #[test]
    fn what_cannot_be_painted_is_named() {
        let regions = [region("ear", "0-3"), region("tail", "8 9")];
        let labels = painted_labels(&regions, 10, 3).unwrap();
        assert_eq!(labels[..5], [Some(0), Some(0), Some(0), Some(0), None]);
        assert_eq!(labels[9], Some(1));
        assert_eq!(
            painted_labels(&regions, 10, 2),
            Err(PaintError::TooMany { painted: 2, coarse: 2 })
        );
        let error = |regions: &[PaintedRegion]| painted_labels(regions, 10, 3).unwrap_err().to_string();
        assert!(error(&[region("c0", "1")]).contains("`c0` cannot name"));
        assert!(error(&[region("ear", "1"), region("ear", "2")]).contains("two painted regions"));
        assert!(error(&[region("ear", "")]).contains("`ear` has no vertex"));
        assert!(error(&[region("ear", "10")]).contains("vertex 10, but the mesh has 10"));
        assert!(error(&[region("ear", "0-3"), region("tail", "3 4")]).contains("vertex 3 is painted twice"));
        assert!(painted_labels(&[], 10, 1).unwrap().iter().all(Option::is_none));
    }
}

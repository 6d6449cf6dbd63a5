//! What was odd about a sequence and handled without refusing it; the trainer prints these.

use core::fmt;

/// Something odd that was handled.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Notice {
    /// Files of the folder that are no shapes were left aside.
    IgnoredFiles {
        /// How many.
        count: usize,
        /// The first of them.
        example: String,
    },
    /// Faces with more than three corners were split into triangles, every shape alike.
    PolygonsTriangulated {
        /// Number of polygons.
        count: usize,
        /// Number of triangles they became.
        triangle_count: usize,
    },
    /// Triangles that name one vertex twice were dropped.
    CollapsedTriangles {
        /// How many.
        count: usize,
    },
    /// Points, lines, strips and other things in the reference file that are not faces were ignored.
    IgnoredElements {
        /// How many.
        count: usize,
    },
    /// Vertices that no triangle uses were kept.
    IsolatedVertices {
        /// How many.
        count: usize,
        /// The first of them.
        first: usize,
    },
    /// The reference has texture coordinates, but something is wrong with them: the sequence goes without.
    TextureIgnored {
        /// What is wrong.
        problem: String,
    },
    /// Vertices that the format splits along seams were welded; what an engine draws keeps them apart.
    SeamsWelded {
        /// Vertices of the file.
        from: usize,
        /// Vertices of the sequence.
        to: usize,
    },
    /// One mesh deforms and was taken; the others were left out.
    MeshesLeftOut {
        /// How many.
        count: usize,
        /// The first of them.
        example: String,
    },
    /// Something that only a reader of this format can tell.
    Remark(String),
    /// Vertices that lie exactly on another one in the reference were kept.
    DuplicateVertices {
        /// How many, not counting the one they lie on.
        count: usize,
        /// The first of them.
        first: usize,
    },
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Notice::IgnoredFiles { count: 1, example } => {
                write!(f, "`{example}` of the folder is no shape and was ignored")
            }
            Notice::IgnoredFiles { count, example } => {
                write!(
                    f,
                    "{count} files of the folder are no shapes and were ignored, the first is `{example}`"
                )
            }
            Notice::PolygonsTriangulated { count, triangle_count } => {
                write!(
                    f,
                    "{count} polygons were split into {triangle_count} triangles, every shape alike"
                )
            }
            Notice::CollapsedTriangles { count } => {
                write!(f, "{count} triangles that name one vertex twice were dropped")
            }
            Notice::IgnoredElements { count } => {
                write!(
                    f,
                    "{count} points, lines or other elements that are no faces were ignored"
                )
            }
            Notice::IsolatedVertices { count, first } => {
                write!(
                    f,
                    "{count} vertices belong to no triangle (the first is {first}); they were kept"
                )
            }
            Notice::TextureIgnored { problem } => write!(f, "texture coordinates were ignored: {problem}"),
            Notice::SeamsWelded { from, to } => {
                write!(
                    f,
                    "{from} vertices of the file were welded along seams to {to}; what is drawn keeps all {from}"
                )
            }
            Notice::MeshesLeftOut { count, example } => {
                write!(
                    f,
                    "{count} other meshes, the first is `{example}`, do not deform and were left out; --mesh all takes them too"
                )
            }
            Notice::Remark(text) => f.write_str(text),
            Notice::DuplicateVertices { count, first } => {
                write!(
                    f,
                    "{count} vertices lie exactly on another one (the first is {first}); they were kept"
                )
            }
        }
    }
}

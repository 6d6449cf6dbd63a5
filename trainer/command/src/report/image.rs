//! Pixels and their way into a file: PNG bytes and data URIs.

use base64::Engine;

/// A picture with straight (not premultiplied) alpha, sRGB.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Red, green, blue, alpha. Shape: `[height][width][4]`, top row first.
    pub rgba: Vec<u8>,
}

/// Why a picture could not be encoded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The pixels do not fill the picture, or the picture is empty.
    #[error("a picture of {width} x {height} cannot be written as PNG: {source}")]
    Encode {
        /// Pixels across.
        width: u32,
        /// Pixels down.
        height: u32,
        /// What the encoder said.
        source: png::EncodingError,
    },
}

impl Image {
    /// PNG bytes, the same for the same pixels. Errors: an empty picture, or pixels that do not fill it.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        self.encode().map_err(|source| ImageError::Encode {
            width: self.width,
            height: self.height,
            source,
        })
    }

    fn encode(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        encoder.set_filter(png::Filter::Adaptive);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&self.rgba)?;
        writer.finish()?;
        Ok(bytes)
    }

    /// The PNG as `data:image/png;base64,...`, ready for an `img` tag. Errors: as [`Image::png`].
    pub fn data_uri(&self) -> Result<String, ImageError> {
        Ok(format!(
            "data:image/png;base64,{}",
            base64::engine::general_purpose::STANDARD.encode(self.png()?)
        ))
    }

    /// Share of the pixels that are at least half opaque. Range: 0 to 1.
    pub fn coverage(&self) -> f64 {
        let opaque = self.rgba.chunks_exact(4).filter(|pixel| pixel[3] > 127).count();
        opaque as f64 / (self.rgba.len() / 4).max(1) as f64
    }
}

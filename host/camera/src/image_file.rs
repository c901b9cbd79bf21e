//! Grey images from PNG and JPEG files, and to PNG files.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use png::{BitDepth, ColorType, Transformations};
use zune_core::bytestream::ZCursor;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;

use crate::grey::{GreyImage, GreyImageError, MAX_SIDE};

/// The first bytes of a JPEG file.
const JPEG: [u8; 3] = [0xff, 0xd8, 0xff];

/// Parts of red, green and blue in the brightness, in 1/1000: ITU-R BT.601, as in JPEG.
const LUMA: [u32; 3] = [299, 587, 114];

/// Why a file is not read or written.
#[derive(Debug, thiserror::Error)]
pub enum ImageFileError {
    /// The system does not give or take it.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// It is damaged, or of another kind.
    #[error("{path}: {reason}; give a PNG or JPEG file")]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// Its pixels are no image.
    #[error("{path}: {source}")]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong with them.
        source: GreyImageError,
    },
}

/// Reads a PNG or JPEG file, by its first bytes; of colours the brightness.
///
/// # Errors
///
/// The file cannot be read, is damaged or is no such image.
pub fn read(path: &Path) -> Result<GreyImage, ImageFileError> {
    let bytes = fs::read(path).map_err(|source| ImageFileError::Io { path: path.to_owned(), source })?;
    let decoded = if bytes.starts_with(&JPEG) { jpeg(&bytes) } else { png(&bytes) };
    let ([width, height], pixels) =
        decoded.map_err(|reason| ImageFileError::Format { path: path.to_owned(), reason })?;
    GreyImage::new(width, height, pixels).map_err(|source| ImageFileError::Image { path: path.to_owned(), source })
}

/// Width, height and pixels.
type Pixels = ([usize; 2], Vec<u8>);

fn jpeg(bytes: &[u8]) -> Result<Pixels, String> {
    let options = DecoderOptions::default()
        .jpeg_set_out_colorspace(ColorSpace::Luma)
        .set_max_width(MAX_SIDE)
        .set_max_height(MAX_SIDE);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let pixels = decoder.decode().map_err(|error| format!("{error:?}"))?;
    let (width, height) = decoder.dimensions().ok_or("it has no size")?;
    Ok(([width, height], pixels))
}

fn png(bytes: &[u8]) -> Result<Pixels, String> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::EXPAND | Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(|error| error.to_string())?;
    let size = reader.output_buffer_size().ok_or("it is too large")?;
    if size > 4 * MAX_SIDE * MAX_SIDE {
        return Err("it is too large".into());
    }
    let mut samples = vec![0; size];
    let frame = reader.next_frame(&mut samples).map_err(|error| error.to_string())?;
    samples.truncate(frame.buffer_size());
    let luma = |colour: &[u8]| {
        let sum: u32 = colour.iter().zip(LUMA).map(|(sample, part)| u32::from(*sample) * part).sum();
        ((sum + 500) / 1000) as u8
    };
    // Transparency is left out.
    let pixels = match frame.color_type {
        ColorType::Grayscale => samples,
        ColorType::GrayscaleAlpha => samples.chunks_exact(2).map(|pixel| pixel[0]).collect(),
        ColorType::Rgb => samples.chunks_exact(3).map(luma).collect(),
        ColorType::Rgba => samples.chunks_exact(4).map(|pixel| luma(&pixel[..3])).collect(),
        ColorType::Indexed => return Err("its palette cannot be expanded".into()),
    };
    Ok(([frame.width as usize, frame.height as usize], pixels))
}

/// Writes a PNG file.
///
/// # Errors
///
/// The file cannot be written.
pub fn write_png(path: &Path, image: &GreyImage) -> Result<(), ImageFileError> {
    let mut bytes = Vec::new();
    encode(&mut bytes, image)
        .map_err(|error| ImageFileError::Format { path: path.to_owned(), reason: error.to_string() })?;
    fs::write(path, bytes).map_err(|source| ImageFileError::Io { path: path.to_owned(), source })
}

fn encode(bytes: &mut Vec<u8>, image: &GreyImage) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(bytes, image.width() as u32, image.height() as u32);
    encoder.set_color(ColorType::Grayscale);
    encoder.set_depth(BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.pixels())?;
    writer.finish()
}

#[cfg(test)]
mod tests {
    use super::{ImageFileError, read, write_png};
    use crate::grey::GreyImage;

    #[test]
    fn a_file_that_is_read_again_is_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        let image = GreyImage::new(3, 2, vec![0, 50, 100, 150, 200, 250]).unwrap();
        write_png(&path, &image).unwrap();
        assert_eq!(read(&path).unwrap(), image);
        let bytes = std::fs::read(&path).unwrap();
        for cut in 0..bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let _ = read(&path);
        }
        std::fs::write(&path, b"no image").unwrap();
        assert!(matches!(read(&path), Err(ImageFileError::Format { .. })));
        assert!(matches!(read(folder.path()), Err(ImageFileError::Io { .. })));
    }

    #[test]
    fn damaged_jpeg_files_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.jpg");
        std::fs::write(&path, [0xff, 0xd8, 0xff, 0xe0, 0, 4, 1, 2, 0xff, 0xda]).unwrap();
        assert!(matches!(read(&path), Err(ImageFileError::Format { .. })));
    }
}

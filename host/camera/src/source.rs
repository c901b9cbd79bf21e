//! Where pictures come from: a folder of images, one image, raw grey frames from a pipe.
//!
//! Video of a device or a network camera comes through the pipe, from a program that decodes it:
//!
//! ```sh
//! ffmpeg -f v4l2 -video_size 1280x720 -i /dev/video0 -f rawvideo -pix_fmt gray - | darm camera watch - --frame 1280x720 …
//! ```

use std::io::Read;
use std::path::{Path, PathBuf};

use crate::grey::{GreyImage, GreyImageError};
use crate::image_file::{self, ImageFileError};

/// Endings of files that are read from a folder.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];

/// A picture with its name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// The name of its file, or its number in the stream.
    pub name: String,
    /// The picture.
    pub image: GreyImage,
}

/// Why there are no pictures.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// The file or folder cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The path, or `-`.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The folder has no images.
    #[error("{path}: no PNG or JPEG files in this folder")]
    Empty {
        /// The folder.
        path: PathBuf,
    },
    /// A device, or the address of a network camera.
    #[error(
        "{text}: video is read from a pipe; run `ffmpeg -i {text} -f rawvideo -pix_fmt gray -` in front of it and give - with --frame WIDTHxHEIGHT"
    )]
    Video {
        /// What was given.
        text: String,
    },
    /// A pipe without the size of its frames.
    #[error("frames from a pipe have no size; give it with --frame WIDTHxHEIGHT")]
    NoSize,
    /// The pipe ended within a frame.
    #[error(
        "the pipe ended after {found} of {expected} bytes of frame {frame}; are the frames grey, one byte a pixel?"
    )]
    Cut {
        /// Number of the frame, from 0.
        frame: u64,
        /// Bytes of it.
        found: usize,
        /// Bytes of a frame.
        expected: usize,
    },
    /// A file is no image.
    #[error(transparent)]
    Image(#[from] ImageFileError),
    /// The size is none of a picture.
    #[error(transparent)]
    Size(#[from] GreyImageError),
}

/// Something that gives pictures one after the other.
pub trait FrameSource {
    /// The next picture; `None` at the end. After an error of one picture the next may be taken.
    ///
    /// # Errors
    ///
    /// The picture cannot be read.
    fn next_frame(&mut self) -> Result<Option<Frame>, SourceError>;
}

/// Opens what a user names: a file, a folder, or `-` for frames of a size from standard input.
///
/// # Errors
///
/// There is no such file, or no image in the folder.
pub fn open(text: &str, size: Option<[usize; 2]>) -> Result<Box<dyn FrameSource>, SourceError> {
    if text == "-" {
        return Ok(Box::new(Pipe::new(std::io::stdin(), size.ok_or(SourceError::NoSize)?)?));
    }
    if text.contains("://") || text.starts_with("/dev/") {
        return Err(SourceError::Video { text: text.to_owned() });
    }
    Ok(Box::new(Files::open(Path::new(text))?))
}

/// Image files in the order of their names.
pub struct Files {
    left: std::vec::IntoIter<PathBuf>,
}

impl Files {
    /// One image, or those of a folder.
    ///
    /// # Errors
    ///
    /// There is no such file, or no image in the folder.
    pub fn open(path: &Path) -> Result<Self, SourceError> {
        let failed = |source| SourceError::Io { path: path.to_owned(), source };
        if !std::fs::metadata(path).map_err(failed)?.is_dir() {
            return Ok(Self { left: vec![path.to_owned()].into_iter() });
        }
        let is_image = |path: &PathBuf| {
            let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
            ending.is_some_and(|ending| ENDINGS.contains(&&ending[..]))
        };
        let entries = std::fs::read_dir(path).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).filter(is_image).collect();
        if paths.is_empty() {
            return Err(SourceError::Empty { path: path.to_owned() });
        }
        paths.sort();
        Ok(Self { left: paths.into_iter() })
    }
}

impl FrameSource for Files {
    fn next_frame(&mut self) -> Result<Option<Frame>, SourceError> {
        let Some(path) = self.left.next() else { return Ok(None) };
        let name = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        Ok(Some(Frame { name, image: image_file::read(&path)? }))
    }
}

/// Raw frames: one byte a pixel, row by row, without anything between frames.
pub struct Pipe<R> {
    bytes: R,
    size: [usize; 2],
    count: u64,
}

impl<R: Read> Pipe<R> {
    /// Frames of this width and height.
    ///
    /// # Errors
    ///
    /// The size is none of an image.
    pub fn new(bytes: R, size: [usize; 2]) -> Result<Self, SourceError> {
        let [width, height] = size;
        // Checks the sides before a frame's memory is taken.
        match GreyImage::new(width, height, Vec::new()) {
            Err(error @ GreyImageError::Size { .. }) => Err(error.into()),
            _ => Ok(Self { bytes, size, count: 0 }),
        }
    }
}

impl<R: Read> FrameSource for Pipe<R> {
    fn next_frame(&mut self) -> Result<Option<Frame>, SourceError> {
        let [width, height] = self.size;
        let (expected, frame) = (width * height, self.count);
        let mut pixels = Vec::with_capacity(expected);
        let failed = |source| SourceError::Io { path: "-".into(), source };
        self.bytes.by_ref().take(expected as u64).read_to_end(&mut pixels).map_err(failed)?;
        match pixels.len() {
            0 => Ok(None),
            found if found < expected => Err(SourceError::Cut { frame, found, expected }),
            _ => {
                self.count += 1;
                Ok(Some(Frame { name: frame.to_string(), image: GreyImage::new(width, height, pixels)? }))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Files, FrameSource as _, Pipe, SourceError, open};
    use crate::grey::GreyImage;
    use crate::image_file::write_png;

    #[test]
    fn frames_of_a_pipe_are_cut_by_their_size() {
        let mut pipe = Pipe::new(&[1, 2, 3, 4, 5][..], [2, 1]).unwrap();
        let frame = pipe.next_frame().unwrap().unwrap();
        assert_eq!((&frame.name[..], frame.image.pixels()), ("0", &[1, 2][..]));
        assert!(pipe.next_frame().unwrap().is_some());
        assert!(matches!(pipe.next_frame(), Err(SourceError::Cut { frame: 2, found: 1, expected: 2 })));
        assert!(pipe.next_frame().unwrap().is_none());
        assert!(matches!(Pipe::new(&[][..], [0, 1]), Err(SourceError::Size(_))));
    }

    #[test]
    fn images_of_a_folder_come_by_name_and_a_damaged_one_ends_nothing() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(Files::open(folder.path()), Err(SourceError::Empty { .. })));
        let image = GreyImage::new(2, 1, vec![3, 4]).unwrap();
        write_png(&folder.path().join("c.png"), &image).unwrap();
        write_png(&folder.path().join("a.png"), &image).unwrap();
        std::fs::write(folder.path().join("b.jpg"), b"damaged").unwrap();
        let mut files = Files::open(folder.path()).unwrap();
        assert_eq!(files.next_frame().unwrap().unwrap().name, "a.png");
        assert!(matches!(files.next_frame(), Err(SourceError::Image(_))));
        assert_eq!(files.next_frame().unwrap().unwrap().name, "c.png");
        assert!(files.next_frame().unwrap().is_none());
    }

    #[test]
    fn what_is_not_read_is_refused_with_what_to_do() {
        assert!(open("/dev/video0", None).is_err_and(|error| error.to_string().contains("ffmpeg -i /dev/video0")));
        assert!(open("-", None).is_err_and(|error| error.to_string().contains("--frame")));
        assert!(matches!(open("missing/folder", None), Err(SourceError::Io { .. })));
    }
}

//! Bag folders of ROS 2: `metadata.yaml` and the files of the storage that it names.

use std::path::{Path, PathBuf};

use crate::foreign::CONVERT_BAG;

use crate::import::error::ImportError;

/// The MCAP files of a bag, in their order.
pub(crate) fn files(folder: &Path) -> Result<Vec<PathBuf>, ImportError> {
    let path = folder.join("metadata.yaml");
    let error = |text: &str| ImportError::new(folder, "", text);
    let Ok(text) = std::fs::read_to_string(&path) else {
        return Err(error("the folder has no metadata.yaml: give the folder of a ROS 2 bag, or the files themselves"));
    };
    let value = |key: &str| {
        let found = text.lines().find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(':'));
        found.map(plain).unwrap_or_default()
    };
    let storage = value("storage_identifier");
    if storage == "sqlite3" {
        return Err(ImportError::new(
            &path,
            "",
            format!("the bag is stored in SQLite, only MCAP is read: {CONVERT_BAG}"),
        ));
    }
    if storage != "mcap" {
        return Err(ImportError::new(&path, "", format!("the storage `{storage}` is unknown, only mcap is read")));
    }
    if value("compression_mode").eq_ignore_ascii_case("file") {
        return Err(ImportError::new(
            &path,
            "",
            "its files are compressed as files: expand them with `zstd -d`, then import them",
        ));
    }
    let listed = text.lines().skip_while(|line| line.trim() != "relative_file_paths:").skip(1);
    let names: Vec<&str> = listed.map_while(|line| line.trim().strip_prefix('-').map(plain)).collect();
    if names.is_empty() {
        return Err(ImportError::new(
            &path,
            "",
            "relative_file_paths names no file: the bag was not closed, import its MCAP file",
        ));
    }
    Ok(names.into_iter().map(|name| folder.join(name)).collect())
}

/// A scalar of YAML without quotes.
fn plain(text: &str) -> &str {
    text.trim().trim_matches(['"', '\''])
}

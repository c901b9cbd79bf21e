//! A table or a board profile as the bytes that a board stores.

use darm_core::table::Record;
use darm_core::units::{Digest, ModelHash};
use darm_core::wire::message::{Image, ImageKind};
use serde::Serialize;
use sha2::{Digest as _, Sha256};

/// A table or a board profile as it travels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UploadImage {
    image: Image,
    bytes: Vec<u8>,
}

impl UploadImage {
    /// The image of a table's records, made for `model`.
    pub fn table(records: &[Record], model: ModelHash) -> Self {
        Self::of(ImageKind::Table, model, records)
    }

    /// The image of records of a kind.
    ///
    /// # Panics
    ///
    /// A record cannot be serialised by postcard: it has a sequence of unknown length, say.
    pub fn of(kind: ImageKind, model: ModelHash, records: &[impl Serialize]) -> Self {
        let append = |bytes, record| postcard::to_extend(record, bytes).expect("memory takes any record");
        let bytes = records.iter().fold(Vec::new(), append);
        let digest = Digest(Sha256::digest(&bytes).into());
        Self { image: Image { kind, len: bytes.len() as u32, digest, model }, bytes }
    }

    /// Kind, length, digest and model.
    pub fn image(&self) -> Image {
        self.image
    }

    /// The records, one after the other.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

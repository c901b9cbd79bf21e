//! Records that are written twice: one that is damaged would read as none.

use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::map::{SerializationError, Value};
use serde::{Deserialize, Serialize};

use super::Store;
use super::error::StorageError;
use super::layout::{KEY_NEWEST, SECOND};

/// A record that is written twice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Doubled<V> {
    value: V,
    /// How often it was written: where one copy is damaged or a power cut came between, the larger number holds. From 1.
    version: u32,
}

/// By hand: the feature `postcard` of `sequential-storage` turns on the default features of postcard, which are six more packages.
impl<'a, V: Serialize + Deserialize<'a>> Value<'a> for Doubled<V> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        // A full buffer is the only way in which a record of a fixed shape is not written.
        postcard::to_slice(self, buffer).map(|used| used.len()).map_err(|_| SerializationError::BufferTooSmall)
    }

    fn deserialize_from(buffer: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        let value = postcard::from_bytes(buffer).map_err(|_| SerializationError::InvalidFormat)?;
        Ok((value, buffer.len()))
    }
}

impl<F: NorFlash> Store<F> {
    /// The newest record; `None` also where that one is lost and an older one is left.
    pub(super) async fn fetch_doubled<V>(&mut self, key: u8) -> Result<Option<V>, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        Ok(self.newest_copy(key).await?.map(|doubled| doubled.value))
    }

    /// Writes a record again where one copy is damaged or older: after a power cut, for example. The other copy is good: what cannot be
    /// written now is tried again at the next start.
    pub(super) async fn repair<V>(&mut self, key: u8)
    where
        V: Copy + PartialEq + Serialize + for<'a> Deserialize<'a>,
    {
        let Ok(Some(newest)) = self.newest_copy::<V>(key).await else { return };
        for key in [key, key | SECOND] {
            if self.fetch(key).await != Ok(Some(newest)) {
                let _ = self.put(key, &newest).await;
            }
        }
    }

    /// The newer one of two copies, unless a newer one than both was written.
    async fn newest_copy<V>(&mut self, key: u8) -> Result<Option<Doubled<V>>, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        let newer = self.newer_copy::<V>(key).await?;
        let version = self.newest.version(key);
        Ok(newer.filter(|newer| newer.version >= *version).inspect(|newest| *version = newest.version))
    }

    async fn newer_copy<V>(&mut self, key: u8) -> Result<Option<Doubled<V>>, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        let mut newer = None;
        for key in [key, key | SECOND] {
            let copy = self.fetch(key).await?;
            if version_of(&newer) < version_of(&copy) {
                newer = copy;
            }
        }
        Ok(newer)
    }

    /// Replaces a record, and writes down that it is the newest.
    pub(super) async fn replace<V>(&mut self, key: u8, value: V) -> Result<(), StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        let version = self.put_doubled(key, value).await?;
        *self.newest.version(key) = version;
        self.put_doubled(KEY_NEWEST, self.newest).await.map(|_| ())
    }

    /// Writes both copies; their version.
    pub(super) async fn put_doubled<V>(&mut self, key: u8, value: V) -> Result<u32, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        // What cannot be read is replaced. A copy that a power cut left alone is newer than the newest that is known.
        let left = self.newer_copy::<V>(key).await.map_or(0, |left| version_of(&left));
        let version = left.max(*self.newest.version(key)).saturating_add(1);
        let doubled = Doubled { value, version };
        self.put(key, &doubled).await?;
        self.put(key | SECOND, &doubled).await?;
        Ok(version)
    }
}

/// 0 for none.
fn version_of<V>(copy: &Option<Doubled<V>>) -> u32 {
    copy.as_ref().map_or(0, |copy| copy.version)
}

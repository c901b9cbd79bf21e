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

fn newer<V>([first, second]: [Option<Doubled<V>>; 2]) -> Option<Doubled<V>> {
    match (first, second) {
        (Some(first), Some(second)) => Some(if first.version < second.version { second } else { first }),
        (first, second) => first.or(second),
    }
}

impl<F: NorFlash> Store<F> {
    /// The newest record; `None` also where that one is lost and an older one is left.
    pub(super) async fn fetch_doubled<V>(&mut self, key: u8) -> Result<Option<V>, StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        let copies = self.copies(key).await?;
        Ok(self.newest_of(key, copies).map(|doubled| doubled.value))
    }

    /// Writes a record again where one copy is damaged or older: after a power cut, for example. The other copy is good: what cannot be
    /// written now is tried again at the next start.
    pub(super) async fn repair<V>(&mut self, key: u8)
    where
        V: Copy + PartialEq + Serialize + for<'a> Deserialize<'a>,
    {
        let Ok(copies) = self.copies::<V>(key).await else { return };
        let Some(newest) = self.newest_of(key, copies) else { return };
        for (key, copy) in [key, key | SECOND].into_iter().zip(copies) {
            if copy != Some(newest) {
                let _ = self.put(key, &newest).await;
            }
        }
    }

    /// The newer one of two copies, unless a newer one than both was written.
    fn newest_of<V>(&mut self, key: u8, copies: [Option<Doubled<V>>; 2]) -> Option<Doubled<V>> {
        let version = self.newest.version(key);
        let newest = newer(copies).filter(|newer| newer.version >= *version)?;
        *version = newest.version;
        Some(newest)
    }

    async fn copies<V>(&mut self, key: u8) -> Result<[Option<Doubled<V>>; 2], StorageError>
    where
        V: Serialize + for<'a> Deserialize<'a>,
    {
        Ok([self.fetch(key).await?, self.fetch(key | SECOND).await?])
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
        let left = self.copies::<V>(key).await.ok().and_then(newer).map_or(0, |left| left.version);
        let version = left.max(*self.newest.version(key)).saturating_add(1);
        let doubled = Doubled { value, version };
        self.put(key, &doubled).await?;
        self.put(key | SECOND, &doubled).await?;
        Ok(version)
    }
}

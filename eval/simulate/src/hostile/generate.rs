//! Arbitrary values of any type that derives `Deserialize`, as the bytes of the wire.
//!
//! A deserializer that answers every question of the type with a random or extreme value, and writes that value as
//! postcard does. So every variant and every field of a message is covered, present and future, without a list by hand;
//! and where a type refuses the value, the bytes go out all the same.

use std::fmt;

use darm_core::wire::message::Request;
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use serde::de::{
    self, DeserializeSeed, Deserializer, EnumAccess, IntoDeserializer as _, SeqAccess, VariantAccess, Visitor,
};

/// Longest list of bytes.
const MAX_BYTES: usize = 280;
/// Longest list of anything else.
const MAX_ITEMS: usize = 6;

/// The bytes of an arbitrary request. Some of its numbers are from `likely`: those that a check compares with.
pub fn request_bytes(rng: &mut ChaCha8Rng, likely: &[u64]) -> Vec<u8> {
    let chunk: Vec<u8> = (0..rng.random_range(0..=MAX_BYTES)).map(|_| rng.random()).collect();
    let mut generator = Generator { rng, likely, chunk: &chunk, bytes: Vec::new() };
    let refused = Request::deserialize(&mut generator).is_err();
    let mut bytes = generator.bytes;
    if refused {
        bytes.extend((0..rng.random_range(0..24u8)).map(|_| rng.random::<u8>()));
    }
    bytes
}

/// Answers with arbitrary values and writes them down.
struct Generator<'r, 'c> {
    rng: &'r mut ChaCha8Rng,
    likely: &'r [u64],
    /// What a borrowed list of bytes is cut from.
    chunk: &'c [u8],
    bytes: Vec<u8>,
}

/// The type refused a value.
#[derive(Debug)]
struct Refused(String);

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refused {}

impl de::Error for Refused {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

impl Generator<'_, '_> {
    /// A number of `bits` bits: small, near a power of two, or anything.
    fn number(&mut self, bits: u32) -> u128 {
        let all = u128::MAX >> (128 - bits);
        let value = match self.rng.random_range(0..5u8) {
            4 if !self.likely.is_empty() => self.likely[self.rng.random_range(0..self.likely.len())].into(),
            0 => u128::from(self.rng.random_range(0..8u8)),
            1 => {
                let power = 1u128 << self.rng.random_range(0..bits);
                if self.rng.random() { power } else { power - 1 }
            }
            2 => all - u128::from(self.rng.random_range(0..2u8)),
            _ => self.rng.random(),
        };
        value & all
    }

    fn varint(&mut self, mut value: u128) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    fn unsigned(&mut self, bits: u32) -> u128 {
        let value = self.number(bits);
        if bits == 8 {
            self.bytes.push(value as u8)
        } else {
            self.varint(value)
        }
        value
    }

    /// Written in zigzag, as postcard does.
    fn signed(&mut self, bits: u32) -> i128 {
        let value = self.unsigned(bits);
        (value >> 1) as i128 ^ -((value & 1) as i128)
    }

    fn float(&mut self) -> f32 {
        const SPECIAL: [f32; 10] = [
            0.0,
            -0.0,
            f32::NAN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::MAX,
            f32::MIN_POSITIVE,
            1e-45,
            std::f32::consts::PI,
            -1e30,
        ];
        match self.rng.random_range(0..3u8) {
            0 => SPECIAL[self.rng.random_range(0..SPECIAL.len())],
            1 => f32::from_bits(self.rng.random()),
            _ => self.rng.random_range(-3.5..3.5),
        }
    }

    fn length(&mut self, max: usize) -> usize {
        let length = if self.rng.random() { self.rng.random_range(0..=max) } else { max };
        self.varint(length as u128);
        length
    }
}

macro_rules! unsigned {
    ($($method:ident $visit:ident $type:ty, $bits:expr;)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
            let value = self.unsigned($bits);
            visitor.$visit(value as $type)
        }
    )*};
}

macro_rules! signed {
    ($($method:ident $visit:ident $type:ty, $bits:expr;)*) => {$(
        fn $method<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
            let value = self.signed($bits);
            visitor.$visit(value as $type)
        }
    )*};
}

impl<'de> Deserializer<'de> for &mut Generator<'_, 'de> {
    type Error = Refused;

    unsigned! {
        deserialize_u8 visit_u8 u8, 8;
        deserialize_u16 visit_u16 u16, 16;
        deserialize_u32 visit_u32 u32, 32;
        deserialize_u64 visit_u64 u64, 64;
        deserialize_u128 visit_u128 u128, 128;
    }

    signed! {
        deserialize_i16 visit_i16 i16, 16;
        deserialize_i32 visit_i32 i32, 32;
        deserialize_i64 visit_i64 i64, 64;
        deserialize_i128 visit_i128 i128, 128;
    }

    fn deserialize_i8<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let value = self.unsigned(8);
        visitor.visit_i8(value as i8)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let value = self.rng.random();
        self.bytes.push(u8::from(value));
        visitor.visit_bool(value)
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let value = self.float();
        self.bytes.extend(value.to_le_bytes());
        visitor.visit_f32(value)
    }

    fn deserialize_f64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let value = f64::from(self.float());
        self.bytes.extend(value.to_le_bytes());
        visitor.visit_f64(value)
    }

    fn deserialize_char<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        self.bytes.extend([1, b'x']);
        visitor.visit_char('x')
    }

    fn deserialize_str<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let length = self.length(MAX_ITEMS);
        self.bytes.extend(std::iter::repeat_n(b'x', length));
        visitor.visit_str(&"x".repeat(length))
    }

    fn deserialize_string<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        self.deserialize_str(visitor)
    }

    fn deserialize_bytes<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let length = self.length(self.chunk.len());
        self.bytes.extend(&self.chunk[..length]);
        visitor.visit_borrowed_bytes(&self.chunk[..length])
    }

    fn deserialize_byte_buf<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        self.deserialize_bytes(visitor)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let some = self.rng.random();
        self.bytes.push(u8::from(some));
        if some { visitor.visit_some(self) } else { visitor.visit_none() }
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_unit()
    }

    fn deserialize_unit_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_unit()
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(self, _: &'static str, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        let left = self.length(MAX_ITEMS);
        visitor.visit_seq(Items { generator: self, left })
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, left: usize, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_seq(Items { generator: self, left })
    }

    fn deserialize_tuple_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        left: usize,
        visitor: V,
    ) -> Result<V::Value, Refused> {
        visitor.visit_seq(Items { generator: self, left })
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refused> {
        visitor.visit_seq(Items { generator: self, left: fields.len() })
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refused> {
        let variant = self.rng.random_range(0..variants.len()) as u32;
        self.varint(u128::from(variant));
        visitor.visit_enum(Variant { generator: self, variant })
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refused> {
        Err(Refused("the wire says nothing of types".into()))
    }

    fn deserialize_map<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refused> {
        Err(Refused("no message holds a map".into()))
    }

    fn deserialize_identifier<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refused> {
        Err(Refused("fields have no names on the wire".into()))
    }

    fn deserialize_ignored_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refused> {
        Err(Refused("nothing on the wire is ignored".into()))
    }

    fn is_human_readable(&self) -> bool {
        false
    }
}

struct Items<'g, 'r, 'c> {
    generator: &'g mut Generator<'r, 'c>,
    left: usize,
}

impl<'de> SeqAccess<'de> for Items<'_, '_, 'de> {
    type Error = Refused;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, Refused> {
        let Some(left) = self.left.checked_sub(1) else { return Ok(None) };
        self.left = left;
        seed.deserialize(&mut *self.generator).map(Some)
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.left)
    }
}

struct Variant<'g, 'r, 'c> {
    generator: &'g mut Generator<'r, 'c>,
    variant: u32,
}

impl<'de> EnumAccess<'de> for Variant<'_, '_, 'de> {
    type Error = Refused;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), Refused> {
        let variant: de::value::U32Deserializer<Refused> = self.variant.into_deserializer();
        let value = seed.deserialize(variant)?;
        Ok((value, self))
    }
}

impl<'de> VariantAccess<'de> for Variant<'_, '_, 'de> {
    type Error = Refused;

    fn unit_variant(self) -> Result<(), Refused> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, Refused> {
        seed.deserialize(self.generator)
    }

    fn tuple_variant<V: Visitor<'de>>(self, left: usize, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_seq(Items { generator: self.generator, left })
    }

    fn struct_variant<V: Visitor<'de>>(self, fields: &'static [&'static str], visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_seq(Items { generator: self.generator, left: fields.len() })
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use darm_core::sequencer::Command;
    use darm_core::wire::message::Request;
    use rand::SeedableRng as _;
    use rand_chacha::ChaCha8Rng;

    use super::request_bytes;

    #[test]
    fn every_message_and_every_command_is_generated_as_the_wire_has_it() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let (mut requests, mut commands) = (BTreeSet::new(), BTreeSet::new());
        for _ in 0..2000 {
            let bytes = request_bytes(&mut rng, &[3]);
            let Ok(request) = postcard::from_bytes::<Request<'_>>(&bytes) else { continue };
            requests.insert(bytes[0]);
            if let Request::Command(command) = request {
                commands.insert(bytes[1]);
                assert_eq!(postcard::to_allocvec(&command).unwrap(), bytes[1..], "{command:?}");
                let _: Command = command;
            }
        }
        assert_eq!((requests.len(), commands.len()), (15, 6));
    }
}

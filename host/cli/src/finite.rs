//! Whether all numbers of an answer are finite: a serialiser that writes nothing and fails at the first that is not.

use std::fmt;

use serde::ser::{self, Serialize, Serializer};

/// A number that is infinite or NaN, and the keys that lead to it.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct NotFinite {
    number: String,
    /// Innermost first.
    keys: Vec<String>,
}

/// Fails at the first number of `answer` that is not finite.
pub(crate) fn check(answer: &impl Serialize) -> Result<(), NotFinite> {
    answer.serialize(Check)
}

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let keys: Vec<_> = self.keys.iter().rev().map(String::as_str).collect();
        let (number, keys) = (&self.number, keys.join("."));
        write!(f, "the result has a number that is not finite: {keys} is {number}; give numbers of a usual size")
    }
}

impl std::error::Error for NotFinite {}

impl ser::Error for NotFinite {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { number: message.to_string(), keys: Vec::new() }
    }
}

#[derive(Clone, Copy)]
struct Check;

impl Check {
    fn value<T: Serialize + ?Sized>(key: &str, value: &T) -> Result<(), NotFinite> {
        value.serialize(Self).map_err(|mut found| {
            found.keys.push(key.to_owned());
            found
        })
    }
}

/// Elements of a sequence or fields, with the number of the next one or the key of the value that comes.
struct Parts {
    next: usize,
    key: String,
}

macro_rules! finite {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(self, _: $type) -> Result<(), NotFinite> {
            Ok(())
        })*
    };
}

macro_rules! parts {
    ($($method:ident($($type:ty),*)),*) => {
        $(fn $method(self, $(_: $type),*) -> Result<Parts, NotFinite> {
            Ok(Parts { next: 0, key: String::new() })
        })*
    };
}

impl Serializer for Check {
    type Ok = ();
    type Error = NotFinite;
    type SerializeSeq = Parts;
    type SerializeTuple = Parts;
    type SerializeTupleStruct = Parts;
    type SerializeTupleVariant = Parts;
    type SerializeMap = Parts;
    type SerializeStruct = Parts;
    type SerializeStructVariant = Parts;

    finite!(serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char,
        serialize_str: &str, serialize_bytes: &[u8], serialize_unit_struct: &'static str);

    parts!(
        serialize_seq(Option<usize>),
        serialize_tuple(usize),
        serialize_tuple_struct(&'static str, usize),
        serialize_tuple_variant(&'static str, u32, &'static str, usize),
        serialize_map(Option<usize>),
        serialize_struct(&'static str, usize),
        serialize_struct_variant(&'static str, u32, &'static str, usize)
    );

    fn serialize_f32(self, number: f32) -> Result<(), NotFinite> {
        self.serialize_f64(number.into())
    }

    fn serialize_f64(self, number: f64) -> Result<(), NotFinite> {
        match number.is_finite() {
            true => Ok(()),
            false => Err(NotFinite { number: number.to_string(), keys: Vec::new() }),
        }
    }

    fn serialize_none(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, _: &'static str) -> Result<(), NotFinite> {
        Ok(())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Result<(), NotFinite> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> Result<(), NotFinite> {
        Self::value(variant, value)
    }
}

macro_rules! elements {
    ($($of:ident::$method:ident),*) => {
        $(impl ser::$of for Parts {
            type Ok = ();
            type Error = NotFinite;

            fn $method<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
                self.next += 1;
                Check::value(&(self.next - 1).to_string(), value)
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        })*
    };
}

macro_rules! fields {
    ($($of:ident),*) => {
        $(impl ser::$of for Parts {
            type Ok = ();
            type Error = NotFinite;

            fn serialize_field<T: Serialize + ?Sized>(&mut self, key: &'static str, value: &T) -> Result<(), NotFinite> {
                Check::value(key, value)
            }

            fn end(self) -> Result<(), NotFinite> {
                Ok(())
            }
        })*
    };
}

elements!(
    SerializeSeq::serialize_element,
    SerializeTuple::serialize_element,
    SerializeTupleStruct::serialize_field,
    SerializeTupleVariant::serialize_field
);
fields!(SerializeStruct, SerializeStructVariant);

impl ser::SerializeMap for Parts {
    type Ok = ();
    type Error = NotFinite;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> Result<(), NotFinite> {
        self.key =
            serde_json::to_value(key).map_or_else(|_| String::new(), |key| key.as_str().unwrap_or("").to_owned());
        Ok(())
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> Result<(), NotFinite> {
        Check::value(&self.key, value)
    }

    fn end(self) -> Result<(), NotFinite> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use serde::Serialize;

    use super::check;

    #[derive(Serialize)]
    struct Answer {
        name: &'static str,
        torque: Vec<f64>,
        #[serde(skip_serializing_if = "Option::is_none")]
        share: Option<f64>,
        #[serde(flatten)]
        more: std::collections::BTreeMap<&'static str, f64>,
    }

    #[test]
    fn the_first_number_that_is_not_finite_is_named() {
        let answer = |torque, share, more| Answer { name: "a", torque, share, more: [("mass_kg", more)].into() };
        assert_eq!(check(&answer(vec![1.0, 2.0], None, 3.0)), Ok(()));
        let text = |answer| check(&answer).unwrap_err().to_string();
        assert!(text(answer(vec![1.0, f64::NAN], None, 3.0)).contains("torque.1 is NaN"));
        assert!(text(answer(vec![], Some(f64::INFINITY), 3.0)).contains("share is inf"));
        assert!(text(answer(vec![], None, f64::NEG_INFINITY)).contains("mass_kg is -inf"));
    }
}

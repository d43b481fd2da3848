//! docs/protocol.md has every message, every field and every limit of the code, and no others.
//!
//! The names come from serde itself: a deserializer that holds no data is told by the derived code
//! which variants and fields it expects.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use protocol::{ToMaster, ToWorker};
use serde::de::value::StrDeserializer;
use serde::de::{DeserializeSeed, Deserializer, EnumAccess, VariantAccess, Visitor};
use serde::{Deserialize, forward_to_deserialize_any};

const DOCS: &str = include_str!("../../docs/protocol.md");
const LIMITS: &str = include_str!("../src/limits.rs");

/// Asks for variant number `variant` and notes what the type says about itself.
#[derive(Default)]
struct Listener {
    variant: usize,
    variants: &'static [&'static str],
    fields: &'static [&'static str],
}

#[derive(Debug)]
struct HeardEnough;

impl fmt::Display for HeardEnough {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("heard enough")
    }
}

impl std::error::Error for HeardEnough {}

impl serde::de::Error for HeardEnough {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self
    }
}

impl<'de> Deserializer<'de> for &mut Listener {
    type Error = HeardEnough;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, HeardEnough> {
        Err(HeardEnough)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, HeardEnough> {
        self.variants = variants;
        visitor.visit_enum(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, HeardEnough> {
        self.fields = fields;
        Err(HeardEnough)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map identifier ignored_any
    }
}

impl<'de> EnumAccess<'de> for &mut Listener {
    type Error = HeardEnough;
    type Variant = Self;

    fn variant_seed<V: DeserializeSeed<'de>>(self, seed: V) -> Result<(V::Value, Self), HeardEnough> {
        let name = StrDeserializer::<HeardEnough>::new(self.variants[self.variant]);
        Ok((seed.deserialize(name)?, self))
    }
}

impl<'de> VariantAccess<'de> for &mut Listener {
    type Error = HeardEnough;

    fn unit_variant(self) -> Result<(), HeardEnough> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, HeardEnough> {
        seed.deserialize(self)
    }

    fn tuple_variant<V: Visitor<'de>>(self, _: usize, _: V) -> Result<V::Value, HeardEnough> {
        Err(HeardEnough)
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, HeardEnough> {
        self.fields = fields;
        Err(HeardEnough)
    }
}

type Messages = BTreeMap<&'static str, BTreeSet<&'static str>>;

/// Message names with their field names.
fn in_code<'de, M: Deserialize<'de>>() -> Messages {
    let mut messages = Messages::new();
    loop {
        let mut listener = Listener {
            variant: messages.len(),
            ..Listener::default()
        };
        let _ = M::deserialize(&mut listener);
        messages.insert(
            listener.variants[listener.variant],
            BTreeSet::from_iter(listener.fields.to_vec()),
        );
        if messages.len() == listener.variants.len() {
            return messages;
        }
    }
}

/// The same from the page: a heading `### name` for each message, a table row for each field.
fn in_docs(heading: &str) -> Messages {
    let (_, section) = DOCS
        .split_once(&format!("\n## {heading}\n"))
        .expect("the section is there");
    let section = section.split("\n## ").next().unwrap();
    let messages = section.split("\n### ").skip(1).map(|part| {
        let (name, rest) = part.split_once('\n').unwrap();
        (
            name.trim_matches('`'),
            rest.lines().filter_map(first_cell).collect(),
        )
    });
    messages.collect()
}

/// What the row's first cell has between backticks.
fn first_cell(line: &'static str) -> Option<&'static str> {
    line.strip_prefix("| `")?.split('`').next()
}

#[test]
fn every_message_and_field_is_documented() {
    assert_eq!(in_code::<ToMaster>(), in_docs("Worker to master"));
    assert_eq!(in_code::<ToWorker>(), in_docs("Master to worker"));
}

#[test]
fn every_limit_is_documented() {
    let (_, section) = DOCS.split_once("\n## Limits\n").expect("the section is there");
    let documented: BTreeSet<&str> = section
        .split("\n## ")
        .next()
        .unwrap()
        .lines()
        .filter_map(first_cell)
        .collect();
    let names = LIMITS
        .lines()
        .filter_map(|line| line.strip_prefix("pub const ")?.split(':').next());
    assert_eq!(names.collect::<BTreeSet<_>>(), documented);
}

/// The example's bytes, as the page shows them in hexadecimal.
#[test]
fn the_example_bytes_are_those_of_the_codec() {
    let (_, block) = DOCS.split_once("```hex\n").expect("the example is there");
    let digits = block
        .split("```")
        .next()
        .unwrap()
        .lines()
        .filter_map(|line| line.split('#').next());
    let shown: Vec<u8> = digits
        .flat_map(str::split_whitespace)
        .map(|digits| u8::from_str_radix(digits, 16).unwrap())
        .collect();
    let request = protocol::message::Request {
        frame: protocol::FrameId(1),
        tasks: 2,
    };
    assert_eq!(
        shown,
        protocol::envelope::encode(&ToMaster::Request(request)).unwrap()
    );
}

//! JSON of results on one line, with a blank behind commas and colons.

use serde::Serialize;
use serde_json::ser::{Formatter, Serializer};
use std::io::{self, Write};
use switchback::error::{Error, Result};

struct Spaced;

impl Formatter for Spaced {
    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if first {
            Ok(())
        } else {
            writer.write_all(b", ")
        }
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        self.begin_array_value(writer, first)
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b": ")
    }
}

/// The value as JSON, its fields in the order they are declared; numbers that are not finite are null.
pub fn text(value: &impl Serialize) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let written = value.serialize(&mut Serializer::with_formatter(&mut out, Spaced));
    written.map_err(|e| Error::Internal(format!("a result cannot be written as JSON: {e}")))?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Serialize)]
    struct Value {
        b: &'static str,
        a: [f64; 3],
        c: Option<usize>,
    }

    #[test]
    fn order_escapes_and_numbers() {
        let value = Value { b: "x \"y\"\\\n\u{e9}", a: [f64::NAN, -2.5, 1e-300], c: None };
        let expected = "{\"b\": \"x \\\"y\\\"\\\\\\n\u{e9}\", \"a\": [null, -2.5, 1e-300], \"c\": null}";
        assert_eq!(String::from_utf8(text(&value).unwrap()).unwrap(), expected);
    }
}

//! Numbers and words of a `.nl` file in its text or its binary form, and where they are.

use switchback::{Error, Result};

/// How what follows the header is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Numbers as text, one item a line.
    Text,
    /// Integers of four bytes and floating-point numbers of eight, the lowest byte first.
    Little,
    /// The same, the highest byte first.
    Big,
}

/// Longest piece of a file that a message quotes, in characters.
const QUOTED: usize = 24;

/// A file and how much of it was read.
pub struct Source<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
    form: Form,
}

impl<'a> Source<'a> {
    /// The beginning of a file, whose header is text.
    pub fn new(bytes: &'a [u8]) -> Source<'a> {
        Source { bytes, at: 0, line: 1, form: Form::Text }
    }

    /// How what follows is written.
    pub fn set_form(&mut self, form: Form) {
        self.form = form;
    }

    /// Bytes of the file.
    pub fn len(&self) -> usize {
        self.bytes.len()
    }

    /// An error at the place that was read last.
    pub fn fault(&self, text: impl std::fmt::Display) -> Error {
        let place = match self.form {
            Form::Text => format!("line {}", self.line),
            _ => format!("byte {}", self.at),
        };
        Error::Range(format!(".nl file, {place}: {text}"))
    }

    fn expected(&self, what: &str, found: &[u8]) -> Error {
        if found.is_empty() {
            return self.fault(format_args!("expected {what}, but the file ends"));
        }
        let text: String = String::from_utf8_lossy(found).chars().take(QUOTED).flat_map(char::escape_default).collect();
        self.fault(format_args!("expected {what}, found '{text}'"))
    }

    /// The next line of the header without its comment.
    pub fn header_line(&mut self, what: &str) -> Result<&'a str> {
        let rest = &self.bytes[self.at..];
        let Some(end) = rest.iter().position(|b| *b == b'\n') else { return Err(self.expected(what, b"")) };
        let line = &rest[..end];
        let text = line.split(|b| *b == b'#').next().unwrap_or(line);
        let text = std::str::from_utf8(text).map_err(|_| self.expected(what, text))?;
        self.at += end + 1;
        self.line += 1;
        Ok(text)
    }

    fn skip_blank(&mut self) {
        while let Some(b) = self.bytes.get(self.at) {
            match b {
                b'\n' => self.line += 1,
                b'#' => {
                    let rest = &self.bytes[self.at..];
                    self.at += rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
                    continue;
                }
                b if b.is_ascii_whitespace() => {}
                _ => return,
            }
            self.at += 1;
        }
    }

    /// The letter an item begins with; nothing at the end of the file.
    pub fn key(&mut self) -> Option<u8> {
        if self.form == Form::Text {
            self.skip_blank();
        }
        let key = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(key)
    }

    /// The letter of an item that has to be there; `what` it is, for the message.
    pub fn letter(&mut self, what: &str) -> Result<u8> {
        self.key().ok_or_else(|| self.expected(what, b""))
    }

    /// An error about a letter that was read.
    pub fn strange(&self, what: &str, letter: u8) -> Error {
        self.expected(what, &[letter])
    }

    fn token(&mut self) -> &'a [u8] {
        self.skip_blank();
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|b| b.is_ascii_whitespace() || *b == b'#').unwrap_or(rest.len());
        self.at += end;
        &rest[..end]
    }

    fn raw<const N: usize>(&mut self, what: &str) -> Result<[u8; N]> {
        let rest = &self.bytes[self.at..];
        let Some(found) = rest.first_chunk::<N>() else { return Err(self.expected(what, b"")) };
        let mut out = *found;
        self.at += N;
        if self.form == Form::Big {
            out.reverse();
        }
        Ok(out)
    }

    fn parsed<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let token = self.token();
        let value = std::str::from_utf8(token).ok().and_then(|t| t.parse().ok());
        value.ok_or_else(|| self.expected(what, token))
    }

    /// An integer.
    pub fn int(&mut self, what: &str) -> Result<i32> {
        match self.form {
            Form::Text => self.parsed(what),
            _ => Ok(i32::from_le_bytes(self.raw(what)?)),
        }
    }

    /// An integer of two bytes in the binary form.
    pub fn short(&mut self, what: &str) -> Result<i32> {
        match self.form {
            Form::Text => self.parsed(what),
            _ => Ok(i16::from_le_bytes(self.raw(what)?).into()),
        }
    }

    /// A number, which may be infinite.
    pub fn real(&mut self, what: &str) -> Result<f64> {
        let value: f64 = match self.form {
            Form::Text => self.parsed(what)?,
            _ => f64::from_le_bytes(self.raw(what)?),
        };
        if value.is_nan() {
            return Err(self.fault(format_args!("expected {what}, found NaN")));
        }
        Ok(value)
    }

    /// A number that is finite.
    pub fn finite(&mut self, what: &str) -> Result<f64> {
        let value = self.real(what)?;
        if value.is_infinite() {
            return Err(self.fault(format_args!("expected {what}, found {value}: it must be finite")));
        }
        Ok(value)
    }

    /// A number of things, which is not negative.
    pub fn count(&mut self, what: &str) -> Result<usize> {
        let value = self.int(what)?;
        usize::try_from(value).map_err(|_| self.fault(format_args!("expected {what}, found {value}")))
    }

    /// A number below `limit`.
    pub fn index(&mut self, what: &str, limit: usize) -> Result<usize> {
        let value = self.count(what)?;
        if value >= limit {
            return Err(self.fault(format_args!("{what} is {value}, but there are {limit} of them")));
        }
        Ok(value)
    }

    /// A name.
    pub fn name(&mut self, what: &str) -> Result<String> {
        let found = match self.form {
            Form::Text => self.token(),
            _ => {
                let n = self.count(what)?;
                self.take(n, what)?
            }
        };
        if found.is_empty() {
            return Err(self.expected(what, b""));
        }
        Ok(String::from_utf8_lossy(found).into_owned())
    }

    fn take(&mut self, n: usize, what: &str) -> Result<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        if n > rest.len() {
            return Err(self.fault(format_args!("expected {n} bytes of {what}, but the file has {} more", rest.len())));
        }
        self.at += n;
        Ok(&rest[..n])
    }

    /// Passes over a text that is given with its length.
    pub fn skip_string(&mut self) -> Result<()> {
        let what = "a text";
        if self.form != Form::Text {
            let n = self.count(what)?;
            return self.take(n, what).map(|_| ());
        }
        let rest = &self.bytes[self.at..];
        let digits = rest.iter().position(|b| !b.is_ascii_digit()).unwrap_or(rest.len());
        let n = std::str::from_utf8(&rest[..digits]).ok().and_then(|t| t.parse::<usize>().ok());
        let (Some(n), Some(b':')) = (n, rest.get(digits)) else {
            return Err(self.expected("the length of a text and ':'", &rest[..rest.len().min(QUOTED)]));
        };
        self.at += digits + 1;
        let text = self.take(n, what)?;
        self.line += text.iter().filter(|b| **b == b'\n').count();
        Ok(())
    }
}

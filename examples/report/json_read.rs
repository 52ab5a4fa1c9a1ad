//! Reads JSON: what a list of problems needs.

/// A JSON value; members of objects in the order of the text.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    Null,
    Bool(bool),
    Number(f64),
    Text(String),
    List(Vec<Value>),
    Object(Vec<(String, Value)>),
}

impl Value {
    /// The whole text as one value.
    pub fn parse(text: &str) -> Result<Value, String> {
        let mut r = Reader { text, at: 0 };
        let v = r.value()?;
        r.space();
        if r.at == text.len() {
            Ok(v)
        } else {
            Err(r.error("the end"))
        }
    }
    /// A member of an object.
    pub fn get(&self, key: &str) -> Option<&Value> {
        match self {
            Value::Object(o) => o.iter().find(|m| m.0 == key).map(|m| &m.1),
            _ => None,
        }
    }
    pub fn number(&self) -> Option<f64> {
        match self {
            Value::Number(v) => Some(*v),
            _ => None,
        }
    }
    pub fn text(&self) -> Option<&str> {
        match self {
            Value::Text(s) => Some(s),
            _ => None,
        }
    }
    pub fn list(&self) -> &[Value] {
        match self {
            Value::List(l) => l,
            _ => &[],
        }
    }
    /// A list of numbers.
    pub fn numbers(&self) -> Option<Vec<f64>> {
        match self {
            Value::List(l) => l.iter().map(Value::number).collect(),
            _ => None,
        }
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl Reader<'_> {
    fn error(&self, expected: &str) -> String {
        format!("expected {expected} at byte {}", self.at)
    }
    fn space(&mut self) {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
    }
    fn peek(&mut self) -> Option<char> {
        self.space();
        self.text[self.at..].chars().next()
    }
    /// Goes past `token` if it is next.
    fn take(&mut self, token: &str) -> bool {
        self.space();
        let found = self.text[self.at..].starts_with(token);
        if found {
            self.at += token.len();
        }
        found
    }
    fn expect(&mut self, token: &str) -> Result<(), String> {
        if self.take(token) {
            Ok(())
        } else {
            Err(self.error(token))
        }
    }
    fn value(&mut self) -> Result<Value, String> {
        for (word, v) in [("null", Value::Null), ("true", Value::Bool(true)), ("false", Value::Bool(false))] {
            if self.take(word) {
                return Ok(v);
            }
        }
        match self.peek() {
            Some('{') => self.object(),
            Some('[') => self.array(),
            Some('"') => Ok(Value::Text(self.string()?)),
            _ => self.float(),
        }
    }
    fn float(&mut self) -> Result<Value, String> {
        let rest = &self.text[self.at..];
        let len = rest.find([',', '}', ']', ' ', '\n', '\r', '\t']).unwrap_or(rest.len());
        let v = rest[..len].parse().map_err(|_| self.error("a value"))?;
        self.at += len;
        Ok(Value::Number(v))
    }
    fn array(&mut self) -> Result<Value, String> {
        self.expect("[")?;
        let mut out = Vec::new();
        if self.take("]") {
            return Ok(Value::List(out));
        }
        loop {
            out.push(self.value()?);
            if self.take("]") {
                return Ok(Value::List(out));
            }
            self.expect(",")?;
        }
    }
    fn object(&mut self) -> Result<Value, String> {
        self.expect("{")?;
        let mut out = Vec::new();
        if self.take("}") {
            return Ok(Value::Object(out));
        }
        loop {
            self.space();
            let key = self.string()?;
            self.expect(":")?;
            out.push((key, self.value()?));
            if self.take("}") {
                return Ok(Value::Object(out));
            }
            self.expect(",")?;
        }
    }
    fn string(&mut self) -> Result<String, String> {
        self.expect("\"")?;
        let mut out = String::new();
        let mut chars = self.text[self.at..].char_indices();
        while let Some((i, c)) = chars.next() {
            match c {
                '"' => {
                    self.at += i + 1;
                    return Ok(out);
                }
                '\\' => match chars.next().map(|e| e.1) {
                    Some('n') => out.push('\n'),
                    Some('t') => out.push('\t'),
                    Some('u') => {
                        let hex: String = chars.by_ref().take(4).map(|e| e.1).collect();
                        let code = u32::from_str_radix(&hex, 16).map_err(|_| self.error("a code point"))?;
                        out.push(char::from_u32(code).unwrap_or(char::REPLACEMENT_CHARACTER));
                    }
                    Some(e) => out.push(e),
                    None => break,
                },
                c => out.push(c),
            }
        }
        Err(self.error("the end of a string"))
    }
}

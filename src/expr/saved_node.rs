//! Nodes as arrays of JSON: `["sin", 3]`, `["+", 1, 2]`, `["const", 0.5]`, `["where", 4, 5, 6]`.

use std::fmt;

use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::dag::Block;
use super::op::{Binary, Unary};
use super::saved::SavedNode;

/// Name of an operator of one argument; the others have those of C.
fn unary_name(op: Unary) -> &'static str {
    match op {
        Unary::Neg => "neg",
        _ => op.name(),
    }
}

fn block_name(block: Block) -> &'static str {
    match block {
        Block::X => "x",
        Block::U => "u",
        Block::P => "p",
        Block::T => "t",
        Block::Weight => "weight",
        Block::Unknown => "unknown",
    }
}

impl Serialize for SavedNode {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        match *self {
            SavedNode::Const(v) => ("const", v).serialize(s),
            SavedNode::Input(block, i) => (block_name(block), i).serialize(s),
            SavedNode::Unary(op, a) => (unary_name(op), a).serialize(s),
            SavedNode::Binary(op, a, b) => (op.name(), a, b).serialize(s),
            SavedNode::PowI(a, n) => ("powi", a, n).serialize(s),
            SavedNode::Table(t, order, a) => ("table", t, order, a).serialize(s),
            SavedNode::Pick(g, k) => ("component", g, k).serialize(s),
            SavedNode::Truth(holds) => ("truth", u8::from(holds)).serialize(s),
            SavedNode::Positive(a) => ("positive", a).serialize(s),
            SavedNode::Not(a) => ("not", a).serialize(s),
            SavedNode::And(a, b) => ("and", a, b).serialize(s),
            SavedNode::Or(a, b) => ("or", a, b).serialize(s),
            SavedNode::Where(c, a, b) => ("where", c, a, b).serialize(s),
        }
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = SavedNode;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a node: an array of the name of an operator and its operands")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<SavedNode, A::Error> {
        fn next<'de, T: Deserialize<'de>, A: SeqAccess<'de>>(seq: &mut A, name: &str) -> Result<T, A::Error> {
            seq.next_element()?.ok_or_else(|| A::Error::custom(format!("'{name}' has too few operands")))
        }
        let name: String = next(&mut seq, "node")?;
        let n = name.as_str();
        let unary = Unary::ALL.into_iter().find(|&op| unary_name(op) == n);
        let binary = Binary::ALL.into_iter().find(|op| op.name() == n);
        let block = [Block::X, Block::U, Block::P, Block::T].into_iter().find(|&b| block_name(b) == n);
        let s = &mut seq;
        let node = if let Some(op) = binary {
            SavedNode::Binary(op, next(s, n)?, next(s, n)?)
        } else if let Some(op) = unary {
            SavedNode::Unary(op, next(s, n)?)
        } else if let Some(block) = block {
            let i = next(s, n)?;
            if block == Block::T && i != 0 {
                return Err(A::Error::custom(format!("time {i} does not exist: there is one")));
            }
            SavedNode::Input(block, i)
        } else {
            match n {
                "const" => SavedNode::Const(next(s, n)?),
                "powi" => SavedNode::PowI(next(s, n)?, next(s, n)?),
                "table" => SavedNode::Table(next(s, n)?, next(s, n)?, next(s, n)?),
                "component" => SavedNode::Pick(next(s, n)?, next(s, n)?),
                "truth" => SavedNode::Truth(next::<u8, A>(s, n)? != 0),
                "positive" => SavedNode::Positive(next(s, n)?),
                "not" => SavedNode::Not(next(s, n)?),
                "and" => SavedNode::And(next(s, n)?, next(s, n)?),
                "or" => SavedNode::Or(next(s, n)?, next(s, n)?),
                "where" => SavedNode::Where(next(s, n)?, next(s, n)?, next(s, n)?),
                _ => return Err(A::Error::custom(format!("there is no operator '{name:.40}'"))),
            }
        };
        match seq.next_element::<serde::de::IgnoredAny>()? {
            Some(_) => Err(A::Error::custom(format!("'{n}' has too many operands"))),
            None => Ok(node),
        }
    }
}

impl<'de> Deserialize<'de> for SavedNode {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<SavedNode, D::Error> {
        d.deserialize_seq(NodeVisitor)
    }
}

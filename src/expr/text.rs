//! Expressions as text, for messages and reports.

use super::dag::{Block, Dag, Id, Node};
use super::op::{Binary, Unary};

/// Longer texts are cut.
const MAX_LEN: usize = 120;

/// A piece that is still to be written.
enum Piece {
    Text(&'static str),
    Owned(String),
    /// Operand with the precedence of its surroundings.
    Node(Id, u8),
}

impl Dag {
    /// The expression as text, cut where it is long.
    pub fn text(&self, id: Id) -> String {
        self.text_with(id, &|block, i| match block {
            Block::X => format!("x[{i}]"),
            Block::U => format!("u[{i}]"),
            Block::P => format!("p[{i}]"),
            Block::T => "t".into(),
            Block::Weight => format!("w[{i}]"),
            Block::Unknown => format!("unknown[{i}]"),
        })
    }

    /// The expression as text with names for its inputs.
    pub fn text_with(&self, id: Id, name: &dyn Fn(Block, usize) -> String) -> String {
        let mut out = String::new();
        let mut stack = vec![Piece::Node(id, 0)];
        while let Some(piece) = stack.pop() {
            if out.len() > MAX_LEN {
                out.push('…');
                return out;
            }
            match piece {
                Piece::Text(s) => out.push_str(s),
                Piece::Owned(s) => out.push_str(&s),
                Piece::Node(id, outer) => {
                    let (own, mut pieces) = self.pieces(id, name);
                    if own < outer {
                        pieces.insert(0, Piece::Text("("));
                        pieces.push(Piece::Text(")"));
                    }
                    stack.extend(pieces.into_iter().rev());
                }
            }
        }
        out
    }

    /// Precedence and parts of a node.
    fn pieces(&self, id: Id, name: &dyn Fn(Block, usize) -> String) -> (u8, Vec<Piece>) {
        use Piece::{Node as N, Owned, Text};
        let call = |f: &'static str, args: &[Id]| {
            let mut v = vec![Text(f), Text("(")];
            for (k, &a) in args.iter().enumerate() {
                if k > 0 {
                    v.push(Text(", "));
                }
                v.push(N(a, 0));
            }
            v.push(Text(")"));
            (9, v)
        };
        match self.node(id) {
            Node::Const(bits) => {
                let v = f64::from_bits(bits);
                (if v < 0.0 { 1 } else { 9 }, vec![Owned(format!("{v}"))])
            }
            Node::Input(block, i) => (9, vec![Owned(name(block, i as usize))]),
            Node::Unary(Unary::Neg, a) => (2, vec![Text("-"), N(a, 3)]),
            Node::Unary(op, a) => call(op.name(), &[a]),
            Node::Binary(Binary::Add, a, b) => match self.as_const(a) {
                // x + 1 and x − 1 rather than 1 + x.
                Some(k) if k < 0.0 => (1, vec![N(b, 1), Text(" - "), Owned(format!("{}", -k))]),
                Some(_) => (1, vec![N(b, 1), Text(" + "), N(a, 1)]),
                None => (1, vec![N(a, 1), Text(" + "), N(b, 1)]),
            },
            Node::Binary(Binary::Sub, a, b) => (1, vec![N(a, 1), Text(" - "), N(b, 2)]),
            Node::Binary(Binary::Mul, a, b) => (2, vec![N(a, 2), Text("*"), N(b, 3)]),
            Node::Binary(Binary::Div, a, b) => (2, vec![N(a, 2), Text("/"), N(b, 3)]),
            Node::Binary(op, a, b) => call(op.name(), &[a, b]),
            Node::PowI(a, n) => (4, vec![N(a, 5), Owned(format!("^{n}"))]),
            Node::Piecewise(_, 0, a) => call("table", &[a]),
            Node::Piecewise(_, order, a) => {
                let (p, mut v) = call("table", &[a]);
                v[0] = Owned(format!("table{}", "'".repeat(order as usize)));
                (p, v)
            }
            Node::Pick(g, k) => (9, vec![Owned(self.group_name(g)), Owned(format!("[{k}]"))]),
            Node::Truth(v) => (9, vec![Text(if v { "true" } else { "false" })]),
            Node::Positive(s) => (1, vec![N(self.switches[s as usize].psi, 1), Text(" > 0")]),
            Node::Not(a) => call("not", &[a]),
            Node::And(a, b) => call("and", &[a, b]),
            Node::Or(a, b) => call("or", &[a, b]),
            Node::Select(c, a, b) => call("where", &[c, a, b]),
        }
    }

    fn group_name(&self, g: u32) -> String {
        match &self.groups[g as usize].group {
            super::dag::Group::Call { function, .. } => self.functions[*function as usize].name().to_owned(),
            _ => format!("solve{g}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Graph;

    #[test]
    fn texts_read_like_formulas() {
        let g = Graph::new();
        let (x, y) = (g.x(0), g.x(1));
        let cases = [
            (x + y * 2.0, "x[0] + 2*x[1]"),
            ((x - 1.0) * (y + 1.0), "(x[0] - 1)*(x[1] + 1)"),
            (-(x * y).sin() / (x - y), "-sin(x[0]*x[1])/(x[0] - x[1])"),
            ((x + y).powi(3), "(x[0] + x[1])^3"),
            (x.abs(), "where(x[0] > 0, x[0], -x[0])"),
            (x.atan2(y), "atan2(x[0], x[1])"),
        ];
        for (e, text) in cases {
            let got = format!("{e:?}");
            assert!(got == text || got == "-(sin(x[0]*x[1])/(x[0] - x[1]))", "{got} is not {text}");
        }
        let mut long = x;
        for _ in 0..100_000 {
            long = (long + y).sin();
        }
        assert!(format!("{long:?}").len() < 200);
    }
}

//! Files for tests: text, and the same in binary form.
#![allow(dead_code)]

use switchback::nlp::Nlp;
use switchback_mpcc_ampl::nl::{self, Problem};

/// A header for a problem with these sizes; `defined` variables, and `integer` ones.
pub fn header(n_vars: usize, n_cons: usize, n_objs: usize, defined: usize, integer: usize) -> String {
    format!(
        "g3 1 1 0\t# problem test\n {n_vars} {n_cons} {n_objs} 0 0\t# vars, constraints, objectives, ranges, eqns\n \
         {n_cons} {n_objs} 0 0 0 0\n 0 0\n {n_vars} {n_vars} {n_vars}\n 0 2 0 1\n 0 {integer} 0 0 0\n 9 9\n 0 0\n \
         {defined} 0 0 0 0\n"
    )
}

/// Shared defined variables with linear terms, ranges, maximisation, and all kinds of complementarity.
pub const EVERYTHING: &str = "V5 1 0\t# two defined variables\n0 2\no41\nv1\nV6 0 0\no2\nv5\nv5\n\
    C0\t# constraints\no0\nv6\no44\nv2\nC1\nn2.5\nC2\no2\nv3\nv4\nC3\no5\nv4\nn2\nC4\no16\nv5\nC5\nn0\n\
    O0 1\no1\nv6\no54\n3\no5\nv0\nn4\no5\nv2\nn2\no2\nv3\nv3\n\
    x2\n0 0.25\n4 -1.5\nd1\n0 0.5\nr\n0 -1 9\n5 0 2\n5 1 4\n5 2 1\n5 3 5\n2 -3\nb\n1 4\n3\n3\n0 -2 7\n0 -3 3\nk4\n1\n2\n3\n4\n\
    J0 2\n0 0\n1 3\nJ1 2\n2 1\n3 -1\nJ2 3\n3 0\n4 0\n0 0.5\nJ3 2\n4 0\n1 1\nJ4 2\n1 0\n3 1\nJ5 1\n4 1\nG0 2\n1 1\n4 -2\nS0 1 sstatus\n0 3\nS5 1 slack\n1 2.5\n";

/// A problem from its text.
pub fn read(text: &str) -> Problem {
    nl::read(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The same file in binary form: the lines behind the header have numbers of the types that their segment says.
pub fn binary(text: &str, big: bool) -> Vec<u8> {
    let lines: Vec<&str> = text.lines().collect();
    let mut out = Vec::new();
    for (k, line) in lines[..10].iter().enumerate() {
        let line = match k {
            0 => line.replacen('g', "b", 1),
            5 => format!(" 0 2 {} 1", if big { 2 } else { 1 }),
            _ => (*line).to_owned(),
        };
        out.extend_from_slice(line.as_bytes());
        out.push(b'\n');
    }
    let mut w = Binary { out, big };
    let (mut segment, mut kind) = (b' ', 0);
    for line in &lines[10..] {
        let line = line.split('#').next().unwrap();
        let first = line.bytes().next().unwrap();
        let words: Vec<&str> = line.split_whitespace().collect();
        if first.is_ascii_digit() || first == b'-' {
            match segment {
                b'k' => w.ints(&words),
                b'r' | b'b' => {
                    w.out.push(first);
                    match first {
                        b'5' => w.ints(&words[1..]),
                        _ => words[1..].iter().for_each(|v| w.real(v)),
                    }
                }
                b'S' if kind & 4 == 0 => w.ints(&words),
                // the number of operands in a list
                _ if words.len() == 1 => w.ints(&words),
                _ => {
                    w.ints(&words[..1]);
                    w.real(words[1]);
                }
            }
            continue;
        }
        w.out.push(first);
        let rest: Vec<&str> = line[1..].split_whitespace().collect();
        match first {
            b'n' => w.real(rest[0]),
            b's' => w.short(rest[0]),
            b'h' => {
                let text = line.split_once(':').unwrap().1;
                w.ints(&[&text.len().to_string()]);
                w.out.extend_from_slice(text.as_bytes());
            }
            b'S' | b'F' => {
                let n = rest.len() - 1;
                w.ints(&rest[..n]);
                w.ints(&[&rest[n].len().to_string()]);
                w.out.extend_from_slice(rest[n].as_bytes());
                (segment, kind) = (first, rest[0].parse().unwrap());
            }
            b'o' | b'v' | b'l' | b'f' => w.ints(&rest),
            _ => {
                w.ints(&rest);
                segment = first;
            }
        }
    }
    w.out
}

struct Binary {
    out: Vec<u8>,
    big: bool,
}

impl Binary {
    fn put<const N: usize>(&mut self, mut bytes: [u8; N]) {
        if self.big {
            bytes.reverse();
        }
        self.out.extend_from_slice(&bytes);
    }
    fn ints(&mut self, words: &[&str]) {
        words.iter().for_each(|w| self.put(w.parse::<i32>().unwrap().to_le_bytes()));
    }
    fn short(&mut self, word: &str) {
        self.put(word.parse::<i16>().unwrap().to_le_bytes());
    }
    fn real(&mut self, word: &str) {
        self.put(word.parse::<f64>().unwrap().to_le_bytes());
    }
}

/// Largest deviation of first and second derivatives of a program from central differences, relative to values above 1.
pub fn deviation(p: &mut dyn Nlp, x: &[f64], w: f64, y: &[f64]) -> f64 {
    let (n, m) = (p.n(), p.m());
    let (jac, hess) = (p.jac_pattern().clone(), p.hess_pattern().clone());
    // gradient of the Lagrangian, gradient, dense Jacobian
    let mut first = |x: &[f64]| {
        let (mut g, mut j) = (vec![0.0; n], vec![0.0; jac.nnz()]);
        p.derivatives(x, &mut g, &mut j).unwrap();
        let mut dense = vec![0.0; m * n];
        for c in 0..n {
            jac.range(c).for_each(|k| dense[jac.row_idx()[k] * n + c] += j[k]);
        }
        let l: Vec<f64> = (0..n).map(|c| w * g[c] + (0..m).map(|i| y[i] * dense[i * n + c]).sum::<f64>()).collect();
        let mut c = vec![0.0; m];
        let f = p.eval(x, &mut c).unwrap();
        (l, g, dense, f, c)
    };
    let at = first(x);
    let mut worst = 0f64;
    let mut check = |exact: f64, difference: f64| worst = worst.max((exact - difference).abs() / exact.abs().max(1.0));
    let mut curved = vec![0.0; n * n];
    for c in 0..n {
        let h = 1e-5 * x[c].abs().max(1.0);
        let (mut up, mut down) = (x.to_vec(), x.to_vec());
        up[c] += h;
        down[c] -= h;
        let (up, down) = (first(&up), first(&down));
        check(at.1[c], (up.3 - down.3) / (2.0 * h));
        (0..m).for_each(|i| check(at.2[i * n + c], (up.4[i] - down.4[i]) / (2.0 * h)));
        (0..n).for_each(|r| curved[r * n + c] = (up.0[r] - down.0[r]) / (2.0 * h));
    }
    let mut values = vec![0.0; hess.nnz()];
    p.hessian(x, w, y, &mut values).unwrap();
    let mut exact = vec![0.0; n * n];
    for c in 0..n {
        for k in hess.range(c) {
            let r = hess.row_idx()[k];
            exact[r * n + c] = values[k];
            exact[c * n + r] = values[k];
        }
    }
    exact.iter().zip(&curved).for_each(|(e, d)| check(*e, *d));
    worst
}

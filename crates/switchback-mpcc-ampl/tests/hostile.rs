//! Files that nobody wrote: whatever is in a file, reading it, translating it and evaluating it ends, and ends with a result or an error.

mod common;

use common::{binary, header, EVERYTHING};
use switchback::nlp::Nlp;
use switchback_mpcc_ampl::driver;
use switchback_mpcc_ampl::nl;
use switchback_mpcc_ampl::options::Options;
use switchback_mpcc_ampl::translate::translate;

/// Numbers without a pattern (Marsaglia, Xorshift RNGs, J. Stat. Softw. 8, 2003).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 % n as u64) as usize
    }
}

fn go_through(bytes: &[u8]) -> bool {
    let Ok(problem) = nl::read(bytes) else { return false };
    for objective in (0..problem.objectives.len().min(2)).map(Some).chain([None]) {
        let Ok(mut t) = translate(&problem, objective) else { continue };
        let (n, m) = (t.program.n(), t.program.m());
        let mut c = vec![0.0; m];
        let _ = t.program.eval(&t.start, &mut c);
        let mut jac = vec![0.0; t.program.jac_pattern().nnz()];
        let _ = t.program.derivatives(&t.start, &mut vec![0.0; n], &mut jac);
    }
    problem.forest.values(&problem.start);
    let mut options = Options::default();
    options.assign("max_iter=25 max_time=0.05 relax_integrality=1 objno=0").unwrap();
    options.objno = problem.objectives.len().min(1);
    let sol = driver::solve(&problem, &options, &mut Vec::new()).unwrap();
    assert!(sol.code != 599, "{}", sol.message);
    true
}

#[test]
fn mutated_files() {
    let text = header(5, 6, 1, 2, 0) + EVERYTHING;
    let seeds = [text.clone().into_bytes(), binary(&text, false), binary(&text, true)];
    assert!(seeds.iter().all(|s| go_through(s)));
    let words: [&[u8]; 12] = [
        b"2147483647",
        b"-1",
        b"99999999999999999999",
        b"o54\n2147483647\n",
        b"v4",
        b"o64\n2147483647\n",
        b"\xff\xff\xff\x7f",
        b"1e308",
        b"nan",
        b"inf",
        b"h2147483647:",
        b"S7 1 x\n",
    ];
    let mut random = Random(0x9e37_79b9_7f4a_7c15);
    let mut read = 0;
    for round in 0..9000 {
        let mut bytes = seeds[round % seeds.len()].clone();
        for _ in 0..1 + random.below(4) {
            let at = random.below(bytes.len());
            match random.below(6) {
                0 => bytes[at] = random.below(256) as u8,
                1 => bytes[at] = b"0123456789obvnCJrk\n "[random.below(20)],
                2 => bytes.truncate(at.max(1)),
                3 => drop(bytes.drain(at..(at + 1 + random.below(12)).min(bytes.len() - 1).max(at))),
                4 => drop(bytes.splice(at..at, words[random.below(words.len())].iter().copied())),
                _ => {
                    let part: Vec<u8> = bytes[at..(at + random.below(40)).min(bytes.len())].to_vec();
                    let to = random.below(bytes.len());
                    drop(bytes.splice(to..to, part));
                }
            }
        }
        read += usize::from(go_through(&bytes));
    }
    // most are refused; some must be read, or nothing behind the reader was tried
    assert!((300..8700).contains(&read), "{read}");
}

/// Depth is no matter: no recursion, in reading, translation, derivatives.
#[test]
fn deep_expressions() {
    let n = 200_000;
    let text = header(1, 0, 1, 0, 0) + "O0 0\n" + &"o41\n".repeat(n) + "v0\nb\n3\n";
    let problem = nl::read(text.as_bytes()).unwrap();
    let mut t = translate(&problem, Some(0)).unwrap();
    let f = t.program.eval(&[0.5], &mut []).unwrap();
    assert!((f - problem.forest.values(&[0.5])[n]).abs() < 1e-15 && f > 0.0);
}

/// What a file takes of memory is a multiple of its size: a long sum of products is no more than that.
#[test]
fn large_sums_are_linear() {
    let n = 30_000;
    let mut text = header(n, 0, 1, 0, 0) + &format!("O0 0\no54\n{n}\n");
    (0..n).for_each(|j| text += &format!("o5\no0\nv{j}\no16\nv{}\nn2\n", (j + 1) % n));
    text += "b\n";
    (0..n).for_each(|_| text += "3\n");
    let mut t = translate(&nl::read(text.as_bytes()).unwrap(), Some(0)).unwrap();
    // squares of differences of neighbours on a circle: a diagonal and one entry beside it
    assert_eq!(t.program.hess_pattern().nnz(), 2 * n);
    let x: Vec<f64> = (0..n).map(|j| (j % 7) as f64).collect();
    assert!(t.program.eval(&x, &mut []).unwrap() > 0.0);
}

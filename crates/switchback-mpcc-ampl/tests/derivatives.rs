//! Values against those of the format, derivatives against differences.

mod common;

use common::{binary, deviation, header, read, EVERYTHING};
use switchback::nlp::Nlp;
use switchback_mpcc_ampl::nl;
use switchback_mpcc_ampl::translate::translate;

/// An objective of variables with these values, in lines of expressions; what it is worth.
fn objective(lines: &[&str], x: &[f64]) -> (String, f64) {
    let mut text = header(x.len(), 0, 1, 0, 0) + "O0 0\n";
    lines.iter().for_each(|l| text += &format!("{l}\n"));
    text += "b\n";
    x.iter().for_each(|_| text += "3\n");
    let problem = read(&text);
    let nodes = problem.forest.values(x);
    let value = problem.objectives[0].body.value(x, &nodes);
    (text, value)
}

/// Every smooth operator: the value of the file, the value of the program, and derivatives of both orders.
#[test]
fn smooth_operators() {
    let (a, b) = (0.37f64, 1.61f64);
    let of_two = |op: &str| vec![op.to_owned(), "v0".into(), "v1".into()];
    let of_one = |op: i32, v: &str| vec![format!("o{op}"), v.to_owned()];
    let cases: Vec<(Vec<String>, f64)> = vec![
        (of_two("o0"), a + b),
        (of_two("o1"), a - b),
        (of_two("o2"), a * b),
        (of_two("o3"), a / b),
        (of_two("o5"), a.powf(b)),
        (vec!["o5".into(), "v0".into(), "n3".into()], a.powi(3)),
        (vec!["o5".into(), "v0".into(), "n-2.5".into()], a.powf(-2.5)),
        (vec!["o76".into(), "v0".into(), "s2".into()], a * a),
        (vec!["o78".into(), "n2.5".into(), "v0".into()], 2.5f64.powf(a)),
        (of_one(77, "v0"), a * a),
        (of_one(16, "v0"), -a),
        (of_one(37, "v0"), a.tanh()),
        (of_one(38, "v0"), a.tan()),
        (of_one(39, "v0"), a.sqrt()),
        (of_one(40, "v0"), a.sinh()),
        (of_one(41, "v0"), a.sin()),
        (of_one(42, "v0"), a.log10()),
        (of_one(43, "v0"), a.ln()),
        (of_one(44, "v0"), a.exp()),
        (of_one(45, "v0"), a.cosh()),
        (of_one(46, "v0"), a.cos()),
        (of_one(47, "v0"), a.atanh()),
        (of_two("o48"), a.atan2(b)),
        (of_one(49, "v0"), a.atan()),
        (of_one(50, "v0"), a.asinh()),
        (of_one(51, "v0"), a.asin()),
        (of_one(52, "v1"), b.acosh()),
        (of_one(53, "v0"), a.acos()),
        (["o54", "3", "v0", "o2", "v0", "v1", "l7"].map(String::from).to_vec(), a + a * b + 7.0),
        // constants fold, jumps of them too
        (["o2", "o13", "n2.7", "v0"].map(String::from).to_vec(), 2.0 * a),
        (["o35", "o22", "n1", "n2", "o44", "v0", "o43", "n-1"].map(String::from).to_vec(), a.exp()),
    ];
    for (lines, expected) in cases {
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let x = [a, b];
        let (text, value) = objective(&lines, &x);
        assert!((value - expected).abs() <= 4e-16 * expected.abs().max(1.0), "{lines:?}: {value} {expected}");
        let mut t = translate(&read(&text), Some(0)).unwrap();
        let f = t.program.eval(&x, &mut []).unwrap();
        assert!((f - expected).abs() <= 1e-15 * expected.abs().max(1.0), "{lines:?}: {f} {expected}");
        let worst = deviation(&mut t.program, &x, 1.3, &[]);
        assert!(worst < 1e-7, "{lines:?}: {worst:e}");
    }
}

#[test]
fn a_program_with_everything() {
    let text = header(5, 6, 1, 2, 0) + EVERYTHING;
    let problem = read(&text);
    let x = [0.3, -0.7, 0.4, 1.1, -1.2];
    let nodes = problem.forest.values(&x);
    let v = 2.0 * x[0] + x[1].sin();
    assert!((problem.constraints[0].value(&x, &nodes) - (v * v + x[2].exp() + 3.0 * x[1])).abs() < 1e-15);
    let f = v * v - (x[0].powi(4) + x[2] * x[2] + x[3] * x[3]) + x[1] - 2.0 * x[4];
    assert!((problem.objectives[0].body.value(&x, &nodes) - f).abs() < 1e-14);
    assert_eq!(problem.start, [0.25, 0.0, 0.0, 0.0, -1.5]);

    let mut t = translate(&problem, Some(0)).unwrap();
    // constraint 2 with x4 >= -2, constraint 3 with x0 <= 4, both bounds of x4 with constraint 4; constraint 1 is an equation
    assert_eq!(switchback::Mpcc::pairs(&t.program).len(), 4);
    let n = t.program.n();
    let w: Vec<f64> = (0..n).map(|j| 0.3 + 0.17 * j as f64).collect();
    let y: Vec<f64> = (0..t.program.m()).map(|i| 0.5 - 0.3 * i as f64).collect();
    let worst = deviation(&mut t.program, &w, -0.8, &y);
    assert!(worst < 1e-8, "{worst:e}");
    // the program minimises, counts x4 from its lower bound and x0 from its upper one
    let mut c = vec![0.0; t.program.m()];
    let w: Vec<f64> = (0..n)
        .map(|j| match j {
            0 => 4.0 - x[0],
            3 => x[3] + 2.0,
            4 => x[4] + 3.0,
            j if j < 5 => x[j],
            _ => 0.0,
        })
        .collect();
    let found = t.program.eval(&w, &mut c).unwrap();
    assert!((found + f).abs() < 1e-13, "{found} {f}");
}

#[test]
fn both_forms_are_the_same() {
    let text = header(5, 6, 1, 2, 0) + EVERYTHING;
    let expected = format!("{:?}", read(&text));
    for big in [false, true] {
        let found = nl::read(&binary(&text, big)).unwrap();
        assert_eq!(format!("{found:?}"), expected, "big: {big}");
    }
}

/// Kinks and conditions: at points whose variables for them are consistent, the program is worth what the expression is.
#[test]
fn kinks_and_conditions() {
    let cases: [&[&str]; 10] = [
        &["o15", "o1", "v0", "v1"],
        &["o12", "3", "v0", "v1", "n0.5"],
        &["o11", "3", "v0", "v1", "o2", "v0", "v1"],
        &["o6", "v0", "v1"],
        &["o64", "3", "n-1", "n-0.5", "n0.5", "n1", "n2", "v0"],
        &["o35", "o28", "v0", "v1", "o2", "v0", "v0", "v1"],
        &["o35", "o21", "o22", "v0", "v1", "o34", "o23", "v1", "n0", "v0", "o41", "v1"],
        &["o35", "o20", "o29", "v0", "n1", "o29", "v1", "n1", "n5", "v0"],
        &["o15", "o12", "2", "v0", "o15", "v1"],
        &[
            "o54", "2", "o71", "2", "o29", "v0", "n0", "o29", "v1", "n0", "o70", "2", "o29", "v0", "n0", "o29", "v1",
            "n0",
        ],
    ];
    for lines in cases {
        for x in [[0.3, 1.7], [-0.8, 0.4], [1.9, -0.6], [-1.2, -2.0]] {
            let (text, expected) = objective(lines, &x);
            let mut problem = read(&text);
            problem.start = x.to_vec();
            let mut t = translate(&problem, Some(0)).unwrap();
            let mut c = vec![0.0; t.program.m()];
            let f = t.program.eval(&t.start, &mut c).unwrap();
            assert!((f - expected).abs() < 1e-14, "{lines:?} at {x:?}: {f} {expected}");
            for (v, (l, u)) in c.iter().zip(t.bounds.cl.iter().zip(&t.bounds.cu)) {
                assert!((l - 1e-14..=u + 1e-14).contains(v), "{lines:?} at {x:?}");
            }
            for &(a, b) in switchback::Mpcc::pairs(&t.program) {
                assert!(t.start[a] >= 0.0 && t.start[b] >= 0.0 && t.start[a] * t.start[b] == 0.0);
            }
            let y: Vec<f64> = c.iter().map(|v| 1.0 + v).collect();
            let start = t.start.clone();
            assert!(deviation(&mut t.program, &start, 0.7, &y) < 1e-8);
        }
    }
}

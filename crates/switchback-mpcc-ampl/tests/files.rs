//! Files that are refused and why, and files that are solved and with what.

mod common;

use common::{binary, header, read};
use switchback_mpcc_ampl::driver;
use switchback_mpcc_ampl::nl;
use switchback_mpcc_ampl::options::Options;
use switchback_mpcc_ampl::sol::{Sol, Suffix, Values};

fn refused(text: &str) -> String {
    nl::read(text.as_bytes()).err().unwrap_or_else(|| panic!("read without an error:\n{text}")).to_string()
}

fn solved(text: &str, options: &str) -> Sol {
    let mut o = Options::default();
    o.assign(options).unwrap();
    driver::solve(&read(text), &o, &mut Vec::new()).unwrap()
}

#[track_caller]
fn near(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    for (f, e) in found.iter().zip(expected) {
        assert!((f - e).abs() < 1e-7 * e.abs().max(1.0), "{found:?} {expected:?}");
    }
}

#[test]
fn errors_name_the_line_and_what_was_expected() {
    assert!(refused("").contains("line 1: expected the first line of the header, but the file ends"));
    assert!(refused("x3 1 1 0\n").contains("begins with neither 'g' nor 'b'"));
    assert!(refused("g3 1 1 0\n 1 1\n").contains("numbers of variables, constraints and objectives"));
    let many = header(1_000_000_000, 0, 1, 0, 0);
    assert!(refused(&many).contains("the header counts 1000000001 variables"), "{}", refused(&many));
    let huge = header(usize::MAX, 1, 1, 0, 0);
    assert!(refused(&huge).contains("too large"), "{}", refused(&huge));

    let h = header(2, 1, 1, 0, 0);
    let cases = [
        ("C0\no5\nv0\n", "line 14: expected an expression, but the file ends"),
        ("C0\no5\nv0\nq1\n", "line 14: expected an expression: o, n, v, s, l, f or h, found 'q'"),
        ("C0\no19\n", "line 12: there is no operator 19"),
        ("C0\nv2\n", "line 12: the number of a variable is 2, but there are 2 of them"),
        ("C1\nn0\n", "line 11: the number of a constraint is 1, but there are 1 of them"),
        ("C0\nnabc\n", "line 12: expected a number, found 'abc'"),
        ("C0\nninf\n", "line 12: expected a number, found inf: it must be finite"),
        ("C0\no54\n0\n", "line 13: expected operands of sum, found none"),
        ("C0\no64\n1\n", "line 13: a piecewise-linear term has 1 slopes: it must have 2 at least"),
        ("C0\no64\n3\nn0\nn2\nn1\nn1\nn3\nv0\n", "line 17: breakpoints of a piecewise-linear term must increase"),
        ("r\n7 1\n", "line 12: expected the kind of bounds of a constraint, found '7'"),
        ("r\n5 1 3\n", "line 12: a constraint complements variable 3, outside 1..2"),
        ("r\n5 9 1\n", "line 12: the flags of a complementarity constraint is 9"),
        ("b\n3\n", "line 13: expected bounds of a variable, but the file ends"),
        ("J0 1\n0 nan\n", "line 12: expected a factor, found NaN"),
        ("V2 0 0\nn0\n", "the number of a defined variable is 2, but there are 2 of them"),
        ("x-1\n", "line 11: expected a number of starting values, found -1"),
        ("Z\n", "line 11: expected a segment"),
        ("r\n3\n", "expected a segment b, the bounds of the variables, but the file ends"),
        ("b\n3\n3\n", "expected a segment r, the bounds of the constraints, but the file ends"),
        ("C0\nf0 1\nh5:ab\n", "expected 5 bytes of a text"),
        ("C0\nf0 1\nhx:ab\n", "expected the length of a text and ':'"),
    ];
    for (segment, expected) in cases {
        let found = refused(&(h.clone() + segment));
        assert!(found.contains(expected), "{segment:?}: {found}");
    }
    let used = header(2, 0, 1, 1, 0) + "O0 0\nv2\nb\n3\n3\n";
    assert!(refused(&used).contains("the defined variable 2 is used before its segment V"));
    let early = header(2, 0, 1, 1, 0) + "V1 0 0\nn0\n";
    assert!(refused(&early).contains("it must be 2 at least"));
    assert!(refused(&(h.replace(" 2 1 1 0 0", " 2 1 1 0 0 4"))).contains("4 logical constraints (segment L)"));
    let text = header(2, 0, 1, 0, 0) + "O0 0\nn1\nb\n3\n3\n";
    let mut bytes = binary(&text, false);
    bytes.truncate(bytes.len() - 4);
    assert!(nl::read(&bytes).unwrap_err().to_string().contains("byte"));
}

/// What can be read and not be solved is named, and nothing else stands in its way.
#[test]
fn refusals_by_name() {
    let of = |lines: &str| solved(&(header(1, 0, 1, 0, 0) + "F0 1 -1 besselj\nO0 0\n" + lines + "b\n0 0 9\n"), "");
    for (lines, name) in [
        ("f0 2\nv0\nh3:abc\n", "the imported function besselj"),
        ("o13\nv0\n", "the operator floor of variables jumps"),
        ("o4\nv0\nn2\n", "the operator mod"),
        ("o35\no24\nv0\nn1\nn0\nn1\n", "the operator = of variables"),
        ("o59\n1\nv0\n", "the operator count"),
        ("o35\nv0\nn0\nn1\n", "the condition of an if"),
    ] {
        let s = of(lines);
        assert!(s.code == 510 && s.message.contains(name) && s.primals.is_empty(), "{lines:?}: {}", s.message);
    }
    // another objective does not matter
    let two = header(1, 0, 2, 0, 0) + "O0 0\no13\nv0\nO1 0\no5\nv0\nn2\nb\n2 1\n";
    assert_eq!(solved(&two, "objno=2").primals, [1.0]);
    let whole = header(1, 0, 1, 0, 1) + "O0 0\no5\nv0\nn2\nb\n0 -1.5 4\n";
    assert!(solved(&whole, "").message.contains("1 variables must be integers"));
    let relaxed = solved(&whole, "relax_integrality=1");
    assert!(relaxed.code == 0 && relaxed.message.contains("relaxed"), "{}", relaxed.message);
    let e = driver::solve(&read(&two), &Options { objno: 3, ..Options::default() }, &mut Vec::new()).unwrap_err();
    assert!(e.to_string().contains("the problem has 2 objectives"));
    // the variable has no bound to be complementary with
    let open = header(1, 1, 0, 0, 0) + "C0\nn0\nr\n5 1 1\nb\n3\nJ0 1\n0 1\n";
    assert!(solved(&open, "").message.contains("complements the lower bound of variable 0, which has none"));
}

/// `max 2 x + 3 y` under `x + y <= 4`, `x + 3 y <= 6`, `x <= 3`: dual values as AMPL has them.
#[test]
fn a_linear_program_with_its_dual_values() {
    let text = header(2, 2, 1, 0, 0)
        + "C0\nn0\nC1\nn1\nO0 1\nn10\nr\n1 4\n0 -5 7\nb\n0 0 3\n2 0\nJ0 2\n0 1\n1 1\nJ1 2\n0 1\n1 3\nG0 2\n0 2\n1 3\n";
    let s = solved(&text, "");
    assert_eq!(s.code, 0, "{}", s.message);
    near(&s.primals, &[3.0, 1.0]);
    assert!(s.message.contains("objective 19"), "{}", s.message);
    // both rows and the bound of x are active; one of the three is not needed
    let bound = real(&s.suffixes, "bound_dual");
    near(&[s.duals[0] + s.duals[1] + bound[0], s.duals[0] + 3.0 * s.duals[1]], &[2.0, 3.0]);
    assert!(s.duals.iter().all(|y| *y >= -1e-9) && bound[0] >= -1e-9);
    // minimised with the other sign: so are the dual values
    let least = text.replace("O0 1\nn10", "O0 0\nn-10").replace("G0 2\n0 2\n1 3", "G0 2\n0 -2\n1 -3");
    let s = solved(&least, "");
    let bound = real(&s.suffixes, "bound_dual");
    near(&[s.duals[0] + s.duals[1] + bound[0], s.duals[0] + 3.0 * s.duals[1]], &[-2.0, -3.0]);
}

fn real(suffixes: &[Suffix], name: &str) -> Vec<f64> {
    let mut out = vec![0.0; 9];
    for s in suffixes.iter().filter(|s| s.name == name) {
        if let Values::Real(v) = &s.values {
            v.iter().for_each(|(k, v)| out[*k] = *v);
        }
    }
    out
}

/// A variable between two bounds, complementary to `x - t` for a fixed `t`: the projection of `t` on the interval.
#[test]
fn a_mixed_complementarity_problem() {
    for (t, x) in [(-7.0, -3.0), (1.25, 1.25), (9.0, 2.0), (-3.0, -3.0)] {
        let text = header(2, 1, 0, 0, 0) + "C0\nn0\nr\n5 3 1\nb\n0 -3 2\n4 T\nJ0 2\n0 1\n1 -1\n";
        let s = solved(&text.replace('T', &t.to_string()), "");
        assert_eq!(s.code, 0, "{t}: {}", s.message);
        near(&s.primals, &[x, t]);
    }
    // an upper bound alone, a lower bound alone, and no bound: the last is an equation
    for (flags, bounds, t, x) in [
        (2, "1 2", 9.0, 2.0),
        (2, "1 2", 1.0, 1.0),
        (1, "2 -3", -7.0, -3.0),
        (1, "2 -3", 5.0, 5.0),
        (0, "3", 5.0, 5.0),
        // fixed at a bound that takes part: the sign of the function is free on that side
        (1, "4 2", 1.0, 2.0),
        (3, "4 2", 7.0, 2.0),
    ] {
        let text = header(1, 1, 0, 0, 0) + &format!("C0\nn{}\nr\n5 {flags} 1\nb\n{bounds}\nJ0 1\n0 1\n", -t);
        let s = solved(&text, "");
        assert_eq!(s.code, 0, "{flags} {t}: {}", s.message);
        near(&s.primals, &[x]);
    }
    // the function would have to be positive at a variable that is fixed
    let text = header(1, 1, 0, 0, 0) + "C0\nn-3\nr\n5 1 1\nb\n4 2\nJ0 1\n0 1\n";
    assert_eq!(solved(&text, "").code / 100, 2);
}

/// A variable that two constraints complement: `x >= 1`, `x - 2 >= 0` or `x = 1`, and `y + x - 4`.
#[test]
fn a_variable_in_two_pairs() {
    let text = header(2, 2, 1, 0, 0)
        + "C0\nn-2\nC1\nn-4\nO0 0\no5\no0\nv1\nn-1\nn2\nr\n5 1 1\n5 1 1\nb\n2 1\n3\nJ0 1\n0 1\nJ1 2\n0 1\n1 1\nx1\n0 3\n";
    let s = solved(&text, "");
    assert_eq!(s.code, 0, "{}", s.message);
    // F = x - 2 >= 0 excludes x = 1: both functions are zero
    near(&s.primals, &[2.0, 2.0]);
}

#[test]
fn outcomes_have_the_numbers_of_ampl() {
    // x >= 3 and x <= 1
    let infeasible = header(1, 2, 1, 0, 0) + "C0\nn0\nC1\nn0\nO0 0\nv0\nr\n2 3\n1 1\nb\n0 0 9\nJ0 1\n0 1\nJ1 1\n0 1\n";
    let s = solved(&infeasible, "");
    assert!(s.code / 100 == 2 && !real(&s.suffixes, "conflict").iter().all(|w| *w == 0.0), "{}", s.message);
    let crossed = header(1, 0, 1, 0, 0) + "O0 0\nv0\nb\n0 3 2\n";
    assert!(solved(&crossed, "").message.contains("variable 0 has the lower bound 3 above the upper bound 2"));
    assert_eq!(solved(&crossed, "").code, 200);
    let falls = header(1, 0, 1, 0, 0) + "O0 1\nv0\nb\n2 0\n";
    assert_eq!(solved(&falls, "").code, 300, "{}", solved(&falls, "").message);
    let square = header(1, 0, 1, 0, 0) + "O0 0\no5\no1\nv0\nn3\nn4\nb\n3\n";
    assert_eq!(solved(&square, "max_iter=1").code, 400);
    assert_eq!(solved(&square, "max_time=0").code, 401);
    let nowhere = header(1, 0, 1, 0, 0) + "O0 0\no43\no1\nn-1\no5\nv0\nn2\nb\n3\n";
    assert_eq!(solved(&nowhere, "").code / 100, 5, "{}", solved(&nowhere, "").message);
    // max -(x - 1)^2 has a saddle nowhere; min -x^2 + x^4 starts at one
    let saddle = header(1, 0, 1, 0, 0) + "O0 0\no1\no5\nv0\nn4\no5\nv0\nn2\nb\n3\n";
    let s = solved(&saddle, "");
    assert!(s.code == 0 && (s.primals[0].abs() - 0.5f64.sqrt()).abs() < 1e-6 || s.code == 104, "{}", s.message);
    let none = header(0, 0, 0, 0, 0) + "b\n";
    assert_eq!(solved(&none, "").code, 0);
    let empty = header(0, 1, 0, 0, 0) + "C0\nn2\nr\n1 1\nb\n";
    assert_eq!(solved(&empty, "").code, 200);
    // no objective: any point of the rows
    let point = header(2, 1, 0, 0, 0) + "C0\no0\no5\nv0\nn2\no5\nv1\nn2\nr\n4 2\nb\n3\n3\nx2\n0 1\n1 0.5\n";
    let s = solved(&point, "");
    assert!(s.code == 0 && (s.primals[0].powi(2) + s.primals[1].powi(2) - 2.0).abs() < 1e-9, "{}", s.message);
}

/// Steps where the two sides of a condition differ: a point between them is no solution of the problem as it is stated.
#[test]
fn a_point_on_a_step_is_told() {
    // min (x - 1)^2  s.t.  (if x >= 1 then 1 else 0) = 0.5
    let text = header(1, 1, 1, 0, 0) + "C0\no35\no28\nv0\nn1\nn1\nn0\nO0 0\no5\no1\nv0\nn1\nn2\nr\n4 0.5\nb\n3\n";
    let s = solved(&text, "");
    assert_eq!(s.code, 120, "{}", s.message);
    assert!(s.message.contains("constraint 0 violates its bounds by 5"), "{}", s.message);
    // min |x - 3| + |x + 1| + 2 |x - 1|, whose kink is the solution
    let abs = |c: &str| format!("o15\no0\nv0\nn{c}\n");
    let text = header(1, 0, 1, 0, 0) + "O0 0\no54\n3\n" + &abs("-3") + &abs("1") + "o2\nn2\n" + &abs("-1") + "b\n3\n";
    let s = solved(&text, "");
    assert_eq!(s.code, 0, "{}", s.message);
    near(&s.primals, &[1.0]);
}

/// The command: a file in, a file out.
#[test]
fn the_command_writes_what_ampl_reads() {
    let place = std::env::temp_dir().join(format!("switchback-mpcc-ampl-{}", std::process::id()));
    std::fs::create_dir_all(&place).unwrap();
    let stub = place.join("two").to_string_lossy().into_owned();
    let text = header(1, 0, 1, 0, 0) + "O0 0\no5\no1\nv0\nn3\nn2\nb\n3\n";
    for bytes in [text.clone().into_bytes(), binary(&text, false), binary(&text, true)] {
        std::fs::write(stub.clone() + ".nl", bytes).unwrap();
        let run = |args: &[&str], env: &str| {
            let mut out = Vec::new();
            let args: Vec<String> = args.iter().map(|a| (*a).to_owned()).collect();
            let r = driver::run(&args, env, &mut out);
            (r.map_err(|e| e.to_string()), String::from_utf8(out).unwrap())
        };
        assert_eq!(run(&[&stub, "-AMPL"], "outlev=0"), (Ok(()), String::new()));
        let sol = std::fs::read_to_string(stub.clone() + ".sol").unwrap();
        assert!(sol.contains("optimal solution (a strict local optimum)"), "{sol}");
        let (_, values) = sol.split_once("\n\nOptions\n3\n1\n1\n0\n0\n0\n1\n1\n").unwrap();
        let (x, rest) = values.split_once('\n').unwrap();
        assert!((x.parse::<f64>().unwrap() - 3.0).abs() < 1e-12 && rest.starts_with("objno 0 0\n"), "{sol}");
        std::fs::remove_file(stub.clone() + ".sol").unwrap();
        let (r, shown) = run(&[&(stub.clone() + ".nl"), "-e", "wantsol=2", "outlev = 3"], "max_iter=17");
        assert!(r.is_ok() && shown.contains("\nvariable 0 = ") && shown.contains("\nobjective "), "{shown}");
        assert!(shown.lines().count() > 5 && !std::fs::exists(stub.clone() + ".sol").unwrap());
        assert!(run(&[&stub, "tolerance=3"], "").0.unwrap_err().contains("unknown option 'tolerance'"));
        assert!(run(&["-q"], "").0.unwrap_err().contains("unknown flag -q"));
        assert!(run(&[], "").0.unwrap_err().contains("no problem given"));
        assert!(run(&[&(stub.clone() + "x")], "").0.unwrap_err().contains("cannot read"));
        assert!(run(&["-v"], "").1.contains(env!("CARGO_PKG_VERSION")));
        assert!(run(&["-="], "").1.contains("sigma_min"));
        assert!(run(&["-?"], "").1.contains("-AMPL"));
    }
    std::fs::remove_dir_all(&place).unwrap();
}

/// A file of Pyomo 6: Jiang and Ralph's first problem, with a variable for the function that is in the pair.
#[test]
fn a_file_of_pyomo() {
    let s = solved(include_str!("data/jr1.nl"), "");
    assert_eq!(s.code, 0, "{}", s.message);
    near(&s.primals, &[0.5, 0.5, 0.0]);
    assert_eq!(solved(include_str!("data/jr1.nl"), "polish=off").code, 103);
    let numbers = |name: &str| s.suffixes.iter().find(|s| s.name == name).map(|s| s.values.clone());
    assert_eq!(numbers("stationarity"), Some(Values::Int(vec![(0, 1)])));
    assert_eq!(numbers("b_stationary"), Some(Values::Int(vec![(0, 1)])));
    // where the function z2 - z1 has to be s instead of 0, the optimum is (1 + s)² / 2
    near(&[s.duals[0]], &[1.0]);
}

/// Jiang and Ralph's first problem with the function in the constraint, and its mirror image below an upper bound: dual values are
/// derivatives of the optimum `(1 + s)² / 2`, or `(1 - s)² / 2`, by the value `s` the function is compared with.
#[test]
fn dual_values_of_complementarity_constraints() {
    let of = |flags: i32, bound: &str, sign: i32, maximise: bool| {
        let (sense, outer) = if maximise { (1, "o16\n") } else { (0, "") };
        let body = format!("O0 {sense}\n{outer}o0\no5\no0\nv0\nn-1\nn2\no5\nv1\nn2\n");
        header(2, 1, 1, 0, 0) + "C0\nn0\n" + &body + &format!("r\n5 {flags} 2\nb\n3\n{bound}\nJ0 2\n0 {sign}\n1 1\n")
    };
    for (flags, bound, sign, maximise, expected) in [
        (1, "2 0", -1, false, 1.0),
        (1, "2 0", -1, true, -1.0),
        (2, "1 0", 1, false, -1.0),
        (2, "1 0", 1, true, 1.0),
        // the other bound is far away
        (3, "0 0 7", -1, false, 1.0),
        (3, "0 -7 0", 1, false, -1.0),
    ] {
        let s = solved(&of(flags, bound, sign, maximise), "");
        assert_eq!(s.code, 0, "{}", s.message);
        near(&s.primals, &[0.5, -0.5 * f64::from(sign)]);
        near(&s.duals, &[expected]);
    }
}

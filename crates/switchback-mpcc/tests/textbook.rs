//! Programs of the literature with known answers: what the solver must say of each.

#[path = "common/textbook/mod.rs"]
mod textbook;

use switchback_mpcc::mpcc::{BStationarity, MpccSettings};
use switchback_mpcc::nlp::Nlp;
use textbook::branches::{is_local_minimiser, survey, MAX_PAIRS};
use textbook::planted::{enumerated, long};
use textbook::{all, relative, Expect, Numbers, Verdict, ACCURACY};

#[test]
fn every_problem_ends_as_known() {
    let mut bad = Vec::new();
    for p in all() {
        for (k, start) in p.starts.iter().enumerate() {
            if let Verdict::Fail(why) = p.judge(&p.solve(MpccSettings::default(), start)) {
                bad.push(format!("{} from start {k}: {why}", p.name));
            }
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

/// What the collection says of a problem follows from its branches.
#[test]
fn answers_follow_from_the_enumeration_of_branches() {
    for p in all().iter().filter(|p| (1..=MAX_PAIRS).contains(&p.members.len())) {
        let s = survey(p, if p.members.len() > 6 { 3 } else { 6 });
        match p.known.expect {
            Expect::Infeasible => assert!(s.solved.is_empty(), "{}: {:?}", p.name, s.solved),
            Expect::Unbounded => assert!(s.unbounded, "{}", p.name),
            Expect::Optimal => {
                let f = s.minimum();
                assert!(relative(f, p.known.f) <= ACCURACY, "{}: {f}, listed {}", p.name, p.known.f);
            }
        }
        for &f in &p.known.local {
            let mut at = s.solved.iter().filter(|d| relative(d.0, f) <= ACCURACY);
            assert!(at.any(|d| is_local_minimiser(p, &d.1)), "{}: no local minimiser with objective {f}", p.name);
        }
    }
}

#[test]
fn listed_minimisers_are_minimisers_and_traps_are_not() {
    for p in all() {
        let objective = |x: &[f64]| p.program.clone().eval(x, &mut vec![0.0; p.program.m()]).unwrap();
        if let Some(x) = &p.known.x {
            let (rows, pairs) = p.violation(x);
            assert!(rows.max(pairs) < 1e-9, "{}: {rows:e} {pairs:e}", p.name);
            assert!(relative(objective(x), p.known.f) <= 1e-12, "{}: {}", p.name, objective(x));
        }
        for (x, _) in &p.known.traps {
            let (rows, pairs) = p.violation(x);
            assert!(rows.max(pairs) < 1e-12 && !is_local_minimiser(&p, x), "{}: {x:?}", p.name);
        }
    }
}

/// No answer is below the lowest branch, and none can be improved in a neighbourhood.
#[test]
fn programs_whose_branches_are_enumerated_end_in_local_minimisers() {
    let mut bad = Vec::new();
    for p in enumerated() {
        let found = p.solve(MpccSettings::default(), &p.starts[0]);
        let (f, minimum) = (found.solution.objective, survey(&p, 1).minimum());
        if let Verdict::Fail(why) = p.judge(&found) {
            bad.push(format!("{}: {why}", p.name));
        } else if f < minimum - ACCURACY * minimum.abs().max(1.0) {
            bad.push(format!("{}: {f} is below every branch, {minimum}", p.name));
        } else if !is_local_minimiser(&p, &found.x) {
            bad.push(format!("{}: {f} can be improved, minimum {minimum}, {:?}", p.name, found.certificate));
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

/// Too large for an enumeration: solved, polished, and certified as B-stationary.
#[test]
fn long_chains_end_certified() {
    for p in long() {
        let found = p.solve(MpccSettings::default(), &p.starts[0]);
        assert_eq!(p.judge(&found), Verdict::Pass, "{}", p.name);
        let certificate = found.certificate.expect("a certificate");
        assert_eq!(certificate.b, BStationarity::Yes, "{}: {certificate:?}", p.name);
    }
}

/// The types were derived by hand.
#[test]
fn listed_types_of_stationarity_are_certified() {
    let mut bad = Vec::new();
    for p in all() {
        if let (Some(x), Some(t)) = (&p.known.x, p.known.stat) {
            let c = p.certify_at(x);
            if c.stationarity != t || !c.sharp || c.b != BStationarity::Yes {
                bad.push(format!("{}: {c:?}, listed {}", p.name, t.name()));
            }
        }
        for (x, t) in &p.known.traps {
            let c = p.certify_at(x);
            if c.stationarity != *t || !c.sharp || c.b != BStationarity::No {
                bad.push(format!("trap of {}: {c:?}, listed {}", p.name, t.name()));
            }
        }
    }
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

#[test]
fn derivatives_of_formulas_are_exact() {
    let mut r = Numbers::new(3);
    for p in all() {
        let mut q = p.program.clone();
        let (n, m) = (q.n(), q.m());
        let x: Vec<f64> = p.starts[0].iter().map(|v| v + 0.1 * r.next()).collect();
        let y: Vec<f64> = (0..m).map(|_| r.next()).collect();
        let (jp, hp) = (q.jac_pattern().clone(), q.hess_pattern().clone());
        // gradient of the Lagrangian along a direction, and its derivative, by central differences
        let d: Vec<f64> = (0..n).map(|_| r.next()).collect();
        let mut lagrangian = |x: &[f64]| {
            let (mut c, mut g, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; jp.nnz()]);
            let f = q.eval(x, &mut c).unwrap();
            q.derivatives(x, &mut g, &mut jac).unwrap();
            for (j, g) in g.iter_mut().enumerate() {
                *g += jp.range(j).zip(jp.rows(j)).map(|(k, &i)| jac[k] * y[i]).sum::<f64>();
            }
            (f + c.iter().zip(&y).map(|(c, y)| c * y).sum::<f64>(), g)
        };
        let h = 1e-6;
        let shifted = |s: f64| -> Vec<f64> { x.iter().zip(&d).map(|(x, d)| x + s * d).collect() };
        let ((fp, gp), (fm, gm)) = (lagrangian(&shifted(h)), lagrangian(&shifted(-h)));
        let (_, g) = lagrangian(&x);
        let along: f64 = g.iter().zip(&d).map(|(g, d)| g * d).sum();
        assert!((along - (fp - fm) / (2.0 * h)).abs() < 1e-5 * (1.0 + along.abs()), "{}: gradient", p.name);
        let mut hess = vec![0.0; hp.nnz()];
        q.hessian(&x, 1.0, &y, &mut hess).unwrap();
        let mut product = vec![0.0; n];
        for j in 0..n {
            for (k, &i) in hp.range(j).zip(hp.rows(j)) {
                product[i] += hess[k] * d[j];
                if i != j {
                    product[j] += hess[k] * d[i];
                }
            }
        }
        let scale = 1.0 + product.iter().fold(0.0f64, |a, v| a.max(v.abs()));
        for j in 0..n {
            let e = product[j] - (gp[j] - gm[j]) / (2.0 * h);
            assert!(e.abs() < 1e-5 * scale, "{}: Hessian row {j} off by {e:e}", p.name);
        }
    }
}

/// Scholtes (2001): under strict complementarity the solution of the relaxed problem is Lipschitz in `σ`.
#[test]
fn relaxed_solutions_approach_at_the_rate_of_the_relaxation() {
    let sigmas = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];
    for name in ["kth3", "sign flip", "bard1"] {
        let p = all().into_iter().find(|p| p.name == name).unwrap();
        let exact = p.known.x.as_ref().unwrap();
        let points: Vec<(f64, f64)> = sigmas
            .iter()
            .map(|&sigma| {
                let settings = MpccSettings { sigma_min: sigma, polish: false, ..MpccSettings::default() };
                let found = p.solve(settings, &p.starts[0]);
                let error = found.x.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                (sigma.ln(), error.ln())
            })
            .collect();
        let n = points.len() as f64;
        let (mx, my) = (points.iter().map(|p| p.0).sum::<f64>() / n, points.iter().map(|p| p.1).sum::<f64>() / n);
        let slope = points.iter().map(|p| (p.0 - mx) * (p.1 - my)).sum::<f64>()
            / points.iter().map(|p| (p.0 - mx).powi(2)).sum::<f64>();
        assert!((0.9..1.1).contains(&slope), "{name}: slope {slope} of {points:?}");
    }
}

//! How long a call goes on after it has been interrupted: every phase on its own, interrupted at moments spread over it.

use crate::json::{Object, Table};
use crate::models::sliding_ocp;
use crate::Context;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};
use switchback::error::{Error, Result};
use switchback::func::{Callback, Dims};
use switchback::nlp::{Control, Outcome};
use switchback::ocp::Ocp;
use switchback::settings::{InitialGuess, Settings};
use switchback::stop::Stop;
use switchback::system::{SharedFunction, System};

/// Moments of a phase at which it is interrupted.
const MOMENTS: u32 = 12;
/// The same among all reports, which leave the large problems to this report alone.
const MOMENTS_OF_ALL: u32 = 3;
const LARGE: usize = 2;
/// A phase that takes longer is interrupted within so many seconds only.
const LONGEST: f64 = 2.0;

type Call<'a> = Box<dyn FnMut(&mut Control) -> Result<Outcome> + 'a>;

fn function(
    name: &str,
    d: Dims,
    m: usize,
    f: impl Fn(&[f64], &[f64], &mut [f64]) + Send + Sync + 'static,
) -> SharedFunction {
    Arc::new(Callback::new(name, d, m, move |at, o| {
        f(at.x, at.u, o);
        0
    }))
}

/// A ring of `nx` states with derivatives by differences: large factorisations, long evaluations.
fn ring(nx: usize, n_stages: usize, set: &Settings) -> Result<Ocp> {
    let d = Dims { x: nx, u: 1, p: 0 };
    let mut s = System::new(nx, 1, 0)?;
    s.set_f0(function("ring", d, nx, move |x, u, o| {
        for i in 0..x.len() {
            o[i] = (3.0 * x[(i + 1) % x.len()]).sin() - x[i] + u[0];
        }
    }))?;
    let mut o = Ocp::new(&s, 10.0, n_stages, set)?;
    let mut x0 = vec![0.0; nx];
    x0[0] = 0.3;
    o.set_x0(&x0)?;
    o.set_lagrange(function("squares", d, 1, |x, _, o| o[0] = x.iter().map(|v| v * v).sum()))?;
    Ok(o)
}

/// A right-hand side that jumps without saying so: simulations of many steps.
fn jump(set: &Settings) -> Result<Ocp> {
    let d = Dims { x: 1, u: 1, p: 0 };
    let mut s = System::new(1, 1, 0)?;
    s.set_f0(function("jump", d, 1, |x, u, o| o[0] = if x[0] > 0.0 { -1.0 } else { 1.0 } + u[0]))?;
    let mut o = Ocp::new(&s, 10.0, 4, set)?;
    o.set_x0(&[0.3])?;
    o.set_lagrange(function("square", d, 1, |x, _, o| o[0] = x[0] * x[0]))?;
    Ok(o)
}

fn solve(o: &mut Ocp, c: &mut Control) -> Result<Outcome> {
    o.solve(c).map(|r| r.outcome)
}

/// Makes what is interrupted, anew for every moment.
type Make = Box<dyn Fn() -> Call<'static>>;

/// The phases and what is interrupted in each, the `LARGE` ones first.
fn phases() -> Vec<(&'static str, Make)> {
    let usual = Settings { accuracy: 0, ..Settings::default() };
    let fresh = |make: Box<dyn Fn() -> Result<Ocp>>| -> Make {
        Box::new(move || {
            let mut o = make().expect("the problem is well posed");
            Box::new(move |c| solve(&mut o, c))
        })
    };
    let simulated = Settings { initial_guess: InitialGuess::Simulation as i64, ..usual };
    let sensitivity = move || -> Call<'static> {
        let mut o = sliding_ocp(&Settings { n_fe: 6, ..usual });
        o.solve(&mut Control::default()).expect("solvable");
        Box::new(move |c| c.stop.scope(|| o.sensitivity()).map(|_| Outcome::Solved))
    };
    vec![
        (
            "building, first factorisation, solve: 20 states x 200 stages",
            fresh(Box::new(move || ring(20, 200, &usual))),
        ),
        ("the same, 40 states x 200 stages", fresh(Box::new(move || ring(40, 200, &usual)))),
        ("starting simulation", fresh(Box::new(move || jump(&simulated)))),
        ("comparison with the simulation", fresh(Box::new(|| jump(&Settings::default())))),
        ("adaptation", fresh(Box::new(|| Ok(sliding_ocp(&Settings { adapt_tol: 1e-8, ..Settings::default() }))))),
        ("mode search", fresh(Box::new(|| Ok(sliding_ocp(&Settings { mode_search: 40, ..Settings::default() }))))),
        (
            "explanation",
            fresh(Box::new(|| {
                let mut o = sliding_ocp(&Settings { n_fe: 3, ..Settings::default() });
                let d = o.system().dims();
                o.add_terminal(function("far", d, 1, |x, _, o| o[0] = x[0]), &[100.0], &[100.0])?;
                Ok(o)
            })),
        ),
        ("sensitivity", Box::new(sensitivity)),
        (
            "several starts",
            Box::new(move || {
                let mut o = sliding_ocp(&usual);
                let starts = o.random_starts(6, 1);
                Box::new(move |c| o.solve_starts(&starts, 2, c).map(|_| Outcome::Stopped))
            }),
        ),
    ]
}

struct Phase {
    whole: f64,
    interrupt: f64,
    limit: f64,
}

/// Seconds that a call took after `delay`, when it was interrupted, or out of time, then; 0 where it had ended.
fn late(call: &mut Call, delay: f64, by_clock: bool) -> f64 {
    let flag = Arc::new(AtomicBool::new(false));
    let mut stop = Stop::on(&flag);
    if by_clock {
        stop.limit(delay);
    }
    let clock = Instant::now();
    let raiser = (!by_clock).then(|| {
        let flag = flag.clone();
        std::thread::spawn(move || {
            std::thread::sleep(Duration::from_secs_f64(delay));
            flag.store(true, Ordering::Relaxed);
        })
    });
    let end = call(&mut Control::of(stop));
    let seconds = clock.elapsed().as_secs_f64();
    assert!(!matches!(end, Err(Error::Internal(_))), "{end:?}");
    if let Some(r) = raiser {
        r.join().expect("the thread ends");
    }
    (seconds - delay).max(0.0)
}

fn measure(make: &dyn Fn() -> Call<'static>, moments: u32) -> Phase {
    let clock = Instant::now();
    let mut call = make();
    let flagged = Arc::new(AtomicBool::new(false));
    let made = clock.elapsed();
    let mut stop = Stop::on(&flagged);
    stop.limit(4.0 * LONGEST);
    let _ = call(&mut Control::of(stop));
    let whole = (clock.elapsed() - made).as_secs_f64();
    let mut worst = [0f64; 2];
    for k in 0..moments {
        let delay = whole.min(LONGEST) * (f64::from(k) + 0.5) / f64::from(moments);
        for (w, by_clock) in worst.iter_mut().zip([false, true]) {
            *w = w.max(late(&mut make(), delay, by_clock));
        }
    }
    Phase { whole, interrupt: worst[0], limit: worst[1] }
}

pub fn run(c: &Context) {
    let mut table = Table::new(&["phase", "whole, s", "late after an interrupt, ms", "late after max_time, ms"]);
    let (first, moments) = if c.all { (LARGE, MOMENTS_OF_ALL) } else { (0, MOMENTS) };
    for (name, make) in phases().into_iter().skip(first) {
        let p = measure(&*make, moments);
        let ms = |v: f64| format!("{:.1}", 1e3 * v);
        table.row(vec![name.to_owned(), format!("{:.2}", p.whole), ms(p.interrupt), ms(p.limit)]);
        let o = Object::new().text("case", "latency").text("phase", name);
        c.record(&o.num("whole", p.whole).num("interrupt", p.interrupt).num("limit", p.limit));
    }
    c.say(&table.text());
}

//! Networks and blocks without a control, by the event-driven engine and by FESD in both forms: two methods that know
//! nothing of each other, and two forms of one of them.

use super::{optimal, short};
use crate::cases::{distance, simulate};
use crate::expression_models;
use crate::json::{Object, Table};
use crate::Context;
use std::time::Instant;
use switchback::event::{self, Options};
use switchback::settings::{DcsForm, Settings};

pub fn run(c: &Context) {
    let columns = ["simulation", "switches", "event ms", "form", "switches", "difference", "ms"];
    let mut table = Table::new(&columns);
    let blocks = expression_models::blocks().system;
    let start = vec![-1.0, 1.0, -1.0, -1.0, 1.0, 1.0];
    for (name, sys, x0, duration) in optimal::free().into_iter().chain([("blocks", blocks, start, 20.0)]) {
        let clock = Instant::now();
        let tight = Options::with_tolerance(1e-12, 1e-12);
        let reference = event::simulate(&sys, &tight, 0.0, &x0, duration).expect("the run is well posed");
        let event_s = clock.elapsed().as_secs_f64();
        for form in [DcsForm::Stewart, DcsForm::Heaviside] {
            let settings = Settings { dcs_form: form as i64, n_s: 4, n_fe: 3, ..Settings::default() };
            let (r, x, seconds) = simulate(&sys, &settings, &x0, duration, 200);
            let difference = distance(&x, &reference.x);
            let o = Object::new().text("case", "gallery").text("simulation", name).text("form", form.name());
            let o = o.text("outcome", r.outcome.name()).num("difference", difference);
            let o = o.num("wall_s", seconds).num("event_s", event_s);
            let (events, switches) = (reference.switches.len(), r.trajectory.switches.len());
            c.record(&o.int("switches_event", events).int("switches", switches));
            let ms = |s: f64| format!("{:.1}", 1e3 * s);
            let row = [name.to_string(), events.to_string(), ms(event_s), form.name().to_string()];
            table.row([&row[..], &[switches.to_string(), short(difference), ms(seconds)]].concat());
        }
    }
    c.say(&table.text());
}

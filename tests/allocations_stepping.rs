//! Steps of a scene allocate nothing after the first ones.

#[path = "common/counting.rs"]
mod counting;
use counting::count;
use switchback::expr::Graph;
use switchback::scene::{Contact, Scene};
use switchback::stepping::{Options, Stepper};

/// Discs that fall onto a rough floor and each other, with friction and restitution: contacts open and close all the time.
#[test]
fn steps_allocate_nothing() {
    let (n, g) = (8, Graph::new());
    let mut s = Scene::new("discs", 2 * n, 2 * n, 0, 0).unwrap();
    let c = |v: f64| g.constant(v).id();
    for i in 0..n {
        s.set_force(2 * i, c(0.0)).unwrap();
        s.set_force(2 * i + 1, c(-9.81)).unwrap();
        let (x, y) = (g.x(2 * i), g.x(2 * i + 1));
        let floor = Contact::new(&g, &format!("floor {i}"), y - 0.2);
        s.add_contact(Contact { tangents: vec![x.id()], friction: c(0.3), restitution: c(0.9), ..floor }).unwrap();
        for j in 0..i {
            let (dx, dy) = (x - g.x(2 * j), y - g.x(2 * j + 1));
            let pair = Contact::new(&g, &format!("{j}-{i}"), (dx * dx + dy * dy).sqrt() - 0.4);
            s.add_contact(Contact { restitution: c(0.9), ..pair }).unwrap();
        }
    }
    let mut x0 = vec![0.0; 4 * n];
    for i in 0..n {
        (x0[2 * i], x0[2 * i + 1]) = (0.01 * i as f64, 0.3 + 0.45 * i as f64);
    }
    let mut stepper = Stepper::new(&s.build(&g).unwrap().system, &Options::default()).unwrap();
    // the vectors of closed contacts grow to the most there are
    stepper.reset(0.0, &x0).unwrap();
    stepper.advance(2.0).unwrap();
    let most = stepper.statistics().most_contacts;
    stepper.reset(0.0, &x0).unwrap();
    assert!(count() > 0, "the counter must count");
    let before = count();
    stepper.advance(2.0).unwrap();
    assert_eq!(count(), before);
    assert!(most > 1 && stepper.statistics().contacts > 100, "{:?}", stepper.statistics());
}

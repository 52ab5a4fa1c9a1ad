// The C++ header: models written as expressions.
#include "switchback.hpp"

#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

static int failures;
#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            failures++;                                                                                                \
            std::fprintf(stderr, "%s:%d: %s is false\n", __FILE__, __LINE__, #condition);                              \
        }                                                                                                              \
    } while (0)

template <class Body>
static swb_status status_of(Body &&body) {
    try {
        body();
    } catch (const swb::Error &e) {
        CHECK(std::string(e.what()).size() > 5);
        return e.status();
    }
    return SWB_OK;
}

static bool near(double a, double b, double tol = 1e-14) { return std::fabs(a - b) <= tol * (1 + std::fabs(b)); }

/// Every operator against the mathematics of the language.
static void values() {
    swb::Model m("x y", "u", "p");
    const swb::Expr x = m.x(0), y = m.x(1), u = m.u(0), p = m.p(0), t = m.t();
    const double a = 0.7, b = -1.3, c = 0.4, d = 2.5, s = 0.25;
    const struct {
        swb::Expr e;
        double exact;
    } cases[] = {
        {x + y, a + b},           {x + 2, a + 2},          {2 + x, a + 2},
        {x - y, a - b},           {x - 1.5, a - 1.5},      {1 - x, 1 - a},
        {x * y, a * b},           {3 * x, 3 * a},          {x * u, a * c},
        {x / y, a / b},           {x / 4, a / 4},          {4 / x, 4 / a},
        {-y, -b},                 {+y, b},                 {pow(x, 3), a * a * a},
        {pow(x, p), std::pow(a, d)}, {pow(2.0, x), std::pow(2, a)}, {atan2(y, x), std::atan2(b, a)},
        {sqrt(x), std::sqrt(a)},  {exp(y), std::exp(b)},   {log(x), std::log(a)},
        {sin(t), std::sin(s)},    {cos(y), std::cos(b)},   {tan(x), std::tan(a)},
        {asin(x), std::asin(a)},  {acos(x), std::acos(a)}, {atan(y), std::atan(b)},
        {sinh(y), std::sinh(b)},  {cosh(y), std::cosh(b)}, {tanh(y), std::tanh(b)},
        {erf(y), std::erf(b)},    {dot(m.x(), {y, u}), a * b + b * c}, {norm(m.x()), std::sqrt(a * a + b * b)},
        {swb::sum({x, y, u}), a + b + c}, {table(x, {0.0, 1.0}, {1.0, 3.0}, SWB_TABLE_LINES), 1 + 2 * a},
    };
    swb::Exprs all;
    for (const auto &k : cases)
        all.push_back(k.e);
    const swb::Vector got = m.function("all", all)(s, {a, b}, {c}, {d});
    for (std::size_t i = 0; i < all.size(); ++i) {
        CHECK(near(got[i], cases[i].exact));
        if (!near(got[i], cases[i].exact))
            std::fprintf(stderr, "  case %zu: %s\n", i, all[i].text().c_str());
    }
    swb::Expr grown = x;
    grown += y;
    grown *= 2.0;
    grown -= 1.0;
    grown /= u;
    CHECK(near(m.function("grown", {grown})(0, {a, b}, {c}, {d})[0], ((a + b) * 2 - 1) / c));
    CHECK(m.function("all", all).check_derivatives(s, {a, b}, {c}, {d}).passed);
    CHECK((x + y).id() == (y + x).id());
}

static void matrices() {
    swb::Model m(swb::Sizes{3, 0, 0});
    const swb::Expr x = m.x(0), y = m.x(1), z = m.x(2);
    swb::Matrix a(2, 2, m.constant(0));
    a(0, 0) = x + 2;
    a(1, 0) = a(0, 1) = y;
    a(1, 1) = z;
    const swb::Exprs v = solve(a, {x, m.constant(1)});
    const swb::Exprs back = a * v;
    const swb::Matrix square = a * a;
    const swb::Matrix j = jacobian({x * y, sin(z)}, m.x());
    CHECK(j.rows() == 2 && j.cols() == 3);
    const swb::Exprs w = 2.0 * (v - swb::Exprs{x, y}) + swb::Exprs{z, z};
    const swb::Vector got =
        m.function("f", {v[0], v[1], back[0], back[1], square(1, 0), j(0, 0), j(0, 1), j(1, 2), w[0]})(0, {0.5, 1.5, 2.0});
    const double det = 2.5 * 2.0 - 1.5 * 1.5, v0 = (0.5 * 2.0 - 1.5) / det, v1 = (2.5 - 1.5 * 0.5) / det;
    const double exact[] = {v0, v1, 0.5, 1.0, 1.5 * 2.5 + 2.0 * 1.5, 1.5, 0.5, std::cos(2.0), 2 * (v0 - 0.5) + 2};
    for (std::size_t i = 0; i < got.size(); ++i)
        CHECK(near(got[i], exact[i]));
}

/// What switches: the models become systems of the sizes expected and run.
static void models() {
    swb::Model driven("x");
    driven.derivatives({-sign(driven.x(0)) + 0.2 * sin(5 * driven.t())});
    CHECK(driven.counts().pairs == 2 && driven.counts().switching_functions == 1);
    swb::Simulator simulator(driven.system());
    simulator.state(0, {-0.5});
    CHECK(simulator.run(2.0, 10) == SWB_OUTCOME_SOLVED);
    const auto switches = simulator.trajectory().switches();
    CHECK(!switches.empty() && near(switches[0].t, 0.43695503338596907, 1e-5));

    swb::Model car("q v", "a", "", "turbo car");
    const swb::Expr v = car.x(1), a = car.u(0);
    car.derivative(car.x(0), v);
    car.derivative(v, where(v > 10, 3 * a, a));
    CHECK(car.counts().pairs == 2);
    CHECK(car.report().find("turbo car") != std::string::npos);
    CHECK(car.report(true).front() == '{');

    swb::Model all("x y");
    const swb::Expr x = all.x(0), y = all.x(1);
    all.derivatives({min(x, 1.0) + max(-1.0, y) + clip(x, -2, 2) + relay(y, 1, -1) + dead_zone(x, 0.5) + abs(y),
                     where((x > 0) & !(y < 1), 1, 0) + where((x <= 3) | (0 >= y), x, y) + minimum(x, y) + maximum(x, y)});
    CHECK(all.counts().switching_functions > 6);
    all.try_at({0.5, -0.5});
    CHECK(all.report().find("not defined") == std::string::npos);
    CHECK(all.c_code().find("_value") != std::string::npos);

    swb::Model smooth("q v");
    smooth.derivatives({smooth.x(1), -smooth.x(0)});
    CHECK(smooth.counts().pairs == 0);
}

static void optimal_control() {
    swb::Model m("x");
    const swb::Expr x = m.x(0);
    m.derivatives({2 - sign(x)});
    swb::Settings settings;
    settings.set("n_s", 3);
    swb::Ocp ocp(m.system(), 2.0, 1, settings);
    ocp.lagrange(m.function("L", {x * x}));
    ocp.mayer(m.function("M", {pow(x - 5.0 / 3, 2)}));
    ocp.initial_bounds({-2.0}, {-0.5});
    CHECK(ocp.solve() == SWB_OUTCOME_SOLVED);
    CHECK(near(ocp.cost(), 1.5237727753749573, 1e-6));
}

static void documents() {
    swb::Model m("q v");
    m.derivatives({m.x(1), -m.x(0) - 0.3 * sign(m.x(1))});
    const std::string text = m.to_json();
    swb::Simulator a(m.system()), b(swb::Model::system_from_json(text));
    for (swb::Simulator *s : {&a, &b}) {
        s->state(0, {1.0, 0.5});
        CHECK(s->run(1.0, 4) == SWB_OUTCOME_SOLVED);
    }
    CHECK(a.state() == b.state());
    CHECK(a.to_json(1.0, 4) == b.to_json(1.0, 4));
    CHECK(swb::Ocp(m.system(), 1.0, 2).to_json().find("\"ocp\"") != std::string::npos);
    CHECK(status_of([&] { swb::Model::system_from_json(text.substr(9)); }) == SWB_ERR_RANGE);
    // a function that the document names
    const swb::Function drag("drag", {1, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = -at.x[0] * at.x[0]; });
    swb::Model car("v");
    car.derivatives({external(drag, {car.x(0), car.t()})[0]});
    CHECK(status_of([&] { swb::Model::system_from_json(car.to_json()); }) == SWB_ERR_STATE);
    swb::Simulator c(swb::Model::system_from_json(car.to_json(), {&drag}));
    c.state(0, {1.0});
    CHECK(c.run(1.0, 20) == SWB_OUTCOME_SOLVED);
    CHECK(near(c.state()[0], 0.5, 1e-6));
}

static const double g = 9.81;

/// A ball that bounces to rest: impacts, forces and modes of the result; the same in steps.
static void scenes() {
    swb::Scene s("y", "", "", "e", "ball");
    s.force({s.constant(-g)});
    CHECK(s.contact("floor", s.q(0), {}, 0.0, s.p(0)) == 0);
    CHECK(s.contact("top", 10.0 - s.q(0)) == 1);
    s.bounds(0, -1.0, std::numeric_limits<double>::infinity());
    CHECK(s.report().find("left out") == std::string::npos);
    s.bounds(0, -std::numeric_limits<double>::infinity(), 5.0);
    CHECK(s.report().find("left out: contact top") != std::string::npos && s.report(true)[0] == '{');
    const swb::System system = s.system();
    swb::Settings settings;
    settings.set("rtol", 1e-12).set("atol", 1e-12).set("dense", "on").set("sensitivity", "on");
    swb::Integrator integrator(system, settings);
    integrator.params({0.5});
    integrator.reinit(0.0, {1.0, 0.0});
    CHECK(integrator.advance(2.0) == SWB_RUN_OUTCOME_REACHED);
    const swb::Run run = integrator.run();
    const double first = std::sqrt(2.0 / g), speed = g * first;
    const auto impacts = run.impacts();
    CHECK(impacts.size() > 8 && impacts.back().kind == SWB_IMPACT_KIND_LAST && run.info().redundant == 0);
    CHECK(near(impacts[0].t, first, 1e-12) && near(impacts[0].normal, 1.5 * speed, 1e-11));
    CHECK(near(impacts[1].t, first + speed / g, 1e-12) && near(impacts[1].rate_after, 0.25 * speed, 1e-11));
    CHECK(near(run.impact_sensitivity(0)[0], 0.5 * first, 1e-11));
    CHECK(run.contact_modes(0.1) == std::vector<int64_t>{SWB_CONTACT_MODE_OPEN});
    CHECK(run.contact_modes(1.9) == std::vector<int64_t>{SWB_CONTACT_MODE_CLOSED});
    CHECK(run.contact_forces(0.1) == swb::Vector(3) && near(run.contact_forces(1.9)[0], g, 1e-12));
    CHECK(near(run.accumulations().at(0).t, 3.0 * first, 1e-6));

    swb::StepOptions options;
    options.h = 1e-2;
    swb::Stepper stepper(system, options);
    CHECK(stepper.contacts() == 1);
    CHECK(status_of([&] { stepper.step(); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { stepper.reinit(0.0, {1.0}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { stepper.reinit(0.0, {-1.0, 0.0}); }) == SWB_ERR_RANGE);
    stepper.params({0.0});
    stepper.reinit(0.0, {1.0, 0.0});
    stepper.step();
    CHECK(near(stepper.time(), 0.01) && near(stepper.state()[1], -0.01 * g));
    const swb::Steps kept = stepper.run(1.0, 10, true);
    CHECK(kept.times.size() == 11 && kept.states.size() == 22 && kept.impulses.size() == 33);
    CHECK(kept.times.back() == 1.0 && kept.states.back() == 0.0 && near(kept.impulses[30], 0.01 * g, 1e-9));
    CHECK(near(stepper.impulses()[0], 0.01 * g, 1e-9) && stepper.stats().steps == 100 && stepper.stats().unconverged == 0);
    CHECK(stepper.run(1.1).impulses.empty());
    stepper.interrupt();
    CHECK(status_of([&] { stepper.advance(2.0); }) == SWB_ERR_INTERRUPTED);
    stepper.advance(2.0);
    CHECK(stepper.time() == 2.0);

    swb::Scene wrong("x y");
    CHECK(status_of([&] { wrong.force({wrong.q(0)}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { wrong.contact("floor", s.q(0)); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { wrong.system(); }) == SWB_ERR_STATE);
    swb::Model m("x");
    m.derivatives({-m.x(0)});
    CHECK(status_of([&] { swb::Stepper none(m.system()); }) == SWB_ERR_STATE);
}

/// Dry friction takes twice itself from the amplitude in half a turn; a constraint holds the other coordinate.
static void joints() {
    swb::Scene s("x y", "", "", "", "slider");
    s.force({-s.q(0), s.constant(-g)});
    CHECK(s.friction("guide", s.q(0), 0.15, 0.2) == 0);
    CHECK(s.constraint("rail", s.q(1)) == 1);
    CHECK(s.friction("wheel", s.v(0), 0.0) == 2);
    CHECK(status_of([&] { s.friction("guide", s.q(0), 0.1); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { s.stiction(0, 0.1); }) == SWB_ERR_RANGE);
    swb::Settings settings;
    settings.set("rtol", 1e-11).set("atol", 1e-11).set("dense", "on");
    const swb::System system = s.system();
    swb::Integrator integrator(system, settings);
    integrator.reinit(0.0, {1.0, 0.0, 0.0, 0.0});
    CHECK(integrator.advance(20.0) == SWB_RUN_OUTCOME_REACHED);
    CHECK(near(integrator.state()[0], -0.1, 1e-9) && integrator.state()[1] == 0.0);
    const swb::Run run = integrator.run();
    CHECK(near(run.contact_forces(1.0)[1], 0.15, 1e-10) && near(run.contact_forces(1.0)[3], g, 1e-10));
    CHECK(run.contact_modes(15.0)[0] == SWB_CONTACT_MODE_CLOSED);

    // the friction fades with z = exp(-t)
    swb::Scene fading("x", "", "", "", "fading", "z");
    fading.force({fading.constant(0.0)});
    fading.state_rates({-fading.state(0)});
    fading.friction("guide", fading.q(0), 0.5 * fading.state(0));
    const swb::System faded = fading.system();
    swb::Integrator slower(faded, settings);
    slower.reinit(0.0, {0.0, 1.0, 1.0});
    slower.advance(1.0);
    CHECK(near(slower.state()[1], 1.0 - 0.5 * (1.0 - std::exp(-1.0)), 1e-9));

    // a relay holds the current of a motor, which drives a joint towards a far stop
    swb::Scene motor("x", "", "", "", "motor", "z");
    motor.force({motor.state(0)});
    motor.state_rates({2.0 * sign(1.0 - motor.state(0)) - motor.state(0)});
    motor.friction("gear", motor.q(0), 0.3);
    motor.contact("stop", 5.0 - motor.q(0));
    const swb::System driven = motor.system();
    swb::Integrator runs(driven, settings);
    runs.reinit(0.0, {0.0, 0.0, 0.0});
    runs.advance(2.0);
    const double t1 = -std::log(0.85), t2 = std::log(2.0);
    const double end = 1.7 * (t2 - t1) + 2.0 * (std::exp(-t2) - std::exp(-t1)) + 0.7 * (2.0 - t2);
    CHECK(near(runs.state()[1], end, 1e-9) && near(runs.state()[2], 1.0, 1e-10));

    // a gripper lets a ball go, which bounces
    swb::Scene gripper("y");
    const swb::Expr held = gripper.discrete("held", 1.0);
    gripper.force({-10.0 * (1.0 - held)});
    gripper.contact("floor", gripper.q(0), {}, 0.0, 0.8);
    CHECK(gripper.transition(gripper.q(0) > 1.2, {{held, 1.0}}, {}, {{held, 0.0}}) == 0);
    CHECK(status_of([&] { gripper.transition(gripper.q(0) > 1.2, {{motor.state(0), 1.0}}, {}, {{held, 0.0}}); }) == SWB_ERR_RANGE);
    const swb::System released = gripper.system();
    swb::Integrator falls(released, settings);
    falls.reinit(0.0, {0.5, 1.0, 1.0});
    falls.advance(2.0);
    CHECK(near(falls.state()[0], 4.0 * 0.7 - 5.0 * 0.49, 1e-8) && falls.state()[2] == 0.0);

    // a controller that holds what it samples, and pulses
    swb::Scene sampled("x y");
    const swb::Expr kept = sampled.discrete("kept"), pulse = sampled.pwm(sampled.constant(0.25), 0.4, 0.0, "pulse");
    sampled.force({-kept, pulse});
    const swb::Expr count = sampled.every(0.5, {{kept, sampled.v(0)}});
    const swb::System clocked = sampled.system();
    swb::Integrator strikes(clocked, settings);
    strikes.reinit(0.0, {0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0});
    strikes.advance(1.25);
    CHECK(near(strikes.state()[2], 0.1875, 1e-12) && near(strikes.state()[3], 0.35, 1e-12) && strikes.state()[7] == 3.0);
    CHECK(status_of([&] { sampled.every(-0.5, {{kept, sampled.v(0)}}); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { sampled.every(0.5, {{motor.state(0), sampled.v(0)}}); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { sampled.pwm(sampled.constant(1.5), 0.4); }) == SWB_ERR_RANGE);

    swb::Scene block("x y");
    block.force({block.t(), block.constant(-1.0)});
    const int64_t floor = block.contact("floor", block.q(1), {block.q(0)}, 0.3);
    block.stiction(floor, 0.5);
    const swb::System pushed = block.system();
    swb::Integrator until(pushed, settings);
    until.reinit(0.0, {0.0, 0.0, 0.0, 0.0});
    until.advance(0.6);
    // from 0.5 on it slides: v' = t - 0.3
    CHECK(near(until.state()[2], 0.5 * (0.36 - 0.25) - 0.03, 1e-9));
}

/// Play: the output follows the input at the distance of the slack.
static void projected() {
    swb::Projected play("y");
    play.derivatives({play.constant(0.0)});
    const swb::Expr input = 2.0 * sin(play.t());
    play.constraint("upper", input - play.x(0) + 0.5);
    CHECK(play.constraint("lower", play.x(0) - input + 0.5) == 1);
    const swb::System system = play.system();
    swb::Settings settings;
    settings.set("rtol", 1e-11).set("atol", 1e-11).set("dense", "on");
    swb::Integrator integrator(system, settings);
    integrator.reinit(0.0, {0.0});
    CHECK(integrator.advance(2.0) == SWB_RUN_OUTCOME_REACHED && near(integrator.state()[0], 1.5, 1e-10));
    const swb::Run run = integrator.run();
    CHECK(near(run.events().at(0).t, std::asin(0.25), 1e-10) && near(run.contact_forces(1.0)[3], 2.0 * std::cos(1.0), 1e-8));
    CHECK(run.contact_modes(1.0)[1] == SWB_CONTACT_MODE_CLOSED && play.report().find("lower") != std::string::npos);
    CHECK(status_of([&] { swb::Stepper none(system); }) == SWB_ERR_UNSUPPORTED);
}

static void refusals() {
    swb::Model m("q v"), other("x");
    const swb::Expr q = m.x(0);
    CHECK(status_of([&] { q + other.x(0); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { m.system(); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { m.derivatives({q}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { m.derivative(q + 1, q); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { m.derivative(q, other.x(0)); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { m.function("f", {sign(q)}); }) == SWB_ERR_UNSUPPORTED);
    CHECK(status_of([&] { m.function("f", {q * std::nan("")}); }) == SWB_ERR_NONFINITE);
    CHECK(status_of([&] { m.function("f", {q}).jacobian({}, [](const swb_point &, double *) {}); }) == SWB_ERR_STATE);
    CHECK(status_of([&] { dot(m.x(), {q}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { swb::sum({}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { m.try_at({1.0}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { m.x() + swb::Exprs{q}; }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { swb::Matrix(2, {q}); }) == SWB_ERR_DIMENSION);
}

int main() {
    values();
    matrices();
    models();
    optimal_control();
    documents();
    scenes();
    joints();
    projected();
    refusals();
    if (failures == 0)
        std::puts("all checks passed");
    return failures != 0;
}

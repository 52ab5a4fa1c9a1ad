// The C++ header: owners, lambdas, exceptions through the library.
#include "switchback.hpp"

#include <atomic>
#include <cmath>
#include <cstdio>
#include <string>
#include <thread>

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

static const double omega = 6.283185307179586;

static swb::System oscillator(int *calls, int fail_at = -1) {
    const swb::Sizes sizes{2, 0, 0};
    swb::Function modes("F", sizes, 4, [=](const swb_point &at, double *out) {
        if (++*calls == fail_at)
            throw std::logic_error("thrown in a mode");
        const double x = at.x[0], y = at.x[1];
        out[0] = x + omega * y;
        out[1] = -omega * x + y;
        out[2] = x - omega * y;
        out[3] = omega * x + y;
    });
    swb::Function circle("c", sizes, 1, [](const swb_point &at, double *out) {
        out[0] = at.x[0] * at.x[0] + at.x[1] * at.x[1] - 1.0;
        return 0;
    });
    circle
        .jacobian({{0, 1, 2, 2}, {0, 0}},
                  [](const swb_point &at, double *out) {
                      out[0] = 2 * at.x[0];
                      out[1] = 2 * at.x[1];
                  })
        .hessian({{0, 1, 2, 2}, {0, 1}},
                 [](const swb_point &, const double *w, double *out) { out[0] = out[1] = 2 * w[0]; });
    CHECK(circle.check_derivatives(0.0, {0.3, -0.7}).passed);
    CHECK(std::abs(circle(0.0, {0.6, 0.8})[0]) < 1e-15);
    CHECK(status_of([&] { circle(0.0, {0.6}); }) == SWB_ERR_DIMENSION);
    swb::System system(sizes);
    system.subsystem({0, 1}, modes, 2, circle, {-1, 1});
    CHECK(status_of([&] { modes.linear(); }) == SWB_ERR_STATE);
    return system;
}

static void simulation() {
    int calls = 0;
    swb::Settings settings;
    settings.set("n_s", 5).set("n_fe", "2").set("tol", 1e-10);
    CHECK(settings.n_s == 5 && settings.json().find("\"n_fe\": 2") != std::string::npos);
    swb::Simulator first(oscillator(&calls), settings);
    swb::Simulator sim = std::move(first);
    const double x0[] = {std::exp(-1.0), 0.0};
    sim.state(0.0, x0);
    CHECK(sim.run(std::acos(-1.0) / 2, 10) == SWB_OUTCOME_SOLVED);
    CHECK(std::abs(sim.state()[0] + 1.5974603774506981) < 1e-8);
    const swb::Trajectory r = sim.trajectory();
    CHECK(r.switches().size() == 1 && std::abs(r.switches()[0].t - 1.0) < 1e-8);
    CHECK(r.times().size() == 21 && r.states().size() == 42 && r.active().size() == 40);
    CHECK(r.stage_times().size() == 100 && r.stage_states().size() == 200 && r.stage_theta().size() == 200);
    const swb::Vector x = r.at({0.25, 0.5});
    CHECK(std::abs(std::hypot(x[2], x[3]) - std::exp(-0.5)) < 1e-5);
    CHECK(sim.stats().n_steps == 10 && sim.settings().n_s == 5);
    CHECK(status_of([&] { sim.run(-1.0, 3); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { sim.set("n_s", 3.5); }) == SWB_ERR_OPTION);
}

static void exceptions() {
    int calls = 0;
    swb::Simulator sim(oscillator(&calls, 150));
    sim.state(0.0, {0.3, 0.0});
    bool caught = false;
    try {
        sim.run(0.5, 10);
    } catch (const std::logic_error &e) {
        caught = std::string(e.what()) == "thrown in a mode";
    }
    CHECK(caught && calls == 150);
    CHECK(sim.run(0.1, 1) == SWB_OUTCOME_SOLVED);

    // Out of the monitor.
    caught = false;
    sim.on_iteration([](const swb_iteration_info &) -> bool { throw std::string("enough"); });
    try {
        sim.run(0.1, 1);
    } catch (const std::string &s) {
        caught = s == "enough";
    }
    CHECK(caught);
    int iterations = 0;
    sim.on_iteration([&](const swb_iteration_info &) { return ++iterations == 2; });
    CHECK(sim.run(0.1, 1) == SWB_OUTCOME_STOPPED && iterations == 2);
    sim.on_iteration(nullptr);
    sim.interrupt();
    CHECK(sim.run(0.1, 1) == SWB_OUTCOME_STOPPED);
    int lines = 0;
    sim.on_log([&](int64_t, const char *) { lines++; });
    sim.set("log_level", "info");
    CHECK(sim.run(0.1, 1) == SWB_OUTCOME_SOLVED && lines == 1);

    // A code instead of an exception.
    swb::Function f("f", {1, 0, 0}, 1, [](const swb_point &, double *) { return -5; });
    try {
        f(0.0, {1.0});
        CHECK(false);
    } catch (const swb::Error &e) {
        CHECK(e.status() == SWB_ERR_USER && e.user_code() == -5);
    }
}

static void optimal_control() {
    const swb::Sizes sizes{1, 1, 0};
    swb::Function f0("f0", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0]; });
    swb::Function cost("L", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0] * at.u[0]; });
    swb::Function end("e", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System system(sizes);
    system.f0(f0);
    swb::Ocp ocp(system, 2.0, 4);
    ocp.lagrange(cost);
    ocp.terminal(end, {1.0}, {1.0});
    ocp.initial_state({0.0});
    ocp.control_bounds({-swb::infinity}, {3.0});
    CHECK(ocp.solve() == SWB_OUTCOME_SOLVED);
    CHECK(std::abs(ocp.cost() - 0.5) < 1e-8);
    for (double u : ocp.controls())
        CHECK(std::abs(u - 0.5) < 1e-6);
    CHECK(ocp.trajectory().info().n_switches == 0 && ocp.residuals().primal < 1e-9);
    // the cost is (1 - x0)^2 / 2
    const swb::Ocp::Modes modes = ocp.modes();
    CHECK(!modes.times.empty() && modes.times[0] == 0.0);
    const swb::Vector starts = ocp.random_starts(3, 5);
    CHECK(ocp.solve_starts(starts, 2) >= 0 && std::abs(ocp.cost() - 0.5) < 1e-8);
    try {
        ocp.rounds();
        CHECK(false);
    } catch (const swb::Error &) {
    }
    const swb::Ocp::Sensitivity s = ocp.sensitivity();
    CHECK(std::abs(s.cost.at(0) + 1.0) < 1e-6 && std::abs(s.controls.at(3) + 0.5) < 1e-6 && !s.one_sided);
}

// x' = u and x' = p: what is asked for decides, the answers are known.
static void terms_of_optimal_control() {
    const swb::Sizes sizes{1, 1, 0};
    swb::Function f0("f0", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0]; });
    swb::Function effort("L", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0] * at.u[0]; });
    swb::Function rate("time and effort", sizes, 1,
                       [](const swb_point &at, double *out) { out[0] = 1 + at.u[0] * at.u[0]; });
    swb::Function state("x", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System system(sizes);
    system.f0(f0);

    swb::Ocp fastest(system, 3.0, 3);
    fastest.lagrange(rate);
    fastest.initial_state({0.0});
    fastest.terminal(state, {1.0}, {1.0});
    fastest.free_time(SWB_FREE_TIME_HORIZON, 0.1, 10.0);
    CHECK(fastest.solve() == SWB_OUTCOME_SOLVED && std::abs(fastest.cost() - 2.0) < 1e-8);
    CHECK(std::abs(fastest.durations()[1] - 1.0 / 3) < 1e-6 && fastest.accuracy().terminal < 1e-9);
    CHECK(fastest.optimality().verdict == SWB_VERDICT_LOCAL_OPTIMUM && fastest.kinks().empty());
    CHECK(fastest.reduced_gradient().size() == fastest.descent().size() && fastest.descent()[0] == 0.0);
    CHECK(fastest.certificate().stationarity == SWB_STATIONARITY_S);  // there are no pairs: an ordinary optimum
    CHECK(fastest.certificate().second_order == SWB_SECOND_ORDER_STRICT_MINIMUM);
    const auto costates = fastest.multipliers(SWB_MULTIPLIERS_OF_COSTATES);  // 1 + u^2 + lambda u = 0 at u = 1
    CHECK(costates.times.size() == 4 && costates.values.size() == 4 && std::abs(costates.values[1] + 2.0) < 1e-6);
    CHECK(std::abs(fastest.multipliers(SWB_MULTIPLIERS_OF_TERMINAL, 0).values[0] + 2.0) < 1e-6);

    swb::Ocp stages(system, 3.0, 2);
    stages.lagrange(rate);
    stages.initial_state({0.0});
    stages.terminal(state, {1.0}, {1.0});
    stages.free_time(SWB_FREE_TIME_STAGES, 0.1, 10.0);
    stages.horizon(2.0, 4.0);
    stages.durations({0.5, 2.0});
    stages.elements({1, 3});
    CHECK(stages.solve() == SWB_OUTCOME_SOLVED && std::abs(stages.cost() - 2.5) < 1e-8);

    swb::Ocp weak(system, 2.0, 4);
    weak.lagrange(effort);
    weak.initial_state({0.0});
    weak.control_bounds({-0.25}, {0.25});
    weak.relaxed_terminal(state, {1.0}, {1.0}, SWB_NORM_L1, 10.0);
    CHECK(weak.solve() == SWB_OUTCOME_SOLVED && std::abs(weak.cost() - 0.125) < 1e-8);
    CHECK(std::abs(weak.violation() - 0.5) < 1e-7 && weak.mismatch().size() == 4);
    weak.relaxed_path(state, {-1.0}, {0.3}, SWB_NORM_LINF, 100.0, SWB_PATH_AT_ELEMENTS);
    CHECK(weak.solve() == SWB_OUTCOME_SOLVED && std::abs(weak.violation() - 0.7) < 1e-6);

    // a ramp that the linear control follows, then another one
    swb::Ocp ramp(system, 2.0, 4);
    ramp.initial_state({0.0});
    ramp.linear_controls({1});
    ramp.least_squares(state, {1.0}, {0.25, 0.5, 0.75, 1.0}, SWB_COST_AT_CONTROL_GRID);
    ramp.least_squares(effort, {1e-4}, {0.25});
    CHECK(ramp.solve() == SWB_OUTCOME_SOLVED && ramp.cost() < 1e-10);
    for (double u : ramp.control_ends())
        CHECK(std::abs(u - 0.5) < 1e-4);
    ramp.references(0, {0.3, 0.6, 0.9, 1.2});
    ramp.references(1, {0.36});
    CHECK(ramp.solve_warm() == SWB_OUTCOME_SOLVED && std::abs(ramp.controls()[0] - 0.6) < 1e-4);
    ramp.shift();
    CHECK(ramp.solve() == SWB_OUTCOME_SOLVED);
    CHECK(status_of([&] { ramp.references(7, {0.0}); }) == SWB_ERR_RANGE);

    // round trip: the mean is free, the ends are equal
    swb::Ocp loop(system, 1.0, 2);
    swb::Function both("half way", {2, 1, 0}, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] + at.x[1]; });
    loop.lagrange(effort);
    loop.periodic({0});
    loop.boundary(both, {3.0}, {3.0});
    CHECK(loop.solve() == SWB_OUTCOME_SOLVED && loop.cost() < 1e-10);
    CHECK(std::abs(loop.trajectory().at({0.0})[0] - 1.5) < 1e-7);
}

static void parameters_of_optimal_control() {
    const swb::Sizes sizes{1, 0, 1};
    swb::Function slope("p", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.p[0]; });
    slope.jacobian({{0, 0, 1, 1}, {0}}, [](const swb_point &, double *out) { out[0] = 1.0; });
    swb::Function state("x", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System system(sizes);
    system.f0(slope);
    swb::Ocp fit(system, 2.0, 2);
    fit.initial_state({0.0});
    fit.param_bounds({0.0}, {5.0});
    fit.least_squares(state, {1.0}, {0.7, 1.4}, SWB_COST_AT_CONTROL_GRID);
    CHECK(fit.solve() == SWB_OUTCOME_SOLVED && std::abs(fit.params()[0] - 0.7) < 1e-7);
    swb::Ocp given(system, 2.0, 2);
    given.initial_state({0.0});
    given.stage_params({1.0, 3.0});
    CHECK(given.solve() == SWB_OUTCOME_SOLVED && std::abs(given.accuracy().terminal) < 1e-9);
    CHECK(std::abs(given.trajectory().at({2.0})[0] - 4.0) < 1e-9);
}

/* A constant that is measured twice: the mean, weighted by the deviations. */
static void estimation() {
    const swb::Sizes sizes{1, 0, 0};
    swb::Function rest("f", sizes, 1, [](const swb_point &, double *out) { out[0] = 0.0; });
    swb::Function state("x", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System system(sizes);
    system.f0(rest);
    swb::Ocp window(system, 1.0, 4);
    window.initial_state({0.0});
    swb::MheOptions options;
    options.rk_family = SWB_RK_FAMILY_EXPLICIT;
    swb::Mhe mhe(window, state, {1.0}, {0.0}, {0.5}, options);
    CHECK(mhe.stages() == 4 && mhe.states() == 1 && mhe.controls() == 0 && mhe.measurements() == 1 && mhe.noisy() == 0);
    double x = 0.0;
    CHECK(mhe.estimate({3.0}, &x, 1).source == SWB_NMPC_SOURCE_QP && std::abs(x - 4.0 * 3.0 / 5.0) < 1e-9);
    CHECK(mhe.prepare().ready == 1);
    mhe.estimate({1.0}, &x, 1);
    CHECK(std::abs(x - 4.0 * 4.0 / 9.0) < 1e-9 && std::abs(mhe.covariance()[0] - 1.0 / 9.0) < 1e-9);
    CHECK(mhe.window().second == 1 && std::abs(mhe.window().first[4] - x) < 1e-15);
    mhe.reset({2.0});
    CHECK(mhe.window().second == 0 && mhe.window().first[0] == 2.0);
    mhe.interrupt();
}

static void programs() {
    swb::Function f("f", {2, 0, 0}, 1, [](const swb_point &at, double *out) {
        out[0] = (at.x[0] - 1) * (at.x[0] - 1) + at.x[1] * at.x[1];
    });
    swb::Function c("c", {2, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = at.x[1] - at.x[0]; });
    swb::Mpcc jr1(2, 0, f, c);
    jr1.pair(swb::variable(1), swb::constraint(0));
    CHECK(jr1.solve() == SWB_OUTCOME_SOLVED && std::abs(jr1.objective() - 0.5) < 1e-8);
    CHECK(std::abs(jr1.solution()[0] - 0.5) < 1e-6 && jr1.multipliers().first.size() == 1);
    const swb::Mpcc::Pairs pairs = jr1.pairs();
    CHECK(std::abs(pairs.g[0] - 0.5) < 1e-6 && std::abs(pairs.h[0]) < 1e-9 && std::abs(jr1.constraints()[0]) < 1e-9);
    CHECK(jr1.certificate().stationarity == SWB_STATIONARITY_S && jr1.worst(3).empty());
    jr1.name(SWB_ITEM_CONSTRAINT, 0, "gap");
    CHECK(jr1.report().find("solved") != std::string::npos && jr1.json().front() == '{');
    const auto y = jr1.multipliers();
    jr1.warm_start(jr1.solution(), y.first, y.second);
    CHECK(jr1.solve() == SWB_OUTCOME_SOLVED && jr1.stats().iterations <= 3);
    CHECK(jr1.resolve() == SWB_OUTCOME_SOLVED && std::abs(jr1.objective() - 0.5) < 1e-10);
    const swb::Pattern diagonal{{0, 1, 2}, {0, 1}};
    jr1.hessian(diagonal, [](const swb_point &, double weight, const double *, double *out) {
        out[0] = out[1] = 2 * weight;
        return 0;
    });
    jr1.start({1.0, 1.0});
    CHECK(jr1.solve() == SWB_OUTCOME_SOLVED && std::abs(jr1.objective() - 0.5) < 1e-10);
    jr1.hessian(diagonal, [](const swb_point &, double, const double *, double *) -> int { throw std::logic_error("no"); });
    bool caught = false;
    try {
        jr1.solve();
    } catch (const std::logic_error &) {
        caught = true;
    }
    CHECK(caught);
    swb::Mpcc free(2, 0, f);
    free.start({3.0, 3.0});
    CHECK(free.solve() == SWB_OUTCOME_SOLVED && std::abs(free.objective()) < 1e-12);
}

/* A heater that goes on below 18 and off above 20 degrees. */
static void transitions() {
    const swb::Function f("f", {2, 0, 0}, 2, [](const swb_point &at, double *out) {
        out[0] = 5.0 * at.x[1] - 0.2 * at.x[0];
        out[1] = 0.0;
    });
    const swb::Function cold("cold", {2, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = 18.0 - at.x[0]; });
    const swb::Function hot("hot", {2, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] - 20.0; });
    swb::System system({2, 0, 0});
    system.f0(f);
    system.transition(cold, SWB_DIRECTION_RISING, nullptr, {{1, 0.0}}, {{1, 1.0}});
    system.transition(hot, SWB_DIRECTION_RISING, nullptr, {{1, 1.0}}, {{1, 0.0}});
    CHECK(status_of([&] { system.transition(hot, SWB_DIRECTION_RISING, nullptr); }) == SWB_ERR_STATE);
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-11;
    swb::Integrator i(system, settings);
    i.reinit(0.0, {15.0, 0.0});
    CHECK(i.advance(12.0) == SWB_RUN_OUTCOME_REACHED && i.stats().jumps == 9);
    CHECK(std::abs(i.state()[0] - 19.68827786379199706) < 1e-9 && i.state()[1] == 1.0);
}

/* A heater by hysteresis, and a lamp with three states that follows it and the temperature. */
static void automata() {
    const swb::Sizes sizes{3, 0, 0};
    const swb::Function above("above", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] - 20.0; });
    const swb::Function below("below", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] - 18.0; });
    const swb::Function warm("warm", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] - 19.0; });
    const swb::Function always("always", sizes, 1, [](const swb_point &, double *out) { out[0] = 1.0; });
    swb::System system(sizes);
    /* a cooler: on above 20, off below 18; heating is its opposite */
    const swb::Function g("g", sizes, 3, [](const swb_point &at, double *out) {
        out[0] = 5.0 * (1.0 - at.x[1]) - 0.2 * at.x[0];
        out[1] = out[2] = 0.0;
    });
    system.f0(g).hysteresis(1, above, below);
    swb::Automaton lamp(system, 2, {"dark", "dim", "bright"});
    lamp.edge("dark", "dim", warm).edge("dim", "bright", always, SWB_DIRECTION_RISING, nullptr, {{1, 1.0}});
    lamp.edge("bright", "dark", warm, SWB_DIRECTION_FALLING);
    CHECK(lamp["bright"] == 2.0 && lamp.name(1.0) == "dim" && lamp.state() == 2);
    CHECK(status_of([&] { lamp["red"]; }) == SWB_ERR_RANGE && status_of([&] { lamp.name(0.5); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { lamp.edge("dark", "red", warm); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { lamp.edge("dark", "dim", warm, SWB_DIRECTION_RISING, nullptr, {{2, 1.0}}); }) == SWB_ERR_RANGE);
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-11;
    settings.sensitivity = 1;
    swb::Integrator i(system, settings);
    i.reinit(0.0, {15.0, 0.0, lamp["dark"]});
    CHECK(i.advance(12.0) == SWB_RUN_OUTCOME_REACHED);
    const swb::Run run = i.run();
    const auto heater = run.discrete(1), shown = run.discrete(2);
    CHECK(heater.size() == 9 && heater[0].start == 0.0 && heater[8].end == 12.0 && heater[8].value == 0.0);
    CHECK(std::abs(heater[1].start - 3.465735902799726547) < 1e-10 && heater[0].end == heater[1].start);
    CHECK(std::abs(heater[8].start - 10.62002976527444653) < 1e-10);
    CHECK(shown.size() > 6 && lamp.name(shown[0].value) == "dark" && lamp.name(shown[1].value) == "dim");
    CHECK(lamp.name(shown[2].value) == "bright" && shown[2].start == heater[1].start);
    CHECK(std::abs(shown[1].start - 5.0 * std::log(10.0 / 6.0)) < 1e-10);
    const auto jumps = run.jumps();
    CHECK(static_cast<int64_t>(jumps.size()) == run.info().n_jumps && jumps[1].simultaneous == 1);
    const auto around = run.jump_states(1);
    CHECK(around.first[1] == 0.0 && around.second[1] == 1.0 && around.first[0] == around.second[0]);
    CHECK(std::abs(run.jump_sensitivity(0)[0] + 1.0 / (0.2 * (25.0 - 15.0))) < 1e-6);
    CHECK(status_of([&] { run.discrete(3); }) == SWB_ERR_DIMENSION && status_of([&] { run.jump_states(99); }) == SWB_ERR_DIMENSION);
}

/* A car with two gears and a fan by hysteresis, as expressions; and back from its document. */
static void automata_of_expressions() {
    swb::Model m("v", "", "a");
    const swb::Expr v = m.x(0);
    const swb::Expr fan = m.hysteresis(v, 12.0, 9.0, 0.0, "fan");
    swb::ModelAutomaton gear(m, "low high", "gear");
    CHECK(gear.edge("low", "high", v > 10.0, {{v, 0.9 * v}}, {{fan, 0.0}}) == 2);
    CHECK(gear.edge("high", "low", v < 5.0) == 3);
    m.derivatives({m.p(0) * gear.choose({2.0, 1.5}) - 0.1 * v - 2.0 * fan * (1.0 + gear.is_in("high"))});
    CHECK(gear["high"] == 1.0 && gear.name(0.0) == "low");
    CHECK(m.report().find("transition 2: gear 0 -> 1, v := ") != std::string::npos);
    CHECK(m.report().find("discrete: fan, gear") != std::string::npos);
    CHECK(status_of([&] { gear.edge("low", "third", v > 1.0); }) == SWB_ERR_RANGE);
    CHECK(status_of([&] { gear.choose({1.0}); }) == SWB_ERR_DIMENSION);
    CHECK(status_of([&] { m.transition(v > 1.0, {}, {{2.0 * v, v}}); }) == SWB_ERR_RANGE);
    swb::Model moving("v");
    moving.derivatives({moving.x(0)});
    moving.transition(moving.x(0) > 1.0, {}, {});
    CHECK(status_of([&] { moving.system(); }) == SWB_ERR_STATE); /* changes nothing */
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-10;
    const auto run = [&](const swb::System &system) {
        swb::Integrator i(system, settings);
        i.params({2.0});
        i.reinit(0.0, {1.0, 0.0, gear["low"]});
        CHECK(i.advance(20.0) == SWB_RUN_OUTCOME_REACHED);
        return i.run();
    };
    const swb::Run first = run(m.system()), again = run(swb::Model::system_from_json(m.to_json()));
    CHECK(first.state() == again.state() && first.jumps().size() == again.jumps().size() && first.jumps().size() > 3);
    const auto gears = first.discrete(2);
    CHECK(gears.size() == 2 && gear.name(gears[1].value) == "high");
    CHECK(std::abs(gears[1].start - 10.0 * std::log(39.0 / 30.0)) < 1e-8); /* v = 40 - 39 exp(-t/10) */
    CHECK(first.jump_states(0).second[0] == 0.9 * first.jump_states(0).first[0]);
}

/* Events that are noted, that end the run, and that join comparisons; a reset that rounds. */
static void named_events() {
    swb::Model m("q v");
    const swb::Expr q = m.x(0), v = m.x(1), n = m.discrete("n");
    m.derivatives({v, -q});
    CHECK(m.note((q > 0.0) & (v > 0.0), "first quadrant") == 0);
    CHECK(m.stop_at(!(m.t() < 12.0), "late") == 1);
    CHECK(m.event("count", SWB_EFFECT_JUMP, SWB_TRIGGER_EDGE, q > 0.5, {}, {{n, n + floor(2.5 * q)}}) == 2);
    CHECK(m.report().find("late: ends the run where") != std::string::npos);
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-10;
    swb::Integrator i(m.system(), settings);
    i.reinit(0.0, {1.0, 0.0, 0.0}); /* cos t, -sin t */
    CHECK(i.advance(20.0) == SWB_RUN_OUTCOME_EVENT);
    const swb::Run run = i.run();
    CHECK(run.stopped_by() == 1 && std::abs(run.info().t_end - 12.0) < 1e-12);
    const double pi = 3.14159265358979323846;
    const auto seen = run.t_events(0), counted = run.t_events(2);
    CHECK(seen.size() == 2 && std::abs(seen[0] - 1.5 * pi) < 1e-8 && std::abs(seen[1] - 3.5 * pi) < 1e-8);
    CHECK(counted.size() == 2 && std::abs(counted[0] - 5.0 * pi / 3.0) < 1e-8 && run.state()[2] == 2.0);
    CHECK(run.notes().size() == 2 && std::abs(run.note_state(0)[0]) < 1e-8);
    swb::Model other("x");
    CHECK(status_of([&] { m.note((other.x(0) > 0.0) & (other.x(0) < 1.0)); }) == SWB_ERR_RANGE);
    swb::System system(swb::Sizes{1, 0, 0});
    const swb::Function f("f", {1, 0, 0}, 1, [](const swb_point &, double *out) { out[0] = 1.0; });
    const swb::Function g("g", {1, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = at.x[0] - 0.5; });
    system.f0(f).note(g, SWB_DIRECTION_RISING, "half").stop_at(g);
    swb::Integrator j(system, settings);
    j.reinit(0.0, {0.0});
    CHECK(j.advance(2.0) == SWB_RUN_OUTCOME_EVENT && std::abs(j.run().notes().at(0).t - 0.5) < 1e-12);
}

static void events() {
    int calls = 0;
    const double end = 1.5707963267948966;
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-11;
    settings.dense = settings.sensitivity = settings.adjoint = 1;
    const swb::System system = oscillator(&calls);
    swb::Integrator i(system, settings);
    int steps = 0;
    std::string log;
    i.on_step([&](const swb_progress &p) { return steps += p.nx == 2, false; });
    i.on_log([&](int64_t, const char *line) { log += line; });
    i.set("log_level", "info");
    i.stop_times({0.5});
    i.reinit(0.0, {std::exp(-1.0), 0.0});
    CHECK(i.advance(end) == SWB_RUN_OUTCOME_REACHED && i.time() == end && i.reason().empty());
    CHECK(i.stats().steps == steps && log.find("reached") != std::string::npos && i.settings().rtol == 1e-11);
    CHECK(std::abs(i.dky(end, 1)[0] - i.derivative()[0]) < 1e-6);
    const swb::Run run = i.run();
    CHECK(run.state() == i.state() && run.events().size() == 1 && std::abs(run.events()[0].t - 1.0) < 1e-10);
    CHECK(run.times().size() == static_cast<std::size_t>(steps) + 1 && run.branch_points().empty());
    CHECK(run.contacts().empty() && run.accumulations().empty() && run.stats().steps == steps);
    CHECK(std::abs(std::hypot(run.at({0.3})[0], run.at({0.3})[1]) - std::exp(-0.7)) < 1e-9);
    CHECK(std::abs(run.event_sensitivity(0)[0] + std::exp(1.0)) < 1e-8);
    const swb::Vector s = run.sensitivity();
    const swb::Integrator::Gradient g = i.adjoint({1.0, 0.0});
    CHECK(std::abs(g.x0[0] - s[0]) < 1e-9 && std::abs(g.x0[1] - s[2]) < 1e-9 && g.p.empty());
    CHECK(std::abs(i.adjoint({0.0, 0.0}, {}, {}, {0}, {1.0}).x0[0] + std::exp(1.0)) < 1e-8);
    CHECK(status_of([&] { i.advance(0.0); }) == SWB_ERR_RANGE);
    i.reinit(0.0, {std::exp(-1.0), 0.0});
    const swb::Vector sampled = i.sample({0.3, end}), before = run.at({0.3});
    CHECK(sampled.size() == 4 && std::abs(sampled[0] - before[0]) < 1e-12 && std::abs(sampled[2] - i.state()[0]) < 1e-12);

    i.on_step([](const swb_progress &) -> bool { throw std::logic_error("thrown in a step"); });
    i.reinit(0.0, {std::exp(-1.0), 0.0});
    bool caught = false;
    try {
        i.advance(1.0);
    } catch (const std::logic_error &) {
        caught = true;
    }
    CHECK(caught);

    // x' = sign x from 0
    swb::Function modes("F", {1, 0, 0}, 2, [](const swb_point &, double *out) { out[0] = -1.0, out[1] = 1.0; });
    swb::Function x("x", {1, 0, 0}, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System apart({1, 0, 0});
    apart.subsystem({0}, modes, 2, x, {-1, 1});
    swb::Integrator j(apart);
    j.preferred(0, {1});
    j.set("ambiguity", "prefer");
    CHECK(j.advance(1.0) == SWB_RUN_OUTCOME_REACHED && std::abs(j.state()[0] - 1.0) < 1e-12);
    j.on_branching([](const swb_branching &) { return -1; });
    j.reinit(0.0, {0.0});
    CHECK(j.advance(1.0) == SWB_RUN_OUTCOME_AMBIGUOUS && j.outcome() == SWB_RUN_OUTCOME_AMBIGUOUS);
    CHECK(j.run().branch_points().at(0).taken == -1 && j.run().reason() == j.reason() && !j.reason().empty());

    swb::Batch batch(apart);
    batch.run(0.0, 1.0, {1.0, -1.0, 2.0}, {}, {}, 2);
    CHECK(batch.size() == 3 && std::abs(batch.states()[1] + 2.0) < 1e-12 && batch.outcomes()[2] == 0);
    CHECK(std::abs(batch[2].state()[0] - 3.0) < 1e-12 && status_of([&] { batch[3]; }) == SWB_ERR_DIMENSION);
}

// Functions that declare no inputs depend on parameters.
static void undeclared_inputs() {
    swb::Function f("f", {1, 0, 1}, 1, [](const swb_point &at, double *out) { out[0] = -at.p[0] * at.x[0]; });
    swb::System decay({1, 0, 1});
    decay.f0(f);
    swb::Settings settings;
    settings.rtol = settings.atol = 1e-11;
    settings.sensitivity = settings.adjoint = 1;
    swb::Integrator i(decay, settings);
    i.reinit(0.0, {2.0});
    i.params({0.5});
    CHECK(i.advance(1.5) == SWB_RUN_OUTCOME_REACHED);
    const double slope = -1.5 * i.state()[0];
    CHECK(std::abs(i.run().sensitivity()[1] - slope) < 1e-7 && std::abs(i.adjoint({1.0}).p[0] - slope) < 1e-7);
}

// Exceptions on threads of the library come out of the call; serial functions see no other thread.
static void threads() {
    const swb::Sizes sizes{1, 1, 0};
    const auto caller = std::this_thread::get_id();
    std::atomic<int> elsewhere{0};
    const auto make = [&](bool serial, bool throws) {
        swb::Function f0("f0", sizes, 1, [&elsewhere, caller, throws](const swb_point &at, double *out) {
            if (std::this_thread::get_id() != caller)
                ++elsewhere;
            if (throws && at.x[0] > 10.0)
                throw std::out_of_range("x = " + std::to_string(at.x[0]));
            out[0] = at.u[0];
        });
        f0.serial(serial);
        swb::System system(sizes);
        system.f0(f0);
        return system;
    };
    swb::Vector x0(40, 0.0);
    for (std::size_t k = 20; k < x0.size(); ++k)
        x0[k] = 1.0 + static_cast<double>(k);
    for (int64_t n_threads : {1, 2, 8}) {
        swb::Batch batch(make(false, true));
        std::string text;
        try {
            batch.run(0.0, 1.0, x0, {1.0}, {}, n_threads);
        } catch (const std::out_of_range &e) {
            text = e.what();
        }
        CHECK(text.rfind("x = 21.0", 0) == 0);
        const auto outcomes = batch.outcomes();
        CHECK(outcomes[19] == SWB_RUN_OUTCOME_REACHED && outcomes[20] == SWB_ERR_USER && outcomes[39] == SWB_ERR_USER);
        CHECK(std::abs(batch.states()[19] - 1.0) < 1e-12);
        CHECK(status_of([&] { batch[39]; }) == SWB_ERR_USER);
    }
    elsewhere = 0;
    swb::Batch serial(make(true, false));
    serial.run(0.0, 1.0, x0, {1.0}, {}, 8);
    CHECK(elsewhere == 0 && std::abs(serial.states()[0] - 1.0) < 1e-12);

    // the random starts but the first fail
    for (bool flag : {true, false}) {
        swb::Function cost("L", sizes, 1, [&elsewhere, caller](const swb_point &at, double *out) {
            if (std::this_thread::get_id() != caller)
                ++elsewhere;
            if (at.u[0] > 50.0)
                throw std::runtime_error("thrown in a cost");
            out[0] = at.u[0] * at.u[0];
        });
        cost.serial(flag);
        swb::Ocp ocp(make(false, false), 1.0, 2);
        ocp.lagrange(cost);
        ocp.initial_state({1.0});
        bool caught = false;
        elsewhere = 0;
        try {
            ocp.solve_starts({0.5, 0.5, 99.0, 99.0, 99.0, 99.0, 0.25, 0.25}, 4);
        } catch (const std::runtime_error &e) {
            caught = std::string(e.what()) == "thrown in a cost";
        }
        CHECK(caught && ocp.cost() < 1e-10);
        CHECK(!flag || elsewhere == 0);
    }
    CHECK(status_of([&] { swb::Function(static_cast<swb_function *>(nullptr)).serial(); }) == SWB_ERR_NULL);
}

// From 0 to 1, and from there back to 0, with a document in between.
static void phases() {
    const swb::Sizes sizes{1, 1, 0};
    swb::Function f0("f0", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0]; });
    swb::Function cost("L", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.u[0] * at.u[0]; });
    swb::Function end("e", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[0]; });
    swb::System system(sizes);
    system.f0(f0);
    swb::Ocp there(system, 2.0, 2), back(system, 1.0, 2);
    there.lagrange(cost);
    there.terminal(end, {1.0}, {1.0});
    there.initial_state({0.0});
    back.lagrange(cost);
    back.terminal(end, {0.0}, {0.0});
    const swb::Ocp again = swb::Ocp::from_json(back.to_json(), {&f0, &cost, &end});
    swb::MultiPhase both({&there, &again});
    both.link_continuous(0);
    CHECK(both.solve() == SWB_OUTCOME_SOLVED && both.message().empty());
    CHECK(std::abs(both.info().cost - 1.5) < 1e-7 && both.info().link_violation < 1e-9);
    for (double u : both.phase(1).controls())
        CHECK(std::abs(u + 1.0) < 1e-6);
    CHECK(both.phase(1).message().empty());

    swb::Simulator simulator(system);
    simulator.state(0.0, {0.5});
    simulator.controls({2.0});
    auto found = swb::Simulator::from_json(simulator.to_json(3.0, 6), {&f0});
    CHECK(found.simulator.run(found.duration, found.n_steps) == SWB_OUTCOME_SOLVED && found.n_steps == 6);
    CHECK(std::abs(found.simulator.state().at(0) - 6.5) < 1e-9);
}

// A diode with a resistance: x' = z - x, 0 <= z, z + x - 1/2 >= 0, one of them zero.
static void complementarity() {
    const swb::Sizes sizes{2, 0, 0};
    swb::Function f0("f0", sizes, 2, [](const swb_point &at, double *out) {
        out[0] = at.x[1] - at.x[0];
        out[1] = 0.0;
    });
    swb::Function voltage("w", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[1] + at.x[0] - 0.5; });
    swb::Function current("z", sizes, 1, [](const swb_point &at, double *out) { out[0] = at.x[1]; });
    for (const swb::Function *a : {static_cast<const swb::Function *>(nullptr), static_cast<const swb::Function *>(&current)}) {
        swb::System system(sizes);
        system.f0(f0);
        CHECK(status_of([&] { system.complementarity({1}, voltage, a); }) == SWB_ERR_STATE);
        system.algebraic(1).complementarity({1}, voltage, a);
        CHECK(status_of([&] { system.complementarity({1}, f0, a); }) == SWB_ERR_DIMENSION);
        swb::Integrator integrator(system);
        integrator.reinit(0.0, {0.0, 0.0});
        integrator.advance(1.0);
        const double x = 0.25 * (1.0 - std::exp(-2.0));
        CHECK(std::abs(integrator.state()[0] - x) < 1e-6 && std::abs(integrator.state()[1] - (0.5 - x)) < 1e-6);
    }
}

int main() {
    simulation();
    complementarity();
    phases();
    events();
    transitions();
    automata();
    automata_of_expressions();
    named_events();
    undeclared_inputs();
    threads();
    exceptions();
    optimal_control();
    terms_of_optimal_control();
    parameters_of_optimal_control();
    estimation();
    programs();
    return failures ? 1 : 0;
}

// A mass on a belt: simulated, then brought to rest with the least force. The program of docs/cpp.md.
#include <cmath>
#include <cstdio>
#include <switchback.hpp>

int main() {
    try {
        swb::Model m("q v", "F"); // states, controls
        const swb::Expr q = m.x(0), v = m.x(1), F = m.u(0);
        const swb::Expr slip = 1 - v; // the belt has the speed 1
        m.derivatives({v, F - q + sign(slip) / (1 + abs(slip))});
        const swb::System system = m.system();

        swb::Integrator integrator(system);
        integrator.controls({0.0});
        integrator.reinit(0.0, {0.0, 0.0});
        integrator.advance(20.0);
        const auto switches = integrator.run().events();
        for (const auto &s : switches)
            std::printf("switch at %.4f\n", s.t); // 7.1806, 8.4284, 13.4328, 15.4035

        swb::Ocp ocp(system, 2.0, 10);
        ocp.lagrange(m.function("L", {F * F}));
        ocp.initial_state({0.0, 0.0});
        ocp.control_bounds({-3.0}, {3.0});
        ocp.terminal(m.function("end", {q, v}), {2.0, 0.0}, {2.0, 0.0});
        if (ocp.solve() != SWB_OUTCOME_SOLVED) {
            std::printf("%s\n", ocp.message().c_str());
            return 1;
        }
        std::printf("cost %.5f\n", ocp.cost()); // 5.47972
        return switches.size() == 4 && std::fabs(ocp.cost() - 5.47972) < 1e-4 ? 0 : 1;
    } catch (const swb::Error &e) {
        std::printf("%s\n", e.what());
        return 1;
    }
}

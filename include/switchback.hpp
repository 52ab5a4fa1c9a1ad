/* switchback for C++17: the C interface with owners, exceptions and lambdas. Header only. BSD-2-Clause, see LICENSE.
 *
 * Objects own their handle and can be moved, not copied. A call that fails throws swb::Error; an exception thrown by a
 * callback ends the call and comes out of it unchanged, on whatever thread it was thrown (of several, the first). Other
 * ways to leave a callback (longjmp, pthread_exit, cancelling the thread) are not caught: see switchback.h. Arrays are
 * std::vector<double>, or anything swb::View takes. */
#ifndef SWITCHBACK_HPP
#define SWITCHBACK_HPP

#include "switchback.h"

#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace swb {

using Vector = std::vector<double>;

inline constexpr double infinity = std::numeric_limits<double>::infinity();

/// A call that could not do its work.
class Error : public std::runtime_error {
public:
    Error(swb_status status, const std::string &message, int user_code)
        : std::runtime_error(message), status_(status), user_code_(user_code) {}

    swb_status status() const noexcept { return status_; }
    /// Negative code of the user function that ended the call, or 0.
    int user_code() const noexcept { return user_code_; }

private:
    swb_status status_;
    int user_code_;
};

namespace detail {

/// The exception of a callback on its way through the library, where the callback runs on the thread of the call.
inline std::exception_ptr &pending() noexcept {
    static thread_local std::exception_ptr exception;
    return exception;
}

/// Exceptions that functions of a model threw, on any thread, by the code the function returned because of it: the call
/// that fails with this code, on its own thread, throws them again.
class Thrown {
public:
    static Thrown &all() noexcept {
        static Thrown thrown;
        return thrown;
    }
    /// The code to return; -1 if there is no memory left.
    int32_t keep(const std::exception_ptr &exception) noexcept {
        try {
            const std::lock_guard<std::mutex> lock(mutex_);
            const int32_t code = first - static_cast<int32_t>(count_++ % numbers);
            exceptions_[code] = exception;
            order_.push_back(code);
            // Calls that nobody asks about leave theirs behind.
            if (order_.size() > most) {
                exceptions_.erase(order_.front());
                order_.pop_front();
            }
            return code;
        } catch (...) {
            return -1;
        }
    }
    std::exception_ptr take(int32_t code) noexcept {
        const std::lock_guard<std::mutex> lock(mutex_);
        const auto found = exceptions_.find(code);
        if (found == exceptions_.end())
            return nullptr;
        std::exception_ptr exception = std::move(found->second);
        exceptions_.erase(found);
        return exception;
    }

private:
    static constexpr int32_t first = -0x40000000;
    static constexpr uint32_t numbers = 0x3fffffff;
    static constexpr std::size_t most = 4096;
    std::mutex mutex_;
    std::map<int32_t, std::exception_ptr> exceptions_;
    std::deque<int32_t> order_;
    uint32_t count_ = 0;
};

/// Throws what a callback threw, or the error of the call.
inline void check(swb_status status) {
    std::exception_ptr exception = std::exchange(pending(), nullptr);
    if (status == SWB_ERR_USER) {
        std::exception_ptr kept = Thrown::all().take(swb_last_user_code());
        if (!exception)
            exception = std::move(kept);
    }
    if (status != SWB_OK)
        swb_error_handled(); // the exception says it
    if (exception)
        std::rethrow_exception(exception);
    if (status != SWB_OK)
        throw Error(status, swb_last_error(), swb_last_user_code());
}

/// The first exception among the parts of a call that ends well although some of its parts failed: `status_of(k)` asks
/// for part k.
template <class StatusOf>
std::exception_ptr first_thrown(int64_t n, StatusOf &&status_of) {
    std::exception_ptr first;
    for (int64_t k = 0; k < n; ++k)
        if (status_of(k) == SWB_ERR_USER)
            if (std::exception_ptr exception = Thrown::all().take(swb_last_user_code()); exception && !first)
                first = std::move(exception);
    return first;
}

template <class Body>
int32_t guarded(int32_t on_exception, Body &&body) noexcept {
    try {
        return body();
    } catch (...) {
        if (!pending())
            pending() = std::current_exception();
        return on_exception;
    }
}

/// The same for functions of a model, which other threads may call, too.
template <class Body>
int32_t guarded_function(Body &&body) noexcept {
    try {
        return body();
    } catch (...) {
        if (!pending())
            pending() = std::current_exception();
        return Thrown::all().keep(std::current_exception());
    }
}

template <class Handle, void (*free)(Handle *)>
struct Deleter {
    void operator()(Handle *handle) const noexcept { free(handle); }
};
template <class Handle, void (*free)(Handle *)>
using Owner = std::unique_ptr<Handle, Deleter<Handle, free>>;

/// The handles of objects.
template <class Handle, class Object>
std::vector<Handle> handles(const std::vector<Object *> &objects) {
    std::vector<Handle> out;
    for (const auto *o : objects)
        out.push_back(o->get());
    return out;
}

/// Asks for the length of a text, then for the text.
template <class Call>
std::string text(Call &&call) {
    int64_t needed = 0;
    check(call(nullptr, 0, &needed));
    std::string buffer(static_cast<std::size_t>(needed), '\0');
    check(call(buffer.data(), needed, nullptr));
    buffer.resize(buffer.size() - 1);
    return buffer;
}

} // namespace detail

/// A read-only array of numbers that somebody else owns.
class View {
public:
    View() = default;
    View(const double *data, std::size_t size) : data_(data), size_(size) {}
    View(const Vector &v) : View(v.data(), v.size()) {}
    View(std::initializer_list<double> v) : View(v.begin(), v.size()) {}
    template <std::size_t N>
    View(const double (&v)[N]) : View(v, N) {}

    const double *data() const { return size_ == 0 ? nullptr : data_; }
    std::size_t size() const { return size_; }
    int64_t length() const { return static_cast<int64_t>(size_); }
    double operator[](std::size_t i) const { return data_[i]; }
    const double *begin() const { return data_; }
    const double *end() const { return data_ + size_; }

private:
    const double *data_ = nullptr;
    std::size_t size_ = 0;
};

/// Sizes of the inputs of a function.
struct Sizes {
    int64_t nx = 0, nu = 0, np = 0;
};

/// Structure of a sparse matrix by columns: rows increase within a column.
struct Pattern {
    std::vector<int64_t> col_ptr, row_idx;
};

/// Settings: fields by name of the C struct, or by text.
class Settings : public swb_settings {
public:
    Settings() { detail::check(swb_settings_init(this, sizeof(swb_settings))); }
    Settings &set(const char *name, const char *value) {
        detail::check(swb_settings_set_string(this, name, value));
        return *this;
    }
    Settings &set(const char *name, double value) {
        detail::check(swb_settings_set_double(this, name, value));
        return *this;
    }
    template <class Integer, std::enable_if_t<std::is_integral_v<Integer>, int> = 0>
    Settings &set(const char *name, Integer value) {
        detail::check(swb_settings_set_int(this, name, static_cast<int64_t>(value)));
        return *this;
    }
    std::string json() const {
        return detail::text([this](char *b, int64_t n, int64_t *needed) { return swb_settings_to_json(this, b, n, needed); });
    }
};

/// A function with derivatives. Callbacks return nothing, or an int: positive where the function is not defined,
/// negative to stop; they get arrays filled with zeros.
class Function {
public:
    using Value = std::function<int(const swb_point &, double *)>;
    using Hessian = std::function<int(const swb_point &, const double *, double *)>;

    /// value(point, out) writes out[n_out].
    template <class F>
    Function(const char *name, Sizes sizes, int64_t n_out, F value) {
        auto data = std::make_unique<Callbacks>();
        data->value = wrap(std::move(value));
        swb_function *f = nullptr;
        detail::check(swb_function_create(name, sizes.nx, sizes.nu, sizes.np, n_out, call_value, data.get(), destroy, &f));
        callbacks_ = data.release();
        owner_.reset(f);
    }

    /// Takes a function of the C interface.
    explicit Function(swb_function *handle) : owner_(handle) {}

    /// jacobian(point, out) writes the entries of the pattern; columns are x, u, p, t.
    template <class F>
    Function &jacobian(const Pattern &pattern, F jacobian) {
        callbacks().jacobian = wrap(std::move(jacobian));
        set_jacobian(pattern, call_jacobian);
        return *this;
    }
    /// The pattern alone: the values are differences.
    Function &jacobian(const Pattern &pattern) {
        set_jacobian(pattern, nullptr);
        return *this;
    }
    /// hessian(point, weights, out) writes the entries of the pattern of the upper triangle.
    template <class F>
    Function &hessian(const Pattern &pattern, F hessian) {
        callbacks().hessian = wrap_hessian(std::move(hessian));
        set_hessian(pattern, call_hessian);
        return *this;
    }
    /// The pattern alone: the values are differences.
    Function &hessian(const Pattern &pattern) {
        set_hessian(pattern, nullptr);
        return *this;
    }
    /// There are no second derivatives.
    Function &linear() {
        detail::check(swb_function_set_linear(get()));
        return *this;
    }
    /// Sum of enum swb_input: the inputs the function depends on.
    Function &inputs(int32_t mask) {
        detail::check(swb_function_set_inputs(get(), mask));
        return *this;
    }

    /// The callbacks are called by the thread that calls the library only: calls that would work on several threads use
    /// one (SWB_SERIAL).
    Function &serial(bool on = true) {
        detail::check(swb_function_set_flags(get(), on ? SWB_SERIAL : 0));
        return *this;
    }

    Vector operator()(double t, View x, View u = {}, View p = {}) const {
        int64_t n_out = 0;
        detail::check(swb_function_sizes(get(), nullptr, nullptr, nullptr, &n_out, nullptr, nullptr));
        Vector out(static_cast<std::size_t>(n_out));
        const swb_point at = point(t, x, u, p);
        detail::check(swb_function_eval(get(), &at, out.data(), n_out));
        return out;
    }

    struct Check {
        bool passed;
        double max_error;
        std::string report;
    };
    /// Compares the derivatives with finite differences.
    Check check_derivatives(double t, View x, View u = {}, View p = {}) const {
        const swb_point at = point(t, x, u, p);
        int32_t passed = 0;
        Check result{};
        result.report = detail::text([&](char *b, int64_t n, int64_t *needed) {
            return swb_function_check_derivatives(get(), &at, &passed, &result.max_error, b, n, needed);
        });
        result.passed = passed != 0;
        return result;
    }

    swb_function *get() const noexcept { return owner_.get(); }

private:
    struct Callbacks {
        Value value, jacobian;
        Hessian hessian;
    };

    template <class F>
    static Value wrap(F f) {
        if constexpr (std::is_void_v<std::invoke_result_t<F, const swb_point &, double *>>)
            return [f = std::move(f)](const swb_point &at, double *out) mutable { return f(at, out), 0; };
        else
            return f;
    }
    template <class F>
    static Hessian wrap_hessian(F f) {
        if constexpr (std::is_void_v<std::invoke_result_t<F, const swb_point &, const double *, double *>>)
            return [f = std::move(f)](const swb_point &at, const double *w, double *out) mutable { return f(at, w, out), 0; };
        else
            return f;
    }
    static int32_t call_value(const swb_point *at, double *out, void *data) {
        return detail::guarded_function([&] { return static_cast<Callbacks *>(data)->value(*at, out); });
    }
    static int32_t call_jacobian(const swb_point *at, double *out, void *data) {
        return detail::guarded_function([&] { return static_cast<Callbacks *>(data)->jacobian(*at, out); });
    }
    static int32_t call_hessian(const swb_point *at, const double *weights, double *out, void *data) {
        return detail::guarded_function([&] { return static_cast<Callbacks *>(data)->hessian(*at, weights, out); });
    }
    static void destroy(void *data) { delete static_cast<Callbacks *>(data); }

    Callbacks &callbacks() const {
        if (!callbacks_)
            throw Error(SWB_ERR_STATE, "this function has its derivatives already", 0);
        return *callbacks_;
    }
    void set_jacobian(const Pattern &p, swb_jacobian_fn f) {
        detail::check(swb_function_set_jacobian(get(), p.col_ptr.data(), static_cast<int64_t>(p.col_ptr.size()),
                                                p.row_idx.data(), static_cast<int64_t>(p.row_idx.size()), f));
    }
    void set_hessian(const Pattern &p, swb_hessian_fn f) {
        detail::check(swb_function_set_hessian(get(), p.col_ptr.data(), static_cast<int64_t>(p.col_ptr.size()),
                                               p.row_idx.data(), static_cast<int64_t>(p.row_idx.size()), f));
    }
    swb_point point(double t, View x, View u, View p) const {
        int64_t nx = 0, nu = 0, np = 0;
        detail::check(swb_function_sizes(get(), &nx, &nu, &np, nullptr, nullptr, nullptr));
        if (x.length() != nx || u.length() != nu || p.length() != np)
            throw Error(SWB_ERR_DIMENSION, "the point has other sizes than the function", 0);
        return swb_point{t, x.data(), u.data(), p.data()};
    }

    detail::Owner<swb_function, swb_function_free> owner_;
    Callbacks *callbacks_ = nullptr; // owned by the library
};

/// A piecewise smooth system.
class System {
public:
    explicit System(Sizes sizes) {
        swb_system *s = nullptr;
        detail::check(swb_system_create(sizes.nx, sizes.nu, sizes.np, &s));
        owner_.reset(s);
    }
    /// Takes a system of the C interface.
    explicit System(swb_system *handle) : owner_(handle) {}
    System &f0(const Function &f) {
        detail::check(swb_system_set_f0(get(), f.get()));
        return *this;
    }
    /// Modes, switching functions and sign matrix, row after row.
    System &subsystem(const std::vector<int64_t> &rows, const Function &modes, int64_t n_modes, const Function &psi,
                      const std::vector<int8_t> &signs) {
        detail::check(swb_system_add_subsystem(get(), rows.data(), static_cast<int64_t>(rows.size()), modes.get(), n_modes,
                                               psi.get(), signs.data(), static_cast<int64_t>(signs.size()), nullptr));
        return *this;
    }
    /// Modes and Stewart's indicator functions.
    System &subsystem(const std::vector<int64_t> &rows, const Function &modes, int64_t n_modes, const Function &indicators) {
        detail::check(swb_system_add_subsystem_indicators(get(), rows.data(), static_cast<int64_t>(rows.size()), modes.get(),
                                                          n_modes, indicators.get(), nullptr));
        return *this;
    }
    /// Makes the last n_z states algebraic: what f0, modes and g, where it is given, add to their rows is zero. See swb_system_set_algebraic.
    System &algebraic(int64_t n_z, const Function *g = nullptr) {
        detail::check(swb_system_set_algebraic(get(), n_z, g ? g->get() : nullptr));
        return *this;
    }
    /// 0 <= a_k, b_k >= 0, a_k b_k = 0 for algebraic states; without a it is these states themselves. See swb_system_add_complementarity.
    System &complementarity(const std::vector<int64_t> &rows, const Function &b, const Function *a = nullptr) {
        detail::check(swb_system_add_complementarity(get(), rows.data(), static_cast<int64_t>(rows.size()), a ? a->get() : nullptr,
                                                     b.get(), nullptr));
        return *this;
    }
    /// A jump of the state where the guard passes zero in its direction: discrete states and their values before (none: always),
    /// the state behind it (NULL: as before), discrete states and their values behind it. See swb_system_add_transition.
    System &transition(const Function &guard, swb_direction direction, const Function *reset,
                       const std::vector<std::pair<int64_t, double>> &from = {},
                       const std::vector<std::pair<int64_t, double>> &to = {}) {
        return event("", SWB_EFFECT_JUMP, SWB_TRIGGER_LEVEL, guard, direction, reset, from, to);
    }
    /// Ends runs where the guard passes zero in its direction, while the discrete states have these values.
    System &stop_at(const Function &guard, swb_direction direction = SWB_DIRECTION_RISING, const std::string &name = "",
                    const std::vector<std::pair<int64_t, double>> &from = {}) {
        return event(name, SWB_EFFECT_STOP, SWB_TRIGGER_EDGE, guard, direction, nullptr, from, {});
    }
    /// Notes where the guard passes zero in its direction; no step ends for that.
    System &note(const Function &guard, swb_direction direction = SWB_DIRECTION_RISING, const std::string &name = "",
                 const std::vector<std::pair<int64_t, double>> &from = {}) {
        return event(name, SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, guard, direction, nullptr, from, {});
    }
    /// A transition with a name, an effect and a trigger. See swb_system_add_event.
    System &event(const std::string &name, swb_effect effect, swb_trigger trigger, const Function &guard, swb_direction direction,
                  const Function *reset, const std::vector<std::pair<int64_t, double>> &from = {},
                  const std::vector<std::pair<int64_t, double>> &to = {}) {
        std::vector<int64_t> states[2];
        std::vector<double> values[2];
        for (int k = 0; k < 2; k++)
            for (const auto &d : k == 0 ? from : to) {
                states[k].push_back(d.first);
                values[k].push_back(d.second);
            }
        detail::check(swb_system_add_event(
            get(), name.c_str(), effect, trigger, guard.get(), direction, states[0].data(), static_cast<int64_t>(states[0].size()), values[0].data(),
            static_cast<int64_t>(values[0].size()), reset ? reset->get() : nullptr, states[1].data(),
            static_cast<int64_t>(states[1].size()), values[1].data(), static_cast<int64_t>(values[1].size()), nullptr));
        return *this;
    }
    /// A control chooses among values, each held for the time `dwell` at least. See swb_system_add_choice.
    System &choice(int64_t control, const std::vector<double> &values, double dwell = 0) {
        detail::check(swb_system_add_choice(get(), control, values.data(), static_cast<int64_t>(values.size()), dwell, nullptr));
        return *this;
    }
    /// A discrete state that becomes 1 where `above` passes zero from below, and 0 where `below` passes zero from above: a
    /// value minus its upper and minus its lower threshold.
    System &hysteresis(int64_t state, const Function &above, const Function &below) {
        transition(above, SWB_DIRECTION_RISING, nullptr, {{state, 0.0}}, {{state, 1.0}});
        return transition(below, SWB_DIRECTION_FALLING, nullptr, {{state, 1.0}}, {{state, 0.0}});
    }
    swb_system *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_system, swb_system_free> owner_;
};

/// A discrete state with named values, and the edges between them; the values are 0, 1, ... in the order of the names.
class Automaton {
public:
    /// Of a system that outlives it; `state` is the discrete state, whose derivative is zero.
    Automaton(System &system, int64_t state, std::vector<std::string> names)
        : system_(&system), state_(state), names_(std::move(names)) {}
    /// The value of a state, for initial states and modes; Error if there is none of this name.
    double operator[](const std::string &name) const {
        for (std::size_t i = 0; i < names_.size(); i++)
            if (names_[i] == name)
                return static_cast<double>(i);
        throw Error(SWB_ERR_RANGE, "the automaton has no state '" + name + "'", 0);
    }
    /// The name of a value; Error if there is none.
    const std::string &name(double value) const {
        for (std::size_t i = 0; i < names_.size(); i++)
            if (value == static_cast<double>(i))
                return names_[i];
        throw Error(SWB_ERR_RANGE, "the automaton has no state " + std::to_string(value), 0);
    }
    /// From one state to another where the guard passes zero in its direction, while the discrete states in `given`, those of
    /// others, have these values; `reset` is the state behind it, NULL: as before. See System::transition.
    Automaton &edge(const std::string &source, const std::string &target, const Function &guard,
                    swb_direction direction = SWB_DIRECTION_RISING, const Function *reset = nullptr,
                    std::vector<std::pair<int64_t, double>> given = {}) {
        given.emplace_back(state_, (*this)[source]);
        system_->transition(guard, direction, reset, given, {{state_, (*this)[target]}});
        return *this;
    }
    int64_t state() const noexcept { return state_; }

private:
    System *system_;
    int64_t state_;
    std::vector<std::string> names_;
};

/// A copy of what a simulation or an optimal control problem found.
class Trajectory {
public:
    explicit Trajectory(swb_trajectory *handle) : owner_(handle) {
        detail::check(swb_trajectory_get_info(handle, &info_, sizeof info_));
    }
    const swb_trajectory_info &info() const noexcept { return info_; }
    /// Of the element boundaries.
    Vector times() const { return array(swb_trajectory_times, boundaries()); }
    /// At the element boundaries, the states of one boundary together.
    Vector states() const { return array(swb_trajectory_states, boundaries() * info_.nx); }
    Vector steps() const { return array(swb_trajectory_steps, info_.n_elements); }
    Vector stage_times() const { return array(swb_trajectory_stage_times, points()); }
    Vector stage_states() const { return array(swb_trajectory_stage_states, points() * info_.nx); }
    Vector stage_theta() const { return array(swb_trajectory_stage_theta, points() * info_.n_modes); }
    std::vector<int32_t> active() const {
        std::vector<int32_t> out(static_cast<std::size_t>(info_.n_elements * info_.n_modes));
        detail::check(swb_trajectory_active(get(), out.data(), static_cast<int64_t>(out.size())));
        return out;
    }
    std::vector<swb_switch> switches() const {
        std::vector<swb_switch> out(static_cast<std::size_t>(info_.n_switches));
        detail::check(swb_trajectory_switches(get(), out.data(), info_.n_switches, sizeof(swb_switch)));
        return out;
    }
    /// States at any times, the states of one time together.
    Vector at(View times) const {
        Vector x(times.size() * static_cast<std::size_t>(info_.nx));
        detail::check(swb_trajectory_state_at(get(), times.data(), times.length(), x.data(), static_cast<int64_t>(x.size())));
        return x;
    }
    swb_trajectory *get() const noexcept { return owner_.get(); }

private:
    template <class Call>
    Vector array(Call call, int64_t n) const {
        Vector out(static_cast<std::size_t>(n));
        detail::check(call(get(), out.data(), n));
        return out;
    }
    int64_t boundaries() const { return info_.n_elements == 0 ? 0 : info_.n_elements + 1; }
    int64_t points() const { return info_.n_elements * info_.n_s; }

    detail::Owner<swb_trajectory, swb_trajectory_free> owner_;
    swb_trajectory_info info_{};
};

namespace detail {

/// What simulators, optimal control problems and programs share.
template <class Handle, class Calls>
class Solver {
public:
    /// Called once per iteration; true stops. Called by the thread that solves.
    void on_iteration(std::function<bool(const swb_iteration_info &)> f) {
        auto kept = std::make_unique<std::function<bool(const swb_iteration_info &)>>(std::move(f));
        check(Calls::set_iteration(get(), *kept ? call_iteration : nullptr, kept.get()));
        iteration_ = std::move(kept);
    }
    /// Called with every line of the log, as much as the option log_level says.
    void on_log(std::function<void(int64_t, const char *)> f) {
        auto kept = std::make_unique<std::function<void(int64_t, const char *)>>(std::move(f));
        check(Calls::set_log(get(), *kept ? call_log : nullptr, kept.get()));
        log_ = std::move(kept);
    }
    /// Stops the running call, or the next one; from any thread and signal handler.
    void interrupt() const noexcept { Calls::interrupt(get()); }

    void set(const char *name, const char *value) { check(Calls::set_string(get(), name, value)); }
    void set(const char *name, double value) { check(Calls::set_double(get(), name, value)); }
    template <class Integer, std::enable_if_t<std::is_integral_v<Integer>, int> = 0>
    void set(const char *name, Integer value) {
        check(Calls::set_int(get(), name, static_cast<int64_t>(value)));
    }
    void set(const Settings &settings) { check(Calls::set_settings(get(), &settings)); }
    Settings settings() const {
        Settings s;
        check(Calls::get_settings(get(), &s, sizeof(swb_settings)));
        return s;
    }
    swb_residuals residuals() const {
        swb_residuals r{};
        check(Calls::get_residuals(get(), &r, sizeof r));
        return r;
    }
    swb_stats stats() const {
        swb_stats s{};
        check(Calls::get_stats(get(), &s, sizeof s));
        return s;
    }
    swb_outcome outcome() const {
        int32_t o = 0;
        check(Calls::get_outcome(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    Handle *get() const noexcept { return owner_.get(); }

protected:
    Owner<Handle, Calls::free> owner_;

private:
    static int32_t call_iteration(const swb_iteration_info *info, void *data) {
        return guarded(1, [&] {
            return static_cast<int32_t>((*static_cast<std::function<bool(const swb_iteration_info &)> *>(data))(*info));
        });
    }
    static void call_log(int64_t level, const char *line, void *data) {
        guarded(0, [&] { return (*static_cast<std::function<void(int64_t, const char *)> *>(data))(level, line), 0; });
    }
    std::unique_ptr<std::function<bool(const swb_iteration_info &)>> iteration_;
    std::unique_ptr<std::function<void(int64_t, const char *)>> log_;
};

#define SWB_DETAIL_CALLS(object)                                                                                       \
    struct object##_calls {                                                                                            \
        static constexpr auto set_iteration = swb_##object##_set_iteration;                                            \
        static constexpr auto set_log = swb_##object##_set_log;                                                        \
        static constexpr auto interrupt = swb_##object##_interrupt;                                                    \
        static constexpr auto set_string = swb_##object##_set_string;                                                  \
        static constexpr auto set_double = swb_##object##_set_double;                                                  \
        static constexpr auto set_int = swb_##object##_set_int;                                                        \
        static constexpr auto set_settings = swb_##object##_set_settings;                                              \
        static constexpr auto get_settings = swb_##object##_get_settings;                                              \
        static constexpr auto get_residuals = swb_##object##_get_residuals;                                            \
        static constexpr auto get_stats = swb_##object##_get_stats;                                                    \
        static constexpr auto get_outcome = swb_##object##_get_outcome;                                                \
        static void free(swb_##object *handle) { swb_##object##_free(handle); }                                        \
    }
SWB_DETAIL_CALLS(simulator);
SWB_DETAIL_CALLS(ocp);
SWB_DETAIL_CALLS(mpcc);
#undef SWB_DETAIL_CALLS

} // namespace detail

/// Simulates a system by finite elements whose boundaries move onto the switches.
class Simulator : public detail::Solver<swb_simulator, detail::simulator_calls> {
public:
    explicit Simulator(const System &system, const Settings &settings = {}) {
        swb_simulator *s = nullptr;
        detail::check(swb_simulator_create(system.get(), &settings, &s));
        owner_.reset(s);
    }
    /// Begins a new trajectory.
    void state(double t, View x) { detail::check(swb_simulator_set_state(get(), t, x.data(), x.length())); nx_ = x.size(); }
    void controls(View u) { detail::check(swb_simulator_set_controls(get(), u.data(), u.length())); }
    void params(View p) { detail::check(swb_simulator_set_params(get(), p.data(), p.length())); }
    swb_outcome run(double duration, int64_t n_steps) {
        int32_t o = 0;
        detail::check(swb_simulator_run(get(), duration, n_steps, &o));
        return static_cast<swb_outcome>(o);
    }
    swb_outcome step(double h) { return run(h, 1); }
    void clear() { detail::check(swb_simulator_clear(get())); }
    double time() const {
        double t = 0;
        detail::check(swb_simulator_get_time(get(), &t));
        return t;
    }
    Vector state() const {
        Vector x(nx_);
        detail::check(swb_simulator_get_state(get(), x.data(), static_cast<int64_t>(x.size())));
        return x;
    }
    /// A simulator from a document, with the run that it holds; functions that are named there are supplied.
    struct Replay;
    static Replay from_json(const std::string &document, const std::vector<const Function *> &functions = {});
    /// The simulation that starts here as a document, for bug reports and replay.
    std::string to_json(double duration, int64_t n_steps) const {
        return detail::text([&](char *b, int64_t n, int64_t *needed) {
            return swb_simulator_to_json(get(), duration, n_steps, b, n, needed);
        });
    }
    Trajectory trajectory() const {
        swb_trajectory *r = nullptr;
        detail::check(swb_simulator_get_trajectory(get(), &r));
        return Trajectory(r);
    }

private:
    explicit Simulator(swb_simulator *s) {
        owner_.reset(s);
        int64_t nx = 0;
        detail::check(swb_simulator_sizes(s, &nx, nullptr, nullptr));
        nx_ = static_cast<std::size_t>(nx);
    }

    std::size_t nx_ = 0;
};

/// What a document of a simulation holds.
struct Simulator::Replay {
    Simulator simulator;
    double duration;
    int64_t n_steps;
};

inline Simulator::Replay Simulator::from_json(const std::string &document, const std::vector<const Function *> &functions) {
    const auto handles = detail::handles<const swb_function *>(functions);
    swb_simulator *s = nullptr;
    double duration = 0;
    int64_t n_steps = 0;
    detail::check(swb_simulator_from_json(document.c_str(), handles.data(), static_cast<int64_t>(handles.size()), &duration,
                                          &n_steps, &s));
    return {Simulator(s), duration, n_steps};
}

/// Result of an event-driven simulation, a copy.
class Run {
public:
    explicit Run(swb_run *handle) : owner_(handle) { detail::check(swb_run_get_info(handle, &info_, sizeof info_)); }
    const swb_run_info &info() const noexcept { return info_; }
    swb_run_outcome outcome() const noexcept { return static_cast<swb_run_outcome>(info_.outcome); }
    /// Why it ended early, in words.
    std::string reason() const {
        return detail::text([&](char *buf, int64_t len, int64_t *needed) { return swb_run_reason(get(), buf, len, needed); });
    }
    swb_run_stats stats() const {
        swb_run_stats s{};
        detail::check(swb_run_get_stats(get(), &s, sizeof s));
        return s;
    }
    /// State reached.
    Vector state() const { return array(swb_run_state, info_.nx); }
    std::vector<swb_event> events() const { return structs<swb_event>(swb_run_events, info_.n_events); }
    std::vector<swb_branch_point> branch_points() const {
        return structs<swb_branch_point>(swb_run_branch_points, info_.n_branch_points);
    }
    std::vector<swb_contact> contacts() const { return structs<swb_contact>(swb_run_contacts, info_.n_contacts); }
    std::vector<swb_accumulation> accumulations() const {
        return structs<swb_accumulation>(swb_run_accumulations, info_.n_accumulations);
    }
    /// The transitions in the order they were made.
    std::vector<swb_jump> jumps() const { return structs<swb_jump>(swb_run_jumps, info_.n_jumps); }
    /// What was noted in the order of time.
    std::vector<swb_note> notes() const { return structs<swb_note>(swb_run_notes, info_.n_notes); }
    /// The state at a note, by its place in notes().
    Vector note_state(int64_t index) const {
        Vector out(static_cast<std::size_t>(info_.nx));
        detail::check(swb_run_note_state(get(), index, out.data(), info_.nx));
        return out;
    }
    /// Derivatives of the time of a note.
    Vector note_sensitivity(int64_t index) const {
        Vector out(static_cast<std::size_t>(info_.n_columns));
        detail::check(swb_run_note_sensitivity(get(), index, out.data(), info_.n_columns));
        return out;
    }
    /// The event that ended the run, by its number; -1 if none did.
    int64_t stopped_by() const noexcept { return info_.stopped_by; }
    /// Times of an event, by its number: of a transition, a note, or what ended the run.
    Vector t_events(int64_t event) const {
        Vector out;
        for (const swb_jump &j : jumps())
            if (j.transition == event)
                out.push_back(j.t);
        for (const swb_note &n : notes())
            if (n.transition == event)
                out.push_back(n.t);
        return out;
    }
    /// The impacts of a scene in the order they happened, one entry for every contact with an impulse.
    std::vector<swb_impact> impacts() const { return structs<swb_impact>(swb_run_impacts, info_.n_impacts); }
    /// Derivatives of the time of an impact.
    Vector impact_sensitivity(int64_t index) const {
        Vector out(static_cast<std::size_t>(info_.n_columns));
        detail::check(swb_run_impact_sensitivity(get(), index, out.data(), info_.n_columns));
        return out;
    }
    /// Modes of all contacts of a scene at a time, numbers of swb_contact_mode.
    std::vector<int64_t> contact_modes(double t) const {
        std::vector<int64_t> out(static_cast<std::size_t>(info_.n_scene_contacts));
        detail::check(swb_run_contact_modes(get(), &t, 1, out.data(), info_.n_scene_contacts));
        return out;
    }
    /// Forces of all contacts of a scene at a time, three for each: normal, along the tangents.
    Vector contact_forces(double t) const {
        Vector out(static_cast<std::size_t>(3 * info_.n_scene_contacts));
        detail::check(swb_run_contact_forces(get(), &t, 1, out.data(), 3 * info_.n_scene_contacts));
        return out;
    }
    /// The states just before and just behind a transition, by its place in jumps().
    std::pair<Vector, Vector> jump_states(int64_t index) const {
        Vector before(static_cast<std::size_t>(info_.nx)), after = before;
        detail::check(swb_run_jump_states(get(), index, before.data(), after.data(), info_.nx));
        return {std::move(before), std::move(after)};
    }
    /// Derivatives of the time of a transition.
    Vector jump_sensitivity(int64_t index) const {
        Vector out(static_cast<std::size_t>(info_.n_columns));
        detail::check(swb_run_jump_sensitivity(get(), index, out.data(), info_.n_columns));
        return out;
    }
    /// How long a discrete state had a value.
    struct Interval {
        double start, end, value;
    };
    /// The values of a discrete state in their order, with their times; those it had for no time are left out. Error if the run
    /// made more transitions than its log holds (option max_switches).
    std::vector<Interval> discrete(int64_t state) const {
        if (state < 0 || state >= info_.nx)
            throw Error(SWB_ERR_DIMENSION, "there is no state " + std::to_string(state), 0);
        if (stats().jumps > info_.n_jumps)
            throw Error(SWB_ERR_STATE, "the run made more transitions than it noted: raise max_switches", 0);
        const auto made = jumps();
        const auto i = static_cast<std::size_t>(state);
        Interval now{info_.t_start, info_.t_end, made.empty() ? this->state()[i] : jump_states(0).first[i]};
        std::vector<Interval> out;
        for (std::size_t k = 0; k < made.size(); k++) {
            const double value = jump_states(static_cast<int64_t>(k)).second[i];
            if (value == now.value)
                continue;
            now.end = made[k].t;
            add(out, now);
            now = {made[k].t, info_.t_end, value};
        }
        add(out, now, true);
        return out;
    }
    /// Derivatives of the state reached, by columns: initial states, parameters, controls.
    Vector sensitivity() const { return array(swb_run_sensitivity, info_.nx * info_.n_columns); }
    /// Derivatives of the time of a switch.
    Vector event_sensitivity(int64_t index) const {
        Vector out(static_cast<std::size_t>(info_.n_columns));
        detail::check(swb_run_event_sensitivity(get(), index, out.data(), info_.n_columns));
        return out;
    }
    /// Starts and ends of the steps with dense output.
    Vector times() const { return array(swb_run_times, info_.n_pieces == 0 ? 0 : info_.n_pieces + 1); }
    /// States at any times, those of one time together, or their `k`-th derivatives.
    Vector at(View times, int64_t k = 0) const {
        Vector x(times.size() * static_cast<std::size_t>(info_.nx));
        detail::check(
            swb_run_evaluate(get(), times.data(), times.length(), k, x.data(), static_cast<int64_t>(x.size())));
        return x;
    }
    swb_run *get() const noexcept { return owner_.get(); }

private:
    /// Adds an interval, or makes the last one longer; an empty one counts at the end only.
    static void add(std::vector<Interval> &out, const Interval &i, bool last = false) {
        if (!(i.end > i.start) && !last)
            return;
        if (!out.empty() && out.back().value == i.value)
            out.back().end = i.end;
        else
            out.push_back(i);
    }
    template <class Call>
    Vector array(Call call, int64_t n) const {
        Vector out(static_cast<std::size_t>(n));
        detail::check(call(get(), out.data(), n));
        return out;
    }
    template <class Struct, class Call>
    std::vector<Struct> structs(Call call, int64_t n) const {
        std::vector<Struct> out(static_cast<std::size_t>(n));
        detail::check(call(get(), out.data(), n, sizeof(Struct)));
        return out;
    }

    detail::Owner<swb_run, swb_run_free> owner_;
    swb_run_info info_{};
};

/// Event-driven integrator of a system, step by step.
class Integrator {
public:
    explicit Integrator(const System &system, const Settings &settings = {}) {
        swb_integrator *i = nullptr;
        detail::check(swb_integrator_create(system.get(), &settings, &i));
        owner_.reset(i);
        detail::check(swb_system_sizes(system.get(), &nx_, &nu_, &np_, nullptr));
    }
    /// Sets time and state and begins anew.
    void reinit(double t, View x) { detail::check(swb_integrator_reinit(get(), t, x.data(), x.length())); }
    void controls(View u) { detail::check(swb_integrator_set_controls(get(), u.data(), u.length())); }
    void params(View p) { detail::check(swb_integrator_set_params(get(), p.data(), p.length())); }
    /// One value each, or one for each state.
    void tolerances(View rtol, View atol) {
        detail::check(swb_integrator_set_tolerances(get(), rtol.data(), rtol.length(), atol.data(), atol.length()));
    }
    void stop_times(View t) { detail::check(swb_integrator_set_stop_times(get(), t.data(), t.length())); }
    void preferred(int64_t subsystem, const std::vector<int64_t> &modes) {
        detail::check(
            swb_integrator_set_preferred(get(), subsystem, modes.data(), static_cast<int64_t>(modes.size())));
    }
    /// Decides where the continuation is not unique: the number of the continuation, or a negative number to stop.
    void on_branching(std::function<int64_t(const swb_branching &)> f) {
        auto kept = std::make_unique<std::function<int64_t(const swb_branching &)>>(std::move(f));
        detail::check(swb_integrator_set_decider(get(), *kept ? call_decide : nullptr, kept.get()));
        decide_ = std::move(kept);
    }
    /// Called once per accepted step; true stops.
    void on_step(std::function<bool(const swb_progress &)> f) {
        auto kept = std::make_unique<std::function<bool(const swb_progress &)>>(std::move(f));
        detail::check(swb_integrator_set_progress(get(), *kept ? call_step : nullptr, kept.get()));
        step_ = std::move(kept);
    }
    /// Called with every line of the log, as much as the option log_level says.
    void on_log(std::function<void(int64_t, const char *)> f) {
        auto kept = std::make_unique<std::function<void(int64_t, const char *)>>(std::move(f));
        detail::check(swb_integrator_set_log(get(), *kept ? call_log : nullptr, kept.get()));
        log_ = std::move(kept);
    }
    swb_progress_kind step(double t_stop) {
        int32_t kind = 0;
        detail::check(swb_integrator_step(get(), t_stop, &kind));
        return static_cast<swb_progress_kind>(kind);
    }
    swb_run_outcome advance(double t) {
        int32_t o = 0;
        detail::check(swb_integrator_advance(get(), t, &o));
        return static_cast<swb_run_outcome>(o);
    }
    /// Integrates to the last of the times: the states at all of them, one after the other. No step ends for them.
    Vector sample(View times) {
        Vector out(static_cast<std::size_t>(times.length() * nx_));
        detail::check(swb_integrator_sample(get(), times.data(), times.length(), out.data(), times.length() * nx_, nullptr));
        return out;
    }
    /// `k`-th derivative of the dense output at a time in the last step.
    Vector dky(double t, int64_t k) {
        Vector out(static_cast<std::size_t>(nx_));
        detail::check(swb_integrator_get_dky(get(), t, k, out.data(), nx_));
        return out;
    }
    double time() const {
        double t = 0;
        detail::check(swb_integrator_get_time(get(), &t));
        return t;
    }
    Vector state() const { return array(swb_integrator_get_state); }
    Vector derivative() const { return array(swb_integrator_get_derivative); }
    swb_run_outcome outcome() const {
        int32_t o = 0;
        detail::check(swb_integrator_get_outcome(get(), &o));
        return static_cast<swb_run_outcome>(o);
    }
    std::string reason() const {
        return detail::text([&](char *buf, int64_t len, int64_t *needed) {
            return swb_integrator_get_reason(get(), buf, len, needed);
        });
    }
    swb_run_stats stats() const {
        swb_run_stats s{};
        detail::check(swb_integrator_get_stats(get(), &s, sizeof s));
        return s;
    }
    /// A copy of the result since the last reinit.
    Run run() {
        swb_run *r = nullptr;
        detail::check(swb_integrator_get_run(get(), &r));
        return Run(r);
    }
    struct Gradient {
        Vector x0, p, u;
    };
    /// Gradient of a function of the run, see swb_integrator_adjoint.
    Gradient adjoint(View v, View times = {}, View states = {}, const std::vector<int64_t> &events = {}, View weights = {}) {
        Gradient g{Vector(static_cast<std::size_t>(nx_)), Vector(static_cast<std::size_t>(np_)),
                   Vector(static_cast<std::size_t>(nu_))};
        detail::check(swb_integrator_adjoint(get(), v.data(), v.length(), times.data(), times.length(), states.data(),
                                             states.length(), events.data(), static_cast<int64_t>(events.size()),
                                             weights.data(), weights.length(), g.x0.data(), nx_, g.p.data(), np_,
                                             g.u.data(), nu_));
        return g;
    }
    /// Stops the running call, or the next one; from any thread and signal handler.
    void interrupt() const noexcept { swb_integrator_interrupt(get()); }

    void set(const char *name, const char *value) { detail::check(swb_integrator_set_string(get(), name, value)); }
    void set(const char *name, double value) { detail::check(swb_integrator_set_double(get(), name, value)); }
    template <class Integer, std::enable_if_t<std::is_integral_v<Integer>, int> = 0>
    void set(const char *name, Integer value) {
        detail::check(swb_integrator_set_int(get(), name, static_cast<int64_t>(value)));
    }
    Settings settings() const {
        Settings s;
        detail::check(swb_integrator_get_settings(get(), &s, sizeof(swb_settings)));
        return s;
    }
    swb_integrator *get() const noexcept { return owner_.get(); }

private:
    template <class Call>
    Vector array(Call call) const {
        Vector out(static_cast<std::size_t>(nx_));
        detail::check(call(get(), out.data(), nx_));
        return out;
    }
    static int32_t call_step(const swb_progress *info, void *data) {
        return detail::guarded(1, [&] {
            return static_cast<int32_t>((*static_cast<std::function<bool(const swb_progress &)> *>(data))(*info));
        });
    }
    static int64_t call_decide(const swb_branching *branching, void *data) {
        int64_t taken = -1;
        detail::guarded(0, [&] {
            taken = (*static_cast<std::function<int64_t(const swb_branching &)> *>(data))(*branching);
            return 0;
        });
        return taken;
    }
    static void call_log(int64_t level, const char *line, void *data) {
        detail::guarded(
            0, [&] { return (*static_cast<std::function<void(int64_t, const char *)> *>(data))(level, line), 0; });
    }

    detail::Owner<swb_integrator, swb_integrator_free> owner_;
    int64_t nx_ = 0, nu_ = 0, np_ = 0;
    std::unique_ptr<std::function<bool(const swb_progress &)>> step_;
    std::unique_ptr<std::function<int64_t(const swb_branching &)>> decide_;
    std::unique_ptr<std::function<void(int64_t, const char *)>> log_;
};

/// Options of a Stepper: those of swb_step_options, with their defaults.
struct StepOptions : swb_step_options {
    StepOptions() { detail::check(swb_step_options_init(this, sizeof(swb_step_options))); }
};

/// States after steps.
struct Steps {
    /// Times; the first is that from which the steps began.
    Vector times;
    /// nx numbers for each time: coordinates, then velocities.
    Vector states;
    /// Three numbers for each contact and time, of the steps that end at these times: the normal impulse, then those along the
    /// tangents there are; empty if they were not asked for.
    Vector impulses;
};

/// Makes steps of a scene by the theta-method of Moreau and Jean, for many contacts: impacts are not located, and the error is
/// of order 1 in the length of a step.
class Stepper {
public:
    /// Error SWB_ERR_STATE if the system is not that of a scene, SWB_ERR_UNSUPPORTED if it is a projected one.
    explicit Stepper(const System &system, const StepOptions &options = {}) {
        swb_stepper *s = nullptr;
        detail::check(swb_stepper_create(system.get(), &options, &s));
        owner_.reset(s);
        detail::check(swb_stepper_sizes(s, &nx_, nullptr, nullptr, &contacts_));
    }
    /// Sets time and state and begins anew; set the parameters first.
    void reinit(double t, View x) { detail::check(swb_stepper_set_state(get(), t, x.data(), x.length())); }
    void controls(View u) { detail::check(swb_stepper_set_controls(get(), u.data(), u.length())); }
    void params(View p) { detail::check(swb_stepper_set_params(get(), p.data(), p.length())); }
    /// One step of the length in the options.
    void step() { detail::check(swb_stepper_step(get())); }
    /// Equal steps, not longer than that in the options, that end at a time.
    void advance(double t) { detail::check(swb_stepper_advance(get(), t)); }
    /// The same, and keeps the state after `every` steps, with the impulses if they are wanted.
    Steps run(double t, int64_t every = 1, bool impulses = false) {
        int64_t n = 0;
        detail::check(swb_stepper_count(get(), t, every, &n));
        Steps out{Vector(static_cast<std::size_t>(n)), Vector(static_cast<std::size_t>(n * nx_)),
                  Vector(static_cast<std::size_t>(impulses ? 3 * n * contacts_ : 0))};
        detail::check(swb_stepper_run(get(), t, every, out.times.data(), n, out.states.data(), n * nx_,
                                      out.impulses.empty() ? nullptr : out.impulses.data(),
                                      static_cast<int64_t>(out.impulses.size())));
        return out;
    }
    double time() const {
        double t = 0;
        detail::check(swb_stepper_get_time(get(), &t));
        return t;
    }
    /// State reached: coordinates, then velocities.
    Vector state() const {
        Vector x(static_cast<std::size_t>(nx_));
        detail::check(swb_stepper_get_state(get(), x.data(), nx_));
        return x;
    }
    /// Impulses of the last step, not forces: three for each contact, normal, then along the tangents there are.
    Vector impulses() const {
        Vector out(static_cast<std::size_t>(3 * contacts_));
        detail::check(swb_stepper_get_impulses(get(), out.data(), 3 * contacts_));
        return out;
    }
    swb_step_stats stats() const {
        swb_step_stats s{};
        detail::check(swb_stepper_get_stats(get(), &s, sizeof s));
        return s;
    }
    /// Number of contacts; those that were left out of the scene do not count.
    int64_t contacts() const noexcept { return contacts_; }
    /// Stops the running call after the step it is at, or the next call; from any thread and signal handler.
    void interrupt() const noexcept { swb_stepper_interrupt(get()); }
    swb_stepper *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_stepper, swb_stepper_free> owner_;
    int64_t nx_ = 0, contacts_ = 0;
};

/// Event-driven simulations from several initial states on several threads. Functions of the system are called by several
/// threads at once; one that throws ends its run with SWB_ERR_USER.
class Batch {
public:
    explicit Batch(const System &system, const Settings &settings = {}) {
        swb_batch *b = nullptr;
        detail::check(swb_batch_create(system.get(), &settings, &b));
        owner_.reset(b);
        detail::check(swb_system_sizes(system.get(), &nx_, nullptr, nullptr, nullptr));
    }
    /// Initial states, those of one run together; controls and parameters: none, one set for all, or one for each. With
    /// more than one thread (0: one for each processor) functions of the model are called by several threads at once,
    /// unless one of them is serial. If a function throws, the other runs are finished and the exception of the first run
    /// that has one comes out; the results of the others are there.
    void run(double t0, double t1, View x0, View u = {}, View p = {}, int64_t n_threads = 0) {
        const swb_status status = swb_batch_run(get(), t0, t1, x0.data(), x0.length(), u.data(), u.length(), p.data(),
                                                p.length(), n_threads);
        std::exception_ptr own = status == SWB_OK ? std::exchange(detail::pending(), nullptr) : nullptr;
        detail::check(status);
        const std::exception_ptr first = detail::first_thrown(size(), [this](int64_t k) {
            swb_run *r = nullptr;
            const swb_status of_run = swb_batch_get_run(get(), k, &r);
            swb_run_free(r);
            return of_run;
        });
        if (first || own)
            std::rethrow_exception(first ? first : own);
    }
    int64_t size() const {
        int64_t n = 0;
        detail::check(swb_batch_size(get(), &n));
        return n;
    }
    /// Final states, those of one run together; NaN for runs that failed.
    Vector states() const {
        Vector x(static_cast<std::size_t>(size() * nx_));
        detail::check(swb_batch_states(get(), x.data(), static_cast<int64_t>(x.size())));
        return x;
    }
    /// An swb_run_outcome each, or the negative status of a run that failed.
    std::vector<int32_t> outcomes() const {
        std::vector<int32_t> out(static_cast<std::size_t>(size()));
        detail::check(swb_batch_outcomes(get(), out.data(), static_cast<int64_t>(out.size())));
        return out;
    }
    Run operator[](int64_t index) const {
        swb_run *r = nullptr;
        detail::check(swb_batch_get_run(get(), index, &r));
        return Run(r);
    }
    void interrupt() const noexcept { swb_batch_interrupt(get()); }
    swb_batch *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_batch, swb_batch_free> owner_;
    int64_t nx_ = 0;
};

/// Optimal control of a system.
class Ocp : public detail::Solver<swb_ocp, detail::ocp_calls> {
public:
    Ocp(const System &system, double horizon, int64_t n_stages, const Settings &settings = {}) : n_stages_(n_stages) {
        swb_ocp *o = nullptr;
        detail::check(swb_ocp_create(system.get(), horizon, n_stages, &settings, &o));
        owner_.reset(o);
        int64_t nx = 0;
        detail::check(swb_system_sizes(system.get(), &nx, &nu_, &np_, nullptr));
        n_data_ = nx + np_;
    }
    void lagrange(const Function &f) { detail::check(swb_ocp_set_lagrange(get(), f.get())); }
    void mayer(const Function &f) { detail::check(swb_ocp_set_mayer(get(), f.get())); }
    void path(const Function &f, View lower, View upper, swb_path_at at = SWB_PATH_AT_CONTROL_GRID) {
        detail::check(swb_ocp_add_path(get(), f.get(), lower.data(), lower.length(), upper.data(), upper.length(), at));
    }
    void terminal(const Function &f, View lower, View upper) {
        detail::check(swb_ocp_add_terminal(get(), f.get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void state_bounds(View lower, View upper) {
        detail::check(swb_ocp_set_state_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void control_bounds(View lower, View upper) {
        detail::check(swb_ocp_set_control_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void initial_bounds(View lower, View upper) {
        detail::check(swb_ocp_set_initial_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void initial_state(View x0) { detail::check(swb_ocp_set_initial_state(get(), x0.data(), x0.length())); }
    void initial_time(double t0) { detail::check(swb_ocp_set_initial_time(get(), t0)); }
    void params(View p) { detail::check(swb_ocp_set_params(get(), p.data(), p.length())); }
    /// How large states, controls and parameters usually are, in their own units; NaN and empty views where that is not known.
    void nominal(View x, View u = {}, View p = {}) {
        detail::check(swb_ocp_set_nominal(get(), x.data(), x.length(), u.data(), u.length(), p.data(), p.length()));
    }
    /// Parameters that change from stage to stage, those of one stage together.
    void stage_params(View p) { detail::check(swb_ocp_set_stage_params(get(), p.data(), p.length())); }
    /// Parameters with a lower bound below the upper one become variables.
    void param_bounds(View lower, View upper) {
        detail::check(swb_ocp_set_param_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    /// 0 <= a, b >= 0, and one of them is zero.
    void complementarity(const Function &a, const Function &b, swb_path_at at = SWB_PATH_AT_CONTROL_GRID) {
        detail::check(swb_ocp_add_complementarity(get(), a.get(), b.get(), at));
    }
    /// A constraint between both ends of the horizon: `f` takes the initial state, then the final one.
    void boundary(const Function &f, View lower, View upper) {
        detail::check(swb_ocp_add_boundary(get(), f.get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    /// States with the same values at both ends.
    void periodic(const std::vector<int64_t> &states) {
        detail::check(swb_ocp_add_periodic(get(), states.data(), static_cast<int64_t>(states.size())));
    }
    /// A constraint along the horizon that may be violated at a price.
    void relaxed_path(const Function &f, View lower, View upper, swb_norm norm, double weight,
                      swb_path_at at = SWB_PATH_AT_CONTROL_GRID) {
        relaxed(f, lower, upper, at, norm, weight);
    }
    /// A constraint at the end of the horizon that may be violated at a price.
    void relaxed_terminal(const Function &f, View lower, View upper, swb_norm norm, double weight) {
        relaxed(f, lower, upper, -1, norm, weight);
    }
    /// Adds (f - y)' W (f - y) to the cost; `weights` is the diagonal of W or all of it, `references` one y or one for
    /// every stage.
    void least_squares(const Function &f, View weights, View references, swb_cost_at at = SWB_COST_AT_RUNNING) {
        detail::check(swb_ocp_add_least_squares(get(), f.get(), weights.data(), weights.length(), references.data(),
                                                references.length(), at));
    }
    /// Other references of a least-squares term, in the order they were added.
    void references(int64_t term, View values) {
        detail::check(swb_ocp_set_references(get(), term, values.data(), values.length()));
    }
    /// Finite elements of every stage.
    void elements(const std::vector<int64_t> &n_fe) {
        detail::check(swb_ocp_set_elements(get(), n_fe.data(), static_cast<int64_t>(n_fe.size())));
    }
    /// Lengths of the stages; where they are free, those to start from.
    void durations(View d) { detail::check(swb_ocp_set_durations(get(), d.data(), d.length())); }
    /// Lets the optimiser choose the length of the horizon, or that of every stage.
    void free_time(swb_free_time what, double lower, double upper) {
        detail::check(swb_ocp_set_free_time(get(), what, lower, upper));
    }
    /// Bounds the length of the horizon where those of the stages are free.
    void horizon(double lower, double upper) { detail::check(swb_ocp_add_horizon(get(), lower, upper)); }
    /// Controls that are continuous and linear on every stage.
    void linear_controls(const std::vector<int32_t> &linear) {
        detail::check(swb_ocp_set_linear_controls(get(), linear.data(), static_cast<int64_t>(linear.size())));
    }
    void state_guess(View times, View x) {
        detail::check(swb_ocp_set_state_guess(get(), times.data(), times.length(), x.data(), x.length()));
    }
    void control_guess(View u) { detail::check(swb_ocp_set_control_guess(get(), u.data(), u.length())); }
    swb_outcome solve() {
        int32_t o = 0;
        detail::check(swb_ocp_solve(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    /// From the last solution: after small changes its active set is tried first.
    swb_outcome solve_warm() {
        int32_t o = 0;
        detail::check(swb_ocp_solve_warm(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    /// Makes the last solution, one stage later, the guess of the next solve.
    void shift() { detail::check(swb_ocp_shift(get())); }
    /// A problem from a document; functions that are named there are supplied.
    static Ocp from_json(const std::string &document, const std::vector<const Function *> &functions = {}) {
        const auto handles = detail::handles<const swb_function *>(functions);
        swb_ocp *o = nullptr;
        detail::check(swb_ocp_from_json(document.c_str(), handles.data(), static_cast<int64_t>(handles.size()), &o));
        return Ocp(o);
    }
    /// The problem as a document, for bug reports and replay.
    std::string to_json() const {
        return detail::text([&](char *b, int64_t n, int64_t *needed) { return swb_ocp_to_json(get(), b, n, needed); });
    }
    /// Why the last solve did not end with an exact solution, and what the comparison with the simulation says of one.
    std::string message() const {
        return detail::text([&](char *b, int64_t n, int64_t *needed) { return swb_ocp_get_message(get(), b, n, needed); });
    }

    /// What stood for the contacts of a scene in numerical time, with strengths and warnings; empty unless the search was by time-freezing.
    std::string freezing_report() const {
        return detail::text([&](char *b, int64_t n, int64_t *needed) { return swb_ocp_freezing_report(get(), b, n, needed); });
    }
    /// Cost of the solution; NaN unless the problem is solved.
    double cost() const {
        double c = 0;
        detail::check(swb_ocp_get_cost(get(), &c));
        return c;
    }
    /// What the point costs at which the last solve ended, solution or not.
    double cost_reached() const {
        double c = 0;
        detail::check(swb_ocp_get_cost_reached(get(), &c));
        return c;
    }
    /// The controls of one stage together; where they are linear, at the start of the stages.
    Vector controls() const { return array(swb_ocp_get_controls, n_stages_ * nu_); }
    /// Controls at the ends of the stages: others than at their starts where they are linear.
    Vector control_ends() const { return array(swb_ocp_get_control_ends, n_stages_ * nu_); }
    /// Lengths of the stages as they were found.
    Vector durations() const { return array(swb_ocp_get_durations, n_stages_); }
    /// Parameters, those that were free as they were found.
    Vector params() const { return array(swb_ocp_get_params, np_); }
    /// Largest violation of a relaxed constraint.
    double violation() const {
        double v = 0;
        detail::check(swb_ocp_get_violation(get(), &v));
        return v;
    }
    /// The solution beside a simulation of its controls.
    swb_accuracy accuracy() const {
        swb_accuracy a{};
        detail::check(swb_ocp_get_accuracy(get(), &a, sizeof a));
        return a;
    }
    /// Type of stationarity and B-stationarity of the discretised program.
    swb_certificate certificate() const {
        swb_certificate c{};
        detail::check(swb_ocp_get_certificate(get(), &c, sizeof c));
        return c;
    }
    /// The transitions of the last solution in the order of time.
    std::vector<swb_ocp_jump> jumps() const {
        int64_t n = 0;
        detail::check(swb_ocp_jump_count(get(), &n));
        std::vector<swb_ocp_jump> out(static_cast<std::size_t>(n));
        detail::check(swb_ocp_jumps(get(), out.data(), n, sizeof(swb_ocp_jump)));
        return out;
    }
    /// The states just before and just behind a transition, by its place in jumps().
    std::pair<Vector, Vector> jump_states(int64_t index) const {
        const auto nx = static_cast<std::size_t>(n_data_ - np_);
        std::pair<Vector, Vector> out{Vector(nx), Vector(nx)};
        detail::check(swb_ocp_jump_states(get(), index, out.first.data(), out.second.data(), n_data_ - np_));
        return out;
    }
    /// What the last solution is as a point of the control problem, by simulations of its controls; see swb_verdict.
    swb_optimality optimality() const {
        swb_optimality o{};
        detail::check(swb_ocp_get_optimality(get(), &o, sizeof o));
        return o;
    }
    /// Switches of the last solution that lie between two control stages.
    std::vector<swb_kink> kinks() const {
        std::vector<swb_kink> all(static_cast<std::size_t>(optimality().n_kinks));
        for (std::size_t i = 0; i < all.size(); ++i)
            detail::check(swb_ocp_get_kink(get(), static_cast<int64_t>(i), &all[i], sizeof all[i]));
        return all;
    }
    /// Derivatives of the cost with respect to the controls, and changes of the controls that lower it where the last
    /// solution is not optimal; a stage after the other.
    Vector reduced_gradient() const { return array(swb_ocp_get_reduced_gradient, n_stages_ * nu_); }
    Vector descent() const { return array(swb_ocp_get_descent, n_stages_ * nu_); }
    /// Largest difference of a state from the simulation at the end of every stage.
    Vector mismatch() const { return array(swb_ocp_get_mismatch, n_stages_); }
    /// Derivatives of cost and controls with respect to the data: initial state, then parameters; the controls of one
    /// datum together.
    struct Sensitivity {
        Vector cost, controls;
        bool one_sided;
    };
    Sensitivity sensitivity() {
        Sensitivity s{Vector(static_cast<std::size_t>(n_data_)), Vector(static_cast<std::size_t>(n_data_ * n_stages_ * nu_)), false};
        int32_t one_sided = 0;
        detail::check(swb_ocp_get_sensitivity(get(), s.cost.data(), n_data_, s.controls.data(),
                                              static_cast<int64_t>(s.controls.size()), &one_sided));
        s.one_sided = one_sided != 0;
        return s;
    }
    /// Multipliers of the last solution at points of time, as many values at each of them; see swb_multipliers_of for their signs,
    /// for costates too.
    struct Multipliers {
        Vector times, values;
    };
    /// `index`: which constraint, in the order in which they were added; does not count for what is no list.
    Multipliers multipliers(swb_multipliers_of of, std::int64_t index = 0) {
        std::int64_t n = 0, width = 0;
        detail::check(swb_ocp_multiplier_sizes(get(), of, index, &n, &width));
        Multipliers m{Vector(static_cast<std::size_t>(n)), Vector(static_cast<std::size_t>(n * width))};
        detail::check(swb_ocp_get_multipliers(get(), of, index, m.times.data(), n, m.values.data(), n * width));
        return m;
    }
    swb_polished polished() const {
        int32_t p = 0;
        detail::check(swb_ocp_get_polished(get(), &p));
        return static_cast<swb_polished>(p);
    }
    Trajectory trajectory() const {
        swb_trajectory *r = nullptr;
        detail::check(swb_ocp_get_trajectory(get(), &r));
        return Trajectory(r);
    }
    /// The active modes phase by phase; the flags of one phase together. Phases begin at `times` from the start of the
    /// horizon; without `cells` the modes say all.
    struct Modes {
        Vector times;
        std::vector<int32_t> modes, cells;
        /// A transition: time from the start of the horizon, which one, in which stage, whether without passing its guard.
        struct Transition {
            double t;
            int64_t transition, stage;
            bool at_once;
        };
        std::vector<Transition> transitions{};
    };
    /// Mode sequence of the last solution.
    Modes modes() const {
        int64_t n = 0, n_modes = 0, n_cells = 0;
        detail::check(swb_ocp_mode_sizes(get(), &n, &n_modes, &n_cells));
        const auto room = [n](int64_t width) { return std::vector<int32_t>(static_cast<std::size_t>(n * width)); };
        Modes m{Vector(static_cast<std::size_t>(n)), room(n_modes), room(n_cells)};
        detail::check(swb_ocp_get_modes(get(), m.times.data(), n, m.modes.data(), n * n_modes, m.cells.data(), n * n_cells));
        int64_t n_jumps = 0;
        detail::check(swb_ocp_jump_count(get(), &n_jumps));
        const auto size = static_cast<std::size_t>(n_jumps);
        Vector t(size);
        std::vector<int64_t> which(size), stage(size);
        std::vector<int32_t> at_once(size);
        if (n_jumps > 0)
            detail::check(swb_ocp_get_mode_transitions(get(), t.data(), which.data(), stage.data(), at_once.data(), n_jumps));
        for (std::size_t k = 0; k < size; k++)
            m.transitions.push_back({t[k], which[k], stage[k], at_once[k] != 0});
        return m;
    }
    /// Order of modes the next solves start with; an empty one forgets it.
    void modes(const Modes &m) {
        const auto length = [](const std::vector<int32_t> &v) { return static_cast<int64_t>(v.size()); };
        detail::check(swb_ocp_set_modes(get(), m.times.data(), static_cast<int64_t>(m.times.size()), m.modes.data(),
                                        length(m.modes), m.cells.data(), length(m.cells)));
        if (m.transitions.empty())
            return;
        Vector t;
        std::vector<int64_t> which, stage;
        std::vector<int32_t> at_once;
        for (const Modes::Transition &one : m.transitions) {
            t.push_back(one.t);
            which.push_back(one.transition);
            stage.push_back(one.stage);
            at_once.push_back(one.at_once ? 1 : 0);
        }
        detail::check(swb_ocp_set_mode_transitions(get(), t.data(), which.data(), stage.data(), at_once.data(),
                                                   static_cast<int64_t>(t.size())));
    }
    /// Controls to start from, those of one start together: the guess of a solve, then random ones within the bounds.
    Vector random_starts(int64_t n, uint64_t seed = 0) {
        Vector u(static_cast<std::size_t>(n * n_stages_ * nu_));
        detail::check(swb_ocp_random_starts(get(), seed, u.data(), static_cast<int64_t>(u.size())));
        return u;
    }
    /// Solves from several guesses of the controls and keeps the best solution; returns which one that is. With more than
    /// one thread (0: one for each processor) functions of the model are called by several threads at once, unless one of
    /// them is serial. If a function throws, the other starts are solved and the exception of the first start that has
    /// one comes out; the best of the others is the solution.
    int64_t solve_starts(View u, int64_t n_threads = 0) {
        int64_t best = 0;
        const swb_status status = swb_ocp_solve_starts(get(), u.data(), u.length(), n_threads, &best);
        std::exception_ptr own = status == SWB_OK ? std::exchange(detail::pending(), nullptr) : nullptr;
        detail::check(status);
        const int64_t n = n_stages_ * nu_ > 0 ? u.length() / (n_stages_ * nu_) : 0;
        const std::exception_ptr first = detail::first_thrown(n, [this](int64_t k) {
            return swb_ocp_get_start(get(), k, nullptr, nullptr, nullptr, nullptr, 0);
        });
        if (first || own)
            std::rethrow_exception(first ? first : own);
        return best;
    }
    /// One solve on the way to an adapted grid.
    struct Round {
        std::vector<int64_t> elements;
        int64_t n_variables, iterations;
        double error, cost;
    };
    /// The solves of the last adaptation (option adapt_tol).
    std::vector<Round> rounds() const {
        int64_t n = 0;
        detail::check(swb_ocp_get_adaptation(get(), &n, nullptr, nullptr));
        std::vector<Round> all;
        for (int64_t k = 0; k < n; ++k) {
            Round r{std::vector<int64_t>(static_cast<std::size_t>(n_stages_)), 0, 0, 0.0, 0.0};
            detail::check(swb_ocp_get_round(get(), k, r.elements.data(), n_stages_, &r.n_variables, &r.iterations, &r.error,
                                            &r.cost));
            all.push_back(std::move(r));
        }
        return all;
    }

private:
    void relaxed(const Function &f, View lower, View upper, int32_t at, swb_norm norm, double weight) {
        detail::check(swb_ocp_add_relaxed(get(), f.get(), lower.data(), lower.length(), upper.data(), upper.length(), at,
                                          norm, weight));
    }
    template <class Call>
    Vector array(Call call, int64_t n) const {
        Vector out(static_cast<std::size_t>(n));
        detail::check(call(get(), out.data(), n));
        return out;
    }

    friend class MultiPhase;
    explicit Ocp(swb_ocp *o) {
        owner_.reset(o);
        int64_t nx = 0;
        detail::check(swb_ocp_sizes(o, &nx, &nu_, &np_, &n_stages_));
        n_data_ = nx + np_;
    }

    int64_t n_stages_ = 0, nu_ = 0, np_ = 0, n_data_ = 0;
};

/// Options of an Nmpc: those of swb_nmpc_options, with their defaults.
struct NmpcOptions : swb_nmpc_options {
    NmpcOptions() { detail::check(swb_nmpc_options_init(this, sizeof(swb_nmpc_options))); }
};

/// Model predictive control in real time: prepare between samples, feedback at them.
class Nmpc {
public:
    /// Error SWB_ERR_UNSUPPORTED for what controllers do not know, with what that is. The problem is copied.
    explicit Nmpc(const Ocp &ocp, const NmpcOptions &options = {}) {
        swb_nmpc *c = nullptr;
        detail::check(swb_nmpc_create(ocp.get(), &options, &c));
        owner_.reset(c);
        detail::check(swb_nmpc_sizes(c, &n_, &nx_, &nu_));
    }
    /// Solves the problem for a state to convergence: the start of a closed loop. Returns the steps it took.
    int64_t initialise(View x0, int64_t max_iter = 100) {
        int64_t steps = 0;
        detail::check(swb_nmpc_initialise(get(), x0.data(), x0.length(), max_iter, &steps));
        return steps;
    }
    /// Everything for the next sample that needs no measurement; with the state it will find, where that is known.
    swb_nmpc_info prepare(View predicted = {}) {
        swb_nmpc_info info{};
        detail::check(swb_nmpc_prepare(get(), predicted.data(), predicted.length(), &info, sizeof info));
        return info;
    }
    /// Begins a preparation on a thread of the controller. False if one is running already, which goes on.
    bool prepare_async(View predicted = {}) {
        int64_t started = 0;
        detail::check(swb_nmpc_prepare_async(get(), predicted.data(), predicted.length(), &started));
        return started != 0;
    }
    /// Waits for that preparation, and throws what it failed with.
    swb_nmpc_info wait() {
        swb_nmpc_info info{};
        detail::check(swb_nmpc_wait(get(), &info, sizeof info));
        return info;
    }
    /// The control for a measured state. There always is one, and the info says where it comes from.
    swb_nmpc_info feedback(View x, double *u0, int64_t nu) {
        swb_nmpc_info info{};
        detail::check(swb_nmpc_feedback(get(), x.data(), x.length(), u0, nu, &info, sizeof info));
        return info;
    }
    /// What can wait until the control is out.
    void finish() { detail::check(swb_nmpc_finish(get())); }
    void params(View p) { detail::check(swb_nmpc_set_params(get(), p.data(), p.length())); }
    void references(int64_t term, View y) { detail::check(swb_nmpc_set_references(get(), term, y.data(), y.length())); }
    /// The diagonal or the matrix; from the next preparation on.
    void weights(int64_t term, View w) { detail::check(swb_nmpc_set_weights(get(), term, w.data(), w.length())); }
    /// Infinite for none.
    void control_bounds(View lower, View upper) {
        detail::check(lower.length() == upper.length() ? swb_nmpc_set_control_bounds(get(), lower.data(), upper.data(), lower.length())
                                                       : SWB_ERR_DIMENSION);
    }
    void state_bounds(View lower, View upper) {
        detail::check(lower.length() == upper.length() ? swb_nmpc_set_state_bounds(get(), lower.data(), upper.data(), lower.length())
                                                       : SWB_ERR_DIMENSION);
    }
    /// Cost of the plan with the prices of its violations.
    double objective() {
        double v = 0.0;
        detail::check(swb_nmpc_get_objective(get(), &v));
        return v;
    }
    /// Gain of the first stage, row by row, where no constraint is active.
    Vector gain() {
        Vector k(static_cast<std::size_t>(nu_ * nx_));
        detail::check(swb_nmpc_get_gain(get(), k.data(), nu_ * nx_));
        return k;
    }
    void time(double t0) { detail::check(swb_nmpc_set_time(get(), t0)); }
    void deadline(double seconds) { detail::check(swb_nmpc_set_deadline(get(), seconds)); }
    void iterate(View x, View u) { detail::check(swb_nmpc_set_iterate(get(), x.data(), x.length(), u.data(), u.length())); }
    void reset() { detail::check(swb_nmpc_reset(get())); }
    /// Writes the controller as C files without a heap: prefix.h, prefix.c, a program that repeats a recorded loop, and a Makefile.
    void write_c(const std::string &folder, const std::string &prefix, swb_c_real precision = SWB_C_REAL_DOUBLE) {
        detail::check(swb_nmpc_write_c(get(), folder.c_str(), prefix.c_str(), precision));
    }
    /// States of the nodes and controls of the stages, from the last sample on.
    std::pair<Vector, Vector> plan() {
        std::pair<Vector, Vector> out{Vector(static_cast<std::size_t>((n_ + 1) * nx_)), Vector(static_cast<std::size_t>(n_ * nu_))};
        detail::check(swb_nmpc_get_plan(get(), out.first.data(), (n_ + 1) * nx_, out.second.data(), n_ * nu_));
        return out;
    }
    swb_nmpc_monitor monitor() const {
        swb_nmpc_monitor m{};
        detail::check(swb_nmpc_get_monitor(get(), &m, sizeof m));
        return m;
    }
    /// Stages, measured states, controls.
    int64_t stages() const noexcept { return n_; }
    int64_t states() const noexcept { return nx_; }
    int64_t controls() const noexcept { return nu_; }
    /// Ends the running call, or the next one; from any thread and signal handler.
    void interrupt() const noexcept { swb_nmpc_interrupt(get()); }
    swb_nmpc *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_nmpc, swb_nmpc_free> owner_;
    int64_t n_ = 0, nx_ = 0, nu_ = 0;
};

/// Options of an Mhe: those of swb_mhe_options, with their defaults.
struct MheOptions : swb_mhe_options {
    MheOptions() { detail::check(swb_mhe_options_init(this, sizeof(swb_mhe_options))); }
};

/// Moving horizon estimation: prepare with the control of a sample, then estimate with its measurements.
class Mhe {
public:
    /// A problem without costs: its stages are the samples of the window, its initial state the mean before the first measurement. Standard
    /// deviations of that state, of what is added to the states in every stage, and of the measurements.
    Mhe(const Ocp &ocp, const Function &measured, View initial, View process, View measurement, const MheOptions &options = {}) {
        swb_mhe *c = nullptr;
        detail::check(swb_mhe_create(ocp.get(), measured.get(), initial.data(), initial.length(), process.data(), process.length(),
                                     measurement.data(), measurement.length(), &options, &c));
        owner_.reset(c);
        detail::check(swb_mhe_sizes(c, &n_, &nx_, &nu_, &ny_, &nw_));
    }
    /// To the next sample under the control u.
    swb_nmpc_info prepare(View u = {}) {
        swb_nmpc_info info{};
        detail::check(swb_mhe_prepare(get(), u.data(), u.length(), &info, sizeof info));
        return info;
    }
    /// The state from the measurements y, NaN for what was not measured; the info says where it comes from.
    swb_nmpc_info estimate(View y, double *x, int64_t nx) {
        swb_nmpc_info info{};
        detail::check(swb_mhe_estimate(get(), y.data(), y.length(), x, nx, &info, sizeof info));
        return info;
    }
    /// From the next preparation on.
    void params(View p) { detail::check(swb_mhe_set_params(get(), p.data(), p.length())); }
    /// Nothing was measured, with another mean.
    void reset(View x0) { detail::check(swb_mhe_reset(get(), x0.data(), x0.length())); }
    /// States of the window, the last sample at the end, and how many of its stages were.
    std::pair<Vector, int64_t> window() {
        std::pair<Vector, int64_t> out{Vector(static_cast<std::size_t>((n_ + 1) * nx_)), 0};
        detail::check(swb_mhe_get_window(get(), out.first.data(), (n_ + 1) * nx_, nullptr, 0, &out.second));
        return out;
    }
    /// Covariance of the last state, without regard of bounds.
    Vector covariance() {
        Vector p(static_cast<std::size_t>(nx_ * nx_));
        detail::check(swb_mhe_get_covariance(get(), p.data(), nx_ * nx_));
        return p;
    }
    /// Stages of the window, states, controls, measurements, states with noise.
    int64_t stages() const noexcept { return n_; }
    int64_t states() const noexcept { return nx_; }
    int64_t controls() const noexcept { return nu_; }
    int64_t measurements() const noexcept { return ny_; }
    int64_t noisy() const noexcept { return nw_; }
    /// Ends the running call, or the next one; from any thread and signal handler.
    void interrupt() const noexcept { swb_mhe_interrupt(get()); }
    swb_mhe *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_mhe, swb_mhe_free> owner_;
    int64_t n_ = 0, nx_ = 0, nu_ = 0, ny_ = 0, nw_ = 0;
};

/// Phases one after the other, each a problem as it is stated when this is made, linked at their ends.
class MultiPhase {
public:
    explicit MultiPhase(const std::vector<const Ocp *> &phases) {
        const auto handles = detail::handles<swb_ocp *>(phases);
        swb_multiphase *m = nullptr;
        detail::check(swb_multiphase_create(handles.data(), static_cast<int64_t>(handles.size()), nullptr, &m));
        owner_.reset(m);
    }
    /// lower <= f([x(T) of the phase; x(0) of the next]) <= upper.
    void link(int64_t phase, const Function &f, View lower, View upper) {
        detail::check(swb_multiphase_link(get(), phase, f.get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void link_continuous(int64_t phase) { detail::check(swb_multiphase_link_continuous(get(), phase)); }
    /// The next phase begins at r(x(T)), a function of the states of this phase alone.
    void link_reset(int64_t phase, const Function &r) { detail::check(swb_multiphase_link_reset(get(), phase, r.get())); }
    swb_outcome solve() {
        int32_t o = 0;
        detail::check(swb_multiphase_solve(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    swb_multiphase_info info() const {
        swb_multiphase_info i;
        detail::check(swb_multiphase_get_info(get(), &i, sizeof i));
        return i;
    }
    std::string message() const {
        return detail::text(
            [&](char *b, int64_t n, int64_t *needed) { return swb_multiphase_get_message(get(), b, n, needed); });
    }
    /// A copy of a phase with its part of the solution.
    Ocp phase(int64_t k) const {
        swb_ocp *o = nullptr;
        detail::check(swb_multiphase_get_phase(get(), k, &o));
        return Ocp(o);
    }
    void interrupt() const noexcept { swb_multiphase_interrupt(get()); }
    swb_multiphase *get() const noexcept { return owner_.get(); }

private:
    detail::Owner<swb_multiphase, swb_multiphase_free> owner_;
};

/// A member of a complementarity pair.
struct Member {
    swb_member kind;
    int64_t index;
};
inline Member variable(int64_t index) { return {SWB_MEMBER_VARIABLE, index}; }
inline Member constraint(int64_t index) { return {SWB_MEMBER_CONSTRAINT, index}; }

/// A nonlinear program, with complementarity pairs and boxes or without.
class Mpcc : public detail::Solver<swb_mpcc, detail::mpcc_calls> {
public:
    using LagrangianHessian = std::function<int(const swb_point &, double, const double *, double *)>;

    Mpcc(int64_t n, int64_t np, const Function &objective, const Function &constraints, const Settings &settings = {})
        : Mpcc(n, np, objective, &constraints, settings) {}
    Mpcc(int64_t n, int64_t np, const Function &objective, const Settings &settings = {})
        : Mpcc(n, np, objective, nullptr, settings) {}

    void pair(Member g, Member h) {
        detail::check(swb_mpcc_add_pair(get(), g.kind, g.index, h.kind, h.index));
        ++n_pairs_;
    }
    /// The box lower <= w_i <= upper _|_ c_j of a variable and a constraint.
    void box(int64_t variable, int64_t constraint) { detail::check(swb_mpcc_add_box(get(), variable, constraint)); }
    void bounds(View lower, View upper) {
        detail::check(swb_mpcc_set_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void constraint_bounds(View lower, View upper) {
        detail::check(swb_mpcc_set_constraint_bounds(get(), lower.data(), lower.length(), upper.data(), upper.length()));
    }
    void params(View p) { detail::check(swb_mpcc_set_params(get(), p.data(), p.length())); }
    /// hessian(point, weight, y, out) writes the entries of the pattern of the upper triangle: the Hessian of the
    /// Lagrangian in one piece, in place of those of the functions.
    void hessian(const Pattern &pattern, LagrangianHessian f) {
        auto kept = std::make_unique<LagrangianHessian>(std::move(f));
        detail::check(swb_mpcc_set_hessian(get(), pattern.col_ptr.data(), static_cast<int64_t>(pattern.col_ptr.size()),
                                           pattern.row_idx.data(), static_cast<int64_t>(pattern.row_idx.size()),
                                           call_hessian, kept.get()));
        hessian_ = std::move(kept);
    }
    void start(View w) { detail::check(swb_mpcc_set_start(get(), w.data(), w.length())); }
    /// A point with multipliers, as `multipliers` of a program nearby has them.
    void warm_start(View w, View y, View z) {
        detail::check(swb_mpcc_set_warm_start(get(), w.data(), w.length(), y.data(), y.length(), z.data(), z.length()));
    }
    swb_outcome solve() {
        int32_t o = 0;
        detail::check(swb_mpcc_solve(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    /// From the last solution, as after a change of parameters or bounds.
    swb_outcome resolve() {
        int32_t o = 0;
        detail::check(swb_mpcc_resolve(get(), &o));
        return static_cast<swb_outcome>(o);
    }
    /// Names in reports and messages.
    void name(swb_item kind, int64_t index, const char *name) {
        detail::check(swb_mpcc_set_name(get(), kind, index, name));
    }
    double objective() const {
        double f = 0;
        detail::check(swb_mpcc_get_objective(get(), &f));
        return f;
    }
    Vector solution() const {
        Vector w(static_cast<std::size_t>(n_));
        detail::check(swb_mpcc_get_solution(get(), w.data(), n_));
        return w;
    }
    /// Of the constraints, and of the bounds, lower minus upper.
    std::pair<Vector, Vector> multipliers() const {
        std::pair<Vector, Vector> r{Vector(static_cast<std::size_t>(m_)), Vector(static_cast<std::size_t>(n_))};
        detail::check(swb_mpcc_get_multipliers(get(), r.first.data(), m_, r.second.data(), n_));
        return r;
    }
    Vector constraints() const {
        Vector c(static_cast<std::size_t>(m_));
        detail::check(swb_mpcc_get_constraints(get(), c.data(), m_));
        return c;
    }
    /// Values of the members of all pairs, in the order the pairs were added, and the multipliers nu of G, xi of H.
    struct Pairs {
        Vector g, h, nu, xi;
    };
    Pairs pairs() const {
        const Vector zeros(static_cast<std::size_t>(n_pairs_));
        Pairs r{zeros, zeros, zeros, zeros};
        detail::check(swb_mpcc_get_pairs(get(), r.g.data(), r.h.data(), r.nu.data(), r.xi.data(), n_pairs_));
        return r;
    }
    /// Derivatives by the parameters: of the point, those by one parameter together, and of the objective; the sides on which each holds.
    struct Tangents {
        Vector x, objective;
        std::vector<int32_t> sides;
    };
    Tangents tangents() {
        const auto np = static_cast<std::size_t>(np_);
        Tangents t{Vector(np * static_cast<std::size_t>(n_)), Vector(np), std::vector<int32_t>(np)};
        detail::check(swb_mpcc_get_tangents(get(), t.x.data(), np_ * n_, t.objective.data(), np_, t.sides.data(), np_));
        return t;
    }
    /// The weights of the parameters for weights of point and objective, and the sides on which each holds.
    std::pair<Vector, std::vector<int32_t>> vjp(View x, double objective = 0) {
        const auto np = static_cast<std::size_t>(np_);
        std::pair<Vector, std::vector<int32_t>> r{Vector(np), std::vector<int32_t>(np)};
        detail::check(swb_mpcc_vjp(get(), x.data(), x.length(), objective, r.first.data(), np_, r.second.data(), np_));
        return r;
    }
    swb_polished polished() const {
        int32_t p = 0;
        detail::check(swb_mpcc_get_polished(get(), &p));
        return static_cast<swb_polished>(p);
    }
    swb_certificate certificate() const {
        swb_certificate c{};
        detail::check(swb_mpcc_get_certificate(get(), &c, sizeof c));
        return c;
    }
    struct Violation {
        swb_item kind;
        int64_t index;
        double violation;
    };
    /// What the point violates, the worst first, `k` items at most.
    std::vector<Violation> worst(std::size_t k) const {
        std::vector<int32_t> kinds(k);
        std::vector<int64_t> indices(k);
        Vector violations(k);
        int64_t found = 0;
        detail::check(swb_mpcc_get_worst(get(), kinds.data(), indices.data(), violations.data(), static_cast<int64_t>(k), &found));
        std::vector<Violation> out;
        for (std::size_t i = 0; i < k && static_cast<int64_t>(i) < found; ++i)
            out.push_back({static_cast<swb_item>(kinds[i]), indices[i], violations[i]});
        return out;
    }
    /// What the last solve says about itself, for people and for programs.
    std::string report() const {
        return detail::text([this](char *b, int64_t n, int64_t *needed) { return swb_mpcc_report_text(get(), b, n, needed); });
    }
    std::string json() const {
        return detail::text([this](char *b, int64_t n, int64_t *needed) { return swb_mpcc_statistics_json(get(), b, n, needed); });
    }

private:
    static int32_t call_hessian(const swb_point *at, double weight, const double *y, double *out, void *data) {
        return detail::guarded_function([&] { return (*static_cast<LagrangianHessian *>(data))(*at, weight, y, out); });
    }
    Mpcc(int64_t n, int64_t np, const Function &objective, const Function *constraints, const Settings &settings)
        : n_(n), np_(np) {
        swb_mpcc *p = nullptr;
        detail::check(swb_mpcc_create(n, np, objective.get(), constraints ? constraints->get() : nullptr, &settings, &p));
        owner_.reset(p);
        if (constraints)
            detail::check(swb_function_sizes(constraints->get(), nullptr, nullptr, nullptr, &m_, nullptr, nullptr));
    }
    int64_t n_ = 0, np_ = 0, m_ = 0, n_pairs_ = 0;
    std::unique_ptr<LagrangianHessian> hessian_;
};

} // namespace swb

#include "switchback_expr.hpp"

#endif

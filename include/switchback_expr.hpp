/* switchback for C++17: models written as expressions. Included by switchback.hpp. BSD-2-Clause, see LICENSE.
 *
 *     swb::Model m("q v");
 *     const auto q = m.x(0), v = m.x(1);
 *     m.derivatives({v, -q - 0.3 * sign(v)});
 *     swb::Simulator simulator(m.system());
 *
 * An Expr is a value: it can be copied, and lives as long as it is needed. Comparisons are conditions, joined with &, |
 * and !, for where. Operators that switch (sign, abs, min, max, clip, relay, dead_zone, where) are for the derivatives of
 * models only. */
#ifndef SWITCHBACK_EXPR_HPP
#define SWITCHBACK_EXPR_HPP

#include "switchback.hpp"

#include <algorithm>
#include <array>
#include <sstream>

namespace swb {

namespace detail {

using Graph = std::shared_ptr<swb_expr>;

inline Graph new_graph() {
    swb_expr *g = nullptr;
    check(swb_expr_create(&g));
    return Graph(g, swb_expr_free);
}

/// A number of a graph.
struct Node {
    Graph graph;
    int64_t id = -1;
};

inline const Graph &graph_of(const Node &a, const Node &b) {
    if (a.graph != b.graph)
        throw Error(SWB_ERR_STATE, "expressions of two graphs cannot be combined", 0);
    return a.graph;
}

inline Node constant(const Graph &graph, double value) {
    Node n{graph, -1};
    check(swb_expr_constants(graph.get(), &value, 1, &n.id, 1));
    return n;
}

inline Node apply(swb_operator op, const Node &a) {
    Node n{a.graph, -1};
    check(swb_expr_apply(a.graph.get(), op, &a.id, nullptr, nullptr, &n.id, 1));
    return n;
}
inline Node apply(swb_operator op, const Node &a, const Node &b) {
    Node n{graph_of(a, b), -1};
    check(swb_expr_apply(n.graph.get(), op, &a.id, &b.id, nullptr, &n.id, 1));
    return n;
}
inline Node apply(swb_operator op, const Node &a, const Node &b, const Node &c) {
    graph_of(a, b);
    Node n{graph_of(b, c), -1};
    check(swb_expr_apply(n.graph.get(), op, &a.id, &b.id, &c.id, &n.id, 1));
    return n;
}

} // namespace detail

/// A value.
class Expr {
public:
    explicit Expr(detail::Node node) : node_(std::move(node)) {}
    const detail::Node &node() const noexcept { return node_; }
    int64_t id() const noexcept { return node_.id; }
    std::string text() const {
        return detail::text([this](char *b, int64_t n, int64_t *needed) {
            return swb_expr_text(node_.graph.get(), node_.id, b, n, needed);
        });
    }
    template <class T> Expr &operator+=(const T &b) { return *this = *this + b; }
    template <class T> Expr &operator-=(const T &b) { return *this = *this - b; }
    template <class T> Expr &operator*=(const T &b) { return *this = *this * b; }
    template <class T> Expr &operator/=(const T &b) { return *this = *this / b; }

private:
    detail::Node node_;
};

/// A condition.
class Cond {
public:
    explicit Cond(detail::Node node, detail::Node margin = {}) : node_(std::move(node)), margin_(std::move(margin)) {}
    const detail::Node &node() const noexcept { return node_; }
    int64_t id() const noexcept { return node_.id; }
    /// Of a comparison: what is positive where it holds; of others its number is -1.
    const detail::Node &margin() const noexcept { return margin_; }

private:
    detail::Node node_, margin_;
};

using Exprs = std::vector<Expr>;

#define SWB_DETAIL_UNARY(name, op)                                                                                     \
    inline Expr name(const Expr &a) { return Expr(detail::apply(op, a.node())); }
SWB_DETAIL_UNARY(operator-, SWB_OPERATOR_NEG)
SWB_DETAIL_UNARY(sqrt, SWB_OPERATOR_SQRT)
SWB_DETAIL_UNARY(exp, SWB_OPERATOR_EXP)
SWB_DETAIL_UNARY(log, SWB_OPERATOR_LOG)
SWB_DETAIL_UNARY(sin, SWB_OPERATOR_SIN)
SWB_DETAIL_UNARY(cos, SWB_OPERATOR_COS)
SWB_DETAIL_UNARY(tan, SWB_OPERATOR_TAN)
SWB_DETAIL_UNARY(asin, SWB_OPERATOR_ASIN)
SWB_DETAIL_UNARY(acos, SWB_OPERATOR_ACOS)
SWB_DETAIL_UNARY(atan, SWB_OPERATOR_ATAN)
SWB_DETAIL_UNARY(sinh, SWB_OPERATOR_SINH)
SWB_DETAIL_UNARY(cosh, SWB_OPERATOR_COSH)
SWB_DETAIL_UNARY(tanh, SWB_OPERATOR_TANH)
SWB_DETAIL_UNARY(erf, SWB_OPERATOR_ERF)
/// The largest whole number that is not larger: in resets of transitions only.
SWB_DETAIL_UNARY(floor, SWB_OPERATOR_FLOOR)
SWB_DETAIL_UNARY(sign, SWB_OPERATOR_SIGN)
SWB_DETAIL_UNARY(abs, SWB_OPERATOR_ABS)
#undef SWB_DETAIL_UNARY
inline Expr operator+(const Expr &a) { return a; }

/// Both operands may be expressions, or one of them a number.
#define SWB_DETAIL_BINARY(name, op)                                                                                    \
    inline Expr name(const Expr &a, const Expr &b) { return Expr(detail::apply(op, a.node(), b.node())); }             \
    inline Expr name(const Expr &a, double b) {                                                                        \
        return Expr(detail::apply(op, a.node(), detail::constant(a.node().graph, b)));                                 \
    }                                                                                                                  \
    inline Expr name(double a, const Expr &b) {                                                                        \
        return Expr(detail::apply(op, detail::constant(b.node().graph, a), b.node()));                                 \
    }
SWB_DETAIL_BINARY(operator+, SWB_OPERATOR_ADD)
SWB_DETAIL_BINARY(operator-, SWB_OPERATOR_SUB)
SWB_DETAIL_BINARY(operator*, SWB_OPERATOR_MUL)
SWB_DETAIL_BINARY(operator/, SWB_OPERATOR_DIV)
SWB_DETAIL_BINARY(pow, SWB_OPERATOR_POW)
SWB_DETAIL_BINARY(atan2, SWB_OPERATOR_ATAN2)
SWB_DETAIL_BINARY(min, SWB_OPERATOR_MIN)
SWB_DETAIL_BINARY(max, SWB_OPERATOR_MAX)
SWB_DETAIL_BINARY(minimum, SWB_OPERATOR_MIN)
SWB_DETAIL_BINARY(maximum, SWB_OPERATOR_MAX)
SWB_DETAIL_BINARY(dead_zone, SWB_OPERATOR_DEAD_ZONE)
#undef SWB_DETAIL_BINARY

/// An expression, or a number that becomes one.
class Operand {
public:
    Operand(const Expr &e) : expr_(std::make_shared<Expr>(e)) {}
    Operand(double value) : value_(value) {}
    detail::Node in(const detail::Graph &graph) const {
        return expr_ ? expr_->node() : detail::constant(graph, value_);
    }

private:
    std::shared_ptr<const Expr> expr_;
    double value_ = 0;
};

/// The nearest value between low and high.
inline Expr clip(const Expr &a, const Operand &low, const Operand &high) {
    const detail::Graph &g = a.node().graph;
    return Expr(detail::apply(SWB_OPERATOR_CLIP, a.node(), low.in(g), high.in(g)));
}
/// on where a > 0, else off.
inline Expr relay(const Expr &a, const Operand &on, const Operand &off) {
    const detail::Graph &g = a.node().graph;
    return Expr(detail::apply(SWB_OPERATOR_RELAY, a.node(), on.in(g), off.in(g)));
}
/// a where the condition holds, else b.
inline Expr where(const Cond &condition, const Operand &a, const Operand &b) {
    const detail::Graph &g = condition.node().graph;
    return Expr(detail::apply(SWB_OPERATOR_WHERE, condition.node(), a.in(g), b.in(g)));
}

namespace detail {
inline Cond positive(const Expr &a) { return Cond(apply(SWB_OPERATOR_POSITIVE, a.node()), a.node()); }
} // namespace detail

/// On the surface itself Filippov's solution counts: > and >= are the same.
#define SWB_DETAIL_COMPARE(A, B)                                                                                       \
    inline Cond operator>(A a, B b) { return detail::positive(a - b); }                                                \
    inline Cond operator>=(A a, B b) { return detail::positive(a - b); }                                               \
    inline Cond operator<(A a, B b) { return detail::positive(b - a); }                                                \
    inline Cond operator<=(A a, B b) { return detail::positive(b - a); }
SWB_DETAIL_COMPARE(const Expr &, const Expr &)
SWB_DETAIL_COMPARE(const Expr &, double)
SWB_DETAIL_COMPARE(double, const Expr &)
#undef SWB_DETAIL_COMPARE
inline Cond operator&(const Cond &a, const Cond &b) { return Cond(detail::apply(SWB_OPERATOR_AND, a.node(), b.node())); }
inline Cond operator|(const Cond &a, const Cond &b) { return Cond(detail::apply(SWB_OPERATOR_OR, a.node(), b.node())); }
inline Cond operator!(const Cond &a) { return Cond(detail::apply(SWB_OPERATOR_NOT, a.node())); }
inline Cond operator~(const Cond &a) { return !a; }

namespace detail {

/// Numbers of expressions of one graph.
inline std::vector<int64_t> ids(const Graph &graph, const Exprs &all) {
    std::vector<int64_t> out;
    for (const Expr &e : all) {
        if (e.node().graph != graph)
            throw Error(SWB_ERR_STATE, "expressions of two graphs cannot be combined", 0);
        out.push_back(e.id());
    }
    return out;
}

inline const Graph &graph_of(const Exprs &all) {
    if (all.empty())
        throw Error(SWB_ERR_DIMENSION, "there is no expression", 0);
    return all.front().node().graph;
}

inline Exprs exprs(const Graph &graph, const std::vector<int64_t> &ids) {
    Exprs out;
    for (const int64_t id : ids)
        out.emplace_back(Node{graph, id});
    return out;
}

inline int64_t length(const std::vector<int64_t> &v) { return static_cast<int64_t>(v.size()); }
inline int64_t length(const Vector &v) { return static_cast<int64_t>(v.size()); }

template <class F>
Exprs each(const Exprs &a, const Exprs &b, F f) {
    if (a.size() != b.size())
        throw Error(SWB_ERR_DIMENSION, "vectors of expressions have different lengths", 0);
    Exprs out;
    for (std::size_t i = 0; i < a.size(); ++i)
        out.push_back(f(a[i], b[i]));
    return out;
}

} // namespace detail

// --- vectors and matrices --------------------------------------------------------------------------

inline Exprs operator+(const Exprs &a, const Exprs &b) {
    return detail::each(a, b, [](const Expr &x, const Expr &y) { return x + y; });
}
inline Exprs operator-(const Exprs &a, const Exprs &b) {
    return detail::each(a, b, [](const Expr &x, const Expr &y) { return x - y; });
}
template <class Factor, std::enable_if_t<std::is_same_v<Factor, Expr> || std::is_arithmetic_v<Factor>, int> = 0>
Exprs operator*(const Factor &factor, Exprs a) {
    for (Expr &e : a)
        e = e * factor;
    return a;
}

/// Inner product.
inline Expr dot(const Exprs &a, const Exprs &b) {
    const detail::Graph &g = detail::graph_of(a);
    const auto x = detail::ids(g, a), y = detail::ids(g, b);
    detail::Node n{g, -1};
    detail::check(swb_expr_matmul(g.get(), 1, detail::length(x), 1, x.data(), detail::length(x), y.data(),
                                  detail::length(y), &n.id, 1));
    return Expr(std::move(n));
}
/// Euclidean norm; it has no derivative at zero.
inline Expr norm(const Exprs &a) { return sqrt(dot(a, a)); }
inline Expr sum(const Exprs &a) {
    detail::graph_of(a);
    Expr total = a.front();
    for (std::size_t i = 1; i < a.size(); ++i)
        total += a[i];
    return total;
}

/// A matrix of expressions, stored by columns.
class Matrix {
public:
    /// All entries are `value`.
    Matrix(std::size_t rows, std::size_t cols, const Expr &value) : rows_(rows), entries_(rows * cols, value) {}
    Matrix(std::size_t rows, Exprs entries) : rows_(rows), entries_(std::move(entries)) {
        if (rows_ == 0 || entries_.size() % rows_ != 0)
            throw Error(SWB_ERR_DIMENSION, "the entries of a matrix must fill its columns", 0);
    }
    Expr &operator()(std::size_t i, std::size_t j) { return entries_.at(i + rows_ * j); }
    const Expr &operator()(std::size_t i, std::size_t j) const { return entries_.at(i + rows_ * j); }
    std::size_t rows() const { return rows_; }
    std::size_t cols() const { return entries_.size() / rows_; }
    const Exprs &entries() const { return entries_; }

private:
    std::size_t rows_;
    Exprs entries_;
};

inline Matrix operator*(const Matrix &a, const Matrix &b) {
    const detail::Graph &g = detail::graph_of(a.entries());
    const auto x = detail::ids(g, a.entries()), y = detail::ids(g, b.entries());
    if (a.cols() != b.rows())
        throw Error(SWB_ERR_DIMENSION, "matrices of these sizes cannot be multiplied", 0);
    std::vector<int64_t> out(a.rows() * b.cols());
    detail::check(swb_expr_matmul(g.get(), static_cast<int64_t>(a.rows()), static_cast<int64_t>(a.cols()),
                                  static_cast<int64_t>(b.cols()), x.data(), detail::length(x), y.data(),
                                  detail::length(y), out.data(), detail::length(out)));
    return Matrix(a.rows(), detail::exprs(g, out));
}
inline Exprs operator*(const Matrix &a, const Exprs &b) {
    if (b.size() != a.cols())
        throw Error(SWB_ERR_DIMENSION, "a matrix and a vector of these sizes cannot be multiplied", 0);
    return (a * Matrix(b.size(), b)).entries();
}

/// Solution of a small linear system; the matrix is decomposed numerically, where the solution is evaluated.
inline Exprs solve(const Matrix &matrix, const Exprs &rhs) {
    const detail::Graph &g = detail::graph_of(matrix.entries());
    const auto a = detail::ids(g, matrix.entries()), b = detail::ids(g, rhs);
    std::vector<int64_t> out(b.size());
    detail::check(swb_expr_solve(g.get(), a.data(), detail::length(a), b.data(), out.data(), detail::length(out)));
    return detail::exprs(g, out);
}

/// Derivatives with respect to inputs, a row for each output: for energies and Lagrangians.
inline Matrix jacobian(const Exprs &outputs, const Exprs &inputs) {
    const detail::Graph &g = detail::graph_of(outputs);
    const auto f = detail::ids(g, outputs), x = detail::ids(g, inputs);
    std::vector<int64_t> out(f.size() * x.size());
    detail::check(swb_expr_jacobian(g.get(), f.data(), detail::length(f), x.data(), detail::length(x), out.data(),
                                    detail::length(out)));
    return Matrix(f.size(), detail::exprs(g, out));
}

/// Values of a table: see enum swb_table.
inline Expr table(const Expr &a, View points, View values, swb_table kind = SWB_TABLE_SPLINE) {
    detail::Node n{a.node().graph, -1};
    const int64_t id = a.id();
    detail::check(swb_expr_table(n.graph.get(), kind, points.data(), points.length(), values.data(), values.length(),
                                 &id, &n.id, 1));
    return Expr(std::move(n));
}

/// Outputs of a function at expressions for its inputs: x, u, p, then t. The function outlives what is made of them.
inline Exprs external(const Function &f, const Exprs &args) {
    const detail::Graph &g = detail::graph_of(args);
    int64_t n_out = 0;
    detail::check(swb_function_sizes(f.get(), nullptr, nullptr, nullptr, &n_out, nullptr, nullptr));
    const auto a = detail::ids(g, args);
    std::vector<int64_t> out(static_cast<std::size_t>(n_out));
    detail::check(swb_expr_call(g.get(), f.get(), a.data(), detail::length(a), out.data(), n_out));
    return detail::exprs(g, out);
}

// --- models ----------------------------------------------------------------------------------------

/// Sizes of a model; algebraic variables and pairs are counted at one point.
struct Counts {
    int64_t subsystems = 0, switching_functions = 0, regions = 0, algebraic = 0, pairs = 0;
};

namespace detail {

/// The number of a guard in this graph.
inline int64_t guard_of(const Graph &graph, const Cond &guard) {
    if (guard.margin().id < 0 && guard.node().graph.get() != graph.get())
        throw Error(SWB_ERR_RANGE, "the guard is made of variables of another model", 0);
    return guard.margin().id < 0 ? guard.id() : ids(graph, {Expr(guard.margin())}).front();
}

/// The place of a state among all of a model or a scene.
inline int64_t place_of(const Graph &graph, const Exprs &states, const Expr &state) {
    for (std::size_t i = 0; i < states.size(); ++i)
        if (state.node().graph == graph && state.id() == states[i].id())
            return static_cast<int64_t>(i);
    throw Error(SWB_ERR_RANGE, "this expression is no state of the model", 0);
}

} // namespace detail

/// A model: variables, and the derivatives of the states.
class Model {
public:
    /// Variables by names, separated by spaces or commas.
    explicit Model(const std::string &states, const std::string &controls = "", const std::string &parameters = "",
                   std::string name = "model")
        : Model(Names{split(states), split(controls), split(parameters)}, std::move(name)) {}
    /// Variables by number.
    explicit Model(Sizes sizes, std::string name = "model")
        : Model(Names{unnamed(sizes.nx), unnamed(sizes.nu), unnamed(sizes.np)}, std::move(name)) {}

    const Exprs &x() const { return inputs_[0]; }
    const Exprs &u() const { return inputs_[1]; }
    const Exprs &p() const { return inputs_[2]; }
    const Expr &x(std::size_t i) const { return x().at(i); }
    const Expr &u(std::size_t i) const { return u().at(i); }
    const Expr &p(std::size_t i) const { return p().at(i); }
    const Expr &t() const { return inputs_[3].front(); }
    /// A number as an expression.
    Expr constant(double value) const { return Expr(detail::constant(graph_, value)); }

    /// The derivatives of all states, in order; discrete states, the last ones, may be left out.
    void derivatives(const Exprs &rhs) {
        if (rhs.size() != x().size() && rhs.size() + initial_.size() != x().size())
            throw Error(SWB_ERR_DIMENSION, "there must be one derivative for every state", 0);
        const auto ids = detail::ids(graph_, rhs);
        std::copy(ids.begin(), ids.end(), rhs_.begin());
        built_.reset();
    }
    /// The derivative of one state.
    void derivative(const Expr &state, const Operand &rhs) {
        for (std::size_t i = 0; i < x().size(); ++i)
            if (state.node().graph == graph_ && state.id() == x(i).id()) {
                rhs_[i] = detail::ids(graph_, {Expr(rhs.in(graph_))}).front();
                built_.reset();
                return;
            }
        throw Error(SWB_ERR_RANGE, "this expression is no state of the model", 0);
    }
    /// Discrete states and values of them.
    using Values = std::vector<std::pair<Expr, double>>;
    /// States and what they become.
    using Resets = std::vector<std::pair<Expr, Expr>>;

    /// Adds a discrete state, the last one, which only transitions change; documents keep the value it begins with. References
    /// to states, as x(0) returns them, end here: copy them.
    Expr discrete(const std::string &name = "", double initial = 0) {
        const int64_t n = length(0);
        int64_t id = -1;
        detail::check(swb_expr_inputs(graph_.get(), SWB_INPUT_X, n, &id, 1));
        inputs_[0].push_back(Expr(detail::Node{graph_, id}));
        names_[0].push_back(name);
        rhs_.push_back(detail::constant(graph_, 0.0).id);
        initial_.push_back(initial);
        value_names_.emplace_back();
        built_.reset();
        return inputs_[0].back();
    }
    /// Number of discrete states.
    std::size_t discrete_count() const noexcept { return initial_.size(); }
    /// Names the values 0, 1, ... of a discrete state, from 0 in the order they were added: reports and documents keep them. A
    /// ModelAutomaton does so itself.
    void value_names(std::size_t discrete, const std::vector<std::string> &names) {
        value_names_.at(discrete) = names;
        built_.reset();
    }
    /// A jump of the state where a comparison, or several joined by &, | and !, becomes true while the discrete states in `when` have
    /// these values: states become what `reset` says, discrete states what `to` says. Returns its number. See swb_system_add_transition.
    int64_t transition(const Cond &guard, const Values &when, const Resets &reset, const Values &to = {}) {
        return event("", SWB_EFFECT_JUMP, SWB_TRIGGER_LEVEL, guard, when, reset, to);
    }
    /// Ends runs where a condition becomes true, while the discrete states in `when` have these values. Returns its number.
    int64_t stop_at(const Cond &guard, const std::string &name = "", const Values &when = {}) {
        return event(name, SWB_EFFECT_STOP, SWB_TRIGGER_EDGE, guard, when, {}, {});
    }
    /// Notes where a condition becomes true; no step ends for that. Returns its number.
    int64_t note(const Cond &guard, const std::string &name = "", const Values &when = {}) {
        return event(name, SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, guard, when, {}, {});
    }
    /// A transition with a name, an effect and a trigger. Returns its number. See swb_model_add_event.
    int64_t event(const std::string &name, swb_effect effect, swb_trigger trigger, const Cond &guard, const Values &when,
                  const Resets &reset, const Values &to = {}) {
        Jump j;
        j.name = name, j.effect = effect, j.trigger = trigger;
        j.guard = detail::guard_of(graph_, guard);
        for (const auto &d : when)
            j.from.first.push_back(place(d.first)), j.from.second.push_back(d.second);
        for (const auto &r : reset)
            j.reset.first.push_back(place(r.first)), j.reset.second.push_back(detail::ids(graph_, {r.second}).front());
        for (const auto &d : to)
            j.to.first.push_back(place(d.first)), j.to.second.push_back(d.second);
        jumps_.push_back(std::move(j));
        built_.reset();
        return static_cast<int64_t>(jumps_.size()) - 1;
    }
    /// A control, from 0, chooses among values, each held for the time `dwell` at least. See swb_system_add_choice.
    void choice(int64_t control, const std::vector<double> &values, double dwell = 0) {
        choices_.push_back({control, dwell, values});
        built_.reset();
    }
    /// A discrete value that becomes 1 where `value` exceeds `on` and 0 where it falls below `off`, which is smaller. For a
    /// heater, which goes on below a threshold, negate all three.
    Expr hysteresis(const Expr &value, const Operand &on, const Operand &off, double initial = 0, const std::string &name = "") {
        const Expr high(on.in(graph_)), low(off.in(graph_)), w = discrete(name, initial);
        transition(value > high, {{w, 0.0}}, {}, {{w, 1.0}});
        transition(value < low, {{w, 1.0}}, {}, {{w, 0.0}});
        return w;
    }
    /// A point where everything should be defined; the report says what is not.
    void try_at(View x, View u = {}, View p = {}, double t = 0) {
        const auto numbers = [](View v, std::size_t n, const char *what) {
            if (v.size() == 0)
                return Vector(n);
            if (v.size() != n)
                throw Error(SWB_ERR_DIMENSION, std::string("the trial point has another number of ") + what, 0);
            return Vector(v.begin(), v.end());
        };
        trial_ = {numbers(x, inputs_[0].size(), "states"), numbers(u, inputs_[1].size(), "controls"),
                  numbers(p, inputs_[2].size(), "parameters")};
        trial_time_ = t;
        has_trial_ = true;
        built_.reset();
    }

    System system() const {
        swb_system *s = nullptr;
        detail::check(swb_model_system(built(), &s));
        return System(s);
    }
    /// A function of the variables of the model with exact derivatives: for costs and constraints.
    Function function(const char *name, const Exprs &outputs) const {
        const auto ids = detail::ids(graph_, outputs);
        swb_function *f = nullptr;
        detail::check(swb_expr_function(graph_.get(), name, length(0), length(1), length(2), ids.data(),
                                        detail::length(ids), &f));
        return Function(f);
    }
    Counts counts() const {
        Counts c;
        detail::check(swb_model_counts(built(), &c.subsystems, &c.switching_functions, &c.regions, &c.algebraic, &c.pairs));
        return c;
    }
    /// What the model consists of and costs, what was dropped and why, what looks wrong.
    std::string report(bool json = false) const {
        return text([json](const swb_model *m, char *b, int64_t n, int64_t *needed) {
            return swb_model_report(m, json ? 1 : 0, b, n, needed);
        });
    }
    /// C code of all functions with their derivatives.
    std::string c_code() const { return text(swb_model_write_c); }
    /// The model as a document.
    std::string to_json() const { return text(swb_model_to_json); }
    /// The system of a model in a document; functions that it calls are supplied, and found by name.
    static System system_from_json(const std::string &document, const std::vector<const Function *> &functions = {}) {
        std::vector<const swb_function *> handles;
        for (const Function *f : functions)
            handles.push_back(f->get());
        const detail::Graph graph = detail::new_graph();
        swb_model *m = nullptr;
        detail::check(swb_model_from_json(graph.get(), document.c_str(), handles.data(),
                                          static_cast<int64_t>(handles.size()), nullptr, 0, &m));
        const detail::Owner<swb_model, swb_model_free> owner(m);
        swb_system *s = nullptr;
        detail::check(swb_model_system(m, &s));
        return System(s);
    }

private:
    using Names = std::array<std::vector<std::string>, 3>;

    Model(Names names, std::string name) : graph_(detail::new_graph()), name_(std::move(name)), names_(std::move(names)) {
        const std::array<swb_input, 4> blocks{SWB_INPUT_X, SWB_INPUT_U, SWB_INPUT_P, SWB_INPUT_T};
        for (std::size_t k = 0; k < blocks.size(); ++k) {
            std::vector<int64_t> ids(k < names_.size() ? names_[k].size() : 1);
            detail::check(swb_expr_inputs(graph_.get(), blocks[k], 0, ids.data(), detail::length(ids)));
            inputs_[k] = detail::exprs(graph_, ids);
        }
        rhs_.assign(x().size(), -1);
    }
    static std::vector<std::string> split(std::string text) {
        for (char &c : text)
            c = c == ',' ? ' ' : c;
        std::istringstream words(text);
        std::vector<std::string> out;
        for (std::string word; words >> word;)
            out.push_back(word);
        return out;
    }
    static std::vector<std::string> unnamed(int64_t n) {
        if (n < 0)
            throw Error(SWB_ERR_DIMENSION, "a size is negative", 0);
        return std::vector<std::string>(static_cast<std::size_t>(n));
    }
    int64_t length(std::size_t k) const { return static_cast<int64_t>(inputs_[k].size()); }

    const swb_model *built() const {
        if (!built_) {
            std::string names;
            for (const auto &group : names_)
                for (const std::string &name : group)
                    names += name + "\n";
            for (std::size_t i = 0; i < rhs_.size(); ++i)
                if (rhs_[i] < 0)
                    throw Error(SWB_ERR_STATE, "state " + std::to_string(i) + " has no derivative; set it to 0 if it is constant", 0);
            const swb_point at{trial_time_, trial_[0].data(), trial_[1].data(), trial_[2].data()};
            swb_model *m = nullptr;
            detail::check(swb_model_create(graph_.get(), name_.c_str(), length(0), length(1), length(2), rhs_.data(),
                                           names.c_str(), has_trial_ ? &at : nullptr, &m));
            detail::Owner<swb_model, swb_model_free> owner(m);
            detail::check(swb_model_set_discrete(m, initial_.data(), detail::length(initial_)));
            for (std::size_t k = 0; k < value_names_.size(); ++k) {
                std::string all;
                for (const std::string &name : value_names_[k])
                    all += (all.empty() ? "" : "\n") + name;
                detail::check(swb_model_set_value_names(m, static_cast<int64_t>(k), all.c_str()));
            }
            for (const Jump &j : jumps_)
                detail::check(swb_model_add_event(
                    m, graph_.get(), j.name.c_str(), j.effect, j.trigger, j.guard, SWB_DIRECTION_RISING, j.from.first.data(), detail::length(j.from.first),
                    j.from.second.data(), detail::length(j.from.second), j.reset.first.data(), detail::length(j.reset.first),
                    j.reset.second.data(), detail::length(j.reset.second), j.to.first.data(), detail::length(j.to.first),
                    j.to.second.data(), detail::length(j.to.second), nullptr));
            for (const Choice &c : choices_)
                detail::check(swb_model_add_choice(m, c.control, c.values.data(), static_cast<int64_t>(c.values.size()), c.dwell, nullptr));
            built_ = std::move(owner);
        }
        return built_.get();
    }
    template <class Call>
    std::string text(Call call) const {
        const swb_model *m = built();
        return detail::text([&](char *b, int64_t n, int64_t *needed) { return call(m, b, n, needed); });
    }

    /// A control that chooses.
    struct Choice {
        int64_t control;
        double dwell;
        std::vector<double> values;
    };
    /// A transition: places of states with values or expressions.
    struct Jump {
        std::string name;
        swb_effect effect = SWB_EFFECT_JUMP;
        swb_trigger trigger = SWB_TRIGGER_LEVEL;
        int64_t guard = -1;
        std::pair<std::vector<int64_t>, Vector> from, to;
        std::pair<std::vector<int64_t>, std::vector<int64_t>> reset;
    };
    int64_t place(const Expr &state) const { return detail::place_of(graph_, x(), state); }

    detail::Graph graph_;
    std::string name_;
    Names names_;
    std::array<Exprs, 4> inputs_;
    std::vector<int64_t> rhs_;
    Vector initial_;
    std::vector<std::vector<std::string>> value_names_;
    std::vector<Jump> jumps_;
    std::vector<Choice> choices_;
    std::array<Vector, 3> trial_;
    double trial_time_ = 0;
    bool has_trial_ = false;
    mutable detail::Owner<swb_model, swb_model_free> built_;
};

/// A discrete state of a model with named values, 0, 1, ..., and edges between them. It belongs to a model that outlives it.
class ModelAutomaton {
public:
    /// States by names, separated by spaces; it begins in the first.
    ModelAutomaton(Model &model, const std::string &states, const std::string &name = "")
        : model_(&model), state_(model.discrete(name)) {
        std::istringstream words(states);
        for (std::string word; words >> word;)
            names_.push_back(word);
        model.value_names(model.discrete_count() - 1, names_);
    }
    /// The discrete state.
    const Expr &state() const noexcept { return state_; }
    /// The value of a state; Error if there is none of this name.
    double operator[](const std::string &name) const {
        for (std::size_t i = 0; i < names_.size(); ++i)
            if (names_[i] == name)
                return static_cast<double>(i);
        throw Error(SWB_ERR_RANGE, "the automaton has no state '" + name + "'", 0);
    }
    /// The name of a value, as Run::discrete has them; Error if there is none.
    const std::string &name(double value) const {
        for (std::size_t i = 0; i < names_.size(); ++i)
            if (value == static_cast<double>(i))
                return names_[i];
        throw Error(SWB_ERR_RANGE, "the automaton has no state " + std::to_string(value), 0);
    }
    /// An edge that is passed where a comparison becomes true, or at once where it is true when the source begins; `given` are
    /// discrete states of others and the values they must have. Returns the number of its transition.
    int64_t edge(const std::string &source, const std::string &target, const Cond &when, const Model::Resets &reset = {},
                 Model::Values given = {}) {
        given.emplace_back(state_, (*this)[source]);
        return model_->transition(when, given, reset, {{state_, (*this)[target]}});
    }
    /// An expression with a value for each state, in their order: a table of steps between the states, which is nothing that
    /// switches, and whose derivative is zero.
    Expr choose(const Vector &values) const {
        if (values.size() != names_.size() || values.size() < 2)
            throw Error(SWB_ERR_DIMENSION, "there must be one value for every state of the automaton", 0);
        Vector breaks;
        for (std::size_t i = 1; i < values.size(); ++i)
            breaks.push_back(static_cast<double>(i) - 0.5);
        return table(state_, breaks, values, SWB_TABLE_STEPS);
    }
    /// An expression that is 1 in a state and 0 in all others.
    Expr is_in(const std::string &name) const {
        Vector values(names_.size());
        values[static_cast<std::size_t>((*this)[name])] = 1.0;
        return choose(values);
    }

private:
    Model *model_;
    Expr state_;
    std::vector<std::string> names_;
};

// --- scenes ----------------------------------------------------------------------------------------

namespace detail {

/// What scenes and projected systems share.
class ContactSystem {
public:
    const Expr &u(std::size_t i) const { return u_.at(i); }
    const Expr &p(std::size_t i) const { return p_.at(i); }
    const Expr &t() const { return t_.front(); }
    /// A number as an expression.
    Expr constant(double value) const { return Expr(detail::constant(graph_, value)); }
    /// The system, for event-driven simulation.
    System system() {
        check(swb_scene_build(scene_.get(), graph_.get()));
        swb_system *s = nullptr;
        check(swb_scene_system(scene_.get(), &s));
        return System(s);
    }
    /// What it consists of, what each contact costs, which were left out and why; as text or as JSON.
    std::string report(bool json = false) {
        check(swb_scene_build(scene_.get(), graph_.get()));
        return text([&](char *b, int64_t n, int64_t *needed) { return swb_scene_report(scene_.get(), json ? 1 : 0, b, n, needed); });
    }
    /// It as a document.
    std::string to_json() const {
        return text([&](char *b, int64_t n, int64_t *needed) { return swb_scene_to_json(scene_.get(), graph_.get(), b, n, needed); });
    }
    /// The system of a scene or a projected system in a document; functions that it calls are supplied, and found by name.
    static System system_from_json(const std::string &document, const std::vector<const Function *> &functions = {}) {
        std::vector<const swb_function *> handles;
        for (const Function *f : functions)
            handles.push_back(f->get());
        const Graph graph = new_graph();
        swb_scene *made = nullptr;
        check(swb_scene_from_json(graph.get(), document.c_str(), handles.data(), static_cast<int64_t>(handles.size()), nullptr, 0,
                                  &made));
        const Owner<swb_scene, swb_scene_free> owner(made);
        check(swb_scene_build(made, graph.get()));
        swb_system *s = nullptr;
        check(swb_scene_system(made, &s));
        return System(s);
    }

protected:
    using Words = std::vector<std::string>;

    ContactSystem() : graph_(new_graph()) {}

    static Words words(std::string text) {
        for (char &c : text)
            c = c == ',' ? ' ' : c;
        std::istringstream in(text);
        Words out;
        for (std::string word; in >> word;)
            out.push_back(word);
        return out;
    }
    static std::string joined(std::initializer_list<const Words *> groups) {
        std::string out;
        for (const Words *group : groups)
            for (const auto &n : *group)
                out += n + "\n";
        return out;
    }
    static int64_t size(const Words &w) { return static_cast<int64_t>(w.size()); }
    /// Takes the new object and makes the variables of `nx` states, and of these controls and parameters.
    Exprs begin(swb_scene *s, std::size_t nx, const Words &us, const Words &ps) {
        scene_ = Owner<swb_scene, swb_scene_free>(s);
        u_ = inputs(SWB_INPUT_U, us.size());
        p_ = inputs(SWB_INPUT_P, ps.size());
        t_ = inputs(SWB_INPUT_T, 1);
        return inputs(SWB_INPUT_X, nx);
    }
    template <class F>
    void set(F f, const Exprs &values) {
        const auto given = ids(graph_, values);
        check(f(scene_.get(), graph_.get(), given.data(), length(given)));
    }
    int64_t add(const std::string &name, const Expr &gap, const Exprs &tangents, int64_t friction, int64_t restitution) {
        const auto along = ids(graph_, tangents);
        int64_t k = 0;
        check(swb_scene_add_contact(scene_.get(), graph_.get(), name.c_str(), ids(graph_, {gap}).front(), along.data(),
                                    length(along), friction, restitution, &k));
        return k;
    }

    Graph graph_;
    Owner<swb_scene, swb_scene_free> scene_{nullptr};

private:
    Exprs inputs(swb_input block, std::size_t n) const {
        std::vector<int64_t> out(n);
        check(swb_expr_inputs(graph_.get(), block, 0, out.data(), length(out)));
        return exprs(graph_, out);
    }

    Exprs u_, p_, t_;
};

} // namespace detail

/// A mechanical system with contacts: coordinates q, velocities v (one for each coordinate, unless they are named), inertia,
/// forces, contacts. Its states are q, then v.
class Scene : public detail::ContactSystem {
public:
    /// Variables by names, separated by spaces or commas; `states` are states beside coordinates and velocities.
    explicit Scene(const std::string &q, const std::string &v = "", const std::string &controls = "",
                   const std::string &parameters = "", const std::string &name = "scene", const std::string &states = "") {
        const auto qs = words(q), vs = v.empty() ? rates_of(qs) : words(v), us = words(controls), ps = words(parameters);
        const auto zs = words(states);
        swb_scene *s = nullptr;
        detail::check(swb_scene_create_with_states(name.c_str(), size(qs), size(vs), size(zs), size(us), size(ps),
                                                   joined({&qs, &vs, &zs, &us, &ps}).c_str(), &s));
        const Exprs x = begin(s, qs.size() + vs.size() + zs.size(), us, ps);
        all_ = x;
        const auto velocities = x.begin() + static_cast<std::ptrdiff_t>(qs.size());
        const auto behind = velocities + static_cast<std::ptrdiff_t>(vs.size());
        q_.assign(x.begin(), velocities);
        v_.assign(velocities, behind);
        states_.assign(behind, x.end());
    }

    const Exprs &q() const { return q_; }
    const Exprs &v() const { return v_; }
    const Expr &q(std::size_t i) const { return q_.at(i); }
    const Expr &v(std::size_t i) const { return v_.at(i); }
    /// State `i` beside coordinates and velocities.
    const Expr &state(std::size_t i) const { return states_.at(i); }

    /// The rates of the states beside coordinates and velocities.
    void state_rates(const Exprs &values) { set(swb_scene_set_state_rates, values); }
    /// The rates of the coordinates, linear in the velocities.
    void rates(const Exprs &values) { set(swb_scene_set_rates, values); }
    /// The inertia matrix, symmetric: its rows one after the other.
    void inertia(const Exprs &entries) { set(swb_scene_set_inertia, entries); }
    /// The forces, one for every velocity.
    void force(const Exprs &values) { set(swb_scene_set_force, values); }
    /// Adds a contact and returns its number; see swb_scene_add_contact.
    int64_t contact(const std::string &name, const Expr &gap, const Exprs &tangents = {}, const Operand &friction = 0.0,
                    const Operand &restitution = 0.0) {
        return add(name, gap, tangents, detail::ids(graph_, {Expr(friction.in(graph_))}).front(),
                   detail::ids(graph_, {Expr(restitution.in(graph_))}).front());
    }
    /// The coefficient of friction by which a contact sticks, where it is larger; see swb_scene_set_stiction.
    void stiction(int64_t contact, const Operand &friction) {
        detail::check(swb_scene_set_stiction(scene_.get(), graph_.get(), contact,
                                             detail::ids(graph_, {Expr(friction.in(graph_))}).front()));
    }
    /// Adds dry friction at a joint with a bound of its force and returns its number; see swb_scene_add_friction.
    int64_t friction(const std::string &name, const Expr &sliding, const Operand &bound) {
        return joint(name, sliding, bound, -1);
    }
    /// The same with a larger bound for sticking.
    int64_t friction(const std::string &name, const Expr &sliding, const Operand &bound, const Operand &stiction) {
        return joint(name, sliding, bound, detail::ids(graph_, {Expr(stiction.in(graph_))}).front());
    }
    /// Adds a constraint, an expression that is zero, and returns its number; see swb_scene_add_constraint.
    int64_t constraint(const std::string &name, const Expr &zero) {
        int64_t k = 0;
        detail::check(swb_scene_add_constraint(scene_.get(), graph_.get(), name.c_str(),
                                               detail::ids(graph_, {zero}).front(), &k));
        return k;
    }
    /// Adds a discrete state, the last one, which only transitions change; see swb_scene_add_discrete.
    Expr discrete(const std::string &name = "", double initial = 0) {
        int64_t k = 0, id = -1;
        detail::check(swb_scene_add_discrete(scene_.get(), name.c_str(), initial, &k));
        detail::check(swb_expr_inputs(graph_.get(), SWB_INPUT_X, k, &id, 1));
        all_.push_back(Expr(detail::Node{graph_, id}));
        return all_.back();
    }
    /// A jump of the state, as Model::transition. Returns its number. See swb_scene_add_event.
    int64_t transition(const Cond &guard, const Model::Values &when, const Model::Resets &reset, const Model::Values &to = {}) {
        return event("", SWB_EFFECT_JUMP, SWB_TRIGGER_LEVEL, guard, when, reset, to);
    }
    /// A transition with a name, an effect and a trigger. Returns its number. See swb_scene_add_event.
    int64_t event(const std::string &name, swb_effect effect, swb_trigger trigger, const Cond &guard, const Model::Values &when,
                  const Model::Resets &reset, const Model::Values &to = {}) {
        std::vector<int64_t> from_states, reset_states, resets, to_states;
        Vector from_values, to_values;
        for (const auto &d : when)
            from_states.push_back(detail::place_of(graph_, all_, d.first)), from_values.push_back(d.second);
        for (const auto &r : reset)
            reset_states.push_back(detail::place_of(graph_, all_, r.first)), resets.push_back(detail::ids(graph_, {r.second}).front());
        for (const auto &d : to)
            to_states.push_back(detail::place_of(graph_, all_, d.first)), to_values.push_back(d.second);
        int64_t k = 0;
        detail::check(swb_scene_add_event(
            scene_.get(), graph_.get(), name.c_str(), effect, trigger, detail::guard_of(graph_, guard), SWB_DIRECTION_RISING,
            from_states.data(), detail::length(from_states), from_values.data(), detail::length(from_values), reset_states.data(),
            detail::length(reset_states), resets.data(), detail::length(resets), to_states.data(), detail::length(to_states),
            to_values.data(), detail::length(to_values), &k));
        return k;
    }
    /// A clock: a transition at the times offset, offset + period, and so on. Returns the number of times it has struck, a new discrete state. See
    /// swb_scene_add_clock.
    Expr every(double period, const Model::Resets &reset, const Model::Values &to = {}, double offset = 0, const std::string &name = "") {
        const Expr count = discrete(name);
        std::vector<int64_t> reset_states, resets, to_states;
        Vector to_values;
        for (const auto &r : reset)
            reset_states.push_back(detail::place_of(graph_, all_, r.first)), resets.push_back(detail::ids(graph_, {r.second}).front());
        for (const auto &d : to)
            to_states.push_back(detail::place_of(graph_, all_, d.first)), to_values.push_back(d.second);
        detail::check(swb_scene_add_clock(scene_.get(), graph_.get(), period, offset, detail::place_of(graph_, all_, count),
                                          reset_states.data(), detail::length(reset_states), resets.data(), detail::length(resets),
                                          to_states.data(), detail::length(to_states), to_values.data(), detail::length(to_values), nullptr));
        return count;
    }
    /// Pulse-width modulation: 1 from the times offset, offset + period, and so on, until a part `duty` of the period is over, then 0. A new
    /// discrete state; another one counts the periods. See swb_scene_add_pwm.
    Expr pwm(const Expr &duty, double period, double offset = 0, const std::string &name = "") {
        const Expr pulse = discrete(name), count = discrete();
        detail::check(swb_scene_add_pwm(scene_.get(), graph_.get(), detail::ids(graph_, {duty}).front(), period, offset,
                                        detail::place_of(graph_, all_, pulse), detail::place_of(graph_, all_, count), nullptr));
        return pulse;
    }
    /// States that a coordinate stays between bounds, which may be infinite; see swb_scene_set_bounds.
    void bounds(int64_t coordinate, double low, double high) {
        detail::check(swb_scene_set_bounds(scene_.get(), coordinate, low, high));
    }
    /// A scene in numerical time: its system, where things are in it, what became of the contacts.
    struct Frozen {
        System system;
        swb_freeze_layout layout;
        std::string report;
    };
    /// Default options of time-freezing.
    static swb_freeze_options freeze_options() {
        swb_freeze_options o{};
        detail::check(swb_freeze_options_init(&o, sizeof o));
        return o;
    }
    /// The scene as a piecewise smooth system in numerical time (time-freezing); `costs` become states that are integrals over
    /// physical time, `at` is the state where strengths are recommended. See swb_scene_freeze.
    Frozen freeze(const swb_freeze_options &options = freeze_options(), const Exprs &costs = {}, View at = {}) {
        const auto list = detail::ids(graph_, costs);
        swb_model *made = nullptr;
        swb_freeze_layout layout{};
        detail::check(swb_scene_freeze(scene_.get(), graph_.get(), &options, at.data(), at.length(), list.data(),
                                       static_cast<int64_t>(list.size()), &layout, sizeof layout, &made));
        const std::unique_ptr<swb_model, void (*)(swb_model *)> owner(made, swb_model_free);
        swb_system *s = nullptr;
        detail::check(swb_model_system(made, &s));
        System system(s);
        return {std::move(system), layout, detail::text([&](char *b, int64_t n, int64_t *needed) {
                    return swb_scene_freeze_report(scene_.get(), b, n, needed);
                })};
    }
    /// What happens where several contacts close at once.
    void impact_law(swb_impact_law law) { detail::check(swb_scene_set_impact_law(scene_.get(), law)); }

private:
    int64_t joint(const std::string &name, const Expr &sliding, const Operand &bound, int64_t stiction) {
        int64_t k = 0;
        detail::check(swb_scene_add_friction(scene_.get(), graph_.get(), name.c_str(), detail::ids(graph_, {sliding}).front(),
                                             detail::ids(graph_, {Expr(bound.in(graph_))}).front(), stiction, &k));
        return k;
    }
    static Words rates_of(const Words &q) {
        Words out;
        for (const auto &n : q)
            out.push_back("v_" + n);
        return out;
    }

    Exprs q_, v_, states_, all_;
};

/// A projected system, or first-order sweeping process: x' = f plus the sum of gradient(c) times multiplier over all constraints
/// c >= 0; multipliers are not negative, and zero where their constraint is positive. Of a Run, contact_forces has the
/// multipliers, and contact_modes is SWB_CONTACT_MODE_CLOSED where a constraint is active.
class Projected : public detail::ContactSystem {
public:
    /// Variables by names, separated by spaces or commas.
    explicit Projected(const std::string &x, const std::string &controls = "", const std::string &parameters = "",
                       const std::string &name = "projected") {
        const auto xs = words(x), us = words(controls), ps = words(parameters);
        swb_scene *s = nullptr;
        detail::check(swb_scene_create_projected(name.c_str(), size(xs), size(us), size(ps),
                                                 joined({&xs, &us, &ps}).c_str(), &s));
        x_ = begin(s, xs.size(), us, ps);
    }

    const Exprs &x() const { return x_; }
    const Expr &x(std::size_t i) const { return x_.at(i); }

    /// The derivatives of the states without constraints.
    void derivatives(const Exprs &f) { set(swb_scene_set_force, f); }
    /// Adds a constraint c >= 0, an expression of states, parameters and time, and returns its number.
    int64_t constraint(const std::string &name, const Expr &c) { return add(name, c, {}, -1, -1); }

private:
    Exprs x_;
};

} // namespace swb

#endif

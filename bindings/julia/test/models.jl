# Models of the tests.

const OMEGA = 2pi
const OSCILLATOR_X0 = [exp(-1.0), 0.0]
const OSCILLATOR_T = pi / 2
const OSCILLATOR_XT = [-1.5974603774506984, -0.7614936206060108]
const A_IN, A_OUT = [1.0 OMEGA; -OMEGA 1.0], [1.0 -OMEGA; OMEGA 1.0]
const TUTORIAL_COST = 1.5237727753749573 # min over x(0) of the integral of x^2 plus (x(2) - 5/3)^2, x' in 2 - sign x
const TUTORIAL_X0 = (9 - sqrt(417)) / 8

"x' = A_IN x inside the unit circle, A_OUT x outside; the switch is at t = 1."
function oscillator()
    s = System(2)
    add_subsystem!(s; modes = (x -> A_IN * x, x -> A_OUT * x), psi = x -> x'x - 1, signs = [-1, 1])
    return s
end

function oscillator_model()
    m = Model(states = (:x, :y))
    derivatives!(m, when(m.x'm.x > 1, A_OUT * m.x, A_IN * m.x))
    return m
end

"A state with one slope for x < 0 and one for x > 0."
function sides(left, right; f0 = nothing)
    s = System(1; f0 = f0)
    add_subsystem!(s; modes = ([left], [right]), psi = x -> x[1], signs = [-1, 1])
    return s
end

"A block on a belt with friction that falls with speed (L. Dieci, L. Lopez 2009, example 6.1)."
function stick_slip()
    m = Model(states = (:q, :v))
    q, v = m.x
    derivatives!(m, [v, -q + when(v > 0.2, -1 / (0.8 + v), 1 / (1.2 - v))])
    return m
end

function tutorial(n_stages = 1; keywords...)
    return Ocp(sides(3.0, 1.0), 2.0, n_stages; lagrange = x -> x[1]^2, mayer = x -> (x[1] - 5 / 3)^2,
               initial_bounds = (-5.0, 5.0), n_fe = 4, keywords...)
end

"The cheapest way along two curves that catch the state; examples/python/sliding_ocp.py. The cost is 9.14960."
function sliding_ocp()
    m = Model(states = (:q1, :q2, :v1, :v2), controls = (:u1, :u2))
    q1, q2, v1, v2 = m.x
    derivatives!(m, [v1 - sign(q1 + 0.15q2^2), v2 - sign(q2 - 0.05q1^3), m.u...])
    goal = [-pi / 6, -pi / 4]
    ocp = Ocp(m, 4.0, 6; lagrange = m.u'm.u + v1^2 + v2^2, initial_state = [2pi / 3, pi / 3, 0, 0],
              state_bounds = ([-Inf, -Inf, -2, -2], [Inf, Inf, 2, 2]), control_bounds = (-10, 10), n_s = 2, n_fe = 6)
    add_terminal!(ocp, [q1, q2], goal, goal)
    return ocp
end

"What Python computed with the same library, or nothing."
function python_reference()
    path = get(ENV, "SWITCHBACK_REFERENCE", "")
    return isempty(path) ? nothing : Swb.parse_json(read(path, String))
end

reference_solution(name) = Swb.parse_json(read(joinpath(ROOT, "tests", "data", "reference", "$name.json"), String))
scene(name) = Swb.parse_json(read(joinpath(ROOT, "tests", "data", "reference", "scenes", "$name.json"), String))
scene_numbers(v) = v isa AbstractVector ? Float64[parse(Float64, string(e)) for e in v] : parse(Float64, string(v))
only_(v) = (length(v) == 1 || error("not one but $(length(v))"); v[1])
matrix(rows) = permutedims(reduce(hcat, [Float64.(r) for r in rows]))

"The exception that a call throws."
function thrown(f)
    try
        f()
    catch e
        return e
    end
    return nothing
end
refused(f, status, words...) = (e = thrown(f); e isa ArgumentMistake && e.status === status && all(w -> occursin(w, e.msg), words))

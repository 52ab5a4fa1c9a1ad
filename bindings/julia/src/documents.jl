# Documents in JSON: for bug reports, replay, and to pass models on.

"""
    to_json(model)
    to_json(scene)
    to_json(ocp)
    to_json(simulator, duration, n_steps)
    to_json(settings)

An object as a document in JSON. Functions that are not made of expressions are named only; `from_json` needs them again.
"""
to_json(m::Model) = (made = built(m); text(Lib.swb_model_to_json, made))
to_json(s::AnyScene) = text(Lib.swb_scene_to_json, s, s.graph)
to_json(o::Ocp) = text(Lib.swb_ocp_to_json, o)
to_json(s::Simulator, duration, n_steps) =
    (span = number(duration, "duration"); k = integer(n_steps, "n_steps");
     text(Lib.swb_simulator_to_json, s, span, k))

"Call the library with a text and functions; they stay alive meanwhile."
function with_document(call, document, functions)
    said = plain(document, "document")
    functions isa Union{Tuple,AbstractVector} && all(f -> f isa ModelFunction, functions) ||
        mistake(:range, "functions must be a list of ModelFunctions, not $(repr(functions))")
    list = collect(ModelFunction, functions)
    GC.@preserve list begin
        return call(said, [address(f) for f in list], length(list))
    end
end

"""
    from_json(Model, document; functions = [])
    from_json(Ocp, document; functions = [])
    from_json(Simulator, document; functions = [])

The object of a document. Functions that it names are supplied as `ModelFunction`s and found by their names. A `Simulator`
comes with the duration and the number of steps of the run: `simulator, duration, n_steps = from_json(...)`.
"""
function from_json(::Type{Ocp}, document; functions = ())
    o = with_document(document, functions) do said, list, n
        address_ = created(AnyOcp, Lib.swb_ocp_from_json, said, list, n)
        empty_ = (String[], String[], String[])
        Ocp(address_, 0, 0, 0, 0, 0, NaN, 0.0, any(f -> f.serial, functions), nothing, empty_, Monitor(nothing), Monitor(nothing))
    end
    watched(o, nothing, nothing)
    o.nx, o.nu, o.np, o.n_stages = integers(4, Lib.swb_ocp_sizes, o)
    o.names = (fill("", o.nx), fill("", o.nu), fill("", o.np))
    data = parse_json(String(document))["ocp"]
    o.horizon, o.initial_time = Float64(data["horizon"]), Float64(data["t0"])
    return o
end

function from_json(::Type{Simulator}, document; functions = ())
    span, steps = Ref(0.0), Ref(Int64(0))
    s = with_document(document, functions) do said, list, n
        address_ = created(AnySimulator, Lib.swb_simulator_from_json, said, list, n, span, steps)
        Simulator(address_, 0, 0, 0, 0, (String[], String[], String[]), Monitor(nothing), Monitor(nothing))
    end
    watched(s, nothing, nothing)
    s.nx, s.nu, s.np = integers(3, Lib.swb_simulator_sizes, s)
    s.names = (fill("", s.nx), fill("", s.nu), fill("", s.np))
    return s, span[], Int(steps[])
end

function from_json(::Type{Model}, document; functions = ())
    graph = Graph()
    rhs = Vector{Int64}(undef, 0)
    make(rhs) = with_document(document, functions) do said, list, n
        created(AnyBuilt, place -> Lib.swb_model_from_json(graph, said, list, n, isempty(rhs) ? C_NULL : rhs, length(rhs), place))
    end
    first_ = owned(Built(make(rhs), 0)) # refuses what is no document
    n = integers(3, Lib.swb_model_sizes, first_)
    resize!(rhs, n[1])
    made = owned(Built(make(rhs), 0))
    saved = parse_json(String(document))["model"]
    given = get(saved, "names", nothing)
    block(name, k) = (found = given === nothing ? Any[] : get(given, name, Any[]); String[i <= length(found) ? found[i] : "" for i in 1:k])
    m = empty_model(graph, (block("states", n[1]), block("controls", n[2]), block("parameters", n[3])), saved["name"])
    graph.serial = any(f -> f.serial, functions)
    m.rhs = [in_graph(graph, id) for id in rhs]
    trial = get(saved, "trial", nothing)
    trial === nothing || try_at!(m, Float64.(trial["x"]); u = Float64.(trial["u"]), p = Float64.(trial["p"]), t = trial["t"])
    n_discrete, n_transitions = integers(2, Lib.swb_model_transition_counts, made)
    m.discrete = numbers(Float64, n_discrete, Lib.swb_model_get_discrete, made)
    for k in 1:n_discrete
        names = text(Lib.swb_model_get_value_names, made, k - 1)
        isempty(names) || (m.value_names[n[1]-n_discrete+k] = Symbol.(split(names, "\n")))
    end
    m.transitions = Any[read_transition(made, graph, k) for k in 0:n_transitions-1]
    m.choices = Any[(Int64(c["control"]), Float64.(c["values"]), Float64(get(c, "dwell", 0.0))) for c in get(saved, "choices", Any[])]
    m.built = made
    return m
end

# --- reading JSON: the library has checked the document already -----------------------------------------

"Objects as Dict, arrays as Vector, numbers as Float64."
function parse_json(s::String)
    v, _ = json_value(s, json_space(s, 1))
    return v
end

json_space(s, i) = something(findnext(c -> !(c in (' ', '\n', '\r', '\t')), s, i), lastindex(s) + 1)

function json_value(s, i)
    c = s[i]
    c == '{' && return json_members(s, i)
    c == '[' && return json_elements(s, i)
    c == '"' && return json_string(s, i)
    for (word, v) in (("true", true), ("false", false), ("null", nothing))
        startswith(SubString(s, i), word) && return v, i + length(word)
    end
    stop = something(findnext(c -> !(c in "+-.eE" || isdigit(c)), s, i), lastindex(s) + 1)
    return parse(Float64, SubString(s, i, prevind(s, stop))), stop
end

function json_members(s, i)
    out = Dict{String,Any}()
    i = json_space(s, i + 1)
    while s[i] != '}'
        key, i = json_string(s, i)
        v, i = json_value(s, json_space(s, json_space(s, i) + 1)) # behind the colon
        out[key] = v
        i = json_space(s, i)
        s[i] == ',' && (i = json_space(s, i + 1))
    end
    return out, i + 1
end

function json_elements(s, i)
    out = Any[]
    i = json_space(s, i + 1)
    while s[i] != ']'
        v, i = json_value(s, i)
        push!(out, v)
        i = json_space(s, i)
        s[i] == ',' && (i = json_space(s, i + 1))
    end
    return out, i + 1
end

function json_string(s, i)
    out = IOBuffer()
    i = nextind(s, i)
    while s[i] != '"'
        if s[i] != '\\'
            print(out, s[i])
        elseif (i = nextind(s, i); s[i] == 'u')
            code = parse(UInt32, SubString(s, i + 1, i + 4); base = 16)
            i += 4
            if 0xd800 <= code < 0xdc00 # the first half of a pair
                code = 0x10000 + ((code - 0xd800) << 10) + parse(UInt32, SubString(s, i + 3, i + 6); base = 16) - 0xdc00
                i += 6
            end
            print(out, Char(code))
        else
            print(out, get(Dict('n' => '\n', 't' => '\t', 'r' => '\r', 'b' => '\b', 'f' => '\f'), s[i], s[i]))
        end
        i = nextind(s, i)
    end
    return String(take!(out)), nextind(s, i)
end

# Options: one registry in the library, read and set by name.

"""
One option of the library: name, kind (`:int`, `:float`, `:enum`), what it does, symbol in the literature, default, range,
the values of an enumeration, and whether it is fixed once an object is built.
"""
struct Option
    name::Symbol
    kind::Symbol
    doc::String
    symbol::String
    default::Union{Int,Float64,Symbol}
    min::Float64
    max::Float64
    min_open::Bool
    max_open::Bool
    values::Vector{Symbol}
    setup_only::Bool
end

option_kind(i) = symbol(Lib.NAMES_swb_kind, value(Int32, Lib.swb_option_kind, i))

function option_values(i)
    names = Symbol[]
    while (name = Lib.swb_option_value_name(i, length(names))) != C_NULL
        push!(names, Symbol(unsafe_string(name)))
    end
    return names
end

function Option(i::Integer)
    kind = option_kind(i)
    low, high, low_open, high_open = Ref(0.0), Ref(0.0), Ref(Int32(0)), Ref(Int32(0))
    check(Lib.swb_option_range(i, low, high, low_open, high_open))
    values = kind === :enum ? option_values(i) : Symbol[]
    default = value(Float64, Lib.swb_option_default, i)
    start = kind === :enum ? values[Int(default)+1] : kind === :int ? Int(default) : default
    fixed = value(Int32, Lib.swb_option_setup_only, i) != 0
    string_of(pointer) = unsafe_string(pointer)
    return Option(Symbol(string_of(Lib.swb_option_name(i))), kind, string_of(Lib.swb_option_doc(i)),
                  string_of(Lib.swb_option_symbol(i)), start, low[], high[], low_open[] != 0, high_open[] != 0, values,
                  fixed)
end

"""
    options() -> Dict{Symbol,Option}

All options of the library. Every constructor takes them as keywords: `Ocp(m, 1.0, 10; n_s = 3, cross = :stage)`.
"""
options() = Dict(o.name => o for o in (Option(i) for i in 0:Lib.swb_option_count()-1))

function Base.show(io::IO, ::MIME"text/plain", o::Option)
    range = o.kind === :enum ? join(repr.(o.values), ", ") :
        string(o.min_open ? "(" : "[", o.min, ", ", o.max, o.max_open ? ")" : "]")
    print(io, o.name, " = ", repr(o.default), " in ", range, o.setup_only ? ", fixed when an object is built" : "",
          "\n  ", o.doc)
end

# names that users of other packages know
const SYNONYMS = Dict(:reltol => :rtol, :abstol => :atol, :maxiters => :max_steps, :method => :integration,
                      :dtmax => :h_max, :dt => :h_init)

# keywords of other packages whose work is done otherwise here
const ELSEWHERE = Dict(:saveat => "call the solution for the states at any times, sol(times);", :tstops => "use stop_times;",
                       :callback => "use on_step, and switching functions in the model;")

"The keywords of a constructor, besides the options of the library."
own_keywords(constructor::Type) =
    Symbol[k for m in methods(constructor) for k in Base.kwarg_decl(m) if !endswith(String(k), "...")]
own_keywords(list::Tuple) = collect(Symbol, list)

"""
The name of an option in the library, or an error with the nearest name: that of an option, or one of the keywords that the
caller has besides, a constructor's or a list.
"""
function option_name(key::Symbol, others = ())
    name = plain(get(SYNONYMS, key, key), "the name of an option")
    Lib.swb_option_find(name, Ref{Int64}()) == Lib.SWB_OK && return name
    other_way = get(ELSEWHERE, key, nothing)
    hint = other_way !== nothing ? ", $other_way" : nearest(key, [own_keywords(others); collect(keys(SYNONYMS)); option_names()])
    mistake(:option, "unknown option '$key'", isempty(hint) ? ", and none has a name like it; " : hint * " ", "options() lists them",
            others === () ? "" : ", the help of the function its other keywords")
end

"Set an option by the function for the type of the value; `set_int`, `set_double`, `set_string` take (name, value)."
function set_option(set_int, set_double, set_string, key::Symbol, v, others = ())
    name = option_name(key, others)
    if v isa Union{Symbol,AbstractString}
        check(set_string(name, plain(v, "option $key")))
    elseif v isa Integer # Bool too
        typemin(Int64) <= v <= typemax(Int64) ? check(set_int(name, v)) : check(set_double(name, Float64(v)))
    elseif v isa Real && !(v isa AbstractExpression)
        check(set_double(name, Float64(v)))
    else
        mistake(:option, "option $key must be a number or a Symbol, not $(repr(v))")
    end
end

"""
    Settings(; options...)

Values of all options: `s = Settings(n_s = 3, cross = :stage)`, `s.n_s`, `s.n_s = 4`. Constructors take them by
`settings = s`, and options as keywords on top.
"""
mutable struct Settings
    data::Base.RefValue{Lib.swb_settings}

    function Settings(; options...)
        data = Ref{Lib.swb_settings}()
        check(Lib.swb_settings_init(data, sizeof(Lib.swb_settings)))
        s = new(data)
        return isempty(options) ? s : update!(s, given(options))
    end
end

"""
Keywords that were given, by name. What works on them is compiled once, and not for every set of names: the first call with
another option would take half a second else.
"""
const Given = Dict{Symbol,Any}

function given(@nospecialize(keywords))
    keywords isa Given && return keywords
    out = Given()
    if keywords isa AbstractDict && !(keywords isa Iterators.Pairs)
        foreach(key -> out[Symbol(key)] = keywords[key], keys(keywords))
    else
        found = keywords isa NamedTuple ? keywords : values(keywords)
        foreach(key -> out[key] = getfield(found, key), fieldnames(typeof(found)))
    end
    return out
end

raw(s::Settings) = getfield(s, :data)

function update!(s::Settings, options::Given, others = ())
    for (key, v) in options
        set_option((n, w) -> Lib.swb_settings_set_int(raw(s), n, w), (n, w) -> Lib.swb_settings_set_double(raw(s), n, w),
                   (n, w) -> Lib.swb_settings_set_string(raw(s), n, w), key, v, others)
    end
    return s
end

Base.setproperty!(s::Settings, key::Symbol, v) = (update!(s, Given(key => v)); v)
Base.setindex!(s::Settings, v, key::Symbol) = (update!(s, Given(key => v)); s)
Base.getindex(s::Settings, key::Union{Symbol,AbstractString}) = getproperty(s, Symbol(key))
option_names() = [Symbol(unsafe_string(Lib.swb_option_name(i))) for i in 0:Lib.swb_option_count()-1]
Base.propertynames(::Settings) = Tuple(option_names())

function Base.getproperty(s::Settings, key::Symbol)
    name = option_name(key)
    i = value(Int64, Lib.swb_option_find, name)
    kind = option_kind(i)
    kind === :int && return Int(value(Int64, Lib.swb_settings_get_int, raw(s), name))
    kind === :float && return value(Float64, Lib.swb_settings_get_double, raw(s), name)
    return Symbol(text(Lib.swb_settings_get_string, raw(s), name))
end

function Base.copy(s::Settings)
    other = Settings()
    raw(other)[] = raw(s)[]
    return other
end

Base.:(==)(a::Settings, b::Settings) = all(a[name] == b[name] for name in propertynames(a))
Base.hash(s::Settings, h::UInt) = hash([s[name] for name in propertynames(s)], hash(:Settings, h))

"""
    validate(settings)

Check all options together, beyond the range of each, which is checked when it is set.
"""
validate(s::Settings) = check(Lib.swb_settings_validate(raw(s)))

to_json(s::Settings) = text(Lib.swb_settings_to_json, raw(s))

function Base.show(io::IO, s::Settings)
    default = Settings()
    changed = ["$name = $(repr(s[name]))" for name in propertynames(s) if s[name] != default[name]]
    print(io, "Settings(", join(changed, ", "), ")")
end

"A copy of what a constructor was given, with options by keyword on top; `others` are its other keywords."
function chosen_settings(@nospecialize(settings), @nospecialize(options), others)
    start = settings === nothing ? Settings() : settings isa Settings ? copy(settings) :
        settings isa Union{NamedTuple,AbstractDict} ? update!(Settings(), given(settings)) :
        mistake(:range, "settings must be Settings or a NamedTuple, not $(typeof(settings))")
    return update!(start, given(options), others)
end

# Exceptions: one type for each family of status codes.

"""
Why a call of the library could not do its work: `ArgumentMistake`, `UserError`, `NumericError`, `LibraryError`,
`InterruptedSolve` or `InternalError`. Fields: `status`, a Symbol such as `:dimension`, and `msg`.

How an algorithm ended is no exception but the `outcome` of its result.
"""
abstract type SwitchbackError <: Exception end

"""
An argument does not fit. `status` is `:null`, `:dimension` (a size or an index), `:range` (a value), `:state` (the call
does not fit the state of the object), `:unsupported` (the combination) or `:option` (unknown option, or a value of the
wrong type).
"""
struct ArgumentMistake <: SwitchbackError
    status::Symbol
    msg::String
end

"""
A function of the user failed. `status` is `:user` with the negative `code` it returned, or `:nonfinite`: it has no
finite value where one is needed. `cause` is the last `DomainError` it threw, or nothing.
"""
struct UserError <: SwitchbackError
    status::Symbol
    msg::String
    code::Int
    cause::Any
end

"The numerical method cannot go on and there is no usable result."
struct NumericError <: SwitchbackError
    status::Symbol
    msg::String
end

"A foreign library failed, or a resource such as memory is missing."
struct LibraryError <: SwitchbackError
    status::Symbol
    msg::String
end

"Interrupted; the object can be used again."
struct InterruptedSolve <: SwitchbackError
    status::Symbol
    msg::String
end

"A defect of the library; the object can only be closed."
struct InternalError <: SwitchbackError
    status::Symbol
    msg::String
end

function Base.showerror(io::IO, e::SwitchbackError)
    print(io, nameof(typeof(e)), " (", e.status, "): ", e.msg)
    if e isa UserError && e.cause !== nothing
        print(io, "\ncaused by ")
        showerror(io, e.cause)
    end
end

"The Symbol of a number of an enumeration; one that this package does not know keeps its number."
function symbol(names, number)
    for (name, value) in names
        value == number && return name
    end
    return Symbol("number_", number)
end

"The number of a Symbol of an enumeration, or an error that lists them."
function enum_number(names, value, what)
    for (name, number) in names
        name === Symbol(value) && return Int32(number)
    end
    known = join((repr(n) for (n, _) in names), ", ")
    throw(ArgumentMistake(:range, "$what must be one of $known, not $(repr(value))"))
end

# Functions of the C interface that messages of the library name, and what they are here.
const OWN_WORDS = (
    r"\bswb_(ocp|mpcc|multiphase)_solve\b" => "solve!",
    "swb_integrator_reinit" => "reinit!",
    "swb_model_from_json" => "from_json(Model, document)",
    "swb_simulator_from_json" => "from_json(Simulator, document)",
    "swb_ocp_from_json" => "from_json(Ocp, document)",
    r"\bthe swb_\w+ is in use" => "the object is in use",
    "its Jacobian pattern or swb_function_set_inputs" => "an argument named t",
)

"A message of the library with the names that things have in this package."
own_words(msg) = occursin("swb_", msg) ? foldl(replace, OWN_WORDS; init = msg) : msg

mistake(status::Symbol, parts...) = throw(ArgumentMistake(status, string(parts...)))

"The exception of a status code; families are those of the numbers, so a newer library is understood too."
function exception(status, msg, code, cause)
    name = symbol(Lib.NAMES_swb_status, status)
    name === :interrupted && return InterruptedSolve(name, msg)
    name === :internal && return InternalError(name, msg)
    -20 < status < 0 && return ArgumentMistake(name, msg)
    -30 < status <= -20 && return UserError(name, msg, code, cause)
    -50 < status <= -30 && return NumericError(name, msg)
    return LibraryError(name, msg)
end

# Calls into the library: objects and their lifetime, exceptions out of callbacks, Ctrl-C.

# --- exceptions of callbacks ---------------------------------------------------------------------------

"What the callbacks of one running call have to say to it."
mutable struct Frame
    error::Any # the first exception, thrown again where the call returns
    backtrace::Any
    undefined::Any # the last DomainError: the solver tried another point
end

const FRAME = :switchback_frame # key in the storage of the task: callbacks run in the task of the call

# Running calls, of all tasks, in which a callback failed: polls look closer only if there are some.
const FAILURES = Threads.Atomic{Int}(0)

current_frame() = get(task_local_storage(), FRAME, nothing)

"""
What a callback returns because of an exception, which is kept for the end of the call: 1 for a point where the function
is not defined, -1 to end the call. To be called in a `catch`.
"""
@noinline function failed(e)
    frame = current_frame()
    if e isa DomainError
        frame === nothing || (frame.undefined = e)
        return Int32(1)
    end
    keep(e)
    return Int32(-1)
end

"Keep the first exception of a call for its end. To be called in a `catch`."
@noinline function keep(e)
    frame = current_frame()
    if frame !== nothing && frame.error === nothing
        frame.error, frame.backtrace = e, catch_backtrace()
        Threads.atomic_add!(FAILURES, 1)
    end
    return nothing
end

"Throw what a callback threw, with the place where it did as the cause."
function throw_again(frame::Frame)
    e, trace = frame.error, frame.backtrace
    try
        throw(CapturedException(e, trace))
    catch
        throw(e)
    end
end

"Throw the exception of a status that is not 0, with the message of the library."
@inline check(status::Int32) = status == Lib.SWB_OK ? nothing : throw_status(status, nothing)

@noinline function throw_status(status, cause)
    said, code = own_words(unsafe_string(Lib.swb_last_error())), Int(Lib.swb_last_user_code())
    Lib.swb_error_handled() # the exception says it
    throw(exception(status, said, code, cause))
end

"""
Run a call that calls back. Ctrl-C is held off while code of the library runs, which it must not unwind; callbacks let it
through where its exception can be caught. What a callback threw is thrown again.
"""
function guarded(call)
    storage = task_local_storage()
    outer = get(storage, FRAME, nothing)
    frame = Frame(nothing, nothing, nothing)
    storage[FRAME] = frame
    status = try
        Base.disable_sigint(call)
    finally
        storage[FRAME] = outer
        frame.error === nothing || Threads.atomic_sub!(FAILURES, 1)
    end
    frame.error === nothing || throw_again(frame)
    status == Lib.SWB_OK || throw_status(status, frame.undefined)
    return nothing
end

"Let Ctrl-C through: 0, or `stop` if it was pressed or a callback failed. Solves ask this at every iteration or step."
@inline function poll(stop)
    try
        Base.sigatomic_end() # throws here what was held off
        Base.sigatomic_begin()
    catch e
        keep(e)
        return stop
    end
    return FAILURES[] == 0 ? zero(stop) : stop_if_failed(stop)
end

@noinline function stop_if_failed(stop)
    frame = current_frame()
    return frame !== nothing && frame.error !== nothing ? stop : zero(stop)
end

# --- objects ------------------------------------------------------------------------------------------

"""
An object of the library. It is freed by the garbage collector when nothing refers to it any more, or at once by
`close`. A call on a closed object is an error.
"""
abstract type Handle end

# Every handle has the fields `address::Ptr{T}` and `uses::Int`, the calls that run in it.

"Type of the object in the library, and the function that frees it."
function opaque end
function free end

for (name, object) in (
    (:Graph, :expr), (:Built, :model), (:ModelFunction, :function), (:System, :system), (:Run, :run),
    (:Integrator, :integrator), (:Batch, :batch), (:Simulator, :simulator), (:Trajectory, :trajectory), (:Ocp, :ocp),
    (:MultiPhase, :multiphase), (:Program, :mpcc), (:Scene, :scene), (:Stepper, :stepper),
)
    kind, release = Symbol(:swb_, object), Symbol(:swb_, object, :_free)
    @eval begin
        abstract type $(Symbol(:Any, name)) <: Handle end
        opaque(::Type{<:$(Symbol(:Any, name))}) = Lib.$kind
        free(h::$(Symbol(:Any, name))) = Lib.$release(h.address)
        Base.unsafe_convert(::Type{Ptr{Lib.$kind}}, h::$(Symbol(:Any, name))) = address(h)
    end
end

@inline function address(h::Handle)
    h.address == C_NULL && mistake(:state, nameof(typeof(h)), " is closed")
    return h.address
end

function release(h::Handle)
    if h.address != C_NULL
        free(h)
        h.address = C_NULL
    end
    return nothing
end

"Take what a constructor of the library hands out: `make(given..., place)` is the call. The address."
function created(::Type{H}, make::F, given...) where {H<:Handle,F}
    place = Ref{Ptr{opaque(H)}}(C_NULL)
    guarded(() -> make(given..., place))
    return place[]
end

"The finished object, which will be freed with its last reference."
owned(h::Handle) = finalizer(release, h)

"""
    close(object)

Free an object of the library now instead of when it is collected. A second time does nothing.
"""
function Base.close(h::Handle)
    h.uses == 0 || mistake(:state, nameof(typeof(h)), " is in use and cannot be closed: a callback of it is running")
    finalize(h)
    release(h)
end

Base.isopen(h::Handle) = h.address != C_NULL

Base.copy(h::Handle) = error("$(nameof(typeof(h))) cannot be copied")
Base.deepcopy_internal(h::Handle, ::IdDict) = copy(h)

"Run a call on an object that calls back: as `guarded`, and the object cannot be closed meanwhile."
function using_object(call, h::Handle)
    address(h)
    h.uses += 1
    try
        guarded(call)
    finally
        h.uses -= 1
    end
end

# --- values -------------------------------------------------------------------------------------------

# What a function of the library hands out through pointers behind its other arguments, `given`.

"The number that a call writes to a place."
function value(::Type{T}, get::F, given...) where {T,F}
    place = Ref{T}()
    check(get(given..., place))
    return place[]
end

"The struct that a call fills."
function record(::Type{T}, get::F, given...) where {T,F}
    place = Ref{T}()
    check(get(given..., place, sizeof(T)))
    return place[]
end

"The structs that a call fills."
function records(::Type{T}, n, get::F, given...) where {T,F}
    found = Vector{T}(undef, n)
    check(get(given..., n == 0 ? C_NULL : found, n, sizeof(T)))
    return found
end

"`n` numbers that a call fills."
function numbers(::Type{T}, n, get::F, given...) where {T,F}
    found = Vector{T}(undef, n)
    check(get(given..., found, n))
    return found
end

"`n` integers that a call writes to a place each."
function integers(n, get, given...)
    places = [Ref(Int64(0)) for _ in 1:n]
    check(get(given..., places...))
    return [Int(p[]) for p in places]
end

"A text that a call fills: it is asked for the length first."
function text(get::F, given...) where {F}
    needed = value(Int64, place -> get(given..., C_NULL, 0, place))
    buffer = Vector{UInt8}(undef, needed)
    check(get(given..., buffer, needed, C_NULL))
    return String(buffer[1:end-1])
end

"Give numbers to an object: `set(object, numbers, count)` is the call. The object."
function give(set::F, object::Handle, values) where {F}
    using_object(() -> set(object, values, length(values)), object)
    return object
end

# Who is told what happens during a call: iterations, steps, log lines, points where the continuation is not unique.

"A struct of the library as a NamedTuple, without its size."
@generated function named(record)
    names = Tuple(n for n in fieldnames(record) if n !== :struct_size)
    fields = [:(getfield(record, $(QuoteNode(n)))) for n in names]
    return :(NamedTuple{$names}(($(fields...),)))
end

"A function of the user that the library calls during the calls on an object, or nothing."
mutable struct Monitor
    f::Any
end

"The answer of a function of the user to `info()`, `stop` if it failed or something else did before."
function ask(m::Monitor, info, answer, stop)
    poll(Int32(1)) == 0 || return stop
    try
        return answer(Base.reenable_sigint(() -> m.f(info())))
    catch e
        keep(e)
        return stop
    end
end

stops(answer) = answer === true ? Int32(1) : Int32(0)

function iteration_of(info)
    i = named(unsafe_load(info))
    return merge(i, (phase = 0 < i.phase < 128 ? Char(i.phase) : ' ',))
end
iteration_entry(info::Ptr{Lib.swb_iteration_info}, m::Monitor) =
    m.f === nothing ? poll(Int32(1)) : ask(m, () -> iteration_of(info), stops, Int32(1))

copied_numbers(p::Ptr{T}, n) where {T} = n == 0 ? T[] : copy(unsafe_wrap(Array, p, n))

function step_of(info)
    s = unsafe_load(info)
    return (t = s.t, x = copied_numbers(s.x, s.nx), kind = symbol(Lib.NAMES_swb_progress_kind, s.kind), steps = s.steps,
            switches = s.switches)
end
progress_entry(info::Ptr{Lib.swb_progress}, m::Monitor) =
    m.f === nothing ? poll(Int32(1)) : ask(m, () -> step_of(info), stops, Int32(1))

function log_entry(level::Int64, line::Cstring, m::Monitor)
    m.f === nothing && return nothing
    try
        Base.reenable_sigint(() -> m.f(symbol(Lib.NAMES_swb_log_level, level), unsafe_string(line)))
    catch e
        keep(e)
    end
    return nothing
end

"Numbers from 1 of the flags that are set, subsystem by subsystem."
function mode_lists(flags, n_modes)
    ends = cumsum([0; n_modes])
    return [findall(!iszero, flags[ends[k]+1:ends[k+1]]) for k in eachindex(n_modes)]
end

function branching_of(info, n_modes)
    b = unsafe_load(info)
    active = reshape(copied_numbers(b.active, b.n_continuations * b.n_modes), Int(b.n_modes), :)
    return (t = b.t, x = copied_numbers(b.x, b.nx), before = mode_lists(copied_numbers(b.before, b.n_modes), n_modes),
            active = [mode_lists(active[:, k], n_modes) for k in axes(active, 2)],
            velocity = reshape(copied_numbers(b.velocity, b.n_continuations * b.nx), Int(b.nx), :))
end
function decide_entry(info::Ptr{Lib.swb_branching}, m::Monitor)
    f, n_modes = m.f
    taken(answer) = answer === nothing ? Int64(-1) : integer(answer, "what on_branching returns") - 1
    return ask(Monitor(f), () -> branching_of(info, n_modes), taken, Int64(-1))
end

const ITERATION, PROGRESS, LOG, DECIDE = (Ref{Ptr{Cvoid}}(C_NULL) for _ in 1:4) # set when the package is loaded

function make_pointers()
    DESTROY[] = @cfunction(note_released, Cvoid, (Ptr{Cvoid},))
    ITERATION[] = @cfunction(iteration_entry, Int32, (Ptr{Lib.swb_iteration_info}, Ref{Monitor}))
    PROGRESS[] = @cfunction(progress_entry, Int32, (Ptr{Lib.swb_progress}, Ref{Monitor}))
    LOG[] = @cfunction(log_entry, Cvoid, (Int64, Cstring, Ref{Monitor}))
    DECIDE[] = @cfunction(decide_entry, Int64, (Ptr{Lib.swb_branching}, Ref{Monitor}))
end

callable(f, name) = f === nothing || is_callable(f) || mistake(:range, "$name must be a function, not $(typeof(f))")

"Set a monitor of an object, which keeps it."
function set_monitor(set, monitor::Monitor, pointer, f, name; wanted = true)
    callable(f, name)
    monitor.f = f
    check(set(wanted ? pointer[] : C_NULL, pointer_from_objref(monitor)))
end

"""
    on_iteration!(object, f)

Set who is called with a NamedTuple once per iteration of a solve (`print_iteration` prints it); the answer `true` stops
the solve. `nothing` for nobody.
"""
function on_iteration! end

"""
    on_log!(object, f)

Set who is called with the level, a Symbol, and a line of the log; how much comes is the option `log_level`.
"""
function on_log! end

"""
    interrupt!(object)

Stop the call that runs now, or the next one if none runs; from any thread.
"""
function interrupt! end

"""
    set!(object; options...)

Set options of an object: `set!(ocp; max_iter = 500, log_level = :info)`.
"""
function set! end

"""
    settings(object)

A copy of the options of an object.
"""
function settings end

"""
    print_iteration(i)

Print an iteration as one line; give it as `on_iteration`.
"""
function print_iteration(i)
    i.iter % 20 == 0 && println("  iter     objective    inf_pr    inf_du    inf_cc     sigma        mu  alpha_pr")
    @printf("%5d%c % .6e %9.2e %9.2e %9.2e %9.2e %9.2e %9.2e\n", i.iter, i.phase, i.objective, i.inf_pr, i.inf_du, i.inf_cc, i.sigma,
            i.mu, i.alpha_pr)
end

# Pictures of results as SVG, without other packages.

"A panel: lines (t, y, label, a stair?) over time, marks (t, y, number of the line), and what its axis is called."
struct Panel
    label::String
    height::Float64
    lines::Vector{Tuple{Vector{Float64},Vector{Float64},String}}
    marks::Vector{Tuple{Float64,Float64,Int}}
end

const COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf")
const PAGE = 720.0
const LEFT, RIGHT, TOP, GAP = 64.0, 104.0, 34.0, 26.0
colour(k) = COLOURS[mod1(k, length(COLOURS))]
short(v) = string(round(v; digits = 2))
escaped(s) = replace(replace(replace(s, "&" => "&amp;"), "<" => "&lt;"), ">" => "&gt;")

"Round numbers that divide an interval."
function ticks(low, high)
    span = high - low
    raw_step = span / 5
    power = 10.0^floor(log10(raw_step))
    step = power * (raw_step / power < 1.5 ? 1 : raw_step / power < 3.5 ? 2 : raw_step / power < 7.5 ? 5 : 10)
    return step * (ceil(low / step - 1e-9):floor(high / step + 1e-9))
end

tick_text(v) = (r = round(v; sigdigits = 6); r == 0 ? "0" : isinteger(r) && abs(r) < 1e6 ? string(Int(r)) : string(r))

"The smallest interval around numbers, a little wider."
function around(values)
    finite = filter(isfinite, values)
    isempty(finite) && return (-1.0, 1.0)
    low, high = extrema(finite)
    width = high - low
    width <= 1e-12 * max(abs(low), abs(high)) && (width = max(abs(low), 1.0) * 0.5)
    return (low - 0.06width, high + 0.06width)
end

function draw_panel(io, panel::Panel, top, t_range, x_of, switches)
    low, high = around(vcat((y for (_, y, _) in panel.lines)...))
    y_of(v) = top + panel.height * (high - v) / (high - low)
    right = PAGE - RIGHT
    println(io, """<rect x="$LEFT" y="$(short(top))" width="$(right - LEFT)" height="$(panel.height)" fill="none" stroke="#888"/>""")
    for v in ticks(low, high)
        y = short(y_of(v))
        println(io, """<line x1="$LEFT" x2="$right" y1="$y" y2="$y" stroke="#e4e4e4"/>""",
                """<text x="$(LEFT - 6)" y="$y" text-anchor="end" dominant-baseline="middle">$(tick_text(v))</text>""")
    end
    guide_lines(io, top, panel.height, t_range, x_of, switches)
    for (k, (t, y, label)) in enumerate(panel.lines)
        points = join((string(short(x_of(a)), ",", short(y_of(b))) for (a, b) in zip(t, y) if isfinite(b)), " ")
        println(io, """<polyline points="$points" fill="none" stroke="$(colour(k))" stroke-width="1.6"/>""")
        println(io, """<text x="$(right + 8)" y="$(short(top + 12 + 16 * (k - 1)))" fill="$(colour(k))">$(escaped(label))</text>""")
    end
    for (t, y, k) in panel.marks
        println(io, """<circle cx="$(short(x_of(t)))" cy="$(short(y_of(y)))" r="3" fill="$(colour(k))"/>""")
    end
    axis_label(io, panel.label, top + panel.height / 2)
end

function guide_lines(io, top, height, t_range, x_of, switches)
    for v in ticks(t_range...)
        x = short(x_of(v))
        println(io, """<line x1="$x" x2="$x" y1="$(short(top))" y2="$(short(top + height))" stroke="#e4e4e4"/>""")
    end
    for t in switches
        x = short(x_of(t))
        println(io, """<line x1="$x" x2="$x" y1="$(short(top))" y2="$(short(top + height))" stroke="#777" stroke-dasharray="2 3"/>""")
    end
end

axis_label(io, label, y) = println(io, """<text x="14" y="$(short(y))" text-anchor="middle" """,
                                   """transform="rotate(-90 14 $(short(y)))">$(escaped(label))</text>""")

"Bands (start, end, row) of the modes that are active; rows have labels."
function draw_bands(io, bands, labels, top, t_range, x_of, switches)
    height = 16.0 * length(labels)
    println(io, """<rect x="$LEFT" y="$(short(top))" width="$(PAGE - RIGHT - LEFT)" height="$height" fill="none" stroke="#888"/>""")
    guide_lines(io, top, height, t_range, x_of, switches)
    for (a, b, row) in bands
        println(io, """<rect x="$(short(x_of(a)))" y="$(short(top + 16 * (row - 1) + 3))" width="$(short(max(x_of(b) - x_of(a), 0.5)))" """,
                """height="10" fill="$(colour(row))" fill-opacity="0.75"/>""")
    end
    for (row, label) in enumerate(labels)
        x, anchor = length(label) > 8 ? (PAGE - RIGHT + 8, "start") : (LEFT - 6, "end") # where there is room
        println(io, """<text x="$x" y="$(short(top + 16 * row - 8))" text-anchor="$anchor" dominant-baseline="middle">$(escaped(label))</text>""")
    end
    axis_label(io, "modes", top + height / 2)
    return height
end

"A whole picture: panels over one axis of time, then the active modes."
function draw(io, panels, bands, labels, t_range, switches, title)
    x_of(t) = LEFT + (PAGE - RIGHT - LEFT) * (t - t_range[1]) / (t_range[2] - t_range[1])
    heights = [[p.height for p in panels]; isempty(labels) ? Float64[] : [16.0 * length(labels)]]
    total = TOP + sum(heights) + GAP * length(heights) + 22
    println(io, """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 $PAGE $total" width="$PAGE" height="$total" """,
            """font-family="sans-serif" font-size="12">""")
    println(io, """<rect width="$PAGE" height="$total" fill="white"/>""")
    println(io, """<text x="$((LEFT + PAGE - RIGHT) / 2)" y="20" text-anchor="middle" font-size="14">$(escaped(title))</text>""")
    top = TOP
    for p in panels
        draw_panel(io, p, top, t_range, x_of, switches)
        top += p.height + GAP
    end
    isempty(labels) || (top += draw_bands(io, bands, labels, top, t_range, x_of, switches) + GAP)
    for v in ticks(t_range...)
        println(io, """<text x="$(short(x_of(v)))" y="$(short(top - GAP + 15))" text-anchor="middle">$(tick_text(v))</text>""")
    end
    println(io, """<text x="$((LEFT + PAGE - RIGHT) / 2)" y="$(short(top - GAP + 32))" text-anchor="middle">time</text>""")
    println(io, "</svg>")
end

mode_labels(n_modes) = [length(n_modes) > 1 ? "$k: $i" : string(i) for k in eachindex(n_modes) for i in 1:n_modes[k]]

state_labels(names, n, letter = "x") = [isempty(get(names, i, "")) ? "$letter$i" : names[i] for i in 1:n]

"Times close enough for a smooth line: some in every step."
dense_times(t) = length(t) < 2 ? t : [vcat((collect(range(a, b; length = 13))[1:12] for (a, b) in zip(t, t[2:end]) if b > a)...); t[end]]

chosen_states(states, labels) = states === nothing ? collect(eachindex(labels)) : places(states, labels, "states")

"Bands of the active modes of elements, neighbours with the same mode in one piece."
function element_bands(r::Trajectory)
    bands = Tuple{Float64,Float64,Int}[]
    for mode in axes(r.active, 1)
        on = r.active[mode, :]
        first_ = findfirst(on)
        while first_ !== nothing
            behind = something(findnext(!, on, first_), length(on) + 1)
            push!(bands, (r.times[first_], r.times[behind], mode))
            first_ = findnext(on, behind)
        end
    end
    return bands
end

function picture(io::IO, s::Solution; title = "", states = nothing)
    length(s.t) > 1 || mistake(:state, "there is nothing to draw: simulate with dense = true, over some time")
    s.system.scene === nothing || return scene_picture(io, s, title, states)
    labels = state_labels(s.system.names[1], s.system.nx)
    shown = chosen_states(states, labels)
    t = dense_times(s.t)
    x = s(clamp.(t, s.t_start, s.t_end))
    lines = [(t, x[i, :], labels[i]) for i in shown]
    marks = [(e.t, s(e.t)[i], k) for e in s.switches for (k, i) in enumerate(shown)]
    offsets = cumsum([0; s.n_modes])
    bands = [(a, b, offsets[k] + m) for k in eachindex(s.n_modes) for (a, b, on) in active_modes(s, k) for m in on]
    draw(io, [Panel("states", 260.0, lines, marks)], bands, mode_labels(s.n_modes), (s.t_start, s.t_end), unique(switch_times(s)), title)
end

"Coordinates and velocities of a scene with its impacts, and the modes of the contacts that close, a row for each that occurs."
function scene_picture(io, s, title, states)
    labels = state_labels(s.system.names[1], s.system.nx)
    shown = chosen_states(states, labels)
    n_q = s.system.scene isa Scene ? length(s.system.scene.q) : 0 # states of projected systems are in the place of velocities
    times = unique(Float64[i.t for i in s.impacts])
    t = sort!([dense_times(s.t); nextfloat.(filter(<(s.t_end), times))]) # behind impacts, where velocities are others
    x = s(clamp.(t, s.t_start, s.t_end))
    panel(name, chosen) = Panel(name, 170.0, [(t, x[i, :], labels[i]) for i in chosen],
                                [(w, s(w)[i], k) for w in times for (k, i) in enumerate(chosen)])
    parts = [(n_q > 0 ? "coordinates" : "states", filter(<=(n_q), shown)), (n_q > 0 ? "velocities" : "states", filter(>(n_q), shown))]
    panels = [panel(name, chosen) for (name, chosen) in parts if !isempty(chosen)]
    cuts = unique(sort!([s.t_start; switch_times(s); times; s.t_end]))
    rows, bands = Tuple{String,Symbol}[], Tuple{Float64,Float64,Int}[]
    for (name, tangents) in s.system.contacts, mode in (:closed, :slides, :slides_back)
        middles = (cuts[1:end-1] .+ cuts[2:end]) ./ 2
        on = contact_mode(s, name, middles) .== mode
        any(on) || continue
        push!(rows, (name, tangents > 0 && mode === :closed ? :sticks : mode))
        append!(bands, [(cuts[k], cuts[k+1], length(rows)) for k in findall(on)])
    end
    draw(io, panels, bands, [replace("$name $mode", "_" => " ") for (name, mode) in rows], (s.t_start, s.t_end), unique(switch_times(s)), title)
end

function picture(io::IO, r::Trajectory; title = "", states = nothing, controls = zeros(0, 0), control_times = Float64[],
                 control_names = String[])
    isempty(r.steps) && mistake(:state, "there is nothing to draw: the trajectory is empty")
    t_range = (r.times[1], r.times[end])
    labels = state_labels(r.names, r.nx)
    shown = chosen_states(states, labels)
    t = dense_times(r.times)
    x = r(clamp.(t, t_range...))
    panels = [Panel("states", 240.0, [(t, x[i, :], labels[i]) for i in shown],
                    [(w, r(w)[i], k) for w in unique(switch_times(r)) for (k, i) in enumerate(shown)])]
    if !isempty(controls)
        stairs(row) = (repeat(control_times; inner = 2)[2:end-1], repeat(row; inner = 2))
        push!(panels, Panel("controls", 140.0, [(stairs(controls[k, :])..., label) for (k, label) in enumerate(state_labels(control_names, size(controls, 1), "u"))], []))
    end
    draw(io, panels, element_bands(r), mode_labels(r.n_modes), t_range, unique(switch_times(r)), title)
end

picture(io::IO, r::OcpResult; keywords...) = picture(io, r.trajectory; controls = r.controls, control_times = r.control_times,
                                                     control_names = r.control_names, keywords...)
picture(io::IO, r::FesdSolution; keywords...) = picture(io, r.trajectory; controls = r.controls, control_times = r.control_times, keywords...)

"""
    picture(path, result; title = "", states = all)

Draw a `Solution`, a `Trajectory`, or the result of an optimal control problem as SVG: states and controls over time, a mark
and a dotted line at every switch, and the active modes as bands. Of a scene the marks are impacts, and the bands the modes of
the contacts that close. `states` chooses states by number or name. Notebooks show
the picture of a result without being asked.
"""
function picture(path::AbstractString, result; keywords...)
    text_ = sprint(io -> picture(io, result; keywords...)) # nothing is written if it cannot be drawn
    write(path, text_)
    return path
end

Base.show(io::IO, ::MIME"image/svg+xml", r::Union{Solution,Trajectory,OcpResult,FesdSolution}) = picture(io, r)
Base.showable(::MIME"image/svg+xml", s::Solution) = isopen(s) && length(s.t) > 1
Base.showable(::MIME"image/svg+xml", r::Trajectory) = isopen(r) && length(r.steps) > 0

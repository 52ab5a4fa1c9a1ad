# An optimizer of MathOptInterface for nonlinear programs with `Complements`: `JuMP.Model(Switchback.optimizer)`.
# Not tested: no test of this repository can load MathOptInterface.
#
# A model is copied as a whole (`copy_to`); its nonlinear expressions and derivatives are those of MOI.Nonlinear.
module SwitchbackMathOptInterfaceExt

using MathOptInterface
using SparseArrays
using Switchback

const MOI = MathOptInterface
const Bounds = Union{MOI.LessThan{Float64},MOI.GreaterThan{Float64},MOI.EqualTo{Float64},MOI.Interval{Float64}}
const Functions = Union{MOI.ScalarAffineFunction{Float64},MOI.ScalarQuadraticFunction{Float64},MOI.ScalarNonlinearFunction}
const Rows = Union{MOI.VectorOfVariables,MOI.VectorAffineFunction{Float64}}

mutable struct Optimizer <: MOI.AbstractOptimizer
    options::Dict{Symbol,Any}
    silent::Bool
    program::Union{Nothing,Switchback.Mpcc}
    result::Union{Nothing,Switchback.MpccResult}
    sense::MOI.OptimizationSense
    columns::Dict{MOI.VariableIndex,Int}
    rows::Dict{MOI.ConstraintIndex,Int} # of ordinary constraints

    Optimizer() = new(Dict{Symbol,Any}(), false, nothing, nothing, MOI.MIN_SENSE, Dict(), Dict())
end

Switchback.optimizer() = Optimizer()

function MOI.empty!(o::Optimizer)
    o.program = o.result = nothing
    empty!(o.columns)
    empty!(o.rows)
end
MOI.is_empty(o::Optimizer) = o.program === nothing
MOI.get(::Optimizer, ::MOI.SolverName) = "Switchback"
MOI.get(::Optimizer, ::MOI.SolverVersion) = string(Switchback.library_version())
MOI.supports(::Optimizer, ::MOI.Silent) = true
MOI.set(o::Optimizer, ::MOI.Silent, v::Bool) = (o.silent = v)
MOI.get(o::Optimizer, ::MOI.Silent) = o.silent
MOI.supports(::Optimizer, a::MOI.RawOptimizerAttribute) = haskey(Switchback.options(), Symbol(a.name))
MOI.set(o::Optimizer, a::MOI.RawOptimizerAttribute, v) = (o.options[Symbol(a.name)] = v)
MOI.get(o::Optimizer, a::MOI.RawOptimizerAttribute) = o.options[Symbol(a.name)]
MOI.supports(::Optimizer, ::MOI.TimeLimitSec) = true
MOI.set(o::Optimizer, ::MOI.TimeLimitSec, v) = v === nothing ? delete!(o.options, :max_time) : (o.options[:max_time] = Float64(v))
MOI.get(o::Optimizer, ::MOI.TimeLimitSec) = get(o.options, :max_time, nothing)
MOI.supports(::Optimizer, ::MOI.ObjectiveSense) = true
MOI.supports(::Optimizer, ::MOI.ObjectiveFunction{<:Union{MOI.VariableIndex,Functions}}) = true
MOI.supports(::Optimizer, ::MOI.VariablePrimalStart, ::Type{MOI.VariableIndex}) = true
MOI.supports_constraint(::Optimizer, ::Type{MOI.VariableIndex}, ::Type{<:Bounds}) = true
MOI.supports_constraint(::Optimizer, ::Type{<:Functions}, ::Type{<:Bounds}) = true
MOI.supports_constraint(::Optimizer, ::Type{<:Rows}, ::Type{MOI.Complements}) = true

limits(s::MOI.LessThan) = (-Inf, s.upper)
limits(s::MOI.GreaterThan) = (s.lower, Inf)
limits(s::MOI.EqualTo) = (s.value, s.value)
limits(s::MOI.Interval) = (s.lower, s.upper)

"Row i of a vector-valued function as a scalar one."
scalar(f::MOI.VectorOfVariables, i) = 1.0 * f.variables[i]
scalar(f::MOI.VectorAffineFunction, i) = MOI.Utilities.scalarize(f)[i]

function MOI.copy_to(o::Optimizer, source::MOI.ModelLike)
    MOI.empty!(o)
    index_map = MOI.Utilities.IndexMap()
    variables = MOI.get(source, MOI.ListOfVariableIndices())
    for (k, v) in enumerate(variables)
        index_map[v] = v
        o.columns[v] = k
    end
    n = length(variables)
    low, high = fill(-Inf, n), fill(Inf, n)
    model, row_low, row_high, complements = MOI.Nonlinear.Model(), Float64[], Float64[], []
    for (F, S) in MOI.get(source, MOI.ListOfConstraintTypesPresent()), c in MOI.get(source, MOI.ListOfConstraintIndices{F,S}())
        f, set = MOI.get(source, MOI.ConstraintFunction(), c), MOI.get(source, MOI.ConstraintSet(), c)
        index_map[c] = c
        if F <: MOI.VariableIndex
            a, b = limits(set)
            k = o.columns[f]
            low[k], high[k] = max(low[k], a), min(high[k], b)
        elseif S <: MOI.Complements
            push!(complements, f)
        else
            MOI.Nonlinear.add_constraint(model, f, set)
            push!.((row_low, row_high), limits(set))
            o.rows[c] = length(row_low)
        end
    end
    boxes = complementarity_rows!(model, row_low, row_high, complements, o.columns)
    o.sense = MOI.get(source, MOI.ObjectiveSense())
    if o.sense != MOI.FEASIBILITY_SENSE
        F = MOI.get(source, MOI.ObjectiveFunctionType())
        MOI.Nonlinear.set_objective(model, MOI.get(source, MOI.ObjectiveFunction{F}()))
    end
    start = [something(MOI.get(source, MOI.VariablePrimalStart(), v), clamp(0.0, low[k], high[k])) for (k, v) in enumerate(variables)]
    o.program = program(o, model, variables, low, high, row_low, row_high, boxes, start)
    return index_map
end

"""
Rows for the functions that are complementary to variables, and the boxes of both: f is not negative where its variable is at its
lower bound, not positive at its upper bound, and zero between them.
"""
function complementarity_rows!(model, row_low, row_high, complements, columns)
    boxes = Tuple{Int,Int}[]
    for f in complements
        n = MOI.output_dimension(f) ÷ 2
        for i in 1:n
            x = MOI.Utilities.scalarize(f)[n+i]
            variable = x isa MOI.VariableIndex ? x : only(x.terms).variable
            MOI.Nonlinear.add_constraint(model, scalar(f, i), MOI.EqualTo(0.0))
            push!(row_low, 0.0)
            push!(row_high, 0.0)
            push!(boxes, (columns[variable], length(row_low)))
        end
    end
    return boxes
end

"The program with the sparse derivatives of MOI.Nonlinear."
function program(o, model, variables, low, high, row_low, row_high, boxes, start)
    evaluator = MOI.Nonlinear.Evaluator(model, MOI.Nonlinear.SparseReverseMode(), variables)
    MOI.initialize(evaluator, [:Grad, :Jac, :Hess])
    n, m = length(variables), length(row_low)
    sign_ = o.sense == MOI.MAX_SENSE ? -1.0 : 1.0
    has_objective = o.sense != MOI.FEASIBILITY_SENSE
    jacobian, hessian = MOI.jacobian_structure(evaluator), MOI.hessian_lagrangian_structure(evaluator)
    j_values, h_values = zeros(length(jacobian)), zeros(length(hessian))
    jac_prototype = sparse(first.(jacobian), last.(jacobian), ones(length(jacobian)), m, n)
    upper = [(min(a, b), max(a, b)) for (a, b) in hessian]
    hess_prototype = sparse(first.(upper), last.(upper), ones(length(upper)), n, n)
    function jac(J, x)
        MOI.eval_constraint_jacobian(evaluator, j_values, x)
        for ((a, b), v) in zip(jacobian, j_values)
            J[a, b] += v
        end
    end
    function hess(H, x, weight, y)
        MOI.eval_hessian_lagrangian(evaluator, h_values, x, sign_ * weight, y)
        for ((a, b), v) in zip(upper, h_values)
            H[a, b] += v
        end
    end
    options = o.silent ? o.options : merge(Dict{Symbol,Any}(:log_level => :info), o.options)
    values(out, x) = MOI.eval_constraint(evaluator, out, x)
    rows = m == 0 ? NamedTuple() : (constraints = values, n_constraints = m, constraint_bounds = (row_low, row_high), jac = jac, jac_prototype = jac_prototype)
    return Mpcc(n, x -> has_objective ? sign_ * MOI.eval_objective(evaluator, x) : 0.0;
                gradient = x -> (g = zeros(n); has_objective && MOI.eval_objective_gradient(evaluator, g, x); sign_ * g), rows...,
                hess = hess, hess_prototype = hess_prototype, boxes = boxes, bounds = (low, high), start = start,
                on_log = (level, line) -> println(line), options...)
end

MOI.optimize!(o::Optimizer) = (o.result = solve!(o.program); nothing)

const STATUS = Dict(
    :solved => MOI.LOCALLY_SOLVED, :max_iter => MOI.ITERATION_LIMIT, :max_time => MOI.TIME_LIMIT, :stopped => MOI.INTERRUPTED,
    :infeasible => MOI.LOCALLY_INFEASIBLE, :locally_infeasible => MOI.LOCALLY_INFEASIBLE, :stalled => MOI.SLOW_PROGRESS, :diverging => MOI.NORM_LIMIT, :failed => MOI.NUMERICAL_ERROR,
)
MOI.get(o::Optimizer, ::MOI.TerminationStatus) = o.result === nothing ? MOI.OPTIMIZE_NOT_CALLED : get(STATUS, o.result.outcome, MOI.OTHER_ERROR)
MOI.get(o::Optimizer, ::MOI.RawStatusString) = o.result === nothing ? "not solved yet" : string(o.result.outcome)
MOI.get(o::Optimizer, ::MOI.ResultCount) = o.result === nothing ? 0 : 1
function MOI.get(o::Optimizer, a::MOI.PrimalStatus)
    (o.result === nothing || a.result_index > 1) && return MOI.NO_SOLUTION
    return o.result.residuals.primal < 1e-6 ? MOI.FEASIBLE_POINT : MOI.INFEASIBLE_POINT
end
MOI.get(o::Optimizer, a::MOI.DualStatus) = MOI.get(o, MOI.PrimalStatus(a.result_index)) == MOI.FEASIBLE_POINT ? MOI.FEASIBLE_POINT : MOI.NO_SOLUTION
MOI.get(o::Optimizer, ::MOI.ObjectiveValue) = (o.sense == MOI.MAX_SENSE ? -1.0 : 1.0) * o.result.objective
MOI.get(o::Optimizer, ::MOI.SolveTimeSec) = o.result.stats.time_total
MOI.get(o::Optimizer, ::MOI.BarrierIterations) = Int64(o.result.stats.iterations)
MOI.get(o::Optimizer, ::MOI.VariablePrimal, v::MOI.VariableIndex) = o.result.x[o.columns[v]]
MOI.get(o::Optimizer, ::MOI.ConstraintPrimal, c::MOI.ConstraintIndex) = o.result.constraints[o.rows[c]]
# the sign of MOI: grad f = sum of duals times gradients, for minimisation
MOI.get(o::Optimizer, ::MOI.ConstraintDual, c::MOI.ConstraintIndex) = -o.result.y[o.rows[c]]

end

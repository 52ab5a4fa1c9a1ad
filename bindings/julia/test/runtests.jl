# Tests of the package: `julia --project=bindings/julia bindings/julia/test/runtests.jl [file ...]`, or `make check-julia`.
# SWITCHBACK_LIBRARY says which library; SWITCHBACK_REFERENCE is what reference.py wrote, to compare with Python.

using Test, LinearAlgebra, SparseArrays
using Switchback
const Swb = Switchback

const ROOT = joinpath(@__DIR__, "..", "..", "..") # of the repository

include("models.jl")

const FILES = isempty(ARGS) ? ["lib", "expressions", "callbacks", "simulation", "automata", "scenes", "ocp", "programs", "refusals", "memory", "pages"] : ARGS
@testset "Switchback" begin
    @testset "$file" for file in FILES
        seconds = @elapsed include(joinpath(@__DIR__, "$file.jl"))
        println("  ", rpad(file, 12), round(seconds; digits = 1), " s")
    end
end

# What the pages show runs: the README of the package, docs/julia.md, the program in the README of the repository; the examples
# draw their pictures; the generated file fits the header; extensions can be read.

quietly(f) = open(io -> redirect_stdout(f, io), "/dev/null", "w")

"The blocks of code in a page, in a module of their own."
function run_page(path)
    blocks = [m[1] for m in eachmatch(r"```julia\n(.*?)```"s, read(path, String)) if !startswith(m[1], "pkg>") && !startswith(m[1], "# not run")]
    place = Module(:Page)
    Core.eval(place, :(using Base; include(x) = Base.include($place, x)))
    mktempdir() do folder
        cd(folder) do
            quietly(() -> foreach(block -> include_string(place, block, basename(path)), blocks))
        end
    end
    return length(blocks)
end

for page in (joinpath(@__DIR__, "..", "README.md"), joinpath(ROOT, "docs", "julia.md"), joinpath(ROOT, "README.md"))
    @test run_page(page) > 0
end

@testset "examples" begin
    for name in readdir(joinpath(@__DIR__, "..", "examples"))
        mktempdir() do folder
            place = Module(:Example)
            Core.eval(place, :(include(x) = Base.include($place, x); const ARGS = [$folder]))
            quietly(() -> Base.include(place, joinpath(@__DIR__, "..", "examples", name)))
            pictures = filter(p -> endswith(p, ".svg"), readdir(folder))
            @test !isempty(pictures) || name == "program.jl" # which has nothing over time
            for p in pictures
                svg = read(joinpath(folder, p), String)
                @test startswith(svg, "<svg") && occursin("polyline", svg) && !occursin("NaN", svg) && !occursin("Inf", svg)
            end
        end
    end
end

@testset "extensions are Julia" begin
    folder = joinpath(@__DIR__, "..", "ext")
    for file in readdir(folder)
        parsed = Meta.parse(string("begin\n", read(joinpath(folder, file), String), "\nend"))
        @test parsed.head === :block
        @test !any(e -> e isa Expr && e.head in (:error, :incomplete), parsed.args)
    end
end

# The generated interface: every function, layouts as a C compiler has them, versions, what is loaded.

header = joinpath(ROOT, "include", "switchback.h")

@testset "the header" begin
    text_ = read(header, String)
    declared = [Symbol(m[1]) for m in eachmatch(r"SWB_API\s+[\w\s*]+?(swb_\w+)\s*\(", text_)]
    @test length(declared) == count(line -> occursin(r"^(SWB_NODISCARD )?SWB_API", line), split(text_, "\n"))
    @test length(declared) > 250
    @test Set(declared) == Set(Swb.Lib.NAMES)
    for name in declared
        f = getfield(Swb.Lib, name)
        @test length(methods(f)) == 1
        @test haskey(Base.Docs.meta(Swb.Lib), Base.Docs.Binding(Swb.Lib, name))
    end
    @test all(!=(C_NULL), Swb.Lib.ADDRESSES) && length(Swb.Lib.ADDRESSES) == length(declared)
end

@testset "layouts" begin
    structs = [n for n in names(Swb.Lib; all = true) if startswith(string(n), "swb_") &&
               getfield(Swb.Lib, n) isa DataType && isstructtype(getfield(Swb.Lib, n)) && fieldcount(getfield(Swb.Lib, n)) > 0]
    @test length(structs) >= 15
    values = [n for n in names(Swb.Lib; all = true) if startswith(string(n), "SWB_")]
    @test length(values) > 150
    lines, expected = String[], String[]
    for n in structs
        T = getfield(Swb.Lib, n)
        push!(lines, "printf(\"%zu\\n\", sizeof($n));")
        push!(expected, string(sizeof(T)))
        for (k, field) in enumerate(fieldnames(T))
            push!(lines, "printf(\"%zu\\n\", offsetof($n, $field));")
            push!(expected, string(fieldoffset(T, k)))
        end
    end
    for n in values
        push!(lines, "printf(\"%d\\n\", (int)$n);")
        push!(expected, string(Int(getfield(Swb.Lib, n))))
    end
    mktempdir() do folder
        source = joinpath(folder, "layout.c")
        write(source, "#include <stddef.h>\n#include <stdio.h>\n#include <switchback.h>\nint main(void) {\n", join(lines, "\n"),
              "\nreturn 0; }\n")
        program = joinpath(folder, "layout")
        run(`cc -I $(dirname(header)) $source -o $program`)
        @test split(read(`$program`, String)) == expected
    end
end

@testset "versions and names" begin
    @test Swb.library_version() == Swb.Lib.HEADER_VERSION
    @test !isempty(Swb.library_path())
    @test unsafe_string(Swb.Lib.swb_status_name(-2)) == "SWB_ERR_DIMENSION"
    @test unsafe_string(Swb.Lib.swb_outcome_name(0)) == "solved"
    @test Swb.Lib.swb_check_version(99, 0) == Swb.Lib.SWB_ERR_UNSUPPORTED
    # exceptions that other programs see
    code = "try; using Switchback; catch e; print(sprint(showerror, e)); end"
    command = `$(Base.julia_cmd()) --startup-file=no --project=$(Base.active_project()) -e $code`
    said = read(setenv(command, merge(ENV, Dict("SWITCHBACK_LIBRARY" => "/nowhere/lib.so"))), String)
    @test occursin("SWITCHBACK_LIBRARY", said) && occursin("/nowhere/lib.so", said)
end

@testset "options" begin
    all_ = options()
    @test length(all_) == Swb.Lib.swb_option_count() && all_[:tol].kind === :float && all_[:n_s].default isa Int
    @test :radau_iia in all_[:rk_family].values && all_[:rk_family].setup_only
    s = Settings(n_s = 3, cross = :stage, tol = 1e-7)
    @test (s.n_s, s.cross, s.tol) == (3, :stage, 1e-7) && s[:reltol] == s.rtol
    s.n_s = 4
    t = copy(s)
    t.tol = 1e-5
    @test s.n_s == 4 && s.tol == 1e-7 && s != t && Settings() == Settings() && hash(Settings()) == hash(Settings())
    @test occursin("n_s = 4", string(s)) && occursin("\"n_s\":", replace(to_json(s), " " => ""))
    @test validate(s) === nothing
    @test refused(() -> Settings(n_ss = 3), :option, "n_s")
    @test refused(() -> s.toll, :option, "tol")
    @test refused(() -> Settings(n_s = -1), :range)
    @test refused(() -> Settings(cross = :stages), :option, "stage")
    @test refused(() -> Settings(tol = nothing), :option)
    @test occursin("fixed", sprint(show, MIME("text/plain"), all_[:rk_family]))
    @test :tol in propertynames(s)
end

# What Julia costs beside C: a call of a model function, and a whole simulation.
#
# usage: SWITCHBACK_LIBRARY=.../libswitchback.so julia --project=bindings/julia bindings/julia/benchmarks/costs.jl
#
# Needs a C compiler. Both sides use the same library. They take turns, because what else runs on a machine changes in the
# course of minutes, and medians of times of the processor are printed.

using Switchback, Libdl, Statistics
const Lib = Switchback.Lib

folder = mktempdir()
header = abspath(joinpath(@__DIR__, "..", "..", "..", "include"))
library = abspath(Switchback.library_path())
const ROUNDS = 11

"Seconds of the processor, which do not depend on what else runs."
function seconds(f)
    start = ccall(:clock, Clong, ())
    f()
    return 1e-6 * (ccall(:clock, Clong, ()) - start)
end

# --- a call -------------------------------------------------------------------------------------------

write(joinpath(folder, "call.c"), """
#include <switchback.h>
int32_t value(const swb_point *at, double *out, void *data)
{ (void)data; out[0] = at->x[1]; out[1] = -at->x[0] - 0.1 * at->x[1]; return 0; }
""")
run(`cc -O2 -shared -fPIC -I $header $(joinpath(folder, "call.c")) -o $(joinpath(folder, "call.so"))`)
c_value = dlsym(dlopen(joinpath(folder, "call.so")), :value)

function c_function()
    address = Switchback.created(Switchback.AnyModelFunction,
                                 place -> Lib.swb_function_create("f", 2, 0, 0, 2, c_value, C_NULL, C_NULL, place))
    return Switchback.owned(ModelFunction(address, 0, false, "f", 2, 0, 0, 2))
end

function seconds_per_call(f, n)
    x, out = [0.3, 0.4], zeros(2)
    GC.@preserve x out begin
        at = Ref(Lib.swb_point(0.0, pointer(x), C_NULL, C_NULL))
        handle = Switchback.address(f)
        call() = (for _ in 1:n; Lib.swb_function_eval(handle, at, out, 2); end; Int32(0))
        Switchback.guarded(call)
        return seconds(() -> Switchback.guarded(call)) / n
    end
end

n = 100_000
functions = [
    "a call through swb_function_eval, C:" => c_function(),
    "the same, Julia, a tuple:" => ModelFunction(x -> (x[2], -x[1] - 0.1x[2]), 2; outputs = 2),
    "the same, Julia, in place:" => ModelFunction((out, x) -> (out[1] = x[2]; out[2] = -x[1] - 0.1x[2]; nothing), 2; outputs = 2),
    "the same, Julia, a new array:" => ModelFunction(x -> [x[2], -x[1] - 0.1x[2]], 2; outputs = 2),
]
foreach(f -> seconds_per_call(f, 100), last.(functions)) # compiles
calls = 1e9median(reduce(hcat, [[seconds_per_call(f, n) for (_, f) in functions] for _ in 1:ROUNDS]); dims = 2)
for (k, (what, _)) in enumerate(functions)
    println(rpad(what, 42), round(calls[k]; digits = 1), " ns", k == 1 ? "" : ", $(round(calls[k] - calls[1]; digits = 1)) ns more than C")
end

# --- a simulation -------------------------------------------------------------------------------------

m = Model(states = (:q, :v))
q, v = m.x
derivatives!(m, [v, -q + when(v > 0.2, -1 / (0.8 + v), 1 / (1.2 - v))])
write(joinpath(folder, "model.json"), to_json(m))
write(joinpath(folder, "simulate.c"), """
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <switchback.h>
#define TRY(call) do { if (call) { fprintf(stderr, "%s\\n", swb_last_error()); return 1; } } while (0)
static double now(void) { return (double)clock() / CLOCKS_PER_SEC; }
int main(int argc, char **argv)
{
    static char text[1 << 20];
    FILE *file = fopen(argv[1], "r");
    size_t n = fread(text, 1, sizeof text - 1, file);
    int repeat, k, count = atoi(argv[2]);
    double best = 1e9, x0[2] = {-0.8, -1.0}, *t, *x;
    swb_expr *graph; swb_model *model; swb_system *system; swb_integrator *integrator; swb_run *run;
    swb_settings settings; swb_run_info info; swb_event *events;
    (void)argc; text[n] = 0;
    TRY(swb_expr_create(&graph));
    TRY(swb_model_from_json(graph, text, NULL, 0, NULL, 0, &model));
    TRY(swb_model_system(model, &system));
    for (repeat = 0; repeat < 3; repeat++) {
        double start = now();
        for (k = 0; k < count; k++) {
            TRY(swb_settings_init(&settings, sizeof settings));
            settings.rtol = settings.atol = 1e-10; settings.dense = 1;
            TRY(swb_integrator_create(system, &settings, &integrator));
            TRY(swb_integrator_reinit(integrator, 0.0, x0, 2));
            TRY(swb_integrator_advance(integrator, 40.0, NULL));
            TRY(swb_integrator_get_run(integrator, &run));
            TRY(swb_run_get_info(run, &info, sizeof info));
            events = malloc(sizeof *events * info.n_events);
            t = malloc(sizeof *t * (info.n_pieces + 1)); x = malloc(sizeof *x * 2 * (info.n_pieces + 1));
            TRY(swb_run_events(run, events, info.n_events, sizeof *events));
            TRY(swb_run_times(run, t, info.n_pieces + 1));
            TRY(swb_run_evaluate(run, t, info.n_pieces + 1, 0, x, 2 * (info.n_pieces + 1)));
            free(events); free(t); free(x);
            swb_run_free(run); swb_integrator_free(integrator);
        }
        if (now() - start < best) best = now() - start;
    }
    printf("%.17g\\n", best / count);
    return 0;
}
""")
run(`cc -O2 -I $header $(joinpath(folder, "simulate.c")) $library -o $(joinpath(folder, "simulate"))`)
count_ = 50
# the program asks for the library by its SONAME, which need not be the name of the file
number = Switchback.Lib.HEADER_VERSION
symlink(library, joinpath(folder, "libswitchback.so.$(number.major).$(number.minor)"))
program = `$(joinpath(folder, "simulate")) $(joinpath(folder, "model.json")) $count_`
c_seconds() = parse(Float64, read(setenv(program, merge(ENV, Dict("LD_LIBRARY_PATH" => folder))), String))

function seconds_per_simulation(s, count)
    seconds() do
        for _ in 1:count
            simulate(s, [-0.8, -1.0], 40.0; reltol = 1e-10, abstol = 1e-10)
        end
    end / count
end

# the same model as functions of Julia
j = System(2; f0 = x -> (x[2], -x[1]))
add_subsystem!(j; modes = x -> (-1 / (0.8 + x[2]), 1 / (1.2 - x[2])), psi = x -> x[2] - 0.2, signs = [1, -1], rows = [2])
s = System(m)
foreach(system -> seconds_per_simulation(system, 5), (s, j)) # compiles

# of three times on each side the smallest, as the program in C does it
times = [(c_seconds(), minimum(seconds_per_simulation(s, count_) for _ in 1:3), seconds_per_simulation(j, count_)) for _ in 1:ROUNDS]
in_c, in_julia, with_functions = (median(t[k] for t in times) for k in 1:3)
println("\na simulation with 9 switches, C:  ", round(1e6in_c; digits = 1), " us")
println("the same from Julia:              ", round(1e6in_julia; digits = 1), " us, ", round(in_julia / in_c; digits = 2), " times C")
println("the same with functions of Julia: ", round(1e6with_functions; digits = 1), " us (the modes and the switching function are differenced)")

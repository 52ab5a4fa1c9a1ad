# What objects that solve have in common: options, monitors, interrupts, residuals, statistics.

for (T, kind) in ((:Simulator, :simulator), (:Integrator, :integrator), (:Ocp, :ocp), (:Mpcc, :mpcc))
    call(name) = :(Lib.$(Symbol(:swb_, kind, :_, name)))
    @eval begin
        function set!(o::$T; options...)
            for (key, v) in pairs(options)
                set_option((n, w) -> $(call(:set_int))(o, n, w), (n, w) -> $(call(:set_double))(o, n, w),
                           (n, w) -> $(call(:set_string))(o, n, w), key, v)
            end
            return o
        end
        function settings(o::$T)
            s = Settings()
            check($(call(:get_settings))(o, raw(s), sizeof(Lib.swb_settings)))
            return s
        end
        """
            set_settings!(object, settings)

        Set all options of an object.
        """
        set_settings!(o::$T, s::Settings) = (check($(call(:set_settings))(o, raw(s))); o)
        function on_log!(o::$T, f)
            set_monitor((p, d) -> $(call(:set_log))(o, p, d), o.log, LOG, f, "on_log"; wanted = f !== nothing)
            return o
        end
        interrupt!(o::$T) = (check($(call(:interrupt))(o)); nothing)
    end
end

for (T, kind) in ((:Simulator, :simulator), (:Ocp, :ocp), (:Mpcc, :mpcc), (:MultiPhase, :multiphase))
    set = Symbol(:swb_, kind, :_set_iteration)
    @eval function on_iteration!(o::$T, f)
        set_monitor((p, d) -> Lib.$set(o, p, d), o.iteration, ITERATION, f, "on_iteration")
        return o
    end
end
interrupt!(o::MultiPhase) = (check(Lib.swb_multiphase_interrupt(o)); nothing)

for (T, kind) in ((:Simulator, :simulator), (:Ocp, :ocp), (:Mpcc, :mpcc))
    call(name) = :(Lib.$(Symbol(:swb_, kind, :_get_, name)))
    @eval begin
        outcome(o::$T) = solve_outcome(value(Int32, $(call(:outcome)), o))
        """
            residuals(object)

        Residuals of the last solve, unscaled, maximum norm: a NamedTuple.
        """
        residuals(o::$T) = named(record(Lib.swb_residuals, $(call(:residuals)), o))
        stats(o::$T) = named(record(Lib.swb_stats, $(call(:stats)), o))
    end
end

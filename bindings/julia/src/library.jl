# Finds, loads and checks the library; fills the table of addresses of `Lib`.

const LIBRARY_PATH = Ref("")

"""
    library_path()

The library that is loaded, as it was found.
"""
library_path() = LIBRARY_PATH[]

"""
    library_version()

Version of the library that is loaded.
"""
library_version() = VersionNumber(unsafe_string(Lib.swb_version()))

"What the package `Switchback_jll` calls the library, where that package is installed."
function artifact_library()
    id = Base.identify_package("Switchback_jll")
    id === nothing && return nothing
    jll = Base.require(id)
    return string(Base.invokelatest(getfield, jll, :libswitchback))
end

"The places where the library may be, the first that works is taken."
function library_places()
    chosen = get(ENV, "SWITCHBACK_LIBRARY", "")
    isempty(chosen) || return [chosen]
    version = Lib.HEADER_VERSION
    number = version.major == 0 ? "0.$(version.minor)" : string(version.major)
    artifact = artifact_library()
    places = artifact === nothing ? String[] : [artifact]
    return [places; "libswitchback.$(Libdl.dlext).$number"; "libswitchback"]
end

function open_library()
    failures = String[]
    for place in library_places()
        try
            return Libdl.dlopen(place), place
        catch e
            push!(failures, e isa ErrorException ? e.msg : sprint(showerror, e))
        end
    end
    error("Switchback: the library cannot be loaded (the environment variable SWITCHBACK_LIBRARY may say where it ",
          "is):\n  ", join(failures, "\n  "))
end

"Is the library of the version that this package was made for, and are the structs those of its header?"
function load_library()
    handle, place = open_library()
    version = Lib.HEADER_VERSION
    for name in (:swb_version, :swb_check_version)
        Libdl.dlsym(handle, name; throw_error = false) === nothing &&
            error("Switchback: $place is no switchback library")
    end
    status = ccall(Libdl.dlsym(handle, :swb_check_version), Int32, (Int32, Int32), version.major, version.minor)
    if status != Lib.SWB_OK
        other = unsafe_string(ccall(Libdl.dlsym(handle, :swb_version), Cstring, ()))
        error("Switchback: this package is for version $version of the library, but $place has version $other")
    end
    addresses = map(Lib.NAMES) do name
        found = Libdl.dlsym(handle, name; throw_error = false)
        found === nothing && error("Switchback: $place does not match this package: it has no function $name")
        found
    end
    append!(empty!(Lib.ADDRESSES), addresses)
    LIBRARY_PATH[] = place
    settings = Ref{Lib.swb_settings}()
    Lib.swb_settings_init(settings, sizeof(Lib.swb_settings)) == Lib.SWB_OK ||
        error("Switchback: $place has other settings than this package: ", unsafe_string(Lib.swb_last_error()))
    return nothing
end

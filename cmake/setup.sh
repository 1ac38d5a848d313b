# Functions that ./demo, ./test and bench/run share; sourced from the root of the tree. Each step looks first whether it has been done,
# so that a second run goes straight to the work.

setup_fail() {
    echo "$0: $*" >&2
    exit 1
}

# Install those of the named Debian packages that are missing. apt is not started when none is.
setup_packages() {
    if ! command -v dpkg-query >/dev/null; then
        echo "$0: no dpkg here: taking for granted what Debian calls: $*" >&2
        return
    fi
    missing=
    for package; do
        state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null) || state=none
        [ "$state" = installed ] || missing="$missing $package"
    done
    [ -n "$missing" ] || return 0
    if [ "$(id -u)" = 0 ]; then
        as_root=
    elif command -v sudo >/dev/null; then
        as_root=sudo
    else
        setup_fail "these packages are missing, and there is neither root nor sudo to install them. As root:
    apt-get update && apt-get install --no-install-recommends$missing"
    fi
    echo "Installing$missing"
    # -qq and the log keep hundreds of lines off the screen; they are shown when something fails.
    log=$(mktemp)
    if ! { $as_root apt-get -qq -o Acquire::Retries=3 update &&
        $as_root env DEBIAN_FRONTEND=noninteractive apt-get -qq -y -o Acquire::Retries=3 -o Dpkg::Use-Pty=0 \
            install --no-install-recommends $missing; } >"$log" 2>&1 </dev/null; then
        tail -n 40 "$log" >&2
        rm -f "$log"
        setup_fail "apt-get could not install$missing"
    fi
    rm -f "$log"
}

# Configure by a preset of CMakePresets.json into build/PRESET, once (ninja configures again when a CMakeLists changes),
# and build it. All cores, but a GB of memory for each compiler: VTK's headers are hungry.
setup_build() {
    preset=$1
    if [ ! -e "build/$preset/build.ninja" ] || [ CMakePresets.json -nt "build/$preset/build.ninja" ]; then
        cmake --preset "$preset" || setup_fail "cmake could not configure build/$preset"
        touch "build/$preset/build.ninja"
    fi
    jobs=$(nproc)
    memory=$(awk '/^MemAvailable/ { print int($2 / 1048576) }' /proc/meminfo 2>/dev/null) || memory=
    [ -z "$memory" ] || [ "$memory" -ge "$jobs" ] || jobs=$((memory > 0 ? memory : 1))
    cmake --build "build/$preset" -j "$jobs" || setup_fail "build/$preset does not build"
}

# More ranks than cores, no binding to cores, root in a container, and no words about networks that are not used.
setup_mpi() {
    export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
    export OMPI_MCA_rmaps_base_oversubscribe=1 OMPI_MCA_hwloc_base_binding_policy=none
    export OMPI_MCA_btl_base_warn_component_unused=0 OMPI_MCA_mpi_yield_when_idle=1
}

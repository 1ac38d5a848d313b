# What the CSVs of benchmarks say of the machine, as comments; sourced from the root of the tree.

csv_machine() {
    echo "# $(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | sed q)"
    compiler=$(sed -n 's/^CMAKE_C_COMPILER:[^=]*=//p' build/release/CMakeCache.txt)
    echo "# $("$compiler" --version | sed -n 1p)"
    echo "# measured $(date -u +%Y-%m-%dT%H:%MZ)" # of several files the pages take the newest
}

csv_load() {
    cut -d' ' -f1 /proc/loadavg
}

# The load tells whether other programs ran: if it is more than the threads, the measured speeds are too low.
csv_loads() {
    echo "# load average $1 at the start and $(csv_load) at the end"
}

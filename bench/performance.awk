# Draws docs/performance.md from the CSV files named as arguments: a section a file, in their order.
BEGIN {
    FS = ","
    print "# Performance"
    print ""
    print "Drawn by `bench/run` from bench/results/*.csv; do not edit."
    print ""
    print "The mesh is the cube [-1, 1]^3 of n^3 cubes, inner vertices jittered by up to 0.2 of a cube's side, as hexes or as six"
    print "tets each; float32 coordinates and values, int32 indices. The field is sin 6x cos 6y + sin 6y cos 6z + sin 6z cos 6x. Images"
    print "are 1920 x 1080 from (2.4, 1.6, 3.0) to the origin, 40 degrees vertical: every pixel's ray counts, those that miss too."
    print "The isosurface is at 0.3, shaded, by the robust root finder. The volume has a tent of opacity over |f| < 0.6 (at its peak"
    print "0.5 in a length of 0.5), samples each half side of a cube, jittered, in groups of 16."
    print ""
    print "A speed is the median of the runs, with the least and the greatest of them. Beside it stands the error on one pixel in each"
    print "block of 60 x 60, against brute force in double over all cells: of the isosurface the difference in depth, in sides of a"
    print "cube, and of how many pixels one says hit and the other miss; of the volume the largest difference of linear red,"
    print "green, blue or opacity. \"Closed form\" is how far the field's formula is from the isovalue at the points hit: what linear or"
    print "trilinear cells cost, whoever draws them. In brackets: how many of the disagreements are rays that meet more than one root"
    print "in a cell, where the method takes a cell's two ends for the whole of it."
}

FNR == 1 { section() }
/^#/ { machine = machine (machine == "" ? "" : "; ") substr($0, 3); next }
$1 != "bench_render" { next }
{
    if (title == "") title = $2 ", " $3 ($3 == 1 ? " thread" : " threads")
    subject = $4 SUBSEP $5
    if (!(subject in cells)) {
        order[++subjects] = subject
        cells[subject] = $6
        mesh[subject] = $4
        n[subject] = $5
    }
    runs = $7 == "build" ? $9 : runs
    median[subject, $7] = $10
    low[subject, $7] = $11
    high[subject, $7] = $12
}
END { section() }

function number(x) {
    x += 0
    if (x == 0) return "0"
    if (x < 0.001) return sprintf("%.1e", x)
    return sprintf(x < 1 ? "%.3f" : x < 10 ? "%.2f" : x < 100 ? "%.1f" : "%.0f", x)
}

function speed(s, measure) {
    return number(median[s, measure]) " (" number(low[s, measure]) " to " number(high[s, measure]) ")"
}

function error(s, measure, scale) {
    return number(scale * median[s, measure]) ", at most " number(scale * high[s, measure])
}

function section(    i, s) {
    if (title == "") {
        machine = ""
        return
    }
    print "\n## " title "\n"
    print machine ". " runs " runs.\n"
    print "| mesh | n | cells | build, Mcells/s | refit ranges, Mcells/s | refit bounds, Mcells/s | tree, bytes/cell | peak of the build, bytes/cell |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= subjects; i++) {
        s = order[i]
        printf "| %s | %d | %d | %s | %s | %s | %s | %s |\n", mesh[s], n[s], cells[s], speed(s, "build"),
            speed(s, "refit ranges"), speed(s, "refit bounds"), number(median[s, "tree size"]), number(median[s, "build peak"])
    }
    print "\n| mesh | n | isosurface, Mrays/s | depth error | hit or miss differs | closed form | peak, MB |"
    print "|---|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= subjects; i++) {
        s = order[i]
        printf "| %s | %d | %s | %s | %d (%d) of %d | %s | %s |\n", mesh[s], n[s], speed(s, "isosurface"),
            error(s, "isosurface depth error", n[s] / 2), median[s, "isosurface disagreements"],
            median[s, "isosurface ambiguous"], median[s, "isosurface checked"], error(s, "isosurface field error", 1),
            number(median[s, "isosurface peak"])
    }
    print "\n| mesh | n | volume, Mrays/s | error | peak, MB |"
    print "|---|--:|--:|--:|--:|"
    for (i = 1; i <= subjects; i++) {
        s = order[i]
        printf "| %s | %d | %s | %s | %s |\n", mesh[s], n[s], speed(s, "volume"), error(s, "volume error", 1),
            number(median[s, "volume peak"])
    }
    split("", order); split("", cells)
    subjects = 0
    title = machine = ""
}

# Draws docs/accuracy.md from the CSV of bench_accuracy named as argument. figures: the names of those that have been drawn,
# each between spaces.
BEGIN {
    FS = ","
    targets = split("1e-1 1e-2 1e-3 1e-4 1e-5", target, " ")
}

/^# note: / { note = note "\n**" substr($0, 9) "**\n"; next }
/^#/ { machine = machine (machine == "" ? "" : "; ") substr($0, 3); next }
$1 != "bench_accuracy" { next }
{
    if (size == "") size = $6
    m = $4 ($6 == size ? "" : ", " $6 " x " $6)
    if (!(m in cells)) {
        mesh[++meshes] = m
        cells[m] = $5
        isa = $2; threads = $3
    }
    n = ++rows[m]
    layer[m, n] = $7; method[m, n] = $8; setting[m, n] = $9; status[m, n] = $10
    build[m] = $11; first[m, n] = $12; frame[m, n] = $13
    pixels[m, n] = $17; rms[m, n] = $18; most[m, n] = $19; wrong[m, n] = $20; residual[m, n] = $21
    if ($8 == "samples") has_ladder[m] = 1
}

function number(x) {
    x += 0
    if (x == 0) return "0"
    if (x < 0.001) return sprintf("%.1e", x)
    return sprintf(x < 1 ? "%.3f" : x < 10 ? "%.2f" : x < 100 ? "%.1f" : "%.0f", x)
}

function is_peer(m, i) { return method[m, i] ~ /^VTK/ }
function is_volume(m, i) { return layer[m, i] == "volume" }

function name_of(m, i,    what) {
    what = method[m, i]
    if (what == "samples") return "samples, step of " cells_named(setting[m, i])
    if (what == "segments") return exact(m) ? "segments" : "segments, parts of " cells_named(setting[m, i])
    if (what == "frames") return "samples a cell apart, " setting[m, i] (setting[m, i] == "1" ? " frame" : " frames")
    if (what == "sample group") return "samples, step of 1/4 cell, groups of " setting[m, i]
    if (what == "max_error") return "max_error: " setting[m, i]
    return setting[m, i] == "-" ? what : what ", " setting[m, i]
}

function cells_named(s) { return s (s ~ /^[24]$/ ? " cells" : " cell") }

# One segment a cell whatever the step.
function exact(m,    i, count) {
    for (i = 1; i <= rows[m]; i++) count += method[m, i] == "segments"
    return count == 1
}

# A row that another row of the same picture stands for.
function is_repeated(m, i) {
    return method[m, i] == "sample group" || (method[m, i] == "frames" && setting[m, i] == "1")
}

# The cheapest of our volume rows that is off by no more than these; 0 where there is none.
function cheapest(m, rms_wanted, most_wanted,    i, best) {
    best = 0
    for (i = 1; i <= rows[m]; i++) {
        if (!is_volume(m, i) || is_peer(m, i) || status[m, i] != "ok" || is_repeated(m, i)) continue
        if (rms[m, i] + 0 > rms_wanted || most[m, i] + 0 > most_wanted) continue
        if (!best || frame[m, i] + 0 < frame[m, best] + 0) best = i
    }
    return best
}

function times(x) { return sprintf(x < 10 ? "%.1f" : "%.0f", x) }

function ratio(x) { return x >= 10 ? times(x) : "**" times(x) "**" }

function figure(name, text) { if (index(figures, " " name " ")) print "\n![" text "](images/" name ".png)" }

function heading(    i) {
    print "# Accuracy: which setting for which error"
    print ""
    print "Drawn by `bench/run accuracy` from bench/results/accuracy-*.csv; do not edit."
    print note
    print "- **Isosurfaces:** leave `roots: robust`. It is the only setting that misses nothing (of a million random cubics Neubauer's"
    print "  method misses every root on 11 % and the first one on 1 %), and is exact to rounding: a depth in float32 is off by 6e-8 of the"
    print "  scene, so the field there by that times its slope along the ray, which is more than 1e-6 of the range in small cells."
    print "- **Volumes of tets or polyhedra:** `max_error: 1e-2`, which errors stay well below; `method: segments` where it must be"
    print "  exact to rounding, at about twice the time."
    print "- **Volumes of hexes, wedges, pyramids:** `max_error`: 1e-2 for pictures on a screen, 1e-3 where pictures are compared,"
    print "  1e-4 where numbers are taken from them. It is kept without knowing the data, so with much to spare: the errors below are a"
    print "  fortieth of it and less. A step that has been tried out on the data is often cheaper for the same error, as the first table"
    print "  shows."
    print "- **Samples** are for several volumes in one picture, whose segments are mixed pixel by pixel, which takes longer. Their error"
    print "  is of first order, on average half the step for half of it. `group` changes the time alone: the finer the step, the larger the group"
    print "  that pays."
    print "- **Frames of different jitter** average the noise of samples, not their bias: halve the step instead."
    print ""
    print "Errors are of linear light. A picture of 8 bits is off by half a step of sRGB by rounding alone: 0.002 in mid-tones, 0.0002 in"
    print "the dark, 0.004 in the light."
}

function measured() {
    print "\n## What is measured\n"
    print machine ". " isa ", " threads (threads == 1 ? " thread" : " threads") ", pictures of " size " x " size "."
    print ""
    print "Errors are those of some hundred pixels, one in each block, against brute force in double over all cells: volumes against"
    print "an adaptive integral to 1e-10 a cell, of red, green, blue and opacity, linear and premultiplied, over black. The field"
    print "within a cell is the truth: trilinear in hexes, piecewise linear in polyhedra. A frame is the median of up to 5, from"
    print "the trees to the finished pixels. The first picture counts the build of the tree, and for VTK all that it does"
    print "to its input until the first render has ended, but not the opening of its window."
    print ""
    print "All have the same camera, colours and opacity with three knots, unshaded. VTK reads an unstructured grid's opacity as"
    print "extinction, linear between the knots; libinsitu, and VTK for images, as the opacity of a unit distance, whose extinction is"
    print "-ln(1 - opacity). So VTK's mappers of grids are given -ln(1 - opacity) at the knots, and compared with the integral of"
    print "what they were given. The ray caster and projected tetrahedra take only tets, so hexes and polyhedra are cut for them,"
    print "which their first picture pays for, and the field is another then, which their error has. The lattice's polyhedra are"
    print "concave, which VTK's cutting and its search for the cell of a point do not allow for. VTK's ray"
    print "caster works in float and hands over 8 bits, cut off rather than rounded, 0.004 off at most: the errors here are the"
    print "float's. Its rays go through corners of pixels; the camera is shifted for it, so that all have the same rays. The"
    print "resampled images are of 15 bits with samples half a voxel apart. Projected tetrahedra are drawn by Mesa on the CPU."
    print "Each peer runs in a process of its own, stopped after a minute. Pictures of 1024 x 1024 are drawn by segments and `max_error`"
    print "alone, so that is what coarse peers stand beside there."
}

function settings_table(    i, j, m, best) {
    print "\n## Volumes: which setting for which error\n"
    print "The cheapest setting whose largest error is below, and its milliseconds a frame:\n"
    printf "| mesh | cells | tree, ms |"
    for (j = 1; j <= targets; j++) printf " %s |", target[j]
    printf "\n|---|--:|--:|"
    for (j = 1; j <= targets; j++) printf "---|"
    print ""
    for (i = 1; i <= meshes; i++) {
        m = mesh[i]
        if (!(m in has_ladder)) continue
        printf "| %s | %d | %s |", m, cells[m], number(build[m])
        for (j = 1; j <= targets; j++) {
            best = cheapest(m, 1, target[j] + 0)
            printf " %s |", best ? name_of(m, best) ": " number(frame[m, best]) : "-"
        }
        print ""
    }
    figure("accuracy_lattices", "error over time: lattices")
    figure("accuracy_grids", "error over time: real grids")
}

# The least ratios of a mesh over the peers that drew it: into least[] by frame and first.
function peers_table(    i, j, m) {
    print "\n## Volumes: against VTK at equal error\n"
    print "Beside each of VTK's mappers stands the cheapest setting of libinsitu that is off by no more, in the mean square and at most."
    for (i = 1; i <= meshes; i++)
        for (j = 1; j <= rows[mesh[i]]; j++)
            if (is_peer(mesh[i], j)) compare(mesh[i], j)
    verdicts()
    print "\nBold: less than 10 times as fast.\n"
    print "| mesh | VTK | RMS error, at most | frame, ms | first, ms | libinsitu | at most | frame, ms | first, ms | frame, times | first, times |"
    print "|---|---|--:|--:|--:|---|--:|--:|--:|--:|--:|"
    for (i = 1; i <= compared; i++) print comparison[i]
}

# A line of the table of peers.
function compare(m, j,    a, text) {
    if (status[m, j] != "ok") {
        comparison[++compared] = "| " m " | " name_of(m, j) " | " status[m, j] " | - | - | - | - | - | - | - | - |"
        return
    }
    a = cheapest(m, rms[m, j] + 0, most[m, j] + 0)
    text = "| " m " | " name_of(m, j) " | " number(rms[m, j]) ", " number(most[m, j]) " | " number(frame[m, j]) " | " \
        number(first[m, j]) " | "
    if (!a) {
        comparison[++compared] = text "none is so near | - | - | - | - | - |"
        return
    }
    comparison[++compared] = text name_of(m, a) " | " number(most[m, a]) " | " number(frame[m, a]) " | " \
        number(first[m, a]) " | " ratio(frame[m, j] / frame[m, a]) " | " ratio(first[m, j] / first[m, a]) " |"
    compare_least(m, j, "frame", frame[m, j] / frame[m, a])
    compare_least(m, j, "first", first[m, j] / first[m, a])
}

function compare_least(m, j, what, x,    kind) {
    kind = what (method[m, j] == "VTK resample" ? " image" : " cells")
    if ((m, kind) in least && least[m, kind] <= x) return
    least[m, kind] = x
    least_peer[m, kind] = name_of(m, j)
}

function nearest(m, kind) {
    return (m, kind) in least ? times(least[m, kind]) " (" least_peer[m, kind] ")" : "-"
}

# How far ahead of the nearest peer.
function verdicts(    i, m) {
    print "The least of the ratios of their times, frame by frame and from nothing to the first picture:\n"
    print "| mesh | cells drawn: a frame | the first picture | ten times? | resampled image: a frame | the first picture |"
    print "|---|---|---|---|---|---|"
    for (i = 1; i <= meshes; i++) {
        m = mesh[i]
        if (!((m, "frame cells") in least)) continue
        print "| " m " | " nearest(m, "frame cells") " | " nearest(m, "first cells") " | " \
            (least[m, "frame cells"] >= 10 && least[m, "first cells"] >= 10 ? "yes" : "no") " | " \
            nearest(m, "frame image") " | " nearest(m, "first image") " |"
    }
    print ""
    print "Why not ten times against all of them:"
    print ""
    print "- VTK's **ray caster** walks from tet to tet over a list of all faces, with no search at all; libinsitu keeps no"
    print "  neighbours, finds its cells once a frame, and places them anew for every tile of 16 x 16 pixels. It gains as more rays share a cell, in larger"
    print "  pictures; VTK's time goes with the pixels and the faces that their rays cross. And on tets libinsitu's cheapest setting is nearer by"
    print "  far than what it is compared with: below `max_error: 1e-1` there is nothing left to save."
    print "- A **resampled** image is drawn without cells: whoever accepts its error and has a standing field to look at from many sides"
    print "  is mostly served faster by it, and with few voxels on grids of small cells the first picture comes sooner as well."
    print "- **Projected tetrahedra** take colours at the vertices and mix them over the cell. Their error is that of a few samples"
    print "  a ray, and the time of so few is that of placing the cells and of rays that meet them, which coarser steps do not save."
}

function ladder(    i, j, m) {
    print "\n## Volumes: the ladder\n"
    print "RMS error, the largest error, and milliseconds a frame:\n"
    printf "| setting |"
    for (i = 1; i <= meshes && i <= 4; i++) printf " %s |", mesh[i]
    printf "\n|---|"
    for (i = 1; i <= meshes && i <= 4; i++) printf "---|"
    print ""
    for (i = 1; i <= meshes && i <= 4; i++)
        for (j = 1; j <= rows[mesh[i]]; j++) {
            m = mesh[i]
            if (!is_volume(m, j) || (i > 1 && method[m, j] != "segments")) continue
            line(method[m, j], setting[m, j], exact(m))
        }
}

# One setting over the meshes, once.
function line(what, which, is_exact,    i, j, m, cell, text, label) {
    for (i = 1; i <= meshes && i <= 4; i++) {
        m = mesh[i]
        cell = "-"
        for (j = 1; j <= rows[m]; j++) {
            if (!is_volume(m, j) || method[m, j] != what || setting[m, j] != which) continue
            if (what == "segments" && exact(m) != is_exact) continue
            label = name_of(m, j)
            cell = status[m, j] != "ok" ? status[m, j] : number(rms[m, j]) ", " number(most[m, j]) ", " number(frame[m, j])
        }
        text = text " " cell " |"
    }
    if (!(label in said)) print "| " label " |" text
    said[label] = 1
}

function surfaces(    i, j, m, way) {
    print "\n## Isosurfaces\n"
    print "Depth against the reference in sizes of the cell hit, RMS and at most, where both are on the same sheet; pixels that miss,"
    print "or are on another sheet, of those compared; the largest |field at the hit - isovalue| over the range of the cell's values"
    print "(not taken in polyhedra); milliseconds a frame. On tets and in polyhedra all settings solve the same linear equation. Left"
    print "out are rays on which a polyhedron's quad and the tets behind it are on different sides of the isovalue. Packets and"
    print "SPMD are the thesis's traversals, on two lattices beside the picture as a whole, which is what frames are drawn by.\n"
    print "| mesh | setting | depth | wrong | residual | frame, ms |"
    print "|---|---|--:|--:|--:|--:|"
    for (i = 1; i <= meshes; i++)
        for (j = 1; j <= rows[mesh[i]]; j++) {
            m = mesh[i]
            if (is_volume(m, j)) continue
            if (exact(m) && setting[m, j] ~ /N = [134]/) continue
            way = method[m, j]
            way = sub(/^[^ ]* /, ", ", way) ? way : ""
            printf "| %s | %s | %s, %s | %d of %d | %s | %s |\n", m, setting[m, j] way, number(rms[m, j]), number(most[m, j]),
                wrong[m, j], pixels[m, j], residual[m, j] == "nan" ? "-" : number(residual[m, j]), number(frame[m, j])
        }
    figure("accuracy_isosurfaces", "depth error over time: isosurfaces")
}

END {
    heading()
    settings_table()
    peers_table()
    surfaces()
    ladder()
    measured()
}

# Draws docs/performance.md from the CSV files named as arguments. Of a measure that stands in several files the first
# counts: name the newest first.
BEGIN { FS = "," }

FNR == 1 { began = 0 }
/^#/ { note(substr($0, 3)); next }
$1 !~ /^bench_/ { next }
{
    program = substr($1, 7)
    sub(/^tables scaling$/, "scaling " $2 " " $3, program)
    key = program SUBSEP $4 SUBSEP $5 SUBSEP $7
    if (key in median) next
    if (!((program, $4, $5) in cells)) {
        cells[program, $4, $5] = $6
        mesh[program, ++meshes[program]] = $4
        side[program, meshes[program]] = $5
    }
    if (!(program in isa)) { isa[program] = $2; threads[program] = $3 }
    count[key] = $9; median[key] = $10; low[key] = $11; high[key] = $12
}
END { page() }

function note(text) {
    if (text ~ /^load average/ || text ~ /^[0-9]+ s$/) { load[FILENAME] = load[FILENAME] (load[FILENAME] == "" ? "" : ", ") text; return }
    if (!(text in noted)) machine = machine (machine == "" ? "" : "; ") text
    noted[text] = 1
}

# ---- numbers ----

function number(x) {
    x += 0
    if (x == 0) return "0"
    if (x < 0.001) return sprintf("%.1e", x)
    return sprintf(x < 1 ? "%.3f" : x < 10 ? "%.2f" : x < 100 ? "%.1f" : "%.0f", x)
}

function key_of(program, m, n, measure) { return program SUBSEP m SUBSEP n SUBSEP measure }
function has(program, m, n, measure) { return (key_of(program, m, n, measure) in median) }
function value(program, m, n, measure,    k) {
    k = key_of(program, m, n, measure)
    return k in median ? median[k] + 0 : 0
}

# With the least and the greatest.
function spread(program, m, n, measure,    k) {
    k = key_of(program, m, n, measure)
    if (!(k in median)) return "–"
    if (count[k] < 2) return number(median[k])
    return number(median[k]) " (" number(low[k]) " to " number(high[k]) ")"
}

function most(program, m, n, measure, scale,    k) {
    k = key_of(program, m, n, measure)
    return k in median ? number(scale * median[k]) ", at most " number(scale * high[k]) : "–"
}

# The lesser of two times that are there; 0 where none is.
function faster(program, m, n, a, b) {
    if (!has(program, m, n, a)) return has(program, m, n, b) ? value(program, m, n, b) : 0
    if (!has(program, m, n, b)) return value(program, m, n, a)
    return value(program, m, n, a) < value(program, m, n, b) ? value(program, m, n, a) : value(program, m, n, b)
}

# ---- what was asked ----

# is_least: the ratio is to be at least the bar; else at most. aim: "" for none.
function claim(what, m, n, ours, theirs, ratio, is_least, bar, aim,    holds) {
    holds = is_least ? ratio >= bar + 0 : ratio <= bar + 0
    claims++
    held += holds
    printf "| %s | %s %d | %s | %s | %.2f | %s %s%s | %s |\n", what, m, n, ours, theirs, ratio,
        is_least ? "≥" : "≤", bar, aim == "" ? "" : ", aim " aim, holds ? "yes" : "**no**"
}

# Of the faster of its trees.
function embree_trace(m, n) {
    return faster("peers", m, n, "isosurface embree trace low", "isosurface embree trace medium")
}

function claim_trace(m, n, what, measure,    theirs, ours, rays) {
    rays = 1000 * value("peers", m, n, "rays")
    theirs = embree_trace(m, n)
    ours = value("peers", m, n, measure)
    if (!theirs || !ours) return
    claim("isosurface, speed of tracing" what ": Embree, packets of 16, extracted surface", m, n,
        number(rays / ours) " Mrays/s", number(rays / theirs) " Mrays/s", theirs / ours, 1, "1.0", "2")
}

function claim_traces(m, n) {
    claim_trace(m, n, ", from all cells", "isosurface trace")
    claim_trace(m, n, ", from the crossed cells kept", "isosurface trace kept")
}

function claim_step(picture, change, m, n, peer, bar, aim,    ours, theirs, name) {
    ours = value("steps", m, n, picture " " change)
    theirs = peer == "VTK" ? value("steps", m, n, picture " vtk route") : \
        faster("steps", m, n, picture " embree route low", picture " embree route medium")
    if (!ours || !theirs) return
    name = peer == "VTK" ? "VTK: extract and first render" : "Embree: extract, build and trace"
    claim((picture == "isosurface" ? "isosurface" : "three isosurfaces") ", time to picture, " change ": " name, m, n,
        number(ours) " ms", number(theirs) " ms", ours / theirs, 0, bar, aim)
}

function claim_steps(m, n) {
    claim_step("isosurface", "new values", m, n, "Embree", "1.0", "0.5")
    claim_step("isosurfaces", "new values", m, n, "Embree", "1.0", "0.5")
    claim_step("isosurface", "new mesh", m, n, "VTK", "1.0", "")
    claim_step("isosurfaces", "new mesh", m, n, "VTK", "1.0", "")
}

function claim_build(m, n,    ours, theirs, million) {
    million = cells["peers", m, n] / 1000
    ours = value("peers", m, n, "build sah")
    theirs = faster("peers", m, n, "embree cells medium", "embree cells medium wide")
    if (ours && theirs)
        claim("binned SAH build: rtcBuildBVH MEDIUM, the faster of binary and 8-wide", m, n,
            number(million / ours) " Mcells/s", number(million / theirs) " Mcells/s", theirs / ours, 1, "2.0", "")
    ours = value("peers", m, n, "build morton")
    theirs = value("peers", m, n, "embree cells low")
    if (ours && theirs)
        claim("Morton build: rtcBuildBVH LOW", m, n, number(million / ours) " Mcells/s",
            number(million / theirs) " Mcells/s", theirs / ours, 1, "1.0", "")
    ours = value("peers", m, n, "build sah cost")
    theirs = value("peers", m, n, "embree cells medium cost")
    if (ours && theirs)
        claim("SAH cost of the tree: rtcBuildBVH MEDIUM, binary", m, n, number(ours), number(theirs), ours / theirs, 0,
            "1.05", "")
}

function claim_memory(m, n,    size) {
    size = value("render", m, n, "tree size")
    if (!size || m != "tets") return
    claim("the full tree with one field", m, n, number(size) " B/cell", "–", size / 16, 0, "1.0", "0.5 of 16 B/cell")
    claim("peak of its build", m, n, number(value("render", m, n, "build peak")) " B/cell", "–",
        value("render", m, n, "build peak") / 40, 0, "1.0 of 40 B/cell", "")
}

function claim_volume(m, n,    ours, theirs) {
    ours = value("volumes", m, n, "volume samples frame")
    theirs = value("volumes", m, n, "volume vtk ray cast frame")
    if (ours && theirs)
        claim("volume, half-cell steps: VTK's ray cast", m, n, number(ours) " ms", number(theirs) " ms", theirs / ours, 1,
            "10", "")
    theirs = value("volumes", m, n, "volume vtk projected tets frame")
    if (ours && theirs)
        claim("volume, half-cell steps: VTK's projected tets", m, n, number(ours) " ms", number(theirs) " ms",
            theirs / ours, 1, "3", "")
}

function claim_thesis(m, n, bar,    ours) {
    ours = value("render", m, n, "volume")
    if (ours)
        claim("volume, half-cell steps: the thesis's speed on twenty AVX2 cores (an aim)", m, n, number(ours) " Mrays/s",
            bar " Mrays/s", ours / bar, 1, "1.0", "")
}

function claim_scaling(    i, m, n, wide, narrow) {
    split("avx512 avx2 sse4.2", widths, " ")
    for (i = 1; i <= 2; i++) {
        wide = "scaling " widths[i] " " most_threads
        narrow = "scaling " widths[i + 1] " " most_threads
        m = mesh[wide, 1]; n = side[wide, 1]
        if (!has(wide, m, n, "isosurface") || !has(narrow, m, n, "isosurface")) continue
        claim("isosurface: " (i == 1 ? "16 lanes against 8" : "8 lanes against 4"), m, n,
            number(value(wide, m, n, "isosurface")) " Mrays/s", number(value(narrow, m, n, "isosurface")) " Mrays/s",
            value(wide, m, n, "isosurface") / value(narrow, m, n, "isosurface"), 1, "1.6", "")
    }
    wide = "scaling avx512 " most_threads
    if (most_threads != 2 || !has("scaling avx512 1", m, n, "isosurface")) return
    claim("isosurface: two threads against one", m, n, number(value(wide, m, n, "isosurface")) " Mrays/s",
        number(value("scaling avx512 1", m, n, "isosurface")) " Mrays/s",
        value(wide, m, n, "isosurface") / value("scaling avx512 1", m, n, "isosurface"), 1, "1.9", "")
}

function section_claims(    i, m, n) {
    print "\n## What was asked, and what holds\n"
    print "Medians of one run, in turns with the peer in one process (VTK's volume mappers and the instruction sets: one"
    print "process after the other). A ratio is of speeds or of times, ours first, such that the bar says what is meant.\n"
    print "| what: the peer | mesh | ours | peer | ratio | bar | holds |"
    print "|---|---|--:|--:|--:|--:|---|"
    for (i = 1; i <= meshes["peers"]; i++) if (mesh["peers", i] == "tets") claim_traces(mesh["peers", i], side["peers", i])
    for (i = 1; i <= meshes["steps"]; i++) claim_steps(mesh["steps", i], side["steps", i])
    for (i = 1; i <= meshes["peers"]; i++) claim_build(mesh["peers", i], side["peers", i])
    if (has("render", "tets", 126, "refit ranges"))
        claim("refit of ranges", "tets", 126, number(value("render", "tets", 126, "refit ranges")) " Mcells/s", "–",
            value("render", "tets", 126, "refit ranges") / 100, 1, "1.0 of 100 Mcells/s", "")
    for (i = 1; i <= meshes["render"]; i++) claim_memory(mesh["render", i], side["render", i])
    for (i = 1; i <= meshes["volumes"]; i++) claim_volume(mesh["volumes", i], side["volumes", i])
    claim_thesis("tets", 55, 5.3)
    claim_thesis("tets", 126, 4.5)
    claim_scaling()
    printf "\n%d of %d hold. The errors of the frames stand in the tables below (of volumes against VTK at equal error: docs/accuracy.md); the peers' pictures agree with ours:\n\n", held, claims
    print "| | mesh | pixels that only one shows | difference in depth | of 99 % of pixels at most |"
    print "|---|---|--:|--:|--:|"
    for (i = 1; i <= meshes["peers"]; i++) {
        agreement("VTK", mesh["peers", i], side["peers", i], "isosurface vtk")
        agreement("Embree", mesh["peers", i], side["peers", i], "isosurface embree")
    }
    print "\nDepths in sides of a cube. VTK's extraction cuts hexes by cases and makes triangles of them, the trilinear surface is"
    print "curved: this is what its depths differ by. Tets are the same planes for all."
    print "\nEmbree's trace is of triangles that were extracted and put into a tree before. \"From all cells\" the picture's time"
    print "includes to find what is crossed; \"kept\" is a further picture of a step that has several, for which the first kept it."
}

function agreement(name, m, n, measure,    k) {
    k = key_of("peers", m, n, measure " depth difference")
    if (!(k in median)) return
    printf "| %s | %s %d | %s %% | %s | %s |\n", name, m, n,
        number(100 * value("peers", m, n, measure " coverage difference")), number(median[k] * n / 2), number(high[k] * n / 2)
}

# ---- time to picture ----

function milliseconds(program, m, n, measure) { return has(program, m, n, measure) ? number(value(program, m, n, measure)) : "–" }

function section_steps(picture, title,    i, m, n) {
    print "\n### " title "\n"
    print "| mesh | cells | new values | moved vertices | new mesh | VTK extract | + first render (later ones) | Embree build, Morton / SAH | trace | extract + build + trace, Morton / SAH |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["steps"]; i++) {
        m = mesh["steps", i]; n = side["steps", i]
        printf "| %s %d | %d | %s | %s | %s | %s | %s (%s) | %s / %s | %s / %s | %s / %s |\n", m, n, cells["steps", m, n],
            spread("steps", m, n, picture " new values"), spread("steps", m, n, picture " moved vertices"),
            spread("steps", m, n, picture " new mesh"), milliseconds("steps", m, n, picture " vtk extract"),
            milliseconds("steps", m, n, picture " vtk route"), milliseconds("steps", m, n, picture " vtk later render"),
            milliseconds("steps", m, n, picture " embree build low"), milliseconds("steps", m, n, picture " embree build medium"),
            milliseconds("steps", m, n, picture " embree trace low"), milliseconds("steps", m, n, picture " embree trace medium"),
            milliseconds("steps", m, n, picture " embree route low"), milliseconds("steps", m, n, picture " embree route medium")
    }
}

function section_views(    i, m, n) {
    print "\n### Several views of one isosurface in a step\n"
    print "Of the renderer alone; Embree's trace is of its faster tree.\n"
    print "| mesh | cells | one picture | the first of several | each further one | Embree trace |"
    print "|---|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["peers"]; i++) {
        m = mesh["peers", i]; n = side["peers", i]
        if (!has("peers", m, n, "isosurface trace kept")) continue
        printf "| %s %d | %d | %s | %s | %s | %s |\n", m, n, cells["peers", m, n], spread("peers", m, n, "isosurface trace"),
            spread("peers", m, n, "isosurface trace keeping"), spread("peers", m, n, "isosurface trace kept"),
            number(embree_trace(m, n))
    }
}

function section_volumes(    i, m, n) {
    print "\n### Volume\n"
    print "1080 x 1080, samples half a side of a cube apart; of VTK's mappers the first picture includes what they prepare of the"
    print "mesh. Frames are of the renderer alone, with the median and the largest error against the integral.\n"
    print "| mesh | cells | new values | moved vertices | new mesh | VTK ray cast, first / later | projected tets, first / later |"
    print "|---|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["volumes"]; i++) {
        m = mesh["volumes", i]; n = side["volumes", i]
        printf "| %s %d | %d | %s | %s | %s | %s / %s | %s / %s |\n", m, n, cells["volumes", m, n],
            spread("volumes", m, n, "volume new values"), spread("volumes", m, n, "volume moved vertices"),
            spread("volumes", m, n, "volume new mesh"), milliseconds("volumes", m, n, "volume vtk ray cast first"),
            milliseconds("volumes", m, n, "volume vtk ray cast frame"),
            milliseconds("volumes", m, n, "volume vtk projected tets first"),
            milliseconds("volumes", m, n, "volume vtk projected tets frame")
    }
    print "\n| mesh | samples | error | max_error 1e-1 | error | max_error 1e-3 | error | segments | error | VTK ray cast | error | projected tets | error |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["volumes"]; i++) {
        m = mesh["volumes", i]; n = side["volumes", i]
        printf "| %s %d |", m, n
        frame_and_error(m, n, "samples"); frame_and_error(m, n, "max_error 1e-1")
        frame_and_error(m, n, "max_error 1e-3"); frame_and_error(m, n, "segments")
        frame_and_error(m, n, "vtk ray cast"); frame_and_error(m, n, "vtk projected tets")
        print ""
    }
}

function frame_and_error(m, n, what) {
    printf " %s | %s |", spread("volumes", m, n, "volume " what " frame"), most("volumes", m, n, "volume " what " integral error", 1)
}

function parts_row(program, m, n, what) {
    if (!has(program, m, n, what)) return
    printf "| %s %d, %s | %s | %s | %s | %s | %s | %s | %s | %s |\n", m, n, what, milliseconds(program, m, n, what),
        milliseconds(program, m, n, what " prepare"), milliseconds(program, m, n, what " build"),
        milliseconds(program, m, n, what " refit"), milliseconds(program, m, n, what " trace"),
        milliseconds(program, m, n, what " composite"), milliseconds(program, m, n, what " trees"),
        milliseconds(program, m, n, what " peak")
}

function parts_rows(program, picture,    i, m, n) {
    for (i = 1; i <= meshes[program]; i++) {
        m = mesh[program, i]; n = side[program, i]
        parts_row(program, m, n, picture " new values")
        parts_row(program, m, n, picture " moved vertices")
        parts_row(program, m, n, picture " new mesh")
    }
}

function section_parts() {
    print "\n### Where a step's time goes\n"
    print "| step | all | prepare | build | refit | trace | composite | trees, B/cell | most held, B/cell |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|"
    parts_rows("steps", "isosurface")
    parts_rows("steps", "isosurfaces")
    parts_rows("volumes", "volume")
}

# ---- trees and frames ----

function section_render(    i, m, n) {
    print "\n## Trees and frames\n"
    print "| mesh | n | cells | build, Mcells/s | refit ranges, Mcells/s | refit bounds, Mcells/s | tree, bytes/cell | peak of the build, bytes/cell |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["render"]; i++) {
        m = mesh["render", i]; n = side["render", i]
        printf "| %s | %d | %d | %s | %s | %s | %s | %s |\n", m, n, cells["render", m, n], spread("render", m, n, "build"),
            spread("render", m, n, "refit ranges"), spread("render", m, n, "refit bounds"),
            spread("render", m, n, "tree size"), spread("render", m, n, "build peak")
    }
    print "\n| mesh | n | isosurface, Mrays/s | depth error | hit or miss differs | closed form | peak, MB |"
    print "|---|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["render"]; i++) surface_row("render", mesh["render", i], side["render", i], "isosurface")
    print "\n| mesh | n | volume, Mrays/s | error | peak, MB |"
    print "|---|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["render"]; i++) {
        m = mesh["render", i]; n = side["render", i]
        printf "| %s | %d | %s | %s | %s |\n", m, n, spread("render", m, n, "volume"), most("render", m, n, "volume error", 1),
            spread("render", m, n, "volume peak")
    }
}

function disagreements(program, m, n, name) {
    return sprintf("%d (%d) of %d", value(program, m, n, name " disagreements"), value(program, m, n, name " ambiguous"),
        value(program, m, n, name " checked"))
}

function surface_row(program, m, n, name) {
    printf "| %s | %d | %s | %s | %s | %s | %s |\n", m, n, spread(program, m, n, name),
        most(program, m, n, name " depth error", n / 2), disagreements(program, m, n, name),
        most(program, m, n, name " field error", 1), spread(program, m, n, name " peak")
}

# ---- the thesis's tables ----

function section_builders(    i, m, n) {
    print "\n### Builders\n"
    print "Milliseconds; Embree's are of boxes made beforehand, in the memory of its last build, without values. Cost: boxes and cells"
    print "that a ray tests, each 1.\n"
    print "| mesh | n | cells | SAH | its cost | Morton | Embree LOW | its cost | MEDIUM, binary | its cost | MEDIUM, 8-wide |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes["peers"]; i++) {
        m = mesh["peers", i]; n = side["peers", i]
        printf "| %s | %d | %d | %s | %s | %s | %s | %s | %s | %s | %s |\n", m, n, cells["peers", m, n],
            spread("peers", m, n, "build sah"), milliseconds("peers", m, n, "build sah cost"),
            spread("peers", m, n, "build morton"), spread("peers", m, n, "embree cells low"),
            milliseconds("peers", m, n, "embree cells low cost"), spread("peers", m, n, "embree cells medium"),
            milliseconds("peers", m, n, "embree cells medium cost"), spread("peers", m, n, "embree cells medium wide")
    }
}

function section_sizes(    p, i, m, n) {
    p = "tables sizes"
    if (!meshes[p]) return
    print "\n## The thesis's tables in kind\n"
    print "Volumes of these are of 640 x 360 pixels; their errors are against the integral, which is what the step costs."
    print "\n### Table 4.1: traversals, Mrays/s\n"
    print "| mesh | n | cells | binned | error in depth | tiles | packets | error in depth | SPMD | error in depth |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes[p]; i++) {
        m = mesh[p, i]; n = side[p, i]
        printf "| %s | %d | %d | %s | %s | %s | %s | %s | %s | %s |\n", m, n, cells[p, m, n],
            spread(p, m, n, "isosurface binned"), most(p, m, n, "isosurface binned depth error", n / 2),
            spread(p, m, n, "isosurface tiles"),
            spread(p, m, n, "isosurface packets"), most(p, m, n, "isosurface packets depth error", n / 2),
            spread(p, m, n, "isosurface spmd"), most(p, m, n, "isosurface spmd depth error", n / 2)
    }
    print "\n### Table 5.2: sizes\n"
    print "| mesh | n | cells | isosurface, Mrays/s | error in depth | hit or miss differs | volume, Mrays/s | error | build, s | process, GiB |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes[p]; i++) {
        m = mesh[p, i]; n = side[p, i]
        printf "| %s | %d | %d | %s | %s | %s | %s | %s | %s | %s |\n", m, n, cells[p, m, n], spread(p, m, n, "isosurface"),
            most(p, m, n, "isosurface depth error", n / 2), disagreements(p, m, n, "isosurface"), spread(p, m, n, "volume"),
            most(p, m, n, "volume integral error", 1), spread(p, m, n, "build"), spread(p, m, n, "process peak")
    }
}

function section_groups(    p, i, g, m, n, line) {
    p = "tables groups"
    if (!meshes[p]) return
    split("1 4 8 16 24 32", group, " ")
    print "\n### Table 4.2: samples looked up together, Mrays/s\n"
    print "| mesh | n | cells | 1 | 4 | 8 | 16 | 24 | 32 | error | by tiles |"
    print "|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= meshes[p]; i++) {
        m = mesh[p, i]; n = side[p, i]
        line = ""
        for (g = 1; g <= 6; g++) line = line " | " milliseconds(p, m, n, "volume group " group[g])
        printf "| %s | %d | %d%s | %s | %s |\n", m, n, cells[p, m, n], line, most(p, m, n, "volume group 16 integral error", 1),
            milliseconds(p, m, n, "volume tiles")
    }
}

function section_step_sizes(    p, i, g, m, n, line) {
    p = "tables steps"
    if (!meshes[p]) return
    m = mesh[p, 1]; n = side[p, 1]
    split("0.125 0.25 0.375 0.5 0.625 0.75", step, " ")
    print "\n### Table 4.3: steps and groups, Mrays/s\n"
    print "On " m " " n ". A step in sides of a cube; other tables take 0.5.\n"
    print "| step | 1 | 4 | 8 | 16 | 24 | 32 | error | by tiles |"
    print "|--:|--:|--:|--:|--:|--:|--:|--:|--:|"
    for (i = 1; i <= 6; i++) {
        line = ""
        for (g = 1; g <= 6; g++) line = line " | " milliseconds(p, m, n, "volume step " step[i] " group " group[g])
        printf "| %s%s | %s | %s |\n", step[i], line, most(p, m, n, "volume step " step[i] " group 16 integral error", 1),
            milliseconds(p, m, n, "volume step " step[i] " tiles")
    }
}

function scaling_row(width, name, t,    p, m, n) {
    p = "scaling " width " " t
    if (!meshes[p]) return
    m = mesh[p, 1]; n = side[p, 1]
    printf "| %s | %d | %s | %s | %s | %s |\n", name, t, spread(p, m, n, "isosurface"),
        most(p, m, n, "isosurface depth error", n / 2), spread(p, m, n, "volume"), most(p, m, n, "volume integral error", 1)
}

function section_scaling(    p, t) {
    p = "scaling avx512 " most_threads
    if (!most_threads) return
    print "\n## Instruction sets and threads\n"
    print "On " mesh[p, 1] " " side[p, 1] ". Where the time of an isosurface goes by lanes, and what does not gain from them: docs/decisions.md.\n"
    print "| lanes | threads | isosurface, Mrays/s | error in depth | volume, Mrays/s | error |"
    print "|---|--:|--:|--:|--:|--:|"
    for (t = most_threads; t >= 1; t = t > 1 ? 1 : 0) {
        scaling_row("avx512", "16, AVX-512", t)
        scaling_row("avx2", "8, AVX2", t)
        scaling_row("sse4.2", "4, SSE4.2", t)
        scaling_row("plain", "4, plain C", t)
    }
}

# ---- the page ----

function page(    p, words) {
    for (p in meshes)
        if (p ~ /^scaling/) {
            split(p, words, " ")
            if (words[3] + 0 > most_threads) most_threads = words[3] + 0
        }
    print "# Performance"
    print ""
    print "Drawn by `bench/run` from bench/results/*.csv; do not edit."
    print ""
    print "The mesh is the cube [-1, 1]^3 of n^3 cubes, inner vertices jittered by up to 0.2 of a cube's side, as hexes or as six"
    print "tets each; float32 coordinates and values, int32 indices. The field is sin 6x cos 6y + sin 6y cos 6z + sin 6z cos 6x. Images"
    print "are 1920 x 1080 from (2.4, 1.6, 3.0) to the origin, 40 degrees vertical: every pixel's ray counts, those that miss too."
    print "The isosurface is at 0.3 (three: and at -0.5 and 1), shaded, by the robust root finder. The volume has a tent of opacity"
    print "over |f| < 0.6 (at its peak 0.5 in a length of 0.5), samples each half side of a cube, jittered, in groups of 64."
    print ""
    print "A speed is the median of the runs, with the least and the greatest of them. Beside it stands the error on one pixel in each"
    print "block of 60 x 60, against brute force in double over all cells: of the isosurface the difference in depth, in sides of a"
    print "cube, and of how many pixels one says hit and the other miss; of the volume the largest difference of linear red,"
    print "green, blue or opacity. \"Closed form\" is how far the field's formula is from the isovalue at the points hit: what linear or"
    print "trilinear cells cost, whoever draws them. In brackets: how many of the disagreements are rays that meet more than one root"
    print "in a cell, where the method takes a cell's two ends for the whole of it."
    print ""
    printf "%s. %s, %d threads.", machine, isa["render"], threads["render"]
    print " Load and duration of each section stand in its CSV."
    section_claims()
    print "\n## Time to picture\n"
    print "Milliseconds, medians. Ours are whole calls of insitu_step() by one rank, compositing and the image on rank 0 included and"
    print "its file left out; with the least and the greatest. VTK's extraction (vtkContour3DLinearGrid, TBB, no merging of points, no"
    print "normals) begins at arrays in VTK's own form, which cost it nothing; its picture stays in Mesa's frame buffer. Embree's"
    print "route begins at VTK's triangles and ends at a buffer of depths and normals, without shading."
    section_steps("isosurface", "One isosurface")
    section_steps("isosurfaces", "Three isosurfaces")
    section_views()
    section_volumes()
    section_parts()
    section_render()
    section_builders()
    section_sizes()
    section_groups()
    section_step_sizes()
    section_scaling()
}

# Draws error over time, a panel a mesh: gnuplot -e "csv='...'; out='...'; layer='volume'; meshes='a b c d'; size=512" \
#            accuracy.gp
set terminal pngcairo size 1500,1180 font "DejaVu Sans,11" background rgb "white"
set output out
set datafile separator ","
set datafile missing NaN
set logscale xy
set grid xtics ytics lc rgb "#cccccc" lw 1
set border 3 lc rgb "#555555"
set tics nomirror
set format y "10^{%L}"
set xtics (1, 2, 5, 10, 20, 50, 100, 200, 500, "1 s" 1000, "2 s" 2000, "5 s" 5000, "10 s" 10000, "20 s" 20000, "50 s" 50000)
set key off
set xlabel "milliseconds a frame" offset 0,0.4

# Rows of the CSV.
own(mesh, method, column) = (strcol(4) eq mesh && $6 == size && strcol(7) eq layer && strcol(8) eq method && strcol(10) eq "ok") ? column : NaN
setting(mesh, method, name, column) = strcol(9) eq name ? own(mesh, method, column) : NaN
above(y, least) = y > least ? y : least
# The panel whose plot carries the key of all.
key_panel = words(meshes) < 3 ? words(meshes) : 3

title_of(mesh) = mesh." — ".system(sprintf("awk -F, '$4 == \"%s\" { print $5; exit }' %s", mesh, csv))." cells"

if (layer eq "volume") {
    set ylabel "largest error of a channel" offset 1,0
    set yrange [2e-8:1.5]
    floor = 4e-8
    set arrow 1 from graph 0, first 1/510. to graph 1, first 1/510. nohead lc rgb "#bbbbbb" dt 2
    set label 1 "half a step of 8 bits in mid-tones" at graph 0.995, first 0.0027 right font ",8" tc rgb "#888888"
    set label 2 "better: left and down" at graph 0.01, graph 0.03 left font ",8" tc rgb "#888888"
    set multiplot layout 2,2 margins 0.06,0.975,0.16,0.965 spacing 0.06,0.085
    panel = 0
    do for [mesh in meshes] {
        set title title_of(mesh) noenhanced offset 0,-0.6
        # Cells that are linear are one segment, whatever its length.
        parts = int(system(sprintf("awk -F, '$4 == \"%s\" && $6 == %d && $8 == \"segments\"' %s | wc -l", mesh, size, csv)))
        panel = panel + 1
        if (panel == key_panel) { set key at screen 0.5,0.06 center center vertical maxrows 3 Left reverse samplen 2 width 2 } else { set key off }
        plot csv using (own(mesh, "samples", $13)):(above($19, floor)) with linespoints lc rgb "#1f5fbf" pt 7 ps 0.9 lw 1.5 notitle, \
             csv using (own(mesh, "samples", $13)):(above($19, floor)):9 with labels font ",7" tc rgb "#1f5fbf" offset 1.3,0.45 notitle, \
             csv using (own(mesh, "frames", $13)):(above($19, floor)) with linespoints lc rgb "#7fb2e5" pt 6 ps 0.8 lw 1.2 notitle, \
             csv using (own(mesh, "segments", $13)):(above($19, floor)) with linespoints lc rgb "#117733" pt 5 ps 0.9 lw 1.5 notitle, \
             csv using (own(mesh, "segments", $13)):(above($19, floor)):(parts > 1 ? strcol(9) : "") with labels font ",7" tc rgb "#117733" offset 1.3,0.45 notitle, \
             csv using (own(mesh, "max_error", $13)):(above($19, floor)) with linespoints lc rgb "#44aa66" pt 9 ps 1.2 lw 1.2 dt 3 notitle, \
             csv using (setting(mesh, "VTK ray cast", "partial pre-integration", $13)):(above($19, floor)) with points lc rgb "#cc3311" pt 13 ps 1.7 notitle, \
             csv using (setting(mesh, "VTK ray cast", "linear integrator", $13)):(above($19, floor)) with points lc rgb "#cc3311" pt 12 ps 1.9 lw 1.5 notitle, \
             csv using (own(mesh, "VTK Z-sweep", $13)):(above($19, floor)) with points lc rgb "#aa4499" pt 15 ps 1.6 notitle, \
             csv using (own(mesh, "VTK projected tets", $13)):(above($19, floor)) with points lc rgb "#882255" pt 11 ps 1.5 notitle, \
             csv using (own(mesh, "VTK resample", $13)):(above($19, floor)) with linespoints lc rgb "#ee7733" pt 4 ps 1.2 lw 1.2 notitle, \
             csv using (own(mesh, "VTK resample", $13)):(above($19, floor)):9 with labels font ",7" tc rgb "#ee7733" offset 0,0.8 notitle, \
             keyentry with linespoints lc rgb "#1f5fbf" pt 7 ps 0.9 lw 1.5 title "samples, 4 to 1/16 cell", \
             keyentry with linespoints lc rgb "#7fb2e5" pt 6 ps 0.8 lw 1.2 title "samples a cell apart, 1, 2, 4 ... frames", \
             keyentry with linespoints lc rgb "#117733" pt 5 ps 0.9 lw 1.5 title "segments, 4 to 1/8 cell", \
             keyentry with linespoints lc rgb "#44aa66" pt 9 ps 1.2 lw 1.2 dt 3 title "max\\_error 1e-1 to 1e-4", \
             keyentry with points lc rgb "#cc3311" pt 13 ps 1.7 title "VTK ray cast, partial pre-integration", \
             keyentry with points lc rgb "#cc3311" pt 12 ps 1.9 lw 1.5 title "VTK ray cast, linear integrator", \
             keyentry with points lc rgb "#aa4499" pt 15 ps 1.6 title "VTK Z-sweep", \
             keyentry with points lc rgb "#882255" pt 11 ps 1.5 title "VTK projected tets", \
             keyentry with linespoints lc rgb "#ee7733" pt 4 ps 1.2 lw 1.2 title "VTK resampled"
    }
} else {
    set ylabel "largest depth error, cells" offset 1,0
    set yrange [1e-7:1.5]
    floor = 1.2e-7
    set offsets graph 0.15, graph 0.3, 0, 0
    note(rows, name, wrong) = rows == 0 ? name : name.": ".wrong." wrong"
    set multiplot layout 2,2 margins 0.06,0.975,0.09,0.965 spacing 0.06,0.085
    panel = 0
    do for [mesh in meshes] {
        set title title_of(mesh) noenhanced offset 0,-0.6
        panel = panel + 1
        if (panel == key_panel) { set key at screen 0.5,0.022 center center vertical maxrows 1 Left reverse samplen 2 width 2 } else { set key off }
        plot csv using (own(mesh, "Neubauer", $13)):(above($19, floor)) with linespoints lc rgb "#1f5fbf" pt 7 ps 1 lw 1.5 notitle, \
             csv using (own(mesh, "Neubauer", $13)):(above($19, floor)):(note($20, strcol(9), strcol(20))) with labels left font ",9" tc rgb "#1f5fbf" offset 0.8,0.45 notitle, \
             csv using (own(mesh, "Neubauer packets", $13)):(above($19, floor)) with linespoints lc rgb "#77aadd" pt 9 ps 0.9 lw 1.2 dt 3 notitle, \
             csv using (own(mesh, "Neubauer SPMD", $13)):(above($19, floor)) with linespoints lc rgb "#bbccee" pt 11 ps 0.9 lw 1.2 dt 3 notitle, \
             csv using (own(mesh, "robust packets", $13)):(above($19, floor)) with points lc rgb "#66bb88" pt 9 ps 1.2 notitle, \
             csv using (own(mesh, "robust SPMD", $13)):(above($19, floor)) with points lc rgb "#aaddbb" pt 11 ps 1.2 notitle, \
             csv using (own(mesh, "robust", $13)):(above($19, floor)) with points lc rgb "#117733" pt 5 ps 1.3 notitle, \
             csv using (own(mesh, "robust", $13)):(above($19, floor)):(note($20, strcol(9), strcol(20))) with labels left font ",9" tc rgb "#117733" offset 0.8,0.45 notitle, \
             keyentry with linespoints lc rgb "#1f5fbf" pt 7 ps 1 lw 1.5 title "Neubauer's method", \
             keyentry with linespoints lc rgb "#77aadd" pt 9 ps 0.9 lw 1.2 dt 3 title "by packets", \
             keyentry with linespoints lc rgb "#bbccee" pt 11 ps 0.9 lw 1.2 dt 3 title "by SPMD", \
             keyentry with points lc rgb "#117733" pt 5 ps 1.3 title "robust roots (packets, SPMD: paler)"
    }
}
unset multiplot

# Force from one simulated sensor: reference and estimate over time, and the errors of two calibrations.
#   gnuplot -e "out='force.png'; one='conductance.dat'; both='weighted.dat'" scripts/figures/force.gnuplot
# The files have four columns: time_s, force_N (reference), force_estimate_N, force_estimate_std_N.
set terminal pngcairo size 900,560 font "sans,11"
set output out
set multiplot
set lmargin 9
set rmargin 3
set border 3
set tics nomirror out
set grid ytics lc rgb "#dddddd"
set style fill transparent solid 0.25 noborder

set origin 0, 0.42
set size 1, 0.58
set format x ""
set ylabel "force / N"
set key top left Left reverse samplen 2
set title "One of eight simulated sensors, a run it was not calibrated on" font ",14"
set yrange [0:330]
plot both using 1:3 with lines lw 1.5 lc rgb "#1f77b4" title "estimate from conductance and capacitance", \
	both using 1:2 with points pt 7 ps 0.25 lc rgb "black" title "reference"

set origin 0, 0
set size 1, 0.44
unset title
set format x "%g"
set xlabel "time / s"
set ylabel "error / N"
set key top left Left reverse samplen 2 horizontal
set yrange [-3.5:5.5]
plot both using 1:(-2 * $4):(2 * $4) with filledcurves lc rgb "#1f77b4" title "± 2 standard uncertainties", \
	one using 1:($3 - $2) with lines lw 1.5 lc rgb "#d6604d" title "conductance alone", \
	both using 1:($3 - $2) with lines lw 1.5 lc rgb "#1f77b4" title "conductance and capacitance"
unset multiplot

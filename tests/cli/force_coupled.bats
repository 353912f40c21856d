# `tactus force` where channels feel each other: a scan is solved as a whole, wherever the input is cut.
load common

coupled_model() {
	cat >model.toml <<'TOML'
kind = "model"
format = 1
domain = "sensor"
form = "forward"
input = "force_N"
effects = ["mechanical-crosstalk"]
[output.conductance_S]
column = "conductance_S"
[effect.mechanical-crosstalk]
coupling_below = 0.2
coupling_above = 0.3
[[channel]]
channel = 1
base = { g0 = 1e-6, g1 = 4e-7 }
[[channel]]
channel = 2
base = { g0 = 1e-6, g1 = 4e-7 }
[[channel]]
channel = 3
base = { g0 = 1e-6, g1 = 4e-7 }
TOML
}

# Three channels whose loads jump from scan to scan: a neighbour as it was is a wrong neighbour.
coupled_scans() {
	awk -v scans="$1" 'BEGIN {
		print "time_s,sequence,channel,conductance_S"
		for (i = 0; i < scans; i++)
			for (c = 1; c <= 3; c++)
				printf "%.10g,%d,%d,%.10g\n", i / 10, i, c, 1e-6 + 4e-7 * (10 + (i * 37 + c * 17) % 23)
	}'
}

@test "a scan is not cut where a block ends: forces solve the equations of all three channels" {
	coupled_model
	coupled_scans 5000 >scans.csv
	tactus force -m model.toml scans.csv -o out.csv
	run -0 awk -F, '/^#/ { next } !f { for (i = 1; i <= NF; i++) if ($i == "force_estimate_N") f = i; next }
		{ n++; y[$3] = ($4 - 1e-6) / 4e-7; x[$3] = $f }
		$3 == 3 { e = 0; a = .3; b = .2
			d[1] = x[1] + a * x[2] - y[1]; d[2] = b * x[1] + x[2] + a * x[3] - y[2]; d[3] = b * x[2] + x[3] - y[3]
			for (c = 1; c <= 3; c++) if (d[c] > 1e-6 || d[c] < -1e-6) bad++ }
		END { print n, bad + 0 }' out.csv
	[ "$output" = "15000 0" ] || fail "rows and residuals"
}

@test "pieces of any size give the same bits, as CSV and as JSON Lines, and the last scan comes though it is short" {
	coupled_model
	coupled_scans 60 | head -n -1 >scans.csv
	tactus force -m model.toml scans.csv >whole.csv
	[ "$(grep -vc '^[#t]' whole.csv)" -eq 179 ] || fail "rows are missing"
	tactus force -m model.toml scans.csv --format jsonl >whole.jsonl
	for bytes in 7 50 333 1000; do
		perl -e '$| = 1; local $/ = \$ARGV[0]; while (<STDIN>) { syswrite STDOUT, $_; select undef, undef, undef, 0.0005 }' \
			$bytes <scans.csv | tactus force -m model.toml >pieces.csv
		cmp whole.csv pieces.csv
	done
	perl -e '$| = 1; local $/ = \400; while (<STDIN>) { syswrite STDOUT, $_; select undef, undef, undef, 0.0005 }' \
		<whole.jsonl | tactus force -m model.toml --format jsonl >pieces.jsonl
	cmp whole.jsonl pieces.jsonl
}

@test "live: a scan passes as soon as it is complete, once it is known how scans end" {
	coupled_model
	coupled_scans 4 >scans.csv
	mkfifo in out
	tactus force -m model.toml <in >out &
	exec 7>in 8<out
	rows() { # N: as many rows come while no more input does
		local line n=0
		while [ $n -lt "$1" ] && IFS= read -r -t 20 line <&8; do [[ $line == [0-9]* ]] && n=$((n + 1)); done
		[ $n -eq "$1" ] || fail "$n rows instead of $1"
	}
	sed -n '1,5p' scans.csv >&7 # two scans begun: the first is complete
	rows 3
	sed -n '6,7p' scans.csv >&7 # the second is, for it has come as far as the first
	rows 3
	sed -n '8,9p' scans.csv >&7 # the third is not …
	exec 7>&-                   # … and will not be
	rows 2
	wait
}

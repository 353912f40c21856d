#!/usr/bin/env bats
# What devices, force, simulate, show and join do, option by option.
load common

model=$examples/model-forward.toml

@test "devices: the two built-in benches, as lines and as JSON, and their URIs open" {
	run --separate-stderr tactus devices
	status_is 0
	prints "sim:paredes"
	prints "sim:lebosse"
	tactus devices --json >devices.json
	for uri in $(jq -r '.devices[].uri | select(startswith("sim:"))' devices.json); do # not what is plugged in here
		tactus scan "$uri" --count 1 >/dev/null
	done
	[ "$(jq '.devices | length' devices.json)" -eq "$(tactus devices | wc -l)" ]
}

# ---- force --------------------------------------------------------------------------------------------------------

# G = g0 + g1 F without effects: what `force` must give back is arithmetic.
plain_model() {
	cat <<-'EOM'
		kind = "model"
		format = 1
		domain = "sensor"
		form = "forward"
		[output.conductance_S]
		[[channel]]
		channel = 1
		input_range = [0, 200]
		base = { g0 = 1.2e-6, g1 = 4.1e-7 }
		[channel.reading.conductance_S]
		residual_std = 4.1e-8
		[[channel]]
		channel = 2
		input_range = [0, 100]
		base = { g0 = 1.2e-6, g1 = 4.51e-7 }
		[channel.reading.conductance_S]
		residual_std = 4.1e-8
	EOM
}

@test "force: (G - g0)/g1, its standard uncertainty, and what is out of range says so" {
	plain_model >m.toml
	recording >run.csv
	tactus force -m m.toml run.csv >newtons.csv
	"$PYTHON" - <<-'EOP'
		import csv
		rows = list(csv.DictReader(l for l in open("newtons.csv") if not l.startswith("#")))
		assert len(rows) == 80
		for r in rows:
		    c, g, f = int(r["channel"]), float(r["conductance_S"]), float(r["force_N"])
		    slope = {1: 4.1e-7, 2: 4.51e-7}[c]
		    estimate = float(r["force_estimate_N"])
		    assert abs(estimate - (g - 1.2e-6) / slope) < 1e-9 * max(1, abs(estimate)), r
		    assert abs(estimate - f) < 1e-3, r
		    assert abs(float(r["force_estimate_std_N"]) - 4.1e-8 / slope) < 1e-6, r
		    assert ("extrapolated" in r["quality"]) == (f > {1: 200, 2: 100}[c] + 1e-9), r
	EOP
}

@test "force: the model's fingerprint is in the metadata, and is that which show prints" {
	plain_model >m.toml
	recording 2 | tactus force -m m.toml >newtons.csv
	[ "$(metadata model <newtons.csv)" = "$(tactus show m.toml --json | jq -r .fingerprint)" ]
	[ "$(metadata model <newtons.csv | wc -c)" -eq 17 ]
}

@test "force: a channel that the model does not have is kept and flagged" {
	plain_model | sed '/channel = 2/,$d' | sed '$d' >m.toml
	recording 3 | tactus force -m m.toml >newtons.csv
	[ "$(column quality <newtons.csv | sort | uniq -c | tr -s ' ' | tr '\n' ';')" = " 3 ok; 3 uncalibrated;" ]
	[ "$(wc -l <newtons.csv)" -ge 7 ]
}

@test "force: a recording of which no reading becomes a force is said to lack what the model needs" {
	tactus scan sim: --mode ac --count 2 -o ac.csv
	tactus scan sim: --mode dc --count 2 -o dc.csv
	run -0 --separate-stderr tactus force -m "$examples/model-weighted.toml" ac.csv
	says "needs conductance_S of dc rows and capacitance_F of ac rows"
	says "there is no conductance_S of dc rows"
	run -0 --separate-stderr tactus force -m "$examples/model-weighted.toml" dc.csv
	says "there is no capacitance_F of ac rows"
	run -0 --separate-stderr tactus force -m "$examples/model-weighted.toml" "$examples/recording-readout.csv"
	says "no reading became a force"
	run -0 --separate-stderr tactus scan sim: --mode ac --count 2 -m "$examples/model-weighted.toml"
	says "there is no conductance_S of dc rows"
	recording 2 | sed 's/^\([0-9.]*,[0-9]*\),./\1,99/' >other.csv
	plain_model >m.toml
	run -0 --separate-stderr tactus force -m m.toml other.csv
	says "quality says why"
	recording 2 >some.csv
	run -0 --separate-stderr tactus force -m m.toml some.csv
	[ -z "$stderr" ] || fail "there are forces"
}

@test "force: a directory is no model, and is called what it is" {
	run -3 --separate-stderr tactus force -m . <<<""
	[ "$stderr" = "tactus force: .: is a directory" ] || fail "what is it"
}

@test "force: estimating twice replaces the columns" {
	plain_model >m.toml
	recording | tactus force -m m.toml >once.csv
	tactus force -m m.toml once.csv | cmp - once.csv
}

@test "force and simulate without a model, status 2" {
	recording >run.csv
	for c in force simulate; do
		run --separate-stderr tactus $c run.csv
		status_is 2
		says "-m"
	done
}

# ---- simulate -------------------------------------------------------------------------------------------------------

@test "simulate: g0 + g1 F, and force gives the force back" {
	plain_model >m.toml
	recording | cut -d, -f1-4 >loads.csv
	tactus simulate -m m.toml loads.csv >simulated.csv
	tactus force -m m.toml simulated.csv >back.csv
	"$PYTHON" - <<-'EOP'
		import csv
		rows = list(csv.DictReader(l for l in open("back.csv") if not l.startswith("#")))
		assert len(rows) == 80
		for r in rows:
		    f, slope = float(r["force_N"]), {1: 4.1e-7, 2: 4.51e-7}[int(r["channel"])]
		    assert abs(float(r["conductance_S"]) - (1.2e-6 + slope * f)) < 1e-18, r
		    assert abs(float(r["force_estimate_N"]) - f) < 1e-9, r
	EOP
}

@test "simulate --protocol: rows, times, channels and loads are those asked for" {
	plain_model >m.toml
	tactus simulate -m m.toml --protocol "rest 1s, hold 30N 1s" --rate 4Hz >run.csv
	[ "$(column time_s <run.csv | wc -l)" -eq 16 ]
	[ "$(column time_s <run.csv | uniq | tr '\n' ' ')" = "0 0.25 0.5 0.75 1 1.25 1.5 1.75 " ]
	[ "$(column sequence <run.csv | uniq | tr '\n' ' ')" = "0 1 2 3 4 5 6 7 " ]
	[ "$(column channel <run.csv | tr '\n' ' ')" = "1 2 1 2 1 2 1 2 1 2 1 2 1 2 1 2 " ]
	[ "$(column force_N <run.csv | sort -n | uniq -c | tr -s ' ' | tr '\n' ';')" = " 8 0; 8 30;" ]
	[ "$(metadata protocol <run.csv)" = "rest 1s, hold 30N 1s" ]
	tactus simulate -m m.toml --protocol "hold 30N 1s" --rate 4Hz --channels 2 >two.csv
	[ "$(column channel <two.csv | uniq)" = 2 ]
	# 6000 scans of two channels are more than one block
	[ "$(tactus simulate -m m.toml --protocol "sine 1Hz 1N..3N 6s" --rate 1kHz | column sequence | uniq | wc -l)" -eq 6000 ]
}

@test "simulate --noise: as large as the residuals, the same for the same seed, another for another" {
	plain_model >m.toml
	p=(--protocol "hold 30N 10s" --rate 200Hz --noise)
	tactus simulate -m m.toml "${p[@]}" --seed 7 >a
	tactus simulate -m m.toml "${p[@]}" --seed 7 >b
	cmp a b
	if tactus simulate -m m.toml "${p[@]}" --seed 8 | cmp -s - a; then fail "seed 8 gives what seed 7 gives"; fi
	# Of 2000 values the standard deviation is right to 1.6 % (1 sigma): 8 % are five.
	column conductance_S <a | awk 'NR % 2 { n++; s += $1; q += $1 * $1 } END { d = sqrt(q / n - (s / n)^2); exit !(n == 2000 && d > 0.92 * 4.1e-8 && d < 1.08 * 4.1e-8) }'
}

@test "simulate: usage that contradicts itself is refused" {
	plain_model >m.toml
	recording >run.csv
	for args in "run.csv --rate 10Hz" "--protocol rest,2 --rate 10Hz" "run.csv --seed 0"; do
		run --separate-stderr tactus simulate -m m.toml $args
		status_is 2
	done
	run --separate-stderr tactus simulate -m m.toml --protocol "rest 2s"
	status_is 2
	says "--rate"
	run --separate-stderr tactus simulate -m m.toml run.csv --protocol "rest 2s" --rate 10Hz
	status_is 2
	says "not from both"
	run --separate-stderr tactus simulate -m m.toml --protocol "rest 2s, sing 3N 1s" --rate 10Hz
	status_is 2
	says "sing"
	for bad in 1- a 1,,2 -3 99999 1-2-3; do
		run --separate-stderr tactus simulate -m m.toml --protocol "rest 2s" --rate 10Hz --channels "$bad"
		status_is 2
		says "--channels: '$bad'"
	done
}

@test "an estimator is refused alike by all that need a forward model: status 2" {
	recording >run.csv
	for command in simulate diagnose fit; do
		run --separate-stderr tactus $command -m "$examples/model-linear.toml" run.csv
		status_is 2
		[ "$stderr" = "tactus $command: $examples/model-linear.toml: is an estimator (linear), which predicts no readings; a forward model is needed, such as \`tactus fit --model forward\` writes" ] || fail "said otherwise"
	done
}

@test "simulate: a bench's sensors under the loads of a recording, and again the same" {
	tactus scan sim:lebosse --mode dc --duration 5s >run.csv
	tactus simulate -m sim:lebosse run.csv >a
	tactus simulate -m sim:lebosse run.csv | cmp a -
	[ "$(column conductance_S <a | grep -c .)" -eq "$(column time_s <run.csv | wc -l)" ]
	if [ "$(column conductance_S <a)" = "$(column conductance_S <run.csv)" ]; then fail "it is the recording"; fi
}

# ---- show ----------------------------------------------------------------------------------------------------------

@test "show a recording of channels side by side: readings of one instant are no repeats of the clock" {
	map='time_s=ms/1000,force_N=load_g*0.00980665,conductance_S@1=A0/1.023e7,conductance_S@2=A1/1.023e7'
	tactus show "$examples/arduino-log.csv" --decimal-comma --columns "$map" >shown
	grep -q '^clock: 1.001 s to 18.902 s, usually 0.1 s apart (10 Hz); 0 gaps, longest 0.102 s$' shown || fail "$(cat shown)"
	if grep 'same instant' shown; then fail "repeats"; fi
	printf '%s\n' time_s,channel,force_N,conductance_S 0,1,1,1 0,2,1,1 1,1,1,1 1,2,1,1 1,2,1,1 2,1,1,1 2,2,1,1 >twice.csv
	tactus show twice.csv --json | jq -e '.clock.repeated == 1 and .clock.backward == 0'
}

@test "show a recording: rows, channels, ranges, missing values, clock, lost scans, metadata" {
	recording >all.csv
	# Scans 5, 6 and 20 are lost; a value of scan 30 is missing; metadata come first.
	{ echo "# device: a bench"; awk -F, -v OFS=, '$2 != "5" && $2 != "6" && $2 != "20" { if ($2 == "30" && $3 == "2") $5 = ""; print }' all.csv; } >run.csv
	tactus show run.csv --json >show.json
	check() { [ "$(jq -c "$1" show.json)" = "$2" ] || fail "$1 is $(jq -c "$1" show.json), not $2"; }
	check '.kind' '"recording"'
	check '.domain' '"sensor"'
	check '.rows' 74
	check '.channels' '[{"channel":1,"rows":37},{"channel":2,"rows":37}]'
	check '.scans' '{"first":0,"last":39,"lost":3,"gaps":2}'
	check '.clock.gaps' 2
	check '.clock.end_s' 3.9
	check '(.clock.rate_Hz * 1000 | round)' 10000
	check '(.clock.largest_step_s * 1000 | round)' 300
	check '.columns[] | select(.name == "conductance_S") | [.values, .missing, .type]' '[73,1,"number"]'
	check '.columns[] | select(.name == "force_N") | [.minimum, .maximum]' '[0,200]'
	check '.metadata.device' '"a bench"'
	run --separate-stderr tactus show run.csv
	status_is 0
	prints "74 rows, domain sensor"
	prints "3 lost in 2 gaps"
}

@test "show a recording: text columns by their words, clocks that stand still or go back" {
	printf 'time_s,mode,force_N\n0,dc,1\n1,ac,2\n1,ac,3\n0.5,dc,\n' >odd.csv
	tactus show odd.csv --json >show.json
	[ "$(jq -c '.columns[1].words' show.json)" = '{"dc":2,"ac":2}' ]
	[ "$(jq -c '[.clock.repeated, .clock.backward]' show.json)" = '[1,1]' ]
	[ "$(jq -c .scans.lost show.json)" = null ]
}

@test "show a model: form, effects, parameters with errors and units, validity, provenance" {
	tactus show "$model" --json >show.json
	[ "$(jq -r '[.kind, .form, .domain, .input] | join(" ")' show.json)" = "model forward sensor force_N" ]
	[ "$(jq -r '.effects | join(" ")' show.json)" = "hysteresis creep temperature" ]
	[ "$(jq -c '.channels[0] | [.channel, .samples, .rmse_N, .cv_rmse_N, .input_range]' show.json)" = '[1,501,0.74,0.79,[0,250]]' ]
	g0='.channels[0].parameters[] | select(.effect == null and .name == "g0")'
	[ "$(jq -c "$g0 | [.value, .standard_error, .unit]" show.json)" = '[1.2e-06,3e-08,"S"]' ] ||
		[ "$(jq -c "$g0 | [.value, .standard_error, .unit]" show.json)" = '[0.0000012,3e-8,"S"]' ]
	[ "$(jq -r .provenance.recording show.json)" = calibration.csv ]
	run --separate-stderr tactus show "$model"
	status_is 0
	prints "1.2e-06 ± 3e-08 S"
	prints "valid from 0 to 250 N"
}

@test "show: standard input is told by its first bytes, like a file" {
	plain_model >m.toml
	recording >run.csv
	for file in m.toml run.csv; do
		tactus show $file | tail -n +2 >named.txt
		tactus show - <$file | tail -n +2 | cmp - named.txt
		cat $file | tactus show | tail -n +2 | cmp - named.txt
	done
	run -3 --separate-stderr tactus show - </dev/null
	says "the file is empty"
}

@test "show a bench: built-in, and a file" {
	run --separate-stderr tactus show sim:paredes
	status_is 0
	prints "4000"
	run --separate-stderr tactus show "$examples/bench-creep.toml"
	status_is 0
	prints "creep"
}

@test "show a profile of a device: its driver, what is written, which register every column is; built in, and files" {
	tactus show "$examples/profile-plant.toml" --json >show.json
	[ "$(jq -r '[.kind, .profile.driver, .profile.requests_per_scan] | join(" ")' show.json)" = "profile registers 4" ]
	[ "$(jq -r .columns.displacement_um show.json)" = "holding 20 f32 CDAB" ]
	[ "$(jq -r .columns.pressure_Pa show.json)" = "input 7 u16 * 0.5 - 1" ]
	[ "$(jq -r .profile.start show.json)" = "holding 30 f32 = -1; holding 39 u16 = 7" ]
	run --separate-stderr tactus show tactus-board
	status_is 0
	prints "tactus-board: profile of a device, driver registers"
	prints "channel 8 input 156 f32"
	[ "$(tactus show robotiq-ft300 --json | jq -r .profile.unit)" = 9 ]
	printf 'kind = "profile"\ndriver = "lines"\ncolumns = "force_N*0.5,-,conductance_S@1/1e6"\n' >board.toml
	[ "$(tactus show board.toml --json | jq -r .columns.conductance_S)" = "channel 1 field 3 * 1e-06" ]
	run --separate-stderr tactus show labjack-t7
	status_is 0
	prints "labjack-t7: bench, profile of labjack-t7"
	prints "switch_active          low"
	printf 'kind = "profile"\ndriver = "registers"\n[link]\nunits = 3\n' >bad.toml
	run --separate-stderr tactus show bad.toml
	status_is 3
	says "bad.toml:4:1: "
	run --separate-stderr tactus show no-such-profile
	status_is 3
}

@test "show calibration loads: how many, their ranges, frequencies and drives; built in, and a file" {
	run --separate-stderr tactus show "$examples/loads-decades.toml"
	status_is 0
	prints "calibration loads"
	tactus show "$examples/loads-decades.toml" --json | jq -e '.kind == "loads" and .loads == {"loads": "5",
		"resistance_ohm": "3300 to 330000, 1 open", "capacitance_F": "1e-10 to 4.7e-10, 1 without",
		"frequencies_Hz": "1000, 4000", "passes": "1"}'
	tactus show standard | grep -q '^  loads  *[0-9]'
	printf 'kind = "loads"\n[[load]]\nresistance_ohm = -1\n' >bad.toml
	run --separate-stderr tactus show bad.toml
	status_is 3
	says bad.toml:2
}

@test "show --effects: all 29 effects by name, one in full, an unknown one refused" {
	tactus show --effects --json >effects.json
	[ "$(jq '[.effects[] | select(.domain == "sensor")] | length' effects.json)" -eq 16 ]
	[ "$(jq '[.effects[] | select(.domain == "readout")] | length' effects.json)" -eq 13 ]
	jq -e 'all(.effects[]; .summary != "" and .source != "" and .needs != "" and .covariate != "" and (.parameters | length) > 0)' effects.json >/dev/null
	jq -e 'all(.effects[].parameters[]; .lower <= .neutral and .neutral <= .upper)' effects.json >/dev/null
	run tactus show --effects
	for e in $(jq -r '.effects[].name' effects.json); do prints "$e"; done
	run --separate-stderr tactus show --effects creep
	status_is 0
	prints "confused with  drift"
	[ "$(tactus show creep)" = "$output" ] || fail "the name alone does not do"
	cp "$examples/model-forward.toml" creep
	tactus show creep | grep -q 'forward model' || fail "an effect before a file"
	run --separate-stderr tactus show --effects crepe
	status_is 2
	says "'crepe' is no effect"
}

# ---- join ----------------------------------------------------------------------------------------------------------

# Two presses of unlike height, the scan at 20 Hz, the reference at 50 Hz from 5 s on, its clock `offset` seconds behind.
presses() {
	"$PYTHON" - "$1" <<-'EOP'
		import math, sys
		offset = float(sys.argv[1])
		force = lambda t: 20 * math.exp(-((t - 12) / 2.5) ** 2) + 35 * math.exp(-((t - 31) / 4) ** 2)
		with open("scan.csv", "w") as f:
		    print("time_s,sequence,channel,conductance_S", file=f)
		    for i in range(1200):
		        print(i / 20, i, 1, 1e-6 + 4e-7 * force(i / 20), sep=",", file=f)
		with open("scale.csv", "w") as f:
		    print("millis;load_g", file=f)
		    for i in range(2500):
		        t = 5 + i / 50
		        print(f"{(t - offset) * 1000:.3f};{force(t) / 0.00980665:.6f}".replace(".", ","), file=f)
	EOP
}
mapped=(--decimal-comma --columns 'time_s=millis/1000,force_N=load_g*0.00980665')

@test "join: a known offset is found, reported and written, and the force stands beside its rows" {
	presses 2.34
	run --separate-stderr tactus join scan.csv scale.csv "${mapped[@]}" -o joined.csv
	status_is 0
	says "offset between the clocks 2.34"
	says "the sensor's own lag included"
	metadata reference_offset_s <joined.csv | awk '{ exit !($1 > 2.3398 && $1 < 2.3402) }'
	metadata reference_offset_std_s <joined.csv | awk '{ exit !($1 > 0 && $1 < 0.001) }'
	"$PYTHON" - <<-'EOP'
		import csv, math
		force = lambda t: 20 * math.exp(-((t - 12) / 2.5) ** 2) + 35 * math.exp(-((t - 31) / 4) ** 2)
		rows = list(csv.DictReader(l for l in open("joined.csv") if not l.startswith("#")))
		assert len(rows) == 1200
		for r in rows:
		    t = float(r["time_s"])
		    if 5.01 < t < 54.9: assert abs(float(r["force_N"]) - force(t)) < 0.005, r
		    if t < 4.99 or t > 55: assert r["force_N"] == "", r
	EOP
}

@test "join: 95 % of its intervals hold the offset, both streams being noisy; a film that lags is part of the offset" {
	"$PYTHON" - <<-'EOP'
		import math, random, subprocess
		def press(t):
		    return 20 + 8 * math.sin(0.9 * t) + 6 * math.sin(2.3 * t + 1) + 4 * math.sin(5.1 * t)
		def joined(seed, lag_s):
		    rng = random.Random(seed)
		    with open("a.csv", "w") as f:
		        print("time_s,channel,conductance_S", file=f)
		        for k in range(1200):
		            print(k / 20, 1, 1e-6 * (1 + press(k / 20 - lag_s) + rng.gauss(0, 0.3)), sep=",", file=f)
		    with open("b.csv", "w") as f:
		        print("time_s,force_N", file=f)
		        for k in range(2500):
		            print(f"{5 + k / 50 + 0.0037 - 1.5:.6f}", press(5 + k / 50 + 0.0037) + rng.gauss(0, 0.3), sep=",", file=f)
		    text = subprocess.run(["tactus", "join", "a.csv", "b.csv", "-q"], capture_output=True, text=True, check=True).stdout
		    said = dict(l[2:].split(": ", 1) for l in text.splitlines() if l.startswith("# "))
		    return float(said["reference_offset_s"]), float(said["reference_offset_std_s"])
		# of twenty, 16 or fewer are inside in 1.6 % of all cases; the seeds are fixed
		inside = sum(abs(offset - 1.5) < 1.96 * std for offset, std in (joined(seed, 0) for seed in range(20)))
		assert inside >= 17, inside
		offset, std = joined(0, 0.1)
		assert abs(offset - 1.6) < 3 * std, (offset, std)
	EOP
}

@test "join --scan-columns, --scan-delimiter, --scan-decimal-comma: a scan of another program" {
	presses 2.34
	# The board's own log: milliseconds and counts, tabs between them and commas in them.
	awk -F, 'NR == 1 { print "ms\tA0"; next } { printf "%.10g\t%.17g\n", 1000 * $1, $4 * 1e7 }' scan.csv | tr . , >board.csv
	foreign=(--scan-delimiter tab --scan-decimal-comma --scan-columns 'time_s=ms/1000,conductance_S=A0/1e7')
	run --separate-stderr tactus join board.csv scale.csv "${mapped[@]}" "${foreign[@]}"
	status_is 0
	says "offset between the clocks 2.34"
	column force_N <<<"$output" >foreign
	tactus join scan.csv scale.csv "${mapped[@]}" --quiet | column force_N >ours
	"$PYTHON" - <<-'EOP'
		ours, foreign = ([l.strip() for l in open(f)] for f in ("ours", "foreign"))
		assert len(ours) == len(foreign) == 1200
		for a, b in zip(ours, foreign):
		    assert (a == "") == (b == "") and (a == "" or abs(float(a) - float(b)) < 1e-6), (a, b)
	EOP
	# By default both are read as ours.
	run --separate-stderr tactus join board.csv scale.csv "${mapped[@]}"
	status_is 3
	says "no column time_s"
}

@test "join --offset: taken as stated; --max-offset: what lies beyond is not found" {
	presses 2.34
	tactus join scan.csv scale.csv "${mapped[@]}" --offset 2.34s --quiet >joined.csv
	[ "$(metadata reference_offset_s <joined.csv)" = 2.34 ]
	[ -z "$(metadata reference_offset_std_s <joined.csv)" ]
	run --separate-stderr tactus join scan.csv scale.csv "${mapped[@]}" --max-offset 5s
	status_is 0
	run --separate-stderr tactus join scan.csv scale.csv "${mapped[@]}" --max-offset 1s --output conductance_S
	status_is 1
	says "beyond the largest offset, 1 s"
}

@test "join --drift: a clock that runs fast" {
	presses 0
	# The reference's clock gains 1 ms per second.
	awk -F';' -v OFS=';' 'NR > 1 { sub(",", ".", $1); $1 = sprintf("%.4f", $1 * 1.001); sub("[.]", ",", $1) } { print }' scale.csv >fast.csv
	run --separate-stderr tactus join scan.csv fast.csv "${mapped[@]}" --drift
	status_is 0
	says "gains 0.001 ±"
	[ -n "$(metadata reference_drift <<<"$output")" ]
}

@test "join --input, --output: other columns" {
	presses 1
	sed 's/load_g/weight_g/' scale.csv >other.csv
	sed 's/conductance_S/reading/' scan.csv >renamed.csv
	run --separate-stderr tactus join renamed.csv other.csv --decimal-comma --columns 'time_s=millis/1000' --input weight_g --output reading
	status_is 0
	says "offset between the clocks 1"
	[[ $(grep -v '^#' <<<"$output" | head -1) == *",weight_g" ]]
}

@test "join: what cannot be told is status 1, what is missing 3, what contradicts itself 2" {
	presses 1
	echo "time_s,force_N" >flat.csv
	for i in 1 2 3 4 5 6 7 8 9; do echo "$i,3" >>flat.csv; done
	run --separate-stderr tactus join scan.csv flat.csv
	status_is 1
	says "never changes"
	run --separate-stderr tactus join scan.csv flat.csv --offset 1000s
	status_is 1
	says "do not overlap"
	cut -d, -f2- scan.csv >clockless.csv
	run --separate-stderr tactus join clockless.csv flat.csv
	status_is 3
	says "clockless.csv:$(grep -n sequence clockless.csv | head -1 | cut -d: -f1): no column time_s"
	for args in "--offset 1s --drift" "--offset 1s --max-offset 2s" "--max-offset -1s" "--offset 1N"; do
		run --separate-stderr tactus join scan.csv flat.csv $args
		status_is 2
	done
	run --separate-stderr tactus join - - </dev/null
	status_is 2
	{ cat flat.csv; echo "4,5"; } >back.csv
	run --separate-stderr tactus join scan.csv back.csv
	status_is 3
	says "back.csv:11: time_s goes back"
}

#!/usr/bin/env bats
# scan, convert and fit, from what they promise: columns, metadata, numbers checked by other means, exit statuses.
load common

columns() { grep -v '^#' | head -1; }

# ---- scan ----------------------------------------------------------------------------------------------------------

@test "scan: the columns and metadata of a live recording" {
	tactus scan sim: --count 2 >run.csv
	for c in time_s sequence channel mode drive_V frequency_Hz amplitude_V phase_rad resistance_ohm conductance_S capacitance_F \
		resistance_std_ohm conductance_std_S capacitance_std_F quality force_N temperature_degC; do
		columns <run.csv | tr ',' '\n' | grep -qx "$c" || fail "no column $c"
	done
	for k in tactus start device rate_requested_Hz rate_Hz channels modes gain_resistor_ohm seed; do
		[ -n "$(metadata $k <run.csv)" ] || fail "no metadata $k"
	done
	[ "$(metadata tactus <run.csv)" = "$(tactus --version | cut -d' ' -f2)" ]
	[[ $(metadata start <run.csv) =~ ^[0-9]{4}-[0-9]{2}-[0-9]{2}T[0-9:.]+Z$ ]]
	[ "$(column channel <run.csv | uniq | tr '\n' ' ')" = "1 2 3 4 5 6 7 8 1 2 3 4 5 6 7 8 " ]
	[ "$(column mode <run.csv | head -4 | tr '\n' ' ')" = "dc ac dc ac " ]
	[ "$(column sequence <run.csv | uniq -c | tr -s ' ' | tr '\n' ';')" = " 16 0; 16 1;" ]
}

@test "scan --raw: the detectors' volts, with their scale and polarity, and convert makes of them what scan does" {
	tactus scan sim: --count 5 --raw >raw.csv
	for c in detector_amplitude_V detector_phase_V detector_dc_V; do columns <raw.csv | grep -q "$c"; done
	[[ $(columns <raw.csv) != *conductance_S* ]]
	for k in detector_amplitude_gain detector_phase_supply_V detector_phase_inverted; do [ -n "$(metadata $k <raw.csv)" ]; done
	tactus scan sim: --count 5 >run.csv
	tactus convert raw.csv >converted.csv
	for c in conductance_S capacitance_F resistance_ohm quality force_N; do
		[ "$(column $c <run.csv)" = "$(column $c <converted.csv)" ] || fail "$c differs"
	done
}

@test "scan: channels in the order given, one mode, counts and durations" {
	tactus scan sim: --channels 3,1-2,8 --mode ac --count 2 >run.csv
	[ "$(column channel <run.csv | tr '\n' ' ')" = "3 1 2 8 3 1 2 8 " ]
	[ "$(column mode <run.csv | sort -u)" = ac ]
	[ "$(column frequency_Hz <run.csv | sort -u)" = 4000 ]
	tactus scan sim: --channels 1 --mode dc --rate 10Hz --duration 2s >run.csv
	[ "$(column time_s <run.csv | wc -l)" -eq 20 ]
	[ "$(column frequency_Hz <run.csv | sort -u)" = 0 ]
	tactus scan sim: --channels 1 --mode ac --drive 500mV --frequency 1kHz --count 1 >run.csv
	[ "$(column drive_V <run.csv) $(column frequency_Hz <run.csv)" = "0.5 1000" ]
	tactus scan sim: --channels 1 --mode dc --rate 2Hz --protocol "hold 30N 3s" >run.csv
	[ "$(column sequence <run.csv | wc -l)" -eq 6 ]
	column force_N <run.csv | awk '{ if ($1 < 29.5 || $1 > 30.5) exit 1 }'
}

@test "scan --seed: the same bytes again, others for another seed" {
	tactus scan sim: --count 3 --seed 5 >a
	tactus scan sim: --count 3 --seed 5 | cmp a -
	if tactus scan sim: --count 3 --seed 6 | cmp -s a -; then fail "the seed changes nothing"; fi
}

@test "scan --loads standard: known loads, found again by conversion" {
	tactus scan sim: --loads standard >loads.csv
	columns <loads.csv | grep -q reference_resistance_ohm
	[ "$(column frequency_Hz <loads.csv | sort -u | wc -l)" -gt 2 ]
	"$PYTHON" - <<-'EOP'
		import csv
		n = 0
		for r in csv.DictReader(l for l in open("loads.csv") if not l.startswith("#")):
		    if r["quality"] != "ok" or r["reference_resistance_ohm"] == "": continue
		    known, got, std = (float(r[k]) for k in ("reference_resistance_ohm", "resistance_ohm", "resistance_std_ohm"))
		    n += 1
		    # The bench's own imperfections (charge, bandwidth) are a few per cent; a wrong formula is not.
		    assert abs(got - known) < 0.1 * known + 5 * std, r
		assert n > 50, n
	EOP
}

@test "scan: what the settings cannot be is status 2, before anything is written" {
	for args in "--rate 0" "--count 0" "--drive 0V" "--frequency 0" "--rate -1Hz" "--rate 1MHz" "--channels 9" "--channels 0" "--channels 1,1x" "--mode both" \
		"--duration -1s" "--settle -1ms" "--frequency -4kHz" "--tare" "--protocol nonsense" "--max-lost 200" "--timeout -1s" "--timeout 0" "--reconnect-timeout -3s" "--raw -m $examples/model-forward.toml"; do
		run --separate-stderr tactus scan sim: $args -o out.csv
		status_is 2
		[ -z "$output" ]
		[ ! -e out.csv ] || fail "$args: the file was begun"
	done
	run -2 --separate-stderr tactus scan sim: --drive=-3
	says "not -3 V and 4000 Hz"
}

@test "scan --append needs a file to continue" {
	run --separate-stderr tactus scan sim: --append
	status_is 2
	says "-o FILE"
}

@test "scan: a device that is not there is status 4, and no header was written" {
	for uri in sim:nosuch sim:nosuch.toml nosuch: usb:dead:beef 'modbus-tcp://127.0.0.1:1?profile=labjack-t7' replay:nosuch.csv; do
		# A file that a URI names and cannot be read is bad input.
		run --separate-stderr tactus scan "$uri" -o out.csv
		[ "$status" -eq 4 ] || { [[ $uri == *nosuch.* ]] && [ "$status" -eq 3 ]; } || fail "$uri: status $status"
		[ -n "$stderr" ]
		[ ! -e out.csv ]
	done
}

@test "scan: more lost scans than --max-lost allows is status 5, what came is kept, gaps show" {
	printf 'kind = "bench"\nbase = "paredes"\nlost_scans = 0.2\n' >lossy.toml
	run --separate-stderr tactus scan sim:lossy.toml --channels 1 --mode dc --count 200 -o run.csv
	status_is 5
	says "lost"
	[ "$(tactus show run.csv --json | jq .scans.lost)" -gt 5 ]
	run --separate-stderr tactus scan sim:lossy.toml --channels 1 --mode dc --count 200 --max-lost 60% -o run2.csv
	status_is 0
	cmp run.csv run2.csv
}

@test "scan --append: one header, times and numbers go on" {
	tactus scan sim: --channels 1 --mode dc --count 3 -o run.csv
	tactus scan sim: --channels 1 --mode dc --count 2 -o run.csv --append
	[ "$(grep -c '^time_s' run.csv)" -eq 1 ]
	[ "$(column sequence <run.csv | tr '\n' ' ')" = "0 1 2 3 4 " ]
	[ "$(tactus show run.csv --json | jq -c '[.clock.gaps, .clock.backward, .scans.lost]')" = "[0,0,0]" ]
}

@test "scan --append: times have the clock's digits, none that come of adding" {
	for bench in sim: sim:lebosse; do
		tactus scan $bench --channels 1 --count 300 -o run.csv --overwrite
		tactus scan $bench --channels 1 --count 300 -o run.csv --append
		[ "$(column time_s <run.csv | grep -cE '[.][0-9]{10}')" -eq 0 ] || fail "$bench: $(column time_s <run.csv | grep -E '[.][0-9]{10}' | head -3)"
	done
}

@test "scan replay:FILE plays a recording" {
	tactus scan sim: --count 4 -o run.csv
	tactus scan replay:run.csv >played.csv
	for c in sequence channel mode amplitude_V conductance_S force_N; do
		[ "$(column $c <played.csv)" = "$(column $c <run.csv)" ] || fail "$c differs"
	done
	tactus scan replay:run.csv --channels 2 --mode ac --count 3 >some.csv
	[ "$(column channel <some.csv | sort -u) $(column mode <some.csv | sort -u) $(column time_s <some.csv | wc -l)" = "2 ac 3" ]
}

@test "scan replay: a channel or mode that the recording does not have is refused as on a bench, of a pipe at its end" {
	tactus scan sim: --mode ac --count 3 -o run.csv
	for asked in "--channels 12" "--channels 1,12 --count 2" "--mode dc"; do
		run -2 --separate-stderr tactus scan replay:run.csv $asked
		says "run.csv has no $([[ $asked == *12* ]] && echo channel 12 || echo dc readings)"
		[ -z "$output" ] || fail "$asked: a header for nothing"
	done
	run -3 --separate-stderr bash -c 'cat run.csv | tactus scan replay:- --channels 2,12'
	says "has no channel 12"
	[ "$(column channel <<<"$output" | tr '\n' ' ')" = "2 2 2 " ] || fail "what it had"
}

@test "scan replay: two recordings in one file lost no scan between them, however their sequence goes back" {
	tactus scan sim: --channels 1,2 --count 5 -o run.csv
	(cat run.csv && grep -v '^#' run.csv | tail -n +2) >twice.csv
	run -0 --separate-stderr tactus scan replay:twice.csv
	says "sequence goes back at 1 place"
	[[ $stderr != *lost\ \(* ]] || fail "nothing was lost"
	(cat run.csv && grep -v '^#' run.csv | sed '1d; /,2,2,/d; /,2,1,/d') >lossy.csv
	run -5 --separate-stderr tactus scan replay:lossy.csv
	says "1 of 10 scans were lost"
}

@test "scan -m gives newtons live, the same as force does afterwards; --tare takes the first second's mean away" {
	tactus scan sim: -o run.csv
	tactus fit run.csv --model linear -o m.toml -q >/dev/null
	tactus scan sim: -m m.toml >live.csv
	tactus force -m m.toml run.csv >later.csv
	[ "$(column force_estimate_N <live.csv)" = "$(column force_estimate_N <later.csv)" ]
	[ -n "$(metadata model <live.csv)" ]
	tactus scan sim: -m m.toml --tare >tared.csv
	"$PYTHON" - <<-'EOP'
		import csv
		rows = list(csv.DictReader(l for l in open("tared.csv") if not l.startswith("#")))
		sums = {}
		for r in rows:
		    if float(r["time_s"]) < float(rows[0]["time_s"]) + 1 and r["force_estimate_N"]:
		        sums.setdefault(r["channel"], []).append(float(r["force_estimate_N"]))
		assert len(sums) == 8
		for channel, values in sums.items():
		    assert abs(sum(values) / len(values)) < 1e-9, (channel, values)
	EOP
}

# ---- convert -------------------------------------------------------------------------------------------------------

@test "convert: amplitude, phase and DC volts to R, C, G, by the paper's equations" {
	cat >in.csv <<-'EOC'
		# gain_resistor_ohm: 1000
		mode,drive_V,frequency_Hz,amplitude_V,phase_rad
		ac,1,4000,0.5,0.3
		ac,2,1000,0.02,1.2
		dc,-5,0,0.25,
	EOC
	tactus convert in.csv >out.csv
	"$PYTHON" - <<-'EOP'
		import csv, math
		for r in csv.DictReader(l for l in open("out.csv") if not l.startswith("#")):
		    a, d, f = float(r["amplitude_V"]), float(r["drive_V"]), float(r["frequency_Hz"])
		    if r["mode"] == "dc":
		        assert math.isclose(float(r["conductance_S"]), -a / (1000 * d), rel_tol=1e-12)
		        assert r["capacitance_F"] == ""
		        continue
		    p = float(r["phase_rad"])
		    assert math.isclose(float(r["resistance_ohm"]), 1000 * d / (a * math.cos(p)), rel_tol=1e-12)
		    assert math.isclose(float(r["conductance_S"]), a * math.cos(p) / (1000 * d), rel_tol=1e-12)
		    assert math.isclose(float(r["capacitance_F"]), a * math.sin(p) / (1000 * d * 2 * math.pi * f), rel_tol=1e-12)
	EOP
}

@test "convert refuses to guess the amplifier's resistor and says how to give it" {
	printf 'mode,drive_V,frequency_Hz,amplitude_V,phase_rad\nac,1,4000,0.5,0.3\n' >in.csv
	run --separate-stderr tactus convert in.csv
	status_is 2
	says "gain"
	run --separate-stderr tactus convert in.csv --gain-resistor 1kohm
	status_is 0
	run --separate-stderr tactus convert in.csv --gain-resistor 0
	status_is 2
	run --separate-stderr tactus convert in.csv --gain-resistor 1kHz
	status_is 2
}

@test "convert: drive and frequency from options; unknown columns are kept; converting twice changes nothing" {
	printf '# gain_resistor_ohm: 1000\namplitude_V,phase_rad,note\n0.5,0.3,hello\n' >in.csv
	tactus convert in.csv --drive 1V --frequency 4kHz >once.csv
	[ "$(column note <once.csv)" = hello ]
	tactus convert once.csv --drive 1V --frequency 4kHz | cmp - once.csv
}

@test "convert: what cannot be right is flagged and kept" {
	printf '# gain_resistor_ohm: 1000\n# amplitude_max_V: 2\nmode,drive_V,frequency_Hz,amplitude_V,phase_rad\nac,1,4000,2.5,0.3\nac,1,4000,0.5,2\ndc,-5,0,-0.2,\nac,1,4000,,0.2\nac,1,4000,0.5,0.5\n' >in.csv
	tactus convert in.csv >out.csv
	[ "$(column quality <out.csv | tr '\n' ' ')" = "clipped wrong-sign wrong-sign missing ok " ]
}

# ---- fit -----------------------------------------------------------------------------------------------------------

@test "fit: a straight line is found, in the model file as in the table, and force undoes it" {
	recording 200 >run.csv
	run --separate-stderr tactus fit run.csv -o m.toml --json
	status_is 0
	tactus show m.toml --json >show.json
	jq -e '.channels[0].parameters | map({(.name): .value}) | add | ((.g1 / 4.1e-7 - 1) | fabs) < 1e-6 and ((.g0 / 1.2e-6 - 1) | fabs) < 1e-4' show.json >/dev/null
	tactus force -m m.toml run.csv | column force_estimate_N >estimates
	recording 200 | column force_N | paste - estimates | awk '($1 - $2)^2 > 1e-4 { exit 1 }'
}

@test "fit: the models of the contract, on DC and AC" {
	tactus scan sim: --channels 1-2 -o run.csv
	for m in conductance capacitance average weighted linear network power; do
		run --separate-stderr tactus fit run.csv --model $m -o $m.toml
		status_is 0
		[ "$(tactus show $m.toml --json | jq '.channels | length')" -eq 2 ]
		tactus force -m $m.toml run.csv >/dev/null
	done
	run --separate-stderr tactus fit run.csv --model spline
	status_is 2
	run --separate-stderr tactus fit run.csv --effects crepe
	status_is 2
	says crepe
}

@test "fit: data that cannot support a model is status 1 and says why" {
	recording 1 >short.csv
	run --separate-stderr tactus fit short.csv -o m.toml
	status_is 1
	[ -n "$stderr$output" ]
	[ ! -e m.toml ]
	recording | awk -F, -v OFS=, 'NR > 1 { $4 = 5 } { print }' >still.csv
	run --separate-stderr tactus fit still.csv -o m.toml
	status_is 1
	recording | awk -F, -v OFS=, 'NR > 1 { $5 = 1e-6 } { print }' >dead.csv
	run --separate-stderr tactus fit dead.csv -o m.toml
	status_is 1
	head -1 short.csv >header.csv
	run --separate-stderr tactus fit header.csv
	status_is 1
}

@test "fit: a scan at rest is told from a dead channel, and both from too few points" {
	for bench in sim: sim:lebosse; do
		tactus scan $bench -q --count 10 --protocol 'rest 10s' -o rest.csv --overwrite
		run --separate-stderr tactus fit rest.csv -o m.toml
		status_is 1
		says "force_N never varies by more than noise: it is -0."
		says "apply loads over the sensor's range"
	done
	# of eight channels and four scans some correlate by chance
	tactus scan sim: -q --count 4 -o four.csv
	run --separate-stderr tactus fit four.csv -o m.toml
	status_is 1
	[ ! -e m.toml ]
	says "force_N never varies by more than noise"
	# half of the readings below zero are left out: it is the load all the same
	recording 10 | awk -F, -v OFS=, 'NR > 1 { $4 = 0; $5 = (NR % 3 - 1) * 1e-9 } { print }' >zero.csv
	run --separate-stderr tactus fit zero.csv -o m.toml
	status_is 1
	says "force_N never varies: it is 0 in all 10 points"
	recording | awk -F, -v OFS=, 'NR > 1 { $5 = 1e-6 } { print }' >dead.csv
	run --separate-stderr tactus fit dead.csv -o m.toml
	status_is 1
	says "conductance_S is 1e-06 in all 40 readings: the channel is dead; look at its wiring"
	recording 3 >few.csv
	run --separate-stderr tactus fit few.csv -o m.toml
	status_is 1
	says "3 points are too few: 2 parameters need at least 4; record more"
}

@test "fit: what a recording lacks is named: a capacitance in dc, the channel's numbers" {
	tactus scan sim:lebosse --mode dc --count 60 -q -o dc.csv
	run --separate-stderr tactus fit dc.csv --model weighted
	status_is 1
	says "capacitance_F is empty in every row"
	recording | awk -F, -v OFS=, 'NR > 1 { $3 = "" } { print }' >bare.csv
	run --separate-stderr tactus fit bare.csv
	status_is 1
	says "column 'channel' is empty in every row"
}

@test "fit: an effect that makes the force worse is warned of, and what it cannot tell is not ok" {
	tactus scan sim:lebosse --channels 1 --mode dc -q --protocol 'rest 2s, hold 5N 8s, rest 5s' -o held.csv
	run --separate-stderr tactus fit held.csv --effects hysteresis -o m.toml
	status_is 0
	says "warning: channel 1: with its effects the model gives a worse force than without"
	tactus fit held.csv --effects hysteresis --json |
		jq -e '.fit.channels[0] | .rmse_N > 1.01 * .without_effects_rmse_N'
	tactus fit held.csv --json | jq -e '.fit.channels[0].without_effects_rmse_N == null'
	tactus force -m m.toml held.csv -o out.csv
	paste <(column force_estimate_std_N <out.csv) <(column quality <out.csv) >judged
	awk '$1 > 5.2 { wide++; ok += $2 == "ok" } END { exit !(wide > 0 && ok == 0) }' judged
}

@test "fit: a model of the force is refused on known loads; the default and forward fit them" {
	tactus scan sim: --loads standard --channels 1 -q -o loads.csv
	for model in conductance capacitance average weighted linear network power; do
		run --separate-stderr tactus fit loads.csv --model $model -o m.toml
		status_is 2
		says "model '$model' is for the domain sensor; this recording is of readout"
	done
	run --separate-stderr tactus fit loads.csv --model all
	status_is 2
	[ ! -e m.toml ]
	tactus fit loads.csv -q >default
	tactus fit loads.csv --model forward -q >forward
	cmp default forward
	grep -q gain_resistor_ohm forward
}

@test "fit --model forward: a column that a scan in dc leaves empty is no output, unless it is asked for" {
	tactus scan sim:lebosse --count 1000 -q -o dc.csv
	tactus fit dc.csv --model forward -q -o forward.toml >forward
	tactus fit dc.csv --model conductance -q >conductance
	cmp forward conductance
	grep -q '^.output.conductance_S.' forward.toml
	if grep -q capacitance_F forward.toml; then fail "an output without readings"; fi
	run --separate-stderr tactus fit dc.csv --model forward --output capacitance_F
	status_is 3
	says "column 'capacitance_F' has no number in it"
}

@test "fit --seed, --jobs: the same bits whatever the number of threads" {
	tactus scan sim: --channels 1-2 -o run.csv
	tactus fit run.csv --model network --starts 3 --seed 4 --jobs 1 -o a.toml -q >a
	tactus fit run.csv --model network --starts 3 --seed 4 --jobs 2 -o b.toml -q >b
	cmp a b
	grep -v '^date' a.toml >a
	grep -v '^date' b.toml | cmp a -
}

@test "fit -m: a model of both readings is refitted to the dc and ac rows that it came from" {
	tactus scan sim: --channels 1-2 -o run.csv
	tactus fit run.csv --model forward -o both.toml -q >/dev/null
	run --separate-stderr tactus fit -m both.toml run.csv -o again.toml --json
	status_is 0
	jq -e '[.fit.channels[].outputs[].column] == ["conductance_S", "capacitance_F", "conductance_S", "capacitance_F"]' <<<"$output"
	tactus fit run.csv --model forward --json | jq -c '[.fit.channels[].outputs[] | .rmse]' >expected
	jq -e --slurpfile expected expected '[[.fit.channels[].outputs[] | .rmse], $expected[0]] | transpose | all((.[0] / .[1] - 1 | fabs) < 1e-6)' <<<"$output"
	tactus fit run.csv --model capacitance -o c.toml -q >/dev/null
	tactus fit -m c.toml run.csv --json | jq -e '[.fit.channels[0].outputs[].column] == ["capacitance_F"]'
	# Columns that name two domains: the model says which.
	awk -F, -v OFS=, '!/^#/ { $0 = $0 OFS (n++ ? "1000" : "reference_resistance_ohm") } { print }' run.csv >two.csv
	run --separate-stderr tactus fit two.csv
	status_is 3
	says --domain
	tactus fit -m both.toml two.csv
	run --separate-stderr tactus fit -m "$examples/model-readout.toml" run.csv
	status_is 2
	says "the model is of the domain readout, the recording of sensor"
}

@test "fit: the model keeps the conditions of its recording that stayed the same, as numbers" {
	recording >run.csv
	tactus fit run.csv -o m.toml -q >/dev/null
	grep -qx 'temperature_degC = 25.0' m.toml
	grep -qx 'drive_V = -5.0' m.toml
	[ "$(tactus show m.toml --json | jq -c '.provenance | [.temperature_degC, .drive_V]')" = '["25","-5"]' ]
	tactus fit -m m.toml run.csv -o again.toml -q >/dev/null
	grep -qx 'temperature_degC = 25.0' again.toml
	recording | awk -F, -v OFS=, 'NR > 1 { $6 = -5 - NR % 2; $7 = 25 + 0.1 * (NR % 2) } { print }' >moves.csv
	tactus fit moves.csv -o moves.toml -q >/dev/null
	run grep -c 'drive_V' moves.toml
	[ "$output" = 0 ]
	sed -n 's/^temperature_degC = //p' moves.toml | awk '{ exit !($1 > 25.04 && $1 < 25.06) }'
	recording | cut -d, -f1-5 >unknown.csv
	tactus fit unknown.csv -o unknown.toml -q >/dev/null
	run grep -c 'degC\|drive' unknown.toml
	[ "$output" = 0 ]
}

@test "fit --folds: that many parts are held out in turn, 2 to 32" {
	tactus scan sim: --channels 1 --mode dc -o run.csv
	for n in 2 5 8; do
		tactus fit run.csv --folds $n --json | jq -c '[.fit.channels[0] | .rmse_N, .cv_rmse_N]' >$n
	done
	tactus fit run.csv --json | jq -c '[.fit.channels[0] | .rmse_N, .cv_rmse_N]' | cmp - 5
	[ "$(jq '.[0]' 2)" = "$(jq '.[0]' 8)" ]
	[ "$(jq '.[1]' 2)" != "$(jq '.[1]' 8)" ]
	for n in 1 33 many; do
		run --separate-stderr tactus fit run.csv --folds $n
		status_is 2
	done
}

@test "fit --input: errors and parameters are in the unit of the column that plays the load" {
	awk 'BEGIN { print "time_s,voltage_V,displacement_um"; for (i = 0; i < 90; i++) { v = i % 30 * 5; print i / 10 "," v "," 1 + 0.13 * v + i % 7 / 10 } }' >piezo.csv
	tactus fit piezo.csv --input voltage_V --output displacement_um --model power -o piezo.toml >table
	head -1 table | grep -q '^Error of voltage_V in sample'
	sed -n 6p table | grep -q '^ *V  *V  *%'
	grep -q 'g1 .* um/V$' table
	grep -q 'reference_load_N .* V$' table
	! grep -q 'N$' table
	tactus show piezo.toml | grep -q 'g1 .* um/V$'
	# The file that says so is read back, and errors keep their unit.
	tactus force -m piezo.toml piezo.csv | column force_estimate_N | grep -c . | grep -qx 90
	tactus fit piezo.csv --input voltage_V --output displacement_um --model all | sed -n 2p | grep -q '^ *V  *V  *%'
	tactus fit piezo.csv --input voltage_V --output displacement_um --json | jq -e '.fit.input == "voltage_V"'
}

@test "fit: real recordings of others" {
	[ -d "$data" ] || skip "the real recordings are not at ../shared/data"
	tactus fit "$data/tactile_cell_bare.csv" -o cell.toml
	tactus force -m cell.toml "$data/tactile_cell_bare.csv" | column force_estimate_N | grep -c . | grep -qx 1236
	tactus fit "$data/fsr_static.csv" --output adc_count --model power -o fsr.toml
	tactus fit "$data/piezo_actuator.csv" --domain sensor --input voltage_V --output displacement_um -o piezo.toml
	tactus simulate -m piezo.toml "$data/piezo_actuator.csv" | column displacement_um | grep -c . | grep -qx 10000
}

@test "an Arduino's log becomes a calibration and newtons" {
	# The columns that its README names: milliseconds, two ADC readings, grams; decimal commas.
	tactus fit "$examples/arduino-log.csv" --decimal-comma --columns 'time_s=ms/1000,force_N=load_g*0.00980665' \
		--output A0 -o cell.toml >/dev/null
	tactus force -m cell.toml "$examples/arduino-log.csv" --decimal-comma --columns 'time_s=ms/1000,force_N=load_g*0.00980665' >newtons.csv
	[ -n "$(metadata columns <newtons.csv)" ]
	column force_estimate_N <newtons.csv >estimate
	column force_N <newtons.csv | paste - estimate | awk '{ d += ($1 - $2)^2; n++ } END { exit !(n > 20 && sqrt(d / n) < 0.5) }'
}

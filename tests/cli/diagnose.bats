#!/usr/bin/env bats
# tactus diagnose: every option, every exit status, the contract's JSON, input that it must survive.
load common
load diagnosis

# Recordings that several tests read, made once: a sensor that creeps, one that does what the base equations say.
setup_file() {
	cd "$BATS_FILE_TMPDIR" || return
	loads="rest 5s, hold 150N 30s, rest 20s, hold 90N 30s, rest 20s, staircase 0N..180N 30N 2s, rest 20s"
	cat >creep.toml <<-'EOB'
		kind = "bench"
		base = "paredes"
		name = "creeping"
		seed = 3
		[scan]
		rate_Hz = 5
		[[effect]]
		name = "creep"
		amplitude_1 = 0.03
		amplitude_10 = 0.06
	EOB
	tactus scan sim:creep.toml --protocol "$loads" --channels 1 --mode dc -q -o creep.csv
	tactus scan sim:creep.toml --protocol "$loads" --channels 1-3 --mode dc -q -o three.csv
	linear_model 1.2e-6 4.1e-7 4.1e-8 >plain.toml
	tactus simulate -m plain.toml --protocol "$loads" --rate 5Hz --noise --seed 4 -o plain.csv
	sed 's/g1 = 4.1e-7/g1 = 3.4e-7/' plain.toml >stale.toml
}
setup() {
	cd "$BATS_TEST_TMPDIR" || return
	PYTHON=${PYTHON:-python3}
	creep=$BATS_FILE_TMPDIR/creep.csv three=$BATS_FILE_TMPDIR/three.csv
	plain=$BATS_FILE_TMPDIR/plain.csv model=$BATS_FILE_TMPDIR/plain.toml stale=$BATS_FILE_TMPDIR/stale.toml
}

# survives FILE OPTION…: a verdict that is no confident name, or an error that says something; never a crash.
survives() {
	run --separate-stderr tactus diagnose "$@" --json
	case $status in
	0)
		contract <<<"$output" || fail "not the contract's JSON"
		verdict=$(jq -r .verdict <<<"$output")
		[[ $verdict != cause-found ]] || fail "a confident name: $(jq -r .summary <<<"$output")"
		tactus diagnose "$@" >/dev/null || fail "the page fails where the JSON does not"
		;;
	1 | 2 | 3) says "tactus diagnose: " ;;
	*) fail "status $status" ;;
	esac
}

# ---- what it finds --------------------------------------------------------------------------------------------------

@test "creep is named, sized and gained on; the page says so in about a dozen lines of at most 80 columns" {
	run --separate-stderr tactus diagnose "$creep"
	status_is 0
	[ -z "$stderr" ]
	[[ ${lines[0]} == *" off by "*"N. Cause"*"creep"* ]] || fail "the first line: ${lines[0]}"
	for word in Measured Cause "How sure" Gain "Not tested" Next; do prints $'\n'"$word "; done
	prints "the noise floor"
	prints "tactus diagnose $creep --extended extended.toml"
	[ "${#lines[@]}" -le 24 ] || fail "${#lines[@]} lines"
	if grep -v '^  tactus' <<<"${output//$creep/creep.csv}" | LC_ALL=C.UTF-8 grep -E '^.{81}'; then fail "wider than 80 columns"; fi
	tactus diagnose "$creep" --json | jq -e '.verdict == "cause-found" and .series[0].causes[0].effect == "creep" and
		.series[0].gain.reduction > 0.2 and .series[0].causes[0].evidence.delta_bic < -10'
}

@test "--json: the contract's keys in its order, shortest numbers, for every verdict seen here" {
	for args in "$creep" "$plain" "$three" "$plain -m $stale" "$plain -m $model"; do
		tactus diagnose $args --json >result.json
		contract <result.json || fail "$args"
		"$PYTHON" - <<-'EOP'
			import json, re
			text = open("result.json").read()
			for n in re.findall(r"(?<=[ \[])-?[0-9][0-9.e+-]*", re.sub(r'"(\\.|[^"\\])*"', '""', text)):
			    assert len(n) <= len(repr(float(n))) + 1, n
		EOP
	done
}

@test "nothing wrong, stale calibration: said as such" {
	tactus diagnose "$plain" -m "$model" --json | jq -e '.verdict == "nothing-wrong" and (.series[0].causes | length == 0)'
	run --separate-stderr tactus diagnose "$plain" -m "$model"
	prints "Nothing wrong"
	# ambiguous where what the recording cannot test (another drive, say) would do the same
	tactus diagnose "$plain" -m "$stale" --json | jq -e '(.verdict == "stale-calibration" or .verdict == "ambiguous") and
		.series[0].causes[0].effect == "stale-calibration" and
		any(.series[0].causes[0].parameters[]; .name == "g1" and (.value / 4.1e-7 - 1 | fabs) < 0.02)'
	run --separate-stderr tactus diagnose "$plain" -m "$stale"
	prints "stale"
	prints "g1 was "
}

@test "--exit-verdict: each verdict has its status, from 10 on; without it 0; a full disk is worse" {
	head -n "$(($(grep -n '^time_s' "$creep" | cut -d: -f1) + 10))" "$creep" >ten.csv
	order=(cause-found nothing-wrong unexplained ambiguous stale-calibration bad-recording)
	seen=
	for args in "$creep" "$plain -m $model" "$plain -m $stale" "$creep -m $model" ten.csv; do
		run --separate-stderr tactus diagnose $args --exit-verdict --json
		[ "$status" -lt 10 ] && continue
		[ "${order[status - 10]}" = "$(jq -r .verdict <<<"$output")" ] || fail "$args: status $status"
		seen+=" $status"
		run --separate-stderr tactus diagnose $args
		status_is 0
	done
	for s in 10 11 15; do [[ $seen == *" $s"* ]] || fail "only$seen"; done
	run --separate-stderr bash -c "tactus diagnose $creep --exit-verdict >/dev/full"
	status_is 6
}

@test "readings that get better while newtons get worse are no gain: said apart, with the reason, on page and report" {
	sed '/effect/,$d; s/creeping/jumping/' "$BATS_FILE_TMPDIR/creep.toml" >jump.toml
	printf '[[effect]]\nname = "step-change"\ntime_1_s = 40\nconductance_offset_1_S = 4e-6\n' >>jump.toml
	tactus scan sim:jump.toml --protocol "rest 1s, hold 150N 120s" --channels 1 --mode dc -q -o jump.csv
	tactus diagnose jump.csv --json >jump.json
	jq -e '.series[0].gain | .reduction > 0.3 and .force_rmse_after_N > 2 * .force_rmse_before_N' jump.json
	jq -e '.summary | contains("falls by") and contains("but not in newtons")' jump.json
	run tactus diagnose jump.csv --extended jump-extended.toml
	[[ $output == *"Beware     in newtons nothing is gained"*"the load hardly"* ]]
	if grep "^Gain" <<<"$output" | grep " N "; then fail "newtons that grow are sold as a gain"; fi
	[[ $output == *"rather than to \`force\`"* ]]
	type gnuplot >/dev/null || return 0
	tactus diagnose jump.csv --report jump >/dev/null
	grep -q 'class="warn">In newtons nothing is gained: the load hardly' jump/index.html
}

@test "several channels: said together, then a line for each" {
	run --separate-stderr tactus diagnose "$three"
	status_is 0
	[[ ${lines[0]} == *"3 of 3 sensors"* ]] || fail "${lines[0]}"
	for c in 1 2 3; do grep -q "^      $c  cause found .*creep" <<<"$output" || fail "channel $c"; done
	tactus diagnose "$three" --json | jq -e '[.series[].channel] == [1, 2, 3]'
}

@test "eight channels with causes of their own: the headline is two lines, what is shared comes first" {
	cat >mixed.toml <<-'EOB'
		kind = "bench"
		base = "paredes"
		protocol = "rest 5s, hold 150N 30s, rest 20s, hold 90N 30s, rest 20s, staircase 0N..180N 30N 2s, rest 10s"
		[[effect]]
		name = "creep"
		amplitude_1 = 0.03
		amplitude_10 = 0.06
		channels = [1, 2, 4, 5, 7, 8]
		[[effect]]
		name = "step-change"
		time_1_s = 60
		conductance_offset_1_S = 5e-6
		channels = [3, 5]
		[[effect]]
		name = "hysteresis"
		play_weight_4 = 0.2
		channels = [2, 6]
		[[effect]]
		name = "drift"
		conductance_gain = 0.3
		reference_time_s = 100
		channels = [4, 7]
		[[effect]]
		name = "nonlinearity"
		exponent = 0.8
		channels = [8, 1]
	EOB
	tactus scan sim:mixed.toml -q -o mixed.csv
	run --separate-stderr tactus diagnose mixed.csv
	status_is 0
	# from the headline to the line below it
	sed -n '/^6 of 8 sensors: creep; /,/^Measured/p' <<<"$output" >top
	[ "$(wc -l <top)" -ge 2 ] && [ "$(wc -l <top)" -le 3 ] || fail "no headline of two lines at most"
	for c in 1 2 3 4 5 6 7 8; do grep -q "^      $c  " <<<"$output" || fail "channel $c"; done
}

@test "several recordings are one experiment" {
	tactus scan sim:"$BATS_FILE_TMPDIR/creep.toml" --protocol "rest 5s, hold 100N 30s, rest 20s" --channels 1 --mode dc -q -o more.csv
	tactus diagnose "$creep" more.csv --json >result.json
	contract <result.json
	jq -e --arg a "$creep" '.recordings == [$a, "more.csv"]' result.json
	# One of them may have no clock.
	made "g += 3e-7 * sin(i / 20)" 400 | cut -d, -f1,4,5 >clock.csv
	cut -d, -f2,3 clock.csv >none.csv
	for pair in "clock.csv none.csv" "none.csv clock.csv"; do
		# shellcheck disable=SC2086 # two names
		tactus diagnose $pair --json >result.json
		contract <result.json
	done
}

@test "an offset of each recording that no column holds is an unrecorded cause" {
	for k in 1 2 3 4; do made "g += $k * $k % 7 * 3e-7 - 1e-6 + 1e-8 * (rand() - 0.5)" 400 | cut -d, -f1-5 >r$k.csv; done
	tactus diagnose r1.csv r2.csv r3.csv r4.csv --json >said.json
	jq -e '.verdict == "unexplained" and .series[0].unexplained[0].covariate == "recording"' said.json
	jq -e '.series[0].unexplained[0].text | test("is another in every recording.*no column records")' said.json
	made "" 1600 | cut -d, -f1-5 >whole.csv
	for k in 1 2 3 4; do awk -v k=$k 'NR == 1 || int((NR - 2) / 400) == k - 1' whole.csv >r$k.csv; done
	tactus diagnose r1.csv r2.csv r3.csv r4.csv --json | jq -e '.verdict == "nothing-wrong"'
}

@test "a temperature that differs between recordings is tested by them together" {
	for k in 1 2 3 4; do
		made "g = g * (1 + 0.004 * (5 * $k - 5)); x = 20 + 5 * $k" 400 | sed '1s/extra/temperature_degC/' >t$k.csv
	done
	tactus diagnose t1.csv --json | jq -e '[.series[0].not_testable[].effect] | index("temperature") != null'
	tactus diagnose t1.csv t2.csv t3.csv t4.csv --json | jq -e '[.series[0].causes[].effect] == ["temperature"]'
}

# ---- options --------------------------------------------------------------------------------------------------------

@test "--extended writes a model that force, simulate and fit accept, and names it in the JSON" {
	tactus diagnose "$creep" --json --extended better.toml >result.json
	[ "$(jq -r .extended_model result.json)" = better.toml ]
	[ "$(tactus diagnose "$creep" --json | jq .extended_model)" = null ]
	# Where it came from is said as `fit` says it; the error in newtons is that on unseen data.
	tactus fit "$creep" -o fitted.toml >/dev/null
	for what in '"recording_fingerprint"' '"device"' temperature_degC drive_V; do
		grep "^$what = " fitted.toml
		[ "$(grep "^$what = " fitted.toml)" = "$(grep "^$what = " better.toml)" ]
	done
	grep "^cv_rmse_N = $(jq .series[0].gain.force_rmse_after_N result.json | cut -c1-10)" better.toml
	tactus show better.toml --json | jq -e '.effects | index("creep") != null'
	tactus force -m better.toml "$creep" >newtons.csv
	tactus simulate -m better.toml "$creep" >simulated.csv
	tactus fit -m better.toml --domain sensor "$creep" -q >/dev/null
	run --separate-stderr tactus diagnose "$creep" --extended better.toml
	status_is 2
	says "better.toml: exists already"
	tactus diagnose "$creep" --extended better.toml --overwrite >page
	grep -q "better.toml" page
	# what is explained stays explained
	tactus diagnose "$creep" -m better.toml --json | jq -e '[.series[0].causes[].effect] | index("creep") == null'
}

@test "-o takes the page or the JSON, refuses an existing file, --overwrite replaces it" {
	for how in "" --json; do
		tactus diagnose "$creep" $how >expected
		tactus diagnose "$creep" $how -o out
		cmp expected out
		run --separate-stderr tactus diagnose nosuch.csv $how -o out
		status_is 2
		says "out: exists already"
		tactus diagnose "$creep" $how -o out --overwrite
		rm out
	done
	tactus diagnose "$creep" --extended - -o page | tactus show /dev/stdin --json | jq -e '.kind == "model"'
	run --separate-stderr tactus diagnose "$creep" --extended -
	status_is 2
	says "-o FILE"
	run --separate-stderr tactus diagnose "$creep" --extended x -o x
	status_is 2
}

@test "standard input, as - and in a pipe" {
	expected=$(tactus diagnose "$creep" --json | jq -c .series)
	[ "$(tactus diagnose --json <"$creep" | jq -c .series)" = "$expected" ]
	[ "$(tactus diagnose - --json <"$creep" | jq -c .series)" = "$expected" ]
	run --separate-stderr bash -c "tactus diagnose - - <$creep"
	status_is 2
	says "standard input"
}

@test "--jobs 1 and --jobs 2 give the same bytes; --seed repeats, and moves the intervals only" {
	for how in "" --json; do
		tactus diagnose "$three" $how --jobs 1 >a
		tactus diagnose "$three" $how --jobs 2 >b
		cmp a b
	done
	tactus diagnose "$three" --report one --jobs 1 >/dev/null
	tactus diagnose "$three" --report two --jobs 2 >/dev/null
	cmp <(sed 's/--report one/--report two/' one/index.html) two/index.html
	tactus diagnose "$creep" --json --seed 1 >a
	tactus diagnose "$creep" --json | cmp - a
	tactus diagnose "$creep" --json --seed 2 >b
	for f in a b; do jq -c '[.verdict, .series[0].causes[0].parameters, .series[0].gain.reduction]' $f >$f.kept; done
	cmp a.kept b.kept
	if cmp -s a b; then fail "the seed changes nothing"; fi
}

@test "--input, --output and --domain let other columns play" {
	sed 's/^time_s,sequence,channel,force_N/time_s,sequence,channel,load_kg/; s/conductance_S/reading_uS/' "$plain" >renamed.csv
	run --separate-stderr tactus diagnose renamed.csv
	status_is 3
	tactus diagnose renamed.csv --domain sensor --input load_kg --output reading_uS --json >result.json
	contract <result.json
	jq -e '.domain == "sensor" and .series[0].base[0].output == "reading_uS"' result.json
	tactus diagnose renamed.csv --columns force_N=load_kg,conductance_S=reading_uS --json | jq -e '.series[0].base[0].output == "conductance_S"'
}

@test "CSV of other people: --delimiter, --decimal-comma" {
	grep -v '^#' "$plain" | sed 's/,/;/g; s/\./,/g' >foreign.csv
	expected=$(tactus diagnose "$plain" --json | jq -c .series)
	[ "$(tactus diagnose foreign.csv --decimal-comma --json | jq -c .series)" = "$expected" ]
	[ "$(tactus diagnose foreign.csv --decimal-comma --delimiter ';' --json | jq -c .series)" = "$expected" ]
}

@test "-m takes a bench; --device is what the next experiment is written for" {
	tactus diagnose "$creep" -m sim:paredes --json >result.json
	contract <result.json
	for f in "$creep" "$plain"; do
		tactus diagnose "$f" --device modbus-tcp://bench --json >result.json
		jq -e 'all(.series[]; .next_experiment == null or (.next_experiment.command | contains("modbus-tcp://bench")))' result.json
	done
}

@test "a readout recording is diagnosed as one" {
	tactus diagnose "$examples/recording-readout.csv" --domain readout --json >result.json
	contract <result.json
	jq -e '.domain == "readout" and (.series | length > 0) and all(.series[]; .channel == null)' result.json
}

@test "the command to paste names what scan accepts: the bench that was scanned, a device by its URI, never its description" {
	cp "$BATS_FILE_TMPDIR/creep.toml" .
	tactus scan sim:creep.toml --protocol "rest 2s, hold 150N 60s" --channels 1 --mode dc -q -o once.csv
	[ "$(metadata device <once.csv) $(metadata uri <once.csv)" = "sim:creeping sim:creep.toml" ]
	next() { tactus diagnose once.csv --json | jq -r '.series[0].next_experiment.command'; }
	[[ $(next) == "tactus scan sim:creep.toml "* ]]
	mv creep.toml elsewhere.toml
	[[ $(next) == "tactus scan sim: "* ]]
	sed -i '/^# uri:/d; s/^# device: .*/# device: usb:09db:00a9:0123/' once.csv
	[[ $(next) == "tactus scan usb:09db:00a9:0123 "* ]]
	sed -i 's/^# device: .*/# device: ACME logger, serial 7/' once.csv
	[[ $(next) == "tactus scan sim: "* ]]
	tactus diagnose once.csv --json | jq -e '.series[0].next_experiment.text | test("your own device in place of the simulated one")'
	tactus diagnose once.csv --device usb:09db:00a9 --json |
		jq -e '.series[0].next_experiment.text | test("your own device") | not'
}

@test "a load that is no force is moved by hand: the proposed experiment speaks of its unit, not of newtons" {
	pressed() { awk -v slope="$1" 'BEGIN { srand(7); print "time_s,drive_V,pressure_Pa,voltage_V"
		for (i = 0; i < 600; i++) { t = i / 10; p = 4000 * (t % 20 < 10 ? t % 10 : 10 - t % 10)
			printf "%.1f,2,%.6g,%.6g\n", t, p, 0.5 + slope * p + 1e-3 * (rand() - 0.5) } }'; }
	pressed 1e-4 | cut -d, -f1,3,4 >before.csv
	pressed 1.1e-4 >after.csv
	tactus fit before.csv --domain sensor --input pressure_Pa --output voltage_V --model forward -q -o model.toml
	tactus diagnose after.csv -m model.toml --json >result.json
	jq -e '.verdict == "ambiguous"' result.json
	jq -r '.series[0].next_experiment | .command, .text' result.json >next
	grep -q 'pressure_Pa from 0 Pa to 40 kPa' next
	if grep -E '[0-9]N' next; then fail "newtons"; fi
}

@test "the experiment that is proposed for an ambiguous recording resolves it" {
	cp "$BATS_FILE_TMPDIR/creep.toml" .
	tactus scan sim:creep.toml --protocol "rest 2s, hold 150N 200s" --channels 1 --mode dc -q -o once.csv
	tactus diagnose once.csv --device sim:creep.toml --json >once.json
	jq -e '.verdict == "ambiguous" and ([.series[0].causes[0] | .effect, .rivals[].effect] | index("creep") != null)' once.json
	eval "$(jq -r '.series[0].next_experiment.command' once.json) -q"
	tactus diagnose next.csv --json >next.json
	jq -e '.verdict == "cause-found" and [.series[0].causes[].effect] == ["creep"]' next.json
}

@test "what is proposed is within what the scan can do: taps at no more readings a second than have time to settle" {
	local proposed=0
	for mode in dc dc,ac; do
		tactus scan "sim:$BATS_FILE_TMPDIR/creep.toml" --protocol "rest 5s, hold 150N 60s" --channels 1 --mode $mode -q --overwrite -o short.csv
		tactus diagnose short.csv --device "sim:$BATS_FILE_TMPDIR/creep.toml" --json >short.json
		jq -e '.series[0].next_experiment' short.json || continue # told apart at once
		command=$(jq -r '.series[0].next_experiment.command' short.json)
		rm -f next.csv
		eval "$command -q"
		[ -s next.csv ]
		proposed=$((proposed + 1))
	done
	[ $proposed -gt 0 ]
}

@test "a second cause that shows in the weaker output only is not hidden by the first" {
	cat >two.toml <<-'EOM'
		kind = "model"
		format = 1
		domain = "readout"
		form = "forward"
		effects = ["switch-resistance", "comparator-delay"]
		[output.amplitude_V]
		[output.phase_rad]
		[base]
		gain_resistor_ohm = 1000
		[[channel]]
		channel = 1
		[channel.effect.switch-resistance]
		resistance_ohm = 75
		[channel.effect.comparator-delay]
		delay_s = 2e-7
		[channel.reading.amplitude_V]
		residual_std = 1e-3
		[channel.reading.phase_rad]
		residual_std = 1e-3
	EOM
	awk 'BEGIN { print "time_s,channel,reference_resistance_ohm,reference_capacitance_F,frequency_Hz,drive_V"
		split("330 1000 4700 10000 47000 100000", r); split("0 47e-12 220e-12 1e-9", c); split("0 500 2000 4000 10000 30000", f)
		for (k = 0; k < 2; k++) for (v = 0.5; v < 3; v *= 2) for (i = 1; i <= 6; i++) for (j = 1; j <= 4; j++) for (m = 1; m <= 6; m++)
			printf "%.2f,1,%s,%s,%s,%s\n", 0.05 * n++, r[i], c[j], f[m], v }' >loads.csv
	tactus simulate -m two.toml --noise --seed 2 loads.csv -o two.csv
	tactus diagnose two.csv --json >two.json
	jq -e '.verdict == "cause-found" and ([.series[0].causes[].effect] | sort) == ["comparator-delay", "switch-resistance"]' two.json
	jq -e '[.series[0].causes[].parameters[] | select(.name == "delay_s") | .value] | all(. > 1.9e-7 and . < 2.1e-7)' two.json
}

# ---- what is refused ------------------------------------------------------------------------------------------------

@test "an estimator is status 2; what cannot be read, or is of another domain, says so" {
	run --separate-stderr tactus diagnose "$creep" -m "$examples/model-linear.toml"
	status_is 2
	says "estimator"
	run --separate-stderr tactus diagnose "$creep" -m "$examples/model-readout.toml"
	[ "$status" -eq 1 ] || [ "$status" -eq 3 ] || fail "status $status"
	says "readout"
	run --separate-stderr tactus diagnose "$creep" -m nosuch.toml
	status_is 3
	says nosuch.toml
	run --separate-stderr tactus diagnose nosuch.csv
	status_is 3
	says nosuch.csv
	run --separate-stderr tactus diagnose "$creep" nosuch.csv
	status_is 3
	run --separate-stderr tactus diagnose "$creep" --domain wrench
	status_is 2
	for role in input output; do
		run --separate-stderr tactus diagnose "$creep" --$role nosuch_S
		status_is 3
		says "no column 'nosuch_S', which was to be the $role"
		run --separate-stderr tactus diagnose "$creep" --$role mode
		status_is 3
		says "column 'mode' has no number in it"
	done
}

# ---- bad input ------------------------------------------------------------------------------------------------------

@test "ten rows, two rows, one row" {
	for n in 10 2 1; do
		made "" $n >few.csv
		survives few.csv
	done
}

@test "a constant output, an input that never moves, both" {
	made 'g = 1e-6' >a.csv
	made 'f = 50' >b.csv
	made 'f = 50; g = 2e-5' >c.csv
	made 'f = 0; g = 0' >d.csv
	for f in a b c d; do survives $f.csv; done
}

@test "several channels of which one is dead or a copy of another: a bad recording, which no script passes" {
	pair() { # AWK: the second channel's reading g, from its load f; the first one's is h
		awk "BEGIN { srand(3); print \"time_s,sequence,channel,force_N,conductance_S\"
			for (i = 0; i < 600; i++) for (c = 1; c <= 2; c++) {
				f = i % 200 < 100 ? i % 200 : 200 - i % 200; g = 1e-6 + 4e-7 * f + 2e-8 * (rand() + rand() + rand() - 1.5)
				if (c == 1) h = g; else { $1 }
				printf \"%.10g,%d,%d,%g,%.9g\n\", i / 10, i, c, f, g } }"
	}
	pair "" >good.csv
	pair "g = 3e-6" >dead.csv
	pair "g = h" >copy.csv
	run tactus diagnose good.csv --exit-verdict --json
	status_is 11
	for kind in dead copy; do
		run --separate-stderr tactus diagnose $kind.csv --exit-verdict --json
		status_is 15
		jq -e '.verdict == "bad-recording" and [.series[].verdict] == ["nothing-wrong", "bad-recording"] and
			any(.problems[]; .kind == "dead-channel" or .kind == "duplicate-channel")' <<<"$output"
	done
}

@test "missing values in the middle; nothing but missing values" {
	made 'if (i > 200 && i < 260) g = ""; if (i % 37 == 0) f = ""' >gaps.csv
	survives gaps.csv
	made 'g = ""' >none.csv
	survives none.csv
	made 'f = ""' >none.csv
	survives none.csv
}

@test "the columns of two domains at once; a model of another domain" {
	made "" | awk -F, -v OFS=, '{ print $0, NR == 1 ? "reference_resistance_ohm,frequency_Hz,phase_rad,amplitude_V" : "1000,1000,0.1,1" }' >both.csv
	survives both.csv
	survives both.csv --domain sensor
	survives both.csv --domain readout
	survives both.csv -m "$examples/model-readout.toml"
}

@test "fifty columns that mean nothing" {
	made "" 400 | awk -F, -v OFS=, '{ srand(NR); for (k = 1; k <= 50; k++) $0 = $0 OFS (NR == 1 ? "column" k : rand()); print }' >wide.csv
	survives wide.csv
}

@test "amplitudes of 1e-12 and 1e12, of output, input and clock" {
	for scale in 1e-12 1e12; do
		made "g *= $scale" >g.csv
		made "f *= $scale" >f.csv
		made "t *= $scale" >t.csv
		for f in g f t; do
			survives $f.csv
			tactus diagnose $f.csv --report report --overwrite >/dev/null || [ "$?" -eq 3 ]
		done
	done
}

@test "a clock that stands still, runs backwards, or is not there" {
	made 't = 5' >a.csv
	made 't = -t' >b.csv
	made "" | cut -d, -f2- >c.csv
	made "" | cut -d, -f3- >d.csv
	for f in a b c d; do survives $f.csv; done
	tactus diagnose c.csv --json | jq -e '[.series[0].not_testable[].effect] | index("creep") != null'
}

@test "scans that only the other mode has rows of are not lost; one that no row has is" {
	awk 'BEGIN { srand(5); pi = atan2(0, -1)
		print "time_s,sequence,channel,mode,drive_V,frequency_Hz,reference_resistance_ohm,reference_capacitance_F,amplitude_V,phase_rad"
		for (i = 0; i < 100; i++) for (c = 1; c <= 4; c++) {
			dc = i % 25 < 5; f = dc ? 0 : 500 * 2 ^ (i % 4); r = 1000 * c * (1 + i % 3); w = 2 * pi * f * r * 1e-10
			a = 1000 / r * sqrt(1 + w * w) + 1e-5 * (rand() - 0.5); phase = atan2(w, 1) + 1e-5 * (rand() - 0.5)
			printf "%.10g,%d,%d,%s,1,%g,%g,1e-10,%.9g,%s\n", i / 10, i, c, dc ? "dc" : "ac", f, r, a, dc || i % 7 == 3 ? "" : sprintf("%.9g", phase) } }' >blocks.csv
	tactus show blocks.csv | grep -q ', 0 lost'
	tactus diagnose blocks.csv --json | jq -e 'all(.problems[]; .kind != "lost-scans")'
	grep -v '^[0-9.]*,61,' blocks.csv >lost.csv
	tactus diagnose lost.csv --json | jq -e '[.problems[] | select(.kind == "lost-scans") | .text | startswith("sequence skips 1 scan (1 %) in 1 place, first before ")] == [true]'
	tactus show lost.csv | grep -q ', 1 lost'
}

@test "wild readings are excluded, and said" {
	made 'if (i == 77 || i == 300) g = 1' >wild.csv
	survives wild.csv
	tactus diagnose wild.csv --json | jq -e 'any(.problems[]; .kind == "outliers" and
		(.text | startswith("2 isolated wild readings of conductance_S are left out: ")))'
	tactus diagnose wild.csv | head -1 | grep -q '^Problem'
}

@test "numbers as people read them: no thousand of a prefix, noise by its multiple, all that can be explained" {
	page() { tactus diagnose "$@" | tr -s '\n ' ' '; }
	made 'g = 1e-13 * f + (i % 2 ? 1 : -1) * 0.9999e-12' >tiny.csv # off by 999.9 fS
	[[ $(page tiny.csv) == *"off by 1.0 pS rms, "* ]] || fail "$(page tiny.csv)"
	[[ $(page "$creep") =~ readings\).*\ [0-9.]+\ ×\ the\ noise\ floor.*\;\ (all|[0-9.]+\ %)\ of\ what\ can\ be\ explained ]] || fail "$(page "$creep")"
	for args in "$creep" tiny.csv "$plain -m $model" "$plain -m $stale"; do
		if [[ $(page $args) =~ %\ of\ the\ noise|1[0-9][0-9]\ %\ of\ what|samples ]]; then fail "$args"; fi
	done
}

@test "newtons that are not known once channels are coupled are said in words" {
	awk 'BEGIN { srand(4); print "time_s,sequence,channel,force_N,conductance_S"
		for (i = 0; i < 400; i++) {
			for (c = 1; c <= 2; c++) if (i % (20 * c + 7) == 0) f[c] = 100 * rand()
			for (c = 1; c <= 2; c++) printf "%.10g,%d,%d,%.6g,%.8g\n", i / 10, i, c, f[c], 1e-6 + 4e-7 * (f[c] + 0.3 * f[3 - c]) + 1e-7 * (rand() + rand() - 1) } }' >coupled.csv
	run --separate-stderr tactus diagnose coupled.csv
	prints "2 of 2 sensors: mechanical-crosstalk"
	[[ $(tr -s '\n ' ' ' <<<"$output") == *"not known in newtons, the channels being coupled"* ]] || fail "a dash alone"
	tactus diagnose coupled.csv --json | jq -e '.summary + .series[0].summary | test("nan") | not'
}

@test "colour on a terminal, but not with NO_COLOR" {
	type script >/dev/null || skip "script(1) is not installed"
	TERM=xterm script -qec "tactus diagnose $creep" /dev/null >on
	grep -q $'\033' on
	NO_COLOR=1 TERM=xterm script -qec "tactus diagnose $creep" /dev/null >off
	if grep -q $'\033' off; then fail "coloured"; fi
}

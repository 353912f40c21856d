#!/usr/bin/env bats
# tactus convert: every option, against complex arithmetic and least squares in numpy.
load common

# Two loads behind a switch of 78 ohm and leads of 12 pF, in ac (3 V, 4 kHz) and dc (-5 V), over 1800 ohm.
loads() {
	$PYTHON - "$@" <<-'END'
		import numpy as np
		print("# gain_resistor_ohm: 1800\ntime_s,channel,mode,drive_V,frequency_Hz,amplitude_V,phase_rad,note")
		w = 2 * np.pi * 4000
		for i, (r, c) in enumerate([(2000, 500e-12), (47000, 100e-12)]):
		    y = 1 / (78 + 1 / (1 / r + 1j * w * (c + 12e-12)))
		    print(f"{i},{i + 1},ac,3,4000,{1800 * 3 * abs(y)!r},{np.angle(y)!r},first")
		    print(f"{i + .5},{i + 1},dc,-5,0,{1800 * 5 / (r + 78)!r},,second")
	END
}
near() { # VALUE EXPECTED RELATIVE
	$PYTHON -c 'import sys; a, b, t = map(float, sys.argv[1:]); sys.exit(abs(a - b) > t * abs(b))' "$@" || fail "$1 is not $2"
}
cell() { column "$1" <"$2" | sed -n "$3p"; } # NAME FILE ROW

@test "R and C of known loads come back, with switch and leads removed" {
	loads >in.csv
	tactus convert in.csv --switch-resistance 78 --lead-capacitance 12pF >out.csv
	near "$(cell resistance_ohm out.csv 1)" 2000 1e-12
	near "$(cell capacitance_F out.csv 1)" 500e-12 1e-11
	near "$(cell resistance_ohm out.csv 2)" 2000 1e-12
	near "$(cell conductance_S out.csv 4)" 2.127659574468085e-05 1e-12
	near "$(cell capacitance_F out.csv 3)" 100e-12 1e-10
	[ "$(column quality <out.csv | sort -u)" = ok ]
	[ "$(column note <out.csv | sort -u | tr '\n' ' ')" = "first second " ]
	[ "$(metadata switch_resistance_ohm <out.csv) $(metadata lead_capacitance_F <out.csv)" = "78 1.2e-11" ]
	tactus convert in.csv >plain.csv
	near "$(cell resistance_ohm plain.csv 2)" 2078 1e-12
}

@test "new columns are at the end in the contract's order; converting again gives the same bytes" {
	loads >in.csv
	tactus convert in.csv --phase-std 1mrad --amplitude-std 1mV --dc-std 1mV >once.csv
	[ "$(grep -v '^#' once.csv | head -1)" = "time_s,channel,mode,drive_V,frequency_Hz,amplitude_V,phase_rad,note,resistance_ohm,conductance_S,capacitance_F,resistance_std_ohm,conductance_std_S,capacitance_std_F,quality" ]
	tactus convert once.csv | cmp - once.csv
	tactus convert - <once.csv | tactus convert | cmp - once.csv
	tactus convert in.csv --amplitude-std 1mV --phase-std 0.001 --dc-std 0.001 --format jsonl | tactus convert --format csv | cmp - once.csv
}

@test "no uncertainty stated: a note says what cannot be judged; any statement of one silences it" {
	loads >in.csv
	run --separate-stderr tactus convert in.csv
	status_is 0
	says "not stated (--amplitude-std"
	says "folded or ill-conditioned"
	run --separate-stderr tactus convert in.csv --quiet
	[ -z "$stderr" ]
	run --separate-stderr tactus convert in.csv --phase-std 1mrad
	[ -z "$stderr" ]
	{
		printf '# adc_bits: 16\n# adc_range_V: 10\n# detector_amplitude_gain: 1\n# detector_dc_gain: 1\n'
		printf '# detector_phase_supply_V: 5\n# detector_phase_inverted: false\n'
		cat in.csv
	} >adc.csv
	run --separate-stderr tactus convert adc.csv
	[ -z "$stderr" ]
}

@test "the standard uncertainties are those of first order" {
	loads >in.csv
	tactus convert in.csv >none.csv
	[ -z "$(column resistance_std_ohm <none.csv | tr -d '\n')" ]
	tactus convert in.csv --amplitude-std 2mV --phase-std 0.1deg --dc-std 1mV >out.csv
	a=$(cell amplitude_V in.csv 1) p=$(cell phase_rad in.csv 1)
	near "$(cell resistance_std_ohm out.csv 1)" "$($PYTHON -c "from math import *; a, p = $a, $p; print(5400 / a / cos(p) * hypot(.002 / a, tan(p) * radians(.1)))")" 1e-9
	near "$(cell capacitance_std_F out.csv 1)" "$($PYTHON -c "from math import *; a, p = $a, $p; print(a * sin(p) / (5400 * 8000 * pi) * hypot(.002 / a, radians(.1) / tan(p)))")" 1e-9
	near "$(cell conductance_std_S out.csv 2)" 1.1111111111111111e-07 1e-12
	[ "$(metadata phase_std_rad <out.csv)" = 0.0017453292519943296 ]
}

@test "the amplifier's resistor is not guessed: status 2 says how to state it" {
	loads | grep -v '^#' >in.csv
	run --separate-stderr tactus convert in.csv
	status_is 2
	says --gain-resistor
	[ -z "$output" ]
	tactus convert in.csv -g 1.8kohm >out.csv
	[ "$(metadata gain_resistor_ohm <out.csv)" = 1800 ]
}

@test "metadata that are no number, or none that can be, are status 3 with their line" {
	loads >in.csv
	for wrong in abc -3; do
		sed "s/^# gain_resistor_ohm: .*/# gain_resistor_ohm: $wrong/" in.csv >wrong.csv
		run -3 --separate-stderr tactus convert wrong.csv
		says "wrong.csv:$(grep -n gain_resistor wrong.csv | cut -d: -f1): metadata"
	done
}

@test "drive and frequency: options for a log without them, refused where nobody states them" {
	printf 'peak,angle\n1.5,0.2\n' >log.csv
	run --separate-stderr tactus convert log.csv -g 1kohm --columns amplitude_V=peak,phase_rad=angle
	status_is 2
	says --drive
	run --separate-stderr tactus convert log.csv -g 1kohm --drive 3V --columns amplitude_V=peak,phase_rad=angle
	status_is 2
	says --frequency
	tactus convert log.csv -g 1kohm --drive 3V --frequency 4kHz --columns amplitude_V=peak,phase_rad=angle >out.csv
	near "$(cell resistance_ohm out.csv 1)" 2040.6776898 1e-9
	[ "$(metadata drive_V <out.csv) $(metadata frequency_Hz <out.csv)" = "3 4000" ]
}

@test "no row is dropped: what is wrong is said in quality" {
	cat >in.csv <<-'END'
		# gain_resistor_ohm: 1000
		# amplitude_max_V: 5
		# phase_std_rad: 0.01
		mode,drive_V,frequency_Hz,amplitude_V,phase_rad,quality
		ac,3,4000,1,0.5,ok
		ac,3,4000,1,-0.5,ok
		ac,3,4000,1,0.005,ok
		ac,3,4000,5,0.5,ok
		ac,3,4000,,0.5,ok
		ac,3,4000,1,0.5,clipped
		dc,-5,0,-1,,
		ac,3,-4000,1,0.5,ok
		ac,3,0,1,0.5,ok
	END
	tactus convert in.csv >out.csv
	[ "$(column quality <out.csv | tr '\n' ' ')" = "ok wrong-sign folded+ill-conditioned clipped missing clipped wrong-sign wrong-sign missing " ]
	[ "$(cell capacitance_std_F out.csv 8)" = "$(cell capacitance_std_F out.csv 1)" ] || fail "an uncertainty has no sign"
	[ -z "$(cell capacitance_F out.csv 9)$(cell capacitance_std_F out.csv 9)" ]
	[ -z "$(cell resistance_ohm out.csv 5)" ]
	near "$(cell resistance_ohm out.csv 2)" "$(cell resistance_ohm out.csv 1)" 1e-15
}

@test "a mode that is neither ac nor dc is status 3 with its line" {
	printf '# gain_resistor_ohm: 1000\nmode,drive_V,frequency_Hz,amplitude_V\ndc,-5,0,1\nAC,3,4000,1\n' >in.csv
	run --separate-stderr tactus convert in.csv
	status_is 3
	says "in.csv:4: mode 'AC'"
}

@test "detector volts are converted by the scale in the metadata, and refused without it" {
	tactus scan sim: --count 3 --seed 4 >plain.csv
	tactus scan sim: --count 3 --seed 4 --raw >raw.csv
	tactus convert raw.csv >out.csv
	for c in resistance_ohm capacitance_F conductance_std_S; do
		paste <(column $c <plain.csv) <(column $c <out.csv) | awk -F '\t' '$1 == "" && $2 == "" { next } { d = $1 - $2; if (d < 0) d = -d; if (d > 1e-9 * ($1 < 0 ? -$1 : $1)) exit 1 }'
	done
	grep -v detector_phase_inverted raw.csv >blind.csv
	run --separate-stderr tactus convert blind.csv
	status_is 3
	says detector_phase_inverted
}

# ---- raw samples

# 80 ms at 200 kHz of a scan of three loads with a transient at every switch: w.csv, w.f32, w.i16; alone.* without drive.
waveform() {
	$PYTHON - <<-'END'
		import numpy as np
		rate, f, dwell = 200e3, 4000, .0053
		t = np.arange(16000) / rate
		slot = np.floor(t / dwell + 1e-9).astype(int)
		r, c = np.array([2e3, 5e3, 2e4])[slot % 3], np.array([500e-12, 200e-12, 100e-12])[slot % 3]
		y = 1 / r + 2j * np.pi * f * c
		drive = 3 * np.sin(2 * np.pi * f * t + .4)
		out = -1800 * 3 * abs(y) * np.sin(2 * np.pi * f * t + .4 + np.angle(y)) + .1 + 2 * np.exp(-(t - slot * dwell) / 1e-4)
		np.stack([out, drive], 1).astype("<f4").tofile("w.f32")
		np.stack([out, drive], 1).__mul__(5000).round().astype("<i2").tofile("w.i16")
		out.astype("<f4").tofile("alone.f32")
		with open("w.csv", "w") as file:
		    print("# gain_resistor_ohm: 1800\n# frequency_Hz: 4000\ntime_s,sample_V,drive_sample_V", file=file)
		    for row in zip(t + 10, out, drive):
		        print("%.9g,%.9g,%.9g" % row, file=file)
	END
}
scan="--channels 4,2,7 --dwell 5.3ms --settle 2.3ms"
check_scan() { # FILE TOLERANCE
	[ "$(column channel <"$1" | tr '\n' ' ')" = "4 2 7 4 2 7 4 2 7 4 2 7 4 2 7 " ]
	[ "$(column sequence <"$1" | tr '\n' ' ')" = "0 0 0 1 1 1 2 2 2 3 3 3 4 4 4 " ]
	for row in 1 2 3 13 14 15; do
		near "$(cell resistance_ohm "$1" $row)" "$(echo 2e3 5e3 2e4 | cut -d' ' -f$(((row - 1) % 3 + 1)))" "$2"
		near "$(cell capacitance_F "$1" $row)" "$(echo 500e-12 200e-12 100e-12 | cut -d' ' -f$(((row - 1) % 3 + 1)))" "$(awk "BEGIN { print 40 * $2 }")"
	done
	[ "$(column quality <"$1" | sort -u)" = ok ]
}

@test "--waveform float32: a scan's samples become the loads of its channels" {
	waveform
	binary="--sample-rate 200kHz --frequency 4kHz -g 1800"
	tactus convert w.f32 -w float32 $binary --drive-sampled $scan >out.csv
	check_scan out.csv 1e-6
	near "$(cell drive_V out.csv 2)" 3 1e-6
	tactus convert -w float32 $binary --drive-sampled $scan <w.f32 | cmp - out.csv
	(head -c 1001 w.f32 && sleep 0.2 && tail -c +1002 w.f32) | tactus convert - -w float32 $binary --drive-sampled $scan | cmp - out.csv
	tactus convert alone.f32 -w float32 $binary --drive 3V --drive-phase 0.4 $scan >stated.csv
	check_scan stated.csv 1e-6
	[ "$(metadata sample_rate_Hz <out.csv) $(metadata phase_signed <out.csv)" = "200000 true" ]
	grep -v '^#' out.csv | head -1 | grep -q '^time_s,sequence,channel,mode,drive_V,frequency_Hz,amplitude_V,phase_rad,.*,quality$'
}

@test "--waveform int16: the scales are stated, a sample at the end of its range is clipped" {
	waveform
	binary="--sample-rate 200kHz --frequency 4kHz -g 1800 --drive-sampled"
	run --separate-stderr tactus convert w.i16 -w int16 $binary $scan
	status_is 2
	says --sample-scale
	tactus convert w.i16 -w int16 $binary --sample-scale 200uV --drive-scale 200uV $scan >out.csv
	check_scan out.csv 1e-4
	tactus convert w.i16 -w int16 $binary --sample-scale 200uV --drive-scale 200uV --clip 2.5V $scan >clipped.csv
	[ "$(column quality <clipped.csv | head -3 | tr '\n' ' ')" = "clipped ok ok " ]
}

@test "--waveform csv: time_s tells the rate, lost samples cost their reading only" {
	waveform
	run --separate-stderr tactus convert w.csv -w csv $scan -o out.csv
	status_is 0
	says "200000 samples per second"
	check_scan out.csv 1e-7
	near "$(cell time_s out.csv 1)" 10.0037975 1e-9
	sed 8000,8009d w.csv >lost.csv
	run --separate-stderr tactus convert lost.csv -w csv $scan -o lost.out
	status_is 0
	says "10 samples were lost"
	[ "$(column quality <lost.out | tr '\n' ' ')" = "ok ok ok ok ok ok ok missing ok ok ok ok ok ok ok " ]
	near "$(cell resistance_ohm lost.out 9)" 2e4 1e-7
	near "$(cell resistance_ohm lost.out 13)" 2e3 1e-7
}

@test "--waveform refuses what it would have to guess, and what is no stream of samples" {
	waveform
	run --separate-stderr tactus convert w.f32 -w float32 --frequency 4kHz -g 1800 --drive 3V
	status_is 2
	says --sample-rate
	run --separate-stderr tactus convert w.f32 -w float32 --sample-rate 200kHz -g 1800 --drive 3V
	status_is 2
	says --frequency
	run --separate-stderr tactus convert w.f32 -w float32 --sample-rate 200kHz --frequency 4kHz -g 1800
	status_is 2
	says --drive
	run --separate-stderr tactus convert w.f32 -w float32 --sample-rate 200kHz --frequency 4kHz --drive-sampled
	status_is 2
	says --gain-resistor
	run --separate-stderr tactus convert w.f32 -w float32 --sample-rate 200kHz --frequency 4kHz --drive-sampled -g 1kohm --dwell 1ms --settle 2ms
	status_is 2
	says dwell
	run --separate-stderr bash -c 'head -c 4001 w.f32 | tactus convert - -w float32 --sample-rate 200kHz --frequency 4kHz --drive-sampled -g 1kohm -o out.csv'
	status_is 3
	says "within a sample"
	[ ! -e out.csv ]
	for format in int16 float32; do
		run --separate-stderr bash -c ": | tactus convert - -w $format --sample-scale 1V --sample-rate 200kHz --frequency 4kHz --drive 3V -g 1kohm"
		status_is 3
		says "the file is empty"
		[ -z "$output" ] || fail "a header without samples"
	done
	printf '\0\0\300\177' >nan.f32
	run --separate-stderr tactus convert nan.f32 -w float32 --sample-rate 200kHz --frequency 4kHz --drive 3V -g 1kohm
	status_is 3
	says "byte 0"
	run --separate-stderr tactus convert nowhere -w float32 --sample-rate 200kHz --frequency 4kHz --drive 3V -g 1kohm
	status_is 3
	says nowhere
	printf '# gain_resistor_ohm: 1\ntime_s,sample_V\n1,1\n0.5,1\n' >back.csv
	run --separate-stderr tactus convert back.csv -w csv --sample-rate 2kHz --frequency 100Hz --drive 3V
	status_is 3
	says back.csv:4
	sed -i s/^0.5/1.5/ back.csv
	run --separate-stderr tactus convert back.csv -w csv --frequency 100Hz --drive 3V
	status_is 2
	says --sample-rate
}

@test "waveform: the dc readings of a scan's plan become resistances too, and --mode says the plan where nothing does" {
	samples() { # two channels of 2 and 4 kohm, 20 samples in dc at -5 V, 20 in ac at 3 V and 1 kHz
		printf '# gain_resistor_ohm: 1000\n# sample_rate_Hz: 20000\n# frequency_Hz: 1000\n%s' "$1"
		awk 'BEGIN { print "sample_V"; for (i = 0; i < 160; i++) { r = 2000 * (1 + int(i / 40) % 2)
			printf "%.12g\n", int(i / 20) % 2 == 0 ? 5000 / r : -3000 / r * sin(2 * 3.14159265358979 * i / 20) } }'
	}
	samples $'# modes: dc,ac\n# dc_drive_V: -5\n# drive_V: 3\n' >plan.csv
	run -0 --separate-stderr tactus convert plan.csv -w csv --channels 1-2 --dwell 1ms
	[ "$(column mode <<<"$output" | tr '\n' ' ')" = "dc ac dc ac dc ac dc ac " ] || fail "modes"
	[ "$(column resistance_ohm <<<"$output" | awk '{ printf "%.3f ", $1 }')" = \
		"2000.000 2000.000 4000.000 4000.000 2000.000 2000.000 4000.000 4000.000 " ] || fail "resistances"
	samples '' >none.csv
	run -0 --separate-stderr tactus convert none.csv -w csv --channels 1-2 --dwell 1ms --mode dc,ac --dc-drive=-5V --drive 3V
	[ "$(column resistance_ohm <<<"$output" | awk '{ printf "%.3f ", $1 }' | cut -c1-18)" = "2000.000 2000.000 " ] || fail "stated"
	run -2 --separate-stderr tactus convert none.csv -w csv --mode dc
	says --dc-drive
	run -2 --separate-stderr tactus convert plan.csv -w csv
	says --dwell
}

@test "waveform: several channels are never mixed, and what the samples say is not stated beside them" {
	waveform
	options="-w csv -o out.csv"
	run -2 --separate-stderr tactus convert w.csv $options --channels 4,2,7
	says --dwell
	run -3 --separate-stderr tactus convert w.csv $options --channels 4,2,7 --dwell 1s
	says "w.csv: the samples end within the first dwell of 1 s"
	[ ! -e out.csv ] || fail "one reading of three loads"
	run -0 --separate-stderr tactus convert w.csv $options --channels 4,2,7 --dwell 30ms
	run -0 --separate-stderr tactus convert w.csv $options --overwrite --channels 1-4 --dwell 30ms
	says "after 3 of its 4 readings"
	awk -F, '/^#/ { next } { print $0 "," (header++ ? $1 < 10.04 ? 1 : 2 : "channel") }' w.csv >by-channel.csv
	run -0 --separate-stderr tactus convert by-channel.csv $options --overwrite -g 1800 --frequency 4kHz --channels 1,2
	[ "$(column channel <out.csv | tr '\n' ' ')" = "1 2 " ] || fail "the channel column says where a reading ends"
	for stated in --drive=1V --drive-phase=1 --dc-drive=1V; do
		run -2 --separate-stderr tactus convert w.csv -w csv $stated
		says "${stated%=*}: the drive is sampled"
	done
	for rate in 0 -1; do
		run -2 --separate-stderr tactus convert w.csv -w csv --sample-rate=$rate
		says "($rate Hz) must be above 0"
	done
}

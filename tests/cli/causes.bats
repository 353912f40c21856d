#!/usr/bin/env bats
# What tactus diagnose makes of causes, noise and what has no name, in recordings that it had no part in.
load common
load diagnosis

@test "a column of whole numbers that the output follows is named, whatever the load does besides" {
	made 'x = int(45 + 20 * sin(i / 97)); g += 1e-7 * x' 1500 >humid.csv
	tactus diagnose humid.csv --json >said.json
	jq -e '.verdict == "unexplained" and .series[0].unexplained[0].covariate == "extra"' said.json
}

@test "a column that one output follows is seen beside a larger misfit of the other" {
	made 'f = 100 + 90 * sin(0.273 * t) + 30 * (int(i / 300) % 2); split("3 30 100", tau, " ")
		for (k = 1; k <= 3; k++) s[k] += (f - s[k]) * 0.1 / tau[k]
		x = 40 + 20 * sin(0.103 * t + 1); g = 6e-7 + 4e-7 * f + 1e-7 * x + 5e-9 * (rand() - 0.5)
		x = x "," 1e-11 + 3e-13 * (f + 0.05 * s[1] + 0.08 * s[2] + 0.1 * s[3]) + 1e-14 * (rand() - 0.5)' 3000 |
		sed '1s/extra/humidity,capacitance_F/' >two.csv
	tactus diagnose two.csv --json | jq -e 'any(.series[0].wrong[]; .covariate == "humidity" and .explained > 0.5)'
}

@test "readings that are wild only once the cause is known: codes a step off what they should be" {
	cat >loads.toml <<-'EOM'
		kind = "model"
		format = 1
		domain = "readout"
		form = "forward"
		[output.amplitude_V]
		[base]
		gain_resistor_ohm = 1000
		[[channel]]
		channel = 1
		[channel.reading.amplitude_V]
		residual_std = 0.0016
	EOM
	awk 'BEGIN { srand(5); n = split("470 1000 2200 4700 10000", r, " ")
		print "# gain_resistor_ohm: 1000"
		print "time_s,sequence,channel,reference_resistance_ohm,reference_capacitance_F,frequency_Hz,drive_V"
		for (i = 0; i < 2000; i++)
			printf "%g,%d,1,%s,2.2e-10,%d,%.5f\n", i / 20, i, r[1 + int(n * rand())], 500 * 2 ^ int(5 * rand()),
				2 ^ int(3 * rand() - 1) * (1 + 0.001 * rand()) }' >inputs.csv
	tactus simulate -q -m loads.toml inputs.csv --noise --seed 1 -o readings.csv
	awk -F, -v OFS=, '/^#/ { print; next } named++ { $NF = 0.04 * int($NF / 0.04 + 0.5) } 1' readings.csv >codes.csv
	tactus diagnose codes.csv --json >said.json
	jq -e '.series[0].causes[0].effect == "adc-quantisation"' said.json
	jq -e 'any(.problems[]; .kind == "outliers")' said.json
}

@test "a reference that lags under one ramp and a sudden release is no step of the sensor" {
	cat >late.toml <<-'EOB'
		kind = "bench"
		base = "paredes"
		[reference]
		latency_s = 0.5
		[scan]
		rate_Hz = 4
	EOB
	for seed in 1 2 3; do
		tactus scan sim:late.toml --seed $seed --protocol 'ramp 0N..100N 10s, hold 0N 5s' --mode dc --channels 1 -q |
			tactus convert -q -o late.csv --overwrite
		tactus diagnose late.csv --json >said.json
		jq -e '[.series[0].causes[].effect] == ["time-offset"]' said.json
		jq -e '.series[0].causes[0].parameters[0].value | . > -0.51 and . < -0.49' said.json
	done
}

@test "a lag of second order is a lag, with no time offset beside it" {
	computed "time_s,force_N,conductance_S" "t[::fine], load[::fine], g" >two_poles.csv <<-'EOP'
		from scipy.signal import lfilter
		rng = np.random.default_rng(5)
		dt, fine, n = 2e-3, 20, 8000
		t = np.arange(n * fine) * dt / fine
		load = 20 + sum(3 * np.sin(2 * np.pi * f * t + p) for f, p in zip(rng.uniform(0.3, 12, 9), rng.uniform(0, 6, 9)))
		shown = load
		for tau in (0.012, 0.005):
		    k = 1 - np.exp(-dt / fine / tau)
		    shown = lfilter([k], [1, k - 1], shown, zi=[(1 - k) * shown[0]])[0]
		g = 1e-6 + 4e-7 * shown[::fine] + 4e-8 * rng.standard_normal(n)
	EOP
	tactus diagnose two_poles.csv --json >said.json
	jq -e '.series[0] | [.causes[].effect] == ["lag"] and .structure_remains' said.json
}

# rubbed LOAD NOISE: what springs that slip, in parallel (Iwan 1966), leave of a load, with noise; newtons of load in t.
rubbed() {
	computed "time_s,force_N,conductance_S" "t, load, g" <<-EOP
		rng = np.random.default_rng(1)
		t = np.arange(2000) * 0.01
		tri = lambda x: np.abs((x + 1) % 2 - 1)
		load = $1
		slip, carried, felt = 20 * np.array([0.02, 0.04, 0.08, 0.15, 0.3]), np.zeros(5), []
		for step in np.diff(load, prepend=load[0]):
		    carried = np.clip(carried + step, -slip, slip)
		    felt.append(carried @ [0.3, 0.25, 0.2, 0.15, 0.1])
		g = 1e-7 + 2e-6 * (load - 0.25 * np.array(felt) + $2 * rng.standard_normal(len(t)))
	EOP
}

@test "friction under equal triangles is one loop, which creep makes too: ambiguous; two rates and amplitudes name it" {
	local noise half
	for noise in 0.03 0.1 0.2; do
		for half in 1.7 3.1; do
			rubbed "20 * tri(t / $half)" "$noise" >one_rate.csv
			tactus diagnose one_rate.csv --json >said.json
			jq -e '.verdict == "ambiguous" and
				([.series[0].causes[0] | .effect, .rivals[].effect] | index("hysteresis") != null)' said.json
		done
		rubbed "np.where(t < 10, 20, 8) * tri(t / np.where(t % 10 < 6, 1, 0.1))" "$noise" >rates.csv
		tactus diagnose rates.csv --json >said.json
		jq -e '.verdict == "cause-found" and [.series[0].causes[].effect] == ["hysteresis"]' said.json
	done
}

# Known loads in place of a sensor, at several frequencies and drives. SETUP, Python: what the bench does to them.
known_loads() { # SETUP > CSV
	computed "time_s,channel,reference_resistance_ohm,reference_capacitance_F,frequency_Hz,drive_V,amplitude_V,phase_rad" \
		"t, k, R, C, f, V, A, P" <<-EOP
			rng = np.random.default_rng(11)
			n = 1200
			t, k = np.arange(n) * 0.01, np.arange(n) % 8 + 1
			R = rng.choice([2e3, 5e3, 1e4, 3e4, 1e5, 3e5], n)
			C = rng.choice([2e-11, 1e-10, 5e-10, 2e-9], n)
			f = rng.choice([1e3, 4e3, 1e4, 4e4, 1e5], n)
			V = rng.choice([0.5, 1.0, 2.0, 4.0], n)
			Rg, lost, sA, sP = 1000.0, 0.0, 1e-3, 1e-3
			$1
			H = Rg * (1 / R + 2j * np.pi * f * C)
			sine = np.sin((np.arange(2000) + 0.5) * np.pi / 2000)
			half = np.maximum(np.abs(V * H)[:, None] * sine - lost, 0).mean(axis=1) * np.pi / 2
			A = half + sA * rng.standard_normal(n)
			P = np.angle(H) + sP * rng.standard_normal(n)
		EOP
}
names_of_a_readout() { # NAME...: exactly these, with confidence
	jq -e --args '.verdict == "cause-found" and ([.series[0].causes[].effect] | sort) == ($ARGS.positional | sort)' "$@" <said.json
}

@test "a resistor that moved by the noise of the amplitude, beside a phase that is much noisier" {
	known_loads 'Rg, sA, sP = 1000.8, 1e-3, 0.05' >moved.csv
	printf '%s\n' 'kind = "model"' 'format = 1' 'domain = "readout"' 'form = "forward"' '[output.amplitude_V]' \
		'[output.phase_rad]' '[[channel]]' 'channel = 1' 'base = { gain_resistor_ohm = 1000 }' >before.toml
	tactus diagnose moved.csv -m before.toml --json >said.json
	jq -e '.series[0].causes[0] | .effect == "stale-calibration" and .parameters[0].name == "gain_resistor_ohm"' said.json
}

generated() { # KIND SEED > CSV: a recording of the blind tests' generator, of the seeds that are for tuning
	PYTHONPATH=$root/tests/blind "$PYTHON" -B -c "import generate
print(generate.make_case('$1', $2).texts[0], end='')"
}

@test "a comparator that is early behind switches: phases fold, and no capacitance does that" {
	for seed in 47002 47082; do
		generated two/readout $seed >early.csv
		tactus diagnose early.csv --json >said.json
		names_of_a_readout comparator-delay switch-resistance
	done
}

@test "a large feedback capacitance is one, though for a small one a delay would do" {
	for seed in 47000 47001 47002; do
		generated ambiguous/in_proportion_to_frequency/with $seed >large.csv
		tactus diagnose large.csv --json >said.json
		names_of_a_readout feedback-capacitance
	done
}

@test "a diode takes a band of every half wave: an offset of the rectifier, and no gain error beside it" {
	known_loads 'lost = 0.08' >band.csv
	tactus diagnose band.csv --json >said.json
	names_of_a_readout rectifier-offset
	jq -e '.series[0].causes[0].parameters[0] | .name == "offset_V" and (.value + 0.08 * 3.14159265 / 2 | fabs) < 2e-3' said.json
	generated two/readout 47053 >beside.csv
	tactus diagnose beside.csv --json >said.json
	names_of_a_readout comparator-hysteresis rectifier-offset
}

@test "a stack under one load, scanned channel by channel: a moved slope or crosstalk, and one sensor alone tells" {
	computed "time_s,channel,force_N,conductance_S" "t, k, f, g" >stack.csv <<-'EOP'
		rng = np.random.default_rng(5)
		n = 6000
		t, k = np.arange(n) * 0.02, np.arange(n) % 4 + 1
		f = 50 + 30 * np.sin(3.1 * t) + 15 * np.sin(7.3 * t + 1)
		coupled = np.where((k == 1) | (k == 4), 1.02, 1.04)
		g = 1e-6 + 4e-7 * coupled * f + 2e-8 * rng.standard_normal(n)
	EOP
	{
		printf '%s\n' 'kind = "model"' 'format = 1' 'domain = "sensor"' 'form = "forward"' '[output.conductance_S]'
		for channel in 1 2 3 4; do
			printf '%s\n' '[[channel]]' "channel = $channel" 'input_range = [0, 100]' 'base = { g0 = 1e-6, g1 = 4e-7 }'
		done
	} >alone.toml
	tactus diagnose stack.csv -m alone.toml --json >said.json
	jq -e 'all(.series[]; .verdict == "ambiguous" and
		([.causes[0] | .effect, .rivals[].effect] == ["stale-calibration", "mechanical-crosstalk"]) and
		(.next_experiment.text | contains("one sensor alone")))' said.json
}

@test "weak friction on one sine: of one outline the number of parameters does not decide" {
	generated ambiguous/hysteresis_or_lag/without 47005 >weak.csv
	tactus diagnose weak.csv --json >said.json
	jq -e '.verdict == "ambiguous" and ([.series[0].causes[0] | .effect, .rivals[].effect] | index("hysteresis") != null)' said.json
}

@test "what a time offset costs in newtons is measured at the re-stamped times" {
	computed "time_s,force_N,conductance_S" "t, load(t), g" >offset.csv <<-'EOP'
		rng = np.random.default_rng(6)
		t = np.arange(4000) * 0.01
		load = lambda t: 40 + 20 * np.sin(2.1 * t) + 10 * np.sin(5.3 * t + 1)
		g = 1e-6 + 4e-7 * load(t - 0.05) + 4e-8 * rng.standard_normal(len(t))
	EOP
	tactus diagnose offset.csv --json >said.json
	jq -e '.series[0].causes[0].effect == "time-offset"' said.json
	# 0.05 s at some 55 N/s; the noise is 0.1 N
	jq -e '.series[0].gain | .force_rmse_before_N > 1 and .force_rmse_after_N > 0.09 and .force_rmse_after_N < 0.12' said.json
}

@test "a cause that may harm stretches no choice has seen leaves structure, and is said to" {
	made 'if (i >= 590 && i < 650) g = g * 1.12 + 6e-7; g += 2e-7 * (rand() + rand() + rand() - 1.5)' 1000 >moved.csv
	tactus diagnose moved.csv --json >said.json
	jq -e '[.series[0].causes[].effect] == ["step-change"]' said.json
	jq -e 'any(.series[0].causes[]; .evidence.held_out_gain_ci95[0] < 0)' said.json
	jq -e '.series[0] | .structure_remains and any(.unexplained[].text; test("may help or harm"))' said.json
}

# A recording on standard output: loads held for random times, and what Python says of the noise e in newtons.
left_over() {
	NOISE=$1 SEED=${2:-1} "$PYTHON" - <<-'EOP'
		import os, textwrap
		import numpy as np
		rng = np.random.default_rng(int(os.environ["SEED"]))
		n = 3000
		t = np.arange(n) * 0.1
		load = np.repeat(rng.uniform(0, 100, 60) * (rng.random(60) > 0.25), n // 60)
		load = np.convolve(np.pad(load, 5, mode="edge"), np.ones(11) / 11, "valid")
		white = rng.standard_normal(n)
		exec(textwrap.dedent(os.environ["NOISE"]))
		print("time_s,force_N,conductance_S")
		for row in zip(t, load, 1e-7 + 4e-7 * (load + e)):
		    print("%.6g,%.8g,%.8g" % row)
	EOP
}

@test "a steady swing is no noise, however well an autoregression foretells it; the frequency is said" {
	left_over "e = 0.1 * (200 * np.sin(2 * np.pi * 2.3 * t) + white)" >sine.csv
	tactus diagnose sine.csv --json >said.json
	contract <said.json
	jq -e '.verdict == "unexplained" and (.series[0].unexplained[0] | .covariate == "time_s" and .explained > 0.9 and
		(.text | test("conductance_S swings at 2.3 Hz, whatever the load")))' said.json
	jq -e '.series[0].base[0] | .rmse > 20 * .noise_floor and .noise_floor < 2e-7' said.json
	# noise that is foretold as well, but has no line
	left_over "
		e = np.zeros(n)
		for i in range(1, n):
		    e[i] = 0.97 * e[i - 1] + 0.24 * white[i]
		" >coloured.csv
	tactus diagnose coloured.csv --json | jq -e '.verdict == "nothing-wrong"'
}

@test "an offset that wanders to and fro eight times is not nothing" {
	left_over "
		f = np.fft.rfftfreq(n) * n
		e = np.fft.irfft(np.fft.rfft(white) * np.where(f > 0, np.exp(-((f / 8) ** 2) / 2), 0), n)
		e = 3 * e / e.std() + 0.3 * rng.standard_normal(n)" >wander.csv
	tactus diagnose wander.csv --json >said.json
	jq -e '.verdict == "unexplained" and .series[0].unexplained[0].covariate == "time_s"' said.json
}

@test "what jumps to and fro without end and foretells nothing wanders, and is no step-change" {
	made 'if (rand() < 0.02) w = 2e-6 * (rand() - 0.5); g += w + 5e-7 * (rand() + rand() + rand() - 1.5)' 1000 >moved.csv
	tactus diagnose moved.csv --json >said.json
	jq -e '.verdict == "unexplained" and any(.series[0].unexplained[].text; test("wanders that no column records"))' said.json
}

@test "a small jump late in white noise is one: what it does not explain is noise, and does not wander" {
	left_over "e = 0.3 * white + 0.3 * (t > 0.85 * t[-1])" >jump.csv
	tactus diagnose jump.csv --json | jq -e '.series[0].causes | length == 1 and .[0].effect == "step-change"'
	left_over "e = 0.3 * white + 0.02 * np.cumsum(rng.standard_normal(n))" >walk.csv
	tactus diagnose walk.csv --json | jq -e '.verdict == "unexplained" and .series[0].causes == []'
}

@test "readings that stop at the converter's last code: in three stretches of many; by as little as the noise" {
	for seed in 45023 45037; do
		generated one/output-clipping $seed >last.csv
		tactus diagnose last.csv --json >said.json
		jq -e '.verdict == "cause-found" and [.series[0].causes[].effect] == ["output-clipping"]' said.json
	done
}

@test "a reference noisier than the sensor makes no cause of its noise: held loads on the bench as it is" {
	for seed in 1 2 3; do
		tactus scan sim: --seed $seed --rate 2 --protocol 'rest 10s, hold 150N 2min, rest 2min' --channels 2 -q -o held.csv --overwrite
		tactus diagnose held.csv --json >said.json
		jq -e '.verdict == "nothing-wrong"' said.json
		# 0.01 N at 1.85 uS/N, four times what the sensor's own noise is
		jq -e '.series[0].base[0] | .noise_floor > 1.4e-8 and .noise_floor < 2.4e-8' said.json
	done
}

@test "both slopes have moved: both are named, and nothing that moves one output alone is a rival" {
	computed "time_s,force_N,conductance_S,capacitance_F" "t, f, g, c" >slopes.csv <<-'EOP'
		rng = np.random.default_rng(7)
		t = np.arange(3000) * 0.1
		f = 50 + 40 * np.sin(0.2 * t) + 5 * np.sin(1.3 * t)
		g = 1e-6 + 4.5e-7 * f + 1e-6 * rng.standard_normal(len(t))
		c = 2e-11 + 3.3e-12 * f + 2e-13 * rng.standard_normal(len(t))
	EOP
	cat >slopes.toml <<-'EOM'
		kind = "model"
		format = 1
		domain = "sensor"
		form = "forward"
		[output.conductance_S]
		[output.capacitance_F]
		[[channel]]
		channel = 1
		input_range = [0, 100]
		base = { g0 = 1e-6, g1 = 4e-7, c0 = 2e-11, c1 = 3e-12 }
	EOM
	tactus diagnose slopes.csv -m slopes.toml --json >said.json
	jq -e '.verdict == "stale-calibration"' said.json
	jq -e '[.series[0].causes[0].parameters[].name] | sort == ["c1", "g1"]' said.json
}

@test "the mains, where they are the cause, are named and no swing is left" {
	left_over "
		t = np.arange(n) * 0.0031
		e = 3 * np.sin(2 * np.pi * 50 * t) + 0.3 * white" >hum.csv
	tactus diagnose hum.csv --json | jq -e '.series[0] | [.causes[].effect] == ["mains-hum"] and
		(.structure_remains | not)'
}

@test "heavy tails, and noise that grows with the load, are noise and no bursts" {
	for seed in 1 2 3; do
		left_over "e = 0.5 * rng.standard_t(4, n)" $seed >tails.csv
		tactus diagnose tails.csv --json | jq -e '.verdict == "nothing-wrong"'
		left_over "e = white * (0.003 + 0.01 * load)" $seed >grows.csv
		tactus diagnose grows.csv --json | jq -e '.verdict == "nothing-wrong"'
	done
}

@test "noise that is large in some stretches comes in bursts" {
	left_over "e = 0.2 * white * np.where(np.arange(n) % 500 < 30, 10, 1)" >bursts.csv
	tactus diagnose bursts.csv --json >said.json
	jq -e '.verdict == "unexplained" and any(.series[0].unexplained[].text; test("comes in bursts"))' said.json
}

@test "the mains is found wherever its frequency lies, and named with it" {
	for hz in 49.97 50.013 59.96; do
		computed time_s,force_N,conductance_S t,f,g <<-EOP >hum.csv
			t = np.arange(6000) / 200
			f = 40 + 40 * np.sin(0.4 * t)
			g = 2e-6 + 3e-7 * f + 3e-7 * np.sin(2 * np.pi * $hz * t + 1) + 4e-8 * np.random.default_rng(3).normal(size=t.size)
		EOP
		tactus diagnose hum.csv --json >said.json
		jq -e --argjson hz $hz '.series[0] | [.causes[].effect] == ["mains-hum"] and .structure_remains == false and
			any(.causes[0].parameters[]; .name == "mains_Hz" and (.value - $hz | fabs) < 4 * .standard_error and
				.standard_error < 0.003) and .gain.reduction > 0.75' said.json || fail "$hz Hz: $(cat said.json)"
	done
}

@test "a slow wave sampled in step with the mains is no mains" {
	computed time_s,force_N,conductance_S t,f,g <<-'EOP' >wave.csv
		t = np.arange(7500) / 50
		f = 40 + 40 * np.sin(0.4 * t)
		g = 2e-6 + 3e-7 * f + 6e-7 * np.sin(2 * np.pi * t / 19) + 4e-8 * np.random.default_rng(4).normal(size=t.size)
	EOP
	tactus diagnose wave.csv --json | jq -e '.verdict == "unexplained"'
}

@test "a conductance that the drive changes, what it leaks without a load too, is no friction beside" {
	for seed in 1 2; do
		computed time_s,force_N,conductance_S,drive_V t,f,g,v <<-EOP >drive.csv
			rng = np.random.default_rng($seed)
			t = np.arange(6000) / 50
			f = 80 * np.abs(2 * (t / 11 % 1) - 1)
			v = np.array([1, 2, 3, 1.5])[(t / 7).astype(int) % 4]
			g = (2e-6 + 3e-7 * f) * (1 + 0.03 * (v ** 2 - 1)) + 5e-8 * rng.normal(size=t.size)
		EOP
		tactus diagnose drive.csv --json >said.json
		jq -e '[.series[0].causes[].effect] == ["voltage-dependence"]' said.json || fail "$seed: $(cat said.json)"
	done
}

@test "a model of one output is judged by that output" {
	computed time_s,force_N,conductance_S,capacitance_F t,f,g,c <<-'EOP' >both.csv
		rng = np.random.default_rng(6)
		t = np.arange(3000) / 50
		f = 80 * np.abs(2 * (t / 11 % 1) - 1)
		g = 2e-6 + 3e-7 * f + 3e-8 * rng.normal(size=t.size)
		c = 8e-12 + 4e-13 * f + 6e-14 * rng.normal(size=t.size)
	EOP
	tactus fit both.csv --model conductance -o one.toml >fitted.txt
	tactus diagnose both.csv -m one.toml --json | jq -e '.verdict == "nothing-wrong" and .series[0].force_rmse_N < 0.2'
	awk -F, -v OFS=, 'NR == 1 || $3 *= 1.08' both.csv >moved.csv
	tactus diagnose moved.csv -m one.toml --json >said.json
	jq -e '.verdict == "stale-calibration" and [.series[0].causes[0].parameters[].name] - ["g0", "g1"] == []' said.json
}

@test "a cause beside a stale calibration: the headline is the model as given, and what moved is said" {
	computed time_s,force_N,conductance_S t,f,g <<-'EOP' >creeps.csv
		t = np.arange(6000) / 50
		f = np.array([0, 60, 0, 90, 10, 50])[(t / 20).astype(int)]
		s = np.zeros(t.size)
		for k in range(1, t.size):
		    s[k] = s[k - 1] + (f[k] - s[k - 1]) * 0.02 / 8
		g = 2e-6 + 3.3e-7 * (f + 0.08 * s) + 3e-8 * np.random.default_rng(8).normal(size=t.size)
	EOP
	linear_model 2e-6 3e-7 3e-8 >old.toml
	tactus diagnose creeps.csv -m old.toml --json >said.json
	jq -e '.series[0] | .causes[0].effect == "creep" and (.moved | test("g1 from .*%")) and
		.force_rmse_N > 3 * .gain.force_rmse_before_N' said.json
	# What the film remembered before the first reading is said where it can be read off.
	jq -e 'all(.series[0].causes[].parameters[]; (.name | startswith("initial_") | not) or
		(.value | fabs) > .standard_error)' said.json
	tactus diagnose creeps.csv -m old.toml >page.txt
	grep -q '^Moved  *beside that the calibration no longer holds: ' page.txt
}

@test "an offset that comes again at the same times of every recording is an unrecorded cause" {
	for k in 1 2 3; do
		computed time_s,force_N,conductance_S t,f,g <<-EOP >again$k.csv
			rng = np.random.default_rng($k)
			t = np.arange(4800) / 40
			f = 80 * np.abs(2 * (t / (7 + $k) % 1) - 1)
			place = np.random.default_rng(99).normal(size=16)[(t / 7.5).astype(int)]
			g = 2e-6 + 3e-7 * f + 3e-7 * place + 4e-8 * rng.normal(size=t.size)
		EOP
	done
	tactus diagnose again1.csv again2.csv again3.csv --json >said.json
	jq -e '.verdict == "unexplained" and .series[0].unexplained[0].covariate == "time_s" and
		(.series[0].unexplained[0].text | test("at the same times in every recording: an unrecorded cause$"))' said.json
}

@test "a thinned recording says so, and a lag in it is no time offset beside" {
	computed time_s,force_N,conductance_S t,f,g <<-'EOP' >long.csv
		t = np.arange(100000) / 500
		f = 40 + 30 * np.sin(2 * t) + 8 * np.sin(17 * t)
		a = 1 - np.exp(-0.0002 / 0.03)
		fine = np.repeat(f, 10)
		from scipy.signal import lfilter
		lagged = lfilter([a], [1, a - 1], fine - fine[0])[9::10] + fine[0]
		g = 2e-6 + 3e-7 * lagged + 4e-8 * np.random.default_rng(9).normal(size=t.size)
	EOP
	tactus diagnose long.csv --json >said.json
	jq -e '.series[0] | .every > 1 and .causes[0].effect == "lag" and .causes[1] == null' said.json
	tactus diagnose long.csv >page.txt
	grep -qE 'every [0-9]+-th' page.txt
}

#!/usr/bin/env bats
# LabJack: scanned over Modbus TCP from an emulated one, which is also read by programs that are not ours.
load common

# A T7's code of its ±10 V range, in volts.
step=316e-6

# emulate ARGUMENTS… → $uri, and $other of a second device; it listens when its URIs are there, so nobody waits.
emulate() {
	exec 9< <(exec tactus emulate "$@" 2>emulator.err 3>&-)
	emulator=$!
	read -r uri <&9 || fail "$(cat emulator.err)"
	port=$(sed 's|.*://[^:]*:\([0-9]*\).*|\1|' <<<"$uri")
	for word; do [[ $word != ati-* ]] || read -r other <&9; done
}

end_emulator() {
	kill "$emulator" 2>/dev/null || return 0
	cat <&9 >rest # until it has closed its standard output
	exec 9<&-
	emulator=
}

teardown() {
	[ -z "${emulator:-}" ] || end_emulator
}

# take N: lines of a running scan from descriptor 8, kept in `taken`.
take() {
	for _ in $(seq "$1"); do
		read -r line <&8 || fail "$(cat scan.err)"
		printf '%s\n' "$line" >>taken
	done
}

# registers ADDRESS COUNT TYPE → values, one a line, by mbpoll; write ADDRESS TYPE VALUES…
registers() { mbpoll -0 -m tcp -p "$port" -a 1 -1 -q -r "$1" -c "$2" -t "$3" ${4:-} 127.0.0.1 | sed -n 's/^\[[0-9]*\]:[ \t]*\([^ ]*\).*/\1/p'; }
write() { mbpoll -0 -m tcp -p "$port" -a 1 -1 -q -r "$1" -t "$2" -B 127.0.0.1 -- "${@:3}" >/dev/null; }

# alike A B TOLERANCE [STEPS]: the detectors' volts of two raw recordings, scan by scan that both have.
alike() {
	"$PYTHON" - "$@" <<-'EOP'
		import csv, sys
		def rows(name):
		    return {(r["sequence"], r["channel"], r["mode"]): r for r in csv.DictReader(l for l in open(name) if l[0] != "#")}
		a, b = rows(sys.argv[1]), rows(sys.argv[2])
		tolerance = float(sys.argv[3])
		both = sorted(set(a) & set(b))
		assert len(both) >= len(b) / 2 and both, (len(a), len(b))
		for key in both:
		    for column in ("detector_amplitude_V", "detector_phase_V", "detector_dc_V"):
		        x, y = a[key].get(column), b[key].get(column)
		        assert (not x) == (not y), (key, column, x, y)
		        assert not x or abs(float(x) - float(y)) <= tolerance, (key, column, x, y)
	EOP
}

# ---- the same numbers as the simulated bench ------------------------------------------------------------------------

@test "labjack: a scan over Modbus TCP reads what sim: reads, within the converter's step" {
	emulate labjack-t7 --protocol "hold 100N 1h" --speed 4
	tactus scan "$uri" --raw --settle 3ms --count 3 --max-lost 100% >emulated.csv
	tactus scan sim:labjack-t7 --protocol "hold 100N 1h" --raw --count 3 >sim.csv
	alike emulated.csv sim.csv $step
	[ "$(metadata device <emulated.csv)" = "LabJack T7 470012345 (firmware 1.0306)" ]
	[ "$(metadata acquisition <emulated.csv)" = requests ]
	for k in device_delay_s device_jitter_s gain_resistor_ohm adc_bits detector_phase_inverted; do [ -n "$(metadata $k <emulated.csv)" ]; done
}

@test "labjack: the hardware-timed stream reads what sim: reads, within two steps of two converters" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	tactus scan "$uri&stream=1" --raw --count 3 >stream.csv
	tactus scan sim:labjack-t7 --protocol "hold 100N 1h" --raw --count 3 >sim.csv
	# another converter, with constants of its own, and other noise: 100 µV of each
	alike stream.csv sim.csv 1e-3
	[ "$(metadata acquisition <stream.csv)" = stream ]
	# by the device's timer: no jitter at all
	[ "$(column time_s <stream.csv | head -3 | tr '\n' ' ')" = "0.015625 0.03125 0.046875 " ]
	# where its period is no round number, to the nanosecond
	tactus scan "$uri&stream=1" --raw --rate 3 --count 1 >thirds.csv
	[ "$(column time_s <thirds.csv | grep -cE '[.][0-9]{10}')" -eq 0 ]
}

@test "labjack: a T4 has other lines, and its flexible ones become digital first" {
	emulate labjack-t4 --protocol "hold 100N 1h" --speed 4
	[ "$(registers 2880 1 4:int -B)" = 4080 ]
	tactus scan "$uri" --raw --settle 3ms --count 2 --max-lost 100% >emulated.csv
	tactus scan sim:labjack-t4 --protocol "hold 100N 1h" --raw --count 2 >sim.csv
	alike emulated.csv sim.csv 5.2e-3
	[ "$(registers 2880 1 4:int -B)" = 0 ]
	tactus scan "$uri&stream=1" --raw --count 2 >stream.csv
	alike stream.csv sim.csv 12e-3
}

@test "labjack: a stream where the rate asks for it, and only there" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	tactus scan "$uri" --channels 1 --mode dc --rate 1 --settle 1ms --count 1 >slow.csv
	[ "$(metadata acquisition <slow.csv)" = requests ]
	tactus scan "$uri" --channels 1 --mode dc --rate 998 --settle 1ms --count 100 >fast.csv
	[ "$(metadata acquisition <fast.csv)" = stream ]
	[ "$(column sequence <fast.csv | wc -l)" -eq 100 ]
	# a period of whole microseconds, which the device's timer can make: what is said is what it makes
	"$PYTHON" -c "import sys; assert abs(float(sys.argv[1]) - 998) < 0.1" "$(metadata rate_Hz <fast.csv)"
	run --separate-stderr tactus scan "$uri&stream=0" --channels 1 --mode dc --rate 998 --settle 1ms --count 1
	status_is 2
}

# ---- what a user does ---------------------------------------------------------------------------------------------

# Recordings at known loads, one emulated device each (or the bench itself), put together with the load beside.
calibration() { # sim|labjack FILE
	for load in 0 50 100 150 200 250; do
		if [ "$1" = sim ]; then
			tactus scan sim:labjack-t7 --protocol "hold ${load}N 1h" --count 3 >part-$load.csv
		else
			emulate labjack-t7 --protocol "hold ${load}N 1h" --speed 4
			tactus scan "$uri" --settle 3ms --count 3 --max-lost 100% >part-$load.csv
			end_emulator
		fi
	done
	"$PYTHON" - "$2" <<-'EOP'
		import csv, sys
		out, n = open(sys.argv[1], "w"), 0
		for load in (0, 50, 100, 150, 200, 250):
		    lines = open(f"part-{load}.csv").read().splitlines()
		    rows = list(csv.DictReader(l for l in lines if l[0] != "#"))
		    kept = [k for k in rows[0] if k not in ("force_N", "temperature_degC")]
		    if load == 0:
		        out.write("\n".join(l for l in lines if l[0] == "#") + "\n" + ",".join(kept) + ",force_N\n")
		    for r in rows:
		        r["time_s"], r["sequence"] = float(r["time_s"]) + 10 * load, int(r["sequence"]) + load
		        out.write(",".join(str(r[k]) for k in kept) + f",{load}\n")
	EOP
}

@test "labjack: scan, fit and force give the same newtons as on sim:" {
	calibration labjack labjack.csv
	calibration sim sim.csv
	for source in labjack sim; do
		tactus fit $source.csv --model conductance -o $source.toml -q
		tactus force -m $source.toml $source.csv >$source-force.csv
	done
	"$PYTHON" - <<-'EOP'
		import csv
		def forces(name):
		    rows = csv.DictReader(l for l in open(name) if l[0] != "#")
		    return {(r["sequence"], r["channel"], r["mode"]): (float(r["force_estimate_N"]), float(r["force_N"]))
		            for r in rows if r["force_estimate_N"]} # none where there is none without a load
		a, b = forces("labjack-force.csv"), forces("sim-force.csv")
		both = set(a) & set(b)
		assert len(both) > 100, len(both)
		# one step of 316 uV is 0.04 uS at 4.5 V over 1.8 kohm, and a sensor has 1.4 uS a newton
		for k in both:
		    assert abs(a[k][0] - b[k][0]) < 0.1, (k, a[k], b[k])
		assert sum((e - f) ** 2 for e, f in a.values()) / len(a) < 3 ** 2
	EOP
}

@test "labjack: a second emulated device is the reference, on one clock" {
	emulate labjack-t7 ati-net-ft --protocol "ramp 0N..250N 100s" --speed 20
	tactus scan "$uri" --reference "$other" --channels 1-2 --mode dc --settle 0.6ms --rate 50 --count 50 --max-lost 100% >run.csv
	for k in device reference_device device_delay_s; do [ -n "$(metadata $k <run.csv)" ] || fail "no $k"; done
	tactus fit run.csv --model conductance -o model.toml -q
	tactus show model.toml --json >model.json
	"$PYTHON" - <<-'EOP'
		import csv, json
		rows = [r for r in csv.DictReader(l for l in open("run.csv") if l[0] != "#") if r["force_N"]]
		assert len(rows) > 30, len(rows)
		# the bench's own sensitivity of 1.62 uS/N: repeatability and a few ms apart leave 5 %
		x = [(float(r["force_N"]), float(r["conductance_S"])) for r in rows if r["channel"] == "1"]
		mx, my = (sum(v) / len(x) for v in zip(*x))
		slope = sum((f - mx) * (g - my) for f, g in x) / sum((f - mx) ** 2 for f, _ in x)
		assert abs(slope / 1.62e-6 - 1) < 0.05, slope
	EOP
}

# ---- losses -------------------------------------------------------------------------------------------------------

@test "labjack: scans that the device lost are gaps, said and counted, and no reading is taken for another" {
	emulate labjack-t7 --protocol "hold 100N 1h" --lose 1% --seed 7
	run --separate-stderr tactus scan "$uri&stream=1" --raw --rate 20 --settle 3ms --count 20 -o lossy.csv
	status_is 5
	says "lost by the device: "
	says "scans were lost"
	[ "$(tactus show lossy.csv --json | jq .scans.lost)" -gt 0 ]
	[ "$(column sequence <lossy.csv | uniq -c | awk '{ print $1 }' | sort -u)" = 16 ]
	tactus scan sim:labjack-t7 --protocol "hold 100N 1h" --raw --rate 4 --count 20 >sim.csv
	# 3 ms instead of 12 are three time constants: the detectors are 5 % of a channel's volts behind
	alike lossy.csv sim.csv 0.1
}

@test "labjack: a device that went away is found again, with one header and the gap in sequence" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	mkfifo records
	tactus scan "$uri" --channels 1 --mode dc --rate 50 --settle 1ms --count 100000 --max-lost 100% >records 2>scan.err &
	scan=$!
	exec 8<records
	for _ in $(seq 45); do read -r line <&8; done
	end_emulator
	emulate labjack-t7 --protocol "hold 100N 1h" --listen "127.0.0.1:$port"
	while ! grep -q "found again" scan.err; do take 1; done
	take 20
	[[ $line == [0-9]* ]]
	kill -INT "$scan"
	cat <&8 >tail.csv
	wait "$scan" || [ $? -eq 130 ]
	! grep -q time_s tail.csv
}

@test "labjack: a stream that broke off goes on in the same file, where the clock is" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	end_emulator
	emulate labjack-t7 --protocol "hold 100N 1h" --listen "127.0.0.1:$port" # the stream's port follows from this one
	mkfifo records
	tactus scan "$uri&stream=1" --channels 1-2 --mode dc --rate 20 --settle 5ms --count 100000 --max-lost 100% >records 2>scan.err &
	scan=$!
	exec 8<records
	take 45
	end_emulator
	emulate labjack-t7 --protocol "hold 100N 1h" --listen "127.0.0.1:$port"
	while ! grep -q "found again" scan.err; do take 1; done
	take 20
	kill -INT "$scan"
	cat <&8 >>taken
	wait "$scan" || [ $? -eq 130 ]
	exec 8<&-
	mv taken run.csv
	[ "$(grep -c '^time_s' run.csv)" -eq 1 ]
	"$PYTHON" - <<-'EOP'
		import csv
		rows = list(csv.DictReader(l for l in open("run.csv") if l[0] != "#"))
		times, numbers = ([float(r[k]) for r in rows] for k in ("time_s", "sequence"))
		assert all(a < b for a, b in zip(times, times[1:])) and all(a <= b for a, b in zip(numbers, numbers[1:]))
		assert any(b > a + 1 for a, b in zip(numbers, numbers[1:])), "no gap"
		# a scan's number is its time: within the half period by which the device began anew beside the old ticks
		assert all(abs(t * 20 - n) < 1.5 for t, n in zip(times, numbers))
	EOP
}

@test "labjack: --no-reconnect ends with 5 when it goes away" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	mkfifo records
	tactus scan "$uri" --channels 1 --mode dc --rate 50 --settle 1ms --no-reconnect >records 2>scan.err &
	scan=$!
	exec 8<records
	for _ in $(seq 45); do read -r line <&8; done
	end_emulator
	cat <&8 >tail.csv
	status=0
	wait "$scan" || status=$?
	[ $status -eq 5 ]
}

# ---- safety -------------------------------------------------------------------------------------------------------

@test "labjack: interrupted in the middle of a scan it leaves DAC0 at 0 V and all switches open" {
	for mode in 0 1; do
		emulate labjack-t7 --protocol "hold 100N 1h"
		mkfifo records-$mode
		tactus scan "$uri&stream=$mode" --rate 4 --settle 1ms >records-$mode 2>scan.err &
		scan=$!
		exec 8<records-$mode
		for _ in $(seq 60); do read -r line <&8; done
		[ "$(registers 1000 1 4:float -B)" = 4.5 ]
		kill -INT "$scan"
		cat <&8 >tail.csv
		status=0
		wait "$scan" || status=$?
		[ $status -eq 130 ]
		[ "$(registers 1000 1 4:float -B)" = 0 ]
		[ "$(registers 2500 1 4)" = 255 ] # active low
		[ "$(registers 2600 1 4)" = 255 ] # and driven
		[ "$(registers 4990 1 4:int -B)" = 0 ]
		end_emulator
	done
}

@test "labjack: lines that are not in the wiring are left alone" {
	emulate labjack-t7 --protocol "hold 100N 1h"
	write 2015 4 0 # EIO7: an output, low
	tactus scan "$uri" --channels 1 --mode dc --rate 20 --settle 1ms --count 3 --max-lost 100% >/dev/null
	[ "$(registers 2015 1 4)" = 0 ]
	[ "$(registers 2601 1 4)" = 129 ] # EIO0 is ours, EIO7 was
}

@test "labjack: what it is not is refused" {
	emulate labjack-t7
	run --separate-stderr tactus scan "${uri/labjack-t7/labjack-t4}" --count 1
	status_is 4
	says "profile=labjack-t7"
	run --separate-stderr tactus scan "$uri&unit=1&colour=red" --count 1
	[ "$status" -ne 0 ]
	says "colour"
	end_emulator
	run --separate-stderr tactus scan "$uri&timeout=1s" --count 1
	status_is 4
	[ -z "$output" ]
	for args in "--drive 7V --mode dc" "--channels 9" "--rate 1e5" "--rate 1kHz --settle 1us"; do
		emulate labjack-t7
		run --separate-stderr tactus scan "$uri&stream=1" $args --count 1
		status_is 2
		[ "$(registers 2600 1 4)" = 0 ] || fail "$args: something was written"
		end_emulator
	done
}

# ---- programs that are not ours -----------------------------------------------------------------------------------

@test "emulate: mbpoll finds a LabJack" {
	command -v mbpoll >/dev/null || skip "MBPOLL IS NOT INSTALLED"
	emulate labjack-t7 --protocol "hold 100N 1h"
	[ "$(registers 55100 1 4:hex -B | tr 'a-f' 'A-F')" = 0x00112233 ] || [ "$(registers 55100 2 4:hex | tr -d '\n')" = 0x00110x2233 ]
	[ "$(registers 60000 1 4:float -B)" = 7 ]
	[ "$(registers 60028 1 4:int -B)" = 470012345 ]
	# a source at 4.5 V, all lines outputs, the first switch closed: AIN2 shows G·R·V of the first sensor
	write 1000 4:float 4.5
	write 2500 4 254
	write 2600 4 255
	write 2008 4 0
	registers 4 1 4:float -B >volts
	awk '{ exit !($1 > 1.2 && $1 < 1.4) }' volts
	write 2500 4 255
	registers 4 1 4:float -B >volts
	awk '{ exit !($1 > -0.001 && $1 < 0.001) }' volts
	# what there is not is refused, and the reason can be read
	run mbpoll -0 -m tcp -p "$port" -a 1 -1 -q -r 900 -c 1 -t 4 127.0.0.1
	[[ $output == *"llegal data address"* ]]
	run write 43900 4:float 5 # volts: no range of a T7
	[ "$(registers 55000 1 4)" = 2370 ]
}

@test "emulate: pymodbus reads, writes and is refused, with several clients at once" {
	"$PYTHON" -c "import pymodbus.client" 2>/dev/null || skip "PYMODBUS IS NOT INSTALLED"
	emulate labjack-t7 --protocol "hold 100N 1h" --speed 1000 # so that a request takes longer than the detectors do
	"$PYTHON" "$root/tests/peers/labjack_client.py" "$port"
}

@test "emulate: usage, what there is, how it ends" {
	run --separate-stderr tactus emulate
	status_is 2
	run --separate-stderr tactus emulate nosuch
	status_is 4
	says "labjack-t7"
	run --separate-stderr tactus emulate labjack-t7 --listen 127.0.0.1:x
	status_is 2
	run --separate-stderr tactus emulate labjack-t7 --speed 0
	status_is 2
	run --separate-stderr tactus emulate labjack-t7 --bench paredes
	status_is 2
	says "wiring"
	run --separate-stderr tactus emulate --list
	status_is 0
	prints labjack-t4
	emulate labjack-t7
	run --separate-stderr tactus emulate labjack-t7 --listen "127.0.0.1:$port"
	status_is 4
	end_emulator
	for signal in INT:130 TERM:143; do
		emulate labjack-t7
		kill "-${signal%:*}" "$emulator"
		status=0
		wait "$emulator" || status=$?
		[ "$status" -eq "${signal#*:}" ]
		exec 9<&-
		emulator=
	done
}

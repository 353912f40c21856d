#!/usr/bin/env bats
# Emulated devices beside the LabJack: the board over TCP and on a serial line, references.
load common

emulate() {
	exec 9< <(exec tactus emulate "$@" 2>emulator.err 3>&-)
	emulator=$!
	read -r uri <&9 || fail "$(cat emulator.err)"
}

teardown() {
	[ -z "${emulator:-}" ] || kill "$emulator" 2>/dev/null || true
	exec 9<&-
}

# The means of a detector's column of a channel, in two recordings: within so many volts.
near() { # A B COLUMN TOLERANCE
	"$PYTHON" - "$@" <<-'EOP'
		import csv, sys
		def means(name, column):
		    sums = {}
		    for r in csv.DictReader(l for l in open(name) if l[0] != "#"):
		        if r[column]:
		            sums.setdefault((r["channel"], r["mode"]), []).append(float(r[column]))
		    return {k: sum(v) / len(v) for k, v in sums.items()}
		a, b = means(sys.argv[1], sys.argv[3]), means(sys.argv[2], sys.argv[3])
		assert a.keys() == b.keys() and a, (a.keys(), b.keys())
		for k in a:
		    assert abs(a[k] - b[k]) < float(sys.argv[4]), (k, a[k], b[k])
	EOP
}

@test "emulate tactus-board: over TCP and on a serial line the board reads what the bench has" {
	tactus scan sim:tactus-board-bench --protocol "hold 100N 1h" --raw --count 3 >sim.csv
	for profile in tactus-board tactus-board-rtu; do
		emulate $profile --protocol "hold 100N 1h" --speed 4
		[[ $uri == modbus-*profile=tactus-board ]]
		tactus scan "$uri" --raw --settle 1ms --rate 10 --count 3 --max-lost 100% >board.csv
		# means of three readings with 40 uV of noise and steps of 38 uV, at another instant of a film at rest
		for column in detector_amplitude_V detector_phase_V detector_dc_V; do near board.csv sim.csv $column 300e-6; done
		kill "$emulator"
	done
}

@test "emulate: references follow the load, asked for and on their own" {
	for profile in ati-net-ft robotiq-ft300 robotiq-polled; do
		emulate "${profile/polled/ft300}" --protocol "hold 20N 1h"
		[ $profile != robotiq-polled ] || uri="$uri&stream=0"
		run --separate-stderr tactus scan "$uri" --count 20 -o $profile.csv
		status_is 0
		[[ $stderr != *"faults"* ]] || fail "$profile"
		[ "$(column force_N <$profile.csv | wc -l)" -eq 20 ]
		# 10 mN of noise and of resolution
		column force_N <$profile.csv | awk '{ if ($1 < 19.9 || $1 > 20.1) exit 1 }'
		[ "$(column fx_N <$profile.csv | sort -u)" = 0 ]
		# it may be left alone in the middle, and asked again
		tactus scan "$uri" --count 3 | column force_N >again
		[ "$(wc -l <again)" -eq 3 ]
		kill "$emulator"
	done
}

@test "emulate: noise on a serial line does not stop the board" {
	emulate tactus-board-rtu --protocol "hold 100N 1h"
	path=${uri#modbus-rtu:}
	head -c 300 /dev/urandom >"${path%%\?*}"
	tactus scan "$uri" --count 2 --max-lost 100% >board.csv
	[ "$(column sequence <board.csv | sort -u | wc -l)" -ge 1 ]
}

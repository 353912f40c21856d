#!/usr/bin/env bats
# Devices behind Modbus through the program: the board of tactus-devices(7), a link that is lost and found again, and a
# pymodbus server, whose Modbus is not ours.
load common
export peers=$root/tests/peers

teardown() {
	local pid
	for pid in "${started[@]}"; do kill -9 "$pid" 2>/dev/null || true; done
}
started=()

# Waits until a file has a line that matches, or its writer has died.
await() { # FILE PATTERN PID
	until grep -qE "$2" "$1" 2>/dev/null; do
		kill -0 "$3" 2>/dev/null || fail "it ended before it said $2: $(cat "$1")"
		sleep 0.02
	done
}

# The board over TCP; sets $port (the same again, if it has one) and $board.
start_board() {
	rm -f board.out
	"$PYTHON" "$root/tests/peers/modbus_device.py" tcp ${port:-} >board.out 2>board.err &
	board=$!
	started+=("$board")
	await board.out '^[0-9]+$' "$board"
	port=$(cat board.out)
	uri="modbus-tcp://127.0.0.1:$port?profile=tactus-board"
}

# The same on a pseudo-terminal, which $PWD/line names.
start_serial_board() {
	rm -f board.out
	"$PYTHON" "$root/tests/peers/modbus_device.py" rtu >board.out 2>board.err &
	board=$!
	started+=("$board")
	await board.out '^/dev/' "$board"
	ln -sf "$(cat board.out)" line
	uri="modbus-rtu:$PWD/line?profile=tactus-board"
}

# Every scan of the board says its own number: 64 times the temperature.
check_board() {
	"$PYTHON" - "$1" <<-'EOP'
		import csv, sys
		lines = [l for l in open(sys.argv[1]) if not l.startswith("#")]
		assert sum(l.startswith("time_s") for l in lines) == 1, "more than one header"
		last = (-1, 0)
		for r in csv.DictReader(lines):
		    sequence, count, time_s = int(r["sequence"]), round(64 * float(r["temperature_degC"])), float(r["time_s"])
		    assert sequence >= last[0] and time_s >= last[1], r
		    last = (sequence, time_s)
		    step, channel = (count % 256) / 1024, int(r["channel"])
		    if r["mode"] == "dc":
		        assert float(r["detector_dc_V"]) == 0.25 + step + channel / 16, r
		    else:
		        assert float(r["detector_amplitude_V"]) == 0.5 + step + channel / 16, r
		        assert float(r["detector_phase_V"]) == 4 - step - channel / 16, r
	EOP
}

# ---- the board -----------------------------------------------------------------------------------------------------

@test "modbus: the board is identified, told and read, over TCP and a serial line" {
	for start in start_board start_serial_board; do
		$start
		# a busy machine may come late to a scan of the board, which is then a gap
		run --separate-stderr tactus scan "$uri" --raw --count 5 --rate 20Hz --settle 100us --channels 3,1 --max-lost 80 -o $start.csv
		status_is 0
		[[ $(column channel <$start.csv | tr '\n' ' ') =~ ^("3 3 1 1 ")+$ ]]
		[ "$(metadata device_serial <$start.csv)" = 4711 ]
		[ "$(metadata rate_Hz <$start.csv)" = 20 ]
		[ -n "$(metadata device_delay_s <$start.csv)" ]
		check_board $start.csv
	done
}

@test "modbus: what it converts to is what convert makes of its volts" {
	start_board
	tactus scan "$uri" --raw --count 3 --rate 20Hz --settle 100us --max-lost 80 >raw.csv
	tactus convert raw.csv >converted.csv
	[ "$(column conductance_S <converted.csv | grep -c .)" -eq "$(column channel <raw.csv | wc -l)" ]
	tactus scan "$uri" --count 1 --rate 20Hz --settle 100us --mode dc --channels 2 >run.csv
	awk -v v="$(column amplitude_V <run.csv)" -v g="$(column conductance_S <run.csv)" 'BEGIN { exit !(g - v / 1000 < 1e-12 && v / 1000 - g < 1e-12) }'
}

@test "modbus: what cannot be is said before anything is opened or written" {
	start_board
	for case in "--channels 9|no channel 9" "--rate 2kHz|at most 1000" "--drive 6V|takes 0.001 to 5" "--rate 100Hz|too many" "--seed 3|seed"; do
		run --separate-stderr tactus scan "$uri" --count 1 ${case%|*}
		status_is 2
		says "${case#*|}"
		[ -z "$output" ]
	done
	for bad in "modbus-tcp://127.0.0.1:$port|profile=" "$uri&unit=300|unit" "$uri&colour=1|colour" "modbus-rtu:/dev/null?profile=tactus-board&baud=1234|baud"; do
		run --separate-stderr tactus scan "${bad%|*}" --count 1
		status_is 2
		says "${bad#*|}"
	done
	run --separate-stderr tactus scan "modbus-tcp://127.0.0.1:$port?profile=no-such" --count 1
	status_is 4
	kill -9 "$board"
	run --separate-stderr tactus scan "$uri" --count 1
	status_is 4
	says "127.0.0.1:$port"
	run --separate-stderr tactus scan "modbus-rtu:/dev/no-such-port?profile=tactus-board" --count 1
	status_is 4
	says /dev/no-such-port
}

@test "modbus: a profile that is wrong is said with its place" {
	start_board
	printf 'kind = "profile"\nbase = "tactus-board"\n[link]\nunits = 3\n' >bad.toml
	run --separate-stderr tactus scan "modbus-tcp://127.0.0.1:$port?profile=bad.toml" --count 1
	status_is 3
	says "bad.toml:4:1: "
}

@test "modbus: a signal stops cleanly and leaves the board safe" {
	start_board
	tactus scan "$uri" --raw --rate 50Hz --settle 100us -o run.csv 2>scan.err &
	scan=$!
	await run.csv '^[0-9.]+,5,' $scan
	kill -TERM $scan
	status=0
	wait $scan || status=$?
	[ "$status" -eq 143 ]
	check_board run.csv
	printf 'kind = "profile"\ndriver = "registers"\n[[register]]\naddress = 0\ncolumn = "control"\n' >control.toml
	[ "$(tactus scan "modbus-tcp://127.0.0.1:$port?profile=control.toml" --count 1 | column control)" = 0 ]
}

# ---- a lost link ---------------------------------------------------------------------------------------------------

@test "modbus: a board that dies in the middle of a scan is found again, in the same file, with a gap" {
	for start in start_board start_serial_board; do
		rm -f run.csv scan.err
		$start
		tactus scan "$uri" --raw --rate 50Hz --settle 100us -o run.csv 2>scan.err &
		scan=$!
		await run.csv '^[0-9.]+,5,' $scan
		kill -9 "$board"
		await scan.err 'looking for it' $scan
		before=$(column sequence <run.csv | tail -1)
		$start
		await scan.err 'found again' $scan
		lines=$(wc -l <run.csv)
		until [ "$(wc -l <run.csv)" -gt $((lines + 40)) ]; do
			kill -0 $scan || fail "$(cat scan.err)"
			sleep 0.02
		done
		kill -TERM $scan
		status=0
		wait $scan || status=$?
		[ "$status" -eq 143 ]
		[ "$(grep -c 'looking for it' scan.err)" -eq 1 ]
		check_board run.csv
		grep -q 'reconnected: 1' scan.err
		# the numbers went on counting while nobody was there
		column sequence <run.csv | awk -v before="$before" '$1 > before && !seen { seen = 1; gap = $1 - before } END { exit !(gap > 1) }'
		unset port
	done
}

@test "modbus: --no-reconnect ends with 5 and keeps what came; so does a time-out, without spinning" {
	for options in --no-reconnect "--reconnect-timeout 2s"; do
		unset port
		start_board
		rm -f run.csv
		# what all children of this shell have used, in hundredths of a second: the board's and the scan's
		"$PYTHON" - "$board" "$uri" $options >cpu <<-'EOP'
			import os, resource, signal, subprocess, sys
			board, uri, options = int(sys.argv[1]), sys.argv[2], sys.argv[3:]
			scan = subprocess.Popen(["tactus", "scan", uri, "--raw", "--rate", "50Hz", "--settle", "100us", "-o", "run.csv"] + options, stderr=open("scan.err", "w"))
			while not os.path.exists("run.csv") or sum(1 for l in open("run.csv")) < 60: pass
			os.kill(board, signal.SIGKILL)
			status = scan.wait()
			used = resource.getrusage(resource.RUSAGE_CHILDREN)
			print(status, used.ru_utime + used.ru_stime)
		EOP
		read -r status used <cpu
		[ "$status" -eq 5 ] || fail "status $status"
		[ "$(column sequence <run.csv | tail -1)" -ge 1 ]
		check_board run.csv
		# Two seconds of waiting at 5 % of a processor are 0.1 s, and it takes as much to begin.
		awk -v used="$used" 'BEGIN { exit !(used < 0.25) }' || fail "$used s of processor time"
	done
}

# ---- pymodbus ------------------------------------------------------------------------------------------------------

# A python that has pymodbus: a venv in the build folder, else the system's. Sets $pymodbus.
find_pymodbus() {
	local venv=${BUILD:-$root/build}/pymodbus-3.6.9
	if ! "$venv/bin/python" -c 'import pymodbus, serial' 2>/dev/null; then
		python3 -m venv "$venv" >/dev/null 2>&1 &&
			"$venv/bin/pip" install -q --disable-pip-version-check --timeout 5 --retries 1 pymodbus==3.6.9 pyserial==3.5 >/dev/null 2>&1 || true
	fi
	for pymodbus in "$venv/bin/python" "$PYTHON"; do
		if "$pymodbus" -c 'import pymodbus, serial' 2>/dev/null; then return 0; fi
	done
	skip "PYMODBUS COULD NOT BE HAD: OUR CLIENT IS NOT TRIED AGAINST IT"
}

plant_profile() { cp "$examples/profile-plant.toml" plant.toml; }

check_plant() {
	[ "$(column displacement_um <plant.csv | sort -u)" = 100.5 ]
	[ "$(column pressure_Pa <plant.csv | sort -u)" = 1002.5 ]
	[ "$(column pump <plant.csv | sort -u) $(column door <plant.csv | sort -u)" = "1 0" ]
	[ "$(metadata plant_model <plant.csv)" = 1005 ]
	[ "$(column sequence <plant.csv | tr '\n' ' ')" = "0 1 2 " ]
	grep -qx 'write 30 49024 0' server.out
	grep -qx 'write 39 7' server.out
	[ "$(tail -1 server.out)" = 'write 1 1' ]
}

@test "modbus: every kind of register against a pymodbus server over TCP" {
	find_pymodbus
	plant_profile
	port=$("$PYTHON" -c 'import socket; s = socket.create_server(("127.0.0.1", 0)); print(s.getsockname()[1])')
	"$pymodbus" "$root/tests/peers/pymodbus_server.py" tcp "$port" >server.out 2>server.err &
	started+=($!)
	await server.out ready $!
	until tactus scan "modbus-tcp://127.0.0.1:$port?profile=plant.toml" --count 3 -o plant.csv --overwrite 2>scan.err; do
		grep -q 'nothing listens there' scan.err || fail "$(cat scan.err)"
	done
	check_plant
	sed 's/1005/1006/' plant.toml >other.toml
	run --separate-stderr tactus scan "modbus-tcp://127.0.0.1:$port?profile=other.toml" --count 1
	status_is 4
	says "not 1006"
	printf '[[register]]\naddress = 4000\ncolumn = "nothing"\n' | cat plant.toml - >past.toml
	run --separate-stderr tactus scan "modbus-tcp://127.0.0.1:$port?profile=past.toml" --count 1
	status_is 4
	says "exception 2"
}

@test "modbus: every kind of register against a pymodbus server on a serial line" {
	find_pymodbus
	plant_profile
	"$PYTHON" - >lines <<-'EOP' &
		import os, select, sys
		sys.path.insert(0, os.environ["peers"])
		import modbus_device
		(a, path_a, keep_a), (b, path_b, keep_b) = modbus_device.open_line(), modbus_device.open_line()
		print(path_a, path_b, flush=True)
		while True:
		    for line in select.select([a, b], [], [])[0]:
		        os.write(b if line == a else a, os.read(line, 300))
	EOP
	started+=($!)
	await lines /dev/ $!
	read -r ours theirs <lines
	"$pymodbus" "$root/tests/peers/pymodbus_server.py" rtu "$theirs" >server.out 2>server.err &
	started+=($!)
	await server.out ready $!
	until tactus scan "modbus-rtu:$ours?profile=plant.toml&baud=115200&parity=none" --count 3 -o plant.csv --overwrite 2>scan.err; do
		grep -q 'did not answer\|lost' scan.err || fail "$(cat scan.err)"
	done
	check_plant
}

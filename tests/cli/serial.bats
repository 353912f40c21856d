#!/usr/bin/env bats
# `serial:`: the example sketch, compiled for this machine, on a pseudo-terminal; losing the board and finding it again.

load common

# Starts the sketch in the background; its port's name in $port, its process in $board.
plug() {
	mkfifo name.$BATS_TEST_NUMBER.$((++plugged))
	"$BATS_FILE_TMPDIR/board" >name.$BATS_TEST_NUMBER.$plugged 3>&- &
	board=$!
	read -r port <name.$BATS_TEST_NUMBER.$plugged
}

teardown() {
	[ -z "${board:-}" ] || kill "$board" 2>/dev/null || true
}

setup_file() {
	g++ -std=c++17 -include "$BATS_TEST_DIRNAME/arduino_host.hpp" -x c++ \
		"$BATS_TEST_DIRNAME/../examples/arduino-bench/arduino-bench.ino" -o "$BATS_FILE_TMPDIR/board" -lutil
}

@test "the example sketch is scanned as it stands: its header line says what it prints" {
	plug
	tactus scan "serial:$port" --count 200 -o run.csv
	[ "$(metadata device <run.csv)" = "$port" ]
	[ "$(column sequence <run.csv | wc -l)" -eq 400 ]
	[ "$(column channel <run.csv | sort -u | paste -sd,)" = 1,2 ]
	# counts of both inputs hang together as the host's sensors do: c2 - 10 = 1.5 (c1 - 10), both cut to whole counts
	paste -d' ' <(column channel <run.csv) <(column conductance_S <run.csv) | awk '
		$1 == 1 { first = $2 * 1023 / 5 * 10000 - 10 }
		$1 == 2 { second = $2 * 1023 / 5 * 10000 - 10; d = second - 1.5 * first; if (d < -1.01 || d > 1.51) exit 1; n++ }
		END { if (n != 200) exit 1 }'
}

@test "columns in the URI, a reference of its own, and a calibration from it" {
	plug
	tactus scan "serial:$port?columns=-,-,force_N/20,conductance_S@2/1e6" --count 300 -o run.csv
	tactus fit run.csv --model conductance -o model.toml >table.txt
	tactus force -m model.toml run.csv | column force_estimate_N >force.txt
	paste -d' ' force.txt <(column force_N <run.csv) | awk '{ d = $1 - $2; if (d < -0.1 || d > 0.1) exit 1 }'
}

@test "live newtons from the board" {
	plug
	tactus scan "serial:$port?columns=-,-,force_N/20,conductance_S@2/1e6" --count 300 -o run.csv
	tactus fit run.csv --model conductance -o model.toml >table.txt
	tactus scan "serial:$port?columns=-,-,-,conductance_S@2/1e6" --count 10 -m model.toml >live.csv
	[ "$(column force_estimate_N <live.csv | grep -c .)" -eq 10 ]
}

@test "a second board is the reference: its force stands beside every reading, on one clock" {
	export REAL_CLOCK=1 # fifty lines a second from each: what comes at once has no time between
	plug
	first=$port other=$board
	plug
	tactus scan "serial:$first?columns=-,-,-,conductance_S@2/1e6" --reference "serial:$port?columns=-,-,force_N/20,-" \
		--count 40 -o run.csv
	kill "$other"
	[ "$(metadata device <run.csv)" = "$first" ]
	[ "$(metadata reference_device <run.csv)" = "$port" ]
	for key in device_jitter_s reference_jitter_s reference_rate_Hz; do
		metadata $key <run.csv | awk '!($1 > 0) { exit 1 }'
	done
	[ "$(column force_N <run.csv | awk '/./ && $1 >= 0 && $1 < 20.6' | wc -l)" -eq 40 ]
	[ "$(column quality <run.csv | sort -u)" = ok ]
	run --separate-stderr tactus scan "serial:$port?columns=force_N,-"
	status_is 4 && says 'line of 2 numbers' && says 'the last one was "'
	run --separate-stderr tactus scan sim: --reference "serial:$port"
	status_is 1 && says 'does not run by the clock'
	run --separate-stderr tactus scan "serial:$port?columns=-,-,force_N/20,-" --reference "serial:/dev/no-such-port"
	status_is 4 && says /dev/no-such-port
}

@test "a board that is unplugged and comes back goes on in the same file" {
	plug
	ln -s "$port" tty
	tactus scan serial:tty --count 2000000 -o run.csv 2>log.txt 3>&- &
	scan=$!
	until grep -q '^[0-9].*,2,' run.csv 2>/dev/null; do read -rt 0.02 <> <(:) || true; done
	kill "$board"
	wait "$board" || true
	until grep -q 'looking for it' log.txt; do read -rt 0.02 <> <(:) || true; done
	plug
	ln -sfn "$port" tty
	until grep -q 'found again' log.txt; do read -rt 0.02 <> <(:) || true; done
	rows=$(wc -l <run.csv)
	until [ "$(wc -l <run.csv)" -gt "$rows" ]; do read -rt 0.02 <> <(:) || true; done
	kill -INT "$scan"
	status=0
	wait "$scan" || status=$?
	[ "$status" -eq 130 ]
	[ "$(grep -c '^time_s' run.csv)" -eq 1 ]
	[ "$(grep -c 'looking for it' log.txt)" -eq 1 ]
	grep -q 'reconnected: 1' log.txt
	# numbers and time go on, with one gap or more
	column sequence <run.csv | uniq | awk 'NR > 1 && $1 <= last { exit 1 } NR > 1 && $1 > last + 1 { gap++ } { last = $1 } END { exit !gap }'
	column time_s <run.csv | sort -gc
}

@test "with --no-reconnect the status is 5 and what came is kept" {
	plug
	tactus scan "serial:$port" --no-reconnect -o run.csv 2>log.txt 3>&- &
	scan=$!
	until grep -q '^[0-9].*,2,' run.csv 2>/dev/null; do read -rt 0.02 <> <(:) || true; done
	kill "$board"
	status=0
	wait "$scan" || status=$?
	[ "$status" -eq 5 ]
	[ "$(column sequence <run.csv | wc -l)" -gt 1 ]
	grep -q 'lost' log.txt
}

@test "a port that is not there, options that are wrong, settings that the board does not have" {
	run --separate-stderr tactus scan serial:/dev/no-such-port
	status_is 4 && says /dev/no-such-port
	run --separate-stderr tactus scan "serial:/dev/null?colour=red"
	status_is 2 && says colour
	run --separate-stderr tactus scan "serial:/dev/null?columns=a*x"
	status_is 2 && says 'a*x'
	plug
	run --separate-stderr tactus scan "serial:$port" --rate 10Hz
	status_is 2 && says 'rate'
	run --separate-stderr tactus scan "serial:$port" --raw
	status_is 1 && says 'detector volts'
	[ -z "$output" ]
}

@test "a person at a real bench is told what to apply" {
	plug
	run --separate-stderr tactus scan "serial:$port" --protocol 'hold 5N 100ms' --max-lost 100
	status_is 0 && says 'apply 5 N'
	prints '# protocol: hold 5N 100ms'
	run --separate-stderr tactus scan "serial:$port" --protocol $'hold 5N 50ms,\nrest 50ms' --max-lost 100
	status_is 0 && prints '# protocol: hold 5N 50ms, rest 50ms'
	run --separate-stderr tactus scan "serial:$port" --protocol 'hold 5' --max-lost 100
	status_is 2
}

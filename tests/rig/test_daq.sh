#!/bin/sh
# The real program scans a virtual MCC USB-1608FS-Plus with eight switched sensors, on the kernel's USB stack.
# shellcheck source=tests/rig/suite.sh disable=SC2016,SC2317 # the dollars in single quotes are awk's; run_tests calls them
. /rig/suite.sh

URI=usb:09db:00ea

# Switches open, no scan runs, and nobody asked for the firmware to be erased.
is_safe() {
	usb_is latch=255 tristate=0 running=0 erase=0
}

# The resistances behind the switches, by channel.
resistances='BEGIN { split("2000 4700 10000 22000 47000 100000 220000 470000", ohm, " ") }'
# A step of the converter at ±5 V, and what it is at 5 V·1800 Ω/(R + 78 Ω), as a share; twice that is let through.
share='{ c = $at["channel"]; allowed = 2 * 5 / 32768 / (9000 / (ohm[c] + 78)) }'

test_devices_lists_it_by_uri_with_its_serial() {
	exits 0 tactus devices
	grep '^usb:09db:00ea:01A2B3C4 .*USB-1608FS-Plus' out
}

test_a_serial_that_is_not_there_is_status_4() {
	exits 4 tactus scan $URI:FFFFFFFF --count 1
	[ ! -s out ]
}

test_resistances_through_the_switches_in_dc() {
	exits 0 tactus scan $URI --mode dc --rate 2 --count 3 --max-lost 100% -o dc.csv
	exits 0 tactus convert dc.csv
	[ "$(count_rows out)" -ge 8 ]
	rows out "$resistances $share"'
		{ error = $at["resistance_ohm"] / ohm[c] - 1; seen[c]++ }
		error > allowed || error < -allowed { print c, $at["resistance_ohm"]; bad = 1 }
		END { for (c = 1; c <= 8; c++) if (!seen[c]) bad = 1; exit bad }' || { cat out; return 1; }
	is_safe
}

test_amplitudes_in_ac_are_means_of_bursts() {
	exits 0 tactus scan "$URI?samples=50" --mode ac --channels 1-3 --rate 2 --count 3 --max-lost 100%
	rows out "$resistances"'{ c = $at["channel"]; seen[c]++; error = $at["amplitude_V"] - 5400 / (ohm[c] + 78) }
		error > 3e-4 || error < -3e-4 { print c, $at["amplitude_V"]; bad = 1 }
		END { exit bad || !seen[1] || !seen[2] || !seen[3] }' || { cat out; return 1; }
	is_safe
}

test_a_waveform_stream_without_end() {
	exits 0 tactus scan "$URI?stream=2kHz" --mode dc --channels 2 --rate 10 --count 20 --max-lost 100%
	rows out "$resistances"'{ n++; error = $at["amplitude_V"] - 9000 / 4778 } error > 3e-4 || error < -3e-4 { bad = 1 }
		END { exit bad || n < 5 }' || { cat out; return 1; }
	is_safe
}

test_unplugged_in_the_middle_and_found_again() {
	tactus scan $URI --mode dc --channels 1,2 --rate 4 --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 6
	usb unplug
	sleep 1
	usb plug
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 4))
	interrupt $pid
	[ "$(grep -c '^time_s,' run.csv)" -eq 1 ]
	rows run.csv '{ s = $at["sequence"] } s < last { bad = 1 } s > last + 4 && last { gap = 1 } { last = s }
		END { exit bad || !gap }' || { cat run.csv; return 1; }
	is_safe
}

test_a_stream_unplugged_in_the_middle_goes_on() {
	tactus scan "$URI?stream=2kHz" --mode dc --channels 1 --rate 10 --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 6
	usb unplug
	sleep 1
	usb plug
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 4))
	interrupt $pid
	[ "$(grep -c '^time_s,' run.csv)" -eq 1 ]
	rows run.csv '{ s = $at["sequence"] } s <= last && n++ { bad = 1 } { last = s } END { exit bad }'
	is_safe
}

test_another_one_at_the_port_is_not_taken_for_it() {
	tactus scan $URI:01A2B3C4 --mode dc --channels 1 --rate 4 --reconnect-timeout 2s -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 2
	usb unplug
	usb serial 0BADCAFE
	usb plug
	status=0
	wait $pid || status=$?
	usb unplug
	usb serial 01A2B3C4
	usb plug
	cat err
	[ $status -eq 5 ]
	await tactus scan $URI --mode dc --channels 1 --count 1
}

test_an_overrun_is_a_gap_and_the_stream_goes_on() {
	tactus scan "$URI?stream=2kHz" --mode dc --channels 1 --rate 10 --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 5
	usb overrun
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 5))
	interrupt $pid
	grep 'lost by the device' err
	is_safe
}

test_requests_that_stall_or_time_out_are_counted_and_survived() {
	tactus scan $URI --mode dc --channels 1 --rate 4 --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 3
	usb refuse 2
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 2))
	usb ignore 1
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 2))
	interrupt $pid
	grep 'faults' err
	rows run.csv "$resistances"'{ error = $at["amplitude_V"] - 9000 / 2078 } error > 4e-4 || error < -4e-4 { bad = 1 }
		END { exit bad }' || { cat run.csv; return 1; }
	is_safe
}

test_a_signal_leaves_the_switches_open() {
	for signal in INT TERM; do
		tactus scan $URI --mode dc -o run-$signal.csv 2>err &
		pid=$!
		await has_rows run-$signal.csv 3
		kill -$signal $pid
		status=0
		wait $pid || status=$?
		cat err
		[ $status -ge 128 ]
		is_safe
	done
}

test_a_closed_pipe_leaves_the_switches_open() {
	tactus scan $URI --mode dc | head -n 30 >out
	is_safe
}

test_settings_out_of_range_are_refused_before_anything_is_written() {
	before=$(usb state | grep -o 'latch=[0-9]* tristate=[0-9]*')
	status=0
	tactus scan $URI --mode dc --rate 1e6 --count 1 >out 2>err || status=$?
	cat err
	[ $status -ne 0 ]
	[ ! -s out ]
	[ "$(usb state | grep -o 'latch=[0-9]* tristate=[0-9]*')" = "$before" ]
}

test_a_scale_as_reference_beside_the_scan() {
	hid scale weight 1000
	exits 0 tactus scan $URI --mode dc --channels 1 --rate 4 --count 8 --max-lost 100% --reference hid:scale
	rows out '$at["force_N"] == "9.80665" { n++ } END { exit n < 2 }' || { cat out; return 1; }
	is_safe
}

run_tests "$0" "$@"

#!/bin/sh
# The real program scans a virtual USB scale on the kernel's HID stack.
# shellcheck source=tests/rig/suite.sh disable=SC2016,SC2317 # the dollars in single quotes are awk's; run_tests calls them
. /rig/suite.sh

# ---- listing and selecting ----

test_devices_lists_them_by_uri_with_serials() {
	exits 0 tactus devices
	grep '^hid:0922:8003:0012345678 .*scale' out
	grep '^hid:1209:ffb0:3500440031500420 .*OpenFFBoard' out
}

test_a_serial_that_is_not_there_is_status_4() {
	exits 4 tactus scan hid:0922:8003:999 --count 1
	[ ! -s out ]
}

# ---- the scale ----

test_a_scale_weighs_in_newtons_and_its_stale_report_is_dropped() {
	hid scale weight 250
	exits 0 tactus scan hid:scale --count 5
	hid scale weight 1000
	exits 0 tactus scan hid:scale --count 6
	rows out '$at["quality"] == "ok" { ok++; if ($at["force_N"] != "9.80665") bad++ }
		$at["force_N"] == "2.4516625" { bad++ }
		END { exit !(ok >= 3 && bad == 0) }'
}

test_units_signs_and_overload_of_a_scale() {
	hid scale weight 453.59237
	hid scale unit lb
	exits 0 tactus scan hid:scale --count 5
	rows out 'END { exit !($at["force_N"] > 4.44 && $at["force_N"] < 4.46) }'
	hid scale unit g
	hid scale weight -100
	exits 0 tactus scan hid:scale --count 5
	rows out 'END { exit !($at["force_N"] < -0.98 && $at["force_N"] > -0.981 && $at["quality"] != "ok") }'
	hid scale weight 5000
	exits 0 tactus scan hid:scale --count 5
	rows out 'END { exit !($at["quality"] ~ /clipped/) }'
}

test_a_scale_that_sends_changes_alone_is_asked() {
	hid scale weight 500
	exits 0 tactus scan hid:scale --count 5
	hid scale quiet 1
	exits 0 tactus scan hid:scale --count 2 --timeout 0.5s
	hid scale quiet 0
	rows out 'END { exit !($at["force_N"] > 4.903 && $at["force_N"] < 4.904) }'
}

test_an_unplugged_scale_is_found_again_in_the_same_file() {
	hid scale weight 1000
	tactus scan hid:scale --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 3
	hid scale unplug
	before=$(cut -d' ' -f14,15 /proc/$pid/stat)
	sleep 2
	after=$(cut -d' ' -f14,15 /proc/$pid/stat)
	hid scale plug
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 3))
	interrupt $pid
	[ "$(grep -c '^time_s,' run.csv)" -eq 1 ]
	rows run.csv '$at["sequence"] <= last && n++ { bad = 1 } { last = $at["sequence"]; t = $at["time_s"] }
		t - before > 1 && before { gap = 1 } { before = t } END { exit !(gap && !bad) }'
	[ "$(wc -l <err)" -le 4 ] # gone, found again, faults, lost scans
	# One that spins would have all 200; emulation and a busy host make a few percent some ten.
	echo "$before $after" | awk '{ used = $3 + $4 - $1 - $2; print used " of 200 ticks"; exit used > 80 }'
}

test_no_reconnect_ends_with_status_5() {
	tactus scan hid:scale --no-reconnect -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 2
	hid scale unplug
	ends_with $pid 5
	hid scale plug
}

test_a_signal_ends_a_scan_with_a_whole_file() {
	tactus scan hid:scale -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 2
	interrupt $pid
	[ "$(tail -c 1 run.csv | od -An -tx1 | tr -d ' ')" = 0a ]
}

run_tests "$0" "$@"

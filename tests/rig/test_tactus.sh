#!/bin/sh
# The real program against the virtual devices, on the kernel's USB and HID stacks. TAP on standard output.
# shellcheck disable=SC2016  # the dollars in single quotes are awk's
# Every function called test_… below is one test: it runs in its own folder and shell, and fails where a command fails.

hid() { virtual_hid tell "$@"; }
usb() { virtual_usb tell "$@"; }

# Waits until a command succeeds, at most 15 s.
await() {
	n=0
	until "$@"; do
		n=$((n + 1))
		[ $n -lt 150 ] || { echo "in vain: $*"; return 1; }
		usleep 100000
	done
}

# exits STATUS COMMAND…: the command ends with that status; its output is in the files out and err.
exits() {
	wanted=$1
	shift
	status=0
	timeout 60 "$@" >out 2>err || status=$?
	[ $status -eq "$wanted" ] || { echo "status $status: $*"; cat err; return 1; }
}

# The rows of a recording, without comments and header; its columns by name as awk's variables.
rows() { # FILE AWK-PROGRAM
	awk -F, "/^#/ { next } !seen++ { for (i = 1; i <= NF; i++) at[\$i] = i; next } $2" "$1"
}
count_rows() { rows "$1" '{ n++ } END { print n + 0 }'; }
has_rows() { [ -s "$1" ] && [ "$(count_rows "$1")" -ge "$2" ]; }

# Waits for the program in the background, whose standard error is in the file err.
ends_with() { # STATUS
	status=0
	wait "$pid" || status=$?
	cat err
	[ $status -eq "$1" ] || { echo "status $status, not $1"; return 1; }
}

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
	tactus scan hid:scale --duration 10s --max-lost 100% -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 3
	hid scale unplug
	before=$(cut -d' ' -f14,15 /proc/$pid/stat)
	sleep 2
	after=$(cut -d' ' -f14,15 /proc/$pid/stat)
	hid scale plug
	known=$(count_rows run.csv)
	await has_rows run.csv $((known + 3))
	ends_with 0
	[ "$(grep -c '^time_s,' run.csv)" -eq 1 ]
	rows run.csv '$at["sequence"] <= last && n++ { bad = 1 } { last = $at["sequence"]; t = $at["time_s"] }
		t - before > 1 && before { gap = 1 } { before = t } END { exit !(gap && !bad) }'
	[ "$(wc -l <err)" -le 3 ]
	echo "$before $after" | awk '{ used = $3 + $4 - $1 - $2; print used " of 200 ticks"; exit used > 10 }'
}

test_no_reconnect_ends_with_status_5() {
	tactus scan hid:scale --no-reconnect -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 2
	hid scale unplug
	ends_with 5
	hid scale plug
}

test_a_signal_ends_a_scan_with_a_whole_file() {
	tactus scan hid:scale -o run.csv 2>err &
	pid=$!
	await has_rows run.csv 2
	kill -INT "$pid"
	ends_with 130
	[ "$(tail -c 1 run.csv | od -An -tx1 | tr -d ' ')" = 0a ]
}

# ---- permissions, with the udev that is in the machine ----

test_a_permission_problem_prints_a_remedy_that_helps() {
	exits 4 su user -c 'tactus scan hid:scale --count 1'
	cat err
	sed -n 's/.*load them: //p' err | sed 's/sudo //g' >remedy
	grep '^cp /' remedy
	mkdir -p /etc/udev/rules.d
	sh -e remedy
	udevadm settle --timeout=20
	exits 0 su user -c 'tactus scan hid:scale --count 1'
}

# ---- running them ----

tests=$(sed -n 's/^\(test_[a-z0-9_]*\)() {$/\1/p' "$0")
[ $# -eq 0 ] || tests=$*
echo "1..$(echo "$tests" | wc -w)"
number=0
for t in $tests; do
	number=$((number + 1))
	mkdir -p "/tmp/$t"
	chmod 777 "/tmp/$t"
	cd "/tmp/$t" || exit 1
	(
		set -e
		"$t"
	) >log 2>&1
	status=$?
	if [ $status -eq 0 ]; then
		echo "ok $number - ${t#test_}"
	else
		echo "not ok $number - ${t#test_}"
		sed 's/^/# /' log
		echo "# status $status"
	fi
done

#!/bin/sh
# What the suites in shell share; each reads it first and calls run_tests last. Every function called test_… is one test:
# it runs in a shell and folder of its own, and fails where a command fails. TAP on standard output.

hid() { virtual_hid tell "$@"; }
usb() { virtual_usb tell "$@"; }

# What a device says of itself has all these words.
holds() { # STATE NAME=VALUE…
	state=" $1 "
	shift
	for word; do
		case $state in
		*" $word "*) ;;
		*) echo "not $word:$state" && return 1 ;;
		esac
	done
}
motor_is() { holds "$(hid motor state)" "$@"; }
usb_is() { holds "$(usb state)" "$@"; }

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
ends_with() { # PID STATUS
	status=0
	wait "$1" || status=$?
	cat err
	[ $status -eq "$2" ] || { echo "status $status, not $2"; return 1; }
}

# Ends a scan in the background as a user does.
interrupt() { # PID
	kill -INT "$1"
	ends_with "$1" 130
}

run_tests() { # SUITE [TEST…]
	tests=$(sed -n 's/^\(test_[a-z0-9_]*\)() {$/\1/p' "$1")
	shift
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
}

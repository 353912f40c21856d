#!/bin/sh
# What a user without permission meets, and that the printed remedy helps, with a real udev.
# shellcheck source=tests/rig/suite.sh disable=SC2317 # run_tests calls the functions
. /rig/suite.sh

scale='tactus scan hid:scale --count 1'
daq='tactus scan usb:09db:00ea --mode dc --channels 1 --count 1'

test_devices_says_what_may_not_be_opened() {
	exits 0 su user -c 'tactus devices'
	grep '^hid:0922:8003.*no permission' out
	grep '^usb:09db:00ea.*no permission' out
}

test_the_printed_remedy_helps() {
	exits 4 su user -c "$daq"
	grep '60-tactus.rules' err
	exits 4 su user -c "$scale"
	cat err
	sed -n 's/.*load them: //p' err | sed 's/sudo //g' >remedy
	grep '^cp /' remedy
	mkdir -p /etc/udev/rules.d
	sh -e remedy
	udevadm settle --timeout=20
	exits 0 su user -c "$scale"
	exits 0 su user -c "$daq"
}

test_rules_hold_for_what_is_plugged_in_later() {
	hid scale unplug
	usb unplug
	hid scale plug
	usb plug
	await su user -c "$scale" >out 2>err
	await su user -c "$daq" >out 2>err
}

run_tests "$0" "$@"

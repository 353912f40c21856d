#!/bin/sh
# Programs with a motor loop, by the library's drive interface, against a virtual OpenFFBoard on the kernel's HID stack:
# the torque is zero whichever way they end.
# shellcheck source=tests/rig/suite.sh disable=SC2317 # run_tests calls the functions
. /rig/suite.sh

value_of() { hid motor state | tr ' ' '\n' | sed -n "s/^$1=//p"; }

# No torque is commanded, nor was when the program left; nothing plays, the actuators are off, the idle spring too. What
# is left is the board's own damper, which brakes until the axis stands.
is_off() {
	motor_is commanded=0 commanded_at_close=0 active=0 playing=0 spring=0 && await motor_is torque=0
}

test_positive_torque_turns_it_up_and_stop_ends_it() {
	hid motor factory
	hid motor peak 0
	exits 0 turn_motor stop 0.25 400
	cat out
	grep '^position_rad=[0-9]*\.[0-9]*[1-9]' out
	[ "$(value_of peak)" -gt 900 ] # 0.25 of 32767, times 0.8 (effects) and 5000/32767 (power): 1000
	[ "$(value_of peak)" -le 1000 ]
	is_off
	motor_is damper=30 power=5000 # as they were
}

test_negative_torque_turns_it_down() {
	hid motor factory
	exits 0 turn_motor stop -0.25 400
	cat out
	grep '^position_rad=-' out
	is_off
}

# What the library says of the position is what the motor did, in both builds of the firmware.
positions_agree() {
	hid motor factory
	exits 0 turn_motor stop 0.25 600
	cat out
	hid motor state
	grep '^position_rad=' out | tr '= ' '  ' | awk -v turns="$(value_of position)" '{ n++; turned = $2 }
		END { exit !(n == 1 && turned > 0.5 && turned < turns * 2 * 3.14159265 * 1.001) }'
}

test_positions_of_16_bits() {
	positions_agree
}

test_positions_of_32_bits() {
	hid motor wide 1
	hid motor unplug
	hid motor plug
	await turn_motor stop 0 20
	positions_agree
	hid motor wide 0
	hid motor unplug
	hid motor plug
	await turn_motor stop 0 20
}

test_the_limit_holds() {
	hid motor factory
	hid motor peak 0
	exits 0 turn_motor stop 1 200
	grep 'torque_Nm=0.5.* limited=1' out
	[ "$(value_of peak)" -le 2000 ]
	is_off
}

test_close_without_stop_ends_it() {
	hid motor factory
	exits 0 turn_motor close 0.25 200
	is_off
}

test_a_torque_that_is_no_number_ends_it() {
	hid motor factory
	status=0
	turn_motor nan 0.25 200 2>err || status=$?
	cat err
	grep 'motor is off' err
	[ $status -ne 0 ]
	is_off
}

ended_by() { # SIGNAL
	hid motor factory
	turn_motor stop 0.25 20000 >out 2>err &
	pid=$!
	await motor_is playing=1
	kill "-$1" $pid
	ends_with $pid 0
	grep 'caught=[1-9]' out
	is_off
}
test_sigint_ends_it() {
	ended_by INT
}

test_sigterm_ends_it() {
	ended_by TERM
}

# Nothing of the program is left to end it: the board's watchdog does, within its 0.2 s.
test_sigkill_leaves_it_to_the_watchdog() {
	hid motor factory
	turn_motor stop 0.25 20000 >out 2>err &
	pid=$!
	await motor_is playing=1
	kill -KILL $pid
	wait $pid || true
	await motor_is playing=0
	motor_is commanded=0 spring=0
	exits 0 turn_motor stop 0.25 50 # and the next program finds it in order
	is_off
}

test_a_program_that_forgets_to_stop_leaves_it_to_the_watchdog() {
	hid motor factory
	exits 0 turn_motor forget 0.25 200
	await motor_is playing=0
	motor_is commanded=0
	exits 0 turn_motor stop 0 50
	is_off
}

test_an_unplugged_motor_is_lost_and_comes_back_still() {
	hid motor factory
	turn_motor stop 0.25 20000 >out 2>err &
	pid=$!
	await motor_is playing=1
	hid motor unplug
	status=0
	wait $pid || status=$?
	cat err
	[ $status -ne 0 ]
	hid motor plug
	await turn_motor stop 0.25 50
	is_off
}

# It goes on hearing but says nothing any more: the torque is taken away.
test_a_motor_that_falls_silent_is_switched_off() {
	hid motor factory
	turn_motor stop 0.25 20000 >out 2>err &
	pid=$!
	await motor_is playing=1
	hid motor mute 1
	status=0
	wait $pid || status=$?
	hid motor mute 0
	cat err
	grep 'no position' err
	[ $status -ne 0 ]
	motor_is commanded=0 active=0
}

test_an_emergency_stop_refuses_the_start() {
	hid motor factory
	hid motor estop 1
	status=0
	turn_motor stop 0.25 50 2>err || status=$?
	hid motor estop 0
	cat err
	grep 'emergency stop' err
	[ $status -ne 0 ]
	motor_is active=0
}

test_a_command_without_an_answer_times_out() {
	hid motor factory
	hid motor ignore 1
	status=0
	turn_motor stop 0.25 50 2>err || status=$?
	cat err
	grep 'does not answer' err
	[ $status -ne 0 ]
	motor_is active=0
}

test_a_scan_of_a_drive_is_refused() {
	status=0
	tactus scan hid:1209:ffb0 --count 1 2>err || status=$?
	cat err
	[ $status -ne 0 ]
	grep 'motor drive' err
}

run_tests "$0" "$@"

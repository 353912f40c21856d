# What all tests of the command line share. run-tests puts the build folder's `tactus` first on PATH.

bats_require_minimum_version 1.5.0

root=$(cd "$BATS_TEST_DIRNAME/../.." && pwd)
examples=$root/tests/examples
data=$root/../shared/data

setup() {
	cd "$BATS_TEST_TMPDIR" || return
	PYTHON=${PYTHON:-python3}
}

# Every command of the program, from its own help.
commands() { tactus --help | sed -n '/^Commands:/,/^$/s/^  \([a-z][a-z]*\) .*/\1/p'; }

# What a command needs besides a recording so that it would run.
needs() {
	case $1 in
	force | simulate) echo "-m $examples/model-forward.toml" ;;
	convert) echo "--gain-resistor 1000" ;;
	esac
}

# A small recording on standard output that every command can read: two channels, `scans` scans at 10 Hz, the force up
# and down, G = 1.2e-6 S + 4.1e-7 S/N F (more in channel 2), and the DC volts of that G at -5 V over 1 kohm.
recording() {
	awk -v scans="${1:-40}" 'BEGIN {
		print "time_s,sequence,channel,force_N,conductance_S,drive_V,temperature_degC,amplitude_V"
		for (i = 0; i < scans; i++)
			for (c = 1; c <= 2; c++) {
				f = 20 * (i % 20 < 10 ? i % 10 : 10 - i % 10)
				g = 1.2e-6 + 4.1e-7 * f * (0.9 + c / 10)
				printf "%.10g,%d,%d,%.10g,%.10g,-5,25,%.10g\n", i / 10, i, c, f, g, 5000 * g
			}
	}'
}

# Asserts; `run --separate-stderr` came before.
status_is() {
	[ "$status" -eq "$1" ] || fail "status $status instead of $1"
}
says() {
	[[ $stderr == *"$1"* ]] || fail "standard error does not say: $1"
}
prints() {
	[[ $output == *"$1"* ]] || fail "standard output does not have: $1"
}
fail() {
	printf '%s\n' "$1" "--- standard output:" "${output:0:2000}" "--- standard error:" "${stderr:0:2000}" >&2
	return 1
}

# The value of a metadata key, and a column by its name, of a CSV recording on standard input.
metadata() { sed -n "s/^# $1: //p"; }
column() {
	awk -F, -v name="$1" '/^#/ { next } !at { for (i = 1; i <= NF; i++) if ($i == name) at = i; if (!at) exit 1; next } { print $at }'
}

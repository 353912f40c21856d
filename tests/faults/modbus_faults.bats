#!/usr/bin/env bats
# Modbus through a proxy that spoils answers with a seed. SCANS says how many scans each fault is given (`make faults`: 1000).
load ../cli/common

faults() { "$PYTHON" "$root/tests/faults/modbus_faults.py" "${SCANS:-100}" "${SEED:-1}" "$@"; }

@test "faults over TCP: late, lost, cut, doubled, reordered answers, wrong headers, lengths and units give no wrong reading" {
	faults tcp
}

@test "faults on a serial line: late, lost, cut, doubled, reordered answers, bursts of bits and wrong units give no wrong reading" {
	faults rtu
}
